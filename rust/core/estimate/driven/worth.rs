//! What an estimate is worth: covariances, degrees of freedom, the share of each kind of noise.

use super::search::Sought;
use super::small::{add_outer, apply, square};
use super::{Block, Driven, Found, Linear};
use crate::error::Status;
use crate::estimate::answer::unit_diagonal;

/// Relative change of an unknown by which the slopes of shares are taken.
const CHANGE: f64 = 1e-5;

impl Driven {
    /// Covariances at the estimate that was found last: the joint one from the information, and that of the parameters
    /// from the scores of the lines.
    pub fn uncertainty(&mut self, model: &mut impl Linear, found: &mut Found) {
        self.linearise(model, &found.theta, &found.levels);
        let unknowns = self.unknowns();
        let mut inverse = vec![0.0; unknowns * unknowns];
        for (j, column) in inverse.chunks_mut(unknowns).enumerate() {
            if self.scoring.r(j, j) != 0.0 {
                column[j] = 1.0;
                self.scoring.back(0, column);
            }
        }
        for i in 0..unknowns {
            for j in 0..unknowns {
                let each = inverse.chunks(unknowns).map(|column| column[i] * column[j]);
                self.joint[i * unknowns + j] = each.sum();
            }
        }
        self.meat();
        found.cov.clone_from(&self.joint);
        self.shares(model, found);
    }

    /// The covariance of θ from the scores of the lines, each made larger by what leverage leaves of it.
    fn meat(&mut self) {
        let (p, q, all) = (self.parameters, self.outputs, self.residual.len());
        let (unknowns, size) = (self.unknowns(), q * q);
        let part = self.over.len();
        self.sandwich.fill(0.0);
        let (mut score, mut influence) = (vec![0.0; unknowns], vec![0.0; p]);
        for block in &self.blocks {
            for i in 0..block.sampled.lines {
                let place = block.line + i;
                let own = self.lines[place];
                let by = own.count / own.left;
                let over = &self.over[place * size..][..size];
                for (unknown, score) in score.iter_mut().enumerate() {
                    let slope = &self.slopes[unknown * part + place * size..][..size];
                    let each = slope.iter().zip(over).map(|(a, b)| a * b);
                    *score = 0.5 * by * each.sum::<f64>();
                    if unknown < p && !self.held[unknown] {
                        let column = &self.jacobian[unknown * all..];
                        let rows = rows(block, q, i);
                        *score += by * rows.map(|r| column[r] * self.residual[r]).sum::<f64>();
                    }
                }
                for (row, to) in self.joint.chunks(unknowns).zip(&mut influence) {
                    *to = row.iter().zip(&score).map(|(c, s)| c * s).sum();
                }
                add_influence(&mut self.sandwich, &influence);
            }
        }
        // What was known is as certain as it says.
        for (parameter, sd) in self.known.each() {
            for (row, to) in self.joint.chunks(unknowns).zip(&mut influence) {
                *to = row[parameter] / sd;
            }
            add_influence(&mut self.sandwich, &influence);
        }
    }

    /// Covariance of two parameters.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.joint[i * self.unknowns() + j]
    }

    /// The same from the scores of the lines.
    pub fn sandwich(&self, i: usize, j: usize) -> f64 {
        self.sandwich[i * self.parameters + j]
    }

    /// Entry of the normal matrix of the whitened columns of θ.
    pub fn gram(&self, i: usize, j: usize) -> f64 {
        (0..=i.min(j)).map(|k| self.mean.r(k, i) * self.mean.r(k, j)).sum()
    }

    /// Whether the column of a parameter depends on those before it.
    pub fn is_dependent(&self, parameter: usize) -> bool {
        self.mean.r(parameter, parameter) == 0.0
    }

    /// Whether a parameter was held at its bound.
    pub fn is_held(&self, parameter: usize) -> bool {
        self.held[parameter]
    }

    /// θ by θ of an entry like [`Driven::covariance`], row major.
    pub fn square(&self, entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let p = self.parameters;
        (0..p * p).map(|k| entry(k / p, k % p)).collect()
    }

    /// The normal matrix with a unit diagonal.
    pub fn unit_gram(&self) -> Vec<f64> {
        let p = self.parameters;
        unit_diagonal(|k| self.gram(k / p, k % p), p)
    }

    /// How the search ended, at this cost.
    pub fn status(&self, cost: f64, found: &Found, sought: &Sought) -> Status {
        let lost = (0..self.parameters).any(|k| self.is_dependent(k) && !self.is_held(k));
        match (cost.is_finite() && found.theta.iter().all(|t| t.is_finite()), lost) {
            (false, _) => Status::NonFinite,
            (_, true) => Status::Rank,
            _ if sought.settled => Status::Ok,
            _ => Status::MaxIter,
        }
    }

    /// Degrees of freedom of the variance of a parameter, from the scatter of the levels that it rests on.
    pub fn degrees(&self, parameter: usize) -> f64 {
        let (p, q, all) = (self.parameters, self.outputs, self.residual.len());
        let (unknowns, size, part) = (self.unknowns(), q * q, self.over.len());
        let levels = q + self.noises;
        let known = self.known.each().map(|(k, sd)| self.joint[parameter * unknowns + k] / sd);
        let (mut total, mut share) = (known.map(|own| own * own).sum::<f64>(), vec![0.0; levels]);
        let mut influence = vec![(0.0, 0.0); q];
        let mut outer = vec![0.0; size];
        for block in &self.blocks {
            let count = block.sampled.lines;
            for i in 0..count {
                influence.fill((0.0, 0.0));
                for k in 0..p {
                    let by = self.joint[parameter * unknowns + k];
                    let column = &self.jacobian[k * all + block.row..];
                    for (e, to) in influence.iter_mut().enumerate() {
                        to.0 += by * column[2 * e * count + i];
                        to.1 += by * column[(2 * e + 1) * count + i];
                    }
                }
                total += influence.iter().map(|own| square(*own)).sum::<f64>();
                outer.fill(0.0);
                add_outer(&influence, &influence, 1.0, &mut outer);
                for (level, share) in share.iter_mut().enumerate() {
                    let slope =
                        &self.slopes[(p + level) * part + (block.line + i) * size..][..size];
                    *share += slope.iter().zip(&outer).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
        let each = (0..levels * levels).map(|k| {
            let (i, j) = (k / levels, k % levels);
            share[i] * share[j] * self.joint[(p + i) * unknowns + p + j]
        });
        2.0 * total * total / each.sum::<f64>()
    }

    /// What part of each output's misfit is the response to process noise, with standard errors by the delta method.
    fn shares<M: Linear>(&mut self, model: &mut M, found: &mut Found) {
        let (p, q, unknowns) = (self.parameters, self.outputs, self.unknowns());
        let share = |own: &mut Driven, model: &mut M, theta: &[f64], levels: &[f64]| -> Vec<f64> {
            own.evaluate(model, theta, levels);
            (0..q).map(|output| own.share(model, output, levels)).collect()
        };
        let (theta, levels) = (found.theta.clone(), found.levels.clone());
        let mut slopes = vec![0.0; q * unknowns];
        for k in 0..unknowns {
            let ends = [1.0, -1.0].map(|side| {
                let (mut theta, mut levels) = (theta.clone(), levels.clone());
                let own = if k < p { &mut theta[k] } else { &mut levels[k - p] };
                *own *= 1.0 + side * CHANGE;
                share(self, model, &theta, &levels)
            });
            let at = if k < p { theta[k] } else { levels[k - p] };
            if at != 0.0 {
                for output in 0..q {
                    let change = ends[0][output] - ends[1][output];
                    slopes[output * unknowns + k] = change / (2.0 * CHANGE * at);
                }
            }
        }
        let here = share(self, model, &theta, &levels);
        let errors = slopes.chunks(unknowns).map(|slope| {
            let each = slope
                .iter()
                .zip(self.joint.chunks(unknowns))
                .map(|(a, row)| a * row.iter().zip(slope).map(|(c, b)| c * b).sum::<f64>());
            each.sum::<f64>().max(0.0).sqrt()
        });
        found.shares = here.into_iter().zip(errors).collect();
    }

    fn share(&mut self, model: &impl Linear, output: usize, levels: &[f64]) -> f64 {
        let q = self.outputs;
        let (mut measured, mut driven) = (0.0, 0.0);
        let x = &mut self.space.x;
        for (k, block) in self.blocks.iter().enumerate() {
            let [unit, inside] = block.sampled.variances;
            for i in (0..block.sampled.lines).filter(|i| !self.lines[block.line + i].silent) {
                let row = &self.inverse[((block.line + i) * q + output) * q..][..q];
                measured += unit * levels[output];
                for (l, level) in levels[q..].iter().enumerate() {
                    model.enters(k, i, l, x);
                    let mut there = [(0.0, 0.0)];
                    apply(row, x, &mut there);
                    driven += inside * level * square(there[0]);
                }
            }
        }
        driven / (measured + driven)
    }

    /// What the sum of squares would be in white noise on the outputs of the same likelihood, the geometric mean of P over
    /// the rows: so costs compare as likelihoods do. Lines that no output enters have no P.
    pub fn cost(&self, degrees: f64) -> f64 {
        let (mut sum, mut rows) = (0.0, 0.0);
        for block in &self.blocks {
            let unit = crate::math::ln_1(block.sampled.variances[0]);
            let lines = &self.lines[block.line..][..block.sampled.lines];
            for own in lines.iter().filter(|own| !own.silent) {
                sum += own.count * (own.log_p - self.outputs as f64 * unit);
                rows += own.count * self.outputs as f64;
            }
        }
        libm::exp(sum / rows) * degrees
    }

    /// The sum of squares of the residuals under their own covariance.
    pub fn misfit(&self) -> f64 {
        self.lines.iter().map(|own| own.misfit).sum()
    }

    /// Squared distance of θ from what was known of it, in its standard deviations.
    pub fn distance(&self) -> f64 {
        self.known.distance()
    }

    /// Whitened residuals of an output on the lines of each record.
    pub fn residuals(&self, found: &Found, output: usize) -> Vec<Vec<(f64, f64)>> {
        let of = |block: &Block| {
            let count = block.sampled.lines;
            let rows = &found.residual[block.row..];
            let at = |i: usize| (rows[2 * output * count + i], rows[(2 * output + 1) * count + i]);
            (0..count).map(at).collect()
        };
        self.blocks.iter().map(of).collect()
    }
}

/// Adds the outer product of a row's influence on the parameters.
fn add_influence(sandwich: &mut [f64], influence: &[f64]) {
    for (row, a) in sandwich.chunks_mut(influence.len().max(1)).zip(influence) {
        row.iter_mut().zip(influence).for_each(|(to, b)| *to += a * b);
    }
}

/// Rows of a line.
fn rows(block: &Block, outputs: usize, line: usize) -> impl Iterator<Item = usize> + '_ {
    (0..2 * outputs).map(move |e| block.row + e * block.sampled.lines + line)
}
