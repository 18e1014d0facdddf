//! The loop of `awls` and `ml`: steps in lanes until none moves, with a way out for lanes whose pivots are small.

use super::design::Design;
use super::pass::{Factors, Weights, step};
use super::workspace::Workspace;
use super::{Options, awls, mend_step, ml, wls};
use crate::simd::{Isa, Kernel, Lanes, Wide};

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
    fn weights(self) -> Weights {
        if self == Rule::Wls { Weights::Flat } else { Weights::Adapted }
    }

    fn factors(self) -> Factors {
        if self == Rule::Ml { Factors::Instrument } else { Factors::Data }
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
        while run.left > 0 && L::load(&w.active).any() {
            if !run.mended {
                step::<L>(design, w, run.rule.weights(), run.rule.factors());
                if unsound::<L>(w).any() {
                    return false;
                }
            }
            run.mended = false;
            run.left -= 1;
            if run.rule != Rule::Wls {
                (L::load(&w.nit) + L::load(&w.active)).store(&mut w.nit);
            }
            match run.rule {
                Rule::Wls => wls::take::<L>(w),
                Rule::Awls => awls::take::<L>(w, limit),
                Rule::Ml => ml::take::<L>(w, limit),
            }
        }
        true
    }
}

/// Active lanes whose step small pivots spoiled.
#[inline(always)]
fn unsound<L: Lanes>(w: &Workspace) -> L {
    let (active, trusted) = (L::load(&w.active), L::load(&w.trusted));
    // A step that is not finite shows as a move that is not.
    let sound = L::load(&w.moved).select_lt(L::splat(f64::INFINITY), trusted, L::splat(0.0));
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
pub(crate) fn settled<L: Lanes>(w: &Workspace, limit: L) -> L {
    let moved = L::load(&w.moved);
    let lost = moved.select_lt(L::splat(f64::INFINITY), L::splat(0.0), L::splat(1.0));
    at_most(moved, limit).max(lost)
}

impl Workspace {
    /// Makes the next iterate the current one in the lanes `of`.
    #[inline(always)]
    pub(crate) fn advance<L: Lanes>(&mut self, of: L) {
        choose(of, &self.next, &mut self.theta);
        for r in &mut self.records {
            choose(of, &r.next_transient, &mut r.transient);
        }
    }

    /// Remembers the current iterate as the best so far in the lanes `of`.
    #[inline(always)]
    pub(crate) fn keep<L: Lanes>(&mut self, of: L) {
        choose(of, &self.theta, &mut self.best_theta);
        for r in &mut self.records {
            choose(of, &r.transient, &mut r.best_transient);
        }
    }

    /// Moves the current iterate half way back to the best so far in the lanes `of`.
    #[inline(always)]
    pub(crate) fn halve<L: Lanes>(&mut self, of: L) {
        half_way(of, &self.best_theta, &mut self.theta);
        for r in &mut self.records {
            half_way(of, &r.best_transient, &mut r.transient);
        }
    }
}

#[inline(always)]
fn choose<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        of.choose(L::load(from), L::load(to)).store(to);
    }
}

#[inline(always)]
fn half_way<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        let here = L::load(to);
        of.choose(L::splat(0.5) * (here + L::load(from)), here).store(to);
    }
}
