//! Equations: fits held to the noise of every sample, to transfer functions where linear, to bounds and lags.

use super::dense::{gradient, same_covariance};
use super::duffing::{self, op};
use super::fast::{self, OPTIONS};
use super::sampled::{COUNT, DT, Gained, Oracle, Sampled, same};
use super::signals::noisy;
use modfun::Status;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsFit, TermsFitter, TermsOptions, TermsRecord,
};
use modfun::estimate::{Band, Time};
use modfun::quadrature::{Hold, Rule};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Noise, Trend};
use modfun::tape::{Tape, Written};

pub fn options(equations: Equations, method: Method, last: Band, levels: &[f64]) -> TermsOptions {
    TermsOptions {
        equations,
        rule: Rule::Trapezoid,
        method,
        noise: Noise::Output,
        shapes: Vec::new(),
        trend: Trend::None,
        band: last,
        levels: Some(levels.to_vec()),
        levels_matter: true,
        learn: false,
        coloured: false,
        priors: vec![],
        options: OPTIONS,
    }
}

pub fn fit(o: &TermsOptions, dt: f64, records: &[Vec<&[f64]>]) -> TermsFit {
    let sampling: Vec<_> = records.iter().map(|r| (r[0].len(), Time::Even(dt))).collect();
    let records: Vec<_> = records.iter().map(|r| TermsRecord { channels: r.clone() }).collect();
    TermsFitter::new(o.clone(), &sampling, &[], Isa::detect().unwrap())
        .unwrap()
        .fit(&records)
        .unwrap()
}

/// Equations linear in so many parameters: terms as the oracle has them, samples as a tape.
fn equations(
    (orders, terms, parameters): (Vec<usize>, &[Gained], usize),
    (formulas, results, signals): (&[Written], Vec<usize>, usize),
    (channels, noisy): (usize, Vec<usize>),
    sensitivities: Vec<(usize, usize)>,
) -> Equations {
    let signal = Signal { kind: Kind::Rule(Rule::Trapezoid).into(), lag: Lag::Known(0.0) };
    let mut written: Vec<Written> = (0..parameters).map(|k| op("input", 0.0, k, 0)).collect();
    let one = written.len();
    written.push(op("constant", 1.0, 0, 0));
    let (mut values, mut slopes, mut by) = (Vec::new(), Vec::new(), Vec::new());
    for (t, (_, _, _, g)) in terms.iter().enumerate() {
        match g {
            Ok(k) => {
                values.push(*k);
                slopes.push((t, *k));
                by.push(one);
            }
            Err(number) => {
                values.push(written.len());
                written.push(op("constant", *number, 0, 0));
            }
        }
    }
    let all = values.into_iter().chain(by).collect();
    let inputs = channels + noisy.len() * (noisy.len() + 1) / 2 + parameters;
    Equations {
        orders,
        signals: vec![signal; signals],
        terms: terms
            .iter()
            .map(|(equation, signal, order, _)| Term {
                equation: *equation,
                signal: *signal,
                order: *order,
            })
            .collect(),
        coefficients: Tape::new(&written, parameters, all).unwrap(),
        slopes,
        samples: Tape::new(formulas, inputs, results).unwrap(),
        sensitivities,
        signal_slopes: Vec::new(),
        channels,
        noisy,
        parameters,
        starts: vec![None; parameters],
        near: false,
        bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); parameters],
        linear: true,
    }
}

/// y'' + ay' + by + cy³ = u.
const DUFFING: [Gained; 5] = [
    (0, 0, 2, Err(1.0)),
    (0, 0, 1, Ok(0)),
    (0, 0, 0, Ok(1)),
    (0, 1, 0, Ok(2)),
    (0, 2, 0, Err(-1.0)),
];

fn duffing() -> Equations {
    duffing::equations(Rule::Trapezoid)
}

/// Runge–Kutta's steps of a system from a state; samples of every state.
fn solved<const N: usize>(
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
    start: [f64; N],
) -> Vec<Vec<f64>> {
    const EACH: usize = 20;
    let h = DT / EACH as f64;
    let (mut x, mut out) = (start, vec![vec![]; N]);
    let along = |x: [f64; N], by: f64, s: [f64; N]| std::array::from_fn(|i| x[i] + by * s[i]);
    for k in 0..COUNT {
        (0..N).for_each(|i| out[i].push(x[i]));
        for j in 0..EACH {
            let t = k as f64 * DT + j as f64 * h;
            let a = slope(t, x);
            let b = slope(t + h / 2.0, along(x, h / 2.0, a));
            let c = slope(t + h / 2.0, along(x, h / 2.0, b));
            let d = slope(t + h, along(x, h, c));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
    }
    out
}

fn oscillation(start: [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    duffing::record(COUNT, DT, start)
}

/// Signals of the oscillator with slopes at `clean`.
fn sampled(y: &[f64], u: &[f64], clean: &[f64], sigma: f64) -> Sampled {
    let s = sigma * sigma;
    Sampled {
        signals: vec![y.to_vec(), y.iter().map(|y| y * y * y - 3.0 * s * y).collect(), u.to_vec()],
        slopes: vec![
            (0, 0, vec![1.0; COUNT]),
            (1, 0, clean.iter().map(|y| 3.0 * y * y - 3.0 * s).collect()),
        ],
    }
}

/// The whole way: the minimum with slopes at the samples, then with slopes where its noise is taken away.
#[test]
fn an_oscillator_is_what_every_samples_noise_says() {
    let (sigma, last) = (0.2, 14);
    let starts = [[0.5, 0.0], [-0.4, 0.3]];
    let clean: Vec<_> = starts.iter().map(|s| oscillation(*s)).collect();
    let noisy: Vec<Vec<f64>> =
        clean.iter().enumerate().map(|(k, (y, _))| noisy(y, sigma, 0, 20 + k as u64)).collect();
    for records in [1, 2] {
        let mut oracle = Oracle {
            orders: vec![2],
            terms: DUFFING.to_vec(),
            levels: vec![sigma],
            records: (0..records)
                .map(|k| sampled(&noisy[k], &clean[k].1, &noisy[k], sigma))
                .collect(),
            last,
        };
        let channels: Vec<Vec<&[f64]>> =
            (0..records).map(|k| vec![&noisy[k][..], &clean[k].1]).collect();
        let band = Band::Harmonics(last - 2);
        let once = oracle.settled(&[0.3, 1.0, 0.5], false);
        let found = fit(&options(duffing(), Method::Awls, band, &[sigma]), DT, &channels);
        same(&found, &oracle, &once, false, "awls");
        let first = oracle.settled(&[0.3, 1.0, 0.5], true);
        let taken = oracle.rows(&first, false).noise;
        for (k, noise) in taken.iter().enumerate() {
            let left: Vec<f64> = noisy[k].iter().zip(&noise[0]).map(|(y, e)| y - e).collect();
            oracle.records[k] = sampled(&noisy[k], &clean[k].1, &left, sigma);
        }
        let second = oracle.settled(&first, true);
        let found = fit(&options(duffing(), Method::Ml, band, &[sigma]), DT, &channels);
        same(&found, &oracle, &second, true, "ml");
        let bse: Vec<f64> = (0..3).map(|k| found.answer.cov_nonrobust[4 * k].sqrt()).collect();
        let moved = first.iter().zip(&second).zip(&bse).map(|((a, b), s)| ((a - b) / s).abs());
        assert!(moved.fold(0.0, f64::max) > 0.02, "slopes at clean samples change nothing here");
        let steps: Vec<f64> = bse.iter().map(|s| 1e-3 * s).collect();
        let slope = gradient(|x| oracle.criterion(x), &second, &steps);
        for (g, s) in slope.iter().zip(&bse) {
            assert!((g * s / found.scale).abs() < 1e-3, "{slope:?}");
        }
    }
}

/// Two equations share the noise of both channels: rows of a line are whitened and counted together.
#[test]
fn two_equations_of_noisy_states_are_what_every_samples_noise_says() {
    // x' = p0 x + p1 xz, z' = p2 z + p3 xz, of noise in both: x, z, xz.
    let terms = [
        (0, 0, 1, Err(-1.0)),
        (0, 0, 0, Ok(0)),
        (0, 2, 0, Ok(1)),
        (1, 1, 1, Err(-1.0)),
        (1, 1, 0, Ok(2)),
        (1, 2, 0, Ok(3)),
    ];
    let truth = [1.2, -0.8, -1.0, 0.9];
    let slope = |_: f64, x: [f64; 2]| {
        [truth[0] * x[0] + truth[1] * x[0] * x[1], truth[2] * x[1] + truth[3] * x[0] * x[1]]
    };
    let states = solved(slope, [1.5, 1.0]);
    let levels = [0.03, 0.05];
    let v: Vec<Vec<f64>> = (0..2).map(|c| noisy(&states[c], levels[c], c as u32, 30)).collect();
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("multiply", 0.0, 0, 1),
        op("constant", 1.0, 0, 0),
    ];
    let e = equations(
        (vec![1, 1], &terms, 4),
        (&formulas, vec![0, 1, 2, 3, 3, 1, 0], 3),
        (2, vec![0, 1]),
        vec![(0, 0), (1, 1), (2, 0), (2, 1)],
    );
    let sampled = Sampled {
        signals: vec![
            v[0].clone(),
            v[1].clone(),
            v[0].iter().zip(&v[1]).map(|(a, b)| a * b).collect(),
        ],
        slopes: vec![
            (0, 0, vec![1.0; COUNT]),
            (1, 1, vec![1.0; COUNT]),
            (2, 0, v[1].clone()),
            (2, 1, v[0].clone()),
        ],
    };
    let oracle = Oracle {
        orders: vec![1, 1],
        terms: terms.to_vec(),
        levels: levels.to_vec(),
        records: vec![sampled],
        last: 13,
    };
    let want = oracle.settled(&truth, false);
    let o = options(e, Method::Awls, Band::Harmonics(12), &levels);
    let found = fit(&o, DT, &[vec![&v[0], &v[1]]]);
    same(&found, &oracle, &want, false, "awls of two equations");
}

/// y'' + ay' + by − cu' − du = 0 of one noisy channel.
pub fn linear(kind: Kind) -> Equations {
    let terms = [
        (0, 0, 2, Err(1.0)),
        (0, 0, 1, Ok(0)),
        (0, 0, 0, Ok(1)),
        (0, 2, 1, Ok(2)),
        (0, 2, 0, Ok(3)),
    ];
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("constant", 1.0, 0, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 1, 3),
    ];
    let mut e = equations(
        (vec![2], &terms, 4),
        (&formulas, vec![0, 1, 4, 2], 3),
        (2, vec![0]),
        vec![(0, 0)],
    );
    e.signals[2].kind = kind.into();
    e
}

#[test]
fn a_linear_equation_is_a_transfer_function() {
    for method in [Method::Ls, Method::Wls, Method::Awls, Method::Ml] {
        // Where rows are differenced a trend is taken out in another way.
        let trends = if method == Method::Ls { 1 } else { 3 };
        for trend in [Trend::None, Trend::Constant, Trend::Linear].into_iter().take(trends) {
            let records = [fast::record(2, 1, 257, 0.05, 21), fast::record(2, 1, 257, 0.05, 22)];
            let channels: Vec<Vec<&[f64]>> =
                records.iter().map(|r| vec![&r.y[0][..], &r.u[0][..]]).collect();
            // Without weights the noise counts as the equation's.
            let equation = matches!(method, Method::Ls | Method::Wls);
            let plain = fast::plain(method, trend, equation, &records);
            let o =
                options(linear(Kind::Rule(Rule::Trapezoid)), method, Band::Harmonics(18), &[0.1]);
            let noise = if equation { Noise::Equation } else { Noise::Output };
            let o = TermsOptions { trend, noise, ..o };
            let found = fit(&o, records[0].dt, &channels).answer;
            assert_eq!(
                (found.status, plain.status),
                (Status::Ok, Status::Ok),
                "{method:?} {trend:?}"
            );
            assert_eq!(found.degrees_of_freedom, plain.degrees_of_freedom);
            for (k, (a, b)) in found.theta.iter().zip(&plain.theta).enumerate() {
                let bse = plain.cov_nonrobust[5 * k].sqrt();
                assert!((a - b).abs() < 1e-4 * bse, "{method:?} {trend:?}: {a} {b}");
            }
            let square = |all: &[f64]| all.chunks(4).map(<[f64]>::to_vec).collect::<Vec<_>>();
            let what = format!("{method:?} {trend:?}");
            same_covariance(&found.cov_nonrobust, &square(&plain.cov_nonrobust), 1e-3, &what);
            if method != Method::Ls {
                // The leverage of a differenced row counts the transient in the fast path alone.
                same_covariance(
                    &found.cov_hc3,
                    &square(&plain.cov_hc3),
                    1e-3,
                    &format!("{what}: HC3"),
                );
            }
        }
    }
}

#[test]
fn a_bound_that_binds_holds_the_parameter() {
    let (clean, u) = oscillation([0.5, 0.0]);
    let y = noisy(&clean, 0.1, 0, 23);
    let channels = [vec![&y[..], &u[..]]];
    let band = Band::Harmonics(12);
    let open = fit(&options(duffing(), Method::Ml, band, &[0.1]), DT, &channels);
    for (k, low) in [(0, true), (2, false)] {
        let edge = open.answer.theta[k] * if low { 1.1 } else { 0.9 };
        let mut e = duffing();
        e.bounds[k] = if low { (edge, f64::INFINITY) } else { (f64::NEG_INFINITY, edge) };
        let found = fit(&options(e, Method::Ml, band, &[0.1]), DT, &channels);
        assert_eq!(found.answer.status, Status::Ok);
        assert_eq!(found.answer.theta[k], edge);
        assert_eq!(found.at_bound, (0..3).map(|j| j == k).collect::<Vec<_>>());
        assert_eq!(found.answer.cov_nonrobust[4 * k], 0.0);
        assert!(found.answer.cost > open.answer.cost);
    }
}

/// A free lag of a held input is the free delay of a joint fit.
#[test]
fn a_lag_that_is_a_parameter_is_a_free_delay() {
    let r = super::delays::late(0.8, 385, 0.02, 24);
    let joint = super::delays::free_delay(&r);
    let terms = [(0, 0, 2, Err(1.0)), (0, 0, 1, Ok(0)), (0, 0, 0, Ok(1)), (0, 1, 0, Ok(2))];
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("constant", 1.0, 0, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 1, 3),
    ];
    let mut e =
        equations((vec![2], &terms, 4), (&formulas, vec![0, 4, 2], 2), (2, vec![0]), vec![(0, 0)]);
    e.signals[1] = Signal { kind: Kind::Hold(Hold::Zoh).into(), lag: Lag::Parameter(3) };
    e.bounds[3] = (0.0, 2.5);
    e.linear = false;
    let o = options(e, Method::Ml, Band::Edges(0.0, 18.0), &[0.02]);
    let found = fit(&o, r.dt, &[vec![&r.y[0], &r.u[0]]]).answer;
    assert_eq!(found.status, Status::Ok);
    for (k, (a, b)) in found.theta.iter().zip(&joint.theta).enumerate() {
        // But for what sampling folds into the output, which the joint fit takes out.
        let bse = joint.cov_nonrobust[5 * k].sqrt();
        assert!((a - b).abs() < 0.3 * bse, "{k}: {a} {b}");
    }
}

/// The level that a fit reads from the upper lines, and the band it chooses, are near those that are told.
#[test]
fn levels_are_read_from_the_record_where_none_are_given() {
    let (clean, u) = oscillation([0.5, 0.0]);
    let y = noisy(&clean, 0.1, 0, 25);
    let o = TermsOptions { levels: None, ..options(duffing(), Method::Ml, Band::Default, &[]) };
    let found = fit(&o, DT, &[vec![&y, &u]]);
    assert_eq!(found.answer.status, Status::Ok);
    assert!((found.levels[0][0] / 0.1 - 1.0).abs() < 0.15, "{}", found.levels[0][0]);
    assert!((found.scale - 1.0).abs() < 0.5, "{}", found.scale);
    for (k, want) in [0.3, 1.0, 0.5].iter().enumerate() {
        let bse = found.answer.cov_hc3[4 * k].sqrt();
        assert!((found.answer.theta[k] - want).abs() < 4.0 * bse, "{k}: {}", found.answer.theta[k]);
    }
}
