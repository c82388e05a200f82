//! The core's errors as the exceptions of `interdrive.errors`, and the one helper that releases the interpreter.

use interdrive_core::error::Error;
use pyo3::import_exception;
use pyo3::prelude::*;

import_exception!(interdrive.errors, InputError);
import_exception!(interdrive.errors, NoRouteError);
import_exception!(interdrive.errors, StepOrderError);

/// The exception for an error of the core.
pub fn exception(error: Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::InvalidInput(_) | Error::UnknownId { .. } => InputError::new_err(text),
        Error::Setting { name, message } => InputError::new_err((name, message)),
        Error::NoRoute(_) => NoRouteError::new_err(text),
        Error::WrongTimeStep { .. } => StepOrderError::new_err(text),
    }
}

/// Runs `work` with the interpreter released and maps its error.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Error> + Send) -> PyResult<T> {
    py.detach(work).map_err(exception)
}
