//! A neural predictor that answers in path coordinates: the network learns speeds, lateral settling and which path is
//! taken, while the geometry of the road stays exact.

mod features;
mod history;
mod inputs;
mod paths;
mod surroundings;
#[cfg(test)]
mod tests;

pub use features::{
    Feature, MIRRORED_COLUMNS, N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH, VERSION, agent_features, neighbour_features,
    path_features,
};
pub use inputs::{Inputs, KNOT_TIME, N_KNOTS};
pub use paths::{CandidatePath, FREE, LEFT, N_OWN, N_PATHS, RIGHT, SLOTS};
