//! Driving the route's reference path with the Intelligent Driver Model.

use super::arrival;
use super::car_following::{CarFollowing, integrate, limited, positive};
use super::conflicts::Ego;
use super::frame::Start;
use super::speed_profile::SpeedLimits;
use super::{PlanRequest, PlanResult, PlanningMemory, path_motion, planned, refused};
use crate::error::Result;

/// An offset from the path is given up in this time [s].
pub(super) const RETURN_TIME: f64 = 4.0;
/// Least desired speed of an agent whose goal says nothing about where or how fast, or is over [m/s]: that of city
/// traffic in Treiber and Kesting 2013, table 11.2. The present speed would not do: behind a leader it would fall for ever.
const CRUISE_VELOCITY_MIN: f64 = 15.0;

/// Parameters of the planner `idm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdmSettings {
    /// The car-following model.
    pub law: CarFollowing,
    /// Upper bound of the desired speed v0 [m/s]; below it the goal, curves and speed limits decide.
    pub desired_velocity_max: f64,
    /// Lateral acceleration in curves [m/s²].
    pub lateral_acceleration: f64,
}

impl Default for IdmSettings {
    fn default() -> Self {
        Self { law: CarFollowing::default(), desired_velocity_max: f64::INFINITY, lateral_acceleration: 3.0 }
    }
}

impl IdmSettings {
    /// Checks every field.
    ///
    /// # Errors
    /// `InvalidInput` naming the field and what is expected.
    pub fn validate(&self) -> Result<()> {
        self.law.validate()?;
        positive("desired_velocity_max", self.desired_velocity_max, f64::INFINITY)?;
        positive("lateral_acceleration", self.lateral_acceleration, 100.0)
    }

    /// Desired speed from the goal alone [m/s].
    pub(super) fn goal_velocity(&self, request: &PlanRequest, start: &Start) -> f64 {
        let (velocity, _) = arrival::desired(request, start, self.law.deceleration, CRUISE_VELOCITY_MIN);
        velocity.min(self.desired_velocity_max).min(request.vehicle.velocity_max)
    }
}

/// The plan for a request.
pub(super) fn plan(
    request: &PlanRequest,
    settings: &IdmSettings,
    limits: &SpeedLimits,
    memory: &mut PlanningMemory,
) -> PlanResult {
    let path = &request.route.path;
    // Recorded initial yaw rates are noisy; all later ones come from a plan.
    let start = match Start::new(request, request.previous.is_some()) {
        Ok(start) => start,
        Err(reason) => return refused(request, memory, &format!("the agent {reason}")),
    };
    let n_points = request.predictions.n_steps + 1;
    let law = &settings.law;
    let ego = Ego::new(request, path, (start.s, start.velocity, start.d), RETURN_TIME);
    let PlanningMemory { conflicts, speed_profile, motions, free, road, .. } = memory;
    conflicts.collect(request, &ego, n_points);
    speed_profile.fill(path, limits, (start.s, ego.reach), settings.lateral_acceleration, law.deceleration);
    let wish = settings.goal_velocity(request, &start);
    let drive = |conflicts: &super::conflicts::Conflicts, point: usize, s: f64, velocity: f64| {
        let free = law.free(velocity, wish.min(speed_profile.at(s)));
        // The model adds both parts; `allowed` holds the acceleration of a free road.
        let taken = conflicts.allowed(point, &ego, s, velocity, law) - law.acceleration;
        limited(free + taken.min(0.0), velocity, request.vehicle)
    };
    let from = (start.s, start.velocity);
    integrate(from, n_points, request.dt, free, |point, s, velocity| drive(conflicts, point, s, velocity));
    conflicts.decide(request, &ego, free);
    integrate(from, n_points, request.dt, motions, |point, s, velocity| drive(conflicts, point, s, velocity));
    match path_motion::trajectory_on_road(request, path, &start, motions, RETURN_TIME, road) {
        Some(trajectory) => planned(trajectory),
        None => refused(request, memory, "its path bends too tightly where it is"),
    }
}
