//! Runs replicates of a study: draw, transform once, estimate for every level and method, count.

use super::coloured::Coloured;
use super::draw::Noisy;
use super::histogram::{Histogram, Occupied};
use super::moments::Moments;
use super::plan::{GroupPlan, Plan, Task};
use super::workspace::TaskWorkspace;
use crate::error::{Error, Status};
use crate::estimate::Outcome;
use crate::estimate::batch::CHUNK;
use crate::math::student;
use crate::rng::{self, Purpose};
use crate::simd::{LANES, Wide};
use crate::spectrum::Scratch;
use crate::structure::CovType;
use crate::threads::{self, Control};
use std::sync::{Mutex, PoisonError};

/// Which replicates, and whether each of them is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// The key of all random streams.
    pub seed: u64,
    /// First replicate.
    pub first: u64,
    /// How many.
    pub replicates: usize,
    /// Whether every estimate is kept.
    pub samples: bool,
}

/// Sums over the replicates of one group, level and estimator; those of a parameter in its order.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// Moments of the errors of fits that gave finite estimates.
    pub moments: Vec<Moments>,
    /// Intervals that held the truth, of as many as there are errors.
    pub covered: Vec<u64>,
    /// Occupied bins of the errors.
    pub bins: Vec<Vec<Occupied>>,
    /// All fits by their status, in the order of [`Status::ALL`].
    pub status: [u64; Status::ALL.len()],
    /// Iterations of all replicates together.
    pub iterations: u64,
    /// Every estimate, replicate after replicate and NaN where there is none, if asked for.
    pub samples: Vec<f64>,
}

/// Histograms of a group, while its chunks are being worked on, and what remains of them.
#[derive(Default)]
struct Counted {
    chunks: usize,
    open: Vec<Histogram>,
    bins: Vec<Vec<Occupied>>,
}

impl Plan {
    /// Runs replicates; results by group, then level times estimator with estimators fastest.
    ///
    /// `quantiles` holds, for each group and estimator, the half width of an interval in standard errors: that of
    /// Student's t at the design's degrees of freedom, of the normal distribution where each estimate has its own.
    ///
    /// # Errors
    /// [`Error::Cancelled`] and [`Error::Internal`] from the threads.
    pub fn run(
        &self,
        run: &Run,
        quantiles: &[Vec<f64>],
        thread_count: usize,
        progress: &mut dyn FnMut(usize, usize) -> Control,
    ) -> Result<Vec<Vec<Cell>>, Error> {
        if run.first.checked_add(run.replicates as u64).is_none() {
            return Err(Error::Spec(format!(
                "running a study: {} replicates from {} on leave the numbers there are; begin earlier",
                run.replicates, run.first
            )));
        }
        let chunks = run.replicates.div_ceil(CHUNK);
        let counted: Vec<Mutex<Counted>> = self.groups.iter().map(|_| Mutex::default()).collect();
        let work = |w: &mut Option<GroupWorkspace>, index: usize| {
            // Group after group, so that a worker prepares for each about once and few groups are open.
            let (group, chunk) = (index / chunks, index % chunks);
            let g = &self.groups[group];
            let mut worker = match w.take() {
                Some(worker) if worker.group == group => worker,
                _ => GroupWorkspace::new(g, group),
            };
            let mut cells: Vec<Cell> = g.cells().map(Cell::new).collect();
            worker.errors.iter_mut().for_each(Vec::clear);
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(run.replicates);
            for first in range.clone().step_by(LANES) {
                if threads::stopped() {
                    break;
                }
                let count = (range.end - first).min(LANES);
                self.block(&mut worker, run, first as u64, count, &quantiles[group], &mut cells)?;
            }
            let mut errors = worker.errors.iter();
            for moments in cells.iter_mut().flat_map(|cell| &mut cell.moments) {
                *moments =
                    errors.next().map_or_else(Moments::default, |e| Moments::of(self.isa, e));
            }
            counted[group].lock().unwrap_or_else(PoisonError::into_inner).add(
                g,
                &worker.errors,
                chunks,
            );
            *w = Some(worker);
            Ok(cells)
        };
        let parts =
            threads::run(thread_count, chunks * self.groups.len(), progress, || None, work)?;
        let mut results: Vec<Vec<Cell>> = vec![Vec::new(); self.groups.len()];
        for (index, part) in parts.into_iter().enumerate() {
            let part: Vec<Cell> = part?;
            let all = &mut results[index / chunks];
            if all.is_empty() {
                *all = part;
            } else {
                all.iter_mut().zip(part).for_each(|(all, one)| all.append(one));
            }
        }
        for (cells, counted) in results.iter_mut().zip(counted) {
            let mut bins =
                counted.into_inner().unwrap_or_else(PoisonError::into_inner).bins.into_iter();
            for cell in cells {
                cell.bins = bins.by_ref().take(cell.moments.len()).collect();
            }
        }
        Ok(results)
    }

    /// Eight replicates through all levels and estimators of a group.
    fn block(
        &self,
        w: &mut GroupWorkspace,
        run: &Run,
        first: u64,
        count: usize,
        quantiles: &[f64],
        cells: &mut [Cell],
    ) -> Result<(), Error> {
        let g = &self.groups[w.group];
        let replicate = run.first + first;
        self.draw(g, w, run.seed, replicate)?;
        let live = std::array::from_fn(|lane| lane < count);
        for (level, sigma) in g.sigma.iter().enumerate() {
            for (k, task) in g.tasks.iter().enumerate() {
                let space = &mut w.workspaces[k];
                let lines = task.problem.lines();
                let source = &g.sources[task.source];
                let initial = &w.initial[..];
                for output in 0..space.outputs(task) {
                    let noise = &w.noise[task.source][output];
                    let sigma = *sigma * g.scale[output];
                    let to = space.signal_mut(output);
                    self.isa.run(Noisy { source, output, noise, initial, sigma, lines, to });
                }
                let outcome = space.estimate(self.isa, g, task, live)?;
                let first_error = level * g.parameters() + task.offset;
                let errors = &mut w.errors[first_error..first_error + task.truth.len()];
                let cell = &mut cells[level * g.tasks.len() + k];
                cell.add(task, space, &outcome, count, quantiles[k], errors);
                if run.samples {
                    cell.keep(task, space, &outcome.status[..count]);
                }
            }
        }
        Ok(())
    }

    /// Noise coefficients of every source, and normals of the initial states.
    fn draw(
        &self,
        g: &GroupPlan,
        w: &mut GroupWorkspace,
        seed: u64,
        replicate: u64,
    ) -> Result<(), Error> {
        let fill = |purpose, channel, out: &mut [Wide]| {
            rng::fill(self.isa, seed, purpose, channel, replicate, g.group, out);
        };
        if g.states > 0 {
            fill(Purpose::InitialState, 0, &mut w.initial);
        }
        for output in 0..g.scale.len() {
            fill(Purpose::NoiseY, output as u32, &mut w.samples);
            for (k, source) in g.sources.iter().enumerate() {
                let (re, im) = &mut w.noise[k][output];
                match &source.coloured {
                    None => {
                        source.plan.run_lanes(self.isa, &w.samples, re, im, &mut w.scratch[k])?
                    }
                    Some(coloured) => coloured.colour(self.isa, &w.samples, re, im),
                }
            }
        }
        Ok(())
    }
}

impl Counted {
    /// Counts a chunk's errors; after the last of `chunks` only occupied bins remain.
    fn add(&mut self, g: &GroupPlan, errors: &[Vec<f64>], chunks: usize) {
        if self.chunks == 0 {
            self.open = g.cells().flat_map(|t| &t.truth).map(|t| Histogram::new(*t)).collect();
        }
        for (histogram, errors) in self.open.iter_mut().zip(errors) {
            errors.iter().for_each(|e| histogram.push(*e));
        }
        self.chunks += 1;
        if self.chunks == chunks {
            self.bins = self.open.iter().map(Histogram::occupied).collect();
            self.open = Vec::new();
        }
    }
}

/// One thread's memory for one group.
struct GroupWorkspace {
    group: usize,
    /// A workspace an estimator, inputs loaded.
    workspaces: Vec<TaskWorkspace>,
    scratch: Vec<Scratch>,
    /// Normals: a sample each, or a coefficient each.
    samples: Vec<Wide>,
    initial: Vec<Wide>,
    /// Noise coefficients of each source and output.
    noise: Vec<Vec<(Vec<Wide>, Vec<Wide>)>>,
    /// Errors of this chunk, a parameter of a cell each.
    errors: Vec<Vec<f64>>,
}

impl GroupWorkspace {
    fn new(g: &GroupPlan, group: usize) -> GroupWorkspace {
        let wide = |n: usize| vec![Wide::ZERO; n];
        let workspaces = g.tasks.iter().map(|task| TaskWorkspace::new(g, task)).collect();
        GroupWorkspace {
            group,
            workspaces,
            scratch: g.sources.iter().map(|s| s.plan.scratch()).collect(),
            samples: wide({
                let drawn = g.sources.iter().flat_map(|s| &s.coloured).map(Coloured::normals);
                drawn.max().unwrap_or(g.samples)
            }),
            initial: wide(g.states),
            noise: g
                .sources
                .iter()
                .map(|s| {
                    let lines = s.plan.harmonics() + 1;
                    g.scale.iter().map(|_| (wide(lines), wide(lines))).collect()
                })
                .collect(),
            errors: (0..g.sigma.len() * g.parameters())
                .map(|_| Vec::with_capacity(CHUNK))
                .collect(),
        }
    }
}

impl Cell {
    /// Nothing counted yet.
    fn new(task: &Task) -> Cell {
        let p = task.truth.len();
        Cell { moments: vec![Moments::default(); p], covered: vec![0; p], ..Cell::default() }
    }

    /// Counts the first `count` lanes.
    fn add(
        &mut self,
        task: &Task,
        space: &TaskWorkspace,
        outcome: &Outcome,
        count: usize,
        quantile: f64,
        errors: &mut [Vec<f64>],
    ) {
        let mut found = [false; LANES];
        for (lane, found) in found.iter_mut().enumerate().take(count) {
            self.status[outcome.status[lane] as usize] += 1;
            self.iterations += u64::from(outcome.nit[lane]);
            *found = is_found(outcome.status[lane]);
        }
        for (k, truth) in task.truth.iter().enumerate() {
            let error = space.parameter(task, k).map(|value| value - truth);
            if found == [true; LANES] {
                errors[k].extend_from_slice(&error);
            } else {
                errors[k]
                    .extend(error.iter().zip(found).filter(|(_, found)| *found).map(|(e, _)| e));
            }
            if let Some(kind) = task.intervals {
                let variance = space.parameter_variance(task, k);
                let widths = match kind {
                    CovType::Spectral => space.degrees(k).map(|freedom| student(quantile, freedom)),
                    CovType::Nonrobust | CovType::Hc3 => [quantile; LANES],
                };
                let held = |lane: usize| {
                    let square = widths[lane] * widths[lane];
                    found[lane] & (error[lane] * error[lane] <= square * variance[lane])
                };
                self.covered[k] += (0..LANES).map(|lane| u64::from(held(lane))).sum::<u64>();
            }
        }
    }

    /// Keeps the estimates of the lanes with these statuses.
    fn keep(&mut self, task: &Task, space: &TaskWorkspace, statuses: &[Status]) {
        for (lane, status) in statuses.iter().enumerate() {
            for k in 0..task.truth.len() {
                let value = space.parameter(task, k)[lane];
                self.samples.push(if is_found(*status) { value } else { f64::NAN });
            }
        }
    }

    /// Adds a later chunk.
    fn append(&mut self, mut later: Cell) {
        self.moments.iter_mut().zip(&later.moments).for_each(|(all, one)| all.merge(one));
        self.covered.iter_mut().zip(&later.covered).for_each(|(all, one)| *all += one);
        self.status.iter_mut().zip(&later.status).for_each(|(all, one)| *all += one);
        self.iterations += later.iterations;
        self.samples.append(&mut later.samples);
    }
}

/// Whether there is an estimate to count.
fn is_found(status: Status) -> bool {
    matches!(status, Status::Ok | Status::MaxIter)
}
