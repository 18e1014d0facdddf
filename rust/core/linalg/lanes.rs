//! Elimination on eight small systems at once, with a verdict on every pivot.

use crate::simd::{Lanes, Wide};
use std::ops::Range;

/// Smallest pivot, relative to its value before elimination, that normal equations are trusted with:
/// the square of a condition of 3,000.
const PIVOT: f64 = 1e-7;

/// `trusted`, with zero in the lanes where a pivot fell below the limit; NaN shows in the solution itself.
#[inline(always)]
pub fn judge<L: Lanes>(pivot: L, before: L, trusted: L) -> L {
    let limit = before.abs() * L::splat(PIVOT);
    pivot.select_lt(limit, L::splat(0.0), trusted)
}

/// An entry of a system: one of a list of numbers, times a sign.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Which number.
    pub from: usize,
    /// 1 or −1.
    pub sign: f64,
}

/// A `size` × (`size` + 1) system, the last column its right side, as a list of entries.
#[derive(Clone, Copy)]
pub struct System<'a> {
    /// The numbers.
    pub sums: &'a [Wide],
    /// Row after row; of a symmetric system from the diagonal on.
    pub entries: &'a [Entry],
    /// Number of unknowns.
    pub size: usize,
    /// Whether only the upper triangle is given.
    pub symmetric: bool,
}

impl System<'_> {
    /// Writes the system into a matrix and its diagonal apart.
    #[inline(always)]
    pub fn assemble<L: Lanes>(&self, m: &mut [Wide], diagonal: &mut [Wide]) {
        let (size, mut entries) = (self.size, self.entries.iter());
        for i in 0..size {
            let row = &mut m[i * (size + 1)..][..size + 1];
            for (to, e) in row[if self.symmetric { i } else { 0 }..].iter_mut().zip(&mut entries) {
                (L::load(&self.sums[e.from]) * L::splat(e.sign)).store(to);
            }
            L::load(&row[i]).store(&mut diagonal[i]);
        }
    }
}

/// Eliminates the columns `pivots` of a `size` × (`size` + 1) system, the last column its right side.
///
/// No pivoting: the matrices are normal matrices or close to them. `trusted` becomes zero where a pivot
/// is small beside its value before elimination (`diagonal`): the caller uses orthogonal factors there.
/// With `symmetric` only the upper triangle is read and written. The inverse pivots replace the diagonal.
#[inline(always)]
pub fn eliminate<L: Lanes>(
    m: &mut [Wide],
    size: usize,
    pivots: Range<usize>,
    diagonal: &[Wide],
    symmetric: bool,
    trusted: &mut Wide,
) {
    let width = size + 1;
    let mut sound = L::load(trusted);
    for k in pivots {
        let (above, below) = m.split_at_mut((k + 1) * width);
        let row = &mut above[k * width..];
        let pivot = L::load(&row[k]);
        let inverse = L::splat(1.0) / pivot;
        sound = judge::<L>(pivot, L::load(&diagonal[k]), sound);
        for i in k + 1..size {
            let other = &mut below[(i - k - 1) * width..(i - k) * width];
            let lead = if symmetric { L::load(&row[i]) } else { L::load(&other[k]) };
            let factor = -(lead * inverse);
            let from = if symmetric { i } else { k + 1 };
            for j in from..width {
                let reduced = factor.mul_add(L::load(&row[j]), L::load(&other[j]));
                reduced.store(&mut other[j]);
            }
        }
        inverse.store(&mut row[k]);
    }
    sound.store(trusted);
}

/// Solves the eliminated rows `range` for their unknowns; `x[range.end..size]` are known already.
#[inline(always)]
pub fn substitute<L: Lanes>(m: &[Wide], size: usize, range: Range<usize>, x: &mut [Wide]) {
    let width = size + 1;
    for i in range.rev() {
        let row = &m[i * width..(i + 1) * width];
        let mut sum = L::load(&row[size]);
        for j in i + 1..size {
            sum = (-L::load(&row[j])).mul_add(L::load(&x[j]), sum);
        }
        (sum * L::load(&row[i])).store(&mut x[i]);
    }
}

/// Inverse of a symmetric positive definite matrix (`size` × `size`, upper triangle read) into `out`.
///
/// `work` needs `size` × (`size` + 1); `trusted` as in [`eliminate`].
#[inline(always)]
pub fn invert<L: Lanes>(
    m: &[Wide],
    size: usize,
    out: &mut [Wide],
    work: &mut [Wide],
    trusted: &mut Wide,
) {
    // U = D L^T by elimination, then columns of the inverse by two triangular solves each.
    let width = size + 1;
    for i in 0..size {
        for j in i..size {
            work[i * width + j] = m[i * size + j];
        }
    }
    // The diagonal before elimination travels in the unused last column.
    for k in 0..size {
        work[k * width + size] = m[k * size + k];
    }
    let mut sound = L::load(trusted);
    for k in 0..size {
        let pivot = L::load(&work[k * width + k]);
        let inverse = L::splat(1.0) / pivot;
        sound = judge::<L>(pivot, L::load(&work[k * width + size]), sound);
        for i in k + 1..size {
            let factor = -(L::load(&work[k * width + i]) * inverse);
            for j in i..size {
                let r =
                    factor.mul_add(L::load(&work[k * width + j]), L::load(&work[i * width + j]));
                r.store(&mut work[i * width + j]);
            }
        }
        inverse.store(&mut work[k * width + k]);
    }
    sound.store(trusted);
    for c in 0..size {
        // Forward: L z = e_c with L = (U / diag U)ᵀ; z_i = 0 for i < c.
        for i in 0..size {
            let mut z = L::splat(if i == c { 1.0 } else { 0.0 });
            if i > c {
                for k in c..i {
                    let l = L::load(&work[k * width + i]) * L::load(&work[k * width + k]);
                    z = (-l).mul_add(L::load(&out[k * size + c]), z);
                }
            }
            z.store(&mut out[i * size + c]);
        }
        for i in (0..size).rev() {
            let mut z = L::load(&out[i * size + c]);
            for j in i + 1..size {
                z = (-L::load(&work[i * width + j])).mul_add(L::load(&out[j * size + c]), z);
            }
            (z * L::load(&work[i * width + i])).store(&mut out[i * size + c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Isa, Kernel, LANES};

    struct Solve<'a> {
        m: &'a mut [Wide],
        size: usize,
        symmetric: bool,
        x: &'a mut [Wide],
        inverse: &'a mut [Wide],
    }

    impl Kernel for Solve<'_> {
        type Output = Wide;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Wide {
            let (n, w) = (self.size, self.size + 1);
            let square: Vec<Wide> = (0..n * n).map(|k| self.m[(k / n) * w + k % n]).collect();
            let diagonal: Vec<Wide> = (0..n).map(|k| self.m[k * w + k]).collect();
            let mut trusted = Wide::splat(1.0);
            if self.symmetric {
                let mut work = vec![Wide::ZERO; n * w];
                invert::<L>(&square, n, self.inverse, &mut work, &mut trusted);
            }
            eliminate::<L>(self.m, n, 0..n, &diagonal, self.symmetric, &mut trusted);
            substitute::<L>(self.m, n, 0..n, self.x);
            trusted
        }
    }

    fn matrix(size: usize, symmetric: bool) -> Vec<Wide> {
        let value = |k: usize| ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5;
        let mut m = vec![Wide::ZERO; size * (size + 1)];
        for lane in 0..LANES {
            let a = |i: usize, j: usize| value(lane * 97 + i * 13 + j * 7 + i * j);
            for i in 0..size {
                for j in 0..=size {
                    m[i * (size + 1) + j].0[lane] = match (symmetric, j < size) {
                        (true, true) => {
                            (0..size).map(|k| a(k, i) * a(k, j)).sum::<f64>() + f64::from(i == j)
                        }
                        (false, true) => a(i, j) + 3.0 * f64::from(i == j),
                        _ => value(lane + 31 * i),
                    };
                }
            }
        }
        m
    }

    #[test]
    fn solutions_satisfy_their_equations_on_every_set() {
        for (size, symmetric) in [(1, true), (3, true), (6, true), (5, false), (7, false)] {
            let m = matrix(size, symmetric);
            let mut reference = vec![Wide::ZERO; size];
            let mut none = vec![Wide::ZERO; size * size];
            Isa::Plain.run(Solve {
                m: &mut m.clone(),
                size,
                symmetric,
                x: &mut reference,
                inverse: &mut none,
            });
            for isa in Isa::available() {
                let mut x = vec![Wide::ZERO; size];
                let mut inverse = vec![Wide::ZERO; size * size];
                let trusted = isa.run(Solve {
                    m: &mut m.clone(),
                    size,
                    symmetric,
                    x: &mut x,
                    inverse: &mut inverse,
                });
                for lane in 0..LANES {
                    assert_eq!(trusted.0[lane], 1.0);
                    for i in 0..size {
                        assert_eq!(x[i].0[lane].to_bits(), reference[i].0[lane].to_bits());
                        let at = |i: usize, j: usize| m[i * (size + 1) + j].0[lane];
                        let sum: f64 = (0..size).map(|j| at(i, j) * x[j].0[lane]).sum();
                        assert!((sum - at(i, size)).abs() < 1e-12);
                        if symmetric {
                            let y: f64 = (0..size)
                                .map(|j| inverse[i * size + j].0[lane] * at(j, size))
                                .sum();
                            assert!((y - x[i].0[lane]).abs() < 1e-12);
                        }
                    }
                }
            }
        }
    }
}
