//! Eight records at once, one a lane: the estimates of [`TermsFitter::finish`] for each, to the bit.
//!
//! They advance together from the samples to the estimates; a record that has ended waits for the others as it stands.

use super::descent::{Descent, Ended, Need, lower, usable};
use super::fitter::TermsFit;
use super::iterate::TermsProblem;
use super::lines::{EightWorkspace, TermsRecordPlan};
use super::plan::{TermsFitter, TermsRecord};
use super::rows::{Eight, TermsWorkspace};
use super::sigma::Sigma;
use crate::error::Error;
use crate::estimate::band::{Choice, Range};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::simd::LANES;

/// Fewer records are faster one by one.
pub(super) const FEWEST: usize = 3;
/// Lines above which the rows of eight records leave the near caches.
const MOST_LINES: usize = 64;

/// Values of formulas of one record above which those of eight do.
const MOST_NUMBERS: usize = 1 << 16;

/// What one worker keeps from eight records to the next.
#[derive(Default)]
pub(super) struct Eights {
    space: EightWorkspace,
    rows: Rows,
    /// Of few lines, where an estimate may begin.
    few: Rows,
}

/// Rows of each record, and of all.
#[derive(Default)]
struct Rows {
    workers: [TermsWorkspace; LANES],
    eight: Eight,
}

impl Eights {
    /// Memory for one record.
    pub fn one(&mut self) -> &mut TermsWorkspace {
        &mut self.rows.workers[0]
    }
}

/// Records of one block, with the memory of their rows.
struct Block<'a> {
    fitter: &'a TermsFitter,
    problems: Vec<TermsProblem<'a>>,
    space: &'a mut EightWorkspace,
    eight: &'a mut Eight,
    workers: &'a mut [TermsWorkspace; LANES],
    factors: LeftColumns,
}

impl TermsFitter {
    /// Whether eight records go together: those whose signals depend on their samples alone, evenly spaced, of noise
    /// that is the same for all samples and known beforehand.
    pub(super) fn goes_in_eights(&self, chosen: &Choice) -> bool {
        let alike = |own: &TermsRecordPlan| !own.dt.is_nan() && own.uneven.is_empty();
        let results = self.o.equations.samples.results();
        self.weights().0 == RowWeights::Adapted
            && self.records.iter().all(|own| alike(own) && own.samples * results <= MOST_NUMBERS)
            && self.driven().is_none()
            && !self.o.equations.moves()
            && !self.learns()
            && !self.o.coloured
            && chosen.ranges.iter().all(|(first, last)| last - first < MOST_LINES)
    }

    /// Estimates of up to eight records on the lines chosen.
    pub(super) fn finish_eight(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: &[Vec<Sigma>],
        chosen: &Choice,
        memory: &mut Eights,
    ) -> Result<Vec<TermsFit>, Error> {
        let Eights { space, rows, few } = memory;
        let guesses = match chosen.theta.is_none() && self.looks_on_few(&chosen.ranges) {
            true => self.guesses(records, sigmas, space, few)?,
            false => vec![None; records.len()],
        };
        let mut block = Block::new(self, (records, sigmas), &chosen.ranges, space, rows)?;
        let fits = block.fits(chosen, guesses);
        block.end();
        fits
    }

    /// Estimates on few lines, as one record has them from `narrow_guess`.
    fn guesses(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: &[Vec<Sigma>],
        space: &mut EightWorkspace,
        rows: &mut Rows,
    ) -> Result<Vec<Option<Vec<f64>>>, Error> {
        let Ok(mut block) = Block::new(self, (records, sigmas), &self.narrow, space, rows) else {
            return Ok(vec![None; records.len()]); // too few lines for the unknowns
        };
        let ended = block.first(None)?;
        block.end();
        Ok(ended.into_iter().map(|own| own.filter(usable).map(|own| own.theta)).collect())
    }
}

impl<'a> Block<'a> {
    fn new(
        fitter: &'a TermsFitter,
        (records, sigmas): (&'a [TermsRecord<'a>], &[Vec<Sigma>]),
        ranges: &[Range],
        space: &'a mut EightWorkspace,
        Rows { workers, eight }: &'a mut Rows,
    ) -> Result<Block<'a>, Error> {
        let mut problems = Vec::with_capacity(records.len());
        for ((record, own), worker) in records.chunks(1).zip(sigmas).zip(&mut *workers) {
            problems.push(fitter.problem(record, own.clone(), ranges, std::mem::take(worker))?);
        }
        Ok(Block { fitter, problems, space, eight, workers, factors: fitter.weights().1 })
    }

    /// Gives the memory of the rows back.
    fn end(self) {
        for (problem, worker) in self.problems.into_iter().zip(self.workers) {
            *worker = problem.into_worker();
        }
    }

    /// The first estimates, from θ or from where one may begin without.
    fn first(&mut self, theta: Option<&Vec<f64>>) -> Result<Vec<Option<Ended>>, Error> {
        self.load()?;
        let mut starts = Vec::with_capacity(self.problems.len());
        for problem in &mut self.problems {
            starts.push(Some(match theta {
                Some(theta) => theta.clone(),
                None => problem.begin(None)?,
            }));
        }
        self.descend(starts, self.fitter.first_tolerance())
    }

    fn fits(
        &mut self,
        chosen: &Choice,
        guesses: Vec<Option<Vec<f64>>>,
    ) -> Result<Vec<TermsFit>, Error> {
        let first = self.first(chosen.theta.as_ref())?;
        let second = self.descend(guesses, self.fitter.first_tolerance())?;
        let mut ended: Vec<Ended> = Vec::with_capacity(first.len());
        for both in first.into_iter().zip(second) {
            ended.extend(match both {
                (Some(first), Some(second)) => Some(lower(first, second)),
                (first, second) => first.or(second),
            });
        }
        if self.fitter.refines() {
            let refined = self.refined(&ended)?;
            for (own, second) in ended.iter_mut().zip(refined) {
                if let Some(second) = second {
                    *own = Ended { nit: own.nit + second.nit, ..second };
                }
            }
        }
        self.stand(&ended)?;
        let each = self.problems.iter_mut().zip(&ended).enumerate();
        Ok(each
            .map(|(lane, (problem, ended))| {
                problem.take_jacobian(self.eight, lane);
                self.eight.give_base(lane, &mut problem.spots[0]);
                let cost = self.eight.cost.0[lane];
                self.fitter.told(problem, ended, cost, chosen.rule)
            })
            .collect())
    }

    /// Makes the samples lines.
    fn load(&mut self) -> Result<(), Error> {
        let (f, problems) = (self.fitter, &mut self.problems);
        let records: Vec<&TermsRecord<'_>> = problems.iter().map(|p| &p.records[0]).collect();
        let sigmas: Vec<&Sigma> = problems.iter().map(|p| &p.sigmas[0]).collect();
        self.space.take(&records, &sigmas);
        let lines = (problems[0].spots[0].lines.first, problems[0].spots[0].lines.count());
        let (e, spectra) = (&f.o.equations, &mut self.eight.spectra);
        f.records[0].load_eight(f.isa, e, &f.pairs, lines, self.space, spectra)?;
        for (lane, problem) in problems.iter_mut().enumerate() {
            problem.take_signals(self.eight, lane);
        }
        self.eight.resize(self.problems[0].shared());
        Ok(())
    }

    /// The estimates once more, with slopes at channels that the first ones' noise was taken from.
    fn refined(&mut self, first: &[Ended]) -> Result<Vec<Option<Ended>>, Error> {
        self.stand(first)?;
        let (f, lines) = (self.fitter, self.problems[0].spots[0].lines);
        let (e, eight) = (&f.o.equations, &mut *self.eight);
        let range = (lines.first, lines.count());
        f.records[0].denoise_eight(f.isa, e, &f.pairs, &eight.sources, range, self.space);
        let before = match first.iter().all(usable) {
            true => Vec::new(),
            false => eight.spectra.pairs.clone(),
        };
        f.records[0].load_slopes_of_eight(f.isa, e, &f.pairs, self.space, &mut eight.spectra)?;
        let mut starts = Vec::with_capacity(first.len());
        for (lane, (problem, ended)) in self.problems.iter_mut().zip(first).enumerate() {
            if usable(ended) {
                problem.forget_cost();
                starts.push(Some(ended.theta.clone()));
                continue;
            }
            // What is no estimate stays as it was.
            for (to, from) in eight.spectra.pairs.iter_mut().zip(&before) {
                (to[0].0[lane], to[1].0[lane]) = (from[0].0[lane], from[1].0[lane]);
            }
            starts.push(None);
        }
        self.descend(starts, self.fitter.o.options.tol)
    }

    /// Brings rows and columns to the estimates.
    fn stand(&mut self, ended: &[Ended]) -> Result<(), Error> {
        let stands =
            |(problem, ended): (&TermsProblem<'_>, &Ended)| problem.stands_at(&ended.theta);
        if !self.problems.iter().zip(ended).all(stands) {
            for (lane, (problem, ended)) in self.problems.iter_mut().zip(ended).enumerate() {
                problem.set(&ended.theta, RowWeights::Flat)?; // the rows stand in the eight
                self.eight.set(lane, problem.values());
            }
            self.evaluate();
            for (lane, (problem, ended)) in self.problems.iter_mut().zip(ended).enumerate() {
                problem.stand(&ended.theta, RowWeights::Adapted, self.eight.cost.0[lane]);
            }
        }
        self.jacobian();
        Ok(())
    }

    fn evaluate(&mut self) {
        self.eight.evaluate(self.fitter.isa, self.problems[0].shared());
    }

    fn jacobian(&mut self) {
        self.eight.jacobian(self.fitter.isa, self.problems[0].shared(), self.factors);
    }

    /// Descends from each start there is; records without one keep still.
    fn descend(
        &mut self,
        starts: Vec<Option<Vec<f64>>>,
        tol: f64,
    ) -> Result<Vec<Option<Ended>>, Error> {
        let (e, maxiter) = (&self.fitter.o.equations, self.fitter.o.options.maxiter);
        let how = (RowWeights::Adapted, self.factors);
        let from = |start: Vec<f64>| (Descent::new(e, start, how, tol, maxiter), Need::Cost);
        let mut ways: Vec<_> = starts.into_iter().map(|start| start.map(from)).collect();
        let waits = |ways: &[Option<(Descent<'_>, Need)>], need| {
            ways.iter().flatten().any(|(_, own)| *own == need)
        };
        while waits(&ways, Need::Cost) {
            for (lane, (problem, way)) in self.problems.iter_mut().zip(&ways).enumerate() {
                if let Some((way, Need::Cost)) = way {
                    problem.set(way.point(), RowWeights::Flat)?;
                    self.eight.set(lane, problem.values());
                }
            }
            self.evaluate();
            for (lane, (problem, way)) in self.problems.iter_mut().zip(&mut ways).enumerate() {
                if let Some((way, need @ Need::Cost)) = way {
                    let cost = self.eight.cost.0[lane];
                    problem.stand(way.point(), RowWeights::Adapted, cost);
                    *need = way.reached(problem.with_priors(way.point(), cost));
                }
            }
            if !waits(&ways, Need::Step) {
                continue;
            }
            self.jacobian();
            for (lane, (problem, way)) in self.problems.iter_mut().zip(&mut ways).enumerate() {
                if let Some((way, need @ Need::Step)) = way {
                    problem.take_jacobian(self.eight, lane);
                    *need = way.stepped(problem.step(way.point()));
                }
            }
        }
        Ok(ways.into_iter().map(|way| way.map(|(way, _)| way.ended())).collect())
    }
}
