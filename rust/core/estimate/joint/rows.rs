//! Whitened rows of Γ, J and the residual, line by line, for eight replicates.

use super::design::JointDesign;
use super::structure::JointSignal;
use super::tile::Rows;
use super::workspace::{JointRecordSpace, JointSpace};
use crate::covariance::{polynomial, variance};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::simd::{Lanes, Wide};
use std::ops::Range;

type Complex<L> = (L, L);

#[inline(always)]
fn get<L: Lanes>(from: &[Vec<Wide>; 2], at: usize) -> Complex<L> {
    (L::load(&from[0][at]), L::load(&from[1][at]))
}

#[inline(always)]
fn put<L: Lanes>(value: Complex<L>, to: &mut [Vec<Wide>; 2], at: usize) {
    value.0.store(&mut to[0][at]);
    value.1.store(&mut to[1][at]);
}

/// sum + a·b.
#[inline(always)]
fn add<L: Lanes>(sum: Complex<L>, a: Complex<L>, b: Complex<L>) -> Complex<L> {
    let re = (-a.1).mul_add(b.1, a.0.mul_add(b.0, sum.0));
    (re, a.1.mul_add(b.0, a.0.mul_add(b.1, sum.1)))
}

#[inline(always)]
fn conj<L: Lanes>(a: Complex<L>) -> Complex<L> {
    (a.0, -a.1)
}

#[inline(always)]
fn zero<L: Lanes>() -> Complex<L> {
    (L::splat(0.0), L::splat(0.0))
}

/// i^power · v.
#[inline(always)]
fn turned<L: Lanes>(v: Complex<L>, power: usize) -> Complex<L> {
    match power % 4 {
        0 => v,
        1 => (-v.1, v.0),
        2 => (-v.0, -v.1),
        _ => (v.1, -v.0),
    }
}

/// Writes the rows of the lines `range` of record `k`: `right` of the data, `left` as `factors` says (with
/// [`LeftColumns::Data`] it stays as it is: `right` serves), and the residual. `whole`: W holds Σ, too.
///
/// With whiteners for uneven samples the range must be all lines in use.
#[inline(always)]
pub(crate) fn rows<L: Lanes>(
    d: &JointDesign,
    w: &mut JointSpace,
    k: usize,
    range: Range<usize>,
    weights: RowWeights,
    factors: LeftColumns,
    whole: bool,
) {
    let dense = !d.records[k].dense.is_empty() && weights == RowWeights::Adapted;
    for (t, m) in range.clone().enumerate() {
        line::<L>(d, w, k, m, t, weights, factors, whole && !dense);
    }
    if dense {
        let q = d.outputs();
        let width = d.size() + 1;
        let first_is_real = d.records[k].lines.first == 0;
        for (i, whitener) in d.records[k].dense.iter().enumerate() {
            let place = (q, i, range.len(), first_is_real);
            whitener.apply::<L>(&mut w.right, width, place);
            whitener.apply::<L>(&mut w.residual, 1, place);
            if factors != LeftColumns::Data {
                whitener.apply::<L>(&mut w.left, width, place);
            }
        }
        if whole && q > 1 {
            for t in 0..range.len() {
                mix::<L>(&w.root, &mut w.right, t, q, width);
                mix::<L>(&w.root, &mut w.residual, t, q, 1);
                if factors != LeftColumns::Data {
                    mix::<L>(&w.root, &mut w.left, t, q, width);
                }
            }
        }
    }
}

/// Applies the root of Σ across the outputs of a line.
#[inline(always)]
fn mix<L: Lanes>(root: &[Wide], rows: &mut Rows, t: usize, q: usize, width: usize) {
    for part in [&mut rows.re, &mut rows.im] {
        for c in 0..width {
            for i in (0..q).rev() {
                let mut sum = L::splat(0.0);
                for j in 0..=i {
                    let value = L::load(&part[(t * q + j) * width + c]);
                    sum = L::load(&root[i * q + j]).mul_add(value, sum);
                }
                sum.store(&mut part[(t * q + i) * width + c]);
            }
        }
    }
}

/// A signal's coefficient on line m.
#[inline(always)]
fn signal<L: Lanes>(r: &JointRecordSpace, at: usize, m: usize) -> Complex<L> {
    (L::load(&r.re[at * r.lines + m]), L::load(&r.im[at * r.lines + m]))
}

/// Rows of line `m`, at place `t` of the tile.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn line<L: Lanes>(
    d: &JointDesign,
    w: &mut JointSpace,
    k: usize,
    m: usize,
    t: usize,
    weights: RowWeights,
    factors: LeftColumns,
    whole: bool,
) {
    let (q, paths, nt) = (d.outputs(), d.paths(), d.transient.len());
    let rd = &d.records[k];
    polynomials::<L>(d, w, rd.x[m]);
    let flat = weights == RowWeights::Flat;
    let inputs_noisy = d.noise.inputs.is_some() && !flat;
    if inputs_noisy {
        full_whitener::<L>(d, w, k, m);
    } else {
        plain_whitener::<L>(d, w, k, m, flat, whole);
    }

    // Residuals before whitening, in `column`.
    let transient = &rd.transient[m * nt..(m + 1) * nt];
    for i in 0..q {
        let (r, coefficients) = (&w.records[k], &w.iterates.transients[k].now);
        let mut sum = add(zero::<L>(), get(&w.a, i), signal(r, i, m));
        for s in 0..paths {
            if d.structure.numerators[i][s].is_some() {
                let b: Complex<L> = get(&w.b, i * paths + s);
                sum = add(sum, (-b.0, -b.1), signal(r, q + s, m));
            }
        }
        for (j, own) in d.transient.iter().enumerate() {
            if own.output == i {
                let (value, by) = (L::splat(transient[j]), L::load(&coefficients[j]));
                if own.column.phase % 2 == 0 {
                    sum.0 = value.mul_add(by, sum.0);
                } else {
                    sum.1 = value.mul_add(by, sum.1);
                }
            }
        }
        put(sum, &mut w.column, i);
    }
    if factors != LeftColumns::Data {
        if inputs_noisy {
            smooth::<L>(d, w, k, m);
        } else {
            for i in 0..q {
                let a: Complex<L> = get(&w.a, i);
                let order = d.structure.orders[i];
                let from = d.denominators[i];
                let square = variance::<L>(a, &w.coefficients[from..from + order], rd.size_x[m]);
                let inverse = L::splat(1.0) / square;
                let noise = add(zero::<L>(), conj(a), get(&w.column, i));
                let y: Complex<L> = signal(&w.records[k], i, m);
                put((y.0 - noise.0 * inverse, y.1 - noise.1 * inverse), &mut w.hat, i);
            }
            for s in 0..paths {
                put(signal::<L>(&w.records[k], q + s, m), &mut w.hat, q + s);
            }
        }
    }
    whiten::<L>(&w.white, &w.column, q, &mut w.residual, t * q, 1);
    columns::<L>(d, w, k, m, t, factors == LeftColumns::Denoised, false);
    if factors != LeftColumns::Data {
        columns::<L>(d, w, k, m, t, true, true);
    }
}

/// A_i and B_ik at s = ix.
#[inline(always)]
fn polynomials<L: Lanes>(d: &JointDesign, w: &mut JointSpace, x: f64) {
    let paths = d.paths();
    for (i, order) in d.structure.orders.iter().enumerate() {
        let from = d.denominators[i];
        let a = if d.structure.common && i > 0 {
            get(&w.a, 0)
        } else {
            polynomial::<L>(true, &w.coefficients[from..from + order], x)
        };
        put(a, &mut w.a, i);
        for (s, degree) in d.structure.numerators[i].iter().enumerate() {
            if let Some(degree) = degree {
                let from = d.numerators[i * paths + s];
                let b = polynomial::<L>(false, &w.coefficients[from..=from + degree], x);
                put(b, &mut w.b, i * paths + s);
            }
        }
    }
}

/// W where the inputs are exact: inverse root of Σ (if `whole`) times the inverses of the A_i, or times
/// one for equation noise.
#[inline(always)]
fn plain_whitener<L: Lanes>(
    d: &JointDesign,
    w: &mut JointSpace,
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
            let square = variance::<L>(a, &w.coefficients[from..from + order], rd.size_x[m]);
            let still = L::splat(1.0) / square.sqrt();
            if d.structure.common && rd.dense.is_empty() {
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
fn full_whitener<L: Lanes>(d: &JointDesign, w: &mut JointSpace, k: usize, m: usize) {
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
                    let noise = path_covariance(d, k, m, s, v);
                    if left.is_some() && right.is_some() && noise != 0.0 {
                        let b: Complex<L> = get(&w.b, i * paths + s);
                        let b = (b.0 * L::splat(noise), b.1 * L::splat(noise));
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
fn output_covariance<L: Lanes>(
    w: &JointSpace,
    k: usize,
    m: usize,
    q: usize,
    i: usize,
    j: usize,
) -> L {
    let colour = &w.records[k].colour[m * q..(m + 1) * q];
    L::load(&w.sigma[i * q + j]) / (L::load(&colour[i]) * L::load(&colour[j]))
}

/// Covariance of the noise of paths s and v on line m, in the workspace's units.
#[inline(always)]
fn path_covariance(d: &JointDesign, k: usize, m: usize, s: usize, v: usize) -> f64 {
    let (q, paths) = (d.outputs(), d.paths());
    let given = d.noise.inputs.as_ref().map_or(0.0, |sigma| sigma[s * paths + v]);
    let spectra = &d.records[k].path_spectra;
    let colour = match spectra.is_empty() {
        true => 1.0,
        false => (spectra[m * paths + s] * spectra[m * paths + v]).sqrt(),
    };
    given * colour / (d.units[q + s] * d.units[q + v])
}

/// Denoised outputs and inputs into `hat`, from the residual in `column`: v − V L* S⁻¹ r.
#[inline(always)]
fn smooth<L: Lanes>(d: &JointDesign, w: &mut JointSpace, k: usize, m: usize) {
    let (q, paths) = (d.outputs(), d.paths());
    // S⁻¹ r = W* (W r), into `back`; W r into the front of `hat` meanwhile.
    for i in 0..q {
        let mut sum = zero::<L>();
        for j in 0..=i {
            sum = add(sum, get(&w.white, i * q + j), get(&w.column, j));
        }
        put(sum, &mut w.hat, i);
    }
    for j in 0..q {
        let mut sum = zero::<L>();
        for i in j..q {
            sum = add(sum, conj(get(&w.white, i * q + j)), get(&w.hat, i));
        }
        put(sum, &mut w.back, j);
    }
    for i in 0..q {
        let r = &w.records[k];
        let at = i * r.lines + m;
        let mut value = (L::load(&r.re[at]), L::load(&r.im[at]));
        for j in 0..q {
            let (low, high) = (i.min(j), i.max(j));
            let own = -output_covariance::<L>(w, k, m, q, high, low);
            let noise = add(zero::<L>(), conj(get(&w.a, j)), get(&w.back, j));
            value = (noise.0.mul_add(own, value.0), noise.1.mul_add(own, value.1));
        }
        put(value, &mut w.hat, i);
    }
    for s in 0..paths {
        let r = &w.records[k];
        let at = (q + s) * r.lines + m;
        let mut value = (L::load(&r.re[at]), L::load(&r.im[at]));
        for v in 0..paths {
            let own = path_covariance(d, k, m, s, v);
            for j in 0..q {
                if own != 0.0 && d.structure.numerators[j][v].is_some() {
                    let b: Complex<L> = get(&w.b, j * paths + v);
                    let b = (b.0 * L::splat(own), -(b.1 * L::splat(own)));
                    value = add(value, b, get(&w.back, j));
                }
            }
        }
        put(value, &mut w.hat, q + s);
    }
}

/// W times a vector, to the rows of a line from `at` on.
#[inline(always)]
fn whiten<L: Lanes>(
    white: &[Vec<Wide>; 2],
    column: &[Vec<Wide>; 2],
    q: usize,
    to: &mut Rows,
    at: usize,
    stride: usize,
) {
    for i in 0..q {
        let mut sum = zero::<L>();
        for j in 0..=i {
            sum = add(sum, get(white, i * q + j), get(column, j));
        }
        sum.0.store(&mut to.re[at + i * stride]);
        sum.1.store(&mut to.im[at + i * stride]);
    }
}

/// A signal's coefficient as measured or denoised.
#[inline(always)]
fn value<L: Lanes>(w: &JointSpace, k: usize, at: usize, m: usize, denoised: bool) -> Complex<L> {
    if denoised { get(&w.hat, at) } else { signal(&w.records[k], at, m) }
}

/// All columns of a line and the target (with a minus, as the right side of the system), whitened.
#[inline(always)]
fn columns<L: Lanes>(
    d: &JointDesign,
    w: &mut JointSpace,
    k: usize,
    m: usize,
    t: usize,
    denoised: bool,
    left: bool,
) {
    let (q, paths, nt) = (d.outputs(), d.paths(), d.transient.len());
    let width = d.size() + 1;
    let rd = &d.records[k];
    let powers = &rd.powers[m * (d.highest + 1)..(m + 1) * (d.highest + 1)];
    let delays = nt + d.free.len();
    for c in 0..width {
        for i in 0..q {
            put(zero::<L>(), &mut w.column, i);
        }
        if c < nt {
            let own = &d.transient[c];
            let value = L::splat(rd.transient[m * nt + c]);
            let pair = match own.column.phase % 2 {
                0 => (value, L::splat(0.0)),
                _ => (L::splat(0.0), value),
            };
            put(pair, &mut w.column, own.output);
        } else if c < delays || c == d.size() {
            let target = c == d.size();
            let terms = if target { &d.held } else { &d.columns[c - nt] };
            if target {
                for i in 0..q {
                    let order = d.structure.orders[i];
                    let by = L::splat(-powers[order]);
                    let y = turned(value::<L>(w, k, i, m, denoised), order);
                    put((y.0 * by, y.1 * by), &mut w.column, i);
                }
            }
            for term in terms {
                let (at, sign) = match term.signal {
                    JointSignal::Output => (term.output, 1.0),
                    JointSignal::Path(s) => (q + s, -1.0),
                };
                let mut by = L::splat(sign * powers[term.power]);
                if target {
                    by = -(by * L::load(&w.coefficients[term.coefficient]));
                }
                let v = turned(value::<L>(w, k, at, m, denoised), term.power);
                let sum: Complex<L> = get(&w.column, term.output);
                let sum = (v.0.mul_add(by, sum.0), v.1.mul_add(by, sum.1));
                put(sum, &mut w.column, term.output);
            }
        } else {
            let s = d.free_delays[c - delays];
            let slope: Complex<L> = signal(&w.records[k], q + paths + s, m);
            for i in 0..q {
                if d.structure.numerators[i][s].is_some() {
                    let b: Complex<L> = get(&w.b, i * paths + s);
                    put(add(zero::<L>(), (-b.0, -b.1), slope), &mut w.column, i);
                }
            }
        }
        let rows = if left { &mut w.left } else { &mut w.right };
        whiten::<L>(&w.white, &w.column, q, rows, t * q * width + c, width);
    }
}
