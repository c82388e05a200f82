//! Box probabilities in double precision, to compare with, for correlations of any strength: the box is cut into slabs
//! across its shorter side (in standard deviations), over which the conditional probability is integrated. The
//! distribution function of one variable comes from a table of cubics (error below 1e-10).

use super::super::REACH;
use super::super::boxes::gauss_legendre;

const INVERSE_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// Cells of the table per standard deviation.
const CELLS_PER_SIGMA: f64 = 64.0;
/// The table ends here; the rest is below 5e-11.
const TABLE_END: f64 = 6.5;
const N_CELLS: usize = (CELLS_PER_SIGMA * TABLE_END) as usize;
/// Coefficients of the cubic in every cell, for a coordinate running from 0 to 1.
static CDF_CELLS: [[f64; 4]; N_CELLS] = cdf_cells();

const RULE_8: [(f64, f64); 8] = gauss_legendre();

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

/// Probability of the box between `x.0` and `x.1` and between `y.0` and `y.1` [standard deviations] with a correlation
/// within (-1, 1). Error below 1e-8; never negative.
pub(super) fn box_probability(x: (f64, f64), y: (f64, f64), rho: f64) -> f64 {
    let (px, py) = (normal_cdf(x.1) - normal_cdf(x.0), normal_cdf(y.1) - normal_cdf(y.0));
    let is_whole = |(low, high): (f64, f64)| low <= -REACH && high >= REACH;
    if is_whole(x) || is_whole(y) {
        return if is_whole(x) { py } else { px };
    }
    let clip = |(low, high): (f64, f64)| (low.max(-REACH), high.min(REACH));
    let (x, y) = (clip(x), clip(y));
    if x.0 >= x.1 || y.0 >= y.1 {
        return 0.0;
    }
    let (across, along) = if x.1 - x.0 < y.1 - y.0 { (x, y) } else { (y, x) };
    slabs(across, along, rho, (1.0 - rho * rho).sqrt()).max(0.0)
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
    fn strong_correlations_give_the_same_whichever_side_is_cut_into_slabs() {
        for rho in [0.6, -0.9, 0.97, -0.999] {
            let remainder = f64::sqrt(1.0 - rho * rho);
            for (x, y) in [((-1.0, 2.0), (-0.5, 0.7)), ((-6.0, 0.3), (1.0, 4.0)), ((-0.2, 0.2), (-6.0, 6.0))] {
                let (one, other) = (slabs(x, y, rho, remainder), slabs(y, x, rho, remainder));
                assert!((one - other).abs() < 1e-7, "{rho} {x:?} {y:?}: {one} {other}");
            }
        }
    }
}
