//! Dormand and Prince's explicit method of order 8 with error estimates of orders 5 and 3.

use super::system::{Span, System};
use super::tableau::{A, ALL, C, DENSE, FIFTH, STAGES, THIRD};
use super::{Method, SAFETY, SHRINK, Tried};

const GROW: f64 = 10.0;
/// Exponent of the error in the next step: one over the order of the error's estimate and one.
const EXPONENT: f64 = -0.125;
/// Step times fastest rate at which the method is no longer stable, and so many steps in turn that show it.
const EDGE: f64 = 6.1;
const SHOWN: usize = 15;
/// So many calm steps in turn show the opposite.
const CALM: usize = 6;

/// Slopes on the way.
#[derive(Debug)]
pub struct Explicit {
    /// Slopes (stage, start, state); that of stage 12 at the end of the step.
    slopes: Vec<f64>,
    stage: Vec<f64>,
    at_edge: usize,
    calm: usize,
}

impl Explicit {
    pub fn new(size: usize) -> Explicit {
        Explicit { slopes: vec![0.0; ALL * size], stage: vec![0.0; size], at_edge: 0, calm: 0 }
    }

    /// Slopes at a state, into a stage.
    fn slope(&mut self, system: &mut System<'_>, at: Span, stage: usize, x: &[f64]) {
        let out = &mut self.slopes[stage * x.len()..][..x.len()];
        system.slopes(at.interval, at.t + C[stage] * at.h, x, out);
    }

    /// Stage 11 ends where the step does, so that slopes differ there by what the states do.
    fn look(&mut self, h: f64, x: &[f64], new: &[f64]) {
        let size = x.len();
        let mut stage = std::mem::take(&mut self.stage);
        combine(&self.slopes, 11, h, x, &mut stage);
        let (mut slopes, mut states) = (0.0, 0.0);
        for k in 0..size {
            let slope = self.slopes[STAGES * size + k] - self.slopes[11 * size + k];
            let state = new[k] - stage[k];
            slopes += slope * slope;
            states += state * state;
        }
        self.stage = stage;
        if h * h * slopes > EDGE * EDGE * states {
            self.at_edge += 1;
            self.calm = 0;
        } else {
            self.calm += 1;
            self.at_edge = if self.calm >= CALM { 0 } else { self.at_edge };
        }
    }

    /// The polynomials of the step, by three more stages.
    fn remember(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &[f64]) {
        let size = x.len();
        let mut state = std::mem::take(&mut self.stage);
        for stage in STAGES + 1..ALL {
            combine(&self.slopes, stage, at.h, x, &mut state);
            self.slope(system, at, stage, &state);
        }
        self.stage = state;
        let slopes = &self.slopes;
        system.history.push(at.t, at.h, x, |k| {
            let way = new[k] - x[k];
            let (first, last) = (at.h * slopes[k], at.h * slopes[STAGES * size + k]);
            let mut terms = [way, first - way, 2.0 * way - (first + last), 0.0, 0.0, 0.0, 0.0];
            for (term, weights) in terms[3..].iter_mut().zip(&DENSE) {
                *term = at.h * sum(slopes, weights, size, k);
            }
            terms
        });
    }
}

impl Method for Explicit {
    fn begin(&mut self, system: &mut System<'_>, at: Span, x: &[f64]) {
        self.slope(system, at, 0, x);
    }

    fn step(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &mut [f64]) -> Tried {
        let size = x.len();
        for stage in 1..=STAGES {
            combine(&self.slopes, stage, at.h, x, new);
            self.slope(system, at, stage, new);
        }
        let (mut five, mut three) = (0.0, 0.0);
        for k in 0..size {
            let allowed = system.allowed(k, x[k], new[k]);
            let fifth = sum(&self.slopes, &FIFTH, size, k) / allowed;
            let third = sum(&self.slopes, &THIRD, size, k) / allowed;
            five += fifth * fifth;
            three += third * third;
        }
        let error = match five == 0.0 && three == 0.0 {
            true => 0.0,
            false => at.h * five / ((five + 0.01 * three) * size as f64).sqrt(),
        };
        if error == 0.0 {
            return Tried { holds: true, factor: GROW };
        }
        // An error that is no number shrinks the step.
        let wished = SAFETY * libm::pow(error, EXPONENT);
        let holds = error < 1.0;
        Tried { holds, factor: if holds { wished.min(GROW) } else { wished.max(SHRINK) } }
    }

    fn accept(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &[f64]) {
        self.look(at.h, x, new);
        if !system.history.idle() {
            self.remember(system, at, x, new);
        }
        self.slopes.copy_within(STAGES * x.len()..(STAGES + 1) * x.len(), 0);
    }

    fn stiff(&self) -> bool {
        self.at_edge >= SHOWN
    }
}

/// x + h Σ weight · slope of a stage, into `out`.
fn combine(slopes: &[f64], stage: usize, h: f64, x: &[f64], out: &mut [f64]) {
    for (k, (out, x_k)) in out.iter_mut().zip(x).enumerate() {
        *out = x_k + h * sum(slopes, A[stage], x.len(), k);
    }
}

/// Σ weight · slope of a state.
fn sum(slopes: &[f64], weights: &[f64], size: usize, k: usize) -> f64 {
    weights
        .iter()
        .enumerate()
        .fold(0.0, |sum, (stage, weight)| sum + weight * slopes[stage * size + k])
}
