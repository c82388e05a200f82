//! The core's errors as the exceptions of `interdrive.errors`, and the one helper that releases the interpreter.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use interdrive_core::error::Error;
use pyo3::exceptions::PyRuntimeError;
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

/// Runs `work` with the interpreter released and maps its error. A panic is a bug of the core: it becomes an exception
/// that other processes can read, unlike that of PyO3.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Error> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(result) => result.map_err(exception),
        Err(panic) => Err(PyRuntimeError::new_err(format!("the core failed: {}", said(panic.as_ref())))),
    }
}

fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("it did not say why")
}
