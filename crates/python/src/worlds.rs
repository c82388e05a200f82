//! Many worlds in which agents learn, and the caller's arrays, which only this module writes.

use std::sync::Arc;

use interdrive_core::observation::{LAYERS, ObservationSettings, SIDE};
use interdrive_core::plan::Planner;
use interdrive_core::world::Agent;
use interdrive_core::worlds::{
    Actions, Autoreset, Buffers, Ended, EpisodeSpec, N_TERMS, RewardWeights, Stage, Worlds, WorldsSettings,
};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{InputError, detached, exception};
use crate::getters::getters;
use crate::planner::{PyPlanner, action_space};
use crate::predictor::PyPredictor;
use crate::scenario::PyScenario;
use crate::settings::read;
use crate::world::{PyAgent, all_states_dict, outcomes_dict, plans_dict};

#[pyclass(frozen, name = "Stage", module = "interdrive._core")]
pub struct PyStage(pub Arc<Stage>);

#[pymethods]
impl PyStage {
    /// A scenario with the vehicles that can learn, each with the planner that drives it if it does not; `learning`
    /// drives the learners by their actions.
    #[new]
    #[pyo3(signature = (scenario, agents, planners, learning=None))]
    fn new(
        py: Python<'_>,
        scenario: &PyScenario,
        agents: Vec<PyRef<'_, PyAgent>>,
        planners: Vec<Option<PyRef<'_, PyPlanner>>>,
        learning: Option<PyRef<'_, PyPlanner>>,
    ) -> PyResult<Self> {
        let learning = learning.map_or(Planner::External, |planner| planner.0.clone());
        let planners = planners.iter().map(|planner| planner.as_ref().map(|planner| planner.0.clone()));
        let agents: Vec<_> = agents.iter().map(|agent| Agent::clone(&agent.0)).zip(planners).collect();
        let scenario = Arc::clone(&scenario.0);
        detached(py, || Stage::new(scenario, agents, &learning)).map(|stage| Self(Arc::new(stage)))
    }

    /// What a recorded driver did as inputs of a model, shape (time steps, 2), and where they lead to the next state.
    fn recorded_actions<'py>(
        &self,
        py: Python<'py>,
        position: usize,
        model: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyAny>, arrays::Row<'py, bool>)> {
        let (inputs, valid) = self.0.recorded_actions(position, &read(model)?);
        let n = valid.len();
        Ok((arrays::grid(py, inputs, [n, 2])?, arrays::row(py, valid)))
    }

    /// Positions of the vehicles that drive at a time step; with at least `rest` steps of their recording left.
    fn eligible(&self, time_step: i64, rest: i64) -> Vec<usize> {
        self.0.eligible(time_step, rest)
    }

    /// Positions of the vehicles that enter after a time step; with at least `rest` steps of their recording from then on.
    fn later(&self, time_step: i64, rest: i64) -> Vec<usize> {
        self.0.later(time_step, rest)
    }
}

getters! { PyStage {
    /// Ids of the vehicles that can learn, ascending.
    ids: Vec<i64> = |this| this.0.ids().collect();
} }

/// An array of the caller that can be written in place.
fn bound<T: Element>(name: &str, given: &Bound<'_, PyAny>, shape: &[usize]) -> PyResult<Py<PyArrayDyn<T>>> {
    let refused = |text: String| InputError::new_err((format!("buf.{name}"), text));
    let Ok(array) = given.cast::<PyUntypedArray>() else { return Err(refused("an array is expected".into())) };
    let expected = dtype::<T>(given.py());
    if !array.dtype().is_equiv_to(&expected) {
        return Err(refused(format!("{} given, {} expected", array.dtype(), expected)));
    }
    if array.shape() != shape {
        return Err(refused(format!("shape {:?} given, {shape:?} expected", array.shape())));
    }
    if !array.is_c_contiguous() {
        return Err(refused("not C-contiguous".into()));
    }
    let array = given.cast::<PyArrayDyn<T>>()?;
    if array.try_readwrite().is_err() {
        return Err(refused("read-only".into()));
    }
    Ok(array.clone().unbind())
}

enum ActionArray {
    Numbers(Py<PyArrayDyn<f32>>, usize),
    Choices(Py<PyArrayDyn<i32>>),
}

struct Arrays {
    actions: ActionArray,
    observations: Py<PyArrayDyn<f32>>,
    rewards: Py<PyArrayDyn<f32>>,
    terminals: Py<PyArrayDyn<bool>>,
    truncations: Py<PyArrayDyn<bool>>,
    masks: Py<PyArrayDyn<bool>>,
    outcomes: Py<PyArrayDyn<i8>>,
    agent_ids: Py<PyArrayDyn<i64>>,
    components: Option<Py<PyArrayDyn<f32>>>,
    raster: Option<Py<PyArrayDyn<u8>>>,
    final_observations: Option<Py<PyArrayDyn<f32>>>,
    final_raster: Option<Py<PyArrayDyn<u8>>>,
}

type Written<'py, T> = PyReadwriteArrayDyn<'py, T>;

fn written<'py, T: Element>(py: Python<'py>, array: &Py<PyArrayDyn<T>>) -> PyResult<Written<'py, T>> {
    array.bind(py).try_readwrite().map_err(|_| InputError::new_err("an array of the environment cannot be written"))
}

fn slice<'a, T: Element>(array: &'a mut Option<Written<'_, T>>) -> &'a mut [T] {
    array.as_mut().and_then(|array| array.as_slice_mut().ok()).unwrap_or_default()
}

#[pyclass(name = "Worlds", module = "interdrive._core")]
pub struct PyWorlds {
    worlds: Worlds,
    arrays: Option<Arrays>,
}

/// Row, agent, scenario, outcome, truncated, partner, off road, impact speed; steps, seconds, distance, progress, return
/// and components.
type EndedParts = ((usize, i64, usize, i64, bool, i64, bool, f64), (usize, f64, f64, f64, f64, Vec<f64>));

fn parts(ended: &Ended) -> EndedParts {
    let impact_speed = if ended.impact_speed.is_nan() { 0.0 } else { ended.impact_speed };
    (
        (
            ended.row,
            ended.agent_id,
            ended.stage,
            ended.outcome as i64,
            ended.truncated,
            ended.partner.unwrap_or(-1),
            ended.off_road,
            impact_speed,
        ),
        (ended.steps, ended.seconds, ended.distance, ended.progress, ended.total, ended.components.to_vec()),
    )
}

impl PyWorlds {
    fn run(
        &mut self,
        py: Python<'_>,
        work: impl FnOnce(&mut Worlds, Buffers<'_>) -> interdrive_core::error::Result<()> + Send,
    ) -> PyResult<()> {
        let Self { worlds, arrays } = self;
        let arrays = arrays.as_ref().ok_or_else(|| InputError::new_err("worlds: no arrays are bound"))?;
        let (mut numbers, mut choices) = (None, None);
        let mut size = 0;
        match &arrays.actions {
            ActionArray::Numbers(array, n) => (numbers, size) = (Some(written(py, array)?), *n),
            ActionArray::Choices(array) => choices = Some(written(py, array)?),
        }
        let (mut observations, mut rewards) =
            (Some(written(py, &arrays.observations)?), Some(written(py, &arrays.rewards)?));
        let (mut terminals, mut truncations) =
            (Some(written(py, &arrays.terminals)?), Some(written(py, &arrays.truncations)?));
        let mut masks = Some(written(py, &arrays.masks)?);
        let (mut outcomes, mut agent_ids) =
            (Some(written(py, &arrays.outcomes)?), Some(written(py, &arrays.agent_ids)?));
        let mut components = arrays.components.as_ref().map(|array| written(py, array)).transpose()?;
        let mut raster = arrays.raster.as_ref().map(|array| written(py, array)).transpose()?;
        let mut final_observations = arrays.final_observations.as_ref().map(|array| written(py, array)).transpose()?;
        let mut final_raster = arrays.final_raster.as_ref().map(|array| written(py, array)).transpose()?;
        let actions = match &arrays.actions {
            ActionArray::Numbers(..) => Actions::Numbers(slice(&mut numbers), size),
            ActionArray::Choices(_) => Actions::Choices(slice(&mut choices)),
        };
        let buffers = Buffers {
            actions,
            observations: slice(&mut observations),
            rewards: slice(&mut rewards),
            terminals: slice(&mut terminals),
            truncations: slice(&mut truncations),
            masks: slice(&mut masks),
            outcomes: slice(&mut outcomes),
            agent_ids: slice(&mut agent_ids),
            components: slice(&mut components),
            rasters: slice(&mut raster),
            final_observations: slice(&mut final_observations),
            final_rasters: slice(&mut final_raster),
        };
        detached(py, || work(worlds, buffers))
    }
}

#[pymethods]
impl PyWorlds {
    #[new]
    #[pyo3(signature = (
        stages, *, actions, observation, reward, step, predictor, horizon, decision_seconds, max_seconds,
        time_limit_terminates, autoreset, record, threads, num_worlds, slots
    ))]
    fn new(
        stages: Vec<PyRef<'_, PyStage>>,
        actions: (String, Bound<'_, PyAny>, Vec<usize>),
        observation: &Bound<'_, PyAny>,
        reward: &Bound<'_, PyAny>,
        step: &Bound<'_, PyAny>,
        predictor: &PyPredictor,
        horizon: f64,
        decision_seconds: f64,
        max_seconds: f64,
        time_limit_terminates: bool,
        autoreset: &str,
        record: bool,
        threads: usize,
        num_worlds: usize,
        slots: usize,
    ) -> PyResult<Self> {
        let settings = WorldsSettings {
            actions: action_space(&actions.0, &actions.1, actions.2)?,
            observation: read::<ObservationSettings>(observation)?,
            rewards: read::<RewardWeights>(reward)?,
            step: read(step)?,
            predictor: predictor.0.clone(),
            horizon,
            decision_seconds,
            max_seconds,
            time_limit_terminates,
            autoreset: match autoreset {
                "next_step" => Autoreset::NextStep,
                "same_step" => Autoreset::SameStep,
                "disabled" => Autoreset::Disabled,
                _ => return Err(InputError::new_err(format!("autoreset: unknown mode {autoreset:?}"))),
            },
            record,
            threads,
        };
        let stages = stages.iter().map(|stage| Arc::clone(&stage.0)).collect();
        let worlds = Worlds::new(stages, settings, num_worlds, slots).map_err(exception)?;
        Ok(Self { worlds, arrays: None })
    }

    /// Worlds that go on by themselves from here, to the same bits; no arrays are bound to them.
    fn copy(&self, py: Python<'_>) -> Self {
        let worlds = &self.worlds;
        Self { worlds: py.detach(|| worlds.clone()), arrays: None }
    }

    /// Checks the caller's arrays once and keeps them: every reset and step writes into them.
    #[pyo3(signature = (
        *, actions, observations, rewards, terminals, truncations, masks, outcomes, agent_ids, components=None,
        raster=None, final_observations=None, final_raster=None
    ))]
    fn bind(
        &mut self,
        actions: &Bound<'_, PyAny>,
        observations: &Bound<'_, PyAny>,
        rewards: &Bound<'_, PyAny>,
        terminals: &Bound<'_, PyAny>,
        truncations: &Bound<'_, PyAny>,
        masks: &Bound<'_, PyAny>,
        outcomes: &Bound<'_, PyAny>,
        agent_ids: &Bound<'_, PyAny>,
        components: Option<&Bound<'_, PyAny>>,
        raster: Option<&Bound<'_, PyAny>>,
        final_observations: Option<&Bound<'_, PyAny>>,
        final_raster: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (rows, n) = (self.worlds.n_rows(), self.worlds.settings().n_observations());
        let actions = match self.worlds.settings().actions.size() {
            Some(size) => ActionArray::Numbers(bound("actions", actions, &[rows, size])?, size),
            None => ActionArray::Choices(bound("actions", actions, &[rows])?),
        };
        self.arrays = Some(Arrays {
            actions,
            observations: bound("observations", observations, &[rows, n])?,
            rewards: bound("rewards", rewards, &[rows])?,
            terminals: bound("terminals", terminals, &[rows])?,
            truncations: bound("truncations", truncations, &[rows])?,
            masks: bound("masks", masks, &[rows])?,
            outcomes: bound("outcomes", outcomes, &[rows])?,
            agent_ids: bound("agent_ids", agent_ids, &[rows])?,
            components: components.map(|array| bound("components", array, &[rows, N_TERMS])).transpose()?,
            raster: raster.map(|array| bound("raster", array, &[rows, LAYERS, SIDE, SIDE])).transpose()?,
            final_observations: final_observations
                .map(|array| bound("final_observations", array, &[rows, n]))
                .transpose()?,
            final_raster: final_raster
                .map(|array| bound("final_raster", array, &[rows, LAYERS, SIDE, SIDE]))
                .transpose()?,
        });
        Ok(())
    }

    /// Queues the next episode of a world; `planners` are those of its own, with the positions that they drive, and
    /// `generated` vehicles that drive besides.
    #[pyo3(signature = (world, stage, first_time_step, learners, planners=Vec::new(), generated=Vec::new()))]
    fn queue(
        &mut self,
        world: usize,
        stage: usize,
        first_time_step: i64,
        learners: Vec<usize>,
        planners: Vec<(usize, PyRef<'_, PyPlanner>)>,
        generated: Vec<PyRef<'_, PyAgent>>,
    ) -> PyResult<()> {
        let planners = planners.into_iter().map(|(position, planner)| (position, planner.0.clone())).collect();
        let generated = generated.iter().map(|agent| Arc::clone(&agent.0)).collect();
        let spec = EpisodeSpec { stage, first_time_step, learners, planners, generated };
        self.worlds.queue(world, spec).map_err(exception)
    }

    /// Begins the queued episodes of the worlds for which it is true.
    fn reset(&mut self, py: Python<'_>, worlds: Vec<bool>) -> PyResult<()> {
        self.run(py, |all, buffers| all.reset(&worlds, buffers))
    }

    /// One decision of every learner, as the bound actions say.
    fn step(&mut self, py: Python<'_>) -> PyResult<()> {
        self.run(py, Worlds::step)
    }

    /// Other weights of the reward from now on.
    fn set_rewards(&mut self, reward: &Bound<'_, PyAny>) -> PyResult<()> {
        self.worlds.set_rewards(read(reward)?).map_err(exception)
    }

    /// Other scenarios for the episodes that are queued from now on.
    fn set_stages(&mut self, stages: Vec<PyRef<'_, PyStage>>) -> PyResult<()> {
        let stages = stages.iter().map(|stage| Arc::clone(&stage.0)).collect();
        self.worlds.set_stages(stages).map_err(exception)
    }

    /// Information about the learners that ended in the last call.
    fn ended(&self) -> Vec<EndedParts> {
        self.worlds.ended().map(parts).collect()
    }

    /// Outcomes of all agents of a world as a dict of arrays, sorted by id.
    fn outcomes<'py>(&self, py: Python<'py>, world: usize) -> PyResult<Bound<'py, PyDict>> {
        outcomes_dict(py, self.worlds.world(world).map_err(exception)?)
    }

    /// Participants of a world and their states as a dict of arrays.
    fn states<'py>(&self, py: Python<'py>, world: usize) -> PyResult<Bound<'py, PyDict>> {
        all_states_dict(py, self.worlds.world(world).map_err(exception)?)
    }

    /// All plans of a world as a dict of arrays.
    fn plans<'py>(&self, py: Python<'py>, world: usize) -> PyResult<Bound<'py, PyDict>> {
        plans_dict(py, self.worlds.world(world).map_err(exception)?.recording().plans().clone())
    }
}

getters! { PyWorlds {
    /// Number of rows: worlds times rows of each.
    num_rows: usize = |this| this.worlds.n_rows();
    /// Numbers of an observation.
    num_observations: usize = |this| this.worlds.settings().n_observations();
    /// Names of what learners observe about their planner; empty without one.
    observed: Vec<String> = |this| this.worlds.settings().actions.observed();
    /// Worlds without a queued episode, ascending.
    hungry: Vec<usize> = |this| this.worlds.hungry();
} }

/// Names of the terms of a reward; layers, rows and columns of a picture.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("REWARDS", RewardWeights::NAMES.to_vec())?;
    module.add("RASTER", (LAYERS, SIDE, SIDE))?;
    module.add_class::<PyStage>()?;
    module.add_class::<PyWorlds>()
}
