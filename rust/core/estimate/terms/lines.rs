//! From samples to the lines: coefficients of every signal, and of the products of sensitivities that the
//! covariance of the lines is made of.

use super::complex::C;
use super::equations::{Equations, Lag};
use crate::error::Error;
use crate::estimate::fit::Time;
use crate::estimate::window::Window;
use crate::math::sin_cos_turns_1;
use crate::modulation::Lines;
use crate::quadrature::Rule;
use crate::simd::Isa;
use crate::spectrum::{CoefficientPlan, Kind, Scratch};
use crate::tape::Input;

/// How one record becomes lines.
pub(crate) struct RecordPlan {
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
    Even { plan: Box<CoefficientPlan>, squares: Vec<f64> },
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

/// Memory of one worker for [`RecordPlan::load`].
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
        let noisy: Vec<usize> =
            (0..e.signals.len()).filter(|s| used(*s) && sensed(*s)).collect();
        let own = |s: usize| {
            let each = e.sensitivities.iter().enumerate();
            each.filter(move |(_, (signal, _))| *signal == s).map(|(k, (_, c))| (k, *c))
        };
        let mut products: Vec<Vec<(usize, usize, usize)>> = Vec::new();
        let mut place = vec![vec![None; noisy.len()]; e.signals.len()];
        for s in 0..e.signals.len() {
            for (j, other) in noisy.iter().enumerate() {
                let mut list: Vec<(usize, usize, usize)> = own(s)
                    .flat_map(|(a, c)| {
                        own(*other).filter(move |(_, d)| *d == c).map(move |(b, _)| (a.min(b), a.max(b), c))
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
                place[s][j] = Some(at);
            }
        }
        Pairs { noisy, place, products }
    }
}

impl RecordPlan {
    pub fn new(
        e: &Equations,
        samples: usize,
        time: Time<'_>,
        rule: Rule,
        highest: usize,
        uneven: Vec<Vec<f64>>,
    ) -> Result<RecordPlan, Error> {
        let window = Window::new(samples, time, e.longest_lag())?;
        let plan = |(s, signal): (usize, &super::Signal)| match time {
            Time::Uneven(t) => CoefficientPlan::uneven(t, highest, signal.kind),
            Time::Even(dt) => {
                let start = match signal.lag {
                    Lag::Known(_) => e.lag(s, &[]),
                    Lag::Parameter(_) => 0.0,
                };
                CoefficientPlan::new(window.intervals, highest, signal.kind, start / dt, window.lead)
            }
        };
        let plans = e.signals.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        let n = window.intervals;
        let noise = match time {
            Time::Even(_) => {
                let lags = (2 * highest).min(n / 2);
                let plan = CoefficientPlan::new(n, lags, Kind::Rule(Rule::Staircase), 0.0, 0)?;
                let by = 1.0 / n as f64;
                let squares = rule.weights(n)?.iter().map(|w| w * w * by).collect();
                NoisePlan::Even { plan: Box::new(plan), squares }
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
        Ok(RecordPlan { samples, dt, window, highest, plans, noise, uneven })
    }

    /// The lines from `first` to `last`.
    pub fn lines(&self, first: usize, last: usize) -> Lines {
        let unit_variance = match &self.noise {
            NoisePlan::Even { squares, .. } => squares.iter().sum::<f64>() / self.window.intervals as f64,
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
        desk: &mut Desk,
        out: &mut Spectra,
    ) -> Result<(), Error> {
        let results = e.samples.results();
        desk.results.resize_with(results, Vec::new);
        for r in &mut desk.results {
            r.resize(self.samples, 0.0);
        }
        let values = variances.iter().chain(theta).map(|v| Input::Value(*v));
        let inputs: Vec<Input<'_>> =
            channels.iter().map(|c| Input::Series(c)).chain(values).collect();
        e.samples.run(&inputs, self.samples, &mut desk.registers, &mut desk.results);
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
            out.signals[s].clear();
            out.signals[s].extend(desk.re.iter().zip(&desk.im).map(|(re, im)| C(*re, *im)));
        }
        out.pairs.resize_with(pairs.products.len(), Vec::new);
        for (at, list) in pairs.products.iter().enumerate() {
            self.product(e, list, variances, desk);
            self.correlate(isa, desk, &mut out.pairs[at])?;
        }
        Ok(())
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
            NoisePlan::Even { plan, squares } => {
                for (p, w) in desk.product.iter_mut().zip(squares) {
                    *p *= w;
                }
                // The window's last sample has the phase of its first.
                desk.product[0] += desk.product[n];
                let lags = plan.harmonics() + 1;
                desk.re.resize(lags, 0.0);
                desk.im.resize(lags, 0.0);
                plan.run_in(isa, &desk.product, &mut desk.re, &mut desk.im, &mut desk.scratch)?;
                out.extend(desk.re.iter().zip(&desk.im).map(|(re, im)| C(*re, *im)));
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
