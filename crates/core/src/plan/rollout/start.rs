//! Where a plan starts: any state of a vehicle, in the frame of its path.

use super::super::PlanRequest;
use super::super::frame::project;
use crate::conduct::STANDSTILL_SPEED;
use crate::geometry::Point;

/// Where the agent is on its path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::plan) struct Start {
    /// Arc length and offset of the rear axle [m].
    pub(in crate::plan) s: f64,
    pub(in crate::plan) d: f64,
    /// The rear axle, and the heading [rad].
    pub(in crate::plan) axle: Point,
    pub(in crate::plan) theta: f64,
    /// Speed forwards [m/s]; a vehicle that rolls backwards has none.
    pub(in crate::plan) velocity: f64,
    /// Speed along the heading if the vehicle rolls backwards, not positive [m/s].
    pub(in crate::plan) rolling: f64,
    /// Curvature of the rear axle's path [1/m].
    pub(in crate::plan) curvature: f64,
    /// The wheels may be turned before the vehicle moves.
    pub(in crate::plan) stands: bool,
}

impl Start {
    /// The yaw rate counts as stated, or is that of the path; `None` if the agent is not beside its path.
    pub(super) fn new(request: &PlanRequest, yaw_rate_counts: bool) -> Option<Self> {
        let (path, vehicle, state) = (&request.route.path, request.vehicle, &request.state);
        let axle = vehicle.rear_axle_from_center(state.pose());
        let (s, d) = project(path, axle, request.s_hint)?;
        let (velocity, rolling) = (state.velocity.max(0.0), state.velocity.min(0.0));
        let at = path.at(s);
        // A vehicle that enters within a turn turns its wheels like the path.
        let along = at.curvature / at.stretch(d).max(0.3);
        let stands = state.velocity.abs() <= STANDSTILL_SPEED;
        let stated = if stands { along } else { state.yaw_rate / state.velocity };
        let limit = vehicle.curvature_max();
        let curvature = if yaw_rate_counts { stated } else { along }.clamp(-limit, limit);
        Some(Self { s, d, axle, theta: state.orientation, velocity, rolling, curvature, stands })
    }
}
