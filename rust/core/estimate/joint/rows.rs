//! Whitened rows of Γ, J and the residual, line by line, for eight replicates.

use super::complex::{Complex, add, conj, get, put, zero};
use super::design::JointDesign;
use super::line_noise::{
    full_whitener, is_noisy, output_covariance, path_covariance, plain_whitener,
};
use super::structure::JointSignal;
use super::tile::{Across, Rows};
use super::workspace::{JointRecordWorkspace, JointWorkspace};
use crate::covariance::{polynomial, variance};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::simd::{Lanes, Wide};
use std::ops::Range;

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

/// Writes the rows of the lines `range` of record `k` (of single records: groups of eight): `right` of the data,
/// `left` as `factors` says (with [`LeftColumns::Data`] it stays as it is: `right` serves), and the residual.
/// `whole`: W holds Σ, too. Rows of single records are multiplied by the roots of their weights.
#[inline(always)]
pub(crate) fn rows<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    range: Range<usize>,
    weights: RowWeights,
    factors: LeftColumns,
    whole: bool,
) {
    for (t, m) in range.enumerate() {
        line::<L>(d, w, k, m, t, weights, factors, whole);
    }
}

/// A signal's coefficient on line m.
#[inline(always)]
fn signal<L: Lanes>(r: &JointRecordWorkspace, at: usize, m: usize) -> Complex<L> {
    (L::load(&r.re[at * r.lines + m]), L::load(&r.im[at * r.lines + m]))
}

/// Rows of line `m`, at place `t` of the tile.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn line<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    m: usize,
    t: usize,
    weights: RowWeights,
    factors: LeftColumns,
    whole: bool,
) {
    let (q, paths) = (d.outputs(), d.paths());
    let rd = &d.records[k];
    let across = w.across;
    let table = |of: &[f64], row: usize| across.load::<L>(of, rd.stride(), row, m);
    let size_x = table(&rd.size_x, 0);
    polynomials::<L>(d, w, table(&rd.x, 0));
    let flat = weights == RowWeights::Flat;
    let inputs_noisy = d.noise.inputs.is_some() && !flat;
    if inputs_noisy {
        full_whitener::<L>(d, w, k, m);
    } else {
        plain_whitener::<L>(d, w, k, m, flat, whole);
    }

    // Residuals before whitening, in `column`.
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
                let (value, by) = (table(&rd.transient, j), L::load(&coefficients[j]));
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
                let square = variance::<L>(a, &w.coefficients[from..from + order], size_x);
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
    if across == Across::Lines && (w.beyond || rd.uneven.is_none() || flat) {
        let root = match w.beyond {
            true => table(&rd.weight, 0).sqrt(),
            false => table(&rd.root_weight, 0),
        };
        for at in 0..q * q {
            let own: Complex<L> = get(&w.white, at);
            put((own.0 * root, own.1 * root), &mut w.white, at);
        }
    }
    whiten::<L>(&w.white, &w.column, 0..q, (&mut w.residual, 0), t);
    columns::<L>(d, w, k, m, t, factors == LeftColumns::Denoised, false);
    if factors != LeftColumns::Data {
        columns::<L>(d, w, k, m, t, true, true);
    }
}

/// A_i and B_ik at s = ix.
#[inline(always)]
fn polynomials<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, x: L) {
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

/// Denoised outputs and inputs into `hat`, from the residual in `column`: v − V L* S⁻¹ r.
#[inline(always)]
fn smooth<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, k: usize, m: usize) {
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
            if !is_noisy(d, s, v) {
                continue;
            }
            let own = path_covariance::<L>(d, w, k, m, s, v);
            for j in 0..q {
                if d.structure.numerators[j][v].is_some() {
                    let b: Complex<L> = get(&w.b, j * paths + v);
                    let b = (b.0 * own, -(b.1 * own));
                    value = add(value, b, get(&w.back, j));
                }
            }
        }
        put(value, &mut w.hat, q + s);
    }
}

/// W times a vector, to a column of the rows of a line: of the outputs `of` alone where W is diagonal.
#[inline(always)]
fn whiten<L: Lanes>(
    white: &[Vec<Wide>; 2],
    column: &[Vec<Wide>; 2],
    of: Range<usize>,
    (to, c): (&mut Rows, usize),
    t: usize,
) {
    let q = of.end;
    for i in of {
        let mut sum = zero::<L>();
        for j in 0..=i {
            sum = add(sum, get(white, i * q + j), get(column, j));
        }
        to.set(to.at(i, c, t), sum);
    }
}

/// A signal's coefficient as measured or denoised.
#[inline(always)]
fn value<L: Lanes>(
    w: &JointWorkspace,
    k: usize,
    at: usize,
    m: usize,
    denoised: bool,
) -> Complex<L> {
    if denoised { get(&w.hat, at) } else { signal(&w.records[k], at, m) }
}

/// All columns of a line and the target (with a minus, as the right side of the system), whitened. On the left
/// stand those of the right but what denoising changes; the target is not needed there.
#[inline(always)]
fn columns<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    m: usize,
    t: usize,
    denoised: bool,
    left: bool,
) {
    let q = d.outputs();
    let width = d.size() + 1;
    for c in 0..if left { width - 1 } else { width } {
        let reach = &d.reach[c];
        if left && !d.denoised[c] {
            let JointWorkspace { left, right, .. } = w;
            for i in if w.apart { &reach[..] } else { &d.reach[width - 1] } {
                let at = right.at(*i, c, t);
                left.set(at, right.get::<L>(at));
            }
            continue;
        }
        column::<L>(d, w, k, m, c, denoised);
        let JointWorkspace { white, column, left: lefts, right, .. } = w;
        let rows = if left { lefts } else { right };
        if w.apart {
            for i in reach {
                let sum = add(zero::<L>(), get(white, i * q + i), get(column, *i));
                rows.set(rows.at(*i, c, t), sum);
            }
        } else {
            whiten::<L>(white, column, 0..q, (rows, c), t);
        }
    }
}

/// Column `c` of a line before whitening, into `column`.
#[inline(always)]
fn column<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    m: usize,
    c: usize,
    denoised: bool,
) {
    let (q, paths, nt) = (d.outputs(), d.paths(), d.transient.len());
    let (rd, across) = (&d.records[k], w.across);
    let table = |of: &[f64], row: usize| across.load::<L>(of, rd.stride(), row, m);
    let delays = nt + d.free.len();
    for i in 0..q {
        put(zero::<L>(), &mut w.column, i);
    }
    if c < nt {
        let own = &d.transient[c];
        let value = table(&rd.transient, c);
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
                let by = -table(&rd.powers, order);
                let y = turned(value::<L>(w, k, i, m, denoised), order);
                put((y.0 * by, y.1 * by), &mut w.column, i);
            }
        }
        for term in terms {
            let by = table(&rd.powers, term.power);
            let (at, mut by) = match term.signal {
                JointSignal::Output => (term.output, by),
                JointSignal::Path(s) => (q + s, -by),
            };
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
}
