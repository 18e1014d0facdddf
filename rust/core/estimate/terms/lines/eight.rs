//! From the samples of eight records to their lines, one record a lane, to the bit as [`TermsRecordPlan::load`] has
//! them for one. Signals that depend on samples alone, even steps, samples of equal noise.

use super::{Pairs, ROUNDING, TermsRecordPlan};
use crate::error::Error;
use crate::estimate::terms::equations::Equations;
use crate::estimate::terms::plan::TermsRecord;
use crate::estimate::terms::sigma::Sigma;
use crate::simd::{Isa, LANES, Wide, numbers, numbers_mut};
use crate::spectrum::{CoefficientPlan, Scratch};
use crate::tape::Input;

/// Real and imaginary part of a number of each record.
pub(crate) type Both = [Wide; 2];

/// Coefficients of eight records.
#[derive(Default)]
pub(crate) struct EightSpectra {
    /// V of each signal on the lines of the band.
    pub signals: Vec<Both>,
    /// R of each pair of noisy signals, so many lags each; lag 0 stands in the middle.
    pub pairs: Vec<Both>,
    pub lags: usize,
    pub middle: usize,
    /// Whether a pair has no lag but 0, or nothing in common.
    pub white: Vec<bool>,
    pub apart: Vec<bool>,
}

/// Memory of one worker.
#[derive(Default)]
pub(crate) struct EightWorkspace {
    channels: Vec<Vec<Wide>>,
    /// Noisy channels without their noise, and whether it was taken away.
    clean: Vec<Vec<Wide>>,
    cleared: bool,
    /// Variances, then covariances of the noisy channels.
    sigma: Vec<Wide>,
    registers: Vec<f64>,
    results: Vec<Vec<Wide>>,
    product: Vec<Wide>,
    wave: Vec<Wide>,
    re: Vec<Wide>,
    im: Vec<Wide>,
    /// Of each signal's plan, and of the products'.
    scratch: Vec<Scratch>,
    room: Scratch,
}

impl EightWorkspace {
    /// Takes the samples of up to eight records, and the covariance of their noise; the last stands in spare lanes.
    pub fn take(&mut self, records: &[&TermsRecord<'_>], sigmas: &[&Sigma]) {
        let last = records.len() - 1;
        let count = records[0].channels.len();
        self.channels.resize_with(count, Vec::new);
        for (c, to) in self.channels.iter_mut().enumerate() {
            let own: [&[f64]; LANES] = std::array::from_fn(|k| records[k.min(last)].channels[c]);
            to.clear();
            to.extend((0..own[0].len()).map(|k| Wide(own.map(|channel| channel[k]))));
        }
        self.cleared = false;
        let numbers = sigmas[0].numbers().len();
        self.sigma.clear();
        self.sigma.extend(
            (0..numbers)
                .map(|k| Wide(std::array::from_fn(|lane| sigmas[lane.min(last)].numbers()[k]))),
        );
    }
}

impl TermsRecordPlan {
    /// Coefficients of all signals on so many lines from `first` on, and of all pairs of sensitivities.
    pub fn load_eight(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        (first, count): (usize, usize),
        space: &mut EightWorkspace,
        out: &mut EightSpectra,
    ) -> Result<(), Error> {
        self.formulas_of_eight(e, space);
        let lines = self.highest + 1;
        space.re.resize(lines, Wide::ZERO);
        space.im.resize(lines, Wide::ZERO);
        if space.scratch.is_empty() {
            space.scratch.extend(self.plans.iter().map(CoefficientPlan::scratch));
            space.room = self.noise.scratch();
        }
        out.signals.clear();
        for (s, plan) in self.plans.iter().enumerate() {
            let EightWorkspace { results, re, im, scratch, .. } = &mut *space;
            plan.run_lanes(isa, &results[s], re, im, &mut scratch[s])?;
            let least = largest(&results[s]).0.map(|most| ROUNDING * most);
            let kept = |x: Wide| {
                let each = |k: usize| if x.0[k].abs() < least[k] { 0.0 } else { x.0[k] };
                Wide(std::array::from_fn(each))
            };
            let own = re.iter().zip(&*im).skip(first).take(count);
            out.signals.extend(own.map(|(re, im)| [kept(*re), kept(*im)]));
        }
        self.correlate_eight(isa, e, pairs, space, out)
    }

    /// The pairs of sensitivities alone, where noise has been taken from the channels.
    pub fn load_slopes_of_eight(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        space: &mut EightWorkspace,
        out: &mut EightSpectra,
    ) -> Result<(), Error> {
        self.formulas_of_eight(e, space);
        self.correlate_eight(isa, e, pairs, space, out)
    }

    fn correlate_eight(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        space: &mut EightWorkspace,
        out: &mut EightSpectra,
    ) -> Result<(), Error> {
        out.middle = self.noise.middle();
        out.lags = 3 * self.highest + 1;
        out.pairs.resize(pairs.products.len() * out.lags, [Wide::ZERO; 2]);
        out.white.resize(pairs.products.len(), false);
        out.apart.resize(pairs.products.len(), false);
        let each = out.pairs.chunks_exact_mut(out.lags).zip(&mut out.white).zip(&mut out.apart);
        for (((out, white), apart), list) in each.zip(&pairs.products) {
            let channels = |(a, b): &(usize, usize)| (e.sensitivities[*a].1, e.sensitivities[*b].1);
            let both = |pair: &(usize, usize)| {
                let (c, d) = channels(pair);
                space.sigma[Sigma::place_of(e.noisy.len(), c, d)]
            };
            *apart = list.iter().all(|pair| both(pair) == Wide::ZERO);
            if *apart {
                continue;
            }
            let slope = |k: usize| e.samples.constant(e.signals.len() + k);
            let constant = list.iter().try_fold(Wide::ZERO, |sum, (a, b)| {
                let (own, a, b) = (both(&(*a, *b)), slope(*a)?, slope(*b)?);
                Some(Wide(std::array::from_fn(|k| sum.0[k] + own.0[k] * a * b)))
            });
            *white = constant.is_some_and(|own| self.noise.correlate_eight_constants(&own, out));
            if *white {
                continue;
            }
            let (first, n) = (self.window.lead, self.window.intervals);
            space.product.clear();
            space.product.resize(n + 1, Wide::ZERO);
            for pair in list {
                let own = both(pair);
                let slopes = [pair.0, pair.1].map(|k| &space.results[e.signals.len() + k][first..]);
                let each = space.product.iter_mut().zip(slopes[0]).zip(slopes[1]);
                for ((to, a), b) in each {
                    for k in 0..LANES {
                        to.0[k] += own.0[k] * a.0[k] * b.0[k];
                    }
                }
            }
            let EightWorkspace { product, re, im, room, .. } = &mut *space;
            self.noise.correlate_eight(isa, product, re, im, room, out)?;
        }
        Ok(())
    }

    /// Signals and sensitivities, sample by sample; the latter alone where noise has been taken away.
    fn formulas_of_eight(&self, e: &Equations, space: &mut EightWorkspace) {
        let EightWorkspace { channels, clean, cleared, sigma, registers, results, .. } = space;
        results.resize_with(e.samples.results(), Vec::new);
        for r in &mut *results {
            r.resize(self.samples, Wide::ZERO);
        }
        let mut own: Vec<&[Wide]> = channels.iter().map(Vec::as_slice).collect();
        for (channel, values) in e.noisy.iter().zip(&*clean).filter(|_| *cleared) {
            own[*channel] = values;
        }
        let series = own.iter().map(|c| Input::Series(numbers(c)));
        // No signal depends on θ.
        let inputs: Vec<_> = series.chain(sigma.iter().map(|v| Input::Cycle(&v.0))).collect();
        let first = if *cleared { e.signals.len() } else { 0 };
        let mut out: Vec<&mut [f64]> = results.iter_mut().map(|r| numbers_mut(r)).collect();
        e.samples.run(|k| k >= first, &inputs, self.samples * LANES, registers, &mut out);
    }

    /// Takes from the noisy channels the noise that explains the residuals best, as [`TermsRecordPlan::denoised`];
    /// the workspace holds the formulas of these records.
    pub fn denoise_eight(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        sources: &[Both],
        (first, count): (usize, usize),
        space: &mut EightWorkspace,
    ) {
        let (lead, noisy) = (self.window.lead, e.noisy.len());
        space.cleared = true;
        space.clean.resize_with(noisy, Vec::new);
        for (to, c) in space.clean.iter_mut().zip(&e.noisy) {
            to.clone_from(&space.channels[*c]);
        }
        for (s, own) in pairs.noisy.iter().zip(sources.chunks_exact(count)) {
            self.noise.wave_of_eight(isa, own, first, &mut space.wave);
            let each = e.sensitivities.iter().enumerate().filter(|(_, (signal, _))| signal == s);
            for (k, (_, d)) in each {
                let slope = &space.results[e.signals.len() + k][lead..];
                for (c, clean) in space.clean.iter_mut().enumerate() {
                    let both = space.sigma[Sigma::place_of(noisy, c, *d)];
                    if both == Wide::ZERO {
                        continue;
                    }
                    for (to, (w, d)) in clean[lead..].iter_mut().zip(space.wave.iter().zip(slope)) {
                        for k in 0..LANES {
                            to.0[k] -= both.0[k] * d.0[k] * w.0[k];
                        }
                    }
                }
            }
        }
    }
}

/// The largest size of each record; NaN counts for nothing.
fn largest(all: &[Wide]) -> Wide {
    let mut most = [0.0f64; LANES];
    for own in all {
        for (most, x) in most.iter_mut().zip(&own.0) {
            let x = x.abs();
            *most = if x > *most { x } else { *most };
        }
    }
    Wide(most)
}
