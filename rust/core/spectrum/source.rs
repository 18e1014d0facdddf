//! Where the samples of a window come from: eight records, one record, or between samples of either.

use crate::Error;
use crate::simd::{Lanes, Wide};

/// Samples through which a rule's signal is interpolated at a fractional delay.
const TAPS: usize = 6;

/// Where the samples of a window come from: its number 0 is the window's first.
pub(super) trait Source: Copy {
    /// Sample `k` of all lanes.
    fn get<L: Lanes>(&self, k: usize) -> L;
    /// Samples `from`, … where they lie side by side in memory.
    fn run(&self, from: usize, count: usize) -> Option<&[Wide]>;
}

/// Local interpolation at t_k − d·dt through six samples (Lagrange), d a fraction of a sample.
#[derive(Debug, Clone)]
pub(super) struct Taps {
    /// Where the last stencil starts.
    last: usize,
    /// Coefficients by the place of the interval inside the stencil: 2 but near the ends.
    rows: Vec<[f64; TAPS]>,
}

impl Taps {
    pub(super) fn new(samples: usize, ahead: f64) -> Result<Taps, Error> {
        if samples < TAPS {
            return Err(Error::Data(format!(
                "a delay that is no whole number of samples is interpolated through {TAPS} samples, the record has {samples}; round the delay or declare the signal \"zoh\" or \"foh\""
            )));
        }
        let row = |place: usize| {
            let x = place as f64 + ahead;
            std::array::from_fn(|i| {
                let others = (0..TAPS).filter(|&j| j != i);
                others.map(|j| (x - j as f64) / (i as f64 - j as f64)).product()
            })
        };
        Ok(Taps { last: samples - TAPS, rows: (0..TAPS).map(row).collect() })
    }

    /// The value a fraction after sample `k` of the record.
    #[inline(always)]
    fn at<L: Lanes, S: Source>(&self, source: S, k: usize) -> L {
        let start = k.saturating_sub(TAPS / 2 - 1).min(self.last);
        let mut sum = L::splat(0.0);
        for (i, by) in self.rows[k - start].iter().enumerate() {
            sum = source.get::<L>(start + i).mul_add(L::splat(*by), sum);
        }
        sum
    }
}

/// Eight records side by side.
#[derive(Clone, Copy)]
pub(super) struct InLanes<'a>(pub(super) &'a [Wide]);

/// One record in all lanes.
#[derive(Clone, Copy)]
pub(super) struct InAll<'a>(pub(super) &'a [f64]);

/// The window inside a record, interpolated where the delay has a fraction.
#[derive(Clone, Copy)]
pub(super) struct Window<'a, S> {
    pub(super) record: S,
    pub(super) first: usize,
    pub(super) taps: Option<&'a Taps>,
}

impl Source for InLanes<'_> {
    #[inline(always)]
    fn get<L: Lanes>(&self, k: usize) -> L {
        L::load(&self.0[k])
    }
    #[inline(always)]
    fn run(&self, from: usize, count: usize) -> Option<&[Wide]> {
        self.0.get(from..from + count)
    }
}

impl Source for InAll<'_> {
    #[inline(always)]
    fn get<L: Lanes>(&self, k: usize) -> L {
        L::splat(self.0[k])
    }
    #[inline(always)]
    fn run(&self, _: usize, _: usize) -> Option<&[Wide]> {
        None
    }
}

impl<S: Source> Source for Window<'_, S> {
    #[inline(always)]
    fn get<L: Lanes>(&self, k: usize) -> L {
        match self.taps {
            None => self.record.get::<L>(self.first + k),
            Some(taps) => taps.at::<L, S>(self.record, self.first + k),
        }
    }
    #[inline(always)]
    fn run(&self, from: usize, count: usize) -> Option<&[Wide]> {
        if self.taps.is_some() { None } else { self.record.run(self.first + from, count) }
    }
}
