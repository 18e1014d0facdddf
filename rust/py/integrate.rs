//! `integrate`: equations as formulas, driven by pieces of polynomials, to the samples.

use modfun::integrate::{Outcome, Past, Problem, integrate as core};
use modfun::tape::{Tape, Written};
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::slice;
use crate::enter::enter;
use crate::errors::to_python;

/// States (sample, start, state), or None; the time at which the states leave, or are stuck; if stuck, the largest.
type Answer<'py> = (Option<Bound<'py, PyArray3<f64>>>, Option<f64>, Option<f64>);

/// States at the samples.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn integrate<'py>(
    py: Python<'py>,
    formulas: (Vec<Written>, Vec<usize>),
    grid: PyReadonlyArray1<'py, f64>,
    drives: PyReadonlyArray3<'py, f64>,
    pasts: Vec<(usize, f64)>,
    starts: PyReadonlyArray2<'py, f64>,
    theta: PyReadonlyArray2<'py, f64>,
    relative: f64,
    absolute: PyReadonlyArray1<'py, f64>,
    most: usize,
) -> PyResult<Answer<'py>> {
    let (count, states, samples) = (starts.shape()[0], starts.shape()[1], grid.shape()[0]);
    let inputs = 1 + states + drives.shape()[0] + pasts.len() + theta.shape()[1];
    let (ops, places) = formulas;
    let tape = Tape::new(&ops, inputs, places).map_err(to_python)?;
    let pasts: Vec<Past> = pasts.into_iter().map(|(state, delay)| Past { state, delay }).collect();
    let problem = Problem {
        tape: &tape,
        grid: slice(&grid, "grid")?,
        drives: slice(&drives, "drives")?,
        terms: drives.shape()[2],
        pasts: &pasts,
        starts: slice(&starts, "starts")?,
        theta: slice(&theta, "theta")?,
        count,
        relative,
        absolute: slice(&absolute, "absolute")?,
        most,
    };
    match enter(py, None, |_| core(&problem))? {
        Outcome::Done(x) => {
            let shaped = PyArray1::from_vec(py, x).reshape([samples, count, states])?;
            Ok((Some(shaped), None, None))
        }
        Outcome::Left(t) => Ok((None, Some(t), None)),
        Outcome::Stuck(t, largest) => Ok((None, Some(t), Some(largest))),
    }
}
