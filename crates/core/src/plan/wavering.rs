//! How drivers waver: smooth random parts of the acceleration and of the place in the lane, without memory, so that any
//! step of any plan has them.

use std::f64::consts::TAU;

/// Waves of which it consists.
const N_WAVES: usize = 16;
/// A draw of zero has no logarithm.
const DRAW_MIN: f64 = 1e-12;
/// A slower driver wavers less, in proportion to its speed [m/s].
const SLOW: f64 = 2.0;
/// A driver who has to brake harder than this does not waver [m/s²].
const BRAKES_FOR_SURE: f64 = 3.0;

/// A Gaussian process with unit variance and the correlation exp(-t² / (2 length²)), as a sum of random waves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Standard deviation.
    sd: f64,
    /// Angular frequencies [rad/s] and phases [rad].
    waves: [(f64, f64); N_WAVES],
}

impl Noise {
    /// For a standard deviation, a correlation length [s] and a seed; `None` without any noise.
    pub(super) fn new(sd: f64, length: f64, seed: usize) -> Option<Self> {
        if sd <= 0.0 {
            return None;
        }
        let mut state = seed as u64;
        let mut draw = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let waves = std::array::from_fn(|_| {
            let (u, v, w) = (draw().max(DRAW_MIN), draw(), draw());
            ((-2.0 * u.ln()).sqrt() * (TAU * v).cos() / length, TAU * w)
        });
        Some(Self { sd, waves })
    }

    /// At a time [s], in the unit of the standard deviation.
    pub(super) fn value(&self, time: f64) -> f64 {
        self.sd * self.at(time)
    }

    fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.waves.iter().map(|(omega, phase)| (omega * time + phase).cos()).sum();
        (2.0 / N_WAVES as f64).sqrt() * sum
    }

    /// What becomes of a wanted acceleration [m/s²] at a time [s] and a speed [m/s].
    pub(super) fn added(&self, wanted: f64, time: f64, velocity: f64) -> f64 {
        if wanted < -BRAKES_FOR_SURE { wanted } else { wanted + self.value(time) * (velocity / SLOW).min(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: usize) -> Noise {
        Noise::new(1.0, 1.4, seed).expect("noise")
    }

    #[test]
    fn its_values_are_those_of_the_formula() {
        for (seed, time, expected) in
            [(1, 0.0, 0.269608910207), (1, 1.0, 0.205417315023), (1, 2.0, 0.042305619154), (42, 0.0, -1.163295974536)]
        {
            assert!((noise(seed).at(time) - expected).abs() < 1e-9, "{seed} {time}");
        }
    }

    #[test]
    fn over_seeds_it_has_unit_variance_and_its_correlation_length() {
        let n = 2000;
        let pairs: Vec<(f64, f64)> = (0..n).map(|seed| (noise(seed).at(0.0), noise(seed).at(1.4))).collect();
        let sum = |part: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(part).sum::<f64>() / n as f64;
        let (first, second) = (sum(&|pair| pair.0 * pair.0).sqrt(), sum(&|pair| pair.1 * pair.1).sqrt());
        let correlation = sum(&|pair| pair.0 * pair.1) / (first * second);
        assert!((first - 1.0).abs() < 0.05 && (second - 1.0).abs() < 0.05, "{first} {second}");
        assert!((correlation - (-0.5_f64).exp()).abs() < 0.03, "{correlation}");
    }

    #[test]
    fn who_stands_or_has_to_brake_hard_does_not_waver() {
        let own = noise(3);
        assert_eq!(own.added(0.5, 1.0, 0.0), 0.5);
        assert_eq!(own.added(-4.0, 1.0, 10.0), -4.0);
        assert_eq!(own.added(0.5, 1.0, 10.0) - 0.5, 2.0 * (own.added(0.5, 1.0, 1.0) - 0.5));
        assert_eq!(Noise::new(0.0, 1.4, 3), None);
    }
}
