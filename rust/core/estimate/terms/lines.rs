//! From samples to the lines: coefficients of every signal, and of the products of sensitivities that the
//! covariance of the lines is made of.

mod bend;
mod eight;
mod parts;

use std::sync::OnceLock;

use super::complex::{Split, Windows};
use super::equations::{Equations, Lag};
use super::noise::{NoisePlan, NoiseWorkspace};
use super::sigma::Sigma;
use crate::error::Error;
use crate::estimate::fit::Time;
use crate::estimate::window::Window;
use crate::modulation::Lines;
use crate::noise_level::NoiseLevel;
use crate::quadrature::Rule;
use crate::simd::{Isa, LANES};
use crate::spectrum::{CoefficientPlan, Kind, Scratch};
use crate::tape::Input;
pub(crate) use eight::{Both, EightSpectra, EightWorkspace};
use parts::Moving;
pub(crate) use parts::{Part, Parts};

/// Lines to either side over which power is averaged, and how many times the noise it must be to be signal.
const SPREAD: usize = 4;
const LOUD: f64 = 6.0;
/// Part of a signal's size that sums of it may be off by.
const ROUNDING: f64 = 1e-15;

/// How one record becomes lines.
pub(crate) struct TermsRecordPlan {
    pub samples: usize,
    /// NaN for uneven samples.
    pub dt: f64,
    pub window: Window,
    /// Highest line that coefficients are made for.
    pub highest: usize,
    /// One a signal; with a free delay that of its start.
    plans: Vec<CoefficientPlan>,
    /// How each signal's samples stand for it.
    kinds: Vec<Kind>,
    /// Of products of sensitivities.
    noise: NoisePlan,
    /// What tells the noise level of the window's samples, once it was asked for.
    level: OnceLock<NoiseLevel>,
    /// Variance of each sample over the channel's, a noisy channel; empty: all one.
    pub uneven: Vec<Vec<f64>>,
}

/// Coefficients of one record at one θ.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// V of each signal from line 0 on.
    pub signals: Vec<Split>,
    /// R of each pair of noisy signals.
    pub pairs: Vec<Windows>,
    /// Where lag 0 of these stands.
    pub middle: usize,
    /// Whether a pair has no lag but 0.
    pub white: Vec<bool>,
    /// Whether a pair has nothing in common, its channels' noise being independent.
    pub apart: Vec<bool>,
}

/// Which signals are noisy, and where the products of two of them stand.
#[derive(Debug, Clone)]
pub(crate) struct Pairs {
    /// Noisy signals in terms.
    pub noisy: Vec<usize>,
    /// Positions in `noisy` of those in each equation.
    pub of: Vec<Vec<usize>>,
    /// `place[signal][position in noisy]`: the pair, or none.
    pub place: Vec<Vec<Option<usize>>>,
    /// What correlates two equations, row after row of them.
    pub couples: Vec<Vec<Couple>>,
    /// The sensitivities of both signals that are multiplied, a pair: (first, second).
    products: Vec<Vec<(usize, usize)>>,
    /// Signals and pairs that change with θ.
    moving: Moving,
}

/// Noisy signals of two equations that have noise in common, each by its place among the loads, and their pair.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Couple {
    pub from: usize,
    pub to: usize,
    pub pair: usize,
}

/// Where formulas are evaluated: one record's channels, the noisy ones' covariance, θ.
pub(crate) struct Place<'a> {
    pub channels: &'a [&'a [f64]],
    pub sigma: &'a Sigma,
    pub theta: &'a [f64],
    /// Noisy channels without their noise, where slopes are taken there.
    pub clean: &'a [Vec<f64>],
}

/// Memory of one worker for [`TermsRecordPlan::load`].
#[derive(Default)]
pub(crate) struct LinesWorkspace {
    registers: Vec<f64>,
    results: Vec<Vec<f64>>,
    product: Vec<f64>,
    wave: Vec<f64>,
    lags: Split,
    re: Vec<f64>,
    im: Vec<f64>,
    scratch: Scratch,
    room: NoiseWorkspace,
}

impl Pairs {
    pub fn new(e: &Equations) -> Pairs {
        let sensed = |s: usize| e.sensitivities.iter().any(|(signal, _)| *signal == s);
        let used = |s: usize| e.terms.iter().any(|t| t.signal == s);
        let noisy: Vec<usize> = (0..e.signals.len()).filter(|s| used(*s) && sensed(*s)).collect();
        let own = |s: usize| {
            let each = e.sensitivities.iter().enumerate();
            each.filter(move |(_, (signal, _))| *signal == s).map(|(k, _)| k)
        };
        let mut products: Vec<Vec<(usize, usize)>> = Vec::new();
        let mut place = vec![vec![None; noisy.len()]; e.signals.len()];
        for (s, places) in place.iter_mut().enumerate() {
            for (j, other) in noisy.iter().enumerate() {
                let mut list: Vec<(usize, usize)> =
                    own(s).flat_map(|a| own(*other).map(move |b| (a.min(b), a.max(b)))).collect();
                list.sort_unstable();
                if list.is_empty() {
                    continue;
                }
                let at = products.iter().position(|p| *p == list).unwrap_or_else(|| {
                    products.push(list);
                    products.len() - 1
                });
                places[j] = Some(at);
            }
        }
        let holds = |equation: usize, s: usize| {
            e.terms.iter().any(|t| t.equation == equation && t.signal == s)
        };
        let (equations, own) = (e.orders.len(), noisy.len());
        let of: Vec<Vec<usize>> = (0..equations)
            .map(|equation| (0..own).filter(|at| holds(equation, noisy[*at])).collect())
            .collect();
        let couples = (0..equations * equations)
            .map(|both| {
                let (a, b) = (both / equations, both % equations);
                let each = of[a].iter().flat_map(|i| of[b].iter().map(move |j| (*i, *j)));
                let couple = |(i, j): (usize, usize)| {
                    let (from, to) = (a * own + i, b * own + j);
                    place[noisy[i]][j].map(|pair| Couple { from, to, pair })
                };
                each.filter_map(couple).collect()
            })
            .collect();
        let moving = Moving::new(e, &products);
        Pairs { noisy, of, couples, place, products, moving }
    }
}

impl TermsRecordPlan {
    pub fn new(
        e: &Equations,
        record: usize,
        (samples, time): (usize, Time<'_>),
        rule: Rule,
        highest: usize,
        uneven: Vec<Vec<f64>>,
    ) -> Result<TermsRecordPlan, Error> {
        let window = Window::new(samples, time, e.longest_lag())?;
        if let Some(few) = uneven.iter().find(|v| v.len() != samples) {
            return Err(Error::Data(format!(
                "fitting with uneven noise: variances of {} samples for {samples}",
                few.len()
            )));
        }
        let kinds: Vec<Kind> = e.signals.iter().map(|s| *s.kind.of(record)).collect();
        let plan = |(s, signal): (usize, &super::Signal)| match time {
            Time::Uneven(t) => CoefficientPlan::uneven(t, highest, kinds[s]),
            Time::Even(dt) => {
                let start = match signal.lag {
                    Lag::Known(_) => e.lag(s, &[]),
                    Lag::Parameter(_) => 0.0,
                };
                CoefficientPlan::new(window.intervals, highest, kinds[s], start / dt, window.lead)
            }
        };
        let plans = e.signals.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        let noise = NoisePlan::new(time, window.intervals, rule, highest)?;
        let dt = if let Time::Even(dt) = time { dt } else { f64::NAN };
        let level = OnceLock::new();
        Ok(TermsRecordPlan { samples, dt, window, highest, plans, kinds, noise, level, uneven })
    }

    /// What tells the noise of the window's samples.
    pub fn noise_level(&self, order: usize) -> Result<&NoiseLevel, Error> {
        if let Some(level) = self.level.get() {
            return Ok(level);
        }
        let own = NoiseLevel::new(self.samples - self.window.lead, order)?;
        Ok(self.level.get_or_init(|| own))
    }

    /// The lines from `first` to `last`.
    pub fn lines(&self, first: usize, last: usize) -> Lines {
        let unit_variance = self.noise.unit_variance();
        Lines { first, last, omega0: self.window.omega0, unit_variance }
    }

    /// Coefficients of signals, and of pairs of sensitivities, at θ: all of them, or those that change with it.
    #[allow(clippy::too_many_arguments)]
    pub fn load(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        at: &Place<'_>,
        parts: Parts,
        space: &mut LinesWorkspace,
        out: &mut Spectra,
    ) -> Result<(), Error> {
        let signals = |s: usize| pairs.moving.signal(s, parts.signals);
        let slopes = |k: usize| pairs.moving.slope(k, parts.pairs);
        let together = at.clean.is_empty();
        let first = e.signals.len();
        if together {
            let wanted = |k: usize| if k < first { signals(k) } else { slopes(k - first) };
            self.formulas(e, at, &[], wanted, space);
        } else {
            // The signals themselves are those of the samples as they are.
            self.formulas(e, at, &[], |k| k < first && signals(k), space);
        }
        let count = self.highest + 1;
        space.re.resize(count, 0.0);
        space.im.resize(count, 0.0);
        out.signals.resize_with(e.signals.len(), Split::default);
        for (s, signal) in e.signals.iter().enumerate().filter(|(s, _)| signals(*s)) {
            let late;
            let plan = match signal.lag {
                Lag::Known(_) => &self.plans[s],
                Lag::Parameter(_) => {
                    let delay = e.lag(s, at.theta) / self.dt;
                    let Window { intervals, lead, .. } = self.window;
                    late =
                        CoefficientPlan::new(intervals, self.highest, self.kinds[s], delay, lead)?;
                    &late
                }
            };
            plan.run_in(isa, &space.results[s], &mut space.re, &mut space.im, &mut space.scratch)?;
            // A constant is on line 0 alone: what rounding leaves elsewhere must not pass for a column.
            let least = ROUNDING * largest(&space.results[s]);
            for x in space.re.iter_mut().chain(&mut space.im) {
                *x = if x.abs() < least { 0.0 } else { *x };
            }
            out.signals[s].copy(&space.re, &space.im);
        }
        if !together {
            self.formulas(e, at, at.clean, |k| k >= first && slopes(k - first), space);
        }
        self.correlate(isa, e, pairs, at, parts.pairs, space, out)
    }

    /// R of pairs, of the sensitivities that stand in the workspace.
    #[allow(clippy::too_many_arguments)]
    fn correlate(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        at: &Place<'_>,
        part: Part,
        space: &mut LinesWorkspace,
        out: &mut Spectra,
    ) -> Result<(), Error> {
        out.middle = self.noise.middle();
        out.pairs.resize_with(pairs.products.len(), Windows::new);
        out.white.resize(pairs.products.len(), false);
        out.apart.resize(pairs.products.len(), false);
        let each = out.pairs.iter_mut().zip(&mut out.white).zip(&mut out.apart);
        let each = each.zip(&pairs.products).enumerate();
        for (_, (((out, white), apart), list)) in each.filter(|(k, _)| pairs.moving.pair(*k, part))
        {
            let common = |(a, b): &(usize, usize)| {
                at.sigma.get(e.sensitivities[*a].1, e.sensitivities[*b].1) != 0.0
            };
            *apart = !list.iter().any(common);
            if *apart {
                continue;
            }
            let constant = self.constant_product(e, list, at.sigma);
            let lags = &mut space.lags;
            *white = constant.is_some_and(|product| self.noise.correlate_constant(product, lags));
            if !*white {
                self.product(e, list, at.sigma, space);
                let LinesWorkspace { product, room, lags, .. } = space;
                self.noise.correlate(isa, product, room, lags)?;
            }
            space.lags.windows(out);
        }
        Ok(())
    }

    /// Those signals and sensitivities that are wanted, sample by sample, where noisy channels are given without noise
    /// there.
    fn formulas(
        &self,
        e: &Equations,
        at: &Place<'_>,
        clean: &[Vec<f64>],
        wanted: impl Fn(usize) -> bool,
        space: &mut LinesWorkspace,
    ) {
        space.results.resize_with(e.samples.results(), Vec::new);
        for r in &mut space.results {
            r.resize(self.samples, 0.0);
        }
        let mut own: Vec<&[f64]> = at.channels.to_vec();
        for (channel, values) in e.noisy.iter().zip(clean) {
            own[*channel] = values;
        }
        let values = at.sigma.numbers().iter().chain(at.theta).map(|v| Input::Value(*v));
        let inputs: Vec<Input<'_>> = own.iter().map(|c| Input::Series(c)).chain(values).collect();
        let mut out: Vec<&mut [f64]> = space.results.iter_mut().map(Vec::as_mut_slice).collect();
        e.samples.run(wanted, &inputs, self.samples, &mut space.registers, &mut out);
    }

    /// Noisy channels without the noise that explains the residuals best, v̂ = ΣLᵀλ; `sources` holds Σ over
    /// equations of conj(L)λ of each noisy signal on `count` lines from `first` on.
    #[allow(clippy::too_many_arguments)]
    pub fn denoised(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        at: &Place<'_>,
        sources: &[Split],
        (count, first): (usize, usize),
        space: &mut LinesWorkspace,
    ) -> Vec<Vec<f64>> {
        self.formulas(e, at, &[], |k| k >= e.signals.len(), space);
        let lead = self.window.lead;
        let mut clean: Vec<Vec<f64>> = e.noisy.iter().map(|c| at.channels[*c].to_vec()).collect();
        for (s, own) in pairs.noisy.iter().zip(sources) {
            self.noise.wave(isa, own, count, first, &mut space.wave);
            let each = e.sensitivities.iter().enumerate().filter(|(_, (signal, _))| signal == s);
            for (k, (_, d)) in each {
                let slope = &space.results[e.signals.len() + k][lead..];
                for (c, clean) in clean.iter_mut().enumerate() {
                    let both = at.sigma.get(c, *d);
                    if both == 0.0 {
                        continue;
                    }
                    let own = clean[lead..].iter_mut().zip(space.wave.iter().zip(slope));
                    match self.uneven_product(c, *d) {
                        None => own.for_each(|(to, (w, d))| *to -= both * d * w),
                        Some(uneven) => {
                            for ((to, (w, d)), own) in own.zip(uneven) {
                                *to -= both * own * d * w;
                            }
                        }
                    }
                }
            }
        }
        clean
    }

    /// The highest line up to `wide` on which a noisy channel shows more than its noise.
    ///
    /// Differences take out what the ends leak, as for the noise level; five neighbours are averaged.
    pub fn signal_edge(
        &self,
        isa: Isa,
        channels: &[&[f64]],
        noisy: &[usize],
        variances: &[f64],
        order: usize,
        wide: usize,
    ) -> Result<usize, Error> {
        let (q, n) = (order + 2, self.window.intervals);
        let top = (wide + q + SPREAD).min(n / 2);
        let plan = CoefficientPlan::new(n, top, Kind::Rule(Rule::Trapezoid), 0.0, 0)?;
        let (mut re, mut im) = (vec![0.0; top + 1], vec![0.0; top + 1]);
        let mut scratch = plan.scratch();
        let choose: f64 = (1..=q).map(|i| (q + i) as f64 / i as f64).product();
        let mut edge = 0;
        for (channel, variance) in noisy.iter().zip(variances) {
            let samples = &channels[*channel][self.window.lead..];
            plan.run_in(isa, samples, &mut re, &mut im, &mut scratch)?;
            for part in [&mut re, &mut im] {
                for round in 0..q {
                    for m in 0..top.saturating_sub(round) {
                        part[m] = part[m + 1] - part[m];
                    }
                }
            }
            let noise = choose * plan.unit_variance() * variance;
            let power = |m: usize| (re[m] * re[m] + im[m] * im[m]) / noise;
            let loud = |m: &usize| {
                (m - SPREAD..=m + SPREAD).map(power).sum::<f64>() > LOUD * (2 * SPREAD + 1) as f64
            };
            let last = (SPREAD..top.saturating_sub(q + SPREAD)).rev().find(loud);
            edge = edge.max(last.map_or(0, |m| m + q / 2 + SPREAD));
        }
        Ok(edge)
    }

    /// Σ of both sensitivities times the covariance of the sample, on the window.
    fn product(
        &self,
        e: &Equations,
        list: &[(usize, usize)],
        sigma: &Sigma,
        space: &mut LinesWorkspace,
    ) {
        let (first, n) = (self.window.lead, self.window.intervals);
        let signals = e.signals.len();
        space.product.resize(n + 1, 0.0);
        space.product.fill(0.0);
        for (a, b) in list {
            let (c, d) = (e.sensitivities[*a].1, e.sensitivities[*b].1);
            let both = sigma.get(c, d);
            if both == 0.0 {
                continue;
            }
            let (a, b) =
                (&space.results[signals + a][first..], &space.results[signals + b][first..]);
            let each = space.product.iter_mut().zip(a).zip(b);
            match self.uneven_product(c, d) {
                None => each.for_each(|((to, a), b)| *to += both * a * b),
                Some(own) => each.zip(own).for_each(|(((to, a), b), v)| *to += both * v * a * b),
            }
        }
    }

    /// Roots of the variances of each sample of the window over those of the channels, multiplied; none where all are one.
    fn uneven_product(&self, c: usize, d: usize) -> Option<impl Iterator<Item = f64>> {
        let (c, d) = (self.uneven.get(c)?, self.uneven.get(d)?);
        let lead = self.window.lead;
        Some(
            c[lead..].iter().zip(&d[lead..]).map(|(c, d)| if c == d { *c } else { (c * d).sqrt() }),
        )
    }

    /// The product where it is the same for all samples.
    fn constant_product(
        &self,
        e: &Equations,
        list: &[(usize, usize)],
        sigma: &Sigma,
    ) -> Option<f64> {
        let slope = |k: usize| e.samples.constant(e.signals.len() + k);
        list.iter().try_fold(0.0, |sum, (a, b)| {
            let (c, d) = (e.sensitivities[*a].1, e.sensitivities[*b].1);
            let both = sigma.get(c, d);
            match self.uneven.get(c) {
                _ if both == 0.0 => Some(sum),
                None => Some(sum + both * slope(*a)? * slope(*b)?),
                Some(_) => None,
            }
        })
    }
}

/// The largest size, in eight at a time; NaN counts for nothing.
fn largest(all: &[f64]) -> f64 {
    let (eights, rest) = all.as_chunks::<LANES>();
    let mut most = [0.0f64; LANES];
    for own in eights {
        for (most, x) in most.iter_mut().zip(own) {
            let x = x.abs();
            *most = if x > *most { x } else { *most };
        }
    }
    most.iter().chain(rest).fold(0.0, |most, x| most.max(x.abs()))
}
