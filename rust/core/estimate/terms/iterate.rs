//! Steps to the minimum: Gauss–Newton on whitened rows, the transient projected out, within bounds.
//!
//! With C = LLᵀ, and r̃, J̃ what is left of L⁻¹r and L⁻¹J beside the whitened columns of the transient,
//!
//! ```text
//! θ₊ = θ − (J̃ᵀ J̃)⁻¹ J̃ᵀ r̃.
//! ```
//!
//! J has the columns ∂Q/∂θ of the data; for `ml` those of denoised signals (`rows`), with which J̃ᵀr̃ is the exact
//! gradient of ½ rᵀC(θ)⁻¹r.

use super::complex::C;
use super::equations::Equations;
use super::lines::Desk;
use super::plan::{TermsFitter, TermsRecord};
use super::rows::{Spot, dot};
use crate::error::{Error, Status};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::linalg::qr::Absorber;
use crate::threads::stopped;

/// Steps before the cost must fall: the first ones may raise it on their way to the right answer.
const FREE_STEPS: u32 = 2;
/// Halvings of a step that does not lower the cost.
const HALVINGS: usize = 10;
/// A cost that rises by no more than this part of itself has not risen.
const LEVEL: f64 = 1e-9;
/// Sine of the angle below which a column depends on the ones before it.
const DEPENDENT: f64 = 1e-9;

/// Records on their lines at one θ, with what a step needs.
pub(crate) struct TermsProblem<'a> {
    pub fitter: &'a TermsFitter,
    records: &'a [TermsRecord<'a>],
    /// Variance of each noisy channel.
    pub variances: Vec<f64>,
    pub spots: Vec<Spot>,
    /// g of each term, then the slopes.
    values: Vec<f64>,
    lags: Vec<f64>,
    registers: Vec<f64>,
    desk: Desk,
    /// Columns of θ and the residual over all records, transients taken out.
    pub columns: Vec<Vec<f64>>,
    pub residual: Vec<f64>,
    loaded: bool,
    /// Noisy channels of each record without their noise, where slopes are taken there.
    clean: Vec<Vec<Vec<f64>>>,
}

/// How an iteration ended.
#[derive(Debug, Clone)]
pub(crate) struct Ended {
    pub theta: Vec<f64>,
    pub cost: f64,
    pub status: Status,
    pub nit: u32,
    pub at_bound: Vec<bool>,
}

/// A step and what it was made of.
pub(crate) struct Step {
    pub by: Vec<f64>,
    /// Its effect on the rows, relative to the largest term.
    pub moved: f64,
    pub at_bound: Vec<bool>,
    pub full: bool,
}

impl<'a> TermsProblem<'a> {
    pub fn new(
        fitter: &'a TermsFitter,
        records: &'a [TermsRecord<'a>],
        variances: Vec<f64>,
        spots: Vec<Spot>,
        desk: Desk,
    ) -> TermsProblem<'a> {
        let e = &fitter.o.equations;
        TermsProblem {
            fitter,
            records,
            variances,
            values: vec![0.0; e.coefficients.results()],
            lags: vec![0.0; e.signals.len()],
            registers: Vec::new(),
            desk,
            columns: vec![Vec::new(); e.parameters],
            residual: Vec::new(),
            loaded: false,
            clean: Vec::new(),
            spots,
        }
    }

    fn equations(&self) -> &'a Equations {
        &self.fitter.o.equations
    }

    /// Gives the worker's memory back.
    pub fn into_desk(self) -> Desk {
        self.desk
    }

    /// Coefficients and, where they depend on it, signals at θ.
    fn set(&mut self, theta: &[f64]) -> Result<(), Error> {
        let e = self.equations();
        e.coefficients.values(theta, &mut self.registers, &mut self.values);
        if self.loaded && !e.moves() {
            return Ok(());
        }
        for (s, lag) in self.lags.iter_mut().enumerate() {
            *lag = e.lag(s, theta);
        }
        let own = self.fitter.records.iter().zip(self.records).zip(&mut self.spots);
        for (k, ((plan, record), spot)) in own.enumerate() {
            plan.load(
                self.fitter.isa,
                e,
                &self.fitter.pairs,
                &record.channels,
                &self.variances,
                theta,
                self.clean.get(k).map_or(&[], Vec::as_slice),
                &mut self.desk,
                &mut spot.spectra,
            )?;
        }
        self.loaded = true;
        Ok(())
    }

    /// Takes the slopes of the signals from now on at the channels that θ's residuals leave, v − v̂.
    ///
    /// Slopes at the noisy samples make some bias where noise is large; one such pass takes it away.
    pub fn relinearise(&mut self, theta: &[f64]) -> Result<(), Error> {
        self.cost(theta, RowWeights::Adapted)?;
        let (e, pairs) = (self.equations(), &self.fitter.pairs);
        let mut clean = Vec::with_capacity(self.spots.len());
        let own = self.fitter.records.iter().zip(self.records).zip(&mut self.spots);
        for ((plan, record), spot) in own {
            let sources = spot.sources(pairs);
            let (channels, first) = (&record.channels, spot.lines.first);
            let from = (sources.as_slice(), first);
            let desk = &mut self.desk;
            clean.push(plan.denoised(e, pairs, channels, &self.variances, theta, from, desk));
        }
        self.clean = clean;
        self.loaded = false;
        Ok(())
    }

    /// Weighted sum of squares at θ, the transient taken out.
    pub fn cost(&mut self, theta: &[f64], weights: RowWeights) -> Result<f64, Error> {
        self.set(theta)?;
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        let g = &self.values[..e.terms.len()];
        let each = self.spots.iter_mut();
        Ok(each.map(|s| s.evaluate(isa, e, pairs, g, &self.lags, weights)).sum())
    }

    /// Columns of θ and the residual where [`TermsProblem::cost`] was last.
    pub fn jacobian(&mut self, factors: LeftColumns) {
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        self.residual.clear();
        for c in &mut self.columns {
            c.clear();
        }
        for spot in &mut self.spots {
            spot.jacobian(isa, e, pairs, &self.values, &self.lags, factors);
            self.residual.extend_from_slice(&spot.residual);
            for (to, from) in self.columns.iter_mut().zip(&spot.columns) {
                let first = to.len();
                to.extend_from_slice(from);
                spot.project(&mut to[first..]);
            }
        }
    }

    /// The least squares step at θ that keeps the bounds.
    pub fn step(&self, theta: &[f64]) -> Step {
        let e = self.equations();
        let p = e.parameters;
        let sizes: Vec<f64> = self.columns.iter().map(|c| dot(c, c).sqrt()).collect();
        let mut at_bound = vec![false; p];
        // At a bound that the gradient pushes against, a parameter stays.
        for (k, (low, high)) in e.bounds.iter().enumerate() {
            let slope = dot(&self.columns[k], &self.residual);
            at_bound[k] = (theta[k] <= *low && slope > 0.0) || (theta[k] >= *high && slope < 0.0);
        }
        let mut by = vec![0.0; p];
        let mut full = true;
        for _ in 0..=p {
            let free: Vec<usize> = (0..p).filter(|k| !at_bound[*k]).collect();
            let mut residual = self.residual.clone();
            for k in (0..p).filter(|k| at_bound[*k] && by[*k] != 0.0) {
                for (r, c) in residual.iter_mut().zip(&self.columns[k]) {
                    *r += by[k] * c;
                }
            }
            let (found, sound) = least_squares(&self.columns, &free, &residual);
            full = sound;
            for (k, value) in free.iter().zip(&found) {
                by[*k] = *value;
            }
            let crossed = free.iter().filter(|k| {
                let to = theta[**k] + by[**k];
                to < e.bounds[**k].0 || to > e.bounds[**k].1
            });
            let crossed: Vec<usize> = crossed.copied().collect();
            if crossed.is_empty() {
                break;
            }
            for k in crossed {
                let (low, high) = e.bounds[k];
                by[k] = (theta[k] + by[k]).max(low).min(high) - theta[k];
                at_bound[k] = true;
            }
        }
        let effect = by.iter().zip(&sizes).map(|(b, s)| b.abs() * s).fold(0.0, largest);
        let terms = theta.iter().zip(&sizes).map(|(t, s)| t.abs() * s).fold(0.0, largest);
        let size = largest(terms, dot(&self.residual, &self.residual).sqrt());
        Step { by, moved: effect / size, at_bound, full }
    }

    /// Iterates from θ: Gauss–Newton for `ml` and flat weights, reweighting for `awls`.
    pub fn iterate(
        &mut self,
        mut theta: Vec<f64>,
        weights: RowWeights,
        factors: LeftColumns,
        tol: f64,
        maxiter: usize,
    ) -> Result<Ended, Error> {
        let e = self.equations();
        e.clip(&mut theta);
        // Reweighted data have no cost that must fall.
        let guarded = weights == RowWeights::Flat || factors == LeftColumns::Denoised;
        let mut cost = self.cost(&theta, weights)?;
        let mut ended = Status::MaxIter;
        let (mut nit, mut at_bound) = (0, vec![false; theta.len()]);
        while (nit as usize) < maxiter && !stopped() {
            if !cost.is_finite() {
                ended = Status::NonFinite;
                break;
            }
            self.jacobian(factors);
            let step = self.step(&theta);
            at_bound = step.at_bound;
            if !step.full || !step.moved.is_finite() {
                // Where the cost was finite, only dependent columns make a step that is not.
                ended = Status::Rank;
                break;
            }
            nit += 1;
            let mut size = 1.0;
            let mut next = theta.clone();
            let mut reached = f64::NAN;
            for _ in 0..=HALVINGS {
                for ((to, from), by) in next.iter_mut().zip(&theta).zip(&step.by) {
                    *to = from + size * by;
                }
                e.clip(&mut next);
                reached = self.cost(&next, weights)?;
                let fell = reached <= cost * (1.0 + LEVEL) + f64::MIN_POSITIVE;
                let early = nit <= FREE_STEPS || !guarded;
                if reached.is_finite() && (fell || early) {
                    break;
                }
                size *= 0.5;
            }
            let fell = reached <= cost * (1.0 + LEVEL) + f64::MIN_POSITIVE;
            if guarded && nit > FREE_STEPS && !fell {
                // No shorter step helps: here is the minimum, as far as numbers can tell.
                cost = self.cost(&theta, weights)?;
                ended = if step.moved < tol.sqrt() { Status::Ok } else { Status::MaxIter };
                break;
            }
            theta = next;
            cost = reached;
            if step.moved * size < tol {
                ended = Status::Ok;
                break;
            }
        }
        Ok(Ended { theta, cost, status: ended, nit, at_bound })
    }

    /// Mean square of what each equation holds without parameters, over the lines.
    pub fn target_power(&self) -> Vec<f64> {
        let e = self.equations();
        let fixed = |t: usize| !e.slopes.iter().any(|(own, _)| *own == t);
        let mut power = vec![0.0; e.orders.len()];
        let mut count = 0;
        for spot in &self.spots {
            let lines = spot.lines;
            count += lines.count();
            for (equation, power) in power.iter_mut().enumerate() {
                for line in 0..lines.count() {
                    let mut sum = C::default();
                    for (t, term) in e.terms.iter().enumerate() {
                        if term.equation == equation && fixed(t) {
                            let v = spot.spectra.signals[term.signal][line + lines.first];
                            sum += spot.power(term.order)[line] * v * self.values[t];
                        }
                    }
                    *power += sum.0 * sum.0 + sum.1 * sum.1;
                }
            }
        }
        power.iter().map(|p| p / count as f64).collect()
    }
}

/// The larger; NaN where either is.
fn largest(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Minimiser of |r + Σ x_k c_k| over the columns named, and whether these are independent.
fn least_squares(columns: &[Vec<f64>], free: &[usize], residual: &[f64]) -> (Vec<f64>, bool) {
    let n = free.len();
    let mut a = factored(columns, free, Some(residual));
    a.absorb();
    let mut x = vec![0.0; n];
    let mut full = true;
    for k in (0..n).rev() {
        let size = (0..=k).map(|i| a.r(i, k) * a.r(i, k)).sum::<f64>().sqrt();
        let pivot = a.r(k, k);
        full &= pivot.abs() > DEPENDENT * size;
        let sum = (k + 1..n).fold(-a.qt(k, n), |s, j| s - a.r(k, j) * x[j]);
        x[k] = sum / pivot;
    }
    (x, full)
}

/// Orthogonal factors of the columns named, beside them the residual.
pub(crate) fn factored(columns: &[Vec<f64>], free: &[usize], residual: Option<&[f64]>) -> Absorber {
    let n = free.len();
    let rows = columns.first().map_or(0, Vec::len);
    let mut a = Absorber::new(n, rows.max(1));
    for i in 0..rows {
        let right = residual.map_or(0.0, |r| r[i]);
        let own = free.iter().map(|k| columns[*k][i]);
        a.push(own.clone(), own.chain([right]));
    }
    a
}
