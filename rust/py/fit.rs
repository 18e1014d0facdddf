//! `fit` and `fit_many`: arrays and words in, a dictionary of arrays out.

use modfun::Error;
use modfun::estimate::{
    Band, Batch, Fit, FitOptions, Options, RecordView, Time, Wanted, fit as core_fit,
    fit_many as core_fit_many,
};
use modfun::quadrature::Hold;
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Noise, Structure, Trend};
use numpy::{Complex64, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;

/// One of a closed list of words.
fn word<T: Copy>(what: &str, given: &str, all: &[(&str, T)]) -> Result<T, Error> {
    all.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<String> = all.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        Error::Spec(format!("fitting: {what} \"{given}\" is not one of {}", names.join(", ")))
    })
}

/// Options as Python gives them.
#[derive(FromPyObject)]
pub struct Given {
    #[pyo3(item)]
    order: usize,
    #[pyo3(item)]
    numerators: Vec<Option<usize>>,
    #[pyo3(item)]
    delays: Vec<f64>,
    #[pyo3(item)]
    intersample: Vec<String>,
    #[pyo3(item)]
    method: String,
    #[pyo3(item)]
    noise: String,
    #[pyo3(item)]
    trend: Option<String>,
    #[pyo3(item)]
    rule: String,
    #[pyo3(item)]
    extended: bool,
    #[pyo3(item)]
    band: Option<(f64, f64)>,
    #[pyo3(item)]
    harmonics: Option<usize>,
    #[pyo3(item)]
    tol: f64,
    #[pyo3(item)]
    maxiter: usize,
}

impl Given {
    /// In the core's words.
    pub fn options(&self, wanted: Wanted) -> Result<FitOptions, Error> {
        let hold = |name: &String| -> Result<Option<Hold>, Error> {
            match (name.as_str(), Kind::from_name(name)) {
                ("smooth", _) => Ok(None),
                (_, Ok(Kind::Hold(hold))) => Ok(Some(hold)),
                _ => Err(Error::Spec(format!(
                    "fitting: intersample \"{name}\" is not one of \"smooth\", \"zoh\", \"foh\""
                ))),
            }
        };
        let Kind::Rule(rule) = Kind::from_name(&self.rule)? else {
            return Err(Error::Spec(format!(
                "fitting: \"{}\" describes inputs; give it as intersample and leave rule to the output",
                self.rule
            )));
        };
        let methods =
            [("ls", Method::Ls), ("wls", Method::Wls), ("awls", Method::Awls), ("ml", Method::Ml)];
        let band = match (self.band, self.harmonics) {
            (None, None) => Band::Default,
            (Some((low, high)), None) => Band::Edges(low, high),
            (None, Some(m)) => Band::Harmonics(m),
            (Some(_), Some(_)) => {
                return Err(Error::Spec("fitting: give band or harmonics, not both".into()));
            }
        };
        Ok(FitOptions {
            structure: Structure::new(self.order, self.numerators.clone())?,
            delays: self.delays.clone(),
            intersample: self.intersample.iter().map(hold).collect::<Result<_, _>>()?,
            rule,
            method: word("method", &self.method, &methods)?,
            noise: word(
                "noise",
                &self.noise,
                &[("output", Noise::Output), ("equation", Noise::Equation)],
            )?,
            trend: match &self.trend {
                None => Trend::None,
                Some(name) => word(
                    "trend",
                    name,
                    &[("constant", Trend::Constant), ("linear", Trend::Linear)],
                )?,
            },
            extended: self.extended,
            band,
            options: Options { tol: self.tol, maxiter: self.maxiter, wanted },
        })
    }
}

/// Sampling instants as Python gives them: a step or an array.
#[derive(FromPyObject)]
enum When<'py> {
    Step(f64),
    Instants(PyReadonlyArray1<'py, f64>),
}

/// Fits one structure to one or several records.
#[pyfunction]
#[pyo3(signature = (y, u, time, **options))]
pub fn fit<'py>(
    py: Python<'py>,
    y: Vec<PyReadonlyArray2<'py, f64>>,
    u: Vec<PyReadonlyArray2<'py, f64>>,
    time: Vec<Bound<'py, PyAny>>,
    options: Option<Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let given: Given = options.unwrap_or_else(|| PyDict::new(py)).extract()?;
    let o = given.options(Wanted::Covariance).map_err(to_python)?;
    if y.len() != u.len() || y.len() != time.len() {
        return Err(to_python(Error::Data(format!(
            "fitting: {} outputs, {} inputs and {} time axes; one of each a record",
            y.len(),
            u.len(),
            time.len()
        ))));
    }
    let when: Vec<When<'py>> = time.iter().map(|t| t.extract()).collect::<PyResult<_>>()?;
    let mut records = Vec::with_capacity(y.len());
    for ((y, u), when) in y.iter().zip(&u).zip(&when) {
        let samples = slice(y, "y")?;
        let inputs = slice(u, "u")?;
        let count = y.as_array().ncols();
        if y.as_array().nrows() != 1 {
            return Err(to_python(Error::Data(format!(
                "fitting: {} outputs at once; select one, for example with select(outputs=[...])",
                y.as_array().nrows()
            ))));
        }
        if u.as_array().nrows() > 0 && u.as_array().ncols() != count {
            return Err(to_python(Error::Data(format!(
                "fitting: the output has {count} samples but the inputs have {}",
                u.as_array().ncols()
            ))));
        }
        let time = match when {
            When::Step(dt) => Time::Even(*dt),
            When::Instants(t) => Time::Uneven(t.as_slice()?),
        };
        let u = if inputs.is_empty() { Vec::new() } else { inputs.chunks_exact(count).collect() };
        records.push(RecordView { y: samples, u, time });
    }
    let result = core_fit(&records, &o, Isa::detect()).map_err(to_python)?;
    dictionary(py, &result)
}

fn dictionary<'py>(py: Python<'py>, f: &Fit) -> PyResult<Bound<'py, PyDict>> {
    let p = f.theta.len();
    let out = PyDict::new(py);
    out.set_item("theta", vector(py, f.theta.clone()))?;
    out.set_item("cov_nonrobust", matrix(py, f.cov_nonrobust.clone(), p)?)?;
    out.set_item("cov_hc3", matrix(py, f.cov_hc3.clone(), p)?)?;
    out.set_item("gram", matrix(py, f.gram.clone(), p)?)?;
    out.set_item("cost", f.cost)?;
    out.set_item("df_resid", f.degrees_of_freedom)?;
    out.set_item("sigma", f.sigma)?;
    out.set_item("status", f.status.name())?;
    out.set_item("nit", f.nit)?;
    let lines: Vec<(usize, usize)> = f.lines.iter().map(|l| (l.first, l.last)).collect();
    out.set_item("lines", lines)?;
    out.set_item("omega0", f.lines.iter().map(|l| l.omega0).collect::<Vec<_>>())?;
    let residuals = PyList::empty(py);
    for r in &f.residuals {
        let complex: Vec<Complex64> = r.iter().map(|(re, im)| Complex64::new(*re, *im)).collect();
        residuals.append(vector(py, complex))?;
    }
    out.set_item("residuals", residuals)?;
    match &f.band_rule {
        None => out.set_item("band_rule", py.None())?,
        Some(rule) => {
            let account = PyDict::new(py);
            account.set_item("k_max", rule.wide)?;
            account.set_item("k_0", rule.narrow)?;
            account.set_item("cost_wide", rule.costs[0])?;
            account.set_item("cost_narrow", rule.costs[1])?;
            account.set_item("k", rule.chosen)?;
            out.set_item("band_rule", account)?;
        }
    }
    Ok(out)
}

/// Fits one structure to every record of a batch.
#[pyfunction]
#[pyo3(signature = (y, u, dt, *, uncertainty, threads, progress=None, **options))]
#[allow(clippy::too_many_arguments)]
pub fn fit_many<'py>(
    py: Python<'py>,
    y: PyReadonlyArray3<'py, f64>,
    u: PyReadonlyArray3<'py, f64>,
    dt: f64,
    uncertainty: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
    options: Option<Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let given: Given = options.unwrap_or_else(|| PyDict::new(py)).extract()?;
    let o = given
        .options(if uncertainty { Wanted::Covariance } else { Wanted::Cost })
        .map_err(to_python)?;
    let shape = y.as_array().dim();
    let inputs = u.as_array().dim();
    let wrong = |what: String| Err(to_python(Error::Data(format!("fitting a batch: {what}"))));
    if shape.1 != 1 {
        return wrong(format!("{} outputs at once; select one", shape.1));
    }
    if inputs.1 != o.structure.numerators.len() {
        return wrong(format!(
            "the structure has {} inputs but the batch has {}",
            o.structure.numerators.len(),
            inputs.1
        ));
    }
    if inputs.1 > 0 && inputs.2 != shape.2 {
        return wrong(format!("outputs have {} samples, inputs {}", shape.2, inputs.2));
    }
    if inputs.0 != 1 && inputs.0 != shape.0 {
        return wrong(format!(
            "{} replicates of y but {} of u; give one set for all or as many as y",
            shape.0, inputs.0
        ));
    }
    let (y, u) = (slice(&y, "y")?.to_vec(), slice(&u, "u")?.to_vec());
    let thread_count = modfun::threads::count(threads).map_err(to_python)?;
    let shared = inputs.0 == 1;
    let (many, design) = enter(py, progress, |report| {
        let batch = Batch { y: &y, u: &u, shared, samples: shape.2, dt };
        core_fit_many(&batch, &o, Isa::detect(), thread_count, report)
    })?;
    let rows = many.status.len();
    let out = PyDict::new(py);
    let df_resid = design.degrees_of_freedom();
    out.set_item("theta", matrix(py, many.theta, rows)?)?;
    out.set_item("bse_nonrobust", matrix(py, many.bse_nonrobust, rows)?)?;
    out.set_item("bse_hc3", matrix(py, many.bse_hc3, rows)?)?;
    out.set_item("status", vector(py, many.status.iter().map(|s| *s as u8).collect()))?;
    out.set_item("cost", vector(py, many.cost))?;
    out.set_item("nit", vector(py, many.nit.iter().map(|n| i64::from(*n)).collect()))?;
    out.set_item("df_resid", df_resid)?;
    let lines = design.lines();
    out.set_item("lines", lines.iter().map(|l| (l.first, l.last)).collect::<Vec<_>>())?;
    out.set_item("omega0", lines.iter().map(|l| l.omega0).collect::<Vec<_>>())?;
    Ok(out)
}
