//! Eight records at once, one a lane: the estimates of [`TermsFitter::finish`] for each, to the bit.
//!
//! Samples become lines record by record. The rows, of which an estimate takes many, advance together; a record that
//! has ended waits for the others as it stands.

use super::descent::{Descent, Ended, Need};
use super::fitter::{TermsFit, lower, usable};
use super::iterate::TermsProblem;
use super::plan::{TermsFitter, TermsRecord};
use super::rows::{Eight, Worker};
use super::sigma::Sigma;
use crate::error::Error;
use crate::estimate::band::Choice;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::simd::LANES;

/// Fewer records are faster one by one.
pub(super) const FEWEST: usize = 3;
/// Lines above which the rows of eight records leave the near caches.
const MOST_LINES: usize = 64;

/// What one worker keeps from eight records to the next.
#[derive(Default)]
pub(super) struct Eights {
    workers: [Worker; LANES],
    eight: Eight,
}

impl Eights {
    /// Memory for one record.
    pub fn one(&mut self) -> &mut Worker {
        &mut self.workers[0]
    }
}

/// Records of one block, with the memory of their rows.
struct Block<'a> {
    fitter: &'a TermsFitter,
    problems: Vec<TermsProblem<'a>>,
    eight: &'a mut Eight,
    factors: LeftColumns,
}

impl TermsFitter {
    /// Whether eight records go together: those whose signals depend on their samples alone, weighed by noise that
    /// is known.
    pub(super) fn goes_in_eights(&self, chosen: &Choice) -> bool {
        self.weights().0 == RowWeights::Adapted
            && self.driven().is_none()
            && !self.o.equations.moves()
            && !self.learns()
            && chosen.ranges.iter().all(|(first, last)| last - first < MOST_LINES)
    }

    /// Estimates of up to eight records on the lines chosen.
    pub(super) fn finish_eight(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: Vec<Vec<Sigma>>,
        chosen: &Choice,
        memory: &mut Eights,
    ) -> Result<Vec<TermsFit>, Error> {
        let mut guesses = Vec::with_capacity(records.len());
        let mut problems = Vec::with_capacity(records.len());
        let each = records.chunks(1).zip(sigmas).zip(&mut memory.workers);
        for ((record, sigmas), worker) in each {
            guesses.push(match &chosen.theta {
                Some(_) => None,
                None => self.narrow_guess(record, &sigmas, &chosen.ranges)?,
            });
            problems.push(self.problem(record, sigmas, &chosen.ranges, std::mem::take(worker))?);
        }
        let factors = self.weights().1;
        let mut block = Block { fitter: self, problems, eight: &mut memory.eight, factors };
        let fits = block.fits(chosen, guesses);
        for (problem, worker) in block.problems.into_iter().zip(&mut memory.workers) {
            *worker = problem.into_worker();
        }
        fits
    }
}

impl Block<'_> {
    fn fits(
        &mut self,
        chosen: &Choice,
        guesses: Vec<Option<Vec<f64>>>,
    ) -> Result<Vec<TermsFit>, Error> {
        let tol = self.fitter.first_tolerance();
        let mut starts = Vec::with_capacity(self.problems.len());
        for problem in &mut self.problems {
            starts.push(Some(match &chosen.theta {
                Some(theta) => theta.clone(),
                None => problem.begin(None)?,
            }));
        }
        let first = self.descend(starts, tol)?;
        let second = self.descend(guesses, tol)?;
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
                self.fitter.told(problem, ended, self.eight.cost.0[lane], chosen.rule)
            })
            .collect())
    }

    /// The estimates once more, with slopes at channels that the first ones' noise was taken from.
    fn refined(&mut self, first: &[Ended]) -> Result<Vec<Option<Ended>>, Error> {
        self.stand(first)?;
        let mut starts = Vec::with_capacity(first.len());
        for (lane, (problem, ended)) in self.problems.iter_mut().zip(first).enumerate() {
            starts.push(usable(ended).then(|| {
                self.eight.give_sources(lane, &mut problem.spots[0]);
                problem.clear_noise(&ended.theta);
                ended.theta.clone()
            }));
        }
        self.descend(starts, self.fitter.o.options.tol)
    }

    /// Brings rows and columns to the estimates.
    fn stand(&mut self, ended: &[Ended]) -> Result<(), Error> {
        let stands =
            |(problem, ended): (&TermsProblem<'_>, &Ended)| problem.stands_at(&ended.theta);
        if !self.problems.iter().zip(ended).all(stands) {
            for (lane, (problem, ended)) in self.problems.iter_mut().zip(ended).enumerate() {
                problem.set(&ended.theta)?;
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
        for (lane, (problem, way)) in self.problems.iter_mut().zip(&ways).enumerate() {
            if let Some((way, _)) = way {
                problem.set(way.point())?;
                if lane == 0 {
                    self.eight.resize(problem.shared());
                }
                self.eight.load(lane, &problem.spots[0]);
            }
        }
        let waits = |ways: &[Option<(Descent<'_>, Need)>], need| {
            ways.iter().flatten().any(|(_, own)| *own == need)
        };
        while waits(&ways, Need::Cost) {
            for (lane, (problem, way)) in self.problems.iter_mut().zip(&ways).enumerate() {
                if let Some((way, Need::Cost)) = way {
                    problem.set(way.point())?;
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
