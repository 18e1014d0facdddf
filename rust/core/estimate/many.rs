//! Results of many fits.

use super::answer::Answer;
use super::covariances::Covariances;
use super::design::Design;
use super::driven::output::Levels;
use super::outcome::Outcome;
use super::workspace::Workspace;
use crate::error::Status;
use crate::structure::CovType;

/// Results of many fits, replicate after replicate.
#[derive(Debug, Clone, Default)]
pub struct Many {
    /// Estimates.
    pub theta: Vec<f64>,
    /// Classical standard errors.
    pub bse_nonrobust: Vec<f64>,
    /// HC3 standard errors.
    pub bse_hc3: Vec<f64>,
    /// Standard errors from a smooth noise spectrum.
    pub bse_spectral: Vec<f64>,
    /// Degrees of freedom of each of these.
    pub degrees: Vec<f64>,
    /// Outcomes.
    pub status: Vec<Status>,
    /// Weighted sums of squares.
    pub cost: Vec<f64>,
    /// Iterations.
    pub nit: Vec<u32>,
    /// Degrees of freedom of each HC3 standard error, of equations alone.
    pub hc3_degrees: Vec<f64>,
    /// Levels of noise that drives the system and of the samples, where they are estimated.
    pub levels: Vec<Levels>,
}

impl Many {
    /// Adds one lane's results.
    pub(super) fn push(&mut self, d: &Design, w: &Workspace, lane: usize, outcome: &Outcome) {
        self.theta.extend(w.theta(d, lane));
        self.push_errors(&w.covariances, lane, |k| d.scale[k]);
        self.status.push(outcome.status[lane]);
        self.cost.push(w.cost(lane) * d.cost_unit() * d.cost_unit());
        self.nit.push(outcome.nit[lane]);
        self.levels.extend(w.refined.as_ref().map(|refined| refined.levels(d, lane)));
    }

    /// Adds standard errors of one lane, with the unit of each parameter.
    pub(super) fn push_errors(
        &mut self,
        from: &Covariances,
        lane: usize,
        unit: impl Fn(usize) -> f64,
    ) {
        self.bse_nonrobust.extend(from.errors(CovType::Nonrobust, lane, &unit));
        self.bse_hc3.extend(from.errors(CovType::Hc3, lane, &unit));
        self.bse_spectral.extend(from.errors(CovType::Spectral, lane, &unit));
        self.degrees.extend(from.degrees(lane));
    }

    /// Adds one fit by itself.
    pub(super) fn push_answer(&mut self, own: &Answer) {
        let errors = |cov: &[f64]| {
            let variances = cov.iter().step_by(own.theta.len() + 1);
            variances.map(|v| v.sqrt()).collect::<Vec<f64>>()
        };
        self.theta.extend(&own.theta);
        self.bse_nonrobust.extend(errors(&own.cov_nonrobust));
        self.bse_hc3.extend(errors(&own.cov_hc3));
        self.bse_spectral.extend(errors(&own.cov_spectral));
        self.degrees.extend(&own.degrees);
        self.status.push(own.status);
        self.cost.push(own.cost);
        self.nit.push(own.nit);
    }

    pub(super) fn append(&mut self, mut other: Many) {
        self.theta.append(&mut other.theta);
        self.bse_nonrobust.append(&mut other.bse_nonrobust);
        self.bse_hc3.append(&mut other.bse_hc3);
        self.bse_spectral.append(&mut other.bse_spectral);
        self.degrees.append(&mut other.degrees);
        self.status.append(&mut other.status);
        self.cost.append(&mut other.cost);
        self.nit.append(&mut other.nit);
        self.hc3_degrees.append(&mut other.hc3_degrees);
        self.levels.append(&mut other.levels);
    }
}
