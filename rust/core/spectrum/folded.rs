//! Σ_k w_k v_k e^{−2πimk/N} for a few harmonics m: samples folded twice, then short sums in registers.
//!
//! cos and sin repeat themselves under k ↔ N−k, and for even N under k ↔ N/2−k up to a sign that depends
//! on the parity of m. So N+1 samples fold into N/4+1 entries for each parity, which are summed against
//! tables: of eight records in lanes (`eight`), or of one record with eight harmonics in lanes (`one`).
//! Both add in the same order, so a record has the same bits either way. Long records go through in
//! blocks that share one table, each block being turned by its own root of unity.

mod eight;
mod one;

use std::sync::OnceLock;

use super::source::{Records, Source};
use super::tables::{BLOCK, Group, groups};
use crate::quadrature::Weights;
use eight::Pass;

/// The sums of one window length, rule and number of harmonics.
#[derive(Debug, Clone)]
pub(super) struct FoldedSums {
    intervals: usize,
    /// 1/N.
    scale: f64,
    harmonics: usize,
    weights: Weights,
    /// Samples at each end whose weights are not the inner ones.
    edge: usize,
    /// Folded entries.
    length: usize,
    /// How one record is summed.
    groups: Vec<Group>,
    /// How eight records are summed: made when it is first asked for, a single fit never does.
    passes: OnceLock<Vec<Pass>>,
}

impl FoldedSums {
    pub(super) fn new(weights: Weights, harmonics: usize) -> FoldedSums {
        let intervals = weights.intervals();
        let twice = intervals.is_multiple_of(2);
        let length = if twice { intervals / 4 + 1 } else { intervals / 2 + 1 };
        let groups = groups(intervals, harmonics, length);
        FoldedSums {
            intervals,
            scale: 1.0 / intervals as f64,
            harmonics,
            edge: weights.edge(),
            weights,
            length,
            passes: OnceLock::new(),
            groups,
        }
    }

    /// Starts and lengths of the blocks.
    #[inline(always)]
    fn blocks(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.length).step_by(BLOCK).map(|start| (start, BLOCK.min(self.length - start)))
    }

    /// Folds the entries from `start` on: sums v_k + v_{N−k} for even, odd m, differences for even, odd m.
    #[inline(always)]
    fn fold<R: Records, S: Source<R>>(
        &self,
        source: S,
        start: usize,
        entries: &mut [[R::Stored; 4]],
    ) {
        let (n, half, end) = (self.intervals, self.intervals / 2, start + entries.len());
        let twice = n.is_multiple_of(2);
        // Entries whose samples all have inner weights and mirror images of their own.
        let last = if twice {
            (half + 1).saturating_sub(self.edge).min(half.div_ceil(2))
        } else {
            self.length
        };
        let low = self.edge.max(1).clamp(start, end);
        let high = match source.samples() {
            Some(_) => last.clamp(low, end),
            None => low,
        };
        for k in (start..low).chain(high..end) {
            store_all::<R>(self.entry::<R, S>(source, k), &mut entries[k - start]);
        }
        let Some(all) = source.samples() else { return };
        // What takes the time: plain slices, no index to check.
        let entries = &mut entries[low - start..high - start];
        let outer = all[low..high].iter().zip(all[n + 1 - high..n + 1 - low].iter().rev());
        if !twice {
            for ((a, b), to) in outer.zip(entries) {
                let (a, b) = (R::load(a), R::load(b));
                R::store(a + b, &mut to[0]);
                R::store(a - b, &mut to[2]);
            }
            return;
        }
        let inner = all[half + 1 - high..half + 1 - low].iter().rev();
        let four = outer.zip(inner.zip(&all[half + low..half + high])).zip(entries);
        let weights = self.weights.inner();
        if weights == [1.0; 2] {
            for (((a, b), (c, d)), to) in four {
                store_all::<R>(fold_four::<R>(R::load(a), R::load(b), R::load(c), R::load(d)), to);
            }
            return;
        }
        for (k, (((a, b), (c, d)), to)) in (low..).zip(four) {
            let (outer, inner) = (weights[k % 2], weights[(half + k) % 2]);
            let (a, b) = (R::scaled(R::load(a), outer), R::scaled(R::load(b), outer));
            let (c, d) = (R::scaled(R::load(c), inner), R::scaled(R::load(d), inner));
            store_all::<R>(fold_four::<R>(a, b, c, d), to);
        }
    }

    /// Sample times its weight.
    #[inline(always)]
    fn weighted<R: Records, S: Source<R>>(&self, source: S, k: usize) -> R::Value {
        R::scaled(source.get(k), self.weights.at(k))
    }

    /// One folded entry wherever it lies.
    #[inline(always)]
    fn entry<R: Records, S: Source<R>>(&self, source: S, k: usize) -> [R::Value; 4] {
        let (n, half) = (self.intervals, self.intervals / 2);
        let (a, b) = (self.weighted::<R, S>(source, k), self.weighted::<R, S>(source, n - k));
        let zero = R::zero();
        let (p, d) = (a + b, if k == 0 { zero } else { a - b });
        if n % 2 == 1 {
            [p, zero, d, zero]
        } else if 2 * k == half {
            // Its own mirror image: cos vanishes for odd m, sin for even m.
            [p, zero, zero, d]
        } else if k == 0 {
            let middle = self.weighted::<R, S>(source, half);
            [p + middle, p - middle, zero, zero]
        } else {
            let (c, d) =
                (self.weighted::<R, S>(source, half - k), self.weighted::<R, S>(source, half + k));
            fold_four::<R>(a, b, c, d)
        }
    }
}

/// Writes one entry.
#[inline(always)]
fn store_all<R: Records>(from: [R::Value; 4], to: &mut [R::Stored; 4]) {
    for (from, to) in from.into_iter().zip(to) {
        R::store(from, to);
    }
}

/// Samples k, N−k, N/2−k, N/2+k: sums for even, odd m, differences for even, odd m.
#[inline(always)]
fn fold_four<R: Records>(a: R::Value, b: R::Value, c: R::Value, d: R::Value) -> [R::Value; 4] {
    let (p, q) = (a + b, c + d);
    let (e, f) = (a - b, c - d);
    [p + q, p - q, e - f, e + f]
}
