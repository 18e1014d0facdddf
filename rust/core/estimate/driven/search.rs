//! Steps to the estimate: scoring, halved until the criterion falls, lengthened where steps lie along each other.
//!
//! A step is least squares on the whitened rows and on rows for their variances,
//!
//! ```text
//! J̃_m a + r̃_m,    √((k−ℓ)/2) (M a + 1 − r̃ r̃ᴴ/(k−ℓ)),    M = L⁻¹A ∂P AᴴL⁻ᴴ,
//! ```
//!
//! and on those of priors, halved until Σ (k−ℓ) log det P + |r̃|² at the ℓ that stands has fallen. Levels end at 0 where the equations ask for less.

use super::small::{square, whiten};
use super::{Driven, Found, Linear};
use crate::math::ln_1;

/// Square of a step in standard errors that ends the iteration, over the tolerance of a relative change.
const CLOSE: f64 = 1e-3;
/// The same where the criterion falls no further: three hundredths of a standard error.
const NEAR: f64 = 1e-3;
/// Halvings of a step before the search ends.
const HALVINGS: usize = 14;
/// Cosine of steps that lie along each other, and the most that one is multiplied by.
const ALONG: f64 = 0.9;
const LONGEST: f64 = 4.0;
/// Growth of a level that no noise explains.
const ENDLESS: f64 = 1e9;
/// Rise of the criterion that rounding explains.
const ROUNDING: f64 = 1e-12;

/// How a search ended.
pub(crate) struct Sought {
    pub steps: usize,
    pub settled: bool,
}

impl Driven {
    /// Seeks the estimate from the parameters that `found` holds; `first`: relative variances of the samples to begin
    /// with.
    pub fn seek(
        &mut self,
        model: &mut impl Linear,
        found: &mut Found,
        first: &[f64],
        (tol, most): (f64, usize),
    ) -> Sought {
        let (theta, levels) = (&mut found.theta, &mut found.levels);
        levels.resize(self.outputs + self.noises, 0.0);
        self.lines.iter_mut().for_each(|own| own.least = 0.0);
        self.first_levels(model, theta, levels, first);
        let begun: Vec<f64> = levels.clone();
        let mut sought = self.search(model, theta, levels, tol, most);
        // Where the rows say nothing of an equation's own terms its scale has no end.
        sought.settled &= levels.iter().zip(&begun).all(|(now, then)| *now <= ENDLESS * then);
        found.residual.clear();
        found.residual.extend_from_slice(&self.residual);
        found.cov.clear();
        found.shares.clear();
        sought
    }

    fn search(
        &mut self,
        model: &mut impl Linear,
        theta: &mut [f64],
        levels: &mut [f64],
        tol: f64,
        most: usize,
    ) -> Sought {
        let (mut steps, mut taken) = (0, 0.0);
        self.evaluate(model, theta, levels);
        while steps < most {
            self.linearise(model, theta, levels);
            let length = self.solve();
            if !length.is_finite() {
                break;
            }
            steps += 1;
            let whole = self.relaxation(taken);
            self.last.copy_from_slice(&self.step);
            let Some(part) = self.advance(model, theta, levels, whole) else {
                // Where noise is rounding, so is the criterion; and it does not know of leverages, nor of how the ends of a
                // filter enter.
                return Sought { steps, settled: length <= NEAR };
            };
            taken = part;
            if part * part * length <= CLOSE * tol {
                return Sought { steps, settled: true };
            }
        }
        Sought { steps, settled: false }
    }

    /// The step from the point that was linearised; the square of its length in standard errors.
    fn solve(&mut self) -> f64 {
        let (all, size) = (self.residual.len(), self.outputs * self.outputs);
        self.rows.fill(0.0);
        let (mean, rest) = self.rows.split_at_mut(all);
        let (variance, beneath) = rest.split_at_mut(rest.len() - self.known.rows());
        beneath.iter_mut().zip(&self.known.surprises).for_each(|(to, z)| *to = *z);
        mean.copy_from_slice(&self.residual);
        let each = variance.chunks_mut(size).zip(self.over.chunks(size)).zip(&self.lines);
        for ((to, over), own) in each {
            let by = 1.0 / (2.0 * own.left).sqrt();
            to.iter_mut().zip(over).for_each(|(to, over)| *to = by * over);
        }
        self.scoring.project(0, &mut self.rows, &mut self.step);
        let length = self.step.iter().map(|b| b * b).sum();
        self.scoring.back(0, &mut self.step);
        self.step.iter_mut().for_each(|s| *s = -*s);
        length
    }

    /// What to multiply the step by: where it lies along the last one, of which the part `taken` was, the equations are
    /// as good as linear on that line, and both steps say where they vanish. Expected information stands for the
    /// slopes of the equations, and is too large or too small where noise is other than assumed.
    fn relaxation(&self, taken: f64) -> f64 {
        let unknowns = self.step.len();
        let whitened = |step: &[f64], i: usize| -> f64 {
            (i..unknowns).map(|j| self.scoring.r(i, j) * step[j]).sum()
        };
        let (mut own, mut other, mut both) = (0.0, 0.0, 0.0);
        for i in 0..unknowns {
            let (now, last) = (whitened(&self.step, i), whitened(&self.last, i));
            (own, other, both) = (own + now * now, other + last * last, both + now * last);
        }
        if taken == 0.0 || both * both < ALONG * ALONG * own * other {
            return 1.0;
        }
        let slope = (1.0 - both / other) / taken;
        if slope > 1.0 / LONGEST { 1.0 / slope } else { LONGEST }
    }

    /// Takes the step times `whole`, or as much of that as lowers the criterion: which part. None where no part does.
    fn advance(
        &mut self,
        model: &mut impl Linear,
        theta: &mut [f64],
        levels: &mut [f64],
        whole: f64,
    ) -> Option<f64> {
        let before = self.criterion();
        let (p, mut part) = (theta.len(), whole);
        let (from, own) = (theta.to_vec(), levels.to_vec());
        for _ in 0..=HALVINGS {
            for (k, (to, from)) in theta.iter_mut().zip(&from).enumerate() {
                let (low, high) = model.bounds(k);
                *to = (from + part * self.step[k]).max(low).min(high);
            }
            for ((to, own), step) in levels.iter_mut().zip(&own).zip(&self.step[p..]) {
                *to = (own + part * step).max(0.0);
            }
            if self.evaluate(model, theta, levels) <= before + ROUNDING * before.abs() {
                return Some(part);
            }
            part *= 0.5;
        }
        theta.copy_from_slice(&from);
        levels.copy_from_slice(&own);
        self.evaluate(model, theta, levels);
        None
    }

    /// The criterion of the point that was evaluated, at the leverages that stand.
    fn criterion(&self) -> f64 {
        let lines = self.lines.iter().map(|own| own.left * own.log_p + own.misfit);
        lines.sum::<f64>() + self.known.distance()
    }

    /// Levels to start from: what the residuals show with noise of the samples alone, and noises that on the middle of the
    /// lines are as strong as that; or noise of the equations alone.
    fn first_levels(
        &mut self,
        model: &mut impl Linear,
        theta: &[f64],
        levels: &mut [f64],
        first: &[f64],
    ) {
        let q = self.outputs;
        levels.fill(0.0);
        let rows: f64 = self.lines.iter().map(|own| own.count).sum();
        let spent = model.transients() * model.records() + self.parameters;
        let degrees = q as f64 * rows - spent as f64;
        if !model.measured() {
            levels[q..].fill(1.0);
            self.evaluate(model, theta, levels);
            for (e, level) in levels[q..].iter_mut().enumerate() {
                let each = self.blocks.iter().map(|block| {
                    let part = 2 * e * block.sampled.lines;
                    let rows = &self.residual[block.row + part..][..2 * block.sampled.lines];
                    rows.iter().map(|r| r * r).sum::<f64>()
                });
                *level = each.sum::<f64>() * q as f64 / degrees;
            }
            return;
        }
        levels[..q].copy_from_slice(first);
        self.evaluate(model, theta, levels);
        let misfit: f64 = self.lines.iter().map(|own| own.misfit).sum();
        let (noises, size) = (self.noises, q * q);
        for l in 0..noises {
            let (mut sum, mut count) = (0.0, 0.0);
            for (k, block) in self.blocks.iter().enumerate() {
                for i in 0..block.sampled.lines {
                    let x = &mut self.space.x;
                    model.enters(k, i, l, x);
                    whiten(&self.lower[(block.line + i) * size..][..size], x);
                    let unit: f64 = x.iter().map(|x| square(*x)).sum();
                    let level = 1.0 / (block.sampled.variances[1] * unit);
                    if level.is_finite() {
                        (sum, count) = (sum + ln_1(level), count + 1.0);
                    }
                }
            }
            levels[q + l] = libm::exp(sum / count);
        }
        levels.iter_mut().for_each(|level| *level *= misfit / degrees);
    }
}
