//! What stands at the end of a fit: transient, cost and covariances, by the straight path or the general one; statuses.

use super::band::CLOSE;
use super::design::Design;
use super::outcome::{lost_lanes, statuses};
use super::spectral::Finish;
use super::workspace::Workspace;
use super::{straight, uncertainty};
use crate::error::Status;
use crate::simd::{Isa, LANES};

/// Completes estimates: T, cost, and with `covariance` the covariances.
pub(super) fn complete(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    covariance: bool,
) {
    if !straight::finish(isa, d, w, live, covariance) {
        uncertainty::finish(isa, d, w, live, covariance);
    }
    if covariance && w.covariances.kinds.spectral {
        let (spectral, by) = (&mut w.covariances.spectral, 1.0 / d.degrees_of_freedom() as f64);
        isa.run(Finish { spectral, bins: &d.bins, cost: &w.progress.cost, by });
    }
}

/// Statuses of all lanes where they stand.
pub(super) fn status(d: &Design, w: &Workspace, with_covariance: bool) -> [Status; LANES] {
    let theta = &w.iterates.theta.now;
    let covariances = with_covariance.then(|| w.covariances.judged());
    let lost = lost_lanes(w.dependent, covariances, theta.len());
    let data = || w.records.iter().flat_map(|r| r.re.iter().chain(&r.im));
    // Where noise is strong, last steps shrink slowly: what is left to go is far below any standard error.
    statuses(CLOSE, theta, |k| d.scale[k], &w.progress, lost, data)
}
