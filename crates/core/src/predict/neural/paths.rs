//! Paths on which a vehicle may go on, and path coordinates: arc length `s` from where the vehicle is now, offset `d` to
//! the left.

use crate::geometry::{Aabb, Point, Pose};
use crate::predict::lanes::lanes_of;
use crate::road::RoadNetwork;

/// Slots of candidate paths; each has its fixed meaning, and may be empty.
pub const N_PATHS: usize = 7;
/// Slots of own lanes, the first ones.
pub const N_OWN: usize = 4;
/// Slot of the lane to the left.
pub const LEFT: usize = 4;
/// Slot of the lane to the right.
pub const RIGHT: usize = 5;
/// Slot of the straight line along the heading; never empty.
pub const FREE: usize = 6;
/// Names of the slots.
pub const SLOTS: [&str; N_PATHS] = ["own_1", "own_2", "own_3", "own_4", "left", "right", "free"];

/// Paths begin this far behind the vehicle [m].
const BEHIND: f64 = 50.0;
/// A neighbouring lane that begins within this distance [m], or two seconds, is one too.
const NEIGHBOUR_AHEAD: f64 = 15.0;
/// Where one lanelet follows another, knots of the second that are not this far [m] ahead of the first are left out.
const JOINT_STEP: f64 = 0.3;
/// Number of such knots; a lanelet that runs backwards for longer is taken as it is.
const JOINT_KNOTS: usize = 12;
/// Segments per box of the index.
const STRIDE: usize = 16;
/// Longest chain of lanelets.
const CHAIN_MAX: usize = 256;

/// Distance [m] within which branches of a lane are paths of their own, at a speed [m/s]: what can be driven in 3 s.
fn branch_reach(velocity: f64) -> f64 {
    15.0 + 3.5 * velocity
}

/// Length of a path ahead [m].
fn reach(velocity: f64) -> f64 {
    (20.0 + 5.0 * velocity).max(100.0)
}

/// A path on which a vehicle may go on.
#[derive(Debug, Clone)]
pub struct CandidatePath {
    points: Vec<Point>,
    arc_lengths: Vec<f64>,
    headings: Vec<f64>,
    boxes: Vec<Aabb>,
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

/// A lane to make a path of.
struct Lane<'a> {
    /// Lanelets one after the other.
    chain: &'a [usize],
    /// Arc length of the vehicle on the first of them [m]; negative if that begins ahead.
    s: f64,
    share: f64,
    /// The lanelet beside or below the vehicle.
    here: usize,
}

/// All paths of a vehicle with a speed along its heading [m/s]; `on_lanes` is false for who follows none.
pub fn candidates(pose: Pose, velocity: f64, on_lanes: bool, road: &RoadNetwork) -> [Option<CandidatePath>; N_PATHS] {
    let mut paths = [const { None }; N_PATHS];
    let (speed, reach) = (velocity.max(0.0), reach(velocity.max(0.0)));
    paths[FREE] = Some(CandidatePath::straight(pose, reach));
    if !on_lanes {
        return paths;
    }
    let lanes = lanes_of(pose, branch_reach(speed), N_OWN, road);
    let total: f64 = lanes.iter().map(|lane| lane.weight).sum();
    for (slot, lane) in lanes.iter().enumerate() {
        let own = Lane { chain: &lane.chain, s: lane.s, share: lane.weight / total, here: lane.chain[0] };
        paths[slot] = CandidatePath::along(&own, pose, reach, road);
    }
    let Some(best) = lanes.first() else { return paths };
    let ahead = NEIGHBOUR_AHEAD.max(2.0 * speed);
    for (slot, is_left) in [(LEFT, true), (RIGHT, false)] {
        let Some((neighbour, s)) = neighbour(&best.chain, best.s, ahead, is_left, pose, road) else { continue };
        if !lanes.iter().any(|lane| lane.chain.contains(&neighbour)) {
            let beside = Lane { chain: &[neighbour], s, share: 0.0, here: neighbour };
            paths[slot] = CandidatePath::along(&beside, pose, reach, road);
        }
    }
    paths
}

/// The first lanelet beside a chain within a distance [m] that runs in its direction, and where the vehicle is on it.
fn neighbour(
    chain: &[usize],
    s: f64,
    ahead: f64,
    is_left: bool,
    pose: Pose,
    road: &RoadNetwork,
) -> Option<(usize, f64)> {
    let mut start = -s;
    for &lanelet in chain {
        let lane = &road.lanelets()[lanelet];
        let beside = if is_left { lane.adjacent_left } else { lane.adjacent_right };
        if let Some((neighbour, true)) = beside {
            let s = if start > 0.0 { -start } else { road.lanelets()[neighbour].center.project(pose.position).s };
            return Some((neighbour, s));
        }
        start += lane.length;
        if start > ahead {
            return None;
        }
    }
    None
}

impl CandidatePath {
    /// Straight on along the heading.
    fn straight(pose: Pose, reach: f64) -> Self {
        let axis = Point::from_angle(pose.orientation);
        let points = [-BEHIND, 0.0, reach].map(|s| pose.position + axis * s).to_vec();
        Self::of(points, vec![-BEHIND, 0.0, reach], vec![pose.orientation; 3])
    }

    /// Along a lane, straightest where the chain ends, straight on where the map ends. `None` where a map is so broken
    /// that no path remains.
    fn along(lane: &Lane<'_>, pose: Pose, reach: f64, road: &RoadNetwork) -> Option<Self> {
        let (chain, first_start) = extended(lane, reach, road);
        let n = (reach + BEHIND) as usize + 16;
        let (mut points, mut headings): (Vec<Point>, Vec<f64>) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut start = first_start;
        let mut first = f64::NAN;
        for &lanelet in &chain {
            let mut skipped = 0;
            let mut is_joint = !points.is_empty();
            for knot in road.lane_knots(lanelet) {
                let s = start + knot.s;
                if s < -BEHIND {
                    continue;
                }
                if s > reach {
                    break;
                }
                let Some((last, heading)) = points.last().zip(headings.last()) else {
                    first = s;
                    points.push(knot.position);
                    headings.push(knot.heading);
                    continue;
                };
                if is_joint {
                    let step = knot.position - *last;
                    let is_ahead = step.dot(Point::from_angle(*heading)) >= JOINT_STEP;
                    if !is_ahead && (skipped < JOINT_KNOTS || step.norm() < JOINT_STEP) {
                        skipped += 1;
                        continue;
                    }
                    is_joint = false;
                }
                headings.push(continued(*heading, knot.heading));
                points.push(knot.position);
            }
            start += road.lanelets()[lanelet].length;
        }
        if points.len() < 2 {
            return None;
        }
        let mut path = Self::through(points, headings, first, reach);
        let foot = path.foot(pose.position, -30.0, 30.0)?;
        path.arc_lengths.iter_mut().for_each(|s| *s -= foot.0);
        let here = &road.lanelets()[lane.here];
        let (_, heading) = path.pose_at(0.0);
        path.offset = foot.1;
        path.heading_error = crate::geometry::wrap_angle(pose.orientation - heading);
        path.share = lane.share;
        path.width = here.width_at(lane.s.max(0.0));
        path.speed_limit = here.speed_limit;
        path.end = start - foot.0;
        Some(path)
    }

    /// A path through knots, the first at arc length `first`, with straight ends.
    fn through(mut points: Vec<Point>, mut headings: Vec<f64>, first: f64, reach: f64) -> Self {
        let n = points.len();
        let axis = Point::from_angle(headings[n - 1]);
        let mut length = 0.0;
        let mut arc_lengths = Vec::with_capacity(n + 2);
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
        Self::of(points, arc_lengths, headings)
    }

    /// A path by its points; what a vehicle has to do with it is not known yet.
    fn of(points: Vec<Point>, arc_lengths: Vec<f64>, headings: Vec<f64>) -> Self {
        let mut path = Self {
            points,
            arc_lengths,
            headings,
            boxes: Vec::new(),
            offset: 0.0,
            heading_error: 0.0,
            share: 0.0,
            width: 0.0,
            speed_limit: f64::NAN,
            end: 0.0,
        };
        path.index();
        path
    }

    fn index(&mut self) {
        let n = self.points.len() - 1;
        self.boxes = (0..n)
            .step_by(STRIDE)
            .map(|i| Aabb::around(self.points[i..=(i + STRIDE).min(n)].iter().copied()))
            .collect();
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

    /// Point, heading [rad] and curvature [1/m] at an arc length [m]; `hint` is the segment of the last call, from which
    /// the search begins.
    pub(super) fn at(&self, s: f64, hint: &mut usize) -> (Point, f64, f64) {
        while *hint + 1 < self.n_segments() && self.arc_lengths[*hint + 1] <= s {
            *hint += 1;
        }
        let (position, heading) = self.pose_on(*hint, s);
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
            let (position, heading) = self.pose_at(s);
            let (axis, delta) = (Point::from_angle(heading), point - position);
            let (along, d) = (delta.dot(axis), axis.cross(delta));
            if along.abs() < TOLERANCE {
                return Some((s, d));
            }
            s += along / (1.0 - self.curvature_on(self.segment_at(s), s) * d).max(0.3);
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

    /// Foot of a point that is at most `distance` [m] away from the path: arc length, offset [m], segment. Rough: by the
    /// chords of the segments.
    pub(super) fn near(&self, point: Point, distance: f64) -> Option<(f64, f64, usize)> {
        let mut nearest = distance * distance;
        let mut found = None;
        for (k, around) in self.boxes.iter().enumerate() {
            if !around.grown(distance).contains(point) {
                continue;
            }
            for i in k * STRIDE..((k + 1) * STRIDE).min(self.n_segments()) {
                let (s, distance_squared, side) = self.chord_foot(i, point);
                if distance_squared < nearest {
                    nearest = distance_squared;
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

    /// Where a straight way of a point first meets the path: fraction of the way, arc length [m], segment.
    pub(super) fn crossing(&self, from: Point, way: Point) -> Option<(f64, f64, usize)> {
        let around = Aabb::around([from, from + way]);
        let mut first: Option<(f64, f64, usize)> = None;
        for (k, other) in self.boxes.iter().enumerate() {
            if !other.overlaps(&around) || is_beside(from, way, other) {
                continue;
            }
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

/// The whole box lies on one side of a way.
fn is_beside(from: Point, way: Point, other: &Aabb) -> bool {
    let (center, half) = (other.min.lerp(other.max, 0.5), (other.max - other.min) * 0.5);
    way.cross(center - from).abs() > way.x.abs() * half.y + way.y.abs() * half.x
}

/// The chain with lanelets behind and ahead, and the arc length of its start, seen from the vehicle.
fn extended(lane: &Lane<'_>, reach: f64, road: &RoadNetwork) -> (Vec<usize>, f64) {
    let length = |lanelet: usize| road.lanelets()[lanelet].length;
    let mut chain = Vec::with_capacity(lane.chain.len() + 8);
    let mut start = -lane.s;
    let mut at = lane.chain[0];
    while start > -BEHIND && chain.len() < CHAIN_MAX {
        let Some(&before) = road.predecessors_straightest_first(at).first() else { break };
        chain.push(before);
        start -= length(before);
        at = before;
    }
    chain.reverse();
    chain.extend_from_slice(lane.chain);
    let mut end = start + chain.iter().map(|lanelet| length(*lanelet)).sum::<f64>();
    while end < reach && chain.len() < 2 * CHAIN_MAX {
        let Some(&next) = road.successors_straightest_first(chain[chain.len() - 1]).first() else { break };
        chain.push(next);
        end += length(next);
    }
    (chain, start)
}

/// The heading nearest to `last` that is the same direction as `heading` [rad].
fn continued(last: f64, heading: f64) -> f64 {
    last + crate::geometry::wrap_angle(heading - last)
}
