//! The estimate of eight replicates: start, iteration, second start, uncertainty, statuses.

use super::again::Estimation;
use super::aliasing::{Changes, MOST_ROUNDS, ROUNDS};
use super::band::SAME;
use super::completion::{complete, status};
use super::design::Design;
use super::filtered::begin_filtered;
use super::iterate::iterate;
use super::options::{Options, Start, Wanted};
use super::outcome::Outcome;
use super::pass::prepare;
use super::refine::refine;
use super::rest::{self, KnownStart};
use super::rule::Rule;
use super::unalias::unalias;
use super::workspace::Workspace;
use super::{ls, straight, uncertainty};
use crate::error::Status;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::structure::Method;

/// Estimates θ from the coefficients in the workspace; `live` lanes only, the others hold anything.
pub fn estimate(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    start: Start<'_>,
    o: &Options,
) -> Outcome {
    w.begin(live);
    let periodic = d.known_start.as_ref().is_some_and(KnownStart::periodic);
    w.records.iter_mut().for_each(|r| r.tie.begin(periodic));
    if d.method == Method::Ls {
        if !straight::ls(isa, d, w) {
            isa.run(ls::LsStep { design: d, space: w });
        }
    } else {
        match start {
            Start::Wls => iterate(isa, d, w, Rule::Wls, o),
            Start::Theta(theta) => {
                for ((to, value), scale) in w.iterates.theta.now.iter_mut().zip(theta).zip(&d.scale)
                {
                    *to = Wide::splat(value / scale);
                }
                prepare(isa, d, w);
                isa.run(uncertainty::Transients { design: d, space: w });
            }
            Start::Each(starts) => begin_each(isa, d, w, starts, o),
            Start::Filtered => begin_filtered(isa, d, w, o),
        }
    }
    let rule = match d.method {
        Method::Awls if d.adapts() => Some(Rule::Awls),
        Method::Ml if d.adapts() => Some(Rule::Ml),
        _ => None,
    };
    let estimation = Estimation { isa, design: d, rule, options: o };
    let at_once = d.acts_at_once();
    match rule {
        _ if at_once => estimation.settle(w, live),
        Some(rule) => {
            iterate(isa, d, w, rule, o);
            if start == Start::Wls {
                estimation.go_again(w, live, rule);
            }
        }
        None => w.progress.active = Wide::ZERO,
    }
    let asked = o.wanted == Wanted::Covariance;
    if o.wanted != Wanted::Cost {
        match &d.known_start {
            Some(known) if !periodic => {
                if at_once {
                    w.records.iter_mut().for_each(|r| r.measured.give_back(&mut r.re, &mut r.im));
                }
                estimation.start_known(w, known, live);
            }
            _ if at_once => {}
            _ => estimation.unfold(w, live),
        }
    }
    if o.wanted != Wanted::Theta {
        complete(isa, d, w, live, asked);
    }
    if d.driven() && o.wanted != Wanted::Cost {
        refine(isa, d, w, live, (o.tol, o.maxiter), asked);
    }
    let status = status(d, w, asked);
    if asked {
        let lost = |k: &usize| matches!(status[*k], Status::Rank | Status::NonFinite);
        (0..LANES).filter(lost).for_each(|k| w.covariances.forget(k));
    }
    Outcome { status, nit: w.progress.nit.0.map(|nit| nit as u32) }
}

impl Estimation<'_> {
    /// Rounds of what sampling folds at the estimate, and of the estimate that follows, in each lane until it stands.
    fn unfold(&self, w: &mut Workspace, live: [bool; LANES]) {
        let Estimation { isa, design: d, .. } = *self;
        if d.aliasing.is_none() {
            return;
        }
        w.records.iter_mut().for_each(|r| r.measured.keep(&r.re, &r.im));
        let (mut left, mut changes) = (live, [Changes::NONE; LANES]);
        let (mut unsettled, mut dependent) = ([false; LANES], w.dependent);
        for round in 1..=MOST_ROUNDS {
            if d.method == Method::Ls {
                prepare(isa, d, w);
                isa.run(uncertainty::Transients { design: d, space: w });
            }
            let changed = unalias(isa, d, w, left);
            self.again(w, left);
            for lane in 0..LANES {
                if !left[lane] {
                    continue;
                }
                (unsettled[lane], dependent[lane]) =
                    (w.progress.active.0[lane] > 0.0, w.dependent[lane]);
                let more = changes[lane].go_on(changed[lane]);
                left[lane] = round < ROUNDS || more;
            }
            if left == [false; LANES] {
                break;
            }
        }
        (0..LANES).for_each(|k| w.progress.active.0[k] = f64::from(unsettled[k]));
        w.dependent = dependent;
    }

    /// Rounds of the transient that the estimate makes of a known start, and of the estimate that follows, in each lane
    /// until it stands: what is linear in a round is not in the whole.
    fn start_known(&self, w: &mut Workspace, known: &KnownStart, live: [bool; LANES]) {
        let Estimation { isa, design: d, rule, .. } = *self;
        w.records.iter_mut().for_each(|r| r.measured.keep(&r.re, &r.im));
        let (mut left, mut unsettled, mut dependent) = (live, [false; LANES], w.dependent);
        let (mut best, mut cost) = (w.iterates.theta.now.clone(), [f64::INFINITY; LANES]);
        for round in 0..rest::ROUNDS {
            isa.run(Ties { design: d, known, space: w });
            unalias(isa, d, w, [true; LANES]);
            w.forget_products();
            complete(isa, d, w, live, false);
            let mut onward = left;
            for lane in 0..LANES {
                if !left[lane] {
                    continue;
                }
                let own = w.progress.cost.0[lane];
                // `wls` under output noise does not make the cost small.
                let lower = round == 0 || rule.is_none() || own <= cost[lane] * (1.0 + SAME);
                let now = w.iterates.theta.now.iter_mut().zip(&mut best);
                let moved = rest::moved(
                    rest::SETTLED,
                    now.map(|(now, best)| {
                        let before = best.0[lane];
                        match lower {
                            true => best.0[lane] = now.0[lane],
                            // Too far for what was linear there.
                            false => now.0[lane] = 0.5 * (now.0[lane] + before),
                        }
                        (before, now.0[lane])
                    }),
                );
                left[lane] = round == 0 || moved;
                if lower {
                    cost[lane] = own;
                }
                onward[lane] = lower && left[lane];
            }
            if left == [false; LANES] {
                break;
            }
            self.again(w, onward);
            for lane in (0..LANES).filter(|k| onward[*k]) {
                unsettled[lane] = w.progress.active.0[lane] > 0.0;
                dependent[lane] = w.dependent[lane];
            }
        }
        for lane in (0..LANES).filter(|k| live[*k]) {
            for (now, best) in w.iterates.theta.now.iter_mut().zip(&best) {
                now.0[lane] = best.0[lane];
            }
        }
        // As the estimate says, however many rounds other lanes took.
        isa.run(Ties { design: d, known, space: w });
        unalias(isa, d, w, [true; LANES]);
        w.forget_products();
        for lane in 0..LANES {
            w.progress.active.0[lane] = f64::from(unsettled[lane] || left[lane]);
        }
        w.dependent = dependent;
    }
}

/// The transients as functions of θ, where it stands.
struct Ties<'a> {
    design: &'a Design,
    known: &'a KnownStart,
    space: &'a mut Workspace,
}

impl Kernel for Ties<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Ties { design: d, known, space: w } = self;
        let theta = &w.iterates.theta.now;
        for ((r, course), t) in
            w.records.iter_mut().zip(&known.courses).zip(&mut w.iterates.transients)
        {
            r.tie.set::<L>(&d.structure, &d.columns, course, theta);
            r.tie.at::<L>(theta, &mut t.now);
        }
    }
}

/// Lane 0 where `wls` leads, the lanes behind it at these parameters with the transients that belong to them.
fn begin_each(isa: Isa, d: &Design, w: &mut Workspace, starts: &[Vec<f64>], o: &Options) {
    let live = w.progress.active;
    w.progress.active = Wide(Start::Wls.lanes().map(f64::from));
    iterate(isa, d, w, Rule::Wls, o);
    let first = w.iterates.clone();
    for (lane, theta) in starts.iter().enumerate().map(|(k, theta)| (k + 1, theta)) {
        for ((to, value), scale) in w.iterates.theta.now.iter_mut().zip(theta).zip(&d.scale) {
            to.0[lane] = value / scale;
        }
        w.progress.active.0[lane] = live.0[lane];
    }
    prepare(isa, d, w);
    isa.run(uncertainty::Transients { design: d, space: w });
    for (own, from) in w.iterates.transients.iter_mut().zip(&first.transients) {
        for (to, from) in own.now.iter_mut().zip(&from.now) {
            to.0[0] = from.0[0];
        }
    }
}
