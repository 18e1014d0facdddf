//! Statistics of residual lines for Python.

use modfun::line_tests::{self, Line};
use numpy::{Complex64, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::vector;

/// Adds the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(line_correlation, module)?)?;
    module.add_function(wrap_pyfunction!(line_colour, module)?)?;
    module.add_function(wrap_pyfunction!(pooled_power, module)?)?;
    module.add_function(wrap_pyfunction!(line_event, module)?)?;
    module.add_function(wrap_pyfunction!(sharpest, module)?)?;
    module.add_function(wrap_pyfunction!(unforeseen, module)?)
}

fn lines(residuals: &[PyReadonlyArray1<'_, Complex64>]) -> Vec<Vec<Line>> {
    residuals.iter().map(|e| e.as_array().iter().map(|e| (e.re, e.im)).collect()).collect()
}

/// Ljung-Box statistic of the lines of records, and their autocorrelation.
#[pyfunction]
#[pyo3(signature = (residuals, lags=None))]
fn line_correlation<'py>(
    py: Python<'py>,
    residuals: Vec<PyReadonlyArray1<'py, Complex64>>,
    lags: Option<usize>,
) -> Option<(f64, Bound<'py, PyArray1<f64>>)> {
    line_tests::correlation(&lines(&residuals), lags).map(|(q, r)| (q, vector(py, r)))
}

/// Kolmogorov-Smirnov distance of the lines' power, and the level of the lower over the upper half.
#[pyfunction]
fn line_colour(residuals: Vec<PyReadonlyArray1<'_, Complex64>>) -> Option<(f64, f64)> {
    line_tests::colour(&lines(&residuals))
}

/// Power of the lines of all records, in the order of their place in their band.
#[pyfunction]
fn pooled_power<'py>(
    py: Python<'py>,
    residuals: Vec<PyReadonlyArray1<'py, Complex64>>,
) -> Bound<'py, PyArray1<f64>> {
    vector(py, line_tests::pooled_power(&lines(&residuals)))
}

/// Place, on a grid of four times as many points as lines, of the event that explains most, and its share.
#[pyfunction]
fn line_event(residuals: PyReadonlyArray1<'_, Complex64>) -> Option<(usize, f64)> {
    line_tests::event(&residuals.as_array().iter().map(|e| (e.re, e.im)).collect::<Vec<Line>>())
}

/// Largest fourth difference over the mean one, of the channel where that is largest.
#[pyfunction]
fn sharpest(samples: PyReadonlyArray2<'_, f64>) -> f64 {
    let rows = samples.as_array();
    rows.outer_iter().map(|row| line_tests::sharpest(row.iter().copied())).fold(0.0, f64::max)
}

/// What cubics through four samples leave of the next one, rms over that of the samples about their mean.
#[pyfunction]
fn unforeseen(samples: PyReadonlyArray1<'_, f64>) -> f64 {
    line_tests::unforeseen(&samples.as_array().to_vec())
}
