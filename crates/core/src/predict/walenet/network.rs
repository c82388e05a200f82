//! The whole network: encoder, social pooling, image, decoder.

use super::activation::{exp, leaky, tanh};
use super::layer::CHANNELS;
use super::picture::Picture;
use super::recurrent::Gru;
use super::stack::{self, Stack};
use crate::error::{Error, Result};
use crate::predict::product::{Matrix, multiply};

/// Positions of a history, every 0.1 s, the last is now.
pub const N_HISTORY: usize = 30;
/// Steps of the output, every 0.1 s.
pub const N_OUTPUT: usize = 40;
/// Cells along the lane, the first far ahead; 6 m each.
pub(super) const CELLS_ALONG: usize = 13;
/// Cells across, from left to right.
pub(super) const CELLS_ACROSS: usize = 3;
/// Cells around a vehicle; cell 13 c + r is in column c and row r, its own is 19.
pub const N_CELLS: usize = CELLS_ALONG * CELLS_ACROSS;

/// A history in the frame of the predicted vehicle: (x right, y forward) [m], oldest first.
pub type History = [[f32; 2]; N_HISTORY];
/// Per step: mean right and forward [m], inverse standard deviations [1/m], correlation.
pub type Output = [[f32; 5]; N_OUTPUT];

const POINT: usize = 16;
const ENCODED: usize = 32;
const DYNAMICS: usize = 16;
const SOCIAL: usize = 40;
const SOCIAL_ROWS: usize = CELLS_ALONG - 2;
const NARROW: usize = 8;
const NARROW_ROWS: usize = SOCIAL_ROWS - 2;
const DECODED: usize = 64;
const CONTEXT: usize = SOCIAL + DYNAMICS + CHANNELS;

/// A named array as a weights file holds it.
#[derive(Debug, Clone)]
pub struct Tensor {
    /// Its name in the published checkpoint.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Row-major.
    pub values: Vec<f32>,
}

/// The network with its parameters in the order in which they are used, and what it makes of nothing.
#[derive(Debug, Clone)]
pub struct Network {
    point: Matrix,
    point_bias: Vec<f32>,
    encoder: Gru,
    dynamics: Matrix,
    dynamics_bias: Vec<f32>,
    /// Per column of cells: (state, row of the kernel and channel).
    social: Vec<Matrix>,
    /// Encoder state of an empty cell.
    empty_state: Vec<f32>,
    /// Social convolution with bias when all cells are empty, (rows, channels).
    empty_social: Vec<f32>,
    narrow: Matrix,
    narrow_bias: Vec<f32>,
    stack: Stack,
    decoder: Gru,
    output: Matrix,
    output_bias: Vec<f32>,
}

/// Memory of one thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    pub(super) stack: stack::Scratch,
    points: Vec<f32>,
    embedded: Vec<f32>,
    weighed: Vec<f32>,
    states: Vec<f32>,
    gates: Vec<f32>,
    decoded: Vec<f32>,
}

/// The tensors of a file by name.
struct Tensors<'a>(&'a [Tensor]);

impl<'a> Tensors<'a> {
    fn get(&self, name: &str, shape: &[usize]) -> Result<&'a [f32]> {
        let found = self.0.iter().find(|tensor| tensor.name == name);
        let tensor = found.ok_or_else(|| Error::invalid(format!("weights of walenet: tensor {name} is missing")))?;
        if tensor.shape != shape || tensor.values.len() != shape.iter().product::<usize>() {
            return Err(Error::invalid(format!(
                "weights of walenet: tensor {name} has shape {:?} and {} values, {shape:?} is expected",
                tensor.shape,
                tensor.values.len()
            )));
        }
        if tensor.values.iter().any(|value| !value.is_finite()) {
            return Err(Error::invalid(format!("weights of walenet: tensor {name} has values that are not numbers")));
        }
        Ok(&tensor.values)
    }

    fn gru(&self, name: &str, inputs: usize, size: usize) -> Result<Gru> {
        Ok(Gru::new(
            self.get(&format!("{name}.weight_ih_l0"), &[3 * size, inputs])?,
            self.get(&format!("{name}.weight_hh_l0"), &[3 * size, size])?,
            self.get(&format!("{name}.bias_ih_l0"), &[3 * size])?,
            self.get(&format!("{name}.bias_hh_l0"), &[3 * size])?,
        ))
    }

    /// A layer with torch's (outputs, inputs): the matrix (inputs, outputs) and the bias.
    fn linear(&self, name: &str, inputs: usize, outputs: usize) -> Result<(Matrix, Vec<f32>)> {
        let weights = self.get(&format!("{name}.weight"), &[outputs, inputs])?;
        let bias = self.get(&format!("{name}.bias"), &[outputs])?;
        Ok((Matrix::new(inputs, outputs, |i, j| weights[j * inputs + i]), bias.to_vec()))
    }

    fn stack(&self) -> Result<Stack> {
        const C: usize = CHANNELS;
        let (mut weights, mut biases) = ([&[][..]; 8], [&[][..]; 8]);
        for layer in 0..8 {
            let inputs = if layer == 0 { 1 } else { C };
            weights[layer] = self.get(&format!("sc_conv{}.weight", layer + 1), &[C, inputs, 3, 3])?;
            biases[layer] = self.get(&format!("sc_conv{}.bias", layer + 1), &[C])?;
        }
        Ok(Stack::new(&weights, &biases))
    }
}

impl Network {
    /// From the tensors of the published checkpoint, by their names there; others are ignored.
    ///
    /// # Errors
    /// `InvalidInput` naming the tensor that is missing, has another shape or values that are not numbers.
    pub fn new(tensors: &[Tensor]) -> Result<Self> {
        let tensors = Tensors(tensors);
        let (point, point_bias) = tensors.linear("ip_emb", 2, POINT)?;
        let (dynamics, dynamics_bias) = tensors.linear("dyn_emb", ENCODED, DYNAMICS)?;
        let (output, output_bias) = tensors.linear("op", DECODED, 5)?;
        let wide = tensors.get("soc_conv.weight", &[ENCODED, ENCODED, 3, CELLS_ACROSS])?;
        let social = (0..CELLS_ACROSS).map(|column| {
            Matrix::new(ENCODED, 3 * ENCODED, |input, j| {
                wide[((j % ENCODED * ENCODED + input) * 3 + j / ENCODED) * CELLS_ACROSS + column]
            })
        });
        let narrow = tensors.get("conv_3x1.weight", &[NARROW, ENCODED, 3, 1])?;
        let mut network = Self {
            point,
            point_bias,
            encoder: tensors.gru("enc_lstm", POINT, ENCODED)?,
            dynamics,
            dynamics_bias,
            social: social.collect(),
            empty_state: vec![0.0; ENCODED],
            empty_social: tensors.get("soc_conv.bias", &[ENCODED])?.repeat(SOCIAL_ROWS),
            narrow: Matrix::new(ENCODED, 3 * NARROW, |input, j| {
                narrow[(j % NARROW * ENCODED + input) * 3 + j / NARROW]
            }),
            narrow_bias: tensors.get("conv_3x1.bias", &[NARROW])?.to_vec(),
            stack: tensors.stack()?,
            decoder: tensors.gru("dec_lstm", CONTEXT, DECODED)?,
            output,
            output_bias,
        };
        let mut scratch = Scratch::default();
        network.encode(&[[[0.0; 2]; N_HISTORY]], &mut scratch);
        network.empty_state.copy_from_slice(&scratch.states);
        let mut social = network.empty_social.clone();
        for cell in 0..N_CELLS {
            network.add_cell(cell, &network.empty_state, &mut social);
        }
        network.empty_social = social;
        Ok(network)
    }

    /// The network's answer to inputs as its authors define them, for comparisons with other implementations.
    ///
    /// `grey` is the picture, (256, 256) of 0, 127 and 255; `cells` are the histories in those of the 39 cells that are
    /// not empty, each at most once.
    ///
    /// # Errors
    /// `InvalidInput` for another picture or an impossible cell.
    pub fn answer(&self, history: &History, cells: &[(usize, History)], grey: &[u8]) -> Result<Output> {
        let picture = Picture::from_grey(grey)
            .ok_or_else(|| Error::invalid("walenet: a picture has 256 x 256 pixels of 0, 127 or 255"))?;
        let twice = |i: usize| cells[..i].iter().any(|other| other.0 == cells[i].0);
        if let Some(i) = (0..cells.len()).find(|i| cells[*i].0 >= N_CELLS || twice(*i)) {
            return Err(Error::invalid(format!("walenet: cell {} is impossible or there twice", cells[i].0)));
        }
        let mut scratch = Scratch::default();
        let image = self.image(&picture, &mut scratch);
        let histories: Vec<History> = std::iter::once(*history).chain(cells.iter().map(|cell| cell.1)).collect();
        let places: Vec<(usize, usize)> = cells.iter().zip(1..).map(|(cell, place)| (cell.0, place)).collect();
        Ok(self.forward(&histories, &places, &image, &mut scratch))
    }

    /// The 32 numbers that stand for a picture.
    pub(super) fn image(&self, picture: &Picture, scratch: &mut Scratch) -> [f32; CHANNELS] {
        self.stack.vector(picture, &mut scratch.stack)
    }

    /// Everything but the image. History 0 is that of the predicted vehicle; `cells` says which history is in which cell
    /// of those that are not empty, each cell at most once.
    pub(super) fn forward(
        &self,
        histories: &[History],
        cells: &[(usize, usize)],
        image: &[f32; CHANNELS],
        scratch: &mut Scratch,
    ) -> Output {
        self.encode(histories, scratch);
        let mut context = [0.0; CONTEXT];
        context[..SOCIAL].copy_from_slice(&self.pooled(cells, &scratch.states));
        let mut dynamics = [0.0; DYNAMICS];
        multiply(&scratch.states[..ENCODED], &self.dynamics, &mut dynamics);
        for (i, value) in dynamics.iter().enumerate() {
            context[SOCIAL + i] = leaky(value + self.dynamics_bias[i]);
        }
        context[SOCIAL + DYNAMICS..].copy_from_slice(image);
        self.decode(&context, scratch)
    }

    /// Last encoder state of each history, (histories, 32), into `scratch.states`.
    fn encode(&self, histories: &[History], scratch: &mut Scratch) {
        let n = histories.len();
        scratch.points.clear();
        for step in 0..N_HISTORY {
            scratch.points.extend(histories.iter().flat_map(|history| history[step]));
        }
        scratch.embedded.resize(n * N_HISTORY * POINT, 0.0);
        multiply(&scratch.points, &self.point, &mut scratch.embedded);
        for row in scratch.embedded.chunks_exact_mut(POINT) {
            row.iter_mut().zip(&self.point_bias).for_each(|(value, bias)| *value = leaky(*value + bias));
        }
        self.encoder.weigh(&scratch.embedded, &mut scratch.weighed);
        scratch.states.clear();
        scratch.states.resize(n * ENCODED, 0.0);
        for weighed in scratch.weighed.chunks_exact(n * 3 * ENCODED) {
            self.encoder.step(weighed, &mut scratch.states, &mut scratch.gates);
        }
    }

    /// Adds what the state of a cell contributes to the social convolution, (rows, channels).
    fn add_cell(&self, cell: usize, state: &[f32], social: &mut [f32]) {
        let mut products = [0.0; 3 * ENCODED];
        multiply(state, &self.social[cell / CELLS_ALONG], &mut products);
        for (tap, product) in products.chunks_exact(ENCODED).enumerate() {
            let row = (cell % CELLS_ALONG).wrapping_sub(tap);
            if row < SOCIAL_ROWS {
                let sums = &mut social[row * ENCODED..(row + 1) * ENCODED];
                sums.iter_mut().zip(product).for_each(|(sum, value)| *sum += value);
            }
        }
    }

    /// Social convolutions and pooling: index 5 * channel + row.
    fn pooled(&self, cells: &[(usize, usize)], states: &[f32]) -> [f32; SOCIAL] {
        let mut social = self.empty_social.clone();
        for (cell, history) in cells {
            let mut difference = [0.0; ENCODED];
            for (i, value) in difference.iter_mut().enumerate() {
                *value = states[history * ENCODED + i] - self.empty_state[i];
            }
            self.add_cell(*cell, &difference, &mut social);
        }
        social.iter_mut().for_each(|value| *value = leaky(*value));
        let stride = self.narrow.columns();
        let mut products = vec![0.0; SOCIAL_ROWS * stride];
        multiply(&social, &self.narrow, &mut products);
        let mut pooled = [f32::NEG_INFINITY; SOCIAL];
        for row in 0..NARROW_ROWS {
            for channel in 0..NARROW {
                let sum = (0..3).fold(0.0, |sum, tap| sum + products[(row + tap) * stride + tap * NARROW + channel]);
                // Output o sees rows 2 o - 1 and 2 o.
                let largest = &mut pooled[5 * channel + row.div_ceil(2)];
                *largest = largest.max(leaky(sum + self.narrow_bias[channel]));
            }
        }
        pooled
    }

    fn decode(&self, context: &[f32; CONTEXT], scratch: &mut Scratch) -> Output {
        self.decoder.weigh(context, &mut scratch.weighed);
        scratch.states.clear();
        scratch.states.resize(DECODED, 0.0);
        scratch.decoded.clear();
        for _ in 0..N_OUTPUT {
            self.decoder.step(&scratch.weighed, &mut scratch.states, &mut scratch.gates);
            scratch.decoded.extend_from_slice(&scratch.states);
        }
        let stride = self.output.columns();
        scratch.embedded.resize(N_OUTPUT * stride, 0.0);
        multiply(&scratch.decoded, &self.output, &mut scratch.embedded);
        std::array::from_fn(|step| {
            let value = |k: usize| scratch.embedded[step * stride + k] + self.output_bias[k];
            [value(0), value(1), exp(value(2)), exp(value(3)), tanh(value(4))]
        })
    }
}
