//! Coefficients of one record at any delay: sums over windows that start at whole samples, kept once made, and what
//! lies between them.
//!
//! Of a smooth signal a coefficient at a fractional delay is that of six neighbouring windows, weighed as the signal
//! is interpolated; of a held one it is that of one window times a factor, with what its ends add
//! ([`super::HoldFactor`]). Beyond its ends a smooth record goes on along the polynomial through its last six
//! samples, which is what a plan interpolates there.

use super::{CoefficientPlan, HoldFactor, Kind, ROUNDING, Scratch};
use super::{offset::offset, source::TAPS, source::between};
use crate::error::Error;
use crate::quadrature::{Rule, times};
use crate::simd::Isa;

/// Samples that a smooth record is continued by at either end.
const BEYOND: usize = TAPS / 2;
/// Sixth differences of a polynomial of degree five vanish: what comes next after six samples.
const NEXT: [f64; TAPS] = [-1.0, 6.0, -15.0, 20.0, -15.0, 6.0];

/// Coefficients of one record whose delay is not known yet.
pub(crate) struct Shifted {
    isa: Isa,
    kind: Kind,
    lead: usize,
    /// Of windows that start at a sample, held signals summed as they are.
    plan: CoefficientPlan,
    scratch: Scratch,
    /// Less their offset.
    samples: Vec<f64>,
    offset: f64,
    /// Samples before the record's first.
    before: usize,
    /// Coefficients (Re, Im) of the windows that were asked for, by their first sample.
    windows: Vec<Option<[Vec<f64>; 2]>>,
}

impl Shifted {
    /// Of a record whose window of `intervals` starts `lead` samples late: coefficients up to `harmonics`.
    ///
    /// # Errors
    /// As [`CoefficientPlan::new`].
    pub fn new(
        isa: Isa,
        samples: &[f64],
        kind: Kind,
        (intervals, lead): (usize, usize),
        harmonics: usize,
    ) -> Result<Shifted, Error> {
        let (rule, before) = match kind {
            Kind::Rule(rule) => (rule, BEYOND),
            Kind::Hold(_) => (Rule::Staircase, 0),
        };
        if before > 0 && samples.len() < TAPS {
            return Err(super::source::too_few(samples.len()));
        }
        let plan = CoefficientPlan::new(intervals, harmonics, Kind::Rule(rule), 0.0, 0)?;
        let offset = offset(samples.len(), |k| samples[k]);
        let mut all = vec![0.0; before];
        all.extend(samples.iter().map(|v| v - offset));
        for k in (0..before).rev() {
            all[k] = (0..TAPS).map(|i| NEXT[i] * all[k + TAPS - i]).sum();
        }
        for _ in 0..before {
            let from = all.len() - TAPS;
            all.push((0..TAPS).map(|i| NEXT[i] * all[from + i]).sum());
        }
        let starts = all.len().saturating_sub(intervals);
        Ok(Shifted {
            isa,
            kind,
            lead,
            scratch: plan.scratch(),
            plan,
            samples: all,
            offset,
            before,
            windows: vec![None; starts],
        })
    }

    /// Writes the coefficients at a delay of so many samples, from line 0 on; of a held signal with its jump
    /// ([`CoefficientPlan::with_jump`]).
    ///
    /// # Errors
    /// [`Error::Spec`] for a delay below 0 or beyond the lead.
    pub fn write(&mut self, delay: f64, re: &mut [f64], im: &mut [f64]) -> Result<(), Error> {
        if !(delay >= 0.0 && delay <= self.lead as f64 + ROUNDING) {
            return Err(Error::Spec(format!(
                "a delay of {delay} samples where the window starts {} samples late; give bounds within it",
                self.lead
            )));
        }
        let near = delay.round();
        let delay = if (delay - near).abs() <= ROUNDING { near } else { delay };
        let whole = delay.ceil();
        let ahead = whole - delay;
        let first = self.lead - whole as usize;
        re.fill(0.0);
        im.fill(0.0);
        match self.kind {
            Kind::Rule(_) if ahead == 0.0 => self.add(first + self.before, 1.0, re, im)?,
            Kind::Rule(_) => {
                let from = first + self.before + 1 - BEYOND;
                for (i, by) in between(BEYOND - 1, ahead).into_iter().enumerate() {
                    self.add(from + i, by, re, im)?;
                }
            }
            Kind::Hold(hold) => {
                self.add(first, 1.0, re, im)?;
                let n = self.plan.intervals();
                let rise = |k: usize| self.samples[first + k + n] - self.samples[first + k];
                let ends = [rise(0), if first < self.lead { rise(1) } else { 0.0 }];
                for (m, (re, im)) in re.iter_mut().zip(im.iter_mut()).enumerate() {
                    let factor = HoldFactor::new(hold, m, n, ahead);
                    let sum = times(factor.sum, (*re, *im));
                    let add = |part: fn((f64, f64)) -> f64| {
                        part(factor.ends[0]) * ends[0] + part(factor.ends[1]) * ends[1]
                    };
                    (*re, *im) = (sum.0 + add(|c| c.0), sum.1 + add(|c| c.1));
                }
                let start = hold.start(ahead);
                im[0] = -(start[0] * ends[0] + start[1] * ends[1]);
            }
        }
        re[0] += self.offset;
        Ok(())
    }

    /// Adds `by` times the coefficients of the window that starts at a sample.
    fn add(&mut self, start: usize, by: f64, re: &mut [f64], im: &mut [f64]) -> Result<(), Error> {
        let own = match &mut self.windows[start] {
            Some(own) => own,
            none => {
                let lines = self.plan.harmonics() + 1;
                let mut own = [vec![0.0; lines], vec![0.0; lines]];
                let [re, im] = &mut own;
                let window = &self.samples[start..start + self.plan.samples()];
                self.plan.run_in(self.isa, window, re, im, &mut self.scratch)?;
                none.insert(own)
            }
        };
        for (to, from) in [re, im].into_iter().zip(own) {
            for (to, from) in to.iter_mut().zip(from) {
                *to += by * *from;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_delay_has_the_coefficients_of_a_plan_made_for_it() {
        let (intervals, lead) = (200, 9);
        let wave = |level: f64| -> Vec<f64> {
            (0..=intervals + lead).map(|k| level + ((k * k) % 101) as f64 / 50.0 - 1.0).collect()
        };
        for (kind, level) in Kind::ALL.into_iter().flat_map(|kind| [(kind, 0.0), (kind, 64.0)]) {
            let samples = wave(level);
            for harmonics in [20, 80] {
                let room = (intervals, lead);
                let mut all = Shifted::new(Isa::Plain, &samples, kind, room, harmonics).unwrap();
                for delay in [0.0, 0.3, 1.0, 1.99, 4.5, 8.2, 9.0] {
                    let plan = CoefficientPlan::new(intervals, harmonics, kind, delay, lead);
                    let lines = || vec![0.0; harmonics + 1];
                    let (mut want, mut got) = ([lines(), lines()], [lines(), lines()]);
                    let [re, im] = &mut want;
                    plan.unwrap().with_jump().run(&samples, re, im).unwrap();
                    let [re, im] = &mut got;
                    all.write(delay, re, im).unwrap();
                    for (want, got) in want.iter().flatten().zip(got.iter().flatten()) {
                        assert!((want - got).abs() < 1e-13, "{kind:?} {delay}: {want} {got}");
                    }
                }
                let [re, im] = &mut [vec![0.0; harmonics + 1], vec![0.0; harmonics + 1]];
                assert!(all.write(9.5, re, im).is_err() && all.write(f64::NAN, re, im).is_err());
            }
        }
    }
}
