//! `interdrive._core`: what of the core is visible from Python.

#![allow(clippy::too_many_arguments, reason = "one array per field: Python passes them by name")]

mod arrays;
mod commonroad;
mod criticality;
mod errors;
mod getters;
mod neural;
mod observation;
mod planner;
mod predictions;
mod predictor;
mod reference_drivers;
mod route;
mod scenario;
mod scene;
mod scoring;
mod settings;
mod step;
mod vehicle;
mod view;
mod world;
mod worlds;

use interdrive_core::conduct;
use interdrive_core::control::{self, Signal};
use interdrive_core::criticality::Measure;
use interdrive_core::criticality::harm::ImpactArea;
use interdrive_core::junctions::{AreaKind, Reason};
use interdrive_core::plan::external_plan::PLAN_POINTS_MAX;
use interdrive_core::recording::OutcomeKind;
use interdrive_core::right_of_way;
use interdrive_core::rules;
use interdrive_core::trajectory::PlanStatus;
use interdrive_core::turn::Turn;
use interdrive_core::v2x::{Service, Via};
use interdrive_core::vehicle::{ParticipantKind, single_track};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Names of the codes in arrays, by their position, as the core calls them.
fn codes(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let codes = PyDict::new(py);
    codes.set_item("kind", ParticipantKind::ALL.map(|kind| format!("{kind:?}")))?;
    codes.set_item("outcome", OutcomeKind::ALL.map(|kind| format!("{kind:?}")))?;
    codes.set_item("plan_status", PlanStatus::ALL.map(|status| format!("{status:?}")))?;
    codes.set_item("impact_area", ImpactArea::ALL.map(|area| format!("{area:?}")))?;
    codes.set_item("service", Service::ALL.map(|service| format!("{service:?}")))?;
    codes.set_item("via", Via::ALL.map(|via| format!("{via:?}")))?;
    codes.set_item("signal", Signal::ALL.map(|signal| format!("{signal:?}")))?;
    codes.set_item("turn", Turn::ALL.map(|turn| format!("{turn:?}")))?;
    codes.set_item("area_kind", AreaKind::ALL.map(|kind| format!("{kind:?}")))?;
    codes.set_item("precedence", Reason::ALL.map(|reason| format!("{reason:?}")))?;
    codes.set_item("order", right_of_way::OrderKind::ALL.map(|kind| format!("{kind:?}")))?;
    codes.set_item("measure", Measure::ALL.map(|(_, name)| name))?;
    Ok(codes)
}

/// Codes of the signals that hold nobody.
fn going_signals() -> Vec<usize> {
    Signal::ALL.iter().enumerate().filter(|(_, signal)| signal.lets_go()).map(|(code, _)| code).collect()
}

/// A vehicle could stop within a distance [m] from a speed [m/s] by the braking that is expected.
#[pyfunction]
fn could_stop(velocity: f64, distance: f64) -> bool {
    conduct::could_stop(velocity, distance)
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("CODES", codes(module.py())?)?;
    module.add("PLAN_POINTS_MAX", PLAN_POINTS_MAX)?;
    module.add("STANDSTILL_SPEED", conduct::STANDSTILL_SPEED)?;
    module.add("JUDGED_STANDSTILL_SPEED", conduct::JUDGED_STANDSTILL_SPEED)?;
    module.add("CREEPING_SPEED", single_track::CREEPING_SPEED)?;
    module.add("EXPECTED_DECELERATION", conduct::EXPECTED_DECELERATION)?;
    module.add("STOP_REACH", rules::STOP_REACH)?;
    module.add("STOP_RANK", control::STOP_RANK)?;
    module.add("RANK_WITHOUT_SIGN", control::RANK_WITHOUT_SIGN)?;
    module.add("GOING_SIGNALS", going_signals())?;
    module.add("DESIGN_WIDTH", right_of_way::DESIGN_WIDTH)?;
    module.add("REACH", right_of_way::REACH)?;
    module.add("REACH_TIME", right_of_way::REACH_TIME)?;
    criticality::register(module)?;
    worlds::register(module)?;
    neural::register(module)?;
    scoring::register(module)?;
    reference_drivers::register(module)?;
    commonroad::register(module)?;
    module.add_function(wrap_pyfunction!(could_stop, module)?)?;
    module.add_function(wrap_pyfunction!(settings::check_settings, module)?)?;
    module.add_function(wrap_pyfunction!(settings::settings_tables, module)?)?;
    module.add_function(wrap_pyfunction!(settings::steps_at_most, module)?)?;
    module.add_function(wrap_pyfunction!(observation::observation_layout, module)?)?;
    module.add_function(wrap_pyfunction!(observation::observation_blocks, module)?)?;
    module.add_class::<scenario::PyShape>()?;
    module.add_class::<scenario::PyRoadNetwork>()?;
    module.add_class::<scenario::PyParticipants>()?;
    module.add_class::<scenario::PyScenario>()?;
    module.add_class::<route::PyGoal>()?;
    module.add_class::<vehicle::PyVehicle>()?;
    module.add_class::<route::PyRoute>()?;
    module.add_class::<planner::PyPlanner>()?;
    module.add_class::<scene::PyScene>()?;
    module.add_class::<view::PyView>()?;
    module.add_class::<view::PyEgo>()?;
    module.add_class::<view::PyBarriers>()?;
    module.add_class::<world::PyAgent>()?;
    module.add_class::<predictor::PyPredictor>()?;
    module.add_class::<predictions::PyPredictions>()?;
    module.add_class::<step::PyStep>()?;
    module.add_class::<world::PyWorld>()
}
