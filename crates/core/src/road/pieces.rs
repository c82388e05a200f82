//! Road edges in pieces of similar length, for observations.

use super::RoadNetwork;
use super::edges::Segment;
use super::grid::{Buckets, Grid};
use crate::geometry::{Aabb, Point};

/// Longest piece [m].
const LENGTH_MAX: f64 = 5.0;
/// Largest distance of map vertices from the piece that replaces them [m].
const DEVIATION_MAX: f64 = 0.1;
/// Ends within this distance [m] are the same point.
const SAME_POINT: f64 = 1e-6;

/// Pieces of road edges of at most 5 m, and their index.
#[derive(Debug, Clone)]
pub struct EdgePieces {
    pieces: Vec<Segment>,
    grid: Grid,
    buckets: Buckets,
}

impl EdgePieces {
    fn new(edges: &[Segment]) -> Self {
        let mut pieces: Vec<Segment> = Vec::new();
        let mut rest = edges;
        while let Some(first) = rest.first() {
            let n = joined(rest);
            cut(Segment { a: first.a, b: rest[n - 1].b }, &mut pieces);
            rest = &rest[n..];
        }
        let ends = pieces.iter().flat_map(|piece| [piece.a, piece.b]);
        let nowhere = Aabb { min: Point::default(), max: Point::default() };
        let around = if pieces.is_empty() { nowhere } else { Aabb::around(ends) };
        let grid = Grid::over(&around).coarser(&around).coarser(&around);
        let buckets = Buckets::fill(grid.n_cells(), pieces.len(), |i, add| {
            grid.visit_convex(&[pieces[i].a, pieces[i].b], 0.0, &mut *add);
        });
        Self { pieces, grid, buckets }
    }

    /// All pieces. Nothing is drivable to the left of them.
    pub fn all(&self) -> &[Segment] {
        &self.pieces
    }

    /// Visits the pieces in the cells of a box, in ascending order within a cell; a piece in several cells is visited
    /// in each of them.
    pub(crate) fn visit_near(&self, aabb: &Aabb, mut visit: impl FnMut(usize, &Segment)) {
        let Some(range) = self.grid.range(aabb) else { return };
        for cell in self.grid.cells(range) {
            for i in self.buckets.of(cell) {
                visit(*i as usize, &self.pieces[*i as usize]);
            }
        }
    }
}

/// How many of the first edges, each beginning where the one before ends, one piece can replace.
fn joined(edges: &[Segment]) -> usize {
    let mut n = 1;
    while let Some(next) = edges.get(n) {
        let whole = Segment { a: edges[0].a, b: next.b };
        let is_straight = || edges[..n].iter().all(|edge| whole.distance(edge.b) <= DEVIATION_MAX);
        let follows = next.a.distance(edges[n - 1].b) <= SAME_POINT;
        if !follows || whole.a.distance(whole.b) > LENGTH_MAX + SAME_POINT || !is_straight() {
            break;
        }
        n += 1;
    }
    n
}

/// Adds the equal parts of a segment, none of them too long.
fn cut(whole: Segment, pieces: &mut Vec<Segment>) {
    let n = ((whole.a.distance(whole.b) - SAME_POINT) / LENGTH_MAX).ceil().max(1.0) as usize;
    let at = |i: usize| whole.a.lerp(whole.b, i as f64 / n as f64);
    pieces.extend((0..n).map(|i| Segment { a: at(i), b: at(i + 1) }));
}

impl RoadNetwork {
    /// The road edges in pieces of at most 5 m: longer ones are cut into equal parts, consecutive shorter ones are
    /// joined if that moves the border by at most 0.1 m. Built on first use.
    pub fn edge_pieces(&self) -> &EdgePieces {
        self.pieces.get_or_init(|| EdgePieces::new(self.road_edges()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(points: &[(f64, f64)]) -> Vec<Segment> {
        points.windows(2).map(|p| Segment { a: Point::new(p[0].0, p[0].1), b: Point::new(p[1].0, p[1].1) }).collect()
    }

    fn lengths(edges: &[Segment]) -> Vec<f64> {
        EdgePieces::new(edges).all().iter().map(|piece| (piece.a.distance(piece.b) * 100.0).round() / 100.0).collect()
    }

    #[test]
    fn long_edges_are_cut_into_equal_parts() {
        assert_eq!(lengths(&chain(&[(0.0, 0.0), (12.0, 0.0)])), [4.0; 3]);
        assert_eq!(lengths(&chain(&[(0.0, 0.0), (10.0, 0.0)])), [5.0; 2]);
    }

    #[test]
    fn short_edges_are_joined_unless_they_bend_or_do_not_follow_each_other() {
        let fine: Vec<_> = (0..=10).map(|i| (f64::from(i), 0.0)).collect();
        assert_eq!(lengths(&chain(&fine)), [5.0; 2]);
        assert_eq!(lengths(&chain(&[(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])), [2.0; 2]);
        assert_eq!(lengths(&chain(&[(0.0, 0.0), (2.0, 0.05), (4.0, 0.0)])), [4.0]);
        let apart = [chain(&[(0.0, 0.0), (1.0, 0.0)]), chain(&[(1.5, 0.0), (2.5, 0.0)])].concat();
        assert_eq!(lengths(&apart), [1.0; 2]);
    }
}
