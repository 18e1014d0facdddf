//! Covariance of the rows of one record, eight lines a register.

use std::ops::Range;

use super::Spot;
use crate::estimate::terms::complex::{Windows, loaded, times};
use crate::estimate::terms::lines::{Couple, Pairs, Spectra};
use crate::linalg::dense::Panel;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers};

/// Memory of [`Spot::covariance`].
#[derive(Default)]
pub(super) struct Entries {
    loads: Vec<Windows>,
    /// What the lines from m on have with line m: sums of E[Q Q*] and E[Q Q] as they stand in the matrix, of Re with
    /// Re, Im with Im, Re with Im and Im with Re.
    parts: [Vec<Wide>; 4],
}

impl Spot {
    /// Covariance of the rows, upper triangle.
    pub(super) fn covariance(&mut self, isa: Isa, equations: usize, pairs: &Pairs) {
        let (count, first) = (self.count(), self.lines.first);
        let Entries { loads, parts } = &mut self.entries;
        loads.resize_with(self.loads.len(), Windows::new);
        self.loads.iter().zip(loads).for_each(|(own, to)| own.windows(to));
        parts.iter_mut().for_each(|part| part.resize(count.div_ceil(LANES), Wide::ZERO));
        isa.run(Covariance {
            pairs,
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
                        let (d, x) = self.sum::<L>(couples, m, block * LANES);
                        let [same, other, forth, back] = &mut self.entries.parts;
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
    /// Σ_ij L_i(m) conj(L_j(l) R_ij(l − m)) of the eight lines l that begin `ahead` of m, and of mirrored lines, −l
    /// for l, Σ_ij L_i(m) L_j(l) R_ij(l + m).
    #[inline(always)]
    fn sum<L: Lanes>(&self, couples: &[Couple], m: usize, ahead: usize) -> ((L, L), (L, L)) {
        let loads = &self.entries.loads;
        let zero = (L::splat(0.0), L::splat(0.0));
        let (mut d, mut x) = (zero, zero);
        let far = 2 * (m + self.first) + ahead;
        for couple in couples {
            if self.spectra.apart[couple.pair] {
                continue;
            }
            // White noise has no lag but 0.
            let white = self.spectra.white[couple.pair];
            let [re, im] = &loads[couple.from][m];
            let (a, b) = (L::splat(re.0[0]), L::splat(im.0[0]));
            let to = loaded::<L>(&loads[couple.to][m + ahead]);
            let lags = &self.spectra.pairs[couple.pair][self.spectra.middle..];
            if !white || ahead == 0 {
                let product = times(to, loaded(&lags[ahead]));
                d.0 = a.mul_add(product.0, b.mul_add(product.1, d.0));
                d.1 = b.mul_add(product.0, (-a).mul_add(product.1, d.1));
            }
            if !white || far == 0 {
                let product = times(to, loaded(&lags[far]));
                x.0 = a.mul_add(product.0, (-b).mul_add(product.1, x.0));
                x.1 = b.mul_add(product.0, a.mul_add(product.1, x.1));
            }
        }
        (d, x)
    }

    /// Puts the entries of line m, equation a, with equation b of the lines from m on in their places.
    #[inline(always)]
    fn write(&mut self, m: usize, a: usize, b: usize) {
        let equations = self.equations;
        let [same, other, forth, back] = &self.entries.parts;
        // Line 0 has no Im.
        let missing = if self.first == 0 { equations } else { 0 };
        let at = |line: usize| (2 * line * equations).saturating_sub(missing);
        let whole = usize::from(m + self.first == 0);
        let (start, some) = (at(m + whole), whole..self.count - m);
        let re = self.panel.row_mut(at(m) + a);
        if b == 0 {
            // What the factor of the last time left before the diagonal.
            re[at(m) / LANES * LANES..][..LANES].fill(0.0);
        }
        if whole == 1 {
            re[b] = same[0].0[0];
        }
        put(&mut re[start..], [same, forth], some.clone(), (b, equations));
        if whole == 0 {
            let im = self.panel.row_mut(at(m) + equations + a);
            if b == 0 {
                im[at(m) / LANES * LANES..][..LANES].fill(0.0);
            }
            put(&mut im[start..], [back, other], some, (b, equations));
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
    if equations == 1 {
        // The same in pairs of a known size.
        let each = row.as_chunks_mut().0.iter_mut();
        return each.zip(entries).for_each(|(to, (re, im))| *to = [*re, *im]);
    }
    for (to, (re, im)) in row.chunks_exact_mut(2 * equations).zip(entries) {
        to[b] = *re;
        to[equations + b] = *im;
    }
}
