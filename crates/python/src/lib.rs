//! `interdrive._core`: what of the core is visible from Python.

#![allow(clippy::too_many_arguments, reason = "one array per field: Python passes them by name")]

mod arrays;
mod errors;
mod planner;
mod scenario;
mod view;
mod world;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::register(module)?;
    module.add_class::<scenario::PyShape>()?;
    module.add_class::<scenario::PyRoadNetwork>()?;
    module.add_class::<scenario::PyScenario>()?;
    module.add_class::<scenario::PyGoal>()?;
    module.add_class::<scenario::PyVehicle>()?;
    module.add_class::<scenario::PyRoute>()?;
    module.add_class::<planner::PyFrenetSettings>()?;
    module.add_class::<planner::PyRecordedSettings>()?;
    module.add_class::<planner::PyVelocityAdjustingSettings>()?;
    module.add_class::<planner::PyIdmSettings>()?;
    module.add_class::<view::PyScene>()?;
    module.add_class::<view::PyView>()?;
    module.add_class::<view::PyEgo>()?;
    module.add_class::<world::PyAgent>()?;
    module.add_class::<world::PyPredictor>()?;
    module.add_class::<world::PyPredictions>()?;
    module.add_class::<world::PyPlans>()?;
    module.add_class::<world::PyWorld>()
}
