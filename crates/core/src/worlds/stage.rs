//! A scenario ready to be played: all that is worked out once and shared by every world in which it is played.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::geometry::wrap_angle;
use crate::observation::PathTable;
use crate::plan::Planner;
use crate::rules::RulesSettings;
use crate::scenario::Scenario;
use crate::start::{first_state, past_states};
use crate::trajectory::State;
use crate::vehicle::single_track::Kinematic;
use crate::world::{Agent, StagedAgent, StepSettings, Threads, check_agents, check_delays, staged};
use crate::worlds::EpisodeSpec;

/// The model does what a recorded driver did if it comes so near the next state: [m] and [rad].
const MISSED_DISTANCE: f64 = 0.1;
const MISSED_TURN: f64 = 0.02;

/// A vehicle that can learn.
#[derive(Debug)]
struct Player {
    learner: StagedAgent,
    table: Arc<PathTable>,
    /// With a planner; `None` if it replays its recording unless it learns.
    traffic: Option<StagedAgent>,
    /// Row of its recording.
    row: Option<usize>,
}

/// A scenario with all vehicles that can learn.
#[derive(Debug)]
pub struct Stage {
    pub(super) scenario: Arc<Scenario>,
    players: Vec<Player>,
}

/// The agents of an episode.
#[derive(Debug, Default, Clone)]
pub(super) struct Cast {
    /// Sorted by id.
    pub(super) agents: Vec<StagedAgent>,
    /// The learners: positions among the agents, and what they know of their routes.
    pub(super) learners: Vec<(usize, Arc<PathTable>)>,
    /// Rows of the learners' recordings.
    pub(super) recorded: Vec<Option<usize>>,
}

impl Cast {
    /// Others than the learners drive, too.
    pub(super) fn has_traffic(&self) -> bool {
        self.agents.len() > self.learners.len()
    }

    /// When the first of the learners enters.
    pub(super) fn first_start(&self) -> Option<i64> {
        self.learners.iter().map(|(agent, _)| self.agents[*agent].agent.start_time_step).min()
    }
}

impl Stage {
    /// From all vehicles that can learn, each with the planner that drives it if it does not; without one it replays its
    /// recording. Learners have the planner `learning`, or none (`External`).
    ///
    /// # Errors
    /// `InvalidInput`: an id twice, or a planner that needs a recording that is not there.
    pub fn new(scenario: Arc<Scenario>, mut agents: Vec<(Agent, Option<Planner>)>, learning: &Planner) -> Result<Self> {
        agents.sort_by_key(|(agent, _)| agent.id);
        let all: Vec<Agent> = agents.iter().map(|(agent, _)| agent.clone()).collect();
        check_agents(&all, scenario.obstacles.states.first_time_step)?;
        let player = |(agent, planner): (Agent, Option<Planner>)| {
            let table = Arc::new(PathTable::new(&agent.route, &agent.goal, &scenario.road));
            let row = scenario.obstacles.states.row(agent.id);
            let traffic = match planner {
                Some(planner) => Some(StagedAgent::new(Agent { planner, ..agent.clone() }, &scenario)?),
                None => None,
            };
            // A learner that chooses its motion itself gets no orders at junctions; others do not count on it.
            let precedence = agent.rules.precedence && *learning != Planner::External;
            let rules = RulesSettings { precedence, ..agent.rules };
            let learner = StagedAgent::new(Agent { planner: learning.clone(), rules, ..agent }, &scenario)?;
            Ok(Player { learner, table, traffic, row })
        };
        let players = agents.into_iter().map(player).collect::<Result<_>>()?;
        Ok(Self { scenario, players })
    }

    /// Ids of the vehicles that can learn, ascending.
    pub fn ids(&self) -> impl Iterator<Item = i64> {
        self.players.iter().map(|player| player.learner.agent.id)
    }

    /// Positions of the vehicles that drive at a time step; with at least `rest` steps of their recording left, if they
    /// have started before.
    pub fn eligible(&self, time_step: i64, rest: i64) -> Vec<usize> {
        let drives = |player: &Player| {
            let start = player.learner.agent.start_time_step;
            let states = &self.scenario.obstacles.states;
            let has = |time_step: i64| player.row.is_some_and(|row| states.get(row, time_step).is_some());
            start == time_step && (rest == 0 || player.row.is_none() || has(time_step + rest))
                || start < time_step && has(time_step) && has(time_step + rest)
        };
        (0..self.players.len()).filter(|i| drives(&self.players[*i])).collect()
    }

    /// Positions of the vehicles that enter after a time step; with at least `rest` steps of their recording from then on,
    /// if they have one.
    pub fn later(&self, time_step: i64, rest: i64) -> Vec<usize> {
        let enters = |player: &Player| {
            let (start, states) = (player.learner.agent.start_time_step, &self.scenario.obstacles.states);
            let has = |row| rest == 0 || states.get(row, start + rest).is_some();
            start > time_step && player.row.is_none_or(has)
        };
        (0..self.players.len()).filter(|i| enters(&self.players[*i])).collect()
    }

    /// What a recorded driver did, as the inputs of a model: two numbers per recorded time step, clipped to -1 to 1, and
    /// whether they lead from the recorded state to within 0.1 m and 0.02 rad of the next one.
    pub fn recorded_actions(&self, position: usize, model: &Kinematic) -> (Vec<f32>, Vec<bool>) {
        let (player, states) = (&self.players[position], &self.scenario.obstacles.states);
        let agent = &player.learner.agent;
        let mut found = (vec![0.0; 2 * states.n_steps], vec![false; states.n_steps]);
        let Some(row) = player.row else { return found };
        for step in 0..states.n_steps {
            let time_step = states.first_time_step + step as i64;
            let (Some(from), Some(to)) = (states.get(row, time_step), states.get(row, time_step + 1)) else { continue };
            let curvature =
                agent.route.path.project(from.pose().position).map_or(0.0, |(s, _)| agent.route.path.curvature_at(s));
            let from = State { yaw_rate: if from.yaw_rate.is_finite() { from.yaw_rate } else { 0.0 }, ..from };
            let dt = self.scenario.dt;
            let inputs =
                model.inverse(&agent.vehicle, &from, &to, curvature, dt).map(|input| input.clamp(-1.0, 1.0) as f32);
            let reached = model.step(&agent.vehicle, &from, inputs.map(f64::from), curvature, dt).state;
            let is_near = reached.pose().position.distance(to.pose().position) <= MISSED_DISTANCE
                && wrap_angle(reached.orientation - to.orientation).abs() <= MISSED_TURN;
            found.0[2 * step..2 * step + 2].copy_from_slice(&inputs);
            found.1[step] = is_near;
        }
        found
    }

    /// A vehicle is driven by a planner if it does not learn.
    pub(super) fn has_planner(&self, position: usize) -> bool {
        self.players.get(position).is_some_and(|player| player.traffic.is_some())
    }

    /// No vehicle perceives others later than the past lasts that worlds keep.
    ///
    /// # Errors
    /// `InvalidInput` naming the vehicle.
    pub(super) fn check_delays(&self, step: &StepSettings) -> Result<()> {
        check_delays(self.players.iter().map(|player| &*player.learner.agent), step, self.scenario.dt)
    }

    /// Generated vehicles are possible, and their ids ascend above all of the scenario.
    ///
    /// # Errors
    /// `InvalidInput` naming the vehicle.
    pub(super) fn check_generated(&self, generated: &[Arc<Agent>], step: &StepSettings) -> Result<()> {
        if generated.is_empty() {
            return Ok(());
        }
        let states = &self.scenario.obstacles.states;
        check_agents(generated, states.first_time_step)?;
        check_delays(generated.iter().map(|agent| &**agent), step, self.scenario.dt)?;
        let largest = self.ids().chain(states.ids.iter().copied()).max();
        let ids = largest.into_iter().chain(generated.iter().map(|agent| agent.id));
        match ids.is_sorted_by(|a, b| a < b) {
            true => Ok(()),
            false => Err(Error::invalid("generated vehicles need ascending ids above all of the scenario")),
        }
    }

    /// Writes the agents of an episode.
    ///
    /// # Errors
    /// `InvalidInput` naming a learner that has left by then; those of a planner of a generated vehicle.
    pub(super) fn cast(&self, spec: &EpisodeSpec, threads: &Threads, cast: &mut Cast) -> Result<()> {
        let EpisodeSpec { learners, first_time_step, planners, generated, .. } = spec;
        let first_time_step = *first_time_step;
        cast.agents.clear();
        cast.learners.clear();
        cast.recorded.clear();
        for (i, player) in self.players.iter().enumerate() {
            let learns = learners.binary_search(&i).is_ok();
            let Some(staged) = (if learns { Some(&player.learner) } else { player.traffic.as_ref() }) else { continue };
            let own = planners.binary_search_by_key(&i, |(position, _)| *position).ok().filter(|_| !learns);
            let own = own.map(|row| staged.driven_by(&planners[row].1, &self.scenario)).transpose()?;
            let staged = own.as_ref().unwrap_or(staged);
            let entering = self.entering(staged, player.row, first_time_step)?;
            if learns {
                if entering.is_none() {
                    let id = staged.agent.id;
                    return Err(Error::invalid(format!("learners: {id} has left by time step {first_time_step}")));
                }
                cast.learners.push((cast.agents.len(), Arc::clone(&player.table)));
                cast.recorded.push(player.row);
            }
            cast.agents.extend(entering);
        }
        if !generated.is_empty() {
            cast.agents.extend(staged(generated, &self.scenario, threads)?);
        }
        Ok(())
    }

    /// An agent in an episode that begins at a time step: where its recording is then, if it has started before; `None`
    /// if it has left.
    fn entering(&self, staged: &StagedAgent, row: Option<usize>, time_step: i64) -> Result<Option<StagedAgent>> {
        let agent = &staged.agent;
        if agent.start_time_step >= time_step {
            return Ok(Some(staged.clone()));
        }
        let Some(row) = row else { return Ok(None) };
        let Some(stated) = self.scenario.stated(row, time_step) else { return Ok(None) };
        let dt = self.scenario.dt;
        let past = past_states(&self.scenario.obstacles.states, row, time_step, dt);
        let initial_state = first_state(&stated, &past, dt, &agent.route.path, None, &agent.vehicle);
        let agent = Agent { initial_state, start_time_step: time_step, ..Agent::clone(agent) };
        Ok(Some(staged.entering(agent, &self.scenario)?))
    }
}
