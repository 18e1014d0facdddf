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

use super::complex::Split;
use super::descent::{Descent, Ended, Need, Step};
use super::equations::Equations;
use super::lines::{LinesWorkspace, Part, Parts, Place};
use super::plan::{TermsFitter, TermsRecord};
use super::rows::{Eight, Shared, Spot, TermsWorkspace};
use super::sigma::Sigma;
use crate::error::Error;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::prior;
use crate::linalg::columns::Columns;
use crate::linalg::qr::dot;

/// Sine of the angle below which a column depends on the ones before it.
const DEPENDENT: f64 = 1e-9;

/// Records on their lines at one θ, with what a step needs.
pub(crate) struct TermsProblem<'a> {
    pub fitter: &'a TermsFitter,
    pub records: &'a [TermsRecord<'a>],
    /// Covariance of the noisy channels of each record.
    pub sigmas: Vec<Sigma>,
    pub spots: Vec<Spot>,
    /// g of each term, then the slopes.
    values: Vec<f64>,
    lags: Vec<f64>,
    registers: Vec<f64>,
    space: LinesWorkspace,
    /// Columns of θ and the residual over all records, transients taken out.
    pub columns: Vec<Vec<f64>>,
    pub residual: Vec<f64>,
    /// Where the last cost was taken, and what it was.
    stands: Option<(RowWeights, f64)>,
    theta: Vec<f64>,
    loaded: Loaded,
    /// Noisy channels of each record without their noise, where slopes are taken there.
    clean: Vec<Vec<Vec<f64>>>,
    /// The step from there.
    step: Step,
    factor: Columns,
}

/// What of the spectra is made of the samples, and the noise, that count now.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Loaded {
    signals: bool,
    pairs: bool,
}

impl Loaded {
    /// What is to be made for rows of such weights: flat ones need no covariance, but what stays the same at every θ
    /// is made with the signals, of the same formulas.
    fn missing(self, moves: bool, weights: RowWeights) -> Parts {
        let part = |loaded: bool| match (loaded, moves) {
            (false, _) => Part::All,
            (true, true) => Part::Moving,
            (true, false) => Part::Nothing,
        };
        let pairs = match weights {
            RowWeights::Flat if moves || self.signals => Part::Nothing,
            _ => part(self.pairs),
        };
        Parts { signals: part(self.signals), pairs }
    }
}

impl<'a> TermsProblem<'a> {
    pub fn new(
        fitter: &'a TermsFitter,
        records: &'a [TermsRecord<'a>],
        sigmas: Vec<Sigma>,
        spots: Vec<Spot>,
        space: LinesWorkspace,
    ) -> TermsProblem<'a> {
        let e = &fitter.o.equations;
        TermsProblem {
            fitter,
            records,
            sigmas,
            values: vec![0.0; e.coefficients.results()],
            lags: vec![0.0; e.signals.len()],
            registers: Vec::new(),
            space,
            columns: vec![Vec::new(); e.parameters],
            residual: Vec::new(),
            stands: None,
            theta: Vec::new(),
            loaded: Loaded::default(),
            clean: Vec::new(),
            step: Step::default(),
            factor: Columns::new(fitter.isa, 0, 0),
            spots,
        }
    }

    /// Degrees of freedom: rows less transients and parameters.
    pub fn degrees_of_freedom(&self) -> usize {
        let rows: usize = self.spots.iter().map(|s| s.rows.len()).sum();
        let spent: usize = self.spots.iter().map(|s| s.transients).sum();
        rows.saturating_sub(spent + self.equations().parameters).max(1)
    }

    /// Other noise from now on.
    pub fn set_sigmas(&mut self, sigmas: Vec<Sigma>) {
        self.sigmas = sigmas;
        self.loaded = Loaded::default();
        self.stands = None;
    }

    /// The step that was found last.
    pub fn last_step(&self) -> &Step {
        &self.step
    }

    /// Puts other rows in the place of those that stand.
    pub fn replace(&mut self, spots: impl Iterator<Item = Spot>) {
        for (own, mut spot) in self.spots.iter_mut().zip(spots) {
            spot.spectra = std::mem::take(&mut own.spectra);
            *own = spot;
        }
        self.stands = None;
    }

    /// What it has in common with others of its kind.
    pub fn shared(&self) -> Shared<'_> {
        let (equations, pairs) = (self.equations(), &self.fitter.pairs);
        Shared { equations, pairs, spot: &self.spots[0], lags: &self.lags }
    }

    /// g of each term and slopes where [`TermsProblem::set`] was last.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    fn equations(&self) -> &'a Equations {
        &self.fitter.o.equations
    }

    /// Gives the worker's memory back.
    pub fn into_worker(self) -> TermsWorkspace {
        TermsWorkspace { space: self.space, spots: self.spots }
    }

    /// Coefficients and, where they depend on it, signals at θ, with what rows of such weights take of these.
    pub fn set(&mut self, theta: &[f64], weights: RowWeights) -> Result<(), Error> {
        let e = self.equations();
        e.coefficients.values(theta, &mut self.registers, &mut self.values);
        let parts = self.loaded.missing(e.moves(), weights);
        if parts == (Parts { signals: Part::Nothing, pairs: Part::Nothing }) {
            return Ok(());
        }
        for (s, lag) in self.lags.iter_mut().enumerate() {
            *lag = e.lag(s, theta);
        }
        let own = self.fitter.records.iter().zip(self.records).zip(&mut self.spots);
        for (k, ((plan, record), spot)) in own.enumerate() {
            let at = Place {
                channels: &record.channels,
                sigma: &self.sigmas[k],
                theta,
                clean: self.clean.get(k).map_or(&[], Vec::as_slice),
            };
            let (isa, pairs, space) = (self.fitter.isa, &self.fitter.pairs, &mut self.space);
            plan.load(isa, e, pairs, &at, parts, space, &mut spot.spectra)?;
        }
        self.loaded.signals = true;
        self.loaded.pairs |= parts.pairs != Part::Nothing;
        Ok(())
    }

    /// Takes the slopes of the signals from now on at the channels that θ's residuals leave, v − v̂.
    ///
    /// Slopes at the noisy samples make some bias where noise is large; one such pass takes it away.
    pub fn relinearise(&mut self, theta: &[f64]) -> Result<(), Error> {
        self.cost(theta, RowWeights::Adapted)?;
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        let mut clean = Vec::with_capacity(self.spots.len());
        let own = self.fitter.records.iter().zip(self.records).zip(&mut self.spots);
        for (((plan, record), spot), sigma) in own.zip(&self.sigmas) {
            spot.find_sources(isa, pairs);
            let at = Place { channels: &record.channels, sigma, theta, clean: &[] };
            let lines = (spot.lines.count(), spot.lines.first);
            let (sources, space) = (&spot.sources, &mut self.space);
            clean.push(plan.denoised(isa, e, pairs, &at, sources, lines, space));
        }
        self.clean = clean;
        self.loaded.pairs = false; // their slopes are taken elsewhere
        self.stands = None;
        Ok(())
    }

    /// Takes the signals of one of eight records: what else is made of its samples stays there.
    pub fn take_signals(&mut self, eight: &Eight, lane: usize) {
        let e = self.equations();
        for (s, lag) in self.lags.iter_mut().enumerate() {
            *lag = e.lag(s, &[]);
        }
        eight.give_signals(lane, &mut self.spots[0]);
        self.loaded = Loaded { signals: true, pairs: false };
    }

    /// What was taken last as its cost is none any more.
    pub fn forget_cost(&mut self) {
        self.stands = None;
    }

    /// Weighted sum of squares at θ, the transient taken out.
    pub fn cost(&mut self, theta: &[f64], weights: RowWeights) -> Result<f64, Error> {
        match self.stands {
            Some((own, cost)) if own == weights && self.theta == theta => return Ok(cost),
            _ => self.stands = None,
        }
        self.set(theta, weights)?;
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        let g = &self.values[..e.terms.len()];
        let each = self.spots.iter_mut();
        let cost = each.map(|s| s.evaluate(isa, e, pairs, g, &self.lags, weights)).sum();
        self.stand(theta, weights, cost);
        Ok(cost)
    }

    /// Notes what the cost at θ is, of rows that stand here or elsewhere.
    pub fn stand(&mut self, theta: &[f64], weights: RowWeights, cost: f64) {
        self.theta.clear();
        self.theta.extend_from_slice(theta);
        self.stands = Some((weights, cost));
    }

    /// Where the cost was taken last.
    pub fn stands_at(&self, theta: &[f64]) -> bool {
        self.stands.is_some() && self.theta == theta
    }

    /// The same with what priors add: where it is least the estimate is.
    fn criterion(&mut self, theta: &[f64], weights: RowWeights) -> Result<f64, Error> {
        let cost = self.cost(theta, weights)?;
        Ok(self.with_priors(theta, cost))
    }

    /// The criterion at θ, of the cost there.
    pub fn with_priors(&self, theta: &[f64], cost: f64) -> f64 {
        let far = prior::distance(&self.fitter.o.priors, |k| theta[k]);
        cost * prior::factor(far, self.degrees_of_freedom() as f64)
    }

    /// That of one record at the θ of the last cost under other noise; what stands is then to be made anew.
    pub fn cost_of(&mut self, record: usize, sigma: &Sigma, theta: &[f64]) -> Result<f64, Error> {
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        let at = Place {
            channels: &self.records[record].channels,
            sigma,
            theta,
            clean: self.clean.get(record).map_or(&[], Vec::as_slice),
        };
        let (plan, spot) = (&self.fitter.records[record], &mut self.spots[record]);
        plan.load(isa, e, pairs, &at, Parts::ALL, &mut self.space, &mut spot.spectra)?;
        let g = &self.values[..e.terms.len()];
        Ok(spot.evaluate(isa, e, pairs, g, &self.lags, RowWeights::Adapted))
    }

    /// How far noise bends the signals at θ (`lines/bend.rs`).
    pub fn bend(&mut self, theta: &[f64]) -> f64 {
        let e = self.equations();
        let own = self.fitter.records.iter().zip(self.records).zip(&self.sigmas);
        let bend = own.map(|((plan, record), sigma)| {
            let at = Place { channels: &record.channels, sigma, theta, clean: &[] };
            plan.bend(e, &at, &mut self.space)
        });
        bend.fold(0.0, f64::max)
    }

    /// Columns of θ and the residual where [`TermsProblem::cost`] was last; rows of priors are the last.
    pub fn jacobian(&mut self, factors: LeftColumns) {
        let (isa, e, pairs) = (self.fitter.isa, self.equations(), &self.fitter.pairs);
        self.residual.clear();
        for c in &mut self.columns {
            c.clear();
        }
        for spot in &mut self.spots {
            spot.jacobian(isa, e, pairs, &self.values, &self.lags, factors);
            self.residual.extend_from_slice(&spot.residual);
            for (k, to) in self.columns.iter_mut().enumerate() {
                let first = to.len();
                to.extend_from_slice(&spot.columns[k]);
                spot.take_transient(&mut to[first..]);
            }
        }
        self.add_priors();
    }

    /// Takes columns of θ and residual of one of eight records.
    pub fn take_jacobian(&mut self, eight: &Eight, lane: usize) {
        self.residual.clear();
        self.residual.extend(eight.residual(lane));
        for (to, from) in self.columns.iter_mut().zip(eight.columns(lane)) {
            to.clear();
            to.extend(from);
        }
        self.add_priors();
    }

    fn add_priors(&mut self) {
        let scale = self.stands.map_or(0.0, |(_, cost)| cost) / self.degrees_of_freedom() as f64;
        for p in &self.fitter.o.priors {
            let by = p.entry(scale);
            self.residual.push(by * (self.theta[p.parameter] - p.mean));
            for (k, column) in self.columns.iter_mut().enumerate() {
                column.push(if k == p.parameter { by } else { 0.0 });
            }
        }
    }

    /// The least squares step at θ that keeps the bounds.
    pub fn step(&mut self, theta: &[f64]) -> &Step {
        let e = self.equations();
        let p = e.parameters;
        if self.factor.rows() < self.residual.len() {
            let rows = self.residual.len();
            self.factor = Columns::new(self.fitter.isa, rows, p).judged_by(DEPENDENT);
        }
        let Step { by, moved, at_bound, full, free, found, residual } = &mut self.step;
        by.clear();
        by.resize(p, 0.0);
        at_bound.clear();
        // At a bound that the gradient pushes against, a parameter stays.
        at_bound.extend(e.bounds.iter().enumerate().map(|(k, (low, high))| {
            let (low, high) = (theta[k] <= *low, theta[k] >= *high);
            let slope = if low || high { dot(&self.columns[k], &self.residual) } else { 0.0 };
            (low && slope > 0.0) || (high && slope < 0.0)
        }));
        for _ in 0..=p {
            free.clear();
            free.extend((0..p).filter(|k| !at_bound[*k]));
            residual.clear();
            residual.extend_from_slice(&self.residual);
            residual.resize(self.factor.rows(), 0.0);
            for k in (0..p).filter(|k| at_bound[*k] && by[*k] != 0.0) {
                for (r, c) in residual.iter_mut().zip(&self.columns[k]) {
                    *r += by[k] * c;
                }
            }
            self.factor.truncate(0);
            *full = free.iter().fold(true, |all, k| self.factor.push_rows(&self.columns[*k]) & all);
            found.clear();
            found.resize(free.len(), 0.0);
            self.factor.project(0, residual, found);
            self.factor.back(0, found);
            for (k, value) in free.iter().zip(&*found) {
                by[*k] = -value;
            }
            let mut crossed = false;
            for &k in &*free {
                let (low, high) = e.bounds[k];
                let to = theta[k] + by[k];
                if to < low || to > high {
                    by[k] = to.max(low).min(high) - theta[k];
                    at_bound[k] = true;
                    crossed = true;
                }
            }
            if !crossed {
                break;
            }
        }
        let (mut effect, mut terms) = (0.0, 0.0);
        for ((c, by), theta) in self.columns.iter().zip(&*by).zip(theta) {
            let size = dot(c, c).sqrt();
            effect = largest(effect, by.abs() * size);
            terms = largest(terms, theta.abs() * size);
        }
        let size = largest(terms, dot(&self.residual, &self.residual).sqrt());
        *moved = effect / size;
        &self.step
    }

    /// Iterates from θ: Gauss–Newton for `ml` and flat weights, reweighting for `awls`.
    pub fn iterate(
        &mut self,
        theta: Vec<f64>,
        weights: RowWeights,
        factors: LeftColumns,
        tol: f64,
        maxiter: usize,
    ) -> Result<Ended, Error> {
        self.iterate_while(theta, (weights, factors), tol, maxiter, |_| true)
    }

    /// The same, which ends before a step where there is no more to be found.
    pub(super) fn iterate_while(
        &mut self,
        theta: Vec<f64>,
        (weights, factors): (RowWeights, LeftColumns),
        tol: f64,
        maxiter: usize,
        goes_on: impl Fn(&Descent<'_>) -> bool,
    ) -> Result<Ended, Error> {
        let mut way = Descent::new(self.equations(), theta, (weights, factors), tol, maxiter);
        let mut need = Need::Cost;
        loop {
            need = match need {
                Need::Cost => way.reached(self.criterion(way.point(), weights)?),
                Need::Step if !goes_on(&way) => Need::Nothing,
                Need::Step => {
                    self.jacobian(factors);
                    way.stepped(self.step(way.point()))
                }
                Need::Nothing => return Ok(way.ended()),
            };
        }
    }

    /// Mean square of what each equation holds without parameters, over the lines.
    pub fn target_power(&self) -> Vec<f64> {
        let e = self.equations();
        let fixed = |t: usize| !e.slopes.iter().any(|(own, _)| *own == t);
        let mut power = vec![0.0; e.orders.len()];
        let (mut count, mut sum) = (0, Split::default());
        for spot in &self.spots {
            let lines = spot.lines;
            count += lines.count();
            for (equation, power) in power.iter_mut().enumerate() {
                sum.clear(lines.count());
                for (t, term) in e.terms.iter().enumerate() {
                    if term.equation == equation && fixed(t) {
                        spot.add(term.signal, term.order, self.values[t], &mut sum);
                    }
                }
                *power += dot(&sum.re, &sum.re) + dot(&sum.im, &sum.im);
            }
        }
        power.iter().map(|p| p / count as f64).collect()
    }
}

/// The larger; NaN where either is.
fn largest(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}
