//! Probabilities of several boxes at once in single precision, without branches, for correlations near ±1.
//!
//! With a correlation of 1 both coordinates are equal, and a box has the probability of an interval. What a smaller one
//! takes away is the integral of Plackett's derivative over the correlation r up to 1. With t = 1 - r² and x² = t, its
//! integrand at a corner (h, k) is exp(-(h - k)² / (2 x²)), a kernel that may be narrow, times exp(-h k / (1 + r)) / r,
//! which is smooth (Drezner and Wesolowsky, J. Statist. Comput. Simul. 35, 1990; Genz, Statistics and Computing 14,
//! 2004). The smooth factor is a power series of t, and the moments of the kernel are known, so no integral is left and
//! all correlations take the same work.

#![expect(clippy::needless_range_loop, reason = "loops over lanes become one step of a wide machine")]

use super::REACH;
use super::boxes::{Boxes, INVERSE_TAU, LANES, LOG2_E, density_and_tail, power_of_two};

/// Powers of t in the series: the rest is below 1e-7 for correlations from 0.88 on.
const N: usize = 7;
/// `SERIES[n][m]` belongs to the power n of t and m of h k; exp(-h k / 2) is left out.
const SERIES: [[f32; N]; N] = series();

/// Root of 2 pi.
const SQRT_TAU: f32 = 2.506_628_3;
/// Sides end here: the rest is below 1e-9.
const END: f32 = 6.0;

const fn series() -> [[f32; N]; N] {
    // 1 / r, and by how much 1 / (1 + r) is above 1 / 2 (Catalan numbers by powers of 4).
    let (mut inverse, mut above) = ([0.0; N], [0.0; N]);
    let (mut catalan, mut n) = (0.5, 1);
    inverse[0] = 1.0;
    while n < N {
        inverse[n] = inverse[n - 1] * (2 * n - 1) as f64 / (2 * n) as f64;
        catalan *= (2 * (2 * n - 1)) as f64 / (4 * (n + 1)) as f64;
        above[n] = catalan;
        n += 1;
    }
    // exp(-h k above) is the sum of the powers of -h k above by their factorials.
    let (mut all, mut term, mut m) = ([[0.0; N]; N], inverse, 0);
    while m < N {
        let (mut next, mut n) = ([0.0; N], 0);
        while n < N {
            all[n][m] = term[n] as f32;
            let mut i = 0;
            while i <= n {
                next[n] -= term[i] * above[n - i] / (m + 1) as f64;
                i += 1;
            }
            n += 1;
        }
        term = next;
        m += 1;
    }
    all
}

/// The probability of each box; the mean is the origin. Error below 6e-7; never negative. The correlation must be at
/// least 0.88 and below 1, or the same with the other sign.
#[inline(always)]
pub(super) fn probabilities(boxes: &Boxes, rho: f32) -> [f32; LANES] {
    let wide = f64::from(rho);
    let square = (1.0 - wide * wide) as f32;
    let width = square.sqrt();
    let kernel = Kernel { square, inverse: 1.0 / width };
    let (sign, scale) = (if rho < 0.0 { -1.0 } else { 1.0 }, width * INVERSE_TAU);
    let mut found = [0.0; LANES];
    for lane in 0..LANES {
        let (low_x, high_x) = (boxes.low_x[lane], boxes.high_x[lane]);
        let (low_y, high_y) = (boxes.low_y[lane], boxes.high_y[lane]);
        // Where the correlation is negative, the box is reflected once more.
        let is_positive = sign * boxes.sign[lane] > 0.0;
        let (below, above) = if is_positive { (low_y, high_y) } else { (-high_y, -low_y) };
        let (x, y) = ([clipped(low_x), clipped(high_x)], [clipped(below), clipped(above)]);
        let (from, to) = (larger(x[0], y[0]), -larger(-x[1], -y[1]));
        let interval = larger(beyond(from) - beyond(to), 0.0);
        let same = kernel.integral(x[0], y[0]) + kernel.integral(x[1], y[1]);
        let other = kernel.integral(x[0], y[1]) + kernel.integral(x[1], y[0]);
        let probability = interval - scale * (same - other);
        let is_possible = (low_x < REACH as f32) & (low_y < REACH as f32) & (probability > 0.0);
        found[lane] = if is_possible { probability } else { 0.0 };
    }
    found
}

/// The kernel over x from 0 to the square root of 1 - r².
struct Kernel {
    /// 1 - r².
    square: f32,
    /// Inverse of its root.
    inverse: f32,
}

impl Kernel {
    /// The integral at a corner, times 2 pi and divided by the largest x.
    #[inline(always)]
    fn integral(&self, h: f32, k: f32) -> f32 {
        let (product, distance) = (h * k, (h - k).abs() * self.inverse);
        let square = distance * distance;
        let (density, tail) = density_and_tail(distance);
        // Moments by parts, each with its power of t.
        let mut moment = density - SQRT_TAU * distance * tail;
        let (mut power, mut sum) = (1.0, 0.0);
        for n in 0..N {
            let mut factor = SERIES[n][n];
            for m in (0..n).rev() {
                factor = factor * product + SERIES[n][m];
            }
            sum += factor * (power * moment);
            power *= self.square;
            moment = (density - square * moment) * (1.0 / (2 * n + 3) as f32);
        }
        sum * power_of_two(-0.5 * LOG2_E * product)
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn clipped(side: f32) -> f32 {
    let side = if side > -END { side } else { -END };
    if side < END { side } else { END }
}

/// Probability that a standard normal variable is beyond a place.
#[inline(always)]
fn beyond(z: f32) -> f32 {
    let (_, tail) = density_and_tail(z.abs());
    if z < 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_that_of_the_smooth_factor() {
        for (product, square) in [(0.0_f64, 0.05_f64), (3.0, 0.2), (-2.5, 0.2), (8.0, 0.1), (-1.0, 0.01)] {
            let r = (1.0 - square).sqrt();
            let exact = (product * (0.5 - 1.0 / (1.0 + r))).exp() / r;
            let powers = (0..N).flat_map(|n| (0..N).map(move |m| (n, m)));
            let found: f64 =
                powers.map(|(n, m)| f64::from(SERIES[n][m]) * square.powi(n as i32) * product.powi(m as i32)).sum();
            assert!((found - exact).abs() < 1e-5 * exact, "{product} {square}: {found} {exact}");
        }
    }
}
