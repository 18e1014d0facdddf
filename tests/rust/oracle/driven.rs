//! Noise that drives the system: the three fits that know it, at the zero of its equations, with their covariances.

use super::dense::{C, Qr, dot, gradient, inverse, same_covariance};
use super::record::Record;
use super::signals::{System, noise, noisy, samples, smooth};
use super::{fast, joint, terms};
use modfun::Status;
use modfun::estimate::joint::{Delay, JointOptions, JointStructure, NoiseModel, Path};
use modfun::estimate::terms::TermsOptions;
use modfun::estimate::{Answer, Band, FitOptions, Levels};
use modfun::modulation::Lines;
use modfun::quadrature::Rule;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Noise};

const HARMONICS: usize = 24;
const COUNT: usize = 257;
const DT: f64 = 10.0 / 256.0;
/// Coefficients of A and B, then variance of a sample's noise and density of what drives the system.
const TRUE: [f64; 6] = [1.6, 9.0, 1.0, 2.0, 0.0025, 0.3];

/// y'' + ay' + by = cu' + du + w, with w constant from sample to sample: white on the lines that are used.
fn record(replicate: u64) -> Record {
    let system = System { a: TRUE[..2].to_vec(), b: vec![TRUE[2..4].to_vec(), vec![0.0, 1.0]] };
    let w = noise(1, replicate, COUNT);
    let size = (TRUE[5] / DT).sqrt();
    let inputs = |j: usize, k: usize, t: f64| if j == 0 { smooth(0, t) } else { size * w[k] };
    let clean = system.response(&inputs, (COUNT, DT), &[0.2, -0.1]);
    Record {
        y: vec![noisy(&clean, TRUE[4].sqrt(), 0, replicate)],
        u: vec![samples(COUNT, DT, |t| smooth(0, t))],
        dt: DT,
        ..Record::default()
    }
}

/// One line of a record.
struct Line {
    s: C,
    y: C,
    u: C,
    /// Real rows.
    rows: f64,
    /// Variance of a coefficient under unit noise of the samples, and under unit density.
    unit: f64,
    inside: f64,
}

fn lines(records: &[Record], used: &[Lines]) -> Vec<Line> {
    let each = records.iter().zip(used).flat_map(|(r, l)| (l.first..=l.last).map(move |m| (r, m)));
    let line = |(r, m): (&Record, usize)| Line {
        s: C(0.0, m as f64 * r.omega0()),
        y: r.coefficient(&r.y[0], m),
        u: r.coefficient(&r.u[0], m),
        rows: if m == 0 { 1.0 } else { 2.0 },
        unit: r.unit_variance(),
        inside: 1.0 / r.window().1,
    };
    each.map(line).collect()
}

impl Line {
    fn a(&self, x: &[f64]) -> C {
        self.s * self.s + self.s * x[0] + C(x[1], 0.0)
    }

    /// Variance of the residual and of the output about its response.
    fn residual(&self, x: &[f64]) -> f64 {
        self.unit * x[4] * self.a(x).square() + self.inside * x[5]
    }

    fn output(&self, x: &[f64]) -> f64 {
        self.residual(x) / self.a(x).square()
    }
}

/// Re and Im of each line under unit variance.
fn whitened(lines: &[Line], x: &[f64], of: impl Fn(usize) -> C) -> Vec<f64> {
    let each = lines.iter().enumerate().map(|(i, line)| {
        let value = of(i) * (line.rows / line.residual(x)).sqrt();
        [value.0, if line.rows == 1.0 { 0.0 } else { value.1 }]
    });
    each.flatten().collect()
}

/// What the formulas at the head of `driven/mod.rs` give at a point.
struct Oracle {
    /// Left sides of the equations over the roots of their information.
    equations: Vec<f64>,
    /// Of parameters and levels, and of the parameters from the scores of the lines.
    cov: Vec<Vec<f64>>,
    sandwich: Vec<Vec<f64>>,
    degrees: Vec<f64>,
    share: (f64, f64),
    cost: f64,
    residual: Vec<f64>,
}

fn oracle(lines: &[Line], records: usize, x: &[f64]) -> Oracle {
    let (p, all) = (4, x.len());
    let per = lines.len() / records;
    let free: Vec<Vec<f64>> = (0..2 * records)
        .map(|k| {
            let own = |i: usize| {
                if i / per == k / 2 { C::power(lines[i].s.1, k % 2) } else { C::default() }
            };
            whitened(lines, x, own)
        })
        .collect();
    let ends = Qr::new(&free);
    let model = |i: usize| {
        let line = &lines[i];
        line.a(x) * line.y - (line.s * x[2] + C(x[3], 0.0)) * line.u
    };
    let residual = ends.rest(&whitened(lines, x, model));
    let response: Vec<C> = (0..lines.len())
        .map(|i| {
            let by = (lines[i].residual(x) / lines[i].rows).sqrt();
            lines[i].y - C(residual[2 * i], residual[2 * i + 1]) * by * lines[i].a(x).inverse()
        })
        .collect();
    let column = |k: usize| {
        let own = |i: usize| match k {
            0 => lines[i].s * response[i],
            1 => response[i],
            2 => lines[i].s * lines[i].u * -1.0,
            _ => lines[i].u * -1.0,
        };
        ends.rest(&whitened(lines, x, own))
    };
    let jacobian: Vec<Vec<f64>> = (0..p).map(column).collect();
    let taken = Qr::new(&[free, jacobian.clone()].concat()).leverages(2 * lines.len());
    let slopes: Vec<Vec<f64>> = lines
        .iter()
        .map(|line| {
            let steps: Vec<f64> = x.iter().map(|x| 1e-5 * x).collect();
            gradient(|x| line.output(x).ln(), x, &steps)
        })
        .collect();
    let left: Vec<f64> =
        (0..lines.len()).map(|i| lines[i].rows - taken[2 * i] - taken[2 * i + 1]).collect();
    let pair = |v: &[f64], i: usize| C(v[2 * i], v[2 * i + 1]);
    let over: Vec<f64> = (0..lines.len()).map(|i| left[i] - pair(&residual, i).square()).collect();

    let score = |k: usize, i: usize| {
        let own = |c: &Vec<f64>| dot(&c[2 * i..2 * i + 2], &residual[2 * i..2 * i + 2]);
        0.5 * slopes[i][k] * over[i] + jacobian.get(k).map_or(0.0, own)
    };
    let entry = |a: usize, b: usize| {
        let mean = if a < p && b < p { dot(&jacobian[a], &jacobian[b]) } else { 0.0 };
        mean + (0..lines.len()).map(|i| 0.5 * left[i] * slopes[i][a] * slopes[i][b]).sum::<f64>()
    };
    let information: Vec<Vec<f64>> =
        (0..all).map(|a| (0..all).map(|b| entry(a, b)).collect()).collect();
    let cov = inverse(&information);
    let mut sandwich = vec![vec![0.0; p]; p];
    for (i, line) in lines.iter().enumerate() {
        let scores: Vec<f64> = (0..all).map(|k| line.rows / left[i] * score(k, i)).collect();
        let moves: Vec<f64> = cov.iter().map(|row| dot(row, &scores)).collect();
        for a in 0..p {
            for b in 0..p {
                sandwich[a][b] += moves[a] * moves[b];
            }
        }
    }
    // Satterthwaite: how much of each variance scales with each level.
    let degrees = |k: usize| {
        let moved = |i: usize| {
            (0..p).fold(C::default(), |sum, j| sum + pair(&jacobian[j], i) * cov[k][j]).square()
        };
        let total: f64 = (0..lines.len()).map(moved).sum();
        let share: Vec<f64> = (p..all)
            .map(|level| (0..lines.len()).map(|i| slopes[i][level] * moved(i)).sum())
            .collect();
        let scatter: f64 = (p..all).map(|a| share[a - p] * dot(&cov[a][p..], &share)).sum();
        2.0 * total * total / scatter
    };
    let share = |x: &[f64]| {
        let measured: f64 = lines.iter().map(|line| line.unit * x[4]).sum();
        let driven: f64 = lines.iter().map(|line| line.output(x)).sum::<f64>() - measured;
        driven / (measured + driven)
    };
    let steps: Vec<f64> = x.iter().map(|x| 1e-5 * x).collect();
    let slope = gradient(share, x, &steps);
    let error = (0..all).map(|a| slope[a] * dot(&cov[a], &slope)).sum::<f64>().sqrt();
    let rows: f64 = lines.iter().map(|line| line.rows).sum();
    let mean = |line: &Line| line.rows * (line.output(x) / line.unit).ln();
    let freedom = rows - (p + 2 * records) as f64;
    Oracle {
        equations: (0..all)
            .map(|k| (0..lines.len()).map(|i| score(k, i)).sum::<f64>() / information[k][k].sqrt())
            .collect(),
        cost: (lines.iter().map(mean).sum::<f64>() / rows).exp() * freedom,
        degrees: (0..p).map(degrees).collect(),
        share: (share(x), error),
        cov,
        sandwich,
        residual,
    }
}

/// Holds a fit to the oracle.
fn held(answer: &Answer, levels: &Levels, residuals: &[f64], records: &[Record], what: &str) {
    assert_eq!(answer.status, Status::Ok, "{what}");
    let x: Vec<f64> = answer.theta.iter().chain(&levels.values).copied().collect();
    let want = oracle(&lines(records, &answer.lines), records.len(), &x);
    for (k, value) in want.equations.iter().enumerate() {
        assert!(value.abs() < 1e-4, "{what}: equation {k} is off by {value} standard errors");
    }
    same_covariance(&levels.cov, &want.cov, 1e-5, what);
    let own: Vec<Vec<f64>> = want.cov[..4].iter().map(|row| row[..4].to_vec()).collect();
    same_covariance(&answer.cov_nonrobust, &own, 1e-5, what);
    same_covariance(&answer.cov_hc3, &want.sandwich, 1e-5, &format!("{what}: from the scores"));
    let near = |a: f64, b: f64, of: &str| {
        assert!((a / b - 1.0).abs() < 1e-5, "{what}: {of} {a}, by the formulas {b}");
    };
    answer.degrees.iter().zip(&want.degrees).for_each(|(a, b)| near(*a, *b, "degrees"));
    near(answer.cost, want.cost, "cost");
    near(levels.shares[0].0, want.share.0, "share");
    near(levels.shares[0].1, want.share.1, "error of the share");
    assert_eq!(residuals.len(), want.residual.len());
    for (a, b) in residuals.iter().zip(&want.residual) {
        assert!((a - b).abs() < 1e-6, "{what}: residual {a}, by the formulas {b}");
    }
    // 5 standard errors: one false alarm in 10⁵ other seeds.
    for (k, truth) in TRUE.iter().enumerate() {
        let error = (x[k] - truth) / want.cov[k][k].sqrt();
        assert!(error.abs() < 5.0, "{what}: unknown {k} is {error} standard errors from the truth");
    }
}

fn flat(residuals: &[Vec<(f64, f64)>]) -> Vec<f64> {
    residuals.iter().flatten().flat_map(|(re, im)| [*re, *im]).collect()
}

#[test]
fn a_transfer_function_solves_the_equations() {
    // The search on record 200 has steps that raise the criterion until they are halved.
    for replicates in [&[60][..], &[60, 61], &[200]] {
        let records: Vec<Record> = replicates.iter().map(|k| record(*k)).collect();
        let o = fast::options(2, vec![Some(1)], Method::Ml, Band::Harmonics(HARMONICS));
        let found = fast::fit(&FitOptions { noise: Noise::Process, ..o }, &records);
        let what = format!("records {replicates:?}");
        held(&found.answer, &found.levels.unwrap(), &flat(&found.residuals), &records, &what);
    }
}

#[test]
fn a_joint_fit_of_one_output_solves_them() {
    let records = [record(60), record(61)];
    let one = JointStructure {
        orders: vec![2],
        common: true,
        numerators: vec![vec![Some(1)]],
        paths: vec![Path { input: 0, delay: Delay::Known(0.0) }],
        fixed: vec![],
        bounds: vec![],
    };
    let o = joint::options(one, Method::Ml, Band::Harmonics(HARMONICS));
    let o = JointOptions { noise: NoiseModel::output(), driven: true, ..o };
    let found = joint::fit(&o, &records);
    let residuals: Vec<_> = found.residuals.into_iter().map(|mut own| own.remove(0)).collect();
    held(&found.answer, &found.levels.unwrap(), &flat(&residuals), &records, "joint");
    assert_eq!(found.at_bound, [false; 4]);
}

#[test]
fn a_linear_equation_solves_them() {
    let records = [record(60), record(61)];
    let channels: Vec<Vec<&[f64]>> =
        records.iter().map(|r| vec![&r.y[0][..], &r.u[0][..]]).collect();
    let linear = terms::linear(Kind::Rule(Rule::Trapezoid));
    let o = terms::options(linear, Method::Ml, Band::Harmonics(HARMONICS), &[0.05]);
    let found = terms::fit(&TermsOptions { noise: Noise::Process, ..o }, DT, &channels);
    let residuals: Vec<_> = found.residuals.into_iter().map(|mut own| own.remove(0)).collect();
    held(&found.answer, &found.driven.unwrap(), &flat(&residuals), &records, "equation");
}
