//! Estimation of several outputs, coloured or input noise, uneven sample noise, fixed and bounded parameters and unknown delays.
//!
//! On each line the residuals of all outputs, r_i = A_iY_i − Σ_k B_ikU_k − T_i, are whitened by a small
//! matrix W with W S W* = 1, S = D Σ_y D* + B Σ_u B*, D = diag(A_i). Rows of Γ and J are written line by
//! line and their products summed: slower than the sums of products that one output with white noise
//! allows (`estimate::sums`), and able to carry what those cannot. Steps and stopping are the same.

mod batch;
mod colour;
mod default_band;
mod delays;
mod dense;
mod design;
mod fitter;
mod iterate;
mod qr_step;
mod rows;
mod step;
mod structure;
mod tile;
mod uncertainty;
mod workspace;

pub use batch::JointBatch;
pub(crate) use batch::Shared;
pub use design::{Colour, JointDesign, NoiseModel};
pub use fitter::{JointFit, JointFitter, JointOptions, JointRecord};
pub use structure::{Delay, JointStructure, Path};
pub(crate) use workspace::JointSpace;
