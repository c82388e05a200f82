//! Worlds with learners that drive straight on, for tests and measurements.

use std::sync::Arc;

use interdrive_core::observation::{ObservationSettings, PIXELS, layout};
use interdrive_core::plan::Planner;
use interdrive_core::plan::learned::ActionSpace;
use interdrive_core::predict::{LaneFollowing, Predictor};
use interdrive_core::vehicle::single_track::Kinematic;
use interdrive_core::world::StepSettings;
use interdrive_core::worlds::{
    Actions, Autoreset, Buffers, EpisodeSpec, N_TERMS, RewardWeights, Stage, Worlds, WorldsSettings,
};

use super::shipped;

/// The caller's arrays.
pub struct Arrays {
    /// Slow, so that episodes last.
    actions: Vec<f32>,
    observations: Vec<f32>,
    rasters: Vec<u8>,
    rewards: Vec<f32>,
    /// Terminals, truncations, masks.
    pub flags: [Vec<bool>; 3],
    outcomes: Vec<i8>,
    agent_ids: Vec<i64>,
    components: Vec<f32>,
}

impl Arrays {
    /// For so many rows.
    pub fn new(rows: usize, observation: &ObservationSettings) -> Self {
        let n = layout::length(observation);
        let pixels = if observation.raster { PIXELS } else { 0 };
        Self {
            actions: [-0.1, 0.0].repeat(rows),
            observations: vec![0.0; rows * n],
            rasters: vec![0; rows * pixels],
            rewards: vec![0.0; rows],
            flags: std::array::from_fn(|_| vec![false; rows]),
            outcomes: vec![0; rows],
            agent_ids: vec![0; rows],
            components: vec![0.0; rows * N_TERMS],
        }
    }

    /// As the core takes them.
    pub fn buffers(&mut self) -> Buffers<'_> {
        let [terminals, truncations, masks] = &mut self.flags;
        Buffers {
            actions: Actions::Numbers(&self.actions, 2),
            observations: &mut self.observations,
            rewards: &mut self.rewards,
            terminals,
            truncations,
            masks,
            outcomes: &mut self.outcomes,
            agent_ids: &mut self.agent_ids,
            components: &mut self.components,
            rasters: &mut self.rasters,
            final_observations: &mut [],
            final_rasters: &mut [],
        }
    }
}

/// All vehicles at the T-junction as learners to be.
pub fn stage() -> Arc<Stage> {
    let (scenario, agents) = shipped::cast(shipped::T_JUNCTION, 8, &Planner::External);
    let players = agents.into_iter().map(|agent| (agent, None)).collect();
    Arc::new(Stage::new(scenario, players, &Planner::External).expect("a stage"))
}

/// Worlds that begin anew by themselves after so many steps.
pub fn worlds(
    stage: &Arc<Stage>,
    (n, learners): (usize, usize),
    steps: usize,
    threads: usize,
    observation: ObservationSettings,
) -> Worlds {
    let settings = WorldsSettings {
        actions: ActionSpace::Kinematic(Kinematic::default()),
        observation,
        rewards: RewardWeights::default(),
        step: StepSettings::default(),
        predictor: Predictor::LaneFollowing(LaneFollowing::default()),
        horizon: 3.0,
        decision_seconds: 0.1,
        max_seconds: 0.1 * steps as f64,
        time_limit_terminates: false,
        autoreset: Autoreset::SameStep,
        record: false,
        threads,
    };
    Worlds::new(vec![Arc::clone(stage)], settings, n, learners).expect("worlds")
}

/// Queues an episode of the last vehicles for every world that has none.
pub fn refill(worlds: &mut Worlds, learners: usize) {
    let n = worlds.stages()[0].ids().count();
    for world in worlds.hungry() {
        let spec = EpisodeSpec { learners: (n - learners..n).collect(), ..EpisodeSpec::default() };
        worlds.queue(world, spec).expect("an episode");
    }
}
