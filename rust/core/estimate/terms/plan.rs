//! Equations and a way of sampling made ready: what the samples do not change.

use super::equations::Equations;
use super::lines::{Pairs, TermsRecordPlan};
use super::rows::TermsWorkspace;

use crate::error::Error;
use crate::estimate::band::{Band, Range, default_lines, lines_of_both_noises};
use crate::estimate::fit::Time;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::options::Options;
use crate::estimate::prior::{self, Prior};
use crate::estimate::spare::Spare;
use crate::estimate::window::Window;
use crate::quadrature::Rule;
use crate::simd::Isa;
use crate::structure::{Method, Noise, Trend};

/// Most lines of the wide band: beyond, dense factors cost more than they tell.
pub(super) const WIDEST: usize = 128;

/// The same of noise inside the equations, whose lines are independent.
const WIDEST_DRIVEN: usize = 1024;

/// Everything that says how records are fitted.
#[derive(Debug, Clone)]
pub struct TermsOptions {
    /// What is fitted.
    pub equations: Equations,
    /// Quadrature behind the noise; signals say their own.
    pub rule: Rule,
    /// Numerators and denominators, in descending powers, of the filters of noise that enters through channels of zeros, the
    /// last of the noisy ones.
    pub shapes: Vec<(Vec<f64>, Vec<f64>)>,
    /// Estimator.
    pub method: Method,
    /// Of the channels, of the equations, or of both.
    pub noise: Noise,
    /// Constant and drift of each equation.
    pub trend: Trend,
    /// Lines.
    pub band: Band,
    /// Noise standard deviation of each noisy channel, where known.
    pub levels: Option<Vec<f64>>,
    /// Whether the levels' sizes matter, not only their existence.
    pub levels_matter: bool,
    /// Whether levels of several noisy channels are estimated with the parameters.
    pub learn: bool,
    /// Whether the colour of each noisy channel is, too.
    pub coloured: bool,
    /// What is known of parameters beforehand.
    pub priors: Vec<Prior>,
    /// Iteration.
    pub options: Options,
}

/// One record's channels.
#[derive(Debug, Clone)]
pub struct TermsRecord<'a> {
    /// In the order that the formulas number them.
    pub channels: Vec<&'a [f64]>,
}

/// Everything about fits of one kind that their samples do not change.
pub struct TermsFitter {
    pub(crate) o: TermsOptions,
    pub(crate) isa: Isa,
    pub(crate) pairs: Pairs,
    pub(crate) records: Vec<TermsRecordPlan>,
    pub(crate) given: Vec<Range>,
    pub(crate) narrow: Vec<Range>,
    pub(crate) workers: Spare<TermsWorkspace>,
}

impl TermsFitter {
    /// Makes ready for records of these lengths (in samples) and instants; `uneven` holds the variance of
    /// each sample of each noisy channel of each record over the channel's, where they differ.
    ///
    /// # Errors
    /// [`Error::Spec`] and [`Error::Data`] where options and lengths do not go together.
    pub fn new(
        o: TermsOptions,
        sampling: &[(usize, Time<'_>)],
        uneven: &[Vec<Vec<f64>>],
        isa: Isa,
    ) -> Result<TermsFitter, Error> {
        o.equations.check()?;
        prior::check(&o.priors, o.equations.parameters, o.method)?;
        if sampling.is_empty() {
            return Err(Error::Data("fitting: no record was given".into()));
        }
        if o.levels.as_ref().is_some_and(|l| l.len() != o.equations.noisy.len()) {
            return Err(Error::Spec(
                "fitting: noise levels are needed for each noisy channel".into(),
            ));
        }
        if o.coloured && o.equations.bends() {
            return Err(Error::Spec(
                "fitting equations with noise=\"coloured\": one of them is nonlinear in the outputs, which spreads their \
                 noise over all lines, so that its colour cannot weigh the lines. Leave noise= out: the standard errors \
                 hold for noise of any colour"
                    .into(),
            ));
        }
        for signal in &o.equations.signals {
            signal.kind.check("kinds of a signal", sampling.len())?;
        }
        let e = &o.equations;
        let order = e.orders.iter().copied().max().unwrap_or(1).max(1);
        let trends = o.trend.terms();
        let unknowns = (e.parameters + trends * e.orders.len()).div_ceil(e.orders.len());
        let (mut records, mut given, mut narrow) = (Vec::new(), Vec::new(), Vec::new());
        for (k, (samples, time)) in sampling.iter().enumerate() {
            if order > *samples {
                return Err(Error::Data(format!(
                    "fitting: derivatives up to order {order} from {samples} samples a record; take fewer"
                )));
            }
            let window = Window::new(*samples, *time, e.longest_lag())?;
            let (wide, few) = default_lines(o.method, unknowns, order, window.both(), 0);
            let range = window.given(o.band, order)?.unwrap_or((0, wide.min(WIDEST)));
            let own = uneven.get(k).cloned().unwrap_or_default();
            // The colour of the noise is read from a wide band even where the fit's is narrow.
            let highest = match (o.coloured, o.noise == Noise::Process && o.band == Band::Default) {
                (true, _) => range.1.max(wide.min(WIDEST)),
                (_, true) => {
                    range.1.max(lines_of_both_noises(wide, window.resolved).min(WIDEST_DRIVEN))
                }
                _ => range.1,
            };
            records.push(TermsRecordPlan::new(e, k, (*samples, *time), o.rule, highest, own)?);
            given.push(range);
            narrow.push((range.0, few.min(range.1)));
        }
        if o.noise == Noise::Process
            && !(e.can_be_driven(o.shapes.len()) && uneven.iter().all(Vec::is_empty))
        {
            return Err(Error::Spec(format!(
                "fitting equations with process noise: it is told from that of the samples by {} equations in {} noisy \
                 outputs; it takes as many equations as outputs, each linear in all outputs (and in the form in which it \
                 was written: no unmeasured state), delays that are known, and samples of even noise without gaps. \
                 Take noise=\"output\"",
                e.orders.len(),
                e.noisy.len() - o.shapes.len().min(e.noisy.len())
            )));
        }
        let pairs = Pairs::new(e);
        Ok(TermsFitter { isa, pairs, records, given, narrow, workers: Spare::new(), o })
    }

    /// What weighs the rows, and of which signals the columns are made.
    pub(crate) fn weights(&self) -> (RowWeights, LeftColumns) {
        match (self.o.noise, self.o.method) {
            (Noise::Equation, _) | (_, Method::Wls | Method::Ls) => {
                (RowWeights::Flat, LeftColumns::Data)
            }
            (_, Method::Awls) => (RowWeights::Adapted, LeftColumns::Data),
            (_, Method::Ml) => (RowWeights::Adapted, LeftColumns::Denoised),
        }
    }
}
