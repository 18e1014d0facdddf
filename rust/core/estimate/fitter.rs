//! A structure, a method and a way of sampling made ready: what the samples do not change is made once, for
//! any number of fits.

mod coefficients;
mod finish;
mod workspace;

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

pub(crate) use workspace::{FitWorkspace, Problem, binary_unit};

use super::aliasing::Aliasing;
use super::answer::Answer;
use super::band::{BandRule, Choice, MANY, Range};
use super::design::Design;
use super::fit::{Fit, FitOptions, RecordView, Time};
use super::options::Start;
use super::outcome::End;
use super::record_levels::{misfits, settle};
use super::rest::{Course, Initial, KnownStart};
use super::shared::Shared;
use super::spare::Spare;
use super::wider::reaches_further;
use super::window::{Window, coefficient_plans};
use crate::error::{Error, Status};
use crate::modulation::Lines;
use crate::simd::{Isa, LANES};
use crate::spectrum::CoefficientPlan;
use crate::structure::{Method, Noise};

/// Bands lately chosen for batches that are kept.
const BANDS: usize = 4;

/// How one record becomes coefficients.
pub(crate) struct RecordPlan {
    pub samples: usize,
    /// `None` for uneven samples.
    dt: Option<f64>,
    pub window: Window,
    /// One a channel, output first.
    pub plans: Vec<CoefficientPlan>,
    /// As given, else up to the widest line of the default rule.
    pub range: Range,
    /// Lines behind the first one of the narrow fit that gives the second start.
    pub narrow: usize,
}

/// Everything about fits of one kind that their samples do not change.
///
/// Several threads may use it at the same time; no bit depends on that, nor on the fits before.
pub struct Fitter {
    pub(crate) o: FitOptions,
    pub(crate) isa: Isa,
    pub(crate) records: Vec<RecordPlan>,
    spaces: Spare<FitWorkspace>,
    shared: Mutex<Vec<Arc<Shared>>>,
    /// How often the wide band of the default rule was doubled.
    doublings: u32,
    /// The same with a band twice as wide, made when a record asks for it; none where samples show no more.
    wider: OnceLock<Option<Box<Fitter>>>,
}

impl Fitter {
    /// Makes ready for records of these lengths (in samples) and instants.
    ///
    /// # Errors
    /// [`Error::Spec`] and [`Error::Data`] where options and lengths do not go together.
    pub fn new(o: FitOptions, sampling: &[(usize, Time<'_>)], isa: Isa) -> Result<Fitter, Error> {
        Fitter::beside(None, o, sampling, isa)
    }

    /// The same with the plans of another fitter, where that makes the same coefficients.
    ///
    /// # Errors
    /// As [`Fitter::new`].
    pub fn beside(
        other: Option<&Fitter>,
        o: FitOptions,
        sampling: &[(usize, Time<'_>)],
        isa: Isa,
    ) -> Result<Fitter, Error> {
        Fitter::doubled(0, other, o, sampling, isa)
    }

    fn doubled(
        doublings: u32,
        other: Option<&Fitter>,
        o: FitOptions,
        sampling: &[(usize, Time<'_>)],
        isa: Isa,
    ) -> Result<Fitter, Error> {
        o.check()?;
        if sampling.is_empty() {
            return Err(Error::Data("fitting: no record was given".into()));
        }
        o.intersample.check("intersample kinds", sampling.len())?;
        let most = sampling.iter().map(|s| s.0).max().unwrap_or(0);
        if o.structure.parameters().max(o.structure.transient) > most {
            // Said before anything of that size is laid out.
            return Err(Error::Data(format!(
                "fitting: {} parameters and {} transient terms from at most {most} samples a record; take fewer poles \
                 and zeros",
                o.structure.parameters(),
                o.structure.transient
            )));
        }
        // Plans of even records alone are taken over.
        let alike =
            |f: &&Fitter| (0..sampling.len()).all(|k| f.o.channels(k, true) == o.channels(k, true));
        let other = other.filter(alike).map_or(&[][..], |f| &f.records);
        let plan = |(k, (samples, time)): (usize, &(usize, Time<'_>))| {
            let window = Window::new(*samples, *time, o.longest_delay())?;
            let (wide, narrow) = o.default_lines(window.both(), doublings);
            let range = window.given(o.band, o.structure.order)?.unwrap_or((0, wide));
            let dt = if let Time::Even(dt) = time { Some(*dt) } else { None };
            let same = |r: &&RecordPlan| {
                dt.is_some() && (r.samples, r.dt, r.range.1) == (*samples, dt, range.1)
            };
            let plans = match other.get(k).filter(same) {
                Some(same) => same.plans.clone(),
                None => coefficient_plans(&o.channels(k, dt.is_some()), *time, window, range.1)?,
            };
            Ok(RecordPlan { samples: *samples, dt, window, plans, range, narrow })
        };
        let records = sampling.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        Ok(Fitter {
            o,
            isa,
            records,
            spaces: Spare::new(),
            shared: Mutex::new(Vec::new()),
            doublings,
            wider: OnceLock::new(),
        })
    }

    /// The fitter with a band twice as wide, where the rule's choice met the end of this one.
    fn wider(&self, rule: Option<BandRule>) -> Option<&Fitter> {
        rule.filter(BandRule::meets_end)?;
        let make = || {
            let even = |r: &RecordPlan| Some((r.samples, Time::Even(r.dt?)));
            let sampling: Vec<_> = self.records.iter().map(even).collect::<Option<_>>()?;
            let wider =
                Fitter::doubled(self.doublings + 1, None, self.o.clone(), &sampling, self.isa);
            let further = |wider: &Fitter| reaches_further(&wider.ranges(), &self.ranges());
            wider.ok().filter(further).map(Box::new)
        };
        self.wider.get_or_init(make).as_deref()
    }

    /// Fits one structure to one record, or to several as one problem.
    ///
    /// # Errors
    /// [`Error::Data`] for what the caller can mend; failures of the numbers are a [`Status`] of the
    /// result.
    pub fn fit(&self, records: &[RecordView<'_>]) -> Result<Fit, Error> {
        self.fit_best(records, &[])
    }

    /// The same on lines that were given, iterated from `wls` and from each of these parameters: the best of all.
    ///
    /// # Errors
    /// As [`Fitter::fit`], and [`Error::Spec`] where the lines were not given or θ has another length.
    pub fn fit_best(&self, records: &[RecordView<'_>], starts: &[Vec<f64>]) -> Result<Fit, Error> {
        let wanted = self.o.structure.parameters();
        if let Some(theta) =
            starts.iter().find(|theta| self.o.band_is_sought() || theta.len() != wanted)
        {
            return Err(Error::Spec(format!(
                "fitting from a start: it has {} numbers for {wanted} parameters and needs a band; give both",
                theta.len()
            )));
        }
        self.fit_on(records, starts, None)
    }

    /// The same, and where errors fall beyond the end of the default band, on more lines. `before`: the estimate on
    /// fewer.
    fn fit_on(
        &self,
        records: &[RecordView<'_>],
        starts: &[Vec<f64>],
        before: Option<&[f64]>,
    ) -> Result<Fit, Error> {
        let fit = self.fit_here(records, starts, before)?;
        let Some(wider) = self.wider(fit.answer.band_rule) else { return Ok(fit) };
        let other = wider.fit_on(records, &[], Some(&fit.answer.theta))?;
        let order = self.o.structure.order;
        Ok(if fit.candidate(order).yields_to(&other.candidate(order)) { other } else { fit })
    }

    fn fit_here(
        &self,
        records: &[RecordView<'_>],
        starts: &[Vec<f64>],
        before: Option<&[f64]>,
    ) -> Result<Fit, Error> {
        let mut space = self.spaces.lend();
        let space = space.get_or(|| self.space());
        let Choice { ranges, rule, theta } = self.choose(space, records, before)?;
        if let Some(theta) = theta {
            return self.finish(space, &ranges, Start::Theta(&theta), rule);
        }
        let narrow = match rule {
            Some(_) => None,
            None => self.narrow_estimate(space, &ranges),
        };
        let starts: Vec<Vec<f64>> = narrow.into_iter().chain(starts.iter().cloned()).collect();
        let best = self.best_of(space, &ranges, &starts, rule)?;
        self.levelled(space, &ranges, best)
    }

    /// The estimate from `wls` and from each of these parameters with the lowest cost.
    fn best_of(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
        starts: &[Vec<f64>],
        rule: Option<BandRule>,
    ) -> Result<Fit, Error> {
        // As many at once as there are lanes beside that of `wls`.
        let mut starts = starts.chunks(LANES - 1);
        let first = starts.next().map_or(Start::Wls, Start::Each);
        let mut best = self.finish(space, ranges, first, rule)?;
        let end = |fit: &Fit| End { status: fit.answer.status, cost: fit.answer.cost };
        for more in starts {
            let other = self.finish(space, ranges, Start::Each(more), None)?;
            if end(&other).is_better_than(end(&best)) {
                best = other;
            }
        }
        // From `wls` alone the lanes go again by themselves.
        let lost = matches!(best.answer.status, Status::Rank | Status::NonFinite);
        let settled = best.answer.status == Status::Ok && best.answer.nit <= MANY;
        if matches!(first, Start::Each(_)) && self.o.noise == Noise::Output && !(lost || settled) {
            let theta = self.lower_from_filters(space, ranges, &best.answer.theta)?;
            let other = self.finish(space, ranges, Start::Theta(&theta), rule)?;
            if end(&other).is_better_than(end(&best)) {
                best = other;
            }
        }
        Ok(best)
    }

    /// Loads the records and says which lines to use: as given, or by the default rule.
    fn choose(
        &self,
        space: &mut FitWorkspace,
        records: &[RecordView<'_>],
        before: Option<&[f64]>,
    ) -> Result<Choice, Error> {
        self.load(space, records)?;
        let ranges = self.ranges();
        match self.o.band_is_sought() {
            true => {
                self.find_levels(space, &self.narrow(&ranges), Start::Wls);
                let choice = self.default_band(space, ranges.clone(), before)?;
                if let Some(theta) = &choice.theta {
                    // More lines than the fit needs know the levels better.
                    self.find_levels(space, &ranges, Start::Theta(theta));
                }
                Ok(choice)
            }
            false => Ok(Choice { ranges, rule: None, theta: None }),
        }
    }

    /// Noise levels of several records: those that a fit on these lines has; as they stand where it fails.
    fn find_levels(&self, space: &mut FitWorkspace, ranges: &[Range], start: Start<'_>) {
        let before = space.levels.clone();
        if self.learns_levels()
            && self
                .finish(space, ranges, start, None)
                .and_then(|fit| self.levelled(space, ranges, fit))
                .is_err()
        {
            space.levels = before;
        }
    }

    /// Whether records have noise levels of their own.
    fn learns_levels(&self) -> bool {
        let adapts = matches!(self.o.method, Method::Awls | Method::Ml);
        self.o.own_levels && self.o.noise != Noise::Process && self.records.len() > 1 && adapts
    }

    /// The fit with noise levels of the records that its residuals have.
    fn levelled(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
        first: Fit,
    ) -> Result<Fit, Error> {
        if !self.learns_levels() {
            return Ok(first);
        }
        let misfits = |fit: &Fit| misfits(&fit.answer, fit.sigma, &fit.residuals);
        let (levels, fit) = settle(space.levels.clone(), first, misfits, |levels, fit| {
            space.levels.copy_from_slice(levels);
            let Answer { theta, nit, band_rule, .. } = &fit.answer;
            let mut again = self.finish(space, ranges, Start::Theta(theta), *band_rule)?;
            again.answer.nit += nit;
            Ok(again)
        })?;
        space.levels = levels;
        Ok(fit)
    }

    /// The lines of each record, as given or up to the widest of the default rule.
    fn ranges(&self) -> Vec<Range> {
        self.records.iter().map(|r| r.range).collect()
    }

    /// What the records of a batch share: lines as given, or those the default rule finds on one record.
    pub(crate) fn shared(&self, record: &RecordView<'_>) -> Result<Arc<Shared>, Error> {
        let ([own], Some(dt)) = (self.records.as_slice(), self.records.first().and_then(|r| r.dt))
        else {
            return Err(Error::Spec(
                "fitting a batch: its records are fitted one by one and need one even step".into(),
            ));
        };
        let range = match self.o.band_is_sought() {
            true => {
                let mut space = self.spaces.lend();
                let space = space.get_or(|| self.space());
                let records = std::slice::from_ref(record);
                let Choice { ranges, rule, .. } = self.choose(space, records, None)?;
                let rule = match self.wider(rule) {
                    Some(_) => self.fit(records)?.answer.band_rule,
                    None => rule,
                };
                (ranges[0].0, rule.map_or(ranges[0].1, |rule| rule.chosen))
            }
            false => own.range,
        };
        let mut kept = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept.iter().find(|s| s.range == range) {
            return Ok(found.clone());
        }
        let plans = match range == own.range {
            true => own.plans.clone(),
            false => {
                coefficient_plans(&self.o.channels(0, true), Time::Even(dt), own.window, range.1)?
            }
        };
        let made = Arc::new(Shared::new(self.design(&[range], &[1.0])?, plans, range));
        kept.truncate(BANDS - 1);
        kept.insert(0, made.clone());
        Ok(made)
    }

    /// The problem on some lines, with noise variances of the records over a common one.
    pub(super) fn design(&self, ranges: &[Range], levels: &[f64]) -> Result<Design, Error> {
        let o = &self.o;
        let lines: Vec<Lines> = ranges
            .iter()
            .zip(&self.records)
            .zip(levels)
            .map(|(((first, last), r), level)| Lines {
                first: *first,
                last: *last,
                omega0: r.window.omega0,
                unit_variance: r.plans[0].unit_variance() * level,
            })
            .collect();
        let mut design = Design::new(&o.structure, o.method, o.noise, o.trend, o.extended, &lines)?;
        let inputs = (0..).map(|k| o.inputs(k));
        let records = self.records.iter().map(|r| r.dt).zip(inputs);
        design.aliasing = Aliasing::new(records, design.band_edge);
        if o.initial != Initial::Unknown {
            design.known_start = Some(self.known_start(design.band_edge)?);
            design.straight = None;
        }
        Ok(design)
    }

    /// How the records run from their known start, with time in units of a band edge.
    fn known_start(&self, band_edge: f64) -> Result<KnownStart, Error> {
        let o = &self.o;
        if o.initial != Initial::Periodic && self.records.iter().any(|r| r.dt.is_none()) {
            return Err(Error::Data(
                "fitting with a known initial state: the samples need an even step; resample \
                 them, or take initial_state=\"unknown\""
                    .into(),
            ));
        }
        if !(o.states.is_empty() || o.states.len() == self.records.len()) {
            return Err(Error::Spec(format!(
                "fitting from given states: {} of them for {} records; give one a record",
                o.states.len(),
                self.records.len()
            )));
        }
        let course = |r: &RecordPlan| Course {
            step: r.dt.unwrap_or(f64::NAN) * band_edge,
            seconds: r.dt.unwrap_or(f64::NAN),
            lead: r.window.lead,
            intervals: r.window.intervals,
        };
        Ok(KnownStart {
            courses: self.records.iter().map(course).collect(),
            inputs: (0..self.records.len()).map(|k| o.inputs(k)).collect(),
            initial: o.initial,
            states: o.states.clone(),
        })
    }
}
