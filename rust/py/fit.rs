//! `Fitter`: words and lengths make it, arrays go in, a dictionary of arrays comes out.

use modfun::Error;
use modfun::estimate::{
    Answer, Band, BandRule, Batch, EachRecord, Fit, FitOptions, Fitter as Core, Initial, Levels,
    Many, NoiseSpectrum, Options, Prior, RecordView, Time, Wanted,
};
use modfun::modulation::Lines;
use modfun::quadrature::{Hold, Rule};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Noise, Structure, Trend};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{complex, matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;

/// One of a closed list of words.
pub fn word<T: Copy>(what: &str, given: &str, all: &[(&str, T)]) -> Result<T, Error> {
    all.iter().find(|(name, _)| *name == given).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<String> = all.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        Error::Spec(format!("fitting: {what} \"{given}\" is not one of {}", names.join(", ")))
    })
}

/// Words that every kind of fit understands.
#[derive(FromPyObject)]
pub struct Words {
    #[pyo3(item)]
    intersample: Vec<Vec<String>>,
    #[pyo3(item)]
    method: String,
    #[pyo3(item)]
    trend: Option<String>,
    #[pyo3(item)]
    rule: String,
    #[pyo3(item)]
    pub extended: bool,
    #[pyo3(item)]
    band: Option<(f64, f64)>,
    #[pyo3(item)]
    harmonics: Option<usize>,
    #[pyo3(item)]
    tol: f64,
    #[pyo3(item)]
    maxiter: usize,
}

impl Words {
    /// How each input behaves between samples: in all records, or in each.
    pub fn intersample(&self) -> Result<EachRecord<Vec<Option<Hold>>>, Error> {
        let hold = |name: &String| match (name.as_str(), Kind::from_name(name)) {
            ("smooth", _) => Ok(None),
            (_, Ok(Kind::Hold(hold))) => Ok(Some(hold)),
            _ => Err(Error::Spec(format!(
                "fitting: intersample \"{name}\" is not one of \"smooth\", \"zoh\", \"foh\""
            ))),
        };
        let record = |names: &Vec<String>| names.iter().map(hold).collect();
        let each = self.intersample.iter().map(record).collect::<Result<_, Error>>()?;
        EachRecord::new("intersample", each)
    }

    /// Quadrature of smooth signals.
    pub fn rule(&self) -> Result<Rule, Error> {
        match Kind::from_name(&self.rule)? {
            Kind::Rule(rule) => Ok(rule),
            Kind::Hold(_) => Err(Error::Spec(format!(
                "fitting: \"{}\" describes inputs; give it as intersample and leave rule to the output",
                self.rule
            ))),
        }
    }

    /// Estimator.
    pub fn method(&self) -> Result<Method, Error> {
        let methods =
            [("ls", Method::Ls), ("wls", Method::Wls), ("awls", Method::Awls), ("ml", Method::Ml)];
        word("method", &self.method, &methods)
    }

    /// Offset and drift.
    pub fn trend(&self) -> Result<Trend, Error> {
        match &self.trend {
            None => Ok(Trend::None),
            Some(name) => {
                word("trend", name, &[("constant", Trend::Constant), ("linear", Trend::Linear)])
            }
        }
    }

    /// Lines.
    pub fn band(&self) -> Result<Band, Error> {
        match (self.band, self.harmonics) {
            (None, None) => Ok(Band::Default),
            (Some((low, high)), None) => Ok(Band::Edges(low, high)),
            (None, Some(m)) => Ok(Band::Harmonics(m)),
            (Some(_), Some(_)) => {
                Err(Error::Spec("fitting: give band or harmonics, not both".into()))
            }
        }
    }

    /// Iteration.
    pub fn iteration(&self, wanted: Wanted) -> Options {
        Options { tol: self.tol, maxiter: self.maxiter, wanted }
    }
}

/// Options of a fit of one output as Python gives them.
pub struct Given {
    order: usize,
    numerators: Vec<Option<usize>>,
    delays: Vec<f64>,
    noise: String,
    initial_state: String,
    states: Vec<Vec<f64>>,
    /// Transient coefficients, where they are more than the poles.
    transient: Option<usize>,
    words: Words,
}

impl<'py> FromPyObject<'_, 'py> for Given {
    type Error = PyErr;
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Given> {
        Ok(Given {
            order: given.get_item("order")?.extract()?,
            numerators: given.get_item("numerators")?.extract()?,
            delays: given.get_item("delays")?.extract()?,
            noise: given.get_item("noise")?.extract()?,
            initial_state: given.get_item("initial_state")?.extract()?,
            states: given.get_item("states")?.extract()?,
            transient: match given.get_item("transient") {
                Ok(transient) => transient.extract()?,
                Err(_) => None,
            },
            words: given.extract()?,
        })
    }
}

impl Given {
    /// In the core's words.
    pub fn options(&self, wanted: Wanted) -> Result<FitOptions, Error> {
        let words = [
            ("unknown", Initial::Unknown),
            ("zero", Initial::Zero),
            ("rest", Initial::Rest),
            ("periodic", Initial::Periodic),
        ];
        Ok(FitOptions {
            structure: {
                let structure = Structure::new(self.order, self.numerators.clone())?;
                let transient = self.transient.unwrap_or(structure.transient);
                structure.with_transient(transient)?
            },
            delays: self.delays.clone(),
            intersample: self.words.intersample()?,
            rule: self.words.rule()?,
            method: self.words.method()?,
            noise: noise(&self.noise)?,
            trend: self.words.trend()?,
            extended: self.words.extended,
            band: self.words.band()?,
            own_levels: true,
            initial: word("initial_state", &self.initial_state, &words)?,
            states: self.states.clone(),
            options: self.words.iteration(wanted),
        })
    }
}

/// Sampling instants as Python gives them: a step or an array.
#[derive(FromPyObject)]
pub enum When<'py> {
    Step(f64),
    Instants(PyReadonlyArray1<'py, f64>),
}

/// Length and instants of each record.
pub fn sampling<'a>(samples: &[usize], time: &'a [When<'_>]) -> PyResult<Vec<(usize, Time<'a>)>> {
    if samples.len() != time.len() {
        return Err(to_python(Error::Data(format!(
            "fitting: {} lengths and {} time axes; one of each a record",
            samples.len(),
            time.len()
        ))));
    }
    let one = |(samples, when): (&usize, &'a When<'_>)| -> PyResult<(usize, Time<'a>)> {
        let time = match when {
            When::Step(dt) => Time::Even(*dt),
            When::Instants(t) => Time::Uneven(slice(t, "t")?),
        };
        Ok((*samples, time))
    };
    samples.iter().zip(time).map(one).collect()
}

/// Channels of many records as Python gives them: (replicate, channel, time), or a list of (channel, time).
#[derive(FromPyObject)]
pub enum Records<'py> {
    Together(PyReadonlyArray3<'py, f64>),
    Listed(Vec<PyReadonlyArray2<'py, f64>>),
}

impl Records<'_> {
    /// One slice a channel, record after record; all records have `channels`.
    pub fn rows(&self, name: &str, channels: usize) -> PyResult<Vec<&[f64]>> {
        let counted = |have: usize| match have == channels {
            true => Ok(()),
            false => Err(to_python(Error::Data(format!(
                "fitting: {name} has {have} channels where {channels} are needed; choose them with \
                 select(outputs=[...], inputs=[...])"
            )))),
        };
        match self {
            Records::Together(array) => {
                counted(array.shape()[1])?;
                Ok(slice(array, name)?.chunks_exact(array.shape()[2].max(1)).collect())
            }
            Records::Listed(arrays) => {
                let mut rows = Vec::with_capacity(arrays.len() * channels);
                for array in arrays {
                    counted(array.shape()[0])?;
                    rows.extend(slice(array, name)?.chunks_exact(array.shape()[1].max(1)));
                }
                Ok(rows)
            }
        }
    }
}

/// Everything about fits of one kind that their samples do not change; see the core's `Fitter`.
#[pyclass(frozen, module = "modfun._core")]
pub struct Fitter {
    core: Core,
    inputs: usize,
}

#[pymethods]
impl Fitter {
    /// Makes ready for records of these numbers of samples and steps, or instants, with what another that was
    /// made for the same records knows of them.
    #[new]
    #[pyo3(signature = (samples, time, *, beside=None, **options))]
    fn new(
        samples: Vec<usize>,
        time: Vec<When<'_>>,
        beside: Option<&Bound<'_, Fitter>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Fitter> {
        let given: Given = asked(options)?.extract()?;
        let o = given.options(Wanted::Covariance).map_err(to_python)?;
        let sampling = sampling(&samples, &time)?;
        let inputs = o.structure.numerators.len();
        let isa = Isa::detect().map_err(to_python)?;
        let beside = beside.map(|other| &other.get().core);
        Ok(Fitter { core: Core::beside(beside, o, &sampling, isa).map_err(to_python)?, inputs })
    }

    /// Fits one structure to one record, or to several as one problem: lists of (channel, time). Of the fits
    /// from `wls` and from each start the best.
    #[pyo3(signature = (y, u, *, starts=None))]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        y: Vec<PyReadonlyArray2<'py, f64>>,
        u: Vec<PyReadonlyArray2<'py, f64>>,
        starts: Option<Vec<Vec<f64>>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        if y.len() != u.len() {
            return Err(to_python(Error::Data(format!(
                "fitting: {} outputs and {} inputs; one of each a record",
                y.len(),
                u.len()
            ))));
        }
        let (y, u) = (Records::Listed(y), Records::Listed(u));
        let mut inputs = u.rows("u", self.inputs)?.into_iter();
        let records: Vec<RecordView<'_>> = y
            .rows("y", 1)?
            .into_iter()
            .map(|y| RecordView { y, u: inputs.by_ref().take(self.inputs).collect() })
            .collect();
        let found = enter(py, None, |_| {
            self.core.fit_best(&records, starts.as_deref().unwrap_or_default())
        })?;
        dictionary(py, found)
    }

    /// Fits every record by itself; the inputs may be one set for all.
    #[pyo3(signature = (y, u, *, threads, progress=None))]
    fn fit_many<'py>(
        &self,
        py: Python<'py>,
        y: Records<'py>,
        u: Records<'py>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let batch = Batch { y: y.rows("y", 1)?, u: u.rows("u", self.inputs)? };
        let threads = modfun::threads::count(threads).map_err(to_python)?;
        let (many, design) =
            enter(py, progress, |report| self.core.fit_many(&batch, threads, report))?;
        many_dictionary(py, many, design.degrees_of_freedom(), design.lines())
    }
}

/// The options of a fitter, of which there must be some.
pub fn asked<'a, 'py>(options: Option<&'a Bound<'py, PyDict>>) -> PyResult<&'a Bound<'py, PyDict>> {
    options.ok_or_else(|| to_python(Error::Spec("fitting: no option was given".into())))
}

/// A dictionary of what all kinds of fits answer.
pub fn answered(py: Python<'_>, a: Answer) -> PyResult<Bound<'_, PyDict>> {
    let p = a.theta.len();
    let out = PyDict::new(py);
    out.set_item("condition_bound", a.condition_bound())?;
    out.set_item("theta", vector(py, a.theta))?;
    out.set_item("cov_nonrobust", matrix(py, a.cov_nonrobust, p)?)?;
    out.set_item("cov_hc3", matrix(py, a.cov_hc3, p)?)?;
    out.set_item("cov_spectral", matrix(py, a.cov_spectral, p)?)?;
    out.set_item("df_spectral", vector(py, a.degrees))?;
    let NoiseSpectrum { omega, power, log_error } = a.noise_spectrum;
    let channels = power.len();
    let both = (matrix(py, power.concat(), channels)?, matrix(py, log_error.concat(), channels)?);
    out.set_item("noise_spectrum", (vector(py, omega), both.0, both.1))?;
    out.set_item("gram", matrix(py, a.gram, p)?)?;
    out.set_item("cost", a.cost)?;
    out.set_item("df_resid", a.degrees_of_freedom)?;
    out.set_item("status", a.status.name())?;
    out.set_item("nit", a.nit)?;
    set_lines(&out, &a.lines)?;
    out.set_item("band_rule", account(py, a.band_rule)?)?;
    Ok(out)
}

/// The lines of each record, and how far they are apart.
fn set_lines(out: &Bound<'_, PyDict>, lines: &[Lines]) -> PyResult<()> {
    out.set_item("lines", lines.iter().map(|l| (l.first, l.last)).collect::<Vec<_>>())?;
    out.set_item("omega0", lines.iter().map(|l| l.omega0).collect::<Vec<_>>())
}

/// Where noise comes from, by its word.
pub fn noise(given: &str) -> Result<Noise, Error> {
    let noises =
        [("output", Noise::Output), ("equation", Noise::Equation), ("process", Noise::Process)];
    word("noise", given, &noises)
}

/// An estimated parameter, its mean and its standard deviation beforehand.
pub type GivenPrior = (usize, f64, f64);

/// The same in the core's words.
pub fn priors(given: Vec<GivenPrior>) -> Vec<Prior> {
    given.into_iter().map(|(parameter, mean, sd)| Prior { parameter, mean, sd }).collect()
}

/// Levels of noise that drives the system and of the samples, where they were estimated.
pub fn set_levels(out: &Bound<'_, PyDict>, levels: Option<Levels>) -> PyResult<()> {
    let Some(Levels { values, cov, shares }) = levels else { return Ok(()) };
    let py = out.py();
    let size = cov.len().isqrt();
    let count = shares.len();
    out.set_item("process_levels", vector(py, values))?;
    out.set_item("cov_process_levels", matrix(py, cov, size)?)?;
    let both = shares.into_iter().flat_map(|(share, error)| [share, error]).collect();
    out.set_item("process_shares", matrix(py, both, count)?)
}

/// The same for many fits: values, their standard errors and shares with errors, one row a fit.
fn set_levels_of_many(out: &Bound<'_, PyDict>, many: &[Levels], parameters: usize) -> PyResult<()> {
    let count = many.iter().map(|own| own.values.len()).max().unwrap_or(0);
    let shares = many.iter().map(|own| own.shares.len()).max().unwrap_or(0);
    let size = parameters + count;
    let (mut values, mut errors, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for own in many {
        let whole = own.values.len() == count && own.cov.len() == size * size;
        for k in 0..count {
            values.push(if whole { own.values[k] } else { f64::NAN });
            let at = (parameters + k) * (size + 1);
            errors.push(if whole { own.cov[at].sqrt() } else { f64::NAN });
        }
        for k in 0..shares {
            let (share, error) = own.shares.get(k).copied().unwrap_or((f64::NAN, f64::NAN));
            parts.extend([share, error]);
        }
    }
    let (py, rows) = (out.py(), many.len());
    out.set_item("process_levels", matrix(py, values, rows)?)?;
    out.set_item("bse_process_levels", matrix(py, errors, rows)?)?;
    out.set_item("process_shares", matrix(py, parts, rows)?)
}

/// What a fit of one output answers.
pub fn dictionary(py: Python<'_>, f: Fit) -> PyResult<Bound<'_, PyDict>> {
    let out = answered(py, f.answer)?;
    out.set_item("sigma", f.sigma)?;
    out.set_item("free_cost", f.free_cost)?;
    set_levels(&out, f.levels)?;
    out.set_item("record_levels", vector(py, f.record_levels))?;
    let residuals = PyList::empty(py);
    for record in &f.residuals {
        residuals.append(vector(py, complex(record)))?;
    }
    out.set_item("residuals", residuals)?;
    Ok(out)
}

/// The default band rule's account.
fn account(py: Python<'_>, rule: Option<BandRule>) -> PyResult<Option<Bound<'_, PyDict>>> {
    let Some(rule) = rule else { return Ok(None) };
    let account = PyDict::new(py);
    account.set_item("k_max", rule.wide as f64)?;
    account.set_item("k_0", rule.narrow as f64)?;
    account.set_item("cost_wide", rule.costs[0])?;
    account.set_item("cost_narrow", rule.costs[1])?;
    account.set_item("k", rule.chosen as f64)?;
    account.set_item("meets_end", f64::from(rule.meets_end()))?;
    Ok(Some(account))
}

/// What `fit_many` answers: estimates, errors and outcomes of all records, and the lines they share.
pub fn many_dictionary(
    py: Python<'_>,
    many: Many,
    df_resid: usize,
    lines: Vec<Lines>,
) -> PyResult<Bound<'_, PyDict>> {
    let rows = many.status.len();
    let out = PyDict::new(py);
    if !many.levels.is_empty() {
        set_levels_of_many(&out, &many.levels, many.theta.len() / rows)?;
    }
    out.set_item("theta", matrix(py, many.theta, rows)?)?;
    out.set_item("bse_nonrobust", matrix(py, many.bse_nonrobust, rows)?)?;
    out.set_item("bse_hc3", matrix(py, many.bse_hc3, rows)?)?;
    out.set_item("bse_spectral", matrix(py, many.bse_spectral, rows)?)?;
    out.set_item("df_spectral", matrix(py, many.degrees, rows)?)?;
    out.set_item("status", vector(py, many.status.iter().map(|s| *s as u8).collect()))?;
    out.set_item("cost", vector(py, many.cost))?;
    out.set_item("nit", vector(py, many.nit.iter().map(|n| i64::from(*n)).collect()))?;
    out.set_item("df_resid", df_resid)?;
    if !many.hc3_degrees.is_empty() {
        out.set_item("df_hc3", matrix(py, many.hc3_degrees, rows)?)?;
    }
    set_lines(&out, &lines)?;
    Ok(out)
}
