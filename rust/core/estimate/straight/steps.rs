//! The iteration of a small problem whose sizes are known when it is compiled: sums, system and iterate in registers.
//!
//! It does what `pass::step` and `iterate` do, operation by operation and to the bit.

use super::shape::{SUMS, Shape};
use super::solve::solve;
use super::sums::{Lines, Signals, accumulate, beside, prepare};
use super::tables::{StraightWorkspace, Tables};
use super::weights::weigh;
use crate::estimate::iterates::half_way;
use crate::estimate::rule::{ASK, Rule, Run};
use crate::estimate::workspace::Workspace;
use crate::simd::{Kernel, Lanes, Wide};
use crate::threads::stopped;

/// Iterates the active lanes, as long as all pivots may be trusted.
pub(super) struct Steps<'a, const N: usize, const I: usize, const Z: usize, const S: usize> {
    pub tables: &'a Tables,
    pub space: &'a mut Workspace,
    pub run: &'a mut Run,
}

/// What a step finds.
struct Step<L, const S: usize> {
    next: [L; S],
    trusted: L,
    moved: L,
    cost: L,
}

impl<const N: usize, const I: usize, const Z: usize, const S: usize> Kernel
    for Steps<'_, N, I, Z, S>
{
    /// Whether it came to its end; else the next step waits for the general path.
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        if !L::HINTS {
            return false;
        }
        let Steps { tables, space, run } = self;
        match run.rule {
            Rule::Ml => iterate::<L, N, I, Z, S, true>(tables, space, run),
            Rule::Wls | Rule::Awls => iterate::<L, N, I, Z, S, false>(tables, space, run),
        }
    }
}

#[inline(always)]
fn iterate<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const ML: bool,
>(
    tables: &Tables,
    w: &mut Workspace,
    run: &mut Run,
) -> bool {
    let Workspace { records, iterates, progress, weights, straight, .. } = w;
    let Workspace { hat_re, hat_im, residual_re, residual_im, .. } = w;
    let r = &mut records[0];
    let lines = r.limit;
    let signals = Signals { re: &r.re, im: &r.im, lines: r.lines };
    prepare::<L, N, I, Z>(tables, straight, &signals);
    let mut on = Lines {
        weights: &mut weights[..lines],
        hat: (&mut hat_re[..lines], &mut hat_im[..lines]),
        residual: (&mut residual_re[..lines], &mut residual_im[..lines]),
    };
    let (theta, transient) = (&mut iterates.theta, &mut iterates.transients[0]);
    let mut now = read::<L, S, N>(&transient.now, &theta.now);
    let mut best = now;
    if ML {
        best = read::<L, S, N>(&transient.best, &theta.best);
    }
    let mut at = progress.load::<L>();
    let limit = L::splat(run.limit);
    let mut sound = true;
    while run.left > 0 && at.active.any() {
        if run.left.is_multiple_of(ASK) && stopped() {
            break;
        }
        let flat = run.rule == Rule::Wls;
        let found = step::<L, N, I, Z, S, ML>(tables, straight, &signals, &mut on, &now, flat);
        (at.moved, at.cost) = (found.moved, found.cost);
        if at.unsound(found.trusted).any() {
            sound = false;
            break;
        }
        run.left -= 1;
        if !flat {
            at.nit = at.nit + at.active;
        }
        let verdict = run.rule.decide(&mut at, limit);
        for k in 0..S {
            if ML {
                best[k] = verdict.taken.choose(now[k], best[k]);
                now[k] = half_way(verdict.halved, best[k], now[k]);
            }
            now[k] = verdict.taken.choose(found.next[k], now[k]);
        }
    }
    write::<L, S, N>(&now, &mut transient.now, &mut theta.now);
    if ML {
        write::<L, S, N>(&best, &mut transient.best, &mut theta.best);
    }
    at.store(progress);
    sound
}

#[inline(always)]
pub(super) fn read<L: Lanes, const S: usize, const N: usize>(
    transient: &[Wide],
    theta: &[Wide],
) -> [L; S] {
    let mut all = [L::splat(0.0); S];
    for k in 0..S {
        all[k] = L::load(if k < N { &transient[k] } else { &theta[k - N] });
    }
    all
}

#[inline(always)]
fn write<L: Lanes, const S: usize, const N: usize>(
    all: &[L; S],
    transient: &mut [Wide],
    theta: &mut [Wide],
) {
    for k in 0..S {
        all[k].store(if k < N { &mut transient[k] } else { &mut theta[k - N] });
    }
}

/// The next iterate by the system at this one.
#[inline(always)]
fn step<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const ML: bool,
>(
    tables: &Tables,
    space: &mut StraightWorkspace,
    signals: &Signals<'_>,
    on: &mut Lines<'_>,
    now: &[L; S],
    flat: bool,
) -> Step<L, S> {
    let table = const { &Shape::<N, I, Z>::TABLE };
    let mut cost = L::splat(0.0);
    if flat {
        for (to, weight) in on.weights.iter_mut().zip(&tables.weight) {
            L::splat(*weight).store(to);
        }
    } else {
        cost = weigh::<L, N, I, Z, S, false, ML>(tables, signals, on, now);
    }
    let StraightWorkspace { own, shared, sums, .. } = space;
    let sums = &mut sums[..SUMS];
    // Of the output with itself `ml` needs the size of the target alone.
    let first = if ML { table.target } else { 0 };
    accumulate::<L>(own, table.own, first, on.weights, &mut sums[first..table.own]);
    let with_shared = table.own + table.shared;
    accumulate::<L>(shared, table.shared, 0, on.weights, &mut sums[table.own..with_shared]);
    if ML {
        beside::<L, N, I, Z>(tables, signals, on, &mut sums[with_shared..]);
    }
    let solved = match ML {
        true => solve::<L, N, I, Z, S, false>(sums),
        false => solve::<L, N, I, Z, S, true>(sums),
    };
    let mut largest = L::load(&sums[table.target]);
    let mut moved = L::splat(0.0);
    for k in N..S {
        let size = solved.diagonal[k].abs();
        let change = solved.unknowns[k] - now[k];
        // The maximum that lets NaN pass: it must not read as settled.
        let effect = change * change * size;
        moved = effect.select_lt(moved, moved, effect);
        let own = now[k] * now[k] * size;
        largest = own.select_lt(largest, largest, own);
    }
    Step { next: solved.unknowns, trusted: solved.trusted, moved: moved / largest, cost }
}
