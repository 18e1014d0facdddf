//! Complex numbers in lanes, and where they lie.

use crate::simd::{Lanes, Wide};

pub(super) type Complex<L> = (L, L);

#[inline(always)]
pub(super) fn get<L: Lanes>(from: &[Vec<Wide>; 2], at: usize) -> Complex<L> {
    (L::load(&from[0][at]), L::load(&from[1][at]))
}

#[inline(always)]
pub(super) fn put<L: Lanes>(value: Complex<L>, to: &mut [Vec<Wide>; 2], at: usize) {
    value.0.store(&mut to[0][at]);
    value.1.store(&mut to[1][at]);
}

/// sum + a·b.
#[inline(always)]
pub(super) fn add<L: Lanes>(sum: Complex<L>, a: Complex<L>, b: Complex<L>) -> Complex<L> {
    let re = (-a.1).mul_add(b.1, a.0.mul_add(b.0, sum.0));
    (re, a.1.mul_add(b.0, a.0.mul_add(b.1, sum.1)))
}

#[inline(always)]
pub(super) fn conj<L: Lanes>(a: Complex<L>) -> Complex<L> {
    (a.0, -a.1)
}

#[inline(always)]
pub(super) fn zero<L: Lanes>() -> Complex<L> {
    (L::splat(0.0), L::splat(0.0))
}
