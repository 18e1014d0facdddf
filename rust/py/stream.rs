//! `Stream`: samples go in as they come, estimates from the last window come out.

use modfun::Error;
use modfun::estimate::joint::JointFitter;
use modfun::estimate::{Fitter, Many, Stream as Core, Wanted};
use modfun::simd::Isa;
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::{Given, asked};
use crate::joint::GivenJoint;

/// One output, or all that takes a joint fit.
enum Kind {
    Plain(Core<Fitter>),
    Joint(Core<JointFitter>, usize),
}

/// Estimates from the last samples of a stream; see the core's `Stream`.
#[pyclass(module = "modfun._core")]
pub struct Stream {
    kind: Kind,
    channels: usize,
}

/// Estimates of many moments, one after the other.
fn track(py: Python<'_>, (counts, many): (Vec<u64>, Many)) -> PyResult<Bound<'_, PyDict>> {
    let rows = counts.len();
    let out = PyDict::new(py);
    out.set_item("count", vector(py, counts.iter().map(|c| *c as i64).collect()))?;
    out.set_item("theta", matrix(py, many.theta, rows)?)?;
    out.set_item("bse_nonrobust", matrix(py, many.bse_nonrobust, rows)?)?;
    out.set_item("bse_hc3", matrix(py, many.bse_hc3, rows)?)?;
    out.set_item("status", vector(py, many.status.iter().map(|s| *s as u8).collect()))?;
    out.set_item("nit", vector(py, many.nit.iter().map(|n| i64::from(*n)).collect()))?;
    Ok(out)
}

#[pymethods]
impl Stream {
    /// Windows of so many samples and step; `weights` of the last window, the one before, ….
    #[new]
    #[pyo3(signature = (samples, dt, weights, **options))]
    fn new(
        samples: usize,
        dt: f64,
        weights: Vec<f64>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Stream> {
        let asked = asked(options)?;
        let isa = Isa::detect().map_err(to_python)?;
        if asked.contains("orders")? {
            let given: GivenJoint = asked.extract()?;
            let o = given.options(Wanted::Covariance).map_err(to_python)?;
            let outputs = o.structure.orders.len();
            let channels = outputs + o.intersample.len();
            let core = Core::new(o, samples, dt, &weights, isa).map_err(to_python)?;
            return Ok(Stream { kind: Kind::Joint(core, outputs), channels });
        }
        let given: Given = asked.extract()?;
        let o = given.options(Wanted::Covariance).map_err(to_python)?;
        let channels = 1 + o.intersample.len();
        let core = Core::new(o, samples, dt, &weights, isa).map_err(to_python)?;
        Ok(Stream { kind: Kind::Plain(core), channels })
    }

    /// Takes samples (channel, time), outputs first.
    fn push(&mut self, samples: PyReadonlyArray2<'_, f64>) -> PyResult<()> {
        for sample in self.transposed(&samples)? {
            match &mut self.kind {
                Kind::Plain(core) => core.push(&sample),
                Kind::Joint(core, _) => core.push(&sample),
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
        let samples = self.transposed(&samples)?;
        let kind = &mut self.kind;
        let found = enter(py, None, |_| match kind {
            Kind::Plain(core) => core.follow(&samples, every),
            Kind::Joint(core, _) => core.follow(&samples, every),
        })?;
        track(py, found)
    }

    /// What `follow` notes, of this moment.
    fn now<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let kind = &mut self.kind;
        let found = enter(py, None, |_| match kind {
            Kind::Plain(core) => Ok((vec![core.count()], core.now()?)),
            Kind::Joint(core, _) => Ok((vec![core.count()], core.now()?)),
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
        }
    }

    /// Forgets all samples.
    fn clear(&mut self) {
        match &mut self.kind {
            Kind::Plain(core) => core.clear(),
            Kind::Joint(core, _) => core.clear(),
        }
    }
}

impl Stream {
    /// Samples (channel, time) one after the other.
    fn transposed(&self, samples: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Vec<f64>>> {
        if samples.shape()[0] != self.channels {
            return Err(to_python(Error::Data(format!(
                "streaming: {} channels came where {} were announced",
                samples.shape()[0],
                self.channels
            ))));
        }
        let (all, times) = (slice(samples, "samples")?, samples.shape()[1]);
        let sample = |k: usize| (0..self.channels).map(|c| all[c * times + k]).collect();
        Ok((0..times).map(sample).collect())
    }
}
