//! Linear layers in f32. Every output is summed in the order of the inputs, so that it has the same bits whatever else
//! is computed at the same time and however many numbers the processor handles at once.

use std::ops::Range;

/// Outputs are padded to a multiple of this.
const PADDING: usize = 16;
/// Rows that are computed at once.
const ROWS: usize = 4;

/// Weights and bias of a linear layer.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// Number of inputs.
    pub(super) n_in: usize,
    /// Number of outputs with padding: distance between rows of a table of outputs.
    pub(super) width: usize,
    /// (inputs, width), row-major; padding is zero.
    weights: Vec<f32>,
    /// (width,).
    bias: Vec<f32>,
}

impl Linear {
    /// From some inputs of a layer with `n_in` inputs: weights (outputs, inputs), row-major, and bias (outputs,).
    pub(super) fn new(weights: &[f32], bias: &[f32], n_in: usize, inputs: Range<usize>) -> Self {
        let width = bias.len().next_multiple_of(PADDING);
        let mut padded = vec![0.0; inputs.len() * width];
        for (row, k) in padded.chunks_exact_mut(width).zip(inputs.clone()) {
            for (to, from) in row.iter_mut().zip(weights[k..].iter().step_by(n_in)) {
                *to = *from;
            }
        }
        let mut padded_bias = bias.to_vec();
        padded_bias.resize(width, 0.0);
        Self { n_in: inputs.len(), width, weights: padded, bias: padded_bias }
    }

    /// Without bias.
    pub(super) fn without_bias(mut self) -> Self {
        self.bias.fill(0.0);
        self
    }

    /// Outputs for rows of inputs that are `stride` apart, into a table of `width` columns.
    pub(super) fn apply(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut Vec<f32>) {
        out.clear();
        for _ in 0..n_rows {
            out.extend_from_slice(&self.bias);
        }
        self.add(inputs, stride, n_rows, out);
    }

    /// The same without bias, added to a table of `width` columns.
    pub(super) fn add(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut [f32]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "the processor was asked whether it has what the function is compiled for")]
            // SAFETY: AVX2 is there.
            unsafe {
                self.add_with_avx2(inputs, stride, n_rows, out);
            }
            return;
        }
        self.add_in_blocks::<8>(inputs, stride, n_rows, out);
    }

    /// Products are not fused with sums here either: the bits are those of any other processor.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn add_with_avx2(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut [f32]) {
        self.add_in_blocks::<16>(inputs, stride, n_rows, out);
    }

    #[inline(always)]
    fn add_in_blocks<const COLUMNS: usize>(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut [f32]) {
        let mut row = 0;
        while row + ROWS <= n_rows {
            self.add_block::<ROWS, COLUMNS>(&inputs[row * stride..], stride, &mut out[row * self.width..]);
            row += ROWS;
        }
        while row < n_rows {
            self.add_block::<1, COLUMNS>(&inputs[row * stride..], stride, &mut out[row * self.width..]);
            row += 1;
        }
    }

    #[inline(always)]
    fn add_block<const N: usize, const COLUMNS: usize>(&self, inputs: &[f32], stride: usize, out: &mut [f32]) {
        let rows: [&[f32]; N] = std::array::from_fn(|r| &inputs[r * stride..r * stride + self.n_in]);
        for column in (0..self.width).step_by(COLUMNS) {
            let mut sums = [[0.0_f32; COLUMNS]; N];
            for (r, sums) in sums.iter_mut().enumerate() {
                sums.copy_from_slice(&out[r * self.width + column..][..COLUMNS]);
            }
            for (k, weights) in self.weights.chunks_exact(self.width).enumerate() {
                let weights: &[f32; COLUMNS] =
                    weights[column..column + COLUMNS].try_into().expect("as many as columns");
                for (sums, row) in sums.iter_mut().zip(&rows) {
                    let input = row[k];
                    for (sum, weight) in sums.iter_mut().zip(weights) {
                        *sum += input * weight;
                    }
                }
            }
            for (r, sums) in sums.iter().enumerate() {
                out[r * self.width + column..][..COLUMNS].copy_from_slice(sums);
            }
        }
    }
}

/// Negative numbers become zero.
pub(super) fn relu(values: &mut [f32]) {
    for value in values {
        *value = value.max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1 that no sum of few represents exactly.
    fn numbers(n: usize, seed: u32) -> Vec<f32> {
        let mut state = seed;
        (0..n)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / 8_388_608.0 - 1.0
            })
            .collect()
    }

    /// The definition, in the order of the inputs.
    fn by_hand(weights: &[f32], bias: &[f32], input: &[f32]) -> Vec<f32> {
        bias.iter()
            .enumerate()
            .map(|(j, bias)| {
                let mut sum = *bias;
                for (k, x) in input.iter().enumerate() {
                    sum += x * weights[j * input.len() + k];
                }
                sum
            })
            .collect()
    }

    #[test]
    fn outputs_have_the_bits_of_the_definition_in_any_batch_and_with_any_width() {
        for (n_in, n_out) in [(1, 1), (7, 50), (54, 64), (33, 17)] {
            let (weights, bias) = (numbers(n_in * n_out, 1), numbers(n_out, 2));
            let layer = Linear::new(&weights, &bias, n_in, 0..n_in);
            for n_rows in [0, 1, 3, 4, 9] {
                let inputs = numbers(n_rows * n_in, 3);
                let mut out = Vec::new();
                layer.apply(&inputs, n_in, n_rows, &mut out);
                let mut narrow = layer.bias.repeat(n_rows);
                layer.add_in_blocks::<8>(&inputs, n_in, n_rows, &mut narrow);
                assert_eq!(out, narrow, "the same with and without wide registers");
                for row in 0..n_rows {
                    let expected = by_hand(&weights, &bias, &inputs[row * n_in..(row + 1) * n_in]);
                    assert_eq!(out[row * layer.width..][..n_out], expected, "{n_in} to {n_out}, row {row} of {n_rows}");
                }
            }
        }
    }

    #[test]
    fn a_layer_in_two_parts_gives_what_the_whole_gives() {
        let (weights, bias, inputs) = (numbers(10 * 6, 1), numbers(6, 2), numbers(3 * 10, 3));
        let mut whole = Vec::new();
        Linear::new(&weights, &bias, 10, 0..10).apply(&inputs, 10, 3, &mut whole);
        let mut parts = Vec::new();
        Linear::new(&weights, &bias, 10, 0..4).apply(&inputs, 10, 3, &mut parts);
        Linear::new(&weights, &bias, 10, 4..10).without_bias().add(&inputs[4..], 10, 3, &mut parts);
        assert_eq!(whole, parts);
    }
}
