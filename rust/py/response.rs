//! `local_responses`: frequency responses from the lines around each frequency.

use modfun::Error;
use modfun::response::{Family, Piece, Responses, Settings, Weighting, responses};
use modfun::simd::Isa;
use modfun::threads;
use numpy::{Complex64, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice};
use crate::enter::enter;
use crate::errors::to_python;

/// Line spacing, half-width, whether line 0 counts, coefficients of outputs and of inputs (channel, line).
type Given<'py> =
    (f64, usize, bool, PyReadonlyArray2<'py, Complex64>, PyReadonlyArray2<'py, Complex64>);

/// Estimates at `omega` by name, each with a row a frequency.
#[pyfunction]
#[pyo3(signature = (pieces, omega, family, degree, weighting, threads, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn local_responses<'py>(
    py: Python<'py>,
    pieces: Vec<Given<'py>>,
    omega: PyReadonlyArray1<'py, f64>,
    family: &str,
    degree: usize,
    weighting: &str,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = settings(family, degree, weighting).map_err(to_python)?;
    let omega = slice(&omega, "omega")?;
    let pieces: Vec<Piece> = pieces
        .iter()
        .map(|(omega0, half, zero, y, u)| {
            Ok(Piece {
                omega0: *omega0,
                half: *half,
                zero: *zero,
                y: channels(y)?,
                u: channels(u)?,
            })
        })
        .collect::<PyResult<_>>()?;
    let count = threads::count(threads).map_err(to_python)?;
    let isa = Isa::detect().map_err(to_python)?;
    let found =
        enter(py, progress, |report| responses(isa, count, settings, &pieces, omega, report))?;
    let Responses { response, cov, noise, coherence, left_out, freedom } = found;
    let rows = omega.len();
    let out = PyDict::new(py);
    out.set_item("response", matrix(py, complex(response), rows)?)?;
    out.set_item("cov", matrix(py, complex(cov), rows)?)?;
    out.set_item("noise", matrix(py, complex(noise), rows)?)?;
    out.set_item("coherence", matrix(py, coherence, rows)?)?;
    out.set_item("left_out", matrix(py, left_out, rows)?)?;
    out.set_item("freedom", freedom)?;
    Ok(out)
}

fn settings(family: &str, degree: usize, weighting: &str) -> Result<Settings, Error> {
    let family = match family {
        "modulating" => Family::Modulating,
        "lpm" => Family::Polynomial,
        "lrm" => Family::Rational,
        _ => return Err(Error::Spec(format!("there is no kind of local model {family:?}"))),
    };
    let weighting = match weighting {
        "ls" => Weighting::Ls,
        "awls" => Weighting::Awls,
        "ml" => Weighting::Ml,
        _ => return Err(Error::Spec(format!("there is no weighting {weighting:?}"))),
    };
    Ok(Settings { family, degree, weighting })
}

fn channels(array: &PyReadonlyArray2<'_, Complex64>) -> PyResult<Vec<Vec<[f64; 2]>>> {
    let lines = array.shape()[1];
    let values = array.as_slice().map_err(|_| {
        to_python(Error::Data("coefficients: expected C-contiguous arrays (channel, line)".into()))
    })?;
    Ok(values
        .chunks(lines.max(1))
        .map(|channel| channel.iter().map(|v| [v.re, v.im]).collect())
        .collect())
}

fn complex(pairs: Vec<[f64; 2]>) -> Vec<Complex64> {
    pairs.into_iter().map(|[re, im]| Complex64::new(re, im)).collect()
}
