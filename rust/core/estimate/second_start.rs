//! A second start for lanes that took many steps: the estimate on few lines, where noise rules less.
//!
//! From `wls` the right minimum is 5 to 10 steps away; a way that leads astray, into another minimum or nowhere, is
//! longer. Such a lane goes again, from the estimate on the lower lines that tell its unknowns, and keeps the better
//! end. What other lanes do changes no bit of it.

use super::again::Estimation;
use super::band::{CLOSE, MANY};
use super::completion::{complete, status};
use super::design::Design;
use super::iterate::iterate;
use super::options::Options;
use super::outcome::End;
use super::pass::prepare;
use super::rule::Rule;
use super::uncertainty;
use super::workspace::Workspace;
use crate::simd::{Isa, LANES};

impl Estimation<'_> {
    /// Goes again where the way was long; the better of both ends stands in each lane.
    pub fn go_again(&self, w: &mut Workspace, live: [bool; LANES], rule: Rule) {
        let Estimation { isa, design: d, options: o, .. } = *self;
        let long = |lane: usize| {
            w.progress.active.0[lane] > 0.0 || w.progress.nit.0[lane] > f64::from(MANY)
        };
        let again: [bool; LANES] = std::array::from_fn(|lane| live[lane] && long(lane));
        if again == [false; LANES] {
            return;
        }
        let few = |lines: usize| d.few_lines().min(lines);
        let fewer = w.records.iter().any(|r| few(r.lines) < r.lines);
        if !fewer || !d.determined(w.records.iter().map(|r| few(r.lines))) {
            return;
        }
        let first = ends(isa, d, w, live);
        let (progress, dependent) = (w.progress, w.dependent);
        w.before.copy(&w.iterates, [true; LANES]);

        w.records.iter_mut().for_each(|r| r.limit = few(r.lines));
        w.begin(again);
        iterate(isa, d, w, Rule::Wls, o);
        iterate(isa, d, w, rule, &Options { tol: o.tol.max(CLOSE), ..*o });
        w.records.iter_mut().for_each(|r| r.limit = r.lines);
        w.begin(again);
        prepare(isa, d, w);
        isa.run(uncertainty::Transients { design: d, space: w });
        iterate(isa, d, w, rule, o);

        let second = ends(isa, d, w, again);
        let better = |k: usize| again[k] && second[k].is_better_than(first[k]);
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
    }
}

/// How each lane ends where it stands.
fn ends(isa: Isa, d: &Design, w: &mut Workspace, live: [bool; LANES]) -> [End; LANES] {
    complete(isa, d, w, live, false);
    w.forget_products();
    let status = status(d, w, false);
    std::array::from_fn(|lane| End { status: status[lane], cost: w.cost(lane) })
}
