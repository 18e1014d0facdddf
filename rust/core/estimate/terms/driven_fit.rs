//! Fits of equations that noise drives, from starts without such noise.

use super::descent::usable;
use super::driven::DrivenTerms;
use super::fitter::TermsFit;
use super::plan::{TermsFitter, TermsRecord, WIDEST};
use super::rows::TermsWorkspace;
use super::sigma::Sigma;
use crate::error::{Error, Status};
use crate::estimate::answer::Answer;
use crate::estimate::band::{Choice, Range};
use crate::estimate::spectral::NoiseSpectrum;
use crate::structure::Noise;

impl TermsFitter {
    /// The same with the levels of noise inside the equations, from what few lines say without.
    pub(super) fn finish_driven(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: Vec<Sigma>,
        chosen: &Choice,
        worker: TermsWorkspace,
        noise: Noise,
    ) -> Result<(TermsFit, TermsWorkspace), Error> {
        let narrow: Vec<Range> = self
            .narrow
            .iter()
            .zip(&chosen.ranges)
            .map(|(few, own)| (own.0, few.1.min(own.1)))
            .collect();
        let few = self.problem(records, sigmas.clone(), &narrow, TermsWorkspace::default());
        let (few, flat) = match few {
            Ok(mut few) => (self.estimate(&mut few, None).ok(), few.flat().ok()),
            Err(_) => (None, None),
        };
        // Without such noise lines depend on one another, and a start needs no more than these.
        let capped: Vec<Range> =
            chosen.ranges.iter().map(|own| (own.0, own.1.min(own.0 + WIDEST))).collect();
        let mut without =
            self.problem(records, sigmas.clone(), &capped, TermsWorkspace::default())?;
        let wide = self.estimate(&mut without, chosen.theta.as_deref())?;
        let mut problem = self.problem(records, sigmas, &chosen.ranges, worker)?;
        let mut best: Option<DrivenTerms> = None;
        // Weights as if sensors had all the noise may lead away: then once more from rows without.
        for (start, last) in [(Some(wide), false), (few, false), (flat, true)] {
            let settled = best.as_ref().is_some_and(|best| best.ended.status == Status::Ok);
            let Some(start) = start.filter(usable).filter(|_| !(last && settled)) else { continue };
            let found = self.refine(&mut problem, &start, noise)?;
            // Noise may be told apart in more than one way.
            if best.as_ref().is_none_or(|best| found.is_better(best)) {
                best = Some(found);
            }
        }
        let Some(found) = best else {
            let lost = self.estimate(&mut without, None)?;
            let fit = self.finished(&mut without, &lost, chosen.rule)?;
            return Ok((fit, problem.into_worker()));
        };
        let q = self.o.equations.orders.len();
        let sigma: Vec<f64> = found.levels.values[..q].iter().map(|v| v.sqrt()).collect();
        let levels = vec![sigma; records.len()];
        let lost = matches!(found.ended.status, Status::Rank | Status::NonFinite);
        let known = |own: Vec<f64>| if lost { vec![f64::NAN; own.len()] } else { own };
        let fit = TermsFit {
            answer: Answer {
                theta: found.ended.theta,
                cov_spectral: known(found.nonrobust.clone()),
                cov_nonrobust: known(found.nonrobust),
                cov_hc3: known(found.hc3),
                degrees: known(found.degrees.clone()),
                noise_spectrum: NoiseSpectrum::default(),
                gram: known(found.gram),
                cost: found.ended.cost,
                degrees_of_freedom: found.freedom,
                status: found.ended.status,
                nit: found.ended.nit,
                lines: problem.spots.iter().map(|s| s.lines).collect(),
                band_rule: chosen.rule,
            },
            scale: 1.0,
            seen: levels.clone(),
            correlation: problem.sigmas.iter().map(Sigma::correlation).collect(),
            levels,
            hc3_degrees: known(found.degrees),
            at_bound: found.ended.at_bound,
            bend: 0.0,
            residuals: found.residuals,
            driven: Some(found.levels),
        };
        Ok((fit, problem.into_worker()))
    }
}
