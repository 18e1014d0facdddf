//! `Study`: a Monte Carlo study laid out once, run by the core for any range of replicates.

use modfun::estimate::Wanted;
use modfun::monte_carlo::histogram::BINS;
use modfun::monte_carlo::{Cell, Contender, Draw, Group, Plan, Run, Told};
use modfun::simd::Isa;
use modfun::structure::CovType;
use modfun::{Error, Status};
use numpy::{
    PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::Given;
use crate::joint::GivenJoint;
use crate::tally::numbers;

/// What all cells with the same noise-free record share, as Python gives it.
#[derive(FromPyObject)]
struct GivenGroup<'py> {
    #[pyo3(item)]
    group: u32,
    #[pyo3(item)]
    dt: f64,
    #[pyo3(item)]
    y: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    u: PyReadonlyArray2<'py, f64>,
    /// (state, output, time).
    #[pyo3(item)]
    free: PyReadonlyArray3<'py, f64>,
    #[pyo3(item)]
    scale: Vec<f64>,
    #[pyo3(item)]
    sigma: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    estimators: Vec<GivenContender<'py>>,
}

/// An estimator and where its numbers go.
#[derive(FromPyObject)]
struct GivenContender<'py> {
    #[pyo3(item)]
    options: Bound<'py, PyDict>,
    #[pyo3(item)]
    truth: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    cov_type: Option<String>,
    /// Position among all estimators of the study.
    #[pyo3(item)]
    position: usize,
    /// Position of each parameter among all parameters of the study.
    #[pyo3(item)]
    columns: Vec<usize>,
}

impl GivenContender<'_> {
    fn contender(&self) -> PyResult<Contender> {
        let intervals = match self.cov_type.as_deref() {
            None => None,
            Some("spectral") => Some(CovType::Spectral),
            Some("HC3") => Some(CovType::Hc3),
            Some("nonrobust") => Some(CovType::Nonrobust),
            Some(other) => {
                let text =
                    format!("cov_type=\"{other}\" is not \"spectral\", \"HC3\" or \"nonrobust\"");
                return Err(refused(&text));
            }
        };
        let truth = slice(&self.truth, "truth")?.to_vec();
        if self.columns.len() != truth.len() {
            let (columns, values) = (self.columns.len(), truth.len());
            return Err(refused(&format!("{columns} columns for {values} true values")));
        }
        let options = match self.options.contains("orders")? {
            true => {
                let given: GivenJoint = self.options.extract()?;
                Told::Joint(Box::new(given.options(Wanted::Theta).map_err(to_python)?))
            }
            false => {
                let given: Given = self.options.extract()?;
                Told::Plain(given.options(Wanted::Theta).map_err(to_python)?)
            }
        };
        Ok(Contender { options, truth, intervals })
    }
}

impl GivenGroup<'_> {
    fn group(&self) -> PyResult<Group> {
        let (outputs, samples) = (self.y.shape()[0], self.y.shape()[1]);
        let rows = |values: &[f64], length: usize, name: &str| -> PyResult<Vec<Vec<f64>>> {
            if !values.is_empty() && length != samples {
                return Err(to_python(Error::Data(format!(
                    "planning a study: {name} has {length} samples but y has {samples}"
                ))));
            }
            Ok(values.chunks_exact(samples.max(1)).map(<[f64]>::to_vec).collect())
        };
        let free = rows(slice(&self.free, "free")?, self.free.shape()[2], "free")?;
        Ok(Group {
            group: self.group,
            dt: self.dt,
            y: rows(slice(&self.y, "y")?, samples, "y")?,
            u: rows(slice(&self.u, "u")?, self.u.shape()[1], "u")?,
            free: free.chunks(outputs.max(1)).map(<[Vec<f64>]>::to_vec).collect(),
            sigma: slice(&self.sigma, "sigma")?.to_vec(),
            scale: self.scale.clone(),
            estimators: self
                .estimators
                .iter()
                .map(GivenContender::contender)
                .collect::<PyResult<_>>()?,
        })
    }
}

fn refused(text: &str) -> PyErr {
    to_python(Error::Spec(format!("planning a study: {text}")))
}

/// Places of one group's numbers in arrays (group, level, estimator, parameter).
struct Places {
    levels: usize,
    /// Position and columns of each of the group's estimators.
    estimators: Vec<(usize, Vec<usize>)>,
}

/// A study laid out: what no replicate changes is evaluated, the rest is drawn and fitted by `part`.
#[pyclass(frozen, module = "modfun._core")]
pub struct Study {
    plan: Plan,
    quantiles: Vec<Vec<f64>>,
    places: Vec<Places>,
    estimators: usize,
    parameters: usize,
}

#[pymethods]
impl Study {
    /// Arrays have `shape` = (estimators, parameters) beyond group and level.
    #[new]
    #[pyo3(signature = (groups, shape, *, draw, level))]
    fn new(
        py: Python<'_>,
        groups: Vec<Bound<'_, PyAny>>,
        shape: (usize, usize),
        draw: &str,
        level: f64,
    ) -> PyResult<Study> {
        let draw = match draw {
            "samples" => Draw::Samples,
            "coefficients" => Draw::Coefficients,
            other => {
                let text = format!("draw=\"{other}\" is not \"samples\" or \"coefficients\"");
                return Err(refused(&text));
            }
        };
        let given: Vec<GivenGroup<'_>> =
            groups.iter().map(|g| g.extract()).collect::<PyResult<_>>()?;
        let laid_out: Vec<Group> = given.iter().map(GivenGroup::group).collect::<PyResult<_>>()?;
        let places: Vec<Places> = given
            .iter()
            .zip(&laid_out)
            .map(|(given, group)| Places {
                levels: group.sigma.len(),
                estimators: given
                    .estimators
                    .iter()
                    .map(|e| (e.position, e.columns.clone()))
                    .collect(),
            })
            .collect();
        let (estimators, parameters) = shape;
        let inside = |p: &Places| {
            let levels = places.first().map_or(0, |first| first.levels);
            p.levels == levels
                && p.estimators
                    .iter()
                    .all(|(e, columns)| *e < estimators && columns.iter().all(|c| *c < parameters))
        };
        if !places.iter().all(inside) {
            let text = format!("numbers of a group lie outside of the shape {shape:?}");
            return Err(refused(&text));
        }
        let plan = enter(py, None, |_| Plan::new(&laid_out, draw, Isa::detect()?))?;
        let quantiles = half_widths(py, &plan, &laid_out, level)?;
        Ok(Study { plan, quantiles, places, estimators, parameters })
    }

    /// Whether drawing coefficients is less work than drawing samples and leaves records that have them.
    #[getter]
    fn coefficients_pay(&self) -> bool {
        self.plan.coefficients_pay()
    }

    /// Unit noise of a replicate in the group at this position, (output, time).
    fn noise<'py>(
        &self,
        py: Python<'py>,
        group: usize,
        seed: u64,
        replicate: u64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if group >= self.places.len() {
            let text = format!("there is no group {group} among {}", self.places.len());
            return Err(refused(&text));
        }
        let rows = enter(py, None, |_| self.plan.noise(group, seed, replicate))?;
        matrix(py, rows.concat(), rows.len())
    }

    /// Sums over replicates `first..first + replicates`, each a flat array in the order group, level,
    /// estimator, parameter; with `samples` the estimates, the replicate before all of these.
    #[pyo3(signature = (*, seed, first, replicates, samples, threads, progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn part<'py>(
        &self,
        py: Python<'py>,
        seed: u64,
        first: u64,
        replicates: usize,
        samples: bool,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let run = Run { seed, first, replicates, samples };
        let sums = enter(py, progress, |report| {
            let results = self.plan.run(&run, &self.quantiles, threads, report)?;
            Ok(self.sums(&run, &results))
        })?;
        let out = PyDict::new(py);
        out.set_item("moments", vector(py, sums.moments))?;
        out.set_item("covered", vector(py, sums.covered))?;
        out.set_item("status", vector(py, sums.status))?;
        out.set_item("iterations", vector(py, sums.iterations))?;
        out.set_item("bins", vector(py, sums.bins))?;
        out.set_item("counts", vector(py, sums.counts))?;
        out.set_item("samples", samples.then(|| vector(py, sums.samples)))?;
        Ok(out)
    }
}

/// Flat arrays of a part.
struct Sums {
    moments: Vec<f64>,
    covered: Vec<i64>,
    status: Vec<i64>,
    iterations: Vec<i64>,
    bins: Vec<i64>,
    counts: Vec<i64>,
    samples: Vec<f64>,
}

impl Study {
    fn sums(&self, run: &Run, results: &[Vec<Cell>]) -> Sums {
        let rows: usize = self.places.iter().map(|p| p.levels * self.estimators).sum();
        let figures = rows * self.parameters;
        let mut sums = Sums {
            moments: vec![0.0; figures * numbers(&<_>::default()).len()],
            covered: vec![0; figures],
            status: vec![0; rows * Status::ALL.len()],
            iterations: vec![0; rows],
            bins: Vec::new(),
            counts: Vec::new(),
            samples: vec![f64::NAN; if run.samples { figures * run.replicates } else { 0 }],
        };
        let mut first_row = 0;
        for (cells, places) in results.iter().zip(&self.places) {
            let positions = (0..places.levels)
                .flat_map(|level| places.estimators.iter().map(move |place| (level, place)));
            for (cell, (level, (position, columns))) in cells.iter().zip(positions) {
                let row = first_row + level * self.estimators + position;
                sums.add(cell, row, columns, self.parameters, figures);
            }
            first_row += places.levels * self.estimators;
        }
        sums.sort();
        sums
    }
}

impl Sums {
    fn add(
        &mut self,
        cell: &Cell,
        row: usize,
        columns: &[usize],
        parameters: usize,
        figures: usize,
    ) {
        let states = Status::ALL.len();
        for (to, count) in self.status[row * states..].iter_mut().zip(&cell.status) {
            *to = *count as i64;
        }
        self.iterations[row] = cell.iterations as i64;
        for (k, column) in columns.iter().enumerate() {
            let figure = row * parameters + column;
            let five = numbers(&cell.moments[k]);
            self.moments[figure * five.len()..][..five.len()].copy_from_slice(&five);
            self.covered[figure] = cell.covered[k] as i64;
            for (bin, count) in &cell.bins[k] {
                self.bins.push((figure * BINS + usize::from(*bin)) as i64);
                self.counts.push(*count as i64);
            }
            let of_this = cell.samples.iter().skip(k).step_by(columns.len());
            for (to, value) in self.samples.iter_mut().skip(figure).step_by(figures).zip(of_this) {
                *to = *value;
            }
        }
    }

    /// Bins in order, wherever their estimators and parameters stand.
    fn sort(&mut self) {
        let mut pairs: Vec<(i64, i64)> =
            self.bins.iter().copied().zip(self.counts.iter().copied()).collect();
        pairs.sort_unstable();
        (self.bins, self.counts) = pairs.into_iter().unzip();
    }
}

/// Half widths of intervals in standard errors, from SciPy: of Student's t at each design's degrees of freedom, of the
/// normal distribution where each estimate has its own; 0 where nothing is covered.
fn half_widths(
    py: Python<'_>,
    plan: &Plan,
    groups: &[Group],
    level: f64,
) -> PyResult<Vec<Vec<f64>>> {
    let counted = groups.iter().flat_map(|g| &g.estimators).any(|e| e.intervals.is_some());
    if !counted {
        return Ok(groups.iter().map(|g| vec![0.0; g.estimators.len()]).collect());
    }
    let special = py.import("scipy.special")?;
    let (student, normal) = (special.getattr("stdtrit")?, special.getattr("ndtri")?);
    let share = 0.5 + level / 2.0;
    let of = |(df, e): (&usize, &Contender)| match e.intervals {
        Some(CovType::Spectral) => normal.call1((share,))?.extract::<f64>(),
        _ => student.call1((*df as f64, share))?.extract::<f64>(),
    };
    let widths = |(own, g): (&Vec<usize>, &Group)| own.iter().zip(&g.estimators).map(of).collect();
    plan.freedom().iter().zip(groups).map(widths).collect()
}
