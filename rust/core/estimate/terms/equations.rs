//! What is fitted: terms g(θ) p^k E of equations, signals E and coefficients g as formulas.

use super::sigma::numbers;
use crate::error::Error;
use crate::estimate::each_record::EachRecord;
use crate::spectrum::Kind;
use crate::tape::Tape;

/// By how much a signal is late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lag {
    /// In seconds.
    Known(f64),
    /// A parameter, in seconds.
    Parameter(usize),
}

/// A formula of the channels, sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// How its samples stand for it.
    pub kind: EachRecord<Kind>,
    /// By how much it is late, all of it.
    pub lag: Lag,
}

/// g(θ) p^order E in an equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Term {
    /// Which equation.
    pub equation: usize,
    /// Which signal E.
    pub signal: usize,
    /// Derivatives of it.
    pub order: usize,
}

/// Equations Σ g(θ) p^k E = 0 of sampled channels.
///
/// The tape of samples has as inputs the channels, the noise variance of each noisy channel, the covariances of these
/// channels, (0, 1), (0, 2), …, (1, 2), …, and θ; its results are the signals, then the sensitivities. The tape of coefficients has θ as inputs; its results
/// are g of each term, then the slopes.
#[derive(Debug, Clone)]
pub struct Equations {
    /// Highest derivative of each equation: so many transient coefficients.
    pub orders: Vec<usize>,
    /// Signals in the terms, then slopes of signals.
    pub signals: Vec<Signal>,
    /// Terms.
    pub terms: Vec<Term>,
    /// Values of g and slopes.
    pub coefficients: Tape,
    /// ∂g/∂θ that are not zero: term and parameter.
    pub slopes: Vec<(usize, usize)>,
    /// Signals and sensitivities.
    pub samples: Tape,
    /// ∂E/∂v that are not zero: signal and noisy channel.
    pub sensitivities: Vec<(usize, usize)>,
    /// ∂E/∂θ that are not zero: signal, parameter, and the signal it is.
    pub signal_slopes: Vec<(usize, usize, usize)>,
    /// Number of channels.
    pub channels: usize,
    /// Channels with noise.
    pub noisy: Vec<usize>,
    /// Number of parameters.
    pub parameters: usize,
    /// Where the search begins, if given.
    pub starts: Vec<Option<f64>>,
    /// Whether the starts are estimates of these equations, so that no others are tried.
    pub near: bool,
    /// Least and most of each parameter.
    pub bounds: Vec<(f64, f64)>,
    /// Whether every g is linear in θ, and no signal depends on it.
    pub linear: bool,
}

impl Equations {
    /// Checks that all positions exist.
    ///
    /// # Errors
    /// [`Error::Spec`] naming what does not fit.
    pub fn check(&self) -> Result<(), Error> {
        let wrong = |what: &str| {
            Err(Error::Spec(format!("fitting equations: the {what} do not fit the terms")))
        };
        let (signals, p) = (self.signals.len(), self.parameters);
        let terms = self.terms.iter().all(|t| {
            t.equation < self.orders.len()
                && t.signal < signals
                && t.order <= self.orders[t.equation]
        });
        let lags = self.signals.iter().all(|s| match s.lag {
            Lag::Known(h) => h >= 0.0 && h.is_finite(),
            Lag::Parameter(k) => k < p && self.bounds.get(k).is_some_and(|b| b.1.is_finite()),
        });
        let held = self.slopes.iter().all(|(t, k)| *t < self.terms.len() && *k < p);
        let moved =
            self.signal_slopes.iter().all(|(s, k, to)| *s < signals && *k < p && *to < signals);
        let sensed = self.sensitivities.iter().all(|(s, c)| *s < signals && *c < self.noisy.len());
        if !terms || self.terms.is_empty() {
            return wrong("equations");
        }
        if !lags {
            return wrong("delays (a parameter needs max=)");
        }
        if !held || self.coefficients.results() != self.terms.len() + self.slopes.len() {
            return wrong("coefficients");
        }
        if !moved || !sensed || self.samples.results() != signals + self.sensitivities.len() {
            return wrong("signals");
        }
        if self.noisy.iter().any(|c| *c >= self.channels)
            || self.samples.inputs() != self.channels + numbers(self.noisy.len()) + p
            || self.coefficients.inputs() != p
        {
            return wrong("channels");
        }
        if self.starts.len() != p || self.bounds.len() != p {
            return wrong("starts and bounds");
        }
        if self.free_lags().any(|(_, k)| self.bounds[k].1.is_nan() || self.bounds[k].1 < 0.0) {
            return wrong("bounds of delays");
        }
        if self.sensitivities.is_empty() {
            return Err(Error::Spec(
                "fitting equations: no term has a noisy signal, so that there is nothing to weigh"
                    .into(),
            ));
        }
        Ok(())
    }

    /// The starts that no others are tried beside, where there is one of each parameter.
    pub(crate) fn near(&self) -> Option<Vec<f64>> {
        self.starts.iter().copied().collect::<Option<_>>().filter(|_| self.near)
    }

    /// Longest delay in seconds.
    pub(crate) fn longest_lag(&self) -> f64 {
        self.signals.iter().fold(0.0, |most: f64, s| {
            most.max(match s.lag {
                Lag::Known(h) => h,
                Lag::Parameter(k) => self.bounds[k].1,
            })
        })
    }

    /// Whether a parameter stands inside a signal.
    pub(crate) fn is_inside(&self, parameter: usize) -> bool {
        self.signal_slopes.iter().any(|(_, own, _)| *own == parameter)
    }

    /// Whether signals, or their coefficients, change with θ.
    pub(crate) fn moves(&self) -> bool {
        !self.signal_slopes.is_empty() || self.free_lags().next().is_some()
    }

    /// Whether a signal's slope depends on the samples.
    pub(crate) fn bends(&self) -> bool {
        let first = self.signals.len();
        (first..self.samples.results()).any(|k| self.samples.constant(k).is_none())
    }

    /// Signals whose delay is a parameter, with it.
    pub(crate) fn free_lags(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.signals.iter().enumerate().filter_map(|(s, signal)| match signal.lag {
            Lag::Parameter(k) => Some((s, k)),
            Lag::Known(_) => None,
        })
    }

    /// Delay of a signal at θ, in seconds.
    pub(crate) fn lag(&self, signal: usize, theta: &[f64]) -> f64 {
        match self.signals[signal].lag {
            Lag::Known(h) => h,
            Lag::Parameter(k) => theta[k].clamp(0.0, self.bounds[k].1),
        }
    }

    /// θ within its bounds.
    pub(crate) fn clip(&self, theta: &mut [f64]) {
        for (t, (low, high)) in theta.iter_mut().zip(&self.bounds) {
            *t = t.max(*low).min(*high);
        }
    }
}
