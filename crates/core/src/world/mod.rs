//! The running state: participants, time step, outcome per agent. A [`Step`] shows it, predicts and plans;
//! [`World::step`] is the only function that changes it.

mod advance;
mod cooperation;
mod encounter;
mod entry;
mod ordering;
mod outside;
mod people;
mod narrow_places;
mod planning;
mod queues;
mod settings;
mod staging;
mod standstill;
mod step;
mod storeys;
#[cfg(test)]
mod tests;
mod threads;
mod unseen;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::barrier::{Barrier, Barriers};
use crate::collision::ContactMemory;
use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::geometry::shape::Shape;
use crate::plan::frenet::{self, CostWeights};
use crate::plan::reference_driver::AlertnessLog;
use crate::plan::{Planner, PlanningMemory, Prepared, ReferenceDriving};
use crate::predict::{self, Predictor, predict_with};
use crate::recording::{Outcome, OutcomeKind, Recording};
use crate::reference_drivers;
use crate::right_of_way::{Course, Memory, Order};
use crate::route::Route;
use crate::rules::{Indicator, LineMemory, RulesSettings, SpeedLimits, Way};
use crate::scenario::{Goal, Scenario};
use crate::scene::{OBSERVED_STEPS, Participants, Scene, ViewLimits};
use crate::trajectory::{PlanTable, Predictions, State, States, Trajectory};
use crate::v2x::Radio;
use crate::vehicle::{ParticipantKind, Vehicle};
pub use outside::Outside;
pub use queues::Queue;
pub use settings::{Clock, StepSettings, WorldSettings};
pub(crate) use staging::StagedAgent;
pub(crate) use staging::{check_agents, check_delays, staged};
pub use step::{Expected, Forecast, Step};
pub(crate) use threads::Threads;

/// Number of participants up to which one thread makes predictions that need no network.
const FEW: usize = 12;

/// An agent before the first step.
#[derive(Debug, Clone)]
pub struct Agent {
    /// Unique among all participants; an obstacle of the scenario with this id is replaced by the agent.
    pub id: i64,
    /// Kind.
    pub kind: ParticipantKind,
    /// Footprint.
    pub shape: Shape,
    /// Parameters and limits.
    pub vehicle: Vehicle,
    /// State when it enters.
    pub initial_state: State,
    /// Time step when it enters.
    pub start_time_step: i64,
    /// Until then its recording is replayed; otherwise it is absent.
    pub replays_before: bool,
    /// The queue before the map in which it waits for a gap; `None`: it enters at its time.
    pub queue: Option<Queue>,
    /// What it wants.
    pub goal: Goal,
    /// How to get there.
    pub route: Arc<Route>,
    /// Its planner.
    pub planner: Planner,
    /// What it sees.
    pub view: ViewLimits,
    /// The rules of the road that it obeys.
    pub rules: RulesSettings,
    /// Whether it has V2X; `None`: as drawn by the penetration.
    pub v2x: Option<bool>,
}

/// Effort of a plan, which threads write.
#[derive(Debug, Default)]
struct Effort(AtomicUsize);

impl Clone for Effort {
    fn clone(&self) -> Self {
        Self(AtomicUsize::new(self.0.load(Ordering::Relaxed)))
    }
}

/// Something that threads share, with copies that have their own.
#[derive(Debug, Default)]
pub(crate) struct Shared<T>(Mutex<T>);

impl<T> Shared<T> {
    pub(crate) fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Clone> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Mutex::new(self.lock().clone()))
    }
}

/// An agent's changing part.
#[derive(Debug, Clone)]
struct Drive {
    agent: Arc<Agent>,
    /// What its planner computes once: before the first step, or, for an agent from a queue, when it is first needed.
    prepared: OnceLock<Arc<Prepared>>,
    /// What the rules of the road say about its reference path.
    way: Arc<Way>,
    /// The conflict zones on its way; empty if it neither obeys orders nor agrees with others.
    course: Arc<Course>,
    /// What it remembers of the next ones.
    memory: Memory,
    /// What it remembers of the lines ahead.
    lines: LineMemory,
    /// The crosswalk on its way before which it was told to wait at the last step.
    crosswalk: Option<usize>,
    /// Row among the participants.
    row: usize,
    /// Row of the obstacle that it replays until it starts.
    replayed: Option<usize>,
    /// For how many time steps it has waited for room to enter.
    waited: i64,
    /// Place among the agents with V2X.
    place: Option<usize>,
    outcome: Outcome,
    /// Arc length of the rear axle on the reference path [m].
    s: f64,
    /// It is so far beside the reference path that it has no place there.
    has_left_path: bool,
    /// Last plan and the time step of its point 0.
    plan: Option<(Trajectory, i64)>,
    /// The lane change that it shows, if it chooses its lanes.
    indicator: Indicator,
    /// Where it stands, once the recording is over.
    stand: Option<standstill::Stand>,
    /// Has been fully on the road; before that, leaving it is not counted.
    was_on_road: bool,
    /// Fraction of the step at which the collision that ended it happened.
    contact_fraction: f64,
    /// Effort of its last plan, 0 if that was kept: agents with the largest effort are planned first. Affects run time only.
    effort: Effort,
    /// Cost weights in the place of those of its planner, and the terms of its last choice.
    weights: Option<CostWeights>,
    terms: Shared<Option<[f64; frenet::N_TERMS]>>,
    /// What it remembers as a reference driver.
    alertness: Shared<AlertnessLog>,
}

impl Drive {
    fn is_driving(&self, time_step: i64) -> bool {
        self.outcome.kind == OutcomeKind::Running && time_step >= self.agent.start_time_step
    }

    /// Arc length of its front on the reference path [m].
    fn front(&self) -> f64 {
        let half = 0.5 * self.agent.vehicle.length;
        if self.plan.is_none() {
            // Where `s` is about to be.
            let center = self.agent.initial_state.pose().position;
            if let Some((s, _)) = self.agent.route.path.project_near(center, self.s, half) {
                return s + half;
            }
        }
        self.s + self.agent.vehicle.rear_axle_to_center + half
    }

    /// What the rules say about the lane in which it is, and the arc length of its front there [m]: agents that change lanes
    /// by themselves are not always in that of the reference path.
    fn way_below(&self, state: &State, scenario: &Scenario) -> (&Way, f64) {
        let vehicle = &self.agent.vehicle;
        let pose = state.pose();
        let axle = Pose { position: vehicle.rear_axle_from_center(pose), ..pose };
        let found = self.prepared(scenario).way_below(axle);
        let to_front = vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        found.map_or_else(|| (&*self.way, self.front()), |(way, s)| (way, s + to_front))
    }

    /// What its planner computes once.
    fn prepared(&self, scenario: &Scenario) -> &Prepared {
        let made = || Arc::new(staging::prepared(&self.agent, scenario).unwrap_or(Prepared::Nothing));
        self.prepared.get_or_init(made)
    }

    /// Gives back memory that an agent which has left does not need; only vehicles from queues come in large numbers.
    fn forget(&mut self) {
        if self.agent.queue.is_some() {
            (self.prepared, self.plan) = (OnceLock::new(), None);
        }
    }

    /// Last time step of the grace period.
    fn last_time_step(&self, step: &StepSettings) -> Option<i64> {
        self.agent.goal.latest_time_step().map(|end| step.time_limit(self.agent.start_time_step, end))
    }
}

/// Where an agent is on its reference path, and how far it may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Arc length of its rear axle [m]; NaN where it cannot be told.
    pub s: f64,
    /// Arc length of its front [m].
    pub front: f64,
    /// What it must not pass now.
    pub barriers: Barriers,
}

/// The running simulation. A copy goes on by itself, to the same bits.
#[derive(Debug, Clone)]
pub struct World {
    scenario: Arc<Scenario>,
    settings: WorldSettings,
    participants: Arc<Participants>,
    /// Row of the recorded obstacle behind each participant; `None` for agents.
    recorded_row: Vec<Option<usize>>,
    /// Rows from here on are driven from outside.
    n_own: usize,
    /// Rows of those from outside that left after a contact.
    sent_away: BTreeSet<usize>,
    drives: Vec<Drive>,
    first_time_step: i64,
    time_step: i64,
    /// From then on the recording changes nothing.
    recording_end: i64,
    /// Some agent has an area on its way.
    has_passages: bool,
    /// Orders of the present time step, once they were needed.
    orders: OnceLock<Vec<Order>>,
    /// Some agent has a crosswalk on its way that it obeys.
    has_crosswalks: bool,
    /// The agents that wait before crosswalks at the present time step, once that was needed.
    waits: OnceLock<Vec<(i64, usize, Barrier)>>,
    /// State now, per participant; `None` if absent.
    states: Vec<Option<State>>,
    /// Pairs that touched when one of them entered: contact counts once they have separated.
    entered_in_contact: BTreeSet<(usize, usize)>,
    recording: Recording,
    /// Messages; `None` if no agent has V2X.
    radio: Option<Box<Radio>>,
    /// What the equipped agents see at this time step, once they have looked, by place.
    sights: Vec<OnceLock<Vec<usize>>>,
    threads: Threads,
    /// Memory of the planners, one per thread.
    memories: Vec<Shared<PlanningMemory>>,
    prediction_memory: predict::Memory,
    step_memory: StepMemory,
}

/// An agent of a world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Driver<'a> {
    /// As it was before the first step.
    pub(crate) agent: &'a Agent,
    /// Speed limits along its reference path.
    pub(crate) limits: &'a SpeedLimits,
    /// Arc length of its rear axle on the reference path [m].
    pub(crate) s: f64,
    /// Row among the participants.
    pub(crate) row: usize,
    /// How it stands.
    pub(crate) outcome: &'a Outcome,
    /// Its state, also that in which it has just ended; `None` before it starts and after it has ended.
    pub(crate) state: Option<State>,
    /// Last time step of the grace period.
    pub(crate) last_time_step: Option<i64>,
}

/// Memory that steps reuse; nothing in it outlives a step.
#[derive(Debug, Default, Clone)]
pub(crate) struct StepMemory {
    /// States of the step before, afterwards.
    next: Vec<Option<State>>,
    /// Rows of the participants that are there before and after the step.
    moving: Vec<usize>,
    contacts: ContactMemory,
    edges: Vec<u32>,
}

impl World {
    /// A world at the scenario's first time step.
    ///
    /// # Errors
    /// `InvalidInput` naming the agent or field: an id twice, an initial state that is not a number, an agent that
    /// starts before the first time step or whose planner needs a recording that is not there, impossible settings.
    pub fn new(scenario: Arc<Scenario>, agents: Vec<Agent>, settings: WorldSettings) -> Result<Self> {
        Self::with_shared(scenario, agents.into_iter().map(Arc::new).collect(), settings)
    }

    /// The same with agents that are known elsewhere, too: thousands need not be copied.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn with_shared(scenario: Arc<Scenario>, mut agents: Vec<Arc<Agent>>, settings: WorldSettings) -> Result<Self> {
        agents.sort_by_key(|agent| agent.id);
        // Errors of perception follow the seed of the world, too.
        let own = (settings.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize;
        for agent in agents.iter_mut().filter(|agent| own != 0 && agent.view.errs()) {
            Arc::make_mut(agent).view.error_seed ^= own;
        }
        let mut world = Self::empty(Arc::clone(&scenario), settings)?;
        check_agents(&agents, scenario.obstacles.states.first_time_step)?;
        check_delays(agents.iter().map(|agent| &**agent), &settings.step, scenario.dt)?;
        let staged = staging::staged(&agents, &scenario, &world.threads)?;
        let first_time_step = scenario.obstacles.states.first_time_step;
        world.restart(&scenario, &staged, first_time_step);
        Ok(world)
    }

    /// Gives it other memory for its steps, and hands over its own.
    pub(crate) fn swap_memory(&mut self, memory: &mut StepMemory) {
        std::mem::swap(&mut self.step_memory, memory);
    }

    /// Now.
    pub fn time_step(&self) -> i64 {
        self.time_step
    }

    /// The input.
    pub fn scenario(&self) -> &Arc<Scenario> {
        &self.scenario
    }

    /// The participants.
    pub fn participants(&self) -> &Arc<Participants> {
        &self.participants
    }

    /// Its threads.
    pub(crate) fn threads(&self) -> &Threads {
        &self.threads
    }

    /// What has happened.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Hands over the states since the last call, with the rows of the participants that were there, and the plans that led
    /// to them; only as much of the past stays as agents look back. The present, which may still change, is handed over
    /// only if it is the `end`.
    pub fn take_recorded(&mut self, end: bool) -> (Vec<usize>, States, PlanTable) {
        let kept = self.settings.step.history_at(self.scenario.dt).max(staging::HISTORY_MIN) + 1;
        self.recording.take(kept, end)
    }

    /// Hands over all plans until now, which the world forgets.
    pub fn take_plans(&mut self) -> PlanTable {
        self.recording.take_plans()
    }

    /// Agents in the order of their ids.
    pub fn agents(&self) -> impl Iterator<Item = &Agent> {
        self.drives.iter().map(|drive| &*drive.agent)
    }

    /// How each agent stands, in the order of their ids.
    pub fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        self.drives.iter().map(|drive| &drive.outcome)
    }

    /// No agent is driving or still to come; without agents, the time of the world is over.
    pub fn is_done(&self) -> bool {
        let has_time = self.drives.is_empty() && self.time_step < self.end_without_agents();
        !has_time && self.drives.iter().all(|drive| drive.outcome.kind != OutcomeKind::Running)
    }

    fn end_without_agents(&self) -> i64 {
        self.first_time_step.saturating_add(self.settings.steps_without_agents as i64)
    }

    /// Ids of the agents that drive now, ascending.
    pub fn driving(&self) -> Vec<i64> {
        self.driving_ids().collect()
    }

    /// Pairs of ids that touched when one of them entered and have not separated since.
    pub fn entered_in_contact(&self) -> Vec<(i64, i64)> {
        let ids = &self.participants.ids;
        self.entered_in_contact.iter().map(|(a, b)| (ids[*a], ids[*b])).collect()
    }

    /// An agent now, by its position among the agents.
    pub(crate) fn driver(&self, index: usize) -> Driver<'_> {
        let drive = &self.drives[index];
        Driver {
            agent: &drive.agent,
            limits: &drive.way.limits,
            s: drive.s,
            row: drive.row,
            outcome: &drive.outcome,
            state: self.states[drive.row].or_else(|| self.recording.last_state(drive.row)),
            last_time_step: drive.last_time_step(&self.settings.step),
        }
    }

    /// Ids of the agents that drive now, ascending.
    pub(crate) fn driving_ids(&self) -> impl Iterator<Item = i64> {
        self.drives.iter().filter(|drive| drive.is_driving(self.time_step)).map(|drive| drive.agent.id)
    }

    /// Latest time step at which the last agent ends; without agents, the last time step if that is known.
    pub fn last_time_step(&self) -> Option<i64> {
        if self.drives.is_empty() && self.settings.steps_without_agents > 0 {
            return Some(self.end_without_agents());
        }
        self.latest_of_agents().map(|latest| latest.min(self.final_time_step()))
    }

    /// The same, if they had all the time in the world.
    fn latest_of_agents(&self) -> Option<i64> {
        self.drives.iter().filter_map(|drive| drive.last_time_step(&self.settings.step)).max()
    }

    /// Time step after which nothing happens any more.
    fn final_time_step(&self) -> i64 {
        let states = &self.scenario.obstacles.states;
        let needed = self.latest_of_agents().map_or(0, |latest| latest.saturating_sub(states.first_time_step));
        let steps = self.settings.step.steps_at_most(states.n_steps, needed);
        states.first_time_step.saturating_add(steps as i64)
    }

    /// What can be seen now.
    pub fn scene(&self) -> Scene {
        let mut scene = self.scene_with_past(self.settings.step.history_at(self.scenario.dt));
        self.write_turns(&scene.present, &mut scene.turns);
        scene
    }

    /// Rows and states of the participants present; each with the earliest state by which its speed can be judged, and the time
    /// steps since.
    pub(crate) fn present(&self) -> impl Iterator<Item = (usize, &State, Option<(usize, &State)>)> {
        self.recording.present::<OBSERVED_STEPS>().filter(|(row, ..)| self.states[*row].is_some())
    }

    /// Writes what can be seen now, with a part of the past, into a scene that is there; memory is reused.
    pub(crate) fn write_scene(&self, history_steps: usize, scene: &mut Scene) {
        (scene.time_step, scene.dt) = (self.time_step, self.scenario.dt);
        if !Arc::ptr_eq(&scene.participants, &self.participants) {
            scene.participants = Arc::clone(&self.participants);
        }
        scene.present.clear();
        scene.present.extend((0..self.states.len()).filter(|row| self.states[*row].is_some()));
        self.write_turns(&scene.present, &mut scene.turns);
        self.recording.write_last_states(history_steps + 1, &mut scene.past);
    }

    /// The same without turns.
    fn scene_with_past(&self, history_steps: usize) -> Scene {
        let present = (0..self.states.len()).filter(|row| self.states[*row].is_some()).collect();
        Scene {
            time_step: self.time_step,
            dt: self.scenario.dt,
            participants: Arc::clone(&self.participants),
            present,
            turns: Vec::new(),
            past: self.recording.last_states(history_steps + 1),
        }
    }

    /// Rows of the participants that an agent sees, ascending.
    ///
    /// # Errors
    /// `UnknownId`; `InvalidInput` if the agent is not present in the scene.
    pub fn visible(&self, id: i64, scene: &Scene) -> Result<Vec<usize>> {
        self.check_scene(scene)?;
        let drive = &self.drives[self.drive_index(id)?];
        if scene.present.binary_search(&drive.row).is_err() {
            return Err(Error::invalid(format!("agent {id} is not present at time step {}", scene.time_step)));
        }
        Ok(scene.visible_from(drive.row, &drive.agent.view))
    }

    /// Predictions of a native predictor for all participants present, on the threads of the world.
    ///
    /// # Errors
    /// As [`predict_with`].
    pub fn predict(&self, predictor: &Predictor, scene: &Scene, n_steps: usize) -> Result<Predictions> {
        let with = |each: predict::Each<'_>| {
            predict_with(predictor, scene, &self.scenario.road, n_steps, &self.prediction_memory, each)
        };
        match predictor {
            // Waking a thread takes longer than what there is to do for a few.
            _ if scene.present.len() <= FEW && !matches!(predictor, Predictor::Neural(_)) => with(&predict::one_by_one),
            _ => with(&|n, work| self.threads.each(n, |_, i| work(i))),
        }
    }

    /// Rows of a scene mean something among its own participants only.
    fn check_scene(&self, scene: &Scene) -> Result<()> {
        match Arc::ptr_eq(&scene.participants, &self.participants) {
            true => Ok(()),
            false => Err(Error::invalid("the scene is of another world")),
        }
    }

    /// The time step of what was handed over must be now.
    fn check_time_step(&self, what: &'static str, found: i64) -> Result<()> {
        if found == self.time_step {
            Ok(())
        } else {
            Err(Error::WrongTimeStep { what, expected: self.time_step, found })
        }
    }

    fn drive_index(&self, id: i64) -> Result<usize> {
        self.drives
            .binary_search_by_key(&id, |drive| drive.agent.id)
            .map_err(|_| Error::UnknownId { what: "agent", id })
    }

    /// Puts a reference driver in the place of an agent from the next plan on.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn replace_driver(&mut self, id: i64, driver: reference_drivers::Driver) -> Result<()> {
        let index = self.drive_index(id)?;
        let drive = &mut self.drives[index];
        let planner = Planner::Reference(driver, ReferenceDriving::default());
        drive.agent = Arc::new(Agent { planner, ..Agent::clone(&drive.agent) });
        (drive.prepared, drive.alertness) = (OnceLock::from(Arc::new(Prepared::Nothing)), Shared::default());
        Ok(())
    }

    /// An agent as it was before the first step.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn agent(&self, id: i64) -> Result<&Arc<Agent>> {
        Ok(&self.drives[self.drive_index(id)?].agent)
    }

    /// Where an agent is on its reference path, and how far it may go now.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn progress(&self, id: i64) -> Result<Progress> {
        let drive = &self.drives[self.drive_index(id)?];
        let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity.max(0.0));
        let barriers = self.rules(drive).barriers(&drive.way, drive.front(), velocity);
        Ok(Progress { s: drive.s, front: drive.front(), barriers })
    }

    /// Speed limits at every point of the agent's reference path [m/s]; infinite where there is none.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn speed_limits(&self, id: i64) -> Result<Vec<f64>> {
        let drive = &self.drives[self.drive_index(id)?];
        let path = &drive.agent.route.path;
        Ok((0..path.x().len()).map(|i| drive.way.limits.at(i as f64 * path.spacing())).collect())
    }
}
