//! Line of sight: which bodies are not hidden behind nearer ones, seen from a point in the plane.
//!
//! Exact for bodies that do not overlap: every convex part covers a range of directions; of two convex sets that do not
//! overlap, one is in front wherever both lie in the same direction. What is left of a part's range when the ranges of
//! all parts in front of it are taken away is what can be seen of it. No angle is computed: ranges are pairs of vectors,
//! compared by the sign of their cross product.

use crate::geometry::shape::{Placement, Shape};
use crate::geometry::{Point, Pose};

/// Gaps between hiding bodies that are narrower than this are closed [rad]: 0.1 mm at 100 m.
const NARROWEST: f64 = 1e-6;

/// A body that may be seen and may hide others.
#[derive(Debug, Clone, Copy)]
pub struct SightBody<'a> {
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

    #[inline]
    fn is_wide(&self) -> bool {
        let cross = self.first.cross(self.last);
        let scale = self.first.norm_squared() * self.last.norm_squared();
        cross > 0.0 && (cross * cross > NARROWEST * NARROWEST * scale || self.first.dot(self.last) < 0.0)
    }
}

/// A convex part as the eye sees it.
#[derive(Debug, Clone, Copy)]
struct Silhouette {
    body: usize,
    hides: bool,
    is_wanted: bool,
    range: Range,
    /// Sectors of the full turn that the range touches, one bit each: parts without a common one do not meet.
    sectors: u64,
    /// No point of its body is nearer to the eye [m].
    near: f64,
    /// No point of its body is further away [m].
    far: f64,
    /// Corners of a polygon, counter-clockwise, or the centre of a circle; in the common list.
    corners: (usize, usize),
    radius: f64,
}

/// Everything around an eye; coordinates relative to it.
#[derive(Debug, Default)]
struct Surroundings {
    /// Sorted by `near`.
    parts: Vec<Silhouette>,
    corners: Vec<Point>,
}

impl Surroundings {
    /// Adds the parts of a body; false if the eye lies in one of them, then none is added.
    fn add(&mut self, index: usize, body: &SightBody<'_>, eye: Point, near: f64, far: f64) -> bool {
        let placement = Placement::new(body.pose);
        let (n_parts, n_corners) = (self.parts.len(), self.corners.len());
        for part in body.shape.parts() {
            let start = self.corners.len();
            self.corners.extend(part.vertices.iter().map(|vertex| placement.apply(*vertex) - eye));
            let range = match &self.corners[start..] {
                [center] => tangents(*center, part.radius),
                corners => extremes(corners),
            };
            let Some(range) = range else {
                self.parts.truncate(n_parts);
                self.corners.truncate(n_corners);
                return false;
            };
            self.parts.push(Silhouette {
                body: index,
                hides: body.hides,
                is_wanted: body.is_wanted,
                range,
                sectors: sectors(&range),
                near,
                far,
                corners: (start, self.corners.len()),
                radius: part.radius,
            });
        }
        true
    }

    /// Some of the part's directions are not taken by nearer parts of other bodies; `left` is working memory.
    fn is_seen(&self, part: &Silhouette, left: &mut Vec<Range>) -> bool {
        left.clear();
        left.push(part.range);
        for other in self.parts.iter().take_while(|other| other.near < part.far) {
            if !other.hides || other.sectors & part.sectors == 0 || other.body == part.body {
                continue;
            }
            let Some(common) = part.range.common(&other.range).filter(Range::is_wide) else { continue };
            if other.far < part.near || self.is_nearer(other, part, common.middle()) {
                take_away(left, &common);
                if left.is_empty() {
                    return false;
                }
            }
        }
        true
    }

    fn is_nearer(&self, part: &Silhouette, other: &Silhouette, direction: Point) -> bool {
        self.entry(part, direction) < self.entry(other, direction)
    }

    /// Distance to where a ray from the eye enters a part that it meets, in lengths of `direction`.
    fn entry(&self, part: &Silhouette, direction: Point) -> f64 {
        let corners = &self.corners[part.corners.0..part.corners.1];
        if let [center] = corners {
            let length_squared = direction.norm_squared();
            let (along, across) = (center.dot(direction), center.cross(direction));
            let half_chord = (part.radius * part.radius * length_squared - across * across).max(0.0).sqrt();
            return (along - half_chord) / length_squared;
        }
        let mut entry = 0.0_f64;
        let mut from = corners[corners.len() - 1];
        for to in corners {
            let outwards = -(*to - from).left();
            let towards = outwards.dot(direction);
            if towards < 0.0 {
                entry = entry.max(outwards.dot(from) / towards);
            }
            from = *to;
        }
        entry
    }
}

/// The sectors, of 64 around the eye, from the one of the range's first direction to that of its last one.
fn sectors(range: &Range) -> u64 {
    // Grows with the angle, from 0 to 4 over a full turn: the way along the edge of a square, without trigonometry.
    let along_square = |v: Point| {
        let share = v.y / (v.x.abs() + v.y.abs());
        if v.x < 0.0 {
            2.0 - share
        } else if share < 0.0 {
            4.0 + share
        } else {
            share
        }
    };
    let sector = |v: Point| ((along_square(v) * 16.0) as u32).min(63);
    let (first, last) = (sector(range.first), sector(range.last));
    let (from_first, up_to_last) = (u64::MAX << first, u64::MAX >> (63 - last));
    if first <= last { from_first & up_to_last } else { from_first | up_to_last }
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

/// For each body whether any of it can be seen from `eye`; false for bodies that are not wanted.
///
/// A body is seen unless every direction in which it lies is taken by a nearer body that hides. Bodies around the eye
/// are seen and hide nothing; a body hides nothing of itself. Where two bodies overlap, the body that is nearer in the
/// middle of their shared directions counts as nearer. The order of the bodies does not matter.
pub fn seen_from(eye: Point, bodies: &[SightBody<'_>]) -> Vec<bool> {
    let bounds = |body: &SightBody<'_>| {
        let (distance, radius) = (body.pose.position.distance(eye), body.shape.bounding_radius());
        (distance - radius, distance + radius)
    };
    let furthest = bodies.iter().filter(|body| body.is_wanted).map(|body| bounds(body).1).fold(0.0, f64::max);
    let mut seen = vec![false; bodies.len()];
    let mut around = Surroundings::default();
    for (index, body) in bodies.iter().enumerate() {
        let (near, far) = bounds(body);
        if (body.is_wanted || (body.hides && near < furthest)) && !around.add(index, body, eye, near, far) {
            seen[index] = body.is_wanted;
        }
    }
    around.parts.sort_unstable_by(|a, b| a.near.total_cmp(&b.near));
    let mut left = Vec::new();
    for part in around.parts.iter().filter(|part| part.is_wanted) {
        if !seen[part.body] {
            seen[part.body] = around.is_seen(part, &mut left);
        }
    }
    seen
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
