//! Integration against closed forms: orders of both methods, states of the past, escapes, repeated bits.
#![allow(clippy::disallowed_methods)]

use super::explicit::Explicit;
use super::implicit::Implicit;
use super::system::{Span, System};
use super::*;

fn op(name: &str, value: f64, a: usize, b: usize) -> crate::tape::Written {
    (name.into(), value, a, b)
}

/// x' = θ x + u.
fn decay() -> Tape {
    let ops = [
        op("input", 0.0, 1, 0),
        op("input", 0.0, 3, 0),
        op("multiply", 0.0, 0, 1),
        op("input", 0.0, 2, 0),
        op("add", 0.0, 2, 3),
    ];
    Tape::new(&ops, 4, vec![4]).expect("a tape")
}

/// y'' = −y.
fn oscillator() -> Tape {
    let ops = [
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 2, 0),
    ];
    Tape::new(&ops, 3, vec![1, 3]).expect("a tape")
}

/// y'' = θ (1 − y²) y' − y: van der Pol.
fn relaxation() -> Tape {
    let ops = [
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("input", 0.0, 3, 0),
        op("constant", 1.0, 0, 0),
        op("constant", -1.0, 0, 0),
        op("whole", 2.0, 0, 0),
        op("multiply", 0.0, 4, 5),
        op("add", 0.0, 3, 6),
        op("multiply", 0.0, 2, 7),
        op("multiply", 0.0, 8, 1),
        op("multiply", 0.0, 4, 0),
        op("add", 0.0, 9, 10),
    ];
    Tape::new(&ops, 4, vec![1, 11]).expect("a tape")
}

/// x'(t) = θ x(t − h).
fn late() -> Tape {
    let ops = [op("input", 0.0, 2, 0), op("input", 0.0, 3, 0), op("multiply", 0.0, 0, 1)];
    Tape::new(&ops, 4, vec![2]).expect("a tape")
}

fn problem<'a>(
    tape: &'a Tape,
    grid: &'a [f64],
    starts: &'a [f64],
    theta: &'a [f64],
) -> Problem<'a> {
    Problem {
        tape,
        grid,
        drives: &[],
        terms: 1,
        pasts: &[],
        starts,
        theta,
        count: 1,
        relative: 1e-9,
        absolute: &[1e-12; 2][..tape.results()],
        most: 100_000,
    }
}

fn done(problem: &Problem<'_>) -> Vec<f64> {
    match integrate(problem).expect("it fits") {
        Outcome::Done(x) => x,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_decay_driven_by_steps_follows_its_closed_form_for_each_start() {
    let (tape, grid) = (decay(), [0.0, 0.5, 1.0]);
    let x = done(&Problem {
        drives: &[1.0, 0.0],
        count: 2,
        ..problem(&tape, &grid, &[0.0, 2.0], &[-1.0, -3.0])
    });
    for (start, (theta, x0)) in [(-1.0_f64, 0.0), (-3.0, 2.0)].into_iter().enumerate() {
        let first = x0 * (0.5 * theta).exp() + (0.5 * theta).exp_m1() / theta;
        assert!((x[2 + start] - first).abs() < 1e-9, "{x:?}");
        assert!((x[4 + start] - first * (0.5 * theta).exp()).abs() < 1e-9, "{x:?}");
    }
}

/// Error at t = 1.6 of the oscillator by equal steps of a method.
fn at_equal_steps<M: Method>(make: impl Fn(&System<'_>) -> M, steps: usize) -> f64 {
    let (tape, end) = (oscillator(), 1.6);
    let grid = [0.0, end];
    let problem = Problem { relative: 1e-6, ..problem(&tape, &grid, &[1.0, 0.0], &[]) };
    let mut system = System::new(&problem).expect("it fits");
    let mut method = make(&system);
    let (mut x, mut new, h) = (vec![1.0, 0.0], vec![0.0; 2], end / steps as f64);
    for k in 0..steps {
        let at = Span { interval: 0, t: k as f64 * h, h };
        if k == 0 {
            method.begin(&mut system, at, &x);
        }
        method.step(&mut system, at, &x, &mut new);
        method.accept(&mut system, at, &x, &new);
        std::mem::swap(&mut x, &mut new);
    }
    (x[0] - end.cos()).abs().max((x[1] + end.sin()).abs())
}

#[test]
fn errors_fall_with_the_orders_of_the_methods() {
    let order = |coarse: f64, fine: f64| (coarse / fine).log2();
    let explicit = |steps| at_equal_steps(|system| Explicit::new(system.states), steps);
    assert!((order(explicit(2), explicit(4)) - 8.0).abs() < 1.0);
    let implicit = |steps| at_equal_steps(Implicit::new, steps);
    assert!((order(implicit(8), implicit(16)) - 5.0).abs() < 0.5);
    assert!(implicit(16) < 1e-7);
}

#[test]
fn a_state_of_the_past_is_the_method_of_steps_for_each_start() {
    // x' = −x(t − 1), x = 1 before 0: polynomials of rising degree on each unit.
    let exact = |t: f64| {
        (0..=4).fold(0.0, |sum, k| {
            let s =
                (t - f64::from(k) + 1.0).max(0.0) * f64::from(u8::from(t >= f64::from(k) - 1.0));
            let factorial: f64 = (1..=k).map(f64::from).product();
            sum + if k % 2 == 0 { 1.0 } else { -1.0 } * s.powi(k) / factorial
        })
    };
    let grid: Vec<f64> = (0..=30).map(|k| f64::from(k) * 0.1).collect();
    let pasts = [Past { state: 0, delay: 1.0 }];
    let tape = late();
    let whole =
        Problem { pasts: &pasts, count: 2, ..problem(&tape, &grid, &[1.0, 2.0], &[-1.0, -1.0]) };
    let x = done(&whole);
    for (t, x) in grid.iter().zip(x.chunks_exact(2)) {
        assert!((x[0] - exact(*t)).abs() < 1e-9, "{t} {x:?} {}", exact(*t));
        assert!((x[1] - 2.0 * exact(*t)).abs() < 2e-9, "{t} {x:?}");
    }
    assert_eq!(x, done(&whole), "the same bits again");
}

#[test]
fn a_delay_of_nothing_is_the_state_itself_and_old_steps_are_forgotten() {
    let tape = late();
    let grid: Vec<f64> = (0..=9000).map(|k| f64::from(k) * 1e-3).collect();
    let now = [Past { state: 0, delay: 0.0 }];
    let x = done(&Problem { pasts: &now, ..problem(&tape, &grid, &[1.0], &[-1.0]) });
    assert!((x[9000] / (-9.0_f64).exp() - 1.0).abs() < 1e-8);
    // x' = −x(t − h) with x = e^{rt} from a kink on: r = −e^{−rh} is met in the end.
    let pasts = [Past { state: 0, delay: 0.01 }];
    let x = done(&Problem { pasts: &pasts, ..problem(&tape, &grid, &[1.0], &[-1.0]) });
    let rate = (x[9000] / x[8000]).ln();
    assert!((rate + (-rate * 0.01).exp()).abs() < 1e-8, "{rate}");
}

#[test]
fn a_stiff_equation_goes_to_the_implicit_method_and_keeps_its_accuracy() {
    // x' = −10⁶ (x − cos t): on the slow solution but for the first microseconds.
    let ops = [
        op("input", 0.0, 1, 0),
        op("input", 0.0, 0, 0),
        op("cos", 0.0, 1, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 2, 3),
        op("add", 0.0, 0, 4),
        op("constant", -1e6, 0, 0),
        op("multiply", 0.0, 5, 6),
    ];
    let tape = Tape::new(&ops, 2, vec![7]).expect("a tape");
    let grid = [0.0, 1.0, 2.0];
    let x = done(&Problem { most: 5000, ..problem(&tape, &grid, &[0.0], &[]) });
    let exact = |t: f64| (1e12 * t.cos() + 1e6 * t.sin()) / (1e12 + 1.0);
    for k in 1..3 {
        assert!((x[k] - exact(grid[k])).abs() < 1e-9, "{x:?}");
    }
}

#[test]
fn a_stiff_oscillator_has_its_period_for_each_start() {
    // Van der Pol, μ = 1000: the period by Dorodnicyn's expansion.
    let (tape, mu) = (relaxation(), 1000.0_f64);
    let grid: Vec<f64> = (0..=4000).map(f64::from).collect();
    let starts = [2.0, 0.0, 2.0, 0.0];
    let x = done(&Problem { count: 2, ..problem(&tape, &grid, &starts, &[mu, mu]) });
    let y: Vec<f64> = x.chunks_exact(4).map(|x| x[0]).collect();
    assert!(x.chunks_exact(4).all(|x| (x[0] - x[2]).abs() < 1e-12));
    let falls: Vec<usize> = (1..y.len()).filter(|&k| y[k] < 0.0 && y[k - 1] >= 0.0).collect();
    let period = mu * (3.0 - 2.0 * 2.0_f64.ln()) + 7.014 * mu.powf(-1.0 / 3.0)
        - mu.ln() / (1.5 * mu)
        - 1.3246 / mu;
    assert!(((falls[1] - falls[0]) as f64 - period).abs() <= 1.0, "{falls:?} {period}");
}

#[test]
fn a_stiff_equation_looks_back_too() {
    // x' = −10⁵ x + 10⁵ x(t − 1) + 1, x = 0 before: x follows x(t − 1) + 10⁻⁵, a staircase of ramps.
    let ops = [
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 0, 2),
        op("add", 0.0, 1, 3),
        op("constant", 1e5, 0, 0),
        op("multiply", 0.0, 4, 5),
        op("constant", 1.0, 0, 0),
        op("add", 0.0, 6, 7),
    ];
    let tape = Tape::new(&ops, 3, vec![8]).expect("a tape");
    let grid = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];
    let pasts = [Past { state: 0, delay: 1.0 }];
    let x = done(&Problem { pasts: &pasts, ..problem(&tape, &grid, &[0.0], &[]) });
    for (t, x) in grid.iter().zip(&x) {
        // On the unit k the response is (k + 1) 10⁻⁵ but for what has died out by the middle.
        if t.fract() == 0.5 {
            assert!((x - 1e-5 * (t.floor() + 1.0)).abs() < 1e-12, "{t} {x}");
        }
    }
}

#[test]
fn an_escape_says_when_and_too_many_steps_say_where() {
    let ops = [op("input", 0.0, 1, 0), op("multiply", 0.0, 0, 0)];
    let tape = Tape::new(&ops, 2, vec![1]).expect("a tape");
    let grid = [0.0, 2.0];
    let escape = problem(&tape, &grid, &[1.0], &[]);
    let Outcome::Left(t) = integrate(&escape).expect("it fits") else {
        panic!("x' = x² leaves at t = 1");
    };
    assert!((t - 1.0).abs() < 1e-3, "{t}");
    let few = integrate(&Problem { most: 3, ..escape }).expect("it fits");
    assert!(matches!(few, Outcome::Stuck(t, largest) if t < 1.0 && largest >= 1.0), "{few:?}");
}

#[test]
fn sizes_that_do_not_fit_are_refused() {
    assert!(integrate(&problem(&decay(), &[0.0, 1.0], &[1.0], &[-1.0])).is_err());
}

#[test]
fn work_that_is_to_stop_stops() {
    let tape = oscillator();
    let grid = [0.0, 1e9];
    let long = Problem { most: usize::MAX, ..problem(&tape, &grid, &[1.0, 0.0], &[]) };
    let ended = crate::threads::asking(|| crate::threads::Control::Stop, || integrate(&long));
    assert!(matches!(ended, Err(Error::Cancelled)));
}
