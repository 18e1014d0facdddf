//! Σ_k w_k v_k e^{−2πimk/N} for a few harmonics m: samples folded twice, then short sums in registers.
//!
//! cos and sin repeat themselves under k ↔ N−k, and for even N under k ↔ N/2−k up to a sign that depends
//! on the parity of m. So N+1 samples fold into N/4+1 entries for each parity, and the sums over these
//! run for up to five harmonics at once with all accumulators in registers. Long records go through in
//! blocks of [`BLOCK`] entries; from [`DIRECT`] entries on, one table serves all blocks, each block being
//! turned by its own root of unity, so that memory stays at `BLOCK` · 2(M+1) doubles and a root of
//! unity a block and harmonic.

use crate::math::root_of_unity;
use crate::simd::{Lanes, Wide};

use super::source::Source;

/// Entries folded and summed at a time: four of these arrays lie in the first-level cache.
pub(super) const BLOCK: usize = 128;
/// Folded entries up to which the table covers the whole record.
const DIRECT: usize = 2048;
/// Accumulators that, with the sample and the table entry, fill the 16 registers of AVX2.
const MOST: usize = 5;

/// The sums of one window length, set of weights and number of harmonics.
#[derive(Debug, Clone)]
pub(super) struct FoldedSums {
    intervals: usize,
    /// 1/N.
    scale: f64,
    harmonics: usize,
    weights: Vec<f64>,
    /// Samples at each end whose weights are not 1.
    edge: usize,
    /// Folded entries.
    length: usize,
    /// Block by block (cos, sin) of 2πmk₀/N; empty where the table covers all.
    turns: Vec<(f64, f64)>,
    table: Vec<f64>,
    passes: Vec<Pass>,
}

/// A sum over one folded array for `count` harmonics `first`, `first + step`, …
#[derive(Debug, Clone, Copy)]
struct Pass {
    /// 0, 1: sums v_k + v_{N−k} for even, odd m; 2, 3: differences.
    array: usize,
    sine: bool,
    first: usize,
    step: usize,
    count: usize,
    table: usize,
}

impl FoldedSums {
    /// `weights` are N+1 numbers in units of the sampling interval.
    pub(super) fn new(weights: Vec<f64>, harmonics: usize) -> FoldedSums {
        let intervals = weights.len() - 1;
        let even = intervals.is_multiple_of(2);
        let length = if even { intervals / 4 + 1 } else { intervals / 2 + 1 };
        let half = intervals / 2 + 1;
        let weighted = |k: &usize| weights[*k] != 1.0 || weights[intervals - *k] != 1.0;
        let edge = (0..half).rev().find(weighted).map_or(0, |k| k + 1);
        let rows = if length <= DIRECT { length } else { BLOCK };
        let turned = length > DIRECT;
        let mut sums = FoldedSums {
            intervals,
            scale: 1.0 / intervals as f64,
            harmonics,
            weights,
            edge,
            length,
            turns: Vec::new(),
            table: Vec::new(),
            passes: Vec::new(),
        };
        let step = if even { 2 } else { 1 };
        for parity in 0..step {
            for (array, sine) in
                [(parity, false), (parity + 2, true), (parity, true), (parity + 2, false)]
            {
                if turned || sine == (array >= 2) {
                    sums.add_passes(array, sine, parity, step, rows);
                }
            }
        }
        if turned {
            for start in (0..length).step_by(BLOCK) {
                for m in 0..=harmonics {
                    sums.turns.push(root_of_unity((m * start) as u64, intervals as u64));
                }
            }
        }
        sums
    }

    /// Splits the harmonics of one array evenly into passes and writes their tables.
    fn add_passes(&mut self, array: usize, sine: bool, parity: usize, step: usize, rows: usize) {
        // Harmonic 0 has no sine, and its cosine never meets the differences.
        let lowest = if parity == 0 && (sine || array >= 2) { step } else { parity };
        if lowest > self.harmonics {
            return;
        }
        let all = (self.harmonics - lowest) / step + 1;
        let groups = all.div_ceil(MOST);
        let mut done = 0;
        for group in 0..groups {
            let count = (all - done).div_ceil(groups - group);
            let (first, table) = (lowest + done * step, self.table.len());
            for k in 0..rows {
                for m in (first..).step_by(step).take(count) {
                    let (cos, sin) = root_of_unity((m * k) as u64, self.intervals as u64);
                    self.table.push(if sine { sin } else { cos });
                }
            }
            self.passes.push(Pass { array, sine, first, step, count, table });
            done += count;
        }
    }

    /// Registers of scratch that [`FoldedSums::run`] needs.
    pub(super) fn scratch(&self) -> usize {
        4 * BLOCK.min(self.length)
    }

    /// Writes (1/N) Σ_k w_k v_k e^{−2πimk/N}, m = 0…M.
    #[inline(always)]
    pub(super) fn run<L: Lanes, S: Source>(
        &self,
        source: S,
        re: &mut [Wide],
        im: &mut [Wide],
        scratch: &mut [Wide],
    ) {
        let (re, im) = (&mut re[..=self.harmonics], &mut im[..=self.harmonics]);
        L::splat(0.0).store(&mut im[0]);
        if self.length > BLOCK {
            for x in re.iter_mut().chain(&mut im[1..]) {
                L::splat(0.0).store(x);
            }
        }
        let entries = scratch.as_chunks_mut::<4>().0;
        for (block, start) in (0..self.length).step_by(BLOCK).enumerate() {
            let count = BLOCK.min(self.length - start);
            let entries = &mut entries[..count];
            self.fold::<L, S>(source, start, entries);
            for pass in &self.passes {
                let skip = if self.turns.is_empty() { start } else { 0 };
                let table = &self.table[pass.table + skip * pass.count..];
                match pass.count {
                    1 => self.sum::<L, 1>(pass, block, entries, table, re, im),
                    2 => self.sum::<L, 2>(pass, block, entries, table, re, im),
                    3 => self.sum::<L, 3>(pass, block, entries, table, re, im),
                    4 => self.sum::<L, 4>(pass, block, entries, table, re, im),
                    _ => self.sum::<L, MOST>(pass, block, entries, table, re, im),
                }
            }
        }
    }

    /// One pass over one block, added to the coefficients.
    #[inline(always)]
    fn sum<L: Lanes, const G: usize>(
        &self,
        pass: &Pass,
        block: usize,
        entries: &[[Wide; 4]],
        table: &[f64],
        re: &mut [Wide],
        im: &mut [Wide],
    ) {
        let mut sums = [L::splat(0.0); G];
        for (x, row) in entries.iter().zip(table.as_chunks::<G>().0) {
            let x = L::load(&x[pass.array & 3]);
            for g in 0..G {
                sums[g] = x.mul_add(L::splat(row[g]), sums[g]);
            }
        }
        let scale = self.scale;
        for (g, sum) in sums.into_iter().enumerate() {
            let m = pass.first + g * pass.step;
            if self.length <= BLOCK {
                // One block: each coefficient part has one pass.
                let (to, by) = if pass.sine { (&mut im[m], -scale) } else { (&mut re[m], scale) };
                (sum * L::splat(by)).store(to);
                continue;
            }
            let (cos, sin) = match self.turns.get(block * (self.harmonics + 1) + m) {
                Some(turn) => *turn,
                None => (1.0, 0.0),
            };
            // With θ the angle inside the block and φ its turn: cos(φ+θ) of the sums, −sin(φ+θ) of the differences.
            let (to, by) = match (pass.array >= 2, pass.sine) {
                (false, false) => (&mut re[m], cos),
                (false, true) => (&mut re[m], -sin),
                (true, false) => (&mut im[m], -sin),
                (true, true) => (&mut im[m], -cos),
            };
            sum.mul_add(L::splat(by * scale), L::load(to)).store(to);
        }
    }

    /// Folds the entries from `start` on.
    #[inline(always)]
    fn fold<L: Lanes, S: Source>(&self, source: S, start: usize, entries: &mut [[Wide; 4]]) {
        let (n, half, end) = (self.intervals, self.intervals / 2, start + entries.len());
        let twice = n.is_multiple_of(2);
        // Entries whose samples all have weight 1 and mirror images of their own.
        let last = if twice {
            (half + 1).saturating_sub(self.edge).min(half.div_ceil(2))
        } else {
            self.length
        };
        let low = self.edge.max(1).clamp(start, end);
        let high = last.clamp(low, end);
        for k in (start..low).chain(high..end) {
            store_all(self.entry::<L, S>(source, k), &mut entries[k - start]);
        }
        let some = high - low;
        let entries = &mut entries[low - start..high - start];
        let outer = (source.run(low, some), source.run(n + 1 - high, some));
        let inner =
            (source.run((half + 1).saturating_sub(high), some), source.run(half + low, some));
        match (outer, inner) {
            // What takes the time: plain slices, no index to check.
            ((Some(a), Some(b)), (Some(c), Some(d))) if twice => {
                let samples = a.iter().zip(b.iter().rev()).zip(c.iter().rev().zip(d));
                for (((a, b), (c, d)), to) in samples.zip(entries) {
                    store_all(fold_four(L::load(a), L::load(b), L::load(c), L::load(d)), to);
                }
            }
            ((Some(a), Some(b)), _) if !twice => {
                for ((a, b), to) in a.iter().zip(b.iter().rev()).zip(entries) {
                    let (a, b) = (L::load(a), L::load(b));
                    (a + b).store(&mut to[0]);
                    (a - b).store(&mut to[2]);
                }
            }
            _ => {
                for (k, to) in (low..high).zip(entries) {
                    let (a, b) = (source.get::<L>(k), source.get::<L>(n - k));
                    if twice {
                        store_all(
                            fold_four(a, b, source.get::<L>(half - k), source.get::<L>(half + k)),
                            to,
                        );
                    } else {
                        (a + b).store(&mut to[0]);
                        (a - b).store(&mut to[2]);
                    }
                }
            }
        }
    }

    /// Sample times its weight.
    #[inline(always)]
    fn weighted<L: Lanes, S: Source>(&self, source: S, k: usize) -> L {
        source.get::<L>(k) * L::splat(self.weights[k])
    }

    /// One folded entry near the ends or in the middle: sums for even, odd m, differences for even, odd m.
    #[inline(always)]
    fn entry<L: Lanes, S: Source>(&self, source: S, k: usize) -> [L; 4] {
        let (n, half, zero) = (self.intervals, self.intervals / 2, L::splat(0.0));
        let (a, b) = (self.weighted::<L, S>(source, k), self.weighted::<L, S>(source, n - k));
        let (p, d) = (a + b, if k == 0 { zero } else { a - b });
        if n % 2 == 1 {
            [p, zero, d, zero]
        } else if 2 * k == half {
            // Its own mirror image: cos vanishes for odd m, sin for even m.
            [p, zero, zero, d]
        } else if k == 0 {
            let middle = self.weighted::<L, S>(source, half);
            [p + middle, p - middle, zero, zero]
        } else {
            let (c, d) =
                (self.weighted::<L, S>(source, half - k), self.weighted::<L, S>(source, half + k));
            fold_four(a, b, c, d)
        }
    }
}

/// Writes one entry.
#[inline(always)]
fn store_all<L: Lanes>(from: [L; 4], to: &mut [Wide; 4]) {
    for (from, to) in from.into_iter().zip(to) {
        from.store(to);
    }
}

/// Samples k, N−k, N/2−k, N/2+k: sums for even, odd m, differences for even, odd m.
#[inline(always)]
fn fold_four<L: Lanes>(a: L, b: L, c: L, d: L) -> [L; 4] {
    let (p, q) = (a + b, c + d);
    let (e, f) = (a - b, c - d);
    [p + q, p - q, e - f, e + f]
}
