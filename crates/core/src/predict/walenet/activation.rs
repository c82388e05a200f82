//! Activations in single precision with the same bits on every machine.

/// Exponential function; relative error below 2e-7. Polynomial of degree 6 after reduction by powers of two (as in
/// Moshier's Cephes library), because the one of the system differs between systems and is slower.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    /// Adding this rounds to whole numbers, which then are the low bits.
    const ROUNDING: f32 = 12_582_912.0;
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUNDING;
    let whole = shifted - ROUNDING;
    let rest = x - whole * LN_2_HIGH - whole * LN_2_LOW;
    let mut sum = 1.987_569_1e-4;
    for coefficient in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        sum = sum * rest + coefficient;
    }
    let power = f32::from_bits(shifted.to_bits().wrapping_sub(ROUNDING.to_bits()).wrapping_add(127) << 23);
    (sum * rest * rest + rest + 1.0) * power
}

/// Logistic function.
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Hyperbolic tangent; absolute error below 2e-7.
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// Leaky rectifier with slope 0.1.
#[inline(always)]
pub(super) fn leaky(x: f32) -> f32 {
    x.max(0.1 * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn activations_are_exact_to_single_precision() {
        for i in -20_000..=20_000 {
            let x = i as f32 * 4.3e-3;
            let exact = f64::from(x);
            let relative = (f64::from(exp(x)) - exact.exp()).abs() / exact.exp();
            assert!(relative < 2e-7, "exp({x}): {relative}");
            assert!((f64::from(tanh(x)) - exact.tanh()).abs() < 2e-7, "tanh({x})");
            assert!((f64::from(sigmoid(x)) - 1.0 / (1.0 + (-exact).exp())).abs() < 1e-7, "sigmoid({x})");
        }
        assert!(exp(1e9).is_finite() && exp(-1e9) > 0.0, "no overflow");
    }
}
