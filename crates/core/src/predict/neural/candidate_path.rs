//! The geometry of a candidate path: poses along it, path coordinates of points, crossings.

use super::index::{Candidates, Index, ROUNDING, STRIDE};
use crate::geometry::Point;

/// Paths begin this far behind the vehicle [m].
pub(super) const BEHIND: f64 = 50.0;

/// A path on which a vehicle may go on.
#[derive(Debug, Clone)]
pub struct CandidatePath {
    pub(super) points: Vec<Point>,
    pub(super) arc_lengths: Vec<f64>,
    pub(super) headings: Vec<f64>,
    index: Index,
    /// Offset of the vehicle now [m].
    pub offset: f64,
    /// Orientation of the vehicle minus heading of the path now [rad].
    pub heading_error: f64,
    /// How well this own lane fits, of all own lanes; 0 for other paths.
    pub share: f64,
    /// Width of the lane now [m]; 0 for the free path.
    pub width: f64,
    /// Speed limit of the lane now [m/s]; NaN: unknown.
    pub speed_limit: f64,
    /// Arc length at which the path leaves the known lanelets [m].
    pub end: f64,
}

impl Default for CandidatePath {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            arc_lengths: Vec::new(),
            headings: Vec::new(),
            index: Index::default(),
            offset: 0.0,
            heading_error: 0.0,
            share: 0.0,
            width: 0.0,
            speed_limit: f64::NAN,
            end: 0.0,
        }
    }
}

impl CandidatePath {
    /// A path without knots, in the memory of another one.
    pub(super) fn blank(memory: Option<Self>) -> Self {
        let Self { mut points, mut arc_lengths, mut headings, index, .. } = memory.unwrap_or_default();
        points.clear();
        arc_lengths.clear();
        headings.clear();
        Self { points, arc_lengths, headings, index, ..Self::default() }
    }

    /// Completes a path that has points and headings, the first at arc length `first`, by straight ends.
    pub(super) fn complete(&mut self, first: f64, reach: f64) {
        let Self { points, arc_lengths, headings, .. } = self;
        let n = points.len();
        let axis = Point::from_angle(headings[n - 1]);
        let mut length = 0.0;
        arc_lengths.push(first);
        for pair in points.windows(2) {
            length += pair[0].distance(pair[1]);
            arc_lengths.push(first + length);
        }
        let last = arc_lengths[n - 1];
        if last < reach - 1.0 {
            points.push(points[n - 1] + axis * (reach - last));
            headings.push(headings[n - 1]);
            arc_lengths.push(reach);
        }
        if first > 1.0 - BEHIND {
            let axis = Point::from_angle(headings[0]);
            points.insert(0, points[0] - axis * (first + BEHIND));
            headings.insert(0, headings[0]);
            arc_lengths.insert(0, -BEHIND);
        }
        self.build_index();
    }

    /// Once all points are there.
    pub(super) fn build_index(&mut self) {
        self.index.build(&self.points);
    }

    fn n_segments(&self) -> usize {
        self.points.len() - 1
    }

    /// Index of the segment that holds an arc length, clamped to the ends.
    pub(super) fn segment_at(&self, s: f64) -> usize {
        self.arc_lengths.partition_point(|arc_length| *arc_length <= s).clamp(1, self.n_segments()) - 1
    }

    /// Point and heading [rad] at an arc length [m]; straight on beyond the ends.
    pub fn pose_at(&self, s: f64) -> (Point, f64) {
        self.pose_on(self.segment_at(s), s)
    }

    fn pose_on(&self, i: usize, s: f64) -> (Point, f64) {
        let (start, end) = (self.arc_lengths[i], self.arc_lengths[i + 1]);
        let fraction = (s - start) / (end - start);
        let within = fraction.clamp(0.0, 1.0);
        let heading = self.headings[i] + within * (self.headings[i + 1] - self.headings[i]);
        let beyond = (fraction - within) * (end - start);
        let mut position = self.points[i].lerp(self.points[i + 1], within);
        if beyond != 0.0 {
            position = position + Point::from_angle(heading) * beyond;
        }
        (position, heading)
    }

    /// World position and heading of the path [rad] at path coordinates [m].
    pub fn world(&self, s: f64, d: f64) -> (Point, f64) {
        let (position, heading) = self.pose_at(s);
        (position + Point::from_angle(heading).left() * d, heading)
    }

    /// Point and heading [rad] at an arc length [m]; `hint` is the segment of the last call, from which the search begins.
    pub(super) fn pose_from(&self, s: f64, hint: &mut usize) -> (Point, f64) {
        while *hint + 1 < self.n_segments() && self.arc_lengths[*hint + 1] <= s {
            *hint += 1;
        }
        self.pose_on(*hint, s)
    }

    /// The same with the curvature [1/m].
    pub(super) fn at(&self, s: f64, hint: &mut usize) -> (Point, f64, f64) {
        let (position, heading) = self.pose_from(s, hint);
        (position, heading, self.curvature_on(*hint, s))
    }

    fn curvature_on(&self, i: usize, s: f64) -> f64 {
        if s < self.arc_lengths[0] || s > self.arc_lengths[i + 1] {
            return 0.0;
        }
        (self.headings[i + 1] - self.headings[i]) / (self.arc_lengths[i + 1] - self.arc_lengths[i])
    }

    /// Path coordinates (s, d) of a point, the inverse of [`Self::world`], near the nearest segment between two arc
    /// lengths; `None` if there is none: the point lies beyond the centre of a bend.
    pub fn foot(&self, point: Point, from: f64, to: f64) -> Option<(f64, f64)> {
        const ITERATIONS: usize = 8;
        /// A step of the iteration that is shorter than this ends it [m].
        const TOLERANCE: f64 = 1e-6;
        let (mut s, mut nearest) = (f64::NAN, f64::INFINITY);
        for i in self.segment_at(from)..=self.segment_at(to) {
            let (foot, distance_squared, _) = self.chord_foot(i, point);
            if distance_squared < nearest {
                (s, nearest) = (foot, distance_squared);
            }
        }
        // From the foot on the chord to the one where the normal of the smooth heading passes through the point.
        for _ in 0..ITERATIONS {
            let segment = self.segment_at(s);
            let (position, heading) = self.pose_on(segment, s);
            let (axis, delta) = (Point::from_angle(heading), point - position);
            let (along, d) = (delta.dot(axis), axis.cross(delta));
            if along.abs() < TOLERANCE {
                return Some((s, d));
            }
            s += along / (1.0 - self.curvature_on(segment, s) * d).max(0.3);
        }
        let (position, heading) = self.pose_at(s);
        let (axis, delta) = (Point::from_angle(heading), point - position);
        (delta.dot(axis).abs() < 0.02).then_some((s, axis.cross(delta)))
    }

    /// Foot on a segment: arc length [m], distance squared [m²], offset [m] (left positive).
    #[inline]
    fn chord_foot(&self, i: usize, point: Point) -> (f64, f64, f64) {
        let (chord, delta) = (self.points[i + 1] - self.points[i], point - self.points[i]);
        let length_squared = chord.norm_squared();
        let fraction = (delta.dot(chord) / length_squared).clamp(0.0, 1.0);
        let distance_squared = (delta - chord * fraction).norm_squared();
        let s = self.arc_lengths[i] + fraction * (self.arc_lengths[i + 1] - self.arc_lengths[i]);
        (s, distance_squared, chord.cross(delta))
    }

    /// Where the path may be near to a point, at most `distance` [m] away, and where a straight way from there may cross it.
    pub(super) fn look(&self, point: Point, distance: f64, way: Point) -> Candidates {
        self.index.look(point, distance, way)
    }

    /// Foot of a point that is at most `distance` [m] away from the path: arc length, offset [m], segment. Rough: by the
    /// chords of the segments. `candidates` are those of this point and distance.
    pub(super) fn near(&self, point: Point, distance: f64, candidates: Candidates) -> Option<(f64, f64, usize)> {
        let (mut nearest, mut reach) = (distance * distance, distance + ROUNDING);
        let mut found = None;
        for k in self.index.near(candidates) {
            for i in k * STRIDE..((k + 1) * STRIDE).min(self.n_segments()) {
                // No point of a segment is further from its start than its length.
                let within = reach + (self.arc_lengths[i + 1] - self.arc_lengths[i]);
                if (point - self.points[i]).norm_squared() > within * within {
                    continue;
                }
                let (s, distance_squared, side) = self.chord_foot(i, point);
                if distance_squared < nearest {
                    nearest = distance_squared;
                    reach = distance_squared.sqrt() + ROUNDING;
                    found = Some((s, distance_squared.sqrt().copysign(side), i));
                }
            }
        }
        found
    }

    /// Unit vector along a segment.
    pub(super) fn axis_of(&self, segment: usize) -> Point {
        let chord = self.points[segment + 1] - self.points[segment];
        chord * chord.norm().recip()
    }

    /// Where a straight way of a point first meets the path: fraction of the way, arc length [m], segment. `candidates` are
    /// those of this point and way.
    pub(super) fn crossing(&self, from: Point, way: Point, candidates: Candidates) -> Option<(f64, f64, usize)> {
        let mut first: Option<(f64, f64, usize)> = None;
        for k in self.index.crossed(candidates) {
            let start = k * STRIDE;
            let mut before = way.cross(self.points[start] - from);
            for i in start..(start + STRIDE).min(self.n_segments()) {
                let after = way.cross(self.points[i + 1] - from);
                let (left, right) = (before, after);
                before = after;
                // Both ends on the same side of the way.
                if left * right > 0.0 || left == right {
                    continue;
                }
                let on_chord = left / (left - right);
                let meeting = self.points[i].lerp(self.points[i + 1], on_chord);
                let on_way = (meeting - from).dot(way) / way.norm_squared();
                if (0.0..=1.0).contains(&on_way) && first.is_none_or(|(fraction, ..)| on_way < fraction) {
                    let s = self.arc_lengths[i] + on_chord * (self.arc_lengths[i + 1] - self.arc_lengths[i]);
                    first = Some((on_way, s, i));
                }
            }
        }
        first
    }
}
