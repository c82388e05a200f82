//! Rows of points that lie on the road or not: pictures of the drivable area.

use super::RoadNetwork;
use super::coverage::{DrivableArea, Ground};
use super::grid::Grid;
use crate::geometry::Point;

/// Parts per side into which a cell of the index is divided.
const PARTS: usize = 5;

/// What cells of half a metre are (larger on large maps), so that a point costs one look-up unless an edge is near.
#[derive(Debug, Clone)]
pub(super) struct GroundMap {
    grid: Grid,
    ground: Vec<Ground>,
}

impl GroundMap {
    fn new(area: &DrivableArea, tolerance: f64) -> Self {
        let coarse = area.surface.grid;
        let grid = coarse.finer(PARTS);
        let mut ground: Vec<Ground> = (0..grid.n_cells()).map(|cell| area.ground[coarse.around(cell, PARTS)]).collect();
        let mut is_edge = vec![false; ground.len()];
        for edge in &area.edges {
            grid.visit_convex(&[edge.a, edge.b], tolerance, |cell| is_edge[cell] = true);
        }
        for (cell, ground) in ground.iter_mut().enumerate() {
            if *ground == Ground::Edge && !is_edge[cell] {
                let is_road = grid.samples_of(cell).into_iter().any(|point| area.surface.is_near(point));
                *ground = if is_road { Ground::Road } else { Ground::OffRoad };
            }
        }
        Self { grid, ground }
    }
}

impl RoadNetwork {
    /// Sets the bytes of all points `first + i * step` that are drivable to 255, as [`is_on_road`](Self::is_on_road) says.
    pub(crate) fn draw_drivable(&self, first: Point, step: Point, out: &mut [u8]) {
        let map = self.ground.get_or_init(|| GroundMap::new(&self.area, self.settings.gap_tolerance));
        map.grid.visit_row(first, step, out.len(), |i, cell| match map.ground[cell] {
            Ground::Road => out[i] = 255,
            Ground::OffRoad => {}
            Ground::Edge => {
                if self.area.surface.is_near(first + step * i as f64) {
                    out[i] = 255;
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;
    use crate::road::testing::{crossing, fork, ring};

    #[test]
    fn rows_of_points_are_drivable_where_single_points_are() {
        let mut numbers = Lcg::new(3);
        for road in [crossing(), fork(), ring()] {
            let mut drivable = 0;
            for _ in 0..400 {
                let first = Point::new(numbers.within(-60.0, 60.0), numbers.within(-20.0, 20.0));
                let step = Point::from_angle(numbers.within(0.0, 6.0)) * 0.75;
                let mut found = [0; 96];
                road.draw_drivable(first, step, &mut found);
                let is_drivable = |i: usize| road.is_on_road(first + step * i as f64);
                assert_eq!(found, std::array::from_fn(|i| if is_drivable(i) { 255 } else { 0 }));
                drivable += found.iter().filter(|value| **value == 255).count();
            }
            assert!(drivable > 1_000, "{drivable} of 38,400 points");
        }
    }
}
