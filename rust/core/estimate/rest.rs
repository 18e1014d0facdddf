//! Records that begin in a known state: their transient as a function of the parameters.
//!
//! The lines see the states at both ends through the transient T alone, and free coefficients of T leave both unknown.
//! Where the record begins at rest, z = A(p)⁻¹u runs from nothing. With δ_i = (z⁽ⁱ⁾(end) − z⁽ⁱ⁾(start))/T of the
//! window, y = B(p)z and u = A(p)z, integration by parts gives AY − BU = T(s), Bezout's form of A and B in δ:
//!
//! ```text
//! T(s) = Σ_d s^d Σ_{k,l} e α_k β_l δ_{k+l−1−d},     e = 1 where k ≤ d < l, −1 where l ≤ d < k.
//! ```
//!
//! It is linear in B. Its slopes by α_j follow from v = A(p)⁻²u, of which z = A(p)v is made: ∂z/∂α_j = −p^j v. The
//! response from sample to sample is exact for held inputs; smooth ones go through polynomials of six samples. A given
//! state adds the response to an impulse through Σ_l s^l Σ_{k>l} α_k y⁽ᵏ⁻¹⁻ˡ⁾(0), which begins with y, y', … as given.

mod drive;
mod tie;

pub(crate) use drive::Drives;
pub(crate) use tie::Tie;

use crate::quadrature::Hold;
use crate::simd::LANES;
use drive::Drive;

/// Most rounds of the transient and of the estimate that follows, and the relative change of θ that ends them.
pub(crate) const ROUNDS: usize = 20;
pub(crate) const SETTLED: f64 = 1e-4;

/// What is known of the state at a record's first sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Initial {
    /// Nothing.
    Unknown,
    /// Nothing moved, and the inputs act from the first sample on; late ones were before as they begin.
    Zero,
    /// All was steady under the inputs' first values.
    Rest,
    /// That at the record's end: whole periods of a steady response.
    Periodic,
}

/// One record as its states run through it.
#[derive(Debug, Clone)]
pub(crate) struct Course {
    /// In units of the band edge, and in seconds.
    pub step: f64,
    pub seconds: f64,
    /// Steps before the window, and in it.
    pub lead: usize,
    pub intervals: usize,
}

/// A problem whose records begin in a known state.
#[derive(Debug, Clone)]
pub(crate) struct KnownStart {
    pub courses: Vec<Course>,
    /// How each input of each record runs between samples, and how many seconds it is late.
    pub inputs: Vec<Vec<(Option<Hold>, f64)>>,
    pub initial: Initial,
    /// y, y', … of the free response of each record, if they are given.
    pub states: Vec<Vec<f64>>,
}

/// Whether parameters have moved by more than this part of them, from what they were and what they are.
pub(crate) fn moved(settled: f64, theta: impl Iterator<Item = (f64, f64)>) -> bool {
    let (mut change, mut size) = (0.0, 0.0);
    for (before, now) in theta {
        change += (now - before) * (now - before);
        size += now * now;
    }
    change > settled * settled * size
}

impl KnownStart {
    /// Whether the transient is nothing, whatever θ.
    pub fn periodic(&self) -> bool {
        self.initial == Initial::Periodic
    }

    /// What the inputs of record `k` and the state do: eight lanes, a function of (lane) each.
    pub fn drives<'a>(
        &self,
        k: usize,
        units: &[f64],
        samples: impl Fn(usize, usize) -> &'a [f64],
    ) -> Drives {
        let course = &self.courses[k];
        let one = |(input, (hold, late)): (usize, &(Option<Hold>, f64))| {
            let lanes: [&[f64]; LANES] = std::array::from_fn(|lane| samples(lane, input));
            let unit = units.get(1 + input).copied().unwrap_or(1.0);
            let late = late / course.seconds;
            Drive::new(*hold, late, self.initial, course.lead + course.intervals, unit, lanes)
        };
        let unit = units.first().copied().unwrap_or(1.0);
        let state = self.states.get(k).into_iter().flatten().map(|x| x / unit);
        Drives {
            inputs: self.inputs[k].iter().enumerate().map(one).collect(),
            state: state.collect(),
        }
    }
}
