//! Smooth profiles over time through the values at the knots.

use super::inputs::{KNOT_TIME, N_KNOTS};

/// A cubic between knots 0.5 s apart.
pub(super) struct Profile {
    values: [f64; N_KNOTS + 1],
    slopes: [f64; N_KNOTS + 1],
}

impl Profile {
    /// Never decreasing between values that do not decrease (Fritsch and Carlson 1980: no slope above three times that of
    /// a neighbouring chord); the first slope is given.
    pub(super) fn monotone(values: &[f64; N_KNOTS + 1], first_slope: f64) -> Self {
        let chords = chords(values);
        let mut slopes = [0.0; N_KNOTS + 1];
        slopes[0] = first_slope.clamp(0.0, 3.0 * chords[0]);
        for j in 1..N_KNOTS {
            let (before, after) = (chords[j - 1], chords[j]);
            slopes[j] = (0.5 * (before + after)).min(3.0 * before.min(after));
        }
        let last = 1.5 * chords[N_KNOTS - 1] - 0.5 * chords[N_KNOTS - 2];
        slopes[N_KNOTS] = last.clamp(0.0, 3.0 * chords[N_KNOTS - 1]);
        Self { values: *values, slopes }
    }

    /// Begins and ends with slope 0.
    pub(super) fn smooth(values: &[f64; N_KNOTS + 1]) -> Self {
        let chords = chords(values);
        let mut slopes = [0.0; N_KNOTS + 1];
        for j in 1..N_KNOTS {
            slopes[j] = 0.5 * (chords[j - 1] + chords[j]);
        }
        Self { values: *values, slopes }
    }

    /// Value and slope at a time from now [s]; beyond the last knot the last slope is kept, or the last value.
    pub(super) fn at(&self, time: f64, goes_on: bool) -> (f64, f64) {
        let beyond = time - N_KNOTS as f64 * KNOT_TIME;
        if beyond >= 0.0 {
            let slope = if goes_on { self.slopes[N_KNOTS] } else { 0.0 };
            return (self.values[N_KNOTS] + slope * beyond, slope);
        }
        let j = (time / KNOT_TIME) as usize;
        let u = time / KNOT_TIME - j as f64;
        let v = 1.0 - u;
        let (from, to) = (self.values[j], self.values[j + 1]);
        let (first, last) = (self.slopes[j] * KNOT_TIME, self.slopes[j + 1] * KNOT_TIME);
        let value =
            from * (1.0 + 2.0 * u) * v * v + to * (3.0 - 2.0 * u) * u * u + first * u * v * v - last * u * u * v;
        let slope = 6.0 * u * v * (to - from) + first * v * (1.0 - 3.0 * u) + last * u * (3.0 * u - 2.0);
        (value, slope / KNOT_TIME)
    }
}

fn chords(values: &[f64; N_KNOTS + 1]) -> [f64; N_KNOTS] {
    std::array::from_fn(|j| (values[j + 1] - values[j]) / KNOT_TIME)
}
