//! Exact responses of linear systems to sampled inputs, from sample to sample.

mod uneven;

use crate::Error;
use crate::model::StateSpace;
use crate::model::discretise::phi;
use crate::quadrature::gauss_legendre;

pub use uneven::simulate_uneven;

/// Gauss–Legendre nodes inside each sample of a smooth input.
pub const NODES: usize = 6;

/// Intervals that no machine holds the samples of.
const MOST: usize = 1 << 36;

/// How an input runs between the samples; all arrays (input, time), row by row.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// Constant from each sample to the next: (inputs, N+1).
    Zoh(&'a [f64]),
    /// Straight from each sample to the next: (inputs, N+1).
    Foh(&'a [f64]),
    /// Smooth: (inputs, N+1), which serves D·u, and the values at the nodes inside each sample,
    /// (inputs, N, [`NODES`]), at t_k + h·s with s from [`gauss_legendre`].
    Smooth(&'a [f64], &'a [f64]),
}

/// Outputs (outputs, N+1) of `system` from the state `x0` on, at the samples 0…`intervals`, `dt` seconds apart.
///
/// Held inputs are exact. A smooth input goes through Gauss–Legendre quadrature of the convolution
/// ∫ e^{A(h−σ)} B u(t_k+σ) dσ, exact for integrands of degree 11 inside a sample: sample so that
/// neither the input nor the fastest pole turns by more than about a radian a sample.
///
/// # Errors
/// [`Error::Spec`] for matrices that do not fit or are not finite or a `dt` that is not positive,
/// [`Error::Data`] for arrays that do not fit.
pub fn simulate(
    system: &StateSpace<'_>,
    x0: &[f64],
    input: Input<'_>,
    dt: f64,
    intervals: usize,
) -> Result<Vec<f64>, Error> {
    system.check()?;
    if !(dt > 0.0 && dt.is_finite()) {
        return Err(Error::Spec(format!("the sampling interval is {dt} s; give a positive one")));
    }
    let (n, inputs) = (system.states, system.inputs);
    let samples = match input {
        Input::Zoh(u) | Input::Foh(u) | Input::Smooth(u, _) => u,
    };
    if intervals > MOST {
        return Err(Error::Data(format!("simulating: {intervals} intervals; take at most {MOST}")));
    }
    fits("the initial state", x0.len(), n)?;
    fits("the input", samples.len(), inputs * (intervals + 1))?;
    if let Input::Smooth(_, nodes) = input {
        fits("the input between the samples", nodes.len(), inputs * intervals * NODES)?;
    }
    let step = Step::new(system, dt, &input);
    let mut y = vec![0.0; system.outputs * (intervals + 1)];
    let (mut x, mut next) = (x0.to_vec(), vec![0.0; n]);
    for k in 0..=intervals {
        for (i, y) in y.chunks_exact_mut(intervals + 1).enumerate() {
            y[k] = dot(&system.c[i * n..][..n], x.iter().copied())
                + dot(
                    &system.d[i * inputs..][..inputs],
                    samples.chunks_exact(intervals + 1).map(|u| u[k]),
                );
        }
        if k == intervals {
            break;
        }
        for (i, next) in next.iter_mut().enumerate() {
            *next = dot(&step.free[i * n..][..n], x.iter().copied());
            for (place, gain) in step.gains.iter().enumerate() {
                let value = |j: usize| match input {
                    Input::Smooth(_, nodes) => nodes[(j * intervals + k) * NODES + place],
                    _ => samples[j * (intervals + 1) + k + place],
                };
                *next += dot(&gain[i * inputs..][..inputs], (0..inputs).map(value));
            }
        }
        std::mem::swap(&mut x, &mut next);
    }
    Ok(y)
}

/// x_{k+1} = free · x_k + Σ gains · (the input values of the sample).
struct Step {
    free: Vec<f64>,
    gains: Vec<Vec<f64>>,
}

impl Step {
    fn new(system: &StateSpace<'_>, dt: f64, input: &Input<'_>) -> Step {
        let over = |part: f64| {
            let scaled: Vec<f64> = system.a.iter().map(|a| a * (dt * part)).collect();
            phi(system.states, &scaled)
        };
        let [free, one, two] = over(1.0);
        let gain = |matrix: &[f64], by: f64| {
            let (n, p) = (system.states, system.inputs);
            let entry = |k: usize| {
                let column = system.b.iter().skip(k % p).step_by(p).copied();
                by * dot(&matrix[k / p * n..][..n], column)
            };
            (0..n * p).map(entry).collect::<Vec<f64>>()
        };
        let gains = match input {
            Input::Zoh(_) => vec![gain(&one, dt)],
            Input::Foh(_) => {
                let falling: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a - b).collect();
                vec![gain(&falling, dt), gain(&two, dt)]
            }
            Input::Smooth(..) => {
                let (nodes, weights) = gauss_legendre::<NODES>();
                let pairs = nodes.iter().zip(&weights);
                pairs.map(|(node, weight)| gain(&over(1.0 - node)[0], dt * weight)).collect()
            }
        };
        Step { free, gains }
    }
}

fn dot(row: &[f64], column: impl Iterator<Item = f64>) -> f64 {
    row.iter().zip(column).map(|(a, b)| a * b).sum()
}

fn fits(what: &str, got: usize, wanted: usize) -> Result<(), Error> {
    if got == wanted {
        return Ok(());
    }
    Err(Error::Data(format!(
        "simulating: {what} has {got} numbers instead of {wanted}; give arrays that fit the model"
    )))
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OSCILLATOR: StateSpace<'_> = StateSpace {
        a: &[0.0, 1.0, -4.0, 0.0],
        b: &[0.0, 4.0],
        c: &[1.0, 0.0],
        d: &[0.0],
        states: 2,
        inputs: 1,
        outputs: 1,
    };

    fn first_order(a: &[f64; 1]) -> StateSpace<'_> {
        StateSpace { a, b: &[1.0], c: &[1.0], d: &[0.0], states: 1, inputs: 1, outputs: 1 }
    }

    #[test]
    fn held_steps_and_ramps_have_their_closed_forms() {
        let (n, h) = (200, 0.05);
        let time = |k: usize| k as f64 * h;
        let ramp: Vec<f64> = (0..=n).map(time).collect();
        for rate in [0.0_f64, 0.3, 2.0] {
            let a = [-rate];
            let step =
                simulate(&first_order(&a), &[0.5], Input::Zoh(&vec![1.0; n + 1]), h, n).unwrap();
            let slope = simulate(&first_order(&a), &[0.5], Input::Foh(&ramp), h, n).unwrap();
            for k in 0..=n {
                let t = time(k);
                let fade = (-rate * t).exp();
                let (one, two) = if rate == 0.0 {
                    (t, 0.5 * t * t)
                } else {
                    ((1.0 - fade) / rate, (t - (1.0 - fade) / rate) / rate)
                };
                assert!((step[k] - 0.5 * fade - one).abs() < 1e-12, "{rate} {k}");
                assert!((slope[k] - 0.5 * fade - two).abs() < 1e-11, "{rate} {k}");
            }
        }
    }

    #[test]
    fn an_undamped_oscillator_keeps_its_amplitude_and_follows_a_smooth_input() {
        let (n, h) = (2000, 0.05);
        let free = simulate(&OSCILLATOR, &[1.0, 0.0], Input::Zoh(&vec![0.0; n + 1]), h, n).unwrap();
        // y'' + 4y = 4 sin t from rest: y = (4 sin t − 2 sin 2t)/3.
        let (places, _) = gauss_legendre::<NODES>();
        let time = |k: usize| k as f64 * h;
        let u: Vec<f64> = (0..=n).map(|k| time(k).sin()).collect();
        let nodes: Vec<f64> =
            (0..n).flat_map(|k| places.map(|s| (time(k) + s * h).sin())).collect();
        let forced = simulate(&OSCILLATOR, &[0.0, 0.0], Input::Smooth(&u, &nodes), h, n).unwrap();
        for k in 0..=n {
            let t = time(k);
            assert!((free[k] - (2.0 * t).cos()).abs() < 1e-11, "{k}");
            assert!(
                (forced[k] - (4.0 * t.sin() - 2.0 * (2.0 * t).sin()) / 3.0).abs() < 1e-11,
                "{k}"
            );
        }
    }

    #[test]
    fn inputs_and_outputs_keep_their_places() {
        // Two decoupled integrators, outputs swapped, with feedthrough of the second input to the first output.
        let system = StateSpace {
            a: &[0.0; 4],
            b: &[1.0, 0.0, 0.0, 2.0],
            c: &[0.0, 1.0, 1.0, 0.0],
            d: &[0.0, 10.0, 0.0, 0.0],
            states: 2,
            inputs: 2,
            outputs: 2,
        };
        let u = [1.0, 1.0, 1.0, 3.0, 3.0, 3.0];
        let y = simulate(&system, &[0.0, 0.0], Input::Zoh(&u), 0.5, 2).unwrap();
        assert_eq!(y, [30.0, 33.0, 36.0, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn no_inputs_and_no_states_are_systems_too() {
        let free =
            StateSpace { a: &[-1.0], b: &[], c: &[2.0], d: &[], states: 1, inputs: 0, outputs: 1 };
        let y = simulate(&free, &[1.0], Input::Zoh(&[]), 1.0, 1).unwrap();
        assert!((y[1] - 2.0 * (-1.0_f64).exp()).abs() < 1e-15);
        let gain =
            StateSpace { a: &[], b: &[], c: &[], d: &[3.0], states: 0, inputs: 1, outputs: 1 };
        assert_eq!(simulate(&gain, &[], Input::Foh(&[1.0, 2.0]), 1.0, 1).unwrap(), [3.0, 6.0]);
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let a = [f64::NAN];
        let zeros = [0.0; 3];
        let run = |s: &StateSpace<'_>, x0: &[f64], dt| simulate(s, x0, Input::Zoh(&zeros), dt, 2);
        assert!(
            matches!(run(&first_order(&a), &[0.0], 1.0), Err(Error::Spec(m)) if m.contains("(0, 0) of A"))
        );
        assert!(
            matches!(run(&first_order(&[1.0]), &[], 1.0), Err(Error::Data(m)) if m.contains("initial state"))
        );
        assert!(matches!(run(&first_order(&[1.0]), &[0.0], 0.0), Err(Error::Spec(_))));
        let wrong = StateSpace { b: &[1.0, 2.0], ..first_order(&[1.0]) };
        assert!(
            matches!(run(&wrong, &[0.0], 1.0), Err(Error::Spec(m)) if m.contains("B must be 1 × 1"))
        );
        let short = simulate(&OSCILLATOR, &[0.0, 0.0], Input::Smooth(&[0.0; 2], &[0.0; 5]), 1.0, 1);
        assert!(matches!(short, Err(Error::Data(m)) if m.contains("5 numbers instead of 6")));
    }

    proptest! {
        #[test]
        fn a_smooth_input_through_node_values_of_a_line_is_the_foh(
            entries in prop::collection::vec(-1.0f64..1.0, 9), b in prop::collection::vec(-1.0f64..1.0, 3),
            u in prop::collection::vec(-1.0f64..1.0, 8),
        ) {
            let system = StateSpace {
                a: &entries, b: &b, c: &[1.0, 0.0, -1.0], d: &[0.5], states: 3, inputs: 1, outputs: 1,
            };
            let (places, _) = gauss_legendre::<NODES>();
            let n = u.len() - 1;
            let nodes: Vec<f64> =
                (0..n).flat_map(|k| places.map(|s| u[k] + (u[k + 1] - u[k]) * s)).collect();
            let x0 = [0.3, -1.0, 2.0];
            let smooth = simulate(&system, &x0, Input::Smooth(&u, &nodes), 0.2, n).unwrap();
            let foh = simulate(&system, &x0, Input::Foh(&u), 0.2, n).unwrap();
            for (a, b) in smooth.iter().zip(&foh) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }
    }
}
