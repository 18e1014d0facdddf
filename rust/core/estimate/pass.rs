//! One pass over the lines: weights, denoised output, sums, the small system, the next iterate. Eight replicates at once.

use super::design::Design;
use super::normal_equations::{LeftColumns, RowWeights};
use super::sums::{Data, Model};
use super::workspace::Workspace;
use crate::covariance::{polynomial, variance};
use crate::linalg::lanes::{System, eliminate, substitute};
use crate::simd::{Isa, Kernel, Lanes, Wide};
use std::ops::Range;

/// Prepares what does not depend on θ, where it is not there: products of the data for records of a single tile.
pub(crate) fn prepare(isa: Isa, design: &Design, space: &mut Workspace) {
    if !space.prepared {
        isa.run(Prepare { design, space });
    }
}

struct Prepare<'a> {
    design: &'a Design,
    space: &'a mut Workspace,
}

impl Kernel for Prepare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let d = self.design;
        for (r, rd) in self.space.records.iter_mut().zip(&d.records) {
            if r.lines <= d.tile {
                let data = if r.inputs_ready { Data::Outputs } else { Data::All };
                d.products.write::<L>(r, 0..rd.x.len(), &rd.powers, data, None);
                r.inputs_ready = true;
            }
        }
        self.space.prepared = true;
    }
}

/// Splits lines into tiles.
pub(crate) fn tiles(lines: usize, tile: usize) -> impl Iterator<Item = Range<usize>> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let range = from..lines.min(from + tile.max(1));
        from = range.end;
        (!range.is_empty()).then_some(range)
    })
}

/// Copies in registers: calls of memcpy cost more than the few numbers of a small problem.
#[inline(always)]
pub(crate) fn copy<L: Lanes>(from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        L::load(from).store(to);
    }
}

/// Zeros, likewise.
#[inline(always)]
fn clear<L: Lanes>(all: &mut [Wide]) {
    for one in all {
        L::splat(0.0).store(one);
    }
}

/// Forms the system at the current θ and T, and solves it for the next ones.
///
/// Of a single record all unknowns at once; of several, which share θ, each record's transient is
/// eliminated and the rest added.
#[inline(always)]
pub(crate) fn step<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    weights: RowWeights,
    factors: LeftColumns,
) {
    let (p, nt, size) = (d.parameters(), d.transient, d.size());
    let symmetric = factors != LeftColumns::Instrument;
    let single = w.records.len() == 1;
    L::splat(1.0).store(&mut w.trusted);
    if !single {
        clear::<L>(&mut w.global[..p * (p + 1)]);
        clear::<L>(&mut w.column_size[..p]);
    }
    let (mut cost, mut target_size) = (L::splat(0.0), L::splat(0.0));
    for k in 0..w.records.len() {
        cost = cost + record_sums::<L>(d, w, k, weights, factors, false);
        target_size = target_size + L::load(&w.sums[d.products.target]);
        let Workspace { sums, diagonal, trusted, .. } = w;
        let r = &mut w.records[k];
        system(d, sums, factors).assemble::<L>(&mut r.matrix, diagonal);
        if r.tie.active {
            r.tie.put_in::<L>(&mut r.matrix, diagonal, nt, symmetric);
        }
        if single {
            eliminate::<L>(&mut r.matrix, size, 0..size, diagonal, symmetric, trusted);
            substitute::<L>(&r.matrix, size, 0..size, &mut w.unknowns);
            copy::<L>(&w.diagonal[nt..size], &mut w.column_size);
        } else {
            for (sum, own) in w.column_size.iter_mut().zip(&w.diagonal[nt..size]) {
                (L::load(sum) + L::load(own)).store(sum);
            }
            eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, symmetric, &mut w.trusted);
            add_parameter_block::<L>(&r.matrix, nt, size, &mut w.global, symmetric);
        }
    }
    cost.store(&mut w.progress.cost);
    target_size.store(&mut w.target_size);
    if single {
        copy::<L>(&w.unknowns[nt..size], &mut w.iterates.theta.next);
    } else {
        eliminate::<L>(&mut w.global, p, 0..p, &w.column_size, symmetric, &mut w.trusted);
        substitute::<L>(&w.global, p, 0..p, &mut w.iterates.theta.next);
    }
    for (r, t) in w.records.iter().zip(&mut w.iterates.transients) {
        if !single {
            copy::<L>(&w.iterates.theta.next, &mut w.unknowns[nt..size]);
            substitute::<L>(&r.matrix, size, 0..nt, &mut w.unknowns);
        }
        copy::<L>(&w.unknowns[..nt], &mut t.next);
        if r.tie.active {
            r.tie.at::<L>(&w.iterates.theta.next, &mut t.next);
        }
    }
    let moved = w.iterates.theta.moved::<L>(&w.column_size, &w.target_size, p);
    moved.store(&mut w.progress.moved);
}

/// Adds the θ block of a record's eliminated system to the common one.
#[inline(always)]
pub(crate) fn add_parameter_block<L: Lanes>(
    matrix: &[Wide],
    nt: usize,
    size: usize,
    global: &mut [Wide],
    symmetric: bool,
) {
    let p = size - nt;
    for i in 0..p {
        for j in if symmetric { i } else { 0 }..=p {
            let sum = &mut global[i * (p + 1) + j];
            (L::load(sum) + L::load(&matrix[(nt + i) * (size + 1) + nt + j])).store(sum);
        }
    }
}

/// The system [T, θ | target] that sums make.
#[inline(always)]
fn system<'a>(d: &'a Design, sums: &'a [Wide], factors: LeftColumns) -> System<'a> {
    let symmetric = factors != LeftColumns::Instrument;
    let plan = if symmetric { &d.symmetric } else { &d.instrument };
    System { sums, entries: &plan.entries, size: d.size(), symmetric }
}

/// The system of record `k` at the current θ and T, in its matrix; its diagonal in `diagonal`.
/// Returns the cost.
#[inline(always)]
pub(crate) fn record_system<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    weights: RowWeights,
    factors: LeftColumns,
    residual: bool,
) -> L {
    let cost = record_sums::<L>(d, w, k, weights, factors, residual);
    let r = &mut w.records[k];
    system(d, &w.sums, factors).assemble::<L>(&mut r.matrix, &mut w.diagonal);
    if r.tie.active {
        let symmetric = factors != LeftColumns::Instrument;
        r.tie.put_in::<L>(&mut r.matrix, &mut w.diagonal, d.transient, symmetric);
    }
    cost
}

/// All sums that the system of record `k` is made of. Returns the cost, where the residual is asked for
/// or needed.
#[inline(always)]
fn record_sums<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    weights: RowWeights,
    factors: LeftColumns,
    residual: bool,
) -> L {
    let plan = if factors == LeftColumns::Instrument { &d.instrument } else { &d.symmetric };
    let residual = residual || factors != LeftColumns::Data;
    let mut cost = L::splat(0.0);
    for range in tiles(w.records[k].limit, d.tile) {
        let begins = range.start == 0;
        let own = lines::<L>(d, w, k, range.clone(), weights, residual);
        cost = cost + own;
        let r = &mut w.records[k];
        // Where a record is one tile, its data are prepared.
        let data = if r.lines > d.tile { Data::All } else { Data::Nothing };
        let hat =
            Model { re: &w.hat_re, im: &w.hat_im, replaces: factors == LeftColumns::Denoised };
        let model = if factors == LeftColumns::Data { None } else { Some(hat) };
        if data != Data::Nothing || model.is_some() {
            d.products.write::<L>(r, range.clone(), &d.records[k].powers, data, model);
        }
        d.products.accumulate::<L>(plan, r, &w.weights[..range.len()], begins, &mut w.sums);
    }
    cost
}

/// λ of the lines of a tile; with `residual` also residual and denoised output. Returns this tile's
/// share of the cost.
#[inline(always)]
pub(crate) fn lines<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    range: Range<usize>,
    weights: RowWeights,
    residual: bool,
) -> L {
    let rd = &d.records[k];
    let x = &rd.x[range.clone()];
    let part = x.len();
    let (size_x, weight) = (&rd.size_x[range.start..][..part], &rd.weight[range.start..][..part]);
    let lambda = &mut w.weights[..part];
    let flat = weights == RowWeights::Flat;
    if flat {
        for i in 0..part {
            L::splat(weight[i]).store(&mut lambda[i]);
        }
        if !residual {
            return L::splat(0.0);
        }
    }
    let denominator = &w.iterates.theta.now[..d.structure.order];
    let (a_re, a_im) = (&mut w.a_re[..part], &mut w.a_im[..part]);
    let inverse_square = &mut w.inverse_square[..part];
    for i in 0..part {
        let a = polynomial::<L>(true, denominator, L::splat(x[i]));
        let inverse = L::splat(1.0) / variance::<L>(a, denominator, L::splat(size_x[i]));
        if !flat {
            (L::splat(weight[i]) * inverse).store(&mut lambda[i]);
        }
        if residual {
            a.0.store(&mut a_re[i]);
            a.1.store(&mut a_im[i]);
            inverse.store(&mut inverse_square[i]);
        }
    }
    if residual { denoise::<L>(d, w, k, range) } else { L::splat(0.0) }
}

/// Residual r = AY − BU − T and denoised output ŷ = y − r/A, the model's own response with its
/// transient, on the lines of a tile. Returns Σ λ|r|².
#[inline(always)]
fn denoise<L: Lanes>(d: &Design, w: &mut Workspace, k: usize, range: Range<usize>) -> L {
    let (rd, r, transient) = (&d.records[k], &w.records[k], &w.iterates.transients[k].now);
    let x = &rd.x[range.clone()];
    let part = x.len();
    let (a_re, a_im) = (&w.a_re[..part], &w.a_im[..part]);
    let (re, im) = (&mut w.residual_re[..part], &mut w.residual_im[..part]);
    let (y_re, y_im) = (&r.re[range.start..][..part], &r.im[range.start..][..part]);
    for i in 0..part {
        let (a, b) = (L::load(&a_re[i]), L::load(&a_im[i]));
        let (p, q) = (L::load(&y_re[i]), L::load(&y_im[i]));
        (-b).mul_add(q, a * p).store(&mut re[i]);
        b.mul_add(p, a * q).store(&mut im[i]);
    }
    let mut first = d.structure.order;
    for (input, degree) in d.structure.numerators.iter().enumerate() {
        let Some(degree) = degree else { continue };
        let numerator = &w.iterates.theta.now[first..=first + degree];
        first += degree + 1;
        let at = (1 + input) * r.lines + range.start;
        let (u_re, u_im) = (&r.re[at..][..part], &r.im[at..][..part]);
        for i in 0..part {
            let b = polynomial::<L>(false, numerator, L::splat(x[i]));
            let (p, q) = (L::load(&u_re[i]), L::load(&u_im[i]));
            b.1.mul_add(q, (-b.0).mul_add(p, L::load(&re[i]))).store(&mut re[i]);
            (-b.1).mul_add(p, (-b.0).mul_add(q, L::load(&im[i]))).store(&mut im[i]);
        }
    }
    for (j, column) in d.columns[..d.transient].iter().enumerate() {
        let t = L::load(&transient[j]);
        let value = &rd.transient[j * rd.x.len() + range.start..][..part];
        let to = if column.phase % 2 == 0 { &mut *re } else { &mut *im };
        for i in 0..part {
            L::splat(value[i]).mul_add(t, L::load(&to[i])).store(&mut to[i]);
        }
    }
    let (lambda, inverse) = (&w.weights[..part], &w.inverse_square[..part]);
    let (hat_re, hat_im) = (&mut w.hat_re[..part], &mut w.hat_im[..part]);
    let mut cost = L::splat(0.0);
    for i in 0..part {
        let (a, b) = (L::load(&a_re[i]), L::load(&a_im[i]));
        let (p, q) = (L::load(&re[i]), L::load(&im[i]));
        let inverse = L::load(&inverse[i]);
        cost = L::load(&lambda[i]).mul_add(p.mul_add(p, q * q), cost);
        (L::load(&y_re[i]) - a.mul_add(p, b * q) * inverse).store(&mut hat_re[i]);
        (L::load(&y_im[i]) - a.mul_add(q, -(b * p)) * inverse).store(&mut hat_im[i]);
    }
    cost
}
