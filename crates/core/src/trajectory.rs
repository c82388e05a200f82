//! The tables of the field: arrays per field, rows sorted by participant id, a mask where something is absent.

use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::limits::{NUMBER_MAX, TIME_STEP_MAX, check_time_step, is_possible};

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

    /// Row of a participant.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    /// State of a row at a time step; `None` where absent or outside the table.
    pub fn get(&self, row: usize, time_step: i64) -> Option<State> {
        let column =
            usize::try_from(time_step.wrapping_sub(self.first_time_step)).ok().filter(|c| *c < self.n_steps)?;
        let i = row * self.n_steps + column;
        self.valid[i].then(|| State {
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

/// What a predictor expects: for every participant some modes with probabilities, each with a Gaussian position per
/// step. Prediction step `k` (from 0) is the time `(k + 1) * dt` after `time_step`.
///
/// Shapes: `probability` (participants, modes); all others (participants, modes, steps), row-major.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Predictions {
    /// Time step at which the prediction was made.
    pub time_step: i64,
    /// Participant ids, ascending; one per row.
    pub ids: Vec<i64>,
    /// Number of modes of every participant; unused ones have probability 0 and are not valid.
    pub n_modes: usize,
    /// Number of predicted steps.
    pub n_steps: usize,
    /// Probability of each mode; those of a participant add up to 1.
    pub probability: Vec<f64>,
    /// Mean of the footprint centre [m].
    pub x: Vec<f64>,
    /// Mean of the footprint centre [m].
    pub y: Vec<f64>,
    /// Heading [rad].
    pub orientation: Vec<f64>,
    /// Speed [m/s].
    pub velocity: Vec<f64>,
    /// Variance of x [m²].
    pub covariance_xx: Vec<f64>,
    /// Covariance of x and y [m²].
    pub covariance_xy: Vec<f64>,
    /// Variance of y [m²].
    pub covariance_yy: Vec<f64>,
    /// The participant is expected to be there (mode used, time known).
    pub valid: Vec<bool>,
}

impl Predictions {
    /// A table without any expectation.
    pub fn empty(time_step: i64, ids: Vec<i64>, n_modes: usize, n_steps: usize) -> Self {
        Self::filled(f64::NAN, time_step, ids, n_modes, n_steps)
    }

    /// A table of which every row is going to be written.
    pub(crate) fn zeros(time_step: i64, ids: Vec<i64>, n_modes: usize, n_steps: usize) -> Self {
        Self::filled(0.0, time_step, ids, n_modes, n_steps)
    }

    fn filled(number: f64, time_step: i64, ids: Vec<i64>, n_modes: usize, n_steps: usize) -> Self {
        let n = ids.len() * n_modes * n_steps;
        let column = || vec![number; n];
        Self {
            time_step,
            probability: vec![0.0; ids.len() * n_modes],
            ids,
            n_modes,
            n_steps,
            x: column(),
            y: column(),
            orientation: column(),
            velocity: column(),
            covariance_xx: column(),
            covariance_xy: column(),
            covariance_yy: column(),
            valid: vec![false; n],
        }
    }

    /// Becomes a table of so many rows without any expectation and without ids; the memory is reused.
    pub(crate) fn clear(&mut self, time_step: i64, n_rows: usize, n_modes: usize, n_steps: usize) {
        let n = n_rows * n_modes * n_steps;
        (self.time_step, self.n_modes, self.n_steps) = (time_step, n_modes, n_steps);
        self.ids.clear();
        self.probability.clear();
        self.probability.resize(n_rows * n_modes, 0.0);
        let Self { x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy, valid, .. } = self;
        for field in [x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy] {
            field.clear();
            field.resize(n, f64::NAN);
        }
        valid.clear();
        valid.resize(n, false);
    }

    /// Parts of `n_rows` rows each, to be written at the same time; the last one may have fewer.
    pub(crate) fn parts(&mut self, n_rows: usize) -> Parts<'_> {
        let n = n_rows * self.n_modes * self.n_steps;
        let mut fields = [
            &mut self.x,
            &mut self.y,
            &mut self.orientation,
            &mut self.velocity,
            &mut self.covariance_xx,
            &mut self.covariance_xy,
            &mut self.covariance_yy,
        ]
        .map(|field| field.chunks_mut(n));
        let (probability, valid) = (self.probability.chunks_mut(n_rows * self.n_modes), self.valid.chunks_mut(n));
        let parts = probability.zip(valid).map(|(probability, valid)| {
            let fields = fields.each_mut().map(|field| field.next().expect("as many parts of every field"));
            Mutex::new(Rows { probability, valid, fields })
        });
        Parts(parts.collect())
    }

    /// Row of a participant.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    /// The rows of some participants (ascending ids); ids that are not there are left out.
    pub fn of(&self, ids: &[i64]) -> Self {
        let rows: Vec<usize> = ids.iter().filter_map(|id| self.row(*id)).collect();
        let taken = rows.iter().map(|row| self.ids[*row]).collect();
        let mut out = Self::empty(self.time_step, taken, self.n_modes, self.n_steps);
        for (to, from) in rows.into_iter().enumerate() {
            out.copy_row(to, self, from);
        }
        out
    }

    /// Takes over a row of a table with as many modes and steps.
    pub(crate) fn copy_row(&mut self, to_row: usize, from: &Self, from_row: usize) {
        let (a, b, n) = (from.offset(from_row, 0), self.offset(to_row, 0), from.n_modes * from.n_steps);
        let modes = from.n_modes;
        self.probability[to_row * modes..(to_row + 1) * modes]
            .copy_from_slice(&from.probability[from_row * modes..(from_row + 1) * modes]);
        self.x[b..b + n].copy_from_slice(&from.x[a..a + n]);
        self.y[b..b + n].copy_from_slice(&from.y[a..a + n]);
        self.orientation[b..b + n].copy_from_slice(&from.orientation[a..a + n]);
        self.velocity[b..b + n].copy_from_slice(&from.velocity[a..a + n]);
        self.covariance_xx[b..b + n].copy_from_slice(&from.covariance_xx[a..a + n]);
        self.covariance_xy[b..b + n].copy_from_slice(&from.covariance_xy[a..a + n]);
        self.covariance_yy[b..b + n].copy_from_slice(&from.covariance_yy[a..a + n]);
        self.valid[b..b + n].copy_from_slice(&from.valid[a..a + n]);
    }

    /// Position of (row, mode, step 0) in the flat arrays.
    #[inline]
    pub fn offset(&self, row: usize, mode: usize) -> usize {
        (row * self.n_modes + mode) * self.n_steps
    }
}

impl Predictions {
    /// Takes over covariances from an array of shape (participants, modes, steps, 2, 2).
    ///
    /// # Errors
    /// `InvalidInput` naming the participant whose covariance is not symmetric at a valid step.
    pub fn set_covariances(&mut self, covariances: &[f64]) -> Result<()> {
        // Products in another order differ in their last bits.
        let is_asymmetric = |c: &[f64; 4]| (c[1] - c[2]).abs() > 1e-6 * (c[0].abs() + c[3].abs());
        let (covariances, _) = covariances.as_chunks::<4>();
        if let Some(i) = covariances.iter().zip(&self.valid).position(|(c, valid)| *valid && is_asymmetric(c)) {
            let id = self.ids[i / (self.n_modes * self.n_steps)];
            return Err(Error::invalid(format!(
                "predictions: participant {id} has a covariance that is not symmetric"
            )));
        }
        self.covariance_xx = covariances.iter().map(|c| c[0]).collect();
        self.covariance_xy = covariances.iter().map(|c| c[1]).collect();
        self.covariance_yy = covariances.iter().map(|c| c[3]).collect();
        Ok(())
    }

    /// Checks what a predictor from outside handed over.
    ///
    /// # Errors
    /// `InvalidInput`: ids that are not ascending, no mode or no step; or naming the participant: a valid step that is
    /// not a number, a covariance that is not positive definite, probabilities that do not add up to 1 although a mode
    /// is valid.
    pub fn validate(&self) -> Result<()> {
        const TOLERANCE: f64 = 1e-6;
        if !self.ids.is_sorted_by(|a, b| a < b) {
            return Err(Error::invalid("predictions: ids must be unique and ascending"));
        }
        if self.n_modes == 0 || self.n_steps == 0 {
            let (n_modes, n_steps) = (self.n_modes, self.n_steps);
            return Err(Error::invalid(format!("predictions: {n_modes} modes of {n_steps} steps are no prediction")));
        }
        for (row, id) in self.ids.iter().enumerate() {
            let modes = &self.probability[row * self.n_modes..(row + 1) * self.n_modes];
            let start = self.offset(row, 0);
            let all = start..start + self.n_modes * self.n_steps;
            if !self.valid[all.clone()].iter().any(|valid| *valid) {
                continue;
            }
            let total: f64 = modes.iter().sum();
            if (total - 1.0).abs() > TOLERANCE || modes.iter().any(|p| p.is_nan() || *p < 0.0) {
                return Err(Error::invalid(format!(
                    "predictions: mode probabilities of participant {id} are {modes:?}"
                )));
            }
            for i in all.filter(|i| self.valid[*i]) {
                let (xx, xy, yy) = (self.covariance_xx[i], self.covariance_xy[i], self.covariance_yy[i]);
                if ![self.x[i], self.y[i], self.orientation[i], self.velocity[i], xx, xy, yy]
                    .iter()
                    .all(|v| is_possible(*v))
                {
                    return Err(Error::invalid(format!(
                        "predictions: participant {id} has a valid step that is not a number up to {NUMBER_MAX:e}"
                    )));
                }
                if !(xx > 0.0 && yy > 0.0 && xx * yy - xy * xy > 0.0) {
                    return Err(Error::invalid(format!(
                        "predictions: participant {id} has a covariance that is not positive definite"
                    )));
                }
            }
        }
        Ok(())
    }
}

/// A table of predictions in parts that several threads write at the same time.
pub(crate) struct Parts<'a>(Vec<Mutex<Rows<'a>>>);

/// Some rows of a table.
struct Rows<'a> {
    probability: &'a mut [f64],
    valid: &'a mut [bool],
    fields: [&'a mut [f64]; 7],
}

impl Parts<'_> {
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Writes a part: the rows of a table with as many rows.
    pub(crate) fn copy_from(&self, part: usize, table: &Predictions) {
        let Predictions { x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy, .. } = table;
        // No other thread writes this part, and what a panic leaves in it is never read.
        let mut rows = self.0[part].lock().unwrap_or_else(PoisonError::into_inner);
        rows.probability.copy_from_slice(&table.probability);
        rows.valid.copy_from_slice(&table.valid);
        let fields = [x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy];
        for (to, from) in rows.fields.iter_mut().zip(fields) {
            to.copy_from_slice(from);
        }
    }
}

/// How a plan came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum PlanStatus {
    /// No plan yet.
    None = 0,
    /// A trajectory was chosen by the planner.
    Planned = 1,
    /// Nothing was free of collision: emergency braking.
    EmergencyBraking = 2,
    /// Not even emergency braking was possible.
    Infeasible = 3,
    /// The planner raised or returned garbage.
    Error = 4,
}

impl PlanStatus {
    /// All; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 5] = [Self::None, Self::Planned, Self::EmergencyBraking, Self::Infeasible, Self::Error];
}

/// Why a planner found no ordinary plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Obstruction {
    /// What rejected most of the samples that the vehicle can drive, in words.
    pub rejection: String,
    /// Where the agent's centre would be in the first contact, or at its largest overhang [m]; NaN: nowhere.
    pub at: Point,
    /// How far the cheapest of the samples that leave the road reaches beyond the lanelets [m]; NaN for other reasons.
    pub overhang: f64,
}

impl Obstruction {
    /// One that is nowhere in particular.
    pub fn nowhere(rejection: &str) -> Self {
        Self { rejection: rejection.into(), at: Point::new(f64::NAN, f64::NAN), overhang: f64::NAN }
    }
}

/// One trajectory: point 0 is the state at planning time, point `i` is `i * dt` later. Positions are footprint centres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// Points, dt apart.
    pub points: Vec<State>,
}

/// The plans of all agents that are being driven, one row per agent, sorted by id.
///
/// Every field of the points has shape (agents, points), row-major; point 0 is the state at planning time. Rows whose
/// plan is shorter are filled with NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct Plans {
    /// Time step at which the plans were made.
    pub time_step: i64,
    /// Agent ids, ascending.
    pub ids: Vec<i64>,
    /// Number of points of every row.
    pub n_points: usize,
    /// Points, (agents, points); NaN beyond the end of a shorter plan.
    pub points: Vec<State>,
    /// How each plan came about.
    pub status: Vec<PlanStatus>,
    /// Cost of the chosen trajectory; NaN if the planner has none.
    pub cost: Vec<f64>,
    /// Text for rows with status `Error`.
    pub message: Vec<String>,
    /// Rows without an ordinary plan, ascending, and why, where the planner says so.
    pub obstructions: Vec<(usize, Obstruction)>,
}

impl Plans {
    /// Rows without a plan.
    pub fn none(time_step: i64, ids: Vec<i64>, n_points: usize) -> Self {
        let n = ids.len();
        Self {
            time_step,
            ids,
            n_points,
            points: vec![Self::NO_POINT; n * n_points],
            status: vec![PlanStatus::None; n],
            cost: vec![f64::NAN; n],
            message: vec![String::new(); n],
            obstructions: Vec::new(),
        }
    }

    /// A point that is not there.
    pub const NO_POINT: State = State {
        x: f64::NAN,
        y: f64::NAN,
        orientation: f64::NAN,
        velocity: f64::NAN,
        acceleration: f64::NAN,
        yaw_rate: f64::NAN,
    };

    /// Writes the plan of an agent; the table grows if the plan is longer than any before.
    ///
    /// # Errors
    /// `UnknownId` if the agent does not drive now.
    pub fn set_row(&mut self, id: i64, points: &[State]) -> Result<()> {
        let row = self.row(id).ok_or(Error::UnknownId { what: "driving agent", id })?;
        if points.len() > self.n_points {
            let mut wider = vec![Self::NO_POINT; self.ids.len() * points.len()];
            for other in 0..self.ids.len() {
                wider[other * points.len()..][..self.n_points].copy_from_slice(self.row_points(other));
            }
            (self.points, self.n_points) = (wider, points.len());
        }
        let range = row * self.n_points..(row + 1) * self.n_points;
        self.points[range.clone()].fill(Self::NO_POINT);
        self.points[range.start..range.start + points.len()].copy_from_slice(points);
        self.status[row] = PlanStatus::Planned;
        self.cost[row] = f64::NAN;
        Ok(())
    }

    /// Notes that an agent's planner failed.
    ///
    /// # Errors
    /// `UnknownId` if the agent does not drive now.
    pub fn fail_row(&mut self, id: i64, message: String) -> Result<()> {
        let row = self.row(id).ok_or(Error::UnknownId { what: "driving agent", id })?;
        self.status[row] = PlanStatus::Error;
        self.message[row] = message;
        Ok(())
    }

    /// Points of a row.
    pub fn row_points(&self, row: usize) -> &[State] {
        &self.points[row * self.n_points..(row + 1) * self.n_points]
    }

    /// Row of an agent.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }
}
