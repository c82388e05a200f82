//! All participants at one time step, as arrays.

use std::sync::Arc;

use interdrive_core::predict::is_standing;
use interdrive_core::road::RoadNetwork;
use interdrive_core::scene::Scene;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{self, Grid, Row};
use crate::errors::detached;
use crate::getters::getters;
use crate::scenario::{PyRoadNetwork, PyScenario};

/// One field of the past of some rows: shape (rows, history), the last column is now.
pub fn past<'py, T: numpy::Element + Copy>(py: Python<'py>, scene: &Scene, rows: &[usize], values: &[T]) -> Grid<'py> {
    let n = scene.past.n_steps;
    let flat: Vec<T> = rows.iter().flat_map(|row| values[row * n..(row + 1) * n].iter().copied()).collect();
    arrays::grid(py, flat, [rows.len(), n])
}

macro_rules! participants_seen {
    ($class:ident) => {
        getters! { $class {
            /// Time step now.
            time_step: i64 = |this| this.scene.time_step;
            /// Time between steps [s].
            dt: f64 = |this| this.scene.dt;
            /// Ids, ascending, shape (participants,).
            ids: Row<'py, i64> = |this, py|
                arrays::row(py, this.rows().iter().map(|row| this.scene.participants.ids[*row]).collect());
            /// Codes of their kinds, shape (participants,); `interdrive.scenario.KINDS` has the names.
            kinds: Row<'py, i64> = |this, py|
                arrays::row(py, this.rows().iter().map(|row| this.scene.participants.kind[*row] as i64).collect());
            /// Whether a participant is a static obstacle, shape (participants,).
            is_static: Row<'py, bool> = |this, py|
                arrays::row(py, this.rows().iter().map(|row| this.scene.participants.is_static[*row]).collect());
            /// Length of the footprints' bounding boxes [m], shape (participants,).
            length: Row<'py, f64> = |this, py|
                arrays::row(py, this.rows().iter().map(|row| this.scene.participants.shape[*row].extent().0).collect());
            /// Width of the footprints' bounding boxes [m], shape (participants,).
            width: Row<'py, f64> = |this, py|
                arrays::row(py, this.rows().iter().map(|row| this.scene.participants.shape[*row].extent().1).collect());
            /// Centres [m], shape (participants, history); the last column is now, nan where absent.
            x: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.x);
            /// Centres [m], world frame, shape (participants, history); nan where absent.
            y: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.y);
            /// Headings [rad], world frame, shape (participants, history); nan where absent.
            orientation: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.orientation);
            /// Speeds along the heading [m/s], shape (participants, history); nan where absent.
            velocity: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.velocity);
            /// Accelerations along the heading [m/s²], shape (participants, history); nan where absent.
            acceleration: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.acceleration);
            /// Changes of heading [rad/s], shape (participants, history); nan where absent.
            yaw_rate: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.yaw_rate);
            /// Whether a participant was present, shape (participants, history).
            valid: Grid<'py> = |this, py| past(py, &this.scene, &this.rows(), &this.scene.past.valid);
        } }
    };
}
pub(crate) use participants_seen;

#[pyclass(frozen, name = "Scene", module = "interdrive._core")]
pub struct PyScene {
    pub scene: Arc<Scene>,
    pub road: Arc<RoadNetwork>,
}

impl PyScene {
    fn rows(&self) -> Vec<usize> {
        self.scene.present.clone()
    }
}

participants_seen!(PyScene);

#[pymethods]
impl PyScene {
    /// What `World.scene_from` of another process needs: plain numbers and arrays.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let past = &self.scene.past;
        let fields = [&past.x, &past.y, &past.orientation, &past.velocity, &past.acceleration, &past.yaw_rate];
        let fields = fields.map(|values| arrays::row(py, values.clone()));
        let valid = arrays::row(py, past.valid.clone());
        let present = self.scene.present.clone();
        (self.scene.time_step, present, past.first_time_step, past.n_steps, fields, valid).into_pyobject(py)
    }
}

getters! { PyScene {
    /// The roads.
    road: PyRoadNetwork = |this| PyRoadNetwork(Arc::clone(&this.road));
    /// Speeds along the heading now [m/s], shape (participants,): stated ones, unless a recorded participant's positions
    /// contradict them.
    observed_velocity: Row<'py, f64> = |this, py|
        arrays::row(py, this.scene.present.iter().map(|row| this.scene.observed_velocity(*row)).collect());
    /// Which participants have not moved for half a second, or for all that is known; shape (participants,).
    is_standing: Row<'py, bool> = |this, py|
        arrays::row(py, this.scene.present.iter().map(|row| is_standing(&this.scene, *row)).collect());
} }

#[pymethods]
impl PyScenario {
    /// The recorded traffic at a time step, with its past, without any agent.
    #[pyo3(signature = (time_step, history_steps=30))]
    fn scene(&self, py: Python<'_>, time_step: i64, history_steps: usize) -> PyResult<PyScene> {
        let scenario = &self.0;
        let scene = detached(py, || Scene::recorded(scenario, time_step, history_steps))?;
        Ok(PyScene { scene: Arc::new(scene), road: Arc::clone(&scenario.road) })
    }
}
