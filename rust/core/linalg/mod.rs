//! Small systems of equations: eight at once without pivoting, and one at a time by Householder QR.

pub mod columns;
pub(crate) mod condition;
pub mod dense;
pub(crate) mod eight;
pub mod lanes;
pub(crate) mod large;
pub mod qr;
pub(crate) mod stacked;
