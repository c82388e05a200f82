//! Points of simulated motions.

use super::PlanRequest;
use crate::geometry::Point;
use crate::geometry::shape::OrientedBox;

/// A vehicle at one time of a simulated motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct DrivenPoint {
    /// Centre of the footprint, and the unit vector along the heading.
    pub(super) center: Point,
    pub(super) axis: Point,
    pub(super) theta: f64,
    /// Of the rear axle's path [1/m].
    pub(super) curvature: f64,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    /// Arc length and offset of the rear axle on the reference path [m].
    pub(super) s: f64,
    pub(super) d: f64,
}

impl DrivenPoint {
    pub(super) fn footprint(&self, request: &PlanRequest) -> OrientedBox {
        let (half_length, half_width) = (0.5 * request.vehicle.length, 0.5 * request.vehicle.width);
        OrientedBox { center: self.center, axis: self.axis, half_length, half_width }
    }
}
