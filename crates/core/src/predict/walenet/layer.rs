//! A layer of the image network: 3 x 3 convolution, then 2 x 2 max pooling, on differences to the empty picture.

use super::patches::NONE;
use crate::predict::product::{Matrix, multiply};
use crate::simd::multiversion;

/// Channels of every layer, also the size of the result.
pub(super) const CHANNELS: usize = 32;
/// Products of one input vector: nine taps times channels.
pub(super) const PRODUCTS: usize = 9 * CHANNELS;

/// What an output depends on: the entries of its 4 x 4 inputs (four words), and at which borders of the map it lies.
pub(super) type Patch = [u64; 5];

/// A layer behind the first, with 32 input channels.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    /// Side of the input; that of the output is half of it.
    pub(super) side: usize,
    /// (input channel, tap and output channel).
    pub(super) weights: Matrix,
    /// Outputs of the empty picture before pooling, (side, side, channels).
    empty: Vec<f32>,
    /// Behind pooling, (side / 2, side / 2, channels).
    pub(super) empty_pooled: Vec<f32>,
}

impl Layer {
    /// Works out the maps of the empty picture from the map before it, (side, side, channels).
    pub(super) fn new(side: usize, weights: Matrix, bias: &[f32], before: &[f32]) -> Self {
        let mut layer = Self {
            side,
            weights,
            empty: bias.repeat(side * side),
            empty_pooled: vec![0.0; side * side / 4 * CHANNELS],
        };
        let mut products = vec![0.0; side * PRODUCTS];
        for row in 0..side {
            multiply(&before[row * side * CHANNELS..(row + 1) * side * CHANNELS], &layer.weights, &mut products);
            for (column, products) in products.chunks_exact(PRODUCTS).enumerate() {
                for (tap, product) in products.chunks_exact(CHANNELS).enumerate() {
                    // The tap's own place in the kernel says which output this input belongs to.
                    let (y, x) = (row + 1, column + 1);
                    let (y, x) = (y.wrapping_sub(tap / 3), x.wrapping_sub(tap % 3));
                    if y < side && x < side {
                        let at = (y * side + x) * CHANNELS;
                        layer.empty[at..at + CHANNELS].iter_mut().zip(product).for_each(|(sum, value)| *sum += value);
                    }
                }
            }
        }
        for (at, pooled) in layer.empty_pooled.chunks_exact_mut(CHANNELS).enumerate() {
            let half = side / 2;
            pooled.fill(f32::NEG_INFINITY);
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let from = ((at / half * 2 + row) * side + at % half * 2 + column) * CHANNELS;
                let values = &layer.empty[from..from + CHANNELS];
                pooled.iter_mut().zip(values).for_each(|(largest, value)| *largest = largest.max(*value));
            }
        }
        layer
    }

    /// Outputs whose 4 x 4 inputs hold one of `inputs`, each once. `is_reached` is false everywhere before and after.
    pub(super) fn reached(&self, inputs: &[u16], is_reached: &mut Vec<bool>, outputs: &mut Vec<u16>) {
        let half = self.side / 2;
        is_reached.resize(is_reached.len().max(half * half), false);
        outputs.clear();
        for at in inputs {
            let (row, column) = (*at as usize / self.side, *at as usize % self.side);
            for row in reached_along(row, half) {
                for column in reached_along(column, half) {
                    let at = row * half + column;
                    if !std::mem::replace(&mut is_reached[at], true) {
                        outputs.push(at as u16);
                    }
                }
            }
        }
        outputs.iter().for_each(|at| is_reached[*at as usize] = false);
    }

    /// What an output depends on, where `index` says which entry stands at an input.
    ///
    /// The maps of the empty picture are the same everywhere but in their outermost rows and columns, because only there
    /// a layer sees what lies outside.
    pub(super) fn patch(&self, index: &[u16], output: usize) -> Patch {
        let half = self.side / 2;
        let (row, column) = (output / half, output % half);
        let entries = self.entries(index, row, column);
        let word = |u: usize| (0..4).fold(0, |word, v| word | u64::from(entries[4 * u + v]) << (16 * v));
        let border = |i: usize| u64::from(i == 0) + 2 * u64::from(i + 1 == half);
        [word(0), word(1), word(2), word(3), 4 * border(row) + border(column)]
    }

    /// The entries of the 4 x 4 inputs of an output; `NONE` outside.
    #[inline(always)]
    fn entries(&self, index: &[u16], row: usize, column: usize) -> [u16; 16] {
        let side = self.side;
        let mut entries = [NONE; 16];
        if row > 0 && column > 0 && 2 * row + 2 < side && 2 * column + 2 < side {
            for (u, entries) in entries.chunks_exact_mut(4).enumerate() {
                let from = (2 * row + u - 1) * side + 2 * column - 1;
                entries.copy_from_slice(&index[from..from + 4]);
            }
            return entries;
        }
        for u in usize::from(row == 0)..4.min(side + 1 - 2 * row) {
            for v in usize::from(column == 0)..4.min(side + 1 - 2 * column) {
                entries[4 * u + v] = index[(2 * row + u - 1) * side + 2 * column + v - 1];
            }
        }
        entries
    }
}

/// Outputs that an input reaches along one axis; one for the first and last input, else two.
pub(super) fn reached_along(input: usize, half: usize) -> std::ops::RangeInclusive<usize> {
    input.saturating_sub(1) / 2..=input.div_ceil(2).min(half - 1)
}

multiversion! {
    /// Sums the products that reach each output, adds the map of the empty picture, pools, and takes the difference.
    /// `index` says which row of `products` belongs to an input.
    pub(super) fn pool = pool_outputs,
        (layer: &Layer, index: &[u16], products: &[f32], outputs: &[u16], values: &mut [f32])
}

#[inline(always)]
fn pool_outputs(layer: &Layer, index: &[u16], products: &[f32], outputs: &[u16], values: &mut [f32]) {
    let (side, half) = (layer.side, layer.side / 2);
    for (at, value) in outputs.iter().zip(values.chunks_exact_mut(CHANNELS)) {
        let (row, column) = (*at as usize / half, *at as usize % half);
        let entries = layer.entries(index, row, column);
        let mut largest = [f32::NEG_INFINITY; CHANNELS];
        for i in 0..4 {
            let (a, b) = (i / 2, i % 2);
            let mut sums = [0.0_f32; CHANNELS];
            for tap in 0..9 {
                let entry = entries[(a + tap / 3) * 4 + b + tap % 3];
                if entry != NONE {
                    let from = entry as usize * PRODUCTS + tap * CHANNELS;
                    let product = &products[from..from + CHANNELS];
                    sums.iter_mut().zip(product).for_each(|(sum, value)| *sum += value);
                }
            }
            let from = ((2 * row + a) * side + 2 * column + b) * CHANNELS;
            let empty = &layer.empty[from..from + CHANNELS];
            for ((largest, sum), empty) in largest.iter_mut().zip(sums).zip(empty) {
                *largest = largest.max(sum + empty);
            }
        }
        let empty = &layer.empty_pooled[*at as usize * CHANNELS..(*at as usize + 1) * CHANNELS];
        for ((value, largest), empty) in value.iter_mut().zip(largest).zip(empty) {
            *value = largest - empty;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_maps_differ_in_their_outermost_rows_and_columns_only() {
        let side = 32;
        let weights =
            |seed: usize| Matrix::new(CHANNELS, PRODUCTS, |i, j| ((i * 31 + j * 7 + seed) as f32).sin() * 0.1);
        let bias: Vec<f32> = (0..CHANNELS).map(|i| (i as f32).cos()).collect();
        let first = Layer::new(side, weights(1), &bias, &bias.repeat(side * side));
        let second = Layer::new(side / 2, weights(2), &bias, &first.empty_pooled);
        for layer in [first, second] {
            let half = layer.side / 2;
            let of = |row: usize, column: usize| &layer.empty_pooled[(row * half + column) * CHANNELS..][..CHANNELS];
            for i in 1..half - 1 {
                for j in 1..half - 1 {
                    assert_eq!(of(i, j), of(1, 1), "inside");
                }
                assert_eq!((of(0, i), of(i, 0)), (of(0, 1), of(1, 0)), "along a border");
                assert_eq!((of(half - 1, i), of(i, half - 1)), (of(half - 1, 1), of(1, half - 1)));
            }
            assert_ne!(of(0, 1), of(1, 1));
        }
    }

    #[test]
    fn a_patch_tells_entries_and_borders_apart() {
        let layer = Layer::new(8, Matrix::new(CHANNELS, PRODUCTS, |_, _| 0.0), &[0.0; CHANNELS], &[0.0; 64 * CHANNELS]);
        let mut index = vec![NONE; 64];
        let nothing = layer.patch(&index, 5);
        assert_eq!(nothing, layer.patch(&index, 6), "the same inside");
        assert!([0, 1, 3, 4, 7, 12, 13, 15].iter().all(|at| layer.patch(&index, *at) != nothing));
        // Input (4, 4) is the fourth in row and column of output (1, 1), the second of output (2, 2).
        index[4 * 8 + 4] = 3;
        let with = layer.patch(&index, 5);
        assert_eq!(with[3] >> 48, 3);
        assert_eq!(layer.patch(&index, 10)[1] >> 16 & 0xFFFF, 3);
    }
}
