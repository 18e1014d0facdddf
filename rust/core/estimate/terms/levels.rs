//! Covariance of the noise of several outputs, and of several records, estimated with the parameters.
//!
//! With C = Σ_jk Σ(j, k) C_jk the covariance of a record's rows, the derivatives of rᵀC⁻¹r and of log det C to Σ are −Q and T. With
//! Σ = WWᵀ, A = WᵀQW and B = WᵀTW = VVᵀ are what the noise of the channels has of the weighted sum of squares, and of the rows.
//! Where Σ is right the two agree, but for one factor; else Σ ← W (V⁻¹AV⁻ᵀ) Wᵀ is the way to maximum likelihood (restricted: what
//! transients and parameters take from the rows is taken from all channels alike). As many equations as channels make Σ the
//! covariance of their residuals in one step. With fewer, correlations cannot be told, and σ_j² ← σ_j² Q_jj/T_jj.

use super::descent::{Ended, usable};
use super::iterate::TermsProblem;
use super::plan::{TermsFitter, TermsRecord};
use super::rows::TermsWorkspace;
use super::sigma::{Sigma, root};
use crate::error::{Error, Status};
use crate::estimate::normal_equations::RowWeights;
use crate::math::ln_1;

/// Relative change of a variance by which derivatives are taken.
const CHANGE: f64 = 1e-5;
/// Standard deviations of a ratio of levels, or of a correlation, from what was seen in the high band that contradict it.
const FAR: f64 = 4.0;
/// Rounds of levels and parameters, and the relative change of variances that ends them.
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-3;
/// Rounds one after the other whose parameters did not settle: no more of them would.
const UNSETTLED: usize = 6;
/// A variance changes by no more than this factor a round.
const MOST: f64 = 1e4;
/// A level is at least this part of its channel's size: rows of channels that share an equation would drown in
/// rounding, and so small a misfit needs no better weight.
const LEAST: f64 = 1e-4;
/// Rows that tell of a channel's noise, at least.
const FEWEST: f64 = 1.0;

/// What residuals say of the noise.
struct Learnt {
    sigmas: Vec<Sigma>,
    /// Largest change: |log| of a variance's, or that of a correlation.
    change: f64,
    /// Largest change beside the factor common to all variances, in its standard deviations.
    contradiction: f64,
}

impl TermsFitter {
    /// Whether levels are estimated with the parameters.
    pub(super) fn learns(&self) -> bool {
        let several = self.o.equations.noisy.len() * self.records.len() > 1;
        self.o.learn && several && self.weights().0 == RowWeights::Adapted
    }

    /// Whether the equations can tell correlations of the noise.
    fn tells_correlation(&self) -> bool {
        let e = &self.o.equations;
        e.noisy.len() > 1 && e.orders.len() >= e.noisy.len()
    }

    /// Noise to choose lines with: what the residuals on few lines have, where these contradict what was seen in
    /// the high band.
    pub(crate) fn first_sigmas(
        &self,
        records: &[TermsRecord<'_>],
        seen: &[Sigma],
    ) -> Result<Vec<Sigma>, Error> {
        if !self.learns() || !self.band_is_sought() {
            return Ok(seen.to_vec());
        }
        let few = self.problem(records, seen.to_vec(), &self.narrow, TermsWorkspace::default());
        let Ok(mut problem) = few else { return Ok(seen.to_vec()) }; // too few lines for the unknowns
        let ended = self.estimate(&mut problem, None)?;
        self.learn(&mut problem, ended)?;
        Ok(problem.sigmas)
    }

    /// Noise and parameters in turn until both stand, if the residuals contradict what the noise was taken for.
    pub(crate) fn learn(
        &self,
        problem: &mut TermsProblem<'_>,
        first: Ended,
    ) -> Result<Ended, Error> {
        if !self.learns() || !usable(&first) {
            return Ok(first);
        }
        let mut ended = first;
        let (seen, least) = (problem.sigmas.clone(), problem.least_variances());
        let raised = seen.iter().zip(&least).map(|(own, least)| own.at_least(least)).collect();
        problem.set_sigmas(raised);
        let mut unsettled = 0;
        for round in 0..ROUNDS {
            let learnt = problem.learnt(&ended.theta, &least)?;
            let none =
                learnt.sigmas.iter().zip(&least).all(|(own, least)| own.variances() == least);
            // What the high band shows of coloured noise is no guide to the band of the fit.
            let agrees = learnt.contradiction <= FAR && !self.o.coloured;
            if round == 0 && (agrees || none) {
                problem.set_sigmas(seen);
                break;
            }
            if learnt.change < SETTLED {
                break;
            }
            let before = problem.sigmas.clone();
            problem.set_sigmas(learnt.sigmas);
            let next = self.estimate(problem, Some(&ended.theta))?;
            if !usable(&next) {
                problem.set_sigmas(before);
                break;
            }
            ended = Ended { nit: ended.nit + next.nit, ..next };
            unsettled = if ended.status == Status::Ok { 0 } else { unsettled + 1 };
            if unsettled == UNSETTLED {
                break;
            }
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

    /// What the residuals at θ say of the noise.
    fn learnt(&mut self, theta: &[f64], least: &[Vec<f64>]) -> Result<Learnt, Error> {
        let own = self.sigmas.clone();
        let cost = self.cost(theta, RowWeights::Adapted)?;
        let rows: usize = self.spots.iter().map(|s| s.rows.len()).sum();
        let degrees = self.degrees_of_freedom() as f64;
        let (left, scale) = (degrees / rows as f64, cost / degrees);
        let mut found = Learnt { sigmas: Vec::new(), change: 0.0, contradiction: 0.0 };
        for (k, own) in own.iter().enumerate() {
            let shares = self.shares(k, own, theta, left)?;
            let ratios = shares.ratios(own, self.fitter.tells_correlation());
            found.contradiction = found.contradiction.max(shares.contradiction(&ratios, scale));
            found.change = found.change.max(change(&ratios, own.channels()));
            found.sigmas.push(moved(own, &ratios).at_least(&least[k]).kept_definite());
        }
        self.set_sigmas(own);
        Ok(found)
    }

    /// A and B of a record at θ, B times what is `left` of the rows.
    fn shares(
        &mut self,
        record: usize,
        own: &Sigma,
        theta: &[f64],
        left: f64,
    ) -> Result<Shares, Error> {
        let q = own.channels();
        let (cost, log_det) = self.likelihood(record, own, theta)?;
        let (mut squares, mut rows) = (vec![0.0; q * q], vec![0.0; q * q]);
        for a in 0..q {
            let last = if self.fitter.tells_correlation() { q - 1 } else { a };
            for b in a..=last {
                let by = CHANGE * (own.get(a, a) * own.get(b, b)).sqrt();
                let mut near = own.clone();
                near.set(a, b, own.get(a, b) + by);
                let (cost_near, log_det_near) = self.likelihood(record, &near, theta)?;
                // An entry beside the diagonal stands twice in Σ.
                let each = if a == b { by } else { 2.0 * by };
                for at in [a * q + b, b * q + a] {
                    squares[at] = (cost - cost_near) / each;
                    rows[at] = left * (log_det_near - log_det) / each;
                }
            }
        }
        let w = own.root();
        Ok(Shares { squares: around(&squares, &w, q), rows: around(&rows, &w, q) })
    }

    /// Weighted sum of squares of a record at θ and log det of its rows' covariance, under other noise.
    fn likelihood(
        &mut self,
        record: usize,
        sigma: &Sigma,
        theta: &[f64],
    ) -> Result<(f64, f64), Error> {
        let cost = self.cost_of(record, sigma, theta)?;
        Ok((cost, self.spots[record].log_det()))
    }
}

/// What the noise of the channels of a record has of the weighted sum of squares, A, and of the rows, B.
struct Shares {
    squares: Vec<f64>,
    rows: Vec<f64>,
}

impl Shares {
    /// V⁻¹AV⁻ᵀ; A_jj/B_jj alone where correlations are not told, and 1 where no row tells of a channel.
    fn ratios(&self, own: &Sigma, correlated: bool) -> Vec<f64> {
        let q = own.channels();
        let factor = root(&self.rows, q).filter(|v| {
            let told = (0..q).all(|k| v[k * (q + 1)] * v[k * (q + 1)] > FEWEST);
            correlated && told && (0..q).all(|k| self.squares[k * (q + 1)] > 0.0)
        });
        let mut out = vec![0.0; q * q];
        let Some(v) = factor else {
            for k in (0..q).map(|k| k * (q + 1)) {
                let told = self.squares[k] > 0.0 && self.rows[k] > FEWEST;
                let ratio = self.squares[k] / self.rows[k];
                out[k] = if told { ratio.clamp(1.0 / MOST, MOST) } else { 1.0 };
            }
            return out;
        };
        out.copy_from_slice(&self.squares);
        for _ in 0..2 {
            solve(&v, &mut out, q);
            transpose(&mut out, q);
        }
        let within =
            |k: usize| (out[k * (q + 1)].clamp(1.0 / MOST, MOST) / out[k * (q + 1)]).sqrt();
        let by: Vec<f64> = (0..q).map(within).collect();
        (0..q * q).for_each(|k| out[k] *= by[k / q] * by[k % q]);
        out
    }

    /// Standard deviations that the ratios are from one `scale` times unity.
    fn contradiction(&self, ratios: &[f64], scale: f64) -> f64 {
        let q = self.rows.len().isqrt();
        let mut most = 0.0f64;
        for a in 0..q {
            for b in 0..=a {
                let rows = (self.rows[a * (q + 1)] * self.rows[b * (q + 1)]).sqrt();
                let size = (ratios[a * (q + 1)] * ratios[b * (q + 1)]).sqrt();
                let by =
                    if a == b { ln_1(size / scale).abs() } else { ratios[a * q + b].abs() / size };
                let root = if a == b { 0.5 * rows } else { rows };
                if rows > FEWEST {
                    most = most.max(by * root.sqrt());
                }
            }
        }
        most
    }
}

/// By how much such ratios change the noise.
fn change(ratios: &[f64], q: usize) -> f64 {
    let size = |k: usize| ratios[k * (q + 1)];
    let one = |k: usize| match (k / q, k % q) {
        (a, b) if a == b => ln_1(size(a)).abs(),
        (a, b) => ratios[k].abs() / (size(a) * size(b)).sqrt(),
    };
    (0..q * q).map(one).fold(0.0, f64::max)
}

/// W M Wᵀ, Σ = WWᵀ; where M is diagonal, the same correlations at variances times its entries.
fn moved(own: &Sigma, ratios: &[f64]) -> Sigma {
    let q = own.channels();
    if (0..q * q).all(|k| k / q == k % q || ratios[k] == 0.0) {
        let variances: Vec<f64> =
            own.variances().iter().enumerate().map(|(k, v)| v * ratios[k * (q + 1)]).collect();
        return own.with(&variances);
    }
    let mut w = own.root();
    transpose(&mut w, q);
    Sigma::of(q, &around(ratios, &w, q))
}

/// WᵀMW.
fn around(m: &[f64], w: &[f64], q: usize) -> Vec<f64> {
    let one = |i: usize, j: usize| -> f64 {
        (0..q * q).map(|k| w[k / q * q + i] * m[k] * w[k % q * q + j]).sum()
    };
    (0..q * q).map(|k| one(k / q, k % q)).collect()
}

/// V⁻¹M in place, V lower triangular.
fn solve(v: &[f64], m: &mut [f64], q: usize) {
    for column in 0..q {
        for i in 0..q {
            let before: f64 = (0..i).map(|k| v[i * q + k] * m[k * q + column]).sum();
            m[i * q + column] = (m[i * q + column] - before) / v[i * (q + 1)];
        }
    }
}

fn transpose(m: &mut [f64], q: usize) {
    for i in 0..q {
        for j in 0..i {
            m.swap(i * q + j, j * q + i);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_of_which_rows_tell_gets_its_share_of_squares_over_rows() {
        let shares = Shares { squares: vec![8.0, 0.5, 0.5, 3.0], rows: vec![4.0, 0.1, 0.1, 0.5] };
        let ratios = shares.ratios(&Sigma::independent(vec![1.0, 2.0]), false);
        assert_eq!(ratios, [2.0, 0.0, 0.0, 1.0]);
    }
}
