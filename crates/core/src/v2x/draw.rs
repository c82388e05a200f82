//! Random numbers that depend on what they are for, never on what was drawn before.

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

/// What a number is drawn for: the first word.
pub(super) const EQUIPMENT: i64 = 0;
pub(super) const RECEPTION: i64 = 1;
pub(super) const JITTER: i64 = 2;

/// Which agents have V2X: this share of them, rounded to the nearest number. Those of a smaller share are among those of
/// a larger one.
pub fn equipped(seed: u64, penetration: f64, ids: &[i64]) -> Vec<bool> {
    let n = (penetration * ids.len() as f64 + 0.5).floor() as usize;
    let mut order: Vec<(f64, i64, usize)> =
        ids.iter().enumerate().map(|(row, id)| (uniform(seed, &[EQUIPMENT, *id]), *id, row)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut chosen = vec![false; ids.len()];
    order.iter().take(n).for_each(|(_, _, row)| chosen[*row] = true);
    chosen
}
