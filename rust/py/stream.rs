//! `Stream`: samples go in as they come, estimates from the last window come out.

use modfun::Error;
use modfun::estimate::joint::JointFitter;
use modfun::estimate::{Fitter, Many, Stream as Core, Wanted};
use modfun::simd::Isa;
use numpy::{PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::Given;
use crate::joint::GivenJoint;

/// One output, all that takes a joint fit, or samples alone.
enum Kind {
    Plain(Core<Fitter>),
    Joint(Core<JointFitter>, usize),
    Samples,
}

/// The last samples of a stream, and estimates from them; see the core's `Stream`.
#[pyclass(module = "modfun._core")]
pub struct Stream {
    kind: Kind,
    channels: usize,
    /// The last samples of all channels, sample after sample; the latest of `count` at (count − 1) mod their number.
    past: Vec<f64>,
    count: usize,
}

/// Estimates of many moments, one after the other.
fn track(py: Python<'_>, (counts, many): (Vec<u64>, Many)) -> PyResult<Bound<'_, PyDict>> {
    let rows = counts.len();
    let out = PyDict::new(py);
    out.set_item("count", vector(py, counts.iter().map(|c| *c as i64).collect()))?;
    out.set_item("theta", matrix(py, many.theta, rows)?)?;
    out.set_item("bse_nonrobust", matrix(py, many.bse_nonrobust, rows)?)?;
    out.set_item("bse_hc3", matrix(py, many.bse_hc3, rows)?)?;
    out.set_item("bse_spectral", matrix(py, many.bse_spectral, rows)?)?;
    out.set_item("df_spectral", matrix(py, many.degrees, rows)?)?;
    out.set_item("status", vector(py, many.status.iter().map(|s| *s as u8).collect()))?;
    out.set_item("nit", vector(py, many.nit.iter().map(|n| i64::from(*n)).collect()))?;
    Ok(out)
}

#[pymethods]
impl Stream {
    /// Keeps the `remembered` last samples of so many channels. With options it estimates, from windows of so
    /// many samples and step; `weights` are those of the last window, the one before, ….
    #[new]
    #[pyo3(signature = (channels, remembered, samples, dt, weights, **options))]
    fn new(
        channels: usize,
        remembered: usize,
        samples: usize,
        dt: f64,
        weights: Vec<f64>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Stream> {
        let isa = Isa::detect().map_err(to_python)?;
        let kind = match options {
            None => Kind::Samples,
            Some(options) if options.contains("orders")? => {
                let given: GivenJoint = options.extract()?;
                let o = given.options(Wanted::Covariance).map_err(to_python)?;
                let outputs = o.structure.orders.len();
                let core = Core::new(o, samples, dt, &weights, isa).map_err(to_python)?;
                Kind::Joint(core, outputs)
            }
            Some(options) => {
                let given: Given = options.extract()?;
                let o = given.options(Wanted::Covariance).map_err(to_python)?;
                Kind::Plain(Core::new(o, samples, dt, &weights, isa).map_err(to_python)?)
            }
        };
        Ok(Stream { kind, channels, past: vec![0.0; channels * remembered], count: 0 })
    }

    /// Takes samples (channel, time), outputs first.
    fn push(&mut self, samples: PyReadonlyArray2<'_, f64>) -> PyResult<()> {
        for sample in self.kept(&samples)? {
            match &mut self.kind {
                Kind::Plain(core) => core.push(&sample),
                Kind::Joint(core, _) => core.push(&sample),
                Kind::Samples => {}
            }
        }
        Ok(())
    }

    /// The same, with an estimate after every `every`-th sample of the stream.
    fn follow<'py>(
        &mut self,
        py: Python<'py>,
        samples: PyReadonlyArray2<'py, f64>,
        every: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let samples = self.kept(&samples)?;
        let kind = &mut self.kind;
        let found = enter(py, None, |_| match kind {
            Kind::Plain(core) => core.follow(&samples, every),
            Kind::Joint(core, _) => core.follow(&samples, every),
            Kind::Samples => Err(no_estimator()),
        })?;
        track(py, found)
    }

    /// Samples taken.
    #[getter]
    fn count(&self) -> usize {
        self.count
    }

    /// The last samples, (channel, time).
    fn past<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let size = self.past.len() / self.channels.max(1);
        let have = self.count.min(size);
        let at =
            |c: usize, k: usize| self.past[((self.count - have + k) % size) * self.channels + c];
        let all = (0..self.channels).flat_map(|c| (0..have).map(move |k| at(c, k))).collect();
        matrix(py, all, self.channels)
    }

    /// What `follow` notes, of this moment.
    fn now<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let kind = &mut self.kind;
        let found = enter(py, None, |_| match kind {
            Kind::Plain(core) => Ok((vec![core.count()], core.now()?)),
            Kind::Joint(core, _) => Ok((vec![core.count()], core.now()?)),
            Kind::Samples => Err(no_estimator()),
        })?;
        track(py, found)
    }

    /// The estimate of this moment; as `Fitter.fit` or `JointFitter.fit`.
    fn fit<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match &mut self.kind {
            Kind::Plain(core) => crate::fit::dictionary(py, enter(py, None, |_| core.fit())?),
            Kind::Joint(core, outputs) => {
                crate::joint::dictionary(py, enter(py, None, |_| core.fit())?, *outputs)
            }
            Kind::Samples => Err(to_python(no_estimator())),
        }
    }

    /// Forgets all samples.
    fn clear(&mut self) {
        self.count = 0;
        match &mut self.kind {
            Kind::Plain(core) => core.clear(),
            Kind::Joint(core, _) => core.clear(),
            Kind::Samples => {}
        }
    }
}

fn no_estimator() -> Error {
    Error::Internal("streaming: samples alone are kept here".into())
}

impl Stream {
    /// Keeps samples (channel, time), and gives them one after the other.
    fn kept(&mut self, samples: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vec<f64>>> {
        if samples.shape()[0] != self.channels {
            return Err(to_python(Error::Data(format!(
                "streaming: {} channels came where {} were announced",
                samples.shape()[0],
                self.channels
            ))));
        }
        let (all, times) = (slice(samples, "samples")?, samples.shape()[1]);
        let sample = |k: usize| (0..self.channels).map(|c| all[c * times + k]).collect();
        let found: Vec<Vec<f64>> = (0..times).map(sample).collect();
        let size = self.past.len() / self.channels.max(1);
        for sample in &found {
            let at = (self.count % size.max(1)) * self.channels;
            self.past[at..at + self.channels].copy_from_slice(sample);
            self.count += 1;
        }
        Ok(found)
    }
}
