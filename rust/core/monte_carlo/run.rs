//! Runs a study: draw, transform once, estimate for every level and method, count.

use super::plan::{Draw, Group, GroupPlan, Source, Task};
use super::summary::{Histogram, Moments, Outcomes, ParameterSummary};
use crate::error::{Error, Status};
use crate::estimate::batch::{CHUNK, load};
use crate::estimate::{Design, Options, Outcome, Start, Wanted, Workspace, estimate};
use crate::modulation::Lines;
use crate::rng::{self, Purpose};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::spectrum::Scratch;
use crate::threads::{self, Control};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Which intervals are counted as covering the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Intervals {
    /// None, and no covariance is computed.
    None,
    /// From classical standard errors.
    Nonrobust,
    /// From HC3 standard errors.
    Hc3,
}

/// Which replicates, and what is kept of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// The key of all random streams.
    pub seed: u64,
    /// First replicate.
    pub first: u64,
    /// How many.
    pub replicates: usize,
    /// What coverage counts.
    pub intervals: Intervals,
    /// Whether every estimate is kept.
    pub samples: bool,
}

/// Estimates of one cell, replicate after replicate.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Parameters.
    pub theta: Vec<f64>,
    /// Standard errors that the intervals use; empty without intervals.
    pub bse: Vec<f64>,
    /// Outcomes.
    pub status: Vec<Status>,
}

/// Results of one group, level and estimator.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// Errors and coverage of each parameter, over fits that gave finite estimates.
    pub parameters: Vec<ParameterSummary>,
    /// Median error of each parameter, to 0.4 % of itself.
    pub median: Vec<f64>,
    /// All fits by their status.
    pub outcomes: Outcomes,
    /// Iterations of all replicates together.
    pub iterations: u64,
    /// Every estimate, if asked for.
    pub samples: Samples,
}

/// A study laid out; it can be run for any range of replicates.
pub struct Plan {
    groups: Vec<GroupPlan>,
    draw: Draw,
    isa: Isa,
}

impl Plan {
    /// Evaluates what no replicate changes.
    ///
    /// # Errors
    /// As a fit of each group's noise-free record.
    pub fn new(groups: &[Group], draw: Draw, isa: Isa) -> Result<Plan, Error> {
        let groups =
            groups.iter().map(|g| GroupPlan::new(g, draw, isa)).collect::<Result<_, _>>()?;
        Ok(Plan { groups, draw, isa })
    }

    /// The design of each group's estimators: lines and degrees of freedom.
    #[must_use]
    pub fn designs(&self) -> Vec<Vec<&Design>> {
        self.groups.iter().map(|g| g.tasks.iter().map(|t| &t.shared.design).collect()).collect()
    }

    /// Tasks of a group's cells: levels times estimators, estimators fastest.
    fn cells(&self, group: usize) -> impl Iterator<Item = &Task> {
        let g = &self.groups[group];
        g.sigma.iter().flat_map(|_| &g.tasks)
    }

    /// Runs replicates; results by group, then level times estimator with estimators fastest.
    ///
    /// `quantiles` holds, for each group and estimator, the half width of an interval in standard
    /// errors (Student's t at the design's degrees of freedom).
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
        let chunks = run.replicates.div_ceil(CHUNK);
        let histograms: Vec<Mutex<Vec<Histogram>>> = (0..self.groups.len())
            .map(|g| {
                let truths = self.cells(g).flat_map(|t| &t.truth);
                Mutex::new(truths.map(|t| Histogram::new(*t)).collect())
            })
            .collect();
        let work = |w: &mut Option<Worker>, index: usize, stop: &AtomicBool| {
            // Group after group, so that a worker prepares for each about once.
            let (group, chunk) = (index / chunks, index % chunks);
            let mut worker = match w.take() {
                Some(worker) if worker.group == group => worker,
                _ => Worker::new(&self.groups[group], group),
            };
            let mut cells = vec![Cell::default(); self.cells(group).count()];
            worker.errors.iter_mut().for_each(Vec::clear);
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(run.replicates);
            for first in range.clone().step_by(LANES) {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                let count = (range.end - first).min(LANES);
                self.block(&mut worker, run, first as u64, count, &quantiles[group], &mut cells)?;
            }
            let mut counted = histograms[group].lock().unwrap_or_else(PoisonError::into_inner);
            let mut errors = worker.errors.iter().zip(counted.iter_mut());
            for (cell, task) in cells.iter_mut().zip(self.cells(group)) {
                cell.parameters.resize(task.truth.len(), ParameterSummary::default());
                for (parameter, (errors, histogram)) in cell.parameters.iter_mut().zip(&mut errors)
                {
                    parameter.moments = Moments::of(errors);
                    errors.iter().for_each(|e| histogram.push(*e));
                }
            }
            drop(counted);
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
        for (cells, histograms) in results.iter_mut().zip(&histograms) {
            let counted = histograms.lock().unwrap_or_else(PoisonError::into_inner);
            let mut medians = counted.iter().map(Histogram::median);
            for cell in cells {
                cell.median = medians.by_ref().take(cell.parameters.len()).collect();
            }
        }
        Ok(results)
    }

    /// Eight replicates through all levels and estimators of a group.
    fn block(
        &self,
        w: &mut Worker,
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
                let (d, space) = (&task.shared.design, &mut w.spaces[k]);
                let lines = d.records[0].lines;
                let source = &g.sources[task.source];
                let (noise, initial) = (&w.noise[task.source], &w.initial[..]);
                self.isa.run(Noisy { source, noise, initial, sigma: *sigma, lines, space });
                let options = Options {
                    wanted: match run.intervals {
                        Intervals::None => Wanted::Theta,
                        _ => Wanted::Covariance,
                    },
                    ..task.options.options
                };
                let outcome = estimate(self.isa, d, space, live, Start::Wls, &options);
                let index = level * g.tasks.len() + k;
                let first_error = level * g.parameters() + task.offset;
                let errors = &mut w.errors[first_error..first_error + task.truth.len()];
                cells[index].add(
                    run,
                    task,
                    space,
                    &outcome,
                    count,
                    quantiles[k],
                    errors,
                    &mut w.row,
                );
            }
        }
        Ok(())
    }

    /// Noise coefficients of every source, and normals of the initial states.
    fn draw(&self, g: &GroupPlan, w: &mut Worker, seed: u64, replicate: u64) -> Result<(), Error> {
        let fill = |purpose, out: &mut [Wide]| {
            rng::fill(self.isa, seed, purpose, 0, replicate, g.group, out);
        };
        if g.states > 0 {
            fill(Purpose::InitialState, &mut w.initial);
        }
        fill(Purpose::NoiseY, &mut w.samples);
        for (k, source) in g.sources.iter().enumerate() {
            let (re, im) = &mut w.noise[k];
            match self.draw {
                Draw::Samples => {
                    source.plan.run_lanes(self.isa, &w.samples, re, im, &mut w.scratch[k])?
                }
                Draw::Coefficients => colour(self.isa, source, &w.samples, re, im),
            }
        }
        Ok(())
    }
}

/// One thread's memory for one group.
struct Worker {
    group: usize,
    /// A workspace an estimator, inputs loaded.
    spaces: Vec<Workspace>,
    scratch: Vec<Scratch>,
    /// Normals: a sample each, or a coefficient each.
    samples: Vec<Wide>,
    initial: Vec<Wide>,
    /// Noise coefficients of each source.
    noise: Vec<(Vec<Wide>, Vec<Wide>)>,
    row: Vec<f64>,
    /// Errors of this chunk, a parameter of a cell each.
    errors: Vec<Vec<f64>>,
}

impl Worker {
    fn new(g: &GroupPlan, group: usize) -> Worker {
        let wide = |n: usize| vec![Wide::ZERO; n];
        let spaces = g
            .tasks
            .iter()
            .map(|t| {
                let d = &t.shared.design;
                let mut space = Workspace::new(d);
                for (k, (re, im)) in t.inputs.iter().enumerate() {
                    let splat =
                        |v: &Vec<f64>| v.iter().map(|x| Wide::splat(*x)).collect::<Vec<_>>();
                    load(&mut space, 1 + k, d.lines()[0], &splat(re), &splat(im));
                }
                space
            })
            .collect();
        let most = g.tasks.iter().map(|t| t.truth.len()).max().unwrap_or(0);
        Worker {
            group,
            spaces,
            scratch: g.sources.iter().map(|s| s.plan.scratch()).collect(),
            samples: wide(if g.sources.iter().all(|s| s.root.is_empty()) {
                g.samples
            } else {
                g.sources.iter().map(|s| 2 * s.plan.harmonics() + 1).max().unwrap_or(0)
            }),
            initial: wide(g.states),
            noise: g
                .sources
                .iter()
                .map(|s| (wide(s.plan.harmonics() + 1), wide(s.plan.harmonics() + 1)))
                .collect(),
            row: Vec::with_capacity(2 * most),
            errors: (0..g.sigma.len() * g.parameters())
                .map(|_| Vec::with_capacity(CHUNK))
                .collect(),
        }
    }
}

/// Y = Y₀ + Σ z F + σE on the used lines.
struct Noisy<'a> {
    source: &'a Source,
    noise: &'a (Vec<Wide>, Vec<Wide>),
    initial: &'a [Wide],
    sigma: f64,
    lines: Lines,
    space: &'a mut Workspace,
}

impl Kernel for Noisy<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Noisy { source, noise, initial, sigma, lines, space } = self;
        let (to_re, to_im) = space.signal_mut(0, 0);
        let used = lines.first..=lines.last;
        add_noise::<L>(to_re, &source.y.0[used.clone()], &noise.0[used.clone()], sigma);
        add_noise::<L>(to_im, &source.y.1[used.clone()], &noise.1[used.clone()], sigma);
        for (z, free) in initial.iter().zip(&source.free) {
            add_free::<L>(to_re, &free.0[used.clone()], z);
            add_free::<L>(to_im, &free.1[used.clone()], z);
        }
    }
}

#[inline(always)]
fn add_noise<L: Lanes>(to: &mut [Wide], clean: &[f64], noise: &[Wide], sigma: f64) {
    for ((to, clean), noise) in to.iter_mut().zip(clean).zip(noise) {
        L::splat(sigma).mul_add(L::load(noise), L::splat(*clean)).store(to);
    }
}

#[inline(always)]
fn add_free<L: Lanes>(to: &mut [Wide], free: &[f64], z: &Wide) {
    for (to, free) in to.iter_mut().zip(free) {
        L::splat(*free).mul_add(L::load(z), L::load(to)).store(to);
    }
}

/// Coefficients with the rule's own covariance from independent normals.
fn colour(isa: Isa, source: &Source, normals: &[Wide], re: &mut [Wide], im: &mut [Wide]) {
    struct Colour<'a>(&'a Source, &'a [Wide], &'a mut [Wide], &'a mut [Wide]);
    impl Kernel for Colour<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            let size = 2 * self.0.plan.harmonics() + 1;
            for i in 0..size {
                let mut sum = L::splat(0.0);
                for (root, z) in self.0.root[i * size..=i * size + i].iter().zip(self.1) {
                    sum = L::splat(*root).mul_add(L::load(z), sum);
                }
                let to = if i == 0 || i % 2 == 1 {
                    &mut self.2[i.div_ceil(2)]
                } else {
                    &mut self.3[i / 2]
                };
                sum.store(to);
            }
        }
    }
    isa.run(Colour(source, normals, re, im));
}

impl Cell {
    /// Counts the live lanes of a block.
    #[allow(clippy::too_many_arguments)]
    fn add(
        &mut self,
        run: &Run,
        task: &Task,
        space: &Workspace,
        outcome: &Outcome,
        count: usize,
        quantile: f64,
        errors: &mut [Vec<f64>],
        row: &mut Vec<f64>,
    ) {
        let (d, p) = (&task.shared.design, task.truth.len());
        self.parameters.resize(p, ParameterSummary::default());
        for lane in 0..count {
            let status = outcome.status[lane];
            self.outcomes.push(status);
            self.iterations += u64::from(outcome.nit[lane]);
            row.clear();
            row.extend(space.theta(d, lane));
            match run.intervals {
                Intervals::None => {}
                Intervals::Nonrobust => row.extend(space.bse_nonrobust(d, lane)),
                Intervals::Hc3 => row.extend(space.bse_hc3(d, lane)),
            }
            let (theta, bse) = row.split_at(p);
            if run.samples {
                self.samples.theta.extend_from_slice(theta);
                self.samples.bse.extend_from_slice(bse);
                self.samples.status.push(status);
            }
            if !matches!(status, Status::Ok | Status::MaxIter) {
                continue;
            }
            for (k, (value, truth)) in theta.iter().zip(&task.truth).enumerate() {
                let error = value - truth;
                errors[k].push(error);
                if let Some(bse) = bse.get(k) {
                    let coverage = match run.intervals {
                        Intervals::Nonrobust => &mut self.parameters[k].nonrobust,
                        _ => &mut self.parameters[k].hc3,
                    };
                    coverage.push(error.abs() <= quantile * bse);
                }
            }
        }
    }

    /// Adds a later chunk.
    fn append(&mut self, mut later: Cell) {
        self.parameters.iter_mut().zip(&later.parameters).for_each(|(all, one)| all.merge(one));
        self.outcomes.merge(&later.outcomes);
        self.iterations += later.iterations;
        self.samples.theta.append(&mut later.samples.theta);
        self.samples.bse.append(&mut later.samples.bse);
        self.samples.status.append(&mut later.samples.status);
    }
}
