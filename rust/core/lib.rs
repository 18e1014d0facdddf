//! Identification of continuous-time systems by Fourier modulating functions.

#![warn(missing_docs)]

mod error;
pub mod math;
pub mod rng;
pub mod simd;

pub use error::{Error, Status};
