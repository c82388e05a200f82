//! The cost of a sample. What follows from the tables alone is computed for all samples at once; terms that need the
//! trajectory in the world are added to the few samples that get so far. The prediction term comes in blocks of points:
//! each adds something positive, so every partial sum is a lower bound.

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use super::bounds::{FirstBounds, largest, smallest};
use super::lateral::LateralPoints;
use super::obstacles::Obstacles;
use super::sample::{Motion, Samples};
use super::settings::{CostWeights, N_TERMS};
use crate::geometry::polyline::ReferencePath;
use crate::wide::for_wide_machines;

/// Terms that follow from the tables. Of all rows there is a lower bound at first; a better one and then the samples of
/// a row are worked out when somebody asks for them.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample, of this plan once `compute_row` has seen its row.
    pub(super) velocity_offset: Vec<f64>,
    /// Weighted sum of the terms from the tables, likewise.
    pub(super) total: Vec<f64>,
    /// No sample of the row has a smaller total; infinite for rejected rows.
    pub(super) bounds: Vec<f64>,
    /// The bound is as good as it gets.
    is_tight: Vec<bool>,
    desired_velocity: f64,
    speeds: LaneSpeeds,
    /// The smallest weighted sum of the lateral terms, by lateral table of time.
    lateral: Vec<f64>,
    first: FirstBounds,
    /// 1 for points, 0 for padding.
    counts: Vec<f64>,
}

/// Lanes that are worked on at once.
const LANES: usize = 4;
/// Bounds are lowered by this fraction: the sums that they bound are rounded.
const ROUNDING: f64 = 1e-9;

/// Both components of the velocity of a row's samples at all points, along the path and sideways; they are linear in the
/// lane.
#[derive(Debug, Clone, Default)]
struct LaneSpeeds {
    row: Option<usize>,
    n_points: usize,
    curvature: Vec<f64>,
    along: Vec<f64>,
    along_by_lane: Vec<f64>,
    sideways: Vec<f64>,
    sideways_by_lane: Vec<f64>,
}

impl LaneSpeeds {
    /// Speeds of the samples of a row.
    fn find(&mut self, samples: &Samples, index: usize, path: &ReferencePath) {
        if self.row.replace(index) == Some(index) {
            return;
        }
        let (motion, lateral) = (samples.motions(index), samples.lateral_points(index));
        self.n_points = samples.n_points;
        let Self { curvature, along, along_by_lane, sideways, sideways_by_lane, .. } = self;
        for buffer in [&mut *curvature, along, along_by_lane, sideways, sideways_by_lane] {
            buffer.resize(samples.stride, 0.0);
        }
        for (curvature, s) in curvature.iter_mut().zip(motion.s) {
            *curvature = path.curvature_at(*s);
        }
        write_speeds(self, motion.s_dot, &lateral, samples.rows[index].is_over_arc);
    }
}

for_wide_machines! {
    fn write_speeds = speeds_at, (out: &mut LaneSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool)
}

#[inline(always)]
fn speeds_at(out: &mut LaneSpeeds, s_dot: &[f64], lateral: &LateralPoints, is_over_arc: bool) {
    let n = s_dot.len();
    let (curvature, LateralPoints { home, step }) = (&out.curvature[..n], lateral.cut(0..n));
    let (along, along_by_lane) = (&mut out.along[..n], &mut out.along_by_lane[..n]);
    let (sideways, sideways_by_lane) = (&mut out.sideways[..n], &mut out.sideways_by_lane[..n]);
    for i in 0..n {
        // d' s_dot = d_dot
        let factor = if is_over_arc { s_dot[i] } else { 1.0 };
        along[i] = s_dot[i] * (1.0 - curvature[i] * home[0][i]);
        along_by_lane[i] = -s_dot[i] * curvature[i] * step[0][i];
        sideways[i] = factor * home[1][i];
        sideways_by_lane[i] = factor * step[1][i];
    }
}

for_wide_machines! {
    /// Summed squares of speed minus desired speed over the points, for up to four lanes.
    fn summed_squares = squares_of, (speeds: &LaneSpeeds, lanes: &[f64], desired: f64) -> [f64; LANES]
}

#[inline(always)]
fn squares_of(speeds: &LaneSpeeds, lanes: &[f64], desired: f64) -> [f64; LANES] {
    let mut lane = [0.0; LANES];
    lane[..lanes.len()].copy_from_slice(lanes);
    let mut sums = [0.0; LANES];
    let n = speeds.n_points;
    let (along, along_by_lane) = (&speeds.along[..n], &speeds.along_by_lane[..n]);
    let (sideways, sideways_by_lane) = (&speeds.sideways[..n], &speeds.sideways_by_lane[..n]);
    for i in 0..n {
        for k in 0..LANES {
            let along = along[i] + lane[k] * along_by_lane[i];
            let sideways = sideways[i] + lane[k] * sideways_by_lane[i];
            let offset = (along * along + sideways * sideways).sqrt() - desired;
            sums[k] += offset * offset;
        }
    }
    sums
}

/// Sum over all points with padding in an order that suits wide machines.
#[inline(always)]
fn summed(n: usize, value: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; LANES];
    for i in (0..n).step_by(LANES) {
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += value(i + k);
        }
    }
    sums.iter().sum()
}

for_wide_machines! {
    /// Summed squares of what speed and desired speed differ by at least, whatever the lane between the outer ones.
    fn summed_gaps = gaps_of, (speeds: &LaneSpeeds, counts: &[f64], outer: [f64; 2], desired: f64) -> f64
}

#[inline(always)]
fn gaps_of(speeds: &LaneSpeeds, counts: &[f64], [first, last]: [f64; 2], desired: f64) -> f64 {
    let n = counts.len();
    let (along, along_by_lane) = (&speeds.along[..n], &speeds.along_by_lane[..n]);
    let (sideways, sideways_by_lane) = (&speeds.sideways[..n], &speeds.sideways_by_lane[..n]);
    summed(n, |i| {
        // Each component is between its values at the outer lanes.
        let ahead = (along[i] + first * along_by_lane[i], along[i] + last * along_by_lane[i]);
        let aside = (sideways[i] + first * sideways_by_lane[i], sideways[i] + last * sideways_by_lane[i]);
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
    /// First bounds of all rows.
    pub(super) fn prepare(
        &mut self,
        samples: &Samples,
        desired_velocity: f64,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        self.desired_velocity = desired_velocity;
        self.speeds.row = None;
        self.velocity_offset.resize(samples.len(), f64::INFINITY);
        self.total.resize(samples.len(), f64::INFINITY);
        self.is_tight.clear();
        self.is_tight.resize(samples.rows.len(), false);
        self.counts.clear();
        self.counts.extend((0..samples.stride).map(|i| if i < samples.n_points { 1.0 } else { 0.0 }));
        self.lateral.clear();
        for table in 0..samples.lateral.len() {
            self.lateral.push(least_lateral(samples, table, weights));
        }
        self.first.prepare(samples, path);
        self.bounds.clear();
        for index in 0..samples.rows.len() {
            let bound = self.first_bound(samples, index, weights);
            self.bounds.push(bound);
        }
    }

    fn first_bound(&mut self, samples: &Samples, index: usize, weights: &CostWeights) -> f64 {
        let row = &samples.rows[index];
        if row.rejection != super::Rejection::Admissible {
            return f64::INFINITY;
        }
        let gaps = self.first.gaps(samples, index, self.desired_velocity);
        let lateral = row.table.map_or(0.0, |table| self.lateral[table]);
        (from_tables(weights, gaps.sqrt(), 0.0, 0.0, row.jerk) + lateral) * (1.0 - ROUNDING)
    }

    /// A better bound of an admissible row, once.
    pub(super) fn tighten(
        &mut self,
        samples: &mut Samples,
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
        let outer = [samples.lanes[0], samples.lanes[samples.lanes.len() - 1]];
        let gaps = summed_gaps(&self.speeds, &self.counts, outer, self.desired_velocity);
        let lateral = self.lateral.get(table).copied().unwrap_or_else(|| least_lateral(samples, table, weights));
        let total = from_tables(weights, gaps.sqrt(), 0.0, 0.0, samples.rows[index].jerk) + lateral;
        Some((total * (1.0 - ROUNDING)).max(self.bounds[index]))
    }

    /// Terms and totals of the samples of an admissible row. The first is the root of the summed squares of
    /// v - v_desired, with v² = (s_dot K)² + d_dot².
    pub(super) fn compute_row(
        &mut self,
        samples: &mut Samples,
        index: usize,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        samples.load_motion(index);
        let table = samples.lateral_table(index);
        self.speeds.find(samples, index, path);
        let n_lanes = samples.lanes.len();
        let row = &samples.rows[index];
        let lanes = index * n_lanes..(index + 1) * n_lanes;
        let sums = &mut self.velocity_offset[lanes.clone()];
        for (sums, lanes) in sums.chunks_mut(LANES).zip(samples.lanes.chunks(LANES)) {
            let squares = summed_squares(&self.speeds, lanes, self.desired_velocity);
            sums.copy_from_slice(&squares[..sums.len()]);
        }
        let per_lane = table * n_lanes..(table + 1) * n_lanes;
        let parts = samples.lateral.offset[per_lane.clone()].iter().zip(&samples.lateral.jerk[per_lane]);
        for ((velocity_offset, total), (offset, jerk)) in sums.iter_mut().zip(&mut self.total[lanes]).zip(parts) {
            *velocity_offset = velocity_offset.sqrt();
            *total = from_tables(weights, *velocity_offset, *offset, *jerk, row.jerk);
        }
    }
}

/// The smallest weighted sum of the lateral terms of a table.
fn least_lateral(samples: &Samples, table: usize, weights: &CostWeights) -> f64 {
    let lanes = table * samples.lanes.len()..(table + 1) * samples.lanes.len();
    let terms = samples.lateral.offset[lanes.clone()].iter().zip(&samples.lateral.jerk[lanes]);
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
    pub(super) fn new(motion: &Motion, [_, d_1, d_2]: [f64; 3], is_over_arc: bool) -> Self {
        let Motion { s_dot, s_ddot, .. } = *motion;
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
