//! Integration of first-order equations given as a tape, driven by pieces of polynomials, to the samples.

use crate::Error;
use crate::tape::Tape;
use crate::threads::stopped;

/// Safety factor of the next step, and how far it may shrink or grow.
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 10.0;
/// Exponent of the error in the next step: one over the order of the error's estimate and one.
const EXPONENT: f64 = -0.125;

/// An explicit Runge–Kutta method of order 8 with error estimates of orders 5 and 3 (Dormand and Prince).
#[derive(Debug, Clone, Copy)]
pub struct Tableau<'a> {
    /// Weights of earlier stages, (stage, stage).
    pub a: &'a [f64],
    /// Weights of the solution, (stage).
    pub b: &'a [f64],
    /// Instants of the stages in a step, (stage).
    pub c: &'a [f64],
    /// Weights of the error of order 5, (stage + 1): the last one of the slope at the end.
    pub fifth: &'a [f64],
    /// Weights of the error of order 3.
    pub third: &'a [f64],
}

/// What is integrated.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Slopes of the states, of (t, states, drives, parameters).
    pub tape: &'a Tape,
    /// Instants of the samples.
    pub grid: &'a [f64],
    /// Coefficients (drive, interval, power) in descending powers of the time since the interval began.
    pub drives: &'a [f64],
    /// Coefficients of a piece.
    pub terms: usize,
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
    /// More steps than allowed: the system is stiff.
    Stiff,
    /// The states leave all bounds at this time, or have no slope there.
    Left(f64),
}

/// Integrates from sample to sample; no step passes over one, so that drives may jump there.
///
/// # Errors
/// [`Error::Spec`] where sizes do not go together; [`Error::Cancelled`] where the work is to stop.
pub fn integrate(problem: &Problem<'_>, tableau: &Tableau<'_>) -> Result<Outcome, Error> {
    let mut run = Run::new(problem, tableau)?;
    let grid = problem.grid;
    let size = problem.starts.len();
    let mut out = Vec::with_capacity(size * grid.len());
    out.extend_from_slice(problem.starts);
    let mut next = f64::INFINITY;
    let mut steps = 0;
    for interval in 0..grid.len().saturating_sub(1) {
        if stopped() {
            return Err(Error::Cancelled);
        }
        let (start, end) = (grid[interval], grid[interval + 1]);
        let mut t = start;
        run.slope(interval, t, 0);
        while t < end {
            let left = end - t;
            let last = next >= left * (1.0 - 1e-9);
            let h = if last { left } else { next };
            let error = run.step(interval, t, h);
            steps += 1;
            if steps > problem.most {
                return Ok(Outcome::Stiff);
            }
            if error < 1.0 {
                let grown = match error > 0.0 {
                    true => (SAFETY * libm::pow(error, EXPONENT)).min(GROW),
                    false => GROW,
                };
                // A step cut short by a sample says nothing against a longer one.
                next = if last { next.max(h * grown) } else { h * grown };
                t = if last { end } else { t + h };
                run.accept();
            } else {
                // Also where the error is not a number.
                let factor = (SAFETY * libm::pow(error, EXPONENT)).max(SHRINK);
                next = h * factor;
                if next <= 16.0 * f64::EPSILON * t.abs().max(end - start) {
                    return Ok(Outcome::Left(t));
                }
            }
        }
        out.extend_from_slice(&run.x);
    }
    debug_assert_eq!(out.len(), size * grid.len().max(1));
    Ok(Outcome::Done(out))
}

/// States and slopes on the way.
struct Run<'a> {
    problem: &'a Problem<'a>,
    tableau: &'a Tableau<'a>,
    states: usize,
    parameters: usize,
    x: Vec<f64>,
    new: Vec<f64>,
    /// Slopes (stage, start, state); the last one at the end of the step.
    slopes: Vec<f64>,
    inputs: Vec<f64>,
    registers: Vec<f64>,
}

impl<'a> Run<'a> {
    fn new(problem: &'a Problem<'a>, tableau: &'a Tableau<'a>) -> Result<Self, Error> {
        let stages = tableau.c.len();
        let count = problem.count.max(1);
        let (states, parameters) = (problem.starts.len() / count, problem.theta.len() / count);
        let intervals = problem.grid.len().saturating_sub(1);
        let pieces = intervals.saturating_mul(problem.terms);
        let drives = problem.drives.len().checked_div(pieces).unwrap_or(0);
        let inputs = 1 + states + drives + parameters;
        let fits = (1..=problem.starts.len().max(1)).contains(&problem.count)
            && tableau.a.len() == stages * stages
            && tableau.b.len() == stages
            && tableau.fifth.len() == stages + 1
            && tableau.third.len() == stages + 1
            && problem.starts.len() == count * states
            && problem.theta.len() == count * parameters
            && problem.drives.len() == drives * pieces
            && problem.absolute.len() == states
            && problem.tape.results() == states
            && problem.tape.inputs() == inputs;
        if !fits {
            return Err(Error::Spec(format!(
                "integrating: {states} states, {drives} drives and {parameters} parameters do not go \
                 with formulas of {} results and {} inputs",
                problem.tape.results(),
                problem.tape.inputs()
            )));
        }
        Ok(Run {
            problem,
            tableau,
            states,
            parameters,
            x: problem.starts.to_vec(),
            new: problem.starts.to_vec(),
            slopes: vec![0.0; (stages + 1) * problem.starts.len()],
            inputs: vec![0.0; inputs],
            registers: Vec::new(),
        })
    }

    /// Slopes at `new`, into a stage.
    fn slope(&mut self, interval: usize, t: f64, stage: usize) {
        let Problem { tape, grid, drives, terms, theta, count, .. } = *self.problem;
        let (n, intervals, since) = (self.states, grid.len() - 1, t - grid[interval]);
        let first = 1 + n;
        let last = self.inputs.len() - self.parameters;
        self.inputs[0] = t;
        for (k, to) in self.inputs[first..last].iter_mut().enumerate() {
            let at = (k * intervals + interval) * terms;
            *to = drives[at..at + terms].iter().fold(0.0, |value, c| value * since + c);
        }
        let size = n * count;
        for one in 0..count {
            let own = one * n..(one + 1) * n;
            self.inputs[1..first].copy_from_slice(&self.new[own.clone()]);
            let mine = one * self.parameters..(one + 1) * self.parameters;
            self.inputs[last..].copy_from_slice(&theta[mine]);
            let out = &mut self.slopes[stage * size..][own];
            tape.values(&self.inputs, &mut self.registers, out);
        }
    }

    /// Tries a step, into `new`; its error in units of what is allowed.
    fn step(&mut self, interval: usize, t: f64, h: f64) -> f64 {
        let Tableau { a, b, c, fifth, third } = *self.tableau;
        let (stages, size) = (c.len(), self.x.len());
        for stage in 1..stages {
            self.combine(&a[stage * stages..stage * stages + stage], h);
            self.slope(interval, t + c[stage] * h, stage);
        }
        self.combine(b, h);
        self.slope(interval, t + h, stages);
        let (mut five, mut three) = (0.0, 0.0);
        for k in 0..size {
            let (x, new) = (self.x[k], self.new[k]);
            let allowed = self.problem.absolute[k % self.states]
                + self.problem.relative * x.abs().max(new.abs());
            let (mut e5, mut e3) = (0.0, 0.0);
            for stage in 0..=stages {
                let slope = self.slopes[stage * size + k];
                e5 += fifth[stage] * slope;
                e3 += third[stage] * slope;
            }
            five += (e5 / allowed) * (e5 / allowed);
            three += (e3 / allowed) * (e3 / allowed);
        }
        if five == 0.0 && three == 0.0 {
            return 0.0;
        }
        h.abs() * five / ((five + 0.01 * three) * size as f64).sqrt()
    }

    /// x + h Σ weight · slope, into `new`.
    fn combine(&mut self, weights: &[f64], h: f64) {
        let size = self.x.len();
        for k in 0..size {
            let mut sum = 0.0;
            for (stage, weight) in weights.iter().enumerate() {
                sum += weight * self.slopes[stage * size + k];
            }
            self.new[k] = self.x[k] + h * sum;
        }
    }

    /// The step holds: its end is where the next one begins.
    fn accept(&mut self) {
        let (stages, size) = (self.tableau.c.len(), self.x.len());
        self.x.copy_from_slice(&self.new);
        self.slopes.copy_within(stages * size.., 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The classical method of order 4; its "errors" are those of its first stage, of order 1.
    const A: [f64; 16] =
        [0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    const B: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
    const C: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
    const E: [f64; 5] = [-5e-6, 0.0, 0.0, 0.0, 5e-6];
    const CLASSICAL: Tableau<'static> = Tableau { a: &A, b: &B, c: &C, fifth: &E, third: &E };

    fn op(name: &str, value: f64, a: usize, b: usize) -> crate::tape::Written {
        (name.into(), value, a, b)
    }

    /// x' = θ x + u.
    fn decay() -> Tape {
        let ops = [
            op("input", 0.0, 1, 0),
            op("input", 0.0, 3, 0),
            op("multiply", 0.0, 0, 1),
            op("input", 0.0, 2, 0),
            op("add", 0.0, 2, 3),
        ];
        Tape::new(&ops, 4, vec![4]).expect("a tape")
    }

    #[test]
    fn a_decay_driven_by_steps_follows_its_closed_form_for_each_start() {
        let tape = decay();
        let grid = [0.0, 0.5, 1.0];
        let problem = Problem {
            tape: &tape,
            grid: &grid,
            drives: &[1.0, 0.0],
            terms: 1,
            starts: &[0.0, 2.0],
            theta: &[-1.0, -3.0],
            count: 2,
            relative: 1e-9,
            absolute: &[1e-12],
            most: 100_000,
        };
        let Outcome::Done(x) = integrate(&problem, &CLASSICAL).expect("it fits") else {
            panic!("it ends");
        };
        for (start, (theta, x0)) in [(-1.0_f64, 0.0), (-3.0, 2.0)].into_iter().enumerate() {
            let first = x0 * libm::exp(0.5 * theta) + (libm::exp(0.5 * theta) - 1.0) / theta;
            assert!((x[2 + start] - first).abs() < 1e-7, "{x:?}");
            assert!((x[4 + start] - first * libm::exp(0.5 * theta)).abs() < 1e-7, "{x:?}");
        }
    }

    #[test]
    fn an_escape_says_when_and_too_many_steps_say_stiff() {
        let ops = [op("input", 0.0, 1, 0), op("multiply", 0.0, 0, 0)];
        let tape = Tape::new(&ops, 2, vec![1]).expect("a tape");
        let grid = [0.0, 2.0];
        let mut problem = Problem {
            tape: &tape,
            grid: &grid,
            drives: &[],
            terms: 1,
            starts: &[1.0],
            theta: &[],
            count: 1,
            relative: 1e-6,
            absolute: &[1e-9],
            most: 100_000,
        };
        let Outcome::Left(t) = integrate(&problem, &CLASSICAL).expect("it fits") else {
            panic!("x' = x² leaves at t = 1");
        };
        assert!((t - 1.0).abs() < 1e-3, "{t}");
        problem.most = 3;
        assert_eq!(integrate(&problem, &CLASSICAL).expect("it fits"), Outcome::Stiff);
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        let tape = decay();
        let problem = Problem {
            tape: &tape,
            grid: &[0.0, 1.0],
            drives: &[],
            terms: 1,
            starts: &[1.0],
            theta: &[-1.0],
            count: 1,
            relative: 1e-9,
            absolute: &[1e-12],
            most: 10,
        };
        assert!(integrate(&problem, &CLASSICAL).is_err());
    }
}
