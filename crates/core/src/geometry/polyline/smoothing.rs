//! Noisy, kinked vertices -> a smooth, finely sampled curve near them.
//!
//! The points, resampled at a uniform spacing, are replaced by the p that minimise
//! sum |p_i - q_i|² + (L / h)⁶ sum |third difference of p|². The third derivative by arc length is the rate of
//! curvature, so straight lines and parabolas stay as they are, and detail shorter than 2 pi L fades. What the first
//! pass took away is smoothed and added once more, which leaves tight bends their radius.

use super::Polyline;
use crate::error::Result;
use crate::geometry::Point;

/// Spacing of the points that are smoothed [m].
const SPACING: f64 = 0.5;
/// Smoothing length L [m]. A kink of angle a is rounded by about 0.27 L a: 0.12 m at 10 degrees, 0.36 m at 30. Longer
/// would steer less abruptly, but in junctions of narrow streets leave the lane.
const SMOOTHING_LENGTH: f64 = 2.5;
/// Weight of the first and the last point; of the others: 1.
const END_WEIGHT: f64 = 50.0;
/// A vertex at which the polyline turns by more than this ...
const SPIKE_COSINE: f64 = 0.26;
/// ... next to a segment shorter than this [m] is not a bend but an error of the map.
const SPIKE_LENGTH: f64 = 1.5;

/// Smooth points about 0.5 m apart, at least nine.
pub(super) fn smoothed(points: &[Point]) -> Result<Vec<Point>> {
    let line = Polyline::new(&without_spikes(Polyline::new(points)?.points()))?;
    let spacing = SPACING.min(line.length() / 8.0);
    let raw = line.resampled(spacing);
    let step = line.length() / (raw.len() - 1) as f64;
    // On short lines less, so that the matrix stays well conditioned and the ends keep a say.
    let smoothing_length = SMOOTHING_LENGTH.min(line.length() / 8.0);
    let smoother = Smoother::new(raw.len(), (smoothing_length / step).powi(6));
    let mut curve = raw.clone();
    smoother.solve(&mut curve);
    let mut rest: Vec<Point> = raw.iter().zip(&curve).map(|(q, p)| *q - *p).collect();
    smoother.solve(&mut rest);
    for (p, r) in curve.iter_mut().zip(&rest) {
        *p = *p + *r;
    }
    Ok(curve)
}

/// Drops inner vertices at which the line jumps sideways or turns back within a short distance.
fn without_spikes(points: &[Point]) -> Vec<Point> {
    let mut kept = points.to_vec();
    let mut i = 1;
    while i + 1 < kept.len() {
        let (before, after) = (kept[i] - kept[i - 1], kept[i + 1] - kept[i]);
        let (length_before, length_after) = (before.norm(), after.norm());
        let turns = before.dot(after) < SPIKE_COSINE * length_before * length_after;
        if turns && length_before.min(length_after) < SPIKE_LENGTH {
            kept.remove(i);
            i = i.saturating_sub(1).max(1);
        } else {
            i += 1;
        }
    }
    kept
}

/// Factorised matrix 1 + stiffness * D'D, D the third differences: symmetric, seven diagonals.
struct Smoother {
    /// Row i of the unit lower triangle: entries (i, i-1), (i, i-2), (i, i-3).
    lower: Vec<[f64; 3]>,
    diagonal: Vec<f64>,
}

impl Smoother {
    /// For at least two points; the first and the last have a larger say than the others.
    fn new(n: usize, stiffness: f64) -> Self {
        /// Weights of four neighbours in the third difference, whose square is made small.
        const DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];
        // band[i][k] = entry (i, i - k)
        let mut band = vec![[1.0, 0.0, 0.0, 0.0]; n];
        band[0][0] = END_WEIGHT;
        band[n - 1][0] = END_WEIGHT;
        for first in 0..n.saturating_sub(3) {
            for a in 0..4 {
                for b in 0..=a {
                    band[first + a][a - b] += stiffness * DIFFERENCE[a] * DIFFERENCE[b];
                }
            }
        }
        let mut lower = vec![[0.0; 3]; n];
        let mut diagonal = vec![0.0; n];
        for i in 0..n {
            let mut pivot = band[i][0];
            for k in (1..=3.min(i)).rev() {
                let j = i - k;
                // Columns left of j that rows i and j share.
                let mut entry = band[i][k];
                for m in k + 1..=3.min(i) {
                    entry -= lower[i][m - 1] * lower[j][m - k - 1] * diagonal[i - m];
                }
                lower[i][k - 1] = entry / diagonal[j];
                pivot -= entry * lower[i][k - 1];
            }
            diagonal[i] = pivot;
        }
        Self { lower, diagonal }
    }

    fn solve(&self, values: &mut [Point]) {
        let n = values.len();
        // Differences are taken from the first point, so that large coordinates cost no digits.
        let origin = values[0];
        for i in 0..n {
            let weight = if i == n - 1 { END_WEIGHT } else { 1.0 }; // the first value is the origin, zero
            let mut value = (values[i] - origin) * weight;
            for k in 1..=3.min(i) {
                value = value - values[i - k] * self.lower[i][k - 1];
            }
            values[i] = value;
        }
        for (value, pivot) in values.iter_mut().zip(&self.diagonal) {
            *value = *value * (1.0 / pivot);
        }
        for i in (0..n).rev() {
            let mut value = values[i];
            for k in 1..=3.min(n - 1 - i) {
                value = value - values[i + k] * self.lower[i + k][k - 1];
            }
            values[i] = value;
        }
        for value in values.iter_mut() {
            *value = *value + origin;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deviation(points: &[Point], curve: &[Point]) -> f64 {
        let line = Polyline::new(points).expect("valid");
        curve.iter().map(|p| line.project(*p).distance).fold(0.0, f64::max)
    }

    #[test]
    fn a_straight_line_stays_where_it_is_even_far_from_the_origin() {
        let points: Vec<Point> =
            (0..40).map(|i| Point::new(5.3e6 + f64::from(i) * 7.0, 6.9e5 - f64::from(i) * 2.0)).collect();
        assert!(deviation(&points, &smoothed(&points).expect("valid")) < 1e-6);
    }

    #[test]
    fn a_tight_bend_keeps_its_radius() {
        let points: Vec<Point> = (0..60).map(|i| Point::from_angle(f64::from(i) * 0.05) * 7.0).collect();
        assert!(deviation(&points, &smoothed(&points).expect("valid")) < 0.1);
    }

    #[test]
    fn noise_between_vertices_fades() {
        let points: Vec<Point> =
            (0..100).map(|i| Point::new(f64::from(i), if i % 2 == 0 { 0.1 } else { -0.1 })).collect();
        let curve = smoothed(&points).expect("valid");
        assert!(curve[20..curve.len() - 20].iter().all(|p| p.y.abs() < 0.01));
    }

    #[test]
    fn a_sideways_jump_and_a_step_back_are_not_bends() {
        let points = [(0.0, 0.0), (30.0, 0.0), (30.0, 0.6), (60.0, 0.6), (59.0, 0.6), (90.0, 0.6)]
            .map(|(x, y)| Point::new(x, y));
        assert_eq!(without_spikes(&points).len(), 4);
    }
}
