//! Modulated equations of any terms: Σ_j g_j(θ) s^k V_j(m) on the lines, with their dense covariance.
//!
//! Signals are formulas of noisy channels, coefficients formulas of parameters; several equations may share
//! both. Noise enters through the sensitivities of the signals, so that the lines of an equation, and of
//! different equations, are correlated (docs/architecture.md, "Terms").

mod batch;
mod complex;
mod equations;
mod fitter;
mod instruments;
mod iterate;
mod lines;
mod plan;
mod rows;
mod starts;
mod uncertainty;

pub use batch::TermsBatch;
pub use equations::{Equations, Lag, Signal, Term};
pub use fitter::TermsFit;
pub use plan::{TermsFitter, TermsOptions, TermsRecord};
