//! What happened: states, plans, outcomes and, if requested, visibility intervals. Append-only.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::columns::{coded, table};
use crate::trajectory::{PlanTable, Plans, State, States};
use crate::turn::Turn;

/// How an agent ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum OutcomeKind {
    /// Not done yet.
    Running = 0,
    /// All conditions of the goal were met at once.
    GoalReached = 1,
    /// All conditions but time were met, after the time limit and within the grace period.
    GoalReachedLate = 2,
    /// The grace period ended.
    TimeLimit = 3,
    /// Drove past the goal's areas without meeting the conditions.
    GoalMissed = 4,
    /// No plan, not even emergency braking.
    Infeasible = 5,
    /// Hit another participant or the edge of the road.
    Collision = 6,
    /// The planner raised or returned garbage.
    PlannerError = 7,
}

coded!(OutcomeKind);

impl OutcomeKind {
    /// All; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 8] = [
        Self::Running,
        Self::GoalReached,
        Self::GoalReachedLate,
        Self::TimeLimit,
        Self::GoalMissed,
        Self::Infeasible,
        Self::Collision,
        Self::PlannerError,
    ];
}

table! {
    /// How and when an agent ended, and its partner in a contact.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Outcome {
        /// How.
        pub kind: OutcomeKind,
        /// Time step of the end; the latest one while running.
        pub time_step: i64,
        /// The other participant of a collision.
        pub partner as "partner_id": Option<i64>,
        /// The collision was with the edge of the road.
        pub off_road: bool,
        /// Size of the relative velocity at the contact [m/s]; NaN without a collision.
        pub impact_speed: f64,
        /// Largest overhang of its body beyond the lanelets [m].
        pub off_lanelets: f64,
        /// Time for which the overhang exceeded the tolerance of the map [s].
        pub off_lanelets_s: f64,
        /// For people; often empty.
        pub message: String,
    }
}

impl Outcome {
    /// Still driving.
    pub fn running(time_step: i64) -> Self {
        Self {
            kind: OutcomeKind::Running,
            time_step,
            partner: None,
            off_road: false,
            impact_speed: f64::NAN,
            off_lanelets: 0.0,
            off_lanelets_s: 0.0,
            message: String::new(),
        }
    }
}

table! {
    /// A stretch of time steps in which an agent had to wait before a junction or a crosswalk for one reason.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Wait {
        /// The agent.
        pub agent as "agent_id": i64,
        /// First time step.
        pub first as "first_time_step": i64,
        /// Last time step, included.
        pub last as "last_time_step": i64,
        /// Code of the reason.
        pub kind: u8,
        /// The participant that it waited for.
        pub by as "by_id": Option<i64>,
        /// Arc length on its reference path that its front was not to pass [m].
        pub stop as "stop_s": f64,
    }
}

table! {
    /// An agent that obeys orders enters a conflict zone: it cannot stop before it any more.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Entry {
        /// The agent.
        pub agent as "agent_id": i64,
        /// Number of the area.
        pub area: i64,
        /// Since then.
        pub time_step: i64,
        /// It had been told to go, or had not been told to wait.
        pub granted: bool,
    }
}

/// States of all participants and plans of all agents, step by step.
#[derive(Debug, Clone)]
pub struct Recording {
    ids: Vec<i64>,
    /// Time step of the first column.
    first_time_step: i64,
    /// Row and state of the participants that are there, per time step.
    columns: VecDeque<Vec<(usize, State)>>,
    /// Memory of columns of an earlier recording.
    spare: Vec<Vec<(usize, State)>>,
    /// Largest number of columns; earlier ones are forgotten.
    columns_max: usize,
    /// Earlier time steps were handed over.
    taken: i64,
    plans: PlanTable,
    /// Visibility intervals (first and last time step) by the ids of observer and seen participant.
    sightings: BTreeMap<(i64, i64), Vec<(i64, i64)>>,
    waits: BTreeMap<i64, Vec<Wait>>,
    entries: Vec<Entry>,
}

table! {
    /// A stretch of time steps in which an agent saw another participant without a break.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Sighting {
        /// The observer.
        pub observer as "observer_id": i64,
        /// The seen participant.
        pub seen as "seen_id": i64,
        /// First time step.
        pub first as "first_time_step": i64,
        /// Last time step, included.
        pub last as "last_time_step": i64,
    }
}

impl Recording {
    /// Nothing recorded yet.
    pub fn new(ids: Vec<i64>, first_time_step: i64) -> Self {
        let (columns, plans, sightings) = (VecDeque::new(), PlanTable::default(), BTreeMap::new());
        let (spare, waits, entries) = (Vec::new(), BTreeMap::new(), Vec::new());
        let (columns_max, taken) = (usize::MAX, first_time_step);
        Self { ids, first_time_step, columns, spare, columns_max, taken, plans, sightings, waits, entries }
    }

    /// Becomes an empty recording of at most `columns_max` columns; memory is reused.
    pub(crate) fn restart(&mut self, ids: &[i64], first_time_step: i64, columns_max: usize) {
        self.ids.clear();
        self.ids.extend_from_slice(ids);
        (self.first_time_step, self.taken, self.columns_max) = (first_time_step, first_time_step, columns_max);
        self.spare.extend(self.columns.drain(..));
        self.plans.clear();
        self.sightings.clear();
        self.waits.clear();
        self.entries.clear();
    }

    /// Adds the states of the next time step, one per participant.
    pub(crate) fn push(&mut self, states: &[Option<State>]) {
        let mut column = if self.columns.len() == self.columns_max {
            self.first_time_step += 1;
            self.columns.pop_front().unwrap_or_default()
        } else {
            self.spare.pop().unwrap_or_default()
        };
        write_present(states, &mut column);
        self.columns.push_back(column);
    }

    /// The states of the last time step were others.
    pub(crate) fn replace_last(&mut self, states: &[Option<State>]) {
        if let Some(column) = self.columns.back_mut() {
            write_present(states, column);
        }
    }

    /// Hands over the states since the last call, with the rows of the participants that were there, and the plans that led
    /// to them. From then on only the last `kept` time steps are there. The last time step, which may still change, is
    /// handed over only if it is the `end`.
    pub(crate) fn take(&mut self, kept: usize, end: bool) -> (Vec<usize>, States, PlanTable) {
        let next = self.first_time_step + self.columns.len() as i64 - i64::from(!end);
        let skipped = (self.taken - self.first_time_step) as usize;
        let n_steps = (next - self.taken).max(0) as usize;
        let columns = self.columns.iter().skip(skipped).take(n_steps);
        let rows: BTreeSet<usize> = columns.clone().flatten().map(|(row, _)| *row).collect();
        let rows: Vec<usize> = rows.into_iter().collect();
        let ids = rows.iter().map(|row| self.ids[*row]).collect();
        let mut states = States::absent(ids, self.taken, n_steps);
        for (i, column) in columns.enumerate() {
            for (row, state) in column {
                states.set(rows.binary_search(row).expect("collected"), i, state);
            }
        }
        self.taken += n_steps as i64;
        while self.columns.len() > kept && self.first_time_step < self.taken {
            self.columns.pop_front();
            self.first_time_step += 1;
        }
        (rows, states, self.take_plans())
    }

    /// More participants, with ids above all before; they were absent until now.
    pub(crate) fn append_ids(&mut self, ids: impl Iterator<Item = i64>) {
        self.ids.extend(ids);
    }

    /// State of a row at the last time step.
    pub(crate) fn last_state(&self, row: usize) -> Option<State> {
        let present = self.columns.back()?;
        present.binary_search_by_key(&row, |(row, _)| *row).ok().map(|place| present[place].1)
    }

    /// Rows and states of the participants that are there at the last time step; each with the earliest state that it had
    /// up to `STEPS` time steps before, and how long ago that was.
    pub(crate) fn present<const STEPS: usize>(&self) -> impl Iterator<Item = (usize, &State, Option<(usize, &State)>)> {
        let of = |ago: usize| self.columns.len().checked_sub(1 + ago).map(|i| self.columns[i].as_slice());
        let mut earlier: [_; STEPS] = std::array::from_fn(|i| (STEPS - i, of(STEPS - i).unwrap_or_default()));
        of(0).unwrap_or_default().iter().map(move |(row, state)| {
            let before = earlier.iter_mut().find_map(|(ago, column)| {
                while column.first().is_some_and(|(other, _)| other < row) {
                    *column = &column[1..];
                }
                column.first().filter(|(other, _)| other == row).map(|(_, state)| (*ago, state))
            });
            (*row, state, before)
        })
    }

    /// Adds the plans that led to the next time step, with what the agents showed by their blinkers.
    pub(crate) fn push_plans(&mut self, plans: &Plans, turns: &[Option<Turn>]) {
        self.plans.push(plans, turns);
    }

    /// Notes that an agent sees others at a time step; called in the order of time.
    pub(crate) fn push_sightings(&mut self, time_step: i64, observer: i64, seen: impl Iterator<Item = i64>) {
        for id in seen {
            let stretches = self.sightings.entry((observer, id)).or_default();
            match stretches.last_mut() {
                Some((_, last)) if *last == time_step - 1 => *last = time_step,
                _ => stretches.push((time_step, time_step)),
            }
        }
    }

    /// Notes that an agent has to wait at a time step; called in the order of time.
    pub(crate) fn push_wait(&mut self, wait: Wait) {
        let stretches = self.waits.entry(wait.agent).or_default();
        let is_same = |last: &&mut Wait| {
            last.last == wait.first - 1 && (last.kind, last.by, last.stop) == (wait.kind, wait.by, wait.stop)
        };
        // At most two at once: before a junction, and before a crosswalk.
        match stretches.iter_mut().rev().take(2).find(is_same) {
            Some(last) => last.last = wait.last,
            None => stretches.push(wait),
        }
    }

    /// Waits before junctions and crosswalks, sorted by agent and first time step.
    pub fn waits(&self) -> impl Iterator<Item = &Wait> {
        self.waits.values().flatten()
    }

    /// Notes that an agent enters conflict zones.
    pub(crate) fn push_entries(&mut self, entries: impl IntoIterator<Item = Entry>) {
        self.entries.extend(entries);
    }

    /// When agents that obey orders entered conflict zones.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Visibility intervals, sorted by observer, seen and time; empty unless requested.
    pub fn sightings(&self) -> impl Iterator<Item = Sighting> {
        self.sightings.iter().flat_map(|((observer, seen), stretches)| {
            stretches.iter().map(|(first, last)| Sighting {
                observer: *observer,
                seen: *seen,
                first: *first,
                last: *last,
            })
        })
    }

    /// Participant ids, ascending.
    pub fn ids(&self) -> &[i64] {
        &self.ids
    }

    /// Number of recorded time steps.
    pub fn n_steps(&self) -> usize {
        self.columns.len()
    }

    /// All plans.
    pub fn plans(&self) -> &PlanTable {
        &self.plans
    }

    /// Hands over all plans until now.
    pub(crate) fn take_plans(&mut self) -> PlanTable {
        std::mem::take(&mut self.plans)
    }

    /// All states as a table of shape (participants, time steps).
    pub fn states(&self) -> States {
        self.last_states(self.columns.len())
    }

    /// The last `n` recorded time steps as a table of shape (participants, n); absent before the beginning.
    pub fn last_states(&self, n: usize) -> States {
        let mut table = States::default();
        self.write_last_states(n, &mut table);
        table
    }

    /// The same into a table that is there; memory is reused.
    pub(crate) fn write_last_states(&self, n: usize, table: &mut States) {
        let last_time_step = self.first_time_step + self.columns.len() as i64 - 1;
        table.clear(&self.ids, last_time_step + 1 - n as i64, n);
        let skipped = self.columns.len().saturating_sub(n);
        let offset = n.saturating_sub(self.columns.len());
        for (i, states) in self.columns.iter().skip(skipped).enumerate() {
            for (row, state) in states {
                table.set(*row, offset + i, state);
            }
        }
    }
}

/// Writes the rows of participants that are there, and their states.
fn write_present(states: &[Option<State>], column: &mut Vec<(usize, State)>) {
    column.clear();
    column.reserve(states.iter().flatten().count());
    column.extend(states.iter().enumerate().filter_map(|(row, state)| Some((row, (*state)?))));
}
