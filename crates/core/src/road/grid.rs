//! A uniform grid over the map: which things touch which cell. Bounded number of cells, no hashing.

use crate::geometry::{Aabb, Point};

/// Smallest cell [m]: about the length of a car's footprint box halved.
const CELL_SIZE_MIN: f64 = 2.5;
/// Maps that would need more cells get larger ones.
const CELLS_MAX: f64 = 262_144.0;

/// Share of a cell by which rounding may shift its bounds: what lies on a bound is in the cells on both sides.
const BOUND_SLACK: f64 = 1e-6;

/// Layout of the cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    origin: Point,
    size: f64,
    inverse_size: f64,
    columns: usize,
    rows: usize,
}

/// A rectangle of cells, all bounds included.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellRange {
    columns: (usize, usize),
    rows: (usize, usize),
}

impl Grid {
    /// Cells that cover a box of finite size.
    pub(super) fn over(aabb: &Aabb) -> Self {
        let extent = aabb.max - aabb.min;
        let mut size = CELL_SIZE_MIN;
        while count(extent.x, size) * count(extent.y, size) > CELLS_MAX {
            size *= 1.25;
        }
        Self::with_cells_of(size, aabb)
    }

    /// Cells of twice the size over the same box.
    pub(super) fn coarser(&self, aabb: &Aabb) -> Self {
        Self::with_cells_of(2.0 * self.size, aabb)
    }

    /// The same cells, each divided into `parts` per side.
    pub(super) fn finer(&self, parts: usize) -> Self {
        let size = self.size / parts as f64;
        let (columns, rows) = (self.columns * parts, self.rows * parts);
        Self { origin: self.origin, size, inverse_size: size.recip(), columns, rows }
    }

    /// The cell around one of those into which these are divided.
    pub(super) fn around(&self, finer: usize, parts: usize) -> usize {
        let columns = self.columns * parts;
        finer / columns / parts * self.columns + finer % columns / parts
    }

    fn with_cells_of(size: f64, aabb: &Aabb) -> Self {
        let extent = aabb.max - aabb.min;
        Self {
            origin: aabb.min,
            size,
            inverse_size: size.recip(),
            columns: count(extent.x, size) as usize,
            rows: count(extent.y, size) as usize,
        }
    }

    pub(super) fn n_cells(&self) -> usize {
        self.columns * self.rows
    }

    /// The cell with a point; `None` outside the grid or for NaN.
    #[inline]
    pub(super) fn cell_of(&self, point: Point) -> Option<usize> {
        let local = (point - self.origin) * self.inverse_size;
        let inside = local.x >= 0.0 && local.y >= 0.0 && local.x < self.columns as f64 && local.y < self.rows as f64;
        inside.then(|| local.y as usize * self.columns + local.x as usize)
    }

    /// Visits the cells of the points `first + i * step`, `i` below `n`, that lie in the grid. A point on a bound may be told
    /// to lie on either side of it.
    #[inline]
    pub(super) fn visit_row(&self, first: Point, step: Point, n: usize, mut visit: impl FnMut(usize, usize)) {
        /// One cell in fixed point; points farther away are not visited [cells].
        const ONE: f64 = (1_i64 << 32) as f64;
        const FAR: f64 = (1_i64 << 24) as f64;
        let (local, step) = ((first - self.origin) * self.inverse_size, step * self.inverse_size);
        if !(local.x.abs().max(local.y.abs()) < FAR && step.x.abs().max(step.y.abs()) < FAR) {
            return;
        }
        let fixed = |point: Point| ((point.x * ONE) as i64, (point.y * ONE) as i64);
        let ((mut x, mut y), (dx, dy)) = (fixed(local), fixed(step));
        for i in 0..n {
            // Negative numbers are large here.
            let (column, row) = ((x >> 32) as usize, (y >> 32) as usize);
            if column < self.columns && row < self.rows {
                visit(i, row * self.columns + column);
            }
            (x, y) = (x + dx, y + dy);
        }
    }

    /// Centre of a cell and four points around it.
    pub(super) fn samples_of(&self, cell: usize) -> [Point; 5] {
        let (row, column) = (cell / self.columns, cell % self.columns);
        [(0.5, 0.5), (0.2, 0.3), (0.7, 0.2), (0.8, 0.7), (0.3, 0.8)]
            .map(|(x, y)| self.origin + Point::new(column as f64 + x, row as f64 + y) * self.size)
    }

    /// Cells that touch a box; `None` if there is none.
    #[inline]
    pub(super) fn range(&self, aabb: &Aabb) -> Option<CellRange> {
        let low = (aabb.min - self.origin) * self.inverse_size;
        let high = (aabb.max - self.origin) * self.inverse_size;
        let touches = high.x >= 0.0 && high.y >= 0.0 && low.x < self.columns as f64 && low.y < self.rows as f64;
        // Negative values become 0 by the cast, large ones are cut.
        touches.then(|| CellRange {
            columns: (low.x as usize, (high.x as usize).min(self.columns - 1)),
            rows: (low.y as usize, (high.y as usize).min(self.rows - 1)),
        })
    }

    /// The cells of a range, row by row.
    #[inline]
    pub(super) fn cells(&self, range: CellRange) -> impl Iterator<Item = usize> {
        let columns = self.columns;
        (range.rows.0..=range.rows.1)
            .flat_map(move |row| (range.columns.0..=range.columns.1).map(move |column| row * columns + column))
    }

    /// Visits every cell within `margin` [m] (per axis) of a convex polygon or, with two vertices, a segment.
    pub(super) fn visit_convex(&self, vertices: &[Point], margin: f64, mut visit: impl FnMut(usize)) {
        let around = Aabb::around(vertices.iter().copied()).grown(margin);
        let Some(range) = self.range(&around) else { return };
        for row in range.rows.0..=range.rows.1 {
            let reach = margin + BOUND_SLACK * self.size;
            let bottom = self.origin.y + row as f64 * self.size - reach;
            let top = bottom + self.size + 2.0 * reach;
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for (i, &a) in vertices.iter().enumerate() {
                let b = vertices[(i + 1) % vertices.len()];
                if let Some((x_start, x_end)) = x_within(a, b, bottom, top) {
                    low = low.min(x_start.min(x_end));
                    high = high.max(x_start.max(x_end));
                }
            }
            let strip = Aabb { min: Point::new(low - margin, bottom), max: Point::new(high + margin, top) };
            if let Some(part) = self.range(&strip) {
                for column in part.columns.0..=part.columns.1 {
                    visit(row * self.columns + column);
                }
            }
        }
    }
}

/// Number of cells of a size along a length.
fn count(length: f64, size: f64) -> f64 {
    (length / size).floor() + 1.0
}

/// x at both ends of the part of a segment between two heights.
fn x_within(a: Point, b: Point, bottom: f64, top: f64) -> Option<(f64, f64)> {
    if a.y.max(b.y) < bottom || a.y.min(b.y) > top {
        return None;
    }
    let height = b.y - a.y;
    if height.abs() < 1e-12 {
        return Some((a.x, b.x));
    }
    let x_at = |y: f64| a.x + (b.x - a.x) * ((y - a.y) / height).clamp(0.0, 1.0);
    Some((x_at(bottom), x_at(top)))
}

/// Items per cell, in one array.
#[derive(Debug, Clone, Default)]
pub(super) struct Buckets {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Buckets {
    /// Fills the cells: `visit(item, add)` calls `add(cell)` for every cell of an item. Items are ascending in a cell.
    pub(super) fn fill(n_cells: usize, n_items: usize, visit: impl Fn(usize, &mut dyn FnMut(usize))) -> Self {
        Self::fill_at_most(usize::MAX, n_cells, n_items, visit).expect("there is no limit")
    }

    /// The same; `None` if there would be more than `most` entries in all cells.
    pub(super) fn fill_at_most(
        most: usize,
        n_cells: usize,
        n_items: usize,
        visit: impl Fn(usize, &mut dyn FnMut(usize)),
    ) -> Option<Self> {
        let mut starts = vec![0_u32; n_cells + 1];
        let mut n_entries = 0_usize;
        for item in 0..n_items {
            visit(item, &mut |cell| {
                starts[cell + 1] += 1;
                n_entries += 1;
            });
            if n_entries > most {
                return None;
            }
        }
        for cell in 0..n_cells {
            starts[cell + 1] += starts[cell];
        }
        let mut next: Vec<u32> = starts[..n_cells].to_vec();
        let mut items = vec![0_u32; starts[n_cells] as usize];
        for item in 0..n_items {
            visit(item, &mut |cell| {
                items[next[cell] as usize] = item as u32;
                next[cell] += 1;
            });
        }
        Some(Self { starts, items })
    }

    #[inline]
    pub(super) fn of(&self, cell: usize) -> &[u32] {
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::over(&Aabb { min: Point::new(-10.0, 100.0), max: Point::new(40.0, 130.0) })
    }

    #[test]
    fn a_triangle_is_found_in_every_cell_that_it_touches() {
        let corners = [Point::new(-5.0, 101.0), Point::new(30.0, 108.0), Point::new(2.0, 127.0)];
        let mut visited = vec![false; grid().n_cells()];
        grid().visit_convex(&corners, 0.0, |cell| visited[cell] = true);
        for i in 0..=60 {
            for j in 0..=(60 - i) {
                let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                let point = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                assert!(visited[grid().cell_of(point).expect("inside")]);
            }
        }
        assert!(visited.iter().filter(|v| **v).count() < grid().n_cells() / 2, "but not everywhere");
    }

    #[test]
    fn a_segment_along_the_bound_of_two_rows_is_found_whatever_rounding_makes_of_the_bound() {
        let grid = Grid::over(&Aabb { min: Point::new(-101.1, -101.1), max: Point::new(101.1, 101.1) });
        for row in 1..80 {
            let y = f64::from(row * 25 - 1011) / 10.0; // not -101.1 + 2.5 row, which rounds otherwise
            let mut visited = Vec::new();
            grid.visit_convex(&[Point::new(2.5, y), Point::new(0.0, y)], 0.0, |cell| visited.push(cell));
            assert!(visited.contains(&grid.cell_of(Point::new(1.0, y)).expect("inside")), "row {row}");
        }
    }

    #[test]
    fn points_outside_have_no_cell_and_boxes_are_cut_to_the_map() {
        assert_eq!(grid().cell_of(Point::new(-10.1, 110.0)), None);
        assert_eq!(grid().cell_of(Point::new(f64::NAN, 110.0)), None);
        let everything = Aabb { min: Point::new(-1e9, -1e9), max: Point::new(1e9, 1e9) };
        let range = grid().range(&everything).expect("touches");
        assert_eq!(grid().cells(range).count(), grid().n_cells());
    }

    #[test]
    fn a_huge_map_gets_larger_cells_not_more() {
        let map = Aabb { min: Point::new(0.0, 0.0), max: Point::new(30_000.0, 20_000.0) };
        assert!(Grid::over(&map).n_cells() <= CELLS_MAX as usize);
    }

    #[test]
    fn things_that_are_everywhere_are_too_many_entries_until_the_cells_are_larger() {
        let map = Aabb { min: Point::new(0.0, 0.0), max: Point::new(100.0, 100.0) };
        let entries = |grid: &Grid| {
            Buckets::fill_at_most(5000, grid.n_cells(), 10, |_, add| (0..grid.n_cells()).for_each(&mut *add))
        };
        let fine = Grid::over(&map);
        assert!(entries(&fine).is_none());
        assert_eq!(entries(&fine.coarser(&map)).expect("fewer cells").of(0).len(), 10);
    }
}
