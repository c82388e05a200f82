//! What bodies cover during each interval of a plan, in single precision: a broad phase that lets through all that overlap.

use super::poses::{Poses, Stretch};
use super::reach::{GROUP, ROUNDING, Reach};
use crate::simd::multiversion;

/// Numbers of a box: centre, axis, half length and width.
const N_NUMBERS: usize = 6;

/// Numbers of some boxes, of neighbouring intervals.
type Boxes = [[f32; GROUP]; N_NUMBERS];

/// Swept boxes of several bodies; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct SweptBoxes {
    /// (bodies, groups of intervals)
    boxes: Vec<Boxes>,
    /// The boxes of a group are to be examined; likewise.
    counts: Vec<bool>,
    n_groups: usize,
    /// Which bodies may overlap the sample at hand, a bit per interval; likewise.
    found: Vec<u8>,
}

impl SweptBoxes {
    /// Clears everything and reserves `stride` intervals with padding.
    pub(super) fn begin(&mut self, stride: usize) {
        self.boxes.clear();
        self.counts.clear();
        self.n_groups = stride / GROUP;
    }

    /// No body is there.
    pub(super) fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Adds a body of a size (half length and width), unless it stays out of reach.
    pub(super) fn push(&mut self, poses: &Poses, half: (f64, f64), reach: &Reach) -> bool {
        let before = self.counts.len();
        write_boxes(self, poses, [half.0 as f32, half.1 as f32], Some(reach));
        let is_near = self.counts[before..].contains(&true);
        if !is_near {
            self.boxes.truncate(before);
            self.counts.truncate(before);
        }
        is_near
    }

    /// The only body, wherever it is.
    pub(super) fn set(&mut self, stride: usize, poses: &Poses, half: (f64, f64)) {
        self.begin(stride);
        write_boxes(self, poses, [half.0 as f32, half.1 as f32], None);
    }

    /// Looks for bodies that may overlap a single one; false if there is none.
    pub(super) fn broad_phase(&mut self, single: &SweptBoxes) -> bool {
        find_overlaps(self, single)
    }

    /// Intervals in which something was found, ascending; with bodies, ascending.
    pub(super) fn found(&self) -> impl Iterator<Item = (usize, usize)> {
        let n_bodies = self.found.len() / self.n_groups.max(1);
        let bits = move |group: usize, body: usize| self.found[body * self.n_groups + group];
        (0..self.n_groups).flat_map(move |group| {
            let any = (0..n_bodies).fold(0, |any, body| any | bits(group, body));
            (0..GROUP).filter(move |k| any >> k & 1 == 1).flat_map(move |k| {
                let bodies = (0..n_bodies).filter(move |body| bits(group, *body) >> k & 1 == 1);
                bodies.map(move |body| (group * GROUP + k, body))
            })
        })
    }
}

multiversion! {
    /// Appends the boxes of a body.
    fn write_boxes = boxes_at, (out: &mut SweptBoxes, poses: &Poses, half: [f32; 2], reach: Option<&Reach>)
}

#[inline(always)]
fn boxes_at(out: &mut SweptBoxes, poses: &Poses, half: [f32; 2], reach: Option<&Reach>) {
    for group in 0..out.n_groups {
        let boxes = spanning(&poses.stretch(group), half);
        let counts = reach.is_none_or(|reach| is_near(&boxes, &reach.sides(group), reach.axis()));
        out.boxes.push(boxes);
        out.counts.push(counts);
    }
}

/// Boxes in the mean direction of a body at two points that contain it at both, as `OrientedBox::spanning`.
#[inline(always)]
fn spanning(poses: &Stretch, [half_length, half_width]: [f32; 2]) -> Boxes {
    let Stretch { x, y, axis_x, axis_y } = poses;
    let mut boxes = [[0.0; GROUP]; N_NUMBERS];
    for k in 0..GROUP {
        let (a_x, a_y, b_x, b_y) = (axis_x[k], axis_y[k], axis_x[k + 1], axis_y[k + 1]);
        let sense = if a_x * b_x + a_y * b_y < 0.0 { -1.0 } else { 1.0 };
        let (sum_x, sum_y) = (a_x + sense * b_x, a_y + sense * b_y);
        let scale = 1.0 / (sum_x * sum_x + sum_y * sum_y).sqrt();
        let (axis_x, axis_y) = (sum_x * scale, sum_y * scale);
        let (to_x, to_y) = (x[k + 1] - x[k], y[k + 1] - y[k]);
        let (cos_a, sin_a) = ((axis_x * a_x + axis_y * a_y).abs(), (axis_x * a_y - axis_y * a_x).abs());
        let (cos_b, sin_b) = ((axis_x * b_x + axis_y * b_y).abs(), (axis_x * b_y - axis_y * b_x).abs());
        let ahead = axis_x * to_x + axis_y * to_y;
        let left = axis_x * to_y - axis_y * to_x;
        let (low, high) =
            span(half_length * cos_a + half_width * sin_a, half_length * cos_b + half_width * sin_b, ahead);
        let (right, wide) =
            span(half_length * sin_a + half_width * cos_a, half_length * sin_b + half_width * cos_b, left);
        let (ahead, left) = (0.5 * (low + high), 0.5 * (right + wide));
        boxes[0][k] = x[k] + (axis_x * ahead - axis_y * left);
        boxes[1][k] = y[k] + (axis_y * ahead + axis_x * left);
        boxes[2][k] = axis_x;
        boxes[3][k] = axis_y;
        boxes[4][k] = 0.5 * (high - low);
        boxes[5][k] = 0.5 * (wide - right);
    }
    boxes
}

/// What two extents cover, one around 0 and one around a place.
#[inline(always)]
fn span(half_a: f32, half_b: f32, at_b: f32) -> (f32, f32) {
    let (low_b, high_b) = (at_b - half_b, at_b + half_b);
    (if -half_a < low_b { -half_a } else { low_b }, if half_a > high_b { half_a } else { high_b })
}

/// Some box shares a point with the region of its point.
#[inline(always)]
fn is_near(boxes: &Boxes, sides: &[[f32; GROUP]; 4], [ahead_x, ahead_y]: [f32; 2]) -> bool {
    let [x, y, axis_x, axis_y, half_length, half_width] = boxes;
    let [rear, front, right, left] = sides;
    let mut near = 0;
    for k in 0..GROUP {
        let (ahead, aside) = (x[k] * ahead_x + y[k] * ahead_y, y[k] * ahead_x - x[k] * ahead_y);
        let cos = (axis_x[k] * ahead_x + axis_y[k] * ahead_y).abs();
        let sin = (axis_y[k] * ahead_x - axis_x[k] * ahead_y).abs();
        let length = half_length[k] * cos + half_width[k] * sin + ROUNDING;
        let width = half_length[k] * sin + half_width[k] * cos + ROUNDING;
        near |= u32::from(
            (ahead + length >= rear[k])
                & (ahead - length <= front[k])
                & (aside + width >= right[k])
                & (aside - width <= left[k]),
        );
    }
    near != 0
}

multiversion! {
    fn find_overlaps = overlaps_of, (bodies: &mut SweptBoxes, single: &SweptBoxes) -> bool
}

#[inline(always)]
fn overlaps_of(bodies: &mut SweptBoxes, single: &SweptBoxes) -> bool {
    let SweptBoxes { boxes, counts, n_groups, found } = bodies;
    found.clear();
    found.resize(counts.len(), 0);
    let mut any = 0;
    for group in 0..*n_groups {
        let own = &single.boxes[group];
        let mut place = group;
        while place < counts.len() {
            if counts[place] {
                let bits = overlapping(own, &boxes[place]);
                found[place] = bits;
                any |= bits;
            }
            place += *n_groups;
        }
    }
    any != 0
}

/// Pairs that no side direction of the first box separates, one bit each; most that are apart are separated by one.
/// What is not a number overlaps nothing.
#[expect(clippy::needless_range_loop, reason = "functions of iterators that are not inlined know no wide machines")]
#[inline(always)]
fn overlapping(a: &Boxes, b: &Boxes) -> u8 {
    let [a_x, a_y, ahead_x, ahead_y, length, width] = a;
    let [b_x, b_y, axis_x, axis_y, half_length, half_width] = b;
    let mut bits = [0; GROUP];
    for k in 0..GROUP {
        let (x, y) = (b_x[k] - a_x[k], b_y[k] - a_y[k]);
        let cos = (axis_x[k] * ahead_x[k] + axis_y[k] * ahead_y[k]).abs();
        let sin = (axis_y[k] * ahead_x[k] - axis_x[k] * ahead_y[k]).abs();
        let ahead = (x * ahead_x[k] + y * ahead_y[k]).abs();
        let aside = (y * ahead_x[k] - x * ahead_y[k]).abs();
        let overlaps = (ahead <= length[k] + half_length[k] * cos + half_width[k] * sin + ROUNDING)
            & (aside <= width[k] + half_length[k] * sin + half_width[k] * cos + ROUNDING);
        bits[k] = u32::from(overlaps).wrapping_neg() & 1 << k;
    }
    let mut all = 0;
    for k in 0..GROUP {
        all |= bits[k];
    }
    all as u8
}

#[cfg(test)]
mod tests;
