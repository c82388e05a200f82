//! Goals and the routes that lead to them as handles.

use std::sync::Arc;

use interdrive_core::geometry::shape::PlacedShape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::road::RoadNetwork;
use interdrive_core::route::{Route, RouteSettings, find_route, route_along, route_through};
use interdrive_core::scenario::{Goal, GoalState};
use interdrive_core::start::first_state;
use interdrive_core::trajectory::State;
use interdrive_core::vehicle::ParticipantKind;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::{self, Grid, Row};
use crate::errors::{InputError, detached, exception};
use crate::getters::getters;
use crate::scenario::{PyRoadNetwork, PyShape};
use crate::vehicle::PyVehicle;

/// What an agent should reach: one of some alternatives.
#[pyclass(frozen, name = "Goal", module = "interdrive._core")]
pub struct PyGoal(pub Goal);

type Interval = (f64, f64);
/// One alternative: areas in the world frame, time steps, velocity and orientation intervals.
type Alternative<'py> = (Vec<PyRef<'py, PyShape>>, (i64, i64), Option<Interval>, Option<Interval>);
/// The same on its way up, with outlines for the areas.
type Stated<'py> = (Vec<Bound<'py, PyAny>>, (i64, i64), Option<Interval>, Option<Interval>);

#[pymethods]
impl PyGoal {
    #[new]
    #[pyo3(signature = (states, pace=None))]
    fn new(states: Vec<Alternative<'_>>, pace: Option<f64>) -> Self {
        let placed = |shape: &PyRef<'_, PyShape>| PlacedShape { shape: shape.0.clone(), pose: Pose::default() };
        let states = states
            .into_iter()
            .map(|(areas, time_step, velocity, orientation)| GoalState {
                areas: areas.iter().map(placed).collect(),
                time_step,
                velocity,
                orientation,
            })
            .collect();
        Self(Goal { states, pace })
    }

    fn __repr__(&self) -> String {
        let times: Vec<_> =
            self.0.states.iter().map(|state| format!("{} to {}", state.time_step.0, state.time_step.1)).collect();
        format!("<Goal at time steps {}>", times.join(" or "))
    }

    /// Whether a state meets the goal: with and without its time.
    ///
    /// Args:
    ///     x: Centre of the footprint [m], world frame.
    ///     y: The same [m].
    ///     orientation: Heading [rad].
    ///     velocity: Speed along the heading [m/s].
    ///     time_step: When.
    fn is_met(&self, x: f64, y: f64, orientation: f64, velocity: f64, time_step: i64) -> (bool, bool) {
        let state = State { x, y, orientation, velocity, ..State::default() };
        (self.0.is_met(&state, time_step), self.0.is_met_at_any_time(&state))
    }
}

getters! { PyGoal {
    /// Every alternative: outlines of its areas in the world frame (none: anywhere), time steps, velocity interval,
    /// orientation interval.
    states: PyResult<Vec<Stated<'py>>> = |this, py| {
        let placed = |area: &PlacedShape| -> PyResult<Vec<Bound<'py, PyAny>>> {
            let in_world = |part: Vec<Point>| part.into_iter().map(|point| area.pose.world_from_body(point));
            area.shape.outline().into_iter().map(|part| arrays::points(py, in_world(part))).collect()
        };
        let stated = |state: &GoalState| {
            let outlines: PyResult<Vec<_>> = state.areas.iter().map(placed).collect();
            Ok((outlines?.into_iter().flatten().collect(), state.time_step, state.velocity, state.orientation))
        };
        this.0.states.iter().map(stated).collect()
    };
} }

/// Lanelets from the start of an agent to its goal, and the reference path along them.
#[pyclass(frozen, name = "Route", module = "interdrive._core")]
pub struct PyRoute {
    pub route: Arc<Route>,
    pub road: Arc<RoadNetwork>,
}

#[pymethods]
impl PyRoute {
    fn __repr__(&self, py: Python<'_>) -> String {
        let ids: Vec<_> = self.lanelet_ids(py).iter().map(i64::to_string).collect();
        format!("<Route over lanelets {}, {:.1} m>", ids.join(" > "), self.length(py))
    }

    /// Route and reference path from a pose to a goal for a kind of participant, given by its code; raises `NoRouteError`.
    #[staticmethod]
    #[pyo3(signature = (road, x, y, orientation, velocity, goal, user = ParticipantKind::Car as i64))]
    fn find(
        py: Python<'_>,
        road: &PyRoadNetwork,
        x: f64,
        y: f64,
        orientation: f64,
        velocity: f64,
        goal: &PyGoal,
        user: i64,
    ) -> PyResult<Self> {
        let areas: Vec<PlacedShape> = goal.0.states.iter().flat_map(|state| state.areas.iter().cloned()).collect();
        let start = Pose::new(x, y, orientation);
        let network = Arc::clone(&road.0);
        let user = ParticipantKind::from_code(user).map_err(exception)?;
        let settings = RouteSettings { user, ..RouteSettings::default() };
        let route = detached(py, || find_route(&network, start, velocity, &areas, &settings))?;
        Ok(Self { route: Arc::new(route), road: Arc::clone(&road.0) })
    }

    /// Route and reference path from a pose that follow a track at forks, for a kind of participant, given by its code;
    /// raises `NoRouteError`.
    ///
    /// Args:
    ///     road: The roads.
    ///     x: Start [m], world frame.
    ///     y: The same [m].
    ///     orientation: Heading [rad].
    ///     velocity: Speed [m/s].
    ///     track: Positions from the start on [m], shape (points, 2).
    ///     keeps_lane: Leaves its lane only where that ends.
    ///     length: Length of the route [m], if the road is as long.
    ///     user: Code of the kind.
    #[staticmethod]
    #[pyo3(signature = (
        road, x, y, orientation, velocity, track, *, keeps_lane, length, user = ParticipantKind::Car as i64
    ))]
    fn along(
        py: Python<'_>,
        road: &PyRoadNetwork,
        x: f64,
        y: f64,
        orientation: f64,
        velocity: f64,
        track: PyReadonlyArray2<'_, f64>,
        keeps_lane: bool,
        length: f64,
        user: i64,
    ) -> PyResult<Self> {
        let track = arrays::read_points("track", &track)?;
        let start = Pose::new(x, y, orientation);
        let network = Arc::clone(&road.0);
        let user = ParticipantKind::from_code(user).map_err(exception)?;
        let settings = RouteSettings { user, free_length: length, ..RouteSettings::default() };
        let route = detached(py, || route_along(&network, start, velocity, &track, keeps_lane, &settings))?;
        Ok(Self { route: Arc::new(route), road: Arc::clone(&road.0) })
    }

    /// Route and reference path from a pose over given lanelets, each a successor of the one before or beside it, to the end
    /// of the last one, where the areas of the goal are, for a kind of participant, given by its code; raises `NoRouteError`.
    #[staticmethod]
    #[pyo3(signature = (road, x, y, orientation, velocity, lanelet_ids, goal, user = ParticipantKind::Car as i64))]
    fn through(
        py: Python<'_>,
        road: &PyRoadNetwork,
        x: f64,
        y: f64,
        orientation: f64,
        velocity: f64,
        lanelet_ids: Vec<i64>,
        goal: &PyGoal,
        user: i64,
    ) -> PyResult<Self> {
        let areas: Vec<PlacedShape> = goal.0.states.iter().flat_map(|state| state.areas.iter().cloned()).collect();
        let network = Arc::clone(&road.0);
        let index =
            |id: &i64| network.index_of(*id).ok_or_else(|| InputError::new_err(format!("there is no lanelet {id}")));
        let lanelets = lanelet_ids.iter().map(index).collect::<PyResult<Vec<usize>>>()?;
        let start = Pose::new(x, y, orientation);
        let user = ParticipantKind::from_code(user).map_err(exception)?;
        let settings = RouteSettings { user, ..RouteSettings::default() };
        let route = detached(py, || route_through(&network, start, velocity, &lanelets, &areas, &settings))?;
        Ok(Self { route: Arc::new(route), road: Arc::clone(&road.0) })
    }

    /// Acceleration [m/s²] and yaw rate [rad/s] of a vehicle that starts on the route.
    ///
    /// Args:
    ///     vehicle: Its limits.
    ///     state: x, y [m], orientation [rad], velocity [m/s], acceleration, yaw rate; nan for those two where they are not
    ///         stated.
    ///     past: Speed [m/s] and heading [rad] at the time steps right before, oldest first.
    ///     dt: Time between steps [s].
    #[pyo3(signature = (vehicle, state, past, dt))]
    fn first_state(&self, vehicle: &PyVehicle, state: [f64; 6], past: Vec<(f64, f64)>, dt: f64) -> (f64, f64) {
        let [x, y, orientation, velocity, acceleration, yaw_rate] = state;
        let stated = State { x, y, orientation, velocity, acceleration, yaw_rate };
        let past: Vec<State> = past
            .into_iter()
            .map(|(velocity, orientation)| State { velocity, orientation, ..State::default() })
            .collect();
        let found = first_state(&stated, &past, dt, &self.route.path, Some(self.route.start_s), &vehicle.0);
        (found.acceleration, found.yaw_rate)
    }

    /// Arc lengths and lateral distances, to the left positive, of points relative to the reference path [m].
    ///
    /// Args:
    ///     x: Points [m], world frame, any shape.
    ///     y: The same [m].
    ///
    /// Returns:
    ///     (s, d), of the same shape; nan where a point has no foot on the path.
    fn project<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<(Row<'py, f64>, Row<'py, f64>)> {
        let (n, m) = (x.as_array().len(), y.as_array().len());
        if n != m {
            return Err(InputError::new_err(format!("x and y must have one length, not {n} and {m}")));
        }
        let (s, d): (Vec<f64>, Vec<f64>) = x
            .as_array()
            .iter()
            .zip(y.as_array())
            .map(|(x, y)| self.route.path.project(Point::new(*x, *y)).unwrap_or((f64::NAN, f64::NAN)))
            .unzip();
        Ok((arrays::row(py, s), arrays::row(py, d)))
    }
}

getters! { PyRoute {
    /// Ids of the lanelets in driving order.
    lanelet_ids: Vec<i64> = |this| this.route.lanelets.iter().map(|i| this.road.lanelets()[*i].id).collect();
    /// Reference path [m], shape (points, 2), uniform spacing.
    reference_path: Grid<'py> = |this, py| {
        let path = &this.route.path;
        arrays::points(py, path.x().iter().zip(path.y()).map(|(x, y)| Point::new(*x, *y)))
    };
    /// Heading along the reference path [rad], not wrapped.
    reference_orientation: Row<'py, f64> = |this, py| arrays::row(py, this.route.path.theta().to_vec());
    /// Curvature along the reference path [1/m].
    reference_curvature: Row<'py, f64> = |this, py| arrays::row(py, this.route.path.curvature().to_vec());
    /// Length of the reference path [m].
    length: f64 = |this| this.route.path.length();
    /// Arc length of the start (rear axle) on the reference path [m].
    start_s: f64 = |this| this.route.start_s;
    /// Arc length at which the path enters the goal area [m]; nan without an area.
    goal_entry_s: f64 = |this| this.route.goal_entry_s;
    /// Arc length at which it leaves the goal area [m]; nan without an area.
    goal_exit_s: f64 = |this| this.route.goal_exit_s;
    /// Number of lane changes on the route.
    lane_changes: usize = |this| this.route.lane_changes;
} }
