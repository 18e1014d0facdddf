//! One fit from samples to covariance: window, coefficients, default band, estimate.

use super::uncertainty::{Information, Residuals, mend_inverse};
use super::window::{Window, coefficient_plans};
use super::{Design, Options, Start, Wanted, Workspace, estimate};
use crate::error::{Error, Status};
use crate::modulation::Lines;
use crate::quadrature::{Hold, Rule};
use crate::simd::{Isa, LANES, Wide};
use crate::spectrum::Kind;
use crate::structure::{Method, Noise, Structure, Trend};

/// Standard errors may grow by this factor when the default band is narrowed.
const BAND_TOLERANCE: f64 = 1.01;

/// Sampling instants of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Time<'a> {
    /// A constant step in seconds.
    Even(f64),
    /// The instants themselves.
    Uneven(&'a [f64]),
}

/// One record's samples.
#[derive(Debug, Clone)]
pub struct RecordView<'a> {
    /// Output.
    pub y: &'a [f64],
    /// Inputs.
    pub u: Vec<&'a [f64]>,
    /// When.
    pub time: Time<'a>,
}

/// Which lines are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Band {
    /// By the default rule (docs/architecture.md, "Default band").
    Default,
    /// From and to, in rad/s.
    Edges(f64, f64),
    /// The report's M: the highest harmonic is M + n.
    Harmonics(usize),
}

/// Everything that says how a record is fitted.
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// Orders.
    pub structure: Structure,
    /// Known delay of each input in seconds.
    pub delays: Vec<f64>,
    /// How each input behaves between samples; `None` smooth.
    pub intersample: Vec<Option<Hold>>,
    /// Quadrature of smooth signals.
    pub rule: Rule,
    /// Estimator.
    pub method: Method,
    /// Where the noise enters.
    pub noise: Noise,
    /// Offset and drift.
    pub trend: Trend,
    /// All rows, or the report's range 0..M.
    pub extended: bool,
    /// Lines.
    pub band: Band,
    /// Iteration.
    pub options: Options,
}

/// What the default rule saw and chose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandRule {
    /// Highest line of the wide fit.
    pub wide: usize,
    /// Highest line of the narrow fit that gave the second start.
    pub narrow: usize,
    /// Cost on the wide band from `wls`, and from the narrow fit.
    pub costs: [f64; 2],
    /// Highest line chosen.
    pub chosen: usize,
}

/// A finished fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Estimates in the user's units.
    pub theta: Vec<f64>,
    /// Classical covariance, row major.
    pub cov_nonrobust: Vec<f64>,
    /// HC3 covariance, row major.
    pub cov_hc3: Vec<f64>,
    /// Normal matrix of the whitened columns with the transient projected out, unit diagonal.
    pub gram: Vec<f64>,
    /// Σ|r|²/(hS) in units of the output squared.
    pub cost: f64,
    /// Real equations less unknowns.
    pub degrees_of_freedom: usize,
    /// Noise standard deviation, √(cost/degrees of freedom): of the output's samples, or of the
    /// equation error's.
    pub sigma: f64,
    /// Outcome.
    pub status: Status,
    /// Iterations after the start.
    pub nit: u32,
    /// Lines of each record.
    pub lines: Vec<Lines>,
    /// Residuals on the lines of each record over σ: unit variance in Re and Im.
    pub residuals: Vec<Vec<(f64, f64)>>,
    /// The default rule's account.
    pub band_rule: Option<BandRule>,
}

impl FitOptions {
    /// Checks what does not depend on data.
    ///
    /// # Errors
    /// [`Error::Spec`] naming the option.
    pub fn check(&self) -> Result<(), Error> {
        let inputs = self.structure.numerators.len();
        if self.delays.len() != inputs || self.intersample.len() != inputs {
            return Err(Error::Spec(format!(
                "fitting: {inputs} inputs but {} delays and {} intersample kinds",
                self.delays.len(),
                self.intersample.len()
            )));
        }
        if let Some(bad) = self.delays.iter().find(|d| !(**d >= 0.0 && d.is_finite())) {
            return Err(Error::Spec(format!(
                "fitting: a delay of {bad} s; delays are finite and not negative"
            )));
        }
        Ok(())
    }

    /// Samples by which the window starts late so that delayed inputs are known in all of it.
    pub(crate) fn lead(&self, dt: f64) -> usize {
        let longest = self.delays.iter().fold(0.0, |m: f64, d| m.max(*d));
        (longest / dt - 1e-9).ceil().max(0.0) as usize
    }

    /// Kind of each channel: output first.
    pub(crate) fn kinds(&self) -> Vec<Kind> {
        let input = |h: &Option<Hold>| h.map_or(Kind::Rule(self.rule), Kind::Hold);
        std::iter::once(Kind::Rule(self.rule)).chain(self.intersample.iter().map(input)).collect()
    }

    /// Real unknowns of the default rule's guideline: parameters and trend terms.
    fn unknowns(&self) -> usize {
        self.structure.parameters()
            + usize::from(self.trend != Trend::None)
            + usize::from(self.trend == Trend::Linear)
    }

    /// Highest lines of the default rule for a window of `intervals`: wide, narrow.
    ///
    /// `ls` and `wls` have no business with lines where noise rules: M = 3# (report, eq. 20).
    pub(crate) fn default_lines(&self, intervals: usize) -> (usize, usize) {
        let narrow = 3 * self.unknowns() + self.structure.order;
        let wide = (intervals / 8).max((intervals / 4).min(16));
        match self.method {
            Method::Ls | Method::Wls => {
                let only = narrow.min(intervals / 2);
                (only, only)
            }
            _ => (wide, narrow.min(wide)),
        }
    }
}

/// Coefficients of all channels of a record up to some line.
struct Spectra {
    window: Window,
    unit_variance: f64,
    channels: Vec<(Vec<f64>, Vec<f64>)>,
}

fn spectra(
    r: &RecordView<'_>,
    o: &FitOptions,
    window: Window,
    highest: usize,
) -> Result<Spectra, Error> {
    let plans = coefficient_plans(o, r.time, window, highest)?;
    let mut channels = Vec::with_capacity(plans.len());
    for (plan, samples) in plans.iter().zip(std::iter::once(&r.y).chain(&r.u)) {
        let (mut re, mut im) = (vec![0.0; highest + 1], vec![0.0; highest + 1]);
        plan.run(samples, &mut re, &mut im)?;
        channels.push((re, im));
    }
    Ok(Spectra { window, unit_variance: plans[0].unit_variance(), channels })
}

/// Fits one structure to one or several records.
///
/// # Errors
/// [`Error::Spec`] and [`Error::Data`] for what the caller can mend; failures of the numbers are a
/// [`Status`] of the result.
pub fn fit(records: &[RecordView<'_>], o: &FitOptions, isa: Isa) -> Result<Fit, Error> {
    o.check()?;
    let most = records.iter().map(|r| r.y.len()).max().unwrap_or(0);
    if o.structure.parameters() > most {
        // Said before anything of that size is laid out.
        return Err(Error::Data(format!(
            "fitting: {} parameters from at most {most} samples a record; take fewer poles and zeros",
            o.structure.parameters()
        )));
    }
    if records.is_empty() {
        return Err(Error::Data("fitting: no record was given".into()));
    }
    let mut ranges = Vec::with_capacity(records.len());
    let mut all = Vec::with_capacity(records.len());
    for r in records {
        if r.u.len() != o.structure.numerators.len() {
            return Err(Error::Data(format!(
                "fitting: the structure has {} inputs but a record has {}",
                o.structure.numerators.len(),
                r.u.len()
            )));
        }
        let window = Window::new(r.y.len(), r.time, o)?;
        let (wide, narrow) = o.default_lines(window.intervals);
        let range = window.given(o)?;
        ranges.push((range.unwrap_or((0, wide)), narrow));
        all.push(spectra(r, o, window, range.map_or(wide, |r| r.1))?);
    }
    let job = Job { o, isa, all: &all };
    let chosen: Vec<(usize, usize)> = ranges.iter().map(|r| r.0).collect();
    let adapts = o.noise == Noise::Output && matches!(o.method, Method::Awls | Method::Ml);
    if o.band != Band::Default || !adapts {
        return job.finish(&chosen, Start::Wls, None);
    }
    let narrow: Vec<(usize, usize)> = ranges.iter().map(|r| (0, r.1)).collect();
    let (chosen, rule, theta) = job.default_band(&chosen, &narrow)?;
    match theta {
        Some(theta) => job.finish(&chosen, Start::Theta(&theta), Some(rule)),
        None => job.finish(&chosen, Start::Wls, Some(rule)),
    }
}

struct Job<'a> {
    o: &'a FitOptions,
    isa: Isa,
    all: &'a [Spectra],
}

const LIVE: [bool; LANES] = {
    let mut live = [false; LANES];
    live[0] = true;
    live
};

impl Job<'_> {
    /// Design and loaded workspace for lines (first, last) a record.
    fn prepare(&self, ranges: &[(usize, usize)]) -> Result<(Design, Workspace), Error> {
        let o = self.o;
        let lines: Vec<Lines> = ranges
            .iter()
            .zip(self.all)
            .map(|((first, last), s)| Lines {
                first: *first,
                last: *last,
                omega0: s.window.omega0,
                unit_variance: s.unit_variance,
            })
            .collect();
        let mut d = Design::new(&o.structure, o.method, o.noise, o.trend, o.extended, &lines)?;
        let units = self.units();
        d.set_units(&units);
        let mut w = Workspace::new(&d);
        for (k, (s, lines)) in self.all.iter().zip(d.lines()).enumerate() {
            for (signal, (re, im)) in s.channels.iter().enumerate() {
                let (to_re, to_im) = w.signal_mut(k, signal);
                for (i, m) in (lines.first..=lines.last).enumerate() {
                    to_re[i] = Wide::splat(re[m] / units[signal]);
                    to_im[i] = Wide::splat(im[m] / units[signal]);
                }
            }
        }
        Ok((d, w))
    }

    /// Power of two at the size of each channel over all records; 1 where there is none.
    fn units(&self) -> Vec<f64> {
        let channels = self.all.first().map_or(0, |s| s.channels.len());
        let size = |k: usize| {
            let parts =
                self.all.iter().flat_map(|s| s.channels[k].0.iter().chain(&s.channels[k].1));
            parts.fold(0.0, |most: f64, v| most.max(v.abs()))
        };
        let power = |x: f64| f64::from_bits(x.to_bits() & (0x7ff << 52));
        (0..channels)
            .map(|k| Some(power(size(k))).filter(|p| p.is_normal()).unwrap_or(1.0))
            .collect()
    }

    /// Runs without covariance: cost, θ, and whether it may be used.
    fn trial(&self, d: &Design, w: &mut Workspace, start: Start<'_>) -> (f64, Option<Vec<f64>>) {
        let options = Options { wanted: Wanted::Cost, ..self.o.options };
        let outcome = estimate(self.isa, d, w, LIVE, start, &options);
        let usable = matches!(outcome.status[0], Status::Ok | Status::MaxIter);
        match usable {
            true => (w.cost(0) * d.cost_unit() * d.cost_unit(), Some(w.theta(d, 0).collect())),
            false => (f64::INFINITY, None),
        }
    }

    /// The default rule: fit wide from `wls` and from the narrow fit, keep the lower cost; then the
    /// fewest lines that keep every standard error within 1 % of the wide one's at equal σ.
    #[allow(clippy::type_complexity)]
    fn default_band(
        &self,
        wide: &[(usize, usize)],
        narrow: &[(usize, usize)],
    ) -> Result<(Vec<(usize, usize)>, BandRule, Option<Vec<f64>>), Error> {
        let (d, mut w) = self.prepare(wide)?;
        let last = |r: &[(usize, usize)]| r.iter().map(|r| r.1).max().unwrap_or(0);
        let (first_cost, first) = self.trial(&d, &mut w, Start::Wls);
        let mut rule = BandRule {
            wide: last(wide),
            narrow: last(narrow),
            costs: [first_cost, f64::INFINITY],
            chosen: last(wide),
        };
        let mut best = first;
        if narrow != wide
            && let Ok((dn, mut wn)) = self.prepare(narrow)
            && let (_, Some(start)) = self.trial(&dn, &mut wn, Start::Wls)
        {
            let (cost, second) = self.trial(&d, &mut w, Start::Theta(&start));
            rule.costs[1] = cost;
            if cost < first_cost {
                best = second;
            } else if let Some(theta) = &best {
                // The workspace must stand at the estimate that is kept.
                self.trial(&d, &mut w, Start::Theta(theta));
            }
        }
        let Some(theta) = best else { return Ok((wide.to_vec(), rule, None)) };
        let chosen = self.narrowest(&d, &mut w, wide);
        rule.chosen = last(&chosen);
        Ok((chosen, rule, Some(theta)))
    }

    /// The fewest lines whose standard errors at equal σ stay within the tolerance; standard errors
    /// fall as lines join, so halving finds them.
    fn narrowest(
        &self,
        d: &Design,
        w: &mut Workspace,
        wide: &[(usize, usize)],
    ) -> Vec<(usize, usize)> {
        let longest = self.all.iter().map(|s| s.window.omega0).fold(f64::INFINITY, f64::min);
        let edge = wide
            .iter()
            .zip(self.all)
            .fold(0.0, |e: f64, (r, s)| e.max(r.1 as f64 * s.window.omega0));
        let up_to = |steps: usize| -> Vec<(usize, usize)> {
            let omega = steps as f64 * longest;
            wide.iter()
                .zip(self.all)
                .map(|(r, s)| (r.0, r.1.min((omega / s.window.omega0 + 1e-9) as usize).max(1)))
                .collect()
        };
        let top = (edge / longest + 0.5) as usize;
        let p = d.parameters();
        let mut errors = |ranges: &[(usize, usize)]| -> Option<Vec<f64>> {
            let mut equations = 0;
            for ((r, range), lines) in w.records.iter_mut().zip(ranges).zip(d.lines()) {
                r.limit = (range.1 + 1).saturating_sub(lines.first).min(r.lines);
                equations += 2 * r.limit - usize::from(lines.first == 0);
            }
            if equations <= d.parameters() + d.transient * w.records.len() {
                return None;
            }
            self.isa.run(Information { design: d, space: w, covariance: true });
            mend_inverse(d, w, 0);
            Some((0..p).map(|k| w.inverse[k * p + k].0[0]).collect())
        };
        let Some(reference) = errors(wide) else { return wide.to_vec() };
        let mut good = |steps: usize| {
            let limit = BAND_TOLERANCE * BAND_TOLERANCE;
            errors(&up_to(steps))
                .is_some_and(|v| v.iter().zip(&reference).all(|(v, r)| *v > 0.0 && *v <= limit * r))
        };
        let (mut low, mut high) = (0, top);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if good(middle) { high = middle } else { low = middle }
        }
        if high == top { wide.to_vec() } else { up_to(high) }
    }

    /// The estimate on the chosen lines with everything a user sees.
    fn finish(
        &self,
        ranges: &[(usize, usize)],
        start: Start<'_>,
        band_rule: Option<BandRule>,
    ) -> Result<Fit, Error> {
        let (d, mut w) = self.prepare(ranges)?;
        let options = Options { wanted: Wanted::Covariance, ..self.o.options };
        let outcome = estimate(self.isa, &d, &mut w, LIVE, start, &options);
        let p = d.parameters();
        let root: Vec<f64> = (0..p).map(|k| w.gram[k * p + k].0[0].sqrt()).collect();
        let gram = (0..p * p).map(|k| w.gram[k].0[0] / (root[k / p] * root[k % p])).collect();
        let degrees_of_freedom = d.degrees_of_freedom();
        let plain_sigma = (w.cost(0) / degrees_of_freedom as f64).sqrt();
        let mut residuals = Vec::new();
        self.isa.run(Residuals { design: &d, space: &mut w, out: &mut residuals });
        let over = |v: &[Wide; 2]| (v[0].0[0] / plain_sigma, v[1].0[0] / plain_sigma);
        Ok(Fit {
            theta: w.theta(&d, 0).collect(),
            cov_nonrobust: w.cov_nonrobust(&d, 0),
            cov_hc3: w.cov_hc3(&d, 0),
            gram,
            cost: w.cost(0) * d.cost_unit() * d.cost_unit(),
            degrees_of_freedom,
            sigma: plain_sigma * d.cost_unit(),
            status: outcome.status[0],
            nit: outcome.nit[0],
            lines: d.lines(),
            residuals: residuals.iter().map(|r| r.iter().map(over).collect()).collect(),
            band_rule,
        })
    }
}
