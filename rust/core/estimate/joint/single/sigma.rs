//! Covariance and colour of the noise of a single problem, from its residuals.

use super::super::colour;
use super::super::design::Colour;
use super::super::iterate::Refresh;
use super::{Run, Single};
use crate::error::Error;
use crate::estimate::autoregression::{ROUNDS, SETTLED};
use crate::simd::Wide;

impl Single<'_> {
    /// The colour, and Σ where the rows hold it, from the residuals, θ again, until neither changes.
    pub(super) fn alternate(
        &mut self,
        run: Run<'_>,
        refresh: &mut Refresh<'_>,
    ) -> Result<(), Error> {
        let mut going = true;
        for round in 0..ROUNDS.min(run.most) {
            let live = std::array::from_fn(|lane| lane == 0);
            let mut changed: f64 = 0.0;
            if self.d.noise.colour == Colour::Fitted {
                changed = colour::refit(self.isa, self.d, &mut self.w, round, live)[0];
            }
            if !run.fresh && self.d.estimates_covariance() {
                changed = changed.max(self.renew());
            }
            let settled = changed <= SETTLED && self.w.progress.active.0[0] == 0.0;
            if round > 0 && (settled || self.dependent) {
                going = false;
                break;
            }
            self.w.progress.again(Wide::splat(1.0));
            self.iterate(run, refresh)?;
        }
        self.w.progress.active = Wide::splat(f64::from(going));
        Ok(())
    }

    /// Σ̂ of the residuals that were formed last, and its inverse.
    pub(super) fn take_covariance(&mut self) {
        let q = self.d.outputs();
        let each = q as f64 / self.d.degrees_of_freedom().max(1) as f64;
        let mut squares = self.system.squares.clone();
        if self.d.holds_sigma() {
            // Of rows that held the last Σ = RRᵀ: R S Rᵀ.
            let (root, own) = (&self.w.triangle, &self.system.squares);
            let entry = |i: usize, j: usize| -> f64 {
                let row = |b: usize| (0..=i).map(move |a| root[i * q + a] * own[a * q + b]);
                (0..=j).map(|b| root[j * q + b] * row(b).sum::<f64>()).sum()
            };
            squares = (0..q * q).map(|k| entry(k / q, k % q)).collect();
        }
        for (k, square) in squares.iter().enumerate() {
            let least = if k % (q + 1) == 0 { self.least[k / q] } else { f64::NEG_INFINITY };
            self.w.sigma[k] = Wide::splat((square * each).max(least));
        }
        self.w.take_root(q);
        self.couple();
    }

    /// Σ̂ of the residuals as they are; by how much its root changed, relative to its size.
    fn renew(&mut self) -> f64 {
        let q = self.d.outputs();
        let before: Vec<f64> = self.w.root.iter().map(|v| v.0[0]).collect();
        self.measure();
        self.take_covariance();
        let now: Vec<f64> = self.w.root.iter().map(|v| v.0[0]).collect();
        let gap = |k: usize| (now[k] - before[k]).abs() / now[k / q * (q + 1)];
        (0..q * q).map(gap).fold(0.0, f64::max)
    }

    /// P = WᵀW, W the root of Σ⁻¹; one where the rows hold Σ.
    pub(super) fn couple(&mut self) {
        self.factors.fill(None);
        let q = self.d.outputs();
        let root = |i: usize, j: usize| self.w.root[i * q + j].0[0];
        for i in 0..q {
            for j in 0..q {
                self.coupling[i * q + j] = match self.d.holds_sigma() {
                    true => f64::from(i == j),
                    false => (i.max(j)..q).map(|c| root(c, i) * root(c, j)).sum(),
                };
            }
        }
    }

    /// √det Σ̂: falls where log det Σ̂ does.
    pub(super) fn determinant(&self) -> f64 {
        let q = self.d.outputs();
        1.0 / (0..q).map(|i| self.w.root[i * (q + 1)].0[0]).product::<f64>()
    }
}
