//! Keeping the recorded path and, on a free path, the recorded speed.

use super::car_following::{CarFollowing, integrate, limited};
use super::conflicts::{Conflicts, Deference, Ego};
use super::frame::Start;
use super::path_motion::RETURN_TIME;
use super::recorded_path::RecordedPath;
use super::wavering::Wavering;
use super::{PlanRequest, PlanResult, PlanningMemory, path_motion, refused};
use crate::barrier::Barriers;
use crate::conduct::STANDSTILL_SPEED;
use crate::rules::SpeedLimits;
use crate::settings::settings;

/// A vehicle this near to its recorded place is on schedule [m] and corrects the rest; a later one is late and does not
/// catch up.
const ON_SCHEDULE: f64 = 1.0;
/// Errors of speed and place decay within these times [s].
const VELOCITY_TIME: f64 = 0.5;
const PLACE_TIME: f64 = 1.0;
/// A vehicle slower than recorded at its place by more than this [m/s] accelerates with the car-following model.
const SLOWER_BY: f64 = 0.3;
/// A late vehicle passes a place where it stood, and has left by then, at this speed [m/s].
const PASSING_SPEED: f64 = 2.0;
/// Places nearer than this are the same [m].
const SAME_PLACE: f64 = 0.02;
/// Lateral acceleration in curves beyond the end of the recording [m/s²].
const LATERAL_ACCELERATION: f64 = 3.0;

settings! {
    /// Keeps the recorded path and, where the way is free, the recorded speed.
    ///
    /// Behind leaders and before crossing participants it brakes with the Intelligent Driver Model: Treiber, Hennecke,
    /// Helbing, "Congested traffic states in empirical observations and microscopic simulations", Phys. Rev. E 62, 2000,
    /// doi 10.1103/PhysRevE.62.1805; defaults of Treiber and Kesting, "Traffic Flow Dynamics", 2013, table 11.2. With the
    /// gap s and the leader's speed vl, the desired gap is s* = s0 + max(0, v T + v (v - vl) / (2 sqrt(a b))), and the
    /// acceleration is at most a (1 - (s* / s)²). It returns to the recorded speed v0 with a (1 - (v / v0)^exponent). See
    /// docs/reference/planners.md.
    pub struct VelocityAdjustingSettings as VelocityAdjusting(law: CarFollowing, wavering: Wavering) {}
}

/// Acceleration on a free path [m/s²].
fn undisturbed(
    recorded_path: &RecordedPath,
    law: &CarFollowing,
    clock_now: f64,
    (s, velocity): (f64, f64),
    speed_limit: f64,
    dt: f64,
) -> f64 {
    let last = recorded_path.clock(recorded_path.last_time_step());
    let latest = recorded_path.latest_clock(s + SAME_PLACE);
    let behind = recorded_path.s_at(clock_now, dt) - s;
    let on_schedule = behind.abs() < ON_SCHEDULE || latest > clock_now;
    let clock = if on_schedule { clock_now } else { latest };
    if clock >= last {
        let wish = recorded_path.last_velocity().min(speed_limit);
        let wish = if wish < STANDSTILL_SPEED { 0.0 } else { wish };
        return if velocity < wish || velocity > wish + SLOWER_BY {
            law.free(velocity, wish)
        } else {
            (wish - velocity) / dt
        };
    }
    let recorded = recorded_path.velocity_at(clock);
    let change = (recorded_path.velocity_at(clock + 1.0) - recorded) / dt;
    if on_schedule {
        let place = if behind.abs() < ON_SCHEDULE { behind } else { behind.signum() * ON_SCHEDULE };
        return change + (recorded - velocity) / VELOCITY_TIME + place / (PLACE_TIME * PLACE_TIME);
    }
    // Where it stood, and drove on since, it does not stand again.
    let (recorded, change) = if recorded < PASSING_SPEED && recorded_path.drives_on(clock) {
        (PASSING_SPEED, 0.0)
    } else {
        (recorded, change)
    };
    if velocity < recorded - SLOWER_BY {
        return law.free(velocity, recorded).max(change);
    }
    (change + (recorded - velocity) / VELOCITY_TIME).max(-2.0 * law.deceleration.max(-change))
}

/// The plan for a request.
pub(super) fn plan(
    request: &PlanRequest,
    settings: &VelocityAdjustingSettings,
    recorded_path: &RecordedPath,
    memory: &mut PlanningMemory,
) -> PlanResult {
    let (law, noise) = (&settings.law, settings.wavering.noise());
    let path = recorded_path.path();
    let hint = recorded_path.s_at(recorded_path.clock(request.time_step), request.dt);
    let near = path.project_near(request.vehicle.rear_axle_from_center(request.state.pose()), hint, 2.0).is_some();
    let hint = if near { hint } else { f64::NAN };
    let start = match Start::on(path, hint, &request.state, request.vehicle, request.previous.is_some()) {
        Ok(start) => start,
        Err(reason) => return refused(request, &format!("the agent {reason}")),
    };
    let n_points = request.predictions.n_steps + 1;
    let ego = Ego::new(request, path, (start.s, start.velocity, start.d), RETURN_TIME);
    let PlanningMemory { conflicts, speed_profile, motions, free, .. } = memory;
    conflicts.collect(request, &ego, n_points, Barriers::NONE);
    speed_profile.fill(
        path,
        (&SpeedLimits::default(), 0.0),
        (start.s, ego.reach),
        LATERAL_ACCELERATION,
        law.deceleration,
    );
    let clock = recorded_path.clock(request.time_step);
    let deference = Deference::to_standing(law.minimum_gap);
    let drive = |conflicts: &Conflicts, point: usize, s: f64, velocity: f64| {
        let now = clock + point as f64;
        let wish = undisturbed(recorded_path, law, now, (s, velocity), speed_profile.at(s), request.dt);
        let follow = |gap: f64, leader: f64, _: f64| law.following(velocity, gap, leader);
        let allowed = conflicts.allowed(point, &ego, (s, velocity), deference, follow);
        let wanted = wish.min(allowed);
        let time = (request.time_step + point as i64) as f64 * request.dt;
        limited(noise.as_ref().map_or(wanted, |noise| noise.added(wanted, time, velocity)), velocity, request.vehicle)
    };
    let from = (start.s, start.velocity);
    integrate(from, n_points, request.dt, free, |point, s, velocity| drive(conflicts, point, s, velocity));
    conflicts.decide(request, &ego, deference, free);
    integrate(from, n_points, request.dt, motions, |point, s, velocity| drive(conflicts, point, s, velocity));
    match path_motion::trajectory(request, path, &start, motions, RETURN_TIME) {
        Some(trajectory) => PlanResult::planned(trajectory, f64::NAN),
        None => refused(request, "its path bends too tightly where it is"),
    }
}
