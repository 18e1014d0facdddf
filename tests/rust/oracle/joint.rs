//! Several outputs: joint fits against rows written out, their noise, bounds, held coefficients and delays.
#![allow(clippy::needless_range_loop)]

use super::dense::{gradient, same_covariance};
use super::fast;
use super::linear::{Columns, Problem};
use super::record::{Between, Record};
use super::signals::{System, noise, noisy, samples, smooth};
use modfun::Status;
use modfun::estimate::joint::{
    Delay, JointFit, JointFitter, JointOptions, JointRecord, JointStructure, NoiseModel, Path,
};
use modfun::estimate::{Band, FitOptions, Fitter, Initial, Prior, RecordView, Time};
use modfun::quadrature::{Hold, Rule};
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Structure, Trend};

const TRENDS: [Trend; 3] = [Trend::None, Trend::Constant, Trend::Linear];
pub const COUNT: usize = 257;
pub const DT: f64 = 10.0 / 256.0;

/// Two outputs of second order, with one denominator or two, of two inputs.
pub fn two(common: bool, sigma: f64, correlation: f64, count: usize, replicate: u64) -> Record {
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

pub fn structure(common: bool) -> JointStructure {
    JointStructure {
        orders: vec![2, 2],
        common,
        numerators: vec![vec![Some(1), Some(0)], vec![Some(0), Some(1)]],
        paths: (0..2).map(|input| Path { input, delay: Delay::Known(0.0) }).collect(),
        fixed: vec![],
        bounds: vec![],
    }
}

pub fn options(structure: JointStructure, method: Method, band: Band) -> JointOptions {
    let inputs = structure.paths.len();
    JointOptions {
        structure: structure.checked().unwrap(),
        intersample: vec![None; inputs].into(),
        rule: Rule::Trapezoid,
        method,
        noise: NoiseModel { outputs: Some(vec![1.0, 0.3, 0.3, 0.5]), ..NoiseModel::output() },
        trend: Trend::None,
        extended: true,
        band,
        driven: false,
        own_levels: false,
        priors: vec![],
        options: fast::OPTIONS,
    }
}

pub fn fit(o: &JointOptions, records: &[Record]) -> JointFit {
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
pub fn problem(o: &JointOptions, records: &[Record], found: &JointFit) -> Problem {
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
    let mut problem = Problem {
        folded: Vec::new(),
        orders: s.orders.clone(),
        common: s.common,
        numerators: s.numerators.clone(),
        fixed: s.fixed.clone(),
        delays: s.paths.iter().map(delay).collect(),
        inputs: match o.intersample.of(0)[0] {
            None => Between::Samples,
            Some(Hold::Zoh) => Between::Zoh,
            Some(Hold::Foh) => Between::Foh,
        },
        trend: o.trend,
        extended: o.extended,
        equation: o.noise.equation,
        sigma,
        input_sigma: o.noise.inputs.as_ref().map_or(Vec::new(), |s| square(s, s.len().isqrt())),
        records,
    };
    problem.fold(&found.answer.theta);
    problem
}

/// Everything that a fit says, held to the oracle. Covariances agree but for `within`.
#[track_caller]
pub fn check(o: &JointOptions, records: &[Record], within: f64) -> JointFit {
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
    let mut numbers = Vec::new();
    for (own, lines) in found.residuals.iter().zip(&found.answer.lines) {
        for m in 0..lines.count() {
            numbers.extend(own.iter().map(|o| o[m].0));
            numbers.extend(own.iter().map(|o| o[m].1).filter(|_| m + lines.first > 0));
        }
    }
    assert_eq!(numbers.len(), worth.residual.len(), "{what}");
    let apart = numbers.iter().zip(&worth.residual).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 10.0 * within, "{what}: residuals {apart} apart");
    let mut classical = worth.classical.clone();
    if o.noise.outputs.is_none() && o.structure.orders.len() > 1 {
        let growth =
            problem.growth(theta, if by_model { Columns::Denoised } else { Columns::Data });
        for (row, a) in classical.iter_mut().zip(&growth) {
            row.iter_mut().zip(&growth).for_each(|(own, b)| *own *= (a * b).sqrt());
        }
    }
    same_covariance(&found.answer.cov_nonrobust, &classical, within, &format!("{what}: classical"));
    same_covariance(&found.answer.cov_hc3, &worth.hc3, within, &format!("{what}: HC3"));
    // Differences tell nothing where columns are nearly dependent.
    if by_model && o.structure.orders.iter().all(|n| *n <= 4) {
        let p = theta.len();
        let bse: Vec<f64> = (0..p).map(|k| worth.classical[k][k].sqrt()).collect();
        let steps: Vec<f64> = bse.iter().map(|s| 1e-3 * s).collect();
        let slope = gradient(|x| problem.criterion(x), theta, &steps);
        let variance = worth.cost / worth.degrees as f64;
        for (k, (g, s)) in slope.iter().zip(&bse).enumerate() {
            let part = g * s / variance;
            // Twice the step that is left.
            assert!(part.abs() < (2.0 * within).max(1e-3), "{what}: slope {part} of parameter {k}");
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

/// Three outputs: what is written with two indices of outputs is told apart from its transpose.
#[test]
fn three_outputs_of_noisy_inputs_are_what_the_rows_say() {
    let r = two(false, 0.05, 0.5, COUNT, 17);
    let third = System { a: vec![3.0, 6.0], b: vec![vec![1.0, 1.0], vec![0.5, 2.0]] };
    let clean = third.response(&|j, _, t| smooth(j, t), (COUNT, DT), &[0.1, 0.3]);
    let y = vec![r.y[0].clone(), r.y[1].clone(), noisy(&clean, 0.05, 9, 17)];
    let r = Record { y, ..r };
    let s = JointStructure {
        orders: vec![2; 3],
        numerators: vec![vec![Some(1), Some(0)], vec![Some(0), Some(1)], vec![Some(1); 2]],
        ..structure(false)
    };
    let sigma = vec![1.0, 0.3, 0.1, 0.3, 0.5, -0.2, 0.1, -0.2, 0.8];
    for inputs in [None, Some(vec![0.4, 0.1, 0.1, 0.6])] {
        for method in [Method::Awls, Method::Ml] {
            let o = options(s.clone(), method, Band::Harmonics(18));
            let noise = NoiseModel {
                inputs: inputs.clone(),
                outputs: Some(sigma.clone()),
                ..o.noise.clone()
            };
            check(&JointOptions { noise, ..o }, std::slice::from_ref(&r), 1e-5);
        }
    }
}

#[test]
fn ill_conditioned_columns_are_solved_by_orthogonal_factors() {
    for order in [5, 6] {
        for method in [Method::Awls, Method::Ml] {
            let s = JointStructure {
                orders: vec![order],
                numerators: vec![vec![Some(order - 1)]],
                paths: structure(true).paths[..1].to_vec(),
                ..structure(true)
            };
            let o = options(s, method, Band::Edges(0.0, 25.0));
            let o = JointOptions { noise: NoiseModel::output(), ..o };
            check(&o, &[fast::record(order, 1, 513, 1e-4, 1)], 1e-4);
        }
    }
    // Two poles and zeros too many: columns are told apart by the noise alone.
    let s = JointStructure {
        orders: vec![4],
        numerators: vec![vec![Some(3)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    let o = options(s, Method::Wls, Band::Edges(0.0, 12.0));
    let noise = NoiseModel { equation: true, ..NoiseModel::output() };
    check(&JointOptions { noise, ..o }, &[fast::record(2, 1, 513, 1e-5, 1)], 1e-4);
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

/// The same levels, and the same estimates, as the fast path has.
#[test]
fn levels_of_records_are_those_of_the_fast_path() {
    let records: Vec<Record> =
        (0..3).map(|k| fast::record(2, 1, 257, [0.02, 0.1, 0.4][k], k as u64)).collect();
    let s = JointStructure {
        orders: vec![2],
        numerators: vec![vec![Some(1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    let band = Band::Edges(0.0, 12.0);
    let o = JointOptions {
        noise: NoiseModel::output(),
        driven: false,
        own_levels: true,
        ..options(s, Method::Ml, band)
    };
    let joint = fit(&o, &records);
    let plain = fast::own_levels(&records, Method::Ml, band);
    for (a, b) in joint.record_levels.iter().zip(&plain.record_levels) {
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
    for (k, (a, b)) in joint.answer.theta.iter().zip(&plain.answer.theta).enumerate() {
        let bse = plain.answer.cov_nonrobust[5 * k].sqrt();
        assert!((a - b).abs() < 1e-3 * bse, "{k}: {a} {b}");
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
        intersample: vec![None; 2].into(),
        rule: Rule::Trapezoid,
        method,
        noise: if equation { Noise::Equation } else { Noise::Output },
        trend,
        extended: true,
        band: Band::Harmonics(18),
        own_levels: false,
        initial: Initial::Unknown,
        states: vec![],
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
        // Joint costs have a unit of their own, a power of two.
        for (a, b) in a.costs.iter().zip(b.costs) {
            let unit = (a / b).log2();
            assert!((unit - unit.round()).abs() < 1e-6, "{method:?}: costs {a} and {b}");
        }
    }
}

/// What the record says beside it is a millionth of its information.
#[test]
fn a_prior_that_is_surer_than_the_record_is_the_variance() {
    for method in [Method::Awls, Method::Ml] {
        let records = [two(true, 0.05, 0.5, COUNT, 4)];
        let o = options(structure(true), method, Band::Edges(0.0, 12.0));
        let plain = fit(&o, &records).answer;
        let (at, p) = (1, plain.theta.len());
        let sd = 1e-3 * plain.cov_nonrobust[at * (p + 1)].sqrt();
        let mean = plain.theta[at] + 0.5 * sd;
        let o = JointOptions { priors: vec![Prior { parameter: at, mean, sd }], ..o };
        let found = fit(&o, &records).answer;
        assert!((found.theta[at] - mean).abs() < 1e-2 * sd, "{method:?}: {}", found.theta[at]);
        for cov in [&found.cov_nonrobust, &found.cov_hc3, &found.cov_spectral] {
            let ratio = cov[at * (p + 1)].sqrt() / sd;
            assert!((ratio - 1.0).abs() < 1e-3, "{method:?}: {ratio}");
        }
    }
}

#[test]
fn inputs_that_are_alike_cannot_be_told_apart() {
    for method in [Method::Awls, Method::Ml] {
        let mut record = two(true, 0.05, 0.5, COUNT, 4);
        record.u[1] = record.u[0].clone();
        let s = JointStructure { numerators: vec![vec![Some(0); 2]; 2], ..structure(true) };
        let o = options(s, method, Band::Edges(0.0, 12.0));
        let found = fit(&o, &[record]).answer;
        assert_eq!(found.status, Status::Rank, "{method:?}");
        assert!(found.cov_nonrobust.iter().all(|v| v.is_nan()), "{method:?}");
    }
}
