//! What sampling folds into the output's sums under held inputs, taken out of them.
//!
//! A held input bends the response at every sample, and a sum over samples folds the response's lines m + jN onto
//! line m. There the input's coefficients are known from its own on line m: with s_j = i(m + jN)ω₀
//!
//! ```text
//! U(m + jN) = (U(m) − J(m)) (m/(m + jN))^p e^{−2πijτ/h} + J(m) m/(m + jN),     J(m) = (u(0) − u(T))/(2πim),
//! Y(m) = sum over samples − Σ_{j≠0} G(s_j) U(m + jN),
//! ```
//!
//! p = 1 held, 2 straight between samples, τ its delay; J is the jump from the record's end to its beginning, which
//! stands at a sample whatever the delay.
//! The sums over j beyond a few end in closed form. G is that of the estimate, which then follows anew: the error of
//! G in so small a term is next to nothing after two rounds, but for poles as fast as the sampling, which take more.
//! What the folding adds is no small matter: for one pole more than zeros it is (ωh)²/12 of the response, 5 % at eight
//! samples a period. Where all inputs are held, what the ends of the record fold is known from the transient, and the
//! output's sums are plain ones; else the ends, J among them, are left to the end weights of the quadrature. Uneven
//! samples fold otherwise and keep their
//! weights, too.

use std::f64::consts::{PI, TAU};

use crate::math::sin_cos_turns_1;
use crate::modulation::Column;
use crate::quadrature::{Hold, Rule};
use crate::simd::{LANES, Lanes, Wide};

/// Foldings on each side that are taken one by one.
const FOLDS: usize = 6;
/// Images of a line, on both sides.
const IMAGES: usize = 2 * FOLDS;
/// Rounds of taking it out and of the estimate that follows, which every estimate has.
pub(crate) const ROUNDS: usize = 2;
/// Most rounds, of estimates that go on to move.
pub(crate) const MOST_ROUNDS: usize = 20;
/// Part by which changes shrink from round to round at the most: a superfluous pole far beyond the band goes on for
/// ever, to where it leaves more.
const QUICKLY: f64 = 0.2;
/// What is still to come, in parts of the output, where an estimate stands.
const STANDS: f64 = 2e-6;
/// A correction above this part of the output's power is none: the estimate is far off.
pub(crate) const LARGE: f64 = 0.1;
/// The same where an input acts at once: at half the sampling rate what is folded is 1.4 of the power.
pub(crate) const LARGE_AT_ONCE: f64 = 1.5;

/// The rule of the output's sums: where all is known that plain sums fold into it, they need no end weights.
pub(crate) fn output_rule(given: Rule, inputs: &[Option<Hold>], even: bool) -> Rule {
    let all = inputs.iter().all(Option::is_some) && even;
    match given {
        Rule::Gregory if all && !inputs.is_empty() => Rule::Trapezoid,
        _ => given,
    }
}

/// Foldings of one input, in each lane.
#[derive(Debug, Clone)]
pub(crate) struct Fold {
    pub hold: Hold,
    /// Steps that the samples come after the middle of the hold.
    pub behind: f64,
    /// e^{−2πijf} of j = 1, 2, …, f the part of a step by which the input changes after a sample.
    phases: [[Wide; 2]; FOLDS],
    /// Σ 2 cos(2πjf)/j² of the others.
    far: Wide,
    /// −Σ 2 sin(2πjf)/j of the others; what a step at the samples themselves makes, whose outputs see its new value.
    jump: Wide,
}

/// Foldings of held inputs in a record of even steps.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    /// In seconds.
    pub step: f64,
    /// 2π/h over the band edge.
    pub span: f64,
    /// Of each input, where it is held.
    pub inputs: Vec<Option<Fold>>,
    /// Whether all are held: then what the ends of the record fold is known, too.
    pub ends: bool,
}

/// Foldings of held inputs in a problem: of each record, none where its steps are uneven or nothing is held.
#[derive(Debug, Clone)]
pub(crate) struct Aliasing {
    pub records: Vec<Option<Record>>,
}

impl Aliasing {
    /// Those of records by their steps and the holds and delays of their inputs; nothing where none is held.
    pub fn new(
        records: impl Iterator<Item = (Option<f64>, Vec<(Option<Hold>, f64)>)>,
        band_edge: f64,
    ) -> Option<Aliasing> {
        let mut any = false;
        let record = |(step, inputs): (Option<f64>, Vec<(Option<Hold>, f64)>)| {
            let held = inputs.iter().any(|(hold, _)| hold.is_some());
            any |= held;
            let step = step.filter(|_| held)?;
            let fold = |(hold, delay): &(Option<Hold>, f64)| {
                hold.map(|hold| Fold::new(hold, [delay / step; LANES]))
            };
            Some(Record {
                step,
                span: TAU / step / band_edge,
                inputs: inputs.iter().map(fold).collect(),
                ends: inputs.iter().all(|(hold, _)| hold.is_some()),
            })
        };
        let records = records.map(record).collect();
        any.then_some(Aliasing { records })
    }
}

impl Fold {
    /// Of steps at samples, whose outputs see the mean of both values.
    const AT_SAMPLES: Fold = {
        let mut far = PI * PI / 3.0;
        let mut j = 1;
        while j <= FOLDS {
            far -= 2.0 / (j * j) as f64;
            j += 1;
        }
        Fold {
            hold: Hold::Zoh,
            behind: 0.0,
            phases: [[Wide([1.0; LANES]), Wide::ZERO]; FOLDS],
            far: Wide([far; LANES]),
            jump: Wide::ZERO,
        }
    };

    /// Of an input that is late by so many steps.
    pub fn new(hold: Hold, delay: [f64; LANES]) -> Fold {
        let mut fold = Fold {
            hold,
            behind: 0.0,
            phases: [[Wide::ZERO; 2]; FOLDS],
            far: Wide::ZERO,
            jump: Wide::ZERO,
        };
        for (lane, delay) in delay.into_iter().enumerate() {
            let late = delay - delay.floor();
            // A delay of whole steps, but for rounding.
            let late = if (1e-9..=1.0 - 1e-9).contains(&late) { late } else { 0.0 };
            let mut far = 2.0 * PI * PI * (1.0 / 6.0 - late + late * late);
            let mut jump = -TAU * (0.5 - late);
            for (phase, j) in fold.phases.iter_mut().zip(1..) {
                let j = f64::from(j);
                let (sin, cos) = sin_cos_turns_1(j * late);
                (phase[0].0[lane], phase[1].0[lane]) = (cos, -sin);
                far -= 2.0 * cos / (j * j);
                jump += 2.0 * sin / j;
            }
            fold.far.0[lane] = far;
            fold.jump.0[lane] = if late == 0.0 { PI } else { jump };
            if lane == 0 {
                fold.behind = if late == 0.0 { -0.5 } else { 0.5 - late };
            }
        }
        fold
    }

    /// What is folded of an input with U = `u` on line x, by G of a = (a₁ … a_n) and b in falling powers; `jump` is ixJ(x),
    /// whose own folding is left out where the ends of the record are not known (`ends`).
    #[inline(always)]
    pub fn of<L: Lanes>(
        &self,
        (a, b): (&[Wide], &[Wide]),
        images: &Images<L>,
        u: (L, L),
        jump: L,
        ends: bool,
    ) -> (L, L) {
        let zero = L::splat(0.0);
        let (mut sum, mut plain) = ((zero, zero), (zero, zero));
        for (k, [cos, sin]) in self.phases.iter().enumerate() {
            let (cos, sin) = (L::load(cos), L::load(sin));
            for (k, sin) in [(2 * k, sin), (2 * k + 1, -sin)] {
                let g = times(polynomial::<L>(b, images.at[k]), images.inverse[k]);
                let part = images.over[k];
                plain = (g.0.mul_add(part, plain.0), g.1.mul_add(part, plain.1));
                let part = if self.hold == Hold::Zoh { part } else { part * part * images.x };
                let (c, s) = (part * cos, part * sin);
                sum.0 = g.0.mul_add(c, (-g.1).mul_add(s, sum.0));
                sum.1 = g.0.mul_add(s, g.1.mul_add(c, sum.1));
            }
        }
        let rest = self.rest::<L>(a, b, images);
        sum = (sum.0 + rest.0, sum.1 + rest.1);
        // xU less xJ, which is −i times what was given.
        let within = (u.0 * images.x, u.1.mul_add(images.x, jump));
        let mut folded = times(sum, within);
        if ends {
            let rest = Fold::AT_SAMPLES.rest::<L>(a, b, images);
            let by = times((plain.0 + rest.0, plain.1 + rest.1), (zero, jump));
            folded = (folded.0 - by.0, folded.1 - by.1);
        }
        folded
    }

    /// Σ of those beyond, over x, where G = g₀ + g₁/s + …
    #[inline(always)]
    fn rest<L: Lanes>(&self, a: &[Wide], b: &[Wide], images: &Images<L>) -> (L, L) {
        let zero = L::splat(0.0);
        let (mut through, mut next) = (zero, zero);
        if b.len() > a.len() {
            through = L::load(&b[0]);
            if let (Some(a), Some(b)) = (a.first(), b.get(1)) {
                next = (-through).mul_add(L::load(a), L::load(b));
            }
        } else if b.len() == a.len() {
            next = L::load(&b[0]);
        } else {
            return (zero, zero);
        }
        let span = images.span;
        let far = L::load(&self.far) * L::splat(1.0 / (span * span));
        match self.hold {
            Hold::Zoh => {
                let jump = through * L::load(&self.jump) * L::splat(1.0 / span);
                (-(through * images.x * far), jump - next * far)
            }
            Hold::Foh => (through * images.x * far, zero),
        }
    }
}

/// Lines that sampling folds onto line x.
pub(crate) struct Images<L> {
    x: L,
    span: f64,
    at: [L; IMAGES],
    /// One over these, and 1/A on them.
    over: [L; IMAGES],
    inverse: [(L, L); IMAGES],
}

impl<L: Lanes> Images<L> {
    #[inline(always)]
    pub fn new(a: &[Wide], x: L, span: f64) -> Images<L> {
        let (mut at, mut over, mut inverse) = ([x; IMAGES], [x; IMAGES], [(x, x); IMAGES]);
        for k in 0..IMAGES {
            let shift = (k / 2 + 1) as f64 * span;
            at[k] = x + L::splat(if k % 2 == 0 { shift } else { -shift });
            over[k] = L::splat(1.0) / at[k];
            // Monic.
            let mut sum = (L::splat(1.0), L::splat(0.0));
            for next in a {
                sum = horner(sum, next, at[k]);
            }
            let square = sum.0.mul_add(sum.0, sum.1 * sum.1);
            inverse[k] = (sum.0 / square, -sum.1 / square);
        }
        Images { x, span, at, over, inverse }
    }

    /// Σ_{j≠0} T(i(x + jX))/A(i(x + jX)): what the ends of the record fold, by the transient's columns and values.
    #[inline(always)]
    pub fn ends<'a>(&self, transient: impl Iterator<Item = (Column, &'a Wide)> + Clone) -> (L, L) {
        let mut sum = (L::splat(0.0), L::splat(0.0));
        for (k, at) in self.at.iter().enumerate() {
            // Those beyond fall as 1/j and cancel in pairs but for 1/j²: the last pair stands for them.
            let last = FOLDS as f64;
            let by = if k / 2 + 1 < FOLDS { 1.0 } else { 1.0 + last * last / (last + 0.5) };
            let mut t = (L::splat(0.0), L::splat(0.0));
            for (column, value) in transient.clone() {
                let mut size = L::splat(column.sign);
                for _ in 0..column.power {
                    size = size * *at;
                }
                if column.power < 0 {
                    size = -size / *at;
                }
                let own = L::load(value) * size;
                match column.phase % 2 {
                    0 => t.0 = t.0 + own,
                    _ => t.1 = t.1 + own,
                }
            }
            let one = times(t, self.inverse[k]);
            sum = (one.0.mul_add(L::splat(by), sum.0), one.1.mul_add(L::splat(by), sum.1));
        }
        // Columns stand on the left side of the equation.
        (-sum.0, -sum.1)
    }
}

/// B(ix), falling powers.
#[inline(always)]
fn polynomial<L: Lanes>(b: &[Wide], x: L) -> (L, L) {
    let mut sum = (L::splat(0.0), L::splat(0.0));
    for next in b {
        sum = horner(sum, next, x);
    }
    sum
}

#[inline(always)]
fn horner<L: Lanes>((re, im): (L, L), next: &Wide, x: L) -> (L, L) {
    ((-x).mul_add(im, L::load(next)), x * re)
}

#[inline(always)]
fn times<L: Lanes>(a: (L, L), b: (L, L)) -> (L, L) {
    (a.0.mul_add(b.0, -(a.1 * b.1)), a.0.mul_add(b.1, a.1 * b.0))
}

/// How much what is folded changes from round to round, in parts of the output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Changes(f64);

impl Changes {
    /// Before the first.
    pub const NONE: Changes = Changes(f64::INFINITY);

    /// Takes the next; whether more is to come that is worth a round, as changes go on to shrink by the same part.
    /// Where they hardly shrink, further rounds lead nowhere.
    pub fn go_on(&mut self, now: f64) -> bool {
        let part = now / self.0;
        self.0 = now;
        part < QUICKLY && now * part > STANDS * (1.0 - part)
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::simd::{Isa, Kernel};

    /// What is folded of a unit input by G of (a, b) on line x at this span, with this jump.
    struct Folded<'a>(&'a Fold, &'a [f64], &'a [f64], f64, f64, f64);

    impl Kernel for Folded<'_> {
        type Output = (f64, f64);
        #[inline(always)]
        fn run<L: Lanes>(self) -> (f64, f64) {
            let wide = |v: &[f64]| v.iter().map(|v| Wide::splat(*v)).collect::<Vec<_>>();
            let (a, b) = (wide(self.1), wide(self.2));
            let x = L::splat(self.3);
            let one = (L::splat(1.0), L::splat(0.0));
            let jump = L::splat(self.5);
            let found = self.0.of((&a, &b), &Images::new(&a, x, self.4), one, jump, true);
            let (mut re, mut im) = (Wide::ZERO, Wide::ZERO);
            found.0.store(&mut re);
            found.1.store(&mut im);
            (re.0[0], im.0[0])
        }
    }

    type C = (f64, f64);
    fn product(a: C, b: C) -> C {
        (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
    }
    fn over(a: C, b: C) -> C {
        let square = b.0 * b.0 + b.1 * b.1;
        let c = product(a, (b.0, -b.1));
        (c.0 / square, c.1 / square)
    }
    fn turn(phase: f64) -> C {
        (phase.cos(), phase.sin())
    }

    /// The sampled response of (d s + b)/(s + a), h = 1, to an input that changes `late` after each sample, over the
    /// input's own coefficient: written out sample by sample.
    fn sampled(hold: Hold, (a, b, d): (f64, f64, f64), late: f64, w: f64) -> C {
        let b = b - a * d; // the part without feedthrough
        let z = turn(w);
        let decay = |t: f64| (-a * t).exp();
        // ∫ e^{−a(t−σ)} dσ and ∫ e^{−a(t−σ)} σ dσ over 0..t.
        let one = |t: f64| (1.0 - decay(t)) / a;
        let ramp = |t: f64| (t - one(t)) / a;
        let late_by = turn(-w * late);
        let (gain, input) = match hold {
            Hold::Zoh => {
                let before = b * decay(1.0 - late) * one(late);
                let after = b * one(1.0 - late);
                let gain = over((before, 0.0), z);
                ((gain.0 + after, gain.1), over((1.0 - z.0, z.1), (0.0, w)))
            }
            Hold::Foh => {
                let falling = b * (one(1.0) - ramp(1.0));
                let rising = product((b * ramp(1.0), 0.0), z);
                let shape = (2.0 - 2.0 * w.cos()) / (w * w);
                ((falling + rising.0, rising.1), (shape, 0.0))
            }
        };
        let state = over(gain, (z.0 - decay(1.0), z.1));
        // A sample sees what came last.
        let direct = if late > 0.0 { over((d, 0.0), z) } else { (d, 0.0) };
        over((state.0 + direct.0, state.1 + direct.1), product(input, late_by))
    }

    #[test]
    fn foldings_are_the_sampled_response_less_the_response() {
        for (hold, late) in [
            (Hold::Zoh, 0.0),
            (Hold::Zoh, 0.05),
            (Hold::Zoh, 0.5),
            (Hold::Zoh, 0.9),
            (Hold::Foh, 0.0),
        ] {
            let fold = Fold::new(hold, [3.0 + late; LANES]);
            for system @ (a, b, d) in [(0.3, 1.0, 0.0), (2.0, -1.5, 0.0), (0.7, 1.0, 0.4)] {
                for w in [0.01, 0.3, 0.8, 1.6, 2.5] {
                    let numerator = if d == 0.0 { vec![b] } else { vec![d, b] };
                    let found = Isa::Plain.run(Folded(&fold, &[a], &numerator, w, TAU, 0.0));
                    let own = over((b, d * w), (a, w));
                    let all = sampled(hold, system, late, w);
                    let size = all.0.hypot(all.1);
                    let gap = (found.0 - (all.0 - own.0)).hypot(found.1 - (all.1 - own.1));
                    assert!(gap < 2e-3 * size, "{hold:?} {late} {system:?} {w}: {gap} of {size}");
                }
            }
        }
    }

    #[test]
    fn a_jump_at_a_sample_counts_only_where_outputs_see_it_at_once() {
        let fold = Fold::new(Hold::Zoh, [2.0; LANES]);
        for (numerator, through) in [(vec![1.0], 0.0), (vec![0.4, 1.0], 0.4)] {
            let at = |jump: f64| Isa::Plain.run(Folded(&fold, &[0.7], &numerator, 0.8, TAU, jump));
            // A sum over samples sees the mean of both values there, not the new one.
            let gap = -PI * through * 0.3 / TAU;
            let (with, without) = (at(0.3), at(0.0));
            assert!((with.0 - without.0 - gap).abs() < 1e-15, "{with:?} {without:?}");
            assert!((with.1 - without.1).abs() < 1e-15, "{with:?} {without:?}");
        }
    }

    #[test]
    fn two_poles_more_than_zeros_fold_by_the_fourth_power() {
        // 1/(s² + s + 1): Σ (1/s_j²)(x/x_j) of the leading term is x (1/X)³ Σ 1/j⁴-like sums, odd in j.
        let fold = Fold::new(Hold::Zoh, [0.0; LANES]);
        let at = |w: f64| Isa::Plain.run(Folded(&fold, &[1.0, 1.0], &[1.0], w, TAU, 0.0));
        let (low, high) = (at(0.02), at(0.04));
        assert!((high.0 / low.0 / 4.0 - 1.0).abs() < 0.01, "{low:?} {high:?}");
        assert!(low.0.abs() < 1e-5, "{low:?}");
    }
}
