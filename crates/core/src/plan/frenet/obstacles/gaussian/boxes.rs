//! Probabilities of several boxes at once in single precision, without branches, for correlations up to 0.88.
//!
//! The distribution function of one variable is the density times a polynomial (the form of Hastings, Approximations
//! for Digital Computers, 1955; own coefficients by weighted least squares, error below 1e-8, in
//! single precision 1.6e-7). Weak correlations enter
//! by the tetrachoric series (Pearson, Phil. Trans. R. Soc. A 195, 1900), which needs the densities at the sides of the
//! boxes alone. For moderate ones the derivative by the correlation, the density at the corners with signs (Plackett,
//! Biometrika 41, 1954), is integrated with Gauss-Legendre nodes (Drezner and Wesolowsky, J. Statist. Comput. Simul. 35,
//! 1990).

#![expect(clippy::needless_range_loop, reason = "loops over lanes become one step of a wide machine")]

use super::REACH;

/// Boxes that are worked on at once.
pub(super) const LANES: usize = 8;

/// Correlations up to which three and six terms of the series do: the rest is below 2e-7.
const SERIES_UP_TO: [f32; 2] = [0.04, 0.15];
/// Correlations up to which three, four, six and eight nodes give the integral to 3e-7.
pub(super) const NODES_UP_TO: [f32; 4] = [0.4, 0.58, 0.77, 0.88];
const RULE_3: [(f64, f64); 3] = gauss_legendre();
const RULE_4: [(f64, f64); 4] = gauss_legendre();
const RULE_6: [(f64, f64); 6] = gauss_legendre();
const RULE_8: [(f64, f64); 8] = gauss_legendre();

/// -1 / (2 ln 2): the density is 2 to the square times this.
const SQUARE_TO_POWER: f32 = -0.721_347_5;
pub(super) const LOG2_E: f32 = std::f32::consts::LOG2_E;
pub(super) const INVERSE_TAU: f32 = 0.159_154_94;

/// Boxes, reflected into the first quadrant: the ends of their sides [standard deviations].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Boxes {
    pub(super) low_x: [f32; LANES],
    pub(super) high_x: [f32; LANES],
    pub(super) low_y: [f32; LANES],
    pub(super) high_y: [f32; LANES],
    /// A reflection of one axis changes the sign of the correlation.
    pub(super) sign: [f32; LANES],
}

impl Boxes {
    /// Around centres [m], of one size, in double precision: sides can be many deviations from the mean.
    #[inline(always)]
    pub(super) fn new(
        x: &[f64; LANES],
        y: &[f64; LANES],
        half: (f64, f64),
        (inverse_sigma_x, inverse_sigma_y): (f64, f64),
    ) -> Self {
        let zeros = [0.0; LANES];
        let mut boxes = Self { low_x: zeros, high_x: zeros, low_y: zeros, high_y: zeros, sign: zeros };
        for lane in 0..LANES {
            let (far_x, far_y) = (x[lane].abs(), y[lane].abs());
            boxes.low_x[lane] = ((far_x - half.0) * inverse_sigma_x) as f32;
            boxes.high_x[lane] = ((far_x + half.0) * inverse_sigma_x) as f32;
            boxes.low_y[lane] = ((far_y - half.1) * inverse_sigma_y) as f32;
            boxes.high_y[lane] = ((far_y + half.1) * inverse_sigma_y) as f32;
            boxes.sign[lane] = (if (x[lane] < 0.0) == (y[lane] < 0.0) { 1.0_f64 } else { -1.0 }) as f32;
        }
        boxes
    }

    /// The probability of each box; the mean is the origin. Error below 6e-7; never negative. The correlation must not
    /// be stronger than the last of `NODES_UP_TO`.
    #[inline(always)]
    pub(super) fn probabilities(&self, rho: f32) -> [f32; LANES] {
        let strength = if rho < 0.0 { -rho } else { rho };
        let [three, four, six, _] = NODES_UP_TO;
        let [few, many] = SERIES_UP_TO;
        if strength <= few {
            self.by_series::<3>(rho)
        } else if strength <= many {
            self.by_series::<6>(rho)
        } else if strength <= three {
            self.by_nodes(&RULE_3, rho)
        } else if strength <= four {
            self.by_nodes(&RULE_4, rho)
        } else if strength <= six {
            self.by_nodes(&RULE_6, rho)
        } else {
            self.by_nodes(&RULE_8, rho)
        }
    }

    #[inline(always)]
    fn by_series<const TERMS: usize>(&self, rho: f32) -> [f32; LANES] {
        /// What is smaller counts as nothing, see `power_of_two`.
        const NOTHING: f32 = 1e-12;
        let (mut factors, mut factor) = ([0.0; TERMS], INVERSE_TAU);
        for n in 0..TERMS {
            factor *= rho / (n + 1) as f32;
            factor = if factor.abs() > NOTHING { factor } else { 0.0 };
            factors[n] = factor;
        }
        let mut found = [0.0; LANES];
        for lane in 0..LANES {
            let (x, y) = self.sides(lane);
            // Derivatives of the distribution function: Hermite polynomials times the density, by recurrence.
            let (mut x_now, mut y_now) = ([x.low_density, x.high_density], [y.low_density, y.high_density]);
            let (mut x_before, mut y_before) = ([0.0; 2], [0.0; 2]);
            let mut gains = [0.0; 2];
            for n in 0..TERMS {
                gains[n % 2] += factors[n] * ((x_now[1] - x_now[0]) * (y_now[1] - y_now[0]));
                let next = |z: f32, now: f32, before: f32| z * now - n as f32 * before;
                let x_next = [next(x.low, x_now[0], x_before[0]), next(x.high, x_now[1], x_before[1])];
                let y_next = [next(y.low, y_now[0], y_before[0]), next(y.high, y_now[1], y_before[1])];
                (x_before, x_now) = (x_now, x_next);
                (y_before, y_now) = (y_now, y_next);
            }
            found[lane] = probability(&x, &y, self.sign[lane] * gains[0] + gains[1]);
        }
        found
    }

    #[inline(always)]
    fn by_nodes<const N: usize>(&self, rule: &[(f64, f64); N], rho: f32) -> [f32; LANES] {
        let mut nodes = [[0.0; 3]; N];
        for i in 0..N {
            let (place, weight) = rule[i];
            let r = 0.5 * rho * (1.0 + place as f32);
            let inverse = 1.0 / (1.0 - r * r);
            nodes[i] = [
                0.5 * rho * weight as f32 * inverse.sqrt() * INVERSE_TAU,
                SQUARE_TO_POWER * inverse,
                LOG2_E * r * inverse,
            ];
        }
        let mut found = [0.0; LANES];
        for lane in 0..LANES {
            let ((x, y), sign) = (self.sides(lane), self.sign[lane]);
            let squares = [x.low * x.low, x.high * x.high, y.low * y.low, y.high * y.high];
            let mut gain = 0.0;
            for [weight, of_square, of_product] in nodes {
                let of_product = sign * of_product;
                let density = |square: f32, product: f32| power_of_two(of_square * square + of_product * product);
                let same =
                    density(squares[0] + squares[2], x.low * y.low) + density(squares[1] + squares[3], x.high * y.high);
                let other =
                    density(squares[0] + squares[3], x.low * y.high) + density(squares[1] + squares[2], x.high * y.low);
                gain += weight * (same - other);
            }
            found[lane] = probability(&x, &y, sign * gain);
        }
        found
    }

    #[inline(always)]
    fn sides(&self, lane: usize) -> (Side, Side) {
        (Side::new(self.low_x[lane], self.high_x[lane]), Side::new(self.low_y[lane], self.high_y[lane]))
    }
}

/// One side of a box: its ends [standard deviations], times sqrt(2 pi) the densities there, and the probability between.
struct Side {
    low: f32,
    high: f32,
    low_density: f32,
    high_density: f32,
    probability: f32,
}

impl Side {
    /// Between two ends whose middle is not negative.
    #[inline(always)]
    fn new(low: f32, high: f32) -> Self {
        let (low_density, low_tail) = density_and_tail(if low < 0.0 { -low } else { low });
        let (high_density, high_tail) = density_and_tail(high);
        let probability = (if low < 0.0 { 1.0 - low_tail } else { low_tail }) - high_tail;
        Self { low, high, low_density, high_density, probability }
    }
}

/// Both probabilities and what the correlation adds; nothing for boxes out of reach.
#[inline(always)]
fn probability(x: &Side, y: &Side, gain: f32) -> f32 {
    let found = x.probability * y.probability + gain;
    let is_possible = (x.low < REACH as f32) & (y.low < REACH as f32) & (found > 0.0);
    if is_possible { found } else { 0.0 }
}

/// Nodes of a Gauss-Legendre rule in [-1, 1] with their weights, computed by the compiler: zeros of the Legendre polynomial of degree `N` by Newton's method from the usual
/// cosine guesses.
pub(super) const fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
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

/// sqrt(2 pi) times the density at a place that is not negative, and the probability of being beyond it.
#[inline(always)]
pub(super) fn density_and_tail(z: f32) -> (f32, f32) {
    let density = power_of_two(SQUARE_TO_POWER * (z * z));
    let t = 1.0 / (1.0 + 0.28 * z);
    let polynomial = t
        * (0.116_520_94
            + t * (0.067_495_72 + t * (0.268_912_77 + t * (-0.236_996_74 + t * (0.389_876_04 + t * -0.105_808_74)))));
    (density, density * polynomial)
}

/// 2 to a number up to about 0, relative error below 2e-7. What is below 1e-12 counts as nothing: products of smaller
/// numbers would be too small for the number format, and then some processors take very long.
#[inline(always)]
pub(super) fn power_of_two(x: f32) -> f32 {
    /// Adding and subtracting it rounds to an integer; its low bits hold that integer.
    const ROUNDER: f32 = 12_582_912.0;
    const LEAST: f32 = -40.0;
    let is_something = x > LEAST;
    let x = if is_something { x } else { LEAST };
    let shifted = x + ROUNDER;
    let f = x - (shifted - ROUNDER);
    // Weighted least squares, |f| <= 1/2.
    let series = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_222_83 + f * (0.055_505_585 + f * (0.009_669_691 + f * 0.001_330_060_4))));
    let power = series * f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    if is_something { power } else { 0.0 }
}
