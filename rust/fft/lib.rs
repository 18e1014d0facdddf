//! Real Fourier transforms of any length: a crate of its own, so that a change of a kernel does not compile them again.
#![forbid(unsafe_code)]

use std::sync::Arc;

pub use realfft::RealToComplex;
pub use realfft::num_complex::Complex;

/// The transform of `length` real numbers, X(m) = Σ_k x(k) e^{−2πimk/length}, m = 0…length/2.
#[must_use]
pub fn forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    realfft::RealFftPlanner::new().plan_fft_forward(length)
}
