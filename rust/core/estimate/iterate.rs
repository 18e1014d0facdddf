//! The loop of `awls` and `ml`: steps in lanes until none moves, with a way out for lanes whose pivots are small.

use super::design::Design;
use super::iterates::Move;
use super::normal_equations::{LeftColumns, RowWeights};
use super::options::Options;
use super::pass::step;
use super::rule::{ASK, Rule, Run};
use super::workspace::Workspace;
use super::{pass, qr_step, straight};
use crate::simd::{Isa, Kernel, LANES, Lanes};
use crate::threads::stopped;

/// Iterates the active lanes, at most `maxiter` times. Lanes that are not active keep their bits.
///
/// Masks, here and in the rules, are 1 in the lanes they mean and 0 in others.
pub(crate) fn iterate(isa: Isa, d: &Design, w: &mut Workspace, rule: Rule, o: &Options) {
    let left = if rule == Rule::Wls { 1 } else { o.maxiter };
    let mut run = Run { rule, left, limit: o.tol * o.tol, mended: false };
    // All steps in one call; it comes back early where a lane needs the general path, and that where one needs
    // orthogonal factors.
    if straight::iterate(isa, d, w, &mut run) {
        return;
    }
    pass::prepare(isa, d, w);
    while !isa.run(Iteration { design: d, space: w, run: &mut run }) {
        mend_step(isa, d, w, rule.weights(), rule.factors());
        run.mended = true;
    }
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
        while run.left > 0 && L::load(&w.progress.active).any() {
            // Steps are short beside the question.
            if run.left.is_multiple_of(ASK) && stopped() {
                break;
            }
            if !run.mended {
                step::<L>(design, w, run.rule.weights(), run.rule.factors());
                if w.progress.load::<L>().unsound(L::load(&w.trusted)).any() {
                    return false;
                }
            }
            run.mended = false;
            run.left -= 1;
            if run.rule != Rule::Wls {
                (L::load(&w.progress.nit) + L::load(&w.progress.active)).store(&mut w.progress.nit);
            }
            run.rule.take::<L>(&mut w.iterates, &mut w.progress, limit);
        }
        true
    }
}

/// Replaces steps that small pivots spoiled by steps from orthogonal factors.
fn mend_step(isa: Isa, d: &Design, w: &mut Workspace, weights: RowWeights, factors: LeftColumns) {
    let spoiled = w.progress.spoiled(&w.trusted);
    for lane in (0..LANES).filter(|k| spoiled[*k]) {
        let at = qr_step::Place { lane, weights, factors };
        let full = w.qr.solve(d, &w.records, &mut w.iterates, at);
        w.dependent[lane] = !full;
        if !full && weights == RowWeights::Flat {
            // Dependent columns in the start: nothing to iterate from.
            w.progress.active.0[lane] = 0.0;
        }
    }
    isa.run(Move {
        theta: &w.iterates.theta,
        column_size: &w.column_size,
        target_size: &w.target_size,
        terms: d.parameters(),
        moved: &mut w.progress.moved,
    });
}
