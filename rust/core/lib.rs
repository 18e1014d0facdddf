//! Identification of continuous-time systems by Fourier modulating functions.

#![warn(missing_docs)]

mod covariance;
mod error;
pub mod estimate;
pub mod linalg;
pub mod math;
pub mod model;
pub mod modulation;
pub mod monte_carlo;
pub mod noise_level;
pub mod quadrature;
pub mod rng;
pub mod simd;
pub mod simulate;
pub mod spectrum;
pub mod structure;
pub mod threads;

pub use error::{Error, Status};
