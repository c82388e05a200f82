//! The border of the drivable area: pieces of lanelet borders beside which nothing is drivable.

use super::lanelet::Lanelet;
use super::open_ends::Filler;
use super::surface::{Surface, is_twisted};
use crate::geometry::Point;

/// A straight piece of something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// First end, world frame [m].
    pub a: Point,
    /// Second end, world frame [m].
    pub b: Point,
}

/// A border of a drivable piece; the piece lies to the right of it.
struct Border<'a> {
    points: &'a [Point],
    /// The piece may also lie to the left: its lanelet is twisted.
    both_sides: bool,
}

/// Road edges of a map whose surface covers the lanelets and the fillers.
///
/// A point of a border is edge if the point `gap_tolerance` further out lies on nothing drivable. That is decided
/// exactly, by clipping the shifted border against the triangles of the surface; pieces of less than twice the
/// tolerance are dropped, so gaps and overlaps up to the tolerance leave no trace.
pub(super) fn road_edges(
    lanelets: &[Lanelet],
    fillers: &[Filler],
    surface: &Surface,
    gap_tolerance: f64,
) -> Vec<Segment> {
    let mut edges = Vec::new();
    let mut seek = |points: &[Point], both_sides: bool| {
        let border = Border { points, both_sides };
        uncovered_pieces(&border, surface, gap_tolerance, &mut edges);
    };
    for lanelet in lanelets {
        let both_sides = is_twisted(lanelet);
        let (start, end) = (lanelet.start(), lanelet.end());
        let backwards: Vec<Point> = lanelet.right.iter().rev().copied().collect();
        seek(&lanelet.left, both_sides);
        seek(&[end.0, end.1], both_sides);
        seek(&backwards, both_sides);
        seek(&[start.1, start.0], both_sides);
    }
    for border in fillers.iter().flat_map(|filler| &filler.borders) {
        seek(border, false);
    }
    edges
}

/// Arc lengths of the vertices.
fn arc_lengths(points: &[Point]) -> Vec<f64> {
    let mut length = 0.0;
    std::iter::once(0.0)
        .chain(points.windows(2).map(|pair| {
            length += pair[0].distance(pair[1]);
            length
        }))
        .collect()
}

fn uncovered_pieces(border: &Border, surface: &Surface, gap_tolerance: f64, edges: &mut Vec<Segment>) {
    let s = arc_lengths(border.points);
    let mut uncovered = uncovered_intervals(border.points, &s, surface, gap_tolerance);
    if border.both_sides {
        uncovered.extend(uncovered_intervals(border.points, &s, surface, -gap_tolerance));
        uncovered.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    for (from, to) in uncovered {
        for (i, pair) in border.points.windows(2).enumerate() {
            let (low, high) = (from.max(s[i]), to.min(s[i + 1]));
            if low < high {
                let at = |arc_length: f64| pair[0].lerp(pair[1], (arc_length - s[i]) / (s[i + 1] - s[i]));
                edges.push(Segment { a: at(low), b: at(high) });
            }
        }
    }
}

/// Arc lengths between which the border, shifted to the left by `shift` [m], lies on no triangle.
fn uncovered_intervals(points: &[Point], s: &[f64], surface: &Surface, shift: f64) -> Vec<(f64, f64)> {
    let length_min = 2.0 * shift.abs();
    let mut covered: Vec<(f64, f64)> = Vec::new();
    for (i, pair) in points.windows(2).enumerate() {
        let span = s[i + 1] - s[i];
        if span <= 0.0 {
            continue;
        }
        let out = (pair[1] - pair[0]).left() * (shift / span);
        let (a, b) = (pair[0] + out, pair[1] + out);
        surface.grid.visit_convex(&[a, b], 0.0, |cell| {
            covered.extend(
                surface
                    .in_cell(cell)
                    .filter_map(|triangle| triangle.clip(a, b))
                    .map(|(from, to)| (s[i] + from * span, s[i] + to * span)),
            );
        });
    }
    covered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut uncovered = Vec::new();
    let mut reached = 0.0;
    for (from, to) in covered {
        if from > reached {
            uncovered.push((reached, from));
        }
        reached = to.max(reached);
    }
    uncovered.push((reached, s[s.len() - 1]));
    uncovered.retain(|(from, to)| to - from > length_min);
    uncovered
}
