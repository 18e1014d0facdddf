//! Identification of continuous-time systems from short, noisy, transient records by Fourier
//! modulating functions (A. E. Pearson, NASA NAG-1-1065, 1993, "the report"): the numerical core.
//!
//! # The method on one page
//!
//! A record on \[0, T\] obeys A(p)y = B(p)u, p = d/dt, from an unknown state. Multiplied by
//! φ_m(t) = (1/T)e^{−imω₀t}(e^{−iω₀t} − 1)ⁿ, which vanishes with its first n − 1 derivatives at both
//! ends, and integrated, the equation loses its derivatives and its initial state (report, eqs. 7–12):
//! Δⁿ{A(imω₀)Y(m)} = Δⁿ{B(imω₀)U(m)} + ε(m), with Fourier coefficients Y, U and differences in m.
//!
//! Least squares on these rows with the covariance of ε is least squares on the *lines* themselves,
//! Q(m) = A(s)Y(m) − B(s)U(m), s = imω₀, with a polynomial T(s) of n real coefficients as further
//! unknown: what the end conditions add and Δⁿ annihilates. There the covariance is diagonal,
//! σ²|A(s)|²/N for white noise on the sampled output, and everything is a weighted sum over lines:
//!
//! min over θ, T of Σ_m |Q(m; θ) − T(s_m)|² / (h_m |A(s_m)|²),   h₀ = 1, h_m = ½.
//!
//! `ls` solves the differenced rows without weights; `wls` the lines with |A| = 1; `awls` with |A| of
//! the last estimate; `ml` also follows the gradient through |A|, by columns of the denoised output.
//!
//! # The path of a fit
//!
//! [`quadrature`] weights and [`spectrum`] sums turn samples into coefficients; [`modulation`] says
//! which columns the lines have; `covariance` weighs them; [`estimate`] solves; [`simulate`] and
//! [`model`] predict, [`integrate`] what is not linear. [`monte_carlo`] does the same for many replicates with noise from [`rng`]. Eight
//! replicates travel together in the registers of [`simd`]; a single fit is one live lane of the same
//! kernels and gives the same bits.

#![warn(missing_docs)]

mod covariance;
mod error;
pub mod estimate;
pub mod integrate;
pub mod linalg;
pub mod line_tests;
pub mod math;
pub mod model;
pub mod modulation;
pub mod monte_carlo;
pub mod noise_level;
pub mod quadrature;
pub mod response;
pub mod rng;
pub mod simd;
pub mod simulate;
pub mod spectrum;
pub mod structure;
pub mod tape;
pub mod threads;
pub mod tones;

pub use error::{Error, Status};
