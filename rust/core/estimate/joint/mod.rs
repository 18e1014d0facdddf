//! Estimation of several outputs, coloured or input noise, uneven sample noise, fixed and bounded parameters and unknown delays.
//!
//! The outputs share one denominator (report, eq. 25) or have one each (eq. 26). On line m
//!
//! ```text
//! r_i = A_i(s) Y_i − Σ_k B_ik(s) e^{−sτ_ik} U_k − T_i(s),
//! minimise over θ, τ, T:  Σ_m r* S⁻¹ r / h_m,   S = D Σ_y D* + B Σ_u B*,   D = diag(A_i),
//! ```
//!
//! by the steps of one output: `wls` with S = 1, `awls` with S of the last estimate, `ml` with J for Γ on the left.
//! Once θ has settled with Σ_y = 1, an unknown Σ_y is that of each step's own residuals. With e_i = r_i/A_i, q outputs
//! and ν degrees of freedom,
//!
//! ```text
//! Σ̂_ij = (q/ν) Σ_m Re(e_i e_j*) / h_m,
//! ```
//!
//! and fits on the same lines are compared by ν log det Σ̂. A small matrix W with W S W* = 1 whitens the rows of a
//! line, which are written line by line and their products summed: slower than the sums of products that one output
//! with white noise allows (`estimate::sums`), and able to carry what those cannot.

mod apart;
mod at_once;
mod batch;
mod colour;
mod complex;
mod default_band;
mod delays;
mod design;
mod driven;
mod fit;
mod fitter;
mod growth;
mod iterate;
mod line_noise;
mod qr_step;
mod rows;
mod single;
mod step;
mod structure;
mod tile;
mod unalias;
mod uncertainty;
mod whitener;
mod workspace;

pub use batch::JointBatch;
pub(crate) use batch::JointShared;
pub use design::{Colour, JointDesign, NoiseModel};
pub use fit::JointFit;
pub(crate) use fitter::Scales;
pub use fitter::{JointFitter, JointOptions, JointRecord};
pub use structure::{Delay, JointStructure, Path};
pub(crate) use workspace::JointWorkspace;
