//! The terms of the cost of one sample, see [`CostWeights`]: those that follow from the grid of samples alone, for all samples
//! of a profile at once, and those of a trajectory. Terms that depend on predictions are in `obstacles`.

use super::super::frame::Waypoint;
use super::Problem;
use super::feasibility::Rejection;
use super::grid::SampleGrid;
use super::profiles::ProfilePoint;
use super::settings::{CostWeights, N_TABLE_TERMS, N_WORLD_TERMS};
use crate::simd::multiversion;

/// Terms that follow from the grid; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct TableCosts {
    /// One entry per sample; infinite for samples of rejected profiles.
    pub(super) terms: Vec<[f64; N_TABLE_TERMS]>,
    /// What these terms cost.
    pub(super) bounds: Vec<f64>,
    /// Summed squares of the end offsets of a profile at hand.
    squares: Vec<f64>,
    speeds: Vec<[f64; 4]>,
}

impl TableCosts {
    pub(super) fn prepare(&mut self, samples: &SampleGrid, problem: &Problem) {
        self.terms.clear();
        self.terms.resize(samples.len(), [f64::INFINITY; N_TABLE_TERMS]);
        let [of_velocity, of_offset, of_lateral, of_longitudinal, ..] = problem.settings.weights.as_array();
        self.bounds.clear();
        self.bounds.resize(samples.len(), f64::INFINITY);
        let n_offsets = samples.end_offsets.len();
        for (index, profile) in samples.profiles.iter().enumerate() {
            if profile.rejection != Rejection::Admissible {
                continue;
            }
            self.find_speeds(samples, index, problem);
            self.squares.clear();
            self.squares.resize(n_offsets, 0.0);
            sum_squares(&self.speeds, &samples.end_offsets, problem.targets.velocity, &mut self.squares);
            let (first, lateral) = (profile.table * n_offsets, &samples.lateral);
            for (k, square) in self.squares.iter().enumerate() {
                let (velocity, offset, jerk) = (square.sqrt(), lateral.offset[first + k], lateral.jerk[first + k]);
                self.terms[index * n_offsets + k] = [velocity, offset, jerk, profile.jerk];
                self.bounds[index * n_offsets + k] =
                    of_velocity * velocity + of_offset * offset + of_lateral * jerk + of_longitudinal * profile.jerk;
            }
        }
    }

    /// Both components of the velocity of a profile's samples at all points: along the path, what each metre of end offset adds
    /// to it, and likewise sideways.
    fn find_speeds(&mut self, samples: &SampleGrid, index: usize, problem: &Problem) {
        let (path, is_over_arc) = (&problem.request.route.path, samples.profiles[index].is_over_arc);
        let points = samples.motion(index).iter().zip(samples.beside(index));
        self.speeds.clear();
        self.speeds.extend(points.map(|(motion, lateral)| {
            let (s_dot, curvature) = (motion.s_dot, path.curvature_at(motion.s));
            let ([home, home_1, _], [step, step_1, _]) = (lateral.home, lateral.step);
            // d' s_dot = d_dot
            let factor = if is_over_arc { s_dot } else { 1.0 };
            [s_dot * (1.0 - curvature * home), -s_dot * curvature * step, factor * home_1, factor * step_1]
        }));
    }
}

multiversion! {
    /// Adds the squares of v - v_desired over the points, with v² = (s_dot K)² + d_dot².
    fn sum_squares = sum_squares_of, (speeds: &[[f64; 4]], end_offsets: &[f64], desired: f64, sums: &mut [f64])
}

#[inline(always)]
fn sum_squares_of(speeds: &[[f64; 4]], end_offsets: &[f64], desired: f64, sums: &mut [f64]) {
    let n = sums.len().min(end_offsets.len());
    for [along, along_by_offset, sideways, sideways_by_offset] in speeds {
        for k in 0..n {
            let along = along + end_offsets[k] * along_by_offset;
            let sideways = sideways + end_offsets[k] * sideways_by_offset;
            let gap = (along * along + sideways * sideways).sqrt() - desired;
            sums[k] += gap * gap;
        }
    }
}

/// Motion of one sample in the Frenet frame, by time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrenetMotion {
    s_dot: f64,
    s_ddot: f64,
    d_dot: f64,
    d_ddot: f64,
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
    distance_to_obstacles: f64,
    dt: f64,
) -> [f64; N_WORLD_TERMS] {
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
        distance_to_obstacles,
    ]
}

/// Weighted sum of the world terms.
pub(super) fn weighted_world_terms(weights: &CostWeights, terms: &[f64; N_WORLD_TERMS]) -> f64 {
    weights.as_array()[N_TABLE_TERMS..].iter().zip(terms).map(|(weight, term)| weight * term).sum()
}

/// One of the world terms counts.
pub(super) fn has_world_terms(weights: &CostWeights) -> bool {
    weights.as_array()[N_TABLE_TERMS..][..N_WORLD_TERMS].iter().any(|weight| *weight > 0.0)
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
