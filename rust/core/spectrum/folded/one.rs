//! Sums of one record, eight harmonics in the lanes: nothing is allocated, and no lane idles.

use super::FoldedSums;
use crate::simd::{LANES, Lanes, Wide};
use crate::spectrum::FOLDED_HARMONICS;
use crate::spectrum::source::{One, Source};
use crate::spectrum::tables::{BLOCK, Group};

/// Groups there are at most: the last of each parity may not be full.
const GROUPS: usize = FOLDED_HARMONICS / LANES + 2;

impl FoldedSums {
    /// Writes (1/N) Σ_k w_k v_k e^{−2πimk/N}, m = 0…M.
    #[inline(always)]
    pub(in crate::spectrum) fn run_one<L: Lanes, S: Source<One>>(
        &self,
        source: S,
        re: &mut [f64],
        im: &mut [f64],
    ) {
        let mut entries = [[0.0; 4]; BLOCK];
        let mut sums = [[Wide::ZERO; 2]; GROUPS];
        let sums = &mut sums[..self.groups.len()];
        for (block, (start, count)) in self.blocks().enumerate() {
            let entries = &mut entries[..count];
            self.fold::<One, S>(source, start, entries);
            if self.groups[0].turned() {
                for (group, to) in self.groups.iter().zip(&mut *sums) {
                    turned::<L>(group, block, entries, to);
                }
                continue;
            }
            // Two groups at a time hide the latency of the additions.
            for (groups, to) in self.groups.chunks(2).zip(sums.chunks_mut(2)) {
                match groups {
                    [a, b] => direct_two::<L>([a, b], start, entries, to),
                    _ => direct_one::<L>(&groups[0], start, entries, &mut to[0]),
                }
            }
        }
        for (group, sums) in self.groups.iter().zip(sums) {
            for lane in 0..group.count {
                let m = group.first + lane * group.step;
                re[m] = self.scale * sums[0].0[lane];
                im[m] = -self.scale * sums[1].0[lane];
            }
        }
        im[0] = 0.0;
    }
}

/// Folded sums and differences that a group's cosines and sines meet.
#[inline(always)]
fn pair<L: Lanes>(group: &Group, x: &[f64; 4]) -> (L, L) {
    // The parity of the group's harmonics.
    let array = group.first % group.step;
    (L::splat(x[array & 1]), L::splat(x[2 + (array & 1)]))
}

/// Cosines of the sums and sines of the differences of one block, added to a group's sums.
#[inline(always)]
fn direct_one<L: Lanes>(group: &Group, start: usize, entries: &[[f64; 4]], to: &mut [Wide; 2]) {
    let mut sums = [L::splat(0.0); 2];
    for (x, row) in entries.iter().zip(&group.entries[start..]) {
        let (p, d) = pair::<L>(group, x);
        sums = [p.mul_add(L::load(&row[0]), sums[0]), d.mul_add(L::load(&row[1]), sums[1])];
    }
    add(sums, to);
}

/// [`direct_one`] of two groups.
#[inline(always)]
fn direct_two<L: Lanes>(
    groups: [&Group; 2],
    start: usize,
    entries: &[[f64; 4]],
    to: &mut [[Wide; 2]],
) {
    let [first, second] = groups;
    let mut sums = [[L::splat(0.0); 2]; 2];
    let rows = first.entries[start..].iter().zip(&second.entries[start..]);
    for (x, (one, two)) in entries.iter().zip(rows) {
        let (p, d) = pair::<L>(first, x);
        let [re, im] = sums[0];
        sums[0] = [p.mul_add(L::load(&one[0]), re), d.mul_add(L::load(&one[1]), im)];
        let (p, d) = pair::<L>(second, x);
        let [re, im] = sums[1];
        sums[1] = [p.mul_add(L::load(&two[0]), re), d.mul_add(L::load(&two[1]), im)];
    }
    add(sums[0], &mut to[0]);
    add(sums[1], &mut to[1]);
}

#[inline(always)]
fn add<L: Lanes>(sums: [L; 2], to: &mut [Wide; 2]) {
    for (sum, to) in sums.into_iter().zip(to) {
        (L::load(to) + sum).store(to);
    }
}

/// Cosines and sines of sums and differences of one block, turned to its place and added.
#[inline(always)]
fn turned<L: Lanes>(group: &Group, block: usize, entries: &[[f64; 4]], to: &mut [Wide; 2]) {
    let zero = L::splat(0.0);
    let (mut sum, mut difference) = ([zero; 2], [zero; 2]);
    for (x, row) in entries.iter().zip(&group.entries) {
        let (p, d) = pair::<L>(group, x);
        let (cos, sin) = (L::load(&row[0]), L::load(&row[1]));
        sum = [p.mul_add(cos, sum[0]), p.mul_add(sin, sum[1])];
        difference = [d.mul_add(cos, difference[0]), d.mul_add(sin, difference[1])];
    }
    let [[a, b], [c, d]] = group.turns(block);
    let (a, b, c, d) = (L::load(a), L::load(b), L::load(c), L::load(d));
    let (cos, sin) = (a * c - b * d, b * c + a * d);
    let re = sum[0].mul_add(cos, L::load(&to[0]));
    sum[1].mul_add(-sin, re).store(&mut to[0]);
    let im = difference[0].mul_add(sin, L::load(&to[1]));
    difference[1].mul_add(cos, im).store(&mut to[1]);
}
