//! Many joint fits at once: eight records a block, or one where problems are large; blocks over threads.

use std::sync::Arc;

use super::at_once::one_by_one;
use super::delays::{self, Delayed};
use super::design::JointDesign;
use super::fitter::{JointFitter, JointRecord, JointRecordPlan, Loaded};
use super::iterate::{JointStart, estimate};
use super::single::Single;
use super::workspace::JointWorkspace;
use crate::error::Error;
use crate::estimate::band::Choice;
use crate::estimate::batch::CHUNK;
use crate::estimate::{Many, Options, Outcome, Wanted};
use crate::simd::{Isa, LANES, Wide};
use crate::spectrum::{CoefficientPlan, Kind, Scratch};
use crate::threads::{self, Control};

/// Unknowns above which one record fills the lanes better than eight.
const LARGE: usize = 24;

/// What all replicates share: lines, design, how samples become coefficients, where a delay starts.
pub(crate) struct JointShared {
    pub design: Arc<JointDesign>,
    /// Outputs, then paths.
    pub plans: Vec<CoefficientPlan>,
    pub kinds: Vec<Kind>,
    pub dt: f64,
    lead: usize,
    intervals: usize,
    /// Estimate of the record that chose the band, where delays are sought: their start.
    start: Option<Vec<f64>>,
}

/// Samples of many records of one length and step.
#[derive(Debug, Clone)]
pub struct JointBatch<'a> {
    /// Outputs of each record, record after record.
    pub y: Vec<&'a [f64]>,
    /// Inputs of each record, record after record; or one set for all.
    pub u: Vec<&'a [f64]>,
    /// How many records.
    pub records: usize,
}

impl JointBatch<'_> {
    fn outputs(&self) -> usize {
        self.y.len() / self.records.max(1)
    }

    fn input(&self, record: usize, inputs: usize, k: usize) -> &[f64] {
        if self.u.len() == inputs { self.u[k] } else { self.u[record * inputs + k] }
    }

    fn record(&self, r: usize, inputs: usize) -> JointRecord<'_> {
        let q = self.outputs();
        JointRecord {
            y: self.y[r * q..(r + 1) * q].to_vec(),
            u: (0..inputs).map(|k| self.input(r, inputs, k)).collect(),
        }
    }
}

impl JointFitter {
    /// What the records of a batch share: lines as given, or as found on one record.
    pub(crate) fn shared(&self, record: &JointRecord<'_>) -> Result<JointShared, Error> {
        self.shared_after(record, None)
    }

    /// The same after the estimate `before` over a narrower band.
    fn shared_after(
        &self,
        record: &JointRecord<'_>,
        before: Option<&[f64]>,
    ) -> Result<JointShared, Error> {
        let alike = |r: &JointRecordPlan| r.dt.is_finite() && r.uneven.is_none();
        let one = self.records.len() == 1 && alike(&self.records[0]);
        if !one {
            return Err(Error::Spec(
                "fitting a batch: its records need one even step and samples of equal noise; fit them one \
                 by one"
                    .into(),
            ));
        }
        let own = &self.records[0];
        let loaded = self.load(std::slice::from_ref(record))?;
        let records = std::slice::from_ref(record);
        let Choice { ranges, theta, rule } = self.choose(&loaded, records, before)?;
        if let Some(wider) = self.wider(rule) {
            let fit = self.fit_on(records, before)?;
            if fit.answer.band_rule.map(|rule| rule.wide) > rule.map(|rule| rule.wide) {
                return wider.shared_after(record, theta.as_deref());
            }
        }
        let design = self.design(&ranges, &loaded.scales, &self.o.noise, false)?;
        let start = theta.filter(|_| !design.free_delays.is_empty());
        Ok(JointShared {
            design: Arc::new(design),
            plans: own.plans.clone(),
            kinds: own.kinds.clone(),
            dt: own.dt,
            lead: own.window.lead,
            intervals: own.window.intervals,
            start,
        })
    }

    /// Fits every record of a batch by itself.
    ///
    /// # Errors
    /// As [`JointFitter::fit`]; [`Error::Cancelled`] and [`Error::Internal`] from the threads.
    pub fn fit_many(
        &self,
        batch: &JointBatch<'_>,
        thread_count: usize,
        progress: &mut dyn FnMut(usize, usize) -> Control,
    ) -> Result<(Many, Arc<JointDesign>), Error> {
        let (inputs, outputs) = (self.o.inputs(), self.o.structure.orders.len());
        if self.o.driven {
            return Err(Error::Spec(
                "fitting a batch with process noise: held and bounded coefficients are fitted record by record".into(),
            ));
        }
        let samples = self.records[0].samples;
        let shapes = batch.records > 0
            && batch.y.len() == outputs * batch.records
            && (batch.u.len() == inputs || batch.u.len() == inputs * batch.records)
            && batch.y.iter().chain(&batch.u).all(|c| c.len() == samples);
        if !shapes {
            return Err(Error::Data(format!(
                "fitting a batch: {} outputs and {} inputs of {} records where each record has {outputs} and \
                 {inputs} channels of {samples} samples",
                batch.y.len(),
                batch.u.len(),
                batch.records
            )));
        }
        let sound = |r: &usize| {
            let own = &batch.y[r * outputs..(r + 1) * outputs];
            own.iter().all(|y| y.iter().all(|v| v.is_finite()))
        };
        let chooser = (0..batch.records).find(sound).unwrap_or(0);
        let shared = self.shared(&batch.record(chooser, inputs))?;
        let options = Options { wanted: Wanted::Covariance, ..self.o.options };
        // Lanes know nothing of priors.
        let large = shared.design.size() > LARGE || !self.o.priors.is_empty();
        let make = || shared.worker(self.isa, large);
        let work = |w: &mut JointBatchWorkspace<'_>, chunk: usize| {
            let mut out = Many::default();
            let (from, to) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(batch.records));
            if let Some(single) = &mut w.single {
                for r in (from..to).take_while(|_| !threads::stopped()) {
                    let spectra = self.load(&[batch.record(r, inputs)])?;
                    self.fit_in(single, &shared, &batch.record(r, inputs), &spectra, &mut out)?;
                }
                return Ok(out);
            }
            for first in (from..to).step_by(LANES) {
                if threads::stopped() {
                    break;
                }
                let count = (to - first).min(LANES);
                for (signal, plan) in shared.plans.iter().enumerate() {
                    for lane in 0..LANES {
                        // Spare lanes repeat the last record: finite work, thrown away.
                        let r = first + lane.min(count - 1);
                        let from = match signal.checked_sub(outputs) {
                            None => batch.y[r * outputs + signal],
                            Some(s) => batch.input(r, inputs, shared.input(s)),
                        };
                        for (to, value) in w.samples.iter_mut().zip(from) {
                            to.0[lane] = *value;
                        }
                    }
                    let scratch = &mut w.scratch[signal];
                    plan.run_lanes(self.isa, &w.samples, &mut w.re, &mut w.im, scratch)?;
                    shared.load(&mut w.space, signal, &w.re, &w.im);
                }
                let samples = (0..shared.kinds.len())
                    .map(|s| {
                        let own = |lane: usize| {
                            batch.input(first + lane.min(count - 1), inputs, shared.input(s))
                        };
                        (0..LANES).map(own).collect()
                    })
                    .collect();
                let live = std::array::from_fn(|lane| lane < count);
                let outcome = shared.estimate(self.isa, &mut w.space, live, samples, &options)?;
                for lane in 0..count {
                    out.push_joint(&shared.design, &w.space, lane, &outcome);
                }
            }
            Ok(out)
        };
        let chunks = batch.records.div_ceil(CHUNK);
        let parts = threads::run(thread_count, chunks, progress, make, work)?;
        let mut all = Many::default();
        for part in parts {
            all.append(part?);
        }
        Ok((all, Arc::clone(&shared.design)))
    }
}

/// One worker's memory for blocks of records, or for one at a time where problems are large.
#[derive(Default)]
struct JointBatchWorkspace<'d> {
    single: Option<Single<'d>>,
    space: JointWorkspace,
    scratch: Vec<Scratch>,
    samples: Vec<Wide>,
    re: Vec<Wide>,
    im: Vec<Wide>,
}

impl JointFitter {
    /// Fits one record of a batch by itself, on the lines and in the units of all.
    fn fit_in(
        &self,
        single: &mut Single<'_>,
        shared: &JointShared,
        record: &JointRecord<'_>,
        loaded: &Loaded,
        out: &mut Many,
    ) -> Result<(), Error> {
        let d = single.d;
        for (signal, ((re, im), unit)) in loaded.spectra[0].iter().zip(&d.units).enumerate() {
            single.load(0, signal, (re, im), *unit);
        }
        single.w.begin_delays(d);
        single.w.keep_measured();
        let mut delayed = self.delayed(std::slice::from_ref(record));
        let mut refresh = |w: &mut JointWorkspace| delays::refresh(self.isa, d, w, &mut delayed, 1);
        let start = shared.start.as_deref().map_or(JointStart::Wls, JointStart::Theta);
        let ended = single.estimate(start, &self.o.options, None, &mut refresh)?;
        let (found, status) = single.answer(ended);
        let p = d.parameters();
        out.theta.extend(single.w.theta(d, 0));
        out.bse_nonrobust.extend((0..p).map(|k| found.nonrobust[k * (p + 1)].sqrt()));
        out.bse_hc3.extend((0..p).map(|k| found.hc3[k * (p + 1)].sqrt()));
        out.bse_spectral.extend((0..p).map(|k| found.spectral[k * (p + 1)].sqrt()));
        out.degrees.extend(found.degrees);
        out.status.push(status);
        out.push_cost(d, &single.w, 0);
        out.nit.push(ended.nit);
        Ok(())
    }
}

impl JointShared {
    fn worker(&self, isa: Isa, large: bool) -> JointBatchWorkspace<'_> {
        if large {
            let single = Some(Single::new(isa, &self.design));
            return JointBatchWorkspace { single, ..JointBatchWorkspace::default() };
        }
        let (samples, lines) = (self.plans[0].samples(), self.plans[0].harmonics() + 1);
        JointBatchWorkspace {
            single: None,
            space: JointWorkspace::new(&self.design),
            scratch: self.plans.iter().map(CoefficientPlan::scratch).collect(),
            samples: vec![Wide::ZERO; samples],
            re: vec![Wide::ZERO; lines],
            im: vec![Wide::ZERO; lines],
        }
    }

    /// Which input a path begins with.
    pub(crate) fn input(&self, path: usize) -> usize {
        self.design.structure.paths[path].input
    }

    /// Copies coefficients from line 0 on into the workspace, in its units.
    pub(crate) fn load(&self, space: &mut JointWorkspace, signal: usize, re: &[Wide], im: &[Wide]) {
        let lines = self.design.records[0].lines;
        let by = 1.0 / self.design.units[signal];
        let (to_re, to_im) = space.signal_mut(0, signal);
        let from = re[lines.first..=lines.last].iter().zip(&im[lines.first..=lines.last]);
        for ((to_re, to_im), (from_re, from_im)) in to_re.iter_mut().zip(to_im).zip(from) {
            // Units are powers of two: nothing is rounded.
            for lane in 0..LANES {
                to_re.0[lane] = from_re.0[lane] * by;
                to_im.0[lane] = from_im.0[lane] * by;
            }
        }
        let jump = Wide(im[0].0.map(|v| v * by));
        space.keep_jump(&self.design, 0, signal, |to| *to = jump);
    }

    /// Brings outputs that stand in the user's units to those of the workspace.
    pub(crate) fn to_units(&self, space: &mut JointWorkspace) {
        for output in 0..self.design.outputs() {
            let by = 1.0 / self.design.units[output];
            let (re, im) = space.signal_mut(0, output);
            for value in re.iter_mut().chain(im) {
                for lane in &mut value.0 {
                    *lane *= by;
                }
            }
        }
    }

    /// Estimates what stands in the workspace; `samples` of each path's input, one set or one a lane.
    pub(crate) fn estimate(
        &self,
        isa: Isa,
        space: &mut JointWorkspace,
        live: [bool; LANES],
        samples: Vec<Vec<&[f64]>>,
        options: &Options,
    ) -> Result<Outcome, Error> {
        let d = &self.design;
        if d.acts_at_once() {
            return one_by_one(isa, d, space, live, options);
        }
        let mut delayed = [Delayed {
            samples,
            kinds: &self.kinds,
            dt: self.dt,
            lead: self.lead,
            intervals: self.intervals,
            tables: Vec::new(),
        }];
        let mut refresh = |w: &mut JointWorkspace| delays::refresh(isa, d, w, &mut delayed, LANES);
        space.begin_delays(d);
        let start = match &self.start {
            Some(theta) => JointStart::Theta(theta),
            None => JointStart::Wls,
        };
        estimate(isa, d, space, live, start, options, &mut refresh)
    }
}

impl Many {
    /// Adds one lane's results.
    fn push_joint(&mut self, d: &JointDesign, w: &JointWorkspace, lane: usize, outcome: &Outcome) {
        self.theta.extend(w.theta(d, lane));
        self.push_errors(&w.covariances, lane, |k| d.parameter_scale(k));
        self.status.push(outcome.status[lane]);
        self.push_cost(d, w, lane);
        self.nit.push(outcome.nit[lane]);
    }

    /// Adds a lane's cost: of one output in units of its square.
    fn push_cost(&mut self, d: &JointDesign, w: &JointWorkspace, lane: usize) {
        let unit = match d.outputs() {
            1 => w.sigma[0].0[lane] * d.residual_unit(0) * d.residual_unit(0),
            _ => 1.0,
        };
        self.cost.push(w.progress.cost.0[lane] * unit);
    }
}
