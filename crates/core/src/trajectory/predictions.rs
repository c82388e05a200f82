//! What predictors expect of all participants.

use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::limits::{NUMBER_MAX, is_possible};

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

    /// The table with more rows at its end, without any expectation yet. Their ids need not be ascending, so that
    /// Adds a row without expectations and returns its position. Its id need not be the largest: [`Predictions::row`] must
    /// not be asked of such a table.
    pub(crate) fn push_row(&mut self, id: i64) -> usize {
        self.ids.push(id);
        let n = self.ids.len() * self.n_modes;
        self.probability.resize(n, 0.0);
        let Self { x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy, valid, n_steps, .. } =
            self;
        for field in [x, y, orientation, velocity, covariance_xx, covariance_xy, covariance_yy] {
            field.resize(n * *n_steps, f64::NAN);
        }
        valid.resize(n * *n_steps, false);
        self.ids.len() - 1
    }

    /// Becomes a table of `n_rows` rows without expectations and ids; the memory is reused.
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
        self.rows(&rows)
    }

    /// Some rows, in this order.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn rows(&self, rows: &[usize]) -> Self {
        let taken = rows.iter().map(|row| self.ids[*row]).collect();
        let mut out = Self::empty(self.time_step, taken, self.n_modes, self.n_steps);
        for (to, from) in rows.iter().enumerate() {
            out.copy_row(to, self, *from);
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
        /// Probabilities add up to 1 within this: they may come from single precision.
        const TOLERANCE: f64 = 1e-6;
        if !self.ids.is_sorted_by(|a, b| a < b) {
            return Err(Error::invalid("predictions: ids must be unique and ascending"));
        }
        if self.n_modes == 0 || self.n_steps == 0 {
            let (n_modes, n_steps) = (self.n_modes, self.n_steps);
            return Err(Error::invalid(format!(
                "predictions need at least one mode and one step, got {n_modes} x {n_steps}"
            )));
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
