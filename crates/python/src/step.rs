//! A step that has begun, as a handle for predictors and planners in Python.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use interdrive_core::road::RoadNetwork;
use interdrive_core::trajectory::PlanStatus;
use interdrive_core::world::{Forecast, Step};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{self, Row};
use crate::errors::exception;
use crate::getters::getters;
use crate::predictions::PyPredictions;
use crate::predictor::PyPredictor;
use crate::scene::PyScene;
use crate::view::PyView;

/// The source of predictions: the core, or what a predictor in Python has answered.
#[derive(FromPyObject)]
pub enum PyForecast<'py> {
    Core(PyRef<'py, PyPredictor>),
    Outside(PyRef<'py, PyPredictions>),
}

impl PyForecast<'_> {
    /// Calls `work` with the same for the core.
    pub fn with<T>(&self, n_steps: usize, work: impl FnOnce(Forecast<'_>) -> T) -> T {
        match self {
            Self::Core(predictor) => work(Forecast::Core(&predictor.0, n_steps)),
            Self::Outside(predictions) => work(Forecast::Outside(&predictions.table())),
        }
    }
}

/// Nanoseconds since the first call, for the core.
pub fn nanoseconds() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    u64::try_from(START.get_or_init(now).elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// What is there, what agents expect and what they plan in one step, and the times at which its phases ended.
#[pyclass(name = "Step", module = "interdrive._core")]
pub struct PyStep {
    pub step: Step,
    pub road: Arc<RoadNetwork>,
    pub marks: Vec<Instant>,
    /// Part of the last phase, once the step is over.
    pub collision: Option<Duration>,
}

#[allow(clippy::disallowed_methods, reason = "times are reported to Python; the core does not see them")]
pub fn now() -> Instant {
    Instant::now()
}

#[pymethods]
impl PyStep {
    /// Ends a phase.
    pub fn mark(&mut self) {
        self.marks.push(now());
    }

    /// Checks the plan that a planner made from its view and writes it: arrays of shape (points,), point 0 is now.
    ///
    /// `slides`: the positions need not follow from the speeds; for bodies that no vehicle drives, such as those of tests
    /// of contact.
    #[pyo3(signature = (view, x, y, orientation, velocity, acceleration=None, yaw_rate=None, *, slides=false))]
    fn set(
        &mut self,
        view: &PyView,
        x: PyReadonlyArrayDyn<'_, f64>,
        y: PyReadonlyArrayDyn<'_, f64>,
        orientation: PyReadonlyArrayDyn<'_, f64>,
        velocity: PyReadonlyArrayDyn<'_, f64>,
        acceleration: Option<PyReadonlyArrayDyn<'_, f64>>,
        yaw_rate: Option<PyReadonlyArrayDyn<'_, f64>>,
        slides: bool,
    ) -> PyResult<()> {
        let rates = [acceleration.as_ref(), yaw_rate.as_ref()];
        let points = view.checked([&x, &y, &orientation, &velocity], rates, slides)?;
        self.step.plans.set_row(view.agent.id, &points).map_err(exception)
    }

    /// Notes that an agent's planner failed.
    fn fail(&mut self, id: i64, message: String) -> PyResult<()> {
        self.step.plans.fail_row(id, message).map_err(exception)
    }
}

getters! { PyStep {
    /// What is there now.
    scene: PyScene = |this| PyScene { scene: Arc::clone(&this.step.scene), road: Arc::clone(&this.road) };
    /// What agents expect.
    predictions: PyResult<PyPredictions> = |this| this.step.expected().map(PyPredictions::expected).map_err(exception);
    /// Ids of the agents that drive, ascending.
    ids: Row<'py, i64> = |this, py| arrays::row(py, this.step.plans.ids.clone());
    /// Codes of `interdrive.run.PLAN_STATUS`.
    status: Row<'py, i64> = |this, py| {
        arrays::row(py, this.step.plans.status.iter().map(|status| *status as i64).collect())
    };
    /// Costs of the plans; not a number where the planner has none, or the plan is the rest of an earlier one.
    cost: Row<'py, f64> = |this, py| arrays::row(py, this.step.plans.cost.clone());
    /// Ids of the agents that still need a plan from outside the core.
    missing: Vec<i64> = |this| {
        let none = |(id, status): (&i64, &PlanStatus)| (*status == PlanStatus::None).then_some(*id);
        this.step.plans.ids.iter().zip(&this.step.plans.status).filter_map(none).collect()
    };
    /// Seconds that the core has planned for each agent, in the order of `ids`; empty unless the world has a profile.
    plan_seconds: Row<'py, f64> = |this, py| {
        arrays::row(py, this.step.plans.nanoseconds.iter().map(|spent| 1e-9 * *spent as f64).collect())
    };
    /// Seconds that each phase has taken, in the order of `interdrive.run.PHASES`.
    seconds: Vec<f64> = |this| {
        let mut phases: Vec<Duration> = this.marks.windows(2).map(|ends| ends[1] - ends[0]).collect();
        if let Some(collision) = this.collision {
            let advance = phases.pop().unwrap_or_default().saturating_sub(collision);
            phases.extend([collision, advance]);
        }
        phases.iter().map(Duration::as_secs_f64).collect()
    };
} }
