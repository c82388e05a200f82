//! Values of the published planner (its binary, version 0.4.0) that a corrected planner must still reproduce.
//!
//! Its reference path is a circle of radius 50 m with vertices 1 m apart. Tolerances: its points lie on the chords, up to
//! 2.5 mm inside the circle; its path headings are those of the segment ahead, 0.01 rad too large here; it takes the
//! slope d' for the tangent of the heading offset D instead of d'/K.

use crate::geometry::Point;
use crate::geometry::polyline::PathPoint;
use crate::plan::frame::{FrenetPoint, Waypoint};
use crate::plan::polynomial::Polynomial;

const RADIUS: f64 = 50.0;
const HEADING_BIAS: f64 = 0.01;

fn circle(s: f64) -> PathPoint {
    let theta = s / RADIUS;
    let (sin, cos) = theta.sin_cos();
    let position = Point::new(RADIUS * sin, RADIUS * (1.0 - cos));
    PathPoint { position, theta, cos, sin, curvature: 1.0 / RADIUS, curvature_rate: 0.0 }
}

struct Case {
    s: Polynomial,
    d: Polynomial,
    end_time: f64,
    end_velocity: f64,
    over_arc: bool,
}

impl Case {
    fn new(s: [f64; 3], d: [f64; 3], (end_time, end_velocity, end_offset): (f64, f64, f64), over_arc: bool) -> Self {
        let s = Polynomial::to_slope(s, end_velocity, end_time);
        let length = if over_arc { s.at(end_time)[0] - s.at(0.0)[0] } else { end_time };
        Self { s, d: Polynomial::to_rest(d, end_offset, length), end_time, end_velocity, over_arc }
    }

    /// Rear axle at point `i`; footprint centre and rear axle coincide.
    fn point(&self, i: usize) -> Waypoint {
        let t = i as f64 * 0.1;
        let within = t.min(self.end_time);
        let [mut s, s_dot, s_ddot, _] = self.s.at(within);
        s += (t - within) * self.end_velocity;
        let along = if self.over_arc { s - self.s.at(0.0)[0] } else { within };
        let [d, d_1, d_2, _] = self.d.at(along);
        let (d_prime, d_prime2) =
            if self.over_arc { (d_1, d_2) } else { (d_1 / s_dot, (d_2 - d_1 / s_dot * s_ddot) / (s_dot * s_dot)) };
        Waypoint::new(&circle(s), &FrenetPoint { s_dot, s_ddot, d, d_prime, d_prime2 }, 0.0).expect("beside the circle")
    }

    fn velocity_cost(&self, desired: f64) -> f64 {
        (0..=30).map(|i| (self.point(i).velocity - desired).powi(2)).sum::<f64>().sqrt()
    }

    fn reference_cost(&self) -> f64 {
        (16..=30).map(|i| self.point(i).d.powi(2)).sum::<f64>().sqrt()
    }
}

fn a() -> Case {
    Case::new([20.0, 10.0, 0.4], [0.5, 0.1, 0.05], (2.0, 8.0, 1.25), false)
}

fn b() -> Case {
    Case::new([20.0, 10.0, 0.4], [0.5, 0.1, 0.05], (1.4, 12.0, -0.75), false)
}

fn c() -> Case {
    Case::new([20.0, 1.5, 0.2], [0.3, 0.02, 0.01], (3.0, 3.0, 0.75), true)
}

#[test]
fn positions_headings_and_speeds_are_those_of_the_published_planner() {
    for (case, i, x, y, theta, velocity) in [
        (a(), 5, 23.65824, 6.65336, 0.553703, 9.68845),
        (a(), 12, 28.84945, 10.44031, 0.707415, 8.61843),
        (a(), 30, 38.86357, 20.57084, 0.932676, 7.80000),
        (b(), 12, 31.15465, 9.97760, 0.636170, 12.07777),
        (c(), 12, 21.21929, 5.18165, 0.544471, 2.10597),
    ] {
        let point = case.point(i);
        assert!(point.center.distance(Point::new(x, y)) < 4e-3, "{point:?}");
        assert!((point.theta() - (theta - HEADING_BIAS)).abs() < 4e-3, "{} for {theta}", point.theta());
        assert!((point.velocity - velocity).abs() < 2e-3, "{} for {velocity}", point.velocity);
    }
}

#[test]
fn curvature_and_acceleration_have_the_corrected_values() {
    let point = a().point(5);
    assert!((point.curvature - 0.02974).abs() < 2e-4, "{}", point.curvature);
    assert!((point.acceleration - -1.08348).abs() < 1e-3, "{}", point.acceleration);
}

#[test]
fn reference_and_velocity_costs_are_those_of_the_published_planner() {
    for (case, desired, reference, velocity) in [(a(), 9.0, 4.825205, 5.214428), (c(), 3.0, 2.590268, 4.893854)] {
        assert!((case.reference_cost() - reference).abs() < 1e-3, "{}", case.reference_cost());
        assert!((case.velocity_cost(desired) - velocity).abs() < 2e-3, "{}", case.velocity_cost(desired));
    }
    // Case B: the published planner loses the end sample and keeps what it has a tenth of a second before: 2.888177,
    // where all of the last fifteen points should be at 0.75 m, and 15.379608 with seventeen speeds short of 12 m/s.
    assert!((b().reference_cost() - 0.75 * 15_f64.sqrt()).abs() < 1e-9);
    assert!((b().velocity_cost(9.0) - 15.379608).abs() < 0.12, "{}", b().velocity_cost(9.0));
}
