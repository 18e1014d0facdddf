//! Identification of continuous-time systems by Fourier modulating functions.

#![warn(missing_docs)]

mod error;
pub mod math;
pub mod quadrature;
pub mod rng;
pub mod simd;
pub mod spectrum;
pub mod threads;

pub use error::{Error, Status};
