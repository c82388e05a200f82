//! How a world begins: agents with their precomputed data, and the participants.

use std::borrow::Borrow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::standstill::recording_end;
use super::{Agent, Drive, Effort, Shared, StepMemory, StepSettings, Threads, World, WorldSettings, ordering, people};
use crate::error::{Error, Result};
use crate::limits::{HISTORY_STEPS_MAX, NUMBER_MAX, check_threads, check_time_step};
use crate::plan::{Planner, Prepared};
use crate::predict;
use crate::recording::{Outcome, Recording};
use crate::right_of_way::{Course, Memory};
use crate::route::Route;
use crate::rules::{Indicator, LineMemory, Way};
use crate::scenario::Scenario;
use crate::scene::{Participants, Storeys};

/// Past time steps that a scene needs so that speeds can be observed.
pub(super) const HISTORY_MIN: usize = 3;

/// An agent with the data precomputed before the first step.
#[derive(Debug, Clone)]
pub(crate) struct StagedAgent {
    pub(crate) agent: Arc<Agent>,
    /// `None`: it is made when it is first needed.
    prepared: Option<Arc<Prepared>>,
    pub(crate) way: Arc<Way>,
    course: Arc<Course>,
    /// Arc length of its rear axle on the reference path when it enters [m].
    start_s: f64,
}

impl StagedAgent {
    /// # Errors
    /// `InvalidInput` if its planner needs a recording that is not there.
    pub(crate) fn new(agent: Agent, scenario: &Scenario) -> Result<Self> {
        let way = Arc::new(way(&agent, scenario));
        Self::on(way, Arc::new(agent), scenario)
    }

    /// The same, on the way of its route. What the planner computes for vehicles from queues waits until they enter: of
    /// thousands only some are there at the same time.
    fn on(way: Arc<Way>, agent: Arc<Agent>, scenario: &Scenario) -> Result<Self> {
        let start_s = axle_s(&agent, agent.route.start_s);
        let course = Arc::new(ordering::course(&agent, scenario, &way));
        let prepared = match agent.queue {
            Some(_) => None,
            None => Some(Arc::new(prepared(&agent, scenario)?)),
        };
        Ok(Self { prepared, way, course, start_s, agent })
    }

    /// The same agent with a planner of its own; route and way stay.
    ///
    /// # Errors
    /// As [`StagedAgent::new`].
    pub(crate) fn driven_by(&self, planner: &Planner, scenario: &Scenario) -> Result<Self> {
        let agent = Agent { planner: planner.clone(), ..Agent::clone(&self.agent) };
        Ok(Self { prepared: Some(Arc::new(prepared(&agent, scenario)?)), agent: Arc::new(agent), ..self.clone() })
    }

    /// The same agent, entering elsewhere or at another time; its route stays.
    ///
    /// # Errors
    /// As [`StagedAgent::new`].
    pub(crate) fn entering(&self, agent: Agent, scenario: &Scenario) -> Result<Self> {
        let near = agent.route.path.project(agent.initial_state.pose().position).map_or(self.start_s, |foot| foot.0);
        let start_s = axle_s(&agent, near);
        let prepared = match self.prepared.as_deref() {
            Some(Prepared::RecordedPath(_)) => Some(Arc::new(prepared(&agent, scenario)?)),
            _ => self.prepared.clone(),
        };
        let (way, course) = (Arc::clone(&self.way), Arc::clone(&self.course));
        Ok(Self { prepared, way, course, start_s, agent: Arc::new(agent) })
    }
}

/// Arc length of the rear axle of an agent that enters [m], near that of its centre.
fn axle_s(agent: &Agent, center_s: f64) -> f64 {
    let axle = agent.vehicle.rear_axle_from_center(agent.initial_state.pose());
    let window = 2.0 * agent.vehicle.rear_axle_to_center;
    agent.route.path.project_near(axle, center_s, window).map_or(center_s, |foot| foot.0)
}

/// What the rules say along the route of an agent.
fn way(agent: &Agent, scenario: &Scenario) -> Way {
    Way::along(&agent.route.path, &agent.route.pieces, scenario, &agent.rules)
}

/// Agents with the data precomputed before the first step, by all threads. Those with one route and the same rules share
/// their way.
///
/// # Errors
/// As [`StagedAgent::new`], of the first agent that has any.
pub(crate) fn staged(agents: &[Arc<Agent>], scenario: &Scenario, threads: &Threads) -> Result<Vec<StagedAgent>> {
    let mut firsts: Vec<usize> = Vec::new();
    let mut by_route: BTreeMap<*const Route, Vec<usize>> = BTreeMap::new();
    let mut way_of = Vec::with_capacity(agents.len());
    for (place, agent) in agents.iter().enumerate() {
        let known = by_route.entry(Arc::as_ptr(&agent.route)).or_default();
        let same = known.iter().find(|number| agents[firsts[**number]].rules == agent.rules).copied();
        way_of.push(same.unwrap_or_else(|| {
            firsts.push(place);
            known.push(firsts.len() - 1);
            firsts.len() - 1
        }));
    }
    let ways = each(threads, firsts.len(), |number| Arc::new(way(&agents[firsts[number]], scenario)));
    let made = |place: usize| StagedAgent::on(Arc::clone(&ways[way_of[place]]), Arc::clone(&agents[place]), scenario);
    each(threads, agents.len(), made).into_iter().collect()
}

/// What `work` returns for every number below `n`, by all threads.
fn each<T: Send>(threads: &Threads, n: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let made: Vec<Mutex<Option<T>>> = (0..n).map(|_| Mutex::new(None)).collect();
    threads.each(n, |_, i| *made[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(work(i)));
    made.into_iter().filter_map(|one| one.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

pub(super) fn prepared(agent: &Agent, scenario: &Scenario) -> Result<Prepared> {
    let Agent { id, start_time_step, planner, vehicle, route, goal, rules, .. } = agent;
    Prepared::new(planner, (*id, *start_time_step), vehicle, (route, goal), (scenario, rules))
}

impl World {
    /// A world without participants.
    ///
    /// # Errors
    /// `InvalidInput` for impossible settings.
    pub(crate) fn empty(scenario: Arc<Scenario>, settings: WorldSettings) -> Result<Self> {
        settings.step.validate()?;
        settings.v2x.validate()?;
        check_threads(settings.threads)?;
        let history_steps = settings.step.history_at(scenario.dt);
        if history_steps > HISTORY_STEPS_MAX {
            return Err(Error::invalid(format!(
                "history_steps must be at most {HISTORY_STEPS_MAX}, not {history_steps}"
            )));
        }
        let first_time_step = scenario.obstacles.states.first_time_step;
        Ok(Self {
            states: Vec::new(),
            recording: Recording::new(Vec::new(), first_time_step),
            participants: Arc::default(),
            recorded_row: Vec::new(),
            n_own: 0,
            sent_away: BTreeSet::new(),
            drives: Vec::new(),
            first_time_step,
            time_step: first_time_step,
            recording_end: first_time_step,
            has_passages: false,
            orders: OnceLock::new(),
            has_crosswalks: false,
            waits: OnceLock::new(),
            entered_in_contact: BTreeSet::new(),
            scenario,
            settings,
            radio: None,
            sights: Vec::new(),
            threads: Threads::new(settings.threads)?,
            memories: (0..settings.threads).map(|_| Shared::default()).collect(),
            prediction_memory: predict::Memory::default(),
            step_memory: StepMemory::default(),
        })
    }

    /// Begins anew in any scenario, at a time step at or before which no agent has started. The agents are sorted by id.
    /// Memory is reused.
    pub(crate) fn restart(&mut self, scenario: &Arc<Scenario>, agents: &[StagedAgent], first_time_step: i64) {
        let (participants, recorded_row) = participants(scenario, agents);
        let has_people = people::any_people(&participants);
        self.drives.clear();
        let ids = &scenario.obstacles.states.ids;
        self.drives.extend(agents.iter().map(|staged| Drive {
            prepared: staged.prepared.clone().map_or_else(OnceLock::new, OnceLock::from),
            way: Arc::clone(&staged.way),
            course: Arc::clone(&staged.course),
            memory: Memory::default(),
            lines: LineMemory::default(),
            crosswalk: None,
            row: participants.ids.binary_search(&staged.agent.id).expect("agents are participants"),
            replayed: ids.binary_search(&staged.agent.id).ok().filter(|_| staged.agent.replays_before),
            waited: 0,
            place: None,
            outcome: Outcome::running(staged.agent.start_time_step),
            s: staged.start_s,
            has_left_path: false,
            plan: None,
            stand: None,
            indicator: Indicator::default(),
            was_on_road: false,
            contact_fraction: f64::INFINITY,
            effort: Effort::default(),
            weights: None,
            terms: Shared::default(),
            alertness: Shared::default(),
            agent: Arc::clone(&staged.agent),
        }));
        if !Arc::ptr_eq(&self.scenario, scenario) {
            self.scenario = Arc::clone(scenario);
        }
        let history_steps = self.settings.step.history_at(scenario.dt).max(HISTORY_MIN);
        let columns_max = if self.settings.keep_recording { usize::MAX } else { history_steps + 1 };
        self.recording.restart(&participants.ids, first_time_step, columns_max);
        self.states.clear();
        self.states.resize(participants.ids.len(), None);
        (self.n_own, self.participants, self.recorded_row) = (recorded_row.len(), Arc::new(participants), recorded_row);
        self.sent_away.clear();
        (self.first_time_step, self.time_step) = (first_time_step, first_time_step);
        self.recording_end = recording_end(scenario);
        self.entered_in_contact.clear();
        self.orders = OnceLock::new();
        self.has_crosswalks = has_people && agents.iter().any(|staged| !staged.way.crosswalks().is_empty());
        self.waits = OnceLock::new();
        self.radio = None;
        self.equip();
        let has_passages = |drive: &Drive| !drive.course.passages.is_empty();
        let n_passing = self.drives.iter().filter(|drive| self.passes(drive)).count();
        self.has_passages = self.agrees() || n_passing > 1 || self.drives.iter().any(has_passages);
        self.enter(first_time_step);
        self.look_at_lights();
        self.recording.push(&self.states);
    }
}

/// No agent perceives others later than the past of a scene lasts, in time steps of `dt` [s].
pub(crate) fn check_delays<'a>(
    agents: impl IntoIterator<Item = &'a Agent>,
    step: &StepSettings,
    dt: f64,
) -> Result<()> {
    let kept = step.history_at(dt);
    match agents.into_iter().find(|agent| agent.view.late_steps(dt) > kept as i64) {
        None => Ok(()),
        Some(Agent { id, view, .. }) => Err(Error::invalid(format!(
            "agent {id}: view.delay of {} s is longer than the past that is kept: {} s, see step.history_steps",
            view.delay,
            (kept as f64 * dt * 1e3).round() / 1e3
        ))),
    }
}

/// Ids are unique, numbers possible, and no agent starts before the scenario.
pub(crate) fn check_agents(agents: &[impl Borrow<Agent>], first_time_step: i64) -> Result<()> {
    for pair in agents.windows(2) {
        if pair[0].borrow().id == pair[1].borrow().id {
            return Err(Error::invalid(format!("agent {} occurs twice", pair[0].borrow().id)));
        }
    }
    for agent in agents.iter().map(Borrow::borrow) {
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
        agent.view.validate().map_err(|error| Error::invalid(format!("agent {id}: view.{error}")))?;
        if agent.goal.states.is_empty() {
            return Err(Error::invalid(format!("agent {id} has no goal")));
        }
    }
    Ok(())
}

/// Agents and the recorded obstacles that no agent replaces, sorted by id.
fn participants(scenario: &Scenario, agents: &[StagedAgent]) -> (Participants, Vec<Option<usize>>) {
    let obstacles = &scenario.obstacles;
    let mut rows: Vec<(i64, Option<usize>, Option<&Agent>)> =
        agents.iter().map(|staged| (staged.agent.id, None, Some(&*staged.agent))).collect();
    let replaced = |id: &i64| agents.binary_search_by_key(id, |staged| staged.agent.id).is_ok();
    rows.extend(
        obstacles.states.ids.iter().enumerate().filter(|(_, id)| !replaced(id)).map(|(row, id)| (*id, Some(row), None)),
    );
    rows.sort_by_key(|(id, ..)| *id);
    let mut participants = Participants { storeys: Storeys::of(&scenario.road), ..Participants::default() };
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
