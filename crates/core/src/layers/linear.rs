//! Linear layers in f32. Every output is summed in the order of the inputs, so that it has the same bits whatever else
//! is computed at the same time and however many numbers the processor handles at once.

use std::ops::Range;

use super::product::{Matrix, add_product};

/// Weights and bias of a linear layer.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    /// Number of inputs.
    pub(crate) n_in: usize,
    /// Number of outputs with padding: distance between rows of a table of outputs.
    pub(crate) width: usize,
    weights: Matrix,
    /// (width,).
    bias: Vec<f32>,
}

impl Linear {
    /// From some inputs of a layer with `n_in` inputs: weights (outputs, inputs), row-major, and bias (outputs,).
    pub(crate) fn new(weights: &[f32], bias: &[f32], n_in: usize, inputs: Range<usize>) -> Self {
        let weights = Matrix::new(inputs.len(), bias.len(), |input, j| weights[j * n_in + inputs.start + input]);
        let width = weights.columns();
        let mut padded_bias = bias.to_vec();
        padded_bias.resize(width, 0.0);
        Self { n_in: inputs.len(), width, weights, bias: padded_bias }
    }

    /// Without bias.
    pub(crate) fn without_bias(mut self) -> Self {
        self.bias.fill(0.0);
        self
    }

    /// Outputs for rows of inputs that are `stride` apart, into a table of `width` columns.
    pub(crate) fn apply(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut Vec<f32>) {
        out.clear();
        for _ in 0..n_rows {
            out.extend_from_slice(&self.bias);
        }
        self.add(inputs, stride, n_rows, out);
    }

    /// The same without bias, added to a table of `width` columns.
    pub(crate) fn add(&self, inputs: &[f32], stride: usize, n_rows: usize, out: &mut [f32]) {
        add_product(inputs, stride, n_rows, &self.weights, out);
    }
}

/// Negative numbers become zero; what is not a number stays so.
pub(crate) fn relu(values: &mut [f32]) {
    for value in values {
        *value = if *value < 0.0 { 0.0 } else { *value };
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
    fn outputs_have_the_bits_of_the_definition_in_any_batch() {
        for (n_in, n_out) in [(1, 1), (7, 50), (54, 64), (33, 17)] {
            let (weights, bias) = (numbers(n_in * n_out, 1), numbers(n_out, 2));
            let layer = Linear::new(&weights, &bias, n_in, 0..n_in);
            for n_rows in [0, 1, 3, 4, 9] {
                let inputs = numbers(n_rows * n_in, 3);
                let mut out = Vec::new();
                layer.apply(&inputs, n_in, n_rows, &mut out);
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
