//! The memory of one fit: coefficients of its records, and problems on lines with their workspaces.

use std::sync::Arc;

use super::{Fitter, RecordPlan};
use crate::error::Error;
use crate::estimate::band::{CLOSE, Range};
use crate::estimate::design::Design;
use crate::estimate::fit::RecordView;
use crate::estimate::options::{Options, Start, Wanted};
use crate::estimate::outcome::End;
use crate::estimate::replicates::estimate;
use crate::estimate::rest::{Drives, Initial};
use crate::estimate::workspace::Workspace;
use crate::simd::{LANES, Wide};
use crate::spectrum::{CoefficientPlan, Scratch};

/// Problems that a workspace keeps: the two of the default rule, and bands lately chosen.
const PROBLEMS: usize = 4;

/// Memory of one fit.
pub(crate) struct FitWorkspace {
    /// Of each record, each channel.
    pub(super) spectra: Vec<Vec<Spectrum>>,
    /// Power of two at the size of each channel over all records.
    pub(super) units: Vec<f64>,
    /// Noise variance of each record over a common one.
    pub(super) levels: Vec<f64>,
    /// Of each record, what its inputs do to states from a known start.
    drives: Vec<Arc<Drives>>,
    problems: Vec<Problem>,
}

/// Coefficients of one channel.
pub(super) struct Spectrum {
    scratch: Scratch,
    pub(super) re: Vec<f64>,
    pub(super) im: Vec<f64>,
}

/// A choice of lines with its workspace.
pub(crate) struct Problem {
    ranges: Vec<Range>,
    levels: Vec<f64>,
    pub design: Design,
    /// The design's scales before a record's units.
    scale: Vec<f64>,
    pub space: Workspace,
}

/// The power of two at the size of a channel, so that dividing by it changes no digit; one for nothing.
pub(crate) fn binary_unit(size: f64) -> f64 {
    let power = f64::from_bits(size.to_bits() & (0x7ff << 52));
    if power.is_normal() { power } else { 1.0 }
}

impl Fitter {
    pub(super) fn space(&self) -> FitWorkspace {
        let spectrum = |plan: &CoefficientPlan| {
            let none = vec![0.0; plan.harmonics() + 1];
            Spectrum { scratch: plan.scratch(), re: none.clone(), im: none }
        };
        let spectra = |r: &RecordPlan| r.plans.iter().map(spectrum).collect();
        FitWorkspace {
            spectra: self.records.iter().map(spectra).collect(),
            units: Vec::new(),
            levels: vec![1.0; self.records.len()],
            drives: Vec::new(),
            problems: Vec::new(),
        }
    }

    /// Coefficients of all channels, and their units.
    pub(super) fn load(
        &self,
        space: &mut FitWorkspace,
        records: &[RecordView<'_>],
    ) -> Result<(), Error> {
        if records.len() != self.records.len() {
            return Err(Error::Data(format!(
                "fitting: {} records were given where {} were announced",
                records.len(),
                self.records.len()
            )));
        }
        let inputs = self.o.structure.numerators.len();
        for ((record, plan), spectra) in records.iter().zip(&self.records).zip(&mut space.spectra) {
            if record.u.len() != inputs {
                return Err(Error::Data(format!(
                    "fitting: the structure has {inputs} inputs but a record has {}",
                    record.u.len()
                )));
            }
            let channels = std::iter::once(&record.y).chain(&record.u);
            for ((plan, samples), s) in plan.plans.iter().zip(channels).zip(spectra) {
                plan.run_in(self.isa, samples, &mut s.re, &mut s.im, &mut s.scratch)?;
            }
        }
        space.begin();
        space.drives.clear();
        if matches!(self.o.initial, Initial::Zero | Initial::Rest) {
            let known = self.known_start(1.0)?;
            let drives = |(k, record): (usize, &RecordView<'_>)| {
                Arc::new(known.drives(k, &space.units, |_, input| record.u[input]))
            };
            space.drives = records.iter().enumerate().map(drives).collect();
        }
        Ok(())
    }

    /// The problem on lines (first, last) a record, its workspace loaded. Put it back with
    /// [`FitWorkspace::keep`].
    pub(crate) fn problem(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
    ) -> Result<Problem, Error> {
        let same = |p: &Problem| p.ranges == ranges && p.levels == space.levels;
        let mut problem = match space.problems.iter().position(same) {
            Some(at) => space.problems.remove(at),
            None => {
                let design = self.design(ranges, &space.levels)?;
                Problem {
                    ranges: ranges.to_vec(),
                    levels: space.levels.clone(),
                    scale: design.scale.clone(),
                    space: Workspace::new(&design),
                    design,
                }
            }
        };
        problem.load(space);
        Ok(problem)
    }
}

impl FitWorkspace {
    /// Units of the coefficients that stand, the power of two at the size of each channel over all records; noise of
    /// one level.
    pub(super) fn begin(&mut self) {
        self.levels.fill(1.0);
        let size = |k: usize| {
            let parts = self.spectra.iter().flat_map(|s| s[k].re.iter().chain(&s[k].im));
            parts.fold(0.0, |most: f64, v| most.max(v.abs()))
        };
        let channels = self.spectra.first().map_or(0, Vec::len);
        self.units = (0..channels).map(|k| binary_unit(size(k))).collect();
    }

    /// Keeps a problem for the next fit, the latest first.
    pub(crate) fn keep(&mut self, problem: Problem) {
        self.problems.truncate(PROBLEMS - 1);
        self.problems.insert(0, problem);
    }
}

impl Problem {
    /// Writes a workspace's coefficients into the workspace, in the workspace's units.
    fn load(&mut self, space: &FitWorkspace) {
        self.design.scale.copy_from_slice(&self.scale);
        self.design.set_units(&space.units);
        for (k, (spectra, range)) in space.spectra.iter().zip(self.design.lines()).enumerate() {
            for ((signal, s), unit) in spectra.iter().enumerate().zip(&space.units) {
                let (re, im) = self.space.signal_mut(k, signal);
                let from = s.re[range.first..].iter().zip(&s.im[range.first..]);
                for ((re, im), (from_re, from_im)) in re.iter_mut().zip(im).zip(from) {
                    *re = Wide::splat(from_re / unit);
                    *im = Wide::splat(from_im / unit);
                }
                let jump = Wide::splat(s.im[0] / unit);
                self.space.keep_jump(k, signal, range.first, |to| *to = jump);
            }
            // The band rule may have asked for fewer.
            self.space.records[k].limit = self.space.records[k].lines;
            if let Some(drives) = space.drives.get(k) {
                self.space.records[k].tie.drives = drives.clone();
            }
        }
    }

    /// Runs without covariance from `wls` and from these parameters, a lane each, close to the end: costs.
    pub(crate) fn trial(&mut self, fitter: &Fitter, starts: &[Vec<f64>]) -> [f64; LANES] {
        let start = if starts.is_empty() { Start::Wls } else { Start::Each(starts) };
        self.trial_from(fitter, start)
    }

    /// The same from where it is said.
    pub(crate) fn trial_from(&mut self, fitter: &Fitter, start: Start<'_>) -> [f64; LANES] {
        let (d, w) = (&self.design, &mut self.space);
        let given = fitter.o.options;
        let options = Options { wanted: Wanted::Cost, tol: given.tol.max(CLOSE), ..given };
        let live = start.lanes();
        let outcome = estimate(fitter.isa, d, w, live, start, &options);
        let unit = d.cost_unit() * d.cost_unit();
        std::array::from_fn(|lane| match live[lane] {
            true => End { status: outcome.status[lane], cost: w.cost(lane) * unit }.cost(),
            false => f64::INFINITY,
        })
    }
}
