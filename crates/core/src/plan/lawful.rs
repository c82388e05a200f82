//! Driving the route's reference path as fast as is lawful, with the Intelligent Driver Model.

use super::car_following::CarFollowing;
use super::frame::Start;
use super::idm::{Following, follow_path};
use super::path_motion::RETURN_TIME;
use super::speed_profile::SpeedProfile;
use super::{PlanRequest, PlanResult, PlanningMemory, refused};
use crate::conduct::STATIONARY_SPEED;
use crate::settings::{between, positive, settings};

/// It reaches a lawful speed that falls within this time [s], ...
pub(super) const SLOWING_TIME: f64 = 0.5;
/// ... but brakes no harder for it [m/s²].
pub(super) const SLOWING_MAX: f64 = 3.0;
/// Where no limit is stated, the nearest one counts that is stated on the path within this distance [m].
pub(super) const STATED_WITHIN: f64 = 50.0;
/// Where none is stated within that, at least this speed is lawful [m/s], ...
const UNSTATED_VELOCITY_MIN: f64 = 5.0;
/// ... and the median speed of what moves within this distance [m] and this angle to the agent's heading (cosine).
const TRAFFIC_WITHIN: f64 = 100.0;
const TRAFFIC_HEADING_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

settings! {
    /// Drives the reference path of its route with the Intelligent Driver Model, as `Idm`, but at the lawful speed.
    ///
    /// The desired speed is the lawful free-flow speed: the speed limit, the speed that curves allow and the vehicle's
    /// largest speed, whichever is least. It knows no time of its goal. Where no limit is stated, the nearest one on the
    /// path within 50 m counts, else the largest of 5 m/s, the speed at which it entered, and the median speed of what
    /// moves its way within 100 m. See docs/reference/planners.md.
    pub struct LawfulSettings as Lawful(
        law: CarFollowing = CarFollowing { acceleration: 1.5, deceleration: 2.0, ..CarFollowing::default() }
    ) {
        /// Factor applied to the lawful speed.
        speed_factor: f64 = 1.0, between(0.01, 10.0);
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit.
        lateral_acceleration: f64 ["m/s²"] = 4.0, positive(100.0);
    }
}

/// The plan for a request.
pub(super) fn plan(request: &PlanRequest, settings: &LawfulSettings, memory: &mut PlanningMemory) -> PlanResult {
    let start = match Start::new(request, request.previous.is_some()) {
        Ok(start) => start,
        Err(reason) => return refused(request, &format!("the agent {reason}")),
    };
    let lawful = lawful_velocity(request);
    let v_max = request.vehicle.velocity_max;
    let law = &settings.law;
    let free = |profile: &SpeedProfile, s: f64, velocity: f64| {
        let desired = |s: f64| settings.speed_factor * profile.at(s).min(v_max);
        // The model alone falls behind where the lawful speed falls.
        let slowing = (desired(s + velocity * SLOWING_TIME) - velocity) / SLOWING_TIME;
        law.free(velocity, desired(s)).min(slowing.max(-SLOWING_MAX))
    };
    let following = Following {
        law,
        improved: 0.0,
        lateral_acceleration: settings.lateral_acceleration,
        noise: None,
        place: (0.0, RETURN_TIME),
    };
    follow_path(request, &following, start, (lawful, free), memory)
}

/// The speed that is lawful at an arc length [m/s], but for bends.
pub(super) fn lawful_velocity<'a>(request: &PlanRequest<'a>) -> impl Fn(f64) -> f64 + 'a {
    let limits = &request.rules.way.limits;
    let unstated = unstated_velocity(request);
    move |s: f64| limits.nearest(s, STATED_WITHIN).unwrap_or(unstated)
}

/// What counts as lawful where no limit is stated [m/s].
fn unstated_velocity(request: &PlanRequest) -> f64 {
    let own = request.state;
    let moves_along = |other: &super::Other| {
        let near = (other.pose.position - own.pose().position).norm() <= TRAFFIC_WITHIN;
        let along = (other.pose.orientation - own.orientation).cos() >= TRAFFIC_HEADING_COSINE;
        near && along && other.velocity > STATIONARY_SPEED
    };
    let mut speeds: Vec<f64> = request.others.iter().filter(|o| moves_along(o)).map(|o| o.velocity).collect();
    speeds.sort_by(f64::total_cmp);
    let n = speeds.len();
    let median = if n == 0 { 0.0 } else { 0.5 * (speeds[(n - 1) / 2] + speeds[n / 2]) };
    UNSTATED_VELOCITY_MIN.max(request.entry.velocity).max(median)
}
