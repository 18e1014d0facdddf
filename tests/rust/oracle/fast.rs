//! One output: `ls`, `wls`, `awls` and `ml` against rows written out, and the default band.
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, gradient, hessian, inverse, same_covariance, sandwich};
use super::linear::{Columns, Problem, Rows};
use super::record::{Between, Record};
use super::signals::{System, noisy, samples, smooth};
use modfun::Status;
use modfun::estimate::{Band, Fit, FitOptions, Fitter, Initial, Options, RecordView, Time, Wanted};
use modfun::quadrature::Rule;
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Structure, Trend};

pub const OPTIONS: Options = Options { tol: 1e-9, maxiter: 100, wanted: Wanted::Covariance };
const TRENDS: [Trend; 3] = [Trend::None, Trend::Constant, Trend::Linear];

pub fn options(
    order: usize,
    numerators: Vec<Option<usize>>,
    method: Method,
    band: Band,
) -> FitOptions {
    let inputs = numerators.len();
    FitOptions {
        structure: Structure::new(order, numerators).unwrap(),
        delays: vec![0.0; inputs],
        intersample: vec![None; inputs].into(),
        rule: Rule::Trapezoid,
        method,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band,
        own_levels: false,
        initial: Initial::Unknown,
        states: vec![],
        options: OPTIONS,
    }
}

/// A record of a system with poles at −1, −1 ± 2i, −1.5 ± 4i, …, as many as asked for.
pub fn record(order: usize, inputs: usize, count: usize, sigma: f64, replicate: u64) -> Record {
    let dt = 10.0 / 256.0;
    let factors = [vec![1.0], vec![1.6, 9.0], vec![2.0, 4.0], vec![1.0, 25.0]];
    let picked: &[usize] = match order {
        1 => &[0],
        2 => &[1],
        3 => &[0, 1],
        4 => &[1, 3],
        5 => &[0, 1, 3],
        _ => &[1, 2, 3],
    };
    let mut a = vec![1.0];
    for k in picked {
        let mut next = vec![0.0; a.len() + factors[*k].len()];
        for (i, x) in a.iter().enumerate() {
            next[i] += x;
            for (j, f) in factors[*k].iter().enumerate() {
                next[i + j + 1] += x * f;
            }
        }
        a = next;
    }
    // The first input has all the zeros there may be, others none.
    let b = (0..inputs).map(|k| {
        (0..order).map(|i| if k == 0 || i + 1 == order { (1 + i) as f64 } else { 0.0 }).collect()
    });
    let system = System { a: a[1..].to_vec(), b: b.collect() };
    let start = vec![0.3; order];
    let clean = system.response(&|j, _, t| smooth(j, t), (count, dt), &start);
    let rms = (dot(&clean, &clean) / count as f64).sqrt();
    Record {
        y: vec![noisy(&clean, sigma * rms, 0, replicate)],
        u: (0..inputs).map(|k| samples(count, dt, |t| smooth(k, t))).collect(),
        dt,
        ..Record::default()
    }
}

pub fn fit(o: &FitOptions, records: &[Record]) -> Fit {
    let sampling: Vec<(usize, Time<'_>)> =
        records.iter().map(|r| (r.y[0].len(), Time::Even(r.dt))).collect();
    let views: Vec<RecordView<'_>> = records
        .iter()
        .map(|r| RecordView { y: &r.y[0], u: r.u.iter().map(Vec::as_slice).collect() })
        .collect();
    Fitter::new(o.clone(), &sampling, Isa::detect().unwrap()).unwrap().fit(&views).unwrap()
}

/// The oracle's problem on the lines that a fit used.
fn problem(o: &FitOptions, records: &[Record], found: &Fit) -> Problem {
    let mut records = records.to_vec();
    for (r, lines) in records.iter_mut().zip(&found.answer.lines) {
        r.lines = (lines.first, lines.last);
    }
    Problem {
        folded: Vec::new(),
        orders: vec![o.structure.order],
        common: true,
        numerators: vec![o.structure.numerators.clone()],
        fixed: Vec::new(),
        delays: vec![Some(0.0); o.structure.numerators.len()],
        inputs: Between::Samples,
        trend: o.trend,
        extended: o.extended,
        equation: o.noise == Noise::Equation,
        sigma: vec![vec![1.0]],
        input_sigma: Vec::new(),
        records,
    }
}

/// Instruments that are not the weighted columns: H (Σ z zᵀ v) Hᵀ on rows as they are.
struct Oblique {
    classical: Vec<Vec<f64>>,
    hc3: Vec<Vec<f64>>,
    step: Vec<f64>,
}

/// `z` on unweighted rows; those of `problem` have the scale `by`.
fn oblique(problem: &Problem, theta: &[f64], z: &[Vec<f64>], by: &[f64], floor: f64) -> Oblique {
    let t = problem.transients(theta, false);
    let rows = problem.rows(theta, Some(&t), Columns::Data, false);
    let base = Qr::new(&rows.transient);
    let raw = |column: &[f64]| -> Vec<f64> { column.iter().zip(by).map(|(x, s)| x / s).collect() };
    let columns: Vec<Vec<f64>> = rows.columns.iter().map(|c| raw(&base.rest(c))).collect();
    let residual = raw(&rows.residual);
    let (p, n) = (theta.len(), residual.len());
    let degrees = n - p - rows.transient.len();
    let variance = dot(&rows.residual, &rows.residual) / degrees as f64;
    let system: Vec<Vec<f64>> =
        (0..p).map(|a| (0..p).map(|b| dot(&z[a], &columns[b])).collect()).collect();
    let h = inverse(&system);
    let shared = base.leverages(n);
    let (mut plain, mut robust) = (vec![vec![0.0; p]; p], vec![vec![0.0; p]; p]);
    for i in 0..n {
        let own: f64 =
            (0..p).map(|a| columns[a][i] * (0..p).map(|b| h[a][b] * z[b][i]).sum::<f64>()).sum();
        let left = residual[i] / (1.0 - own - shared[i]).max(floor);
        for a in 0..p {
            for b in 0..p {
                plain[a][b] += z[a][i] * z[b][i] * variance / (by[i] * by[i]);
                robust[a][b] += z[a][i] * z[b][i] * left * left;
            }
        }
    }
    let classical = sandwich(&h, &plain);
    let right: Vec<f64> = z.iter().map(|z| dot(z, &residual)).collect();
    let step = (0..p).map(|k| dot(&h[k], &right) / classical[k][k].sqrt()).collect();
    Oblique { hc3: sandwich(&h, &robust), classical, step }
}

/// Scale of each row under flat weights and under those of the noise.
fn scales(problem: &Problem, theta: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let of = |flat: bool| problem.rows(theta, None, Columns::Data, flat).residual;
    let mut flat = Vec::new();
    for r in &problem.records {
        for m in r.line_numbers(problem.trend) {
            let h = if m == 0 { 1.0 } else { 0.5 };
            let scale = (1.0 / (h * r.unit_variance())).sqrt();
            flat.extend(std::iter::repeat_n(scale, if m == 0 { 1 } else { 2 }));
        }
    }
    let whole = of(false).iter().zip(of(true)).zip(&flat).map(|((w, f), s)| w / f * s).collect();
    (flat, whole)
}

/// Instruments of the differenced rows of one record from line 0 on, on its lines: Gᵀ G c.
fn differenced(problem: &Problem, rows: &Rows, flat: &[f64]) -> Vec<Vec<f64>> {
    let n = problem.orders[0];
    let last = problem.records[0].lines.1 as i64;
    let mut binomial = vec![1.0];
    for _ in 0..n {
        let padded: Vec<f64> = std::iter::once(0.0).chain(binomial.iter().copied()).collect();
        let ahead = binomial.iter().copied().chain([0.0]);
        binomial = padded.iter().zip(ahead).map(|(up, here)| up - here).collect();
    }
    let lowest = if problem.extended { -((n / 2) as i64) } else { 0 };
    // A row of G: a factor for each real number of the lines.
    let mut g: Vec<Vec<f64>> = Vec::new();
    for k in lowest..=last - n as i64 {
        let (mut re, mut im) = (vec![0.0; flat.len()], vec![0.0; flat.len()]);
        for (j, c) in binomial.iter().enumerate() {
            let m = k + j as i64;
            let at = (2 * m.unsigned_abs() as usize).saturating_sub(1);
            re[at] += c;
            if m != 0 {
                im[at + 1] += c * m.signum() as f64;
            }
        }
        g.push(re);
        if !(problem.extended && n.is_multiple_of(2) && k == lowest) {
            g.push(im);
        }
    }
    let one = |column: &Vec<f64>| -> Vec<f64> {
        let raw: Vec<f64> = column.iter().zip(flat).map(|(x, s)| x / s).collect();
        let mut out = vec![0.0; raw.len()];
        for row in &g {
            let value = dot(row, &raw);
            out.iter_mut().zip(row).for_each(|(o, r)| *o += value * r);
        }
        out
    };
    rows.columns.iter().map(one).collect()
}

/// Everything that a fit says, held to the oracle.
#[track_caller]
fn check(o: &FitOptions, records: &[Record]) {
    let found = fit(o, records);
    let what =
        format!("{:?} {:?} {:?} {:?} {}", o.structure, o.method, o.noise, o.trend, o.extended);
    let problem = problem(o, records, &found);
    let theta = &found.answer.theta;
    assert_eq!(found.answer.status, Status::Ok, "{what}");
    let by_model = o.method == Method::Ml && o.noise == Noise::Output;
    let worth = problem.worth(theta, if by_model { Columns::Denoised } else { Columns::Data });
    assert_eq!(found.answer.degrees_of_freedom, worth.degrees, "{what}");
    assert!((found.answer.cost / worth.cost - 1.0).abs() < 1e-7, "{what}: cost");
    let variance = worth.cost / worth.degrees as f64;
    assert!((found.sigma / variance.sqrt() - 1.0).abs() < 1e-7, "{what}: sigma");
    let numbers = found.residuals.iter().zip(&found.answer.lines);
    let numbers = numbers.flat_map(|(own, lines)| {
        let zero = lines.first == 0;
        own.iter()
            .enumerate()
            .flat_map(move |(k, r)| [Some(r.0), Some(r.1).filter(|_| !zero || k > 0)])
    });
    let numbers: Vec<f64> = numbers.flatten().collect();
    assert_eq!(numbers.len(), worth.residual.len(), "{what}");
    let apart = numbers.iter().zip(&worth.residual).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-5, "{what}: residuals {apart} apart");
    let flat = o.method == Method::Wls && o.noise == Noise::Output;
    let (step, classical, hc3) = if o.method == Method::Ls || flat {
        let (scale, by) = scales(&problem, theta);
        let rows = problem.rows(theta, None, Columns::Data, true);
        let z: Vec<Vec<f64>> = match o.method {
            Method::Ls => differenced(&problem, &rows, &scale),
            _ => {
                let base = Qr::new(&rows.transient);
                let weighted = |c: &Vec<f64>| -> Vec<f64> {
                    base.rest(c).iter().zip(&scale).map(|(x, s)| x * s).collect()
                };
                rows.columns.iter().map(weighted).collect()
            }
        };
        let floor = if o.method == Method::Ls { 0.25 } else { 1e-6 };
        let worth = oblique(&problem, theta, &z, &by, floor);
        (worth.step, worth.classical, worth.hc3)
    } else {
        (worth.step, worth.classical, worth.hc3)
    };
    assert!(
        step.iter().all(|s| s.abs() < 1e-5),
        "{what}: steps of {step:?} standard errors are left"
    );
    same_covariance(&found.answer.cov_nonrobust, &classical, 1e-5, &format!("{what}: classical"));
    same_covariance(&found.answer.cov_hc3, &hc3, 1e-5, &format!("{what}: HC3"));
}

#[test]
fn every_method_order_and_trend_is_what_the_rows_say() {
    for order in 1..=4 {
        // Differenced rows have columns of their own for a trend, which are not written out here.
        let ls = std::iter::once((Method::Ls, Trend::None));
        let others = [Method::Wls, Method::Awls, Method::Ml].into_iter();
        let others = others.flat_map(|method| TRENDS.map(|trend| (method, trend)));
        for (method, trend) in ls.chain(others) {
            for extended in [true, false] {
                for noise in [Noise::Output, Noise::Equation] {
                    // Noise in the equation has a likelihood of its own (tests/python/fitting/test_process_noise.py).
                    if (method, noise) == (Method::Ml, Noise::Equation) {
                        continue;
                    }
                    let numerators = vec![Some(order - 1), Some(0)];
                    let o = FitOptions {
                        trend,
                        extended,
                        noise,
                        ..options(order, numerators, method, Band::Harmonics(18))
                    };
                    let sigma = if order == 4 { 0.01 } else { 0.05 };
                    check(&o, &[record(order, 2, 257, sigma, 1)]);
                }
            }
        }
    }
}

/// Pivots of the normal equations are too small here: steps and covariances come from orthogonal factors.
#[test]
fn ill_conditioned_columns_are_solved_by_orthogonal_factors() {
    for order in [5, 6] {
        for method in [Method::Wls, Method::Awls, Method::Ml] {
            let o = options(order, vec![Some(order - 1)], method, Band::Edges(0.0, 25.0));
            check(&o, &[record(order, 1, 513, 1e-4, 1), record(order, 1, 449, 1e-4, 2)]);
        }
    }
    // Two poles and zeros too many: columns are told apart by the noise alone.
    let o = options(4, vec![Some(3)], Method::Wls, Band::Edges(0.0, 12.0));
    let o = FitOptions { noise: Noise::Equation, ..o };
    check(&o, &[record(2, 1, 513, 1e-5, 1), record(2, 1, 449, 1e-5, 2)]);
}

#[test]
fn several_records_have_transients_of_their_own() {
    let records = [record(2, 1, 257, 0.1, 1), record(2, 1, 193, 0.1, 2), record(2, 1, 225, 0.1, 3)];
    for method in [Method::Wls, Method::Awls, Method::Ml] {
        for trend in TRENDS {
            let o = options(2, vec![Some(1)], method, Band::Edges(0.0, 12.0));
            check(&FitOptions { trend, ..o }, &records);
        }
    }
}

pub fn own_levels(records: &[Record], method: Method, band: Band) -> Fit {
    fit(&FitOptions { own_levels: true, ..options(2, vec![Some(1)], method, band) }, records)
}

/// Records divided by their levels have noise of one level: the same problem.
#[test]
fn levels_of_records_are_what_makes_their_noise_one() {
    let noise = [0.02, 0.1, 0.4];
    let records: Vec<Record> =
        noise.iter().enumerate().map(|(k, s)| record(2, 1, 257, *s, k as u64)).collect();
    for method in [Method::Awls, Method::Ml] {
        let o = options(2, vec![Some(1)], method, Band::Edges(0.0, 12.0));
        let own = own_levels(&records, method, Band::Edges(0.0, 12.0));
        for pair in own.record_levels.windows(2) {
            assert!((2.0..10.0).contains(&(pair[1] / pair[0])), "{:?}", own.record_levels);
        }
        let divided: Vec<Record> = records
            .iter()
            .zip(&own.record_levels)
            .map(|(r, level)| {
                let over = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
                    all.iter().map(|v| v.iter().map(|x| x / level).collect()).collect()
                };
                Record { y: over(&r.y), u: over(&r.u), ..r.clone() }
            })
            .collect();
        let one = fit(&o, &divided);
        assert!((own.sigma / one.sigma - 1.0).abs() < 1e-9);
        for k in 0..4 {
            let bse = one.answer.cov_nonrobust[5 * k].sqrt();
            let gap = (own.answer.theta[k] - one.answer.theta[k]).abs();
            assert!(gap < 1e-4 * bse, "{method:?} {k}: {gap} for {bse}");
            let (a, b) = (own.answer.cov_hc3[5 * k], one.answer.cov_hc3[5 * k]);
            assert!((a / b - 1.0).abs() < 1e-4, "{method:?} {k}: {a} {b}");
        }
    }
}

#[test]
fn ml_stands_where_the_criterion_is_flat() {
    for order in 1..=4 {
        for trend in TRENDS {
            let o = options(order, vec![Some(order - 1)], Method::Ml, Band::Harmonics(20));
            let records = [record(order, 1, 257, 0.1, 4)];
            let found = fit(&FitOptions { trend, ..o.clone() }, &records);
            let problem = problem(&FitOptions { trend, ..o }, &records, &found);
            let theta = &found.answer.theta;
            let p = theta.len();
            let bse: Vec<f64> =
                (0..p).map(|k| found.answer.cov_nonrobust[k * (p + 1)].sqrt()).collect();
            let steps: Vec<f64> = bse.iter().map(|s| 1e-3 * s).collect();
            let slope = gradient(|x| problem.criterion(x), theta, &steps);
            for (k, (g, s)) in slope.iter().zip(&bse).enumerate() {
                // A standard error of a step changes the criterion by σ².
                let part = g * s / (found.sigma * found.sigma);
                assert!(part.abs() < 1e-3, "order {order}, {trend:?}, parameter {k}: {part}");
            }
        }
    }
}

#[test]
fn the_classical_covariance_is_the_inverse_hessian_without_noise() {
    // Coefficients of the exact model leave nothing: records are long against their bandwidth.
    let o = options(2, vec![Some(1)], Method::Ml, Band::Harmonics(12));
    let mut clean = record(2, 1, 257, 0.0, 0);
    let found = fit(&o, &[clean.clone()]);
    let problem_of = problem(&o, &[clean.clone()], &found);
    // The quadrature's own error is taken out of the output: what is left is rounding.
    let theta = found.answer.theta.clone();
    let t = problem_of.transients(&theta, false);
    let rows = problem_of.rows(&theta, Some(&t), Columns::Data, true);
    let r = problem_of.records[0].clone();
    let n = clean.y[0].len() - 1;
    let flat = scales(&problem_of, &theta).0;
    let raw: Vec<f64> = rows.residual.iter().zip(&flat).map(|(x, s)| x / s).collect();
    let omega0 = r.omega0();
    for m in 0..=r.lines.1 {
        let q = if m == 0 { C(raw[0], 0.0) } else { C(raw[2 * m - 1], raw[2 * m]) };
        let s = m as f64 * omega0;
        let a = C::power(s, 2) + C::power(s, 1) * theta[0] + C(theta[1], 0.0);
        let e = q * a.inverse();
        for k in 0..=n {
            let turned = C::turn(s * k as f64 * r.dt) * e;
            clean.y[0][k] -= if m == 0 { turned.0 } else { 2.0 * turned.0 };
        }
    }
    let found = fit(&o, &[clean.clone()]);
    let problem = problem(&o, &[clean], &found);
    let theta = &found.answer.theta;
    let p = theta.len();
    let variance = found.sigma * found.sigma;
    let unit: Vec<f64> = found.answer.cov_nonrobust.iter().map(|c| c / variance).collect();
    let steps: Vec<f64> = (0..p).map(|k| 1e-3 * unit[k * (p + 1)].sqrt()).collect();
    let curved = hessian(|x| problem.criterion(x), theta, &steps);
    let half: Vec<Vec<f64>> =
        curved.iter().map(|row| row.iter().map(|h| 0.5 * h).collect()).collect();
    same_covariance(&unit, &inverse(&half), 2e-3, "inverse Hessian");
}

/// The default band as docs/core.md has it: the fewest lines whose standard errors at equal σ are within 1 %.
#[test]
fn the_default_band_is_the_fewest_lines_that_tell_as_much() {
    let mut chosen = Vec::new();
    for (order, sigma) in [(1, 0.05), (2, 0.05), (2, 0.2), (3, 0.02)] {
        for method in [Method::Awls, Method::Ml] {
            let o = options(order, vec![Some(order - 1)], method, Band::Default);
            let records = [record(order, 1, 513, sigma, 5)];
            let found = fit(&o, &records);
            let rule = found.answer.band_rule.unwrap();
            assert_eq!((rule.wide, rule.narrow), (64, 6 * order + order));
            let edge = 64.0 * found.answer.lines[0].omega0;
            let wide = fit(&FitOptions { band: Band::Edges(0.0, edge), ..o.clone() }, &records);
            let all = problem(&o, &records, &wide);
            let theta = &wide.answer.theta;
            let t = all.transients(theta, false);
            let variances = |last: usize| -> Vec<f64> {
                let mut few = all.clone();
                few.records[0].lines.1 = last;
                let columns = if method == Method::Ml { Columns::Denoised } else { Columns::Data };
                let rows = few.rows(theta, Some(&t), columns, false);
                let base = Qr::new(&rows.transient);
                let z: Vec<Vec<f64>> = rows.columns.iter().map(|c| base.rest(c)).collect();
                let inverse = Qr::new(&z).inverse_normal();
                (0..theta.len()).map(|k| inverse[k][k]).collect()
            };
            let reference = variances(64);
            let enough = |last: &usize| {
                variances(*last).iter().zip(&reference).all(|(v, r)| v.sqrt() <= 1.01 * r.sqrt())
            };
            let fewest = (2 * order + 1..=64).find(enough).unwrap();
            assert_eq!(rule.chosen, fewest, "{order} {sigma} {method:?}");
            assert_eq!(found.answer.lines[0].last, fewest);
            chosen.push(fewest);
        }
    }
    assert!(chosen.iter().any(|last| *last < 64), "a test of a rule that never narrows");
}

/// A fit of one input by the default band, for others to be held to.
pub fn default_band(method: Method, record: &Record) -> modfun::estimate::Answer {
    fit(&options(2, vec![Some(1)], method, Band::Default), std::slice::from_ref(record)).answer
}

/// A fit of one input with one zero on M = 18, for others to be held to.
pub fn plain(
    method: Method,
    trend: Trend,
    equation: bool,
    records: &[Record],
) -> modfun::estimate::Answer {
    let noise = if equation { Noise::Equation } else { Noise::Output };
    let o = options(2, vec![Some(1)], method, Band::Harmonics(18));
    fit(&FitOptions { trend, noise, ..o }, records).answer
}
