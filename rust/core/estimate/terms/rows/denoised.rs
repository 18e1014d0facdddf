//! The noise that explains the residuals best, and the lines of the signals without it.

use super::Spot;
use super::colour::{colour_of, give};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::terms::complex::{C, Split, late, loaded};
use crate::estimate::terms::equations::Equations;
use crate::estimate::terms::lines::{Pairs, Spectra};
use crate::linalg::dense::back;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers, numbers_mut};

impl Spot {
    /// Coefficients of all signals on the lines, denoised where wanted.
    pub(super) fn denoise(
        &mut self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        lags: &[f64],
        factors: LeftColumns,
    ) {
        let (count, first) = (self.count(), self.lines.first);
        self.denoised.resize_with(self.spectra.signals.len(), Split::default);
        for (to, from) in self.denoised.iter_mut().zip(&self.spectra.signals) {
            to.copy(&from.re[first..first + count], &from.im[first..first + count]);
        }
        if factors == LeftColumns::Data || self.weights == RowWeights::Flat {
            return;
        }
        self.find_sources(isa, pairs);
        self.noise.resize(2 * count.div_ceil(LANES), Wide::ZERO);
        for (s, late_by) in lags.iter().enumerate() {
            if pairs.place[s].iter().all(Option::is_none) {
                continue;
            }
            isa.run(Noise {
                places: &pairs.place[s],
                sources: &self.sources,
                spectra: &self.spectra,
                first,
                count,
                out: &mut self.noise,
            });
            if let Some(colour) = colour_of(&self.colours, e, s) {
                give(colour, &mut self.noise);
            }
            let to = &mut self.denoised[s];
            let (re, im) = numbers(&self.noise).split_at(self.noise.len() / 2 * LANES);
            if *late_by == 0.0 {
                to.re.iter_mut().zip(&re[..count]).for_each(|(to, noise)| *to -= noise);
                to.im.iter_mut().zip(&im[..count]).for_each(|(to, noise)| *to -= noise);
                continue;
            }
            for m in 0..count {
                let turn = late((m + first) as f64 * self.lines.omega0 * late_by);
                let noise = C(re[m], im[m]) * turn;
                to.re[m] -= noise.0;
                to.im[m] -= noise.1;
            }
        }
    }

    /// What the residual says of the noise: z_j(l) = Σ over equations of conj(L)(λ_Re + iλ_Im), λ = C⁻¹r, of
    /// each noisy signal on the lines; into `sources`.
    pub fn find_sources(&mut self, isa: Isa, pairs: &Pairs) {
        let (count, own) = (self.count(), pairs.noisy.len());
        let equations = self.error.len();
        self.lambda.clear();
        self.lambda.resize(self.rows.len().div_ceil(LANES), Wide::ZERO);
        numbers_mut(&mut self.lambda)[..self.rows.len()].copy_from_slice(&self.residual);
        back(isa, &self.panel, &mut self.lambda);
        self.sources.resize_with(own, Split::default);
        for to in &mut self.sources {
            to.clear(count);
        }
        let first = if self.lines.first == 0 { equations } else { 0 };
        for equation in 0..equations {
            let lambda = &numbers(&self.lambda)[equation..];
            for &j in &pairs.of[equation] {
                let (to, load) = (&mut self.sources[j], &self.loads[equation * own + j]);
                // Line 0 has no Im.
                let start = usize::from(first > 0);
                for _ in 0..start {
                    to.re[0] += load.re[0] * lambda[0];
                    to.im[0] -= load.im[0] * lambda[0];
                }
                let (re, im) = (&mut to.re[start..count], &mut to.im[start..count]);
                let loads = load.re[start..].iter().zip(&load.im[start..]);
                let both = lambda[first..].chunks(2 * equations);
                for ((to, (x, y)), both) in re.iter_mut().zip(im).zip(loads).zip(both) {
                    *to.0 += x * both[0] + y * both[equations];
                    *to.1 += x * both[equations] - y * both[0];
                }
            }
        }
    }
}

/// ½ Σ_jl \[R_j(m − l) z_j(l) + R_j(m + l) conj z_j(l)\] of one signal, eight lines m a register.
struct Noise<'a> {
    places: &'a [Option<usize>],
    sources: &'a [Split],
    spectra: &'a Spectra,
    first: usize,
    count: usize,
    /// All Re, then all Im.
    out: &'a mut [Wide],
}

impl Kernel for Noise<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let half = L::splat(0.5);
        let (re, im) = self.out.split_at_mut(self.out.len() / 2);
        for (block, (re, im)) in re.iter_mut().zip(im).enumerate() {
            let m = block * LANES;
            let mut sum = (L::splat(0.0), L::splat(0.0));
            for (place, z) in self.places.iter().zip(self.sources) {
                let Some(pair) = place.filter(|pair| !self.spectra.apart[*pair]) else { continue };
                let (r, middle) = (&self.spectra.pairs[pair], self.spectra.middle);
                if self.spectra.white[pair] {
                    let (own, near) = (L::splat(r[middle][0].0[0]), z.eight::<L>(m));
                    sum = (own.mul_add(near.0, sum.0), own.mul_add(near.1, sum.1));
                    if m + self.first == 0 {
                        // Line 0 mirrors itself.
                        let (mut re, mut im) = (Wide::ZERO, Wide::ZERO);
                        (re.0[0], im.0[0]) = (z.re[0], -z.im[0]);
                        sum.0 = own.mul_add(L::load(&re), sum.0);
                        sum.1 = own.mul_add(L::load(&im), sum.1);
                    }
                    continue;
                }
                let (near, far) = (middle + m + 1 - self.count, middle + m);
                let far = far + 2 * self.first;
                let (near, far) = (&r[near..near + self.count], &r[far..far + self.count]);
                let each = near.iter().rev().zip(far);
                for ((near, far), (x, y)) in each.zip(z.re.iter().zip(&z.im)) {
                    let (near, far) = (loaded::<L>(near), loaded::<L>(far));
                    let (x, y) = (L::splat(*x), L::splat(*y));
                    sum.0 = y.mul_add(far.1 - near.1, x.mul_add(near.0 + far.0, sum.0));
                    sum.1 = x.mul_add(near.1 + far.1, y.mul_add(near.0 - far.0, sum.1));
                }
            }
            (half * sum.0).store(re);
            (half * sum.1).store(im);
        }
    }
}
