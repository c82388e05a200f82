//! From a motion along a path, with a lateral offset that is given up, to states of the vehicle.

use super::PlanRequest;
use super::car_following::PathMotion;
use super::frame::{FrenetPoint, STRETCH_MIN, Start, Waypoint};
use super::polynomial::Polynomial;
use crate::geometry::polyline::{PathPoint, ReferencePath};
use crate::geometry::shape::OrientedBox;
use crate::trajectory::{State, Trajectory};

/// A vehicle gives up an offset from its path within this time [s], as in an unhurried lane change.
pub(super) const RETURN_TIME: f64 = 4.0;
/// An offset is given up over at least this length [m], ...
const LENGTH_MIN: f64 = 8.0;
/// ... so that steering stays below this curvature [1/m] at low speed (a quintic's largest second derivative is 5.77
/// times the offset over the squared length).
const CURVATURE_WANTED: f64 = 0.12;
/// Factor that lengthens the motion if the vehicle cannot drive it, and how often.
const LENGTH_FACTOR: f64 = 1.6;
const ATTEMPTS: usize = 4;

/// Ends beside the path that are tried in this order if the footprint would leave the road [m], ...
const BESIDE: [f64; 9] = [0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0];
/// ... reached within this time [s].
const BESIDE_TIME: f64 = 1.5;
/// No vehicle leaves the road this near the middle of a lane this straight: offset [m], curvature [1/m], and the step
/// of the examination [m].
const HARMLESS_OFFSET: f64 = 0.4;
const STRAIGHT_CURVATURE: f64 = 0.02;
const STRAIGHT_STEP: f64 = 3.0;

/// A vehicle within this offset [m] and slope drives as far as its path is long.
const STRAIGHT_ON: f64 = 1e-4;

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

/// Lateral offset over arc length: from the present one, with its derivatives, to another one.
#[derive(Debug, Clone, Copy)]
struct Shift {
    polynomial: Polynomial,
    end: f64,
    length: f64,
}

impl Shift {
    /// Within `length` [m].
    fn within(start: &Start, end: f64, length: f64) -> Self {
        Self { polynomial: Polynomial::to_rest([start.d, start.d_prime, start.d_prime2], end, length), end, length }
    }

    /// Length that takes `time` [s] at the present speed, but is not too abrupt.
    fn length(start: &Start, end: f64, time: f64) -> f64 {
        let gentle = (5.77 * (start.d - end).abs() / CURVATURE_WANTED).sqrt();
        (start.velocity * time).max(gentle).max(LENGTH_MIN)
    }

    /// Offset and its first two derivatives by arc length, after `distance` [m].
    fn at(&self, distance: f64) -> [f64; 3] {
        if distance >= self.length {
            return [self.end, 0.0, 0.0];
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
    motions: &[PathMotion],
    time: f64,
) -> Option<Trajectory> {
    let mut points = Vec::with_capacity(motions.len());
    shifted(request, path, start, motions, (0.0, time), &mut points)?;
    Some(Trajectory { points })
}

/// The same, but to an offset from the path, and where the footprint would leave the road, to another one: where lanes
/// are narrow and bend tightly a vehicle whose rear axle follows the middle leaves its lane.
pub(super) fn trajectory_on_road(
    request: &PlanRequest,
    path: &ReferencePath,
    start: &Start,
    motions: &[PathMotion],
    (aside, time): (f64, f64),
) -> Option<Trajectory> {
    let mut points = Vec::with_capacity(motions.len());
    shifted(request, path, start, motions, (aside, time), &mut points)?;
    let is_harmless = start.d.abs().max(aside.abs()) < HARMLESS_OFFSET && is_straight(path, start.s, motions);
    if is_harmless {
        return Some(Trajectory { points });
    }
    let mut longest = stays_on_road(request, &points);
    let mut best = points.clone();
    for (end, time) in BESIDE.iter().map(|end| (*end, time.min(BESIDE_TIME))) {
        if longest >= points.len() {
            break;
        }
        if shifted(request, path, start, motions, (end, time), &mut points).is_some() {
            let stays = stays_on_road(request, &points);
            if stays > longest {
                longest = stays;
                best.clone_from(&points);
            }
        }
    }
    Some(Trajectory { points: best })
}

/// The path does not bend more than any lane leaves room for.
fn is_straight(path: &ReferencePath, s: f64, motions: &[PathMotion]) -> bool {
    let end = motions.last().map_or(s, |motion| motion.s) + 5.0;
    let n = path.steps_from(s, STRAIGHT_STEP, ((end - s) / STRAIGHT_STEP).ceil());
    (0..=n).all(|i| path.curvature_at(s + i as f64 * STRAIGHT_STEP).abs() < STRAIGHT_CURVATURE)
}

/// Number of points up to which the footprint stays on the road once it is fully on it.
fn stays_on_road(request: &PlanRequest, points: &[State]) -> usize {
    let (length, width) = (request.vehicle.length, request.vehicle.width);
    let mut was_on_road = request.was_on_road;
    let leaves = points.iter().position(|point| {
        let footprint = OrientedBox::new(point.pose(), length, width);
        let leaves = was_on_road && !request.road.admits_box(request.vehicle, &footprint);
        was_on_road = was_on_road || request.road.box_is_covered(&footprint);
        leaves
    });
    leaves.unwrap_or(points.len())
}

/// Ends at an offset from the path, within a time at the present speed or as fast as the vehicle can.
fn shifted(
    request: &PlanRequest,
    path: &ReferencePath,
    start: &Start,
    motions: &[PathMotion],
    (end, time): (f64, f64),
    points: &mut Vec<State>,
) -> Option<()> {
    let mut length = Shift::length(start, end, time);
    for _ in 0..ATTEMPTS {
        if write(request, path, start, motions, &Shift::within(start, end, length), points)? {
            break;
        }
        length *= LENGTH_FACTOR;
    }
    points[0] = request.state;
    Some(())
}

/// Way of the rear axle for one metre of the path; `None` near the centre of the path's curvature.
fn stretch(path: &ReferencePath, start: &Start, lateral: &Shift, s: f64) -> Option<f64> {
    let [d, d_prime, _] = lateral.at(s - start.s);
    if d.abs() < STRAIGHT_ON && d_prime.abs() < STRAIGHT_ON {
        return Some(1.0);
    }
    let parallel = 1.0 - point_at(path, s).curvature * d;
    (parallel >= STRETCH_MIN).then(|| parallel.hypot(d_prime))
}

/// Whether the vehicle can drive it; `None` if it cannot be expressed.
fn write(
    request: &PlanRequest,
    path: &ReferencePath,
    start: &Start,
    motions: &[PathMotion],
    lateral: &Shift,
    points: &mut Vec<State>,
) -> Option<bool> {
    let vehicle = request.vehicle;
    let mut drivable = true;
    points.clear();
    let (mut s, mut driven) = (start.s, start.s);
    for motion in motions {
        // Beside a bend the way of the vehicle is longer or shorter than that along the path.
        let way = motion.s - driven;
        let halfway = s + 0.5 * way / stretch(path, start, lateral, s)?;
        s += way / stretch(path, start, lateral, halfway)?;
        driven = motion.s;
        let [d, d_prime, d_prime2] = lateral.at(s - start.s);
        let at = point_at(path, s);
        let s_dot = motion.velocity / stretch(path, start, lateral, s)?;
        let frenet = FrenetPoint { s_dot, s_ddot: 0.0, d, d_prime, d_prime2 };
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
            acceleration: motion.acceleration,
            yaw_rate: point.curvature * point.velocity,
        });
    }
    Some(drivable)
}
