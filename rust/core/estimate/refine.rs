//! Estimates carried on with the likelihood of noise that drives the system, lane after lane.

use super::design::Design;
use super::driven::output::{Output, Refined};
use super::driven::{Driven, Found};
use super::workspace::Workspace;
use crate::simd::{Isa, LANES};

/// Carries on from the estimates that stand in the lanes, with their covariances where they are asked for.
pub(super) fn refine(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    limits: (f64, usize),
    covariance: bool,
) {
    let p = d.parameters();
    let mut output = Output { d, records: &w.records, lane: 0, theta: Vec::new() };
    let Refined { mut driven, mut found } = match w.refined.take() {
        Some(own) => *own,
        None => Refined { driven: Driven::new(&output, isa), found: vec![Found::default(); LANES] },
    };
    for (lane, live) in live.into_iter().enumerate() {
        let (theta, found) = (&mut w.iterates.theta.now, &mut found[lane]);
        *found = Found::default();
        if !live || w.dependent[lane] || theta.iter().any(|t| !t.0[lane].is_finite()) {
            continue;
        }
        output.lane = lane;
        found.theta.extend(theta.iter().map(|t| t.0[lane]));
        let sought = driven.seek(&mut output, found, &[1.0], limits);
        for (to, from) in theta.iter_mut().zip(&found.theta) {
            to.0[lane] = *from;
        }
        w.progress.nit.0[lane] += sought.steps as f64;
        w.progress.active.0[lane] = f64::from(!sought.settled);
        w.progress.cost.0[lane] = driven.cost_of_output(d, found);
        if covariance {
            driven.uncertainty(&mut output, found);
            for k in 0..p * p {
                let (i, j) = (k / p, k % p);
                w.covariances.nonrobust[k].0[lane] = driven.covariance(i, j);
                w.covariances.spectral.cov[k].0[lane] = driven.covariance(i, j);
                w.covariances.hc3[k].0[lane] = driven.sandwich(i, j);
                w.gram[k].0[lane] = driven.gram(i, j);
            }
            for (k, to) in w.covariances.spectral.degrees.iter_mut().enumerate() {
                to.0[lane] = driven.degrees(k);
                w.dependent[lane] |= driven.is_dependent(k);
            }
        }
    }
    w.refined = Some(Box::new(Refined { driven, found }));
}
