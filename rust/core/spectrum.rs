//! From samples to Fourier coefficients V(m) = (1/T) ∫ v(t) e^{−imω₀t} dt, ω₀ = 2π/T, report eqs. (8), (21).
//!
//! A [`CoefficientPlan`] is made once for a window and serves any number of records: folded sums up to
//! [`FOLDED_HARMONICS`] harmonics, a real FFT above, direct sums for uneven samples.

mod folded;
mod held;
mod kind;
mod offset;
mod padded;
mod shifted;
mod sliding;
mod source;
mod tables;

use std::sync::Arc;

use modfun_fft::{Complex, RealToComplex};

use crate::Error;
use crate::math::sin_cos_turns_1;
use crate::quadrature::{Hold, Rule, Weights, cell_moments, check_times, times};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use folded::FoldedSums;
use held::HoldFactor;
pub use kind::Kind;
use offset::{levelled, offset, offsets};
pub use padded::Padded;
pub(crate) use shifted::Shifted;
pub use sliding::Sliding;
use source::{Between, Eight, One, Taps, weighted};

/// Harmonics up to which sums are folded (same bits in every lane and on every processor); above, an FFT.
pub const FOLDED_HARMONICS: usize = 64;
/// Part of a sample that rounding explains when a delay is divided by the step.
const ROUNDING: f64 = 1e-9;
/// Samples of a record that no machine holds.
const MOST: usize = 1 << 36;

/// Memory of one worker for one plan, from [`CoefficientPlan::scratch`]: only a plan's first call
/// for eight records allocates (its tables), and the first record with a large offset.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    wide: Vec<Wide>,
    record: Vec<f64>,
    /// Samples less an offset, of one record and of eight.
    level: Vec<f64>,
    wide_level: Vec<Wide>,
    one_re: Vec<f64>,
    one_im: Vec<f64>,
    real: Vec<f64>,
    complex: Vec<Complex<f64>>,
    work: Vec<Complex<f64>>,
}

/// Samples → coefficients V(0)…V(M) for one window, kind of signal and delay.
#[derive(Clone)]
pub struct CoefficientPlan {
    intervals: usize,
    harmonics: usize,
    kind: Kind,
    lead: usize,
    /// Sample that stands at the start of the window (the delay's whole part taken off).
    first: usize,
    /// Part of a sample by which the signal comes ahead of that sample's grid.
    ahead: f64,
    taps: Option<Taps>,
    unit_variance: f64,
    sums: Sums,
    holds: Vec<HoldFactor>,
    /// What the first two samples count in the jump at the window's ends, where that is kept.
    jump: Option<[f64; 2]>,
}

#[derive(Clone)]
enum Sums {
    /// Plans of one window and rule share them.
    Folded(Arc<FoldedSums>),
    Fft {
        weights: Weights,
        transform: Arc<dyn RealToComplex<f64>>,
    },
    Uneven {
        t: Vec<f64>,
        weights: Vec<f64>,
    },
}

impl CoefficientPlan {
    /// A plan for evenly spaced samples.
    ///
    /// * `intervals` N: intervals of the window, T = N·dt; a record of `lead` + N + 1 samples is needed.
    /// * `harmonics` M: coefficients 0…M, M ≤ N/2 (report eq. (22)).
    /// * `delay`: in samples, ≥ 0; the coefficients are those of v(t − delay·dt). Held signals are split
    ///   exactly within their cells, others interpolated through 6 samples.
    /// * `lead`: samples between the record's first and the start of the window, ≥ delay.
    ///
    /// # Errors
    /// [`Error::Spec`] for harmonics above N/2, a delay that is negative or longer than the lead, the
    /// parabolic rule with odd N; [`Error::Data`] for too few samples.
    pub fn new(
        intervals: usize,
        harmonics: usize,
        kind: Kind,
        delay: f64,
        lead: usize,
    ) -> Result<CoefficientPlan, Error> {
        if intervals.max(lead) > MOST {
            return Err(Error::Data(format!(
                "coefficients of {intervals} intervals that start {lead} samples late; take a shorter record"
            )));
        }
        // A held signal is the plain sum of its values, whatever happens inside the cells.
        let weights = match kind {
            Kind::Rule(rule) => Weights::new(rule, intervals)?,
            Kind::Hold(_) => Weights::new(Rule::Staircase, intervals)?,
        };
        check_harmonics(intervals, harmonics)?;
        if !(delay >= 0.0 && delay <= lead as f64 + ROUNDING) {
            return Err(Error::Spec(format!(
                "a delay of {delay} samples needs a window that starts between 0 and `lead` = {lead} samples late; give a delay ≥ 0 and a lead of at least the delay, rounded up"
            )));
        }
        // A hair beside a whole sample is that sample: 0.3 s over 0.1 s is not 2.9999999999999996.
        let near = delay.round();
        let delay = if (delay - near).abs() <= ROUNDING { near } else { delay };
        let whole = delay.ceil();
        let ahead = whole - delay;
        let first = lead - whole as usize;
        let mut plan = CoefficientPlan {
            intervals,
            harmonics,
            kind,
            lead,
            first,
            ahead,
            taps: None,
            unit_variance: weights.sum_of_squares() / (intervals as f64 * intervals as f64),
            sums: Sums::Uneven { t: Vec::new(), weights: Vec::new() },
            holds: Vec::new(),
            jump: None,
        };
        match kind {
            Kind::Hold(hold) => {
                let factor = |m| HoldFactor::new(hold, m, intervals, ahead);
                plan.holds = (0..=harmonics).map(factor).collect();
            }
            Kind::Rule(_) if ahead > 0.0 => plan.taps = Some(Taps::new(plan.samples(), ahead)?),
            Kind::Rule(_) => {}
        }
        plan.sums = if harmonics <= FOLDED_HARMONICS {
            Sums::Folded(Arc::new(FoldedSums::new(weights, harmonics)))
        } else {
            let transform = modfun_fft::forward(intervals);
            Sums::Fft { weights, transform }
        };
        Ok(plan)
    }

    /// A plan for samples at the times `t` (increasing, in seconds); the window is all of them.
    ///
    /// # Errors
    /// As [`CoefficientPlan::new`]; [`Error::Data`] where the times do not increase.
    pub fn uneven(t: &[f64], harmonics: usize, kind: Kind) -> Result<CoefficientPlan, Error> {
        check_times(t)?;
        let intervals = t.len() - 1;
        let span = t[intervals] - t[0];
        let weights = match kind {
            Kind::Rule(rule) => rule.uneven_weights(t)?,
            Kind::Hold(_) => Rule::Staircase.uneven_weights(t)?,
        };
        check_harmonics(intervals, harmonics)?;
        Ok(CoefficientPlan {
            intervals,
            harmonics,
            kind,
            lead: 0,
            first: 0,
            ahead: 0.0,
            taps: None,
            unit_variance: weights.iter().map(|w| w * w).sum::<f64>() / (span * span),
            sums: Sums::Uneven { t: t.to_vec(), weights },
            holds: Vec::new(),
            jump: None,
        })
    }

    /// Samples a record must have: lead + N + 1.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.lead + self.intervals + 1
    }

    /// Intervals N of the window.
    #[must_use]
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Highest harmonic M.
    #[must_use]
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// How the samples stand for a signal.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Variance of a coefficient (of |V|², m > 0) where the samples are white noise of variance 1:
    /// Σ w_k²/N², for uneven samples Σ q_k²/T². Held kinds: of the plain sum of the values.
    #[must_use]
    pub fn unit_variance(&self) -> f64 {
        self.unit_variance
    }

    /// Memory for any number of calls of [`CoefficientPlan::run_in`] and [`CoefficientPlan::run_lanes`].
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let mut scratch = Scratch::default();
        match &self.sums {
            Sums::Folded(sums) => scratch.wide.resize(sums.scratch(), Wide::ZERO),
            other => {
                scratch.record.resize(self.samples(), 0.0);
                scratch.one_re.resize(self.harmonics + 1, 0.0);
                scratch.one_im.resize(self.harmonics + 1, 0.0);
                if let Sums::Fft { transform, .. } = other {
                    scratch.hold_transform(transform.as_ref());
                }
            }
        }
        scratch
    }

    /// Coefficients of one record: V(m) = `re[m]` + i·`im[m]`, m = 0…M.
    ///
    /// Up to [`FOLDED_HARMONICS`] no memory is needed but for a large offset, and the bits are those of any lane of
    /// [`CoefficientPlan::run_lanes`].
    ///
    /// # Errors
    /// [`Error::Data`] where a length does not fit the plan; as [`Isa::detect`].
    pub fn run(&self, samples: &[f64], re: &mut [f64], im: &mut [f64]) -> Result<(), Error> {
        self.run_in(Isa::detect()?, samples, re, im, &mut Scratch::default())
    }

    /// [`CoefficientPlan::run`] on a given instruction set; only above [`FOLDED_HARMONICS`] does it use scratch.
    ///
    /// # Errors
    /// As [`CoefficientPlan::run`].
    pub fn run_in(
        &self,
        isa: Isa,
        samples: &[f64],
        re: &mut [f64],
        im: &mut [f64],
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        self.check_lengths(samples.len(), re.len(), im.len())?;
        let constant = offset(samples.len(), |k| samples[k]);
        if constant == 0.0 {
            return self.sum(isa, samples, re, im, scratch);
        }
        let mut level = std::mem::take(&mut scratch.level);
        level.clear();
        level.extend(samples.iter().map(|v| v - constant));
        let outcome = self.sum(isa, &level, re, im, scratch);
        scratch.level = level;
        re[0] += constant;
        outcome
    }

    /// The coefficients of samples as they are.
    fn sum(
        &self,
        isa: Isa,
        samples: &[f64],
        re: &mut [f64],
        im: &mut [f64],
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        match &self.sums {
            Sums::Folded(sums) => {
                // Lanes are harmonics here.
                isa.run(OneRecord { plan: self, sums, samples, re, im });
            }
            Sums::Fft { weights, transform } => {
                self.transform(weights, transform.as_ref(), samples, re, im, scratch)?;
            }
            Sums::Uneven { t, weights } => self.direct(t, weights, samples, re, im),
        }
        Ok(())
    }

    /// Coefficients of eight records at once; above [`FOLDED_HARMONICS`] and for uneven samples, one by one.
    ///
    /// # Errors
    /// As [`CoefficientPlan::run`].
    pub fn run_lanes(
        &self,
        isa: Isa,
        samples: &[Wide],
        re: &mut [Wide],
        im: &mut [Wide],
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        self.check_lengths(samples.len(), re.len(), im.len())?;
        if let Sums::Folded(sums) = &self.sums {
            let constants = offsets(samples);
            let Scratch { wide, wide_level, .. } = scratch;
            if constants.0 == [0.0; LANES] {
                isa.run(EightRecords { plan: self, sums, samples, re, im, wide });
                return Ok(());
            }
            levelled(samples, &constants, wide_level);
            isa.run(EightRecords { plan: self, sums, samples: wide_level, re, im, wide });
            re[0].0.iter_mut().zip(constants.0).for_each(|(v, constant)| *v += constant);
            return Ok(());
        }
        let mut record = std::mem::take(&mut scratch.record);
        let mut one_re = std::mem::take(&mut scratch.one_re);
        let mut one_im = std::mem::take(&mut scratch.one_im);
        let mut outcome = Ok(());
        for lane in 0..LANES {
            for (x, wide) in record.iter_mut().zip(samples) {
                *x = wide.0[lane];
            }
            outcome = outcome.and(self.run_in(isa, &record, &mut one_re, &mut one_im, scratch));
            for m in 0..=self.harmonics {
                (re[m].0[lane], im[m].0[lane]) = (one_re[m], one_im[m]);
            }
        }
        (scratch.record, scratch.one_re, scratch.one_im) = (record, one_re, one_im);
        outcome
    }

    fn check_lengths(&self, samples: usize, re: usize, im: usize) -> Result<(), Error> {
        if samples != self.samples() {
            return Err(Error::Data(format!(
                "coefficients of a window of {} intervals that starts {} samples late need {} samples, got {samples}; plan for this length",
                self.intervals,
                self.lead,
                self.samples()
            )));
        }
        if re != self.harmonics + 1 || im != self.harmonics + 1 {
            return Err(Error::Data(format!(
                "{} coefficients need arrays of that length, got {re} and {im}",
                self.harmonics + 1
            )));
        }
        Ok(())
    }

    /// One record through the FFT, which wants the window's last sample added to its first.
    fn transform(
        &self,
        weights: &Weights,
        transform: &dyn RealToComplex<f64>,
        samples: &[f64],
        re: &mut [f64],
        im: &mut [f64],
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        scratch.hold_transform(transform);
        let Scratch { real, complex, work, .. } = scratch;
        match &self.taps {
            None => weighted(weights, &samples[self.first..], real),
            Some(taps) => {
                let window: Between<'_, One> = Between { record: samples, first: self.first, taps };
                weighted(weights, window, real);
            }
        }
        transform.process_with_scratch(real, complex, work).map_err(|e| {
            Error::Internal(format!("the FFT of {} samples failed: {e}", self.intervals))
        })?;
        let by = 1.0 / self.intervals as f64;
        for m in 0..=self.harmonics {
            (re[m], im[m]) = (by * complex[m].re, by * complex[m].im);
        }
        im[0] = 0.0;
        self.hold::<One>(samples, re, im);
        Ok(())
    }

    /// One record with uneven samples: sums over samples, or over cells of a held signal.
    fn direct(&self, t: &[f64], weights: &[f64], samples: &[f64], re: &mut [f64], im: &mut [f64]) {
        let span = t[self.intervals] - t[0];
        for m in 0..=self.harmonics {
            let mut sum = (0.0, 0.0);
            for k in 0..=self.intervals {
                let (sin, cos) = sin_cos_turns_1(-(m as f64) * ((t[k] - t[0]) / span));
                let value = match self.kind {
                    Kind::Rule(_) => (samples[k], 0.0),
                    Kind::Hold(_) if k == self.intervals => (0.0, 0.0),
                    Kind::Hold(hold) => {
                        let (a, b) = cell_moments(m as f64 * ((t[k + 1] - t[k]) / span));
                        let rise =
                            if hold == Hold::Foh { samples[k + 1] - samples[k] } else { 0.0 };
                        (samples[k] * a.0 + rise * b.0, samples[k] * a.1 + rise * b.1)
                    }
                };
                let term = times(value, (cos, sin));
                sum = (sum.0 + weights[k] * term.0, sum.1 + weights[k] * term.1);
            }
            (re[m], im[m]) = (sum.0 / span, sum.1 / span);
        }
        im[0] = 0.0;
    }
}

/// Folded sums of one record, then the factors of held signals.
struct OneRecord<'a> {
    plan: &'a CoefficientPlan,
    sums: &'a FoldedSums,
    samples: &'a [f64],
    re: &'a mut [f64],
    im: &'a mut [f64],
}

impl Kernel for OneRecord<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let OneRecord { plan, sums, samples, re, im } = self;
        match &plan.taps {
            None => sums.run_one::<L, _>(&samples[plan.first..], re, im),
            Some(taps) => {
                let window: Between<'_, One> = Between { record: samples, first: plan.first, taps };
                sums.run_one::<L, _>(window, re, im);
            }
        }
        plan.hold::<One>(samples, re, im);
    }
}

/// Folded sums of eight records, then the factors of held signals.
struct EightRecords<'a> {
    plan: &'a CoefficientPlan,
    sums: &'a FoldedSums,
    samples: &'a [Wide],
    re: &'a mut [Wide],
    im: &'a mut [Wide],
    wide: &'a mut [Wide],
}

impl Kernel for EightRecords<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let EightRecords { plan, sums, samples, re, im, wide } = self;
        match &plan.taps {
            None => sums.run_eight::<L, _>(&samples[plan.first..], re, im, wide),
            Some(taps) => {
                let window: Between<'_, Eight<L>> =
                    Between { record: samples, first: plan.first, taps };
                sums.run_eight::<L, _>(window, re, im, wide);
            }
        }
        plan.hold::<Eight<L>>(samples, re, im);
    }
}

impl Scratch {
    fn hold_transform(&mut self, transform: &dyn RealToComplex<f64>) {
        self.real.resize(transform.len(), 0.0);
        self.complex.resize(transform.complex_len(), Complex::default());
        self.work.resize(transform.get_scratch_len(), Complex::default());
    }
}

fn check_harmonics(intervals: usize, harmonics: usize) -> Result<(), Error> {
    if harmonics > intervals / 2 {
        return Err(Error::Spec(format!(
            "harmonic {harmonics} lies above half the sampling rate: a window of {intervals} intervals has harmonics up to {}; lower the band or sample faster",
            intervals / 2
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
