//! Several outputs: joint fits against rows written out, their noise, bounds, held coefficients and delays.
#![allow(clippy::needless_range_loop)]

use super::dense::{gradient, same_covariance};
use super::fast;
use super::linear::{Columns, Problem, Record};
use super::signals::{System, noise, noisy, samples, smooth};
use modfun::Status;
use modfun::estimate::joint::{
    Colour, Delay, JointFit, JointFitter, JointOptions, JointRecord, JointStructure, NoiseModel,
    Path,
};
use modfun::estimate::{Band, FitOptions, Fitter, RecordView, Time};
use modfun::quadrature::{Hold, Rule};
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Structure, Trend};

const TRENDS: [Trend; 3] = [Trend::None, Trend::Constant, Trend::Linear];
const COUNT: usize = 257;
const DT: f64 = 10.0 / 256.0;

/// Two outputs of second order, with one denominator or two, of two inputs.
fn two(common: bool, sigma: f64, correlation: f64, count: usize, replicate: u64) -> Record {
    let systems = [
        System { a: vec![1.6, 9.0], b: vec![vec![2.0, 5.0], vec![0.0, 3.0]] },
        System {
            a: if common { vec![1.6, 9.0] } else { vec![2.0, 5.0] },
            b: vec![vec![0.0, 4.0], vec![1.0, 2.0]],
        },
    ];
    let e = [noise(0, replicate, count), noise(1, replicate, count)];
    let y = systems.iter().enumerate().map(|(i, system)| {
        let clean = system.response(&|j, _, t| smooth(j, t), (count, DT), &[0.2, -0.1]);
        let own = |k: usize| match i {
            0 => e[0][k],
            _ => correlation * e[0][k] + (1.0 - correlation * correlation).sqrt() * 0.5 * e[1][k],
        };
        clean.iter().enumerate().map(|(k, y)| y + sigma * own(k)).collect()
    });
    Record {
        y: y.collect(),
        u: (0..2).map(|k| samples(count, DT, |t| smooth(k, t))).collect(),
        dt: DT,
        ..Record::default()
    }
}

fn structure(common: bool) -> JointStructure {
    JointStructure {
        orders: vec![2, 2],
        common,
        numerators: vec![vec![Some(1), Some(0)], vec![Some(0), Some(1)]],
        paths: (0..2).map(|input| Path { input, delay: Delay::Known(0.0) }).collect(),
        fixed: vec![],
        bounds: vec![],
    }
}

fn options(structure: JointStructure, method: Method, band: Band) -> JointOptions {
    let inputs = structure.paths.len();
    JointOptions {
        structure: structure.checked().unwrap(),
        intersample: vec![None; inputs],
        rule: Rule::Trapezoid,
        method,
        noise: NoiseModel { outputs: Some(vec![1.0, 0.3, 0.3, 0.5]), ..NoiseModel::output() },
        trend: Trend::None,
        extended: true,
        band,
        options: fast::OPTIONS,
    }
}

fn fit(o: &JointOptions, records: &[Record]) -> JointFit {
    let sampling: Vec<(usize, Time<'_>)> = records
        .iter()
        .map(|r| match r.times.is_empty() {
            true => (r.y[0].len(), Time::Even(r.dt)),
            false => (r.y[0].len(), Time::Uneven(&r.times)),
        })
        .collect();
    let views: Vec<JointRecord<'_>> = records
        .iter()
        .map(|r| JointRecord {
            y: r.y.iter().map(Vec::as_slice).collect(),
            u: r.u.iter().map(Vec::as_slice).collect(),
        })
        .collect();
    let variances: Vec<Vec<Vec<f64>>> = records.iter().map(|r| r.variances.clone()).collect();
    let uneven = variances.iter().any(|v| !v.is_empty());
    let variances = if uneven { &variances[..] } else { &[] };
    JointFitter::new(o.clone(), &sampling, variances, Isa::detect().unwrap())
        .unwrap()
        .fit(&views)
        .unwrap()
}

/// The oracle's problem on the lines that a fit used, with Σ as given or as the fit found it.
fn problem(o: &JointOptions, records: &[Record], found: &JointFit) -> Problem {
    let s = &o.structure;
    let q = s.orders.len();
    let longest = s.longest_delay();
    let mut records = records.to_vec();
    for (k, (r, lines)) in records.iter_mut().zip(&found.answer.lines).enumerate() {
        r.lines = (lines.first, lines.last);
        r.lead = (longest / r.dt - 1e-9).ceil() as usize;
        r.spectra = o.noise.spectra.get(k).cloned().unwrap_or_default();
    }
    let square = |all: &[f64], n: usize| all.chunks(n).map(<[f64]>::to_vec).collect();
    let sigma = match (&o.noise.outputs, q) {
        (Some(given), _) => square(given, q),
        (None, 1) => vec![vec![1.0]],
        (None, _) => square(&found.noise, q),
    };
    let delay = |p: &Path| if let Delay::Known(tau) = p.delay { Some(tau) } else { None };
    Problem {
        orders: s.orders.clone(),
        common: s.common,
        numerators: s.numerators.clone(),
        fixed: s.fixed.clone(),
        delays: s.paths.iter().map(delay).collect(),
        held_inputs: o.intersample[0].is_some(),
        trend: o.trend,
        extended: o.extended,
        equation: o.noise.equation,
        sigma,
        input_sigma: o.noise.inputs.as_ref().map_or(Vec::new(), |s| square(s, s.len().isqrt())),
        records,
    }
}

/// Everything that a fit says, held to the oracle. Covariances agree but for `within`.
#[track_caller]
fn check(o: &JointOptions, records: &[Record], within: f64) -> JointFit {
    let found = fit(o, records);
    let problem = problem(o, records, &found);
    let what = format!("{:?} {:?} {:?}", o.method, o.trend, o.noise);
    assert_eq!(found.answer.status, Status::Ok, "{what}");
    let theta = &found.answer.theta;
    let by_model = o.method == Method::Ml && !o.noise.equation;
    let worth = problem.worth(theta, if by_model { Columns::Denoised } else { Columns::Data });
    assert_eq!(found.answer.degrees_of_freedom, worth.degrees, "{what}");
    let cost = found.answer.cost;
    assert!((cost / worth.cost - 1.0).abs() < within, "{what}: cost {cost} for {}", worth.cost);
    assert!(worth.step.iter().all(|s| s.abs() < within), "{what}: {:?} left", worth.step);
    same_covariance(
        &found.answer.cov_nonrobust,
        &worth.classical,
        within,
        &format!("{what}: classical"),
    );
    same_covariance(&found.answer.cov_hc3, &worth.hc3, within, &format!("{what}: HC3"));
    if by_model {
        let p = theta.len();
        let bse: Vec<f64> = (0..p).map(|k| worth.classical[k][k].sqrt()).collect();
        let steps: Vec<f64> = bse.iter().map(|s| 1e-3 * s).collect();
        let slope = gradient(|x| problem.criterion(x), theta, &steps);
        let variance = worth.cost / worth.degrees as f64;
        for (k, (g, s)) in slope.iter().zip(&bse).enumerate() {
            assert!((g * s / variance).abs() < 1e-3, "{what}: slope {g} of parameter {k}");
        }
    }
    found
}

#[test]
fn every_denominator_method_and_trend_is_what_the_rows_say() {
    for common in [true, false] {
        for method in [Method::Awls, Method::Ml] {
            for trend in TRENDS {
                for extended in [true, false] {
                    let o = options(structure(common), method, Band::Harmonics(18));
                    let o = JointOptions { trend, extended, ..o };
                    check(&o, &[two(common, 0.05, 0.5, COUNT, 1)], 1e-5);
                }
            }
        }
    }
}

#[test]
fn equation_noise_is_weighted_by_its_covariance_alone() {
    for method in [Method::Wls, Method::Awls] {
        let o = options(structure(true), method, Band::Harmonics(18));
        let noise = NoiseModel { equation: true, ..o.noise.clone() };
        check(&JointOptions { noise, ..o }, &[two(true, 0.05, 0.5, COUNT, 2)], 1e-5);
    }
}

#[test]
fn later_records_have_transients_of_their_own() {
    for common in [true, false] {
        for method in [Method::Awls, Method::Ml] {
            let o = options(structure(common), method, Band::Edges(0.0, 12.0));
            let records = [
                two(common, 0.05, 0.5, 257, 1),
                two(common, 0.05, 0.5, 193, 2),
                two(common, 0.05, 0.5, 225, 3),
            ];
            check(&o, &records, 1e-5);
        }
    }
}

/// Σ̂ is (q/ν) Σ Re(e e*)/h of the residuals over A, all of it, and the fit stands still at it.
#[test]
fn an_unknown_covariance_is_that_of_the_residuals() {
    for common in [true, false] {
        let o = options(structure(common), Method::Ml, Band::Harmonics(18));
        let o = JointOptions { noise: NoiseModel::output(), ..o };
        let records = [two(common, 0.1, 0.8, COUNT, 3)];
        let found = check(&o, &records, 1e-4);
        let mut plain = problem(&o, &records, &found);
        let theta = &found.answer.theta;
        let t = plain.transients(theta, false);
        plain.sigma = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
        let rows = plain.rows(theta, Some(&t), Columns::Data, false);
        let mut sums = [[0.0; 2]; 2];
        for pair in rows.residual.chunks(2) {
            for i in 0..2 {
                for j in 0..2 {
                    sums[i][j] += pair[i] * pair[j];
                }
            }
        }
        let freedom = found.answer.degrees_of_freedom as f64;
        for i in 0..2 {
            for j in 0..2 {
                let want = 2.0 / freedom * sums[i][j];
                let size = (sums[0][0] * sums[1][1]).sqrt() * 2.0 / freedom;
                let gap = (found.noise[2 * i + j] - want).abs();
                assert!(
                    gap < 1e-4 * size,
                    "{common} ({i}, {j}): {} for {want}",
                    found.noise[2 * i + j]
                );
            }
        }
        let correlation = found.noise[1] / (found.noise[0] * found.noise[3]).sqrt();
        assert!(correlation > 0.5, "the test's noise is correlated, found {correlation}");
    }
}

/// Fits of one output by the fast path and jointly: (θ, cost, covariances).
fn both(
    method: Method,
    trend: Trend,
    common: bool,
    equation: bool,
) -> [modfun::estimate::Answer; 2] {
    let r = fast::record(2, 2, COUNT, 0.1, 6);
    let numerators = vec![Some(1), Some(0)];
    let plain = FitOptions {
        structure: Structure::new(2, numerators.clone()).unwrap(),
        delays: vec![0.0; 2],
        intersample: vec![None; 2],
        rule: Rule::Trapezoid,
        method,
        noise: if equation { Noise::Equation } else { Noise::Output },
        trend,
        extended: true,
        band: Band::Harmonics(18),
        options: fast::OPTIONS,
    };
    let one = JointStructure {
        orders: vec![2],
        common,
        numerators: vec![numerators],
        ..structure(common)
    };
    let o = options(one, method, Band::Harmonics(18));
    let o = JointOptions { noise: NoiseModel { equation, ..NoiseModel::output() }, trend, ..o };
    let view = RecordView { y: &r.y[0], u: r.u.iter().map(Vec::as_slice).collect() };
    let fitter = Fitter::new(plain, &[(COUNT, Time::Even(DT))], Isa::detect().unwrap()).unwrap();
    [fitter.fit(&[view]).unwrap().answer, fit(&o, &[r]).answer]
}

#[test]
fn one_output_is_the_fast_estimators_answer() {
    for (method, equation) in [(Method::Wls, true), (Method::Awls, false), (Method::Ml, false)] {
        for trend in TRENDS {
            let [plain, joint] = both(method, trend, true, equation);
            assert_eq!((plain.status, joint.status), (Status::Ok, Status::Ok));
            assert!((plain.cost / joint.cost - 1.0).abs() < 1e-8, "{method:?} {trend:?}");
            let p = plain.theta.len();
            for (k, (a, b)) in plain.theta.iter().zip(&joint.theta).enumerate() {
                let bse = plain.cov_nonrobust[k * (p + 1)].sqrt();
                assert!((a - b).abs() < 1e-6 * bse, "{method:?} {trend:?}: {a} {b}");
            }
            let square = |all: &[f64]| all.chunks(p).map(<[f64]>::to_vec).collect::<Vec<_>>();
            let what = format!("{method:?} {trend:?}");
            same_covariance(&joint.cov_nonrobust, &square(&plain.cov_nonrobust), 1e-6, &what);
            same_covariance(&joint.cov_hc3, &square(&plain.cov_hc3), 1e-6, &what);
        }
    }
}

#[test]
fn separate_outputs_of_independent_noise_are_single_fits() {
    let r = two(false, 0.1, 0.0, COUNT, 7);
    for method in [Method::Awls, Method::Ml] {
        let o = options(structure(false), method, Band::Harmonics(18));
        let known = NoiseModel { outputs: Some(vec![1.0, 0.0, 0.0, 0.25]), ..NoiseModel::output() };
        let joint =
            fit(&JointOptions { noise: known, ..o.clone() }, std::slice::from_ref(&r)).answer;
        let mut from = 0;
        for i in 0..2 {
            let s = JointStructure {
                orders: vec![2],
                numerators: vec![o.structure.numerators[i].clone()],
                ..structure(false)
            };
            let alone = JointOptions {
                noise: NoiseModel::output(),
                ..options(s, method, Band::Harmonics(18))
            };
            let own = Record { y: vec![r.y[i].clone()], ..r.clone() };
            let single = fit(&alone, &[own]).answer;
            let p = single.theta.len();
            for (k, value) in single.theta.iter().enumerate() {
                let bse = single.cov_nonrobust[k * (p + 1)].sqrt();
                let gap = (joint.theta[from + k] - value).abs();
                assert!(gap < 1e-6 * bse, "{method:?} {i}, {k}: {} {value}", joint.theta[from + k]);
            }
            from += p;
        }
    }
}

#[test]
fn noise_of_inputs_and_given_colour_weigh_the_lines() {
    for common in [true, false] {
        for method in [Method::Awls, Method::Ml] {
            let o = options(structure(common), method, Band::Harmonics(18));
            let lines: Vec<f64> = (0..40).map(|m| 1.0 / (1.0 + 0.1 * f64::from(m))).collect();
            let flat = vec![1.0; 40];
            let coloured = vec![vec![lines.clone(), flat.clone(), flat, lines]];
            let inputs = Some(vec![0.4, 0.1, 0.1, 0.6]);
            for (inputs, spectra) in
                [(inputs.clone(), vec![]), (None, coloured.clone()), (inputs, coloured)]
            {
                let noise = NoiseModel { inputs, spectra, ..o.noise.clone() };
                let mut r = two(common, 0.05, 0.5, COUNT, 8);
                for (k, u) in r.u.iter_mut().enumerate() {
                    *u = noisy(u, 0.05, 2 + k as u32, 8);
                }
                check(&JointOptions { noise, ..o.clone() }, &[r], 1e-5);
            }
        }
    }
}

/// Where the spectrum is that of an autoregression, a fitted colour brings it out.
#[test]
fn the_colour_of_noise_is_read_from_the_residuals() {
    let count = 1025;
    let r = fast::record(2, 1, count, 0.0, 9);
    let e = noise(3, 9, count + 50);
    let mut coloured = vec![0.0; count + 50];
    for k in 1..count + 50 {
        coloured[k] = 0.9 * coloured[k - 1] + 0.03 * e[k];
    }
    let y = r.y[0].iter().zip(&coloured[50..]).map(|(y, e)| y + e).collect();
    let r = Record { y: vec![y], ..r };
    let s = JointStructure {
        orders: vec![2],
        numerators: vec![vec![Some(1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    let o = options(s, Method::Ml, Band::Harmonics(120));
    let fitted = NoiseModel { colour: Colour::Fitted, ..NoiseModel::output() };
    let power = |m: usize| {
        let turned = std::f64::consts::TAU * m as f64 / (count - 1) as f64;
        1.0 / (1.0 + 0.81 - 1.8 * turned.cos())
    };
    let spectra = vec![vec![(0..513).map(power).collect(), vec![1.0; 513]]];
    let told = NoiseModel { spectra, ..NoiseModel::output() };
    let [fitted, told, white] = [fitted, told, NoiseModel::output()]
        .map(|noise| fit(&JointOptions { noise, ..o.clone() }, std::slice::from_ref(&r)).answer);
    assert_eq!(fitted.status, Status::Ok);
    let p = told.theta.len();
    let bse = |a: &modfun::estimate::Answer, k: usize| a.cov_nonrobust[k * (p + 1)].sqrt();
    let mut apart: f64 = 0.0;
    for k in 0..p {
        let ratio = bse(&fitted, k) / bse(&told, k);
        assert!((0.75..1.33).contains(&ratio), "parameter {k}: {ratio}");
        let gap = (fitted.theta[k] - told.theta[k]).abs() / bse(&told, k);
        assert!(gap < 0.5, "parameter {k}: {gap} standard errors from the true colour's");
        apart = apart.max((bse(&white, k) / bse(&told, k) - 1.0).abs());
    }
    assert!(apart > 0.4, "white weights say the same: {apart}");
}

#[test]
fn held_coefficients_keep_their_values() {
    for common in [true, false] {
        let mut s = structure(common);
        let count = s.clone().checked().unwrap().coefficients();
        s.fixed = vec![None; count];
        s.fixed[1] = Some(8.8);
        s.fixed[3] = Some(5.1);
        s.fixed[count - 1] = Some(2.1);
        for method in [Method::Awls, Method::Ml] {
            let o = options(s.clone(), method, Band::Harmonics(18));
            let found = check(&o, &[two(common, 0.05, 0.5, COUNT, 10)], 1e-5);
            assert_eq!(found.answer.theta.len(), count - 3);
        }
    }
}

/// A bound that binds: the others are those of a fit with the value held there, and it has no error.
#[test]
fn a_parameter_led_beyond_its_bound_stands_on_it() {
    let free = structure(true).checked().unwrap();
    let records = [two(true, 0.05, 0.5, COUNT, 11)];
    let open = fit(&options(free.clone(), Method::Ml, Band::Harmonics(18)), &records).answer;
    for (k, low) in [(0, true), (3, false)] {
        let edge = open.theta[k] + if low { 0.05 } else { -0.05 };
        let mut bounded = free.clone();
        bounded.bounds[k] = if low { (edge, f64::INFINITY) } else { (f64::NEG_INFINITY, edge) };
        let mut held = free.clone();
        held.fixed[k] = Some(edge);
        let bounded = fit(&options(bounded, Method::Ml, Band::Harmonics(18)), &records);
        let held = fit(&options(held, Method::Ml, Band::Harmonics(18)), &records).answer;
        assert_eq!(bounded.answer.status, Status::Ok);
        let pinned: Vec<bool> = (0..open.theta.len()).map(|j| j == k).collect();
        assert_eq!(bounded.at_bound, pinned);
        assert!((bounded.answer.theta[k] / edge - 1.0).abs() < 1e-12);
        let p = open.theta.len();
        assert_eq!(bounded.answer.cov_nonrobust[k * (p + 1)], 0.0);
        let others = (0..p).filter(|j| *j != k);
        for (j, want) in others.zip(&held.theta) {
            let bse = bounded.answer.cov_nonrobust[j * (p + 1)].sqrt();
            assert!((bounded.answer.theta[j] - want).abs() < 1e-5 * bse, "{j}: {want}");
        }
        assert!((bounded.answer.cost / held.cost - 1.0).abs() < 1e-8);
    }
    let mut wide = free;
    wide.bounds.fill((-1e3, 1e3));
    let wide = fit(&options(wide, Method::Ml, Band::Harmonics(18)), &records);
    assert!(!wide.at_bound.contains(&true));
    assert_eq!(wide.answer.theta, open.theta);
}

/// Samples of uneven noise, and masked ones, at even instants and at uneven ones.
#[test]
fn uneven_samples_are_weighed_by_their_own_covariance() {
    let s = JointStructure {
        orders: vec![2],
        numerators: vec![vec![Some(1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    for uneven_times in [false, true] {
        let mut r = fast::record(2, 1, 129, 0.1, 12);
        r.variances =
            vec![(0..129).map(|k| 1.0 + 3.0 * f64::from(k) / 128.0 + f64::from(k % 3)).collect()];
        if uneven_times {
            r.times = (0..129)
                .map(|k| r.dt * (f64::from(k) + 0.3 * (0.7 * f64::from(k)).sin()))
                .collect();
        } else {
            (40..46).for_each(|k| r.variances[0][k] = f64::INFINITY);
        }
        for method in [Method::Awls, Method::Ml] {
            let o = options(s.clone(), method, Band::Harmonics(14));
            let o = JointOptions { noise: NoiseModel::output(), ..o };
            check(&o, &[r.clone()], 1e-4);
        }
    }
}

#[test]
fn outputs_of_uneven_noise_share_a_covariance() {
    let mut r = two(false, 0.05, 0.5, 129, 13);
    let variance = |i: u32| (0..129).map(|k| 1.0 + f64::from((k + i) % 4)).collect();
    r.variances = vec![variance(0), variance(2)];
    let o = options(structure(false), Method::Awls, Band::Harmonics(14));
    check(&o, &[r], 1e-4);
}

/// y = 5/(s² + 1.6s + 9) of a held input, late by τ.
pub fn late(tau: f64, count: usize, sigma: f64, seed: u64) -> Record {
    let levels = noise(5, seed, count);
    let u: Vec<f64> = (0..count).map(|k| levels[k / 4]).collect();
    let system = System { a: vec![1.6, 9.0], b: vec![vec![0.0, 5.0]] };
    let value = |_: usize, _: usize, t: f64| u[(((t - tau) / DT + 1e-9).floor().max(0.0)) as usize];
    let clean = system.response(&value, (count, DT), &[0.0, 0.0]);
    Record { y: vec![noisy(&clean, sigma, 6, seed)], u: vec![u], dt: DT, ..Record::default() }
}

fn delayed(delay: Delay, method: Method, band: Band) -> JointOptions {
    let s = JointStructure {
        orders: vec![2],
        common: true,
        numerators: vec![vec![Some(0)]],
        paths: vec![Path { input: 0, delay }],
        fixed: vec![],
        bounds: vec![],
    };
    let o = options(s, method, band);
    JointOptions { noise: NoiseModel::output(), intersample: vec![Some(Hold::Zoh)], ..o }
}

#[test]
fn known_delays_move_the_input() {
    for tau in [0.0, 0.3, 0.4 * DT, 5.0 * DT] {
        let o = delayed(Delay::Known(tau), Method::Ml, Band::Harmonics(25));
        check(&o, &[late(tau, COUNT, 0.02, 14)], 1e-5);
    }
}

/// From starts on both sides, and from afar, where only the search over the bounds finds the way.
#[test]
fn free_delays_are_found_and_stand_where_the_criterion_is_flat() {
    let true_delay = 0.8;
    for start in [0.0, 0.7, 1.0, 2.4] {
        for method in [Method::Awls, Method::Ml] {
            let delay = Delay::Free { start, min: 0.0, max: 2.5 };
            let o = delayed(delay, method, Band::Edges(0.0, 18.0));
            let found = check(&o, &[late(true_delay, 385, 0.02, 15)], 1e-3);
            let tau = found.answer.theta[3];
            let bse = found.answer.cov_nonrobust[15].sqrt();
            assert!((tau - true_delay).abs() < 5.0 * bse && bse < 0.05, "{start}: {tau} ± {bse}");
        }
    }
}

#[test]
fn the_default_band_seeks_delays_too() {
    let o = delayed(Delay::Free { start: 2.4, min: 0.0, max: 2.5 }, Method::Ml, Band::Default);
    let found = fit(&o, &[late(0.8, 385, 0.02, 16)]);
    assert_eq!(found.answer.status, Status::Ok);
    let bse = found.answer.cov_nonrobust[15].sqrt();
    assert!((found.answer.theta[3] - 0.8).abs() < 5.0 * bse, "{}", found.answer.theta[3]);
}

/// The rule of one output, as tests of the fast path have it, chooses for one output here.
#[test]
fn the_default_band_is_that_of_the_fast_path() {
    let r = fast::record(2, 1, 513, 0.05, 5);
    for method in [Method::Awls, Method::Ml] {
        let s = JointStructure {
            orders: vec![2],
            numerators: vec![vec![Some(1)]],
            paths: structure(true).paths[..1].to_vec(),
            ..structure(true)
        };
        let o = options(s, method, Band::Default);
        let o = JointOptions { noise: NoiseModel::output(), ..o };
        let joint = fit(&o, std::slice::from_ref(&r)).answer;
        let plain = fast::default_band(method, &r);
        let (a, b) = (joint.band_rule.unwrap(), plain.band_rule.unwrap());
        assert_eq!((a.wide, a.narrow, a.chosen), (b.wide, b.narrow, b.chosen));
        assert!(a.chosen < a.wide, "a test of a rule that never narrows");
    }
}

/// The fit of a free delay up to 2.5 s, for others to be held to.
pub fn free_delay(r: &Record) -> modfun::estimate::Answer {
    let delay = Delay::Free { start: 0.7, min: 0.0, max: 2.5 };
    fit(&delayed(delay, Method::Ml, Band::Edges(0.0, 18.0)), std::slice::from_ref(r)).answer
}
