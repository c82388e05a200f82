//! How fast the agent wants to be: in time at the goal, comfortable in curves, at a safe distance to its leader.

use super::super::arrival::{self, LOOK_AHEAD};
use super::super::car_following::safe_velocity;
use super::super::comfort::FrenetComfort;
use super::super::conflicts::LINE_GAP;
use super::super::frame::Start;
use super::super::{Other, PlanRequest};
use super::settings::FrenetSettings;
use crate::barrier::{Barrier, Barriers};
use crate::conduct::STATIONARY_SPEED;

/// Distance of the samples of the path's curvature [m], and how far they reach at most.
const CURVE_STEP: f64 = 1.0;
const CURVE_REACH: f64 = 250.0;
/// The corridor of the path is wider than the agent by this, on each side [m].
const CORRIDOR_MARGIN: f64 = 0.3;
/// Reaction time of the safe speed before stop lines and the mouths of junctions [s]; that behind leaders is a setting.
const LINE_REACTION: f64 = 1.0;
/// One that is faster than the limit aims below it by this share of the excess, at most by so much [m/s], so that it does
/// not only approach it.
const EXCESS_SHARE: f64 = 0.5;
const BELOW_MAX: f64 = 1.0;
/// Nothing comes nearer to a stop line than this [m].
const LINE_CLEARANCE: f64 = 0.1;
/// An agent that has to wait for more than this [s] may want to stop.
const STOP_TIME: f64 = 2.0;
/// More than any rounding of a distance [m].
const ROUNDING: f64 = 1e-6;

/// What the agent wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Targets {
    /// Speed [m/s].
    pub(super) velocity: f64,
    /// Place beside the path, to the left [m].
    pub(super) offset: f64,
    /// Speed limit here or where the agent will soon be, whichever is higher [m/s].
    pub(super) limit: f64,
    /// Arc lengths of the rear axle [m] at which it may want to stop: behind the leader, before the goal's end, before a
    /// stop line.
    pub(super) stops: [Option<f64>; 3],
    /// Arc lengths that the rear axle must not pass [m], and until when.
    pub(super) barriers: Barriers,
}

/// A participant ahead on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leader {
    /// Arc length of its rear [m].
    rear: f64,
    /// Along the path [m/s].
    velocity: f64,
}

impl Targets {
    pub(super) fn new(request: &PlanRequest, start: &Start, settings: &FrenetSettings) -> Self {
        let comfort = &settings.comfort;
        let vehicle = request.vehicle;
        let front = start.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let all_barriers = request.barriers(request.rules.way, start.s);
        let approach = |one: &Barrier| approach_velocity(one, front, request.dt, comfort.deceleration);
        let (mut following, mut standing) =
            (all_barriers.iter().map(approach).fold(f64::INFINITY, f64::min), f64::INFINITY);
        let lasting = || all_barriers.iter().filter(|one| one.until > STOP_TIME).map(|one| one.s);
        for Leader { rear, velocity } in request.others.iter().filter_map(|other| leader(other, request, start)) {
            let gap = rear - front - comfort.standstill_gap;
            following = following.min(safe_velocity(gap, velocity, (comfort.time_gap, comfort.deceleration)));
            standing = standing.min(rear + 0.5 * velocity * velocity.abs() / comfort.deceleration);
        }
        let goal = arrival::desired(
            request,
            (start.s, start.velocity),
            comfort.deceleration,
            comfort.cruise_velocity_min,
            Some(0.0),
        );
        let (goal_velocity, goal_stop) = goal;
        let middle = start.s + vehicle.rear_axle_to_center;
        let step = comfort.velocity_step;
        let elsewhere = goal_velocity.min(start.velocity + step).min(vehicle.velocity_max).min(following).max(0.0);
        let limits = &request.rules.way.limits;
        let limit = limits.at(middle).max(limits.at(middle + LOOK_AHEAD * start.velocity));
        let excess = (start.velocity - limit).max(0.0);
        let velocity = path_velocity(
            request,
            start,
            comfort,
            elsewhere.min((limit - (EXCESS_SHARE * excess).min(BELOW_MAX)).max(0.0)),
        );
        let velocity = settings.place.wavering.desired(velocity.max(start.velocity - step).max(0.0), request);
        let offset = settings.place.aside_of_path(request, start.s);
        let leader_stop = standing - comfort.standstill_gap - (front - start.s);
        // Stops further away than three comfortable braking distances are left to the desired speed.
        let reach = 20.0 + 1.5 * start.velocity.powi(2) / comfort.deceleration;
        let near = |s: &f64| settings.stop_targets && (0.3..reach).contains(&(s - start.s));
        let line_stop = lasting().fold(f64::INFINITY, f64::min) - LINE_GAP - (front - start.s);
        // Where it stands now it may stay.
        let for_axle = |s: f64| (s - LINE_CLEARANCE - (front - start.s)).max(start.s + ROUNDING);
        let mut axle_barriers = Barriers::NONE;
        axle_barriers.extend(all_barriers.iter().map(|one| Barrier { s: for_axle(one.s), ..*one }));
        let stops = [Some(leader_stop).filter(near), goal_stop.filter(near), Some(line_stop).filter(near)];
        Self { velocity, offset, limit, stops, barriers: axle_barriers }
    }
}

/// Speed at which an agent drives towards a barrier [m/s]: it can stop there, or arrives when it opens.
fn approach_velocity(barrier: &Barrier, front: f64, dt: f64, deceleration: f64) -> f64 {
    let room = barrier.s - LINE_GAP - front;
    let safe = safe_velocity(room, 0.0, (LINE_REACTION, deceleration));
    if barrier.until.is_finite() { safe.max(room / barrier.until.max(dt)) } else { safe }
}

/// The participant as a leader, if it is ahead, its footprint in the corridor between the agent and
/// the path, and it stands or moves along the path. Structures of several parts are left to the collision test.
fn leader(other: &Other, request: &PlanRequest, start: &Start) -> Option<Leader> {
    if other.is_static && other.shape.parts().len() > 1 {
        return None;
    }
    let vehicle = request.vehicle;
    // How far away leaders are looked for [m], beyond their size.
    let reach = 40.0 + start.velocity * (2.0 + start.velocity / 4.0);
    let distance = other.pose.position.distance(request.state.pose().position);
    if distance > reach + other.shape.bounding_radius() {
        return None;
    }
    let body = other.shape.oriented_box(other.pose);
    let path = &request.route.path;
    let corridor = 0.5 * vehicle.width + CORRIDOR_MARGIN;
    let middle = start.s + vehicle.rear_axle_to_center;
    // A participant that can be neither ahead nor in the corridor needs no exact foot.
    let beside_at = start.d.abs() + corridor + body.half_length.hypot(body.half_width) + ROUNDING;
    let (from, to) = (middle - path.spacing(), start.s + distance + 10.0 + path.spacing());
    if !path.may_pass(body.center, beside_at, from, to) {
        return None;
    }
    let (s, d) = path.project_near(body.center, start.s + 0.5 * distance, 0.5 * distance + 10.0)?;
    let tangent = path.at(s).tangent();
    let (cos, sin) = (tangent.dot(body.axis), tangent.cross(body.axis));
    let half_s = body.half_length * cos.abs() + body.half_width * sin.abs();
    let half_d = body.half_length * sin.abs() + body.half_width * cos.abs();
    let beside = d - half_d > start.d.max(0.0) + corridor || d + half_d < start.d.min(0.0) - corridor;
    let ahead = s > middle;
    let stands = other.is_static || other.velocity.abs() < STATIONARY_SPEED;
    let velocity = if stands { 0.0 } else { other.velocity_along(cos) };
    if !ahead || beside || !(stands || other.leads(cos)) {
        return None;
    }
    Some(Leader { rear: s - half_s, velocity })
}

/// Speed from which all curves ahead can be taken comfortably, and all speed limits be met, after comfortable braking, or
/// `velocity` if that is less.
fn path_velocity(request: &PlanRequest, start: &Start, comfort: &FrenetComfort, velocity: f64) -> f64 {
    let (path, limits) = (&request.route.path, &request.rules.way.limits);
    let is_limited = limits.any();
    let b = comfort.deceleration;
    let cornering = request.vehicle.cornering(comfort.lateral_acceleration);
    let lead = start.velocity * LOOK_AHEAD;
    let reach = (20.0 + lead + 0.5 * start.velocity.powi(2) / b).min(CURVE_REACH);
    let mut square = velocity * velocity;
    for i in 0..(reach / CURVE_STEP) as usize {
        let ahead = i as f64 * CURVE_STEP;
        let room = square - 2.0 * b * (ahead - lead).max(0.0);
        if room <= 0.0 {
            break; // Curves from here on do not matter.
        }
        let bend = path.curvature_at(start.s + ahead).abs();
        if room * bend > cornering {
            square += cornering / bend - room;
        }
        if !is_limited {
            continue;
        }
        let limit = limits.at(start.s + ahead);
        let room = square - 2.0 * b * (ahead - lead).max(0.0);
        if room > limit * limit {
            square += limit * limit - room;
        }
    }
    square.sqrt()
}
