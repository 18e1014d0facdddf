//! `sinusoids`: tones of many records.

use modfun::simd::Isa;
use modfun::tones::{Found, Options, Plan};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;

/// Tones of records (record, sample); complex ones: real parts, then imaginary parts.
///
/// Time is counted in samples. Rows of the answer hold frequencies, dampings (where free), amplitudes, phases,
/// nan behind the tones that were found; the covariance is that of the first record.
#[pyfunction]
#[pyo3(signature = (records, weights, *, count, choose, damped, complex, trend, band, lines, awls, threads, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn sinusoids<'py>(
    py: Python<'py>,
    records: PyReadonlyArray2<'py, f64>,
    weights: PyReadonlyArray1<'py, f64>,
    count: usize,
    choose: bool,
    damped: bool,
    complex: bool,
    trend: usize,
    band: (f64, f64),
    lines: usize,
    awls: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = Options { count, choose, damped, complex, trend, band, lines, awls };
    let isa = Isa::detect().map_err(to_python)?;
    let plan = Plan::new(slice(&weights, "weights")?, options, isa).map_err(to_python)?;
    let rows: Vec<&[f64]> =
        slice(&records, "records")?.chunks_exact(records.shape()[1].max(1)).collect();
    if records.shape()[1] != plan.length() {
        return Err(to_python(modfun::Error::Data(format!(
            "sinusoids: {} numbers a record, and weights for {}",
            records.shape()[1],
            plan.length()
        ))));
    }
    let threads = modfun::threads::count(threads).map_err(to_python)?;
    let found = enter(py, progress, |report| plan.run_many(&rows, threads, report))?;
    dictionary(py, &found, count, damped)
}

fn dictionary<'py>(
    py: Python<'py>,
    found: &[Found],
    count: usize,
    damped: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let kinds = if damped { 4 } else { 3 };
    let (mut params, mut bse) = (Vec::new(), Vec::new());
    for f in found {
        let own = f.tones.len();
        let errors: Vec<f64> =
            (0..kinds * own).map(|k| f.cov[k * (kinds * own + 1)].sqrt()).collect();
        let of = |kind: usize, i: usize| match (kind, damped) {
            (0, _) => std::f64::consts::TAU * f.tones[i].frequency,
            (1, true) => f.tones[i].damping,
            (k, _) if k + 2 == kinds => f.amplitude[i],
            _ => f.phase[i],
        };
        for kind in 0..kinds {
            for i in 0..count {
                params.push(if i < own { of(kind, i) } else { f64::NAN });
                bse.push(if i < own { errors[kind * own + i] } else { f64::NAN });
            }
        }
    }
    let out = PyDict::new(py);
    let rows = found.len();
    out.set_item("params", matrix(py, params, rows)?)?;
    out.set_item("bse", matrix(py, bse, rows)?)?;
    out.set_item("count", vector(py, found.iter().map(|f| f.tones.len() as i64).collect()))?;
    out.set_item("status", vector(py, found.iter().map(|f| f.status as u8).collect()))?;
    out.set_item("cost", vector(py, found.iter().map(|f| f.cost).collect()))?;
    out.set_item("variance", vector(py, found.iter().map(|f| f.variance).collect()))?;
    out.set_item("nit", vector(py, found.iter().map(|f| f.nit as i64).collect()))?;
    if let Some(f) = found.first() {
        let own = kinds * f.tones.len();
        out.set_item("cov", matrix(py, f.cov.clone(), own)?)?;
        out.set_item("trend", vector(py, f.trend.clone()))?;
        out.set_item("df_resid", f.df)?;
        out.set_item("costs", vector(py, f.costs.clone()))?;
    }
    Ok(out)
}
