//! One world: an episode from its first step to the end of its last learner.

use std::sync::Arc;

use super::rewards::{Amounts, N_TERMS, term, term_of};
use super::stage::{Cast, Stage};
use super::{Actions, Ended, EpisodeSpec, Rows, WorldsSettings};
use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::observation::{
    self, ObservationMemory, ObservationSettings, ObservedBody, Observer, PIXELS, PathTable, layout::EGO_LENGTH,
    present_bodies,
};
use crate::plan::Planner;
use crate::plan::frenet::{CostWeights, N_TERMS as N_COSTS};
use crate::plan::learned::{Action, ActionSpace};
use crate::plan::weights::WeightActions;
use crate::recording::OutcomeKind;
use crate::scene::PositionIndex;
use crate::trajectory::{PlanStatus, Plans, State};
use crate::world::{Driver, Forecast, Step, StepMemory, StepSettings, World, WorldSettings};

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
        index.write(participants, present, bodies.iter().map(|body| body.position));
        // Those that have just ended are not present any more, but their bodies are what others may have hit.
        for learner in self.learners.iter().filter(|learner| learner.is_driving) {
            let driver = self.world.driver(learner.agent);
            if let (false, Some(state)) = (driver.outcome.kind == OutcomeKind::Running, driver.state) {
                bodies.push(ObservedBody::new(participants, driver.row, &state, state.velocity));
            }
        }
    }

    /// The reward of a learner for the last step, and whether it has ended.
    fn judge(
        &mut self,
        slot: usize,
        weights: &Amounts,
        rows: &mut Rows<'_>,
        is_late: bool,
        settings: &WorldsSettings,
        memory: &CallMemory,
    ) {
        let learner = &self.learners[slot];
        let driver = self.world.driver(learner.agent);
        let (before, dt) = (learner.state, self.world.scenario().dt);
        // One that ends without moving stays where it was.
        let state = driver.state.unwrap_or(before);
        let outcome = driver.outcome;
        let vehicle = &driver.agent.vehicle;
        let q = driver.s + vehicle.rear_axle_to_center;
        let mut amounts = [0.0; N_TERMS];
        let progress = ((q - learner.start_q) / learner.way).clamp(-1.0, 1.0);
        amounts[term::PROGRESS] = progress - learner.progress;
        let lateral = state.velocity * state.yaw_rate;
        amounts[term::ACCELERATION] = (state.acceleration / 4.0).powi(2) * dt;
        amounts[term::LATERAL_ACCELERATION] = (lateral / 4.0).powi(2) * dt;
        amounts[term::JERK] = ((state.acceleration - before.acceleration) / (20.0 * dt)).powi(2) * dt;
        let at = driver.agent.route.path.at(driver.s);
        let offset = at.tangent().cross(vehicle.rear_axle_from_center(state.pose()) - at.position);
        amounts[term::PATH_OFFSET] = (0.5 * offset.abs()).min(1.0) * dt;
        amounts[term::OVERSPEED] = (state.velocity.abs() / driver.limits.at(q) - 1.0).max(0.0) * dt;
        amounts[term::LIMITED] = f64::from(u8::from(learner.limited));
        amounts[term::WEIGHT_CHANGE] = learner.weight_change;
        if let Some(term) = term_of(outcome.kind, outcome.off_road) {
            amounts[term] = 1.0;
            if outcome.kind == OutcomeKind::Collision {
                amounts[term::COLLISION_SPEED] = outcome.impact_speed / 10.0;
            }
        }
        if weights[term::HEADWAY] != 0.0 {
            amounts[term::HEADWAY] = self.headway(&driver, &state, memory) * dt;
        }
        if weights[term::RECORDED] != 0.0 {
            let obstacles = &self.world.scenario().obstacles.states;
            let recorded = learner.recorded.and_then(|row| obstacles.get(row, self.world.time_step()));
            amounts[term::RECORDED] = recorded
                .map_or(0.0, |recorded| (-0.5 * recorded.pose().position.distance(state.pose().position)).exp() * dt);
        }
        let is_running = outcome.kind == OutcomeKind::Running;
        let kind = outcome.kind;
        let has_ended = !is_running || is_late;
        let reward: f64 = weights.iter().zip(&amounts).map(|(weight, amount)| weight * amount).sum();
        rows.rewards[slot] += reward as f32;
        if !rows.components.is_empty() {
            let components = &mut rows.components[slot * N_TERMS..(slot + 1) * N_TERMS];
            components.iter_mut().zip(&amounts).for_each(|(sum, amount)| *sum += *amount as f32);
        }
        let learner = &mut self.learners[slot];
        learner.progress = progress;
        learner.steps += 1;
        // Once in a decision.
        learner.weight_change = 0.0;
        learner.distance += before.pose().position.distance(state.pose().position);
        learner.total += reward;
        learner.components.iter_mut().zip(&amounts).for_each(|(sum, amount)| *sum += amount);
        learner.state = state;
        if has_ended {
            (learner.is_driving, learner.has_ended) = (false, true);
            let is_time = kind == OutcomeKind::TimeLimit && !settings.time_limit_terminates;
            let truncated = is_running || is_time;
            (rows.terminals[slot], rows.truncations[slot]) = (!truncated, truncated);
        }
        rows.outcomes[slot] = kind as i8;
    }

    /// 1 - gap / (1.5 s times speed) to the nearest participant seen ahead whose footprint overlaps the own width along
    /// the path; 0 where that is negative, or there is none.
    fn headway(&self, driver: &Driver<'_>, state: &State, memory: &CallMemory) -> f64 {
        /// A smaller time gap costs [s].
        const TIME: f64 = 1.5;
        let (path, vehicle) = (&driver.agent.route.path, &driver.agent.vehicle);
        let reach = TIME * state.velocity;
        if reach <= 0.0 {
            return 0.0;
        }
        let (pose, storeys) = (state.pose(), &self.world.participants().storeys);
        let eye = pose.position;
        let front = driver.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let radius = driver.agent.view.sensor_radius;
        let mut gap = f64::INFINITY;
        for (body, row) in memory.bodies.iter().zip(&memory.present) {
            let distance = body.position.distance(eye);
            let half_length = 0.5 * body.size.0;
            if *row == driver.row || distance > radius || distance > reach + vehicle.length + half_length + 5.0 {
                continue;
            }
            let Some((s, d)) = path.project_near(body.position, front, reach + half_length + 5.0) else { continue };
            let turned = path.at(s).tangent().cross(body.axis).abs();
            let half_width = 0.5 * body.size.1 + (half_length - 0.5 * body.size.1) * turned;
            let ahead = s - half_length - front;
            let is_ahead = d.abs() < half_width + 0.5 * vehicle.width && s > front - 0.5 * vehicle.length;
            if is_ahead && !storeys.are_apart_at(|| (pose, body.pose())) {
                gap = gap.min(ahead.max(0.0));
            }
        }
        (1.0 - gap / reach).max(0.0)
    }

    /// Writes what a learner observes now, with a picture if there is room for one.
    fn observe(
        &self,
        slot: usize,
        settings: &WorldsSettings,
        (out, picture): (&mut [f32], &mut [u8]),
        memory: &mut CallMemory,
    ) {
        let learner = &self.learners[slot];
        let (out, planner) =
            out.split_at_mut(out.len() - settings.actions.weights().map_or(0, WeightActions::n_observed));
        if let Some(own) = settings.actions.weights() {
            observe_planner(own, learner, self.world.terms(learner.agent), planner);
        }
        let driver = self.world.driver(learner.agent);
        let observer = Observer {
            state: &learner.state,
            vehicle: &driver.agent.vehicle,
            route: &driver.agent.route,
            table: &learner.table,
            limits: driver.limits,
            goal: &driver.agent.goal,
            road: &self.world.scenario().road,
            predictions: self.step.predictions(),
            s: driver.s,
            time_step: self.world.time_step(),
            dt: self.world.scenario().dt,
            last_time_step: driver.last_time_step,
        };
        let CallMemory { bodies, present, index, seen, observation, .. } = memory;
        let (participants, view) = (self.world.participants(), &driver.agent.view);
        let pose = learner.state.pose();
        seen.clear();
        match driver.state {
            Some(_) if self.has_scene => self.step.scene.see(driver.row, view, index, seen),
            Some(_) => {
                index.around(pose.position, view.sensor_radius, seen);
                let is_near = |row: usize, at: Point| participants.is_near(row, at, pose.position, view);
                seen.retain(|i| present[*i] != driver.row && is_near(present[*i], index.positions[*i]));
            }
            None => (),
        }
        // Those that have just ended are seen by learners that have just ended only: the others look after that.
        let is_seen = |body: &ObservedBody| {
            body.id != learner.id
                && body.position.distance(pose.position) <= view.sensor_radius
                && !participants.storeys.are_apart_at(|| (pose, body.pose()))
        };
        if !learner.is_driving {
            seen.extend((present.len()..bodies.len()).filter(|place| is_seen(&bodies[*place])));
        }
        observation::observe(&observer, bodies, seen, &settings.observation, observation, out);
        if !picture.is_empty() {
            observation::draw(&observer, bodies, seen, picture);
        }
    }

    /// Writes observations, masks and ids of all rows. Those of learners that have ended in this call hold their last
    /// observation already if `keep_last`; all others that do not drive are zero.
    pub(super) fn write(
        &self,
        settings: &WorldsSettings,
        rows: &mut Rows<'_>,
        keep_last: bool,
        memory: &mut CallMemory,
    ) {
        let n = settings.n_observations();
        let pixels = if settings.observation.raster { PIXELS } else { 0 };
        for slot in 0..rows.masks.len() {
            let out = &mut rows.observations[slot * n..(slot + 1) * n];
            let picture = &mut rows.rasters[slot * pixels..(slot + 1) * pixels];
            let Some(learner) = self.learners.get(slot).filter(|learner| learner.has_entered) else {
                clear(out);
                picture.fill(0);
                let id = self.learners.get(slot).map_or(-1, |learner| learner.id);
                (rows.masks[slot], rows.agent_ids[slot], rows.outcomes[slot]) = (false, id, -1);
                continue;
            };
            let (is_driving, has_ended, id) = (learner.is_driving, learner.has_ended, learner.id);
            (rows.masks[slot], rows.agent_ids[slot]) = (is_driving, id);
            if is_driving {
                self.observe(slot, settings, (out, picture), memory);
            } else if !(has_ended && keep_last) {
                clear(out);
                picture.fill(0);
            }
        }
    }

    /// Writes the last observation of a learner that has just ended: to `observations` if it is kept there, and to
    /// `final_observations` if there is room for it.
    fn write_last(
        &self,
        slot: usize,
        settings: &WorldsSettings,
        rows: &mut Rows<'_>,
        keep_last: bool,
        memory: &mut CallMemory,
    ) {
        let n = settings.n_observations();
        let of = |array: &[u8]| if array.is_empty() { 0..0 } else { slot * PIXELS..(slot + 1) * PIXELS };
        let (pictures, final_pictures) = (of(rows.rasters), of(rows.final_rasters));
        if keep_last {
            let out = &mut rows.observations[slot * n..(slot + 1) * n];
            self.observe(slot, settings, (out, &mut rows.rasters[pictures]), memory);
        }
        if !rows.final_observations.is_empty() {
            let out = &mut rows.final_observations[slot * n..(slot + 1) * n];
            self.observe(slot, settings, (out, &mut rows.final_rasters[final_pictures]), memory);
        }
    }

    /// Adds the information about learners that ended in this call; `first_row` is that of the world.
    pub(super) fn tell(&self, first_row: usize, settings: &WorldsSettings, ended: &mut Vec<Ended>) {
        for (slot, learner) in self.learners.iter().enumerate().filter(|(_, learner)| learner.has_ended) {
            let outcome = self.world.driver(learner.agent).outcome;
            let truncated = match outcome.kind {
                OutcomeKind::Running => true,
                OutcomeKind::TimeLimit => !settings.time_limit_terminates,
                _ => false,
            };
            ended.push(Ended {
                row: first_row + slot,
                agent_id: learner.id,
                stage: self.spec.stage,
                outcome: outcome.kind,
                truncated,
                partner: outcome.partner,
                off_road: outcome.off_road,
                impact_speed: outcome.impact_speed,
                steps: learner.steps,
                seconds: learner.steps as f64 * self.world.scenario().dt,
                distance: learner.distance,
                progress: learner.progress,
                total: learner.total,
                components: learner.components,
            });
        }
    }
}

/// Fills an unused row with zeros, unless it holds no observation: every observation begins with numbers about the
/// observer, of which its size is never zero.
fn clear(row: &mut [f32]) {
    if row[..EGO_LENGTH].iter().any(|value| value.to_bits() != 0) {
        row.fill(0.0);
    }
}

/// The plan of a learner whose action is not a number.
fn refuse(plans: &mut Plans, row: usize) {
    let (id, time_step) = (plans.ids[row], plans.time_step);
    plans.status[row] = PlanStatus::Error;
    plans.message[row] = format!("agent {id}, time step {time_step}: the action is not a number");
}

/// Writes what a learner observes about its planner: weights, terms of its last choice, how that came about.
fn observe_planner(own: &WeightActions, learner: &Learner, terms: Option<[f64; N_COSTS]>, out: &mut [f32]) {
    let powers = own.powers(&learner.weights).map(|power| (power / 3.0).clamp(-1.0, 1.0));
    // An infinite amount is 1.
    let shares = terms.unwrap_or_default().map(|amount| 1.0 - 1.0 / (1.0 + amount));
    let is = |flag: bool| f64::from(u8::from(flag));
    let none = learner.status == PlanStatus::None;
    let planned = learner.status == PlanStatus::Planned;
    let status = [is(planned), is(!planned && !none), is(none)];
    for (out, number) in out.iter_mut().zip(powers.chain(shares).chain(status)) {
        *out = number as f32;
    }
}
