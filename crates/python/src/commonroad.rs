//! CommonRoad documents as dicts of arrays, one dict for each element, with the names of `interdrive.files.elements`.

use interdrive_commonroad::document::{
    Bound as Side, Course, Intersection, Lanelet, Light, Obstacle, Position, Problem, Role, Shape, Sign, State, Value,
};
use interdrive_commonroad::{Document, Refusal, limits};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PySyntaxError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arrays::{grid, row};
use crate::errors::InputError;

/// A Python value of something of a document.
type Made<'py> = PyResult<Bound<'py, PyAny>>;

/// Adds the reader and the bounds that it checks, by their names.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    macro_rules! bounds {
        ($($name:ident)*) => {$(module.add(stringify!($name), limits::$name)?;)*};
    }
    bounds!(LARGEST_ID SMALLEST_DT LARGEST_DT LARGEST_TIME_STEP LARGEST_GOAL_TIME_STEP LARGEST_COORDINATE);
    bounds!(LARGEST_VELOCITY LARGEST_ACCELERATION LARGEST_YAW_RATE LARGEST_ANGLE DEEPEST);
    bounds!(MOST_LANELETS MOST_POINTS_OF_A_LANELET MOST_POINTS MOST_OBSTACLES MOST_STATES MOST_PROBLEMS);
    module.add_function(wrap_pyfunction!(read_commonroad, module)?)
}

/// Reads a document.
#[pyfunction]
fn read_commonroad<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyDict>> {
    let document = py.detach(|| interdrive_commonroad::read(text)).map_err(|refusal| match refusal {
        Refusal::Syntax(reason) => PySyntaxError::new_err(reason),
        Refusal::Content(reason) => InputError::new_err(reason),
    })?;
    made(py, document)
}

fn made(py: Python<'_>, document: Document) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("dt", document.dt)?;
    dict.set_item("benchmark_id", document.benchmark_id)?;
    dict.set_item("version", document.version)?;
    dict.set_item("lanelets", list(py, document.lanelets, lanelet)?)?;
    dict.set_item("signs", list(py, document.signs, sign)?)?;
    dict.set_item("lights", list(py, document.lights, light)?)?;
    dict.set_item("intersections", list(py, document.intersections, intersection)?)?;
    dict.set_item("obstacles", list(py, document.obstacles, obstacle)?)?;
    dict.set_item("problems", list(py, document.problems, problem)?)?;
    dict.set_item("notes", PyTuple::new(py, document.notes)?)?;
    Ok(dict)
}

fn list<'py, T>(py: Python<'py>, all: Vec<T>, one: fn(Python<'py>, T) -> Made<'py>) -> Made<'py> {
    let found = PyList::empty(py);
    for element in all {
        found.append(one(py, element)?)?;
    }
    Ok(found.into_any())
}

fn bound(py: Python<'_>, side: Side) -> Made<'_> {
    let n = side.points.len() / side.columns;
    grid(py, side.points, [n, side.columns])
}

fn lanelet(py: Python<'_>, lanelet: Lanelet) -> Made<'_> {
    let dict = PyDict::new(py);
    dict.set_item("lanelet_id", lanelet.id)?;
    dict.set_item("line_marking_left_vertices", lanelet.left.marking)?;
    dict.set_item("line_marking_right_vertices", lanelet.right.marking)?;
    dict.set_item("left_vertices", bound(py, lanelet.left)?)?;
    dict.set_item("right_vertices", bound(py, lanelet.right)?)?;
    dict.set_item("predecessor", PyTuple::new(py, lanelet.predecessors)?)?;
    dict.set_item("successor", PyTuple::new(py, lanelet.successors)?)?;
    dict.set_item("adj_left", lanelet.adjacent_left.map(|(id, _)| id))?;
    dict.set_item("adj_left_same_direction", lanelet.adjacent_left.is_some_and(|(_, same)| same))?;
    dict.set_item("adj_right", lanelet.adjacent_right.map(|(id, _)| id))?;
    dict.set_item("adj_right_same_direction", lanelet.adjacent_right.is_some_and(|(_, same)| same))?;
    dict.set_item("lanelet_type", PyTuple::new(py, lanelet.types)?)?;
    dict.set_item("users", PyTuple::new(py, lanelet.users)?)?;
    dict.set_item("traffic_signs", PyTuple::new(py, lanelet.signs)?)?;
    dict.set_item("traffic_lights", PyTuple::new(py, lanelet.lights)?)?;
    let line = lanelet.stop_line.map(|line| (line.ends, PyTuple::new(py, line.signs), PyTuple::new(py, line.lights)));
    dict.set_item(
        "stop_line",
        match line {
            Some((ends, signs, lights)) => Some((ends, signs?, lights?)),
            None => None,
        },
    )?;
    Ok(dict.into_any())
}

fn sign(py: Python<'_>, sign: Sign) -> Made<'_> {
    let elements = sign.elements.into_iter().map(|one| (one.name, one.code, one.value));
    (sign.id, elements.collect::<Vec<_>>()).into_bound_py_any(py)
}

fn light(py: Python<'_>, light: Light) -> Made<'_> {
    let dict = PyDict::new(py);
    dict.set_item("traffic_light_id", light.id)?;
    dict.set_item("position", light.position.map(|[x, y]| (x, y)))?;
    dict.set_item("phases", PyTuple::new(py, light.phases)?)?;
    dict.set_item("time_offset", light.offset)?;
    dict.set_item("direction", light.direction)?;
    dict.set_item("active", light.active)?;
    Ok(dict.into_any())
}

fn intersection(py: Python<'_>, intersection: Intersection) -> Made<'_> {
    let incomings = PyList::empty(py);
    for one in intersection.incomings {
        let dict = PyDict::new(py);
        dict.set_item("incoming_id", one.id)?;
        dict.set_item("incoming_lanelets", PyTuple::new(py, one.lanelets)?)?;
        dict.set_item("outgoing_right", PyTuple::new(py, one.right)?)?;
        dict.set_item("outgoing_straight", PyTuple::new(py, one.straight)?)?;
        dict.set_item("outgoing_left", PyTuple::new(py, one.left)?)?;
        incomings.append(dict)?;
    }
    let crossings = PyTuple::new(py, intersection.crossings)?;
    (intersection.id, incomings, crossings).into_pyobject(py).map(Bound::into_any)
}

/// Kind and numbers of a shape: length, width, centre and orientation; radius and centre; vertices; or its members.
fn shape(py: Python<'_>, shape: Shape) -> Made<'_> {
    match shape {
        Shape::Rectangle { length, width, center: [x, y], orientation } => {
            ("rectangle", length, width, (x, y), orientation).into_pyobject(py).map(Bound::into_any)
        }
        Shape::Circle { radius, center: [x, y] } => ("circle", radius, (x, y)).into_pyobject(py).map(Bound::into_any),
        Shape::Polygon(vertices) => {
            let n = vertices.len() / 2;
            ("polygon", grid(py, vertices, [n, 2])?).into_pyobject(py).map(Bound::into_any)
        }
        Shape::Group(members) => ("group", list(py, members, self::shape)?).into_pyobject(py).map(Bound::into_any),
    }
}

/// A number, a pair for an interval, or None.
fn value<'py, T: IntoPyObject<'py> + Copy>(py: Python<'py>, value: Option<Value<T>>) -> Made<'py> {
    match value {
        None => Ok(py.None().into_bound(py)),
        Some(Value::Exact(exact)) => exact.into_bound_py_any(py),
        Some(Value::Interval(first, last)) => (first, last).into_bound_py_any(py),
    }
}

fn state(py: Python<'_>, state: State) -> Made<'_> {
    let dict = PyDict::new(py);
    match state.position {
        None => dict.set_item("position", py.None())?,
        Some(Position::Point([x, y])) => dict.set_item("position", row(py, vec![x, y]))?,
        Some(Position::Area(area)) => dict.set_item("position", shape(py, area)?)?,
    }
    dict.set_item("time_step", value(py, state.time_step)?)?;
    dict.set_item("orientation", value(py, state.orientation)?)?;
    dict.set_item("velocity", value(py, state.velocity)?)?;
    dict.set_item("acceleration", value(py, state.acceleration)?)?;
    dict.set_item("yaw_rate", value(py, state.yaw_rate)?)?;
    dict.set_item("velocity_y", value(py, state.velocity_y)?)?;
    Ok(dict.into_any())
}

fn obstacle(py: Python<'_>, obstacle: Obstacle) -> Made<'_> {
    let dict = PyDict::new(py);
    dict.set_item("obstacle_id", obstacle.id)?;
    let role = match obstacle.role {
        Role::Static => "static",
        Role::Dynamic => "dynamic",
        Role::Environment => "environment",
        Role::Phantom => "phantom",
    };
    dict.set_item("role", role)?;
    dict.set_item("obstacle_type", obstacle.kind)?;
    dict.set_item("shape", obstacle.shape.map(|one| shape(py, one)).transpose()?)?;
    dict.set_item("initial_state", state(py, obstacle.initial)?)?;
    dict.set_item("has_set", obstacle.has_set)?;
    let (table, states) = match obstacle.course {
        Course::None => (None, None),
        Course::States(states) => (None, Some(list(py, states, state)?)),
        Course::Table(steps, values) => {
            let n = steps.len();
            (Some((row(py, steps), grid(py, values, [n, 6])?)), None)
        }
    };
    dict.set_item("table", table)?;
    dict.set_item("states", states)?;
    Ok(dict.into_any())
}

fn problem(py: Python<'_>, problem: Problem) -> Made<'_> {
    let goals = PyList::empty(py);
    for (goal, lanelets) in problem.goals {
        goals.append((state(py, goal)?, PyTuple::new(py, lanelets)?))?;
    }
    (problem.id, state(py, problem.initial)?, goals).into_pyobject(py).map(Bound::into_any)
}
