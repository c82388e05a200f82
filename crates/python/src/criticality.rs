//! Criticality: measures of recorded traffic, harm of collisions, and the formulas on arrays.

use std::sync::Arc;

use interdrive_core::criticality::harm::{self, CrashBody, ImpactArea, Sides};
use interdrive_core::criticality::{
    ConflictAreas, Connector, Criticality, Measure, Request, Traffic, evaluate, formulas,
    overlapping_lanelets as core_overlapping_lanelets,
};
use interdrive_core::error::Error;
use interdrive_core::geometry::Point;
use interdrive_core::trajectory::State;
use interdrive_core::vehicle::ParticipantKind;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{self, Row};
use crate::errors::{InputError, detached, exception};
use crate::scenario::{PyParticipants, PyRoadNetwork};
use crate::settings::read;

type Floats<'py> = PyReadonlyArray1<'py, f64>;

/// Values of several arrays of the same length, one after the other.
fn columns<const N: usize>(names: [&str; N], given: [&Floats<'_>; N]) -> PyResult<[Vec<f64>; N]> {
    let length = given[0].as_array().len();
    let mut out = [const { Vec::new() }; N];
    for (i, (name, array)) in names.into_iter().zip(given).enumerate() {
        out[i] = arrays::read_row(name, array, length)?;
    }
    Ok(out)
}

/// A formula applied element by element.
fn each<'py, const N: usize>(
    py: Python<'py>,
    names: [&str; N],
    given: [&Floats<'_>; N],
    formula: impl Fn([f64; N]) -> f64,
) -> PyResult<Row<'py, f64>> {
    let values = columns(names, given)?;
    let result = (0..values[0].len()).map(|i| formula(std::array::from_fn(|k| values[k][i]))).collect();
    Ok(arrays::row(py, result))
}

/// Formulas of the core by their names, applied element by element.
macro_rules! on_arrays {
    ($($name:ident($($argument:ident),+);)+) => { $(
        #[pyfunction]
        pub fn $name<'py>(py: Python<'py>, $($argument: Floats<'_>),+) -> PyResult<Row<'py, f64>> {
            let (names, given) = ([$(stringify!($argument)),+], [$(&$argument),+]);
            each(py, names, given, |[$($argument),+]| formulas::$name($($argument),+))
        }
    )+ };
}

on_arrays! {
    time_headway(headway, velocity);
    time_to_collision(headway, velocity, acceleration);
    required_lateral_acceleration(time, offset, left, right);
    minimal_stopping_distance(velocity, deceleration);
    proportion_of_stopping_distance(remaining, stopping);
}

#[pyfunction]
pub fn required_acceleration<'py>(
    py: Python<'py>,
    headway: Floats<'_>,
    follower: Floats<'_>,
    leader: Floats<'_>,
    leader_acceleration: Floats<'_>,
    leader_stops: bool,
) -> PyResult<Row<'py, f64>> {
    let names = ["headway", "follower", "leader", "leader_acceleration"];
    each(py, names, [&headway, &follower, &leader, &leader_acceleration], |[h, f, l, a]| {
        if leader_stops {
            formulas::required_acceleration_stopping(h, f, l, a)
        } else {
            formulas::required_acceleration(h, l - f, a)
        }
    })
}

/// Time [s] and integral [s²] below the threshold.
#[pyfunction]
pub fn exposure(ttc: Floats<'_>, threshold: f64, dt: f64) -> (f64, f64) {
    formulas::exposure(&ttc.as_array().to_vec(), threshold, dt)
}

/// Mass [kg] of participants by kind code and footprint.
#[pyfunction]
pub fn participant_mass<'py>(
    py: Python<'py>,
    kinds: Vec<i64>,
    length: Floats<'_>,
    width: Floats<'_>,
) -> PyResult<Row<'py, f64>> {
    let (length, width) =
        (arrays::read_row("length", &length, kinds.len())?, arrays::read_row("width", &width, kinds.len())?);
    let mut masses = Vec::with_capacity(kinds.len());
    for (i, code) in kinds.into_iter().enumerate() {
        masses.push(harm::mass(ParticipantKind::from_code(code).map_err(exception)?, length[i], width[i]));
    }
    Ok(arrays::row(py, masses))
}

/// Probability of severe injuries when driving against the edge of the road.
#[pyfunction]
pub fn boundary_harm(kind: i64, impact_speed: f64) -> PyResult<f64> {
    Ok(harm::boundary_harm(ParticipantKind::from_code(kind).map_err(exception)?, impact_speed))
}

/// Relative speed [m/s] of a collision, and for both of those involved: probability of severe injuries, speed change
/// [m/s], direction to the other one [rad], area that is hit.
#[pyfunction]
pub fn collision_harm<'py>(
    py: Python<'py>,
    kinds: (i64, i64),
    masses: (f64, f64),
    velocities: (f64, f64),
    orientations: (f64, f64),
    positions: ((f64, f64), (f64, f64)),
    asymmetric: bool,
) -> PyResult<Bound<'py, PyTuple>> {
    let body = |kind: i64, mass: f64, velocity: f64, orientation: f64, (x, y): (f64, f64)| -> PyResult<CrashBody> {
        if mass.is_nan() || mass <= 0.0 {
            return Err(InputError::new_err(format!("a mass must be positive, not {mass} kg")));
        }
        let state = State { orientation, velocity, ..State::default() };
        let kind = ParticipantKind::from_code(kind).map_err(exception)?;
        Ok(CrashBody { kind, mass, state, before: Point::new(x, y) })
    };
    let first = body(kinds.0, masses.0, velocities.0, orientations.0, positions.0)?;
    let second = body(kinds.1, masses.1, velocities.1, orientations.1, positions.1)?;
    let sides = if asymmetric { Sides::Asymmetric } else { Sides::Symmetric };
    let found = harm::collision_harm(&first, &second, sides);
    let area = |area: ImpactArea| format!("{area:?}").to_lowercase();
    let one = |h: &harm::Harm| (h.probability, h.speed_change, h.angle, area(h.area));
    (harm::relative_speed(&first.state, &second.state), one(&found[0]), one(&found[1])).into_pyobject(py)
}

/// Pairs of ids of lanelets that overlap once they are eroded.
#[pyfunction]
pub fn overlapping_lanelets(py: Python<'_>, road: &PyRoadNetwork, erosion: f64, overlap_min: f64) -> Vec<(i64, i64)> {
    let road = Arc::clone(&road.0);
    let pairs = py.detach(|| core_overlapping_lanelets(&road, erosion, overlap_min));
    pairs.into_iter().map(|(i, j)| (road.lanelets()[i].id, road.lanelets()[j].id)).collect()
}

/// All measures of some participants: a dict of arrays.
#[pyfunction]
#[pyo3(signature = (dt, road, participants, *, judged, deceleration, connectors, contacts, threads, settings))]
pub fn evaluate_criticality<'py>(
    py: Python<'py>,
    dt: f64,
    road: &PyRoadNetwork,
    participants: &PyParticipants,
    judged: Vec<i64>,
    deceleration: Vec<f64>,
    connectors: Option<Vec<(i64, i64)>>,
    contacts: Vec<(i64, i64, i64)>,
    threads: usize,
    settings: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let connector = |(id, incoming): (i64, i64)| {
        let lanelet = road.0.index_of(id).ok_or(Error::UnknownId { what: "lanelet", id })?;
        Ok(Connector { lanelet, incoming })
    };
    let conflict_areas = match connectors {
        Some(given) => {
            ConflictAreas::Stated(given.into_iter().map(connector).collect::<Result<_, Error>>().map_err(exception)?)
        }
        None => ConflictAreas::Crossing,
    };
    let settings = read(settings)?;
    let request = Request { ids: judged, deceleration, settings, conflict_areas, contacts, threads };
    let PyParticipants { states, shapes, is_static } = participants;
    let road = Arc::clone(&road.0);
    let found = detached(py, || {
        let traffic = Traffic::new(dt, road, states.clone(), shapes.clone(), is_static.clone())?;
        evaluate(&traffic, &request)
    })?;
    as_dict(py, found)
}

fn as_dict(py: Python<'_>, found: Criticality) -> PyResult<Bound<'_, PyDict>> {
    let shape = [found.ids.len(), found.n_steps];
    let dict = PyDict::new(py);
    let measures = PyDict::new(py);
    for (((measure, name), series), extremes) in Measure::ALL.into_iter().zip(found.series).zip(&found.extremes) {
        let one = PyDict::new(py);
        one.set_item("value", arrays::grid(py, series.value, shape)?)?;
        one.set_item("partner", arrays::grid(py, series.partner, shape)?)?;
        one.set_item("way", arrays::grid(py, series.way, shape)?)?;
        one.set_item("extreme", arrays::row(py, extremes.iter().map(|e| e.value).collect()))?;
        one.set_item("extreme_time_step", arrays::row(py, extremes.iter().map(|e| e.time_step).collect()))?;
        one.set_item("extreme_partner", arrays::row(py, extremes.iter().map(|e| e.partner).collect()))?;
        one.set_item("extreme_way", arrays::row(py, extremes.iter().map(|e| e.way).collect()))?;
        one.set_item("grows", measure.grows())?;
        measures.set_item(name, one)?;
    }
    let in_the_way = PyDict::new(py);
    for (measure, series) in Measure::FOLLOWING.into_iter().zip(found.in_the_way) {
        let one = PyDict::new(py);
        one.set_item("value", arrays::grid(py, series.value, shape)?)?;
        one.set_item("partner", arrays::grid(py, series.partner, shape)?)?;
        one.set_item("way", arrays::grid(py, series.way, shape)?)?;
        in_the_way.set_item(Measure::ALL[measure as usize].1, one)?;
    }
    dict.set_item("measures", measures)?;
    dict.set_item("in_the_way", in_the_way)?;
    dict.set_item("tet_seconds", arrays::row(py, found.exposure.iter().map(|e| e.tet_seconds).collect()))?;
    dict.set_item("tit_mean", arrays::row(py, found.exposure.iter().map(|e| e.tit_mean).collect()))?;
    dict.set_item("psd_below_one", arrays::row(py, found.exposure.iter().map(|e| e.psd_below_one).collect()))?;
    dict.set_item("et_left_censored", arrays::row(py, found.exposure.iter().map(|e| e.et_left_censored).collect()))?;
    dict.set_item("pet_first", arrays::row(py, found.exposure.iter().map(|e| e.pet_first).collect()))?;
    dict.set_item("ids", arrays::row(py, found.ids))?;
    let ways: Vec<(bool, Vec<i64>)> = found.ways.into_iter().map(|way| (way.is_conflict_area, way.lanelets)).collect();
    dict.set_item("ways", ways)?;
    Ok(dict)
}

/// Adds the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(time_headway, module)?)?;
    module.add_function(wrap_pyfunction!(time_to_collision, module)?)?;
    module.add_function(wrap_pyfunction!(required_acceleration, module)?)?;
    module.add_function(wrap_pyfunction!(required_lateral_acceleration, module)?)?;
    module.add_function(wrap_pyfunction!(minimal_stopping_distance, module)?)?;
    module.add_function(wrap_pyfunction!(proportion_of_stopping_distance, module)?)?;
    module.add_function(wrap_pyfunction!(exposure, module)?)?;
    module.add_function(wrap_pyfunction!(participant_mass, module)?)?;
    module.add_function(wrap_pyfunction!(boundary_harm, module)?)?;
    module.add_function(wrap_pyfunction!(collision_harm, module)?)?;
    module.add_function(wrap_pyfunction!(overlapping_lanelets, module)?)?;
    module.add_function(wrap_pyfunction!(evaluate_criticality, module)?)
}
