//! The image network: eight times a 3 x 3 convolution and 2 x 2 max pooling, no activation in between.
//!
//! Hardly two pixels in a hundred show anything, so it works on differences to the empty picture, whose maps are stored
//! once: only differences that are not zero are multiplied, each with all nine taps at once, and only the outputs that
//! they reach are pooled. Lines look alike in many places, vehicles and time steps: an output of the first layer depends
//! on 4 x 4 pixels alone, one of the second on 10 x 10, and their products with the next layer are kept in tables. Of
//! the outputs of the second layer three in four are found there on recorded roads, of the third not half, which is not
//! worth a table.

use super::layer::{CHANNELS, Layer, PRODUCTS, pool, reached_along};
use super::patches::{NONE, Patches};
use super::picture::{GREY, Picture, SIDE};
use crate::predict::product::{Matrix, multiply};

/// Entries of the tables at which they are emptied. A picture adds at most 2^14 to the first and 2^12 to the second.
const FIRST_MAX: usize = 8_192;
const SECOND_MAX: usize = 12_288;

/// All eight layers.
#[derive(Debug, Clone)]
pub(super) struct Stack {
    /// First layer: (tap, channel).
    first: Vec<[f32; CHANNELS]>,
    layers: Vec<Layer>,
}

/// Memory of one thread; the tables make later pictures faster, never different.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    /// Products of outputs of the first layer, by 4 x 4 pixels.
    first: Patches<1>,
    /// Products of outputs of the second layer, by 4 x 4 entries of the first table.
    second: Patches<5>,
    /// 4 x 4 pixels around every output of the first layer, two bits each.
    pixels: Vec<u32>,
    /// Which row of products belongs to an input, per layer; `NONE` almost everywhere.
    index: Vec<Vec<u16>>,
    /// Positions (row * side + column) of inputs that are not as in the empty picture, and of the outputs they reach.
    inputs: Vec<u16>,
    outputs: Vec<u16>,
    /// Those of the outputs that no table has.
    unknown: Vec<u16>,
    is_reached: Vec<bool>,
    /// Differences to the empty picture and their products; both only grow.
    differences: Vec<f32>,
    products: Vec<f32>,
}

/// The first `length` entries of memory that only grows.
fn at_least(memory: &mut Vec<f32>, length: usize) -> &mut [f32] {
    memory.resize(memory.len().max(length), 0.0);
    &mut memory[..length]
}

impl Stack {
    /// From torch's tensors: weights (32, 1, 3, 3), then seven (32, 32, 3, 3); biases (32).
    pub(super) fn new(weights: &[&[f32]; 8], biases: &[&[f32]; 8]) -> Self {
        let first = (0..9).map(|tap| std::array::from_fn(|channel| weights[0][channel * 9 + tap])).collect();
        let mut layers: Vec<Layer> = Vec::with_capacity(7);
        for number in 1..8 {
            let side = SIDE >> number;
            let bias: [f32; CHANNELS] = biases[0].try_into().expect("32 biases");
            let before = layers.last().map_or_else(|| bias.repeat(side * side), |layer| layer.empty_pooled.clone());
            let weights = Matrix::new(CHANNELS, PRODUCTS, |input, j| {
                weights[number][(j % CHANNELS * CHANNELS + input) * 9 + j / CHANNELS]
            });
            layers.push(Layer::new(side, weights, biases[number], &before));
        }
        Self { first, layers }
    }

    /// The 32 numbers that the network makes of a picture.
    pub(super) fn vector(&self, picture: &Picture, scratch: &mut Scratch) -> [f32; CHANNELS] {
        self.look_up(picture, scratch);
        let Scratch { second, index, inputs, outputs, is_reached, differences, products, .. } = scratch;
        for (number, layer) in self.layers.iter().enumerate().skip(1) {
            let index = &mut index[number];
            if number > 1 {
                let differences = &differences[..inputs.len() * CHANNELS];
                multiply(differences, &layer.weights, at_least(products, inputs.len() * PRODUCTS));
                inputs.iter().zip(0..).for_each(|(at, row)| index[*at as usize] = row);
            }
            let products = if number == 1 { second.rows() } else { &*products };
            layer.reached(inputs, is_reached, outputs);
            pool(layer, index, products, outputs, at_least(differences, outputs.len() * CHANNELS));
            inputs.iter().for_each(|at| index[*at as usize] = NONE);
            std::mem::swap(inputs, outputs);
        }
        let mut vector: [f32; CHANNELS] = self.layers[6].empty_pooled[..].try_into().expect("a single output");
        // An empty picture makes no difference.
        let difference = &differences[..inputs.len() * CHANNELS];
        vector.iter_mut().zip(difference).for_each(|(value, difference)| *value += difference);
        vector
    }

    /// The first two layers: `inputs` are then those of the third, with the entries of their products in `index`.
    fn look_up(&self, picture: &Picture, scratch: &mut Scratch) {
        let Scratch { first, second, pixels, index, inputs, outputs, unknown, is_reached, differences, .. } = scratch;
        if pixels.is_empty() {
            pixels.resize(SIDE / 2 * (SIDE / 2), 0);
            index.extend(self.layers.iter().map(|layer| vec![NONE; layer.side * layer.side]));
        }
        if first.len() > FIRST_MAX {
            first.clear();
            second.clear();
        } else if second.len() > SECOND_MAX {
            second.clear();
        }
        let (of_first, of_second) = index.split_at_mut(1);
        let (of_first, of_second) = (&mut of_first[0], &mut of_second[0]);

        collect_pixels(picture, pixels, inputs);
        let mut n_new = 0;
        for at in &*inputs {
            let (entry, is_new) = first.entry([u64::from(std::mem::take(&mut pixels[*at as usize]))]);
            of_first[*at as usize] = entry;
            n_new += usize::from(is_new);
        }
        let new = at_least(differences, n_new * CHANNELS);
        for (difference, patch) in new.chunks_exact_mut(CHANNELS).zip(first.last(n_new)) {
            difference.copy_from_slice(&self.first_difference(patch[0] as u32));
        }
        multiply(new, &self.layers[0].weights, first.last_rows(n_new, PRODUCTS));

        self.layers[0].reached(inputs, is_reached, outputs);
        unknown.clear();
        for at in &*outputs {
            let (entry, is_new) = second.entry(self.layers[0].patch(of_first, *at as usize));
            of_second[*at as usize] = entry;
            if is_new {
                unknown.push(*at);
            }
        }
        let new = at_least(differences, unknown.len() * CHANNELS);
        pool(&self.layers[0], of_first, first.rows(), unknown, new);
        multiply(new, &self.layers[1].weights, second.last_rows(unknown.len(), PRODUCTS));
        inputs.iter().for_each(|at| of_first[*at as usize] = NONE);
        std::mem::swap(inputs, outputs);
    }

    /// What the first layer makes of 4 x 4 pixels, as difference to the empty picture.
    fn first_difference(&self, pixels: u32) -> [f32; CHANNELS] {
        let mut largest = [f32::NEG_INFINITY; CHANNELS];
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut sums = [0.0; CHANNELS];
            for tap in 0..9 {
                let pixel = (row + tap / 3) * 4 + column + tap % 3;
                let grey = GREY[(pixels >> (2 * pixel) & 3) as usize];
                sums.iter_mut().zip(&self.first[tap]).for_each(|(sum, weight)| *sum += grey * weight);
            }
            largest.iter_mut().zip(sums).for_each(|(largest, sum)| *largest = largest.max(sum));
        }
        largest
    }
}

/// Writes the 4 x 4 pixels around every output of the first layer that sees a lit one into `pixels`, and lists those
/// outputs.
fn collect_pixels(picture: &Picture, pixels: &mut [u32], outputs: &mut Vec<u16>) {
    let half = SIDE / 2;
    outputs.clear();
    for (row, column, code) in picture.lit() {
        for y in reached_along(row, half) {
            for x in reached_along(column, half) {
                let patch = &mut pixels[y * half + x];
                if *patch == 0 {
                    outputs.push((y * half + x) as u16);
                }
                *patch |= u32::from(code) << (2 * ((row + 1 - 2 * y) * 4 + column + 1 - 2 * x));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture::Ink;
    use super::*;

    /// Between -1 and 1 (xorshift64*, Vigna 2016).
    fn numbers(n: usize, seed: u64) -> Vec<f32> {
        let mut state = (seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (0..n)
            .map(|_| {
                state ^= state >> 12;
                state ^= state << 25;
                state ^= state >> 27;
                (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40) as f32 / 8_388_608.0 - 1.0
            })
            .collect()
    }

    /// Specks at random places.
    fn specks(seed: u64) -> Picture {
        let mut picture = Picture::default();
        for drawn in numbers(12_000, seed).chunks_exact(3) {
            let place = |value: f32| ((value + 1.0) * 128.0) as usize % SIDE;
            picture.set(place(drawn[0]), place(drawn[1]), if drawn[2] < 0.0 { Ink::Edge } else { Ink::Marking });
        }
        picture
    }

    #[test]
    fn tables_that_are_full_are_emptied_and_change_no_bit() {
        let weights: Vec<Vec<f32>> =
            (0..8).map(|layer| numbers(if layer == 0 { 288 } else { 9216 }, layer + 1)).collect();
        let biases: Vec<Vec<f32>> = (0..8).map(|layer| numbers(CHANNELS, layer + 20)).collect();
        let weights: [&[f32]; 8] = std::array::from_fn(|layer| &weights[layer][..]);
        let biases: [&[f32]; 8] = std::array::from_fn(|layer| &biases[layer][..]);
        let stack = Stack::new(&weights, &biases);
        let mut used = Scratch::default();
        // (tables became smaller, how often)
        let (mut emptied, mut before) = ([0, 0], [0, 0]);
        for seed in 0..24 {
            let picture = specks(seed);
            let found = stack.vector(&picture, &mut used);
            let now = [used.first.len(), used.second.len()];
            for (table, count) in emptied.iter_mut().enumerate() {
                *count += usize::from(now[table] < before[table]);
            }
            before = now;
            if seed % 8 == 7 {
                assert_eq!(found, stack.vector(&picture, &mut Scratch::default()), "picture {seed}");
            }
        }
        assert!(emptied.iter().all(|count| *count > 0), "{emptied:?} times");
    }
}
