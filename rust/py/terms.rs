//! `TermsFitter`: fits of equations whose terms are formulas.

use modfun::Error;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsBatch, TermsFit, TermsFitter as Core, TermsOptions,
    TermsRecord,
};
use modfun::estimate::{EachRecord, Wanted};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::tape::{Tape, Written};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{channels, complex, listed, matrix, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::{
    GivenPrior, When, Words, answered, asked, many_dictionary, noise, priors, sampling, set_levels,
};

/// Operations and positions of results.
type GivenTape = (Vec<Written>, Vec<usize>);
/// Kinds in all records or in each, delay, and the parameter that the delay is.
type GivenSignal = (Vec<String>, f64, Option<usize>);

/// Options as Python gives them.
#[derive(FromPyObject)]
struct GivenTerms {
    #[pyo3(item)]
    orders: Vec<usize>,
    #[pyo3(item)]
    signals: Vec<GivenSignal>,
    #[pyo3(item)]
    terms: Vec<(usize, usize, usize)>,
    #[pyo3(item)]
    coefficients: GivenTape,
    #[pyo3(item)]
    slopes: Vec<(usize, usize)>,
    #[pyo3(item)]
    formulas: GivenTape,
    #[pyo3(item)]
    sensitivities: Vec<(usize, usize)>,
    #[pyo3(item)]
    signal_slopes: Vec<(usize, usize, usize)>,
    #[pyo3(item)]
    channels: usize,
    #[pyo3(item)]
    noisy: Vec<usize>,
    #[pyo3(item)]
    starts: Vec<Option<f64>>,
    #[pyo3(item)]
    near: bool,
    #[pyo3(item)]
    bounds: Vec<(f64, f64)>,
    #[pyo3(item)]
    linear: bool,
    #[pyo3(item)]
    noise: String,
    #[pyo3(item)]
    shapes: Vec<(Vec<f64>, Vec<f64>)>,
    #[pyo3(item)]
    levels: Option<Vec<f64>>,
    #[pyo3(item)]
    levels_matter: bool,
    #[pyo3(item)]
    learn: bool,
    #[pyo3(item)]
    coloured: bool,
    #[pyo3(item)]
    priors: Vec<GivenPrior>,
}

impl GivenTerms {
    fn options(self, words: &Words) -> Result<TermsOptions, Error> {
        let parameters = self.starts.len();
        let signal = |(kinds, delay, parameter): GivenSignal| -> Result<Signal, Error> {
            let lag = parameter.map_or(Lag::Known(delay), Lag::Parameter);
            let each = kinds.iter().map(|kind| Kind::from_name(kind));
            let each = each.collect::<Result<_, Error>>()?;
            Ok(Signal { kind: EachRecord::new("kind of a signal", each)?, lag })
        };
        let term = |(equation, signal, order)| Term { equation, signal, order };
        let noisy = self.noisy.len();
        let inputs = self.channels + noisy * (noisy + 1) / 2 + parameters;
        Ok(TermsOptions {
            equations: Equations {
                orders: self.orders,
                signals: self.signals.into_iter().map(signal).collect::<Result<_, Error>>()?,
                terms: self.terms.into_iter().map(term).collect(),
                coefficients: Tape::new(&self.coefficients.0, parameters, self.coefficients.1)?,
                slopes: self.slopes,
                samples: Tape::new(&self.formulas.0, inputs, self.formulas.1)?,
                sensitivities: self.sensitivities,
                signal_slopes: self.signal_slopes,
                channels: self.channels,
                noisy: self.noisy,
                parameters,
                starts: self.starts,
                near: self.near,
                bounds: self.bounds,
                linear: self.linear,
            },
            rule: words.rule()?,
            method: words.method()?,
            noise: noise(&self.noise)?,
            shapes: self.shapes,
            trend: words.trend()?,
            band: words.band()?,
            levels: self.levels,
            levels_matter: self.levels_matter,
            learn: self.learn,
            coloured: self.coloured,
            priors: priors(self.priors),
            options: words.iteration(Wanted::Covariance),
        })
    }
}

/// Everything about fits of equations that their samples do not change; see the core's `TermsFitter`.
#[pyclass(frozen, module = "modfun._core")]
pub struct TermsFitter {
    core: Core,
}

#[pymethods]
impl TermsFitter {
    /// Makes ready for records of these numbers of samples and steps, or instants; `uneven` holds the
    /// variance of each sample (noisy channel, time) of each record over the channel's, where they differ.
    #[new]
    #[pyo3(signature = (samples, time, uneven, **options))]
    fn new(
        samples: Vec<usize>,
        time: Vec<When<'_>>,
        uneven: Vec<Option<PyReadonlyArray2<'_, f64>>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<TermsFitter> {
        let options = asked(options)?;
        let (given, words): (GivenTerms, Words) = (options.extract()?, options.extract()?);
        let o = given.options(&words).map_err(to_python)?;
        let sampling = sampling(&samples, &time)?;
        let rows = listed(&uneven, "variances")?;
        let isa = Isa::detect().map_err(to_python)?;
        Ok(TermsFitter { core: Core::new(o, &sampling, &rows, isa).map_err(to_python)? })
    }

    /// Fits one set of parameters to the channels of one record, or of several: lists of (channel, time).
    fn fit<'py>(
        &self,
        py: Python<'py>,
        records: Vec<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut own = Vec::with_capacity(records.len());
        for record in &records {
            own.push(TermsRecord { channels: channels(record, "channels")? });
        }
        let found = enter(py, None, |_| self.core.fit(&own))?;
        dictionary(py, found)
    }

    /// Fits every record by itself: a list of (channel, time); `shared` channels follow those of each.
    #[pyo3(signature = (records, shared, *, threads, progress=None))]
    fn fit_many<'py>(
        &self,
        py: Python<'py>,
        records: Vec<PyReadonlyArray2<'py, f64>>,
        shared: PyReadonlyArray2<'py, f64>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let all = channels(&shared, "channels")?;
        let mut own = Vec::with_capacity(records.len());
        for record in &records {
            let mut channels = channels(record, "channels")?;
            channels.extend(&all);
            own.push(TermsRecord { channels });
        }
        let threads = modfun::threads::count(threads).map_err(to_python)?;
        let batch = TermsBatch { records: own };
        let (many, degrees, lines) =
            enter(py, progress, |report| self.core.fit_many(&batch, threads, report))?;
        many_dictionary(py, many, degrees, lines)
    }
}

fn dictionary(py: Python<'_>, f: TermsFit) -> PyResult<Bound<'_, PyDict>> {
    let out = answered(py, f.answer)?;
    out.set_item("scale", f.scale)?;
    out.set_item("levels", rows(py, f.levels)?)?;
    out.set_item("seen", rows(py, f.seen)?)?;
    out.set_item("correlation", rows(py, f.correlation)?)?;
    out.set_item("df_hc3", vector(py, f.hc3_degrees))?;
    out.set_item("at_bound", f.at_bound)?;
    out.set_item("bend", f.bend)?;
    let residuals = PyList::empty(py);
    for record in &f.residuals {
        residuals.append(matrix(py, complex(record.iter().flatten()), record.len())?)?;
    }
    out.set_item("residuals", residuals)?;
    set_levels(&out, f.driven)?;
    Ok(out)
}

/// One row a record.
fn rows(py: Python<'_>, values: Vec<Vec<f64>>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = values.len();
    matrix(py, values.concat(), count)
}
