//! `ls` of a small problem whose sizes are known when it is compiled: what `ls` does, to the bit.

use super::errors::column;
use super::shape::{OUTPUT, POWERS};
use super::sums::Signals;
use crate::estimate::design::Design;
use crate::estimate::ls::{reach, reach_back, solve};
use crate::estimate::workspace::Workspace;
use crate::simd::{Kernel, Lanes, Wide};

/// Forms the rows Δⁿ and solves their normal equations.
pub(super) struct Ls<'a, const N: usize, const I: usize, const Z: usize, const S: usize> {
    pub design: &'a Design,
    pub powers: &'a [[f64; POWERS]],
    pub space: &'a mut Workspace,
}

impl<const N: usize, const I: usize, const Z: usize, const S: usize> Kernel for Ls<'_, N, I, Z, S> {
    /// Whether it did.
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        if !L::HINTS {
            return false;
        }
        let Ls { design: d, powers, space: w } = self;
        let (zero, size) = (L::splat(0.0), S - N);
        let width = size + 1;
        let (r, record) = (&mut w.records[0], &d.records[0]);
        let signals = Signals { re: &r.re, im: &r.im, lines: r.lines };
        for ((m, powers), to) in
            powers.iter().enumerate().zip(r.differenced.chunks_exact_mut(2 * width))
        {
            for c in N..S {
                let (re, im) =
                    column::<L, N, Z>(c, signals.at::<L>(OUTPUT, m), &signals, m, powers);
                re.store(&mut to[c - N]);
                im.store(&mut to[width + c - N]);
            }
            let (re, im) =
                column::<L, N, Z>(N - 1, signals.at::<L>(OUTPUT, m), &signals, m, powers);
            re.store(&mut to[size]);
            im.store(&mut to[width + size]);
        }
        r.instruments.fill(Wide::ZERO);
        let mut sums = [[zero; S]; S];
        let mut right = [zero; S];
        for m in record.rows.first..=record.rows.last {
            let (mut re, mut im) = ([zero; S], [zero; S]);
            for (j, c) in d.differences[..=N].iter().enumerate() {
                let Some((at, mirrored)) = reach(record.lines.first, m + j as isize) else {
                    continue;
                };
                let from = &r.differenced[at * 2 * width..][..2 * width];
                let (c_re, c_im) = (L::splat(*c), L::splat(if mirrored { -*c } else { *c }));
                for i in 0..width {
                    re[i] = c_re.mul_add(L::load(&from[i]), re[i]);
                    im[i] = c_im.mul_add(L::load(&from[width + i]), im[i]);
                }
            }
            if m == record.rows.first && record.rows.first_is_real {
                im = [zero; S];
            }
            for i in 0..size {
                for j in i..size {
                    sums[i][j] = re[i].mul_add(re[j], im[i].mul_add(im[j], sums[i][j]));
                }
                right[i] = re[i].mul_add(re[size], im[i].mul_add(im[size], right[i]));
            }
            for (j, c) in d.differences[..=N].iter().enumerate() {
                let line = m + j as isize;
                let Some((at, sign)) = reach_back(record.lines.first, line, *c) else { continue };
                let to = &mut r.instruments[at * 2 * size..][..2 * size];
                let (c_re, c_im) = (L::splat(*c), L::splat(sign));
                for i in 0..size {
                    c_re.mul_add(re[i], L::load(&to[i])).store(&mut to[i]);
                    c_im.mul_add(im[i], L::load(&to[size + i])).store(&mut to[size + i]);
                }
            }
        }
        for i in 0..size {
            for j in i..size {
                sums[i][j].store(&mut w.global[i * width + j]);
            }
            right[i].store(&mut w.global[i * width + size]);
        }
        solve::<L>(w, size, size);
        true
    }
}
