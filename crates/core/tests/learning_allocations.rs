//! Memory that worlds with learners allocate once they are warm: none while episodes last.

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

mod counting;
mod shipped;

use counting::allocations;

/// The caller's arrays.
struct Arrays {
    actions: Vec<f32>,
    observations: Vec<f32>,
    rasters: Vec<u8>,
    rewards: Vec<f32>,
    flags: [Vec<bool>; 3],
    outcomes: Vec<i8>,
    agent_ids: Vec<i64>,
    components: Vec<f32>,
}

impl Arrays {
    fn new(rows: usize, observation: &ObservationSettings) -> Self {
        let n = layout::length(observation);
        let pixels = if observation.raster { PIXELS } else { 0 };
        Self {
            // Slow, so that episodes last.
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

    fn buffers(&mut self) -> Buffers<'_> {
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

/// Allocations of a step within episodes, and of those in which all worlds begin anew, or have just begun and keep their
/// first plans: the most over some steps after warm-up with one thread, the least with more.
fn taken(stage: &Arc<Stage>, learners: usize, threads: usize, observation: ObservationSettings) -> (usize, usize) {
    const WORLDS: usize = 8;
    const EPISODE: usize = 10;
    let settings = WorldsSettings {
        actions: ActionSpace::Kinematic(Kinematic::default()),
        observation,
        rewards: RewardWeights::default(),
        step: StepSettings::default(),
        predictor: Predictor::LaneFollowing(LaneFollowing::default()),
        horizon: 3.0,
        decision_seconds: 0.1,
        max_seconds: 0.1 * EPISODE as f64,
        time_limit_terminates: false,
        autoreset: Autoreset::SameStep,
        record: false,
        threads,
    };
    let mut worlds = Worlds::new(vec![Arc::clone(stage)], settings, WORLDS, learners).expect("worlds");
    let mut arrays = Arrays::new(WORLDS * learners, &observation);
    let first = (stage.ids().count() - learners..stage.ids().count()).collect::<Vec<_>>();
    let refill = |worlds: &mut Worlds| {
        for world in worlds.hungry() {
            let spec = EpisodeSpec { learners: first.clone(), ..EpisodeSpec::default() };
            worlds.queue(world, spec).expect("an episode");
        }
    };
    refill(&mut worlds);
    worlds.reset(&[true; WORLDS], arrays.buffers()).expect("a reset");
    refill(&mut worlds);
    let (mut driving, mut beginning) = (None, None);
    for step in 0..6 * EPISODE {
        let before = allocations();
        worlds.step(arrays.buffers()).expect("a step");
        let now = allocations() - before;
        let begins = step % EPISODE == EPISODE - 1 || step % EPISODE == 0;
        assert_eq!(arrays.flags[1].iter().all(|cut| *cut), step % EPISODE == EPISODE - 1);
        assert!(!arrays.flags[0].iter().any(|ended| *ended), "no learner is to end in a second");
        refill(&mut worlds);
        if step >= 2 * EPISODE {
            let kept = if begins { &mut beginning } else { &mut driving };
            let before: usize = kept.unwrap_or(now);
            *kept = Some(if threads == 1 { before.max(now) } else { before.min(now) });
        }
    }
    (driving.expect("steps"), beginning.expect("resets"))
}

/// One test, so that nothing else allocates meanwhile.
#[test]
#[allow(clippy::print_stdout, reason = "to lower the numbers you need to see them: --nocapture")]
fn a_step_of_learners_among_recorded_vehicles_allocates_nothing() {
    let (scenario, agents) = shipped::cast(shipped::T_JUNCTION, 8, &Planner::External);
    let players = agents.into_iter().map(|agent| (agent, None)).collect();
    let stage = Arc::new(Stage::new(scenario, players, &Planner::External).expect("a stage"));
    let usual = ObservationSettings::default();
    let all = ObservationSettings { edges: 32, raster: true, ..usual };
    for (learners, threads, observation) in
        [(1, 1, usual), (8, 1, usual), (1, 2, usual), (8, 2, usual), (8, 1, all), (8, 2, all)]
    {
        let (driving, beginning) = taken(&stage, learners, threads, observation);
        println!("{learners} learners, {threads} threads: {driving} per step, {beginning} if 8 worlds begin anew");
        // Two threads share a list of worlds, made anew in every step.
        assert!(driving <= [0, 2][threads - 1], "{learners} learners, {threads} threads: {driving}");
    }
}
