//! From a motion along a path, with a lateral offset that is given up, to states of the vehicle.

use super::PlanRequest;
use super::car_following::Motion;
use super::frame::{FrenetPoint, Start, Waypoint};
use super::polynomial::Polynomial;
use crate::geometry::polyline::{PathPoint, ReferencePath};
use crate::trajectory::{State, Trajectory};

/// An offset is given up over at least this length [m], ...
const LENGTH_MIN: f64 = 8.0;
/// ... so that steering stays below this curvature [1/m] at low speed (a quintic's largest second derivative is 5.77
/// times the offset over the squared length).
const CURVATURE_WANTED: f64 = 0.12;
/// If the vehicle cannot drive it, the length is raised by this factor, so many times.
const LENGTH_FACTOR: f64 = 1.6;
const ATTEMPTS: usize = 4;

/// Everything at an arc length; beyond its end the path goes on straight.
pub(super) fn point_at(path: &ReferencePath, s: f64) -> PathPoint {
    let mut at = path.at(s);
    let over = if s < 0.0 { s } else { (s - path.length()).max(0.0) };
    if over != 0.0 {
        at.position = at.position + at.tangent() * over;
        (at.curvature, at.curvature_rate) = (0.0, 0.0);
    }
    at
}

/// Lateral offset over arc length: from the present one, with its derivatives, to zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Return {
    polynomial: Polynomial,
    length: f64,
}

impl Return {
    /// Within `length` [m].
    pub(super) fn within(start: &Start, length: f64) -> Self {
        Self { polynomial: Polynomial::to_rest([start.d, start.d_prime, start.d_prime2], 0.0, length), length }
    }

    /// Length that takes `time` [s] at the present speed, but is not too abrupt.
    pub(super) fn length(start: &Start, time: f64) -> f64 {
        let gentle = (5.77 * start.d.abs() / CURVATURE_WANTED).sqrt();
        (start.velocity * time).max(gentle).max(LENGTH_MIN)
    }

    /// Offset and its first two derivatives by arc length, after `distance` [m].
    fn at(&self, distance: f64) -> [f64; 3] {
        if distance >= self.length {
            return [0.0; 3];
        }
        let [d, d_prime, d_prime2, _] = self.polynomial.at(distance);
        [d, d_prime, d_prime2]
    }
}

/// States of the footprint centre along a path; the offset is given up in `time` [s], or later if the vehicle could not
/// steer as fast. Point 0 is the present state. `None` where the path bends too tightly for the offset.
pub(super) fn trajectory(
    request: &PlanRequest,
    path: &ReferencePath,
    start: &Start,
    motions: &[Motion],
    time: f64,
) -> Option<Trajectory> {
    let mut points = Vec::with_capacity(motions.len());
    let mut length = Return::length(start, time);
    for _ in 0..ATTEMPTS {
        if write(request, path, start, motions, &Return::within(start, length), &mut points)? {
            break;
        }
        length *= LENGTH_FACTOR;
    }
    points[0] = request.state;
    Some(Trajectory { points })
}

/// Whether the vehicle can drive it; `None` if it cannot be expressed.
fn write(
    request: &PlanRequest,
    path: &ReferencePath,
    start: &Start,
    motions: &[Motion],
    lateral: &Return,
    points: &mut Vec<State>,
) -> Option<bool> {
    let vehicle = request.vehicle;
    let mut drivable = true;
    points.clear();
    for motion in motions {
        let [d, d_prime, d_prime2] = lateral.at(motion.s - start.s);
        let frenet = FrenetPoint { s_dot: motion.velocity, s_ddot: motion.acceleration, d, d_prime, d_prime2 };
        let at = point_at(path, motion.s);
        let point = Waypoint::new(&at, &frenet, vehicle.rear_axle_to_center)?;
        // What the path itself asks for cannot be changed here.
        let curvature_max = vehicle.curvature_max().max(at.curvature.abs() * 1.1);
        let tyres = vehicle.lateral_acceleration_max.max(1.1 * at.curvature.abs() * point.velocity.powi(2));
        drivable &= point.curvature.abs() <= curvature_max && point.curvature.abs() * point.velocity.powi(2) <= tyres;
        points.push(State {
            x: point.center.x,
            y: point.center.y,
            orientation: point.theta() + start.heading_shift,
            velocity: point.velocity,
            acceleration: point.acceleration,
            yaw_rate: point.curvature * point.velocity,
        });
    }
    Some(drivable)
}
