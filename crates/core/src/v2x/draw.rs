//! What cooperation draws.

use crate::draws::uniform;

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
