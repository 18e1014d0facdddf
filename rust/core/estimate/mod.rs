//! Estimators of θ for eight replicates at once; a single fit is the same kernel with one live lane.

mod awls;
pub(crate) mod batch;
mod default_band;
mod design;
mod fit;
pub(crate) mod fitter;
mod iterate;
pub mod joint;
mod ls;
mod ml;
mod outcome;
mod pass;
mod qr_step;
mod spare;
mod stream;
mod sums;
pub mod terms;
mod uncertainty;
mod window;
mod wls;
mod workspace;

pub use batch::{Batch, Many};
pub use design::Design;
pub use fit::{Band, BandRule, Fit, FitOptions, RecordView, Time};
pub use fitter::Fitter;
pub use outcome::Outcome;
pub use stream::{Slider, Stream};
pub use workspace::Workspace;

use crate::error::Status;
use crate::simd::{Isa, LANES, Wide};
use crate::structure::Method;
use iterate::{Rule, iterate};
use outcome::{lost_in_rounding, statuses};
use pass::{Factors, Prepare, Weights};

/// When an iteration stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Largest change of a parameter, as its effect on the equation relative to the largest term.
    pub tol: f64,
    /// Most iterations after the start.
    pub maxiter: usize,
    /// What is wanted besides θ.
    pub wanted: Wanted,
}

/// What is computed once θ is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wanted {
    /// Nothing more.
    Theta,
    /// The cost, and the transient that belongs to θ.
    Cost,
    /// Covariances as well.
    Covariance,
}

/// Where an iteration starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<'a> {
    /// From `wls`.
    Wls,
    /// From given parameters, in the user's units.
    Theta(&'a [f64]),
}

/// Estimates θ from the coefficients in the workspace; `live` lanes only, the others hold anything.
pub fn estimate(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    start: Start<'_>,
    o: &Options,
) -> Outcome {
    w.begin(live);
    isa.run(Prepare { design: d, space: w });
    if d.method == Method::Ls {
        isa.run(ls::LsStep { design: d, space: w });
    } else {
        match start {
            Start::Wls => iterate(isa, d, w, Rule::Wls, o),
            Start::Theta(theta) => {
                for ((to, value), scale) in w.theta.iter_mut().zip(theta).zip(&d.scale) {
                    *to = Wide::splat(value / scale);
                }
                isa.run(uncertainty::Transients { design: d, space: w });
            }
        }
    }
    match d.method {
        Method::Awls if d.adapts() => iterate(isa, d, w, Rule::Awls, o),
        Method::Ml if d.adapts() => iterate(isa, d, w, Rule::Ml, o),
        _ => w.progress.active = Wide::ZERO,
    }
    uncertainty::finish(isa, d, w, live, o.wanted);
    let asked = o.wanted == Wanted::Covariance;
    let status = status(d, w, asked);
    for (k, status) in status.iter().enumerate() {
        if matches!(status, Status::Rank | Status::NonFinite) {
            w.forget_covariance(k);
        }
    }
    Outcome { status, nit: w.progress.nit.0.map(|nit| nit as u32) }
}

fn status(d: &Design, w: &Workspace, with_covariance: bool) -> [Status; LANES] {
    let p = w.theta.len();
    let dependent = std::array::from_fn(|k| {
        w.dependent[k]
            || (with_covariance && lost_in_rounding([&w.cov_nonrobust, &w.cov_hc3], p, k))
    });
    let data = || w.records.iter().flat_map(|r| r.re.iter().chain(&r.im));
    statuses(&w.theta, |k| d.scale[k], &w.progress, dependent, data)
}

/// Replaces steps that small pivots spoiled by steps from orthogonal factors.
fn mend_step(d: &Design, w: &mut Workspace, weights: Weights, factors: Factors) {
    for lane in 0..LANES {
        // A step that is not finite shows as a move that is not.
        let sound = w.trusted.0[lane] > 0.0 && w.progress.moved.0[lane].is_finite();
        if sound || w.progress.active.0[lane] == 0.0 {
            continue;
        }
        let at = qr_step::Place { lane, weights, factors };
        let full = w.qr.solve(d, &mut w.records, &w.theta, &mut w.next, at);
        w.measure_move(lane);
        w.dependent[lane] = !full;
        if !full && weights == Weights::Flat {
            // Dependent columns in the start: nothing to iterate from.
            w.progress.active.0[lane] = 0.0;
        }
    }
}

impl Workspace {
    /// Nothing known yet: the live lanes iterate, the others do not.
    fn begin(&mut self, live: [bool; LANES]) {
        self.progress.begin(live);
        self.dependent = [false; LANES];
    }

    /// The change of one lane after its step was replaced, as the kernel measures it.
    fn measure_move(&mut self, k: usize) {
        let each = self.theta.iter().zip(&self.next).zip(&self.column_size);
        let square = each.fold(0.0, |most: f64, ((from, to), column)| {
            let step = to.0[k] - from.0[k];
            let effect = step * step * column.0[k].abs();
            // NaN must not read as settled.
            if effect > most || effect.is_nan() { effect } else { most }
        });
        let own = self.theta.iter().zip(&self.column_size);
        let largest = own.fold(self.target_size.0[k], |most: f64, (t, column)| {
            let own = t.0[k] * t.0[k] * column.0[k].abs();
            if own < most { most } else { own }
        });
        self.progress.moved.0[k] = square / largest;
    }

    /// No covariance rather than a wrong one, where the parameters are not determined.
    fn forget_covariance(&mut self, k: usize) {
        for c in self.cov_hc3.iter_mut().chain(&mut self.cov_nonrobust) {
            c.0[k] = f64::NAN;
        }
    }

    /// θ of one lane in the user's units.
    pub fn theta<'a>(&'a self, d: &'a Design, lane: usize) -> impl Iterator<Item = f64> + 'a {
        self.theta.iter().zip(&d.scale).map(move |(t, s)| t.0[lane] * s)
    }

    /// Parameter `k` of every lane in the user's units.
    pub(crate) fn parameter(&self, d: &Design, k: usize) -> [f64; LANES] {
        self.theta[k].0.map(|t| t * d.scale[k])
    }

    /// Standard errors of parameter `k` of every lane, from HC3 or the classical covariance.
    pub(crate) fn parameter_bse(&self, d: &Design, k: usize, hc3: bool) -> [f64; LANES] {
        let cov = if hc3 { &self.cov_hc3 } else { &self.cov_nonrobust };
        cov[k * (d.parameters() + 1)].0.map(|v| v.sqrt() * d.scale[k])
    }

    /// Standard errors of one lane from the diagonal of a covariance.
    fn bse<'a>(cov: &'a [Wide], d: &'a Design, lane: usize) -> impl Iterator<Item = f64> + 'a {
        let p = d.parameters();
        d.scale.iter().enumerate().map(move |(k, s)| cov[k * (p + 1)].0[lane].sqrt() * s)
    }

    /// HC3 standard errors of one lane.
    pub fn bse_hc3<'a>(&'a self, d: &'a Design, lane: usize) -> impl Iterator<Item = f64> + 'a {
        Self::bse(&self.cov_hc3, d, lane)
    }

    /// Classical standard errors of one lane.
    pub fn bse_nonrobust<'a>(
        &'a self,
        d: &'a Design,
        lane: usize,
    ) -> impl Iterator<Item = f64> + 'a {
        Self::bse(&self.cov_nonrobust, d, lane)
    }

    /// Whitened squared residuals of one lane, summed.
    pub fn cost(&self, lane: usize) -> f64 {
        self.progress.cost.0[lane]
    }

    /// A covariance of one lane in the user's units, row major.
    fn covariance(cov: &[Wide], d: &Design, lane: usize) -> Vec<f64> {
        let p = d.parameters();
        let at = |k: usize| cov[k].0[lane] * d.scale[k / p] * d.scale[k % p];
        (0..p * p).map(at).collect()
    }

    /// HC3 covariance of one lane.
    pub fn cov_hc3(&self, d: &Design, lane: usize) -> Vec<f64> {
        Self::covariance(&self.cov_hc3, d, lane)
    }

    /// Classical covariance of one lane.
    pub fn cov_nonrobust(&self, d: &Design, lane: usize) -> Vec<f64> {
        Self::covariance(&self.cov_nonrobust, d, lane)
    }
}
