//! Held inputs that act at once: with as many zeros as poles, d = b₀ brings an input's step to the sample at once.
//!
//! What sampling folds is no little thing then: a sample sees the step half a sample before the middle of its hold,
//! and an estimate without that is far off, into fast unstable poles. So the first one takes the input as it is seen
//! from the samples, V = U e^{−sk} with the samples k seconds after the middle of the hold. Up to terms of (sh)²
//!
//! ```text
//! Y = d Û + (B_r/A) U ≈ (B″/A) V,    B = d A + B_r,    B″ = d A + B_r (1 + sk),
//! ```
//!
//! Û the input's sum over samples: a numerator of the same degree, and B follows from B″. That is done on lines of
//! eight samples per period. From there on what is folded is known well enough for rounds of what it is and of the
//! estimate that follows, first on these lines, then on all. Each goes half the way, as these estimates swing about
//! where they end.

use std::f64::consts::TAU;

use super::again::Estimation;
use super::aliasing::{Fold, Record};
use super::design::Design;
use super::iterate::iterate;
use super::pass::prepare;
use super::rest::moved;
use super::rule::Rule;
use super::unalias::unalias;
use super::uncertainty::Transients;
use super::workspace::Workspace;
use crate::math::sin_cos_turns_1;
use crate::quadrature::Hold;
use crate::simd::{Isa, LANES, Wide};
use crate::structure::Method;

/// Most rounds on one choice of lines.
const ROUNDS: usize = 40;
/// Change of the parameters, in parts of them, at which they stand.
const SETTLED: f64 = 1e-7;
/// Fewest samples per period of the lines that the first estimate takes.
pub(crate) const SAMPLES: f64 = 8.0;

impl Design {
    /// Whether a held input acts at once in some record.
    pub(crate) fn acts_at_once(&self) -> bool {
        let records = self.aliasing.iter().flat_map(|a| a.records.iter().flatten());
        let mut held = records.flat_map(|r| r.inputs.iter().zip(&self.structure.numerators));
        held.any(|(fold, degree)| self.at_once(fold.as_ref(), *degree).is_some())
    }

    /// The folding of an input that acts at once.
    fn at_once<'a>(&self, fold: Option<&'a Fold>, degree: Option<usize>) -> Option<&'a Fold> {
        fold.filter(|f| f.hold == Hold::Zoh && degree == Some(self.structure.order))
    }
}

impl Estimation<'_> {
    /// The estimate with what sampling folds taken out of the output, in all live lanes.
    pub fn settle(&self, w: &mut Workspace, live: [bool; LANES]) {
        let Estimation { isa, design: d, rule, options: o } = *self;
        w.records.iter_mut().for_each(|r| r.measured.keep(&r.re, &r.im));
        take_few_lines(d, w);
        turn(d, w);
        w.begin(live);
        if d.method == Method::Ls {
            self.again(w, live);
        } else {
            iterate(isa, d, w, Rule::Wls, o);
        }
        if let Some(rule) = rule {
            iterate(isa, d, w, rule, o);
        }
        turn_back(d, w);
        self.rounds(w, live);
        if w.records.iter().any(|r| r.limit < r.lines) {
            w.records.iter_mut().for_each(|r| r.limit = r.lines);
            self.rounds(w, live);
        }
    }

    /// Rounds of what is folded at the estimate and of half the way to the estimate that follows, each lane until it
    /// stands.
    fn rounds(&self, w: &mut Workspace, live: [bool; LANES]) {
        let Estimation { isa, design: d, .. } = *self;
        let (mut left, mut unsettled, mut dependent) = (live, [false; LANES], w.dependent);
        for _ in 0..ROUNDS {
            take_out(isa, d, w);
            w.before_round.copy_from_slice(&w.iterates.theta.now);
            self.again(w, left);
            for lane in 0..LANES {
                if !left[lane] {
                    continue;
                }
                (unsettled[lane], dependent[lane]) =
                    (w.progress.active.0[lane] > 0.0, w.dependent[lane]);
                let each = w.iterates.theta.now.iter_mut().zip(&w.before_round);
                left[lane] = moved(
                    SETTLED,
                    each.map(|(now, before)| {
                        let (from, to) = (before.0[lane], now.0[lane]);
                        now.0[lane] = 0.5 * (from + to);
                        (from, to)
                    }),
                );
            }
            if left == [false; LANES] {
                break;
            }
        }
        // As the estimate says, however many rounds other lanes took.
        take_out(isa, d, w);
        for lane in 0..LANES {
            w.progress.active.0[lane] = f64::from(unsettled[lane] || left[lane]);
        }
        w.dependent = dependent;
    }
}

/// What the estimate that stands folds, out of the output.
fn take_out(isa: Isa, d: &Design, w: &mut Workspace) {
    w.forget_products();
    prepare(isa, d, w);
    isa.run(Transients { design: d, space: w });
    unalias(isa, d, w, [true; LANES]);
    w.forget_products();
}

/// Lines of eight samples per period, where they determine the parameters.
fn take_few_lines(d: &Design, w: &mut Workspace) {
    let Some(aliasing) = &d.aliasing else { return };
    let few = |k: usize| {
        let x = &d.records[k].x;
        let edge = aliasing.records[k].as_ref().map_or(f64::INFINITY, |r| r.span / SAMPLES);
        x.iter().take_while(|x| **x <= edge * (1.0 + 1e-9)).count()
    };
    if d.determined((0..w.records.len()).map(few)) {
        w.records.iter_mut().enumerate().for_each(|(k, r)| r.limit = few(k));
    }
}

/// Inputs that act at once as they are seen from the samples.
fn turn(d: &Design, w: &mut Workspace) {
    let Some(aliasing) = &d.aliasing else { return };
    for (k, record) in aliasing.records.iter().enumerate() {
        let Some(record) = record else { continue };
        let each = record.inputs.iter().zip(&d.structure.numerators).enumerate();
        for (input, (fold, degree)) in each {
            let Some(fold) = d.at_once(fold.as_ref(), *degree) else { continue };
            let (re, im) = w.signal_mut(k, 1 + input);
            for ((re, im), x) in re.iter_mut().zip(im).zip(&d.records[k].x) {
                let (sin, cos) = sin_cos_turns_1(-fold.behind * x / record.span);
                for (re, im) in re.0.iter_mut().zip(&mut im.0) {
                    (*re, *im) = (cos * *re - sin * *im, cos * *im + sin * *re);
                }
            }
        }
    }
}

/// The inputs as they were, and B of B″: d = B″/A at s = −1/k, and B_r by division.
fn turn_back(d: &Design, w: &mut Workspace) {
    let Some(aliasing) = &d.aliasing else { return };
    for r in &mut w.records {
        r.measured.give_back(&mut r.re, &mut r.im);
        r.inputs_ready = false;
    }
    w.straight.inputs_ready = false;
    let (a, b) = w.iterates.theta.now.split_at_mut(d.structure.order);
    let mut from = 0;
    for (input, degree) in d.structure.numerators.iter().enumerate() {
        let Some(degree) = *degree else { continue };
        let own = &mut b[from..=from + degree];
        from += degree + 1;
        // Records in which it is not held were not turned: what they told of B″ stands in it, for a start.
        let behind = |r: &Record| {
            let fold = d.at_once(r.inputs[input].as_ref(), Some(degree))?;
            Some(fold.behind * TAU / r.span)
        };
        let Some(k) = aliasing.records.iter().flatten().find_map(behind) else { continue };
        (0..LANES).for_each(|lane| part(a, own, k, lane));
    }
}

/// B of B″, in one lane.
pub(super) fn part(a: &[Wide], b: &mut [Wide], k: f64, lane: usize) {
    let Some((direct, rest)) = b.split_first_mut() else { return };
    let (mut above, mut below, mut power) = (direct.0[lane], 1.0, 1.0);
    for (b, a) in rest.iter().zip(a) {
        power *= -k;
        above += power * b.0[lane];
        below += power * a.0[lane];
    }
    direct.0[lane] = above / below;
    let mut next = 0.0;
    for (b, a) in rest.iter_mut().zip(a).rev() {
        let through = direct.0[lane] * a.0[lane];
        next = b.0[lane] - through - k * next;
        b.0[lane] = next + through;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numerators_come_back_from_those_of_the_turned_input() {
        // A = s² + 3 s + 8, B = 2 A + 5 s + 7, B″ = 2 A + (5 s + 7)(1 + k s).
        for k in [0.0, -0.05, 0.4] {
            let wide = |v: &[f64]| v.iter().map(|v| Wide::splat(*v)).collect::<Vec<_>>();
            let a = wide(&[3.0, 8.0]);
            let mut b = wide(&[2.0 + 5.0 * k, 6.0 + 5.0 + 7.0 * k, 16.0 + 7.0]);
            part(&a, &mut b, k, 3);
            for (b, wanted) in b.iter().zip([2.0, 11.0, 23.0]) {
                assert!((b.0[3] - wanted).abs() < 1e-12, "{k}: {} {wanted}", b.0[3]);
            }
        }
    }
}
