//! One world: an episode from its first step to the end of its last learner.

mod judging;
mod observing;

use std::sync::Arc;

use super::rewards::{Amounts, N_TERMS};
use super::stage::{Cast, Stage};
use super::{Actions, EpisodeSpec, Rows, WorldsSettings};
use crate::error::{Error, Result};
use crate::observation::{self, ObservationMemory, ObservationSettings, ObservedBody, PathTable, present_bodies};
use crate::plan::Planner;
use crate::plan::frenet::CostWeights;
use crate::plan::learned::{Action, ActionSpace};
use crate::plan::weights::WeightActions;
use crate::recording::OutcomeKind;
use crate::scene::PositionIndex;
use crate::trajectory::{PlanStatus, Plans, State};
use crate::world::{Forecast, Step, StepMemory, StepSettings, World, WorldSettings};

/// Past time steps in a scene, so that speeds can be observed.
const HISTORY: usize = 3;
/// Shortest way to the goal that progress is measured by [m].
const WAY_MIN: f64 = 10.0;

/// A learner in its episode.
#[derive(Debug, Clone)]
struct Learner {
    /// Position among the agents of the world.
    agent: usize,
    id: i64,
    table: Arc<PathTable>,
    /// Row of its recording.
    recorded: Option<usize>,
    /// It has not entered, but will.
    is_awaited: bool,
    has_entered: bool,
    is_driving: bool,
    /// It has ended in this call.
    has_ended: bool,
    state: State,
    limited: bool,
    /// Its action was not a number.
    is_refused: bool,
    /// Cost weights of its planner, their change in this decision, and whether its last plan was chosen, or brakes.
    weights: CostWeights,
    weight_change: f64,
    status: PlanStatus,
    /// Steps that it drove.
    steps: usize,
    /// Arc length of its centre at first, and from there to its goal [m].
    start_q: f64,
    way: f64,
    progress: f64,
    distance: f64,
    /// Sums over the episode.
    total: f64,
    components: Amounts,
}

/// A world and the state of its episode.
#[derive(Debug, Clone)]
pub(super) struct Episode {
    world: World,
    stage: Option<Arc<Stage>>,
    spec: EpisodeSpec,
    cast: Cast,
    /// Of the reward, as they were when it began.
    weights: Amounts,
    learners: Vec<Learner>,
    /// Agents with planners take part.
    has_traffic: bool,
    /// A scene is needed: predictions or pictures are made of it, or something may be hidden.
    has_scene: bool,
    /// Steps taken.
    steps: usize,
    /// The step that has begun.
    step: Step,
}

/// Memory of a call, shared by all worlds of a thread, so that it stays near the processor.
#[derive(Debug, Default, Clone)]
pub(super) struct CallMemory {
    /// Participants that are there, behind them agents that have ended in this step.
    bodies: Vec<ObservedBody>,
    /// Rows and positions of those that are there.
    present: Vec<usize>,
    index: PositionIndex,
    /// Places among the bodies of those that an observer sees.
    seen: Vec<usize>,
    observation: ObservationMemory,
    step: StepMemory,
}

impl Episode {
    /// A world without an episode.
    pub(super) fn new(stage: &Stage, settings: &WorldsSettings) -> Result<Self> {
        let drawn = if settings.observation.raster { observation::past_steps(0.1) } else { 0 };
        // Pictures show the past, too.
        let step = StepSettings { history_steps: settings.step.history_steps.max(drawn), ..settings.step };
        let world_settings = WorldSettings { step, keep_recording: settings.record, ..WorldSettings::default() };
        let world = World::empty(Arc::clone(&stage.scenario), world_settings)?;
        Ok(Self {
            step: Step::begin(&world),
            world,
            stage: None,
            spec: EpisodeSpec::default(),
            cast: Cast::default(),
            weights: [0.0; N_TERMS],
            learners: Vec::new(),
            has_traffic: false,
            has_scene: true,
            steps: 0,
        })
    }

    /// The world as it is.
    pub(super) fn world(&self) -> &World {
        &self.world
    }

    /// It has an episode of which no learner drives any more or is still to enter, or none.
    pub(super) fn is_over(&self) -> bool {
        !self.learners.iter().any(|learner| learner.is_driving || learner.is_awaited)
    }

    fn is_any_agent_driving(&self) -> bool {
        self.learners.iter().any(|learner| learner.is_driving)
    }

    /// It has begun once.
    pub(super) fn has_begun(&self) -> bool {
        self.stage.is_some()
    }

    /// Begins an episode, at the time step at which the first of its learners drives.
    ///
    /// # Errors
    /// `InvalidInput` if a learner has left by its first step, or all enter after the end of the world; those of
    /// prediction.
    pub(super) fn begin(
        &mut self,
        stage: &Arc<Stage>,
        spec: EpisodeSpec,
        settings: &WorldsSettings,
        memory: &mut CallMemory,
    ) -> Result<()> {
        stage.cast(&spec, self.world.threads(), &mut self.cast)?;
        // Without others that drive, nothing that is seen later happens before the first learner enters.
        let first = match self.cast.has_traffic() {
            true => spec.first_time_step,
            false => self.cast.first_start().unwrap_or(spec.first_time_step),
        };
        self.world.restart(&stage.scenario, &self.cast.agents, first);
        self.has_traffic = self.cast.agents.iter().any(|staged| staged.agent.planner != Planner::External);
        let ObservationSettings { raster, predictions, .. } = settings.observation;
        let is_flat = self.world.participants().storeys.is_flat();
        let is_open = is_flat && !self.world.agents().any(|one| one.view.occlusion || one.view.missed > 0.0);
        self.has_scene = self.has_traffic || raster || predictions || !is_open;
        self.learners.clear();
        for ((agent, table), recorded) in self.cast.learners.drain(..).zip(&self.cast.recorded) {
            let driver = self.world.driver(agent);
            let route = &driver.agent.route;
            let start_q = driver.s + driver.agent.vehicle.rear_axle_to_center;
            let goal = if route.goal_entry_s.is_nan() { route.path.length() } else { route.goal_entry_s };
            self.learners.push(Learner {
                agent,
                id: driver.agent.id,
                table,
                recorded: *recorded,
                is_awaited: true,
                has_entered: false,
                is_driving: false,
                has_ended: false,
                state: State::default(),
                limited: false,
                is_refused: false,
                weights: settings.actions.weights().map_or_else(CostWeights::default, |own| own.planner.weights),
                weight_change: 0.0,
                status: PlanStatus::None,
                steps: 0,
                start_q,
                way: (goal - start_q).max(WAY_MIN),
                progress: 0.0,
                distance: 0.0,
                total: 0.0,
                components: [0.0; N_TERMS],
            });
        }
        (self.steps, self.spec, self.weights) = (0, spec, settings.rewards.as_array());
        self.stage = Some(Arc::clone(stage));
        self.look(settings, memory);
        self.admit();
        while !self.is_any_agent_driving() && !self.is_over() {
            self.plan_traffic(settings)?;
            self.move_all(memory)?;
            self.look(settings, memory);
            self.admit();
        }
        if self.is_over() {
            return Err(Error::invalid("learners: all enter after the end of the world"));
        }
        self.expect_for_observers(settings)
    }

    /// Lets learners drive that have entered now, and returns whether there are any. Learners that would enter after
    /// the end of the world are no longer awaited.
    fn admit(&mut self) -> bool {
        let mut have_entered = false;
        for learner in self.learners.iter_mut().filter(|learner| learner.is_awaited) {
            let driver = self.world.driver(learner.agent);
            if driver.outcome.kind != OutcomeKind::Running {
                learner.is_awaited = false;
            } else if let Some(state) = driver.state {
                (learner.is_awaited, learner.has_entered, learner.is_driving) = (false, true, true);
                (learner.state, have_entered) = (state, true);
            }
        }
        have_entered
    }

    /// Takes one decision of every learner; rewards add up in `rows`. It ends early if a learner enters, which then has to
    /// decide, and goes on until one enters if none drives. Only the last observations of learners that end are written,
    /// to `observations` only if `keep_last`.
    ///
    /// # Errors
    /// Those of prediction.
    pub(super) fn step(
        &mut self,
        actions: &Actions<'_>,
        settings: &WorldsSettings,
        rows: &mut Rows<'_>,
        keep_last: bool,
        memory: &mut CallMemory,
    ) -> Result<()> {
        let dt = self.world.scenario().dt;
        let n = ((settings.decision_seconds / dt).round() as usize).max(1);
        let weights = self.weights;
        for learner in &mut self.learners {
            learner.has_ended = false;
        }
        if let Some(own) = settings.actions.weights() {
            self.weigh(own, actions);
        }
        let mut n_left = n;
        loop {
            self.plan(actions, settings)?;
            self.move_all(memory)?;
            self.steps += 1;
            n_left = n_left.saturating_sub(1);
            self.look(settings, memory);
            let is_late = self.steps as f64 * dt >= settings.max_seconds - 1e-9;
            for slot in 0..self.learners.len() {
                if self.learners[slot].is_driving {
                    self.judge(slot, &weights, rows, is_late, settings, memory);
                    if self.learners[slot].has_ended {
                        self.expect_for_observers(settings)?;
                        self.write_last(slot, settings, rows, keep_last, memory);
                    }
                } else if is_late {
                    self.learners[slot].is_awaited = false;
                }
            }
            let have_entered = self.admit();
            if have_entered || self.is_over() || (n_left == 0 && self.is_any_agent_driving()) {
                break;
            }
        }
        self.expect_for_observers(settings)
    }

    /// Predicts if that is observed.
    fn expect_for_observers(&mut self, settings: &WorldsSettings) -> Result<()> {
        if settings.observation.predictions { self.expect(settings) } else { Ok(()) }
    }

    /// Predicts what is to come from now on, unless that has been done.
    fn expect(&mut self, settings: &WorldsSettings) -> Result<()> {
        let n_steps = ((settings.horizon / self.world.scenario().dt).round() as usize).max(1);
        self.step.expect(&self.world, Forecast::Core(&settings.predictor, n_steps))
    }

    /// Changes the cost weights of all learners that drive, once in a decision.
    fn weigh(&mut self, own: &WeightActions, actions: &Actions<'_>) {
        for (slot, learner) in self.learners.iter_mut().enumerate().filter(|(_, learner)| learner.is_driving) {
            let Action::Numbers(numbers) = actions.of(slot) else { continue };
            learner.is_refused = !numbers.iter().all(|number| number.is_finite());
            if !learner.is_refused {
                let numbers = numbers.iter().map(|number| f64::from(*number));
                (learner.weights, learner.weight_change) = own.changed(&learner.weights, numbers);
                self.world.weigh(learner.agent, learner.weights);
            }
        }
    }

    /// Writes the plans of all agents that drive and have planners; those of others are empty.
    fn plan_traffic(&mut self, settings: &WorldsSettings) -> Result<()> {
        if self.has_traffic {
            self.expect(settings)?;
            self.step.plan(&self.world)?;
        }
        Ok(())
    }

    /// Writes the plans of all agents that drive.
    fn plan(&mut self, actions: &Actions<'_>, settings: &WorldsSettings) -> Result<()> {
        self.plan_traffic(settings)?;
        let dt = self.world.scenario().dt;
        for (slot, learner) in self.learners.iter_mut().enumerate().filter(|(_, learner)| learner.is_driving) {
            if settings.actions.weights().is_some() {
                let row = self.step.plans.row(learner.id).expect("a learner that drives has a row of its plans");
                learner.status = self.step.plans.status[row];
                if learner.is_refused {
                    refuse(&mut self.step.plans, row);
                }
                continue;
            }
            let driver = self.world.driver(learner.agent);
            let curvature = driver.agent.route.path.curvature_at(driver.s);
            let action = actions.of(slot);
            let moved = match &settings.actions {
                ActionSpace::FrenetTarget(target) => {
                    action.numbers().map(|numbers| self.world.aim(learner.agent, target, numbers))
                }
                space => space.next_state(action, &driver.agent.vehicle, &learner.state, curvature, dt),
            };
            match moved {
                Some(moved) => {
                    learner.limited = moved.limited;
                    self.step.plans.set_row(learner.id, &[learner.state, moved.state])?;
                }
                None => {
                    let row = self.step.plans.row(learner.id).expect("a learner that drives has a row of its plans");
                    refuse(&mut self.step.plans, row);
                }
            }
        }
        Ok(())
    }

    /// Moves all as planned.
    fn move_all(&mut self, memory: &mut CallMemory) -> Result<()> {
        self.world.swap_memory(&mut memory.step);
        let moved = self.world.step(&self.step.plans);
        self.world.swap_memory(&mut memory.step);
        moved
    }

    /// Looks at the world as it is now.
    fn look(&mut self, settings: &WorldsSettings, memory: &mut CallMemory) {
        let CallMemory { bodies, present, index, .. } = memory;
        let dt = self.world.scenario().dt;
        let participants = self.world.participants();
        if self.has_scene {
            let predicts = self.has_traffic || settings.observation.predictions;
            let history = if predicts { settings.step.history_at(dt) } else { HISTORY };
            let drawn = if settings.observation.raster { observation::past_steps(dt) } else { 0 };
            self.step.begin_anew(&self.world, history.max(HISTORY).max(drawn));
            observation::bodies(&self.step.scene, settings.observation.raster, bodies);
            present.clone_from(&self.step.scene.present);
        } else {
            self.step.begin_unseen(&self.world);
            present_bodies(participants, self.world.present(), dt, present, bodies);
        }
        index.write(participants, present, bodies.iter().map(|body| body.position), self.learners.len());
        // Those that have just ended are not present any more, but their bodies are what others may have hit.
        for learner in self.learners.iter().filter(|learner| learner.is_driving) {
            let driver = self.world.driver(learner.agent);
            if let (false, Some(state)) = (driver.outcome.kind == OutcomeKind::Running, driver.state) {
                bodies.push(ObservedBody::new(participants, driver.row, &state, state.velocity));
            }
        }
    }
}

/// The plan of a learner whose action is not a number.
fn refuse(plans: &mut Plans, row: usize) {
    let (id, time_step) = (plans.ids[row], plans.time_step);
    plans.status[row] = PlanStatus::Error;
    plans.message[row] = format!("agent {id}, time step {time_step}: the action is not a number");
}
