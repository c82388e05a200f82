//! Random numbers that depend on what they are for, never on what was drawn before.

use std::f64::consts::TAU;

/// One round of splitmix64.
fn mix(z: u64) -> u64 {
    let z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A number in [0, 1) that is determined by the seed and the words alone.
pub fn uniform(seed: u64, words: &[i64]) -> f64 {
    let hash = words.iter().fold(mix(seed), |hash, word| mix(hash ^ mix(word.cast_unsigned())));
    (hash >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A standard normal number that is determined by the seed and the words alone.
pub(crate) fn normal(seed: u64, [a, b, c, d]: [i64; 4]) -> f64 {
    let (size, turn) = (uniform(seed, &[a, b, c, d, 0]), uniform(seed, &[a, b, c, d, 1]));
    (-2.0 * (1.0 - size).ln()).sqrt() * (TAU * turn).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_the_seed_and_the_words_alone() {
        for (seed, words, expected) in [
            (0, &[1, 0, 1, 2, 0][..], 0.772_841_427_139_172_8),
            (0, &[1, 0, 2, 1, 0], 0.425_951_404_100_362_14),
            (7, &[2, 150, 2001, 1001, 1], 0.933_178_674_073_739_8),
            (0, &[0, -5], 0.542_739_759_287_064_1),
        ] {
            assert_eq!(uniform(seed, words), expected, "{seed} {words:?}");
        }
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let drawn: Vec<f64> = (0..10_000).map(|k| normal(3, [0, 1, 2, k])).collect();
        let mean = |part: &dyn Fn(&f64) -> f64| drawn.iter().map(part).sum::<f64>() / drawn.len() as f64;
        assert!(mean(&|z| *z).abs() < 0.03 && (mean(&|z| z * z) - 1.0).abs() < 0.05);
        assert_eq!(normal(3, [0, 1, 2, 4]), drawn[4]);
    }
}
