//! A neural predictor that answers in path coordinates: the network learns speeds, lateral settling and which path is
//! taken, while the geometry of the road stays exact.

mod candidate_path;
mod decode;
mod motion_smoothness;
mod feature_table;
mod features;
#[cfg(test)]
mod forecast_tests;
mod history;
mod index;
mod inputs;
mod network;
mod paths;
mod profile;
mod surroundings;
mod tail;
mod traffic;
#[cfg(test)]
mod tests;

pub use candidate_path::CandidatePath;
pub use feature_table::{
    Feature, MIRRORED_COLUMNS, N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH, VERSION, agent_features, neighbour_features,
    path_features,
};
pub use inputs::{Inputs, KNOT_TIME, N_KNOTS, Settling};
pub use network::{MODE_OUTPUTS, Network, Tensor};
pub use paths::{FREE, LEFT, N_OWN, N_PATHS, RIGHT, SLOTS};

use std::sync::Arc;

use super::{PREDICTED_STANDING_SPEED, STRAIGHT, go_straight, rows_of, stand};
use crate::road::RoadNetwork;
use crate::scene::Scene;
use crate::trajectory::{Predictions, State};
use crate::vehicle::ParticipantKind;
use decode::{Modes, Vehicle};
use network::Activations;
use surroundings::Surroundings;

/// Vehicles whose paths are held and computed at once.
const BATCH: usize = 8;
/// Standard deviation of the position of a pedestrian now [m], and its growth [m/s]: pedestrians turn at will.
const PEDESTRIAN_SIGMA: (f64, f64) = (0.15, 0.3);

/// Settings of the neural predictor.
#[derive(Debug, Clone)]
pub struct Neural {
    /// The network.
    pub network: Arc<Network>,
    /// Number of modes of a vehicle at most, without the wide one; the most probable ones are kept.
    pub modes_max: usize,
}

impl Neural {
    /// Modes of the tables, with the wide one.
    fn n_modes(&self) -> usize {
        self.modes_max + usize::from(self.network.tail.is_some())
    }
}

/// Predictions for all participants present. Vehicles are predicted by the network; static obstacles stay, pedestrians
/// and reversing vehicles go straight on. Participants with a state that is not a number get no prediction.
///
/// The result depends neither on the number of threads nor on the other vehicles of the batch.
pub(super) fn predict(
    settings: &Neural,
    scene: &Scene,
    road: &RoadNetwork,
    n_steps: usize,
    (memory, each): (&super::Memory, super::Each<'_>),
) -> Predictions {
    let n_modes = settings.n_modes();
    let ids: Vec<i64> = scene.present.iter().map(|row| scene.participants.ids[*row]).collect();
    let mut out = Predictions::zeros(scene.time_step, ids, n_modes, n_steps);
    let surroundings = Surroundings::of(scene);
    let parts = out.parts(BATCH);
    each(parts.len(), &|part| {
        memory.with(|scratch| {
            let (table, scratch) = (&mut scratch.table, &mut scratch.neural);
            let present = rows_of(scene, part, BATCH);
            table.clear(scene.time_step, present.len(), n_modes, n_steps);
            scratch.answer(&settings.network, present, (scene, road), &surroundings, table);
            parts.copy_from(part, table);
        });
    });
    drop(parts);
    out
}

/// Memory of a thread.
#[derive(Debug, Default)]
pub(super) struct NeuralMemory {
    inputs: Inputs,
    paths: paths::Memory,
    valid: Vec<bool>,
    activations: Activations,
    modes: Modes,
}

impl NeuralMemory {
    /// Writes expectations for some of those present.
    fn answer(
        &mut self,
        network: &Network,
        present: &[usize],
        (scene, road): (&Scene, &RoadNetwork),
        surroundings: &Surroundings,
        out: &mut Predictions,
    ) {
        let Self { inputs, paths, valid, activations, modes } = self;
        let asked = present.iter().copied().filter(|row| Inputs::has(*row, scene));
        inputs.become_of(asked, (scene, road), surroundings, paths);
        valid.clear();
        valid.extend(inputs.candidates.iter().flatten().map(Option::is_some));
        let outputs = network.run(&inputs.agent, &inputs.neighbours, &inputs.paths, valid, activations);
        let mut outputs = outputs.chunks_exact(N_PATHS * network.n_outputs()).enumerate();
        for (i, row) in present.iter().copied().enumerate() {
            let is_decoded = inputs.rows.binary_search(&row).is_ok() && {
                let (k, outputs) = outputs.next().expect("an answer for every vehicle in question");
                Vehicle::new(scene, inputs, k).decode(network, outputs, out, i, scene.dt, modes)
            };
            if !is_decoded {
                without_network(out, i, row, scene);
            }
        }
    }
}

/// Straight on, or standing.
fn without_network(out: &mut Predictions, i: usize, row: usize, scene: &Scene) {
    let now = scene.state(row);
    if !now.is_finite() {
        return;
    }
    let is_static = scene.participants.is_static[row];
    let state = State { velocity: scene.observed_velocity(row), ..now };
    if is_static || state.velocity.abs() < PREDICTED_STANDING_SPEED {
        return stand(out, i, &state);
    }
    go_straight(out, i, (&state, 0.0), &STRAIGHT, scene.dt);
    if scene.participants.kind[row] == ParticipantKind::Pedestrian {
        let start = out.offset(i, 0);
        for step in 0..out.n_steps {
            let sigma = PEDESTRIAN_SIGMA.0 + PEDESTRIAN_SIGMA.1 * (step + 1) as f64 * scene.dt;
            (out.covariance_xx[start + step], out.covariance_yy[start + step]) = (sigma * sigma, sigma * sigma);
            out.covariance_xy[start + step] = 0.0;
        }
    }
}
