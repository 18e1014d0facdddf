//! Weights of the lines at an iterate, with the residual and the denoised output there.

use super::shape::OUTPUT;
use super::sums::{Lines, Signals};
use super::tables::Tables;
use crate::covariance::{polynomial, variance};
use crate::simd::{Lanes, Wide};

/// λ of the lines at an iterate; where asked for the residual r and the denoised output. Returns Σ λ|r|², where one
/// was.
#[inline(always)]
pub(super) fn weigh<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const RESIDUAL: bool,
    const MODEL: bool,
>(
    tables: &Tables,
    signals: &Signals<'_>,
    on: &mut Lines<'_>,
    at: &[L; S],
) -> L {
    // Copies that no store below can change stay in registers.
    let mut theta = [Wide::ZERO; S];
    for k in 0..S {
        at[k].store(&mut theta[k]);
    }
    let (denominator, numerators) = (&theta[N..2 * N], &theta[2 * N..]);
    let lines = on.weights.len();
    let (x, size_x, weight) =
        (&tables.x[..lines], &tables.size_x[..lines], &tables.weight[..lines]);
    let powers = &tables.powers[..lines];
    let weights = &mut on.weights[..lines];
    let (hat_re, hat_im) = (&mut on.hat.0[..lines], &mut on.hat.1[..lines]);
    let mut cost = L::splat(0.0);
    for m in 0..lines {
        let point = L::splat(x[m]);
        let a = polynomial::<L>(true, denominator, point);
        let inverse = L::splat(1.0) / variance::<L>(a, denominator, L::splat(size_x[m]));
        let lambda = L::splat(weight[m]) * inverse;
        lambda.store(&mut weights[m]);
        if !RESIDUAL && !MODEL {
            continue;
        }
        let y = signals.at::<L>(OUTPUT, m);
        let mut re = (-a.1).mul_add(y.1, a.0 * y.0);
        let mut im = a.1.mul_add(y.0, a.0 * y.1);
        for k in 0..I {
            let (p, q) = signals.at::<L>(1 + k, m);
            let b = polynomial::<L>(false, &numerators[k * Z..(k + 1) * Z], point);
            re = (-b.0).mul_add(p, re);
            im = (-b.0).mul_add(q, im);
            if Z > 1 {
                re = b.1.mul_add(q, re);
                im = (-b.1).mul_add(p, im);
            }
        }
        for j in 0..N {
            let value = L::splat(-powers[m][j]);
            if j % 2 == 0 {
                re = value.mul_add(at[j], re);
            } else {
                im = value.mul_add(at[j], im);
            }
        }
        cost = lambda.mul_add(re.mul_add(re, im * im), cost);
        if RESIDUAL {
            re.store(&mut on.residual.0[m]);
            im.store(&mut on.residual.1[m]);
        }
        if MODEL {
            (y.0 - a.0.mul_add(re, a.1 * im) * inverse).store(&mut hat_re[m]);
            (y.1 - a.0.mul_add(im, -(a.1 * re)) * inverse).store(&mut hat_im[m]);
        }
    }
    cost
}
