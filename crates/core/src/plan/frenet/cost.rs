//! The cost of a sample. What follows from the tables alone is computed for all samples at once; terms that need the
//! trajectory in the world are added to the few samples that get so far. The prediction term comes in blocks of points:
//! each adds something positive, so every partial sum is a lower bound.

use super::super::PlanRequest;
use super::super::frame::Waypoint;
use super::obstacles::Obstacles;
use super::sample::{LateralTables, Motion, Samples};
use super::settings::{CostWeights, N_TERMS};
use crate::geometry::polyline::ReferencePath;

/// Terms that follow from the tables. Of all rows there is a lower bound; the samples of a row are worked out when
/// somebody asks for them.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample, valid once `compute_row` has seen its row.
    pub(super) velocity_offset: Vec<f64>,
    /// Weighted sum of the terms from the tables, likewise.
    pub(super) total: Vec<f64>,
    /// No sample of the row has a smaller total; infinite for rejected rows.
    pub(super) bounds: Vec<f64>,
    desired_velocity: f64,
    /// Of the row at hand, by point.
    speeds: Vec<LaneSpeed>,
    /// The smallest weighted sum of the lateral terms, by lateral table.
    lateral: Vec<f64>,
}

/// Lanes that are worked on at once.
const LANES: usize = 4;

/// Both components of the velocity, along the path and sideways; they are linear in the lane.
#[derive(Debug, Clone, Copy)]
struct LaneSpeed {
    along: f64,
    along_by_lane: f64,
    sideways: f64,
    sideways_by_lane: f64,
}

/// Summed squares of speed minus desired speed over the points, for up to four lanes.
#[inline]
fn summed_squares(speeds: &[LaneSpeed], lanes: &[f64], desired: f64) -> [f64; LANES] {
    let mut lane = [0.0; LANES];
    lane[..lanes.len()].copy_from_slice(lanes);
    let mut sums = [0.0; LANES];
    for speed in speeds {
        for k in 0..LANES {
            let along = speed.along + lane[k] * speed.along_by_lane;
            let sideways = speed.sideways + lane[k] * speed.sideways_by_lane;
            let offset = (along * along + sideways * sideways).sqrt() - desired;
            sums[k] += offset * offset;
        }
    }
    sums
}

/// Summed squares of what speed and desired speed differ by at least, whatever the lane between `first` and `last`.
#[inline]
fn summed_gaps(speeds: &[LaneSpeed], [first, last]: [f64; 2], desired: f64) -> f64 {
    let mut sum = 0.0;
    for speed in speeds {
        let along = [speed.along + first * speed.along_by_lane, speed.along + last * speed.along_by_lane];
        let sideways =
            [speed.sideways + first * speed.sideways_by_lane, speed.sideways + last * speed.sideways_by_lane];
        // Each component is between its values at the outer lanes: its size is smallest at 0, if that is between.
        let smallest = |[a, b]: [f64; 2]| a.min(b).max(-a.max(b)).max(0.0);
        let largest = |[a, b]: [f64; 2]| a.abs().max(b.abs());
        let (low_along, low_sideways) = (smallest(along), smallest(sideways));
        let (high_along, high_sideways) = (largest(along), largest(sideways));
        let low = (low_along * low_along + low_sideways * low_sideways).sqrt();
        let high = (high_along * high_along + high_sideways * high_sideways).sqrt();
        let gap = (low - desired).max(desired - high).max(0.0);
        sum += gap * gap;
    }
    sum
}

impl TableCosts {
    /// The bounds of all rows.
    pub(super) fn prepare(
        &mut self,
        samples: &Samples,
        desired_velocity: f64,
        weights: &CostWeights,
        path: &ReferencePath,
    ) {
        /// Bounds are lowered by this fraction: the sums that they bound are rounded.
        const ROUNDING: f64 = 1e-9;
        self.desired_velocity = desired_velocity;
        for buffer in [&mut self.velocity_offset, &mut self.total] {
            buffer.clear();
            buffer.resize(samples.len(), f64::INFINITY);
        }
        let LateralTables { offset, jerk, .. } = &samples.lateral;
        self.lateral.clear();
        let tables = offset.chunks_exact(samples.lanes.len()).zip(jerk.chunks_exact(samples.lanes.len()));
        self.lateral.extend(tables.map(|(offset, jerk)| {
            let lanes = offset.iter().zip(jerk).map(|(offset, jerk)| from_tables(weights, 0.0, *offset, *jerk, 0.0));
            lanes.fold(f64::INFINITY, f64::min)
        }));
        let outer = [samples.lanes[0], samples.lanes[samples.lanes.len() - 1]];
        self.bounds.clear();
        for (index, row) in samples.rows.iter().enumerate() {
            if row.rejection != super::Rejection::Admissible {
                self.bounds.push(f64::INFINITY);
                continue;
            }
            self.find_speeds(samples, index, path);
            let velocity_offset = summed_gaps(&self.speeds, outer, desired_velocity).sqrt();
            let total = from_tables(weights, velocity_offset, 0.0, 0.0, row.jerk) + self.lateral[row.lateral.table];
            self.bounds.push(total * (1.0 - ROUNDING));
        }
    }

    /// Speeds of the samples of a row, by point.
    fn find_speeds(&mut self, samples: &Samples, index: usize, path: &ReferencePath) {
        let is_over_arc = samples.rows[index].lateral.is_over_arc;
        self.speeds.clear();
        let points = samples.motions(index).iter().zip(samples.lateral_points(index));
        self.speeds.extend(points.map(|(motion, lateral)| {
            let curvature = curvature_at(path, motion.s);
            // d' s_dot = d_dot
            let sideways = if is_over_arc { motion.s_dot } else { 1.0 };
            LaneSpeed {
                along: motion.s_dot * (1.0 - curvature * lateral.home[0]),
                along_by_lane: -motion.s_dot * curvature * lateral.step[0],
                sideways: sideways * lateral.home[1],
                sideways_by_lane: sideways * lateral.step[1],
            }
        }));
    }

    /// Terms and totals of the samples of an admissible row. The first is the root of the summed squares of
    /// v - v_desired, with v² = (s_dot K)² + d_dot².
    pub(super) fn compute_row(&mut self, samples: &Samples, index: usize, weights: &CostWeights, path: &ReferencePath) {
        self.find_speeds(samples, index, path);
        let n_lanes = samples.lanes.len();
        let row = &samples.rows[index];
        let lanes = index * n_lanes..(index + 1) * n_lanes;
        let sums = &mut self.velocity_offset[lanes.clone()];
        for (sums, lanes) in sums.chunks_mut(LANES).zip(samples.lanes.chunks(LANES)) {
            let squares = summed_squares(&self.speeds, lanes, self.desired_velocity);
            sums.copy_from_slice(&squares[..sums.len()]);
        }
        let per_lane = row.lateral.table * n_lanes..(row.lateral.table + 1) * n_lanes;
        let parts = samples.lateral.offset[per_lane.clone()].iter().zip(&samples.lateral.jerk[per_lane]);
        for ((velocity_offset, total), (offset, jerk)) in sums.iter_mut().zip(&mut self.total[lanes]).zip(parts) {
            *velocity_offset = velocity_offset.sqrt();
            *total = from_tables(weights, *velocity_offset, *offset, *jerk, row.jerk);
        }
    }
}

/// `path.at(s).curvature` without the rest.
#[inline]
fn curvature_at(path: &ReferencePath, s: f64) -> f64 {
    let knots = path.curvature();
    let position = s / path.spacing();
    let i = (position as usize).min(knots.len() - 2);
    knots[i] + (knots[i + 1] - knots[i]) * (position - i as f64)
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
