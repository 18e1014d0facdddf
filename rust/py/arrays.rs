//! Takes C-contiguous float64 arrays from Python as slices, and gives vectors back without copying.

use modfun::Error;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::to_python;

/// The elements of a C-contiguous array.
///
/// The crate's own `as_slice` also takes Fortran order, which would silently swap the axes.
pub fn slice<'a, D: numpy::ndarray::Dimension>(
    array: &'a PyReadonlyArray<'_, f64, D>,
    name: &str,
) -> PyResult<&'a [f64]> {
    let given = || {
        to_python(Error::Data(format!(
            "{name}: expected a C-contiguous float64 array, got strides {:?} for shape {:?}; \
             pass numpy.ascontiguousarray({name}, dtype=float)",
            array.strides(),
            array.shape()
        )))
    };
    if !array.is_c_contiguous() {
        return Err(given());
    }
    array.as_slice().map_err(|_| given())
}

/// A vector moved into a one-dimensional array.
pub fn vector<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    PyArray1::from_vec(py, values)
}

/// A vector in row-major order moved into an array of `rows` by `values.len() / rows`.
pub fn matrix<T: numpy::Element>(
    py: Python<'_>,
    values: Vec<T>,
    rows: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let columns = values.len().checked_div(rows).unwrap_or(0);
    PyArray1::from_vec(py, values).reshape([rows, columns])
}
