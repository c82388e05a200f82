//! Line of sight: which bodies are not hidden behind nearer ones, seen from a point in the plane.
//!
//! Exact for bodies that do not overlap: every convex part covers a range of directions; of two convex sets that do not
//! overlap, one is in front wherever both lie in the same direction. What is left of a part's range when the ranges of
//! all parts in front of it are taken away is what can be seen of it. No angle is computed: ranges are pairs of vectors,
//! compared by the sign of their cross product.

use crate::geometry::shape::{ConvexPart, Placement, Shape};
use crate::geometry::{Point, Pose};

/// Gaps between hiding bodies that are narrower than this are closed [rad]: 0.1 mm at 100 m.
const NARROWEST: f64 = 1e-6;

/// Somebody who may be seen or hide others.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    /// Footprint in its body frame.
    pub shape: &'a Shape,
    /// Where it is.
    pub pose: Pose,
    /// Others cannot be seen through it.
    pub hides: bool,
    /// Whether it is seen has to be found out.
    pub is_wanted: bool,
}

/// Directions from the eye, counter-clockwise from `first` to `last`; less than half a turn. The vectors have any
/// length.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    first: Point,
    last: Point,
}

impl Range {
    #[inline]
    fn contains(&self, direction: Point) -> bool {
        self.first.cross(direction) >= 0.0 && direction.cross(self.last) >= 0.0
    }

    /// Directions in both. They are one range: two ranges that are each less than half a turn cannot meet twice.
    #[inline]
    fn common(&self, other: &Self) -> Option<Self> {
        let first = if self.contains(other.first) {
            other.first
        } else if other.contains(self.first) {
            self.first
        } else {
            return None;
        };
        let last = if self.contains(other.last) { other.last } else { self.last };
        Some(Self { first, last })
    }

    /// A direction between both ends.
    fn middle(&self) -> Point {
        self.first * (1.0 / self.first.norm()) + self.last * (1.0 / self.last.norm())
    }

    fn is_wide(&self) -> bool {
        let cross = self.first.cross(self.last);
        let scale = self.first.norm_squared() * self.last.norm_squared();
        cross > 0.0 && (cross * cross > NARROWEST * NARROWEST * scale || self.first.dot(self.last) < 0.0)
    }
}

/// A convex part as the eye sees it; coordinates relative to the eye.
#[derive(Debug, Clone)]
struct Silhouette {
    body: usize,
    range: Range,
    /// No point of its body is nearer to the eye [m].
    near: f64,
    /// No point of its body is further away [m].
    far: f64,
    /// Corners of a polygon, counter-clockwise; the centre of a circle.
    corners: Vec<Point>,
    radius: f64,
}

impl Silhouette {
    /// `None` if the eye lies in the part.
    fn new(body: usize, part: &ConvexPart, placement: &Placement, eye: Point, near: f64, far: f64) -> Option<Self> {
        let corners: Vec<Point> = part.vertices.iter().map(|vertex| placement.apply(*vertex) - eye).collect();
        let range = match corners.as_slice() {
            [center] => tangents(*center, part.radius)?,
            _ => extremes(&corners)?,
        };
        Some(Self { body, range, near, far, corners, radius: part.radius })
    }

    /// Distance to where a ray from the eye enters, in lengths of `direction`; the ray meets the part.
    fn entry(&self, direction: Point) -> f64 {
        if let [center] = self.corners.as_slice() {
            let length_squared = direction.norm_squared();
            let (along, across) = (center.dot(direction), center.cross(direction));
            let half_chord = (self.radius * self.radius * length_squared - across * across).max(0.0).sqrt();
            return (along - half_chord) / length_squared;
        }
        let n = self.corners.len();
        let mut entry = 0.0_f64;
        for i in 0..n {
            let corner = self.corners[i];
            let outwards = -(self.corners[(i + 1) % n] - corner).left();
            let towards = outwards.dot(direction);
            if towards < 0.0 {
                entry = entry.max(outwards.dot(corner) / towards);
            }
        }
        entry
    }
}

/// Tangents from the origin to a circle; `None` from inside.
fn tangents(center: Point, radius: f64) -> Option<Range> {
    let free = center.norm_squared() - radius * radius;
    if free <= 0.0 {
        return None;
    }
    let length = free.sqrt();
    let turned = |side: f64| center * length + center.left() * (side * radius);
    Some(Range { first: turned(-1.0), last: turned(1.0) })
}

/// Outermost corners of a convex polygon, seen from the origin; `None` from inside.
fn extremes(corners: &[Point]) -> Option<Range> {
    let n = corners.len();
    if (0..n).all(|i| corners[i].cross(corners[(i + 1) % n]) >= 0.0) {
        return None;
    }
    let mut range = Range { first: corners[0], last: corners[0] };
    for corner in &corners[1..] {
        if range.first.cross(*corner) < 0.0 {
            range.first = *corner;
        }
        if range.last.cross(*corner) > 0.0 {
            range.last = *corner;
        }
    }
    Some(range)
}

/// For each body whether any of it can be seen from `eye`; false for those that are not wanted.
///
/// A body is seen unless every direction in which it lies is taken by a nearer body that hides. Bodies around the eye
/// are seen and hide nothing; a body hides nothing of itself. Where two bodies overlap, the one that is nearer in the
/// middle of the directions they share counts as nearer. The order of the bodies does not matter.
pub fn seen_from(eye: Point, bodies: &[Body<'_>]) -> Vec<bool> {
    let bounds = |body: &Body<'_>| {
        let (distance, radius) = (body.pose.position.distance(eye), body.shape.bounding_radius());
        (distance - radius, distance + radius)
    };
    let furthest = bodies.iter().filter(|body| body.is_wanted).map(|body| bounds(body).1).fold(0.0, f64::max);
    let mut seen = vec![false; bodies.len()];
    let mut hiding: Vec<Silhouette> = Vec::with_capacity(bodies.len());
    let mut wanted: Vec<Silhouette> = Vec::with_capacity(bodies.len());
    for (index, body) in bodies.iter().enumerate() {
        let (near, far) = bounds(body);
        if !body.is_wanted && (!body.hides || near >= furthest) {
            continue;
        }
        let placement = Placement::new(body.pose);
        let parts = body.shape.parts();
        let shown: Vec<Silhouette> =
            parts.iter().filter_map(|part| Silhouette::new(index, part, &placement, eye, near, far)).collect();
        if shown.len() < parts.len() {
            seen[index] = body.is_wanted;
            continue;
        }
        if body.is_wanted {
            wanted.extend(shown.iter().cloned());
        }
        if body.hides {
            hiding.extend(shown);
        }
    }
    // Nearest first: the loop below ends with the first one that is too far away to hide anything.
    hiding.sort_by(|a, b| a.near.total_cmp(&b.near));
    let mut left = Vec::new();
    for part in &wanted {
        if !seen[part.body] {
            seen[part.body] = is_seen(part, &hiding, &mut left);
        }
    }
    seen
}

/// Some of the part's directions are not taken by nearer parts of other bodies.
fn is_seen(part: &Silhouette, hiding: &[Silhouette], left: &mut Vec<Range>) -> bool {
    left.clear();
    left.push(part.range);
    for other in hiding.iter().take_while(|other| other.near < part.far) {
        let Some(common) = part.range.common(&other.range) else { continue };
        if other.body == part.body || !common.is_wide() {
            continue;
        }
        let middle = common.middle();
        if other.entry(middle) < part.entry(middle) {
            take_away(left, &common);
            if left.is_empty() {
                return false;
            }
        }
    }
    true
}

fn take_away(left: &mut Vec<Range>, taken: &Range) {
    for i in (0..left.len()).rev() {
        let whole = left[i];
        let Some(common) = whole.common(taken) else { continue };
        left.swap_remove(i);
        let before = Range { first: whole.first, last: common.first };
        let after = Range { first: common.last, last: whole.last };
        left.extend([before, after].into_iter().filter(Range::is_wide));
    }
}

#[cfg(test)]
mod tests;
