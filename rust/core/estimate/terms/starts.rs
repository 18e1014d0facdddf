//! Where to begin: one linear step where that is exact, else the best of many starts, by the weights that will count.

use std::cmp::Ordering;

use super::descent::{Descent, Ended, lower, usable};
use super::equations::Equations;
use super::iterate::TermsProblem;

use crate::error::{Error, Status};
use crate::estimate::band::SAME;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};

/// Starts that are tried where coefficients or signals are not linear in θ.
const TRIALS: usize = 24;
/// Steps of each.
const STEPS: usize = 20;
/// Decades that the starts of an unbounded parameter reach to either side of 1.
const DECADES: f64 = 2.0;
/// What noise may bend the signals by: beyond, a low cost says nothing.
const BENT: f64 = 0.5;
/// Least part of its bounds that a start takes of what is not negative.
const SMALLEST: f64 = 1e-3;
/// A start that stalls at so many times the lowest cost is left.
const HIGH: f64 = 2.0;
/// Relative difference of costs, and of parameters but for their signs, within which one that stalls is next to an end.
const BESIDE: f64 = 0.01;
/// Relative precision of a start.
const TOLERANCE: f64 = 1e-6;
/// So many ends are followed under the weights that will count, so many steps far.
const LOWEST: usize = 3;
const LOOKED: usize = 8;

impl TermsProblem<'_> {
    fn is_bent(&mut self, theta: &[f64]) -> bool {
        self.bend(theta) > BENT
    }

    /// The lower of two ends; one where noise bends the signals only where it does at both.
    pub fn better(&mut self, first: Ended, second: Ended) -> Ended {
        match [&first, &second].map(|one| usable(one) && !self.is_bent(&one.theta)) {
            [true, false] => first,
            [false, true] => second,
            _ => lower(first, second),
        }
    }

    /// Least squares of the unweighted rows, where these are linear in θ.
    pub fn flat(&mut self) -> Result<Ended, Error> {
        let from = self.begin(None)?;
        self.iterate(from, RowWeights::Flat, LeftColumns::Data, TOLERANCE, STEPS)
    }

    /// θ that minimises the unweighted rows; with nonlinear coefficients the best of many minima.
    pub fn begin(&mut self, from: Option<&[f64]>) -> Result<Vec<f64>, Error> {
        let e = &self.fitter.o.equations;
        if e.linear {
            let zero = vec![0.0; e.parameters];
            return Ok(self
                .iterate(zero, RowWeights::Flat, LeftColumns::Data, TOLERANCE, 1)?
                .theta);
        }
        if let Some(theta) = e.near() {
            return Ok(theta);
        }
        // (unweighted cost, θ) of each end that is none of those before.
        let mut ends: Vec<(f64, Vec<f64>)> = Vec::new();
        let trials = (0..TRIALS).map(|k| start(e, k));
        for theta in from.map(<[f64]>::to_vec).into_iter().chain(trials) {
            let flat = (RowWeights::Flat, LeftColumns::Data);
            let goes_on = |way: &Descent<'_>| !is_known(&ends, way);
            let ended = self.iterate_while(theta, flat, TOLERANCE, STEPS, goes_on)?;
            let settled = ended.status == Status::Ok;
            let same = |own: &(f64, Vec<f64>)| {
                (ended.cost - own.0).abs() <= SAME * own.0
                    || (!settled && is_beside(own, ended.cost, &ended.theta))
            };
            if ended.cost.is_finite() && !ends.iter().any(same) {
                ends.push((ended.cost, ended.theta));
            }
        }
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.judged(ends)
    }

    /// Of the start that was given and the ends of unweighted ones, that which leads lowest under the weights
    /// that will count.
    ///
    /// Unweighted rows under noise like a lag next to nothing, at which x(t) and x(t − h) are one signal, and
    /// parameters without bounds that run away.
    fn judged(&mut self, ends: Vec<(f64, Vec<f64>)>) -> Result<Vec<f64>, Error> {
        let first = ends.first().map(|(_, theta)| theta.clone());
        let (weights, factors) = self.fitter.weights();
        let e = &self.fitter.o.equations;
        let given = e.starts.iter().any(Option::is_some).then(|| start(e, 0));
        // Where noise bends the signals, a low cost says nothing: such ends come last.
        let mut found = Vec::with_capacity(ends.len() + 1);
        for theta in ends.into_iter().map(|(_, theta)| theta).chain(given) {
            found.push(((self.is_bent(&theta), self.cost(&theta, weights)?), theta));
        }
        found.sort_by(|a, b| worse(&a.0, &b.0));
        found.truncate(LOWEST);
        let mut best: Option<((bool, f64), Vec<f64>)> = None;
        let lowest = found.into_iter().map(|(_, theta)| theta);
        let others: Vec<Vec<f64>> = lowest.filter(|own| Some(own) != first.as_ref()).collect();
        for theta in first.into_iter().chain(others) {
            let ended = self.iterate(theta, weights, factors, TOLERANCE, LOOKED)?;
            let reached = (self.is_bent(&ended.theta), ended.cost);
            let better = best.as_ref().is_none_or(|(own, _)| worse(&reached, own).is_lt());
            if ended.cost.is_finite() && better {
                best = Some((reached, ended.theta));
            }
        }
        Ok(best.map_or_else(|| start(&self.fitter.o.equations, 0), |(_, theta)| theta))
    }
}

/// Whether a way stalls far above the lowest end, or next to one: of 24 starts a dozen lead to the same few ends.
fn is_known(ends: &[(f64, Vec<f64>)], way: &Descent<'_>) -> bool {
    let Some(cost) = way.stalled() else { return false };
    ends.iter().any(|own| cost > HIGH * own.0 || is_beside(own, cost, way.point()))
}

/// Whether a cost and parameters, but for their signs, are next to those of an end, and no lower.
fn is_beside((own, theta): &(f64, Vec<f64>), cost: f64, at: &[f64]) -> bool {
    let near = |(a, b): (&f64, &f64)| (a.abs() - b.abs()).abs() <= BESIDE * b.abs();
    (own * (1.0 - SAME)..=own * (1.0 + BESIDE)).contains(&cost) && at.iter().zip(theta).all(near)
}

/// Whether noise bends the signals, then the cost.
fn worse(a: &(bool, f64), b: &(bool, f64)) -> Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
}

/// The `k`-th start: the given one, then points of a sequence that fills the bounds evenly.
fn start(e: &Equations, k: usize) -> Vec<f64> {
    let each = e.starts.iter().zip(&e.bounds).enumerate();
    each.map(|(at, (given, (low, high)))| {
        let place = fraction(k, at);
        let wide = |place: f64| {
            let size = libm::exp((2.0 * place - 1.0) * DECADES * std::f64::consts::LN_10);
            if (k / 2 + at * k).is_multiple_of(3) { -size } else { size }
        };
        match (*given, low.is_finite(), high.is_finite()) {
            (Some(value), ..) if k == 0 => value,
            (Some(value), false, false) if value != 0.0 => value * wide(place).abs(),
            // Inside a function what is not negative may be far smaller than its bound: every other start goes by
            // its size.
            (_, true, true) if *low >= 0.0 && e.is_inside(at) => {
                let place = fraction(k / 2, at);
                let part = if k.is_multiple_of(2) { place } else { libm::pow(SMALLEST, place) };
                low + (high - low) * part
            }
            (_, true, true) => low + (high - low) * place,
            (_, true, false) => low + wide(place).abs(),
            (_, false, true) => high - wide(place).abs(),
            _ if k == 0 => 1.0,
            _ => wide(place),
        }
    })
    .collect()
}

/// Van der Corput's sequence in the base of the parameter's place among the primes; a half at first.
fn fraction(k: usize, at: usize) -> f64 {
    const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
    let base = PRIMES[at % PRIMES.len()];
    if k == 0 {
        return 0.5;
    }
    let (mut left, mut digit, mut sum) = (k, 1.0, 0.0);
    while left > 0 {
        digit /= base as f64;
        sum += digit * (left % base) as f64;
        left /= base;
    }
    sum
}
