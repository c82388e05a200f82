//! The last resort of every planner, in this order:
//!
//! 1. The agent stands (at most 0.1 m/s): it stays.
//! 2. Full braking that stays on the road: along the path of the previous plan, if the agent is still on it, turning the
//!    wheels towards the reference path, on the arc of the present steering, or straightening the wheels. `frenet` chooses
//!    among these and its own samples by their contacts (`least_bad`).
//! 3. Full braking while the wheels turn towards those of another arc: the one next to the present steering that stays on
//!    the road.
//!
//! When it brakes fully, an agent turns the wheels no faster than it can, and no tighter than its tyres hold beside the
//! braking: where they are tighter already, it opens them.
//!
//! The status is `EmergencyBraking`; `Infeasible` with a reason if even the last resort leaves the road.

use super::frame::{project, start_curvature};
use super::path_motion::point_at;
use super::polynomial::Braking;
use super::{PlanRequest, PlanResult};
use crate::conduct::STANDSTILL_SPEED;
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, wrap_angle};
use crate::trajectory::{Obstruction, State, Trajectory};

/// Full braking as a fraction of the largest deceleration.
const FULL_BRAKING: f64 = 0.9;
/// The previous plan's path is taken if it passes the agent this closely: [m], [rad].
const POSITION_TOLERANCE: f64 = 0.3;
const HEADING_TOLERANCE: f64 = 0.1;
/// Towards the reference path, the wheels point to its point this far ahead: time [s], at least a distance [m].
const AIM_TIME: f64 = 0.7;
const AIM_DISTANCE: f64 = 4.0;

/// What an agent does if there is nothing to choose from.
pub(super) fn without_plan(request: &PlanRequest, n_points: usize, reason: &str) -> PlanResult {
    if request.state.is_finite() {
        let obstruction = Some(Obstruction::nowhere(reason));
        PlanResult { obstruction, ..last_resort(request, n_points, reason) }
    } else {
        refuse(request, n_points, reason.into())
    }
}

/// Standing still or full braking.
pub(super) fn last_resort(request: &PlanRequest, n_points: usize, reason: &str) -> PlanResult {
    if request.state.velocity.abs() <= STANDSTILL_SPEED {
        stay(request, n_points)
    } else {
        brake(request, n_points, reason)
    }
}

/// The agent stays where it is.
pub(super) fn stay(request: &PlanRequest, n_points: usize) -> PlanResult {
    let mut points = vec![State { velocity: 0.0, acceleration: 0.0, yaw_rate: 0.0, ..request.state }; n_points];
    points[0] = request.state;
    if n_points > 1 {
        points[1].acceleration = -request.state.velocity / request.dt;
    }
    PlanResult::braking(Trajectory { points })
}

/// A plan for a state that is not a number: there is nothing to drive.
pub(super) fn refuse(request: &PlanRequest, n_points: usize, message: String) -> PlanResult {
    PlanResult::infeasible(Trajectory { points: vec![request.state; n_points] }, message)
}

/// Full braking along the previous plan's path or an arc. `reason` says why there is no better plan.
pub(super) fn brake(request: &PlanRequest, n_points: usize, reason: &str) -> PlanResult {
    let mut first = None;
    let arcs = curvatures(request).into_iter().map(|curvature| towards_arc(request, n_points, curvature));
    let steered = along_previous(request, n_points).into_iter().chain(towards_path(request, n_points));
    for points in steered.chain(arcs) {
        if stays_on_road(request, &points) {
            return PlanResult::braking(Trajectory { points });
        }
        first = first.or(Some(points));
    }
    let trajectory = Trajectory { points: first.expect("there is always an arc") };
    PlanResult::infeasible(trajectory, format!("{reason}, and full braking leaves the road"))
}

/// Curvatures of braking arcs: the present one and others that the steering allows, the next ones first.
fn curvatures(request: &PlanRequest) -> Vec<f64> {
    const N: i32 = 12;
    let limit = request.vehicle.curvature_max();
    let present = present_curvature(request);
    let mut others: Vec<f64> = (-N..=N).map(|i| limit * f64::from(i) / f64::from(N)).collect();
    others.sort_by(|a, b| (a - present).abs().total_cmp(&(b - present).abs()));
    others.insert(0, present);
    others
}

/// The footprint stays on the road once it is fully on it.
fn stays_on_road(request: &PlanRequest, points: &[State]) -> bool {
    let (length, width) = (request.vehicle.length, request.vehicle.width);
    let mut was_on_road = request.was_on_road;
    points.iter().all(|point| {
        let footprint = OrientedBox::new(point.pose(), length, width);
        let stays = !was_on_road || request.road.admits_box(request.vehicle, &footprint);
        was_on_road = was_on_road || request.road.box_is_covered(&footprint);
        stays
    })
}

fn present_curvature(request: &PlanRequest) -> f64 {
    start_curvature(&request.state, request.vehicle).unwrap_or(0.0)
}

/// Braking at the points; a vehicle that rolls backwards brakes likewise.
fn braking(request: &PlanRequest) -> (f64, Braking) {
    let state = &request.state;
    let direction = if state.velocity < 0.0 { -1.0 } else { 1.0 };
    let deceleration = FULL_BRAKING * request.vehicle.acceleration_max;
    (direction, Braking::new(state.velocity.abs(), direction * state.acceleration, deceleration))
}

/// The wheels turn towards those of an arc.
fn towards_arc(request: &PlanRequest, n_points: usize, curvature: f64) -> Vec<State> {
    turning(request, n_points, |_, _, _, _| curvature)
}

/// The wheels turn towards a point of the reference path as fast as they can, as far as the tyres hold.
fn towards_path(request: &PlanRequest, n_points: usize) -> Option<Vec<State>> {
    let (path, axle) = (&request.route.path, request.vehicle.rear_axle_from_center(request.state.pose()));
    if request.state.velocity <= STANDSTILL_SPEED {
        return None;
    }
    let (s, _) = project(path, axle, request.s_hint)?;
    Some(turning(request, n_points, |axle, heading, distance, velocity| {
        let ahead = AIM_DISTANCE.max(AIM_TIME * velocity);
        let aim = point_at(path, s + distance + ahead).position - axle;
        // The arc that is tangential to the heading and leads to the aim.
        2.0 * Point::from_angle(heading).cross(aim) / aim.norm_squared().max(1.0)
    }))
}

/// Full braking while the wheels turn as fast as they can towards a curvature [1/m]: that which is wanted at a place of the
/// rear axle, with a heading [rad], after a distance [m], at a speed [m/s].
fn turning(request: &PlanRequest, n_points: usize, wanted: impl Fn(Point, f64, f64, f64) -> f64) -> Vec<State> {
    let (state, vehicle) = (request.state, request.vehicle);
    let mut axle = vehicle.rear_axle_from_center(state.pose());
    let (direction, braking) = braking(request);
    let step = vehicle.steering_step(request.dt);
    let mut curvature = present_curvature(request);
    let (mut heading, mut driven) = (state.orientation, 0.0);
    let mut points = Vec::with_capacity(n_points);
    points.push(state);
    for i in 1..n_points {
        let [distance, speed, acceleration, _] = braking.at(i as f64 * request.dt);
        let travel = direction * (distance - driven);
        let held = vehicle.lateral_acceleration_beside(acceleration) / speed.powi(2).max(1e-6);
        let tightest = vehicle.curvature_max().min(held);
        let next = vehicle.turned(curvature, wanted(axle, heading, driven, speed), step, tightest);
        let turn = 0.5 * (curvature + next) * travel;
        axle = axle + Point::from_angle(heading + 0.5 * turn) * travel;
        (heading, curvature, driven) = (heading + turn, next, distance);
        let Point { x, y } = axle + Point::from_angle(heading) * vehicle.rear_axle_to_center;
        let velocity = direction * speed;
        let acceleration = direction * acceleration;
        points.push(State { x, y, orientation: heading, velocity, acceleration, yaw_rate: curvature * velocity });
    }
    points
}

/// The wheels turn as on the previous plan's path.
fn along_previous(request: &PlanRequest, n_points: usize) -> Option<Vec<State>> {
    let old = request.previous?.points.get(request.previous_age..)?;
    let (first, state) = (*old.first()?, request.state);
    let turn = wrap_angle(state.orientation - first.orientation);
    let is_near = first.pose().position.distance(state.pose().position) < POSITION_TOLERANCE
        && turn.abs() < HEADING_TOLERANCE
        && state.velocity > STANDSTILL_SPEED;
    if !is_near || old.len() < 2 || old.iter().any(|point| !point.is_finite() || point.velocity < 0.0) {
        return None;
    }
    let (vehicle, dt) = (request.vehicle, request.dt);
    let axle = |point: &State| vehicle.rear_axle_from_center(point.pose());
    let curvature_after = |distance: f64| {
        let (mut passed, mut curvature) = (0.0, 0.0);
        for pair in old.windows(2) {
            let [before, after] = [&pair[0], &pair[1]]
                .map(|point| (point.velocity > STANDSTILL_SPEED).then(|| point.yaw_rate / point.velocity));
            let length = axle(&pair[1]).distance(axle(&pair[0]));
            let Some(before) = before else { break };
            curvature = after.unwrap_or(before);
            if passed + length >= distance {
                let fraction = (distance - passed) / length.max(1e-6);
                return before + (curvature - before) * fraction.clamp(0.0, 1.0);
            }
            passed += length;
        }
        curvature
    };
    Some(turning(request, n_points, |_, _, driven, velocity| curvature_after(driven + velocity * dt)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::plan::frenet::{self, FrenetMemory, FrenetSettings};
    use crate::plan::testing::Drive;
    use crate::road::testing::{arc, straight};

    /// Full braking from now on.
    fn braking_from(drive: &Drive) -> Vec<State> {
        drive.with_request(|request| last_resort(request, 31, "")).trajectory.points
    }

    #[test]
    fn full_braking_turns_the_wheels_within_the_steering_rate_and_the_friction_circle() {
        let settings = FrenetSettings::default();
        // A plan that turns left as tightly as the tyres hold, then an emergency.
        let mut center = straight((0.0, 0.0), (30.0, 0.0));
        center.extend(arc((30.0, 18.0), 18.0, -FRAC_PI_2, 0.0).into_iter().skip(1));
        for velocity in [3.0, 6.0, 9.0, 11.0] {
            let mut drive = Drive::along(&center, 36.0, velocity);
            drive.state.yaw_rate = velocity / 18.0;
            let result = drive.with_request(|request| frenet::plan(request, &settings, &mut FrenetMemory::default()));
            drive.step(result);
            let points = braking_from(&drive);
            let vehicle = &drive.vehicle;
            let steering = |p: &State| (vehicle.wheelbase * p.yaw_rate / p.velocity).atan();
            for pair in points.windows(2).take_while(|pair| pair[1].velocity > 0.1) {
                let rate = (steering(&pair[1]) - steering(&pair[0])).abs() / drive.dt;
                assert!(rate < vehicle.steering_rate_max + 1e-6, "{velocity} m/s: {rate} rad/s");
                let held = vehicle.lateral_acceleration_beside(pair[1].acceleration);
                let lateral = (pair[1].yaw_rate * pair[1].velocity).abs();
                let opens = steering(&pair[1]).abs() < steering(&pair[0]).abs();
                assert!(lateral < held + 1e-6 || opens, "{velocity} m/s: {lateral} of {held} m/s²");
            }
        }
    }

    #[test]
    fn full_braking_before_a_bend_turns_the_wheels_into_it_as_fast_as_they_turn() {
        // 20 m straight on, then a bend of 12 m radius to the left; no earlier plan, the wheels point straight ahead.
        let mut center = straight((0.0, 0.0), (20.0, 0.0));
        center.extend(arc((20.0, 12.0), 12.0, -FRAC_PI_2, 0.0).into_iter().skip(1));
        let drive = Drive::along(&center, 18.0, 9.0);
        let points = braking_from(&drive);
        let pose = points[30].pose();
        let offset = |place| drive.route.path.project(place).expect("beside it").1.abs();
        let on_the_path = offset(drive.vehicle.rear_axle_from_center(pose));
        // Straight on it would come to rest here.
        let way = points.windows(2).map(|pair| pair[0].pose().position.distance(pair[1].pose().position)).sum::<f64>();
        let straight_on = offset(drive.vehicle.rear_axle_from_center(drive.state.pose()) + Point::new(way, 0.0));
        assert!(on_the_path < 0.5 * straight_on && pose.orientation > 0.1, "{on_the_path} m, {straight_on} m");
        let steering = |p: &State| (drive.vehicle.wheelbase * p.yaw_rate / p.velocity).atan();
        let moving: Vec<f64> = points.iter().filter(|p| p.velocity > 0.1).map(steering).collect();
        let rate = moving.windows(2).map(|w| (w[1] - w[0]).abs() / 0.1).fold(0.0, f64::max);
        assert!(rate > 0.1 && rate <= drive.vehicle.steering_rate_max + 1e-9, "{rate} rad/s");
    }
}
