//! Integration of first-order equations given as a tape, driven by pieces of polynomials, to the samples.

mod explicit;
mod history;
mod implicit;
mod system;
mod tableau;
#[cfg(test)]
mod tests;

use crate::Error;
use crate::tape::Tape;
use crate::threads::stopped;
use explicit::Explicit;
use implicit::Implicit;
use system::{Span, System};

/// Safety factor of the next step, and how far it may shrink.
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
/// So many steps, and so many an interval, may lie ahead of an explicit method whose stability limits them:
/// they cost less than to begin another method.
const AHEAD: (f64, f64) = (1e4, 10.0);
/// Steps between two looks at whether the work is to end.
const LOOK: usize = 64;

/// A state of the past among the inputs of the tape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// Number of the state.
    pub state: usize,
    /// How much earlier; at 0 it is the state itself.
    pub delay: f64,
}

/// What is integrated.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Slopes of the states, of (t, states, drives, states of the past, parameters).
    pub tape: &'a Tape,
    /// Instants of the samples.
    pub grid: &'a [f64],
    /// Coefficients (drive, interval, power) in descending powers of the time since the interval began.
    pub drives: &'a [f64],
    /// Coefficients of a piece.
    pub terms: usize,
    /// States of the past; before the first sample they were those of the start.
    pub pasts: &'a [Past],
    /// Initial states, (start, state).
    pub starts: &'a [f64],
    /// Parameters, (start, parameter).
    pub theta: &'a [f64],
    /// Number of starts, which are integrated on common steps.
    pub count: usize,
    /// Relative error of a step.
    pub relative: f64,
    /// Absolute error of a step, (state).
    pub absolute: &'a [f64],
    /// Most steps.
    pub most: usize,
}

/// How it ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// States (sample, start, state).
    Done(Vec<f64>),
    /// As many steps as allowed lead no further than to this time, where the largest state is so large.
    Stuck(f64, f64),
    /// The states leave all bounds at this time, or have no slope there.
    Left(f64),
}

/// What became of a step.
struct Tried {
    holds: bool,
    /// The next step in units of this one.
    factor: f64,
}

/// A method of one step.
trait Method {
    /// Stands at a state from which an interval begins: the drives may have jumped.
    fn begin(&mut self, system: &mut System<'_>, at: Span, x: &[f64]);
    /// Tries a step from x, into `new`.
    fn step(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &mut [f64]) -> Tried;
    /// The step holds: its end is where the next one begins.
    fn accept(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &[f64]);
    /// Whether stability and not accuracy seems to limit the steps.
    fn stiff(&self) -> bool;
}

/// Integrates from sample to sample; no step passes over one, so that drives may jump there.
///
/// It begins with an explicit method of order 8. Where stability limits its steps and very many lie ahead, an
/// implicit one of order 5 goes on.
///
/// # Errors
/// [`Error::Spec`] where sizes do not go together; [`Error::Cancelled`] where the work is to stop.
pub fn integrate(problem: &Problem<'_>) -> Result<Outcome, Error> {
    let mut system = System::new(problem)?;
    let grid = problem.grid;
    let size = problem.starts.len();
    let (mut x, mut new) = (problem.starts.to_vec(), problem.starts.to_vec());
    let mut out = Vec::with_capacity(size * grid.len());
    out.extend_from_slice(&x);
    let mut method: Box<dyn Method> = Box::new(Explicit::new(size));
    let longest = system.longest();
    let most_ahead = AHEAD.0 + AHEAD.1 * grid.len() as f64;
    let mut next = f64::INFINITY;
    let mut steps = 0_usize;
    for (interval, ends) in grid.windows(2).enumerate() {
        let (start, end) = (ends[0], ends[1]);
        let mut t = start;
        method.begin(&mut system, Span { interval, t, h: 0.0 }, &x);
        while t < end {
            if steps.is_multiple_of(LOOK) && stopped() {
                return Err(Error::Cancelled);
            }
            let left = end - t;
            let last = next.min(longest) >= left * (1.0 - 1e-9);
            let h = if last { left } else { next.min(longest) };
            let at = Span { interval, t, h };
            let tried = method.step(&mut system, at, &x, &mut new);
            steps += 1;
            if steps > problem.most {
                let largest = x.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                return Ok(Outcome::Stuck(t, largest));
            }
            let wished = h * tried.factor;
            if !tried.holds {
                next = wished;
                if next <= 16.0 * f64::EPSILON * t.abs().max(end - start) {
                    return Ok(Outcome::Left(t));
                }
                continue;
            }
            // A step cut short by a sample says nothing against a longer one.
            next = if last { next.max(wished) } else { wished };
            method.accept(&mut system, at, &x, &new);
            std::mem::swap(&mut x, &mut new);
            t = if last { end } else { t + h };
            if method.stiff() && (grid[grid.len() - 1] - t) / h > most_ahead {
                let mut other = Implicit::new(&system);
                other.begin(&mut system, Span { interval, t, h: 0.0 }, &x);
                method = Box::new(other);
            }
        }
        out.extend_from_slice(&x);
    }
    debug_assert_eq!(out.len(), size * grid.len().max(1));
    Ok(Outcome::Done(out))
}
