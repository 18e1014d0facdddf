//! Takes C-contiguous float64 arrays from Python as slices, and gives vectors back without copying.

use modfun::Error;
use numpy::{
    Complex64, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
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

/// The rows of an array, one a channel.
pub fn channels<'a>(array: &'a PyReadonlyArray2<'_, f64>, name: &str) -> PyResult<Vec<&'a [f64]>> {
    Ok(slice(array, name)?.chunks_exact(array.shape()[1].max(1)).collect())
}

/// Rows of the array of each record; none where there is no array.
pub fn listed(
    arrays: &[Option<PyReadonlyArray2<'_, f64>>],
    name: &str,
) -> PyResult<Vec<Vec<Vec<f64>>>> {
    let rows = |array: &PyReadonlyArray2<'_, f64>| {
        Ok(channels(array, name)?.into_iter().map(<[f64]>::to_vec).collect())
    };
    arrays.iter().map(|array| array.as_ref().map_or(Ok(Vec::new()), rows)).collect()
}

/// Pairs of real and imaginary part as complex numbers.
pub fn complex<'a>(pairs: impl IntoIterator<Item = &'a (f64, f64)>) -> Vec<Complex64> {
    pairs.into_iter().map(|(re, im)| Complex64::new(*re, *im)).collect()
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
