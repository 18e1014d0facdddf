//! Other starts for lanes that took many steps: the estimate on few lines, and regressions behind filters.
//!
//! From `wls` the right minimum is 5 to 10 steps away; a way that leads astray, into another minimum or nowhere, is
//! longer. Such a lane goes again, from the estimate on the lower lines that tell its unknowns, where noise rules less,
//! and after the longest ways from regressions behind eight filters. It keeps the best end. What other lanes do changes
//! no bit of it.

use super::again::Estimation;
use super::band::{CLOSE, MANY};
use super::completion::{complete, status};
use super::design::Design;
use super::iterate::iterate;
use super::options::{Options, Start, Wanted};
use super::outcome::End;
use super::pass::prepare;
use super::replicates::estimate;
use super::routh::unstable_roots;
use super::rule::Rule;
use super::uncertainty;
use super::workspace::Workspace;
use crate::simd::{Isa, LANES, numbers_mut};

/// Of at most so many poles ways astray were twice as long in all cases tried, which spares most others the filters.
const FEW_POLES: usize = 3;
/// By which an end from a filter has to be lower, in parts of the cost: noise alone chooses between closer ones.
const LOWER: f64 = 0.005;

impl Estimation<'_> {
    /// Goes again where the way was long; the best of all ends stands in each lane.
    pub fn go_again(&self, w: &mut Workspace, live: [bool; LANES], rule: Rule) {
        let again: [bool; LANES] = std::array::from_fn(|lane| live[lane] && is_long(w, lane));
        if again == [false; LANES] {
            return;
        }
        let d = self.design;
        let few = |lines: usize| d.few_lines().min(lines);
        let fewer = w.records.iter().any(|r| few(r.lines) < r.lines)
            && d.determined(w.records.iter().map(|r| few(r.lines)));
        let most = if d.structure.order > FEW_POLES { MANY } else { 2 * MANY };
        // One that was given few steps has not gone astray.
        let far = std::array::from_fn(|k| again[k] && w.progress.nit.0[k] > f64::from(most));
        if !fewer && far == [false; LANES] {
            return;
        }
        let mut best = ends(self.isa, d, w, live);
        if fewer {
            best = self.go_from_few_lines(w, again, rule, best);
        }
        if far != [false; LANES] {
            self.go_from_filters(w, far, rule, best);
        }
    }

    /// From the estimate on few lines; the better ends.
    fn go_from_few_lines(
        &self,
        w: &mut Workspace,
        lanes: [bool; LANES],
        rule: Rule,
        best: [End; LANES],
    ) -> [End; LANES] {
        let Estimation { isa, design: d, options: o, .. } = *self;
        self.try_from(w, lanes, rule, best, |w| {
            w.records.iter_mut().for_each(|r| r.limit = d.few_lines().min(r.lines));
            w.begin(lanes);
            iterate(isa, d, w, Rule::Wls, o);
            iterate(isa, d, w, rule, &Options { tol: o.tol.max(CLOSE), ..*o });
            w.records.iter_mut().for_each(|r| r.limit = r.lines);
        })
    }

    /// From regressions behind filters, where one of these ways ends lower and no more unstable.
    fn go_from_filters(
        &self,
        w: &mut Workspace,
        mut lanes: [bool; LANES],
        rule: Rule,
        best: [End; LANES],
    ) {
        let Estimation { isa, design: d, options: o, .. } = *self;
        w.make_other(d);
        let Some(mut other) = w.other.take() else { return };
        let options = Options { wanted: Wanted::Cost, tol: o.tol.max(CLOSE), ..*o };
        for lane in 0..LANES {
            if !lanes[lane] {
                continue;
            }
            other.load_lane(w, lane);
            let outcome = estimate(isa, d, &mut other, [true; LANES], Start::Filtered, &options);
            let costs = std::array::from_fn(|k| {
                End { status: outcome.status[k], cost: other.cost(k) }.cost()
            });
            let most = unstable(d, w, lane);
            let end = lowest(d, &mut other, costs, (best[lane].cost(), most));
            lanes[lane] = end.is_some();
            if let Some(end) = end {
                let Workspace { before, iterates, .. } = &mut *other;
                before.take_lane(lane, iterates, end);
            }
        }
        if lanes != [false; LANES] {
            self.try_from(w, lanes, rule, best, |w| w.iterates.copy(&other.before, lanes));
        }
        w.other = Some(other);
    }

    /// Iterates these lanes from where `begin` puts them; the better of both ends stands in each, and is returned.
    fn try_from(
        &self,
        w: &mut Workspace,
        lanes: [bool; LANES],
        rule: Rule,
        best: [End; LANES],
        begin: impl FnOnce(&mut Workspace),
    ) -> [End; LANES] {
        let Estimation { isa, design: d, options: o, .. } = *self;
        let (progress, dependent) = (w.progress, w.dependent);
        w.before.copy(&w.iterates, [true; LANES]);
        begin(w);
        w.begin(lanes);
        prepare(isa, d, w);
        isa.run(uncertainty::Transients { design: d, space: w });
        iterate(isa, d, w, rule, o);

        let ended = ends(isa, d, w, lanes);
        let better = |k: usize| lanes[k] && ended[k].is_better_than(best[k]);
        let stay = std::array::from_fn(|lane| !better(lane));
        w.iterates.copy(&w.before, stay);
        for lane in 0..LANES {
            if stay[lane] {
                w.progress.active.0[lane] = progress.active.0[lane];
                w.progress.nit.0[lane] = progress.nit.0[lane];
                w.dependent[lane] = dependent[lane];
            } else {
                // Both ways.
                w.progress.nit.0[lane] += progress.nit.0[lane];
            }
        }
        std::array::from_fn(|k| if stay[k] { best[k] } else { ended[k] })
    }
}

/// Whether a lane took more steps than a way to the right minimum takes, or has not settled.
pub(super) fn is_long(w: &Workspace, lane: usize) -> bool {
    w.progress.active.0[lane] > 0.0 || w.progress.nit.0[lane] > f64::from(MANY)
}

/// The lane of the lowest of the costs from filters, if it is worth it against that of a way with so many unstable poles.
pub(super) fn lowest(
    d: &Design,
    w: &mut Workspace,
    costs: [f64; LANES],
    (cost, most): (f64, usize),
) -> Option<usize> {
    let worth = |k: &usize| costs[*k] < cost * (1.0 - LOWER) && unstable(d, w, *k) <= most;
    (0..LANES).filter(worth).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
}

/// Unstable poles of the estimate in a lane.
pub(super) fn unstable(d: &Design, w: &mut Workspace, lane: usize) -> usize {
    let n = d.structure.order;
    let polynomial = &mut numbers_mut(&mut w.work)[..=n];
    polynomial[0] = 1.0;
    for (to, a) in polynomial[1..].iter_mut().zip(&w.iterates.theta.now) {
        *to = a.0[lane];
    }
    unstable_roots(polynomial)
}

/// How each lane ends where it stands.
fn ends(isa: Isa, d: &Design, w: &mut Workspace, live: [bool; LANES]) -> [End; LANES] {
    complete(isa, d, w, live, false);
    w.forget_products();
    let status = status(d, w, false);
    std::array::from_fn(|lane| End { status: status[lane], cost: w.cost(lane) })
}
