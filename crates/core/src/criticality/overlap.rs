//! Areas that lanelets and footprints share. Lanelets are eroded first, so that neighbours that only share a border do
//! not count.

use rayon::prelude::*;

use crate::geometry::clipping::{area, clip, intersection, strip};
use crate::geometry::shape::Shape;
use crate::geometry::{Aabb, Point, Pose};
use crate::road::{Lanelet, RoadNetwork};

/// Only this much of a lanelet [m] can be cut off by the erosion of its ends.
const END_REACH: f64 = 3.0;
/// Pieces smaller than this [m²] are rounding.
const PIECE_MIN: f64 = 1e-9;
/// A bend of a bound moves its vertex at most this many times the erosion.
const MITER_MAX: f64 = 2.0;

/// An area as convex pieces that do not overlap, counter-clockwise.
#[derive(Debug, Clone, Default)]
pub(super) struct Area {
    pieces: Vec<(Aabb, Vec<Point>)>,
    around: Option<Aabb>,
}

impl Area {
    fn from_pieces(pieces: impl IntoIterator<Item = Vec<Point>>) -> Self {
        let boxed = |piece: Vec<Point>| (Aabb::around(piece.iter().copied()), piece);
        let pieces: Vec<(Aabb, Vec<Point>)> =
            pieces.into_iter().filter(|piece| area(piece) > PIECE_MIN).map(boxed).collect();
        let around = pieces.iter().map(|(aabb, _)| *aabb).reduce(|a, b| a.union(b));
        Self { pieces, around }
    }

    /// All of a lanelet.
    pub(super) fn of_lanelet(lanelet: &Lanelet) -> Self {
        Self::from_pieces(strip(&lanelet.left, &lanelet.right))
    }

    /// What of a lanelet is farther than `erosion` [m] from its bounds and ends.
    pub(super) fn eroded(lanelet: &Lanelet, erosion: f64) -> Self {
        let (left, right) = (&lanelet.left, &lanelet.right);
        let (inner_left, inner_right) = (shifted(left, -erosion), shifted(right, erosion));
        let n = left.len();
        let mut along = vec![0.0];
        for i in 1..n {
            let step = left[i - 1].lerp(right[i - 1], 0.5).distance(left[i].lerp(right[i], 0.5));
            along.push(along[i - 1] + step);
        }
        let length = along[n - 1];
        let mut pieces = Vec::new();
        for i in 0..n - 1 {
            for mut piece in strip(&inner_left[i..i + 2], &inner_right[i..i + 2]) {
                if along[i] < END_REACH {
                    piece = clipped(&piece, left[0], right[0], erosion);
                }
                if length - along[i + 1] < END_REACH {
                    piece = clipped(&piece, right[n - 1], left[n - 1], erosion);
                }
                pieces.push(piece);
            }
        }
        Self::from_pieces(pieces)
    }

    /// A footprint at a pose. Overlapping parts of a group count twice.
    pub(super) fn of_footprint(shape: &Shape, pose: Pose) -> Self {
        let mut pieces = Vec::new();
        for part in shape.parts() {
            let body: Vec<Point> = if part.radius > 0.0 {
                let corner = |i: u32| Point::from_angle(std::f64::consts::TAU * f64::from(i) / 32.0) * part.radius;
                (0..32).map(|i| part.vertices[0] + corner(i)).collect()
            } else {
                part.vertices.clone()
            };
            pieces.push(body.into_iter().map(|point| pose.world_from_body(point)).collect());
        }
        Self::from_pieces(pieces)
    }

    /// What both cover, as pieces.
    pub(super) fn intersection(&self, other: &Self) -> Self {
        let mut pieces = Vec::new();
        self.visit_common(other, |piece| {
            pieces.push(piece);
            true
        });
        Self::from_pieces(pieces)
    }

    /// Both cover more than `least` [m²] together.
    pub(super) fn shares(&self, other: &Self, least: f64) -> bool {
        let mut common = 0.0;
        self.visit_common(other, |piece| {
            common += area(&piece);
            common <= least
        });
        common > least
    }

    /// Visits the pieces of the intersection until told to stop.
    fn visit_common(&self, other: &Self, mut visit: impl FnMut(Vec<Point>) -> bool) {
        let (Some(here), Some(there)) = (self.around, other.around) else { return };
        if !here.overlaps(&there) {
            return;
        }
        for (aabb, piece) in self.pieces.iter().filter(|(aabb, _)| aabb.overlaps(&there)) {
            for (_, other_piece) in other.pieces.iter().filter(|(other_aabb, _)| aabb.overlaps(other_aabb)) {
                let common = intersection(piece, other_piece);
                if common.len() > 2 && !visit(common) {
                    return;
                }
            }
        }
    }

    /// Size [m²].
    pub(super) fn size(&self) -> f64 {
        self.pieces.iter().map(|(_, piece)| area(piece)).sum()
    }

    /// Middle of the box around it; `None` if it is empty.
    pub(super) fn middle(&self) -> Option<Point> {
        self.around.map(|around| around.min.lerp(around.max, 0.5))
    }

    /// The pieces as one shape around a point, which is its body origin; `None` if there are none.
    pub(super) fn shape(&self) -> Option<(Shape, Point)> {
        let origin = self.middle()?;
        let local = |piece: &Vec<Point>| -> Vec<Point> { piece.iter().map(|p| *p - origin).collect() };
        let parts: Vec<Shape> =
            self.pieces.iter().filter_map(|(_, piece)| Shape::polygon(&local(piece)).ok()).collect();
        (!parts.is_empty()).then(|| (Shape::group(parts), origin))
    }
}

/// The part of a convex polygon at least `inset` [m] to the left of a line from `a` to `b`. Going from the left bound
/// to the right one, the lanelet is on the left.
fn clipped(polygon: &[Point], a: Point, b: Point, inset: f64) -> Vec<Point> {
    let along = b - a;
    let length = along.norm();
    if length < 1e-9 {
        return polygon.to_vec();
    }
    let normal = along.left() * (1.0 / length);
    clip(polygon, a + normal * inset, normal)
}

/// A bound moved to its left by `by` [m] (negative: right), vertex by vertex.
fn shifted(bound: &[Point], by: f64) -> Vec<Point> {
    let n = bound.len();
    let side = |i: usize| {
        let delta = bound[i + 1] - bound[i];
        let length = delta.norm();
        if length > 1e-9 { Some(delta * (1.0 / length)) } else { None }
    };
    let move_vertex = |i: usize| {
        let before = (0..i).rev().find_map(side);
        let after = (i..n - 1).find_map(side);
        let (before, after) = match (before, after) {
            (Some(before), Some(after)) => (before, after),
            (Some(one), None) | (None, Some(one)) => (one, one),
            (None, None) => return bound[i],
        };
        let sum = before + after;
        let norm = sum.norm();
        if norm < 1e-6 {
            return bound[i] + after.left() * by;
        }
        // |sum| / 2 is the cosine of half the bend.
        bound[i] + sum.left() * (by / norm * (2.0 / norm).min(MITER_MAX))
    };
    (0..n).map(move_vertex).collect()
}

/// Values for all indices below `n`, on the threads of the pool in which it is called; outside of one, on the calling
/// thread: the global thread pool is left alone.
fn of_each<T: Send>(n: usize, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if rayon::current_thread_index().is_some() {
        (0..n).into_par_iter().map(value).collect()
    } else {
        (0..n).map(value).collect()
    }
}

/// Which lanelets of a road overlap once they are eroded.
#[derive(Debug, Clone)]
pub(super) struct Overlaps {
    pub(super) eroded: Vec<Area>,
    least: f64,
    n: usize,
    bits: Vec<u64>,
}

impl Overlaps {
    pub(super) fn new(road: &RoadNetwork, erosion: f64, least: f64) -> Self {
        let lanelets = road.lanelets();
        let n = lanelets.len();
        let eroded: Vec<Area> = of_each(n, |i| Area::eroded(&lanelets[i], erosion));
        let meet = |i: usize, j: usize| {
            eroded[i].shares(&eroded[j], least)
                && !(road.has_heights()
                    && eroded[i]
                        .intersection(&eroded[j])
                        .middle()
                        .is_some_and(|at| road.lanelets_are_apart([i, j], at)))
        };
        let pairs: Vec<Vec<usize>> = of_each(n, |i| (i..n).filter(|j| meet(i, *j)).collect());
        let mut bits = vec![0_u64; (n * n).div_ceil(64)];
        for (i, others) in pairs.iter().enumerate() {
            for &j in others {
                for index in [i * n + j, j * n + i] {
                    bits[index / 64] |= 1 << (index % 64);
                }
            }
        }
        Self { eroded, least, n, bits }
    }

    #[inline]
    pub(super) fn of(&self, a: usize, b: usize) -> bool {
        let index = a * self.n + b;
        self.bits[index / 64] >> (index % 64) & 1 == 1
    }

    /// Lanelets that a footprint overlaps, ascending.
    pub(super) fn under(&self, road: &RoadNetwork, shape: &Shape, pose: Pose) -> Vec<usize> {
        let near = road.lanelets_near(pose.position, shape.bounding_radius());
        if near.is_empty() {
            return near;
        }
        let footprint = Area::of_footprint(shape, pose);
        near.into_iter().filter(|lanelet| footprint.shares(&self.eroded[*lanelet], self.least)).collect()
    }
}

#[cfg(test)]
mod tests;
