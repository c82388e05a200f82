//! Points, poses and angles. SI units and radians; unless a name says otherwise, coordinates are in the world frame
//! (x east, y north, orientation counter-clockwise from the x axis).

pub(crate) mod clipping;
pub(crate) mod directions;
pub mod polyline;
pub mod shape;

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul, Neg, Sub};

use crate::limits::is_possible;

/// A point or a vector in the plane [m].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// First coordinate [m].
    pub x: f64,
    /// Second coordinate [m].
    pub y: f64,
}

impl Point {
    /// From its coordinates [m].
    #[inline(always)]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// Unit vector in the direction of an angle [rad].
    #[inline(always)]
    pub fn from_angle(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { x: cos, y: sin }
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// z component of the cross product: positive if `other` lies to the left of `self`.
    #[inline(always)]
    pub fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Length squared [m²].
    #[inline(always)]
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// Length [m].
    #[inline(always)]
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// Distance to another point [m].
    #[inline(always)]
    pub fn distance(self, other: Self) -> f64 {
        (self - other).norm()
    }

    /// Left normal: rotated by +90 degrees.
    #[inline(always)]
    pub fn left(self) -> Self {
        Self { x: -self.y, y: self.x }
    }

    /// Angle from the x axis [rad], in (-pi, pi].
    #[inline(always)]
    pub fn angle(self) -> f64 {
        self.y.atan2(self.x)
    }

    /// Point between `self` (fraction 0) and `other` (fraction 1).
    #[inline(always)]
    pub fn lerp(self, other: Self, fraction: f64) -> Self {
        self + (other - self) * fraction
    }

    /// Both coordinates are numbers.
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }

    /// Both coordinates are numbers that a place can have (see [`crate::limits`]).
    #[inline(always)]
    pub fn is_possible(self) -> bool {
        is_possible(self.x) && is_possible(self.y)
    }
}

impl Add for Point {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for Point {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Mul<f64> for Point {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
    }
}

impl Neg for Point {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y }
    }
}

/// Position and orientation in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Position [m].
    pub position: Point,
    /// Orientation [rad].
    pub orientation: f64,
}

impl Pose {
    /// From position [m] and orientation [rad].
    #[inline]
    pub const fn new(x: f64, y: f64, orientation: f64) -> Self {
        Self { position: Point::new(x, y), orientation }
    }

    /// World coordinates of a point given in the body frame of this pose.
    #[inline]
    pub fn world_from_body(&self, point_in_body: Point) -> Point {
        let axis = Point::from_angle(self.orientation);
        self.position + axis * point_in_body.x + axis.left() * point_in_body.y
    }

    /// Body-frame coordinates of a point given in the world frame.
    #[inline]
    pub fn body_from_world(&self, point_in_world: Point) -> Point {
        let axis = Point::from_angle(self.orientation);
        let delta = point_in_world - self.position;
        Point::new(delta.dot(axis), axis.cross(delta))
    }
}

/// Axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Lower left corner.
    pub min: Point,
    /// Upper right corner.
    pub max: Point,
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self =
        Self { min: Point::new(f64::INFINITY, f64::INFINITY), max: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY) };

    /// Smallest box around the points; `EMPTY` for none.
    pub fn around(points: impl IntoIterator<Item = Point>) -> Self {
        points.into_iter().fold(Self::EMPTY, |aabb, point| aabb.including(point))
    }

    /// Smallest box that also contains the point.
    #[inline]
    pub fn including(self, point: Point) -> Self {
        Self {
            min: Point::new(self.min.x.min(point.x), self.min.y.min(point.y)),
            max: Point::new(self.max.x.max(point.x), self.max.y.max(point.y)),
        }
    }

    /// Smallest box that contains both.
    #[inline]
    pub fn union(self, other: Self) -> Self {
        self.including(other.min).including(other.max)
    }

    /// Larger by `margin` [m] on every side.
    #[inline]
    pub fn grown(self, margin: f64) -> Self {
        let shift = Point::new(margin, margin);
        Self { min: self.min - shift, max: self.max + shift }
    }

    /// The boxes share a point.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.x <= other.max.x && other.min.x <= self.max.x && self.min.y <= other.max.y && other.min.y <= self.max.y
    }

    /// The point lies inside or on the edge.
    #[inline]
    pub fn contains(&self, point: Point) -> bool {
        self.min.x <= point.x && point.x <= self.max.x && self.min.y <= point.y && point.y <= self.max.y
    }
}

/// The same direction as `angle` [rad], in (-pi, pi].
#[inline]
pub fn wrap_angle(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_wrapped_into_the_half_open_interval() {
        for (angle, wrapped) in [(0.0, 0.0), (PI, PI), (-PI, PI), (3.0 * PI, PI), (TAU + 0.5, 0.5), (-TAU - 0.5, -0.5)]
        {
            assert!((wrap_angle(angle) - wrapped).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn body_and_world_frames_are_inverse() {
        let pose = Pose::new(3.0, -2.0, 0.7);
        let point = Point::new(1.5, -0.4);
        let back = pose.body_from_world(pose.world_from_body(point));
        assert!(back.distance(point) < 1e-12);
        // One metre ahead of a vehicle that faces north is one metre further north.
        let ahead = Pose::new(0.0, 0.0, PI / 2.0).world_from_body(Point::new(1.0, 0.0));
        assert!(ahead.distance(Point::new(0.0, 1.0)) < 1e-12);
    }
}
