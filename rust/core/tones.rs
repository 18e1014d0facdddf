//! Sinusoids in noise (report, section 4.10): frequencies, dampings, amplitudes and phases of a record.
//!
//! y(k) = trend + Σ A_i e^{−d_i k} cos(ω_i k + φ_i) + noise, k = 0…n−1. Tones are found one after another on
//! a zero-padded spectrum of what the others leave (`search`) and settled together by Gauss–Newton steps on the
//! samples, amplitudes and trend eliminated (`refine`): the maximum likelihood estimate for white noise. Where lines
//! around the tones are asked for, `ml` sees these alone, and `awls` weighs them by the last estimate (`lines`). Time
//! is counted in samples here, frequencies in turns a sample.

mod awls;
mod lines;
mod refine;
mod search;

use crate::math::ln_1;
use crate::simd::Isa;
use crate::threads::{self, Control};
use crate::{Error, Status};
use lines::Lines;
use refine::Refiner;
use search::{Search, State};

/// Part of the sum of squares that may be rounding.
const ROUNDING: f64 = 1e-16;
/// Records a thread takes at a time.
const CHUNK: usize = 8;

/// What is looked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Number of tones, or the largest number.
    pub count: usize,
    /// Whether the number is chosen, by BIC.
    pub choose: bool,
    /// Whether tones may decay or grow.
    pub damped: bool,
    /// Whether samples are complex: all real parts, then all imaginary parts.
    pub complex: bool,
    /// Unknowns of the trend: 0, 1 (constant) or 2 (linear).
    pub trend: usize,
    /// Where tones are looked for, turns a sample.
    pub band: (f64, f64),
    /// Lines on each side of a tone that are fitted in the end; 0: the samples.
    pub lines: usize,
    /// Whether these lines are fitted by reweighting (real records) instead of maximum likelihood.
    pub awls: bool,
}

/// One tone: frequency (turns a sample) and damping (a sample).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Turns a sample.
    pub frequency: f64,
    /// d of e^{−dk}.
    pub damping: f64,
}

/// The outcome for one record.
#[derive(Debug, Clone)]
pub struct Found {
    /// Ok, or why not.
    pub status: Status,
    /// Tones, by frequency.
    pub tones: Vec<Tone>,
    /// Amplitudes at the first sample.
    pub amplitude: Vec<f64>,
    /// Phases at the first sample, radians.
    pub phase: Vec<f64>,
    /// Coefficients of 1 and (k − (n−1)/2)/n; complex records: real and imaginary part of each.
    pub trend: Vec<f64>,
    /// Covariance of angular frequencies (radians a sample), dampings (where free), amplitudes and phases, row major.
    pub cov: Vec<f64>,
    /// Weighted sum of squares of what is left.
    pub cost: f64,
    /// Variance of the noise.
    pub variance: f64,
    /// Degrees of freedom of `variance`.
    pub df: usize,
    /// Costs of 0, 1, … tones as the search found them.
    pub costs: Vec<f64>,
    /// Gauss–Newton steps of the last refinement.
    pub nit: usize,
}

/// What the samples of a record do not change.
#[derive(Debug, Clone)]
pub struct Plan {
    options: Options,
    weights: Vec<f64>,
    good: usize,
    search: Search,
    isa: Isa,
}

impl Plan {
    /// For records of `weights.len()` samples, each counted with its weight (0: left out).
    ///
    /// # Errors
    /// [`Error::Data`] where there are too few samples for the unknowns.
    pub fn new(weights: &[f64], options: Options, isa: Isa) -> Result<Plan, Error> {
        let good =
            weights.iter().filter(|w| **w > 0.0).count() * if options.complex { 2 } else { 1 };
        let needs = unknowns(&options, options.count);
        if good <= needs {
            return Err(Error::Data(format!(
                "sinusoids: {} tones and the trend have {needs} unknowns, and there are {good} real numbers to find \
                 them from; look for fewer tones, or give a longer record",
                options.count
            )));
        }
        let search = Search::new(weights, &options);
        Ok(Plan { options, weights: weights.to_vec(), good, search, isa })
    }

    /// Real numbers in a record.
    #[must_use]
    pub fn length(&self) -> usize {
        self.weights.len() * if self.options.complex { 2 } else { 1 }
    }

    /// Finds the tones of records, each of [`Plan::length`] numbers.
    ///
    /// # Errors
    /// [`Error::Cancelled`] where `progress` says so.
    pub fn run_many(
        &self,
        records: &[&[f64]],
        threads: usize,
        progress: &mut dyn FnMut(usize, usize) -> Control,
    ) -> Result<Vec<Found>, Error> {
        let chunks = records.len().div_ceil(CHUNK);
        let few = if records.len() == 1 { 0 } else { threads };
        let work = |refiner: &mut Refiner, chunk: usize| {
            let mut found = Vec::with_capacity(CHUNK);
            for record in records.iter().skip(chunk * CHUNK).take(CHUNK) {
                if threads::stopped() {
                    break;
                }
                found.push(self.run(record, refiner));
            }
            found
        };
        let report =
            &mut |done: usize, _: usize| progress((done * CHUNK).min(records.len()), records.len());
        let found = threads::run(few, chunks, report, || self.refiner(), work)?;
        Ok(found.into_iter().flatten().collect())
    }

    fn refiner(&self) -> Refiner {
        Refiner::new(&self.weights, &self.options, self.isa)
    }

    fn run(&self, samples: &[f64], refiner: &mut Refiner) -> Found {
        if samples.iter().any(|x| !x.is_finite()) {
            return self.nothing(Status::NonFinite);
        }
        refiner.take(samples);
        let levels = self.search.run(refiner);
        let costs: Vec<f64> = levels.iter().map(|state| state.cost).collect();
        let count = if self.options.choose { self.chosen(&costs) } else { self.options.count };
        let Some(state) = levels.get(count) else {
            // Nothing was left to find a further tone in.
            return Found { costs, ..self.nothing(Status::Rank) };
        };
        self.settled(state, costs, refiner)
    }

    fn settled(&self, state: &State, costs: Vec<f64>, refiner: &mut Refiner) -> Found {
        let (mut tones, mut cost, mut nit, mut status) =
            (state.tones.clone(), state.cost, 0, Status::Ok);
        if !tones.is_empty() {
            (cost, nit, status) = refiner.settle(&mut tones);
        }
        tones.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
        let trend = refiner.trend(&tones);
        let mut seen = self.good;
        let mut narrow;
        let mut sees = refiner;
        if self.options.lines > 0 && !tones.is_empty() {
            let lines =
                Lines::around(&tones, self.options.lines, self.weights.len(), self.options.complex);
            seen = lines.rows();
            narrow = sees.on(lines.clone(), &tones, self.isa);
            sees = &mut narrow;
            (nit, status) = if self.options.awls {
                awls::awls(sees, &lines, &mut tones, self.options.damped, self.isa)
            } else {
                let (_, nit, status) = sees.settle(&mut tones);
                (nit, status)
            };
            tones.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
            cost = sees.cost(&tones);
        }
        let frees = tones.len() * if self.options.damped { 4 } else { 3 };
        let trends = unknowns(&self.options, 0);
        let Some(df) = seen.checked_sub(frees + if self.options.lines > 0 { 0 } else { trends })
        else {
            return Found { costs, ..self.nothing(Status::Rank) };
        };
        let variance = cost / df as f64;
        let solved = sees.solve(&tones, variance);
        Found {
            status: if solved.independent { status } else { Status::Rank },
            amplitude: solved.amplitude,
            phase: solved.phase,
            trend,
            cov: solved.cov,
            tones,
            cost,
            variance,
            df,
            costs,
            nit,
        }
    }

    /// n log cost + Σ log of what grows with the record: BIC in which a frequency (and a damping) counts three
    /// times, since what a record tells of it grows as n³.
    fn chosen(&self, costs: &[f64]) -> usize {
        let n = self.good as f64;
        let frees = if self.options.damped { 8.0 } else { 5.0 };
        let penalty = frees * ln_1(n);
        // What is left of tones without noise is rounding, in which there is no further tone.
        let least = (costs[0] * ROUNDING).max(f64::MIN_POSITIVE);
        let score = |k: usize| n * ln_1(costs[k].max(least)) + penalty * k as f64;
        (0..costs.len()).fold(0, |best, k| if score(k) < score(best) { k } else { best })
    }

    fn nothing(&self, status: Status) -> Found {
        Found {
            status,
            tones: Vec::new(),
            amplitude: Vec::new(),
            phase: Vec::new(),
            trend: Vec::new(),
            cov: Vec::new(),
            cost: f64::NAN,
            variance: f64::NAN,
            df: 0,
            costs: Vec::new(),
            nit: 0,
        }
    }
}

/// Real unknowns of `count` tones and the trend.
fn unknowns(options: &Options, count: usize) -> usize {
    let tones = count.saturating_mul(if options.damped { 4 } else { 3 });
    tones.saturating_add(options.trend.saturating_mul(if options.complex { 2 } else { 1 }))
}
