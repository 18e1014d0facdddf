//! The way down to the minimum, step by step: where a cost is wanted next, and when it ends.

use super::equations::Equations;
use crate::error::Status;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::threads::stopped;

/// Steps before the cost must fall: the first ones may raise it on their way to the right answer, but not where
/// coefficients bend with θ under the weights that count, as θ then runs away; lags that are sought do not.
const FREE_STEPS: u32 = 2;
/// Halvings of a step that does not lower the cost.
const HALVINGS: usize = 10;
/// A step that lowers the cost by no more than this part of it stalls.
const STALLED: f64 = 0.01;
/// A cost that rises by no more than this part of itself has not risen.
const LEVEL: f64 = 1e-9;

/// How an iteration ended.
#[derive(Debug, Clone)]
pub(crate) struct Ended {
    pub theta: Vec<f64>,
    pub cost: f64,
    pub status: Status,
    pub nit: u32,
    pub at_bound: Vec<bool>,
}

/// A step and what it was made of.
#[derive(Debug, Default)]
pub(crate) struct Step {
    pub by: Vec<f64>,
    /// Its effect on the rows, relative to the largest term.
    pub moved: f64,
    pub at_bound: Vec<bool>,
    /// Whether the columns were independent.
    pub full: bool,
    /// Parameters that are not at a bound, and their part of the step.
    pub free: Vec<usize>,
    pub found: Vec<f64>,
    pub residual: Vec<f64>,
}

/// The one of two estimates that has the lower cost.
pub(super) fn lower(first: Ended, second: Ended) -> Ended {
    match usable(&second) && !(usable(&first) && first.cost <= second.cost) {
        true => second,
        false => first,
    }
}

/// Whether an estimate is one.
pub(super) fn usable(e: &Ended) -> bool {
    matches!(e.status, Status::Ok | Status::MaxIter) && e.cost.is_finite()
}

/// What is asked for next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Need {
    /// The cost at [`Descent::point`].
    Cost,
    /// The step from there, where the cost was just taken.
    Step,
    /// It has ended.
    Nothing,
}

/// Gauss–Newton for `ml` and flat weights, reweighting for `awls`; who computes costs and steps is left open.
#[derive(Debug)]
pub(super) struct Descent<'a> {
    equations: &'a Equations,
    /// Whether the cost must fall: that of reweighted data need not.
    guarded: bool,
    /// Steps that may raise it.
    free_steps: u32,
    tol: f64,
    maxiter: usize,
    theta: Vec<f64>,
    cost: f64,
    /// The cost before the last step.
    before: f64,
    nit: u32,
    at_bound: Vec<bool>,
    status: Status,
    /// The step, its effect, the part of it that is tried, how often, and where that leads.
    by: Vec<f64>,
    moved: f64,
    size: f64,
    tried: usize,
    next: Vec<f64>,
    stage: Stage,
}

/// Where the cost is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Start,
    Trial,
    /// At the last estimate again, as no shorter step helps.
    Back,
}

impl<'a> Descent<'a> {
    /// From θ, its cost wanted first.
    pub fn new(
        equations: &'a Equations,
        mut theta: Vec<f64>,
        (weights, factors): (RowWeights, LeftColumns),
        tol: f64,
        maxiter: usize,
    ) -> Descent<'a> {
        equations.clip(&mut theta);
        let bends = !equations.linear
            && equations.free_lags().next().is_none()
            && weights == RowWeights::Adapted;
        Descent {
            equations,
            free_steps: if bends { 0 } else { FREE_STEPS },
            guarded: weights == RowWeights::Flat || factors == LeftColumns::Denoised,
            tol,
            maxiter,
            cost: f64::NAN,
            before: f64::INFINITY,
            nit: 0,
            at_bound: vec![false; theta.len()],
            status: Status::MaxIter,
            by: vec![0.0; theta.len()],
            moved: f64::NAN,
            size: 1.0,
            tried: 0,
            next: theta.clone(),
            theta,
            stage: Stage::Start,
        }
    }

    /// Where the cost is wanted.
    pub fn point(&self) -> &[f64] {
        if self.stage == Stage::Trial { &self.next } else { &self.theta }
    }

    /// Takes the cost at that point.
    pub fn reached(&mut self, cost: f64) -> Need {
        match self.stage {
            Stage::Start => {
                self.cost = cost;
                self.go_on()
            }
            Stage::Back => {
                self.cost = cost;
                let settled = self.moved < self.tol.sqrt();
                self.end(if settled { Status::Ok } else { Status::MaxIter })
            }
            Stage::Trial => {
                let fell = cost <= self.cost * (1.0 + LEVEL) + f64::MIN_POSITIVE;
                let must_fall = self.guarded && self.nit > self.free_steps;
                if !cost.is_finite() || (must_fall && !fell) {
                    self.size *= 0.5;
                    if self.tried < HALVINGS {
                        self.tried += 1;
                        return self.try_step();
                    }
                }
                if must_fall && !fell {
                    // Here is the minimum, as far as numbers can tell.
                    self.stage = Stage::Back;
                    return Need::Cost;
                }
                self.theta.clone_from(&self.next);
                (self.before, self.cost) = (self.cost, cost);
                if self.moved * self.size < self.tol {
                    return self.end(Status::Ok);
                }
                self.go_on()
            }
        }
    }

    /// Takes the step from the last estimate.
    pub fn stepped(&mut self, step: &Step) -> Need {
        self.at_bound.clone_from(&step.at_bound);
        if !step.full || !step.moved.is_finite() {
            // Where the cost was finite, only dependent columns make a step that is not.
            return self.end(Status::Rank);
        }
        self.nit += 1;
        self.by.clone_from(&step.by);
        (self.moved, self.size, self.tried) = (step.moved, 1.0, 0);
        self.try_step()
    }

    /// The cost where it stands, if the last step hardly lowered it.
    pub fn stalled(&self) -> Option<f64> {
        let stalls = self.nit > FREE_STEPS && self.cost > (1.0 - STALLED) * self.before;
        stalls.then_some(self.cost)
    }

    pub fn ended(self) -> Ended {
        let Descent { theta, cost, status, nit, at_bound, .. } = self;
        Ended { theta, cost, status, nit, at_bound }
    }

    fn try_step(&mut self) -> Need {
        for ((to, from), by) in self.next.iter_mut().zip(&self.theta).zip(&self.by) {
            *to = from + self.size * by;
        }
        self.equations.clip(&mut self.next);
        self.stage = Stage::Trial;
        Need::Cost
    }

    fn go_on(&mut self) -> Need {
        if self.nit as usize >= self.maxiter || stopped() {
            return self.end(Status::MaxIter);
        }
        if !self.cost.is_finite() {
            return self.end(Status::NonFinite);
        }
        Need::Step
    }

    fn end(&mut self, status: Status) -> Need {
        self.status = status;
        Need::Nothing
    }
}
