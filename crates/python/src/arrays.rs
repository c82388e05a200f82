//! numpy in and out: shape checks going down, read-only arrays going up.

use interdrive_core::columns::Values;
use interdrive_core::geometry::Point;
use numpy::{
    Element, IntoPyArray, PyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods, ndarray::Dimension,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::errors::InputError;

/// A read-only array of one dimension.
pub type Row<'py, T> = Bound<'py, PyArray1<T>>;
/// A read-only array of several dimensions.
pub type Grid<'py> = PyResult<Bound<'py, PyAny>>;

/// Forbids writing to an array that is handed out.
fn frozen<'py, T: Element, D: Dimension>(array: Bound<'py, PyArray<T, D>>) -> Bound<'py, PyArray<T, D>> {
    let _ = array.readwrite().make_nonwriteable();
    array
}

/// A read-only array of one dimension.
pub fn row<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    frozen(values.into_pyarray(py))
}

/// A read-only array of the given shape.
pub fn grid<T: Element, const N: usize>(
    py: Python<'_>,
    values: Vec<T>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyAny>> {
    let array = values.into_pyarray(py).reshape(shape.to_vec())?;
    array.call_method1("setflags", (false,))?;
    Ok(array.into_any())
}

/// Columns of a table as a dict of arrays, texts as tuples.
pub fn table(py: Python<'_>, columns: Vec<(String, Values)>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    for (name, values) in columns {
        match values {
            Values::Integers(values) => dict.set_item(name, row(py, values))?,
            Values::Numbers(values) => dict.set_item(name, row(py, values))?,
            Values::Truths(values) => dict.set_item(name, row(py, values))?,
            Values::Texts(values) => dict.set_item(name, PyTuple::new(py, values)?)?,
        }
    }
    Ok(dict)
}

/// Points as an array of shape (points, 2).
pub fn points(py: Python<'_>, points: impl IntoIterator<Item = Point>) -> PyResult<Bound<'_, PyAny>> {
    let flat: Vec<f64> = points.into_iter().flat_map(|point| [point.x, point.y]).collect();
    let n = flat.len() / 2;
    grid(py, flat, [n, 2])
}

/// Points from an array of shape (points, 2).
pub fn read_points(name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Point>> {
    if array.shape()[1] != 2 {
        return Err(InputError::new_err(format!("{name}: shape {:?} given, (points, 2) expected", array.shape())));
    }
    Ok(array.as_array().rows().into_iter().map(|row| Point::new(row[0], row[1])).collect())
}

/// Values of an array of one dimension with a known length.
pub fn read_row<T: Element + Copy>(name: &str, array: &PyReadonlyArray1<'_, T>, length: usize) -> PyResult<Vec<T>> {
    if array.len() != length {
        return Err(InputError::new_err(format!("{name}: {} values given, {length} expected", array.len())));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// Values of an array that must have one dimension.
pub fn read_line(name: &str, array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<f64>> {
    if array.shape().len() != 1 {
        return Err(InputError::new_err(format!("{name} has shape {:?}, one dimension is expected", array.shape())));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// Values of an array of a known shape, row-major.
pub fn read_grid<T: Element + Copy>(
    name: &str,
    array: &PyReadonlyArrayDyn<'_, T>,
    shape: &[usize],
) -> PyResult<Vec<T>> {
    if array.shape() != shape {
        return Err(InputError::new_err(format!("{name}: shape {:?} given, {shape:?} expected", array.shape())));
    }
    Ok(array.as_array().iter().copied().collect())
}
