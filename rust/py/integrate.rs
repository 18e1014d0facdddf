//! `integrate`: equations as formulas, driven by pieces of polynomials, to the samples.

use modfun::integrate::{Outcome, Problem, Tableau, integrate as core};
use modfun::tape::{Tape, Written};
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::slice;
use crate::enter::enter;
use crate::errors::to_python;

/// A, B, C and the weights of the errors of order 5 and 3.
type GivenTableau<'py> = (
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
);
/// States (sample, start, state), or None and the time at which they leave (none: stiff).
type Answer<'py> = (Option<Bound<'py, PyArray3<f64>>>, Option<f64>);

/// States at the samples.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn integrate<'py>(
    py: Python<'py>,
    formulas: (Vec<Written>, Vec<usize>),
    grid: PyReadonlyArray1<'py, f64>,
    drives: PyReadonlyArray3<'py, f64>,
    starts: PyReadonlyArray2<'py, f64>,
    theta: PyReadonlyArray2<'py, f64>,
    relative: f64,
    absolute: PyReadonlyArray1<'py, f64>,
    most: usize,
    tableau: GivenTableau<'py>,
) -> PyResult<Answer<'py>> {
    let (count, states, samples) = (starts.shape()[0], starts.shape()[1], grid.shape()[0]);
    let inputs = 1 + states + drives.shape()[0] + theta.shape()[1];
    let (ops, places) = formulas;
    let tape = Tape::new(&ops, inputs, places).map_err(to_python)?;
    let (a, b, c, fifth, third) = &tableau;
    let (a, b, c) = (slice(a, "A")?, slice(b, "B")?, slice(c, "C")?);
    let tableau = Tableau { a, b, c, fifth: slice(fifth, "E5")?, third: slice(third, "E3")? };
    let problem = Problem {
        tape: &tape,
        grid: slice(&grid, "grid")?,
        drives: slice(&drives, "drives")?,
        terms: drives.shape()[2],
        starts: slice(&starts, "starts")?,
        theta: slice(&theta, "theta")?,
        count,
        relative,
        absolute: slice(&absolute, "absolute")?,
        most,
    };
    match enter(py, None, |_| core(&problem, &tableau))? {
        Outcome::Done(x) => {
            let shaped = PyArray1::from_vec(py, x).reshape([samples, count, states])?;
            Ok((Some(shaped), None))
        }
        Outcome::Stiff => Ok((None, None)),
        Outcome::Left(t) => Ok((None, Some(t))),
    }
}
