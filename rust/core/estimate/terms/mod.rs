//! Modulated equations of any terms, with the dense covariance of their lines (report, section 4.8, eq. 1 with F = 1).
//!
//! ```text
//! Q_e(m; θ) = Σ_j g_j(θ) s^{k_j} V_j(m),   s = imω₀,
//! minimise over θ, T:  rᵀ C(θ)⁻¹ r,        r = Re and Im of all Q_e(m) − T_e(s).
//! ```
//!
//! Signals V are formulas of noisy channels, coefficients g formulas of parameters; several equations may share both.
//! Noise enters through the sensitivities of the signals, so that the lines of an equation, and of different
//! equations, are correlated (docs/core.md, "Terms"). `ls` takes differenced rows without weights, `wls` C = 1,
//! `awls` C of the last estimate, `ml` follows the gradient through C.

mod batch;
mod colour;
mod complex;
mod descent;
mod driven;
mod driven_fit;
mod eight;
mod equations;
mod fitter;
mod instruments;
mod iterate;
mod levels;
mod lines;
mod noise;
mod plan;
mod rows;
mod sigma;
mod starts;
mod uncertainty;

pub use batch::TermsBatch;
pub use equations::{Equations, Lag, Signal, Term};
pub use fitter::TermsFit;
pub use plan::{TermsFitter, TermsOptions, TermsRecord};
