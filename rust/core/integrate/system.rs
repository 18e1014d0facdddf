//! The right sides of the equations for all starts at once: drives, states of the past, the tape.

use super::history::History;
use super::{Past, Problem};
use crate::Error;

/// A step, or the instant where one begins.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// Interval of the grid whose pieces of the drives hold.
    pub interval: usize,
    /// Where the step begins.
    pub t: f64,
    /// How long it is.
    pub h: f64,
}

/// Slopes of the states, and the states so far where the equations look back.
#[derive(Debug)]
pub struct System<'a> {
    pub problem: &'a Problem<'a>,
    /// States of a start.
    pub states: usize,
    pub history: History,
    parameters: usize,
    drives: usize,
    inputs: Vec<f64>,
    registers: Vec<f64>,
}

impl<'a> System<'a> {
    /// # Errors
    /// [`Error::Spec`] where sizes do not go together.
    pub fn new(problem: &'a Problem<'a>) -> Result<Self, Error> {
        let count = problem.count.max(1);
        let (states, parameters) = (problem.starts.len() / count, problem.theta.len() / count);
        let intervals = problem.grid.len().saturating_sub(1);
        let pieces = intervals.saturating_mul(problem.terms);
        let drives = problem.drives.len().checked_div(pieces).unwrap_or(0);
        let inputs = 1 + states + drives + problem.pasts.len() + parameters;
        let fits = (1..=problem.starts.len().max(1)).contains(&problem.count)
            && problem.starts.len() == count * states
            && problem.theta.len() == count * parameters
            && problem.drives.len() == drives * pieces
            && problem.absolute.len() == states
            && problem.tape.results() == states
            && problem.tape.inputs() == inputs;
        if !fits {
            return Err(Error::Spec(format!(
                "integrating: {states} states, {drives} drives, {} states of the past and {parameters} \
                 parameters do not go with formulas of {} results and {} inputs",
                problem.pasts.len(),
                problem.tape.results(),
                problem.tape.inputs()
            )));
        }
        let wrong = |past: &&Past| past.state >= states || past.delay.is_nan() || past.delay < 0.0;
        if let Some(Past { state, delay }) = problem.pasts.iter().find(wrong) {
            return Err(Error::Spec(format!(
                "integrating: state {state} of {states} is wanted {delay} s earlier; a delay is at least 0"
            )));
        }
        Ok(System {
            problem,
            states,
            history: History::new(problem),
            parameters,
            drives,
            inputs: vec![0.0; inputs],
            registers: Vec::new(),
        })
    }

    /// The longest step: beyond the shortest delay it would need its own states.
    pub fn longest(&self) -> f64 {
        let delays = self.problem.pasts.iter().map(|past| past.delay);
        delays.filter(|delay| *delay > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// Slopes of states (start, state) at a time within an interval, its ends included.
    pub fn slopes(&mut self, interval: usize, t: f64, x: &[f64], out: &mut [f64]) {
        let Problem { tape, grid, drives, terms, theta, pasts, starts, .. } = *self.problem;
        let (n, intervals, since) = (self.states, grid.len() - 1, t - grid[interval]);
        let (first, parameters) = (1 + n, self.inputs.len() - self.parameters);
        let behind = first + self.drives;
        self.inputs[0] = t;
        for (k, to) in self.inputs[first..behind].iter_mut().enumerate() {
            let at = (k * intervals + interval) * terms;
            *to = drives[at..at + terms].iter().fold(0.0, |value, c| value * since + c);
        }
        for one in 0..self.problem.count {
            let own = one * n..(one + 1) * n;
            self.inputs[1..first].copy_from_slice(&x[own.clone()]);
            for (k, past) in pasts.iter().enumerate() {
                self.inputs[behind + k] = match past.delay == 0.0 {
                    true => x[one * n + past.state],
                    false => self
                        .history
                        .at(t - past.delay, one * pasts.len() + k)
                        .unwrap_or(starts[one * n + past.state]),
                };
            }
            let mine = one * self.parameters..(one + 1) * self.parameters;
            self.inputs[parameters..].copy_from_slice(&theta[mine]);
            tape.values(&self.inputs, &mut self.registers, &mut out[own]);
        }
    }

    /// What an error may be in a state at x that goes to `new`.
    pub fn allowed(&self, k: usize, x: f64, new: f64) -> f64 {
        self.problem.absolute[k % self.states] + self.problem.relative * x.abs().max(new.abs())
    }
}
