//! Many worlds at once in which some agents learn: all step in one call, on all cores, into arrays of the caller.
//!
//! Worlds are independent, so results do not depend on the number of threads. A world needs an episode to begin with and,
//! if it is to begin anew by itself, the next one queued; which ones is up to the caller: nothing here is drawn.

mod episode;
mod rewards;
mod rows;
mod stage;

use std::sync::{Arc, Mutex};

use crate::error::{Error, Result};
use crate::observation::{ObservationSettings, layout};
use crate::plan::Planner;
use crate::plan::learned::ActionSpace;
use crate::plan::weights::WeightActions;
use crate::predict::Predictor;
use crate::recording::OutcomeKind;
use crate::world::{Agent, Shared, StepSettings, Threads, World};
use episode::{CallMemory, Episode};
pub use rewards::{N_TERMS, RewardWeights};
use rows::Rows;
pub use rows::{Actions, Buffers};
pub use stage::Stage;

/// When a world begins its next episode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Autoreset {
    /// In the call after that in which its last learner ended; that call takes no action.
    NextStep,
    /// In the call in which its last learner ends.
    SameStep,
    /// When it is told to.
    Disabled,
}

/// All settings of many worlds.
#[derive(Debug, Clone)]
pub struct WorldsSettings {
    /// What actions mean.
    pub actions: ActionSpace,
    /// What learners observe.
    pub observation: ObservationSettings,
    /// Weights of their rewards.
    pub rewards: RewardWeights,
    /// Steps of the worlds.
    pub step: StepSettings,
    /// Asked if others plan.
    pub predictor: Predictor,
    /// How far ahead it is asked [s].
    pub horizon: f64,
    /// An action lasts this long [s].
    pub decision_seconds: f64,
    /// An episode lasts at most this long [s].
    pub max_seconds: f64,
    /// The end of the grace period terminates; otherwise it truncates.
    pub time_limit_terminates: bool,
    /// When worlds begin anew.
    pub autoreset: Autoreset,
    /// Keep all states and plans of the episode.
    pub record: bool,
    /// Number of threads.
    pub threads: usize,
}

impl WorldsSettings {
    /// Numbers of an observation.
    pub fn n_observations(&self) -> usize {
        layout::length(&self.observation) + self.actions.weights().map_or(0, WeightActions::n_observed)
    }
}

/// An episode to be played.
#[derive(Debug, Clone, Default)]
pub struct EpisodeSpec {
    /// Position of its stage.
    pub stage: usize,
    /// Its first time step; learners may enter later.
    pub first_time_step: i64,
    /// Positions of the learners among the vehicles of the stage, ascending.
    pub learners: Vec<usize>,
    /// Planners of its own for vehicles of the stage that have one: by position, ascending.
    pub planners: Vec<(usize, Planner)>,
    /// Generated vehicles that drive in it besides those of the stage, by ascending ids that are larger than all of the
    /// scenario.
    pub generated: Vec<Arc<Agent>>,
}

/// A learner that has ended in the last call.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// Its row.
    pub row: usize,
    /// Its id.
    pub agent_id: i64,
    /// Position of the stage.
    pub stage: usize,
    /// How it ended; running if the episode was cut.
    pub outcome: OutcomeKind,
    /// It was cut rather than ended.
    pub truncated: bool,
    /// The other participant of a collision.
    pub partner: Option<i64>,
    /// It left the road.
    pub off_road: bool,
    /// Relative speed of a collision [m/s]; NaN without one.
    pub impact_speed: f64,
    /// Steps that it drove.
    pub steps: usize,
    /// Their time [s].
    pub seconds: f64,
    /// Way that it drove [m].
    pub distance: f64,
    /// Share of the way to the goal that it drove.
    pub progress: f64,
    /// Sum of its rewards.
    pub total: f64,
    /// Sums of the amounts of its reward.
    pub components: [f64; N_TERMS],
}

/// The episodes of one world, one after the other.
#[derive(Debug, Clone)]
struct Episodes {
    episode: Episode,
    next: Option<EpisodeSpec>,
    /// Learners that have ended in the last call.
    ended: Vec<Ended>,
    failure: Option<Error>,
}

/// Many worlds. A copy goes on by itself, to the same bits.
#[derive(Debug, Clone)]
pub struct Worlds {
    stages: Vec<Arc<Stage>>,
    settings: WorldsSettings,
    slots: usize,
    places: Vec<Episodes>,
    threads: Threads,
    /// One per thread.
    memories: Vec<Shared<CallMemory>>,
}

impl Worlds {
    /// `n_worlds` worlds with `slots` rows each, without episodes.
    ///
    /// # Errors
    /// `InvalidInput`: no stage, no world, impossible settings.
    pub fn new(stages: Vec<Arc<Stage>>, settings: WorldsSettings, n_worlds: usize, slots: usize) -> Result<Self> {
        settings.actions.check()?;
        settings.observation.validate()?;
        settings.rewards.validate()?;
        let Some(first) = stages.first() else { return Err(Error::invalid("worlds need at least one scenario")) };
        if n_worlds == 0 || slots == 0 {
            return Err(Error::invalid("worlds: at least one world with one row is needed"));
        }
        for stage in &stages {
            stage.check_delays(&settings.step)?;
        }
        let place = |_| {
            let episode = Episode::new(first, &settings)?;
            Ok(Episodes { episode, next: None, ended: Vec::new(), failure: None })
        };
        let places = (0..n_worlds).map(place).collect::<Result<_>>()?;
        let threads = Threads::new(settings.threads)?;
        let memories = (0..settings.threads.max(1)).map(|_| Shared::default()).collect();
        Ok(Self { stages, settings, slots, places, threads, memories })
    }

    /// Number of rows: worlds times rows of each.
    pub fn n_rows(&self) -> usize {
        self.places.len() * self.slots
    }

    /// Number of worlds.
    pub fn n_worlds(&self) -> usize {
        self.places.len()
    }

    /// The settings.
    pub fn settings(&self) -> &WorldsSettings {
        &self.settings
    }

    /// The scenarios.
    pub fn stages(&self) -> &[Arc<Stage>] {
        &self.stages
    }

    /// A world as it is.
    ///
    /// # Errors
    /// `InvalidInput` if there are fewer worlds.
    pub fn world(&self, world: usize) -> Result<&World> {
        let n = self.places.len();
        let place =
            self.places.get(world).ok_or_else(|| Error::invalid(format!("there is no world {world} of {n}")))?;
        Ok(place.episode.world())
    }

    /// Other weights from now on.
    ///
    /// # Errors
    /// `Setting` for an impossible one.
    pub fn set_rewards(&mut self, rewards: RewardWeights) -> Result<()> {
        rewards.validate()?;
        self.settings.rewards = rewards;
        Ok(())
    }

    /// Other scenarios for the episodes to come.
    ///
    /// # Errors
    /// `InvalidInput` for none.
    pub fn set_stages(&mut self, stages: Vec<Arc<Stage>>) -> Result<()> {
        if stages.is_empty() {
            return Err(Error::invalid("worlds need at least one scenario"));
        }
        self.stages = stages;
        Ok(())
    }

    /// Worlds without a queued episode, ascending.
    pub fn hungry(&self) -> Vec<usize> {
        (0..self.places.len()).filter(|i| self.places[*i].next.is_none()).collect()
    }

    /// Learners that have ended in the last call, by row.
    pub fn ended(&self) -> impl Iterator<Item = &Ended> {
        self.places.iter().flat_map(|place| &place.ended)
    }

    /// Queues the next episode of a world, in place of a queued one.
    ///
    /// # Errors
    /// `InvalidInput` for a world, scenario, or learner that does not exist, more learners than rows, or generated
    /// vehicles that are impossible.
    pub fn queue(&mut self, world: usize, spec: EpisodeSpec) -> Result<()> {
        let Some(stage) = self.stages.get(spec.stage) else {
            return Err(Error::invalid(format!("there is no scenario {}", spec.stage)));
        };
        let n = stage.ids().count();
        if !spec.learners.is_sorted_by(|a, b| a < b) || spec.learners.iter().any(|learner| *learner >= n) {
            return Err(Error::invalid("learners must be ascending positions of vehicles that can learn"));
        }
        let has_planner = |(position, _): &(usize, Planner)| stage.has_planner(*position);
        if !spec.planners.is_sorted_by(|a, b| a.0 < b.0) || !spec.planners.iter().all(has_planner) {
            return Err(Error::invalid("planners must be of ascending positions of vehicles with planners"));
        }
        stage.check_generated(&spec.generated, &self.settings.step)?;
        if spec.learners.is_empty() || spec.learners.len() > self.slots {
            return Err(Error::invalid(format!(
                "learners: 1 to {} expected, {} given",
                self.slots,
                spec.learners.len()
            )));
        }
        let Some(place) = self.places.get_mut(world) else {
            return Err(Error::invalid(format!("there is no world {world}")));
        };
        place.next = Some(spec);
        Ok(())
    }

    /// Begins the queued episodes of some worlds and writes their rows; those of others are left alone.
    ///
    /// # Errors
    /// `InvalidInput` if no episode is queued, or its learners do not drive then or later.
    pub fn reset(&mut self, worlds: &[bool], buffers: Buffers<'_>) -> Result<()> {
        buffers.check(self, false)?;
        if worlds.len() != self.places.len() {
            let (n, m) = (self.places.len(), worlds.len());
            return Err(Error::invalid(format!("reset: the mask has {m} values for {n} worlds")));
        }
        let (settings, stages, memory) = (&self.settings, &self.stages, &mut *self.memories[0].lock());
        for ((place, mut rows), wanted) in self.places.iter_mut().zip(buffers.by_world(self.slots)).zip(worlds) {
            if *wanted {
                rows.clear();
                rows.observations.fill(0.0);
                place.ended.clear();
                place.begin(stages, settings, memory)?;
                place.episode.write(settings, &mut rows, false, memory);
            }
        }
        Ok(())
    }

    /// One decision of every learner in all worlds.
    ///
    /// # Errors
    /// `InvalidInput` before anything has changed: not reset, no episode queued, a choice that does not exist; or the
    /// error of a predictor.
    pub fn step(&mut self, buffers: Buffers<'_>) -> Result<()> {
        buffers.check(self, true)?;
        let autoreset = self.settings.autoreset;
        for (i, place) in self.places.iter().enumerate() {
            if !place.episode.has_begun() {
                return Err(Error::invalid("step: reset first"));
            }
            if autoreset == Autoreset::Disabled && place.episode.is_over() && self.places.len() > 1 {
                return Err(Error::invalid(format!("step: world {i} has ended; reset it (autoreset is off)")));
            }
            if autoreset == Autoreset::Disabled && place.episode.is_over() {
                return Err(Error::invalid("step: the episode has ended; reset first"));
            }
            if autoreset != Autoreset::Disabled && place.next.is_none() {
                return Err(Error::invalid(format!("step: world {i} has no next episode")));
            }
        }
        let (settings, stages, slots) = (&self.settings, &self.stages, self.slots);
        if self.settings.threads == 1 {
            let memory = &mut *self.memories[0].lock();
            for (i, (place, mut rows)) in self.places.iter_mut().zip(buffers.by_world(slots)).enumerate() {
                place.play(stages, settings, i * slots, &mut rows, memory);
            }
        } else {
            let work: Vec<Mutex<(&mut Episodes, Rows<'_>)>> =
                self.places.iter_mut().zip(buffers.by_world(slots)).map(Mutex::new).collect();
            self.threads.each(work.len(), |thread, i| {
                if let Ok(mut one) = work[i].lock() {
                    let (place, rows) = &mut *one;
                    place.play(stages, settings, i * slots, rows, &mut self.memories[thread].lock());
                }
            });
        }
        match self.places.iter_mut().find_map(|place| place.failure.take()) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

impl Episodes {
    fn begin(&mut self, stages: &[Arc<Stage>], settings: &WorldsSettings, memory: &mut CallMemory) -> Result<()> {
        let spec = self.next.take().ok_or_else(|| Error::invalid("reset: no episode is queued"))?;
        let stage = stages.get(spec.stage).ok_or_else(|| Error::invalid("reset: its scenario is gone"))?;
        self.episode.begin(stage, spec, settings, memory)
    }

    /// One decision, or the beginning of the next episode.
    fn play(
        &mut self,
        stages: &[Arc<Stage>],
        settings: &WorldsSettings,
        first_row: usize,
        rows: &mut Rows<'_>,
        memory: &mut CallMemory,
    ) {
        if let Err(error) = self.try_play(stages, settings, first_row, rows, memory) {
            self.failure = Some(error);
        }
    }

    fn try_play(
        &mut self,
        stages: &[Arc<Stage>],
        settings: &WorldsSettings,
        first_row: usize,
        rows: &mut Rows<'_>,
        memory: &mut CallMemory,
    ) -> Result<()> {
        rows.clear();
        self.ended.clear();
        if self.episode.is_over() {
            self.begin(stages, settings, memory)?;
            self.episode.write(settings, rows, false, memory);
            return Ok(());
        }
        let actions = rows.actions;
        let keep_last = settings.autoreset != Autoreset::SameStep;
        self.episode.step(&actions, settings, rows, keep_last, memory)?;
        self.episode.tell(first_row, settings, &mut self.ended);
        if !keep_last && self.episode.is_over() {
            self.begin(stages, settings, memory)?;
            let outcomes = std::mem::take(&mut self.ended);
            self.episode.write(settings, rows, false, memory);
            for ended in &outcomes {
                rows.outcomes[ended.row - first_row] = ended.outcome as i8;
            }
            self.ended = outcomes;
        } else {
            self.episode.write(settings, rows, keep_last, memory);
        }
        Ok(())
    }
}
