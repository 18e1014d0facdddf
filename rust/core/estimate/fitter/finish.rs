//! What a user sees of an estimate on chosen lines.

use super::{FitWorkspace, Fitter, Problem};
use crate::error::Error;
use crate::estimate::answer::{Answer, unit_diagonal};
use crate::estimate::band::{BandRule, Range};
use crate::estimate::fit::Fit;
use crate::estimate::options::{Options, Start, Wanted};
use crate::estimate::outcome::End;
use crate::estimate::replicates::estimate;
use crate::estimate::uncertainty::Residuals;
use crate::simd::{LANES, Wide};
use crate::structure::CovType;

impl Fitter {
    /// The estimate on the chosen lines with everything a user sees; of several starts the best.
    pub(super) fn finish(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
        start: Start<'_>,
        band_rule: Option<BandRule>,
    ) -> Result<Fit, Error> {
        let mut problem = self.problem(space, ranges)?;
        let (d, w) = (&problem.design, &mut problem.space);
        let options = Options { wanted: Wanted::Covariance, ..self.o.options };
        let live = start.lanes();
        let outcome = estimate(self.isa, d, w, live, start, &options);
        let end = |lane: usize| End { status: outcome.status[lane], cost: w.cost(lane) };
        let better =
            |best: usize, k: usize| if end(k).is_better_than(end(best)) { k } else { best };
        let lane = (0..LANES).filter(|k| live[*k]).fold(0, better);
        let degrees_of_freedom = d.degrees_of_freedom();
        let plain_sigma = (w.cost(lane) / degrees_of_freedom as f64).sqrt();
        let mut residuals = Vec::new();
        self.isa.run(Residuals { design: d, space: w, out: &mut residuals });
        let over = |v: &[Wide; 2]| (v[0].0[lane] / plain_sigma, v[1].0[lane] / plain_sigma);
        let mut fit = Fit {
            answer: Answer {
                theta: w.theta(d, lane).collect(),
                cov_nonrobust: w.covariance(d, lane, CovType::Nonrobust),
                cov_hc3: w.covariance(d, lane, CovType::Hc3),
                cov_spectral: w.covariance(d, lane, CovType::Spectral),
                degrees: w.covariances.degrees(lane).collect(),
                noise_spectrum: w.covariances.spectral.told(&d.bins, lane),
                gram: unit_diagonal(|k| w.gram[k].0[lane], d.parameters()),
                cost: w.cost(lane) * d.cost_unit() * d.cost_unit(),
                degrees_of_freedom,
                status: outcome.status[lane],
                nit: outcome.nit[lane],
                lines: d.lines(),
                band_rule,
            },
            sigma: plain_sigma * d.cost_unit(),
            free_cost: None,
            levels: w.refined.as_ref().map(|own| own.levels(d, lane)),
            record_levels: space.levels.iter().map(|v| v.sqrt()).collect(),
            residuals: match &w.refined {
                Some(own) => own.residuals(lane),
                None => residuals.iter().map(|r| r.iter().map(over).collect()).collect(),
            },
        };
        fit.free_cost = self.free_cost(&mut problem, &fit.answer.theta, &options);
        space.keep(problem);
        Ok(fit)
    }

    /// The cost on the same lines without what is known of the initial states, where something is.
    fn free_cost(&self, problem: &mut Problem, theta: &[f64], o: &Options) -> Option<f64> {
        let known = problem.design.known_start.take()?;
        let (d, w) = (&problem.design, &mut problem.space);
        if d.aliasing.is_some() {
            w.records.iter_mut().for_each(|r| r.measured.give_back(&mut r.re, &mut r.im));
        }
        let start = Start::Theta(theta);
        estimate(self.isa, d, w, start.lanes(), start, o);
        let cost = w.cost(0) * d.cost_unit() * d.cost_unit();
        problem.design.known_start = Some(known);
        Some(cost)
    }
}
