//! Addressed normal streams for Python.

use modfun::Error;
use modfun::rng::{self, Address, Purpose};
use modfun::simd::Isa;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays::{matrix, vector};
use crate::enter::enter;
use crate::errors::to_python;

/// The purpose of this name.
pub fn purpose(name: &str) -> Result<Purpose, Error> {
    Purpose::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| {
        let names = Purpose::ALL.map(Purpose::name).join(", ");
        Error::Spec(format!("random stream: purpose {name:?} is unknown; the purposes are {names}"))
    })
}

fn address(
    seed: u64,
    purpose: &str,
    channel: u32,
    replicate: u64,
    group: u32,
) -> PyResult<Address> {
    let purpose = self::purpose(purpose).map_err(to_python)?;
    if channel >= 1 << 27 {
        let text =
            format!("random stream: channel {channel} is too large; it must be below {}", 1 << 27);
        return Err(to_python(Error::Spec(text)));
    }
    Ok(Address { seed, purpose, channel, replicate, group })
}

/// Standard normals of the replicates `first ..`, (replicate, length): each row is [`normals`] of its own.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // an address, and how much from there on
pub fn normal_rows<'py>(
    py: Python<'py>,
    seed: u64,
    purpose: &str,
    channel: u32,
    first: u64,
    group: u32,
    replicates: usize,
    length: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let address = address(seed, purpose, channel, first, group)?;
    let values = enter(py, None, |_| {
        let mut values = vec![0.0; replicates * length];
        rng::rows(Isa::detect()?, address, length, &mut values);
        Ok(values)
    })?;
    matrix(py, values, replicates)
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
    let address = address(seed, purpose, channel, replicate, group)?;
    let values = enter(py, None, |_| {
        let mut values = vec![0.0; count];
        rng::normals(address, &mut values);
        Ok(values)
    })?;
    Ok(vector(py, values))
}
