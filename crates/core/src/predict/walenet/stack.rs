//! The image network: eight times a 3 x 3 convolution and 2 x 2 max pooling, no activation in between.
//!
//! Hardly two pixels in a hundred show anything, so it works on differences to the empty picture, whose maps are stored
//! once: only differences that are not zero are multiplied, each with all nine taps at once, and only the outputs that
//! they reach are pooled. What the first layer makes of 4 x 4 pixels, and the products of that with the second layer,
//! depend on these pixels alone; they are kept in a table, as lines look alike in many places and vehicles.

use super::picture::{GREY, Picture, SIDE};
use super::product::{Matrix, for_wide_machines, multiply};

/// Channels of every layer, also the size of the result.
pub(super) const CHANNELS: usize = 32;
/// Products of one input vector: nine taps times channels.
const PRODUCTS: usize = 9 * CHANNELS;
/// No input.
const NONE: u32 = u32::MAX;
/// Entries of the table of patches at which it is emptied.
const PATCHES_MAX: usize = 8192;

/// A layer behind the first, with 32 input channels.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    /// Side of the input; that of the output is half of it.
    side: usize,
    /// (input channel, tap and output channel).
    weights: Matrix,
    /// Outputs of the empty picture before pooling, (side, side, channels).
    empty: Vec<f32>,
    /// Behind pooling, (side / 2, side / 2, channels).
    empty_pooled: Vec<f32>,
}

/// All eight layers.
#[derive(Debug, Clone)]
pub(super) struct Stack {
    /// First layer: (tap, channel).
    first: Vec<[f32; CHANNELS]>,
    layers: Vec<Layer>,
}

/// Memory of one thread; the table of patches makes later pictures faster, never different.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    patches: Patches,
    /// 4 x 4 pixels around every output of the first layer, two bits each.
    keys: Vec<u32>,
    /// Where in the products of a layer an input is found, per layer; `NONE` almost everywhere.
    index: Vec<Vec<u32>>,
    inputs: Inputs,
    outputs: Inputs,
    is_reached: Vec<bool>,
    products: Vec<f32>,
}

/// Differences to the empty picture that are not zero: positions (row * side + column, ascending) and vectors.
#[derive(Debug, Clone, Default)]
struct Inputs {
    at: Vec<u32>,
    /// One vector per position; what stands behind them is left over.
    values: Vec<f32>,
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
        let Scratch { patches, keys, index, inputs, outputs, is_reached, products } = scratch;
        patches.bound();
        if keys.is_empty() {
            keys.resize(SIDE / 2 * (SIDE / 2), 0);
            index.extend(self.layers.iter().map(|layer| vec![NONE; layer.side * layer.side]));
        }
        collect_patches(picture, keys, &mut inputs.at);
        for at in &inputs.at {
            index[0][*at as usize] = patches.entry(std::mem::take(&mut keys[*at as usize]));
        }
        patches.complete(self);
        for (number, layer) in self.layers.iter().enumerate() {
            if number > 0 {
                let values = &inputs.values[..inputs.at.len() * CHANNELS];
                multiply(values, &layer.weights, at_least(products, inputs.at.len() * PRODUCTS));
                inputs.at.iter().zip(0..).for_each(|(at, entry)| index[number][*at as usize] = entry);
            }
            let products = if number == 0 { &patches.products } else { &*products };
            layer.reached(&inputs.at, is_reached, &mut outputs.at);
            let n_values = outputs.at.len() * CHANNELS;
            pool(layer, &index[number], products, &outputs.at, at_least(&mut outputs.values, n_values));
            inputs.at.iter().for_each(|at| index[number][*at as usize] = NONE);
            std::mem::swap(inputs, outputs);
        }
        let mut vector: [f32; CHANNELS] = self.layers[6].empty_pooled[..].try_into().expect("a single output");
        // An empty picture makes no difference.
        let difference = &inputs.values[..inputs.at.len() * CHANNELS];
        vector.iter_mut().zip(difference).for_each(|(value, difference)| *value += difference);
        vector
    }

    /// What the first layer makes of 4 x 4 pixels, as difference to the empty picture.
    fn first_difference(&self, key: u32) -> [f32; CHANNELS] {
        let mut largest = [f32::NEG_INFINITY; CHANNELS];
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut sums = [0.0; CHANNELS];
            for tap in 0..9 {
                let pixel = (row + tap / 3) * 4 + column + tap % 3;
                let grey = GREY[(key >> (2 * pixel) & 3) as usize];
                sums.iter_mut().zip(&self.first[tap]).for_each(|(sum, weight)| *sum += grey * weight);
            }
            largest.iter_mut().zip(sums).for_each(|(largest, sum)| *largest = largest.max(sum));
        }
        largest
    }
}

impl Layer {
    /// Works out the maps of the empty picture from the map before it, (side, side, channels).
    fn new(side: usize, weights: Matrix, bias: &[f32], before: &[f32]) -> Self {
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

    /// Outputs whose 4 x 4 inputs hold one of `inputs`, ascending. `is_reached` is false everywhere before and after.
    fn reached(&self, inputs: &[u32], is_reached: &mut Vec<bool>, outputs: &mut Vec<u32>) {
        let half = self.side / 2;
        is_reached.resize(is_reached.len().max(half * half), false);
        for at in inputs {
            let (row, column) = (*at as usize / self.side, *at as usize % self.side);
            for row in reached_along(row, half) {
                for column in reached_along(column, half) {
                    is_reached[row * half + column] = true;
                }
            }
        }
        outputs.clear();
        for (at, is_reached) in is_reached[..half * half].iter_mut().enumerate() {
            if std::mem::take(is_reached) {
                outputs.push(at as u32);
            }
        }
    }
}

/// Outputs that an input reaches along one axis; one for the first and last input, else two.
fn reached_along(input: usize, half: usize) -> std::ops::RangeInclusive<usize> {
    input.saturating_sub(1) / 2..=input.div_ceil(2).min(half - 1)
}

/// Writes the 4 x 4 pixels around every output of the first layer that sees a lit one into `keys`, and lists those
/// outputs, ascending.
fn collect_patches(picture: &Picture, keys: &mut [u32], outputs: &mut Vec<u32>) {
    let half = SIDE / 2;
    outputs.clear();
    for (row, column, code) in picture.lit() {
        for y in reached_along(row, half) {
            for x in reached_along(column, half) {
                let key = &mut keys[y * half + x];
                if *key == 0 {
                    outputs.push((y * half + x) as u32);
                }
                *key |= u32::from(code) << (2 * ((row + 1 - 2 * y) * 4 + column + 1 - 2 * x));
            }
        }
    }
    outputs.sort_unstable();
}

for_wide_machines! {
    /// Sums the products that reach each output, adds the map of the empty picture, pools, and takes the difference.
    fn pool = pool_outputs, (layer: &Layer, index: &[u32], products: &[f32], outputs: &[u32], values: &mut [f32])
}

#[inline(always)]
fn pool_outputs(layer: &Layer, index: &[u32], products: &[f32], outputs: &[u32], values: &mut [f32]) {
    let (side, half) = (layer.side, layer.side / 2);
    for (at, value) in outputs.iter().zip(values.chunks_exact_mut(CHANNELS)) {
        let (row, column) = (*at as usize / half * 2, *at as usize % half * 2);
        let mut sums = [[0.0_f32; CHANNELS]; 4];
        // Input (row + u - 1, column + v - 1) reaches output (row + a, column + b) by tap (u - a, v - b).
        for u in usize::from(row == 0)..4.min(side + 1 - row) {
            for v in usize::from(column == 0)..4.min(side + 1 - column) {
                let entry = index[(row + u - 1) * side + column + v - 1];
                if entry == NONE {
                    continue;
                }
                let products = &products[entry as usize * PRODUCTS..(entry as usize + 1) * PRODUCTS];
                for a in u.saturating_sub(2)..=u.min(1) {
                    for b in v.saturating_sub(2)..=v.min(1) {
                        let tap = ((u - a) * 3 + v - b) * CHANNELS;
                        let product = &products[tap..tap + CHANNELS];
                        sums[a * 2 + b].iter_mut().zip(product).for_each(|(sum, value)| *sum += value);
                    }
                }
            }
        }
        let mut largest = [f32::NEG_INFINITY; CHANNELS];
        for (i, sums) in sums.iter().enumerate() {
            let from = ((row + i / 2) * side + column + i % 2) * CHANNELS;
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

/// Products of the second layer by what the first one saw. Open addressing; entry `i` belongs to the i-th key.
#[derive(Debug, Clone, Default)]
struct Patches {
    /// Entry by slot; `NONE`: free. Always less than half full.
    slots: Vec<u32>,
    keys: Vec<u32>,
    products: Vec<f32>,
}

impl Patches {
    /// The entry of a key, which is made if there is none; `complete` must follow.
    fn entry(&mut self, key: u32) -> u32 {
        if self.slots.len() < 2 * (self.keys.len() + 1) {
            let larger = vec![NONE; (2 * self.slots.len()).max(2 * PATCHES_MAX)];
            self.slots = larger;
            for entry in 0..self.keys.len() {
                let slot = self.slot(self.keys[entry]);
                self.slots[slot] = entry as u32;
            }
        }
        let slot = self.slot(key);
        if self.slots[slot] == NONE {
            self.slots[slot] = self.keys.len() as u32;
            self.keys.push(key);
        }
        self.slots[slot]
    }

    /// The slot of a key, or the free one where it belongs.
    fn slot(&self, key: u32) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = (u64::from(key).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & mask;
        while self.slots[slot] != NONE && self.keys[self.slots[slot] as usize] != key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    /// Works out the entries that are new.
    fn complete(&mut self, stack: &Stack) {
        let known = self.products.len() / PRODUCTS;
        let differences: Vec<f32> = self.keys[known..].iter().flat_map(|key| stack.first_difference(*key)).collect();
        self.products.resize(self.keys.len() * PRODUCTS, 0.0);
        multiply(&differences, &stack.layers[0].weights, &mut self.products[known * PRODUCTS..]);
    }

    /// Forgets everything if there is too much.
    fn bound(&mut self) {
        if self.keys.len() > PATCHES_MAX {
            self.slots.fill(NONE);
            self.keys.clear();
            self.products.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_patches_finds_every_key_and_is_emptied_when_it_is_large() {
        let mut patches = Patches::default();
        let keys: Vec<u32> = (1..=3 * PATCHES_MAX as u32).map(|i| i.wrapping_mul(0x0101_0005)).collect();
        for round in 0..2 {
            for (entry, key) in keys.iter().enumerate() {
                assert_eq!(patches.entry(*key), entry as u32, "round {round}");
            }
        }
        assert!(2 * patches.keys.len() < patches.slots.len());
        patches.bound();
        assert_eq!(patches.entry(keys[77]), 0, "forgotten, and begun anew");
        patches.bound();
        assert_eq!(patches.entry(keys[77]), 0, "a small table is kept");
    }
}
