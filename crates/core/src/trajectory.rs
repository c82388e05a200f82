//! The tables of the field: arrays per field, rows sorted by participant id, a mask where something is absent.

mod plan_table;
mod plans;
mod predictions;

pub use plan_table::PlanTable;
pub use plans::{Obstruction, PlanStatus, Plans, Trajectory};
pub use predictions::Predictions;

use crate::error::{Error, Result};
use crate::limits::{TIME_STEP_MAX, check_time_step, is_possible};

/// State of one participant at one time step. The position is the centre of the footprint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Position [m], world frame.
    pub x: f64,
    /// Position [m], world frame.
    pub y: f64,
    /// Heading of the body [rad], world frame.
    pub orientation: f64,
    /// Speed along the heading [m/s].
    pub velocity: f64,
    /// Acceleration along the heading [m/s²].
    pub acceleration: f64,
    /// Change of heading [rad/s].
    pub yaw_rate: f64,
}

impl State {
    /// Position and orientation.
    #[inline]
    pub fn pose(&self) -> crate::geometry::Pose {
        crate::geometry::Pose::new(self.x, self.y, self.orientation)
    }

    /// Every field is a number.
    pub fn is_finite(&self) -> bool {
        [self.x, self.y, self.orientation, self.velocity, self.acceleration, self.yaw_rate]
            .iter()
            .all(|v| v.is_finite())
    }

    /// Every field is a number that a participant can have (see [`crate::limits`]).
    pub fn is_possible(&self) -> bool {
        [self.x, self.y, self.orientation, self.velocity, self.acceleration, self.yaw_rate]
            .iter()
            .all(|v| is_possible(*v))
    }
}

/// States of many participants over consecutive time steps: every field has shape (participants, time steps),
/// row-major; where `valid` is false the participant is absent and the numbers are NaN.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct States {
    /// Participant ids, ascending; one per row.
    pub ids: Vec<i64>,
    /// Time step of the first column.
    pub first_time_step: i64,
    /// Number of columns.
    pub n_steps: usize,
    /// Position [m].
    pub x: Vec<f64>,
    /// Position [m].
    pub y: Vec<f64>,
    /// Heading [rad].
    pub orientation: Vec<f64>,
    /// Speed [m/s].
    pub velocity: Vec<f64>,
    /// Acceleration [m/s²].
    pub acceleration: Vec<f64>,
    /// Change of heading [rad/s].
    pub yaw_rate: Vec<f64>,
    /// Present at that time step.
    pub valid: Vec<bool>,
}

impl States {
    /// The fields have as many entries as ids and steps say, ids are unique and ascending, time steps possible.
    ///
    /// # Errors
    /// `InvalidInput` naming the field; `whose` is what the ids are of.
    pub fn check(&self, whose: &str) -> Result<()> {
        check_time_step("time step", self.first_time_step)?;
        if self.n_steps as u64 > TIME_STEP_MAX as u64 {
            return Err(Error::invalid(format!("a table of {} time steps is too long", self.n_steps)));
        }
        let n = self.ids.len() * self.n_steps;
        let fields = [&self.x, &self.y, &self.orientation, &self.velocity, &self.acceleration, &self.yaw_rate];
        if fields.iter().any(|field| field.len() != n) || self.valid.len() != n {
            return Err(Error::invalid(format!("a field of the states has not {n} entries")));
        }
        if !self.ids.is_sorted_by(|a, b| a < b) {
            return Err(Error::invalid(format!("{whose} ids must be unique and ascending")));
        }
        Ok(())
    }

    /// A table in which all participants are absent.
    pub fn absent(ids: Vec<i64>, first_time_step: i64, n_steps: usize) -> Self {
        let n = ids.len() * n_steps;
        let nan = || vec![f64::NAN; n];
        Self {
            ids,
            first_time_step,
            n_steps,
            x: nan(),
            y: nan(),
            orientation: nan(),
            velocity: nan(),
            acceleration: nan(),
            yaw_rate: nan(),
            valid: vec![false; n],
        }
    }

    /// Becomes a table in which all participants are absent; memory is reused.
    pub(crate) fn clear(&mut self, ids: &[i64], first_time_step: i64, n_steps: usize) {
        self.ids.clear();
        self.ids.extend_from_slice(ids);
        (self.first_time_step, self.n_steps) = (first_time_step, n_steps);
        let n = ids.len() * n_steps;
        let Self { x, y, orientation, velocity, acceleration, yaw_rate, valid, .. } = self;
        for field in [x, y, orientation, velocity, acceleration, yaw_rate] {
            field.clear();
            field.resize(n, f64::NAN);
        }
        valid.clear();
        valid.resize(n, false);
    }

    /// Row of a participant.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    /// Where the state of a row at a time step is in the fields; `None` where absent or outside the table.
    #[inline]
    fn place(&self, row: usize, time_step: i64) -> Option<usize> {
        let column =
            usize::try_from(time_step.wrapping_sub(self.first_time_step)).ok().filter(|c| *c < self.n_steps)?;
        Some(row * self.n_steps + column).filter(|i| self.valid[*i])
    }

    /// A row is there at a time step.
    #[inline]
    pub(crate) fn has(&self, row: usize, time_step: i64) -> bool {
        self.place(row, time_step).is_some()
    }

    /// State of a row at a time step; `None` where absent or outside the table.
    #[inline]
    pub fn get(&self, row: usize, time_step: i64) -> Option<State> {
        self.place(row, time_step).map(|i| State {
            x: self.x[i],
            y: self.y[i],
            orientation: self.orientation[i],
            velocity: self.velocity[i],
            acceleration: self.acceleration[i],
            yaw_rate: self.yaw_rate[i],
        })
    }

    /// Writes a state; the column must exist.
    pub fn set(&mut self, row: usize, column: usize, state: &State) {
        let i = row * self.n_steps + column;
        self.x[i] = state.x;
        self.y[i] = state.y;
        self.orientation[i] = state.orientation;
        self.velocity[i] = state.velocity;
        self.acceleration[i] = state.acceleration;
        self.yaw_rate[i] = state.yaw_rate;
        self.valid[i] = true;
    }
}
