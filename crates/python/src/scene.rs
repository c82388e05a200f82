//! All participants at one time step, as arrays.

use std::sync::Arc;

use interdrive_core::geometry::shape::Shape;
use interdrive_core::predict::is_standing;
use interdrive_core::road::RoadNetwork;
use interdrive_core::scene::Scene;
use interdrive_core::trajectory::State;
use interdrive_core::turn::Turn;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{self, Grid, Row};
use crate::errors::detached;
use crate::getters::getters;
use crate::scenario::{PyRoadNetwork, PyScenario};

/// A participant of which an agent was told.
pub struct Told {
    pub id: i64,
    pub kind: i64,
    pub is_static: bool,
    pub shape: Shape,
    pub state: State,
}

/// A participant in a row of the scene, or a participant that a message told an agent of.
pub enum Shown<'a> {
    Row(usize),
    Told(&'a Told),
}

/// One field of the past: shape (participants, history), the last column is now; `absent` where nothing was told.
pub fn past<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    scene: &Scene,
    shown: &[Shown<'_>],
    values: &[T],
    (told, absent): (impl Fn(&State) -> T, T),
) -> Grid<'py> {
    let n = scene.past.n_steps;
    let mut flat: Vec<T> = Vec::with_capacity(shown.len() * n);
    for one in shown {
        match one {
            Shown::Row(row) => flat.extend_from_slice(&values[row * n..(row + 1) * n]),
            Shown::Told(other) => {
                flat.resize(flat.len() + n - 1, absent);
                flat.push(told(&other.state));
            }
        }
    }
    arrays::grid(py, flat, [shown.len(), n])
}

/// A property of every participant that is shown.
pub fn of_each<T>(shown: &[Shown<'_>], row: impl Fn(usize) -> T, told: impl Fn(&Told) -> T) -> Vec<T> {
    let one = |shown: &Shown<'_>| match shown {
        Shown::Row(at) => row(*at),
        Shown::Told(other) => told(other),
    };
    shown.iter().map(one).collect()
}

/// A turn as a number: 1 to the left, 0 straight on, -1 to the right, nan: unknown.
pub fn side(turn: Option<Turn>) -> f64 {
    match turn {
        Some(Turn::Left) => 1.0,
        Some(Turn::Straight) => 0.0,
        Some(Turn::Right) => -1.0,
        None => f64::NAN,
    }
}

/// The turn of a number.
pub fn turn_of(side: f64) -> Option<Turn> {
    Turn::ALL.into_iter().find(|turn| self::side(Some(*turn)) == side)
}

/// The turn that a participant in a row of the scene shows.
pub fn shown_turn(scene: &Scene, row: usize) -> f64 {
    scene.present.binary_search(&row).map_or(f64::NAN, |place| side(scene.turns[place]))
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
                arrays::row(py, of_each(&this.shown(), |row| this.scene.participants.ids[row], |told| told.id));
            /// Codes of their kinds, shape (participants,); `interdrive.scenario.KINDS` has the names.
            kinds: Row<'py, i64> = |this, py| {
                let kind = |row: usize| this.scene.participants.kind[row] as i64;
                arrays::row(py, of_each(&this.shown(), kind, |told| told.kind))
            };
            /// Whether a participant is a static obstacle, shape (participants,).
            is_static: Row<'py, bool> = |this, py| {
                let is_static = |row: usize| this.scene.participants.is_static[row];
                arrays::row(py, of_each(&this.shown(), is_static, |told| told.is_static))
            };
            /// Length of the footprints' bounding boxes [m], shape (participants,).
            length: Row<'py, f64> = |this, py| {
                let length = |row: usize| this.scene.participants.shape[row].extent().0;
                arrays::row(py, of_each(&this.shown(), length, |told| told.shape.extent().0))
            };
            /// Width of the footprints' bounding boxes [m], shape (participants,).
            width: Row<'py, f64> = |this, py| {
                let width = |row: usize| this.scene.participants.shape[row].extent().1;
                arrays::row(py, of_each(&this.shown(), width, |told| told.shape.extent().1))
            };
            /// Centres [m], shape (participants, history); the last column is now, nan where absent.
            x: Grid<'py> = |this, py| past(py, &this.scene, &this.shown(), &this.scene.past.x, (|s| s.x, f64::NAN));
            /// Centres [m], world frame, shape (participants, history); nan where absent.
            y: Grid<'py> = |this, py| past(py, &this.scene, &this.shown(), &this.scene.past.y, (|s| s.y, f64::NAN));
            /// Headings [rad], world frame, shape (participants, history); nan where absent.
            orientation: Grid<'py> = |this, py|
                past(py, &this.scene, &this.shown(), &this.scene.past.orientation, (|s| s.orientation, f64::NAN));
            /// Speeds along the heading [m/s], shape (participants, history); nan where absent.
            velocity: Grid<'py> = |this, py|
                past(py, &this.scene, &this.shown(), &this.scene.past.velocity, (|s| s.velocity, f64::NAN));
            /// Accelerations along the heading [m/s²], shape (participants, history); nan where absent.
            acceleration: Grid<'py> = |this, py|
                past(py, &this.scene, &this.shown(), &this.scene.past.acceleration, (|s| s.acceleration, f64::NAN));
            /// Changes of heading [rad/s], shape (participants, history); nan where absent.
            yaw_rate: Grid<'py> = |this, py|
                past(py, &this.scene, &this.shown(), &this.scene.past.yaw_rate, (|s| s.yaw_rate, f64::NAN));
            /// Lane change, or turn at the next fork, that a participant shows by its blinkers, shape (participants,): 1 left,
            /// 0 straight on, -1 right, nan where it shows none.
            turn: Row<'py, f64> = |this, py|
                arrays::row(py, of_each(&this.shown(), |row| shown_turn(&this.scene, row), |_| f64::NAN));
            /// Whether a participant was present, shape (participants, history).
            valid: Grid<'py> = |this, py| past(py, &this.scene, &this.shown(), &this.scene.past.valid, (|_| true, false));
        } }
    };
}
pub(crate) use participants_seen;

/// The world at one time step, as predictors get it: all participants with their past, and the road.
///
/// Rows are sorted by id, the last column of a history is now. Arrays are read-only; positions are centres of footprints
/// in the world frame.
#[pyclass(frozen, name = "Scene", module = "interdrive._core")]
pub struct PyScene {
    pub scene: Arc<Scene>,
    pub road: Arc<RoadNetwork>,
}

impl PyScene {
    fn shown(&self) -> Vec<Shown<'_>> {
        self.scene.present.iter().map(|row| Shown::Row(*row)).collect()
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
        let turns: Vec<f64> = self.scene.turns.iter().map(|turn| side(*turn)).collect();
        (self.scene.time_step, present, turns, past.first_time_step, past.n_steps, fields, valid).into_pyobject(py)
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
