//! Sums of studies for Python: moments merged and made figures of, errors counted, quantiles.

use modfun::Error;
use modfun::monte_carlo::histogram::{BINS, Histogram, Occupied, quantile};
use modfun::monte_carlo::moments::Moments;
use modfun::simd::Isa;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice, vector};
use crate::errors::to_python;

/// Count, mean and sums of powers 2 to 4, as Python keeps them.
pub fn numbers(m: &Moments) -> [f64; 5] {
    [m.count as f64, m.mean, m.sums[0], m.sums[1], m.sums[2]]
}

fn moments(rows: &[f64]) -> impl Iterator<Item = Moments> {
    rows.chunks_exact(5).map(|row| Moments {
        count: row[0] as u64,
        mean: row[1],
        sums: [row[2], row[3], row[4]],
    })
}

/// Rows of (count, mean, sums of powers 2 to 4 about the mean).
fn checked<'a>(rows: &'a PyReadonlyArray2<'_, f64>, name: &str) -> PyResult<&'a [f64]> {
    if rows.shape()[1] == 5 {
        return slice(rows, name);
    }
    Err(refused(&format!("{name} has {} columns, not 5", rows.shape()[1])))
}

fn refused(text: &str) -> PyErr {
    to_python(Error::Data(format!("summing up a study: {text}")))
}

/// The moments of both, those of `next` after the others.
#[pyfunction]
pub fn merge_moments<'py>(
    py: Python<'py>,
    before: PyReadonlyArray2<'py, f64>,
    next: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (a, b) = (checked(&before, "before")?, checked(&next, "next")?);
    if a.len() != b.len() {
        return Err(refused(&format!("{} rows to merge with {}", a.len() / 5, b.len() / 5)));
    }
    let merged = moments(a).zip(moments(b)).flat_map(|(mut all, one)| {
        all.merge(&one);
        numbers(&all)
    });
    matrix(py, merged.collect(), a.len() / 5)
}

/// What moments say: figures by name, with their standard errors.
#[pyfunction]
pub fn figures<'py>(
    py: Python<'py>,
    moments: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let rows = checked(&moments, "moments")?;
    let out = PyDict::new(py);
    type Figure = fn(&Moments) -> f64;
    let columns: [(&str, Figure); 6] = [
        ("bias", Moments::bias),
        ("bias_mcse", Moments::bias_se),
        ("sd", Moments::sd),
        ("sd_mcse", Moments::sd_se),
        ("rmse", Moments::rmse),
        ("rmse_mcse", Moments::rmse_se),
    ];
    for (name, of) in columns {
        out.set_item(name, vector(py, self::moments(rows).map(|m| of(&m)).collect()))?;
    }
    Ok(out)
}

/// Moments, and occupied bins with their counts, of errors (replicate, parameter).
///
/// `figures` numbers the parameters among all of the study; bins are numbered through.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn count_errors<'py>(
    py: Python<'py>,
    errors: PyReadonlyArray2<'py, f64>,
    truth: PyReadonlyArray1<'py, f64>,
    figures: Vec<i64>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>)> {
    let (columns, truth) = (errors.shape()[1], slice(&truth, "truth")?);
    if truth.len() != columns || figures.len() != columns {
        return Err(refused(&format!(
            "{columns} columns of errors, {} true values and {} figures",
            truth.len(),
            figures.len()
        )));
    }
    let values = slice(&errors, "errors")?;
    let isa = Isa::detect().map_err(to_python)?;
    let (mut rows, mut bins, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    for (k, (truth, figure)) in truth.iter().zip(&figures).enumerate() {
        let own: Vec<f64> = values.iter().skip(k).step_by(columns.max(1)).copied().collect();
        rows.extend(numbers(&Moments::of(isa, &own)));
        let mut histogram = Histogram::new(*truth);
        own.iter().for_each(|e| histogram.push(*e));
        for (bin, count) in histogram.occupied() {
            bins.push(figure * BINS as i64 + i64::from(bin));
            counts.push(count as i64);
        }
    }
    Ok((matrix(py, rows, columns)?, vector(py, bins), vector(py, counts)))
}

/// A quantile of the errors of each figure, from occupied bins in order and their counts.
#[pyfunction]
pub fn quantiles<'py>(
    py: Python<'py>,
    bins: PyReadonlyArray1<'py, i64>,
    counts: PyReadonlyArray1<'py, i64>,
    truth: PyReadonlyArray1<'py, f64>,
    share: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let flat = |_| refused("bins and counts must be contiguous");
    let (bins, counts) = (bins.as_slice().map_err(flat)?, counts.as_slice().map_err(flat)?);
    if bins.len() != counts.len() {
        return Err(refused(&format!("{} bins but {} counts", bins.len(), counts.len())));
    }
    let size = BINS as i64;
    let mut at = 0;
    let mut out = Vec::with_capacity(truth.len());
    for (figure, truth) in slice(&truth, "truth")?.iter().enumerate() {
        let end = at + bins[at..].partition_point(|bin| *bin < (figure as i64 + 1) * size);
        let own: Vec<Occupied> = bins[at..end]
            .iter()
            .zip(&counts[at..end])
            .map(|(bin, count)| ((bin % size) as u16, *count as u64))
            .collect();
        out.push(quantile(&own, *truth, share));
        at = end;
    }
    Ok(vector(py, out))
}
