//! Coloured noise on the lines of one record: what each signal's noise is there, and the power that residuals show.
//!
//! On line m the noise of a channel is h(mω₀) times what white noise would be there, and so is that of a signal that is
//! linear in it. A nonlinear signal spreads noise over the lines, and is not for this file.

use super::Spot;
use crate::estimate::terms::complex::C;
use crate::estimate::terms::equations::Equations;
use crate::estimate::terms::lines::Pairs;
use crate::estimate::terms::sigma::root;
use crate::simd::{Wide, numbers_mut};

impl Spot {
    /// The same rows in white noise.
    pub fn uncoloured(mut self) -> Spot {
        self.colours.clear();
        self
    }

    /// Colours L of each noisy signal.
    pub(super) fn colour_loads(&mut self, e: &Equations, pairs: &Pairs) {
        for (load, signal) in self.loads.iter_mut().zip(pairs.noisy.iter().cycle()) {
            if let Some(colour) = colour_of(&self.colours, e, *signal) {
                for part in [&mut load.re, &mut load.im] {
                    part.iter_mut().zip(colour).for_each(|(x, colour)| *x *= colour);
                }
            }
        }
    }

    /// Power of a channel's noise on each line over what it was taken for, by the residuals whose sources were just
    /// found: that of its signal's noise, v = GᴴS⁻¹r with G = ΣLR and the line's own covariance S, over GᴴS⁻¹G.
    pub fn power_over_expected(&self, e: &Equations, pairs: &Pairs, noisy: usize) -> Vec<f64> {
        let signal = pairs.noisy.iter().find(|s| channel(e, **s) == Some(noisy));
        let Some(signal) = signal else { return vec![1.0; self.count()] };
        let shares = self.shares(pairs, *signal);
        let one = |m: usize| {
            let mut noise = C(0.0, 0.0);
            for (share, source) in shares.iter().zip(&self.sources) {
                noise += source.get(m) * C(0.5 * share, 0.0);
            }
            let expected = self.expected(m, &shares, &self.inner(pairs, m));
            match expected > 0.0 {
                true => (noise.0 * noise.0 + noise.1 * noise.1) / expected,
                false => 1.0,
            }
        };
        (0..self.count()).map(one).collect()
    }

    /// Mean products of a signal's noise with that of each noisy signal.
    fn shares(&self, pairs: &Pairs, signal: usize) -> Vec<f64> {
        let middle = self.spectra.middle;
        let of = |pair: &Option<usize>| {
            let own = pair.filter(|pair| !self.spectra.apart[*pair]);
            own.map_or(0.0, |pair| self.spectra.pairs[pair][middle][0].0[0])
        };
        pairs.place[signal].iter().map(of).collect()
    }

    /// Lower root of the equations' covariance on a line, in real numbers: Re before Im.
    fn inner(&self, pairs: &Pairs, m: usize) -> Vec<f64> {
        let p = self.error.len();
        let mut whole = vec![0.0; 4 * p * p];
        for a in 0..p {
            for b in 0..p {
                let mut sum = C(0.0, 0.0);
                for couple in &pairs.couples[a * p + b] {
                    if self.spectra.apart[couple.pair] {
                        continue;
                    }
                    let [re, im] = self.spectra.pairs[couple.pair][self.spectra.middle];
                    let to = self.loads[couple.to].get(m) * C(re.0[0], im.0[0]);
                    sum += self.loads[couple.from].get(m) * C(to.0, -to.1);
                }
                for (i, j, value) in
                    [(a, b, sum.0), (a + p, b + p, sum.0), (a + p, b, sum.1), (a, b + p, -sum.1)]
                {
                    whole[i * 2 * p + j] = value;
                }
            }
        }
        root(&whole, 2 * p).unwrap_or_default()
    }

    /// GᴴS⁻¹G of such shares; 0 where S is singular.
    fn expected(&self, m: usize, shares: &[f64], inner: &[f64]) -> f64 {
        let (p, own) = (self.error.len(), shares.len());
        if inner.is_empty() {
            return 0.0;
        }
        let mut x = vec![0.0; 2 * p];
        for i in 0..2 * p {
            let mut sum = C(0.0, 0.0);
            for (at, share) in shares.iter().enumerate() {
                sum += self.loads[i % p * own + at].get(m) * C(*share, 0.0);
            }
            let before: f64 = (0..i).map(|k| inner[i * 2 * p + k] * x[k]).sum();
            x[i] = (if i < p { sum.0 } else { sum.1 } - before) / inner[i * 2 * p + i];
        }
        // Line 0 has no Im, and Re twice the variance.
        let by = if m + self.lines.first == 0 { 0.25 } else { 1.0 };
        by * x.iter().map(|x| x * x).sum::<f64>()
    }
}

/// The noisy channel that a signal is made of.
fn channel(e: &Equations, signal: usize) -> Option<usize> {
    e.sensitivities.iter().find(|(own, _)| *own == signal).map(|(_, channel)| *channel)
}

/// Colour of a signal's noise on the lines; none where it is white.
pub(super) fn colour_of<'a>(
    colours: &'a [Vec<f64>],
    e: &Equations,
    signal: usize,
) -> Option<&'a Vec<f64>> {
    channel(e, signal).and_then(|own| colours.get(own))
}

/// Gives noise a colour: numbers of lines, all Re before all Im.
pub(super) fn give(colour: &[f64], noise: &mut [Wide]) {
    let (re, im) = noise.split_at_mut(noise.len() / 2);
    for part in [re, im] {
        numbers_mut(part).iter_mut().zip(colour).for_each(|(x, colour)| *x *= colour);
    }
}
