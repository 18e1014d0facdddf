//! The states so far, for equations that look back: a polynomial a step.

use super::Problem;

/// Coefficients of a step's polynomial beside the value at its beginning.
pub const TERMS: usize = 7;

/// Steps that are kept at least before those further back than all delays are dropped.
const KEPT: usize = 4096;

/// Steps that were made, and the states that are looked at as polynomials in them.
#[derive(Debug, Default)]
pub struct History {
    /// Beginnings and lengths of the steps.
    steps: Vec<(f64, f64)>,
    /// (step, start, past): x, and f₀ … f₆ of x + s(f₀ + (1 − s)(f₁ + s(f₂ + (1 − s)(f₃ + …)))), s from 0 to 1.
    parts: Vec<(f64, [f64; TERMS])>,
    /// States that are looked at, (start, past), as places in (start, state).
    places: Vec<usize>,
    longest: f64,
}

impl History {
    pub fn new(problem: &Problem<'_>) -> History {
        let states = problem.starts.len() / problem.count.max(1);
        let of = |one: usize| problem.pasts.iter().map(move |past| one * states + past.state);
        let delays = problem.pasts.iter().map(|past| past.delay);
        History {
            places: (0..problem.count).flat_map(of).collect(),
            longest: delays.fold(0.0, f64::max),
            ..History::default()
        }
    }

    /// Whether nobody looks back.
    pub fn idle(&self) -> bool {
        self.places.is_empty()
    }

    /// Adds a step by the state at its beginning and the coefficients of a place in (start, state).
    pub fn push(
        &mut self,
        t: f64,
        h: f64,
        x: &[f64],
        mut terms: impl FnMut(usize) -> [f64; TERMS],
    ) {
        if self.steps.len() >= KEPT {
            let half = self.steps.len() / 2;
            if self.steps[half].0 < t - self.longest {
                self.steps.drain(..half);
                self.parts.drain(..half * self.places.len());
            }
        }
        self.steps.push((t, h));
        for &place in &self.places {
            self.parts.push((x[place], terms(place)));
        }
    }

    /// A state that is looked at, by its place in (start, past), at a time; None before the first step.
    pub fn at(&self, t: f64, which: usize) -> Option<f64> {
        let step = self.steps.partition_point(|(begins, _)| *begins <= t).checked_sub(1)?;
        let (begins, length) = self.steps[step];
        let s = (t - begins) / length;
        let (x, terms) = &self.parts[step * self.places.len() + which];
        let mut value = 0.0;
        for (k, term) in terms.iter().enumerate().rev() {
            value = (value + term) * if k % 2 == 0 { s } else { 1.0 - s };
        }
        Some(x + value)
    }
}
