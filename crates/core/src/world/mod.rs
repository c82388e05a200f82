//! The running state: participants, time step, outcome per agent. `scene` shows it, `predict` and `plan` read it,
//! `step` is the only function that changes it.

mod advance;
mod planning;
mod settings;
#[cfg(test)]
mod tests;
mod threads;

use std::collections::BTreeSet;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex};

use crate::error::{Error, Result};
use crate::geometry::shape::Shape;
use crate::limits::{HISTORY_STEPS_MAX, NUMBER_MAX, check_threads, check_time_step};
use crate::plan::{Planner, PlanningMemory, Prepared};
use crate::predict::{self, Predictor, predict_with};
use crate::recording::{Outcome, OutcomeKind, Recording};
use crate::route::Route;
use crate::rules::{RulesSettings, StopSign, Way};
use crate::scenario::{Goal, Scenario};
use crate::scene::{Participants, Scene, ViewLimits};
use crate::trajectory::{Predictions, State, Trajectory};
use crate::vehicle::{ParticipantKind, Vehicle};
pub use settings::{StepSettings, WorldSettings};
use threads::Threads;

/// For so many participants, expectations that need no network are made by one thread.
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
}

/// An agent's changing part.
#[derive(Debug)]
struct Drive {
    agent: Arc<Agent>,
    /// What its planner computed before the first step.
    prepared: Prepared,
    /// What the rules of the road say about its reference path.
    way: Way,
    /// How long it has stood at a stop sign.
    stop_sign: StopSign,
    /// Row among the participants.
    row: usize,
    outcome: Outcome,
    /// Arc length of the rear axle on the reference path [m].
    s: f64,
    /// Last plan and the time step of its point 0.
    plan: Option<(Trajectory, i64)>,
    /// Has been fully on the road; before that, leaving it is not counted.
    was_on_road: bool,
    /// Fraction of the step at which the collision that ended it happened.
    contact_fraction: f64,
    /// Effort of its last plan, 0 if that was kept: agents with the largest effort are planned first. Affects run time only.
    effort: AtomicUsize,
}

impl Drive {
    fn is_driving(&self, time_step: i64) -> bool {
        self.outcome.kind == OutcomeKind::Running && time_step >= self.agent.start_time_step
    }

    /// Arc length of its front on the reference path [m].
    fn front(&self) -> f64 {
        self.s + self.agent.vehicle.rear_axle_to_center + 0.5 * self.agent.vehicle.length
    }

    /// Last time step of the grace period.
    fn last_time_step(&self, grace_factor: f64) -> Option<i64> {
        let start = self.agent.start_time_step;
        let late = |end: i64| start.saturating_add((grace_factor * (end - start) as f64).floor() as i64);
        self.agent.goal.latest_time_step().map(late)
    }
}

/// The running simulation.
#[derive(Debug)]
pub struct World {
    scenario: Arc<Scenario>,
    settings: WorldSettings,
    participants: Arc<Participants>,
    /// Row of the recorded obstacle behind each participant; `None` for agents.
    recorded_row: Vec<Option<usize>>,
    drives: Vec<Drive>,
    time_step: i64,
    /// State now, per participant; `None` if absent.
    states: Vec<Option<State>>,
    /// Pairs that touched when one of them entered: contact counts once they have separated.
    entered_in_contact: BTreeSet<(usize, usize)>,
    recording: Recording,
    threads: Threads,
    /// Memory of the planners, one per thread.
    memories: Vec<Mutex<PlanningMemory>>,
    prediction_memory: predict::Memory,
}

impl World {
    /// A world at the scenario's first time step.
    ///
    /// # Errors
    /// `InvalidInput` naming the agent or field: an id twice, an initial state that is not a number, an agent that
    /// starts before the first time step or whose planner needs a recording that is not there, impossible settings.
    pub fn new(scenario: Arc<Scenario>, mut agents: Vec<Agent>, settings: WorldSettings) -> Result<Self> {
        settings.step.validate()?;
        check_threads(settings.threads)?;
        let history_steps = settings.step.history_at(scenario.dt);
        if history_steps > HISTORY_STEPS_MAX {
            return Err(Error::invalid(format!(
                "history_steps must be at most {HISTORY_STEPS_MAX}, not {history_steps}"
            )));
        }
        agents.sort_by_key(|agent| agent.id);
        let first_time_step = scenario.obstacles.states.first_time_step;
        check_agents(&agents, first_time_step)?;
        let threads = Threads::new(settings.threads)?;
        let (participants, recorded_row) = participants(&scenario, &agents);
        let drives = agents
            .into_iter()
            .map(|agent| {
                let Agent { id, start_time_step, ref planner, ref vehicle, ref route, ref goal, ref rules, .. } = agent;
                let begins = (id, start_time_step);
                Ok(Drive {
                    prepared: Prepared::new(planner, begins, vehicle, (route, goal), (&scenario, rules))?,
                    way: Way::along(&route.path, &route.lanelets, &scenario, rules),
                    stop_sign: StopSign::default(),
                    row: participants.ids.binary_search(&id).expect("agents are participants"),
                    outcome: Outcome::running(start_time_step),
                    s: route.start_s,
                    plan: None,
                    was_on_road: false,
                    contact_fraction: f64::INFINITY,
                    effort: AtomicUsize::new(0),
                    agent: Arc::new(agent),
                })
            })
            .collect::<Result<_>>()?;
        let mut world = Self {
            states: vec![None; participants.ids.len()],
            recording: Recording::new(participants.ids.clone(), first_time_step),
            participants: Arc::new(participants),
            recorded_row,
            drives,
            time_step: first_time_step,
            entered_in_contact: BTreeSet::new(),
            scenario,
            settings,
            threads,
            memories: (0..settings.threads).map(|_| Mutex::default()).collect(),
            prediction_memory: predict::Memory::default(),
        };
        world.enter(first_time_step);
        world.recording.push(&world.states);
        Ok(world)
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

    /// What happened so far.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Agents in the order of their ids.
    pub fn agents(&self) -> impl Iterator<Item = &Agent> {
        self.drives.iter().map(|drive| &*drive.agent)
    }

    /// How each agent stands, in the order of their ids.
    pub fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        self.drives.iter().map(|drive| &drive.outcome)
    }

    /// No agent is driving or still to come.
    pub fn is_done(&self) -> bool {
        self.drives.iter().all(|drive| drive.outcome.kind != OutcomeKind::Running)
    }

    /// Ids of the agents that drive now, ascending.
    pub fn driving(&self) -> Vec<i64> {
        self.drives.iter().filter(|d| d.is_driving(self.time_step)).map(|d| d.agent.id).collect()
    }

    /// Pairs of ids that touched when one of them entered and have not separated since.
    pub fn entered_in_contact(&self) -> Vec<(i64, i64)> {
        let ids = &self.participants.ids;
        self.entered_in_contact.iter().map(|(a, b)| (ids[*a], ids[*b])).collect()
    }

    /// Latest time step at which the last agent ends; `None` without agents.
    pub fn last_time_step(&self) -> Option<i64> {
        let latest = self.drives.iter().filter_map(|drive| drive.last_time_step(self.settings.step.grace_factor)).max();
        latest.map(|latest| latest.min(self.final_time_step()))
    }

    /// Time step after which nothing happens any more.
    fn final_time_step(&self) -> i64 {
        self.scenario.obstacles.states.first_time_step.saturating_add(self.max_steps() as i64)
    }

    /// Number of time steps after which the world ends.
    fn max_steps(&self) -> usize {
        self.settings.step.steps_at_most(self.scenario.obstacles.states.n_steps)
    }

    /// What can be seen now.
    pub fn scene(&self) -> Scene {
        self.scene_with_past(self.settings.step.history_at(self.scenario.dt))
    }

    fn scene_with_past(&self, history_steps: usize) -> Scene {
        let present = (0..self.states.len()).filter(|row| self.states[*row].is_some()).collect();
        Scene {
            time_step: self.time_step,
            dt: self.scenario.dt,
            participants: Arc::clone(&self.participants),
            present,
            past: self.recording.last_states(history_steps + 1),
        }
    }

    /// Rows of the participants that an agent sees, ascending.
    ///
    /// # Errors
    /// `UnknownId`; `InvalidInput` if the agent is not present in the scene.
    pub fn visible(&self, id: i64, scene: &Scene) -> Result<Vec<usize>> {
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

    /// An agent as it was before the first step.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn agent(&self, id: i64) -> Result<&Arc<Agent>> {
        Ok(&self.drives[self.drive_index(id)?].agent)
    }

    /// Arc length of the agent's rear axle on its reference path [m], and the one that its front must not pass now,
    /// infinite without one; NaN where it cannot be told.
    ///
    /// # Errors
    /// `UnknownId`.
    pub fn progress(&self, id: i64) -> Result<(f64, f64)> {
        let drive = &self.drives[self.drive_index(id)?];
        let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity.max(0.0));
        Ok((drive.s, self.rules(drive).stop(&drive.way, drive.front(), velocity)))
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

fn check_agents(agents: &[Agent], first_time_step: i64) -> Result<()> {
    for pair in agents.windows(2) {
        if pair[0].id == pair[1].id {
            return Err(Error::invalid(format!("agent {} is there twice", pair[0].id)));
        }
    }
    for agent in agents {
        let id = agent.id;
        if !agent.initial_state.is_possible() {
            return Err(Error::invalid(format!(
                "agent {id} starts with a state that is not a number up to {NUMBER_MAX:e}"
            )));
        }
        agent.shape.check_numbers().map_err(|error| Error::invalid(format!("agent {id}: {error}")))?;
        check_time_step(&format!("agent {id}: its start"), agent.start_time_step)?;
        for goal in &agent.goal.states {
            check_time_step(&format!("agent {id}: the begin of its goal"), goal.time_step.0)?;
            check_time_step(&format!("agent {id}: the end of its goal"), goal.time_step.1)?;
        }
        if agent.start_time_step < first_time_step {
            let start = agent.start_time_step;
            return Err(Error::invalid(format!(
                "agent {id} starts at time step {start}, before the scenario ({first_time_step})"
            )));
        }
        let radius = agent.view.sensor_radius;
        if radius.is_nan() || radius <= 0.0 {
            return Err(Error::invalid(format!("agent {id} has a sensor radius of {radius} m")));
        }
        if agent.goal.states.is_empty() {
            return Err(Error::invalid(format!("agent {id} has no goal")));
        }
    }
    Ok(())
}

/// Agents and the recorded obstacles that no agent replaces, sorted by id.
fn participants(scenario: &Scenario, agents: &[Agent]) -> (Participants, Vec<Option<usize>>) {
    let obstacles = &scenario.obstacles;
    let mut rows: Vec<(i64, Option<usize>, Option<&Agent>)> = agents.iter().map(|a| (a.id, None, Some(a))).collect();
    let replaced = |id: &i64| agents.binary_search_by_key(id, |agent| agent.id).is_ok();
    rows.extend(
        obstacles.states.ids.iter().enumerate().filter(|(_, id)| !replaced(id)).map(|(row, id)| (*id, Some(row), None)),
    );
    rows.sort_by_key(|(id, ..)| *id);
    let mut participants = Participants::default();
    let mut recorded = Vec::with_capacity(rows.len());
    for (id, row, agent) in rows {
        participants.ids.push(id);
        participants.is_agent.push(agent.is_some());
        match (row, agent) {
            (Some(row), _) => {
                participants.kind.push(obstacles.kind[row]);
                participants.shape.push(obstacles.shape[row].clone());
                participants.is_static.push(obstacles.is_static[row]);
            }
            (None, Some(agent)) => {
                participants.kind.push(agent.kind);
                participants.shape.push(agent.shape.clone());
                participants.is_static.push(false);
            }
            (None, None) => unreachable!("every row is an obstacle or an agent"),
        }
        recorded.push(row);
    }
    (participants, recorded)
}
