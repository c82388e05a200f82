//! The drivable area as triangles in a grid: what lies under a point.

use super::grid::{Buckets, Grid};
use super::lanelet::Lanelet;
use crate::geometry::{Aabb, Point};

/// Slack [m] on triangle sides, so that a point on the seam of two triangles is in one of them.
const SEAM_TOLERANCE: f64 = 1e-7;
/// Triangles smaller than this [m²] cover nothing.
const AREA_MIN: f64 = 1e-9;
/// Largest number of cells that all triangles occupy together, far more than on real maps: a triangle that covers all
/// of a large map must not cost a megabyte.
const ENTRIES_MAX: usize = 1 << 22;
const ENTRIES_PER_TRIANGLE: usize = 256;

/// Counter-clockwise triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    pub(super) corners: [Point; 3],
    /// Index of its lanelet; `None`: a seam or the continuation beyond an open end.
    pub(super) lanelet: Option<u32>,
}

impl Triangle {
    #[inline]
    pub(super) fn contains(&self, point: Point) -> bool {
        (0..3).all(|i| {
            let side = self.corners[(i + 1) % 3] - self.corners[i];
            let offset = side.cross(point - self.corners[i]);
            offset >= 0.0 || offset * offset <= SEAM_TOLERANCE * SEAM_TOLERANCE * side.norm_squared()
        })
    }

    /// The point is inside or at most this far [m] away.
    #[inline]
    pub(super) fn is_within(&self, point: Point, distance: f64) -> bool {
        // Beyond a side's line by more than the distance: most points are.
        let reach = distance + SEAM_TOLERANCE;
        let is_beyond = |i: usize| {
            let side = self.corners[(i + 1) % 3] - self.corners[i];
            let offset = side.cross(point - self.corners[i]);
            offset < 0.0 && offset * offset > reach * reach * side.norm_squared()
        };
        !(0..3).any(is_beyond) && (self.contains(point) || (0..3).any(|i| self.distance_to_side(i, point) <= distance))
    }

    /// Distance of a point [m], 0 inside.
    fn distance(&self, point: Point) -> f64 {
        if self.contains(point) {
            return 0.0;
        }
        (0..3).map(|i| self.distance_to_side(i, point)).fold(f64::INFINITY, f64::min)
    }

    #[inline]
    fn distance_to_side(&self, i: usize, point: Point) -> f64 {
        let start = self.corners[i];
        let side = self.corners[(i + 1) % 3] - start;
        let offset = point - start;
        let fraction = (offset.dot(side) / side.norm_squared()).clamp(0.0, 1.0);
        offset.distance(side * fraction)
    }

    /// Fractions of the segment from `a` to `b` between which it lies inside.
    pub(super) fn clip(&self, a: Point, b: Point) -> Option<(f64, f64)> {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for i in 0..3 {
            let side = self.corners[(i + 1) % 3] - self.corners[i];
            let slack = SEAM_TOLERANCE * side.norm();
            let at_a = side.cross(a - self.corners[i]) + slack;
            let at_b = side.cross(b - self.corners[i]) + slack;
            if at_a < 0.0 && at_b < 0.0 {
                return None;
            }
            if at_a < 0.0 {
                from = from.max(at_a / (at_a - at_b));
            } else if at_b < 0.0 {
                to = to.min(at_a / (at_a - at_b));
            }
        }
        (from < to).then_some((from, to))
    }
}

/// All triangles of the map and their grid.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) grid: Grid,
    pub(super) triangles: Vec<Triangle>,
    buckets: Buckets,
    tolerance: f64,
}

impl Surface {
    /// Triangles enter all cells within `tolerance` [m].
    pub(super) fn new(triangles: Vec<Triangle>, tolerance: f64) -> Self {
        let around = Aabb::around(triangles.iter().flat_map(|triangle| triangle.corners)).grown(1.0 + tolerance);
        let most = ENTRIES_MAX + ENTRIES_PER_TRIANGLE * triangles.len();
        let mut grid = Grid::over(&around);
        let buckets = loop {
            let buckets = Buckets::fill_at_most(most, grid.n_cells(), triangles.len(), |i, add| {
                grid.visit_convex(&triangles[i].corners, tolerance, &mut *add);
            });
            match buckets {
                Some(buckets) => break buckets,
                None => grid = grid.coarser(&around),
            }
        };
        Self { grid, triangles, buckets, tolerance }
    }

    /// Triangles that touch a cell or are within the tolerance of it.
    #[inline]
    pub(super) fn in_cell(&self, cell: usize) -> impl Iterator<Item = &Triangle> {
        self.buckets.of(cell).iter().map(|i| &self.triangles[*i as usize])
    }

    /// The point is inside a triangle or within the tolerance of one.
    pub(super) fn is_near(&self, point: Point) -> bool {
        let is_near = |cell: usize| self.in_cell(cell).any(|triangle| triangle.is_within(point, self.tolerance));
        self.grid.cell_of(point).is_some_and(is_near)
    }

    /// The point is inside a triangle or at most this far [m] from one.
    pub(super) fn is_within(&self, point: Point, distance: f64) -> bool {
        let Some(range) = self.grid.range(&Aabb { min: point, max: point }.grown(distance)) else { return false };
        let is_inside = |cell: usize| self.in_cell(cell).any(|triangle| triangle.contains(point));
        self.grid.cell_of(point).is_some_and(is_inside)
            || self.grid.cells(range).any(|cell| self.in_cell(cell).any(|triangle| triangle.is_within(point, distance)))
    }

    /// Distance from the nearest triangle [m], at most `most`; or `least`, if that is more.
    pub(super) fn distance_above(&self, least: f64, point: Point, most: f64) -> f64 {
        let is_inside = |cell: usize| self.in_cell(cell).any(|triangle| triangle.contains(point));
        if self.grid.cell_of(point).is_some_and(is_inside) {
            return least;
        }
        let mut nearest = most;
        let Some(range) = self.grid.range(&Aabb { min: point, max: point }.grown(most)) else { return most.max(least) };
        for triangle in self.grid.cells(range).flat_map(|cell| self.in_cell(cell)) {
            if nearest <= least {
                return least;
            }
            nearest = nearest.min(triangle.distance(point));
        }
        nearest.max(least)
    }

    /// Writes the lanelets with a triangle in the cells of a box that satisfies the test, ascending.
    pub(super) fn find_lanelets(&self, aabb: &Aabb, found: &mut Vec<usize>, test: impl Fn(&Triangle) -> bool) {
        found.clear();
        let Some(range) = self.grid.range(aabb) else { return };
        for cell in self.grid.cells(range) {
            for triangle in self.in_cell(cell) {
                if let Some(lanelet) = triangle.lanelet
                    && !found.contains(&(lanelet as usize))
                    && test(triangle)
                {
                    found.push(lanelet as usize);
                }
            }
        }
        found.sort_unstable();
    }
}

/// Triangles of the strip between two bounds with equally many vertices. Pairwise strips cover a lanelet whose outline
/// crosses itself as well as any other.
pub(super) fn strip(left: &[Point], right: &[Point], lanelet: Option<u32>, out: &mut Vec<Triangle>) {
    for i in 0..left.len() - 1 {
        let [a, b, c, d] = [right[i], right[i + 1], left[i + 1], left[i]];
        // The diagonal that leaves both halves counter-clockwise, so that nothing outside is covered.
        let area = |p: Point, q: Point, r: Point| (q - p).cross(r - p);
        let halves = if area(a, b, c).min(area(a, c, d)) >= area(a, b, d).min(area(b, c, d)) {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        };
        for [p, q, r] in halves {
            let twice_area = area(p, q, r);
            if twice_area.abs() > 2.0 * AREA_MIN {
                let corners = if twice_area > 0.0 { [p, q, r] } else { [p, r, q] };
                out.push(Triangle { corners, lanelet });
            }
        }
    }
}

/// A lanelet turns its inside out somewhere: a bound runs backwards or the bounds cross.
pub(super) fn is_twisted(lanelet: &Lanelet) -> bool {
    let (left, right) = (&lanelet.left, &lanelet.right);
    (0..left.len() - 1).any(|i| {
        let [a, b, c, d] = [right[i], right[i + 1], left[i + 1], left[i]];
        (b - a).cross(c - a) < -AREA_MIN || (c - a).cross(d - a) < -AREA_MIN
    })
}
