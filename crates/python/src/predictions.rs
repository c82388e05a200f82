//! Tables of predictions as handles.

use std::sync::Arc;

use interdrive_core::predict::completed;
use interdrive_core::scene::{Perceived, Scene};
use interdrive_core::trajectory::{Predictions, State};
use interdrive_core::v2x::{Known, SharedPredictions};
use interdrive_core::world::Expected;
use numpy::{PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{self, Grid, Row};
use crate::errors::{InputError, exception};
use crate::getters::getters;
use crate::scene::PyScene;

/// Id, code of how it is known, age, place among those present; kind, static, length, width and state of others.
pub type KnownParts = (i64, i64, f64, i64, (i64, bool, f64, f64, [f64; 6]));

/// The expected motion of participants, as a predictor returns it and a planner gets it; read-only.
///
/// Args:
///     time_step: Time step at which the prediction is made.
///     ids: Participants, ascending, shape (participants,).
///     probability: Of each mode, sum 1, shape (participants, modes); a mode with 0 is unused.
///     x: Means of the footprint's centre [m], world frame, shape (participants, modes, steps); step `k` is
///         `(k + 1) * dt` later.
///     y: The same [m].
///     orientation: Headings [rad], the same shape.
///     velocity: Speeds along the heading [m/s], the same shape.
///     covariance: Of the position [m²], world frame, shape (participants, modes, steps, 2, 2), positive definite.
///     valid: Where there is a prediction, shape (participants, modes, steps).
///
/// Raises:
///     InputError: An array has another shape or type, or values that cannot be a prediction; the first one is named.
#[pyclass(frozen, name = "Predictions", module = "interdrive._core")]
pub struct PyPredictions {
    table: Arc<Predictions>,
    rows: Option<Vec<usize>>,
    /// What the agents with V2X were told besides.
    pub told: Option<Arc<SharedPredictions>>,
}

impl PyPredictions {
    pub fn whole(table: Predictions) -> Self {
        Self { table: Arc::new(table), rows: None, told: None }
    }

    /// What agents expect in a step.
    pub fn expected(expected: &Expected) -> Self {
        Self { table: Arc::clone(&expected.predictions), rows: None, told: expected.told.clone() }
    }

    /// The table for the core.
    pub fn table(&self) -> Arc<Predictions> {
        match &self.rows {
            None => Arc::clone(&self.table),
            Some(rows) => Arc::new(self.table.rows(rows)),
        }
    }

    fn shown_ids(&self) -> Vec<i64> {
        match &self.rows {
            None => self.table.ids.clone(),
            Some(rows) => rows.iter().map(|row| self.table.ids[*row]).collect(),
        }
    }

    /// The entries of the shown rows in a table with `width` entries per row.
    fn shown<T: Copy>(&self, values: &[T], width: usize) -> Vec<T> {
        match &self.rows {
            None => values.to_vec(),
            Some(rows) => rows.iter().flat_map(|row| values[row * width..(row + 1) * width].iter().copied()).collect(),
        }
    }

    fn n_shown(&self) -> usize {
        self.rows.as_ref().map_or(self.table.ids.len(), Vec::len)
    }

    fn steps<'py, T: numpy::Element + Copy>(&self, py: Python<'py>, values: &[T]) -> Grid<'py> {
        let (n_modes, n_steps) = (self.table.n_modes, self.table.n_steps);
        arrays::grid(py, self.shown(values, n_modes * n_steps), [self.n_shown(), n_modes, n_steps])
    }
}

/// Most means of a table of predictions (participants x modes x steps), which then takes 640 MB.
const PREDICTIONS_MAX: usize = 10_000_000;

#[pymethods]
impl PyPredictions {
    fn __repr__(&self) -> String {
        let (step, modes, steps) = (self.table.time_step, self.table.n_modes, self.table.n_steps);
        format!("<Predictions at time step {step}: {} participants, {modes} modes, {steps} points>", self.n_shown())
    }

    #[new]
    #[pyo3(signature = (time_step, ids, probability, x, y, orientation, velocity, covariance, valid))]
    fn new(
        time_step: i64,
        ids: PyReadonlyArray1<'_, i64>,
        probability: PyReadonlyArrayDyn<'_, f64>,
        x: PyReadonlyArrayDyn<'_, f64>,
        y: PyReadonlyArrayDyn<'_, f64>,
        orientation: PyReadonlyArrayDyn<'_, f64>,
        velocity: PyReadonlyArrayDyn<'_, f64>,
        covariance: PyReadonlyArrayDyn<'_, f64>,
        valid: PyReadonlyArrayDyn<'_, bool>,
    ) -> PyResult<Self> {
        let shape = x.as_array().shape().to_vec();
        // Before anything is copied.
        if shape.iter().product::<usize>() > PREDICTIONS_MAX {
            return Err(InputError::new_err(format!(
                "predictions: x has shape {shape:?}, at most {PREDICTIONS_MAX} values are allowed"
            )));
        }
        let fields = [("probability", &probability), ("x", &x), ("y", &y), ("orientation", &orientation)];
        for (name, field) in fields.into_iter().chain([("velocity", &velocity), ("covariance", &covariance)]) {
            if field.hasattr("mask")? {
                return Err(InputError::new_err(format!(
                    "predictions: {name} is a masked array; what is missing is said by `valid`"
                )));
            }
        }
        let n_ids = ids.as_array().len();
        let [n, n_modes, n_steps] = shape[..] else {
            return Err(InputError::new_err(format!(
                "predictions: x has shape {shape:?}, (participants, modes, steps) expected"
            )));
        };
        if n != n_ids {
            return Err(InputError::new_err(format!("predictions: x has shape {shape:?} for {n_ids} ids")));
        }
        let ids: Vec<i64> = ids.as_array().to_vec();
        let covariance = arrays::read_grid("predictions: covariance", &covariance, &[n, n_modes, n_steps, 2, 2])?;
        let mut predictions = Predictions {
            time_step,
            ids,
            n_modes,
            n_steps,
            probability: arrays::read_grid("predictions: probability", &probability, &[n, n_modes])?,
            x: x.as_array().iter().copied().collect(),
            y: arrays::read_grid("predictions: y", &y, &shape)?,
            orientation: arrays::read_grid("predictions: orientation", &orientation, &shape)?,
            velocity: arrays::read_grid("predictions: velocity", &velocity, &shape)?,
            valid: arrays::read_grid("predictions: valid", &valid, &shape)?,
            ..Predictions::default()
        };
        predictions.set_covariances(&covariance).map_err(exception)?;
        predictions.validate().map_err(exception)?;
        Ok(Self::whole(predictions))
    }

    /// The rows of some participants; ids that are not there are left out.
    fn of(&self, ids: PyReadonlyArray1<'_, i64>) -> Self {
        let mut ids = ids.as_array().to_vec();
        ids.sort_unstable();
        ids.dedup();
        self.only(ids.into_iter())
    }

    /// With a row for every participant present in the scene: without a row or a valid mode it goes straight on.
    /// Planners work with these.
    fn completed(&self, scene: &PyScene) -> Self {
        Self::whole(completed(&self.table(), &scene.scene).into_owned())
    }

    /// What an agent with V2X knows, sorted by id, as tuples: id, code of how it knows, age [s], place among those present
    /// (-1: its sensors do not see it), code of the kind, whether it is static, length and width [m], and its state; None
    /// for an agent without V2X.
    fn known(&self, id: i64) -> Option<Vec<KnownParts>> {
        let told = self.told.as_ref()?;
        let parts = |known: &Known| {
            let place = known.seen.map_or(-1, |place| place as i64);
            let numbers =
                told.extra(known.row).filter(|_| known.seen.is_none()).map_or_else(Default::default, |extra| {
                    let (length, width) = extra.shape.extent();
                    let State { x, y, orientation, velocity, acceleration, yaw_rate } = extra.state;
                    (
                        extra.kind as i64,
                        extra.is_static,
                        length,
                        width,
                        [x, y, orientation, velocity, acceleration, yaw_rate],
                    )
                });
            (known.id, known.via as i64, known.age, place, numbers)
        };
        told.known.get(&id).map(|known| known.iter().map(parts).collect())
    }

    /// Ages of the received plans that are used instead of predictions [s], over all agents with V2X, and the number of
    /// pairs of such an agent and a participant that it knows.
    fn plan_ages<'py>(&self, py: Python<'py>) -> (Row<'py, f64>, usize) {
        let told = self.told.as_deref();
        let ages = told.map_or_else(Vec::new, |told| told.ages().collect());
        (arrays::row(py, ages), told.map_or(0, |told| told.known.values().map(Vec::len).sum()))
    }

    /// What was received, each once for all that received it: its rows, sorted by id, sender and age, ids of the senders,
    /// and ages [s]; bars are left out.
    fn received<'py>(&self, py: Python<'py>) -> Option<(Self, Row<'py, i64>, Row<'py, f64>)> {
        let told = self.told.as_deref()?;
        let mut order: Vec<usize> = (0..told.extras.len()).filter(|i| told.extras[*i].id >= 0).collect();
        order.sort_by(|a, b| {
            let (a, b) = (&told.extras[*a], &told.extras[*b]);
            (a.id, a.sender).cmp(&(b.id, b.sender)).then(a.age.total_cmp(&b.age))
        });
        // An agent that sees the sender expects it a little elsewhere than an agent that does not.
        order.dedup_by_key(|i| (told.extras[*i].id, told.extras[*i].sender, told.extras[*i].age.to_bits()));
        let senders = order.iter().map(|i| told.extras[*i].sender).collect();
        let ages = order.iter().map(|i| told.extras[*i].age).collect();
        let rows = order.iter().map(|i| told.n_present() + i).collect();
        Some((Self::rows_told(told, rows), arrays::row(py, senders), arrays::row(py, ages)))
    }

    /// For other processes.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, this) = (slf.py(), slf.get());
        let arguments = (
            this.table.time_step,
            this.ids(py),
            this.probability(py)?,
            this.x(py)?,
            this.y(py)?,
            this.orientation(py)?,
            this.velocity(py)?,
            this.covariance(py)?,
            this.valid(py)?,
        );
        Ok((slf.get_type().into_any(), arguments.into_pyobject(py)?))
    }
}

getters! { PyPredictions {
    /// Time step at which the prediction was made.
    time_step: i64 = |this| this.table.time_step;
    /// Ids, ascending, shape (participants,).
    ids: Row<'py, i64> = |this, py| arrays::row(py, this.shown_ids());
    /// Probability of each mode, shape (participants, modes).
    probability: Grid<'py> = |this, py| {
        let n_modes = this.table.n_modes;
        arrays::grid(py, this.shown(&this.table.probability, n_modes), [this.n_shown(), n_modes])
    };
    /// Means of the footprint centre [m], world frame, shape (participants, modes, steps); step `k` is `(k + 1) * dt` later.
    x: Grid<'py> = |this, py| this.steps(py, &this.table.x);
    /// Means of the footprint centre [m], world frame, shape (participants, modes, steps).
    y: Grid<'py> = |this, py| this.steps(py, &this.table.y);
    /// Headings [rad], world frame, shape (participants, modes, steps).
    orientation: Grid<'py> = |this, py| this.steps(py, &this.table.orientation);
    /// Speeds along the heading [m/s], shape (participants, modes, steps).
    velocity: Grid<'py> = |this, py| this.steps(py, &this.table.velocity);
    /// Covariance of the position [m²], shape (participants, modes, steps, 2, 2).
    covariance: Grid<'py> = |this, py| {
        let width = this.table.n_modes * this.table.n_steps;
        let (xx, xy, yy) = (
            this.shown(&this.table.covariance_xx, width),
            this.shown(&this.table.covariance_xy, width),
            this.shown(&this.table.covariance_yy, width),
        );
        let flat: Vec<f64> = (0..xx.len()).flat_map(|i| [xx[i], xy[i], xy[i], yy[i]]).collect();
        arrays::grid(py, flat, [this.n_shown(), this.table.n_modes, this.table.n_steps, 2, 2])
    };
    /// Where there is a prediction, shape (participants, modes, steps); nan elsewhere.
    valid: Grid<'py> = |this, py| this.steps(py, &this.table.valid);
} }

impl PyPredictions {
    /// The rows of these participants.
    pub fn only(&self, ids: impl Iterator<Item = i64>) -> Self {
        let row = |id: i64| match &self.rows {
            None => self.table.row(id),
            // Additional rows are not where their ids would be.
            Some(rows) => rows.binary_search_by_key(&id, |row| self.table.ids[*row]).ok().map(|i| rows[i]),
        };
        Self { table: Arc::clone(&self.table), rows: Some(ids.filter_map(row).collect()), told: None }
    }

    /// Some rows of the table that agents with V2X expect.
    pub fn rows_told(told: &SharedPredictions, rows: Vec<usize>) -> Self {
        Self { table: Arc::clone(&told.table), rows: Some(rows), told: None }
    }

    /// The same for an agent that perceives a scene otherwise; rows from `last` on stay as they are.
    pub fn perceived(self, truth: &Scene, seems: &Perceived, last: usize) -> Self {
        let ids = &truth.participants.ids;
        let rows = self.rows.clone().unwrap_or_else(|| (0..self.table.ids.len()).collect());
        let row_of = |place: usize| {
            let is_it = |row: &usize| *row < last && self.table.ids[*row] == ids[truth.present[place]];
            rows.iter().copied().find(is_it)
        };
        Self { table: Arc::new(seems.expected(truth, &self.table, &row_of)), ..self }
    }
}
