//! The border of the drivable area: pieces of lanelet borders beside which nothing is drivable.

use super::filler::Filler;
use super::grid::Buckets;
use super::lanelet::Lanelet;
use super::surface::{Surface, is_twisted};
use crate::geometry::Point;

/// Enclosed holes up to this size are errors of the map: slits between lanelets that part in a junction.
const HOLE_AREA_MAX: f64 = 1.0;
/// Circumference of such a hole [m], at most.
const HOLE_EDGE_MAX: f64 = 15.0;

/// A straight piece of something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// First end, world frame [m].
    pub a: Point,
    /// Second end, world frame [m].
    pub b: Point,
}

impl Segment {
    /// Its point nearest to another one.
    #[inline]
    pub fn nearest(&self, point: Point) -> Point {
        let along = self.b - self.a;
        let fraction = (point - self.a).dot(along) / along.norm_squared();
        self.a + along * if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) }
    }

    /// Distance to a point [m].
    pub fn distance(&self, point: Point) -> f64 {
        self.nearest(point).distance(point)
    }
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
/// tolerance are dropped, so gaps and overlaps up to the tolerance leave no trace, and so are the edges of enclosed
/// holes of less than 1 m².
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
    without_small_holes(edges, surface, 3.0 * gap_tolerance)
}

/// Drops connected edges (ends within `reach` [m] of each other) that surround a small hole.
fn without_small_holes(edges: Vec<Segment>, surface: &Surface, reach: f64) -> Vec<Segment> {
    let grid = surface.grid;
    let buckets = Buckets::fill(grid.n_cells(), edges.len(), |i, add| {
        grid.visit_convex(&[edges[i].a, edges[i].b], reach, &mut *add);
    });
    // Union-find; every group is named by its first edge.
    let mut groups: Vec<usize> = (0..edges.len()).collect();
    let root = |groups: &[usize], mut i: usize| {
        while groups[i] != i {
            i = groups[i];
        }
        i
    };
    for cell in 0..grid.n_cells() {
        let here = buckets.of(cell);
        for (k, &i) in here.iter().enumerate() {
            for &j in &here[..k] {
                let (i, j) = (i as usize, j as usize);
                let ends = |edge: Segment| [edge.a, edge.b];
                let meet = ends(edges[i]).iter().any(|p| ends(edges[j]).iter().any(|q| p.distance(*q) <= reach));
                if meet {
                    let (a, b) = (root(&groups, i), root(&groups, j));
                    groups[a.max(b)] = a.min(b);
                }
            }
        }
    }
    for i in 0..groups.len() {
        groups[i] = root(&groups, i);
    }
    let mut lengths = vec![0.0; edges.len()];
    let mut areas = vec![0.0; edges.len()];
    for (edge, &group) in edges.iter().zip(&groups) {
        lengths[group] += edge.a.distance(edge.b);
        // What is not drivable lies to the left of an edge, so a hole is surrounded counter-clockwise.
        areas[group] += 0.5 * (edge.a - edges[group].a).cross(edge.b - edges[group].a);
    }
    let is_hole =
        |group: usize| lengths[group] <= HOLE_EDGE_MAX && areas[group] > -1e-3 && areas[group] <= HOLE_AREA_MAX;
    edges.iter().zip(&groups).filter(|(_, group)| !is_hole(**group)).map(|(edge, _)| *edge).collect()
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
