//! Whether a footprint lies on the road: its centre does, and no road edge crosses it.

use super::RoadNetwork;
use super::edges::Segment;
use super::grid::Buckets;
use super::surface::Surface;
use crate::geometry::shape::{OrientedBox, Shape};
use crate::geometry::{Aabb, Point, Pose};

/// What a grid cell is, as far as that can be said of all of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ground {
    /// No road edge and nothing drivable.
    OffRoad,
    /// No road edge, all drivable.
    Road,
    /// A road edge is in it or within the tolerance of it.
    Edge,
}

/// Surface, road edges and their index.
#[derive(Debug, Clone)]
pub(super) struct DrivableArea {
    pub(super) surface: Surface,
    pub(super) edges: Vec<Segment>,
    /// A lane beside the edge bends.
    pub(super) bends: Vec<bool>,
    buckets: Buckets,
    pub(super) ground: Vec<Ground>,
}

impl DrivableArea {
    pub(super) fn new(surface: Surface, edges: Vec<Segment>, tolerance: f64) -> Self {
        let grid = surface.grid;
        let buckets = cells_of(&edges, &surface, tolerance);
        // Without an edge in it, a cell is of one kind everywhere, but for gaps and holes that are too small to count:
        // one of the points lies beside them.
        let ground_of = |cell: usize| {
            if !buckets.of(cell).is_empty() {
                Ground::Edge
            } else if grid.samples_of(cell).into_iter().any(|point| surface.is_near(point)) {
                Ground::Road
            } else {
                Ground::OffRoad
            }
        };
        let ground = (0..grid.n_cells()).map(ground_of).collect();
        let bends = vec![false; edges.len()];
        Self { surface, edges, bends, buckets, ground }
    }

    /// The same edges in other pieces.
    pub(super) fn replace_edges(&mut self, edges: Vec<Segment>, bends: Vec<bool>, tolerance: f64) {
        self.buckets = cells_of(&edges, &self.surface, tolerance);
        (self.edges, self.bends) = (edges, bends);
    }

    #[inline]
    fn is_on_road(&self, point: Point) -> bool {
        self.surface.grid.cell_of(point).is_some_and(|cell| match self.ground[cell] {
            Ground::Road => true,
            Ground::OffRoad => false,
            Ground::Edge => self.surface.is_near(point),
        })
    }

    /// Every cell under the box is road, or none: the answer; `None` if road edges are about.
    #[inline]
    pub(super) fn uniform(&self, aabb: &Aabb) -> Option<bool> {
        let Some(range) = self.surface.grid.range(aabb) else { return Some(false) };
        let mut cells = self.surface.grid.cells(range);
        let first = self.ground[cells.next()?];
        (first != Ground::Edge && cells.all(|cell| self.ground[cell] == first)).then_some(first == Ground::Road)
    }

    /// Some road edge in the cells under the box satisfies the test, which is given its index, too, and may see it often.
    pub(super) fn any_edge_near(&self, aabb: &Aabb, test: impl Fn(usize, &Segment) -> bool) -> bool {
        let Some(range) = self.surface.grid.range(aabb) else { return false };
        let mut cells = self.surface.grid.cells(range);
        cells.any(|cell| self.buckets.of(cell).iter().any(|i| test(*i as usize, &self.edges[*i as usize])))
    }

    fn edges_near(&self, aabb: &Aabb, out: &mut Vec<u32>) {
        out.clear();
        let Some(range) = self.surface.grid.range(aabb) else { return };
        for cell in self.surface.grid.cells(range) {
            out.extend(self.buckets.of(cell).iter().filter(|i| {
                let edge = &self.edges[**i as usize];
                Aabb::around([edge.a, edge.b]).overlaps(aabb)
            }));
        }
        out.sort_unstable();
        out.dedup();
    }
}

impl RoadNetwork {
    /// Border of the drivable area: pieces of lanelet borders (and of the sides of continuations beyond open ends)
    /// beside which, `gap_tolerance` further out, nothing is drivable. Pieces shorter than twice the tolerance are left
    /// out.
    pub fn road_edges(&self) -> &[Segment] {
        &self.area.edges
    }

    /// Indices of the road edges whose bounding box touches the box: ascending, each once. `out` is cleared first.
    pub fn edges_near(&self, aabb: &Aabb, out: &mut Vec<u32>) {
        self.area.edges_near(aabb, out);
    }

    /// The point is drivable: within `gap_tolerance` of a lanelet or of the continuation of an open end.
    pub fn is_on_road(&self, point: Point) -> bool {
        self.area.is_on_road(point)
    }

    /// A footprint, smaller by `gap_tolerance` all around, lies on the road: the centres of its parts do and no road
    /// edge crosses them.
    pub fn covers(&self, shape: &Shape, pose: Pose) -> bool {
        self.covers_with(shape, pose, &mut Vec::new())
    }

    /// The same with memory that is overwritten.
    pub(crate) fn covers_with(&self, shape: &Shape, pose: Pose, scratch: &mut Vec<u32>) -> bool {
        let aabb = shape.aabb(pose);
        let margin = self.settings.gap_tolerance;
        self.area.uniform(&aabb).unwrap_or_else(|| self.covers_by(shape, pose, &aabb, margin, scratch))
    }

    /// The centres of the parts lie on the road, and no road edge comes deeper than `margin` [m] into one.
    pub(super) fn covers_by(&self, shape: &Shape, pose: Pose, aabb: &Aabb, margin: f64, near: &mut Vec<u32>) -> bool {
        self.area.edges_near(aabb, near);
        shape.parts().iter().all(|part| {
            let sum = part.vertices.iter().fold(Point::default(), |sum, vertex| sum + *vertex);
            let center = pose.world_from_body(sum * (part.vertices.len() as f64).recip());
            self.is_on_road(center)
                && near.iter().map(|i| &self.area.edges[*i as usize]).all(|edge| {
                    let (a, b) = (pose.body_from_world(edge.a), pose.body_from_world(edge.b));
                    !enters(&part.vertices, part.radius, a, b, margin)
                })
        })
    }

    /// `covers` for an oriented box, for planners. Nothing is allocated.
    pub fn box_is_covered(&self, footprint: &OrientedBox) -> bool {
        let inner = OrientedBox {
            half_length: (footprint.half_length - self.settings.gap_tolerance).max(0.0),
            half_width: (footprint.half_width - self.settings.gap_tolerance).max(0.0),
            ..*footprint
        };
        let aabb = inner.aabb();
        if let Some(answer) = self.area.uniform(&aabb) {
            return answer;
        }
        if !self.is_on_road(inner.center) {
            return false;
        }
        !self.area.any_edge_near(&aabb, |_, edge| {
            Aabb::around([edge.a, edge.b]).overlaps(&aabb) && inner.overlaps_segment(edge.a, edge.b)
        })
    }
}

/// Which cells edges are in or within the tolerance of.
fn cells_of(edges: &[Segment], surface: &Surface, tolerance: f64) -> Buckets {
    let grid = surface.grid;
    Buckets::fill(grid.n_cells(), edges.len(), |i, add| {
        grid.visit_convex(&[edges[i].a, edges[i].b], tolerance, &mut *add);
    })
}

/// A segment comes deeper than `margin` [m] into a convex part (vertices counter-clockwise; one vertex: a circle).
fn enters(vertices: &[Point], radius: f64, a: Point, b: Point, margin: f64) -> bool {
    if let [center] = vertices {
        let along = b - a;
        let fraction = ((*center - a).dot(along) / along.norm_squared().max(1e-18)).clamp(0.0, 1.0);
        return center.distance(a.lerp(b, fraction)) < radius - margin;
    }
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (i, &vertex) in vertices.iter().enumerate() {
        let side = vertices[(i + 1) % vertices.len()] - vertex;
        let inwards = side.left() * side.norm().max(1e-12).recip();
        let (depth_a, depth_b) = (inwards.dot(a - vertex) - margin, inwards.dot(b - vertex) - margin);
        if depth_a < 0.0 && depth_b < 0.0 {
            return false;
        }
        if depth_a < 0.0 {
            from = from.max(depth_a / (depth_a - depth_b));
        } else if depth_b < 0.0 {
            to = to.min(depth_a / (depth_a - depth_b));
        }
    }
    from < to
}
