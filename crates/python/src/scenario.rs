//! Shapes, roads and scenarios as handles.

use std::sync::Arc;

use interdrive_core::control::{Control, Priorities, Signal, StopLineInput, TrafficLight};
use interdrive_core::error::Error;
use interdrive_core::geometry::shape::Shape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::junctions::Area;
use interdrive_core::right_of_way::meeting_width;
use interdrive_core::road::{LaneMatch, LaneletInput, RoadNetwork, Users};
use interdrive_core::scenario::{Obstacles, Scenario};
use interdrive_core::trajectory::States;
use interdrive_core::turn::Turn;
use interdrive_core::vehicle::ParticipantKind;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Grid, Row};
use crate::errors::{InputError, detached, exception};
use crate::getters::getters;
use crate::settings::read;

/// Poses, ids of lanelets, arc lengths [m] and offsets [m].
type LanesBelow<'py> = (Row<'py, i64>, Row<'py, i64>, Row<'py, f64>, Row<'py, f64>);

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

    fn outline<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        self.0.outline().into_iter().map(|part| arrays::points(py, part)).collect()
    }

    #[pyo3(signature = (pose, other, other_pose))]
    fn distance(&self, pose: (f64, f64, f64), other: &Self, other_pose: (f64, f64, f64)) -> f64 {
        let place = |(x, y, orientation)| Pose::new(x, y, orientation);
        self.0.distance(place(pose), &other.0, place(other_pose))
    }
}

getters! { PyShape {
    /// Length and width of the bounding box in the body frame [m].
    extent: (f64, f64) = |this| this.0.extent();
} }

/// The roads: lanelets, and the drivable area that they cover.
#[pyclass(frozen, name = "RoadNetwork", module = "interdrive._core")]
pub struct PyRoadNetwork(pub Arc<RoadNetwork>);

#[pymethods]
impl PyRoadNetwork {
    #[new]
    #[pyo3(signature = (
        ids, left, right, predecessors, successors, adjacent_left, adjacent_left_same_direction,
        adjacent_right, adjacent_right_same_direction, speed_limit, users, settings, heights=Vec::new()
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
        users: Vec<u32>,
        settings: &Bound<'_, PyAny>,
        heights: Vec<(i64, PyReadonlyArray2<'_, f64>, PyReadonlyArray1<'_, f64>)>,
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
            users.len(),
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
                users: Users::from_bits(users[i]),
            });
        }
        let settings = read(settings)?;
        let stated = heights.iter().map(|(id, points, heights)| {
            let points = arrays::read_points("heights", points)?;
            let heights = arrays::read_row("heights", heights, points.len())?;
            Ok((*id, points.into_iter().zip(heights).collect()))
        });
        let stated: Vec<_> = stated.collect::<PyResult<_>>()?;
        let road = detached(py, || RoadNetwork::new(lanelets, settings))?;
        Ok(Self(Arc::new(if stated.is_empty() { road } else { road.with_heights(stated) })))
    }

    /// Both bounds of every lanelet, left before right, in driving direction: vertices [m], shape (n, 2), and whether no
    /// lanelet lies beyond.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Vec<(Bound<'py, PyAny>, bool)>> {
        let sides = self.0.lanelets().iter().flat_map(|lanelet| {
            [(&lanelet.left, lanelet.adjacent_left.is_none()), (&lanelet.right, lanelet.adjacent_right.is_none())]
        });
        sides.map(|(bound, is_outer)| Ok((arrays::points(py, bound.iter().copied())?, is_outer))).collect()
    }

    /// Whether each of the `points` [m], shape (n, 2), lies on a lanelet; shape (n,).
    fn on_lanelet<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'_, f64>) -> PyResult<Row<'py, bool>> {
        let points = arrays::read_points("points", &points)?;
        let inside = points.into_iter().map(|point| !self.0.lanelets_at(point).is_empty()).collect();
        Ok(arrays::row(py, inside))
    }

    /// Whether each of the `points` [m], shape (n, 2), can be driven on: within the gap tolerance of a lanelet or of what
    /// continues an open end; shape (n,).
    fn on_road<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'_, f64>) -> PyResult<Row<'py, bool>> {
        let points = arrays::read_points("points", &points)?;
        Ok(arrays::row(py, points.into_iter().map(|point| self.0.is_on_road(point)).collect()))
    }

    /// Ids of the lanelets that contain the point `x`, `y` [m], world frame.
    fn lanelets_at(&self, x: f64, y: f64) -> Vec<i64> {
        self.0.lanelets_at(Point::new(x, y)).into_iter().map(|i| self.0.lanelets()[i].id).collect()
    }

    /// Best lanelets for a pose, best first.
    ///
    /// Args:
    ///     x: Position [m], world frame.
    ///     y: The same [m].
    ///     orientation: Heading [rad].
    ///     tolerance: Largest distance from a lanelet [m].
    ///     angle_max: Largest difference from its direction [rad].
    ///
    /// Returns:
    ///     (id, arc length s [m], offset d to the left [m], difference of headings [rad]) for each.
    fn matching(&self, x: f64, y: f64, orientation: f64, tolerance: f64, angle_max: f64) -> Vec<(i64, f64, f64, f64)> {
        let found = self.0.matching(Pose::new(x, y, orientation), tolerance, angle_max);
        found.into_iter().map(|m| (self.0.lanelets()[m.lanelet].id, m.s, m.d, m.heading_error)).collect()
    }

    /// Whether a lanelet is a lane for a kind of participant, given by its code.
    fn admits(&self, lanelet_id: i64, kind: i64) -> PyResult<bool> {
        let unknown = || exception(Error::UnknownId { what: "lanelet", id: lanelet_id });
        let index = self.0.index_of(lanelet_id).ok_or_else(unknown)?;
        let kind = ParticipantKind::from_code(kind).map_err(exception)?;
        Ok(self.0.lanelets()[index].users.admits(kind))
    }

    /// Ids of the lanelets to which a lanelet leads, ascending; stated ones that lie elsewhere are not among them.
    fn successors(&self, lanelet_id: i64) -> PyResult<Vec<i64>> {
        let unknown = || exception(Error::UnknownId { what: "lanelet", id: lanelet_id });
        let lanelets = self.0.lanelets();
        let index = self.0.index_of(lanelet_id).ok_or_else(unknown)?;
        Ok(lanelets[index].successors.iter().map(|next| lanelets[*next].id).collect())
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

    /// Whether one pose (x, y, orientation) is on a road above or below that of another.
    fn are_apart(&self, one: (f64, f64, f64), other: (f64, f64, f64)) -> bool {
        let pose = |(x, y, orientation)| Pose::new(x, y, orientation);
        self.0.are_apart(pose(one), pose(other))
    }

    /// For each pose the largest speed limit of the lanelets at its position that lead its way (within 90 degrees) [m/s],
    /// infinite if one of them has none, nan where none leads its way; and the least difference of headings from any
    /// lanelet there [rad], nan beside all of them.
    fn lane_rules<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'py, f64>,
        y: PyReadonlyArray1<'py, f64>,
        orientation: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Row<'py, f64>, Row<'py, f64>)> {
        let n = x.as_array().len();
        let (x, y) = (arrays::read_row("x", &x, n)?, arrays::read_row("y", &y, n)?);
        let theta = arrays::read_row("orientation", &orientation, n)?;
        let found: Vec<(f64, f64)> = (0..n).map(|i| self.0.lane_rules(Pose::new(x[i], y[i], theta[i]))).collect();
        Ok((arrays::row(py, found.iter().map(|f| f.0).collect()), arrays::row(py, found.iter().map(|f| f.1).collect())))
    }

    /// The lanelets below each pose that lead its way within an angle [rad]: positions of the poses, ids of the lanelets,
    /// arc lengths on their centre lines [m], and offsets from these to the left [m]; for each pose the best one first.
    fn lanes_below<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'py, f64>,
        y: PyReadonlyArray1<'py, f64>,
        orientation: PyReadonlyArray1<'py, f64>,
        angle_max: f64,
    ) -> PyResult<LanesBelow<'py>> {
        let n = x.as_array().len();
        let (x, y) = (arrays::read_row("x", &x, n)?, arrays::read_row("y", &y, n)?);
        let theta = arrays::read_row("orientation", &orientation, n)?;
        let road = &self.0;
        let found: Vec<(i64, LaneMatch)> = detached(py, || {
            let below = |i: usize| {
                let found = road.matching(Pose::new(x[i], y[i], theta[i]), 0.0, angle_max);
                found.into_iter().map(move |lane| (i as i64, lane))
            };
            Ok((0..n).flat_map(below).collect())
        })?;
        let ids = found.iter().map(|(_, lane)| road.lanelets()[lane.lanelet].id).collect();
        Ok((
            arrays::row(py, found.iter().map(|(pose, _)| *pose).collect()),
            arrays::row(py, ids),
            arrays::row(py, found.iter().map(|(_, lane)| lane.s).collect()),
            arrays::row(py, found.iter().map(|(_, lane)| lane.d).collect()),
        ))
    }

    /// Whether a footprint at a pose is covered by the road.
    fn covers(&self, shape: &PyShape, x: f64, y: f64, orientation: f64) -> bool {
        self.0.covers(&shape.0, Pose::new(x, y, orientation))
    }
}

getters! { PyRoadNetwork {
    /// Border of the drivable area, shape (edges, 2, 2).
    road_edges: Grid<'py> = |this, py| {
        let edges = this.0.road_edges();
        let flat: Vec<f64> = edges.iter().flat_map(|edge| [edge.a.x, edge.a.y, edge.b.x, edge.b.y]).collect();
        arrays::grid(py, flat, [edges.len(), 2, 2])
    };
} }

/// Participants with their footprints, and their states at all time steps.
#[pyclass(frozen, name = "Participants", module = "interdrive._core")]
pub struct PyParticipants {
    pub states: States,
    pub shapes: Vec<Shape>,
    pub is_static: Vec<bool>,
}

#[pymethods]
impl PyParticipants {
    /// From arrays of shape (participants, time_steps); without yaw rates these are nan.
    #[new]
    #[pyo3(signature = (ids, shapes, is_static, first_time_step, x, y, orientation, velocity, acceleration, valid, yaw_rate=None))]
    fn new(
        ids: Vec<i64>,
        shapes: Vec<PyRef<'_, PyShape>>,
        is_static: Vec<bool>,
        first_time_step: i64,
        x: PyReadonlyArray2<'_, f64>,
        y: PyReadonlyArrayDyn<'_, f64>,
        orientation: PyReadonlyArrayDyn<'_, f64>,
        velocity: PyReadonlyArrayDyn<'_, f64>,
        acceleration: PyReadonlyArrayDyn<'_, f64>,
        valid: PyReadonlyArrayDyn<'_, bool>,
        yaw_rate: Option<PyReadonlyArrayDyn<'_, f64>>,
    ) -> PyResult<Self> {
        let (rows, n_steps) = x.as_array().dim();
        if rows != ids.len() {
            return Err(InputError::new_err(format!("x: {rows} rows given for {} participant ids", ids.len())));
        }
        let shape = [rows, n_steps];
        let states = States {
            ids,
            first_time_step,
            n_steps,
            x: x.as_array().iter().copied().collect(),
            y: arrays::read_grid("y", &y, &shape)?,
            orientation: arrays::read_grid("orientation", &orientation, &shape)?,
            velocity: arrays::read_grid("velocity", &velocity, &shape)?,
            acceleration: arrays::read_grid("acceleration", &acceleration, &shape)?,
            yaw_rate: yaw_rate.map_or_else(
                || Ok(vec![f64::NAN; rows * n_steps]),
                |values| arrays::read_grid("yaw_rate", &values, &shape),
            )?,
            valid: arrays::read_grid("valid", &valid, &shape)?,
        };
        Ok(Self { states, shapes: shapes.iter().map(|shape| shape.0.clone()).collect(), is_static })
    }
}

/// Id, time step at which the cycle begins, and length in time steps and code of the signal of each phase.
type LightParts = (i64, i64, Vec<(i64, usize)>);
/// Lanelet, both ends [m], whether there is a stop sign, for each lanelet that follows the positions of its lights, and
/// those lanelets onto which drivers may turn on red.
type LineParts = (i64, [(f64, f64); 2], bool, Vec<(i64, Vec<usize>)>, Vec<i64>);

fn control(lights: Vec<LightParts>, lines: Vec<LineParts>, road: &RoadNetwork) -> PyResult<Control> {
    let signal = |(length, code): (i64, usize)| {
        let found = Signal::ALL.get(code).copied();
        found.map(|signal| (length, signal)).ok_or_else(|| InputError::new_err(format!("there is no signal {code}")))
    };
    let light = |(id, offset, phases): LightParts| {
        Ok(TrafficLight { id, offset, phases: phases.into_iter().map(signal).collect::<PyResult<_>>()? })
    };
    let lights = lights.into_iter().map(light).collect::<PyResult<_>>()?;
    let line = |(lanelet, ends, has_stop_sign, lights, turns_on_red): LineParts| StopLineInput {
        lanelet,
        ends: ends.map(|(x, y)| Point::new(x, y)),
        has_stop_sign,
        lights,
        turns_on_red,
    };
    let lines = lines.into_iter().map(line).collect();
    Control::new(lights, lines, road).map_err(exception)
}

/// Turns and ranks of lanelets, minor lanelets, left-hand traffic, side of priority, whether main roads are derived.
type PriorityParts = (Vec<(i64, usize)>, Vec<(i64, [u8; 3])>, Vec<i64>, bool, i8, bool);

fn priorities(parts: PriorityParts, road: &RoadNetwork) -> PyResult<Priorities> {
    let (turns, ranks, minor, left_hand, priority_side, derives_main_road) = parts;
    let index = |id: i64| road.index_of(id).ok_or_else(|| exception(Error::UnknownId { what: "lanelet", id }));
    let turn = |code: usize| {
        let found = Turn::ALL.get(code).copied();
        found.ok_or_else(|| InputError::new_err(format!("there is no turn {code}")))
    };
    Ok(Priorities {
        turns: turns.into_iter().map(|(id, code)| Ok((index(id)?, turn(code)?))).collect::<PyResult<_>>()?,
        ranks: ranks.into_iter().map(|(id, ranks)| Ok((index(id)?, ranks))).collect::<PyResult<_>>()?,
        minor: minor.into_iter().map(index).collect::<PyResult<_>>()?,
        left_hand,
        priority_side,
        derives_main_road,
    })
}

/// Indices of lanelets, ascending.
fn sorted_lanelets(ids: Vec<i64>, road: &RoadNetwork) -> PyResult<Vec<usize>> {
    let index = |id: i64| road.index_of(id).ok_or_else(|| exception(Error::UnknownId { what: "lanelet", id }));
    let mut found: Vec<usize> = ids.into_iter().map(index).collect::<PyResult<_>>()?;
    found.sort_unstable();
    Ok(found)
}

#[pyclass(frozen, name = "Scenario", module = "interdrive._core")]
pub struct PyScenario(pub Arc<Scenario>);

#[pymethods]
impl PyScenario {
    #[new]
    #[pyo3(signature = (
        dt, road, participants, kinds, lights=vec![], lines=vec![], priorities=None, closed=(vec![], vec![]),
        crosswalks=vec![], overlaps=vec![], derived=vec![]
    ))]
    fn new(
        dt: f64,
        road: &PyRoadNetwork,
        participants: &PyParticipants,
        kinds: Vec<i64>,
        lights: Vec<LightParts>,
        lines: Vec<LineParts>,
        priorities: Option<PriorityParts>,
        closed: (Vec<i64>, Vec<i64>),
        crosswalks: Vec<i64>,
        overlaps: Vec<(i64, i64)>,
        derived: Vec<[bool; 2]>,
    ) -> PyResult<Self> {
        let kind = kinds.into_iter().map(ParticipantKind::from_code).collect::<Result<_, _>>().map_err(exception)?;
        let PyParticipants { states, shapes, is_static } = participants;
        let obstacles = Obstacles { kind, shape: shapes.clone(), is_static: is_static.clone(), states: states.clone() };
        let mut scenario = Scenario::new(dt, Arc::clone(&road.0), obstacles).map_err(exception)?;
        scenario.control = control(lights, lines, &road.0)?;
        if let Some(parts) = priorities {
            scenario.control.priorities = self::priorities(parts, &road.0)?;
        }
        scenario.control.closed = [sorted_lanelets(closed.0, &road.0)?, sorted_lanelets(closed.1, &road.0)?];
        scenario.control.crosswalks = sorted_lanelets(crosswalks, &road.0)?;
        scenario.overlaps = overlaps.into_iter().map(|(a, b)| (a.min(b), a.max(b))).collect();
        scenario.derived = derived;
        Ok(Self(Arc::new(scenario)))
    }

    /// All areas that two ways share, one row each, as a dict of arrays: `junction`, `kind` (code), `lanelet`, `entry`
    /// and `exit` of both sides, shape (areas, 2) [m], `first` (side, -1: the first to arrive), `reason` (code), `x`, `y` [m],
    /// `meeting_width` of vehicles that can meet a car there (-inf unless opposed) [m], `side_by_side` (lanes that merge).
    fn junctions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (road, areas) = (&self.0.road, &self.0.junctions().areas);
        let dict = PyDict::new(py);
        dict.set_item("junction", arrays::row(py, areas.iter().map(|area| area.junction as i64).collect()))?;
        dict.set_item("kind", arrays::row(py, areas.iter().map(|area| area.kind as i64).collect()))?;
        let first = |area: &Area| area.first.map_or(-1, |side| side as i64);
        dict.set_item("first", arrays::row(py, areas.iter().map(first).collect()))?;
        dict.set_item("reason", arrays::row(py, areas.iter().map(|area| area.reason as i64).collect()))?;
        let sides = || areas.iter().flat_map(|area| area.sides);
        let ids = sides().map(|side| road.lanelets()[side.lanelet].id).collect();
        dict.set_item("lanelet", arrays::grid(py, ids, [areas.len(), 2])?)?;
        dict.set_item("entry", arrays::grid(py, sides().map(|side| side.entry).collect(), [areas.len(), 2])?)?;
        dict.set_item("exit", arrays::grid(py, sides().map(|side| side.exit).collect(), [areas.len(), 2])?)?;
        let centers: Vec<Point> = areas.iter().map(|area| area.hull.center()).collect();
        dict.set_item("x", arrays::row(py, centers.iter().map(|center| center.x).collect()))?;
        dict.set_item("y", arrays::row(py, centers.iter().map(|center| center.y).collect()))?;
        dict.set_item("meeting_width", arrays::row(py, areas.iter().map(meeting_width).collect()))?;
        dict.set_item("side_by_side", arrays::row(py, areas.iter().map(|area| area.is_side_by_side).collect()))?;
        Ok(dict)
    }
}

getters! { PyScenario {
    /// Time between steps [s].
    dt: f64 = |this| this.0.dt;
} }
