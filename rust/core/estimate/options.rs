//! When an iteration stops, where it starts, and what is computed at its end.

use crate::simd::LANES;

/// When an iteration stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Largest change of a parameter, as its effect on the equation relative to the largest term.
    pub tol: f64,
    /// Most iterations after the start.
    pub maxiter: usize,
    /// What is wanted besides θ.
    pub wanted: Wanted,
}

/// What is computed once θ is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wanted {
    /// Nothing more.
    Theta,
    /// The cost, and the transient that belongs to θ.
    Cost,
    /// Covariances as well.
    Covariance,
}

/// Where an iteration starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<'a> {
    /// From `wls`.
    Wls,
    /// From given parameters, in the user's units.
    Theta(&'a [f64]),
    /// Lane 0 from `wls`, one lane after the other from each of these; all lanes hold the same data.
    Each(&'a [Vec<f64>]),
    /// Each lane from the regression behind a filter of its own; all lanes hold the same data.
    Filtered,
}

impl Start<'_> {
    /// Lanes of a single fit that iterate: the first, and one a start behind it.
    pub(crate) fn lanes(&self) -> [bool; LANES] {
        let last = match self {
            Start::Each(starts) => starts.len(),
            Start::Filtered => LANES - 1,
            Start::Wls | Start::Theta(_) => 0,
        };
        std::array::from_fn(|lane| lane <= last)
    }
}
