//! Bounds of profiles: by how much the speeds of a profile's samples differ from the desired one at least, whatever the
//! end offset. Computed in single precision for every profile; most of them are never examined again.
//!
//! Rounding: speeds are off by less than `SPEED_ROUNDING` of the speeds that they are made of, and sums by less than
//! `ROUNDING` of themselves per addition and for what is done with each term; bounds are lowered by as much.

use super::grid::SampleGrid;
use super::lateral::LateralPoints;
use super::velocity_keeping_profiles::{CoarseSpeeds, SIMD_POINTS};
use crate::geometry::polyline::ReferencePath;
use crate::simd::multiversion;

/// Rounding of speeds as a share of the speeds that they are made of: some 30 roundings in single precision.
const SPEED_ROUNDING: f64 = 2e-6;
/// Of one operation in single precision, and operations that a term of a sum goes through.
const ROUNDING: f64 = 6e-8;
const N_ROUNDINGS: f64 = 40.0;

/// Memory of the bounds of one plan.
#[derive(Debug, Clone, Default)]
pub(super) struct FirstBounds {
    /// What samples with lateral polynomials of time have at each point: largest offset, squares of the smallest and
    /// the largest lateral speed; (tables, three, points with padding).
    spreads: Vec<f32>,
    /// 1 for points, 0 for padding.
    counts: Vec<f32>,
    /// Speeds of a profile without family, and zeros.
    alone: Vec<f32>,
    zeros: Vec<f32>,
    /// Squared gaps at the points of the profile at hand.
    gaps: Vec<f32>,
    /// Largest curvature of the path from the start up to each of its knots [1/m], absolute, and the first of them.
    curvature_up_to: Vec<f64>,
    first_knot: usize,
    /// Knots of the path per metre.
    per_spacing: f64,
}

impl FirstBounds {
    pub(super) fn prepare(&mut self, samples: &SampleGrid, path: &ReferencePath) {
        let n = samples.stride;
        self.counts.clear();
        self.counts.extend((0..n).map(|i| if i < samples.n_points { 1.0 } else { 0.0 }));
        self.zeros.clear();
        self.zeros.resize(n, 0.0);
        self.gaps.resize(n, 0.0);
        self.spreads.resize(3 * n * samples.lateral.len(), 0.0);
        let outer = [samples.end_offsets[0], samples.end_offsets[samples.end_offsets.len() - 1]];
        for (table, out) in self.spreads.chunks_mut(3 * n).enumerate() {
            write_spread(&samples.lateral.points(table), outer, out);
        }
        self.find_curvatures(samples, path);
    }

    /// The largest curvature up to each knot that samples can reach.
    fn find_curvatures(&mut self, samples: &SampleGrid, path: &ReferencePath) {
        let knots = path.curvature();
        self.per_spacing = path.spacing().recip();
        let knot = |s: f64| ((s * self.per_spacing) as usize).min(knots.len() - 1);
        // Speeds that count as 0 may be slightly negative: one knot more on both sides.
        self.first_knot = knot(samples.furthest[0]).saturating_sub(1);
        let last = (knot(samples.furthest[samples.n_points - 1]) + 2).min(knots.len() - 1);
        self.curvature_up_to.clear();
        let mut largest = 0.0_f64;
        for curvature in &knots[self.first_knot..=last] {
            largest = largest.max(curvature.abs());
            self.curvature_up_to.push(largest);
        }
    }

    /// The summed squares of what speed and desired speed differ by are at least this, for all samples of an admissible
    /// profile.
    pub(super) fn gaps(&mut self, samples: &SampleGrid, index: usize, desired: f64) -> f64 {
        let profile = &samples.profiles[index];
        // Rounding is covered by the extra knots that are examined.
        let end = (samples.last_place(index) * self.per_spacing) as usize + 2;
        let place = end.saturating_sub(self.first_knot).min(self.curvature_up_to.len() - 1);
        let curvature = self.curvature_up_to[place];
        if profile.family.is_none() {
            self.alone.clear();
            self.alone.extend(samples.motions(index).s_dot.iter().map(|s_dot| *s_dot as f32));
        }
        let alone = CoarseSpeeds { rest: &self.alone, rise: &self.zeros, end_velocity: 0.0 };
        let speeds = samples.coarse_speeds(index).unwrap_or(alone);
        let rounding = (SPEED_ROUNDING * (desired + samples.speed_scale + profile.end_velocity)) as f32;
        let desired = [desired as f32, rounding];
        let sum = if let Some(table) = profile.table {
            let spread = &self.spreads[3 * table * samples.stride..3 * (table + 1) * samples.stride];
            gaps_over_time(&speeds, spread, &self.counts, curvature as f32, desired, &mut self.gaps)
        } else {
            let [widest, slope] = samples.lateral_bounds(index);
            let bend = curvature * widest;
            let factors = [(1.0 - bend).max(0.0) as f32, (1.0 + bend).hypot(slope) as f32];
            gaps_over_arc(&speeds, &self.counts, factors, desired, &mut self.gaps)
        };
        // Each lane of the sum adds one term per block.
        let n_roundings = N_ROUNDINGS + (samples.stride / SIMD_POINTS) as f64;
        f64::from(sum) * (1.0 - n_roundings * ROUNDING)
    }
}

multiversion! {
    fn write_spread = spread_at, (points: &LateralPoints, outer: [f64; 2], out: &mut [f32])
}

#[inline(always)]
fn spread_at(points: &LateralPoints, [first, last]: [f64; 2], out: &mut [f32]) {
    let n = points.home[0].len();
    let LateralPoints { home, step } = points.cut(0..n);
    let (widest, rest) = out.split_at_mut(n);
    let (low, high) = rest.split_at_mut(n);
    for i in 0..n {
        let outer = |k: usize| (home[k][i] + first * step[k][i], home[k][i] + last * step[k][i]);
        let (offset, speed) = (outer(0), outer(1));
        widest[i] = largest_magnitude(offset.0, offset.1) as f32;
        let (slow, fast) = (smallest_magnitude(speed.0, speed.1), largest_magnitude(speed.0, speed.1));
        (low[i], high[i]) = ((slow * slow) as f32, (fast * fast) as f32);
    }
}

/// The smallest absolute value of numbers between two.
#[inline(always)]
fn smallest_magnitude(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    let near = if low > -high { low } else { -high };
    if near > 0.0 { near } else { 0.0 }
}

/// The largest absolute value of numbers between two.
#[inline(always)]
fn largest_magnitude(a: f64, b: f64) -> f64 {
    let (a, b) = (a.abs(), b.abs());
    if a > b { a } else { b }
}

multiversion! {
    /// For lateral motions over time with a given spread beside a path of bounded curvature; `desired` speed and what
    /// it is off by. Squared gaps are left in `out`.
    fn gaps_over_time = sum_over_time, (
        speeds: &CoarseSpeeds,
        spread: &[f32],
        counts: &[f32],
        curvature: f32,
        desired: [f32; 2],
        out: &mut [f32],
    ) -> f32
}

#[inline(always)]
fn sum_over_time(
    speeds: &CoarseSpeeds,
    spread: &[f32],
    counts: &[f32],
    curvature: f32,
    [desired, rounding]: [f32; 2],
    out: &mut [f32],
) -> f32 {
    let n = out.len();
    let CoarseSpeeds { rest, rise, end_velocity } = *speeds;
    let (rest, rise, counts) = (&rest[..n], &rise[..n], &counts[..n]);
    let (widest, low_aside, high_aside) = (&spread[..n], &spread[n..2 * n], &spread[2 * n..3 * n]);
    let square = desired * desired;
    for i in 0..n {
        let s_dot = larger(rest[i] + end_velocity * rise[i], 0.0);
        let bend = curvature * widest[i];
        let (inside, outside) = (s_dot * larger(1.0 - bend, 0.0), s_dot * (1.0 + bend));
        let (low, high) = (inside * inside + low_aside[i], outside * outside + high_aside[i]);
        // The speed between both that is nearest to the desired one.
        let nearest = larger(low, if high < square { high } else { square }).sqrt();
        let gap = larger((nearest - desired).abs() - rounding, 0.0);
        out[i] = counts[i] * (gap * gap);
    }
    total(out)
}

multiversion! {
    /// For speeds between two multiples of that along the path.
    fn gaps_over_arc = sum_over_arc, (
        speeds: &CoarseSpeeds,
        counts: &[f32],
        factors: [f32; 2],
        desired: [f32; 2],
        out: &mut [f32],
    ) -> f32
}

#[inline(always)]
fn sum_over_arc(
    speeds: &CoarseSpeeds,
    counts: &[f32],
    [low, high]: [f32; 2],
    [desired, rounding]: [f32; 2],
    out: &mut [f32],
) -> f32 {
    let n = out.len();
    let CoarseSpeeds { rest, rise, end_velocity } = *speeds;
    let (rest, rise, counts) = (&rest[..n], &rise[..n], &counts[..n]);
    for i in 0..n {
        let s_dot = larger(rest[i] + end_velocity * rise[i], 0.0);
        let gap = larger(larger(s_dot * low - desired, desired - s_dot * high) - rounding, 0.0);
        out[i] = counts[i] * (gap * gap);
    }
    total(out)
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Sum in a fixed order.
#[inline(always)]
fn total(values: &[f32]) -> f32 {
    let mut sums = [0.0; SIMD_POINTS];
    for values in values.as_chunks::<SIMD_POINTS>().0 {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
    }
    sums.iter().sum()
}
