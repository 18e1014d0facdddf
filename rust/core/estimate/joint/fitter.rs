//! A joint structure and a way of sampling made ready: plans of coefficients, the design on chosen lines, workspaces.

use std::sync::OnceLock;

use super::delays::Delayed;
use super::design::{Colour, JointDesign, NoiseModel, RecordLines, Seen};
use super::single::Single;
use super::structure::{Delay, JointStructure, Path};
use super::whitener::{Uneven, uneven};
use super::workspace::JointWorkspace;
use crate::error::Error;
use crate::estimate::Options;
use crate::estimate::aliasing::{Aliasing, output_rule};
use crate::estimate::at_once::SAMPLES;
use crate::estimate::band::{Band, BandRule, Range, default_lines, lines_of_both_noises};
use crate::estimate::each_record::EachRecord;
use crate::estimate::fit::Time;
use crate::estimate::fitter::binary_unit;
use crate::estimate::prior::{self, Prior};
use crate::estimate::wider::reaches_further;
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
    pub intersample: EachRecord<Vec<Option<Hold>>>,
    /// Quadrature of smooth signals.
    pub rule: Rule,
    /// Estimator: `wls`, `awls` or `ml`.
    pub method: Method,
    /// What the residuals are weighted by.
    pub noise: NoiseModel,
    /// Whether noise drives the system, too: of one output, with known delays and samples of even noise.
    pub driven: bool,
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
    /// How many inputs a record has.
    pub fn inputs(&self) -> usize {
        self.intersample.of(0).len()
    }

    /// How the input of each path runs between samples, in a record.
    fn holds(&self, record: usize) -> impl Iterator<Item = Option<Hold>> {
        let own = self.intersample.of(record);
        self.structure.paths.iter().map(|p| own[p.input])
    }

    /// Checks what does not depend on data.
    fn check(&self) -> Result<(), Error> {
        let (outputs, paths) = (self.structure.orders.len(), &self.structure.paths);
        let inputs = self.inputs();
        if let Some(kinds) = self.intersample.iter().find(|kinds| kinds.len() != inputs) {
            return Err(Error::Spec(format!(
                "fitting: {} intersample kinds of one record and {inputs} of another",
                kinds.len()
            )));
        }
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

/// How one record becomes coefficients.
pub(crate) struct JointRecordPlan {
    pub samples: usize,
    pub dt: f64,
    pub window: Window,
    /// Outputs, then paths.
    pub plans: Vec<CoefficientPlan>,
    /// How the input of each path runs between samples.
    pub kinds: Vec<Kind>,
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
    /// Variances of the samples, where they are uneven.
    pub(super) variances: Vec<Vec<Vec<f64>>>,
    /// How often the wide band of the default rule was doubled.
    doublings: u32,
    /// The same with a band twice as wide, made when a record asks for it; none where samples show no more.
    wider: OnceLock<Option<Box<JointFitter>>>,
    /// Of each output alone, where delays start from its estimate; made when first wanted.
    pub(super) alone: OnceLock<Vec<Alone>>,
}

/// The fits of one output, and where its parameters stand among all.
pub(super) struct Alone {
    pub output: usize,
    pub fitter: JointFitter,
    pub places: Vec<usize>,
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
    pub(crate) fn new(spectra: Spectra) -> Loaded {
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
        let even = variances.iter().all(Vec::is_empty);
        if o.driven
            && !(s.orders.len() == 1
                && s.free_delays().is_empty()
                && even
                && o.method == Method::Ml)
        {
            return Err(Error::Spec(
                "fitting with process noise: it takes one output, delays that are known, samples of even noise without \
                 gaps, and method=\"ml\""
                    .into(),
            ));
        }
        prior::check(&o.priors, s.parameters(), o.method)?;
        if sampling.is_empty() {
            return Err(Error::Data("fitting: no record was given".into()));
        }
        o.intersample.check("intersample kinds", sampling.len())?;
        let most = sampling.iter().map(|s| s.0).max().unwrap_or(0);
        if s.parameters() > most.saturating_mul(s.orders.len()) {
            return Err(Error::Data(format!(
                "fitting: {} parameters from at most {most} samples a record; take fewer poles and zeros",
                s.parameters()
            )));
        }
        // A free delay begins where the window lies: the plan tells what its first value is.
        let start = |delay: Delay| match delay {
            Delay::Known(delay) => delay,
            Delay::Free { start, .. } => start,
        };
        let outputs = s.orders.len();
        let order = s.orders.iter().copied().max().unwrap_or(1);
        let unknowns = s.parameters() + outputs * o.trend.terms();
        let plan = |(k, (samples, time)): (usize, &(usize, Time<'_>))| {
            let kinds: Vec<Kind> =
                o.holds(k).map(|hold| hold.map_or(Kind::Rule(o.rule), Kind::Hold)).collect();
            let even = matches!(time, Time::Even(_));
            let rule = output_rule(o.rule, o.intersample.of(k), even);
            let channels: Vec<(Kind, f64)> = std::iter::repeat_n((Kind::Rule(rule), 0.0), outputs)
                .chain(kinds.iter().zip(&s.paths).map(|(kind, p)| (*kind, start(p.delay))))
                .collect();
            let window = Window::new(*samples, *time, s.longest_delay())?;
            let each = unknowns.div_ceil(outputs);
            let (mut wide, narrow) = default_lines(o.method, each, order, window.both(), doublings);
            if o.driven {
                wide = lines_of_both_noises(wide, window.resolved);
            }
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
            Ok(JointRecordPlan {
                samples: *samples,
                dt,
                window,
                plans,
                kinds,
                range,
                narrow,
                uneven,
            })
        };
        let records = sampling.iter().enumerate().map(plan).collect::<Result<_, Error>>()?;
        let (variances, wider, alone) = (variances.to_vec(), OnceLock::new(), OnceLock::new());
        Ok(JointFitter { o, isa, records, variances, doublings, wider, alone })
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

    /// Coefficients of all channels of all records.
    pub(crate) fn load(&self, records: &[JointRecord<'_>]) -> Result<Loaded, Error> {
        let (outputs, paths) = (self.o.structure.orders.len(), &self.o.structure.paths);
        let inputs = self.o.inputs();
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
        let delay = |p: &Path| match p.delay {
            Delay::Known(delay) => delay,
            // Where it stands is looked up.
            Delay::Free { .. } => 0.0,
        };
        let inputs = |k: usize| o.holds(k).zip(o.structure.paths.iter().map(delay)).collect();
        let steps = self.records.iter().map(|r| Some(r.dt).filter(|dt| dt.is_finite()));
        design.aliasing = Aliasing::new(steps.zip((0..).map(inputs)), design.band_edge);
        let white = NoiseModel { colour: Colour::Given, ..noise.clone() };
        design.seen = Seen::new(&design, |structure| plan(structure, &white, SAMPLES));
        let scaled = |p: &Prior| p.over(design.parameter_scale(p.parameter));
        design.priors = o.priors.iter().map(scaled).collect();
        Ok(design)
    }

    /// A workspace that holds the coefficients in all lanes.
    pub(crate) fn space(&self, d: &JointDesign, loaded: &Loaded) -> JointWorkspace {
        let mut w = JointWorkspace::new(d);
        for (k, spectra) in loaded.spectra.iter().enumerate() {
            let first = d.records[k].lines.first;
            for (signal, ((re, im), unit)) in spectra.iter().zip(&loaded.scales.units).enumerate() {
                let (to_re, to_im) = w.signal_mut(k, signal);
                for (m, (to_re, to_im)) in to_re.iter_mut().zip(to_im).enumerate() {
                    *to_re = Wide::splat(re[first + m] / unit);
                    *to_im = Wide::splat(im[first + m] / unit);
                }
                let jump = Wide::splat(im[0] / unit);
                w.keep_jump(d, k, signal, |to| *to = jump);
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
        let one = |(record, plan): (&JointRecord<'a>, &'a JointRecordPlan)| Delayed {
            samples: self.o.structure.paths.iter().map(|p| vec![record.u[p.input]]).collect(),
            kinds: &plan.kinds,
            dt: plan.dt,
            lead: plan.window.lead,
            intervals: plan.window.intervals,
            tables: Vec::new(),
        };
        records.iter().zip(&self.records).map(one).collect()
    }
}

impl JointWorkspace {
    /// Delays at their starts.
    pub(crate) fn begin_delays(&mut self, d: &JointDesign) {
        for (at, s) in d.free_delays.iter().enumerate() {
            if let Delay::Free { start, .. } = d.structure.paths[*s].delay {
                self.iterates.theta.now[d.free.len() + at] = Wide::splat(start / d.delay_scale);
            }
        }
    }
}
