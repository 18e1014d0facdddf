//! Covariance of the rows of one record, eight lines a register.

use std::ops::Range;

use super::Spot;
use crate::estimate::terms::complex::Split;
use crate::estimate::terms::lines::{Couple, Pairs, Spectra};
use crate::linalg::dense::Panel;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers};

/// What the lines from m on have with line m: E[Q Q*] and E[Q Q] as sums that stand in the matrix, of Re with
/// Re, Im with Im, Re with Im and Im with Re.
pub(super) type Entries = [Vec<Wide>; 4];

impl Spot {
    /// Covariance of the rows, upper triangle.
    pub(super) fn covariance(&mut self, isa: Isa, equations: usize, pairs: &Pairs) {
        let (count, first) = (self.count(), self.lines.first);
        for part in &mut self.entries {
            part.resize(count.div_ceil(LANES), Wide::ZERO);
        }
        isa.across().run(Covariance {
            pairs,
            loads: &self.loads,
            spectra: &self.spectra,
            entries: &mut self.entries,
            panel: &mut self.panel,
            equations,
            count,
            first,
        });
    }
}

struct Covariance<'a> {
    pairs: &'a Pairs,
    loads: &'a [Split],
    spectra: &'a Spectra,
    entries: &'a mut Entries,
    panel: &'a mut Panel,
    equations: usize,
    count: usize,
    first: usize,
}

impl Kernel for Covariance<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let half = L::splat(0.5);
        for m in 0..self.count {
            for a in 0..self.equations {
                for b in 0..self.equations {
                    let couples = &self.pairs.couples[a * self.equations + b];
                    for block in 0..(self.count - m).div_ceil(LANES) {
                        let d = self.sum::<L, false>(couples, m, block * LANES);
                        let x = self.sum::<L, true>(couples, m, block * LANES);
                        let [same, other, forth, back] = &mut *self.entries;
                        (half * (d.0 + x.0)).store(&mut same[block]);
                        (half * (d.0 - x.0)).store(&mut other[block]);
                        (half * (x.1 - d.1)).store(&mut forth[block]);
                        (half * (x.1 + d.1)).store(&mut back[block]);
                    }
                    self.write(m, a, b);
                }
            }
        }
    }
}

impl Covariance<'_> {
    /// Σ_ij L_i(m) conj(L_j(l) R_ij(l − m)) of the eight lines l that begin `ahead` of m; of `mirrored` lines,
    /// −l for l, Σ_ij L_i(m) L_j(l) R_ij(l + m).
    #[inline(always)]
    fn sum<L: Lanes, const MIRRORED: bool>(
        &self,
        couples: &[Couple],
        m: usize,
        ahead: usize,
    ) -> (L, L) {
        let lag = if MIRRORED { 2 * (m + self.first) + ahead } else { ahead };
        let mut sum = (L::splat(0.0), L::splat(0.0));
        for couple in couples {
            let pair = couple.pair;
            if self.spectra.apart[pair] || (self.spectra.white[pair] && lag > 0) {
                continue;
            }
            let to = self.loads[couple.to].eight::<L>(m + ahead);
            let r = self.spectra.pairs[couple.pair].eight::<L>(self.spectra.middle + lag);
            let product = (to.0.mul_add(r.0, (-to.1) * r.1), to.0.mul_add(r.1, to.1 * r.0));
            let from = self.loads[couple.from].get(m);
            let (x, y) = (L::splat(from.0), L::splat(from.1));
            if MIRRORED {
                sum.0 = x.mul_add(product.0, (-y).mul_add(product.1, sum.0));
                sum.1 = y.mul_add(product.0, x.mul_add(product.1, sum.1));
            } else {
                sum.0 = x.mul_add(product.0, y.mul_add(product.1, sum.0));
                sum.1 = y.mul_add(product.0, (-x).mul_add(product.1, sum.1));
            }
        }
        sum
    }

    /// Puts the entries of line m, equation a, with equation b of the lines from m on in their places.
    #[inline(always)]
    fn write(&mut self, m: usize, a: usize, b: usize) {
        let equations = self.equations;
        let [same, other, forth, back] = &*self.entries;
        // Line 0 has no Im.
        let missing = if self.first == 0 { equations } else { 0 };
        let at = |line: usize| (2 * line * equations).saturating_sub(missing);
        let whole = usize::from(m + self.first == 0);
        let (start, some) = (at(m + whole), whole..self.count - m);
        let row = self.panel.row_mut(at(m) + a);
        if whole == 1 {
            row[b] = same[0].0[0];
        }
        put(&mut row[start..], [same, forth], some.clone(), (b, equations));
        // What the factor of the last time left before the diagonal, in the register that holds it.
        row[at(m) / LANES * LANES..at(m)].fill(0.0);
        if whole == 0 {
            let row = self.panel.row_mut(at(m) + equations + a);
            put(&mut row[start..], [back, other], some, (b, equations));
            row[at(m) / LANES * LANES..at(m)].fill(0.0);
        }
    }
}

/// Puts some of the entries of Re and Im of equation `b` of `equations`, line after line, in a row.
#[inline(always)]
fn put(
    row: &mut [f64],
    [re, im]: [&[Wide]; 2],
    some: Range<usize>,
    (b, equations): (usize, usize),
) {
    let entries = numbers(re)[some.clone()].iter().zip(&numbers(im)[some]);
    for (to, (re, im)) in row.chunks_exact_mut(2 * equations).zip(entries) {
        to[b] = *re;
        to[equations + b] = *im;
    }
}
