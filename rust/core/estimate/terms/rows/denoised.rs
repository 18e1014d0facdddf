//! The noise that explains the residuals best, and the lines of the signals without it.

use super::{Spot, late};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::terms::complex::C;
use crate::estimate::terms::lines::Pairs;

impl Spot {
    /// Coefficients of all signals on the lines, denoised where wanted.
    pub(super) fn denoise(&mut self, pairs: &Pairs, lags: &[f64], factors: LeftColumns) {
        let (count, first) = (self.count(), self.lines.first);
        self.denoised.resize_with(self.spectra.signals.len(), Vec::new);
        for (to, from) in self.denoised.iter_mut().zip(&self.spectra.signals) {
            to.clear();
            to.extend_from_slice(&from[first..first + count]);
        }
        if factors == LeftColumns::Data || self.weights == RowWeights::Flat {
            return;
        }
        let own = pairs.noisy.len();
        let z = self.sources(pairs);
        for (s, late_by) in lags.iter().enumerate() {
            for j in 0..own {
                let Some(pair) = pairs.place[s][j] else { continue };
                let r = &self.spectra.pairs[pair];
                let z = &z[j * count..][..count];
                for m in 0..count {
                    let mut sum = C::default();
                    // R(m − l) for l ≤ m, its conjugate beyond.
                    for (z, near) in z[..=m].iter().zip(r[..=m].iter().rev()) {
                        sum += *near * *z;
                    }
                    for (z, near) in z[m + 1..].iter().zip(&r[1..]) {
                        sum += near.conj() * *z;
                    }
                    for (z, far) in z.iter().zip(&r[m + 2 * first..]) {
                        sum += *far * z.conj();
                    }
                    let mut noise = sum * 0.5;
                    if *late_by != 0.0 {
                        noise = noise * late((m + first) as f64 * self.lines.omega0 * late_by);
                    }
                    self.denoised[s][m] = self.denoised[s][m] - noise;
                }
            }
        }
    }

    /// What the residual says of the noise: z_j(l) = Σ over equations of conj(L)(λ_Re + iλ_Im), λ = C⁻¹r, of
    /// each noisy signal on the lines.
    pub fn sources(&mut self, pairs: &Pairs) -> Vec<C> {
        let (count, own) = (self.count(), pairs.noisy.len());
        self.lambda.clear();
        self.lambda.extend_from_slice(&self.residual);
        self.panel.back(&mut self.lambda);
        let mut z = vec![C::default(); own * count];
        for (row, value) in self.rows.iter().zip(&self.lambda) {
            let mu = if row.im { C(0.0, *value) } else { C(*value, 0.0) };
            for j in 0..own {
                let load = self.loads[(row.equation * own + j) * count + row.line];
                z[j * count + row.line] += load.conj() * mu;
            }
        }
        z
    }
}
