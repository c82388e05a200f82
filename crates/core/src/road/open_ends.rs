//! Where the map ends, the road does not: straight continuations beyond open ends, and strips that close small gaps
//! between lanelets that are stated to touch.

use super::filler::Filler;
use super::lanelet::Lanelet;
use super::surface::{Triangle, strip};
use crate::geometry::polyline::Polyline;
use crate::geometry::{Aabb, Point};

/// The direction beyond an end is that of the last piece of centre line of this length [m].
const DIRECTION_LENGTH: f64 = 4.0;
/// Narrower ends [m] are tapers, not roads that go on.
const END_WIDTH_MIN: f64 = 1.0;
/// A point this far [m] beyond an end tells whether another lanelet lies there.
const LOOK_BEYOND: f64 = 0.3;
/// Gaps between a lanelet and its successor up to this [m] are closed.
const CLOSED_GAP_MAX: f64 = 3.0;
/// Gaps between stated neighbours up to this [m] are closed.
const NEIGHBOUR_GAP_MAX: f64 = 0.5;
/// Smaller gaps [m] need no strip.
const GAP_MIN: f64 = 1e-3;

/// An end of a lanelet that nothing continues.
struct OpenEnd {
    lanelet: usize,
    at_start: bool,
    /// Unit vector away from the lanelet.
    outwards: Point,
    /// Corners, left and right looking outwards.
    left: Point,
    right: Point,
    /// Ends side by side continue in one direction: index of the first of them.
    group: usize,
}

/// Straight continuations of all open ends, `length` [m] long.
pub(super) fn continuations(lanelets: &[Lanelet], length: f64) -> Vec<Filler> {
    if length <= 0.0 {
        return Vec::new();
    }
    let boxes: Vec<Aabb> = lanelets.iter().map(|lanelet| Aabb::around(lanelet.polygon.iter().copied())).collect();
    let mut ends: Vec<OpenEnd> = Vec::new();
    for i in 0..lanelets.len() {
        ends.extend([false, true].into_iter().filter_map(|at_start| open_end(lanelets, &boxes, i, at_start)));
    }
    let mut pairs = Vec::new();
    for i in 0..ends.len() {
        ends[i].group = i;
        for j in 0..i {
            if are_side_by_side(lanelets, &ends[j], &ends[i]) {
                pairs.push((j, i));
                let (kept, dropped) = (ends[i].group.min(ends[j].group), ends[i].group.max(ends[j].group));
                ends.iter_mut().filter(|end| end.group == dropped).for_each(|end| end.group = kept);
            }
        }
    }
    let reach = |end: &OpenEnd| {
        let sum = ends.iter().filter(|e| e.group == end.group).fold(Point::default(), |sum, e| sum + e.outwards);
        sum * (length / sum.norm().max(1e-9))
    };
    let beyond = |end: &OpenEnd| {
        let (far_left, far_right) = (end.left + reach(end), end.right + reach(end));
        Filler {
            left: vec![end.left, far_left],
            right: vec![end.right, far_right],
            borders: vec![vec![end.left, far_left], vec![far_left, far_right], vec![far_right, end.right]],
        }
    };
    // A small gap between neighbours goes on between their continuations.
    let between = |(i, j): (usize, usize)| {
        let (a, b) = (&ends[i], &ends[j]);
        let (left, right) =
            if a.left.distance(b.right) < a.right.distance(b.left) { (b.right, a.left) } else { (a.right, b.left) };
        Filler { left: vec![left, left + reach(a)], right: vec![right, right + reach(a)], borders: Vec::new() }
    };
    ends.iter().map(beyond).chain(pairs.into_iter().map(between)).collect()
}

/// The end of a lanelet, if the road goes on there without a lanelet.
fn open_end(lanelets: &[Lanelet], boxes: &[Aabb], lanelet: usize, at_start: bool) -> Option<OpenEnd> {
    let continues = |i: usize| !(if at_start { &lanelets[i].predecessors } else { &lanelets[i].successors }).is_empty();
    if same_direction_neighbours(lanelets, lanelet).into_iter().any(continues) {
        return None;
    }
    let line = &lanelets[lanelet].center;
    let (left, right, outwards) = if at_start {
        let (left, right) = lanelets[lanelet].start();
        (right, left, line.at(0.0) - line.at(DIRECTION_LENGTH))
    } else {
        let (left, right) = lanelets[lanelet].end();
        (left, right, line.at(line.length()) - line.at(line.length() - DIRECTION_LENGTH))
    };
    if left.distance(right) < END_WIDTH_MIN || outwards.norm() < 1e-6 {
        return None;
    }
    let outwards = outwards * outwards.norm().recip();
    let beyond = left.lerp(right, 0.5) + outwards * LOOK_BEYOND;
    let covered = (0..lanelets.len())
        .any(|other| other != lanelet && boxes[other].contains(beyond) && lies_on(&lanelets[other], beyond));
    (!covered).then_some(OpenEnd { lanelet, at_start, outwards, left, right, group: 0 })
}

/// The lanelet and all that are beside it in the same direction, directly or over others.
fn same_direction_neighbours(lanelets: &[Lanelet], lanelet: usize) -> Vec<usize> {
    let mut found = vec![lanelet];
    let mut next = 0;
    while next < found.len() {
        let at = &lanelets[found[next]];
        for (j, _) in [at.adjacent_left, at.adjacent_right].into_iter().flatten().filter(|neighbour| neighbour.1) {
            if !found.contains(&j) {
                found.push(j);
            }
        }
        next += 1;
    }
    found
}

fn lies_on(lanelet: &Lanelet, point: Point) -> bool {
    let mut triangles = Vec::new();
    strip(&lanelet.left, &lanelet.right, None, &mut triangles);
    triangles.iter().any(|triangle: &Triangle| triangle.contains(point))
}

/// Neighbours whose ends share a corner.
fn are_side_by_side(lanelets: &[Lanelet], a: &OpenEnd, b: &OpenEnd) -> bool {
    let named = [lanelets[a.lanelet].adjacent_left, lanelets[a.lanelet].adjacent_right]
        .into_iter()
        .flatten()
        .any(|(j, same)| j == b.lanelet && same == (a.at_start == b.at_start));
    named && (a.left.distance(b.right) < NEIGHBOUR_GAP_MAX || a.right.distance(b.left) < NEIGHBOUR_GAP_MAX)
}

/// Strips over small gaps between successive lanelets and between neighbours.
pub(super) fn seams(lanelets: &[Lanelet]) -> Vec<Filler> {
    let mut fillers = Vec::new();
    for (i, lanelet) in lanelets.iter().enumerate() {
        for &j in &lanelet.successors {
            fillers.extend(joint(lanelet.end(), lanelets[j].start()));
        }
        let neighbours = [(lanelet.adjacent_left, &lanelet.left), (lanelet.adjacent_right, &lanelet.right)];
        for (k, (neighbour, bound)) in neighbours.into_iter().enumerate() {
            let Some((j, same)) = neighbour else { continue };
            let on_left = k == 0;
            let opposite = if same == on_left { &lanelets[j].right } else { &lanelets[j].left };
            // A seam in the same direction is found from both sides; once is enough.
            if i < j
                || lanelets[j].adjacent_left.map(|n| n.0) != Some(i)
                    && lanelets[j].adjacent_right.map(|n| n.0) != Some(i)
            {
                fillers.extend(between(bound, opposite));
            }
        }
    }
    fillers
}

/// Closes a gap between the end of a lanelet and the start of the next.
fn joint(end: (Point, Point), start: (Point, Point)) -> Option<Filler> {
    let gap = end.0.distance(start.0).max(end.1.distance(start.1));
    (gap > GAP_MIN && gap <= CLOSED_GAP_MAX).then(|| Filler {
        left: vec![end.0, start.0],
        right: vec![end.1, start.1],
        borders: vec![vec![end.0, start.0], vec![start.1, end.1]],
    })
}

/// Closes the gap between two bounds wherever it is small.
fn between(bound: &[Point], opposite: &[Point]) -> Option<Filler> {
    let line = Polyline::new(opposite).ok()?;
    let feet: Vec<(Point, f64)> = bound
        .iter()
        .map(|point| {
            let foot = line.project(*point);
            if foot.distance <= NEIGHBOUR_GAP_MAX { (line.at(foot.s), foot.distance) } else { (*point, 0.0) }
        })
        .collect();
    feet.iter().any(|foot| foot.1 > GAP_MIN).then(|| Filler {
        left: bound.to_vec(),
        right: feet.into_iter().map(|foot| foot.0).collect(),
        borders: Vec::new(),
    })
}
