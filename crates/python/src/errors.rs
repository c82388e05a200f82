//! The exception tree, the mapping of the core's errors, and the one helper that releases the interpreter.

use interdrive_core::error::Error;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(interdrive._core, InterdriveError, PyException, "Anything interdrive reports on purpose.");
create_exception!(
    interdrive._core,
    InputError,
    InterdriveError,
    "Input that cannot be used: the text names the file, field or agent and says what to do."
);
create_exception!(
    interdrive._core,
    NoRouteError,
    InputError,
    "The road network does not connect an agent's start with its goal."
);
create_exception!(
    interdrive._core,
    StepOrderError,
    InterdriveError,
    "Scene, predictions or plans belong to another time step than the world's."
);

/// The exception for an error of the core.
pub fn exception(error: Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::InvalidInput(_) | Error::UnknownId { .. } => InputError::new_err(text),
        Error::NoRoute(_) => NoRouteError::new_err(text),
        Error::WrongTimeStep { .. } => StepOrderError::new_err(text),
    }
}

/// Runs `work` with the interpreter released and maps its error.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Error> + Send) -> PyResult<T> {
    py.detach(work).map_err(exception)
}

/// Adds the exceptions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("InterdriveError", py.get_type::<InterdriveError>())?;
    module.add("InputError", py.get_type::<InputError>())?;
    module.add("NoRouteError", py.get_type::<NoRouteError>())?;
    module.add("StepOrderError", py.get_type::<StepOrderError>())
}
