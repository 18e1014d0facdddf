//! Duffing's oscillator y'' + ay' + by + cy³ = u with noise on y, as the core's tapes have it.

use modfun::estimate::terms::{Equations, Lag, Signal, Term};
use modfun::math::sin_cos_turns_1;
use modfun::quadrature::Rule;
use modfun::spectrum::Kind;
use modfun::tape::{Tape, Written};

pub const TRUE: [f64; 3] = [0.3, 1.0, 0.5];

pub fn drive(t: f64) -> f64 {
    // The core's own sine: the same bits on every system.
    let sin = |x: f64| sin_cos_turns_1(x / std::f64::consts::TAU).0;
    2.0 * sin(1.1 * t) + 1.5 * sin(2.3 * t + 1.0) + sin(0.45 * t)
}

/// Samples of y from a state, by 40 Runge–Kutta steps each, and of u.
pub fn record(count: usize, dt: f64, start: [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    let slope = |t: f64, x: [f64; 2]| {
        [x[1], drive(t) - TRUE[0] * x[1] - TRUE[1] * x[0] - TRUE[2] * x[0] * x[0] * x[0]]
    };
    let steps = 40;
    let h = dt / f64::from(steps);
    let (mut x, mut y) = (start, vec![start[0]]);
    for k in 0..count - 1 {
        for j in 0..steps {
            let t = k as f64 * dt + f64::from(j) * h;
            let step = |a: [f64; 2], by: f64| [x[0] + by * a[0], x[1] + by * a[1]];
            let k1 = slope(t, x);
            let k2 = slope(t + h / 2.0, step(k1, h / 2.0));
            let k3 = slope(t + h / 2.0, step(k2, h / 2.0));
            let k4 = slope(t + h, step(k3, h));
            for i in 0..2 {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        y.push(x[0]);
    }
    (y, (0..count).map(|k| drive(k as f64 * dt)).collect())
}

/// A line of a tape.
pub fn op(name: &str, value: f64, a: usize, b: usize) -> Written {
    (name.to_owned(), value, a, b)
}

/// Channels y, u; signals y, y³ − 3σ²y, u and the slopes 1, 3y² − 3σ².
pub fn equations(rule: Rule) -> Equations {
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("whole", 3.0, 0, 0),
        op("constant", -3.0, 0, 0),
        op("multiply", 0.0, 4, 2),
        op("multiply", 0.0, 5, 0),
        op("add", 0.0, 3, 6),
        op("constant", 1.0, 0, 0),
        op("whole", 2.0, 0, 0),
        op("constant", 3.0, 0, 0),
        op("multiply", 0.0, 10, 9),
        op("add", 0.0, 11, 5),
    ];
    let coefficients = [
        op("constant", 1.0, 0, 0),
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -1.0, 0, 0),
    ];
    let signal = Signal { kind: Kind::Rule(rule).into(), lag: Lag::Known(0.0) };
    let term = |signal, order| Term { equation: 0, signal, order };
    Equations {
        orders: vec![2],
        signals: vec![signal; 3],
        terms: vec![term(0, 2), term(0, 1), term(0, 0), term(1, 0), term(2, 0)],
        coefficients: Tape::new(&coefficients, 3, vec![0, 1, 2, 3, 4, 0, 0, 0]).unwrap(),
        slopes: vec![(1, 0), (2, 1), (3, 2)],
        samples: Tape::new(&formulas, 6, vec![0, 7, 1, 8, 12]).unwrap(),
        sensitivities: vec![(0, 0), (1, 0)],
        signal_slopes: Vec::new(),
        channels: 2,
        noisy: vec![0],
        parameters: 3,
        starts: vec![None; 3],
        near: false,
        bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); 3],
        linear: true,
    }
}
