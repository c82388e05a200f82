//! Gated recurrent units of one layer (Cho et al. 2014, with the reset gate behind the recurrent product, as torch has
//! it): r = s(Wr x + br + Ur h + cr), z alike, n = tanh(Wn x + bn + r (Un h + cn)), h' = (1 - z) n + z h.

use super::activation::{sigmoid, tanh};
use crate::predict::product::{Matrix, multiply};
use crate::simd::multiversion;

/// Parameters; rows r, z, n.
#[derive(Debug, Clone)]
pub(super) struct Gru {
    size: usize,
    input: Matrix,
    input_bias: Vec<f32>,
    recurrent: Matrix,
    recurrent_bias: Vec<f32>,
}

impl Gru {
    /// From torch's tensors: `weight_ih` (3 size, inputs), `weight_hh` (3 size, size), biases (3 size).
    pub(super) fn new(weight_ih: &[f32], weight_hh: &[f32], bias_ih: &[f32], bias_hh: &[f32]) -> Self {
        let size = bias_ih.len() / 3;
        let n_inputs = weight_ih.len() / (3 * size);
        Self {
            size,
            input: Matrix::new(n_inputs, 3 * size, |i, j| weight_ih[j * n_inputs + i]),
            input_bias: bias_ih.to_vec(),
            recurrent: Matrix::new(size, 3 * size, |i, j| weight_hh[j * size + i]),
            recurrent_bias: bias_hh.to_vec(),
        }
    }

    /// Input products with biases for any number of inputs, (inputs, 3 size).
    pub(super) fn weigh(&self, inputs: &[f32], weighed: &mut Vec<f32>) {
        weighed.resize(inputs.len() / self.input.rows() * 3 * self.size, 0.0);
        multiply(inputs, &self.input, weighed);
        for row in weighed.chunks_exact_mut(3 * self.size) {
            row.iter_mut().zip(&self.input_bias).for_each(|(value, bias)| *value += bias);
        }
    }

    /// One step of several sequences: `states` (sequences, size) by the weighed inputs (sequences, 3 size). `scratch`
    /// may hold anything.
    pub(super) fn step(&self, weighed: &[f32], states: &mut [f32], scratch: &mut Vec<f32>) {
        scratch.resize(weighed.len(), 0.0);
        multiply(states, &self.recurrent, scratch);
        let width = 3 * self.size;
        for ((state, x), h) in
            states.chunks_exact_mut(self.size).zip(weighed.chunks_exact(width)).zip(scratch.chunks_exact(width))
        {
            gates(x, h, &self.recurrent_bias, state);
        }
    }
}

multiversion! {
    fn gates = gates_of_one, (x: &[f32], h: &[f32], bias: &[f32], state: &mut [f32])
}

#[inline(always)]
fn gates_of_one(x: &[f32], h: &[f32], bias: &[f32], state: &mut [f32]) {
    let n = state.len();
    let (x_r, x_z, x_n) = (&x[..n], &x[n..2 * n], &x[2 * n..3 * n]);
    let (h_r, h_z, h_n) = (&h[..n], &h[n..2 * n], &h[2 * n..3 * n]);
    let (b_r, b_z, b_n) = (&bias[..n], &bias[n..2 * n], &bias[2 * n..3 * n]);
    for j in 0..n {
        let reset = sigmoid(x_r[j] + (h_r[j] + b_r[j]));
        let update = sigmoid(x_z[j] + (h_z[j] + b_z[j]));
        let new = tanh(x_n[j] + reset * (h_n[j] + b_n[j]));
        state[j] = (1.0 - update) * new + update * state[j];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_follows_the_published_equations() {
        let (inputs, size) = (3, 32);
        let some = |n: usize, seed: f32| -> Vec<f32> { (0..n).map(|i| (i as f32 * 0.7 + seed).sin() * 0.5).collect() };
        let (w, u) = (some(3 * size * inputs, 1.0), some(3 * size * size, 2.0));
        let (b, c) = (some(3 * size, 3.0), some(3 * size, 4.0));
        let (x, h) = (some(inputs, 5.0), some(size, 6.0));
        let gru = Gru::new(&w, &u, &b, &c);
        let (mut weighed, mut state, mut scratch) = (Vec::new(), h.clone(), Vec::new());
        gru.weigh(&x, &mut weighed);
        gru.step(&weighed, &mut state, &mut scratch);
        let row = |matrix: &[f32], i: usize, v: &[f32]| -> f64 {
            (0..v.len()).map(|k| f64::from(matrix[i * v.len() + k]) * f64::from(v[k])).sum()
        };
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        for j in 0..size {
            let gate = |k: usize| (row(&w, k, &x) + f64::from(b[k]), row(&u, k, &h) + f64::from(c[k]));
            let (r, z, n) = (gate(j), gate(size + j), gate(2 * size + j));
            let (r, z) = (sigmoid(r.0 + r.1), sigmoid(z.0 + z.1));
            let expected = (1.0 - z) * (n.0 + r * n.1).tanh() + z * f64::from(h[j]);
            assert!((f64::from(state[j]) - expected).abs() < 2e-6, "{j}: {} {expected}", state[j]);
        }
    }
}
