//! Parameter records of native planners.

use interdrive_core::plan::frenet::{Candidates, Comfort, CostWeights, FrenetSettings, N_TERMS, Rejection};
use interdrive_core::plan::{CarFollowing, IdmMobilSettings, IdmSettings, Planner};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::InputError;

/// The settings of a native planner, any of them.
#[derive(FromPyObject)]
pub enum NativePlanner<'py> {
    Frenet(PyRef<'py, PyFrenetSettings>),
    Recorded(PyRef<'py, PyRecordedSettings>),
    VelocityAdjusting(PyRef<'py, PyVelocityAdjustingSettings>),
    Idm(PyRef<'py, PyIdmSettings>),
    IdmMobil(PyRef<'py, PyIdmMobilSettings>),
}

impl From<NativePlanner<'_>> for Planner {
    fn from(settings: NativePlanner<'_>) -> Self {
        match settings {
            NativePlanner::Frenet(settings) => Self::Frenet(Box::new(settings.0.clone())),
            NativePlanner::Recorded(_) => Self::Recorded,
            NativePlanner::VelocityAdjusting(settings) => Self::VelocityAdjusting(settings.0),
            NativePlanner::Idm(settings) => Self::Idm(settings.0),
            NativePlanner::IdmMobil(settings) => Self::IdmMobil(Box::new(settings.0)),
        }
    }
}

/// Takes the value of a key out of a dict; it must be there.
fn take<'py, T>(values: &Bound<'py, PyDict>, planner: &str, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let missing = || InputError::new_err(format!("planner.{planner}.{name} is missing"));
    let value = values.get_item(name)?.ok_or_else(missing)?;
    value.extract().map_err(|_| InputError::new_err(format!("planner.{planner}.{name} cannot be {value}")))
}

/// The core's refusal, which begins with the field: field and message apart.
fn located(checked: interdrive_core::error::Result<()>) -> PyResult<()> {
    checked.map_err(|error| {
        let text = error.to_string();
        match text.split_once(' ') {
            Some((field, message)) => InputError::new_err((field.to_owned(), message.to_owned())),
            None => InputError::new_err(text),
        }
    })
}

/// Writes a record's fields from a dict and back, by one list of names.
macro_rules! record {
    ($read:ident, $write:ident, $record:ty, $prefix:literal, [$($field:ident),* $(,)?]) => {
        fn $read(values: &Bound<'_, PyDict>, planner: &str, record: &mut $record) -> PyResult<()> {
            $(record.$field = take(values, planner, concat!($prefix, stringify!($field)))?;)*
            Ok(())
        }
        fn $write(values: &Bound<'_, PyDict>, record: &$record) -> PyResult<()> {
            $(values.set_item(concat!($prefix, stringify!($field)), record.$field)?;)*
            Ok(())
        }
    };
}

record!(
    read_planner,
    write_planner,
    FrenetSettings,
    "",
    [
        level,
        horizon,
        t_min,
        d_max,
        low_velocity,
        prediction_margin_length,
        prediction_margin_width,
        rear_cone_angle,
        rear_cone_distance,
        collision_mode_probability,
        expectation_density_min,
        stop_targets,
        lazy,
    ]
);
record!(
    read_weights,
    write_weights,
    CostWeights,
    "weights.",
    [
        velocity_offset,
        distance_to_reference,
        lateral_jerk,
        longitudinal_jerk,
        acceleration,
        jerk,
        lateral_velocity,
        lateral_acceleration,
        longitudinal_velocity,
        longitudinal_acceleration,
        orientation_offset,
        distance_to_obstacles,
        prediction,
    ]
);
record!(
    read_comfort,
    write_comfort,
    Comfort,
    "comfort.",
    [time_gap, standstill_gap, deceleration, lateral_acceleration, velocity_step, cruise_velocity_min,]
);
record!(
    read_car_following,
    write_car_following,
    CarFollowing,
    "",
    [time_gap, minimum_gap, acceleration, deceleration, exponent]
);
record!(read_idm, write_idm, IdmSettings, "", [desired_velocity_max, lateral_acceleration]);
record!(
    read_mobil,
    write_mobil,
    IdmMobilSettings,
    "",
    [politeness, changing_threshold, safe_deceleration, bias, lane_change_duration]
);

#[pyclass(frozen, name = "FrenetSettings", module = "interdrive._core")]
pub struct PyFrenetSettings(pub FrenetSettings);

#[pymethods]
impl PyFrenetSettings {
    /// From a dict of dotted names; every name must be there.
    #[new]
    fn new(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut settings = FrenetSettings::default();
        read_planner(values, "frenet", &mut settings)?;
        read_weights(values, "frenet", &mut settings.weights)?;
        read_comfort(values, "frenet", &mut settings.comfort)?;
        located(settings.validate())?;
        Ok(Self(settings))
    }

    /// The core's defaults as a dict of dotted names.
    #[staticmethod]
    fn defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let (values, settings) = (PyDict::new(py), FrenetSettings::default());
        write_planner(&values, &settings)?;
        write_weights(&values, &settings.weights)?;
        write_comfort(&values, &settings.comfort)?;
        Ok(values)
    }
}

/// `recorded` has no settings.
#[pyclass(frozen, name = "RecordedSettings", module = "interdrive._core")]
pub struct PyRecordedSettings;

#[pymethods]
impl PyRecordedSettings {
    #[new]
    fn new() -> Self {
        Self
    }
}

#[pyclass(frozen, name = "VelocityAdjustingSettings", module = "interdrive._core")]
pub struct PyVelocityAdjustingSettings(pub CarFollowing);

#[pymethods]
impl PyVelocityAdjustingSettings {
    /// From a dict of names; every name must be there.
    #[new]
    fn new(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut law = CarFollowing::default();
        read_car_following(values, "velocity_adjusting", &mut law)?;
        located(law.validate())?;
        Ok(Self(law))
    }

    /// The core's defaults as a dict of names.
    #[staticmethod]
    fn defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let values = PyDict::new(py);
        write_car_following(&values, &CarFollowing::default())?;
        Ok(values)
    }
}

#[pyclass(frozen, name = "IdmSettings", module = "interdrive._core")]
pub struct PyIdmSettings(pub IdmSettings);

#[pymethods]
impl PyIdmSettings {
    /// From a dict of names; every name must be there.
    #[new]
    fn new(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut settings = IdmSettings::default();
        read_car_following(values, "idm", &mut settings.law)?;
        read_idm(values, "idm", &mut settings)?;
        located(settings.validate())?;
        Ok(Self(settings))
    }

    /// The core's defaults as a dict of names.
    #[staticmethod]
    fn defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let (values, settings) = (PyDict::new(py), IdmSettings::default());
        write_car_following(&values, &settings.law)?;
        write_idm(&values, &settings)?;
        Ok(values)
    }
}

#[pyclass(frozen, name = "IdmMobilSettings", module = "interdrive._core")]
pub struct PyIdmMobilSettings(pub IdmMobilSettings);

#[pymethods]
impl PyIdmMobilSettings {
    /// From a dict of names; every name must be there.
    #[new]
    fn new(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut settings = IdmMobilSettings::default();
        read_car_following(values, "idm_mobil", &mut settings.idm.law)?;
        read_idm(values, "idm_mobil", &mut settings.idm)?;
        read_mobil(values, "idm_mobil", &mut settings)?;
        located(settings.validate())?;
        Ok(Self(settings))
    }

    /// The core's defaults as a dict of names.
    #[staticmethod]
    fn defaults(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let (values, settings) = (PyDict::new(py), IdmMobilSettings::default());
        write_car_following(&values, &settings.idm.law)?;
        write_idm(&values, &settings.idm)?;
        write_mobil(&values, &settings)?;
        Ok(values)
    }
}

/// Words for a rejection; empty for an admissible sample.
fn words(rejection: Rejection, collision_id: i64) -> String {
    match rejection {
        Rejection::Admissible => String::new(),
        Rejection::Acceleration => "acceleration".into(),
        Rejection::Curvature => "curvature".into(),
        Rejection::SteeringRate => "steering rate".into(),
        Rejection::YawRate => "yaw rate".into(),
        Rejection::LateralAcceleration => "lateral acceleration".into(),
        Rejection::NegativeSpeed => "negative speed".into(),
        Rejection::LeftPath => "left the reference path".into(),
        Rejection::Collision => format!("collision with {collision_id}"),
        Rejection::OffRoad => "off the road".into(),
    }
}

/// All samples of a plan as a dict of arrays: x, y (samples, points); terms (samples, terms); cost, end_time,
/// end_velocity, end_offset (samples,); rejection (words per sample); chosen (-1 for none); desired_velocity.
pub fn candidates_dict<'py>(py: Python<'py>, candidates: &Candidates) -> PyResult<Bound<'py, PyDict>> {
    let (n, n_points) = (candidates.len(), candidates.n_points);
    let reasons = candidates.rejection.iter().zip(&candidates.collision_id).map(|(r, id)| words(*r, *id));
    let dict = PyDict::new(py);
    dict.set_item("x", arrays::grid(py, candidates.x.clone(), [n, n_points])?)?;
    dict.set_item("y", arrays::grid(py, candidates.y.clone(), [n, n_points])?)?;
    dict.set_item("terms", arrays::grid(py, candidates.terms.clone(), [n, N_TERMS])?)?;
    dict.set_item("term_names", CostWeights::NAMES.to_vec())?;
    dict.set_item("cost", arrays::row(py, candidates.cost.clone()))?;
    dict.set_item("end_time", arrays::row(py, candidates.end_time.clone()))?;
    dict.set_item("end_velocity", arrays::row(py, candidates.end_velocity.clone()))?;
    dict.set_item("end_offset", arrays::row(py, candidates.end_offset.clone()))?;
    dict.set_item("rejection", reasons.collect::<Vec<_>>())?;
    dict.set_item("chosen", candidates.chosen.map_or(-1, |chosen| chosen as i64))?;
    dict.set_item("desired_velocity", candidates.desired_velocity)?;
    Ok(dict)
}
