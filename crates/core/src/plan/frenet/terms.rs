//! The terms of the cost of one sample, see [`CostWeights`].

use super::super::frame::Waypoint;
use super::profiles::ProfilePoint;
use super::settings::{CostWeights, N_TABLE_TERMS, N_WORLD_TERMS};

/// Weighted sum of the table terms.
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
    weights.as_array()[N_TABLE_TERMS..][..N_WORLD_TERMS].iter().zip(terms).map(|(weight, term)| weight * term).sum()
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
