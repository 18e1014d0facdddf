//! Noise levels of several outputs, and of several records, estimated with the parameters.
//!
//! With C = Σ_j σ_j² C_j the covariance of a record's rows, σ_j² ∂/∂σ_j² of rᵀC⁻¹r and of log det C are −q_j and t_j: what
//! channel j's noise has of the weighted sum of squares, and of the rows. Where the levels are right q_j/t_j is the
//! same for all channels and records; else σ_j² ← σ_j² q_j/t_j is the way to maximum likelihood (restricted: what transients and
//! parameters take from the rows is taken from all channels alike).

use super::fitter::usable;
use super::iterate::{Ended, TermsProblem};
use super::plan::{TermsFitter, TermsRecord};
use super::rows::Worker;
use crate::error::Error;
use crate::estimate::normal_equations::RowWeights;
use crate::math::ln_1;

/// Relative change of a variance by which derivatives are taken.
const CHANGE: f64 = 1e-5;
/// Standard deviations of a ratio of levels from what was seen in the high band that contradict it.
const FAR: f64 = 4.0;
/// Rounds of levels and parameters, and the relative change of variances that ends them.
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-3;
/// A variance changes by no more than this factor a round.
const MOST: f64 = 1e4;
/// A level is at least this part of its channel's size: rows of channels that share an equation would drown in
/// rounding, and so small a misfit needs no better weight.
const LEAST: f64 = 1e-4;

/// What residuals say of the levels.
struct Learnt {
    variances: Vec<Vec<f64>>,
    /// Largest |log| of what the variances change by.
    change: f64,
    /// Largest |log| of what they change by beside the common factor, in its standard deviations.
    contradiction: f64,
}

impl TermsFitter {
    /// Whether levels are estimated with the parameters.
    fn learns(&self) -> bool {
        let several = self.o.equations.noisy.len() * self.records.len() > 1;
        self.o.learn && several && self.weights().0 == RowWeights::Adapted
    }

    /// Variances to choose lines with: those that the residuals on few lines have, where these contradict
    /// what was seen in the high band.
    pub(crate) fn first_variances(
        &self,
        records: &[TermsRecord<'_>],
        seen: &[Vec<f64>],
    ) -> Result<Vec<Vec<f64>>, Error> {
        if !self.learns() || !self.band_is_sought() {
            return Ok(seen.to_vec());
        }
        let few = self.problem(records, seen.to_vec(), &self.narrow, Worker::default());
        let Ok(mut problem) = few else { return Ok(seen.to_vec()) }; // too few lines for the unknowns
        let ended = self.estimate(&mut problem, None)?;
        self.learn(&mut problem, ended)?;
        Ok(problem.variances)
    }

    /// Levels and parameters in turn until both stand, if the residuals contradict the levels.
    pub(crate) fn learn(
        &self,
        problem: &mut TermsProblem<'_>,
        first: Ended,
    ) -> Result<Ended, Error> {
        if !self.learns() || !usable(&first) {
            return Ok(first);
        }
        let mut ended = first;
        let (seen, least) = (problem.variances.clone(), problem.least_variances());
        let more = |(own, least): (&Vec<f64>, &Vec<f64>)| {
            own.iter().zip(least).map(|(own, least)| own.max(*least)).collect()
        };
        let raised = seen.iter().zip(&least).map(more).collect();
        problem.set_variances(raised);
        for round in 0..ROUNDS {
            let learnt = problem.learnt(&ended.theta, &least)?;
            if round == 0 && !(learnt.contradiction > FAR && learnt.variances != least) {
                problem.set_variances(seen);
                break;
            }
            if learnt.change < SETTLED {
                break;
            }
            let before = problem.variances.clone();
            problem.set_variances(learnt.variances);
            let next = self.estimate(problem, Some(&ended.theta))?;
            if !usable(&next) {
                problem.set_variances(before);
                break;
            }
            ended = Ended { nit: ended.nit + next.nit, ..next };
        }
        Ok(ended)
    }
}

impl TermsProblem<'_> {
    /// Smallest variances that levels are given.
    fn least_variances(&self) -> Vec<Vec<f64>> {
        let size = |samples: &[f64]| {
            let (low, high) = samples
                .iter()
                .fold((f64::MAX, f64::MIN), |(low, high), v| (v.min(low), v.max(high)));
            let least = LEAST * 0.5 * (high - low);
            least * least
        };
        let noisy = &self.fitter.o.equations.noisy;
        self.records.iter().map(|r| noisy.iter().map(|c| size(r.channels[*c])).collect()).collect()
    }

    /// What the residuals at θ say of the levels.
    fn learnt(&mut self, theta: &[f64], least: &[Vec<f64>]) -> Result<Learnt, Error> {
        let own = self.variances.clone();
        let cost = self.cost(theta, RowWeights::Adapted)?;
        let rows: usize = self.spots.iter().map(|s| s.rows.len()).sum();
        let degrees = self.degrees_of_freedom() as f64;
        let (left, scale) = (degrees / rows as f64, cost / degrees);
        let mut found = Learnt { variances: own.clone(), change: 0.0, contradiction: 0.0 };
        for (k, own) in own.iter().enumerate() {
            let (cost, log_det) = self.likelihood(k, own, theta)?;
            for j in 0..own.len() {
                let mut moved = own.clone();
                moved[j] *= 1.0 + CHANGE;
                let (near, log_det_near) = self.likelihood(k, &moved, theta)?;
                let (q, t) = ((cost - near) / CHANGE, left * (log_det_near - log_det) / CHANGE);
                if !(q > 0.0 && t > 1.0) {
                    continue; // no row tells it
                }
                let ratio = (q / t).clamp(1.0 / MOST, MOST);
                let variance = (own[j] * ratio).max(least[k][j]);
                found.variances[k][j] = variance;
                found.change = found.change.max(ln_1(variance / own[j]).abs());
                let deviations = ln_1(ratio / scale).abs() * (0.5 * t).sqrt();
                found.contradiction = found.contradiction.max(deviations);
            }
        }
        self.set_variances(own);
        Ok(found)
    }

    /// Weighted sum of squares of a record at θ and log det of its rows' covariance, under other variances.
    fn likelihood(
        &mut self,
        record: usize,
        variances: &[f64],
        theta: &[f64],
    ) -> Result<(f64, f64), Error> {
        let cost = self.cost_of(record, variances, theta)?;
        Ok((cost, self.spots[record].log_det()))
    }
}
