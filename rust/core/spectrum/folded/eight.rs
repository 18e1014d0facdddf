//! Sums of eight records, one a lane: each pass runs over one folded array for a few harmonics.

use super::FoldedSums;
use crate::simd::{LANES, Lanes, Wide};
use crate::spectrum::source::{Eight, Source};
use crate::spectrum::tables::{BLOCK, Group};

/// Accumulators that, with the sample and the table entry, fill the 16 registers of AVX2.
const MOST: usize = 5;

/// Sums over one folded array for `count` harmonics `first`, `first + step`, …
#[derive(Debug, Clone)]
pub(super) struct Pass {
    /// 0, 1: sums v_k + v_{N−k} for even, odd m; 2, 3: differences.
    array: usize,
    sine: bool,
    first: usize,
    step: usize,
    count: usize,
    /// A row of `count` numbers an entry.
    table: Vec<f64>,
    /// The groups of the harmonics of this parity start there.
    group: usize,
}

/// Splits the harmonics of each parity evenly into passes. Cosines of the sums and sines of the
/// differences are all there is, but for blocks that will be turned.
fn passes(groups: &[Group], harmonics: usize) -> Vec<Pass> {
    let mut passes = Vec::new();
    for (group, lowest) in groups.iter().enumerate().filter(|(_, g)| g.first < g.step) {
        let (parity, step, turned) = (lowest.first, lowest.step, lowest.turned());
        for (array, sine) in
            [(parity, false), (parity, true), (parity + 2, false), (parity + 2, true)]
        {
            if sine != (array >= 2) && !turned {
                continue;
            }
            // Harmonic 0 has no sine, and its cosine never meets the differences.
            let mut first = if parity == 0 && (sine || array >= 2) { step } else { parity };
            while first <= harmonics {
                let rest = (harmonics - first) / step + 1;
                let count = rest.div_ceil(rest.div_ceil(MOST));
                let places = first / step..first / step + count;
                let value = |k: usize, place: usize| {
                    groups[group + place / LANES].entries[k][usize::from(sine)].0[place % LANES]
                };
                let rows = 0..lowest.entries.len();
                let table = rows.flat_map(|k| places.clone().map(move |p| value(k, p))).collect();
                passes.push(Pass { array, sine, first, step, count, table, group });
                first += count * step;
            }
        }
    }
    passes
}

impl FoldedSums {
    /// Registers of scratch that [`FoldedSums::run_eight`] needs.
    pub(in crate::spectrum) fn scratch(&self) -> usize {
        4 * BLOCK.min(self.length)
    }

    /// Writes (1/N) Σ_k w_k v_k e^{−2πimk/N}, m = 0…M.
    #[inline(always)]
    pub(in crate::spectrum) fn run_eight<L: Lanes, S: Source<Eight<L>>>(
        &self,
        source: S,
        re: &mut [Wide],
        im: &mut [Wide],
        scratch: &mut [Wide],
    ) {
        let (re, im) = (&mut re[..=self.harmonics], &mut im[..=self.harmonics]);
        for x in re.iter_mut().chain(im.iter_mut()) {
            L::splat(0.0).store(x);
        }
        let passes = self.passes.get_or_init(|| passes(&self.groups, self.harmonics));
        let entries = scratch.as_chunks_mut::<4>().0;
        for (block, (start, count)) in self.blocks().enumerate() {
            let entries = &mut entries[..count];
            self.fold::<Eight<L>, S>(source, start, entries);
            for pass in passes {
                match pass.count {
                    1 => self.pass::<L, 1>(pass, block, entries, re, im),
                    2 => self.pass::<L, 2>(pass, block, entries, re, im),
                    3 => self.pass::<L, 3>(pass, block, entries, re, im),
                    4 => self.pass::<L, 4>(pass, block, entries, re, im),
                    _ => self.pass::<L, MOST>(pass, block, entries, re, im),
                }
            }
        }
        for (re, im) in re.iter_mut().zip(im.iter_mut()) {
            (L::load(re) * L::splat(self.scale)).store(re);
            (L::load(im) * L::splat(-self.scale)).store(im);
        }
        L::splat(0.0).store(&mut im[0]);
    }

    /// One pass over one block, added to the coefficients (to the imaginary parts without their sign).
    #[inline(always)]
    fn pass<L: Lanes, const G: usize>(
        &self,
        pass: &Pass,
        block: usize,
        entries: &[[Wide; 4]],
        re: &mut [Wide],
        im: &mut [Wide],
    ) {
        let turned = self.groups[pass.group].turned();
        let skip = if turned { 0 } else { block * BLOCK };
        let mut sums = [L::splat(0.0); G];
        for (x, row) in entries.iter().zip(&pass.table.as_chunks::<G>().0[skip..]) {
            let x = L::load(&x[pass.array & 3]);
            for g in 0..G {
                sums[g] = x.mul_add(L::splat(row[g]), sums[g]);
            }
        }
        let to = if pass.array < 2 { re } else { im };
        for (g, sum) in sums.into_iter().enumerate() {
            let to = &mut to[pass.first + g * pass.step];
            if !turned {
                (L::load(to) + sum).store(to);
                continue;
            }
            // With θ the angle inside the block and φ its turn: cos(φ+θ) of the sums, sin(φ+θ) of the differences.
            let place = pass.first / pass.step + g;
            let (cos, sin) = self.groups[pass.group + place / LANES].turn(block, place % LANES);
            let by = match (pass.array < 2, pass.sine) {
                (true, true) => -sin,
                (false, false) => sin,
                _ => cos,
            };
            sum.mul_add(L::splat(by), L::load(to)).store(to);
        }
    }
}
