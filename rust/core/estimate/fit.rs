//! What a fit is told and what it answers.

use super::aliasing::output_rule;
use super::answer::Answer;
use super::band::{Band, default_lines, lines_of_both_noises};
use super::driven::output::Levels;
use super::each_record::EachRecord;
use super::options::Options;
use super::rest::Initial;
use super::wider::Candidate;
use crate::error::Error;
use crate::quadrature::{Hold, Rule};
use crate::spectrum::Kind;
use crate::structure::{Method, Noise, Structure, Trend};

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
}

/// Everything that says how a record is fitted.
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// Orders.
    pub structure: Structure,
    /// Known delay of each input in seconds.
    pub delays: Vec<f64>,
    /// How each input behaves between samples; `None` smooth.
    pub intersample: EachRecord<Vec<Option<Hold>>>,
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
    /// Whether several records have noise levels of their own.
    pub own_levels: bool,
    /// What is known of the state at each record's first sample.
    pub initial: Initial,
    /// With [`Initial::Zero`]: y, y', … of each record's free response at its first sample; empty for none.
    pub states: Vec<Vec<f64>>,
    /// Iteration.
    pub options: Options,
}

/// A finished fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Estimates, covariances, outcome.
    pub answer: Answer,
    /// Noise standard deviation, √(cost/degrees of freedom): of the output's samples, or of the
    /// equation error's.
    pub sigma: f64,
    /// Noise of each record over σ, of geometric mean 1 weighted by rows.
    pub record_levels: Vec<f64>,
    /// Where noise drives the system: what of it, and what of the measurement.
    pub levels: Option<Levels>,
    /// Where the initial state is known: the cost with a free one.
    pub free_cost: Option<f64>,
    /// Residuals on the lines of each record over its noise: unit variance in Re and Im.
    pub residuals: Vec<Vec<(f64, f64)>>,
}

impl Fit {
    /// With the denominator's degree.
    pub(crate) fn candidate(&self, order: usize) -> Candidate<'_> {
        Candidate {
            answer: &self.answer,
            levels: vec![self.sigma * self.sigma],
            denominators: vec![self.answer.theta[..order].to_vec()],
        }
    }
}

impl FitOptions {
    /// Checks what does not depend on data.
    ///
    /// # Errors
    /// [`Error::Spec`] naming the option.
    pub fn check(&self) -> Result<(), Error> {
        let inputs = self.structure.numerators.len();
        let unlike = |kinds: &&Vec<Option<Hold>>| kinds.len() != inputs;
        let kinds = self.intersample.iter().find(unlike).map_or(inputs, Vec::len);
        if self.delays.len() != inputs || kinds != inputs {
            return Err(Error::Spec(format!(
                "fitting: {inputs} inputs but {} delays and {kinds} intersample kinds",
                self.delays.len()
            )));
        }
        if self.noise == Noise::Process && self.method != Method::Ml {
            return Err(Error::Spec(
                "fitting with process noise: its level is estimated by likelihood; take method=\"ml\"".into(),
            ));
        }
        if self.initial != Initial::Unknown {
            if self.noise != Noise::Output && self.method == Method::Ml {
                return Err(Error::Spec(
                    "fitting with a known initial state: noise inside the system moves the states, too; take \
                     noise=\"output\", or initial_state=\"unknown\""
                        .into(),
                ));
            }
            if self.method == Method::Ls {
                return Err(Error::Spec(
                    "fitting with a known initial state: \"ls\" differences it away; take another method".into(),
                ));
            }
            if self.trend == Trend::Linear {
                return Err(Error::Spec(
                    "fitting with a known initial state: a drift of the output moves its states, too; take \
                     trend=\"constant\", or initial_state=\"unknown\""
                        .into(),
                ));
            }
            if self.structure.numerators.iter().all(Option::is_none) && self.states.is_empty() {
                return Err(Error::Spec(
                    "fitting with a known initial state: without an input nothing moves from it; take \
                     initial_state=\"unknown\""
                        .into(),
                ));
            }
            let order = self.structure.order;
            let odd = |s: &&Vec<f64>| s.len() != order || s.iter().any(|x| !x.is_finite());
            if let Some(state) = self.states.iter().find(odd) {
                return Err(Error::Spec(format!(
                    "fitting from a given state: {state:?} does not suit {order} poles; give y, y', … of the free \
                     response, {order} finite numbers"
                )));
            }
            if !self.extended {
                return Err(Error::Spec(
                    "fitting with a known initial state: extended=False leaves out the lines that tell it; \
                     take extended=True"
                        .into(),
                ));
            }
        }
        if let Some(bad) = self.delays.iter().find(|d| !(**d >= 0.0 && d.is_finite())) {
            return Err(Error::Spec(format!(
                "fitting: a delay of {bad} s; delays are finite and not negative"
            )));
        }
        Ok(())
    }

    /// Longest delay of an input, in seconds.
    pub(crate) fn longest_delay(&self) -> f64 {
        self.delays.iter().fold(0.0, |m: f64, d| m.max(*d))
    }

    /// How each input of a record runs between samples, and how many seconds it is late.
    pub(crate) fn inputs(&self, record: usize) -> Vec<(Option<Hold>, f64)> {
        self.intersample.of(record).iter().copied().zip(self.delays.iter().copied()).collect()
    }

    /// Kind and delay of each channel of a record, output first.
    pub(crate) fn channels(&self, record: usize, even: bool) -> Vec<(Kind, f64)> {
        let holds = self.intersample.of(record);
        let inputs = holds.iter().zip(&self.delays);
        let input =
            |(h, d): (&Option<Hold>, &f64)| (h.map_or(Kind::Rule(self.rule), Kind::Hold), *d);
        let output = Kind::Rule(output_rule(self.rule, holds, even));
        std::iter::once((output, 0.0)).chain(inputs.map(input)).collect()
    }

    /// Real unknowns of the default rule's guideline: parameters and trend terms.
    fn unknowns(&self) -> usize {
        self.structure.parameters().saturating_add(self.trend.terms())
    }

    /// Whether the default rule looks at the samples.
    pub(crate) fn band_is_sought(&self) -> bool {
        let adapts = matches!(self.method, Method::Awls | Method::Ml);
        self.band == Band::Default && self.noise == Noise::Output && adapts
    }

    /// Highest lines of the default rule for so many intervals: wide, doubled so many times, and narrow.
    pub(crate) fn default_lines(
        &self,
        intervals: (usize, usize),
        doublings: u32,
    ) -> (usize, usize) {
        let (unknowns, order) = (self.unknowns(), self.structure.order);
        let (wide, few) = default_lines(self.method, unknowns, order, intervals, doublings);
        match self.noise {
            Noise::Process => (lines_of_both_noises(wide, intervals.1), few),
            _ => (wide, few),
        }
    }
}
