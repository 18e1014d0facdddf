//! The noise of one line: its covariance S, and W that whitens its rows, W S W* = 1.

use super::complex::{Complex, add, conj, get, put, zero};
use super::design::JointDesign;
use super::workspace::JointWorkspace;
use crate::covariance::variance;
use crate::simd::Lanes;

/// W where the inputs are exact: inverse root of Σ (if `whole`) times the inverses of the A_i, or times
/// one for equation noise.
#[inline(always)]
pub(super) fn plain_whitener<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    m: usize,
    flat: bool,
    whole: bool,
) {
    let q = d.outputs();
    let (rd, r) = (&d.records[k], &w.records[k]);
    let one = (L::splat(1.0), L::splat(0.0));
    for i in 0..q {
        let mut own = if flat || d.noise.equation {
            one
        } else {
            let a: Complex<L> = get(&w.a, i);
            let (order, from) = (d.structure.orders[i], d.denominators[i]);
            let size_x = w.across.load::<L>(&rd.size_x, rd.stride(), 0, m);
            let square = variance::<L>(a, &w.coefficients[from..from + order], size_x);
            let still = L::splat(1.0) / square.sqrt();
            if d.structure.common && rd.uneven.is_none() {
                // What all outputs share may turn them all alike, where lines are independent: nothing turns.
                (still, L::splat(0.0))
            } else {
                // conj(A)/|A| turns, the floored |A| scales; where A vanishes nothing turns.
                let size = a.0.mul_add(a.0, a.1 * a.1);
                let tiny = L::splat(f64::MIN_POSITIVE);
                let scale = L::splat(1.0) / (size.max(tiny) * square).sqrt();
                (
                    size.select_lt(tiny, still, a.0 * scale),
                    size.select_lt(tiny, L::splat(0.0), -(a.1 * scale)),
                )
            }
        };
        if !flat {
            let colour = L::load(&r.colour[m * q + i]);
            own = (own.0 * colour, own.1 * colour);
        }
        put(own, &mut w.factor, i);
    }
    for i in 0..q {
        for j in 0..=i {
            let value = match (whole, i == j) {
                (true, _) => {
                    let root = L::load(&w.root[i * q + j]);
                    let own: Complex<L> = get(&w.factor, j);
                    (root * own.0, root * own.1)
                }
                (false, true) => get(&w.factor, i),
                (false, false) => zero(),
            };
            put(value, &mut w.white, i * q + j);
        }
    }
}

/// W where the inputs are noisy, too: inverse Cholesky factor of S = D Σ_y D* + B Σ_u B*.
#[inline(always)]
pub(super) fn full_whitener<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, k: usize, m: usize) {
    let (q, paths) = (d.outputs(), d.paths());
    for i in 0..q {
        for j in 0..=i {
            let a = add(zero::<L>(), get(&w.a, i), conj(get(&w.a, j)));
            let own = output_covariance::<L>(w, k, m, q, i, j);
            let mut sum = (a.0 * own, a.1 * own);
            for s in 0..paths {
                for v in 0..paths {
                    let (left, right) =
                        (d.structure.numerators[i][s], d.structure.numerators[j][v]);
                    if left.is_some() && right.is_some() && is_noisy(d, s, v) {
                        let noise = path_covariance::<L>(d, w, k, m, s, v);
                        let b: Complex<L> = get(&w.b, i * paths + s);
                        let b = (b.0 * noise, b.1 * noise);
                        sum = add(sum, b, conj(get(&w.b, j * paths + v)));
                    }
                }
            }
            put(sum, &mut w.factor, i * q + j);
        }
    }
    // Cholesky in place, its diagonal real and kept inverse; then the inverse row by row.
    for j in 0..q {
        let mut pivot = L::load(&w.factor[0][j * q + j]);
        for c in 0..j {
            let own: Complex<L> = get(&w.factor, j * q + c);
            pivot = pivot - own.0.mul_add(own.0, own.1 * own.1);
        }
        let inverse = L::splat(1.0) / pivot.max(L::splat(f64::MIN_POSITIVE)).sqrt();
        put((inverse, L::splat(0.0)), &mut w.factor, j * q + j);
        for i in j + 1..q {
            let mut sum: Complex<L> = get(&w.factor, i * q + j);
            for c in 0..j {
                let left: Complex<L> = get(&w.factor, i * q + c);
                sum = add(sum, (-left.0, -left.1), conj(get(&w.factor, j * q + c)));
            }
            put((sum.0 * inverse, sum.1 * inverse), &mut w.factor, i * q + j);
        }
    }
    for i in 0..q {
        let inverse = L::load(&w.factor[0][i * q + i]);
        for j in 0..=i {
            let mut sum = if i == j { (L::splat(1.0), L::splat(0.0)) } else { zero() };
            for c in j..i {
                let left: Complex<L> = get(&w.factor, i * q + c);
                sum = add(sum, (-left.0, -left.1), get(&w.white, c * q + j));
            }
            put((sum.0 * inverse, sum.1 * inverse), &mut w.white, i * q + j);
        }
    }
}

/// Covariance of the noise of outputs i and j on line m.
#[inline(always)]
pub(super) fn output_covariance<L: Lanes>(
    w: &JointWorkspace,
    k: usize,
    m: usize,
    q: usize,
    i: usize,
    j: usize,
) -> L {
    let colour = &w.records[k].colour[m * q..(m + 1) * q];
    L::load(&w.sigma[i * q + j]) / (L::load(&colour[i]) * L::load(&colour[j]))
}

/// Whether the noise of paths s and v goes together at all.
#[inline(always)]
pub(super) fn is_noisy(d: &JointDesign, s: usize, v: usize) -> bool {
    d.noise.inputs.as_ref().is_some_and(|sigma| sigma[s * d.paths() + v] != 0.0)
}

/// Covariance of the noise of paths s and v on line m, in the workspace's units.
#[inline(always)]
pub(super) fn path_covariance<L: Lanes>(
    d: &JointDesign,
    w: &JointWorkspace,
    k: usize,
    m: usize,
    s: usize,
    v: usize,
) -> L {
    let (q, paths, rd) = (d.outputs(), d.paths(), &d.records[k]);
    let given = d.noise.inputs.as_ref().map_or(0.0, |sigma| sigma[s * paths + v]);
    let unit = d.units[q + s] * d.units[q + v];
    if rd.path_spectra.is_empty() {
        return L::splat(given / unit);
    }
    let spectrum = |path: usize| w.across.load::<L>(&rd.path_spectra, rd.stride(), path, m);
    L::splat(given) * (spectrum(s) * spectrum(v)).sqrt() / L::splat(unit)
}
