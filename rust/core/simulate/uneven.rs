//! Exact responses at uneven instants: a step is a sum of powers of two of one time, and a rest.
//!
//! With the input straight within a step, w = Bu and its slope v, z = (x, w, v) obeys x' = Ax + w, w' = v. Over
//! τ = δ2ʲ that is x ← E x + F w + G v, and E, F, G of the doubled time follow from these. δ is so short that
//! ‖A‖δ ≤ ½; over a rest h, x ← x + h s + G (A s + v) with s = Ax + w. There G = h² Σ (Ah)ᵏ/(k + 2)! is a power
//! series in h alone, which is summed for eight steps at once.

use super::{Error, StateSpace, dot, fits};
use crate::model::discretise::{balance, phi};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::threads::stopped;

/// Where the terms of the Taylor series are below rounding.
const SMALL: f64 = f64::EPSILON / 16.0;

/// Terms at ‖A‖h = ½; beyond them nothing converges and the numbers are at the edge of their range.
const TERMS: usize = 16;

/// Steps between two looks at whether the work is to end.
const LOOK: usize = 4096;

/// Doublings: as many as numbers have binary places of either sign.
const MOST: usize = 2100;

/// Outputs (outputs, samples) of `system` at instants `t` from the state `x0` on.
///
/// `u` is (inputs, samples). Between the samples an input is held where `held` says so, else straight.
///
/// # Errors
/// [`Error::Spec`] for matrices that do not fit or are not finite, [`Error::Data`] for arrays that do not fit
/// and instants that do not rise, [`Error::Cancelled`] where the work is to stop.
pub fn simulate_uneven(
    system: &StateSpace<'_>,
    x0: &[f64],
    u: &[f64],
    held: &[bool],
    t: &[f64],
) -> Result<Vec<f64>, Error> {
    system.check()?;
    let (n, inputs, samples) = (system.states, system.inputs, t.len());
    fits("the initial state", x0.len(), n)?;
    fits("the form of the input", held.len(), inputs)?;
    fits("the input", u.len(), inputs * samples)?;
    if let Some(k) =
        t.windows(2).position(|ends| !(ends[0] < ends[1] && ends[1] - ends[0] < f64::INFINITY))
    {
        return Err(Error::Data(format!(
            "simulating: instant {} is {} s and follows {} s; give rising instants",
            k + 1,
            t[k + 1],
            t[k]
        )));
    }
    let longest = t.windows(2).map(|ends| ends[1] - ends[0]).fold(0.0, f64::max);
    let (a, scale) = balance(n, system.a);
    let b: Vec<f64> = (0..n * inputs).map(|k| system.b[k] / scale[k / inputs]).collect();
    let c: Vec<f64> = (0..system.outputs * n).map(|k| system.c[k] * scale[k % n]).collect();
    let mut motion = Motion::new(n, a, longest);
    for (k, (to, by)) in motion.x.iter_mut().zip(&scale).enumerate() {
        *to = x0[k] / by;
    }
    let mut y = vec![0.0; system.outputs * samples];
    let run = Run { isa: Isa::detect()?, b: &b, c: &c, d: system.d, u, held, t, motion, y: &mut y };
    match n {
        1 => run.steps::<1>()?,
        2 => run.steps::<2>()?,
        3 => run.steps::<3>()?,
        4 => run.steps::<4>()?,
        5 => run.steps::<5>()?,
        6 => run.steps::<6>()?,
        _ => run.steps::<0>()?,
    }
    Ok(y)
}

/// A simulation about to begin.
struct Run<'a> {
    isa: Isa,
    b: &'a [f64],
    c: &'a [f64],
    d: &'a [f64],
    u: &'a [f64],
    held: &'a [bool],
    t: &'a [f64],
    motion: Motion,
    y: &'a mut [f64],
}

impl Run<'_> {
    /// All steps of a system of N states; of any number where N is 0.
    fn steps<const N: usize>(mut self) -> Result<(), Error> {
        let (n, samples) = (self.motion.x.len(), self.t.len());
        let n = if N == 0 { n } else { N };
        let inputs = self.held.len();
        for k in 0..samples {
            for (i, y) in self.y.chunks_exact_mut(samples).enumerate() {
                let now = (0..inputs).map(|j| self.u[j * samples + k]);
                y[k] = dot(&self.c[i * n..][..n], self.motion.x[..n].iter().copied())
                    + dot(&self.d[i * inputs..][..inputs], now);
            }
            if k + 1 == samples {
                break;
            }
            if k.is_multiple_of(LOOK) && stopped() {
                return Err(Error::Cancelled);
            }
            if k.is_multiple_of(LANES) {
                self.motion.prepare(self.isa, &self.t[k..samples.min(k + LANES + 1)]);
            }
            let h = self.t[k + 1] - self.t[k];
            let Motion { w, v, .. } = &mut self.motion;
            let (w, v) = (&mut w[..n], &mut v[..n]);
            w.fill(0.0);
            v.fill(0.0);
            for (j, held) in self.held.iter().enumerate() {
                let (now, then) = (self.u[j * samples + k], self.u[j * samples + k + 1]);
                let slope = if *held { 0.0 } else { (then - now) / h };
                for i in 0..n {
                    w[i] += self.b[i * inputs + j] * now;
                    v[i] += self.b[i * inputs + j] * slope;
                }
            }
            self.motion.advance::<N>(h, k % LANES);
        }
        Ok(())
    }
}

/// E, F, G of a time τ.
struct Doubled {
    tau: f64,
    moves: [Vec<f64>; 3],
}

/// A state that moves by any step.
struct Motion {
    /// Of A; all matrices here stand column after column.
    columns: Vec<f64>,
    /// By falling τ.
    doubled: Vec<Doubled>,
    /// (Aδ)ᵏ/(k + 2)!, the terms of an entry side by side; and δ, which no rest exceeds.
    series: Vec<f64>,
    span: f64,
    /// G of the rests of eight steps.
    rests: Vec<Wide>,
    x: Vec<f64>,
    w: Vec<f64>,
    v: Vec<f64>,
    next: Vec<f64>,
    bend: Vec<f64>,
}

/// G = h² Σ (Aδ)ᵏ/(k + 2)! (h/δ)ᵏ for eight h.
struct Series<'a> {
    series: &'a [f64],
    span: f64,
    h: Wide,
    out: &'a mut [Wide],
}

impl Kernel for Series<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        if self.out.is_empty() {
            return;
        }
        let h = L::load(&self.h);
        let (part, square) = (h / L::splat(self.span), h * h);
        let terms = self.series.len() / self.out.len();
        for (entry, out) in self.series.chunks_exact(terms).zip(self.out) {
            let mut sum = L::splat(0.0);
            for term in entry.iter().rev() {
                sum = sum.mul_add(part, L::splat(*term));
            }
            (sum * square).store(out);
        }
    }
}

impl Motion {
    fn new(n: usize, a: Vec<f64>, longest: f64) -> Motion {
        let column = |j: usize| (0..n).map(|i| a[i * n + j].abs()).sum::<f64>();
        let norm = (0..n).map(column).fold(0.0, f64::max);
        // A power of two, so that differences of steps and multiples are exact.
        let mut tau = 1.0;
        while tau * norm > 0.5 && tau > 0.0 {
            tau *= 0.5;
        }
        while tau < longest && tau * norm <= 0.25 {
            tau *= 2.0;
        }
        let mut doubled = Vec::new();
        if tau <= longest && tau > 0.0 {
            let scaled: Vec<f64> = a.iter().map(|a| a * tau).collect();
            let [e, one, two] = phi(n, &scaled);
            let times = |m: Vec<f64>, by: f64| m.into_iter().map(|m| m * by).collect::<Vec<f64>>();
            let mut last = Doubled { tau, moves: [e, times(one, tau), times(two, tau * tau)] };
            while 2.0 * last.tau <= longest && doubled.len() < MOST {
                let next = last.twice(n);
                doubled.push(std::mem::replace(&mut last, next));
            }
            doubled.push(last);
            doubled.reverse();
            for matrix in doubled.iter_mut().flat_map(|doubled| &mut doubled.moves) {
                *matrix = turned(n, matrix);
            }
        }
        let zeros = || vec![0.0; n];
        let span = tau.min(longest).max(f64::MIN_POSITIVE);
        Motion {
            series: series(n, &turned(n, &a), span, norm * span),
            columns: turned(n, &a),
            doubled,
            span,
            rests: vec![Wide::ZERO; n * n],
            x: zeros(),
            w: zeros(),
            v: zeros(),
            next: zeros(),
            bend: zeros(),
        }
    }

    /// Makes G of the rests of up to eight steps that lie between the instants `t`.
    fn prepare(&mut self, isa: Isa, t: &[f64]) {
        let mut h = Wide::ZERO;
        for (h, ends) in h.0.iter_mut().zip(t.windows(2)) {
            *h = ends[1] - ends[0];
            for Doubled { tau, .. } in &self.doubled {
                if *h >= *tau {
                    *h -= tau;
                }
            }
        }
        isa.run(Series { series: &self.series, span: self.span, h, out: &mut self.rests });
    }

    /// The state h later, `w` and `v` being those of the step's beginning; its rest was prepared in `lane`.
    #[inline(always)]
    fn advance<const N: usize>(&mut self, h: f64, lane: usize) {
        let n = if N == 0 { self.x.len() } else { N };
        let Motion { columns, doubled, rests, x, w, v, next, bend, .. } = self;
        let (x, next) = (&mut x[..n], &mut next[..n]);
        let (w, v, bend) = (&mut w[..n], &v[..n], &mut bend[..n]);
        let mut left = h;
        for Doubled { tau, moves: [e, f, g] } in doubled {
            if left < *tau {
                continue;
            }
            next.fill(0.0);
            add_product::<N>(e, x, next);
            add_product::<N>(f, w, next);
            add_product::<N>(g, v, next);
            x.copy_from_slice(next);
            for (w, v) in w.iter_mut().zip(v) {
                *w += *tau * v;
            }
            left -= *tau;
        }
        if left > 0.0 {
            // ‖A‖h ≤ ½
            next.copy_from_slice(w);
            add_product::<N>(columns, x, next);
            bend.copy_from_slice(v);
            add_product::<N>(columns, next, bend);
            for (j, bend) in bend.iter().enumerate() {
                for (i, x) in x.iter_mut().enumerate() {
                    *x += rests[j * n + i].0[lane] * bend;
                }
            }
            for (x, slope) in x.iter_mut().zip(next) {
                *x += left * *slope;
            }
        }
    }
}

/// Adds the product of a matrix, column after column, with a vector of N numbers (any number where N is 0).
#[inline(always)]
fn add_product<const N: usize>(columns: &[f64], x: &[f64], to: &mut [f64]) {
    let n = if N == 0 { to.len() } else { N };
    let to = &mut to[..n];
    for (k, x) in x[..n].iter().enumerate() {
        for (to, a) in to.iter_mut().zip(&columns[k * n..][..n]) {
            *to += a * x;
        }
    }
}

/// A matrix, row after row, as columns, and back.
fn turned(n: usize, rows: &[f64]) -> Vec<f64> {
    (0..n * n).map(|k| rows[k % n * n + k / n]).collect()
}

/// (Aδ)ᵏ/(k + 2)! as far as they count where ‖A‖δ is `norm`; the terms of an entry side by side.
fn series(n: usize, a: &[f64], span: f64, norm: f64) -> Vec<f64> {
    let mut terms =
        vec![Vec::from_iter((0..n * n).map(|e| if e % (n + 1) == 0 { 0.5 } else { 0.0 }))];
    let mut size = 1.0;
    while terms.len() < TERMS && size > SMALL {
        let (last, by) = (&terms[terms.len() - 1], span / (terms.len() + 2) as f64);
        let mut next = vec![0.0; n * n];
        for i in 0..n {
            for k in 0..n {
                let factor = a[i * n + k] * by;
                for j in 0..n {
                    next[i * n + j] += factor * last[k * n + j];
                }
            }
        }
        size *= norm / (terms.len() + 2) as f64;
        terms.push(next);
    }
    (0..n * n).flat_map(|e| terms.iter().map(move |term| term[e])).collect()
}

impl Doubled {
    /// The same for twice the time.
    fn twice(&self, n: usize) -> Doubled {
        let [e, f, g] = &self.moves;
        let mut moves = [vec![0.0; n * n], f.clone(), g.clone()];
        for i in 0..n {
            for k in 0..n {
                let factor = e[i * n + k];
                for j in 0..n {
                    moves[0][i * n + j] += factor * e[k * n + j];
                    moves[1][i * n + j] += factor * f[k * n + j];
                    moves[2][i * n + j] += factor * g[k * n + j];
                }
            }
        }
        for (g, f) in moves[2].iter_mut().zip(f) {
            *g += self.tau * f;
        }
        Doubled { tau: 2.0 * self.tau, moves }
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::super::{Input, simulate};
    use super::*;

    const OSCILLATOR: StateSpace<'_> = StateSpace {
        a: &[0.0, 1.0, -4.0, -0.4],
        b: &[0.0, 1.0, 4.0, 0.0],
        c: &[1.0, 0.0, 0.0, 1.0],
        d: &[0.5, 0.0, 0.0, 0.0],
        states: 2,
        inputs: 2,
        outputs: 2,
    };

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    /// Instants with steps from a thousandth to 2ⁿ of a second.
    fn instants(count: usize, most: f64) -> Vec<f64> {
        (0..count)
            .scan(-3.0, |t, k| {
                *t += 1e-3 + most * (value(k) + 0.5).powi(4);
                Some(*t)
            })
            .collect()
    }

    #[test]
    fn at_even_instants_it_is_the_even_simulation() {
        let (n, h) = (300, 0.13);
        let t: Vec<f64> = (0..=n).map(|k| k as f64 * h).collect();
        let u: Vec<f64> = (0..2 * (n + 1)).map(value).collect();
        let x0 = [1.0, -2.0];
        for (held, input) in [(true, Input::Zoh(&u)), (false, Input::Foh(&u))] {
            let even = simulate(&OSCILLATOR, &x0, input, h, n).unwrap();
            let uneven = simulate_uneven(&OSCILLATOR, &x0, &u, &[held; 2], &t).unwrap();
            for (a, b) in even.iter().zip(&uneven) {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
        }
    }

    #[test]
    fn first_order_systems_follow_their_closed_form_however_fast_they_are() {
        for rate in [0.0, 1e-9, -0.3, -40.0, -3e5, 2.0] {
            let one = [rate];
            let system = StateSpace {
                a: &one,
                b: &[1.0],
                c: &[1.0],
                d: &[0.0],
                states: 1,
                inputs: 1,
                outputs: 1,
            };
            let t = instants(50, 1.0);
            let u: Vec<f64> = (0..50).map(value).collect();
            let y = simulate_uneven(&system, &[0.7], &u, &[false], &t).unwrap();
            let (mut x, mut size) = (0.7, 0.7_f64);
            for k in 1..50 {
                let h = t[k] - t[k - 1];
                let z = rate * h;
                let (one, two) = if z.abs() < 1e-5 {
                    (1.0 + z / 2.0, 0.5 + z / 6.0)
                } else {
                    (z.exp_m1() / z, (z.exp_m1() - z) / (z * z))
                };
                x = z.exp() * x + h * (one * u[k - 1] + two * (u[k] - u[k - 1]));
                size = size.max(x.abs());
                assert!((y[k] - x).abs() < 1e-12 * size, "{rate} {k}: {} {x}", y[k]);
            }
        }
    }

    #[test]
    fn a_step_in_parts_is_the_whole_step_and_bits_repeat() {
        let t = instants(80, 30.0);
        let u: Vec<f64> = (0..160).map(value).collect();
        let held = [true, false];
        let y = simulate_uneven(&OSCILLATOR, &[1.0, 0.0], &u, &held, &t).unwrap();
        assert_eq!(y, simulate_uneven(&OSCILLATOR, &[1.0, 0.0], &u, &held, &t).unwrap());
        // A third of each step further, where the held input holds and the other is on its line.
        let finer: Vec<f64> =
            t.windows(2).flat_map(|ends| [ends[0], ends[0] + (ends[1] - ends[0]) / 3.0]).collect();
        let mut finer_u = Vec::new();
        for (j, held) in held.iter().enumerate() {
            for k in 0..79 {
                let (now, then) = (u[j * 80 + k], u[j * 80 + k + 1]);
                finer_u.extend([now, if *held { now } else { now + (then - now) / 3.0 }]);
            }
        }
        let parts = simulate_uneven(&OSCILLATOR, &[1.0, 0.0], &finer_u, &held, &finer).unwrap();
        for k in 0..79 {
            assert!((y[k] - parts[2 * k]).abs() < 1e-12, "{k}");
            assert!((y[80 + k] - parts[158 + 2 * k]).abs() < 1e-12, "{k}");
        }
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let run = |u: &[f64], held: &[bool], t: &[f64]| match simulate_uneven(
            &OSCILLATOR,
            &[0.0; 2],
            u,
            held,
            t,
        ) {
            Err(Error::Data(text)) => text,
            other => panic!("{other:?}"),
        };
        assert!(run(&[0.0; 4], &[true; 2], &[0.0, 0.0]).contains("rising"));
        assert!(run(&[0.0; 4], &[true; 2], &[0.0, f64::NAN]).contains("rising"));
        assert!(run(&[0.0; 4], &[true; 2], &[f64::NEG_INFINITY, 0.0]).contains("rising"));
        assert!(run(&[0.0; 3], &[true; 2], &[0.0, 1.0]).contains("the input"));
        assert!(run(&[0.0; 4], &[true], &[0.0, 1.0]).contains("form"));
    }

    #[test]
    fn no_states_no_inputs_and_endless_steps_are_systems_too() {
        let gain =
            StateSpace { a: &[], b: &[], c: &[], d: &[3.0], states: 0, inputs: 1, outputs: 1 };
        let y = simulate_uneven(&gain, &[], &[1.0, 2.0], &[false], &[0.0, 5.0]).unwrap();
        assert_eq!(y, [3.0, 6.0]);
        let free =
            StateSpace { a: &[-1.0], b: &[], c: &[2.0], d: &[], states: 1, inputs: 0, outputs: 1 };
        let y = simulate_uneven(&free, &[1.0], &[], &[], &[0.0, 1e-300, 1.0, 1e300]).unwrap();
        assert!(y[1] == 2.0 && (y[2] - 2.0 * (-1.0_f64).exp()).abs() < 1e-15 && y[3] == 0.0);
        let wild = StateSpace { a: &[1e300], ..free };
        assert!(!simulate_uneven(&wild, &[1.0], &[], &[], &[0.0, 1.0]).unwrap()[1].is_finite());
    }
}
