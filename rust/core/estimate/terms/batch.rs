//! Many fits at once, eight records a block where they go together, over threads, on lines chosen once.

use super::eight::{Eights, FEWEST};
use super::fitter::TermsFit;
use super::plan::{TermsFitter, TermsRecord};
use super::rows::TermsWorkspace;
use crate::error::{Error, Status};
use crate::estimate::Many;
use crate::estimate::band::Choice;
use crate::modulation::Lines;
use crate::simd::LANES;
use crate::threads::{self, Control};

/// Records a chunk, the unit of scheduling.
const CHUNK: usize = 16;

/// Samples of many records of one length and step.
#[derive(Debug, Clone)]
pub struct TermsBatch<'a> {
    /// Channels of each record.
    pub records: Vec<TermsRecord<'a>>,
}

impl TermsFitter {
    /// Fits every record of a batch by itself, on lines given or found on the first sound one; also the
    /// degrees of freedom and the lines.
    ///
    /// # Errors
    /// As [`TermsFitter::fit`]; [`Error::Cancelled`] and [`Error::Internal`] from the threads.
    pub fn fit_many(
        &self,
        batch: &TermsBatch<'_>,
        thread_count: usize,
        progress: &mut dyn FnMut(usize, usize) -> Control,
    ) -> Result<(Many, usize, Vec<Lines>), Error> {
        let sound =
            |r: &&TermsRecord<'_>| r.channels.iter().all(|c| c.iter().all(|v| v.is_finite()));
        let Some(first) = batch.records.iter().find(sound).or(batch.records.first()) else {
            return Err(Error::Data("fitting a batch: it has no records".into()));
        };
        let one = std::slice::from_ref(first);
        self.check(one)?;
        let sigmas = self.first_sigmas(one, &self.sigmas(one)?)?;
        let chosen = self.choose(one, &sigmas)?;
        // Where one record's parameters are a good start for all; a linear start needs none.
        let start = match self.o.equations.linear {
            true => None,
            false => {
                Some(self.finish(one, sigmas, &chosen, TermsWorkspace::default())?.0.answer.theta)
            }
        };
        let shared = Choice { ranges: chosen.ranges, rule: None, theta: start };
        let together = self.goes_in_eights(&shared);
        let work = |memory: &mut Eights, chunk: usize| {
            let mut out = Many::default();
            let mut told = None;
            let own = batch.records.chunks(CHUNK).nth(chunk).unwrap_or_default();
            for records in own.chunks(LANES) {
                if threads::stopped() {
                    break;
                }
                for fit in self.fit_some(records, &shared, together, memory)? {
                    out.push_terms(&fit);
                    told = Some((fit.answer.degrees_of_freedom, fit.answer.lines));
                }
            }
            Ok((out, told))
        };
        let chunks = batch.records.len().div_ceil(CHUNK);
        let parts = threads::run(thread_count, chunks, progress, Eights::default, work)?;
        let mut all = Many::default();
        let mut told = None;
        for part in parts {
            let (part, own) = part?;
            all.append(part);
            told = told.or(own);
        }
        let (degrees, lines) = told.unwrap_or_default();
        Ok((all, degrees, lines))
    }

    /// Fits each of up to eight records, all at once where they go together.
    fn fit_some(
        &self,
        records: &[TermsRecord<'_>],
        shared: &Choice,
        together: bool,
        memory: &mut Eights,
    ) -> Result<Vec<TermsFit>, Error> {
        let mut sigmas = Vec::with_capacity(records.len());
        for one in records.chunks(1) {
            self.check(one)?;
            sigmas.push(self.sigmas(one)?);
        }
        if together && records.len() >= FEWEST {
            return self.finish_eight(records, &sigmas, shared, memory);
        }
        let mut fits = Vec::with_capacity(records.len());
        for (one, own) in records.chunks(1).zip(sigmas) {
            let (fit, back) = self.finish(one, own, shared, std::mem::take(memory.one()))?;
            *memory.one() = back;
            fits.push(fit);
        }
        Ok(fits)
    }
}

impl Many {
    /// Adds one fit.
    fn push_terms(&mut self, fit: &TermsFit) {
        let (own, first) = (&fit.answer, self.theta.len());
        self.push_answer(own);
        if matches!(own.status, Status::Rank | Status::NonFinite) {
            self.theta[first..].fill(f64::NAN);
        }
        self.hc3_degrees.extend(&fit.hc3_degrees);
        self.levels.extend(fit.driven.clone());
    }
}
