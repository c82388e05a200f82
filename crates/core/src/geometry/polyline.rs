//! Curves: the polyline as it was given, and the smooth reference path that is made from one.

mod reference;
mod smoothing;

pub use reference::{PathPoint, ReferencePath};

use std::ops::Range;

use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::limits::NUMBER_MAX;

/// Consecutive vertices closer than this [m] count as one.
const DUPLICATE_DISTANCE: f64 = 1e-6;

/// At least two points, consecutive ones at least 1e-6 m apart, with arc lengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    points: Vec<Point>,
    arc_lengths: Vec<f64>,
}

/// Foot of a point on a polyline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Arc length of the foot [m].
    pub s: f64,
    /// Distance to the foot [m], positive to the left of the segment with the foot.
    pub d: f64,
    /// Distance to the foot [m], never negative.
    pub distance: f64,
}

impl Polyline {
    /// From its vertices; those closer than 1e-6 m to the one before are dropped.
    ///
    /// # Errors
    /// `InvalidInput` if a coordinate is not a number or beyond [`NUMBER_MAX`], or fewer than two vertices are left.
    pub fn new(points: &[Point]) -> Result<Self> {
        if let Some(index) = points.iter().position(|point| !point.is_possible()) {
            return Err(Error::invalid(format!("vertex {index} of a polyline is not a number up to {NUMBER_MAX:e}")));
        }
        let mut kept: Vec<Point> = Vec::with_capacity(points.len());
        for &point in points {
            if kept.last().is_none_or(|last| last.distance(point) > DUPLICATE_DISTANCE) {
                kept.push(point);
            }
        }
        if kept.len() < 2 {
            return Err(Error::invalid(format!(
                "a polyline needs two different vertices, {} of {} are",
                kept.len(),
                points.len()
            )));
        }
        let mut arc_lengths = Vec::with_capacity(kept.len());
        arc_lengths.push(0.0);
        let mut length = 0.0;
        for pair in kept.windows(2) {
            length += pair[0].distance(pair[1]);
            arc_lengths.push(length);
        }
        Ok(Self { points: kept, arc_lengths })
    }

    /// Vertices, world frame [m].
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Arc length of every vertex [m], the first is 0.
    pub fn arc_lengths(&self) -> &[f64] {
        &self.arc_lengths
    }

    /// Arc length of the last vertex [m].
    pub fn length(&self) -> f64 {
        self.arc_lengths[self.arc_lengths.len() - 1]
    }

    /// Index of the segment that holds the arc length, clamped to the ends.
    pub(crate) fn segment_at(&self, s: f64) -> usize {
        self.arc_lengths.partition_point(|arc_length| *arc_length <= s).clamp(1, self.points.len() - 1) - 1
    }

    /// Point at an arc length [m], clamped to the ends.
    pub fn at(&self, s: f64) -> Point {
        let i = self.segment_at(s);
        let (start, end) = (self.arc_lengths[i], self.arc_lengths[i + 1]);
        self.points[i].lerp(self.points[i + 1], ((s - start) / (end - start)).clamp(0.0, 1.0))
    }

    /// Unit vector of the segment at an arc length [m]; at a vertex that of the segment that starts there.
    pub fn direction_at(&self, s: f64) -> Point {
        let i = self.segment_at(s);
        let delta = self.points[i + 1] - self.points[i];
        delta * (1.0 / delta.norm())
    }

    /// Nearest foot over all segments; a point beyond an end has its foot at the end.
    pub fn project(&self, point: Point) -> Projection {
        self.nearest_foot(point, 0..self.points.len() - 1, |_, _| (0.0, 1.0))
    }

    /// Nearest foot among the arc lengths from `from` to `to` [m], which are clamped to the ends.
    pub fn project_between(&self, point: Point, from: f64, to: f64) -> Projection {
        let segments = self.segment_at(from)..self.segment_at(to.max(from)) + 1;
        self.nearest_foot(point, segments, |start, span| {
            let (low, high) = (((from - start) / span).clamp(0.0, 1.0), ((to - start) / span).clamp(0.0, 1.0));
            (low, high.max(low))
        })
    }

    /// The nearest foot on some segments, of each between two fractions of it, which depend on its start and length
    /// [m]; the first one of equals.
    #[inline(always)]
    fn nearest_foot(
        &self,
        point: Point,
        segments: Range<usize>,
        fractions: impl Fn(f64, f64) -> (f64, f64),
    ) -> Projection {
        let (mut best, mut least) = (Projection { s: 0.0, d: 0.0, distance: f64::INFINITY }, f64::INFINITY);
        for i in segments {
            let (delta, offset) = (self.points[i + 1] - self.points[i], point - self.points[i]);
            let (start, span) = (self.arc_lengths[i], self.arc_lengths[i + 1] - self.arc_lengths[i]);
            let (low, high) = fractions(start, span);
            let fraction = (offset.dot(delta) / delta.norm_squared()).max(low).min(high);
            let squared = (offset - delta * fraction).norm_squared();
            if squared < least {
                let distance = squared.sqrt();
                if distance < best.distance {
                    best =
                        Projection { s: start + fraction * span, d: distance.copysign(delta.cross(offset)), distance };
                    least = squared;
                }
            }
        }
        best
    }

    /// Points at uniform arc lengths, first and last vertex included; the spacing [m] is adjusted to divide the length.
    pub fn resampled(&self, spacing: f64) -> Vec<Point> {
        let n = (self.length() / spacing).round().max(1.0) as usize;
        let step = self.length() / n as f64;
        let mut points = Vec::with_capacity(n + 1);
        let mut segment = 0;
        for k in 0..n {
            let s = k as f64 * step;
            while self.arc_lengths[segment + 1] < s {
                segment += 1;
            }
            let fraction =
                (s - self.arc_lengths[segment]) / (self.arc_lengths[segment + 1] - self.arc_lengths[segment]);
            points.push(self.points[segment].lerp(self.points[segment + 1], fraction));
        }
        points.push(self.points[self.points.len() - 1]);
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner() -> Polyline {
        let points = [(0.0, 0.0), (10.0, 0.0), (10.0, 1e-8), (10.0, 5.0)].map(|(x, y)| Point::new(x, y));
        Polyline::new(&points).expect("valid")
    }

    #[test]
    fn near_duplicates_are_dropped_and_arc_lengths_add_up() {
        assert_eq!(corner().arc_lengths(), [0.0, 10.0, 15.0]);
    }

    #[test]
    fn fewer_than_two_different_vertices_or_nan_are_refused() {
        let point = Point::new(1.0, 1.0);
        for points in [vec![], vec![point], vec![point, point], vec![point, Point::new(f64::NAN, 0.0)]] {
            assert!(matches!(Polyline::new(&points), Err(Error::InvalidInput(_))), "{points:?}");
        }
    }

    #[test]
    fn arc_lengths_beyond_the_ends_are_clamped() {
        for (s, x, y) in [(-1.0, 0.0, 0.0), (4.0, 4.0, 0.0), (12.0, 10.0, 2.0), (99.0, 10.0, 5.0)] {
            assert_eq!(corner().at(s), Point::new(x, y), "s = {s}");
        }
        assert_eq!(corner().direction_at(99.0), Point::new(0.0, 1.0));
    }

    #[test]
    fn the_nearest_foot_is_found_with_the_left_side_positive() {
        for (x, y, s, d) in
            [(3.0_f64, 2.0_f64, 3.0_f64, 2.0_f64), (3.0, -1.0, 3.0, -1.0), (8.0, 3.0, 13.0, 2.0), (-3.0, 4.0, 0.0, 5.0)]
        {
            let foot = corner().project(Point::new(x, y));
            assert_eq!((foot.s, foot.d, foot.distance), (s, d, d.abs()), "({x}, {y})");
        }
    }

    #[test]
    fn resampling_keeps_both_ends_and_divides_the_length_evenly() {
        let points = corner().resampled(4.0);
        assert_eq!(points.len(), 5);
        assert_eq!((points[0], points[4]), (Point::new(0.0, 0.0), Point::new(10.0, 5.0)));
        assert_eq!(points[1], Point::new(3.75, 0.0));
    }
}
