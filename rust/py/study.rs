//! `monte_carlo`: a study laid out by Python, run by the core.

use modfun::estimate::{FitOptions, Wanted};
use modfun::monte_carlo::{Cell, Draw, Group, Intervals, Plan, Run};
use modfun::simd::Isa;
use modfun::{Error, Status};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::Given;

/// What all cells with the same noise-free record share, as Python gives it.
#[derive(FromPyObject)]
struct GivenGroup<'py> {
    #[pyo3(item)]
    group: u32,
    #[pyo3(item)]
    dt: f64,
    #[pyo3(item)]
    y: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    u: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    free: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    sigma: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    truth: Vec<PyReadonlyArray1<'py, f64>>,
}

impl GivenGroup<'_> {
    fn group(&self, estimators: &[Given]) -> PyResult<Group> {
        let samples = self.y.as_array().len();
        let rows = |array: &PyReadonlyArray2<'_, f64>, name: &str| -> PyResult<Vec<Vec<f64>>> {
            let values = slice(array, name)?;
            if !values.is_empty() && array.as_array().ncols() != samples {
                return Err(to_python(Error::Data(format!(
                    "planning a study: {name} has {} samples but y has {samples}",
                    array.as_array().ncols()
                ))));
            }
            Ok(values.chunks_exact(samples.max(1)).map(<[f64]>::to_vec).collect())
        };
        if self.truth.len() != estimators.len() {
            return Err(to_python(Error::Spec(format!(
                "planning a study: {} sets of true values for {} estimators",
                self.truth.len(),
                estimators.len()
            ))));
        }
        let estimators: Vec<(FitOptions, Vec<f64>)> = estimators
            .iter()
            .zip(&self.truth)
            .map(|(e, truth)| {
                Ok((e.options(Wanted::Theta).map_err(to_python)?, slice(truth, "truth")?.to_vec()))
            })
            .collect::<PyResult<_>>()?;
        Ok(Group {
            group: self.group,
            dt: self.dt,
            y: slice(&self.y, "y")?.to_vec(),
            u: rows(&self.u, "u")?,
            free: rows(&self.free, "free")?,
            sigma: slice(&self.sigma, "sigma")?.to_vec(),
            estimators,
        })
    }
}

/// Runs a study; results by group, level and estimator.
#[pyfunction]
#[pyo3(signature = (groups, estimators, *, seed, first, replicates, draw, cov_type, level, samples,
                    threads, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn monte_carlo<'py>(
    py: Python<'py>,
    groups: Vec<Bound<'py, PyAny>>,
    estimators: Vec<Vec<Given>>,
    seed: u64,
    first: u64,
    replicates: usize,
    draw: &str,
    cov_type: Option<&str>,
    level: f64,
    samples: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let refused = |text: String| to_python(Error::Spec(format!("running a study: {text}")));
    let draw = match draw {
        "samples" => Draw::Samples,
        "coefficients" => Draw::Coefficients,
        other => {
            return Err(refused(format!(
                "draw=\"{other}\" is not \"samples\" or \"coefficients\""
            )));
        }
    };
    let intervals = match cov_type {
        None => Intervals::None,
        Some("HC3") => Intervals::Hc3,
        Some("nonrobust") => Intervals::Nonrobust,
        Some(other) => {
            return Err(refused(format!("cov_type=\"{other}\" is not \"HC3\" or \"nonrobust\"")));
        }
    };
    if groups.len() != estimators.len() {
        return Err(refused(format!(
            "{} groups but {} estimator lists",
            groups.len(),
            estimators.len()
        )));
    }
    let covariance = intervals != Intervals::None;
    let laid_out: Vec<Group> = groups
        .iter()
        .zip(&estimators)
        .map(|(g, e)| g.extract::<GivenGroup<'_>>()?.group(e))
        .collect::<PyResult<_>>()?;
    let thread_count = modfun::threads::count(threads).map_err(to_python)?;
    let plan = Plan::new(&laid_out, draw, Isa::detect()).map_err(to_python)?;
    let quantiles = half_widths(py, &plan, level, covariance)?;
    let run = Run { seed, first, replicates, intervals, samples };
    let results = enter(py, progress, |report| plan.run(&run, &quantiles, thread_count, report))?;
    let out = PyList::empty(py);
    for ((cells, designs), group) in results.into_iter().zip(plan.designs()).zip(&laid_out) {
        let levels = PyList::empty(py);
        let mut cells = cells.into_iter();
        for _ in &group.sigma {
            let row = PyList::empty(py);
            for ((cell, d), (_, truth)) in
                cells.by_ref().zip(&designs).take(designs.len()).zip(&group.estimators)
            {
                let lines = d.lines().first().map(|l| (l.first, l.last));
                let one = dictionary(py, cell, truth)?;
                one.set_item("lines", lines)?;
                one.set_item("df_resid", d.degrees_of_freedom())?;
                row.append(one)?;
            }
            levels.append(row)?;
        }
        out.append(levels)?;
    }
    Ok(out)
}

/// Student's t quantiles at each design's degrees of freedom, from SciPy.
fn half_widths(py: Python<'_>, plan: &Plan, level: f64, wanted: bool) -> PyResult<Vec<Vec<f64>>> {
    if !wanted {
        return Ok(plan.designs().iter().map(|g| vec![0.0; g.len()]).collect());
    }
    let quantile = py.import("scipy.special")?.getattr("stdtrit")?;
    let of = |df: usize| quantile.call1((df as f64, 0.5 + level / 2.0))?.extract::<f64>();
    plan.designs().iter().map(|g| g.iter().map(|d| of(d.degrees_of_freedom())).collect()).collect()
}

fn dictionary<'py>(py: Python<'py>, cell: Cell, truth: &[f64]) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let all = || cell.parameters.iter();
    let shifted =
        |errors: Vec<f64>| vector(py, errors.iter().zip(truth).map(|(e, t)| e + t).collect());
    out.set_item("count", cell.parameters.first().map_or(0, |p| p.moments.count))?;
    let outcomes = Status::ALL.iter().map(|s| cell.outcomes.count(*s) as i64).collect();
    out.set_item("status", vector(py, outcomes))?;
    out.set_item("bias", vector(py, all().map(|p| p.moments.bias()).collect()))?;
    out.set_item("bias_mcse", vector(py, all().map(|p| p.moments.bias_se()).collect()))?;
    out.set_item("mean", shifted(all().map(|p| p.moments.bias()).collect()))?;
    out.set_item("sd", vector(py, all().map(|p| p.moments.sd()).collect()))?;
    out.set_item("sd_mcse", vector(py, all().map(|p| p.moments.sd_se()).collect()))?;
    out.set_item("rmse", vector(py, all().map(|p| p.moments.rmse()).collect()))?;
    out.set_item("rmse_mcse", vector(py, all().map(|p| p.moments.rmse_se()).collect()))?;
    let coverage = || all().map(|p| if p.hc3.count > 0 { p.hc3 } else { p.nonrobust });
    out.set_item("covered", vector(py, coverage().map(|c| c.share()).collect()))?;
    out.set_item("covered_mcse", vector(py, coverage().map(|c| c.share_se()).collect()))?;
    out.set_item("median", shifted(cell.median))?;
    out.set_item("nit", cell.iterations as f64 / cell.outcomes.total().max(1) as f64)?;
    let rows = cell.samples.status.len();
    if rows > 0 {
        out.set_item("theta", matrix(py, cell.samples.theta, rows)?)?;
        out.set_item("bse", matrix(py, cell.samples.bse, rows)?)?;
        let each = cell.samples.status.iter().map(|s| *s as u8).collect();
        out.set_item("status_each", vector(py, each))?;
    }
    Ok(out)
}
