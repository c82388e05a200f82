//! Probability that a normally distributed point of the plane lies in an axis-parallel box.
//!
//! The distribution function of one variable comes from a table of cubics (error below 1e-10). For two variables the
//! derivative of the probability with respect to the correlation is the density at the corners, with signs (Plackett,
//! Biometrika 41, 1954; Drezner and Wesolowsky, J. Statist. Comput. Simul. 35, 1990): one to eight Gauss-Legendre
//! nodes suffice while the correlation is moderate. Otherwise the box is cut into slabs across its shorter side (in standard
//! deviations), over which the conditional probability is integrated.

use crate::geometry::Point;

/// Beyond this many standard deviations nothing is left (probability below 2e-8).
pub(super) const REACH: f64 = 5.5;
/// Smaller variances count as this [m²].
pub(super) const VARIANCE_MIN: f64 = 1e-6;
/// Boxes with less probability than this along one axis count as impossible.
const NEGLIGIBLE: f64 = 2e-8;
/// Correlations up to which one, two, three, four, six and eight nodes give the box probability to 3e-7.
const NODES_UP_TO: [f64; 6] = [0.02, 0.15, 0.4, 0.58, 0.77, 0.88];
/// Smaller correlations are none.
const INDEPENDENT: f64 = 1e-8;
/// Cells of the table per standard deviation.
const CELLS_PER_SIGMA: f64 = 64.0;
/// The table ends here; the rest is below 5e-11.
const TABLE_END: f64 = 6.5;
const N_CELLS: usize = (CELLS_PER_SIGMA * TABLE_END) as usize;
/// Coefficients of the cubic in every cell, for a coordinate running from 0 to 1.
static CDF_CELLS: [[f64; 4]; N_CELLS] = cdf_cells();

/// Gauss-Legendre nodes in [-1, 1] with their weights.
const RULE_1: [(f64, f64); 1] = gauss_legendre();
const RULE_2: [(f64, f64); 2] = gauss_legendre();
const RULE_3: [(f64, f64); 3] = gauss_legendre();
const RULE_4: [(f64, f64); 4] = gauss_legendre();
const RULE_6: [(f64, f64); 6] = gauss_legendre();
const RULE_8: [(f64, f64); 8] = gauss_legendre();

const INVERSE_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// Exponential function by its power series, for constants only; accurate to rounding for `0 <= x < 40`.
const fn exp_series(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut n = 1.0;
    while n < 200.0 {
        term *= x / n;
        sum += term;
        n += 1.0;
    }
    sum
}

const fn density_constant(z: f64) -> f64 {
    INVERSE_SQRT_TAU / exp_series(0.5 * z * z)
}

/// 1/2 + density(z) (z + z³/3 + z⁵/(3 5) + ...): all terms positive, so nothing cancels.
const fn cdf_constant(z: f64) -> f64 {
    let mut term = z;
    let mut sum = z;
    let mut odd = 3.0;
    while odd < 400.0 {
        term *= z * z / odd;
        sum += term;
        odd += 2.0;
    }
    0.5 + density_constant(z) * sum
}

const fn cdf_cells() -> [[f64; 4]; N_CELLS] {
    let mut cells = [[0.0; 4]; N_CELLS];
    let width = 1.0 / CELLS_PER_SIGMA;
    let (mut value, mut slope) = (cdf_constant(0.0), width * density_constant(0.0));
    let mut i = 0;
    while i < N_CELLS {
        let z = (i + 1) as f64 * width;
        let (next_value, next_slope) = (cdf_constant(z), width * density_constant(z));
        let rise = next_value - value;
        cells[i] = [value, slope, 3.0 * rise - 2.0 * slope - next_slope, slope + next_slope - 2.0 * rise];
        (value, slope) = (next_value, next_slope);
        i += 1;
    }
    cells
}

/// Zeros of the Legendre polynomial of degree `N` by Newton's method from the usual cosine guesses.
const fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
    let mut rule = [(0.0, 0.0); N];
    let mut i = 0;
    while i < N {
        let mut x = cos_series(std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5));
        let mut slope = 1.0;
        let mut round = 0;
        while round < 8 {
            let (mut before, mut value, mut k) = (1.0, x, 1);
            while k < N {
                let next = ((2 * k + 1) as f64 * x * value - k as f64 * before) / (k + 1) as f64;
                (before, value) = (value, next);
                k += 1;
            }
            slope = N as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
            round += 1;
        }
        rule[i] = (x, 2.0 / ((1.0 - x * x) * slope * slope));
        i += 1;
    }
    rule
}

const fn cos_series(angle: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    let mut n = 1.0;
    while n < 40.0 {
        term *= -angle * angle / (n * (n + 1.0));
        sum += term;
        n += 2.0;
    }
    sum
}

/// Probability that a standard normal variable is at most `z`; error below 1e-10.
#[inline(always)]
fn normal_cdf(z: f64) -> f64 {
    let position = z.abs() * CELLS_PER_SIGMA;
    let upper = match CDF_CELLS.get(position as usize) {
        Some(c) => {
            let u = position - (position as usize) as f64;
            c[0] + u * (c[1] + u * (c[2] + u * c[3]))
        }
        None => 1.0,
    };
    if z < 0.0 { 1.0 - upper } else { upper }
}

/// Exponential function of a number up to 0, relative error below 1e-9: powers of two and a polynomial. It is inlined,
/// and a loop over it can be vectorised.
#[inline(always)]
fn exp_negative(x: f64) -> f64 {
    /// Adding and subtracting it rounds to an integer; its low bits hold that integer.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = x.max(-700.0);
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
    let power = shifted - ROUNDER;
    let r = (x - power * LN_2_HIGH) - power * LN_2_LOW;
    // Taylor series to the eighth power: |r| <= 0.347, the rest is below 2e-10.
    let series = 1.0
        + r * (1.0
            + r * (1.0 / 2.0
                + r * (1.0 / 6.0
                    + r * (1.0 / 24.0
                        + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * (1.0 / 40320.0))))))));
    series * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

/// Standard deviations along x and y and correlation of a normal distribution in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Normal2 {
    inverse_sigma_x: f64,
    inverse_sigma_y: f64,
    rho: f64,
    /// sqrt(1 - rho²)
    remainder: f64,
}

/// Node of the integral over the correlation r.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Node {
    weight: f64,
    /// -1 / (2 (1 - r²))
    square_factor: f64,
    /// r / (1 - r²)
    product_factor: f64,
}

impl Normal2 {
    /// From variances [m²] and covariance [m²]. Deviations below 1 mm count as 1 mm and correlations stay within
    /// ±0.9999, so an impossible matrix (not positive semi-definite) is replaced by the nearest usable one.
    #[inline(always)]
    pub(super) fn new(variance_x: f64, covariance: f64, variance_y: f64) -> Self {
        let inverse_sigma_x = variance_x.max(VARIANCE_MIN).sqrt().recip();
        let inverse_sigma_y = variance_y.max(VARIANCE_MIN).sqrt().recip();
        let rho = (covariance * inverse_sigma_x * inverse_sigma_y).clamp(-0.9999, 0.9999);
        Self { inverse_sigma_x, inverse_sigma_y, rho, remainder: (1.0 - rho * rho).sqrt() }
    }

    /// Probability that the point, whose mean is the origin, lies within `half` of each centre in x and in y [m]; a
    /// centre and its opposite give the same. Error below 4e-7; never negative.
    #[inline(always)]
    pub(super) fn probabilities_of_boxes<const N: usize>(&self, centers: &[Point; N], half: (f64, f64)) -> [f64; N] {
        let rho = self.rho.abs();
        let [one, two, three, four, six, eight] = NODES_UP_TO;
        if rho <= INDEPENDENT || rho > eight {
            self.probabilities(&[], centers, half)
        } else if rho <= one {
            self.with_nodes(&RULE_1, centers, half)
        } else if rho <= two {
            self.with_nodes(&RULE_2, centers, half)
        } else if rho <= three {
            self.with_nodes(&RULE_3, centers, half)
        } else if rho <= four {
            self.with_nodes(&RULE_4, centers, half)
        } else if rho <= six {
            self.with_nodes(&RULE_6, centers, half)
        } else {
            self.with_nodes(&RULE_8, centers, half)
        }
    }

    #[inline(always)]
    fn with_nodes<const N: usize, const NODES: usize>(
        &self,
        rule: &[(f64, f64); NODES],
        centers: &[Point; N],
        half: (f64, f64),
    ) -> [f64; N] {
        let mut nodes = [Node::default(); NODES];
        let half_rho = 0.5 * self.rho.abs();
        for i in 0..NODES {
            let (place, weight) = rule[i];
            let r = half_rho * (1.0 + place);
            let inverse = 1.0 / (1.0 - r * r);
            nodes[i] = Node {
                weight: half_rho * weight * inverse.sqrt() * INVERSE_SQRT_TAU * INVERSE_SQRT_TAU,
                square_factor: -0.5 * inverse,
                product_factor: r * inverse,
            };
        }
        self.probabilities(&nodes, centers, half)
    }

    /// Without nodes the correlation is nothing, or so strong that the boxes are cut into slabs.
    #[inline(always)]
    fn probabilities<const N: usize, const NODES: usize>(
        &self,
        nodes: &[Node; NODES],
        centers: &[Point; N],
        half: (f64, f64),
    ) -> [f64; N] {
        let (dx, dy) = (half.0 * self.inverse_sigma_x, half.1 * self.inverse_sigma_y);
        let mut found = [0.0; N];
        for i in 0..N {
            // Reflected into the first quadrant; a reflection of one axis changes the sign of the correlation.
            let center = centers[i];
            let (x, y) = (center.x.abs() * self.inverse_sigma_x, center.y.abs() * self.inverse_sigma_y);
            if x - dx >= REACH || y - dy >= REACH {
                continue;
            }
            let (x, y) = ((x - dx, x + dx), (y - dy, y + dy));
            let py = normal_cdf(y.1) - normal_cdf(y.0);
            let px = normal_cdf(x.1) - normal_cdf(x.0);
            if px < NEGLIGIBLE || py < NEGLIGIBLE {
                continue;
            }
            let sign = if (center.x < 0.0) == (center.y < 0.0) { self.rho.signum() } else { -self.rho.signum() };
            found[i] = if NODES > 0 {
                (px * py + sign * correlation_gain(nodes, x, y, sign)).max(0.0)
            } else if self.rho.abs() <= INDEPENDENT {
                px * py
            } else {
                self.correlated(x, y, sign * self.rho.abs(), px, py)
            };
        }
        found
    }

    /// For strong correlations.
    fn correlated(&self, x: (f64, f64), y: (f64, f64), rho: f64, px: f64, py: f64) -> f64 {
        let is_whole = |(low, high): (f64, f64)| low <= -REACH && high >= REACH;
        if is_whole(x) || is_whole(y) {
            return if is_whole(x) { py } else { px };
        }
        let clip = |(low, high): (f64, f64)| (low.max(-REACH), high.min(REACH));
        let (x, y) = (clip(x), clip(y));
        let across = if x.1 - x.0 < y.1 - y.0 { (x, y) } else { (y, x) };
        slabs(across.0, across.1, rho, self.remainder).max(0.0)
    }
}

/// Integral of the box probability's derivative over the correlation, from 0 to its value: the density at the four
/// corners with alternating signs. Written for four lanes.
#[inline(always)]
fn correlation_gain<const NODES: usize>(nodes: &[Node; NODES], x: (f64, f64), y: (f64, f64), sign: f64) -> f64 {
    // Exponents are at most -(x² + y²) / (2 (1 + rho)): beyond this the error is below 2e-7.
    const FAR: f64 = 46.0;
    let (square_x, square_y) = ([x.0 * x.0, x.1 * x.1], [y.0 * y.0, y.1 * y.1]);
    let nearest = square_x[0].min(square_x[1]) + square_y[0].min(square_y[1]);
    if nearest > FAR {
        return 0.0;
    }
    let square =
        [square_x[0] + square_y[0], square_x[1] + square_y[1], square_x[0] + square_y[1], square_x[1] + square_y[0]];
    let product = [sign * (x.0 * y.0), sign * (x.1 * y.1), sign * (x.0 * y.1), sign * (x.1 * y.0)];
    let mut sums = [0.0; 4];
    for node in nodes {
        for corner in 0..4 {
            let exponent = square[corner] * node.square_factor + product[corner] * node.product_factor;
            sums[corner] += node.weight * exp_negative(exponent);
        }
    }
    (sums[0] + sums[1]) - (sums[2] + sums[3])
}

/// Integral over the slabs `across` (the shorter side) of the conditional probability of `along`.
fn slabs(across: (f64, f64), along: (f64, f64), rho: f64, remainder: f64) -> f64 {
    const LONGEST_PANEL: f64 = 2.5;
    let inverse = 1.0 / remainder;
    let length = across.1 - across.0;
    let panels = (length * inverse / LONGEST_PANEL).ceil().clamp(1.0, 400.0);
    let half = 0.5 * length / panels;
    let mut sum = 0.0;
    for panel in 0..panels as usize {
        let middle = across.0 + (2 * panel + 1) as f64 * half;
        for (node, weight) in &RULE_8 {
            let z = middle + half * node;
            let inner = normal_cdf((along.1 - rho * z) * inverse) - normal_cdf((along.0 - rho * z) * inverse);
            sum += weight * exp_negative(-0.5 * z * z) * inner;
        }
    }
    sum * half * INVERSE_SQRT_TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_function_matches_tabulated_values() {
        // Abramowitz and Stegun, table 26.1.
        for (z, p) in [
            (0.0, 0.5),
            (0.5, 0.691_462_461_274_013),
            (1.0, 0.841_344_746_068_543),
            (2.0, 0.977_249_868_051_821),
            (3.0, 0.998_650_101_968_370),
            (4.0, 0.999_968_328_758_167),
            (6.0, 1.0 - 9.865_876_5e-10),
            (9.0, 1.0),
        ] {
            assert!((normal_cdf(z) - p).abs() < 1e-10, "{z}");
            assert!((normal_cdf(-z) - (1.0 - p)).abs() < 1e-10, "-{z}");
        }
    }

    #[test]
    fn the_distribution_function_is_accurate_between_the_knots() {
        for i in 0..6400 {
            let z = f64::from(i) * 1e-3 + 3e-4;
            assert!((normal_cdf(z) - cdf_constant(z)).abs() < 1e-10, "{z}");
        }
    }

    /// Midpoint rule with a million cells over the part of the box within 7 standard deviations.
    fn brute_force(variance_x: f64, covariance: f64, variance_y: f64, center: (f64, f64), half: (f64, f64)) -> f64 {
        let n = 1000;
        let determinant = variance_x * variance_y - covariance * covariance;
        let bounds =
            |c: f64, h: f64, variance: f64| ((c - h).max(-7.0 * variance.sqrt()), (c + h).min(7.0 * variance.sqrt()));
        let (x0, x1) = bounds(center.0, half.0, variance_x);
        let (y0, y1) = bounds(center.1, half.1, variance_y);
        if x0 >= x1 || y0 >= y1 {
            return 0.0;
        }
        let (hx, hy) = ((x1 - x0) / f64::from(n), (y1 - y0) / f64::from(n));
        let mut sum = 0.0;
        for i in 0..n {
            let x = x0 + (f64::from(i) + 0.5) * hx;
            for j in 0..n {
                let y = y0 + (f64::from(j) + 0.5) * hy;
                let q = (variance_y * x * x - 2.0 * covariance * x * y + variance_x * y * y) / determinant;
                sum += (-0.5 * q).exp();
            }
        }
        sum * hx * hy / (std::f64::consts::TAU * determinant.sqrt())
    }

    #[test]
    fn box_probabilities_agree_with_brute_force_integration() {
        let half = (2.254, 0.805);
        for rho in [0.0, 1e-7, 0.01, -0.14, 0.2, -0.45, 0.59, -0.7, 0.86, 0.9, -0.97] {
            for (sx, sy) in [(0.3, 0.2), (1.0, 0.4), (3.0, 1.5), (0.8, 4.0)] {
                for center in [(0.0, 0.0), (1.0, -0.5), (-2.6, 0.9), (2.0, 2.5), (-4.0, -1.6)] {
                    let (xx, xy, yy) = (sx * sx, rho * sx * sy, sy * sy);
                    let p = Normal2::new(xx, xy, yy).probabilities_of_boxes(&[Point::new(center.0, center.1)], half)[0];
                    let expected = brute_force(xx, xy, yy, center, half);
                    assert!((p - expected).abs() < 3e-6, "rho {rho}, sigma {sx} {sy}, {center:?}: {p} for {expected}");
                }
            }
        }
    }

    #[test]
    fn the_fast_exponential_has_nine_digits() {
        for i in 0..70_000 {
            let x = -f64::from(i) * 1e-2;
            assert!((exp_negative(x) - x.exp()).abs() <= 1e-9 * x.exp(), "{x}");
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert!(exp_negative(-1e9) < 1e-300);
    }

    #[test]
    fn the_nodes_for_small_correlations_agree_with_the_slabs() {
        for up_to in NODES_UP_TO {
            for rho in [0.3 * up_to, -0.7 * up_to, up_to, -up_to] {
                for x in [(-1.0, 2.0), (-6.0, 0.3), (0.5, 5.0), (2.0, 3.0), (-0.7, 0.7), (1.0, 9.0)] {
                    for y in [(-0.5, 0.7), (1.0, 4.0), (-3.0, -2.0), (0.0, 2.0), (-8.0, 1.0)] {
                        let normal = Normal2::new(1.0, rho, 1.0);
                        let (center, half) =
                            ((0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1)), (0.5 * (x.1 - x.0), 0.5 * (y.1 - y.0)));
                        let p = normal.probabilities_of_boxes(&[Point::new(center.0, center.1)], half)[0];
                        let clip = |(low, high): (f64, f64)| (f64::max(low, -7.0), f64::min(high, 7.0));
                        let expected = slabs(clip(x), clip(y), rho, normal.remainder);
                        assert!((p - expected).abs() < 4e-7, "{rho} {x:?} {y:?}: {p} {expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn strong_correlations_give_the_same_whichever_side_is_cut_into_slabs() {
        for rho in [0.6, -0.9, 0.97, -0.999] {
            let remainder = f64::sqrt(1.0 - rho * rho);
            for (x, y) in [((-1.0, 2.0), (-0.5, 0.7)), ((-6.0, 0.3), (1.0, 4.0)), ((-0.2, 0.2), (-6.0, 6.0))] {
                let (one, other) = (slabs(x, y, rho, remainder), slabs(y, x, rho, remainder));
                assert!((one - other).abs() < 1e-7, "{rho} {x:?} {y:?}: {one} {other}");
            }
        }
    }

    #[test]
    fn a_covariance_that_no_distribution_has_gives_a_probability() {
        for (xx, xy, yy) in [(0.0, 0.0, 0.0), (1.0, 5.0, 1.0), (-1.0, 0.2, 0.5)] {
            let p = Normal2::new(xx, xy, yy).probabilities_of_boxes(&[Point::new(0.1, 0.1)], (1.0, 1.0))[0];
            assert!((0.0..=1.0).contains(&p), "{p}");
        }
    }
}
