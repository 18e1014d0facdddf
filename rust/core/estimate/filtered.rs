//! Starts for fits whose ways were long or ended apart: regressions behind filters, which keep noise and far lines small.
//!
//! `wls` weighs lines by their derivatives, so that the upper ones rule. A regression on signals behind 1/(s + λ)ⁿ (a
//! state-variable filter) weighs those below λ most; which λ is right depends on the system. Eight of them, from the band's
//! edge down by factors of two, run at once, one a lane. Each is a step of `awls` at A = (s + λ)ⁿ.

use super::design::Design;
use super::iterate::iterate;
use super::options::Options;
use super::rule::Rule;
use super::workspace::Workspace;
use crate::simd::{Isa, LANES, Wide};

/// The regression behind each lane's filter.
pub(super) fn begin_filtered(isa: Isa, d: &Design, w: &mut Workspace, o: &Options) {
    let live = w.progress.active.0.map(|active| active > 0.0);
    // (s + λ)ⁿ in units of the band's edge: coefficient after coefficient of the binomial.
    let lambda = Wide(std::array::from_fn(|lane| 1.0 / (1_u32 << lane) as f64));
    let n = d.structure.order;
    let mut coefficient = Wide::splat(1.0);
    for (k, to) in w.iterates.theta.now[..n].iter_mut().enumerate() {
        let next = (n - k) as f64 / (k + 1) as f64;
        for lane in 0..LANES {
            coefficient.0[lane] *= next * lambda.0[lane];
        }
        *to = coefficient;
    }
    w.iterates.theta.now[n..].fill(Wide::ZERO);
    iterate(isa, d, w, Rule::Awls, &Options { maxiter: 1, ..*o });
    w.begin(live);
}
