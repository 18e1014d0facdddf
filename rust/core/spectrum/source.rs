//! Where the samples of a window come from: one record or eight, as they are or between samples.

use std::marker::PhantomData;
use std::ops::{Add, Sub};

use crate::Error;
use crate::quadrature::Weights;
use crate::simd::{Lanes, Wide};

/// Samples through which a rule's signal is interpolated at a fractional delay.
pub(super) const TAPS: usize = 6;

/// How many records travel together: what one of their samples is in memory and in registers.
pub(super) trait Records: Copy {
    type Stored: Copy;
    type Value: Copy + Add<Output = Self::Value> + Sub<Output = Self::Value>;

    fn zero() -> Self::Value;
    fn load(from: &Self::Stored) -> Self::Value;
    fn store(value: Self::Value, to: &mut Self::Stored);
    fn scaled(value: Self::Value, by: f64) -> Self::Value;
    /// `by · value + sum` with one rounding.
    fn add_scaled(value: Self::Value, by: f64, sum: Self::Value) -> Self::Value;
}

/// One record.
#[derive(Clone, Copy)]
pub(super) struct One;

/// Eight records side by side.
#[derive(Clone, Copy)]
pub(super) struct Eight<L>(PhantomData<L>);

/// The samples of a window: number 0 is the window's first.
pub(super) trait Source<R: Records>: Copy {
    fn get(&self, k: usize) -> R::Value;
    /// All of them, where they lie in memory as they are.
    fn samples(&self) -> Option<&[R::Stored]>;
}

/// Local interpolation at t_k − d·dt through six samples (Lagrange), d a fraction of a sample.
#[derive(Debug, Clone)]
pub(super) struct Taps {
    /// Where the last stencil starts.
    last: usize,
    /// Coefficients by the place of the interval inside the stencil: 2 but near the ends.
    rows: Vec<[f64; TAPS]>,
}

/// The window that starts at the sample `first` of a record, interpolated.
#[derive(Clone, Copy)]
pub(super) struct Between<'a, R: Records> {
    pub record: &'a [R::Stored],
    pub first: usize,
    pub taps: &'a Taps,
}

impl Taps {
    pub(super) fn new(samples: usize, ahead: f64) -> Result<Taps, Error> {
        if samples < TAPS {
            return Err(too_few(samples));
        }
        let row = |place: usize| between(place, ahead);
        Ok(Taps { last: samples - TAPS, rows: (0..TAPS).map(row).collect() })
    }
}

/// What six samples weigh in the value so far behind the one at `place`, by Lagrange's formula.
pub(super) fn between(place: usize, ahead: f64) -> [f64; TAPS] {
    let x = place as f64 + ahead;
    std::array::from_fn(|i| {
        let others = (0..TAPS).filter(|&j| j != i);
        others.map(|j| (x - j as f64) / (i as f64 - j as f64)).product()
    })
}

pub(super) fn too_few(samples: usize) -> Error {
    Error::Data(format!(
        "a delay that is no whole number of samples is interpolated through {TAPS} samples, the record has {samples}; round the delay or declare the signal \"zoh\" or \"foh\""
    ))
}

impl Records for One {
    type Stored = f64;
    type Value = f64;
    #[inline(always)]
    fn zero() -> f64 {
        0.0
    }
    #[inline(always)]
    fn load(from: &f64) -> f64 {
        *from
    }
    #[inline(always)]
    fn store(value: f64, to: &mut f64) {
        *to = value;
    }
    #[inline(always)]
    fn scaled(value: f64, by: f64) -> f64 {
        value * by
    }
    #[inline(always)]
    fn add_scaled(value: f64, by: f64, sum: f64) -> f64 {
        value.mul_add(by, sum)
    }
}

impl<L: Lanes> Records for Eight<L> {
    type Stored = Wide;
    type Value = L;
    #[inline(always)]
    fn zero() -> L {
        L::splat(0.0)
    }
    #[inline(always)]
    fn load(from: &Wide) -> L {
        L::load(from)
    }
    #[inline(always)]
    fn store(value: L, to: &mut Wide) {
        value.store(to);
    }
    #[inline(always)]
    fn scaled(value: L, by: f64) -> L {
        value * L::splat(by)
    }
    #[inline(always)]
    fn add_scaled(value: L, by: f64, sum: L) -> L {
        value.mul_add(L::splat(by), sum)
    }
}

impl<R: Records> Source<R> for &[R::Stored] {
    #[inline(always)]
    fn get(&self, k: usize) -> R::Value {
        R::load(&self[k])
    }
    #[inline(always)]
    fn samples(&self) -> Option<&[R::Stored]> {
        Some(self)
    }
}

impl<R: Records> Source<R> for Between<'_, R> {
    #[inline(always)]
    fn get(&self, k: usize) -> R::Value {
        let k = self.first + k;
        let start = k.saturating_sub(TAPS / 2 - 1).min(self.taps.last);
        let row = &self.taps.rows[k - start];
        let stencil = &self.record[start..start + TAPS];
        let mut sum = R::scaled(R::load(&stencil[0]), row[0]);
        for (x, by) in stencil.iter().zip(row).skip(1) {
            sum = R::add_scaled(R::load(x), *by, sum);
        }
        sum
    }
    #[inline(always)]
    fn samples(&self) -> Option<&[R::Stored]> {
        None
    }
}

/// Weighted samples of a window of N intervals as N numbers of a period.
pub(super) fn weighted(weights: &Weights, window: impl Source<One>, out: &mut [f64]) {
    let (n, low) = (out.len(), weights.edge().min(out.len()));
    let high = (n - low).max(low);
    for k in (0..low).chain(high..n) {
        out[k] = window.get(k) * weights.at(k);
    }
    let (inner, each) = (weights.inner(), low..high);
    match window.samples() {
        Some(all) => {
            let both = out[each.clone()].iter_mut().zip(&all[each.clone()]);
            both.zip(each).for_each(|((to, x), k)| *to = x * inner[k % 2]);
        }
        None => each.for_each(|k| out[k] = window.get(k) * inner[k % 2]),
    }
    out[0] += window.get(n) * weights.at(n);
}
