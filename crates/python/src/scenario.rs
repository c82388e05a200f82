//! Shapes, roads, scenarios, goals and routes as handles.

use std::sync::Arc;

use interdrive_core::geometry::shape::{PlacedShape, Shape};
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings};
use interdrive_core::route::{Route, RouteSettings, find_route};
use interdrive_core::scenario::{Goal, GoalState, Obstacles, Scenario};
use interdrive_core::scene::Scene;
use interdrive_core::trajectory::States;
use interdrive_core::vehicle::{ParticipantKind, Vehicle};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{InputError, detached, exception};
use crate::view::PyScene;

#[pyclass(frozen, name = "Shape", module = "interdrive._core")]
pub struct PyShape(pub Shape);

fn checked(shape: Shape) -> PyResult<PyShape> {
    shape.check().map_err(exception)?;
    Ok(PyShape(shape))
}

#[pymethods]
impl PyShape {
    #[staticmethod]
    #[pyo3(signature = (length, width, x=0.0, y=0.0, orientation=0.0))]
    fn rectangle(length: f64, width: f64, x: f64, y: f64, orientation: f64) -> PyResult<Self> {
        checked(Shape::rectangle_at(length, width, Point::new(x, y), orientation))
    }

    #[staticmethod]
    #[pyo3(signature = (radius, x=0.0, y=0.0))]
    fn circle(radius: f64, x: f64, y: f64) -> PyResult<Self> {
        checked(Shape::circle_at(radius, Point::new(x, y)))
    }

    #[staticmethod]
    fn polygon(vertices: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        Shape::polygon(&arrays::read_points("vertices", &vertices)?).map(Self).map_err(exception)
    }

    #[staticmethod]
    fn group(members: Vec<PyRef<'_, Self>>) -> Self {
        Self(Shape::group(members.iter().map(|member| member.0.clone()).collect()))
    }

    /// Length and width of the bounding box in the body frame [m].
    #[getter]
    fn extent(&self) -> (f64, f64) {
        self.0.extent()
    }

    fn outline<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        self.0.outline().into_iter().map(|part| arrays::points(py, part)).collect()
    }

    #[pyo3(signature = (pose, other, other_pose))]
    fn distance(&self, pose: (f64, f64, f64), other: &Self, other_pose: (f64, f64, f64)) -> f64 {
        let place = |(x, y, orientation)| Pose::new(x, y, orientation);
        self.0.distance(place(pose), &other.0, place(other_pose))
    }
}

#[pyclass(frozen, name = "RoadNetwork", module = "interdrive._core")]
pub struct PyRoadNetwork(pub Arc<RoadNetwork>);

#[pymethods]
impl PyRoadNetwork {
    #[new]
    #[pyo3(signature = (
        ids, left, right, predecessors, successors, adjacent_left, adjacent_left_same_direction,
        adjacent_right, adjacent_right_same_direction, speed_limit, *, gap_tolerance, open_end_length
    ))]
    fn new(
        py: Python<'_>,
        ids: Vec<i64>,
        left: Vec<PyReadonlyArray2<'_, f64>>,
        right: Vec<PyReadonlyArray2<'_, f64>>,
        predecessors: Vec<Vec<i64>>,
        successors: Vec<Vec<i64>>,
        adjacent_left: Vec<i64>,
        adjacent_left_same_direction: Vec<bool>,
        adjacent_right: Vec<i64>,
        adjacent_right_same_direction: Vec<bool>,
        speed_limit: Vec<f64>,
        gap_tolerance: f64,
        open_end_length: f64,
    ) -> PyResult<Self> {
        let n = ids.len();
        let lengths = [
            left.len(),
            right.len(),
            predecessors.len(),
            successors.len(),
            adjacent_left.len(),
            adjacent_left_same_direction.len(),
            adjacent_right.len(),
            adjacent_right_same_direction.len(),
            speed_limit.len(),
        ];
        if lengths.iter().any(|length| *length != n) {
            return Err(InputError::new_err(format!("{n} lanelet ids, but other fields have {lengths:?} entries")));
        }
        let neighbour = |id: i64, same: bool| (id >= 0).then_some((id, same));
        let mut lanelets = Vec::with_capacity(n);
        for i in 0..n {
            lanelets.push(LaneletInput {
                id: ids[i],
                left: arrays::read_points("left", &left[i])?,
                right: arrays::read_points("right", &right[i])?,
                predecessors: predecessors[i].clone(),
                successors: successors[i].clone(),
                adjacent_left: neighbour(adjacent_left[i], adjacent_left_same_direction[i]),
                adjacent_right: neighbour(adjacent_right[i], adjacent_right_same_direction[i]),
                speed_limit: speed_limit[i],
            });
        }
        let settings = RoadSettings { gap_tolerance, open_end_length };
        detached(py, || RoadNetwork::new(lanelets, settings)).map(|road| Self(Arc::new(road)))
    }

    /// Whether each point (x, y) lies on a lanelet.
    fn on_lanelet<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = arrays::read_points("points", &points)?;
        let inside = points.into_iter().map(|point| !self.0.lanelets_at(point).is_empty()).collect();
        Ok(arrays::row(py, inside))
    }

    /// Whether each point (x, y) is drivable: within the gap tolerance of a lanelet or of what continues an open end.
    fn on_road<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'_, f64>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = arrays::read_points("points", &points)?;
        Ok(arrays::row(py, points.into_iter().map(|point| self.0.is_on_road(point)).collect()))
    }

    /// Ids of the lanelets that contain a point.
    fn lanelets_at(&self, x: f64, y: f64) -> Vec<i64> {
        self.0.lanelets_at(Point::new(x, y)).into_iter().map(|i| self.0.lanelets()[i].id).collect()
    }

    /// Best lanelets for a pose: (id, s, d, heading error), best first.
    fn matching(&self, x: f64, y: f64, orientation: f64, tolerance: f64, angle_max: f64) -> Vec<(i64, f64, f64, f64)> {
        let found = self.0.matching(Pose::new(x, y, orientation), tolerance, angle_max);
        found.into_iter().map(|m| (self.0.lanelets()[m.lanelet].id, m.s, m.d, m.heading_error)).collect()
    }

    /// Polygons of the stretch of lane around arc length `s` of a lanelet.
    fn lane_stretch<'py>(
        &self,
        py: Python<'py>,
        lanelet_id: i64,
        s: f64,
        before: f64,
        after: f64,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let index = self
            .0
            .index_of(lanelet_id)
            .ok_or_else(|| exception(interdrive_core::error::Error::UnknownId { what: "lanelet", id: lanelet_id }))?;
        self.0.lane_stretch(index, s, before, after).into_iter().map(|polygon| arrays::points(py, polygon)).collect()
    }

    /// Border of the drivable area, shape (edges, 2, 2).
    #[getter]
    fn road_edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let edges = self.0.road_edges();
        let flat: Vec<f64> = edges.iter().flat_map(|edge| [edge.a.x, edge.a.y, edge.b.x, edge.b.y]).collect();
        arrays::grid(py, flat, [edges.len(), 2, 2])
    }

    /// Whether a footprint at a pose is covered by the road.
    fn covers(&self, shape: &PyShape, x: f64, y: f64, orientation: f64) -> bool {
        self.0.covers(&shape.0, Pose::new(x, y, orientation))
    }
}

#[pyclass(frozen, name = "Scenario", module = "interdrive._core")]
pub struct PyScenario(pub Arc<Scenario>);

#[pymethods]
impl PyScenario {
    #[new]
    #[pyo3(signature = (
        dt, road, ids, kinds, shapes, is_static, first_time_step, x, y, orientation, velocity, acceleration, yaw_rate, valid
    ))]
    fn new(
        dt: f64,
        road: &PyRoadNetwork,
        ids: Vec<i64>,
        kinds: Vec<i64>,
        shapes: Vec<PyRef<'_, PyShape>>,
        is_static: Vec<bool>,
        first_time_step: i64,
        x: PyReadonlyArray2<'_, f64>,
        y: PyReadonlyArrayDyn<'_, f64>,
        orientation: PyReadonlyArrayDyn<'_, f64>,
        velocity: PyReadonlyArrayDyn<'_, f64>,
        acceleration: PyReadonlyArrayDyn<'_, f64>,
        yaw_rate: PyReadonlyArrayDyn<'_, f64>,
        valid: PyReadonlyArrayDyn<'_, bool>,
    ) -> PyResult<Self> {
        let n_steps = x.as_array().shape()[1];
        let shape = [ids.len(), n_steps];
        if x.as_array().shape() != shape {
            return Err(InputError::new_err(format!(
                "x: {} rows given for {} obstacle ids",
                x.as_array().shape()[0],
                ids.len()
            )));
        }
        let states = States {
            ids,
            first_time_step,
            n_steps,
            x: x.as_array().iter().copied().collect(),
            y: arrays::read_grid("y", &y, &shape)?,
            orientation: arrays::read_grid("orientation", &orientation, &shape)?,
            velocity: arrays::read_grid("velocity", &velocity, &shape)?,
            acceleration: arrays::read_grid("acceleration", &acceleration, &shape)?,
            yaw_rate: arrays::read_grid("yaw_rate", &yaw_rate, &shape)?,
            valid: arrays::read_grid("valid", &valid, &shape)?,
        };
        let kind = kinds.into_iter().map(ParticipantKind::from_code).collect::<Result<_, _>>().map_err(exception)?;
        let obstacles =
            Obstacles { kind, shape: shapes.iter().map(|shape| shape.0.clone()).collect(), is_static, states };
        Scenario::new(dt, Arc::clone(&road.0), obstacles).map(|scenario| Self(Arc::new(scenario))).map_err(exception)
    }

    /// Time between steps [s].
    #[getter]
    fn dt(&self) -> f64 {
        self.0.dt
    }

    /// The recorded traffic at a time step, with its past, without any agent.
    #[pyo3(signature = (time_step, history_steps=30))]
    fn scene(&self, py: Python<'_>, time_step: i64, history_steps: usize) -> PyResult<PyScene> {
        let scenario = &self.0;
        let scene = detached(py, || Scene::recorded(scenario, time_step, history_steps))?;
        Ok(PyScene { scene: Arc::new(scene), road: Arc::clone(&scenario.road) })
    }
}

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
    fn new(states: Vec<Alternative<'_>>) -> Self {
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
        Self(Goal { states })
    }

    /// Every alternative: outlines of its areas in the world frame (none: anywhere), time steps, velocity interval,
    /// orientation interval.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Vec<Stated<'py>>> {
        let placed = |area: &PlacedShape| -> PyResult<Vec<Bound<'py, PyAny>>> {
            let in_world = |part: Vec<Point>| part.into_iter().map(|point| area.pose.world_from_body(point));
            area.shape.outline().into_iter().map(|part| arrays::points(py, in_world(part))).collect()
        };
        let stated = |state: &GoalState| {
            let outlines: PyResult<Vec<_>> = state.areas.iter().map(placed).collect();
            Ok((outlines?.into_iter().flatten().collect(), state.time_step, state.velocity, state.orientation))
        };
        self.0.states.iter().map(stated).collect()
    }

    /// Whether a state meets the goal, with and without its time.
    fn is_met(&self, x: f64, y: f64, orientation: f64, velocity: f64, time_step: i64) -> (bool, bool) {
        let state = interdrive_core::trajectory::State { x, y, orientation, velocity, ..Default::default() };
        let any = |test: &dyn Fn(&GoalState) -> bool| self.0.states.iter().any(test);
        (any(&|goal| goal.is_met(&state, time_step)), any(&|goal| goal.is_met_at_any_time(&state)))
    }
}

#[pyclass(frozen, name = "Vehicle", module = "interdrive._core", from_py_object)]
#[derive(Clone)]
pub struct PyVehicle(pub Vehicle);

#[pymethods]
impl PyVehicle {
    /// Limits that fit a footprint; keyword arguments replace single limits.
    #[new]
    #[pyo3(signature = (
        kind, length, width, *, acceleration_max=None, velocity_max=None, steering_angle_max=None,
        steering_rate_max=None, lateral_acceleration_max=None
    ))]
    fn new(
        kind: i64,
        length: f64,
        width: f64,
        acceleration_max: Option<f64>,
        velocity_max: Option<f64>,
        steering_angle_max: Option<f64>,
        steering_rate_max: Option<f64>,
        lateral_acceleration_max: Option<f64>,
    ) -> PyResult<Self> {
        let kind = ParticipantKind::from_code(kind).map_err(exception)?;
        let mut vehicle = Vehicle::for_footprint(kind, length, width).map_err(exception)?;
        for (name, field, value) in [
            ("acceleration_max", &mut vehicle.acceleration_max, acceleration_max),
            ("velocity_max", &mut vehicle.velocity_max, velocity_max),
            ("steering_angle_max", &mut vehicle.steering_angle_max, steering_angle_max),
            ("steering_rate_max", &mut vehicle.steering_rate_max, steering_rate_max),
            ("lateral_acceleration_max", &mut vehicle.lateral_acceleration_max, lateral_acceleration_max),
        ] {
            match value {
                Some(value) if value > 0.0 && value.is_finite() => *field = value,
                Some(value) => {
                    return Err(InputError::new_err(format!("vehicle.{name} must be positive, not {value}")));
                }
                None => {}
            }
        }
        Ok(Self(vehicle))
    }

    /// Length of the footprint [m].
    #[getter]
    fn length(&self) -> f64 {
        self.0.length
    }
    /// Width of the footprint [m].
    #[getter]
    fn width(&self) -> f64 {
        self.0.width
    }
    /// Distance of the axles [m].
    #[getter]
    fn wheelbase(&self) -> f64 {
        self.0.wheelbase
    }
    /// From the rear axle forward to the centre of the footprint [m].
    #[getter]
    fn rear_axle_to_center(&self) -> f64 {
        self.0.rear_axle_to_center
    }
    /// Largest acceleration and deceleration [m/s²].
    #[getter]
    fn acceleration_max(&self) -> f64 {
        self.0.acceleration_max
    }
    /// Above this speed the engine limits the acceleration to `acceleration_max * velocity_switch / v` [m/s].
    #[getter]
    fn velocity_switch(&self) -> f64 {
        self.0.velocity_switch
    }
    /// Top speed [m/s].
    #[getter]
    fn velocity_max(&self) -> f64 {
        self.0.velocity_max
    }
    /// Largest steering angle [rad].
    #[getter]
    fn steering_angle_max(&self) -> f64 {
        self.0.steering_angle_max
    }
    /// Largest change of the steering angle [rad/s].
    #[getter]
    fn steering_rate_max(&self) -> f64 {
        self.0.steering_rate_max
    }
    /// Largest lateral acceleration [m/s²].
    #[getter]
    fn lateral_acceleration_max(&self) -> f64 {
        self.0.lateral_acceleration_max
    }
    /// Curvature of the rear axle's path at full steering [1/m].
    #[getter]
    fn curvature_max(&self) -> f64 {
        self.0.curvature_max()
    }
}

#[pyclass(frozen, name = "Route", module = "interdrive._core")]
pub struct PyRoute {
    pub route: Arc<Route>,
    pub road: Arc<RoadNetwork>,
}

#[pymethods]
impl PyRoute {
    /// Route and reference path from a pose to a goal; raises `NoRouteError`.
    #[staticmethod]
    fn find(
        py: Python<'_>,
        road: &PyRoadNetwork,
        x: f64,
        y: f64,
        orientation: f64,
        velocity: f64,
        goal: &PyGoal,
    ) -> PyResult<Self> {
        let areas: Vec<PlacedShape> = goal.0.states.iter().flat_map(|state| state.areas.iter().cloned()).collect();
        let start = Pose::new(x, y, orientation);
        let network = Arc::clone(&road.0);
        let route = detached(py, || find_route(&network, start, velocity, &areas, &RouteSettings::default()))?;
        Ok(Self { route: Arc::new(route), road: Arc::clone(&road.0) })
    }

    /// Ids of the lanelets in driving order.
    #[getter]
    fn lanelet_ids(&self) -> Vec<i64> {
        self.route.lanelets.iter().map(|i| self.road.lanelets()[*i].id).collect()
    }

    /// Reference path [m], shape (points, 2), uniform spacing.
    #[getter]
    fn reference_path<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let path = &self.route.path;
        arrays::points(py, path.x().iter().zip(path.y()).map(|(x, y)| Point::new(*x, *y)))
    }

    /// Heading along the reference path [rad], not wrapped.
    #[getter]
    fn reference_orientation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        arrays::row(py, self.route.path.theta().to_vec())
    }

    /// Curvature along the reference path [1/m].
    #[getter]
    fn reference_curvature<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        arrays::row(py, self.route.path.curvature().to_vec())
    }

    /// Length of the reference path [m].
    #[getter]
    fn length(&self) -> f64 {
        self.route.path.length()
    }
    /// Arc length of the start (rear axle) on the reference path [m].
    #[getter]
    fn start_s(&self) -> f64 {
        self.route.start_s
    }
    /// Arc length at which the path enters the goal area [m]; nan without an area.
    #[getter]
    fn goal_entry_s(&self) -> f64 {
        self.route.goal_entry_s
    }
    /// Arc length at which it leaves the goal area [m]; nan without an area.
    #[getter]
    fn goal_exit_s(&self) -> f64 {
        self.route.goal_exit_s
    }
    /// Number of lane changes on the route.
    #[getter]
    fn lane_changes(&self) -> usize {
        self.route.lane_changes
    }

    /// Arc length and signed lateral distance of a point on the reference path, nan where it has no foot.
    fn project<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
    ) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let (s, d): (Vec<f64>, Vec<f64>) = x
            .as_array()
            .iter()
            .zip(y.as_array())
            .map(|(x, y)| self.route.path.project(Point::new(*x, *y)).unwrap_or((f64::NAN, f64::NAN)))
            .unzip();
        (arrays::row(py, s), arrays::row(py, d))
    }
}
