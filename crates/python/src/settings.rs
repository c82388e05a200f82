//! Python's records of settings, read by the tables of the core.

use interdrive_core::criticality::Settings as MeasureSettings;
use interdrive_core::observation::ObservationSettings;
use interdrive_core::plan::frenet::{FrenetSettings, FrenetTarget};
use interdrive_core::plan::rollout::RolloutSettings;
use interdrive_core::plan::{
    CcSettings, FsmSettings, IdmMobilSettings, IdmSettings, LawfulSettings, PdmSettings, R157Settings, RssSettings,
    VelocityAdjustingSettings,
};
use interdrive_core::predict::{ConstantVelocity, LaneFollowing};
use interdrive_core::road::RoadSettings;
use interdrive_core::rules::RulesSettings;
use interdrive_core::scene::ViewLimits;
use interdrive_core::settings::{Range, Record, Value, check};
use interdrive_core::v2x::V2xSettings;
use interdrive_core::vehicle::single_track::Kinematic;
use interdrive_core::world::StepSettings;
use interdrive_core::worlds::RewardWeights;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyInt};

use crate::errors::{InputError, exception};

/// The records that Python makes and hands over, with the settings that they have by default.
fn records() -> Vec<Box<dyn Record>> {
    vec![
        Box::new(RolloutSettings::default()),
        Box::new(FrenetSettings::default()),
        Box::new(VelocityAdjustingSettings::default()),
        Box::new(IdmSettings::default()),
        Box::new(LawfulSettings::default()),
        Box::new(IdmMobilSettings::default()),
        Box::new(PdmSettings::default()),
        Box::new(CcSettings::default()),
        Box::new(R157Settings::default()),
        Box::new(RssSettings::default()),
        Box::new(FsmSettings::default()),
        Box::new(ConstantVelocity::default()),
        Box::new(LaneFollowing::default()),
        Box::new(ViewLimits::default()),
        Box::new(StepSettings::default()),
        Box::new(RoadSettings::default()),
        Box::new(RulesSettings::default()),
        Box::new(V2xSettings::default()),
        Box::new(MeasureSettings::default()),
        Box::new(Kinematic::default()),
        Box::new(FrenetTarget::default()),
        Box::new(ObservationSettings::default()),
        Box::new(RewardWeights::default()),
    ]
}

/// Writes what a record of Python says into one of the core.
fn fill(record: &mut dyn Record, given: &Bound<'_, PyAny>) -> PyResult<()> {
    for (field, value) in record.fields() {
        let one = if field.name.is_empty() { given.clone() } else { given.getattr(field.name)? };
        let expected = match value {
            Value::Number(_) => "a number",
            Value::Count(_) => "a whole number",
            Value::Flag(_) => "true or false",
            Value::Choice(_) | Value::Record(_) => "a name",
        };
        let refused = |_| InputError::new_err((field.name, format!("expected {expected}, not {one}")));
        match value {
            Value::Number(number) => *number = one.extract().map_err(refused)?,
            Value::Count(count) => {
                let Range { min, max, .. } = field.range;
                *count = one.extract().map_err(|error| match one.is_instance_of::<PyInt>() {
                    true => InputError::new_err((field.name, format!("must be {min} to {max}, not {one}"))),
                    false => refused(error),
                })?;
            }
            Value::Flag(flag) => *flag = one.extract().map_err(refused)?,
            Value::Choice(choice) => {
                if !choice.choose(&one.extract::<String>().map_err(refused)?) {
                    let words = choice.words().join(", ");
                    return Err(InputError::new_err((field.name, format!("must be one of {words}, not {one}"))));
                }
            }
            Value::Record(inner) => fill(inner, &one).map_err(|error| within(field.name, &one, error))?,
        }
    }
    Ok(())
}

/// An error of a record within another one: the name of the field that holds it comes before its location.
fn within(outer: &str, one: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
    if error.is_instance_of::<PyAttributeError>(one.py()) {
        return InputError::new_err((outer.to_owned(), format!("expected settings, not {one}")));
    }
    let args = error.value(one.py()).getattr("args").and_then(|args| args.extract::<(String, String)>());
    match args {
        Ok((location, message)) if !outer.is_empty() => InputError::new_err((format!("{outer}.{location}"), message)),
        _ => error,
    }
}

/// The core's settings for a record of Python.
pub fn read<T: Record + Default>(given: &Bound<'_, PyAny>) -> PyResult<T> {
    let mut settings = T::default();
    fill(&mut settings, given)?;
    check(&mut settings).map_err(exception)?;
    Ok(settings)
}

/// Checks a record of Python by the table of this name.
#[pyfunction]
pub fn check_settings(name: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let found = records().into_iter().find(|record| record.about().0 == name);
    let mut settings = found.ok_or_else(|| InputError::new_err((name.to_owned(), "is not a settings record")))?;
    fill(settings.as_mut(), given)?;
    check(settings.as_mut()).map_err(exception)
}

/// A table as a dict: its name, its text, and the fields as dicts; a field that is a record has its table for a value.
fn table<'py>(py: Python<'py>, record: &mut dyn Record) -> PyResult<Bound<'py, PyDict>> {
    let (name, text) = record.about();
    let mut fields = Vec::new();
    for (field, value) in record.fields() {
        let one = PyDict::new(py);
        one.set_item("name", field.name)?;
        one.set_item("unit", field.unit)?;
        one.set_item("text", field.text)?;
        one.set_item("range", field.range.text())?;
        match value {
            Value::Number(number) => one.set_item("default", *number)?,
            Value::Count(count) => one.set_item("default", *count)?,
            Value::Flag(flag) => one.set_item("default", *flag)?,
            Value::Choice(choice) => {
                one.set_item("default", choice.word())?;
                one.set_item("words", choice.words())?;
            }
            Value::Record(inner) => one.set_item("default", table(py, inner)?)?,
        }
        fields.push(one);
    }
    let made = PyDict::new(py);
    made.set_item("name", name)?;
    made.set_item("text", text)?;
    made.set_item("fields", fields)?;
    Ok(made)
}

/// All tables, see `crates/python/settings.py`.
#[pyfunction]
pub fn settings_tables(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    records().iter_mut().map(|record| table(py, record.as_mut())).collect()
}

/// Number of time steps after which a run with these `step` settings ends, given the recorded time steps and, for each
/// agent, the time steps of its start and of the end of its goal.
#[pyfunction]
pub fn steps_at_most(step: &Bound<'_, PyAny>, n_recorded: usize, agents: Vec<(i64, i64)>) -> PyResult<usize> {
    let step = read::<StepSettings>(step)?;
    let needed = agents.into_iter().map(|(start, end)| step.time_limit(start, end)).max();
    Ok(step.steps_at_most(n_recorded, needed.unwrap_or(0)))
}
