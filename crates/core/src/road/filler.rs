//! Drivable pieces between lanelets and beyond their ends.

use crate::geometry::Point;

/// A drivable piece that belongs to no lanelet.
#[derive(Debug, Clone)]
pub(super) struct Filler {
    /// Left and right side, equally many points.
    pub(super) left: Vec<Point>,
    pub(super) right: Vec<Point>,
    /// Borders that may be road edges; drivable is what lies to the right of them.
    pub(super) borders: Vec<Vec<Point>>,
}
