//! The cost of a sample. What follows from the tables alone is computed for all samples at once; terms that need the
//! trajectory in the world are added to the few samples that get so far. The prediction term comes in blocks of points:
//! each adds something positive, so every partial sum is a lower bound.

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use super::cost_bounds::{FirstBounds, largest, smallest};
use super::grid::{ProfilePoint, SampleGrid};
use super::lateral::LateralPoints;
use super::obstacles::Obstacles;
use super::settings::{CostWeights, N_TERMS};
use crate::geometry::polyline::ReferencePath;
use crate::simd::multiversion;

/// Terms that follow from the tables. Of all profiles there is a lower bound at first; a better one and then the samples of
/// a profile are worked out when somebody asks for them.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample, of this plan once `compute_profile` has seen its profile.
    pub(super) velocity_offset: Vec<f64>,
    /// Weighted sum of the terms from the tables, likewise.
    pub(super) total: Vec<f64>,
    /// No sample of the profile has a smaller total; infinite for rejected profiles.
    pub(super) bounds: Vec<f64>,
    /// The bound is as good as it gets.
    is_tight: Vec<bool>,
    desired_velocity: f64,
    speeds: ProfileSpeeds,
    /// The smallest weighted sum of the lateral terms, by lateral table of time.
    lateral: Vec<f64>,
    first: FirstBounds,
    /// 1 for points, 0 for padding.
    counts: Vec<f64>,
}

/// Lanes that are worked on at once.
const WIDTH: usize = 4;
/// Bounds are lowered by this fraction: the sums that they bound are rounded.
const ROUNDING: f64 = 1e-9;

/// Both components of the velocity of a profile's samples at all points, along the path and sideways; they are linear in the
/// end offset.
#[derive(Debug, Clone, Default)]
struct ProfileSpeeds {
    profile: Option<usize>,
    n_points: usize,
    curvature: Vec<f64>,
    along: Vec<f64>,
    along_by_offset: Vec<f64>,
    sideways: Vec<f64>,
    sideways_by_offset: Vec<f64>,
}

impl ProfileSpeeds {
    /// Speeds of the samples of a profile.
    fn find(&mut self, samples: &SampleGrid, index: usize, path: &ReferencePath) {
        if self.profile.replace(index) == Some(index) {
            return;
        }
        let (motion, lateral) = (samples.motions(index), samples.lateral_points(index));
        self.n_points = samples.n_points;
        let Self { curvature, along, along_by_offset, sideways, sideways_by_offset, .. } = self;
        for buffer in [&mut *curvature, along, along_by_offset, sideways, sideways_by_offset] {
            buffer.resize(samples.stride, 0.0);
        }
        for (curvature, s) in curvature.iter_mut().zip(motion.s) {
            *curvature = path.curvature_at(*s);
        }
        write_speeds(self, motion.s_dot, &lateral, samples.profiles[index].is_over_arc);
    }
}

multiversion! {
    fn write_speeds = speeds_at, (out: &mut ProfileSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool)
}

#[inline(always)]
fn speeds_at(out: &mut ProfileSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool) {
    let n = s_dot.len();
    let (curvature, LateralPoints { home, step }) = (&out.curvature[..n], lateral.cut(0..n));
    let (along, along_by_offset) = (&mut out.along[..n], &mut out.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&mut out.sideways[..n], &mut out.sideways_by_offset[..n]);
    for i in 0..n {
        // d' s_dot = d_dot
        let factor = if is_over_arc { s_dot[i] } else { 1.0 };
        along[i] = s_dot[i] * (1.0 - curvature[i] * home[0][i]);
        along_by_offset[i] = -s_dot[i] * curvature[i] * step[0][i];
        sideways[i] = factor * home[1][i];
        sideways_by_offset[i] = factor * step[1][i];
    }
}

multiversion! {
    /// Summed squares of speed minus desired speed over the points, for up to four end offsets.
    fn summed_squares = squares_of, (speeds: &ProfileSpeeds, end_offsets: &[f64], desired: f64) -> [f64; WIDTH]
}

#[inline(always)]
fn squares_of(speeds: &ProfileSpeeds, end_offsets: &[f64], desired: f64) -> [f64; WIDTH] {
    let mut end_offset = [0.0; WIDTH];
    end_offset[..end_offsets.len()].copy_from_slice(end_offsets);
    let mut sums = [0.0; WIDTH];
    let n = speeds.n_points;
    let (along, along_by_offset) = (&speeds.along[..n], &speeds.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&speeds.sideways[..n], &speeds.sideways_by_offset[..n]);
    for i in 0..n {
        for k in 0..WIDTH {
            let along = along[i] + end_offset[k] * along_by_offset[i];
            let sideways = sideways[i] + end_offset[k] * sideways_by_offset[i];
            let offset = (along * along + sideways * sideways).sqrt() - desired;
            sums[k] += offset * offset;
        }
    }
    sums
}

/// Sum over all points with padding in an order that suits wide machines.
#[inline(always)]
fn summed(n: usize, value: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; WIDTH];
    for i in (0..n).step_by(WIDTH) {
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += value(i + k);
        }
    }
    sums.iter().sum()
}

multiversion! {
    /// Summed squares of what speed and desired speed differ by at least, whatever the end offset between the outer ones.
    fn summed_gaps = gaps_of, (speeds: &ProfileSpeeds, counts: &[f64], outer: [f64; 2], desired: f64) -> f64
}

#[inline(always)]
fn gaps_of(speeds: &ProfileSpeeds, counts: &[f64], [first, last]: [f64; 2], desired: f64) -> f64 {
    let n = counts.len();
    let (along, along_by_offset) = (&speeds.along[..n], &speeds.along_by_offset[..n]);
    let (sideways, sideways_by_offset) = (&speeds.sideways[..n], &speeds.sideways_by_offset[..n]);
    summed(n, |i| {
        // Each component is between its values at the outer end offsets.
        let ahead = (along[i] + first * along_by_offset[i], along[i] + last * along_by_offset[i]);
        let aside = (sideways[i] + first * sideways_by_offset[i], sideways[i] + last * sideways_by_offset[i]);
        let (low, low_aside) = (smallest(ahead.0, ahead.1), smallest(aside.0, aside.1));
        let (high, high_aside) = (largest(ahead.0, ahead.1), largest(aside.0, aside.1));
        let (low, high) = (low * low + low_aside * low_aside, high * high + high_aside * high_aside);
        // The speed between both that is nearest to the desired one.
        let (square, near) = (desired * desired, if high < desired * desired { high } else { desired * desired });
        let gap = (if low > square { low } else { near }).sqrt() - desired;
        counts[i] * (gap * gap)
    })
}

impl TableCosts {
    /// First bounds of all profiles.
    pub(super) fn prepare(
        &mut self,
        samples: &SampleGrid,
        desired_velocity: f64,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        self.desired_velocity = desired_velocity;
        self.speeds.profile = None;
        self.velocity_offset.resize(samples.len(), f64::INFINITY);
        self.total.resize(samples.len(), f64::INFINITY);
        self.is_tight.clear();
        self.is_tight.resize(samples.profiles.len(), false);
        self.counts.clear();
        self.counts.extend((0..samples.stride).map(|i| if i < samples.n_points { 1.0 } else { 0.0 }));
        self.lateral.clear();
        for table in 0..samples.lateral.len() {
            self.lateral.push(least_lateral(samples, table, weights));
        }
        self.first.prepare(samples, path);
        self.bounds.clear();
        for index in 0..samples.profiles.len() {
            let bound = self.first_bound(samples, index, weights);
            self.bounds.push(bound);
        }
    }

    fn first_bound(&mut self, samples: &SampleGrid, index: usize, weights: &CostWeights) -> f64 {
        let profile = &samples.profiles[index];
        if profile.rejection != super::Rejection::Admissible {
            return f64::INFINITY;
        }
        let gaps = self.first.gaps(samples, index, self.desired_velocity);
        let lateral = profile.table.map_or(0.0, |table| self.lateral[table]);
        (from_tables(weights, gaps.sqrt(), 0.0, 0.0, profile.jerk) + lateral) * (1.0 - ROUNDING)
    }

    /// A better bound of an admissible profile, once.
    pub(super) fn tighten(
        &mut self,
        samples: &mut SampleGrid,
        index: usize,
        weights: &CostWeights,
        path: &ReferencePath,
    ) -> Option<f64> {
        if std::mem::replace(&mut self.is_tight[index], true) {
            return None;
        }
        samples.load_motion(index);
        let table = samples.lateral_table(index);
        self.speeds.find(samples, index, path);
        let outer = [samples.end_offsets[0], samples.end_offsets[samples.end_offsets.len() - 1]];
        let gaps = summed_gaps(&self.speeds, &self.counts, outer, self.desired_velocity);
        let lateral = self.lateral.get(table).copied().unwrap_or_else(|| least_lateral(samples, table, weights));
        let total = from_tables(weights, gaps.sqrt(), 0.0, 0.0, samples.profiles[index].jerk) + lateral;
        Some((total * (1.0 - ROUNDING)).max(self.bounds[index]))
    }

    /// Terms and totals of the samples of an admissible profile. The first is the root of the summed squares of
    /// v - v_desired, with v² = (s_dot K)² + d_dot².
    pub(super) fn compute_profile(
        &mut self,
        samples: &mut SampleGrid,
        index: usize,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        samples.load_motion(index);
        let table = samples.lateral_table(index);
        self.speeds.find(samples, index, path);
        let n_offsets = samples.end_offsets.len();
        let profile = &samples.profiles[index];
        let end_offsets = index * n_offsets..(index + 1) * n_offsets;
        let sums = &mut self.velocity_offset[end_offsets.clone()];
        for (sums, end_offsets) in sums.chunks_mut(WIDTH).zip(samples.end_offsets.chunks(WIDTH)) {
            let squares = summed_squares(&self.speeds, end_offsets, self.desired_velocity);
            sums.copy_from_slice(&squares[..sums.len()]);
        }
        let per_offset = table * n_offsets..(table + 1) * n_offsets;
        let parts = samples.lateral.offset[per_offset.clone()].iter().zip(&samples.lateral.jerk[per_offset]);
        for ((velocity_offset, total), (offset, jerk)) in sums.iter_mut().zip(&mut self.total[end_offsets]).zip(parts) {
            *velocity_offset = velocity_offset.sqrt();
            *total = from_tables(weights, *velocity_offset, *offset, *jerk, profile.jerk);
        }
    }
}

/// The smallest weighted sum of the lateral terms of a table.
fn least_lateral(samples: &SampleGrid, table: usize, weights: &CostWeights) -> f64 {
    let end_offsets = table * samples.end_offsets.len()..(table + 1) * samples.end_offsets.len();
    let terms = samples.lateral.offset[end_offsets.clone()].iter().zip(&samples.lateral.jerk[end_offsets]);
    let sums = terms.map(|(offset, jerk)| from_tables(weights, 0.0, *offset, *jerk, 0.0));
    sums.fold(f64::INFINITY, f64::min)
}

/// Weighted sum of the first four terms.
pub(super) fn from_tables(weights: &CostWeights, velocity: f64, offset: f64, lateral: f64, longitudinal: f64) -> f64 {
    weights.velocity_offset * velocity
        + weights.distance_to_reference * offset
        + weights.lateral_jerk * lateral
        + weights.longitudinal_jerk * longitudinal
}

/// Motion of one sample in the Frenet frame, by time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrenetMotion {
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
    pub(super) d_dot: f64,
    pub(super) d_ddot: f64,
}

impl FrenetMotion {
    /// From derivatives of the lateral offset by time or by arc length.
    pub(super) fn new(motion: &ProfilePoint, [_, d_1, d_2]: [f64; 3], is_over_arc: bool) -> Self {
        let ProfilePoint { s_dot, s_ddot, .. } = *motion;
        if is_over_arc {
            Self { s_dot, s_ddot, d_dot: d_1 * s_dot, d_ddot: d_2 * s_dot * s_dot + d_1 * s_ddot }
        } else {
            Self { s_dot, s_ddot, d_dot: d_1, d_ddot: d_2 }
        }
    }
}

/// The terms between those of the tables and the prediction, in the order of `CostWeights::NAMES`, from `acceleration`
/// to `distance_to_obstacles`.
pub(super) fn world_terms(
    points: &[Waypoint],
    motion: impl Fn(usize) -> FrenetMotion,
    obstacles: &Obstacles,
    request: &PlanRequest,
) -> [f64; N_TERMS - 5] {
    let dt = request.dt;
    let n = points.len();
    let rate = |i: usize| (points[i + 1].acceleration - points[i].acceleration) / dt;
    let offset = |p: &Waypoint| p.tan_offset.atan();
    let last_half = points[n - n / 2..].iter().map(|p| offset(p).powi(2)).sum::<f64>().sqrt();
    [
        simpson(n, dt, |i| points[i].acceleration),
        (0..n - 1).map(|i| rate(i).powi(2) * dt).sum(),
        simpson(n, dt, |i| motion(i).d_dot),
        simpson(n, dt, |i| motion(i).d_ddot),
        simpson(n, dt, |i| motion(i).s_dot),
        simpson(n, dt, |i| motion(i).s_ddot),
        last_half + offset(&points[n - 1]).powi(2),
        obstacles.distance_cost(points, request),
    ]
}

/// Weighted sum of the world terms.
pub(super) fn weighted_world_terms(weights: &CostWeights, terms: &[f64; N_TERMS - 5]) -> f64 {
    weights.as_array()[4..N_TERMS - 1].iter().zip(terms).map(|(weight, term)| weight * term).sum()
}

/// One of the world terms counts.
pub(super) fn has_world_terms(weights: &CostWeights) -> bool {
    weights.as_array()[4..N_TERMS - 1].iter().any(|weight| *weight > 0.0)
}

/// Integral of the squares of equidistant values by Simpson's rule; the trapezoidal rule over a last odd interval.
fn simpson(n: usize, dt: f64, value: impl Fn(usize) -> f64) -> f64 {
    let square = |i: usize| value(i) * value(i);
    let pairs = (n - 1) / 2;
    let sum: f64 = (0..pairs).map(|k| square(2 * k) + 4.0 * square(2 * k + 1) + square(2 * k + 2)).sum();
    let rest = if (n - 1) % 2 == 1 { 0.5 * dt * (square(n - 2) + square(n - 1)) } else { 0.0 };
    sum * dt / 3.0 + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_integrated_exactly_for_straight_lines() {
        // Integral of t² from 0 to 3.
        assert!((simpson(31, 0.1, |i| i as f64 * 0.1) - 9.0).abs() < 1e-12);
        assert!((simpson(32, 3.0 / 31.0, |i| i as f64 * 3.0 / 31.0) - 9.0).abs() < 1e-3);
    }
}
