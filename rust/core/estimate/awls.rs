//! `awls`: weights from the last estimate, again and again (report, section 4.4).

use super::design::Design;
use super::pass::{Factors, Step, Weights};
use super::workspace::Workspace;
use super::{Lane, Options, take_step};
use crate::simd::{Isa, LANES};

/// Reweights until no parameter moves; a lane that has settled keeps its bits.
pub(crate) fn iterate(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    lanes: &mut [Lane; LANES],
    o: &Options,
) {
    for _ in 0..o.maxiter {
        let active = lanes.map(|l| !l.done);
        if active == [false; LANES] {
            return;
        }
        isa.run(Step { design: d, space: w, weights: Weights::Adapted, factors: Factors::Data });
        take_step(d, w, lanes, Weights::Adapted, Factors::Data);
        w.accept(&active);
        for (k, lane) in lanes.iter_mut().enumerate().filter(|(_, l)| !l.done) {
            lane.nit += 1;
            lane.done = w.moved.0[k] <= o.tol * o.tol;
        }
    }
}
