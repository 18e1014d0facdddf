//! The window of a record: where it starts, how long it is, which lines a band names, one plan a channel.

use super::band::Band;
use super::fit::Time;
use crate::error::Error;
use crate::spectrum::{CoefficientPlan, Kind};

/// Coefficients (re, im) of each record, each of its channels.
pub(crate) type Spectra = Vec<Vec<(Vec<f64>, Vec<f64>)>>;

/// Per cent of the steps that are no longer than the one that sets the default band.
const MOST: usize = 95;

/// Window, resolving frequency and highest possible line of a record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    pub lead: usize,
    pub intervals: usize,
    /// As many of the step that most samples keep: where these are uneven, lines beyond an eighth of it hold the error
    /// of the quadrature, not the signal.
    pub resolved: usize,
    pub omega0: f64,
}

impl Window {
    /// For inputs that act at most `longest` seconds late: it starts so late that they are known in all of it.
    pub fn new(samples: usize, time: Time<'_>, longest: f64) -> Result<Window, Error> {
        let (lead, duration_of) = match time {
            Time::Even(dt) if !(dt > 0.0 && dt.is_finite()) => {
                return Err(Error::Data(format!(
                    "fitting: samples that are {dt} s apart; give a step that is positive and finite"
                )));
            }
            Time::Uneven(t) if t.len() != samples => {
                return Err(Error::Data(format!(
                    "fitting: {} instants of {samples} samples; give one for each",
                    t.len()
                )));
            }
            Time::Even(dt) => ((longest / dt - 1e-9).ceil().max(0.0) as usize, dt),
            Time::Uneven(t) => {
                if longest > 0.0 {
                    return Err(Error::Spec(
                        "fitting with a delay: the samples are uneven in time; resample them evenly".into(),
                    ));
                }
                let span = t.last().zip(t.first()).map_or(0.0, |(b, a)| b - a);
                (0, span / (samples.max(2) - 1) as f64)
            }
        };
        let intervals = samples.saturating_sub(lead.saturating_add(1));
        if intervals < 8 {
            return Err(Error::Data(format!(
                "fitting: {samples} samples, {lead} of them spent on the delay, leave {intervals} intervals; \
                 at least 8 are needed"
            )));
        }
        let omega0 = std::f64::consts::TAU / (intervals as f64 * duration_of);
        let resolved = match time {
            Time::Even(_) => intervals,
            Time::Uneven(t) => {
                let mut steps: Vec<f64> = t.windows(2).map(|pair| pair[1] - pair[0]).collect();
                steps.sort_unstable_by(f64::total_cmp);
                let long = steps[steps.len() * MOST / 100];
                ((intervals as f64 * duration_of / long) as usize).clamp(8, intervals)
            }
        };
        Ok(Window { lead, intervals, resolved, omega0 })
    }

    /// Intervals, and as many as samples resolve.
    pub(crate) fn both(&self) -> (usize, usize) {
        (self.intervals, self.resolved)
    }

    /// Lines for a band given by the caller, with `n` poles.
    pub(crate) fn given(&self, band: Band, n: usize) -> Result<Option<(usize, usize)>, Error> {
        let top = self.intervals / 2;
        match band {
            Band::Default => Ok(None),
            Band::Harmonics(m) if m.saturating_add(n) > top => Err(Error::Spec(format!(
                "fitting with harmonics={m}: M + n = {} exceeds N/2 = {top} (report, eq. 22); \
                 give at most {} for this record",
                m.saturating_add(n),
                top.saturating_sub(n)
            ))),
            Band::Harmonics(m) => Ok(Some((0, m + n))),
            Band::Edges(low, high) => {
                let sound = low >= 0.0 && high > low && high.is_finite();
                if !sound {
                    return Err(Error::Spec(format!(
                        "fitting with band=({low}, {high}): edges are in rad/s, 0 <= lower < upper"
                    )));
                }
                let first = (low / self.omega0 - 1e-9).ceil().max(0.0) as usize;
                let last = (high / self.omega0 + 1e-9).floor() as usize;
                if last > top {
                    return Err(Error::Spec(format!(
                        "fitting with band up to {high} rad/s: the record is sampled up to {:.6} rad/s; \
                         lower the edge",
                        top as f64 * self.omega0
                    )));
                }
                if last <= first {
                    return Err(Error::Spec(format!(
                        "fitting with band=({low}, {high}) rad/s: fewer than two lines spaced {:.6} rad/s \
                         (2 pi over the record's length) lie in it; widen it or take a longer record",
                        self.omega0
                    )));
                }
                Ok(Some((first, last)))
            }
        }
    }
}

/// One plan a channel, of this kind and this delay in seconds, made once for those that agree in both; the unit
/// variance is the output's.
pub(crate) fn coefficient_plans(
    channels: &[(Kind, f64)],
    time: Time<'_>,
    window: Window,
    highest: usize,
) -> Result<Vec<CoefficientPlan>, Error> {
    let plan = |(kind, delay): &(Kind, f64)| match time {
        Time::Uneven(t) => CoefficientPlan::uneven(t, highest, *kind),
        Time::Even(dt) => {
            CoefficientPlan::new(window.intervals, highest, *kind, delay / dt, window.lead)
                .map(CoefficientPlan::with_jump)
        }
    };
    let mut plans: Vec<CoefficientPlan> = Vec::with_capacity(channels.len());
    for (k, channel) in channels.iter().enumerate() {
        plans.push(match channels[..k].iter().position(|other| other == channel) {
            Some(same) => plans[same].clone(),
            None => plan(channel)?,
        });
    }
    Ok(plans)
}
