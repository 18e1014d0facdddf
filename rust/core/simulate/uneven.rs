//! Exact responses at uneven instants: a step is a sum of powers of two of one time, and a rest.
//!
//! With the input straight within a step, w = Bu and its slope v, z = (x, w, v) obeys x' = Ax + w, w' = v. Over
//! τ = δ2ʲ that is x ← E x + F w + G v, and E, F, G of the doubled time follow from these. δ is so short that
//! ‖A‖δ ≤ ½; what is left of a step goes through the Taylor series of its derivatives, a dozen products of A
//! with a vector.

use super::{Error, StateSpace, dot, fits};
use crate::model::discretise::{balance, phi};
use crate::threads::stopped;

/// Where the terms of the Taylor series are below rounding.
const SMALL: f64 = f64::EPSILON / 16.0;

/// Beyond so many terms nothing converges: the numbers are at the edge of their range.
const TERMS: f64 = 40.0;

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
    for k in 0..samples {
        for i in 0..system.outputs {
            let now = u.iter().skip(k).step_by(samples).copied();
            y[i * samples + k] = dot(&c[i * n..][..n], motion.x.iter().copied())
                + dot(&system.d[i * inputs..][..inputs], now);
        }
        if k + 1 == samples {
            break;
        }
        if k.is_multiple_of(LOOK) && stopped() {
            return Err(Error::Cancelled);
        }
        let h = t[k + 1] - t[k];
        motion.w.fill(0.0);
        motion.v.fill(0.0);
        for (j, held) in held.iter().enumerate() {
            let (now, then) = (u[j * samples + k], u[j * samples + k + 1]);
            let slope = if *held { 0.0 } else { (then - now) / h };
            for i in 0..n {
                motion.w[i] += b[i * inputs + j] * now;
                motion.v[i] += b[i * inputs + j] * slope;
            }
        }
        motion.advance(h);
    }
    Ok(y)
}

/// E, F, G of a time τ.
struct Doubled {
    tau: f64,
    moves: [Vec<f64>; 3],
}

/// A state that moves by any step.
struct Motion {
    n: usize,
    a: Vec<f64>,
    norm: f64,
    /// By falling τ.
    doubled: Vec<Doubled>,
    x: Vec<f64>,
    w: Vec<f64>,
    v: Vec<f64>,
    term: Vec<f64>,
    next: Vec<f64>,
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
        }
        let zeros = || vec![0.0; n];
        Motion {
            n,
            a,
            norm,
            doubled,
            x: zeros(),
            w: zeros(),
            v: zeros(),
            term: zeros(),
            next: zeros(),
        }
    }

    /// The state h later, `w` and `v` being those of the step's beginning.
    fn advance(&mut self, h: f64) {
        let n = self.n;
        let mut left = h;
        for Doubled { tau, moves: [e, f, g] } in &self.doubled {
            if left < *tau {
                continue;
            }
            for i in 0..n {
                let row = i * n..(i + 1) * n;
                self.next[i] = dot(&e[row.clone()], self.x.iter().copied())
                    + dot(&f[row.clone()], self.w.iter().copied())
                    + dot(&g[row], self.v.iter().copied());
            }
            std::mem::swap(&mut self.x, &mut self.next);
            for (w, v) in self.w.iter_mut().zip(&self.v) {
                *w += tau * v;
            }
            left -= tau;
        }
        if left > 0.0 {
            self.rest(left);
        }
    }

    /// The Taylor series of a step with ‖A‖h ≤ ½.
    fn rest(&mut self, h: f64) {
        let n = self.n;
        // The k-th term is hᵏ/k! of the k-th derivative: Ax + w, A of that plus v, then A of the one before.
        self.term.copy_from_slice(&self.x);
        let (mut size, mut k) = (1.0, 1.0);
        while size > SMALL && k < TERMS {
            let by = h / k;
            for i in 0..n {
                let slope = dot(&self.a[i * n..(i + 1) * n], self.term.iter().copied());
                let driven = if k == 1.0 {
                    self.w[i]
                } else if k == 2.0 {
                    h * self.v[i]
                } else {
                    0.0
                };
                self.next[i] = by * (slope + driven);
            }
            std::mem::swap(&mut self.term, &mut self.next);
            for (x, term) in self.x.iter_mut().zip(&self.term) {
                *x += term;
            }
            // Beside what v brings, a term is small only by the products of A since the second.
            size *= if k > 2.0 { self.norm * by } else { 1.0 };
            k += 1.0;
        }
    }
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
