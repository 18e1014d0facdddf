//! The loop of `awls` and `ml`: steps in lanes until none moves, with a way out for lanes whose pivots are small.

use super::design::Design;
use super::pass::{Factors, Weights, step};
use super::workspace::Workspace;
use super::{Options, awls, mend_step, ml, wls};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::threads::stopped;

/// How the next iterate is found and when it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rule {
    /// A single step with flat weights.
    Wls,
    /// Steps with the weights of the last estimate.
    Awls,
    /// Steps with these weights and the denoised output, halved where they lead up.
    Ml,
}

impl Rule {
    pub(crate) fn weights(self) -> Weights {
        if self == Rule::Wls { Weights::Flat } else { Weights::Adapted }
    }

    pub(crate) fn factors(self) -> Factors {
        if self == Rule::Ml { Factors::Instrument } else { Factors::Data }
    }

    /// Takes the step that was found, or part of the way back.
    #[inline(always)]
    pub(crate) fn take<L: Lanes>(self, w: &mut impl Iterates, limit: L) {
        match self {
            Rule::Wls => wls::take::<L>(w),
            Rule::Awls => awls::take::<L>(w, limit),
            Rule::Ml => ml::take::<L>(w, limit),
        }
    }
}

/// Iterates the active lanes, at most `maxiter` times. Lanes that are not active keep their bits.
///
/// Masks, here and in the rules, are 1 in the lanes they mean and 0 in others.
pub(crate) fn iterate(isa: Isa, d: &Design, w: &mut Workspace, rule: Rule, o: &Options) {
    let left = if rule == Rule::Wls { 1 } else { o.maxiter };
    let mut run = Run { rule, left, limit: o.tol * o.tol, mended: false };
    // All steps in one call; it comes back early where a lane needs orthogonal factors.
    while !isa.run(Iteration { design: d, space: w, run: &mut run }) {
        mend_step(d, w, rule.weights(), rule.factors());
        run.mended = true;
    }
}

/// Where an iteration stands.
struct Run {
    rule: Rule,
    left: usize,
    limit: f64,
    /// The step that waits was mended: take it as it is.
    mended: bool,
}

struct Iteration<'a> {
    design: &'a Design,
    space: &'a mut Workspace,
    run: &'a mut Run,
}

impl Kernel for Iteration<'_> {
    /// Whether it came to its end.
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Iteration { design, space: w, run } = self;
        let limit = L::splat(run.limit);
        while run.left > 0 && L::load(&w.progress.active).any() && !stopped() {
            if !run.mended {
                step::<L>(design, w, run.rule.weights(), run.rule.factors());
                if unsound::<L>(&w.progress, &w.trusted).any() {
                    return false;
                }
            }
            run.mended = false;
            run.left -= 1;
            if run.rule != Rule::Wls {
                (L::load(&w.progress.nit) + L::load(&w.progress.active)).store(&mut w.progress.nit);
            }
            run.rule.take::<L>(w, limit);
        }
        true
    }
}

/// Where eight replicates stand, a number a lane.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Progress {
    /// 1 in lanes that still iterate, else 0.
    pub active: Wide,
    /// Iterations after the start.
    pub nit: Wide,
    /// Cost at the current iterate, and the lowest so far.
    pub cost: Wide,
    pub best: Wide,
    /// Largest squared change of a parameter in the last step, as its effect relative to the largest
    /// term; that of the step before.
    pub moved: Wide,
    pub last_move: Wide,
    /// Steps halved in a row.
    pub halvings: Wide,
}

impl Progress {
    /// Nothing known yet: the live lanes iterate, the others do not.
    pub fn begin(&mut self, live: [bool; LANES]) {
        self.nit = Wide::ZERO;
        self.again(Wide(live.map(f64::from)));
    }

    /// These lanes iterate anew from where they stand.
    pub fn again(&mut self, lanes: Wide) {
        self.active = lanes;
        self.best = Wide::splat(f64::INFINITY);
        self.last_move = Wide::splat(f64::INFINITY);
        self.halvings = Wide::ZERO;
    }
}

/// What holds iterates of eight replicates: the current one, where a step leads, the best so far.
pub(crate) trait Iterates {
    /// Where the replicates stand.
    fn progress(&mut self) -> &mut Progress;
    /// Makes the next iterate the current one in the lanes `of`.
    fn advance<L: Lanes>(&mut self, of: L);
    /// Remembers the current iterate as the best so far in the lanes `of`.
    fn keep<L: Lanes>(&mut self, of: L);
    /// Moves the current iterate half way back to the best so far in the lanes `of`.
    fn halve<L: Lanes>(&mut self, of: L);
}

/// Active lanes whose step small pivots spoiled.
#[inline(always)]
pub(crate) fn unsound<L: Lanes>(progress: &Progress, trusted: &Wide) -> L {
    let (active, trusted) = (L::load(&progress.active), L::load(trusted));
    // A step that is not finite shows as a move that is not.
    let sound = L::load(&progress.moved).select_lt(L::splat(f64::INFINITY), trusted, L::splat(0.0));
    active - active * sound
}

/// a ≤ b as a mask; true where either is no number.
#[inline(always)]
pub(crate) fn at_most<L: Lanes>(a: L, b: L) -> L {
    b.select_lt(a, L::splat(0.0), L::splat(1.0))
}

/// Lanes that moved by no more than the limit, or are lost: from a step that is not finite, orthogonal
/// factors or not, no way leads back.
#[inline(always)]
pub(crate) fn settled<L: Lanes>(progress: &Progress, limit: L) -> L {
    let moved = L::load(&progress.moved);
    let lost = moved.select_lt(L::splat(f64::INFINITY), L::splat(0.0), L::splat(1.0));
    at_most(moved, limit).max(lost)
}

impl Iterates for Workspace {
    #[inline(always)]
    fn progress(&mut self) -> &mut Progress {
        &mut self.progress
    }

    #[inline(always)]
    fn advance<L: Lanes>(&mut self, of: L) {
        choose(of, &self.next, &mut self.theta);
        for r in &mut self.records {
            choose(of, &r.next_transient, &mut r.transient);
        }
    }

    #[inline(always)]
    fn keep<L: Lanes>(&mut self, of: L) {
        choose(of, &self.theta, &mut self.best_theta);
        for r in &mut self.records {
            choose(of, &r.transient, &mut r.best_transient);
        }
    }

    #[inline(always)]
    fn halve<L: Lanes>(&mut self, of: L) {
        half_way(of, &self.best_theta, &mut self.theta);
        for r in &mut self.records {
            half_way(of, &r.best_transient, &mut r.transient);
        }
    }
}

#[inline(always)]
pub(crate) fn choose<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        of.choose(L::load(from), L::load(to)).store(to);
    }
}

#[inline(always)]
pub(crate) fn half_way<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        let here = L::load(to);
        of.choose(L::splat(0.5) * (here + L::load(from)), here).store(to);
    }
}
