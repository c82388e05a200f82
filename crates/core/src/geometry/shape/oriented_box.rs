//! The planner's rectangle: cheap to copy, compared millions of times per step.

use super::TOUCHING_DISTANCE;
use crate::geometry::{Aabb, Point, Pose};

/// Rectangle at any angle, world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrientedBox {
    /// Centre [m].
    pub center: Point,
    /// Unit vector along the length.
    pub axis: Point,
    /// Half of the length [m].
    pub half_length: f64,
    /// Half of the width [m].
    pub half_width: f64,
}

impl OrientedBox {
    /// Box of a length and a width [m], centred on the pose.
    #[inline]
    pub fn new(pose: Pose, length: f64, width: f64) -> Self {
        Self {
            center: pose.position,
            axis: Point::from_angle(pose.orientation),
            half_length: 0.5 * length,
            half_width: 0.5 * width,
        }
    }

    /// Its centre, heading along its length.
    pub fn pose(&self) -> Pose {
        Pose { position: self.center, orientation: self.axis.angle() }
    }

    /// The boxes share a point; touching counts.
    ///
    /// Separating axes: two rectangles are apart exactly if one of their four side directions separates them.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        let offset = other.center - self.center;
        // (r1 + r2)² <= 2 (r1² + r2²): circles around both boxes are apart, found without a square root.
        if offset.norm_squared() > 2.0 * (self.radius_squared() + other.radius_squared()) + TOUCHING_DISTANCE {
            return false;
        }
        let cos = self.axis.dot(other.axis).abs();
        let sin = self.axis.cross(other.axis).abs();
        let (a, b) = (self, other);
        offset.dot(a.axis).abs() <= a.half_length + b.half_length * cos + b.half_width * sin + TOUCHING_DISTANCE
            && a.axis.cross(offset).abs() <= a.half_width + b.half_length * sin + b.half_width * cos + TOUCHING_DISTANCE
            && offset.dot(b.axis).abs() <= b.half_length + a.half_length * cos + a.half_width * sin + TOUCHING_DISTANCE
            && b.axis.cross(offset).abs() <= b.half_width + a.half_length * sin + a.half_width * cos + TOUCHING_DISTANCE
    }

    /// The box and the straight segment from `start` to `end` share a point; touching counts.
    #[inline]
    pub fn overlaps_segment(&self, start: Point, end: Point) -> bool {
        let middle = self.body_from_world((start + end) * 0.5);
        let half = (end - start) * 0.5;
        let half = Point::new(half.dot(self.axis), self.axis.cross(half));
        let (reach_x, reach_y) = (half.x.abs(), half.y.abs());
        middle.x.abs() <= self.half_length + reach_x + TOUCHING_DISTANCE
            && middle.y.abs() <= self.half_width + reach_y + TOUCHING_DISTANCE
            // The third axis is the segment's normal, not normalised: the tolerance scales with the segment.
            && middle.cross(half).abs()
                <= self.half_length * reach_y + self.half_width * reach_x + TOUCHING_DISTANCE * (reach_x + reach_y)
    }

    /// The point lies inside or on the edge.
    #[inline]
    pub fn contains(&self, point: Point) -> bool {
        let local = self.body_from_world(point);
        local.x.abs() <= self.half_length + TOUCHING_DISTANCE && local.y.abs() <= self.half_width + TOUCHING_DISTANCE
    }

    /// Corners, counter-clockwise: front left, rear left, rear right, front right.
    #[inline]
    pub fn corners(&self) -> [Point; 4] {
        let ahead = self.axis * self.half_length;
        let left = self.axis.left() * self.half_width;
        let (front, rear) = (self.center + ahead, self.center - ahead);
        [front + left, rear + left, rear - left, front - left]
    }

    /// Larger by `margin` [m] on every side.
    #[inline]
    pub fn grown(self, margin: f64) -> Self {
        Self { half_length: self.half_length + margin, half_width: self.half_width + margin, ..self }
    }

    /// Smallest axis-aligned box around it.
    #[inline]
    pub fn aabb(&self) -> Aabb {
        let reach = Point::new(
            self.half_length * self.axis.x.abs() + self.half_width * self.axis.y.abs(),
            self.half_length * self.axis.y.abs() + self.half_width * self.axis.x.abs(),
        );
        Aabb { min: self.center - reach, max: self.center + reach }
    }

    /// Distance from the centre to the corners [m].
    #[inline(always)]
    pub fn radius(&self) -> f64 {
        self.radius_squared().sqrt()
    }

    /// Smallest box in the mean direction of both that contains both.
    ///
    /// For the boxes of one body at two near times this covers what it sweeps, up to the bulge of the arcs on which
    /// its corners turn (half diagonal times an eighth of the turn squared: 3 mm for a car that turns by 0.1 rad).
    #[inline(always)]
    pub fn spanning(a: &Self, b: &Self) -> Self {
        // A box and the same box turned by half a turn are one: take the sense of `b` that is nearer to `a`.
        let sum = if a.axis.dot(b.axis) < 0.0 { a.axis - b.axis } else { a.axis + b.axis };
        // At most a quarter turn lies between the axes, so the sum is at least sqrt(2) long.
        let axis = sum * (1.0 / sum.norm());
        let offset = b.center - a.center;
        let (ahead, half_length) = Self::span(a, b, offset, axis);
        let (left, half_width) = Self::span(a, b, offset, axis.left());
        Self { center: a.center + axis * ahead + axis.left() * left, axis, half_length, half_width }
    }

    /// Middle and half of what both cover along a unit vector [m], from the centre of `a`.
    #[inline(always)]
    fn span(a: &Self, b: &Self, offset: Point, along: Point) -> (f64, f64) {
        let (half_a, half_b, at_b) = (a.half_extent(along), b.half_extent(along), offset.dot(along));
        let low = (-half_a).min(at_b - half_b);
        let high = half_a.max(at_b + half_b);
        (0.5 * (low + high), 0.5 * (high - low))
    }

    /// Half of the extent along a unit vector [m].
    #[inline(always)]
    fn half_extent(&self, along: Point) -> f64 {
        self.half_length * self.axis.dot(along).abs() + self.half_width * self.axis.cross(along).abs()
    }

    #[inline(always)]
    fn radius_squared(&self) -> f64 {
        self.half_length * self.half_length + self.half_width * self.half_width
    }

    #[inline]
    fn body_from_world(&self, point: Point) -> Point {
        let delta = point - self.center;
        Point::new(delta.dot(self.axis), self.axis.cross(delta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::{Lcg, Shape};
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    fn car(x: f64, y: f64, orientation: f64) -> OrientedBox {
        OrientedBox::new(Pose::new(x, y, orientation), 4.0, 2.0)
    }

    #[test]
    fn boxes_overlap_exactly_if_no_side_direction_separates_them() {
        // (x, y, orientation) of the other car; the first one is at the origin and covers [-2, 2] x [-1, 1].
        for (x, y, orientation, expected) in [
            (3.99, 0.0, 0.0, true),
            (4.0, 0.0, 0.0, true), // bumper to bumper
            (4.01, 0.0, 0.0, false),
            (0.0, 2.0, PI, true), // door to door, facing backwards
            (0.0, 2.01, PI, false),
            (3.0, 0.0, FRAC_PI_2, true), // crosswise: 2 + 1
            (3.01, 0.0, FRAC_PI_2, false),
            (2.0 + 1.5 * 2f64.sqrt(), 0.0, FRAC_PI_4, true), // corner on the front: 1.5 sqrt(2) ahead of the centre
            (2.001 + 1.5 * 2f64.sqrt(), 0.0, FRAC_PI_4, false),
            (3.4, 2.4, FRAC_PI_4, true), // its rear on the line x + y = 5.8 - 2 sqrt(2), beyond the corner (2, 1)
            (3.45, 2.45, FRAC_PI_4, false), // 5.9 - 2 sqrt(2) > 3
            (3.4, 2.4, -FRAC_PI_4, false), // its side on x + y = 5.8 - sqrt(2)
        ] {
            assert_eq!(car(0.0, 0.0, 0.0).overlaps(&car(x, y, orientation)), expected, "{x} {y} {orientation}");
            assert_eq!(
                car(x, y, orientation).overlaps(&car(0.0, 0.0, 0.0)),
                expected,
                "{x} {y} {orientation}, swapped"
            );
        }
    }

    #[test]
    fn a_segment_meets_a_box_inside_across_or_at_a_corner() {
        for (start, end, expected) in [
            ((-1.0, 0.0), (1.0, 0.0), true),    // inside
            ((-9.0, 0.5), (9.0, -0.5), true),   // across
            ((-9.0, 1.0), (9.0, 1.0), true),    // along the side
            ((-9.0, 1.01), (9.0, 1.01), false), // beside
            ((2.5, 0.0), (3.0, 0.0), false),    // ahead
            ((1.0, 2.0), (3.0, 0.0), true),     // through the corner (2, 1)
            ((1.0, 2.01), (3.0, 0.01), false),  // past it
            ((0.0, 0.0), (0.0, 0.0), true),     // a point
        ] {
            let (a, b) = (Point::new(start.0, start.1), Point::new(end.0, end.1));
            for turn in [0.0, 0.7, -2.5] {
                let pose = Pose::new(100.0, -20.0, turn);
                let box_ = OrientedBox::new(pose, 4.0, 2.0);
                let found = box_.overlaps_segment(pose.world_from_body(a), pose.world_from_body(b));
                assert_eq!(found, expected, "{start:?} {end:?} turned by {turn}");
            }
        }
    }

    #[test]
    fn the_spanning_box_holds_all_corners_and_is_tight_along_a_straight_drive() {
        let span = OrientedBox::spanning(&car(0.0, 0.0, 0.3), &OrientedBox::new(Pose::new(5.0, 1.0, 0.5), 4.0, 2.0));
        for corner in car(0.0, 0.0, 0.3).corners().into_iter().chain(car(5.0, 1.0, 0.5).corners()) {
            assert!(span.contains(corner), "{corner:?}");
        }
        assert!((span.axis.angle() - 0.4).abs() < 1e-12);
        let straight = OrientedBox::spanning(&car(0.0, 0.0, 0.0), &car(3.0, 0.0, PI));
        assert!((straight.half_length - 3.5).abs() < 1e-12 && (straight.half_width - 1.0).abs() < 1e-12);
        assert!(straight.center.distance(Point::new(1.5, 0.0)) < 1e-12);
    }

    #[test]
    fn the_axis_aligned_box_encloses_the_corners_tightly() {
        let box_ = car(7.0, -3.0, 1.1);
        let (tight, found) = (Aabb::around(box_.corners()), box_.aabb());
        assert!(tight.min.distance(found.min) < 1e-12 && tight.max.distance(found.max) < 1e-12);
        assert_eq!(box_.grown(0.5).half_width, 1.5);
    }

    #[test]
    fn boxes_and_shapes_agree_on_random_pairs() {
        let mut random = Lcg::new(7);
        let (mut overlapping, n) = (0, 20_000);
        for _ in 0..n {
            let (length, width) = (random.within(0.5, 12.0), random.within(0.5, 3.0));
            let pose = Pose::new(random.within(-8.0, 8.0), random.within(-8.0, 8.0), random.within(-4.0, 4.0));
            let other = Pose::new(1.0, 2.0, random.within(-4.0, 4.0));
            let by_box = OrientedBox::new(pose, length, width).overlaps(&OrientedBox::new(other, 4.5, 1.8));
            let by_shape = Shape::rectangle(length, width).overlaps(pose, &Shape::rectangle(4.5, 1.8), other);
            assert_eq!(by_box, by_shape, "{pose:?} {length} {width} {other:?}");
            overlapping += usize::from(by_box);
        }
        assert!((n / 10..n * 9 / 10).contains(&overlapping), "{overlapping} of {n}: the sample must hold both cases");
    }
}
