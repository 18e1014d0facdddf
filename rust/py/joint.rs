//! `JointFitter`: fits of several outputs, coloured or input noise, held parameters and unknown delays.

use modfun::Error;
use modfun::estimate::Wanted;
use modfun::estimate::joint::{
    Colour, Delay, JointBatch, JointFit, JointFitter as Core, JointOptions, JointRecord,
    JointStructure, NoiseModel, Path,
};
use modfun::simd::Isa;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{complex, listed, matrix, vector};
use crate::enter::enter;
use crate::errors::to_python;
use crate::fit::{
    GivenPrior, Records, When, Words, answered, asked, many_dictionary, priors, sampling,
    set_levels,
};

/// Input, delay or its start, and the bounds of a delay that is estimated.
type GivenPath = (usize, f64, Option<(f64, f64)>);

/// Options as Python gives them.
pub struct GivenJoint {
    structure: JointStructure,
    noise: NoiseModel,
    own_levels: bool,
    driven: bool,
    priors: Vec<GivenPrior>,
    words: Words,
}

impl<'py> FromPyObject<'_, 'py> for GivenJoint {
    type Error = PyErr;
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<GivenJoint> {
        let paths: Vec<GivenPath> = given.get_item("paths")?.extract()?;
        let path = |(input, delay, bounds): GivenPath| {
            let delay = match bounds {
                None => Delay::Known(delay),
                Some((min, max)) => Delay::Free { start: delay, min, max },
            };
            Path { input, delay }
        };
        let coloured: bool = given.get_item("coloured")?.extract()?;
        Ok(GivenJoint {
            structure: JointStructure {
                orders: given.get_item("orders")?.extract()?,
                common: given.get_item("common")?.extract()?,
                numerators: given.get_item("numerators")?.extract()?,
                paths: paths.into_iter().map(path).collect(),
                fixed: given.get_item("fixed")?.extract()?,
                bounds: given.get_item("bounds")?.extract()?,
            },
            noise: NoiseModel {
                equation: given.get_item("equation")?.extract()?,
                outputs: given.get_item("sigma_y")?.extract()?,
                inputs: given.get_item("sigma_u")?.extract()?,
                colour: if coloured { Colour::Fitted } else { Colour::Given },
                spectra: given.get_item("spectra")?.extract()?,
            },
            own_levels: given.get_item("own_levels")?.extract()?,
            driven: given.get_item("driven")?.extract()?,
            priors: given.get_item("priors")?.extract()?,
            words: given.extract()?,
        })
    }
}

impl GivenJoint {
    /// In the core's words.
    pub fn options(self, wanted: Wanted) -> Result<JointOptions, Error> {
        Ok(JointOptions {
            structure: self.structure.checked()?,
            intersample: self.words.intersample()?,
            rule: self.words.rule()?,
            method: self.words.method()?,
            noise: self.noise,
            driven: self.driven,
            trend: self.words.trend()?,
            extended: self.words.extended,
            band: self.words.band()?,
            own_levels: self.own_levels,
            priors: priors(self.priors),
            options: self.words.iteration(wanted),
        })
    }
}

/// Everything about joint fits of one kind that their samples do not change; see the core's `JointFitter`.
#[pyclass(frozen, module = "modfun._core")]
pub struct JointFitter {
    core: Core,
    outputs: usize,
    inputs: usize,
}

#[pymethods]
impl JointFitter {
    /// Makes ready for records of these numbers of samples, steps or instants, and variances of the samples
    /// (outputs, time) where they are uneven.
    #[new]
    #[pyo3(signature = (samples, time, variances, **options))]
    fn new(
        samples: Vec<usize>,
        time: Vec<When<'_>>,
        variances: Vec<Option<PyReadonlyArray2<'_, f64>>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<JointFitter> {
        let given: GivenJoint = asked(options)?.extract()?;
        let o = given.options(Wanted::Covariance).map_err(to_python)?;
        let sampling = sampling(&samples, &time)?;
        let uneven = listed(&variances, "variances")?;
        let (outputs, inputs) = (o.structure.orders.len(), o.inputs());
        let isa = Isa::detect().map_err(to_python)?;
        let core = Core::new(o, &sampling, &uneven, isa).map_err(to_python)?;
        Ok(JointFitter { core, outputs, inputs })
    }

    /// Fits one structure to one record, or to several as one problem: lists of (channel, time). `near`: parameters
    /// that lead to the estimate, on a band that is given.
    #[pyo3(signature = (y, u, *, near=None))]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        y: Vec<PyReadonlyArray2<'py, f64>>,
        u: Vec<PyReadonlyArray2<'py, f64>>,
        near: Option<Vec<f64>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        if y.len() != u.len() {
            return Err(to_python(Error::Data(format!(
                "fitting: {} outputs and {} inputs; one of each a record",
                y.len(),
                u.len()
            ))));
        }
        let count = y.len();
        let (y, u) = (Records::Listed(y), Records::Listed(u));
        let (y, u) = (y.rows("y", self.outputs)?, u.rows("u", self.inputs)?);
        let records: Vec<JointRecord<'_>> = (0..count)
            .map(|k| JointRecord {
                y: y[k * self.outputs..(k + 1) * self.outputs].to_vec(),
                u: u[k * self.inputs..(k + 1) * self.inputs].to_vec(),
            })
            .collect();
        let found = enter(py, None, |_| match &near {
            None => self.core.fit(&records),
            Some(theta) => self.core.fit_near(&records, theta),
        })?;
        dictionary(py, found, self.outputs)
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
        let y = y.rows("y", self.outputs)?;
        let records = y.len() / self.outputs.max(1);
        let batch = JointBatch { y, u: u.rows("u", self.inputs)?, records };
        let threads = modfun::threads::count(threads).map_err(to_python)?;
        let (many, design) =
            enter(py, progress, |report| self.core.fit_many(&batch, threads, report))?;
        many_dictionary(py, many, design.degrees_of_freedom(), design.lines())
    }
}

/// What a joint fit answers.
pub fn dictionary(py: Python<'_>, f: JointFit, outputs: usize) -> PyResult<Bound<'_, PyDict>> {
    let out = answered(py, f.answer)?;
    out.set_item("scale", f.scale)?;
    out.set_item("noise", matrix(py, f.noise, outputs)?)?;
    out.set_item("at_bound", f.at_bound)?;
    out.set_item("record_levels", vector(py, f.record_levels))?;
    set_levels(&out, f.levels)?;
    let residuals = PyList::empty(py);
    for record in &f.residuals {
        let own = PyList::empty(py);
        for output in record {
            own.append(vector(py, complex(output)))?;
        }
        residuals.append(own)?;
    }
    out.set_item("residuals", residuals)?;
    Ok(out)
}
