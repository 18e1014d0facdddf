//! A joint structure and a way of sampling made ready, and a fit of its records with everything a user sees.

use std::sync::OnceLock;

use super::delays::{self, Delayed};
use super::design::{Colour, JointDesign, NoiseModel, RecordLines, Seen};
use super::iterate::JointStart;
use super::single::{Covariances, Ended, Single};
use super::structure::{Delay, JointStructure, Path};
use super::whitener::{Uneven, uneven};
use super::workspace::JointSpace;
use crate::error::{Error, Status};
use crate::estimate::Options;
use crate::estimate::aliasing::{Aliasing, output_rule};
use crate::estimate::answer::{Answer, unit_diagonal};
use crate::estimate::at_once::SAMPLES;
use crate::estimate::band::{Band, BandRule, Choice, MANY, Range, SAME, default_lines};
use crate::estimate::fit::Time;
use crate::estimate::fitter::binary_unit;
use crate::estimate::prior::{self, Prior};
use crate::estimate::record_levels::{misfits, settle};
use crate::estimate::wider::{Candidate, reaches_further};
use crate::estimate::window::{Spectra, Window, coefficient_plans};
use crate::modulation::Lines;
use crate::quadrature::{Hold, Rule};
use crate::simd::{Isa, Wide};
use crate::spectrum::{CoefficientPlan, Kind};
use crate::structure::{Method, Trend};

/// Everything that says how records are fitted jointly.
#[derive(Debug, Clone)]
pub struct JointOptions {
    /// Denominators, paths, held values, bounds, delays.
    pub structure: JointStructure,
    /// How each input behaves between samples; `None` smooth.
    pub intersample: Vec<Option<Hold>>,
    /// Quadrature of smooth signals.
    pub rule: Rule,
    /// Estimator: `wls`, `awls` or `ml`.
    pub method: Method,
    /// What the residuals are weighted by.
    pub noise: NoiseModel,
    /// Offset and drift of each output.
    pub trend: Trend,
    /// All rows, or the report's range 0..M.
    pub extended: bool,
    /// Lines.
    pub band: Band,
    /// Whether several records have noise levels of their own.
    pub own_levels: bool,
    /// What is known of parameters (free coefficients, then free delays) beforehand.
    pub priors: Vec<Prior>,
    /// Iteration.
    pub options: Options,
}

/// Most lines of a band that is doubled where samples are uneven in variance: time grows with their cube.
const DENSE: usize = 512;

impl JointOptions {
    /// Checks what does not depend on data.
    fn check(&self) -> Result<(), Error> {
        let (outputs, paths) = (self.structure.orders.len(), &self.structure.paths);
        let inputs = self.intersample.len();
        if let Some(path) = paths.iter().find(|p| p.input >= inputs) {
            return Err(Error::Spec(format!(
                "fitting: a path begins at input {} where there are {inputs}, counted from 0",
                path.input
            )));
        }
        let square = |given: &Option<Vec<f64>>, size: usize| {
            given.as_ref().is_none_or(|all| all.len() == size * size)
        };
        let all =
            |spectra: &Vec<Vec<f64>>| spectra.is_empty() || spectra.len() == outputs + paths.len();
        let noise = &self.noise;
        if square(&noise.outputs, outputs)
            && square(&noise.inputs, paths.len())
            && noise.spectra.iter().all(all)
        {
            return Ok(());
        }
        Err(Error::Spec(format!(
            "fitting: covariances or spectra of the noise are not those of {outputs} outputs and {} paths",
            paths.len()
        )))
    }
}

/// One record's samples.
#[derive(Debug, Clone)]
pub struct JointRecord<'a> {
    /// Outputs.
    pub y: Vec<&'a [f64]>,
    /// Inputs.
    pub u: Vec<&'a [f64]>,
}

/// A finished joint fit.
#[derive(Debug, Clone)]
pub struct JointFit {
    /// Estimates (free coefficients, then free delays in seconds), covariances, outcome.
    pub answer: Answer,
    /// Variance of the noise over that given: cost in units of Σ over degrees of freedom.
    pub scale: f64,
    /// Covariance of the noise of the outputs' samples (of the equations', for equation noise).
    pub noise: Vec<f64>,
    /// Whether each parameter stands at a bound.
    pub at_bound: Vec<bool>,
    /// Noise of each record over that, of geometric mean 1 weighted by rows.
    pub record_levels: Vec<f64>,
    /// Residuals of each record and output over its noise: unit variance in Re and Im.
    pub residuals: Vec<Vec<Vec<(f64, f64)>>>,
}

impl JointFit {
    fn candidate(&self, structure: &JointStructure) -> Candidate<'_> {
        Candidate {
            answer: &self.answer,
            levels: self.noise.iter().step_by(structure.orders.len() + 1).copied().collect(),
            denominators: structure.denominators(&self.answer.theta),
        }
    }
}

/// How one record becomes coefficients.
pub(crate) struct JointRecordPlan {
    pub samples: usize,
    pub dt: f64,
    pub window: Window,
    /// Outputs, then paths.
    pub plans: Vec<CoefficientPlan>,
    /// As given, else up to the widest line of the default rule.
    pub range: Range,
    pub narrow: usize,
    /// Up to the highest line.
    pub uneven: Uneven,
}

/// Everything about joint fits of one kind that their samples do not change.
pub struct JointFitter {
    pub(crate) o: JointOptions,
    pub(crate) isa: Isa,
    pub(crate) records: Vec<JointRecordPlan>,
    pub(crate) kinds: Vec<Kind>,
    /// Variances of the samples, where they are uneven.
    variances: Vec<Vec<Vec<f64>>>,
    /// How often the wide band of the default rule was doubled.
    doublings: u32,
    /// The same with a band twice as wide, made when a record asks for it; none where samples show no more.
    wider: OnceLock<Option<Box<JointFitter>>>,
}

/// Coefficients of all records and signals (outputs, then paths), and what they are measured in.
pub(crate) struct Loaded {
    pub spectra: Spectra,
    pub scales: Scales,
}

/// What coefficients are measured in.
pub(crate) struct Scales {
    /// A unit for each signal.
    pub units: Vec<f64>,
    /// Noise variance of each record over a common one.
    pub levels: Vec<f64>,
}

impl Loaded {
    fn new(spectra: Spectra) -> Loaded {
        let size = |k: usize| {
            let parts = spectra.iter().flat_map(|s| s[k].0.iter().chain(&s[k].1));
            parts.fold(0.0, |most: f64, v| most.max(v.abs()))
        };
        let signals = spectra.first().map_or(0, Vec::len);
        let units = (0..signals).map(|k| binary_unit(size(k))).collect();
        let levels = vec![1.0; spectra.len()];
        Loaded { spectra, scales: Scales { units, levels } }
    }
}

impl JointFitter {
    /// Makes ready for records of these lengths (in samples) and instants; `variances` of the samples of
    /// each record and output where they are uneven (infinite: ignored), else empty.
    ///
    /// # Errors
    /// [`Error::Spec`] and [`Error::Data`] where options and lengths do not go together.
    pub fn new(
        o: JointOptions,
        sampling: &[(usize, Time<'_>)],
        variances: &[Vec<Vec<f64>>],
        isa: Isa,
    ) -> Result<JointFitter, Error> {
        JointFitter::doubled(0, o, sampling, variances, isa)
    }

    fn doubled(
        doublings: u32,
        o: JointOptions,
        sampling: &[(usize, Time<'_>)],
        variances: &[Vec<Vec<f64>>],
        isa: Isa,
    ) -> Result<JointFitter, Error> {
        let s = &o.structure;
        let one_shot = o.method == Method::Ls || (o.method == Method::Wls && !o.noise.equation);
        if one_shot {
            return Err(Error::Spec(
                "fitting: method=\"ls\" and \"wls\" take one output, free parameters, known delays and white \
                 noise of equal size; use \"awls\" or \"ml\" (or noise=\"equation\" with \"wls\")"
                    .into(),
            ));
        }
        o.check()?;
        prior::check(&o.priors, s.parameters(), o.method)?;
        if sampling.is_empty() {
            return Err(Error::Data("fitting: no record was given".into()));
        }
        let most = sampling.iter().map(|s| s.0).max().unwrap_or(0);
        if s.parameters() > most.saturating_mul(s.orders.len()) {
            return Err(Error::Data(format!(
                "fitting: {} parameters from at most {most} samples a record; take fewer poles and zeros",
                s.parameters()
            )));
        }
        let kind = |input: usize| {
            o.intersample.get(input).copied().flatten().map_or(Kind::Rule(o.rule), Kind::Hold)
        };
        let kinds: Vec<Kind> = s.paths.iter().map(|p| kind(p.input)).collect();
        // A free delay begins where the window lies: the plan tells what its first value is.
        let start = |delay: Delay| match delay {
            Delay::Known(delay) => delay,
            Delay::Free { start, .. } => start,
        };
        let outputs = s.orders.len();
        let even = sampling.iter().all(|(_, time)| matches!(time, Time::Even(_)));
        let rule = output_rule(o.rule, &o.intersample, even);
        let channels: Vec<(Kind, f64)> = std::iter::repeat_n((Kind::Rule(rule), 0.0), outputs)
            .chain(kinds.iter().zip(&s.paths).map(|(kind, p)| (*kind, start(p.delay))))
            .collect();
        let order = s.orders.iter().copied().max().unwrap_or(1);
        let unknowns = s.parameters() + outputs * o.trend.terms();
        let plan = |(k, (samples, time)): (usize, &(usize, Time<'_>))| {
            let window = Window::new(*samples, *time, s.longest_delay())?;
            let each = unknowns.div_ceil(outputs);
            let (wide, narrow) = default_lines(o.method, each, order, window.resolved, doublings);
            let range = window.given(o.band, order)?.unwrap_or((0, wide));
            // The colour of the noise is read from a wide band even where the fit's is narrow.
            let highest = match o.noise.colour {
                Colour::Fitted => range.1.max(wide),
                Colour::Given => range.1,
            };
            let plans = coefficient_plans(&channels, *time, window, highest)?;
            let spectra = o.noise.spectra.get(k).into_iter().flatten();
            if let Some(short) = spectra.map(Vec::len).find(|lines| *lines <= highest) {
                return Err(Error::Data(format!(
                    "fitting with spectra of the noise: one has {short} lines where {} are needed",
                    highest + 1
                )));
            }
            let first = if o.trend == Trend::None { range.0 } else { range.0.max(1) };
            let coupled = outputs > 1 && o.noise.inputs.is_none();
            let uneven = match variances.get(k) {
                Some(all) if !all.is_empty() && all.len() != outputs => {
                    return Err(Error::Data(format!(
                        "fitting with uneven noise: variances of {} outputs for {outputs}",
                        all.len()
                    )));
                }
                Some(all) if !all.is_empty() => {
                    uneven(all, (*samples, *time), window, rule, (first, range.1), coupled)?
                }
                _ => Uneven::No,
            };
            let dt = if let Time::Even(dt) = time { *dt } else { f64::NAN };
            Ok(JointRecordPlan { samples: *samples, dt, window, plans, range, narrow, uneven })
        };
        let records = sampling.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        let (variances, wider) = (variances.to_vec(), OnceLock::new());
        Ok(JointFitter { o, isa, records, kinds, variances, doublings, wider })
    }

    /// The fitter with a band twice as wide, where the rule's choice met the end of this one.
    pub(crate) fn wider(&self, rule: Option<BandRule>) -> Option<&JointFitter> {
        rule.filter(BandRule::meets_end)?;
        let make = || {
            let even = |r: &JointRecordPlan| {
                let each = match r.uneven {
                    Uneven::No => 0,
                    Uneven::Each(_) => 1,
                    Uneven::Together(_) => self.o.structure.orders.len(),
                };
                (r.dt.is_finite() && 2 * each * r.range.1 <= DENSE)
                    .then_some((r.samples, Time::Even(r.dt)))
            };
            let sampling: Vec<_> = self.records.iter().map(even).collect::<Option<_>>()?;
            let (doublings, o) = (self.doublings + 1, self.o.clone());
            let wider = JointFitter::doubled(doublings, o, &sampling, &self.variances, self.isa);
            let further = |wider: &JointFitter| reaches_further(&wider.ranges(), &self.ranges());
            wider.ok().filter(further).map(Box::new)
        };
        self.wider.get_or_init(make).as_deref()
    }

    /// Fits one structure to one record, or to several as one problem.
    ///
    /// # Errors
    /// [`Error::Data`] for what the caller can mend; failures of the numbers are a [`Status`].
    pub fn fit(&self, records: &[JointRecord<'_>]) -> Result<JointFit, Error> {
        self.fit_on(records, None)
    }

    /// The same, and where errors fall beyond the end of the default band, on more lines. `before`: the estimate on
    /// fewer.
    pub(crate) fn fit_on(
        &self,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let fit = self.fit_here(records, before)?;
        let Some(wider) = self.wider(fit.answer.band_rule) else { return Ok(fit) };
        let other = wider.fit_on(records, Some(&fit.answer.theta))?;
        let structure = &self.o.structure;
        let is_taken = fit.candidate(structure).yields_to(&other.candidate(structure));
        Ok(if is_taken { other } else { fit })
    }

    fn fit_here(
        &self,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let mut loaded = self.load(records)?;
        if records.len() == 1 || !(self.o.own_levels && self.adapts()) {
            return self.fit_loaded(&loaded, records, before);
        }
        if self.o.band != Band::Default {
            let first = self.fit_loaded(&loaded, records, None)?;
            return self.levelled(&mut loaded, records, &self.o.noise, first);
        }
        // Lines are chosen with the levels that few of them tell; then all tell them better than those the fit needs.
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        let wide = self.ranges();
        if let Some(theta) = self.narrow_estimate(&loaded, records, &wide)? {
            let few = (&white, JointStart::Theta(&theta));
            let few = self.fit_from(&loaded, records, &self.narrow(&wide), few)?;
            self.levelled(&mut loaded, records, &white, few)?;
        }
        let first = self.fit_loaded(&loaded, records, before)?;
        let theta = first.answer.theta.clone();
        let all = (&self.o.noise, JointStart::Theta(&theta));
        let all = self.fit_from(&loaded, records, &wide, all)?;
        self.levelled(&mut loaded, records, &self.o.noise, all)?;
        self.repeated(&loaded, records, &self.o.noise, &first)
    }

    /// The fit with noise levels of the records that its residuals have.
    fn levelled(
        &self,
        loaded: &mut Loaded,
        records: &[JointRecord<'_>],
        noise: &NoiseModel,
        first: JointFit,
    ) -> Result<JointFit, Error> {
        let misfits = |fit: &JointFit| misfits(&fit.answer, fit.scale.sqrt(), &fit.residuals);
        let (levels, fit) = settle(loaded.scales.levels.clone(), first, misfits, |levels, fit| {
            loaded.scales.levels.copy_from_slice(levels);
            self.repeated(loaded, records, noise, fit)
        })?;
        loaded.scales.levels = levels;
        Ok(fit)
    }

    /// A fit once more on its lines, from where it stands, with the levels that stand.
    fn repeated(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        noise: &NoiseModel,
        fit: &JointFit,
    ) -> Result<JointFit, Error> {
        let Answer { theta, lines, nit, band_rule, .. } = &fit.answer;
        let ranges: Vec<Range> = lines.iter().map(|l| (l.first, l.last)).collect();
        let start = JointStart::Theta(theta);
        let mut again = self.fit_from(loaded, records, &ranges, (noise, start))?;
        again.answer.nit += nit;
        again.answer.band_rule = *band_rule;
        Ok(again)
    }

    /// The estimate on these lines from one start.
    fn fit_from(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
        (noise, start): (&NoiseModel, JointStart<'_>),
    ) -> Result<JointFit, Error> {
        let d = self.design(ranges, &loaded.scales, noise, true)?;
        let mut delayed = self.delayed(records);
        let mut refresh = |w: &mut JointSpace| delays::refresh(self.isa, &d, w, &mut delayed, 1);
        let mut single = self.single(&d, loaded);
        let ended = single.estimate(start, &self.o.options, None, &mut refresh)?;
        Ok(self.finished(&d, &mut single, (ended, None), loaded))
    }

    /// The same from coefficients of each record and signal (outputs, then paths), with delays that are known.
    ///
    /// # Errors
    /// As [`JointFitter::fit`], and [`Error::Spec`] where a delay is to be found.
    pub(crate) fn fit_coefficients(&self, spectra: Spectra) -> Result<JointFit, Error> {
        if !self.o.structure.free_delays().is_empty() {
            return Err(Error::Spec(
                "fitting coefficients: a delay that is to be found needs the samples".into(),
            ));
        }
        self.fit_loaded(&Loaded::new(spectra), &[], None)
    }

    fn fit_loaded(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let Choice { ranges, rule, theta } = self.choose(loaded, records, before)?;
        let d = self.design(&ranges, &loaded.scales, &self.o.noise, true)?;
        let mut delayed = self.delayed(records);
        let mut refresh = |w: &mut JointSpace| delays::refresh(self.isa, &d, w, &mut delayed, 1);
        let start = theta.as_deref().map_or(JointStart::Wls, JointStart::Theta);
        let mut best = self.single(&d, loaded);
        let mut ended = best.estimate(start, &self.o.options, None, &mut refresh)?;
        // On the way to the right minimum steps are few: those with Σ = 1, and those with Σ of the residuals.
        let usual = if d.estimates_covariance() { 2 * MANY } else { MANY };
        let long = ended.status == Status::MaxIter || ended.nit > usual;
        // Ways from different starts may end in different minima. Delays that were sought had many starts.
        let narrow = match (rule, &theta) {
            (None, None) if long => self.narrow_estimate(loaded, records, &ranges)?,
            _ => None,
        };
        let second = match (rule, &theta) {
            (Some(_), Some(_)) => Some(JointStart::Wls),
            _ => narrow.as_deref().map(JointStart::Theta),
        };
        if let Some(second) = second {
            let mut other = self.single(&d, loaded);
            // Delays stand where that ended.
            other.w.iterates.theta.now.clone_from(&best.w.iterates.theta.now);
            let found = best.estimates();
            let near = (ended.status == Status::Ok).then_some(&found[..]);
            // The second has the steps of a trial to come lower; only then is it followed to its end.
            let few = self.few_steps();
            let mut again = other.estimate(second, &few, near, &mut refresh)?;
            let lower = !again.near && other.criterion() < best.criterion();
            if again.status == Status::MaxIter && lower {
                let theta: Vec<f64> = other.w.theta(&d, 0).collect();
                let start = JointStart::Theta(&theta);
                again = other.estimate(start, &self.o.options, near, &mut refresh)?;
            }
            let cost = |single: &Single<'_>, ended: &Ended| match ended.status {
                Status::Ok => single.criterion(),
                _ => f64::INFINITY,
            };
            let least = match cost(&best, &ended) {
                found if found.is_finite() => found - SAME * found.abs(),
                none => none,
            };
            if !again.near && cost(&other, &again) < least {
                (best, ended) = (other, again);
            }
        }
        Ok(self.finished(&d, &mut best, (ended, rule), loaded))
    }

    /// Coefficients of all channels of all records.
    pub(crate) fn load(&self, records: &[JointRecord<'_>]) -> Result<Loaded, Error> {
        let (outputs, paths) = (self.o.structure.orders.len(), &self.o.structure.paths);
        let inputs = self.o.intersample.len();
        if records.len() != self.records.len() {
            return Err(Error::Data(format!(
                "fitting: {} records were given where {} were announced",
                records.len(),
                self.records.len()
            )));
        }
        let mut spectra = Vec::with_capacity(records.len());
        for (record, plan) in records.iter().zip(&self.records) {
            if record.y.len() != outputs || record.u.len() != inputs {
                return Err(Error::Data(format!(
                    "fitting: the structure has {outputs} outputs and {inputs} inputs but a record has {} \
                     and {}",
                    record.y.len(),
                    record.u.len()
                )));
            }
            let channels = record.y.iter().chain(paths.iter().map(|p| &record.u[p.input]));
            let one = |(plan, samples): (&CoefficientPlan, &&[f64])| {
                let lines = plan.harmonics() + 1;
                let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
                plan.run_in(self.isa, samples, &mut re, &mut im, &mut plan.scratch())?;
                Ok((re, im))
            };
            spectra
                .push(plan.plans.iter().zip(channels).map(one).collect::<Result<Vec<_>, Error>>()?);
        }
        Ok(Loaded::new(spectra))
    }

    /// The problem on some lines; `whitened`: with what is known of samples that are worse than others.
    pub(crate) fn design(
        &self,
        ranges: &[Range],
        scales: &Scales,
        noise: &NoiseModel,
        whitened: bool,
    ) -> Result<JointDesign, Error> {
        let o = &self.o;
        let plan = |structure: &JointStructure, noise: &NoiseModel, samples: f64| {
            let record = |(((first, last), r), level): ((&Range, &JointRecordPlan), &f64)| {
                let last = (r.window.intervals as f64 / samples + 1e-9).min(*last as f64) as usize;
                let highest = match noise.colour {
                    Colour::Fitted => r.plans[0].harmonics(),
                    Colour::Given => last,
                };
                RecordLines {
                    lines: Lines {
                        first: *first,
                        last: highest,
                        omega0: r.window.omega0,
                        unit_variance: r.plans[0].unit_variance() * level,
                    },
                    used: (last + 1).saturating_sub(*first),
                    uneven: match whitened {
                        true => r.uneven.of_variance(*level),
                        false => Uneven::No,
                    },
                }
            };
            let records = ranges.iter().zip(&self.records).zip(&scales.levels).map(record);
            let (records, units) = (records.collect(), scales.units.clone());
            JointDesign::new(structure, o.method, noise, o.trend, o.extended, records, units)
        };
        let mut design = plan(&o.structure, noise, 0.0)?;
        let input = |p: &Path| {
            let delay = match p.delay {
                Delay::Known(delay) => delay,
                // Where it stands is looked up.
                Delay::Free { .. } => 0.0,
            };
            (o.intersample.get(p.input).copied().flatten(), delay)
        };
        let inputs: Vec<(Option<Hold>, f64)> = o.structure.paths.iter().map(input).collect();
        let steps = self.records.iter().map(|r| Some(r.dt).filter(|dt| dt.is_finite()));
        design.aliasing = Aliasing::new(&inputs, steps, design.band_edge);
        let white = NoiseModel { colour: Colour::Given, ..noise.clone() };
        design.seen = Seen::new(&design, |structure| plan(structure, &white, SAMPLES));
        let scaled = |p: &Prior| p.over(design.parameter_scale(p.parameter));
        design.priors = o.priors.iter().map(scaled).collect();
        Ok(design)
    }

    /// A workspace that holds the coefficients in all lanes.
    pub(crate) fn space(&self, d: &JointDesign, loaded: &Loaded) -> JointSpace {
        let mut w = JointSpace::new(d);
        for (k, spectra) in loaded.spectra.iter().enumerate() {
            let first = d.records[k].lines.first;
            for (signal, ((re, im), unit)) in spectra.iter().zip(&loaded.scales.units).enumerate() {
                let (to_re, to_im) = w.signal_mut(k, signal);
                for (m, (to_re, to_im)) in to_re.iter_mut().zip(to_im).enumerate() {
                    *to_re = Wide::splat(re[first + m] / unit);
                    *to_im = Wide::splat(im[first + m] / unit);
                }
            }
        }
        w.begin_delays(d);
        w
    }

    /// A single problem that holds the coefficients, eight lines in the lanes.
    pub(crate) fn single<'d>(&self, d: &'d JointDesign, loaded: &Loaded) -> Single<'d> {
        let mut single = Single::new(self.isa, d);
        for (k, spectra) in loaded.spectra.iter().enumerate() {
            for (signal, ((re, im), unit)) in spectra.iter().zip(&loaded.scales.units).enumerate() {
                single.load(k, signal, (re, im), *unit);
            }
        }
        single.w.begin_delays(d);
        single.w.keep_measured();
        single
    }

    pub(crate) fn delayed<'a>(&'a self, records: &[JointRecord<'a>]) -> Vec<Delayed<'a>> {
        let one = |(record, plan): (&JointRecord<'a>, &JointRecordPlan)| Delayed {
            samples: self.o.structure.paths.iter().map(|p| vec![record.u[p.input]]).collect(),
            kinds: &self.kinds,
            dt: plan.dt,
            lead: plan.window.lead,
            intervals: plan.window.intervals,
            tables: Vec::new(),
        };
        records.iter().zip(&self.records).map(one).collect()
    }

    /// What a user sees of an estimate.
    fn finished(
        &self,
        d: &JointDesign,
        single: &mut Single<'_>,
        (ended, band_rule): (Ended, Option<BandRule>),
        loaded: &Loaded,
    ) -> JointFit {
        let q = d.outputs();
        let freedom = d.degrees_of_freedom();
        let (found, status) = single.answer(ended);
        let Covariances {
            nonrobust,
            hc3,
            spectral,
            degrees,
            noise_spectrum,
            normal,
            residuals,
            ..
        } = found;
        let w = &single.w;
        let cost = w.progress.cost.0[0];
        let scale = cost / freedom as f64;
        let plain_sigma = scale.sqrt();
        let unit = |i: usize| d.residual_unit(i);
        let noise =
            (0..q * q).map(|k| w.sigma[k].0[0] * scale * unit(k / q) * unit(k % q)).collect();
        let p = d.parameters();
        let over = |(re, im): &(f64, f64)| (re / plain_sigma, im / plain_sigma);
        JointFit {
            answer: Answer {
                theta: w.theta(d, 0).collect(),
                cov_nonrobust: nonrobust,
                cov_hc3: hc3,
                cov_spectral: spectral,
                degrees,
                noise_spectrum,
                gram: unit_diagonal(|k| normal[k], p),
                cost: if q == 1 { cost * w.sigma[0].0[0] * unit(0) * unit(0) } else { cost },
                degrees_of_freedom: freedom,
                status,
                nit: ended.nit,
                lines: d.lines(),
                band_rule,
            },
            scale,
            noise,
            record_levels: loaded.scales.levels.iter().map(|v| v.sqrt()).collect(),
            at_bound: w.pinned.iter().map(|v| v.0[0] > 0.0).collect(),
            residuals: residuals
                .iter()
                .map(|r| r.iter().map(|o| o.iter().map(over).collect()).collect())
                .collect(),
        }
    }
}

impl JointSpace {
    /// Delays at their starts.
    pub(crate) fn begin_delays(&mut self, d: &JointDesign) {
        for (at, s) in d.free_delays.iter().enumerate() {
            if let Delay::Free { start, .. } = d.structure.paths[*s].delay {
                self.iterates.theta.now[d.free.len() + at] = Wide::splat(start / d.delay_scale);
            }
        }
    }
}
