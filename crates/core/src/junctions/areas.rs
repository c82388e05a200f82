//! Where the strips that vehicles need along two lanelets overlap.

use super::{Area, AreaKind, Reason, Side};
use crate::geometry::clipping::{area, intersection, strip};
use crate::geometry::shape::{PlacedShape, Shape};
use crate::geometry::{Aabb, Point, Pose, wrap_angle};
use crate::road::{Lanelet, RoadNetwork};

/// Width of the strip that a vehicle needs [m], at most that of its lanelet: whole lanelets overlap sloppily.
const STRIP_WIDTH: f64 = 2.2;
/// Less than this in common is no area [m²].
const COMMON_MIN: f64 = 0.05;
/// Stretches of a merge that are nearer than this are one [m].
const GAP_MAX: f64 = 1.0;
/// Between these angles lanelets cross; below they run along each other, beyond against each other [rad].
const ALONG_ANGLE: f64 = 20.0 / 180.0 * std::f64::consts::PI;
const AGAINST_ANGLE: f64 = 160.0 / 180.0 * std::f64::consts::PI;

/// The strip along the centre line of a lanelet, by segments.
struct Strip {
    around: Aabb,
    /// Box, convex pieces, and arc length at the start of each segment.
    segments: Vec<(Aabb, Vec<Vec<Point>>, f64)>,
}

impl Strip {
    fn along(lanelet: &Lanelet) -> Self {
        let (points, arc_lengths) = (lanelet.center.points(), lanelet.center.arc_lengths());
        let direction = |i: usize| {
            let delta = points[i + 1] - points[i];
            delta * (1.0 / delta.norm())
        };
        let side = |sign: f64| -> Vec<Point> {
            (0..points.len())
                .map(|i| {
                    let before = direction(i.max(1) - 1);
                    let after = direction(i.min(points.len() - 2));
                    let sum = before + after;
                    let normal = if sum.norm() > 1e-6 { sum.left() * (1.0 / sum.norm()) } else { after.left() };
                    let half = 0.5 * STRIP_WIDTH.min(lanelet.width_at(arc_lengths[i]));
                    points[i] + normal * (sign * half)
                })
                .collect()
        };
        let (left, right) = (side(1.0), side(-1.0));
        let segments: Vec<_> = (0..points.len() - 1)
            .map(|i| {
                let pieces = strip(&left[i..i + 2], &right[i..i + 2]);
                (Aabb::around(pieces.iter().flatten().copied()), pieces, arc_lengths[i])
            })
            .collect();
        let around = segments.iter().fold(Aabb::EMPTY, |around, segment| around.union(segment.0));
        Self { around, segments }
    }
}

/// What two strips have in common: the stretches of both, by pieces, and the corners of the pieces.
#[derive(Default)]
struct Common {
    stretches: [Vec<(f64, f64)>; 2],
    corners: Vec<Point>,
    size: f64,
}

impl Common {
    fn of(lanelets: [&Lanelet; 2], strips: [&Strip; 2]) -> Self {
        let mut common = Self::default();
        let [a, b] = strips;
        for (index, (here, pieces, _)) in a.segments.iter().enumerate().filter(|(_, one)| one.0.overlaps(&b.around)) {
            for (other, (there, others, _)) in b.segments.iter().enumerate().filter(|(_, one)| one.0.overlaps(here)) {
                debug_assert!(here.overlaps(there));
                for (piece, opposite) in pieces.iter().flat_map(|p| others.iter().map(move |o| (p, o))) {
                    let shared = intersection(piece, opposite);
                    if shared.len() < 3 {
                        continue;
                    }
                    common.size += area(&shared);
                    for (side, segment) in [index, other].into_iter().enumerate() {
                        common.stretches[side].push(stretch(lanelets[side], segment, &shared));
                    }
                    common.corners.extend(shared);
                }
            }
        }
        common
    }

    /// From the first to the last arc length on a side.
    fn whole(&self, side: usize) -> (f64, f64) {
        let low = self.stretches[side].iter().map(|stretch| stretch.0).fold(f64::INFINITY, f64::min);
        let high = self.stretches[side].iter().map(|stretch| stretch.1).fold(0.0, f64::max);
        (low, high)
    }

    /// Where the last stretch without a gap begins on a side.
    fn last_begin(&self, side: usize) -> f64 {
        let mut stretches = self.stretches[side].clone();
        stretches.sort_by(|a, b| b.1.total_cmp(&a.1));
        stretches.iter().fold(f64::INFINITY, |begin, (low, high)| {
            if begin.is_infinite() || *high >= begin - GAP_MAX { begin.min(*low) } else { begin }
        })
    }
}

/// Arc lengths of a polygon within a segment of the centre line.
fn stretch(lanelet: &Lanelet, segment: usize, polygon: &[Point]) -> (f64, f64) {
    let (points, arc_lengths) = (lanelet.center.points(), lanelet.center.arc_lengths());
    let (start, end) = (arc_lengths[segment], arc_lengths[segment + 1]);
    let along = (points[segment + 1] - points[segment]) * (1.0 / (end - start));
    let place = |point: &Point| (start + (*point - points[segment]).dot(along)).clamp(start, end);
    polygon.iter().map(place).fold((f64::INFINITY, 0.0), |(low, high), s| (low.min(s), high.max(s)))
}

/// All areas of a map; junctions and precedence are still to be told.
pub(super) fn find(road: &RoadNetwork) -> Vec<Area> {
    let lanelets = road.lanelets();
    let strips: Vec<Strip> = lanelets.iter().map(Strip::along).collect();
    let mut by_left: Vec<usize> = (0..lanelets.len()).collect();
    by_left.sort_by(|a, b| strips[*a].around.min.x.total_cmp(&strips[*b].around.min.x).then(a.cmp(b)));
    let mut found = Vec::new();
    for (place, &i) in by_left.iter().enumerate() {
        let reach = strips[i].around.max.x;
        for &j in by_left[place + 1..].iter().take_while(|j| strips[**j].around.min.x <= reach) {
            if strips[i].around.overlaps(&strips[j].around) {
                let (a, b) = (i.min(j), i.max(j));
                found.extend(area_of(road, [a, b], [&strips[a], &strips[b]]));
            }
        }
    }
    found.sort_by_key(|area| area.sides.map(|side| side.lanelet));
    found
}

/// The area of two lanelets, if they have one.
fn area_of(road: &RoadNetwork, [a, b]: [usize; 2], strips: [&Strip; 2]) -> Option<Area> {
    let lanelets = [&road.lanelets()[a], &road.lanelets()[b]];
    let [first, second] = lanelets;
    let follow = first.successors.contains(&b) || second.successors.contains(&a);
    if follow || [first.adjacent_left, first.adjacent_right].contains(&Some((b, true))) {
        return None;
    }
    let merges = first.successors.iter().any(|next| second.successors.contains(next));
    if !merges && first.predecessors.iter().any(|before| second.predecessors.contains(before)) {
        return None;
    }
    let common = Common::of(lanelets, strips);
    if common.size < COMMON_MIN {
        return None;
    }
    if road.lanelets_are_apart([a, b], common.corners[0]) {
        return None;
    }
    let stretches =
        [0, 1].map(|side| if merges { (common.last_begin(side), lanelets[side].length) } else { common.whole(side) });
    let sides = [0, 1].map(|k| Side { lanelet: [a, b][k], entry: stretches[k].0, exit: stretches[k].1 });
    let middle = sides.map(|side| 0.5 * (side.entry + side.exit));
    let angle = wrap_angle(road.heading_at(b, middle[1]) - road.heading_at(a, middle[0])).abs();
    let kind = match angle {
        _ if merges => AreaKind::Merge,
        _ if angle > AGAINST_ANGLE => AreaKind::Opposed,
        _ if angle >= ALONG_ANGLE => AreaKind::Cross,
        _ => return None,
    };
    let width = if kind == AreaKind::Opposed {
        let aside = second.center.project(first.center.at(middle[0])).distance;
        aside + 0.5 * (first.width_at(middle[0]) + second.width_at(middle[1]))
    } else {
        f64::INFINITY
    };
    let origin = common.corners[0];
    let ring = hull(common.corners.iter().map(|corner| *corner - origin).collect());
    let shape = Shape::polygon(&ring).ok()?;
    let hull = PlacedShape { shape, pose: Pose { position: origin, orientation: 0.0 } };
    Some(Area { kind, sides, width, hull, junction: 0, first: None, reason: Reason::Arrival, is_side_by_side: false })
}

/// Convex hull, counter-clockwise (monotone chain).
fn hull(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for point in points {
            while let [.., before, last] = chain[..]
                && (last - before).cross(point - last) <= 1e-9
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut ring = half(&mut points.iter().copied());
    ring.extend(half(&mut points.iter().rev().copied()));
    ring
}
