//! Addressed normal streams for Python.

use modfun::Error;
use modfun::rng::{self, Address, Purpose};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::arrays::vector;
use crate::enter::enter;
use crate::errors::to_python;

/// The purpose of this name.
pub fn purpose(name: &str) -> Result<Purpose, Error> {
    Purpose::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| {
        let names = Purpose::ALL.map(Purpose::name).join(", ");
        Error::Spec(format!("random stream: purpose {name:?} is unknown; the purposes are {names}"))
    })
}

/// The first `count` standard normals at an address: the noise a study draws there.
#[pyfunction]
pub fn normals<'py>(
    py: Python<'py>,
    seed: u64,
    purpose: &str,
    channel: u32,
    replicate: u64,
    group: u32,
    count: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let purpose = self::purpose(purpose).map_err(to_python)?;
    if channel >= 1 << 27 {
        let text =
            format!("random stream: channel {channel} is too large; it must be below {}", 1 << 27);
        return Err(to_python(Error::Spec(text)));
    }
    let values = enter(py, None, |_| {
        let mut values = vec![0.0; count];
        rng::normals(Address { seed, purpose, channel, replicate, group }, &mut values);
        Ok(values)
    })?;
    Ok(vector(py, values))
}
