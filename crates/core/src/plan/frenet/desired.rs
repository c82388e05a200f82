//! How fast the agent wants to be: in time at the goal, comfortable in curves, at a safe distance to its leader.

use super::super::{Other, PlanRequest};
use super::frame::Start;
use super::settings::{Comfort, FrenetSettings};
use crate::geometry::polyline::ReferencePath;
use crate::scenario::GoalState;

/// The plan reaches a new speed after about this time [s]; speeds are desired for then.
const LOOK_AHEAD: f64 = 1.0;
/// An agent aims this far into the goal area, at most to its middle [m], ...
const GOAL_DEPTH: f64 = 20.0;
/// ... waits this far before its end [m] ...
const GOAL_END_GAP: f64 = 1.0;
/// ... and arrives this long before the last moment [s], ...
const ARRIVAL_RESERVE: f64 = 1.0;
/// ... or by this share of the time that is left, if that is more: who plans to be just in time will be late.
const ARRIVAL_SHARE: f64 = 0.15;
/// Distance of the samples of the path's curvature [m], and how far they reach at most.
const CURVE_STEP: f64 = 1.0;
const CURVE_REACH: f64 = 250.0;
/// Somebody slower than this stands, whatever the heading [m/s].
const STANDING: f64 = 0.5;
/// A leader heads within 60 degrees of the path (cosine).
const SAME_DIRECTION: f64 = 0.5;
/// The corridor of the path is wider than the agent by this, on each side [m].
const CORRIDOR_MARGIN: f64 = 0.3;

/// What the agent wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Desired {
    /// Speed [m/s].
    pub(super) velocity: f64,
    /// Arc lengths of the rear axle [m] at which it may want to stop: behind the leader, before the goal's end.
    pub(super) stop_targets: [Option<f64>; 2],
}

/// Somebody ahead on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leader {
    /// Arc length of its nearest point [m].
    rear: f64,
    /// Its speed along the path [m/s], not negative.
    velocity: f64,
}

impl Desired {
    pub(super) fn new(request: &PlanRequest, start: &Start, settings: &FrenetSettings) -> Self {
        let comfort = &settings.comfort;
        let vehicle = request.vehicle;
        let front = start.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let leaders = || request.others.iter().filter_map(|other| leader(other, request, start));
        let following = leaders()
            .map(|leader| safe_velocity(leader.rear - front - comfort.standstill_gap, leader.velocity, comfort))
            .fold(f64::INFINITY, f64::min);
        let (goal_velocity, goal_stop) = goal(request, start, comfort);
        let step = comfort.velocity_step;
        let velocity = goal_velocity
            .min(start.velocity + step)
            .min(vehicle.velocity_max)
            .min(curve_velocity(&request.route.path, start, comfort))
            .min(following)
            .max(start.velocity - step)
            .max(0.0);
        let leader_stop = leaders()
            .map(|leader| leader.rear + 0.5 * leader.velocity.powi(2) / comfort.deceleration)
            .fold(f64::INFINITY, f64::min)
            - comfort.standstill_gap
            - (front - start.s);
        // Stops further away than three comfortable braking distances are left to the desired speed.
        let reach = 20.0 + 1.5 * start.velocity.powi(2) / comfort.deceleration;
        let near = |s: &f64| settings.stop_targets && (0.3..reach).contains(&(s - start.s));
        Self { velocity, stop_targets: [Some(leader_stop).filter(near), goal_stop.filter(near)] }
    }
}

/// Gipps' safe speed: the agent can stop without contact if the leader brakes as hard as the agent finds comfortable
/// and the agent reacts after the time gap. `gap` is what may be used up [m].
fn safe_velocity(gap: f64, leader_velocity: f64, comfort: &Comfort) -> f64 {
    let b = comfort.deceleration;
    let lag = b * comfort.time_gap;
    let radicand = lag * lag + leader_velocity * leader_velocity + 2.0 * b * gap;
    (radicand.max(0.0).sqrt() - lag).max(0.0)
}

/// The participant as a leader, if it is one: ahead, its footprint in the corridor between the agent and the path, and
/// it stands or moves along the path. Structures of several parts are left to the collision test.
fn leader(other: &Other, request: &PlanRequest, start: &Start) -> Option<Leader> {
    if other.is_static && other.shape.parts().len() > 1 {
        return None;
    }
    let vehicle = request.vehicle;
    let reach = 40.0 + start.velocity * (2.0 + start.velocity / 4.0);
    let distance = other.pose.position.distance(request.state.pose().position);
    if distance > reach + other.shape.bounding_radius() {
        return None;
    }
    let body = other.shape.oriented_box(other.pose);
    let path = &request.route.path;
    let (s, d) = path.project_near(body.center, start.s + 0.5 * distance, 0.5 * distance + 10.0)?;
    let tangent = path.at(s).tangent();
    let (cos, sin) = (tangent.dot(body.axis), tangent.cross(body.axis));
    let half_s = body.half_length * cos.abs() + body.half_width * sin.abs();
    let half_d = body.half_length * sin.abs() + body.half_width * cos.abs();
    let corridor = 0.5 * vehicle.width + CORRIDOR_MARGIN;
    let beside = d - half_d > start.d.max(0.0) + corridor || d + half_d < start.d.min(0.0) - corridor;
    let ahead = s > start.s + vehicle.rear_axle_to_center;
    let stands = other.is_static || other.velocity.abs() < STANDING;
    let moves_along = cos * other.velocity.signum() > SAME_DIRECTION;
    let velocity = if stands { 0.0 } else { (other.velocity * cos).max(0.0) };
    (ahead && !beside && (stands || moves_along)).then_some(Leader { rear: s - half_s, velocity })
}

/// Speed from which all curves ahead can be taken comfortably after comfortable braking.
fn curve_velocity(path: &ReferencePath, start: &Start, comfort: &Comfort) -> f64 {
    let b = comfort.deceleration;
    let lead = start.velocity * LOOK_AHEAD;
    let reach = (20.0 + lead + 0.5 * start.velocity.powi(2) / b).min(CURVE_REACH);
    let squares = (0..(reach / CURVE_STEP) as usize).map(|i| {
        let ahead = i as f64 * CURVE_STEP;
        comfort.lateral_acceleration / path.at(start.s + ahead).curvature.abs().max(1e-9)
            + 2.0 * b * (ahead - lead).max(0.0)
    });
    squares.fold(f64::INFINITY, f64::min).sqrt()
}

/// Desired speed for the goal alone, and where to wait if the agent is early.
///
/// Before the area: the constant speed that, followed by comfortable braking (or accelerating) to the goal's speeds,
/// brings the agent into the area at the middle of the time interval or shortly before its end, whichever is later.
/// Too late: on as before. In the area: the goal's speed; before the time, slowly enough not to leave it. A goal without
/// a place, or behind the agent: the goal's speed, else the present one.
fn goal(request: &PlanRequest, start: &Start, comfort: &Comfort) -> (f64, Option<f64>) {
    let Some(goal) = request.goal.states.iter().max_by_key(|state| state.time_step.1) else {
        return (start.velocity, None);
    };
    let goal_velocity = goal.velocity.map(|(low, high)| 0.5 * (low + high));
    let onwards = goal_velocity.unwrap_or(start.velocity.max(comfort.cruise_velocity_min));
    let (entry, exit) = (request.route.goal_entry_s, request.route.goal_exit_s);
    let center = start.s + request.vehicle.rear_axle_to_center;
    // False for goals without a place, too: their arc lengths are NaN.
    let to_come = exit > center && entry.is_finite();
    if goal.areas.is_empty() || !to_come {
        return (onwards, None);
    }
    let seconds = |steps: f64| steps * request.dt;
    let until = |time_step: i64| seconds((time_step - request.time_step) as f64);
    let is_early = until(goal.time_step.0) > 0.0;
    let stop = is_early.then_some(exit - GOAL_END_GAP - request.vehicle.rear_axle_to_center);
    if center >= entry {
        let room = (exit - GOAL_END_GAP - center).max(0.0);
        let inside = goal_velocity.unwrap_or(start.velocity);
        let waiting =
            if is_early { (room / until(goal.time_step.0)).min((comfort.deceleration * room).sqrt()) } else { inside };
        return (inside.min(waiting), stop);
    }
    (arrival_velocity(goal, entry.min(exit) - center, exit - entry, onwards, comfort, until), stop)
}

fn arrival_velocity(
    goal: &GoalState,
    to_entry: f64,
    depth: f64,
    onwards: f64,
    comfort: &Comfort,
    until: impl Fn(i64) -> f64,
) -> f64 {
    let (earliest, latest) = (until(goal.time_step.0), until(goal.time_step.1));
    if latest <= 0.0 {
        return onwards;
    }
    let reserve = ARRIVAL_RESERVE.max(ARRIVAL_SHARE * latest);
    let arrival = (0.5 * (earliest + latest)).max(latest - reserve).max(0.5 * latest);
    let distance = to_entry + GOAL_DEPTH.min(0.5 * depth);
    cruise_velocity(distance, arrival, goal.velocity.unwrap_or((0.0, f64::INFINITY)), comfort.deceleration)
}

/// Speed after `LOOK_AHEAD` of: constant speed, then a constant change `b` [m/s²] to the nearer end of the interval, so
/// that `distance` is covered in `time`.
fn cruise_velocity(distance: f64, time: f64, (low, high): (f64, f64), b: f64) -> f64 {
    let mean = distance / time;
    if mean > high {
        // distance = v time - (v - high)² / (2 b); the smaller root.
        let root = ((high + b * time).powi(2) - high * high - 2.0 * b * distance).max(0.0).sqrt();
        let cruise = high + b * time - root;
        let braking_since = LOOK_AHEAD - (time - (cruise - high) / b);
        return (cruise - b * braking_since.max(0.0)).max(high);
    }
    if mean < low {
        // distance = v time + (low - v)² / (2 b)
        let root = ((low - b * time).powi(2) - low * low + 2.0 * b * distance).max(0.0).sqrt();
        let cruise = (low - b * time + root).max(0.0);
        let driving_since = LOOK_AHEAD - (time - (low - cruise) / b);
        return (cruise + b * driving_since.max(0.0)).min(low);
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_safe_speed_keeps_the_time_gap_to_a_leader_of_the_same_speed() {
        let comfort = Comfort::default();
        for v in [3.0, 10.0, 25.0] {
            assert!((safe_velocity(v * comfort.time_gap, v, &comfort) - v).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_is_safe_without_a_gap_to_a_standing_leader() {
        assert_eq!(safe_velocity(0.0, 0.0, &Comfort::default()), 0.0);
        assert_eq!(safe_velocity(-5.0, 0.0, &Comfort::default()), 0.0);
    }

    #[test]
    fn the_cruise_speed_covers_the_distance_in_time() {
        let b = 3.0;
        for (distance, time, low, high, expected) in [
            (100.0, 10.0, 0.0, f64::INFINITY, 10.0),
            (100.0, 10.0, 5.0, 12.0, 10.0),
            // v 10 - v²/6 = 80: 30 - sqrt(900 - 480)
            (80.0, 10.0, 0.0, 0.0, 30.0 - 420_f64.sqrt()),
            // v 10 + (12 - v)²/6 = 80: v² + 36 v - 336 = 0
            (80.0, 10.0, 12.0, 15.0, -18.0 + 660_f64.sqrt()),
        ] {
            let v = cruise_velocity(distance, time, (low, high), b);
            assert!((v - expected).abs() < 1e-9, "{v} for {expected}");
        }
    }

    #[test]
    fn the_desired_speed_falls_along_the_braking_before_the_goal() {
        // 5 m/s is reached 2 s before arrival at rest, on the comfortable braking parabola: 1 s later it is 2 less.
        let v = cruise_velocity(4.0, 2.0, (0.0, 0.0), 2.0);
        assert!((v - 2.0).abs() < 1e-9, "{v}");
    }
}
