//! Driving the route's reference path with the Intelligent Driver Model.

use super::arrival;
use super::car_following::{CarFollowing, integrate, limited};
use super::conflicts::{Deference, Ego};
use super::frame::Start;
use super::path_motion::RETURN_TIME;
use super::speed_profile::SpeedProfile;
use super::wavering::{Noise, PlaceInLane};
use super::{PlanRequest, PlanResult, PlanningMemory, path_motion, refused};
use crate::settings::{between, positive, settings};

/// Least desired speed of an agent whose goal says nothing about where or how fast, or is over [m/s]: that of city
/// traffic in Treiber and Kesting 2013, table 11.2. The present speed would not do: behind a leader it would fall for ever.
const CRUISE_VELOCITY_MIN: f64 = 15.0;

settings! {
    /// Drives the reference path of its route with the Intelligent Driver Model.
    ///
    /// Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and microscopic simulations", Phys.
    /// Rev. E 62, 2000, doi 10.1103/PhysRevE.62.1805; defaults and the braking above the desired speed as in
    /// Treiber and Kesting, "Traffic Flow Dynamics", 2013, section 11.3. With the gap s and the leader's speed vl the
    /// acceleration is a (1 - (v / v0)^exponent - (s* / s)²), s* = s0 + max(0, v T + v (v - vl) / (2 sqrt(a b))). The
    /// desired speed v0 brings it to its goal in time, within speed limits and low enough for curves. See
    /// docs/reference/planners.md.
    pub struct IdmSettings as Idm(law: CarFollowing, place: PlaceInLane) {
        /// Upper bound of the desired speed v0.
        desired_velocity_max: f64 ["m/s"] = f64::INFINITY, positive(f64::INFINITY);
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit.
        lateral_acceleration: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Share of the improved model (Treiber and Kesting 2013, section 11.3.7), in which who follows keeps its time gap
        /// at any speed below the desired one; in the plain one the gap grows as the speed nears it.
        improved: f64 = 0.0, between(0.0, 1.0);
    }
}

impl IdmSettings {
    /// Desired speed from the goal alone [m/s].
    pub(super) fn goal_velocity(&self, request: &PlanRequest, start: &Start) -> f64 {
        let (velocity, _) =
            arrival::desired(request, (start.s, start.velocity), self.law.deceleration, CRUISE_VELOCITY_MIN, None);
        velocity.min(self.desired_velocity_max).min(request.vehicle.velocity_max)
    }
}

/// The plan for a request.
pub(super) fn plan(request: &PlanRequest, settings: &IdmSettings, memory: &mut PlanningMemory) -> PlanResult {
    // Recorded initial yaw rates are noisy; all later ones come from a plan.
    let start = match Start::new(request, request.previous.is_some()) {
        Ok(start) => start,
        Err(reason) => return refused(request, &format!("the agent {reason}")),
    };
    let wish = settings.goal_velocity(request, &start);
    let limit = |s: f64| request.rules.way.limits.at(s);
    let law = &settings.law;
    let has_pace = request.goal.pace.is_some();
    let free = |profile: &SpeedProfile, s: f64, velocity: f64| {
        let braking = if has_pace { profile.braking(s, velocity, law.deceleration) } else { f64::INFINITY };
        law.free(velocity, wish.min(profile.at(s))).min(braking)
    };
    let aside = settings.place.aside_of_path(request, start.s);
    let following = Following {
        law,
        improved: settings.improved,
        lateral_acceleration: settings.lateral_acceleration,
        noise: settings.place.wavering.noise(),
        place: (aside, settings.place.time_to_reach(start.d - aside, start.velocity, RETURN_TIME)),
    };
    follow_path(request, &following, start, (limit, free), memory)
}

/// How a path is followed.
pub(super) struct Following<'a> {
    pub(super) law: &'a CarFollowing,
    /// Share of the improved model.
    pub(super) improved: f64,
    /// In curves [m/s²].
    pub(super) lateral_acceleration: f64,
    pub(super) noise: Option<Noise>,
    /// Where beside the path it wants to be, to the left [m], and when [s].
    pub(super) place: (f64, f64),
}

/// The plan along the reference path: at most as fast as `limit` says for an arc length [m] and curves allow. `free` is
/// the acceleration on a free road [m/s²] at an arc length [m] and a speed [m/s].
pub(super) fn follow_path(
    request: &PlanRequest,
    following: &Following<'_>,
    start: Start,
    (limit, free_road): (impl Fn(f64) -> f64, impl Fn(&SpeedProfile, f64, f64) -> f64),
    memory: &mut PlanningMemory,
) -> PlanResult {
    let &Following { law, improved, lateral_acceleration, ref noise, place } = following;
    let path = &request.route.path;
    let n_points = request.predictions.n_steps + 1;
    let ego = Ego { target: place.0, ..Ego::new(request, path, (start.s, start.velocity, start.d), place.1) };
    let PlanningMemory { conflicts, speed_profile, motions, free, .. } = memory;
    conflicts.collect(request, &ego, n_points, request.barriers(request.rules.way, start.s));
    let cornering = request.vehicle.cornering(lateral_acceleration);
    speed_profile.fill_below(path, limit, (start.s, ego.reach), cornering, law.deceleration);
    let deference = Deference::full(law.minimum_gap);
    let drive = |conflicts: &super::conflicts::Conflicts, point: usize, s: f64, velocity: f64| {
        let free = free_road(speed_profile, s, velocity);
        let follow = |gap: f64, leader: f64, _: f64| law.following(velocity, gap, leader);
        let allowed = conflicts.allowed(point, &ego, (s, velocity), deference, follow);
        let wanted = law.combined(free, allowed, improved);
        let time = (request.time_step + point as i64) as f64 * request.dt;
        limited(noise.as_ref().map_or(wanted, |noise| noise.added(wanted, time, velocity)), velocity, request.vehicle)
    };
    let from = (start.s, start.velocity);
    integrate(from, n_points, request.dt, free, |point, s, velocity| drive(conflicts, point, s, velocity));
    conflicts.decide(request, &ego, deference, free);
    integrate(from, n_points, request.dt, motions, |point, s, velocity| drive(conflicts, point, s, velocity));
    match path_motion::trajectory_on_road(request, path, &start, motions, place) {
        Some(trajectory) => PlanResult::planned(trajectory, f64::NAN),
        None => refused(request, "its path bends too tightly where it is"),
    }
}
