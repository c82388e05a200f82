//! The arrays of the caller, one row per learner, and the part of a world.

use super::rewards::N_TERMS;
use super::{Worlds, WorldsSettings};
use crate::error::{Error, Result};
use crate::observation::PIXELS;
use crate::plan::learned::{Action, ActionSpace};

/// Actions, one row per learner.
#[derive(Debug, Clone, Copy)]
pub enum Actions<'a> {
    /// So many numbers per row.
    Numbers(&'a [f32], usize),
    /// A choice per row.
    Choices(&'a [i32]),
}

impl<'a> Actions<'a> {
    /// Of a row.
    pub(super) fn of(&self, row: usize) -> Action<'a> {
        match *self {
            Self::Numbers(numbers, n) => Action::Numbers(&numbers[row * n..(row + 1) * n]),
            Self::Choices(choices) => Action::Choice(choices[row]),
        }
    }

    fn split(self, rows: usize) -> (Self, Self) {
        match self {
            Self::Numbers(numbers, n) => {
                let (a, b) = numbers.split_at((rows * n).min(numbers.len()));
                (Self::Numbers(a, n), Self::Numbers(b, n))
            }
            Self::Choices(choices) => {
                let (a, b) = choices.split_at(rows.min(choices.len()));
                (Self::Choices(a), Self::Choices(b))
            }
        }
    }
}

/// The arrays of the caller, row-major; optional ones are empty and then not written.
#[derive(Debug)]
pub struct Buffers<'a> {
    /// Actions; not read by a reset.
    pub actions: Actions<'a>,
    /// (rows, numbers).
    pub observations: &'a mut [f32],
    /// (rows,).
    pub rewards: &'a mut [f32],
    /// (rows,): the learner has ended in this call.
    pub terminals: &'a mut [bool],
    /// (rows,): it was cut in this call.
    pub truncations: &'a mut [bool],
    /// (rows,): the next action of the row counts.
    pub masks: &'a mut [bool],
    /// (rows,): codes of outcomes; -1 in rows without a learner, or before it enters.
    pub outcomes: &'a mut [i8],
    /// (rows,): -1 in rows without a learner, or before it enters.
    pub agent_ids: &'a mut [i64],
    /// (rows, terms) or empty: amounts of the reward.
    pub components: &'a mut [f32],
    /// (rows, pixels), or empty if no pictures are observed; zero in rows that have ended or are not used.
    pub rasters: &'a mut [u8],
    /// (rows, numbers) or empty: last observations of learners that have ended in this call; others are left alone.
    pub final_observations: &'a mut [f32],
    /// (rows, pixels) or empty: their last pictures.
    pub final_rasters: &'a mut [u8],
}

/// The part of a world.
pub(super) type Rows<'a> = Buffers<'a>;

/// Takes a part from the front of the remainder.
fn front<'a, T>(rest: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let whole = std::mem::take(rest);
    let (part, others) = whole.split_at_mut(n.min(whole.len()));
    *rest = others;
    part
}

impl<'a> Buffers<'a> {
    /// Sizes fit, and choices exist.
    pub(super) fn check(&self, worlds: &Worlds, acts: bool) -> Result<()> {
        let (rows, settings): (usize, &WorldsSettings) = (worlds.n_rows(), worlds.settings());
        let n = settings.n_observations();
        let wrong = |name: &str, given: usize, expected: usize| {
            Err(Error::invalid(format!("{name}: {given} values given, {expected} expected")))
        };
        let pixels = if settings.observation.raster { rows * PIXELS } else { 0 };
        for (name, given, expected, may_be_empty) in [
            ("observations", self.observations.len(), rows * n, false),
            ("rewards", self.rewards.len(), rows, false),
            ("terminals", self.terminals.len(), rows, false),
            ("truncations", self.truncations.len(), rows, false),
            ("masks", self.masks.len(), rows, false),
            ("outcomes", self.outcomes.len(), rows, false),
            ("agent_ids", self.agent_ids.len(), rows, false),
            ("components", self.components.len(), rows * N_TERMS, true),
            ("raster", self.rasters.len(), pixels, false),
            ("final_observations", self.final_observations.len(), rows * n, true),
            ("final_raster", self.final_rasters.len(), pixels, true),
        ] {
            if given != expected && !(may_be_empty && given == 0) {
                return wrong(name, given, expected);
            }
        }
        if !acts {
            return Ok(());
        }
        match (self.actions, settings.actions.size()) {
            (Actions::Numbers(numbers, n), Some(size)) if n == size && numbers.len() == rows * n => Ok(()),
            (Actions::Choices(choices), None) if choices.len() == rows => {
                check_choices(choices, self.masks, &settings.actions)
            }
            (Actions::Numbers(numbers, _), size) => wrong("actions", numbers.len(), rows * size.unwrap_or(1)),
            (Actions::Choices(choices), size) => wrong("actions", choices.len(), rows * size.unwrap_or(1)),
        }
    }

    /// The parts of the worlds in their order.
    pub(super) fn by_world(mut self, slots: usize) -> impl Iterator<Item = Rows<'a>> {
        let rows = self.masks.len();
        let n = self.observations.len() / rows.max(1);
        // Empty ones stay empty.
        let pixels = self.rasters.len() / rows.max(1);
        (0..rows / slots).map(move |_| {
            let (actions, rest) = self.actions.split(slots);
            self.actions = rest;
            Rows {
                actions,
                observations: front(&mut self.observations, slots * n),
                rewards: front(&mut self.rewards, slots),
                terminals: front(&mut self.terminals, slots),
                truncations: front(&mut self.truncations, slots),
                masks: front(&mut self.masks, slots),
                outcomes: front(&mut self.outcomes, slots),
                agent_ids: front(&mut self.agent_ids, slots),
                components: front(&mut self.components, slots * N_TERMS),
                rasters: front(&mut self.rasters, slots * pixels),
                final_observations: front(&mut self.final_observations, slots * n),
                final_rasters: front(&mut self.final_rasters, slots * pixels),
            }
        })
    }

    /// Nothing has happened in this call.
    pub(super) fn clear(&mut self) {
        self.rewards.fill(0.0);
        self.terminals.fill(false);
        self.truncations.fill(false);
        self.outcomes.fill(0);
        self.components.fill(0.0);
    }
}

/// All choices of rows that drive exist.
fn check_choices(choices: &[i32], masks: &[bool], space: &ActionSpace) -> Result<()> {
    let n = space.n_choices();
    let exists = |choice: i32| usize::try_from(choice).is_ok_and(|choice| choice < n);
    match choices.iter().zip(masks).position(|(choice, drives)| *drives && !exists(*choice)) {
        None => Ok(()),
        Some(row) => Err(Error::invalid(format!("actions: {} at row {row}, there are 0 to {}", choices[row], n - 1))),
    }
}
