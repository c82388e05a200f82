//! The knowledge of one agent, as arrays.

use std::sync::Arc;

use interdrive_core::barrier::{Barrier, BarrierReason, Barriers};
use interdrive_core::collision::swept_boxes;
use interdrive_core::error::Error;
use interdrive_core::geometry::shape::OrientedBox;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::plan::external_plan::{PLAN_POINTS_MAX, StatedPlan, check_motion, check_plan};
use interdrive_core::road::RoadNetwork;
use interdrive_core::scene::{Perceived, PlacedBody, Scene};
use interdrive_core::trajectory::State;
use interdrive_core::world::{Agent, Progress};
use numpy::{PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMappingProxy, PyTuple};

use crate::arrays::{self, Grid, Row};
use crate::errors::{InputError, exception};
use crate::getters::getters;
use crate::predictions::PyPredictions;
use crate::route::{PyGoal, PyRoute};
use crate::scene::{Shown, Told, of_each, participants_seen, past, shown_turn};
use crate::vehicle::PyVehicle;

/// A participant that an agent with V2X knows of: how, the age of what it was told [s], and its row in the scene or what was told.
pub struct KnownBody {
    pub via: i64,
    pub age: f64,
    pub body: Result<usize, Told>,
}

/// The knowledge of one agent. `ids`, `x`, ... describe the participants that it sees or was told of; `ego` is the agent
/// itself.
#[pyclass(frozen, name = "View", module = "interdrive._core")]
pub struct PyView {
    /// As the agent perceives it.
    pub scene: Arc<Scene>,
    /// As it is, and how it seems, if the agent perceives something else.
    pub perceived: Option<(Arc<Scene>, Perceived)>,
    pub visible: Vec<usize>,
    /// All participants that it knows of, if it has V2X.
    pub known: Option<Vec<KnownBody>>,
    /// The agent's own row.
    pub row: usize,
    pub agent: Arc<Agent>,
    pub state: State,
    pub progress: Progress,
    /// At every point of the reference path.
    pub speed_limit: Vec<f64>,
    pub road: Arc<RoadNetwork>,
    /// What its driver has drawn, by name.
    pub driver: Option<Py<PyDict>>,
}

impl PyView {
    fn shown(&self) -> Vec<Shown<'_>> {
        match &self.known {
            None => self.visible.iter().map(|row| Shown::Row(*row)).collect(),
            Some(known) => {
                let bodies = known.iter().map(|known| &known.body);
                bodies.map(|body| body.as_ref().map_or_else(Shown::Told, |row| Shown::Row(*row))).collect()
            }
        }
    }

    /// The participant of which the agent was told by this id.
    fn told(&self, id: i64) -> Option<&Told> {
        self.known.iter().flatten().filter_map(|known| known.body.as_ref().err()).find(|told| told.id == id)
    }

    /// The points of a plan that was made from this view: x, y, orientation, velocity; acceleration, yaw rate.
    ///
    /// `slides`: the positions need not follow from the speeds.
    pub fn checked(
        &self,
        fields: [&PyReadonlyArrayDyn<'_, f64>; 4],
        rates: [Option<&PyReadonlyArrayDyn<'_, f64>>; 2],
        slides: bool,
    ) -> PyResult<Vec<State>> {
        // Before anything is copied.
        let n = fields.iter().map(|field| field.as_array().len()).max().unwrap_or(0);
        if n > PLAN_POINTS_MAX {
            return Err(InputError::new_err(format!("the plan has {n} points, at most {PLAN_POINTS_MAX} are allowed")));
        }
        let rate = |name: &str, k: usize| rates[k].map(|values| arrays::read_line(name, values)).transpose();
        let (acceleration, yaw_rate) = (rate("acceleration", 0)?, rate("yaw_rate", 1)?);
        let plan = StatedPlan {
            x: &arrays::read_line("x", fields[0])?,
            y: &arrays::read_line("y", fields[1])?,
            orientation: &arrays::read_line("orientation", fields[2])?,
            velocity: &arrays::read_line("velocity", fields[3])?,
            acceleration: acceleration.as_deref(),
            yaw_rate: yaw_rate.as_deref(),
        };
        let points = plan.points(self.scene.dt).map_err(exception)?;
        let vehicle = &self.agent.vehicle;
        check_plan(&points, &self.state, vehicle, self.scene.dt).map_err(exception)?;
        if !slides {
            check_motion(&points, vehicle, self.scene.dt).map_err(exception)?;
        }
        Ok(points)
    }

    /// The poses of a drive, given by its centres and headings.
    fn poses(
        &self,
        x: &PyReadonlyArray1<'_, f64>,
        y: &PyReadonlyArray1<'_, f64>,
        orientation: &PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Vec<Pose>> {
        let x = x.as_array();
        let (y, orientation) =
            (arrays::read_row("y", y, x.len())?, arrays::read_row("orientation", orientation, x.len())?);
        Ok(x.iter().zip(y).zip(orientation).map(|((x, y), theta)| Pose::new(*x, y, theta)).collect())
    }
}

participants_seen!(PyView);

getters! { PyView {
    /// How the agent knows of each participant, shape (participants,); `interdrive.run.VIA` has the names.
    via: Row<'py, i64> = |this, py| arrays::row(py, match &this.known {
        None => vec![0; this.visible.len()],
        Some(known) => known.iter().map(|known| known.via).collect(),
    });
    /// Age of what the agent was told about each participant [s], shape (participants,): of the received plan for
    /// visible participants; 0 where it was told nothing.
    age: Row<'py, f64> = |this, py| arrays::row(py, match &this.known {
        None => vec![0.0; this.visible.len()],
        Some(known) => known.iter().map(|known| known.age).collect(),
    });
} }

#[pymethods]
impl PyView {
    fn __repr__(&self) -> String {
        let (id, step, seen) = (self.agent.id, self.scene.time_step, self.shown().len());
        format!("<View of agent {id} at time step {step}: {seen} participants>")
    }

    /// The agent itself.
    #[getter]
    fn ego(slf: Py<Self>) -> PyEgo {
        PyEgo { view: slf }
    }

    /// Outlines of the parts of a participant in view, now, in the world frame.
    ///
    /// Args:
    ///     id: Of the participant.
    ///
    /// Returns:
    ///     An array of shape (vertices, 2) [m] for each part; circles as polygons.
    ///
    /// Raises:
    ///     InputError: The participant is not in view.
    fn outlines<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let participants = &self.scene.participants;
        if let Some(told) = self.told(id) {
            let pose = told.state.pose();
            let parts = told.shape.outline().into_iter();
            let world =
                |part: Vec<Point>| arrays::points(py, part.into_iter().map(|point| pose.world_from_body(point)));
            return parts.map(world).collect();
        }
        let row = self.visible.iter().find(|row| participants.ids[**row] == id);
        let row = *row.ok_or_else(|| InputError::new_err(format!("participant {id} is not in view")))?;
        let pose = self.scene.state(row).pose();
        let outlines = participants.shape[row].outline();
        outlines
            .into_iter()
            .map(|part| arrays::points(py, part.into_iter().map(|point| pose.world_from_body(point))))
            .collect()
    }

    /// Refuses a plan that the run would refuse.
    ///
    /// Args:
    ///     x: Centres of the footprint [m], world frame, shape (points,); point 0 is the present state.
    ///     y: The same [m].
    ///     orientation: Headings [rad], shape (points,).
    ///     velocity: Speeds along the heading [m/s], shape (points,).
    ///     acceleration: [m/s²], shape (points,); None: derived from the speed.
    ///     yaw_rate: [rad/s], shape (points,); None: derived from the heading.
    ///
    /// Raises:
    ///     InputError: The plan starts elsewhere, jumps, has too few points or values that are not finite, or exceeds the
    ///         top speed.
    #[pyo3(signature = (x, y, orientation, velocity, acceleration=None, yaw_rate=None))]
    fn check_plan(
        &self,
        x: PyReadonlyArrayDyn<'_, f64>,
        y: PyReadonlyArrayDyn<'_, f64>,
        orientation: PyReadonlyArrayDyn<'_, f64>,
        velocity: PyReadonlyArrayDyn<'_, f64>,
        acceleration: Option<PyReadonlyArrayDyn<'_, f64>>,
        yaw_rate: Option<PyReadonlyArrayDyn<'_, f64>>,
    ) -> PyResult<()> {
        self.checked([&x, &y, &orientation, &velocity], [acceleration.as_ref(), yaw_rate.as_ref()], false).map(|_| ())
    }

    /// Whether the agent stays on the road along a drive, from point to point, as the run judges it (`road.judge`).
    ///
    /// Args:
    ///     x: Centres of the footprint [m], world frame, shape (points,).
    ///     y: The same [m].
    ///     orientation: Headings [rad], shape (points,).
    fn on_road(
        &self,
        x: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
        orientation: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<bool> {
        let vehicle = &self.agent.vehicle;
        let footprint = |pose: &Pose| OrientedBox::new(*pose, vehicle.length, vehicle.width);
        Ok(self
            .poses(&x, &y, &orientation)?
            .windows(2)
            .all(|pair| self.road.admits_motion(vehicle, &footprint(&pair[0]), &footprint(&pair[1]))))
    }

    /// The first contact along a drive that begins now with another participant in its most probable mode.
    ///
    /// Args: x: Centres of the footprint [m], world frame, shape (points,); point i is `i * dt` from now. y: The same
    ///     [m]. orientation: Headings [rad], shape (points,). predictions: The others, as `plan` gets them.
    ///     margin_length: Total length added to the others [m]. margin_width: Total width added to the others [m].
    ///
    /// Returns:
    ///     (id, interval): interval i is between the points i and i + 1; None without a contact.
    #[pyo3(signature = (x, y, orientation, predictions, margin_length=0.0, margin_width=0.0))]
    fn first_contact(
        &self,
        x: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
        orientation: PyReadonlyArray1<'_, f64>,
        predictions: &PyPredictions,
        margin_length: f64,
        margin_width: f64,
    ) -> PyResult<Option<(i64, usize)>> {
        let vehicle = &self.agent.vehicle;
        let drive = swept_boxes(&self.poses(&x, &y, &orientation)?, vehicle.length, vehicle.width);
        let margin = [margin_length, margin_width];
        let told = |id: i64| {
            let told = self.told(id)?;
            Some(PlacedBody { shape: &told.shape, pose: told.state.pose(), is_static: told.is_static })
        };
        Ok(self.scene.first_contact(self.agent.id, &drive, &predictions.table(), margin, &told))
    }
}

#[pymethods]
impl PyPredictions {
    /// The rows that an agent may know: of those in its view, and its own.
    fn seen_by(&self, view: &PyView) -> PyResult<Self> {
        let (expected, found) = (view.scene.time_step, self.table().time_step);
        if expected != found {
            return Err(exception(Error::WrongTimeStep { what: "predictions", expected, found }));
        }
        let told = self.told.as_ref().and_then(|told| Some((told, told.known.get(&view.agent.id)?)));
        let found = if let Some((told, known)) = told {
            let own = view.scene.present.binary_search(&view.row).expect("a view is of an agent that is present");
            let mut rows: Vec<usize> = known.iter().map(|known| known.row).collect();
            rows.insert(known.partition_point(|known| known.id < view.agent.id), own);
            Self::rows_told(told, rows)
        } else {
            let mut rows = view.visible.clone();
            rows.insert(rows.partition_point(|row| *row < view.row), view.row);
            self.only(rows.into_iter().map(|row| view.scene.participants.ids[row]))
        };
        // What it was told has no errors.
        let last = told.map_or(usize::MAX, |(told, _)| told.n_present());
        Ok(match &view.perceived {
            Some((truth, seems)) => found.perceived(truth, seems, last),
            None => found,
        })
    }
}

/// `s`, `front`, and s, until, reason and by of each barrier.
pub type ProgressParts = (f64, f64, Vec<(f64, f64, u8, Option<i64>)>);

/// From what `Ego` hands over to other processes.
pub fn progress((s, front, parts): ProgressParts) -> PyResult<Progress> {
    if parts.len() > Barriers::CAPACITY {
        return Err(InputError::new_err(format!("at most {} barriers, not {}", Barriers::CAPACITY, parts.len())));
    }
    let mut barriers = Barriers::NONE;
    for (s, until, reason, by) in parts {
        let reason = *BarrierReason::ALL
            .get(usize::from(reason))
            .ok_or_else(|| InputError::new_err(format!("unknown reason of a barrier: {reason}")))?;
        barriers.push(Barrier { s, until, reason, by });
    }
    Ok(Progress { s, front, barriers })
}

/// What the front of an agent must not pass now, the nearest first; one entry per barrier.
#[pyclass(frozen, name = "Barriers", module = "interdrive._core")]
pub struct PyBarriers(Vec<Barrier>);

#[pymethods]
impl PyBarriers {
    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        let each = |one: &Barrier| format!("{} at {:.2} m for {:.1} s", one.reason.name(), one.s, one.until);
        format!("<Barriers: {}>", self.0.iter().map(each).collect::<Vec<_>>().join(", "))
    }
}

getters! { PyBarriers {
    /// Arc lengths on the reference path that the front must not pass [m], shape (barriers,), ascending.
    s: Row<'py, f64> = |this, py| arrays::row(py, this.0.iter().map(|one| one.s).collect());
    /// Until when [s from now], shape (barriers,); infinite: until the agent is told otherwise.
    until: Row<'py, f64> = |this, py| arrays::row(py, this.0.iter().map(|one| one.until).collect());
    /// Why, one word per barrier: "line" (stop sign), "light", "yield", "queue", "exit", "crosswalk", "unseen" or
    /// "agreement".
    reason: Bound<'py, PyTuple> = |this, py| {
        PyTuple::new(py, this.0.iter().map(|one| one.reason.name())).expect("names are strings")
    };
    /// The participants to which the agent gives way, shape (barriers,); -1 for none.
    by_id: Row<'py, i64> = |this, py| arrays::row(py, this.0.iter().map(|one| one.by.unwrap_or(-1)).collect());
} }

/// The agent itself within its view.
#[pyclass(frozen, name = "Ego", module = "interdrive._core")]
pub struct PyEgo {
    pub view: Py<PyView>,
}

impl PyEgo {
    /// The barrier that it has to heed first.
    fn hardest(&self) -> Option<Barrier> {
        let view = self.view.get();
        let Progress { front, barriers, .. } = view.progress;
        barriers.hardest(front, view.state.velocity.max(0.0)).copied()
    }
}

#[pymethods]
impl PyEgo {
    fn __repr__(&self) -> String {
        let PyView { agent, state: State { x, y, orientation, velocity, .. }, .. } = self.view.get();
        format!("<Ego {}: centre ({x:.2}, {y:.2}) m, {orientation:.3} rad, {velocity:.2} m/s>", agent.id)
    }
}

getters! { PyEgo {
    /// Id of the agent.
    id: i64 = |this| this.view.get().agent.id;
    /// Centre [m], world frame.
    x: f64 = |this| this.view.get().state.x;
    /// Centre [m], world frame.
    y: f64 = |this| this.view.get().state.y;
    /// Heading [rad], world frame.
    orientation: f64 = |this| this.view.get().state.orientation;
    /// Speed along the heading [m/s].
    velocity: f64 = |this| this.view.get().state.velocity;
    /// Acceleration along the heading [m/s²].
    acceleration: f64 = |this| this.view.get().state.acceleration;
    /// Change of heading [rad/s].
    yaw_rate: f64 = |this| this.view.get().state.yaw_rate;
    /// (x, y, orientation, velocity, acceleration, yaw_rate) as an array.
    state: Row<'py, f64> = |this, py| {
        let s = &this.view.get().state;
        arrays::row(py, vec![s.x, s.y, s.orientation, s.velocity, s.acceleration, s.yaw_rate])
    };
    /// Size and limits of the vehicle.
    vehicle: PyVehicle = |this| PyVehicle(this.view.get().agent.vehicle);
    /// The goal of the agent.
    goal: PyGoal = |this| PyGoal(this.view.get().agent.goal.clone());
    /// What its driver has drawn, by name, as numbers; empty if its planner was given no drivers.
    driver: Bound<'py, PyMappingProxy> = |this, py| {
        let own = this.view.get().driver.as_ref().map_or_else(|| PyDict::new(py), |own| own.bind(py).clone());
        PyMappingProxy::new(py, own.as_mapping())
    };
    /// Lanelets to the goal and the reference path along them.
    route: PyRoute = |this| {
        let view = this.view.get();
        PyRoute { route: Arc::clone(&view.agent.route), road: Arc::clone(&view.road) }
    };
    /// Arc length of the rear axle on the reference path [m].
    s: f64 = |this| this.view.get().progress.s;
    /// Arc length on the reference path of the barrier to heed first [m]: the nearest, unless another one takes a harder
    /// deceleration; infinite without any.
    stop_s: f64 = |this| this.hardest().map_or(f64::INFINITY, |one| one.s);
    /// Until when it holds [s from now]; infinite: until the agent is told otherwise.
    stop_release: f64 = |this| this.hardest().map_or(f64::INFINITY, |one| one.until);
    /// The participant to which the agent gives way there.
    stop_by: Option<i64> = |this| this.hardest().and_then(|one| one.by);
    /// All that the front must not pass now, the nearest first.
    barriers: PyBarriers = |this| {
        let mut all = this.view.get().progress.barriers.to_vec();
        all.sort_by(|a, b| a.s.total_cmp(&b.s));
        PyBarriers(all)
    };
    /// Where it is and what it must not pass, as `World.view` in another process takes it.
    _progress: ProgressParts = |this| {
        let Progress { s, front, barriers } = this.view.get().progress;
        (s, front, barriers.iter().map(|one| (one.s, one.until, one.reason as u8, one.by)).collect())
    };
    /// Speed limit at every point of the reference path [m/s]; infinite where there is none.
    speed_limit: Row<'py, f64> = |this, py| arrays::row(py, this.view.get().speed_limit.clone());
    /// First and last time step at which the goal can be reached in time; the largest integer where there is no last one.
    goal_time_step: (i64, i64) = |this| {
        let goal = &this.view.get().agent.goal;
        (goal.earliest_time_step().unwrap_or(0), goal.latest_time_step().unwrap_or(i64::MAX))
    };
    /// Border of the drivable area within the sensor radius, shape (edges, 2, 2).
    road_edges: Grid<'py> = |this, py| {
        let view = this.view.get();
        let center = Point::new(view.state.x, view.state.y);
        let radius = view.agent.view.sensor_radius;
        let aabb = interdrive_core::geometry::Aabb { min: center, max: center }.grown(radius);
        let mut near = Vec::new();
        view.road.edges_near(&aabb, &mut near);
        let edges = view.road.road_edges();
        let flat: Vec<f64> =
            near.iter().map(|i| &edges[*i as usize]).flat_map(|e| [e.a.x, e.a.y, e.b.x, e.b.y]).collect();
        arrays::grid(py, flat, [near.len(), 2, 2])
    };
} }
