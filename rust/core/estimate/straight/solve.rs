//! The small system of a step: its entries, and its solution in registers.

use super::shape::{SUMS, Shape};
use crate::linalg::lanes::judge;
use crate::simd::{Lanes, Wide};

/// The solution of a system, with what is asked about it.
pub(super) struct Solved<L, const S: usize> {
    pub unknowns: [L; S],
    /// The diagonal before elimination.
    pub diagonal: [L; S],
    pub trusted: L,
}

/// Solves the system that sums make, as `linalg::lanes` does.
#[inline(always)]
pub(super) fn solve<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const SYMMETRIC: bool,
>(
    sums: &[Wide],
) -> Solved<L, S> {
    let zero = L::splat(0.0);
    let (mut m, mut right) = ([[zero; S]; S], [zero; S]);
    let mut solved = Solved { unknowns: [zero; S], diagonal: [zero; S], trusted: L::splat(1.0) };
    // Written out, since the number of earlier rows must be known where a row is compiled.
    macro_rules! rows {
        ($($i:literal)*) => {$(
            if $i < S {
                reduce::<L, N, I, Z, S, $i, SYMMETRIC>(sums, &mut m, &mut right, &mut solved);
            }
        )*};
    }
    rows!(0 1 2 3 4 5 6 7 8);
    for i in (0..S).rev() {
        let mut sum = right[i];
        for j in i + 1..S {
            sum = (-m[i][j]).mul_add(solved.unknowns[j], sum);
        }
        solved.unknowns[i] = sum * m[i][i];
    }
    solved
}

/// Row `R` less its multiples of the rows before; its inverse pivot stands on the diagonal.
#[inline(always)]
fn reduce<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const R: usize,
    const SYMMETRIC: bool,
>(
    sums: &[Wide],
    m: &mut [[L; S]; S],
    right: &mut [L; S],
    solved: &mut Solved<L, S>,
) {
    let first = if SYMMETRIC { R } else { 0 };
    let mut own = [L::splat(0.0); S];
    for j in first..S {
        own[j] = entry::<L, N, I, Z>(sums, SYMMETRIC, R, j);
    }
    let mut last = entry::<L, N, I, Z>(sums, SYMMETRIC, R, S);
    let before = own[R];
    for k in 0..R {
        // Even and odd powers of the transient never meet.
        if R < N && (R - k) % 2 == 1 {
            continue;
        }
        let lead = if SYMMETRIC { m[k][R] } else { own[k] };
        let factor = -(lead * m[k][k]);
        for j in if SYMMETRIC { R } else { k + 1 }..S {
            own[j] = factor.mul_add(m[k][j], own[j]);
        }
        last = factor.mul_add(right[k], last);
    }
    solved.diagonal[R] = before;
    solved.trusted = judge(own[R], before, solved.trusted);
    own[R] = L::splat(1.0) / own[R];
    (m[R], right[R]) = (own, last);
}

#[inline(always)]
pub(super) fn entry<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    sums: &[Wide],
    symmetric: bool,
    i: usize,
    j: usize,
) -> L {
    let e = Shape::<N, I, Z>::TABLE.entry(symmetric, i, j);
    if e.from == SUMS {
        return L::splat(0.0);
    }
    let sum = L::load(&sums[e.from]);
    if e.negative { -sum } else { sum }
}
