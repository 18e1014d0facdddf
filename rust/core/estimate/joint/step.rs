//! The system of a joint problem and its solution: transients eliminated a record, bounds kept.

use super::design::JointDesign;
use super::rows::rows;
use super::tile::Rows;
use super::workspace::JointWorkspace;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::{add_parameter_block, copy, tiles};
use crate::linalg::lanes::{eliminate, substitute};
use crate::simd::{Lanes, Wide};

/// Columns that are summed at a time.
const BLOCK: usize = 4;

/// Forms the system at the current θ and T, and solves it for the next ones.
#[inline(always)]
pub(crate) fn step<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    weights: RowWeights,
    factors: LeftColumns,
    delays_held: bool,
) {
    let (p, nt, size) = (d.parameters(), d.transient.len(), d.size());
    L::splat(1.0).store(&mut w.trusted);
    clear::<L>(&mut w.global);
    clear::<L>(&mut w.column_size);
    L::splat(0.0).store(&mut w.target_size);
    let mut cost = L::splat(0.0);
    for k in 0..w.records.len() {
        cost = cost + record_system::<L>(d, w, k, weights, factors);
        for (sum, own) in w.column_size.iter_mut().zip(&w.diagonal[nt..size]) {
            (L::load(sum) + L::load(own)).store(sum);
        }
        let r = &mut w.records[k];
        eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, false, &mut w.trusted);
        add_parameter_block::<L>(&r.matrix, nt, size, &mut w.global, false);
    }
    cost.store(&mut w.progress.cost);
    solve_parameters::<L>(d, w, delays_held);
    for k in 0..w.records.len() {
        let JointWorkspace { records, iterates, unknowns, .. } = w;
        let (next, theta) = (&iterates.theta.next, &iterates.theta.now);
        copy::<L>(next, &mut unknowns[nt..size]);
        // Of a delay the system holds the change.
        for c in d.free.len()..p {
            (L::load(&next[c]) - L::load(&theta[c])).store(&mut unknowns[nt + c]);
        }
        substitute::<L>(&records[k].matrix, size, 0..nt, unknowns);
        copy::<L>(&unknowns[..nt], &mut iterates.transients[k].next);
    }
    let moved = w.iterates.theta.moved::<L>(&w.column_size, &w.target_size, d.free.len());
    moved.store(&mut w.progress.moved);
}

/// Solves the system in θ; what would leave its bounds is set on them, and the rest solved again.
#[inline(always)]
fn solve_parameters<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, delays_held: bool) {
    let p = d.parameters();
    clear::<L>(&mut w.pinned);
    let bounded = d.is_bounded();
    let delays = d.free.len()..p;
    for _ in 0..=p {
        copy::<L>(&w.global, &mut w.global_work);
        for k in 0..p {
            let held = delays_held && delays.contains(&k);
            if held {
                L::splat(1.0).store(&mut w.pinned[k]);
            }
            if held || bounded {
                pin::<L>(d, w, k, held);
            }
        }
        eliminate::<L>(&mut w.global_work, p, 0..p, &w.column_size, false, &mut w.trusted);
        substitute::<L>(&w.global_work, p, 0..p, &mut w.iterates.theta.next);
        // Of a delay the system gives the change.
        for k in delays.clone() {
            (L::load(&w.iterates.theta.next[k]) + L::load(&w.iterates.theta.now[k]))
                .store(&mut w.iterates.theta.next[k]);
        }
        if !bounded || !leaves::<L>(d, w) {
            break;
        }
        L::splat(1.0).store(&mut w.trusted);
    }
}

/// Whether any lane's solution left its bounds; those parameters are pinned.
#[inline(always)]
fn leaves<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace) -> bool {
    let mut any = false;
    for k in 0..d.parameters() {
        let (low, high) = d.parameter_bounds(k);
        let value = L::load(&w.iterates.theta.next[k]);
        let slack = 1e-12 * (low.abs().min(high.abs()) + f64::MIN_POSITIVE);
        let below = value.select_lt(L::splat(low - slack), L::splat(1.0), L::splat(0.0));
        let above = L::splat(high + slack).select_lt(value, L::splat(1.0), L::splat(0.0));
        let pinned = L::load(&w.pinned[k]);
        let fresh = below.max(above) * (L::splat(1.0) - pinned) * L::load(&w.progress.active);
        any |= fresh.any();
        pinned.max(fresh).store(&mut w.pinned[k]);
    }
    any
}

/// In the lanes where parameter `k` is pinned its row says that it is its bound (a held delay: no change).
#[inline(always)]
fn pin<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, k: usize, held: bool) {
    let p = d.parameters();
    let on = L::load(&w.pinned[k]);
    if !on.any() {
        return;
    }
    let (low, high) = d.parameter_bounds(k);
    let mut bound = L::splat(0.0);
    if !held {
        let wanted = L::load(&w.iterates.theta.next[k]);
        bound = wanted.select_lt(L::splat(low), L::splat(low), wanted);
        bound = L::splat(high).select_lt(bound, L::splat(high), bound);
        if k >= d.free.len() {
            bound = bound - L::load(&w.iterates.theta.now[k]);
        }
    }
    let off = L::splat(1.0) - on;
    for i in 0..p {
        let at = i * (p + 1);
        let entry = on * L::load(&w.global_work[at + k]);
        let right = L::load(&w.global_work[at + p]);
        (-entry).mul_add(bound, right).store(&mut w.global_work[at + p]);
        (L::load(&w.global_work[at + k]) - entry).store(&mut w.global_work[at + k]);
    }
    let size = L::load(&w.column_size[k]).abs();
    // Without a numerator a delay has no column.
    let size = L::splat(f64::MIN_POSITIVE).select_lt(size, size, L::splat(1.0));
    for j in 0..=p {
        let own = &mut w.global_work[k * (p + 1) + j];
        let value = if j == k {
            size
        } else if j == p {
            size * bound
        } else {
            L::splat(0.0)
        };
        off.mul_add(L::load(own), on * value).store(own);
    }
}

/// The system of record `k` at the current θ and T, in its matrix; its diagonal in `diagonal`. Returns the
/// cost, and adds to the size of the target.
#[inline(always)]
pub(crate) fn record_system<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    weights: RowWeights,
    factors: LeftColumns,
) -> L {
    let (q, size) = (d.outputs(), d.size());
    let width = size + 1;
    clear::<L>(&mut w.records[k].matrix);
    let mut cost = L::splat(0.0);
    let mut target = L::load(&w.target_size);
    for range in tiles(w.records[k].limit, d.tile) {
        rows::<L>(d, w, k, range.clone(), weights, factors, true);
        for (t, m) in range.clone().enumerate() {
            let weight = L::splat(d.records[k].weight[m]);
            for i in 0..q {
                let (re, im) = w.residual.get::<L>(t * q + i);
                cost = weight.mul_add(re.mul_add(re, im * im), cost);
                let (re, im) = w.right.get::<L>((t * q + i) * width + size);
                target = weight.mul_add(re.mul_add(re, im * im), target);
            }
        }
        scale_left::<L>(d, w, k, range.clone(), factors);
        accumulate::<L>(&w.left, &w.right, range.len() * q, size, &mut w.records[k].matrix);
    }
    target.store(&mut w.target_size);
    for i in 0..size {
        L::load(&w.records[k].matrix[i * width + i]).store(&mut w.diagonal[i]);
    }
    cost
}

/// The left factor times the weights of the lines; of the data itself where nothing is denoised.
#[inline(always)]
fn scale_left<L: Lanes>(
    d: &JointDesign,
    w: &mut JointWorkspace,
    k: usize,
    range: std::ops::Range<usize>,
    factors: LeftColumns,
) {
    let (q, width) = (d.outputs(), d.size() + 1);
    let JointWorkspace { left, right, .. } = w;
    let data = factors == LeftColumns::Data;
    for (t, m) in range.enumerate() {
        let weight = L::splat(d.records[k].weight[m]);
        for at in t * q * width..(t + 1) * q * width {
            let (re, im) = if data { right.get::<L>(at) } else { left.get::<L>(at) };
            left.set(at, (re * weight, im * weight));
        }
    }
}

/// matrix += Re(leftᴴ right) over rows.
#[inline(always)]
fn accumulate<L: Lanes>(left: &Rows, right: &Rows, count: usize, size: usize, matrix: &mut [Wide]) {
    let width = size + 1;
    let (all_re, all_im) = right.all.split_at(right.part);
    for a in 0..size {
        let mut from = 0;
        while from < width {
            let wide = (width - from).min(BLOCK);
            let mut acc = [L::splat(0.0); BLOCK];
            for b in 0..wide {
                acc[b] = L::load(&matrix[a * width + from + b]);
            }
            for row in 0..count {
                let (re, im) = left.get::<L>(row * width + a);
                let at = row * width + from;
                let (right_re, right_im) = (&all_re[at..at + wide], &all_im[at..at + wide]);
                for b in 0..wide {
                    acc[b] = re.mul_add(L::load(&right_re[b]), acc[b]);
                    acc[b] = im.mul_add(L::load(&right_im[b]), acc[b]);
                }
            }
            for b in 0..wide {
                acc[b].store(&mut matrix[a * width + from + b]);
            }
            from += wide;
        }
    }
}

/// Zeros.
#[inline(always)]
pub(crate) fn clear<L: Lanes>(all: &mut [Wide]) {
    for one in all {
        L::splat(0.0).store(one);
    }
}
