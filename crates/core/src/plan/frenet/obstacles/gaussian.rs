//! Probability that a normally distributed point of the plane lies in an axis-parallel box: single precision for
//! several boxes at once (`boxes`; `degenerate` for correlations near ±1).

mod boxes;
mod degenerate;

use crate::geometry::Point;
use boxes::{Boxes, LANES, NODES_UP_TO};

/// Beyond this many standard deviations nothing is left (probability below 2e-8).
const REACH: f64 = 5.5;
/// Smaller variances count as this [m²].
const VARIANCE_MIN: f64 = 1e-6;

/// How often both diagonals lead from the centre of a footprint to itself, to the front left, front right, rear right and
/// rear left corner; the other lanes stay at the centre.
const LEFT_DIAGONAL: [f64; LANES] = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0];
const RIGHT_DIAGONAL: [f64; LANES] = [0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0];

/// The centre counts twice as much as a corner.
const WEIGHTS: [f32; LANES] = [1.0, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0, 0.0];

/// Standard deviations along x and y and correlation of a normal distribution in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Normal2 {
    inverse_sigma: (f32, f32),
    rho: f32,
}

/// A footprint: where its centre is, and from there to its front left and front right corner [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Footprint {
    pub(super) center: Point,
    pub(super) front_left: Point,
    pub(super) front_right: Point,
}

impl Normal2 {
    /// From variances [m²] and covariance [m²]. Deviations below 1 mm count as 1 mm and correlations stay within
    /// ±0.9999, so an impossible matrix (not positive semi-definite) is replaced by the nearest usable one.
    #[inline(always)]
    pub(super) fn new(variance_x: f64, covariance: f64, variance_y: f64) -> Self {
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let inverse = |variance: f64| 1.0 / (larger(variance, VARIANCE_MIN) as f32).sqrt();
        let (x, y) = (inverse(variance_x), inverse(variance_y));
        let rho = covariance as f32 * x * y;
        let rho = if rho > 0.9999 { 0.9999 } else { rho };
        Self { inverse_sigma: (x, y), rho: if rho < -0.9999 { -0.9999 } else { rho } }
    }

    /// The probability that the distributed centre of a footprint lies within `half` of the origin in x and in y [m],
    /// plus half of those of its four corners. Error of each below 6e-7; never negative.
    #[inline(always)]
    pub(super) fn centre_and_corners(&self, mean: &Footprint, half: (f64, f64)) -> f32 {
        let Footprint { center, front_left, front_right } = *mean;
        // The nearest corner may be beyond what is left of the distribution; a thousandth is more than rounding.
        let beyond = |center: f64, left: f64, right: f64, half: f64, inverse_sigma: f32| {
            (center.abs() - left.abs().max(right.abs()) - half) * f64::from(inverse_sigma) > 1.001 * REACH
        };
        if beyond(center.x, front_left.x, front_right.x, half.0, self.inverse_sigma.0)
            || beyond(center.y, front_left.y, front_right.y, half.1, self.inverse_sigma.1)
        {
            return 0.0;
        }
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let (left, right) = (LEFT_DIAGONAL[lane], RIGHT_DIAGONAL[lane]);
            x[lane] = center.x + (left * front_left.x + right * front_right.x);
            y[lane] = center.y + (left * front_left.y + right * front_right.y);
        }
        let found = self.probabilities(&x, &y, half);
        let mut halves = [0.0; LANES / 2];
        for lane in 0..LANES / 2 {
            halves[lane] = WEIGHTS[lane] * found[lane] + WEIGHTS[lane + LANES / 2] * found[lane + LANES / 2];
        }
        (halves[0] + halves[2]) + (halves[1] + halves[3])
    }

    /// Probabilities of boxes around several centres [m].
    #[inline(always)]
    fn probabilities(&self, x: &[f64; LANES], y: &[f64; LANES], half: (f64, f64)) -> [f32; LANES] {
        let inverse_sigma = (f64::from(self.inverse_sigma.0), f64::from(self.inverse_sigma.1));
        let boxes = Boxes::new(x, y, half, inverse_sigma);
        let [.., moderate] = NODES_UP_TO;
        if self.rho > moderate || self.rho < -moderate {
            return degenerate::probabilities(&boxes, self.rho);
        }
        boxes.probabilities(self.rho)
    }
}

#[cfg(test)]
mod tests;
