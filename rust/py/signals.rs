//! Signals for Python: coefficients, weights, noise level, and exact responses.

use modfun::Error;
use modfun::model::StateSpace;
use modfun::quadrature::{
    Rule, corners as corners_of, corners_between, gauss_legendre as nodes_and_weights,
};
use modfun::simulate::{Input, NODES};
use modfun::spectrum::{CoefficientPlan, Kind};
use numpy::ndarray::Dimension;
use numpy::{
    Complex64, PyArray1, PyArray2, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::{matrix, slice, vector};
use crate::enter::enter;
use crate::errors::to_python;

type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Adds the functions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(coefficients, module)?)?;
    module.add_function(wrap_pyfunction!(quadrature_weights, module)?)?;
    module.add_function(wrap_pyfunction!(noise_level, module)?)?;
    module.add_function(wrap_pyfunction!(corners, module)?)?;
    module.add_function(wrap_pyfunction!(gauss_legendre, module)?)?;
    module.add_function(wrap_pyfunction!(simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate_uneven, module)?)
}

/// Fourier coefficients (channel, harmonics + 1) of samples (channel, time).
#[pyfunction]
fn coefficients<'py>(
    py: Python<'py>,
    samples: PyReadonlyArray2<'py, f64>,
    harmonics: usize,
    kinds: Vec<String>,
    delays: Vec<f64>,
    lead: usize,
    t: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let (channels, length) = (samples.shape()[0], samples.shape()[1]);
    let values = finite(&samples, "samples", length)?;
    let t = t.as_ref().map(|t| slice(t, "t")).transpose()?;
    if kinds.len() != channels || delays.len() != channels {
        return Err(to_python(Error::Spec(format!(
            "coefficients of {channels} channels: got {} kinds and {} delays; give one of each a channel",
            kinds.len(),
            delays.len()
        ))));
    }
    let work = || -> Result<Vec<Complex64>, Error> {
        let mut out = Vec::new();
        for channel in 0..channels {
            let kind = Kind::from_name(&kinds[channel])?;
            let plan = match t {
                None => CoefficientPlan::new(
                    window(length, lead)?,
                    harmonics,
                    kind,
                    delays[channel],
                    lead,
                )?,
                Some(t) => {
                    uneven_only(delays[channel], lead)?;
                    CoefficientPlan::uneven(t, harmonics, kind)?
                }
            };
            let (mut re, mut im) = (vec![0.0; harmonics + 1], vec![0.0; harmonics + 1]);
            plan.run(&values[channel * length..][..length], &mut re, &mut im)?;
            out.extend(re.iter().zip(&im).map(|(re, im)| Complex64::new(*re, *im)));
        }
        Ok(out)
    };
    let out = py.detach(work).map_err(to_python)?;
    matrix(py, out, channels)
}

/// Weights of a rule: in units of the sampling interval, or in units of `t` for uneven samples.
#[pyfunction]
fn quadrature_weights<'py>(
    py: Python<'py>,
    rule: &str,
    intervals: usize,
    t: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let Kind::Rule(rule) = Kind::from_name(rule).map_err(to_python)? else {
        let names: Vec<_> = Rule::ALL.iter().map(|rule| rule.name()).collect();
        return Err(to_python(Error::Spec(format!(
            "a held signal (\"{rule}\") has no quadrature weights; use one of {}",
            names.join(", ")
        ))));
    };
    if intervals > 1 << 30 {
        let text = format!(
            "the weights of {intervals} intervals were asked for; there are at most 2³⁰, shorten the record"
        );
        return Err(to_python(Error::Spec(text)));
    }
    let weights = match t {
        None => rule.weights(intervals),
        Some(t) => {
            let t = slice(&t, "t")?;
            if t.len() != intervals + 1 {
                let text = format!(
                    "{intervals} intervals have {} times, got {}; give all of t",
                    intervals + 1,
                    t.len()
                );
                return Err(to_python(Error::Data(text)));
            }
            rule.uneven_weights(t)
        }
    };
    Ok(vector(py, weights.map_err(to_python)?))
}

/// Standard deviation of white noise a channel, from the unused high band.
#[pyfunction]
fn noise_level<'py>(
    py: Python<'py>,
    samples: PyReadonlyArray2<'py, f64>,
    order: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let length = samples.shape()[1];
    let values = finite(&samples, "samples", length)?;
    let levels: Result<Vec<f64>, Error> = (0..samples.shape()[0])
        .map(|channel| {
            modfun::noise_level::noise_level(&values[channel * length..][..length], order)
        })
        .collect();
    Ok(vector(py, levels.map_err(to_python)?))
}

/// Samples at which the slope of a smooth signal jumps, and samples after which, before the next, it does.
#[pyfunction]
fn corners(samples: PyReadonlyArray1<'_, f64>) -> PyResult<(Vec<usize>, Vec<usize>)> {
    let samples = slice(&samples, "samples")?;
    Ok((corners_of(samples).into_iter().map(|(at, _)| at).collect(), corners_between(samples)))
}

/// Nodes in (0, 1) and weights (sum 1) of the rule inside each sample of a smooth input.
#[pyfunction]
fn gauss_legendre(py: Python<'_>) -> Pair<'_> {
    let (nodes, weights) = nodes_and_weights::<NODES>();
    (vector(py, nodes.to_vec()), vector(py, weights.to_vec()))
}

/// Outputs (ny, N + 1) of a state-space system.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn simulate<'py>(
    py: Python<'py>,
    a: PyReadonlyArray2<'py, f64>,
    b: PyReadonlyArray2<'py, f64>,
    c: PyReadonlyArray2<'py, f64>,
    d: PyReadonlyArray2<'py, f64>,
    x0: PyReadonlyArray1<'py, f64>,
    u: PyReadonlyArray2<'py, f64>,
    dt: f64,
    kind: &str,
    nodes: Option<PyReadonlyArray3<'py, f64>>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let length = u.shape()[1];
    let (system, x0, u) = given(&a, &b, &c, &d, &x0, &u)?;
    let between =
        nodes.as_ref().map(|nodes| finite(nodes, "nodes", (length - 1) * NODES)).transpose()?;
    let input = match (kind, between) {
        ("zoh", _) => Input::Zoh(u),
        ("foh", _) => Input::Foh(u),
        ("smooth", Some(nodes)) => Input::Smooth(u, nodes),
        ("smooth", None) => {
            let text = "simulating a smooth input needs its values at the nodes of gauss_legendre(); pass nodes";
            return Err(to_python(Error::Spec(text.into())));
        }
        _ => {
            let text = format!(
                "an input is \"zoh\", \"foh\" or \"smooth\" between samples, not \"{kind}\"; use one of these"
            );
            return Err(to_python(Error::Spec(text)));
        }
    };
    let y = py
        .detach(|| modfun::simulate::simulate(&system, x0, input, dt, length - 1))
        .map_err(to_python)?;
    matrix(py, y, system.outputs)
}

/// Outputs (ny, N + 1) of a state-space system at uneven instants, its inputs held or straight between them.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn simulate_uneven<'py>(
    py: Python<'py>,
    a: PyReadonlyArray2<'py, f64>,
    b: PyReadonlyArray2<'py, f64>,
    c: PyReadonlyArray2<'py, f64>,
    d: PyReadonlyArray2<'py, f64>,
    x0: PyReadonlyArray1<'py, f64>,
    u: PyReadonlyArray2<'py, f64>,
    held: Vec<bool>,
    t: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (system, x0, u) = given(&a, &b, &c, &d, &x0, &u)?;
    let t = slice(&t, "t")?;
    let y = enter(py, None, |_| modfun::simulate::simulate_uneven(&system, x0, u, &held, t))?;
    matrix(py, y, system.outputs)
}

/// A system, its initial state and its inputs.
type Given<'a> = (StateSpace<'a>, &'a [f64], &'a [f64]);

/// What simulations are given, refused where it does not fit.
fn given<'a>(
    a: &'a PyReadonlyArray2<'_, f64>,
    b: &'a PyReadonlyArray2<'_, f64>,
    c: &'a PyReadonlyArray2<'_, f64>,
    d: &'a PyReadonlyArray2<'_, f64>,
    x0: &'a PyReadonlyArray1<'_, f64>,
    u: &'a PyReadonlyArray2<'_, f64>,
) -> PyResult<Given<'a>> {
    let shape = |array: &PyReadonlyArray2<'_, f64>| (array.shape()[0], array.shape()[1]);
    let ((states, inputs), (outputs, length)) = (shape(b), (c.shape()[0], u.shape()[1]));
    for (name, got, wanted) in [
        ("A", shape(a), (states, states)),
        ("C", shape(c), (outputs, states)),
        ("D", shape(d), (outputs, inputs)),
    ] {
        if got != wanted {
            return Err(to_python(Error::Spec(format!(
                "simulating: {name} is {} × {}, but B and C make it {} × {}; give matrices that fit each other",
                got.0, got.1, wanted.0, wanted.1
            ))));
        }
    }
    if u.shape()[0] != inputs || length == 0 {
        return Err(to_python(Error::Data(format!(
            "simulating: the model has {inputs} inputs, u is {} × {length}; give u as (input, time)",
            u.shape()[0]
        ))));
    }
    let system = StateSpace {
        a: slice(a, "A")?,
        b: slice(b, "B")?,
        c: slice(c, "C")?,
        d: slice(d, "D")?,
        states,
        inputs,
        outputs,
    };
    let x0 = slice(x0, "x0")?;
    if let Some(k) = x0.iter().position(|x| !x.is_finite()) {
        return Err(to_python(Error::Data(format!(
            "simulating: x0[{k}] is {}; give finite states",
            x0[k]
        ))));
    }
    Ok((system, x0, finite(u, "u", length)?))
}

/// The elements, refused where one is not finite; `length` of them make a channel.
fn finite<'a, D: Dimension>(
    array: &'a PyReadonlyArray<'_, f64, D>,
    name: &str,
    length: usize,
) -> PyResult<&'a [f64]> {
    let values = slice(array, name)?;
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(values),
        Some(k) => Err(to_python(Error::Data(format!(
            "{name}: channel {} is {} at index {}; remove or interpolate samples that are not finite",
            k / length,
            values[k],
            k % length
        )))),
    }
}

/// Intervals of the window that starts `lead` samples late.
fn window(length: usize, lead: usize) -> Result<usize, Error> {
    match length.checked_sub(lead.saturating_add(1)) {
        Some(intervals) if intervals > 0 => Ok(intervals),
        _ => Err(Error::Data(format!(
            "a window that starts {lead} samples late needs at least {} samples, the record has {length}; take a longer record or a shorter delay",
            lead.saturating_add(2)
        ))),
    }
}

fn uneven_only(delay: f64, lead: usize) -> Result<(), Error> {
    if delay == 0.0 && lead == 0 {
        return Ok(());
    }
    Err(Error::Spec(format!(
        "uneven samples go without delays: got a delay of {delay} and a lead of {lead} samples; resample the record evenly"
    )))
}
