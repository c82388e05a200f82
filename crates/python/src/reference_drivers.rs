//! Reference drivers: verdicts on concrete cases, and safe distances.

use interdrive_core::reference_drivers::Driver;
use interdrive_core::reference_drivers::cases::{CutIn, CutOut, Ending, Following, drive_all};
use interdrive_core::reference_drivers::rss::{Lateral, Longitudinal};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Row};
use crate::errors::{InputError, detached};

type Floats<'py> = PyReadonlyArray1<'py, f64>;

/// The reference driver of a name.
pub fn driver(name: &str) -> PyResult<Driver> {
    let found = Driver::ALL.into_iter().find(|driver| driver.name() == name);
    found.ok_or_else(|| {
        let known = Driver::ALL.map(Driver::name).join(", ");
        InputError::new_err(format!("there is no reference driver {name}; there are {known}"))
    })
}

fn endings<'py>(py: Python<'py>, found: &[Ending]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("crash", arrays::row(py, found.iter().map(|one| one.crash).collect()))?;
    dict.set_item("is_beside", arrays::row(py, found.iter().map(|one| one.is_beside).collect()))?;
    dict.set_item("impact_speed", arrays::row(py, found.iter().map(|one| one.impact_speed).collect()))?;
    dict.set_item("ttc_min", arrays::row(py, found.iter().map(|one| one.ttc_min).collect()))?;
    Ok(dict)
}

/// Columns of equal length.
fn columns<const N: usize>(names: [&str; N], given: [&Floats<'_>; N]) -> PyResult<Vec<[f64; N]>> {
    let n = given[0].as_array().len();
    let mut read = Vec::with_capacity(N);
    for (name, column) in names.into_iter().zip(given) {
        read.push(arrays::read_row(name, column, n)?);
    }
    Ok((0..n).map(|row| std::array::from_fn(|column| read[column][row])).collect())
}

/// Cut-ins with a driver: crash, is_beside, impact_speed [m/s], ttc_min [s] as arrays of shape (cases,).
#[pyfunction]
pub fn drive_cut_ins<'py>(
    py: Python<'py>,
    name: &str,
    velocity: Floats<'py>,
    other_velocity: Floats<'py>,
    gap: Floats<'py>,
    sideways: Floats<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let driver = driver(name)?;
    let names = ["velocity", "other_velocity", "gap", "sideways"];
    let rows = columns(names, [&velocity, &other_velocity, &gap, &sideways])?;
    let case = |[velocity, other_velocity, gap, sideways]: [f64; 4]| CutIn { velocity, other_velocity, gap, sideways };
    let cases: Vec<CutIn> = rows.into_iter().map(case).collect();
    let found = detached(py, || drive_all(&cases, CutIn::check, |case| case.drive(driver)))?;
    endings(py, &found)
}

/// Cut-outs with a driver: the same, leader_crash and kept_distance [m].
#[pyfunction]
pub fn drive_cut_outs<'py>(
    py: Python<'py>,
    name: &str,
    velocity: Floats<'py>,
    front_distance: Floats<'py>,
    sideways: Floats<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let driver = driver(name)?;
    let rows = columns(["velocity", "front_distance", "sideways"], [&velocity, &front_distance, &sideways])?;
    let case = |[velocity, front_distance, sideways]: [f64; 3]| CutOut { velocity, front_distance, sideways };
    let cases: Vec<CutOut> = rows.into_iter().map(case).collect();
    let (found, leaders): (Vec<Ending>, Vec<bool>) =
        detached(py, || drive_all(&cases, CutOut::check, |case| case.drive(driver)))?.into_iter().unzip();
    let dict = endings(py, &found)?;
    dict.set_item("leader_crash", arrays::row(py, leaders))?;
    let kept = cases.iter().map(|case| driver.kept_distance(case.velocity)).collect();
    dict.set_item("kept_distance", arrays::row(py, kept))?;
    Ok(dict)
}

/// Leaders that brake, with a driver: the same as of cut-ins, and kept_distance [m].
#[pyfunction]
pub fn drive_followings<'py>(
    py: Python<'py>,
    name: &str,
    velocity: Floats<'py>,
    deceleration: Floats<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let driver = driver(name)?;
    let rows = columns(["velocity", "deceleration"], [&velocity, &deceleration])?;
    let cases: Vec<Following> =
        rows.into_iter().map(|[velocity, deceleration]| Following { velocity, deceleration }).collect();
    let dict = endings(py, &detached(py, || drive_all(&cases, Following::check, |case| case.drive(driver)))?)?;
    let kept = cases.iter().map(|case| driver.kept_distance(case.velocity)).collect();
    dict.set_item("kept_distance", arrays::row(py, kept))?;
    Ok(dict)
}

/// Safe distances along a lane [m] for a response time, an acceleration, least, hardest and correct braking.
#[pyfunction]
pub fn rss_longitudinal<'py>(
    py: Python<'py>,
    parameters: (f64, f64, f64, f64, f64),
    first: Floats<'py>,
    second: Floats<'py>,
    opposite: bool,
) -> PyResult<Row<'py, f64>> {
    let (response, acceleration, braking_min, braking_max, braking_correct) = parameters;
    let law = Longitudinal { response, acceleration, braking_min, braking_max, braking_correct };
    let rows = columns(["first", "second"], [&first, &second])?;
    let distance = |[a, b]: [f64; 2]| if opposite { law.opposite_direction(a, b) } else { law.same_direction(a, b) };
    Ok(arrays::row(py, rows.into_iter().map(distance).collect()))
}

/// Safe distances across a lane [m] for a response time, an acceleration, least braking and a fluctuation.
#[pyfunction]
pub fn rss_lateral<'py>(
    py: Python<'py>,
    parameters: (f64, f64, f64, f64),
    left: Floats<'py>,
    right: Floats<'py>,
) -> PyResult<Row<'py, f64>> {
    let (response, acceleration, braking_min, fluctuation) = parameters;
    let law = Lateral { response, acceleration, braking_min, fluctuation };
    let rows = columns(["left", "right"], [&left, &right])?;
    Ok(arrays::row(py, rows.into_iter().map(|[a, b]| law.distance(a, b)).collect()))
}

/// Adds the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(drive_cut_ins, module)?)?;
    module.add_function(wrap_pyfunction!(drive_cut_outs, module)?)?;
    module.add_function(wrap_pyfunction!(drive_followings, module)?)?;
    module.add_function(wrap_pyfunction!(rss_longitudinal, module)?)?;
    module.add_function(wrap_pyfunction!(rss_lateral, module)?)
}
