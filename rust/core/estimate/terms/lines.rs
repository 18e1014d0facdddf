//! From samples to the lines: coefficients of every signal, and of the products of sensitivities that the
//! covariance of the lines is made of.

use super::complex::C;
use super::equations::{Equations, Lag};
use crate::error::Error;
use crate::estimate::fit::Time;
use crate::estimate::window::Window;
use crate::math::{root_of_unity, sin_cos_turns_1};
use crate::modulation::Lines;
use crate::quadrature::Rule;
use crate::simd::Isa;
use crate::spectrum::{CoefficientPlan, Kind, Scratch};
use crate::tape::Input;

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
    /// Of products of sensitivities.
    noise: NoisePlan,
    /// Variance of each sample over the channel's, a noisy channel; empty: all one.
    pub uneven: Vec<Vec<f64>>,
}

/// Sums Σ w_k² p_k e^{−2πi l t_k/T} over a window.
enum NoisePlan {
    Even { plan: Box<CoefficientPlan>, squares: f64, roots: Vec<(f64, f64)> },
    Uneven { squares: Vec<f64>, turns: Vec<f64> },
}

/// Coefficients of one record at one θ.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// V of each signal from line 0 on.
    pub signals: Vec<Vec<C>>,
    /// R of each pair of noisy signals, lags from 0 on.
    pub pairs: Vec<Vec<C>>,
}

/// Which signals are noisy, and where the products of two of them stand.
#[derive(Debug, Clone)]
pub(crate) struct Pairs {
    /// Noisy signals in terms.
    pub noisy: Vec<usize>,
    /// `place[signal][position in noisy]`: the pair, or none.
    pub place: Vec<Vec<Option<usize>>>,
    /// The sensitivities of both signals that have a channel in common, a pair: (first, second, channel).
    products: Vec<Vec<(usize, usize, usize)>>,
}

/// Memory of one worker for [`TermsRecordPlan::load`].
#[derive(Debug, Default)]
pub(crate) struct Desk {
    registers: Vec<f64>,
    results: Vec<Vec<f64>>,
    product: Vec<f64>,
    re: Vec<f64>,
    im: Vec<f64>,
    scratch: Scratch,
}

impl Pairs {
    pub fn new(e: &Equations) -> Pairs {
        let sensed = |s: usize| e.sensitivities.iter().any(|(signal, _)| *signal == s);
        let used = |s: usize| e.terms.iter().any(|t| t.signal == s);
        let noisy: Vec<usize> = (0..e.signals.len()).filter(|s| used(*s) && sensed(*s)).collect();
        let own = |s: usize| {
            let each = e.sensitivities.iter().enumerate();
            each.filter(move |(_, (signal, _))| *signal == s).map(|(k, (_, c))| (k, *c))
        };
        let mut products: Vec<Vec<(usize, usize, usize)>> = Vec::new();
        let mut place = vec![vec![None; noisy.len()]; e.signals.len()];
        for (s, places) in place.iter_mut().enumerate() {
            for (j, other) in noisy.iter().enumerate() {
                let mut list: Vec<(usize, usize, usize)> = own(s)
                    .flat_map(|(a, c)| {
                        own(*other)
                            .filter(move |(_, d)| *d == c)
                            .map(move |(b, _)| (a.min(b), a.max(b), c))
                    })
                    .collect();
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
        Pairs { noisy, place, products }
    }
}

impl TermsRecordPlan {
    pub fn new(
        e: &Equations,
        samples: usize,
        time: Time<'_>,
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
        let plan = |(s, signal): (usize, &super::Signal)| match time {
            Time::Uneven(t) => CoefficientPlan::uneven(t, highest, signal.kind),
            Time::Even(dt) => {
                let start = match signal.lag {
                    Lag::Known(_) => e.lag(s, &[]),
                    Lag::Parameter(_) => 0.0,
                };
                CoefficientPlan::new(
                    window.intervals,
                    highest,
                    signal.kind,
                    start / dt,
                    window.lead,
                )
            }
        };
        let plans = e.signals.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        let n = window.intervals;
        let noise = match time {
            Time::Even(_) => {
                let lags = (2 * highest).min(n / 2);
                let plan = CoefficientPlan::new(n, lags, Kind::Rule(Rule::Staircase), 0.0, 0)?;
                // The rule's end weights are left to the mean of their squares, as linear models do: so the
                // lines of a linear equation are independent, and the two agree to all digits.
                let squares = rule.weights(n)?.iter().map(|w| w * w).sum::<f64>() / (n * n) as f64;
                let roots = (0..n as u64).map(|k| root_of_unity(k, n as u64)).collect();
                NoisePlan::Even { plan: Box::new(plan), squares, roots }
            }
            Time::Uneven(t) => {
                let span = t[n] - t[0];
                let weights = rule.uneven_weights(t)?;
                let squares = weights.iter().map(|q| (q / span) * (q / span)).collect();
                let turns = t.iter().map(|x| (x - t[0]) / span).collect();
                NoisePlan::Uneven { squares, turns }
            }
        };
        let dt = if let Time::Even(dt) = time { dt } else { f64::NAN };
        Ok(TermsRecordPlan { samples, dt, window, highest, plans, noise, uneven })
    }

    /// The lines from `first` to `last`.
    pub fn lines(&self, first: usize, last: usize) -> Lines {
        let unit_variance = match &self.noise {
            NoisePlan::Even { squares, .. } => *squares,
            NoisePlan::Uneven { squares, .. } => squares.iter().sum(),
        };
        Lines { first, last, omega0: self.window.omega0, unit_variance }
    }

    /// Coefficients of all signals, and of all pairs of sensitivities, at θ.
    #[allow(clippy::too_many_arguments)]
    pub fn load(
        &self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        channels: &[&[f64]],
        variances: &[f64],
        theta: &[f64],
        clean: &[Vec<f64>],
        desk: &mut Desk,
        out: &mut Spectra,
    ) -> Result<(), Error> {
        self.formulas(e, channels, variances, theta, &[], desk);
        let count = self.highest + 1;
        desk.re.resize(count, 0.0);
        desk.im.resize(count, 0.0);
        out.signals.resize_with(e.signals.len(), Vec::new);
        for (s, signal) in e.signals.iter().enumerate() {
            let late;
            let plan = match signal.lag {
                Lag::Known(_) => &self.plans[s],
                Lag::Parameter(_) => {
                    let delay = e.lag(s, theta) / self.dt;
                    let Window { intervals, lead, .. } = self.window;
                    late = CoefficientPlan::new(intervals, self.highest, signal.kind, delay, lead)?;
                    &late
                }
            };
            plan.run_in(isa, &desk.results[s], &mut desk.re, &mut desk.im, &mut desk.scratch)?;
            // A constant is on line 0 alone: what rounding leaves elsewhere must not pass for a column.
            let size = desk.results[s].iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let sound = |x: f64| if x.abs() < ROUNDING * size { 0.0 } else { x };
            out.signals[s].clear();
            let each = desk.re.iter().zip(&desk.im);
            out.signals[s].extend(each.map(|(re, im)| C(sound(*re), sound(*im))));
        }
        if !clean.is_empty() {
            // The slopes at channels that noise has been taken from.
            self.formulas(e, channels, variances, theta, clean, desk);
        }
        out.pairs.resize_with(pairs.products.len(), Vec::new);
        for (at, list) in pairs.products.iter().enumerate() {
            self.product(e, list, variances, desk);
            self.correlate(isa, desk, &mut out.pairs[at])?;
        }
        Ok(())
    }

    /// Signals and sensitivities, sample by sample; noisy channels from `clean` where given.
    fn formulas(
        &self,
        e: &Equations,
        channels: &[&[f64]],
        variances: &[f64],
        theta: &[f64],
        clean: &[Vec<f64>],
        desk: &mut Desk,
    ) {
        desk.results.resize_with(e.samples.results(), Vec::new);
        for r in &mut desk.results {
            r.resize(self.samples, 0.0);
        }
        let mut own: Vec<&[f64]> = channels.to_vec();
        for (channel, values) in e.noisy.iter().zip(clean) {
            own[*channel] = values;
        }
        let values = variances.iter().chain(theta).map(|v| Input::Value(*v));
        let inputs: Vec<Input<'_>> = own.iter().map(|c| Input::Series(c)).chain(values).collect();
        e.samples.run(&inputs, self.samples, &mut desk.registers, &mut desk.results);
    }

    /// Noisy channels without the noise that explains the residuals best, v̂ = ΣLᵀλ; `sources` holds Σ over
    /// equations of conj(L)λ of each noisy signal on the lines from `first` on.
    #[allow(clippy::too_many_arguments)]
    pub fn denoised(
        &self,
        e: &Equations,
        pairs: &Pairs,
        channels: &[&[f64]],
        variances: &[f64],
        theta: &[f64],
        (sources, first): (&[C], usize),
        desk: &mut Desk,
    ) -> Vec<Vec<f64>> {
        self.formulas(e, channels, variances, theta, &[], desk);
        let (lead, n) = (self.window.lead, self.window.intervals);
        let count = sources.len() / pairs.noisy.len().max(1);
        let mut clean: Vec<Vec<f64>> = e.noisy.iter().map(|c| channels[*c].to_vec()).collect();
        let mut wave = vec![0.0; n + 1];
        for (s, own) in pairs.noisy.iter().zip(sources.chunks_exact(count.max(1))) {
            wave.fill(0.0);
            for (at, source) in own.iter().enumerate() {
                self.add_wave(first + at, *source, &mut wave);
            }
            let each = e.sensitivities.iter().enumerate().filter(|(_, (signal, _))| signal == s);
            for (at, (_, c)) in each {
                let slope = &desk.results[e.signals.len() + at][lead..];
                for (k, (w, d)) in wave.iter().zip(slope).enumerate() {
                    let uneven = self.uneven.get(*c).map_or(1.0, |v| v[lead + k]);
                    clean[*c][lead + k] -= variances[*c] * uneven * self.weight(k) * d * w;
                }
            }
        }
        clean
    }

    /// Adds Re of `source` times e^{imω₀t} to every sample of the window.
    fn add_wave(&self, line: usize, source: C, wave: &mut [f64]) {
        match &self.noise {
            NoisePlan::Even { roots, .. } => {
                // The phase of sample k is the root number line·k, counted modulo their number.
                let (step, mut at) = (line % roots.len(), 0);
                for w in wave {
                    let (cos, sin) = roots[at];
                    *w += source.0 * cos - source.1 * sin;
                    at += step;
                    if at >= roots.len() {
                        at -= roots.len();
                    }
                }
            }
            NoisePlan::Uneven { turns, .. } => {
                for (w, turn) in wave.iter_mut().zip(turns) {
                    let (sin, cos) = sin_cos_turns_1(line as f64 * turn);
                    *w += source.0 * cos - source.1 * sin;
                }
            }
        }
    }

    /// Share of sample `k` in a coefficient.
    fn weight(&self, k: usize) -> f64 {
        match &self.noise {
            NoisePlan::Even { .. } => 1.0 / self.window.intervals as f64,
            NoisePlan::Uneven { squares, .. } => squares[k].sqrt(),
        }
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

    /// Σ over channels of both sensitivities times the variance of the sample, on the window.
    fn product(
        &self,
        e: &Equations,
        list: &[(usize, usize, usize)],
        variances: &[f64],
        desk: &mut Desk,
    ) {
        let (first, n) = (self.window.lead, self.window.intervals);
        let signals = e.signals.len();
        desk.product.clear();
        desk.product.resize(n + 1, 0.0);
        for (a, b, c) in list {
            let (a, b) = (&desk.results[signals + a][first..], &desk.results[signals + b][first..]);
            match self.uneven.get(*c) {
                None => {
                    for ((to, a), b) in desk.product.iter_mut().zip(a).zip(b) {
                        *to += variances[*c] * a * b;
                    }
                }
                Some(own) => {
                    let each = desk.product.iter_mut().zip(a).zip(b).zip(&own[first..]);
                    for (((to, a), b), v) in each {
                        *to += variances[*c] * v * a * b;
                    }
                }
            }
        }
    }

    /// R(l) of what stands in the desk's product.
    fn correlate(&self, isa: Isa, desk: &mut Desk, out: &mut Vec<C>) -> Result<(), Error> {
        let n = self.window.intervals;
        out.clear();
        match &self.noise {
            NoisePlan::Even { plan, squares, .. } => {
                // The window's last sample has the phase of its first, and both count half.
                desk.product[0] = 0.5 * (desk.product[0] + desk.product[n]);
                let lags = plan.harmonics() + 1;
                desk.re.resize(lags, 0.0);
                desk.im.resize(lags, 0.0);
                plan.run_in(isa, &desk.product, &mut desk.re, &mut desk.im, &mut desk.scratch)?;
                let each = desk.re.iter().zip(&desk.im);
                out.extend(each.map(|(re, im)| C(*re, *im) * *squares));
                // Lags above N/2 are those of the mirrored sum.
                for lag in lags..=2 * self.highest {
                    out.push(out[n - lag].conj());
                }
                desk.re.resize(self.highest + 1, 0.0);
                desk.im.resize(self.highest + 1, 0.0);
            }
            NoisePlan::Uneven { squares, turns } => {
                for lag in 0..=2 * self.highest {
                    let mut sum = C(0.0, 0.0);
                    for ((p, w), t) in desk.product.iter().zip(squares).zip(turns) {
                        let (sin, cos) = sin_cos_turns_1(-(lag as f64) * t);
                        sum += C(cos, sin) * (p * w);
                    }
                    out.push(sum);
                }
            }
        }
        Ok(())
    }
}
