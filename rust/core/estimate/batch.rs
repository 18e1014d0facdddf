//! Many fits of one structure at once: eight records a block, blocks over threads, the same bits as one by one.

use std::sync::Arc;

use super::design::Design;
use super::fit::RecordView;
use super::fitter::Fitter;
use super::many::Many;
use super::options::{Options, Start, Wanted};
use super::replicates::estimate;
use super::shared::BatchWorkspace;
use super::spare::Lent;
use super::workspace::Workspace;
use crate::error::Error;
use crate::modulation::Lines;
use crate::simd::{LANES, Wide};
use crate::threads::{self, Control};

/// Records a chunk, the unit of scheduling.
pub(crate) const CHUNK: usize = 64 * LANES;
/// A chunk with no more samples and visits of a line than this takes milliseconds: no thread is started.
const SHORT: usize = 1 << 22;

/// Samples of many records of one length and step.
#[derive(Debug, Clone)]
pub struct Batch<'a> {
    /// Output of each record.
    pub y: Vec<&'a [f64]>,
    /// Inputs of each record, one record after the other; or one set for all.
    pub u: Vec<&'a [f64]>,
}

/// The same in all lanes: one record has the bits of any lane of eight.
fn spread(from: &[f64], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        *to = Wide::splat(*from);
    }
}

/// Copies coefficients of the used lines into the workspace.
pub(crate) fn load(space: &mut Workspace, signal: usize, lines: Lines, re: &[Wide], im: &[Wide]) {
    let (to_re, to_im) = space.signal_mut(0, signal);
    to_re.copy_from_slice(&re[lines.first..=lines.last]);
    to_im.copy_from_slice(&im[lines.first..=lines.last]);
    space.keep_jump(0, signal, lines.first, |jump| *jump = im[0]);
}

impl Batch<'_> {
    fn shares_inputs(&self, inputs: usize) -> bool {
        self.u.len() == inputs
    }

    fn record(&self, r: usize, inputs: usize) -> RecordView<'_> {
        let first = if self.shares_inputs(inputs) { 0 } else { r * inputs };
        RecordView { y: self.y[r], u: self.u[first..first + inputs].to_vec() }
    }

    fn check(&self, samples: usize, inputs: usize) -> Result<(), Error> {
        if self.y.is_empty() {
            return Err(Error::Data("fitting a batch: it holds no replicate".into()));
        }
        if !self.shares_inputs(inputs) && self.u.len() != inputs * self.y.len() {
            return Err(Error::Data(format!(
                "fitting a batch: {} replicates of {inputs} inputs, but {} inputs were given; give one \
                 set for all or one a replicate",
                self.y.len(),
                self.u.len()
            )));
        }
        if let Some(other) = self.y.iter().chain(&self.u).find(|c| c.len() != samples) {
            return Err(Error::Data(format!(
                "fitting a batch: a channel has {} samples where {samples} were announced; all records \
                 of a batch have the same length",
                other.len()
            )));
        }
        Ok(())
    }
}

impl Fitter {
    /// Fits every record of a batch.
    ///
    /// The band is as given, or chosen on the first record free of missing values and used for all.
    ///
    /// # Errors
    /// As [`Fitter::fit`]; [`Error::Cancelled`] and [`Error::Internal`] from the threads.
    pub fn fit_many(
        &self,
        batch: &Batch<'_>,
        thread_count: usize,
        progress: &mut dyn FnMut(usize, usize) -> Control,
    ) -> Result<(Many, Arc<Design>), Error> {
        let inputs = self.o.structure.numerators.len();
        batch.check(self.records[0].samples, inputs)?;
        let replicates = batch.y.len();
        let sound = |r: &usize| batch.y[*r].iter().all(|v| v.is_finite());
        let chooser = match self.o.band_is_sought() {
            true => (0..replicates).find(sound).unwrap_or(0),
            false => 0,
        };
        let shared = self.shared(&batch.record(chooser, inputs))?;
        let (d, lines) = (&shared.design, shared.design.lines()[0]);
        let options = Options { wanted: Wanted::Covariance, ..self.o.options };
        let once = batch.shares_inputs(inputs);
        // Memory, and whether the inputs that all share are in it.
        let make = || (shared.workers.lend(), false);
        let work = |(worker, loaded): &mut (Lent<'_, BatchWorkspace>, bool), chunk: usize| {
            let w = worker.get_or(|| shared.worker());
            let mut out = Many::default();
            let (from, to) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(replicates));
            for first in (from..to).step_by(LANES) {
                if threads::stopped() {
                    break;
                }
                let count = (to - first).min(LANES);
                for (k, plan) in shared.plans.iter().enumerate() {
                    let scratch = &mut w.scratch[k];
                    if k > 0 && once {
                        if !*loaded {
                            let [re, im] = &mut w.one;
                            plan.run_in(self.isa, batch.u[k - 1], re, im, scratch)?;
                            spread(re, &mut w.re);
                            spread(im, &mut w.im);
                            load(&mut w.space, k, lines, &w.re, &w.im);
                        }
                        continue;
                    }
                    for lane in 0..LANES {
                        // Spare lanes repeat the last record: finite work, thrown away.
                        let r = first + lane.min(count - 1);
                        let from = if k == 0 { batch.y[r] } else { batch.u[r * inputs + k - 1] };
                        for (to, value) in w.samples.iter_mut().zip(from) {
                            to.0[lane] = *value;
                        }
                    }
                    plan.run_lanes(self.isa, &w.samples, &mut w.re, &mut w.im, scratch)?;
                    load(&mut w.space, k, lines, &w.re, &w.im);
                }
                if let Some(known) =
                    d.known_start.as_ref().filter(|k| !(k.periodic() || once && *loaded))
                {
                    w.space.set_drives(known.drives(0, &[], |lane, input| match once {
                        true => batch.u[input],
                        false => batch.u[(first + lane.min(count - 1)) * inputs + input],
                    }));
                }
                *loaded = true;
                let live = std::array::from_fn(|lane| lane < count);
                let outcome = estimate(self.isa, d, &mut w.space, live, Start::Wls, &options);
                for lane in 0..count {
                    out.push(d, &w.space, lane, &outcome);
                }
            }
            Ok(out)
        };
        let chunks = replicates.div_ceil(CHUNK);
        let visits = (shared.plans[0].samples() * (1 + inputs))
            .saturating_add(lines.last.saturating_mul(options.maxiter));
        let short = chunks == 1 && replicates.saturating_mul(visits) <= SHORT;
        let parts =
            threads::run(if short { 0 } else { thread_count }, chunks, progress, make, work)?;
        let mut all = Many::default();
        all.theta.reserve(replicates * d.parameters());
        for part in parts {
            all.append(part?);
        }
        Ok((all, Arc::clone(d)))
    }
}
