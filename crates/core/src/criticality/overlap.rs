//! Areas that lanelets and footprints share. Lanelets are eroded first, so that neighbours that only share a border do
//! not count.

use rayon::prelude::*;

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

    /// The pieces as one shape around a point, which is its body origin; `None` if there are none.
    pub(super) fn shape(&self) -> Option<(Shape, Point)> {
        let around = self.around?;
        let origin = around.min.lerp(around.max, 0.5);
        let local = |piece: &Vec<Point>| -> Vec<Point> { piece.iter().map(|p| *p - origin).collect() };
        let parts: Vec<Shape> =
            self.pieces.iter().filter_map(|(_, piece)| Shape::polygon(&local(piece)).ok()).collect();
        (!parts.is_empty()).then(|| (Shape::group(parts), origin))
    }
}

/// Area of a counter-clockwise polygon [m²].
fn area(polygon: &[Point]) -> f64 {
    0.5 * polygon.windows(2).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0])).sum::<f64>()
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

/// The part of a convex polygon in front of a line.
fn clip(polygon: &[Point], origin: Point, normal: Point) -> Vec<Point> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let (start, end) = ((from - origin).dot(normal), (to - origin).dot(normal));
        if start >= 0.0 {
            out.push(from);
        }
        if (start > 0.0 && end < 0.0) || (start < 0.0 && end > 0.0) {
            out.push(from.lerp(to, start / (start - end)));
        }
    }
    out
}

/// Intersection of convex polygons (Sutherland and Hodgman).
fn intersection(a: &[Point], b: &[Point]) -> Vec<Point> {
    let mut out = a.to_vec();
    for (i, &from) in b.iter().enumerate() {
        let to = b[(i + 1) % b.len()];
        out = clip(&out, from, (to - from).left());
        if out.len() < 3 {
            return Vec::new();
        }
    }
    out
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

/// Convex pieces of the strip between two bounds; those that are inside out are left out.
fn strip(left: &[Point], right: &[Point]) -> Vec<Vec<Point>> {
    let mut pieces = Vec::new();
    for i in 0..left.len() - 1 {
        let quad = [right[i], right[i + 1], left[i + 1], left[i]];
        let turn = |a: usize, b: usize, c: usize| (quad[b] - quad[a]).cross(quad[c] - quad[b]);
        if (0..4).all(|k| turn(k, (k + 1) % 4, (k + 2) % 4) >= 0.0) {
            pieces.push(quad.to_vec());
            continue;
        }
        let [a, b, c, d] = quad;
        let twice = |p: Point, q: Point, r: Point| (q - p).cross(r - p);
        let halves = if twice(a, b, c).min(twice(a, c, d)) >= twice(a, b, d).min(twice(b, c, d)) {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        };
        pieces.extend(halves.into_iter().filter(|[p, q, r]| twice(*p, *q, *r) > 0.0).map(|half| half.to_vec()));
    }
    pieces
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
        let eroded: Vec<Area> = lanelets.par_iter().map(|lanelet| Area::eroded(lanelet, erosion)).collect();
        let n = lanelets.len();
        let pairs: Vec<Vec<usize>> =
            (0..n).into_par_iter().map(|i| (i..n).filter(|j| eroded[i].shares(&eroded[*j], least)).collect()).collect();
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
