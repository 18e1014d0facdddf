//! Estimates carried on with the likelihood of noise that drives the system, lane after lane.

use super::design::Design;
use super::driven::{Driven, Problem};
use super::workspace::Workspace;
use crate::simd::{Isa, LANES};

/// Carries on from the estimates that stand in the lanes, with their covariances where they are asked for.
pub(super) fn refine(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    (tol, maxiter): (f64, usize),
    covariance: bool,
) {
    let mut driven = w.driven.take().unwrap_or_else(|| Box::new(Driven::new(d, isa)));
    for (lane, live) in live.into_iter().enumerate() {
        let theta = &mut w.iterates.theta.now;
        if !live || w.dependent[lane] || theta.iter().any(|t| !t.0[lane].is_finite()) {
            driven.forget(lane);
            continue;
        }
        let at = Problem { d, records: &w.records, lane };
        let found = driven.seek(&at, theta.iter().map(|t| t.0[lane]), tol, maxiter);
        for (to, from) in theta.iter_mut().zip(driven.theta(lane)) {
            to.0[lane] = *from;
        }
        w.progress.nit.0[lane] += found.steps as f64;
        w.progress.active.0[lane] = f64::from(!found.settled);
        w.progress.cost.0[lane] = found.cost;
        if covariance {
            driven.uncertainty(&at);
            let p = d.parameters();
            for k in 0..p * p {
                let (i, j) = (k / p, k % p);
                w.cov_nonrobust[k].0[lane] = driven.covariance(i, j);
                w.spectral.cov[k].0[lane] = driven.covariance(i, j);
                w.cov_hc3[k].0[lane] = driven.sandwich(i, j);
                w.gram[k].0[lane] = driven.gram(i, j);
            }
            for (k, to) in w.spectral.degrees.iter_mut().enumerate() {
                to.0[lane] = driven.degrees(k);
                w.dependent[lane] |= driven.is_dependent(k);
            }
        }
    }
    w.driven = Some(driven);
}
