//! The network: from features to what a vehicle does on each of its paths.
//!
//! Past and present of the vehicle, and each neighbour, go through two layers; the largest values of all neighbours are
//! kept. With these, each path goes through two layers; the largest values of all paths are kept. With these, each path
//! goes through two more layers that give its modes. All but the last are followed by a rectifier.

use super::feature_table::{N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH};
use super::inputs::N_KNOTS;
use super::motion_smoothness::N_SMOOTHNESS;
use super::paths::N_PATHS;
use crate::error::{Error, Result};
use crate::layers::linear::{Linear, relu};

/// Outputs of a mode: its logit, then of every knot the speed [m/s] and the lateral speed [m/s] besides those expected,
/// and the logarithms of how fast the standard deviations along and across the path grow [m/s].
pub const MODE_OUTPUTS: usize = 1 + 4 * N_KNOTS;
/// Most modes that a path may have.
const PATH_MODES_MAX: usize = 8;
/// Widest layer.
const WIDTH_MAX: usize = 4096;

/// Bound of the logarithm of the factor on the spread of a vehicle.
const LOG_SPREAD: f64 = 1.5;

/// When two modes of a vehicle are one, and what its spread is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Merging {
    /// Modes nearer to each other than this at every knot [m] are one ...
    pub distance: f64,
    /// ... and those nearer than this share of their standard deviations.
    pub share: f64,
    /// The spread is that of the second moments (1), the geometric mean (0), or between.
    pub moment: f64,
}

/// What the modes leave out: a wide mode around the most probable one, which makes every mixture a contaminated normal
/// distribution (Tukey, "A survey of sampling from contaminated distributions", 1960).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tail {
    /// Its probability; the other modes share the rest. If all of them were less probable then, it is as probable as
    /// the most probable one.
    pub probability: f64,
    /// Factor on the standard deviation of all other modes together, around the most probable one.
    pub factor: f64,
}

/// A tensor of a file of weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Name, such as `agent.0.weight`.
    pub name: String,
    /// Shape; weights are (outputs, inputs).
    pub shape: Vec<usize>,
    /// Values, row-major.
    pub values: Vec<f32>,
}

/// The network and the calibration of its spread.
#[derive(Debug, Clone)]
pub struct Network {
    agent: [Linear; 2],
    neighbour: [Linear; 2],
    /// The part of the first layer that sees the path, and the part that sees the vehicle and its neighbours.
    path: [Linear; 2],
    path_context: Linear,
    /// The part of the first layer that sees the path, and the part that sees all paths.
    head: [Linear; 2],
    head_context: Linear,
    /// Outputs of the layers for the vehicle.
    n_agent: usize,
    /// Modes of every path.
    pub n_modes: usize,
    /// Factors on the standard deviations along and across the path at every knot.
    pub calibration: [[f64; N_KNOTS]; 2],
    /// Logarithm of a further factor, of a vehicle: a constant and a part of each feature of how even its past was.
    pub motion_smoothness: [[f64; 1 + N_SMOOTHNESS]; 2],
    /// Logits are divided by it.
    pub temperature: f64,
    /// Outputs for speed and lateral speed [m/s] are this much nearer to zero than the last layer says, or zero: a vehicle
    /// can go on exactly as expected.
    pub dead_zone: [f64; 2],
    /// When modes are one.
    pub merging: Merging,
    /// The wide modes of driving and of standing vehicles, if there are any.
    pub tail: Option<[Tail; 2]>,
}

/// Tensors that have not been taken yet.
struct Tensors {
    left: Vec<Tensor>,
}

impl Tensors {
    fn optional(&mut self, name: &str) -> Option<Tensor> {
        self.left.iter().position(|tensor| tensor.name == name).map(|i| self.left.swap_remove(i))
    }

    /// Values of a tensor of one dimension, or their replacement if it is missing.
    fn optional_values<const N: usize>(&mut self, name: &str, missing: [f64; N]) -> Result<[f64; N]> {
        if !self.left.iter().any(|tensor| tensor.name == name) {
            return Ok(missing);
        }
        let found = self.take(name, &[N])?;
        Ok(std::array::from_fn(|k| f64::from(found.values[k])))
    }

    /// A tensor whose shape must be as given, where 0 means any length up to 4096.
    fn take(&mut self, name: &str, shape: &[usize]) -> Result<Tensor> {
        let found = self.optional(name).ok_or_else(|| Error::invalid(format!("tensor {name} is missing")))?;
        let fits = found.shape.len() == shape.len()
            && found.shape.iter().zip(shape).all(|(n, wanted)| (1..=WIDTH_MAX).contains(n) && [0, *n].contains(wanted))
            && found.values.len() == found.shape.iter().product::<usize>();
        if !fits {
            let wanted: Vec<String> =
                shape.iter().map(|n| if *n == 0 { format!("1 to {WIDTH_MAX}") } else { n.to_string() }).collect();
            let wanted = wanted.join(", ");
            return Err(Error::invalid(format!("tensor {name} has shape {:?}, ({wanted}) is expected", found.shape)));
        }
        if found.values.iter().any(|value| !value.is_finite()) {
            return Err(Error::invalid(format!("tensor {name} has values that are not finite numbers")));
        }
        Ok(found)
    }

    /// Weights, bias and number of outputs of a layer with `n_in` inputs; 0 outputs: any number.
    fn layer(&mut self, name: &str, n_in: usize, n_out: usize) -> Result<(Vec<f32>, Vec<f32>, usize)> {
        let weight = self.take(&format!("{name}.weight"), &[n_out, n_in])?;
        let n_out = weight.shape[0];
        let bias = self.take(&format!("{name}.bias"), &[n_out])?;
        Ok((weight.values, bias.values, n_out))
    }

    fn pair(&mut self, name: &str, n_in: usize) -> Result<([Linear; 2], usize)> {
        let (weight, bias, hidden) = self.layer(&format!("{name}.0"), n_in, 0)?;
        let first = Linear::new(&weight, &bias, n_in, 0..n_in);
        let (weight, bias, n_out) = self.layer(&format!("{name}.1"), hidden, 0)?;
        Ok(([first, Linear::new(&weight, &bias, hidden, 0..hidden)], n_out))
    }

    fn factors(&mut self, name: &str) -> Result<[f64; N_KNOTS]> {
        let found = self.take(name, &[N_KNOTS])?;
        if found.values.iter().any(|value| *value <= 0.0) {
            return Err(Error::invalid(format!("tensor {name} has values that are not positive")));
        }
        Ok(std::array::from_fn(|k| f64::from(found.values[k])))
    }
}

impl Network {
    /// From the tensors of a file: `agent`, `neighbour`, `path` and `head`, each with layers 0 and 1 with `weight` and
    /// `bias`; `calibration.s` and `calibration.d`; `calibration.temperature`, `calibration.evenness_s`,
    /// `calibration.evenness_d`, `decode.dead_zone`, `decode.merging` and `decode.tail` if the file has them. The widths
    /// of the layers are those of the tensors.
    ///
    /// # Errors
    /// `InvalidInput` naming the tensor that is missing, unknown, of a wrong shape or with impossible values.
    pub fn new(tensors: Vec<Tensor>) -> Result<Self> {
        let mut tensors = Tensors { left: tensors };
        let (agent, n_agent) = tensors.pair("agent", N_AGENT)?;
        let (neighbour, n_neighbour) = tensors.pair("neighbour", N_NEIGHBOUR)?;
        let n_in = N_PATH + n_agent + n_neighbour;
        let (weight, bias, hidden) = tensors.layer("path.0", n_in, 0)?;
        let path_context = Linear::new(&weight, &bias, n_in, N_PATH..n_in);
        let path_own = Linear::new(&weight, &bias, n_in, 0..N_PATH).without_bias();
        let (weight, bias, n_path) = tensors.layer("path.1", hidden, 0)?;
        let path = [path_own, Linear::new(&weight, &bias, hidden, 0..hidden)];
        let (weight, bias, hidden) = tensors.layer("head.0", 2 * n_path, 0)?;
        let head_context = Linear::new(&weight, &bias, 2 * n_path, n_path..2 * n_path);
        let head_own = Linear::new(&weight, &bias, 2 * n_path, 0..n_path).without_bias();
        let (weight, bias, n_out) = tensors.layer("head.1", hidden, 0)?;
        let n_modes = n_out / MODE_OUTPUTS;
        if n_out % MODE_OUTPUTS != 0 || n_modes > PATH_MODES_MAX {
            return Err(Error::invalid(format!(
                "tensor head.1.weight has {n_out} outputs, {MODE_OUTPUTS} for each of 1 to {PATH_MODES_MAX} modes are expected"
            )));
        }
        let calibration = [tensors.factors("calibration.s")?, tensors.factors("calibration.d")?];
        let [temperature] = tensors.optional_values("calibration.temperature", [1.0])?;
        if temperature <= 0.0 {
            return Err(Error::invalid("tensor calibration.temperature must be one positive number"));
        }
        let motion_smoothness = [
            tensors.optional_values("calibration.evenness_s", [0.0; 1 + N_SMOOTHNESS])?,
            tensors.optional_values("calibration.evenness_d", [0.0; 1 + N_SMOOTHNESS])?,
        ];
        let dead_zone = tensors.optional_values("decode.dead_zone", [0.0; 2])?;
        let [distance, share, moment] = tensors.optional_values("decode.merging", [0.4, 0.0, 1.0])?;
        for (name, values) in [("dead_zone", &dead_zone[..]), ("merging", &[distance, share, moment])] {
            if values.iter().any(|value| *value < 0.0) {
                return Err(Error::invalid(format!("tensor decode.{name} has negative values")));
            }
        }
        let merging = Merging { distance, share, moment };
        let [p_drives, of_drives, p_stands, of_stands] =
            tensors.optional_values("decode.tail", [0.0, 1.0, 0.0, 1.0])?;
        let tail = [(p_drives, of_drives), (p_stands, of_stands)];
        if tail.iter().any(|(probability, factor)| !(0.0..0.5).contains(probability) || *factor < 1.0) {
            return Err(Error::invalid(
                "tensor decode.tail must have probabilities below 0.5 and factors of 1 or more",
            ));
        }
        let tail = (p_drives + p_stands > 0.0).then(|| tail.map(|(probability, factor)| Tail { probability, factor }));
        if let Some(unknown) = tensors.left.first() {
            return Err(Error::invalid(format!("unknown tensor {}", unknown.name)));
        }
        Ok(Self {
            agent,
            n_agent,
            neighbour,
            path,
            path_context,
            head: [head_own, Linear::new(&weight, &bias, hidden, 0..hidden)],
            head_context,
            n_modes,
            calibration,
            motion_smoothness,
            temperature,
            dead_zone,
            merging,
            tail,
        })
    }

    /// Factors on the standard deviations along and across the path of a vehicle with these features.
    pub fn spread_of(&self, agent: &[f32]) -> [f64; 2] {
        let features = &agent[N_AGENT - N_SMOOTHNESS..];
        self.motion_smoothness.map(|weights| {
            let of_features: f64 =
                weights[1..].iter().zip(features).map(|(weight, value)| weight * f64::from(*value)).sum();
            (weights[0] + of_features).clamp(-LOG_SPREAD, LOG_SPREAD).exp()
        })
    }

    /// Outputs of every path.
    pub fn n_outputs(&self) -> usize {
        self.n_modes * MODE_OUTPUTS
    }

    /// Raw outputs of all modes of all paths: (vehicles, `N_PATHS`, modes, `MODE_OUTPUTS`), zero where a slot is empty.
    ///
    /// Features as `Inputs` has them; a neighbour whose last feature is 0 is not there. What comes out for a vehicle does
    /// not depend on the others.
    ///
    /// # Panics
    /// If the tables are not of the same number of vehicles.
    pub fn forward(&self, agent: &[f32], neighbours: &[f32], paths: &[f32], path_valid: &[bool]) -> Vec<f32> {
        let mut memory = Activations::default();
        self.run(agent, neighbours, paths, path_valid, &mut memory);
        memory.out
    }

    /// The same in memory that is reused.
    pub(super) fn run<'a>(
        &self,
        agent: &[f32],
        neighbours: &[f32],
        paths: &[f32],
        path_valid: &[bool],
        memory: &'a mut Activations,
    ) -> &'a [f32] {
        let n = agent.len() / N_AGENT;
        assert!(neighbours.len() == n * N_NEIGHBOURS * N_NEIGHBOUR, "as many neighbours as vehicles");
        assert!(paths.len() == n * N_PATHS * N_PATH && path_valid.len() == n * N_PATHS, "as many paths as vehicles");
        let Activations { context, first, hidden, shared, seen, most, index, values, out } = memory;
        let n_context = self.path_context.n_in;
        zeros(context, n * n_context);
        two_layers(&self.agent, agent, n, first, hidden);
        for (to, from) in context.chunks_exact_mut(n_context).zip(hidden.chunks_exact(self.agent[1].width)) {
            to[..self.n_agent].copy_from_slice(&from[..self.n_agent]);
        }
        gather(neighbours, N_NEIGHBOUR, |k| neighbours[(k + 1) * N_NEIGHBOUR - 1] > 0.0, index, values);
        two_layers(&self.neighbour, values, index.len(), first, hidden);
        keep_largest(hidden, self.neighbour[1].width, index, N_NEIGHBOURS, context, n_context, self.n_agent);

        gather(paths, N_PATH, |k| path_valid[k], index, values);
        self.path_context.apply(context, n_context, n, shared);
        repeat(shared, self.path_context.width, index, hidden);
        self.path[0].add(values, N_PATH, index.len(), hidden);
        relu(hidden);
        self.path[1].apply(hidden, self.path[0].width, index.len(), seen);
        relu(seen);

        let (n_path, width) = (self.head[0].n_in, self.path[1].width);
        zeros(most, n * n_path);
        keep_largest(seen, width, index, N_PATHS, most, n_path, 0);
        self.head_context.apply(most, n_path, n, shared);
        repeat(shared, self.head_context.width, index, hidden);
        self.head[0].add(seen, width, index.len(), hidden);
        relu(hidden);
        self.head[1].apply(hidden, self.head[0].width, index.len(), seen);

        let n_outputs = self.n_outputs();
        zeros(out, n * N_PATHS * n_outputs);
        for (k, values) in index.iter().zip(seen.chunks_exact(self.head[1].width)) {
            out[k * n_outputs..][..n_outputs].copy_from_slice(&values[..n_outputs]);
        }
        out
    }
}

/// Memory of the layers.
#[derive(Debug, Default)]
pub(super) struct Activations {
    context: Vec<f32>,
    first: Vec<f32>,
    hidden: Vec<f32>,
    shared: Vec<f32>,
    seen: Vec<f32>,
    most: Vec<f32>,
    index: Vec<usize>,
    values: Vec<f32>,
    out: Vec<f32>,
}

fn zeros(table: &mut Vec<f32>, n: usize) {
    table.clear();
    table.resize(n, 0.0);
}

/// Both layers with their rectifiers, for dense rows of inputs, by way of `first`.
fn two_layers(layers: &[Linear; 2], inputs: &[f32], n_rows: usize, first: &mut Vec<f32>, second: &mut Vec<f32>) {
    layers[0].apply(inputs, layers[0].n_in, n_rows, first);
    relu(first);
    layers[1].apply(first, layers[0].width, n_rows, second);
    relu(second);
}

/// Indices of the rows that are there, and those rows, dense.
fn gather(
    table: &[f32],
    width: usize,
    is_there: impl Fn(usize) -> bool,
    index: &mut Vec<usize>,
    values: &mut Vec<f32>,
) {
    index.clear();
    index.extend((0..table.len() / width).filter(|k| is_there(*k)));
    values.clear();
    for k in &*index {
        values.extend_from_slice(&table[k * width..(k + 1) * width]);
    }
}

/// The row of the vehicle for each of its paths.
fn repeat(shared: &[f32], width: usize, index: &[usize], out: &mut Vec<f32>) {
    out.clear();
    for k in index {
        out.extend_from_slice(&shared[k / N_PATHS * width..][..width]);
    }
}

/// Writes the largest values of all rows of a vehicle, or 0, into its row from a column on; `per_vehicle` slots each.
fn keep_largest(
    rows: &[f32],
    width: usize,
    index: &[usize],
    per_vehicle: usize,
    out: &mut [f32],
    out_width: usize,
    column: usize,
) {
    for (k, values) in index.iter().zip(rows.chunks_exact(width)) {
        let to = &mut out[k / per_vehicle * out_width..][column..out_width];
        // What is not a number is kept: such a vehicle is left to constant velocity.
        for (most, value) in to.iter_mut().zip(values) {
            *most = if *value > *most || value.is_nan() { *value } else { *most };
        }
    }
}
