//! One pass over the lines: weights, denoised output, sums, the small system, the next iterate. Eight replicates at once.

use super::design::Design;
use super::sums::Product;
use super::workspace::{RecordSpace, Workspace};
use crate::covariance::{polynomial, variance};
use crate::linalg::lanes::{eliminate, substitute};
use crate::modulation::Signal;
use crate::simd::{Kernel, Lanes, Wide};
use std::ops::Range;

/// What the lines are weighted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weights {
    /// S = 1: the covariance of equation noise.
    Flat,
    /// S = |A|² at the current θ.
    Adapted,
}

/// Which output the columns of θ are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Factors {
    /// The data on both sides.
    Data,
    /// The denoised output on the left, the data on the right: the step of `ml`.
    Instrument,
    /// The denoised output on both sides: the information at the estimate.
    Denoised,
}

/// Forms the system at the current θ and T, and solves it for the next ones.
pub(crate) struct Step<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
    pub weights: Weights,
    pub factors: Factors,
}

impl Kernel for Step<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        step::<L>(self.design, self.space, self.weights, self.factors);
    }
}

/// Prepares what does not depend on θ: products of the data for records of a single tile.
pub(crate) struct Prepare<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
}

impl Kernel for Prepare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let d = self.design;
        for r in &mut self.space.records {
            if r.lines <= d.tile {
                data_products::<L>(d, 0..r.lines, r, None);
            }
        }
    }
}

/// Splits lines into tiles.
pub(crate) fn tiles(lines: usize, tile: usize) -> impl Iterator<Item = Range<usize>> {
    (0..lines).step_by(tile.max(1)).map(move |from| from..(from + tile).min(lines))
}

#[inline(always)]
fn step<L: Lanes>(d: &Design, w: &mut Workspace, weights: Weights, factors: Factors) {
    let (p, nt, size) = (d.parameters(), d.transient, d.size());
    let symmetric = factors != Factors::Instrument;
    let width = p + 1;
    w.global[..p * width].fill(Wide::ZERO);
    w.column_size.fill(Wide::ZERO);
    w.trusted = Wide::splat(1.0);
    let mut cost = L::splat(0.0);
    let mut target_size = L::splat(0.0);
    for k in 0..w.records.len() {
        let (c, t) = record_system::<L>(d, w, k, weights, factors, false);
        cost = cost + c;
        target_size = target_size + t;
        let r = &mut w.records[k];
        eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, symmetric, &mut w.trusted);
        add_parameter_block::<L>(&r.matrix, nt, size, &mut w.global, symmetric);
        for i in 0..p {
            let sum = &mut w.column_size[i];
            (L::load(sum) + L::load(&w.diagonal[nt + i])).store(sum);
        }
    }
    cost.store(&mut w.cost);
    target_size.store(&mut w.target_size);
    eliminate::<L>(&mut w.global, p, 0..p, &w.column_size, symmetric, &mut w.trusted);
    substitute::<L>(&w.global, p, 0..p, &mut w.next);
    // Relative to the largest term of the equation: on a line where A vanishes the leading one may be nothing.
    let mut largest = target_size;
    let mut moved = L::splat(0.0);
    for ((from, to), column) in w.theta.iter().zip(&w.next).zip(&w.column_size) {
        let change = L::load(to) - L::load(from);
        // The maximum that lets NaN pass: it must not read as settled.
        let effect = change * change * L::load(column).abs();
        moved = effect.select_lt(moved, moved, effect);
        let own = L::load(from) * L::load(from) * L::load(column).abs();
        largest = own.select_lt(largest, largest, own);
    }
    (moved / largest).store(&mut w.moved);
    for r in &mut w.records {
        w.unknowns[nt..size].copy_from_slice(&w.next);
        substitute::<L>(&r.matrix, size, 0..nt, &mut w.unknowns);
        r.next_transient.copy_from_slice(&w.unknowns[..nt]);
    }
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

/// The system [T, θ | target] of record `k` at the current θ and T, in its matrix; its diagonal in
/// `diagonal`. Returns cost (where the residual is asked for or needed) and Σ w|γ₀|².
#[inline(always)]
pub(crate) fn record_system<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    weights: Weights,
    factors: Factors,
    residual: bool,
) -> (L, L) {
    let size = d.size();
    let plan = if factors == Factors::Instrument { &d.instrument } else { &d.symmetric };
    let mut cost = L::splat(0.0);
    let mut target_size = L::splat(0.0);
    w.sums[..plan.count].fill(Wide::ZERO);
    for range in tiles(w.records[k].limit, d.tile) {
        let (c, t) =
            lines::<L>(d, w, k, range.clone(), weights, residual || factors != Factors::Data);
        cost = cost + c;
        target_size = target_size + t;
        let r = &mut w.records[k];
        match factors {
            Factors::Denoised => {
                data_products::<L>(d, range.clone(), r, Some((&w.hat_re, &w.hat_im)))
            }
            _ if r.lines > d.tile => data_products::<L>(d, range.clone(), r, None),
            _ => {}
        }
        if factors == Factors::Instrument {
            denoised_products::<L>(d, range.clone(), r, &w.hat_re, &w.hat_im);
        }
        plan.accumulate::<L>(&r.products, &w.powers, d.tile, range.len(), &mut w.sums);
    }
    let r = &mut w.records[k];
    r.matrix.fill(Wide::ZERO);
    plan.assemble::<L>(&w.sums, &mut r.matrix);
    for i in 0..size {
        w.diagonal[i] = r.matrix[i * (size + 1) + i];
    }
    (cost, target_size)
}

/// Weights times powers of x on the lines of a tile; with `residual` also residual and denoised
/// output. Returns this tile's share of the cost and of Σ w|γ₀|².
#[inline(always)]
pub(crate) fn lines<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    range: Range<usize>,
    weights: Weights,
    residual: bool,
) -> (L, L) {
    let (rd, r) = (&d.records[k], &w.records[k]);
    let (n, nt) = (d.structure.order, d.transient);
    let theta = &w.theta[..];
    let denominator = &theta[..n];
    let mut cost = L::splat(0.0);
    let mut target_size = L::splat(0.0);
    for (i, m) in range.enumerate() {
        let x = rd.x[m];
        let weight = L::splat(rd.weight[m]);
        let (y_re, y_im) = (L::load(&r.re[m]), L::load(&r.im[m]));
        let flat = weights == Weights::Flat;
        let mut lambda = weight;
        if !flat || residual {
            let a = polynomial::<L>(1.0, denominator, x);
            let inverse = L::splat(1.0) / variance::<L>(a, denominator, rd.size_x[m]);
            if !flat {
                lambda = weight * inverse;
            }
            if residual {
                // r = AY − BU − T, and ŷ = y − r/A: the model's own response, transient included.
                let mut re = (-a.1).mul_add(y_im, a.0 * y_re);
                let mut im = a.1.mul_add(y_re, a.0 * y_im);
                let mut first = n;
                for (input, degree) in d.structure.numerators.iter().enumerate() {
                    let Some(degree) = degree else { continue };
                    let b = polynomial::<L>(0.0, &theta[first..=first + degree], x);
                    first += degree + 1;
                    let at = (1 + input) * r.lines + m;
                    let (u_re, u_im) = (L::load(&r.re[at]), L::load(&r.im[at]));
                    re = b.1.mul_add(u_im, (-b.0).mul_add(u_re, re));
                    im = (-b.1).mul_add(u_re, (-b.0).mul_add(u_im, im));
                }
                for (j, column) in d.columns[..nt].iter().enumerate() {
                    let t = L::load(&r.transient[j]);
                    let value = L::splat(rd.transient[m * nt + j]);
                    if column.phase % 2 == 0 {
                        re = value.mul_add(t, re);
                    } else {
                        im = value.mul_add(t, im);
                    }
                }
                cost = lambda.mul_add(re.mul_add(re, im * im), cost);
                re.store(&mut w.residual_re[i]);
                im.store(&mut w.residual_im[i]);
                let hat_re = y_re - a.0.mul_add(re, a.1 * im) * inverse;
                let hat_im = y_im - a.0.mul_add(im, -(a.1 * re)) * inverse;
                hat_re.store(&mut w.hat_re[i]);
                hat_im.store(&mut w.hat_im[i]);
            }
        }
        let mut power = if d.lowest_power < 0 { lambda * L::splat(1.0 / (x * x)) } else { lambda };
        let x = L::splat(x);
        for q in 0..d.powers {
            power.store(&mut w.powers[q * d.tile + i]);
            power = power * x;
        }
        let top = L::load(&w.powers[(d.powers - 1) * d.tile + i]);
        target_size = top.mul_add(y_re.mul_add(y_re, y_im * y_im), target_size);
    }
    (cost, target_size)
}

/// Products that involve only the data, or with `hat` standing for the output.
#[inline(always)]
pub(crate) fn data_products<L: Lanes>(
    d: &Design,
    range: Range<usize>,
    r: &mut RecordSpace,
    hat: Option<(&[Wide], &[Wide])>,
) {
    let RecordSpace { re, im, products, lines, .. } = r;
    let part =
        |at: usize| (&re[at + range.start..at + range.end], &im[at + range.start..at + range.end]);
    let pick = |s: Signal| match (s, hat) {
        (Signal::U(k), _) => part((1 + k) * *lines),
        (_, Some((re, im))) => (&re[..range.len()], &im[..range.len()]),
        _ => part(0),
    };
    for (k, p) in d.products.iter().enumerate() {
        if p.right == Signal::Denoised {
            continue;
        }
        let out = &mut products[k * d.tile..k * d.tile + range.len()];
        product::<L>(p, pick(p.left), pick(p.right), out);
    }
}

#[inline(always)]
fn denoised_products<L: Lanes>(
    d: &Design,
    range: Range<usize>,
    r: &mut RecordSpace,
    hat_re: &[Wide],
    hat_im: &[Wide],
) {
    for (k, p) in d.products.iter().enumerate() {
        if p.right != Signal::Denoised {
            continue;
        }
        let at = match p.left {
            Signal::U(k) => (1 + k) * r.lines,
            _ => 0,
        };
        let left = at + range.start..at + range.end;
        let left = (&r.re[left.clone()], &r.im[left]);
        let hat = (&hat_re[..range.len()], &hat_im[..range.len()]);
        let out = &mut r.products[k * d.tile..k * d.tile + range.len()];
        // The constant one stands on the left here; `product` has it on the right.
        if p.left == Signal::One {
            let swapped = Product { left: Signal::Denoised, right: Signal::One, ..*p };
            product::<L>(&swapped, hat, hat, out);
            if p.imaginary {
                for x in out {
                    (-L::load(x)).store(x);
                }
            }
        } else {
            product::<L>(p, left, hat, out);
        }
    }
}

/// Re or Im of conj(left)·right on each line.
#[inline(always)]
fn product<L: Lanes>(
    p: &Product,
    left: (&[Wide], &[Wide]),
    right: (&[Wide], &[Wide]),
    out: &mut [Wide],
) {
    for (i, x) in out.iter_mut().enumerate() {
        let value = if p.right == Signal::One {
            match (p.left == Signal::One, p.imaginary) {
                (true, _) => L::splat(1.0),
                (false, false) => L::load(&left.0[i]),
                (false, true) => -L::load(&left.1[i]),
            }
        } else {
            let (l, m) = (L::load(&left.0[i]), L::load(&left.1[i]));
            let (re, im) = (L::load(&right.0[i]), L::load(&right.1[i]));
            if p.imaginary { l.mul_add(im, -(m * re)) } else { l.mul_add(re, m * im) }
        };
        value.store(x);
    }
}
