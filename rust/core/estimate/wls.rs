//! `wls`: one shot with the covariance of white equation noise (report, section 4.4); the start of the others.

use super::design::Design;
use super::pass::{Factors, Step, Weights};
use super::workspace::Workspace;
use super::{Lane, take_step};
use crate::simd::{Isa, LANES};

/// Lines with S = 1.
pub(crate) fn solve(isa: Isa, d: &Design, w: &mut Workspace, lanes: &mut [Lane; LANES]) {
    isa.run(Step { design: d, space: w, weights: Weights::Flat, factors: Factors::Data });
    take_step(d, w, lanes, Weights::Flat, Factors::Data);
    w.accept(&[true; LANES]);
}
