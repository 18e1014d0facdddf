//! What is counted and timed: one program for each kind of estimation, on records that never change.
//!
//! `counted.rs` counts their instructions on AVX2, `fits.rs` times them on the best set.

#[path = "../tests/rust/common/mod.rs"]
mod common;
#[path = "../tests/rust/common/duffing.rs"]
mod duffing;

use common::{DURATION, INTERVALS, chirp, response};
use modfun::estimate::joint::{
    Delay, JointFitter, JointOptions, JointRecord, JointStructure, NoiseModel, Path,
};
use modfun::estimate::terms::{TermsFitter, TermsOptions, TermsRecord};
use modfun::estimate::{Band, FitOptions, Fitter, Options, RecordView, Time, Wanted};
use modfun::monte_carlo::{Contender, Draw, Group, Intervals, Plan, Run, Told};
use modfun::quadrature::{Hold, Rule};
use modfun::response::{Family, Piece, Settings, Weighting, responses};
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Structure, Trend};
use modfun::threads::Control;
use modfun::tones;
use std::hint::black_box;

/// Does so many pieces of the work.
pub type Work = Box<dyn FnMut(usize)>;

/// A program by its name.
pub struct Program {
    pub name: &'static str,
    /// What one piece is.
    pub piece: &'static str,
    /// Pieces of a count; it is made of twice as many less these.
    pub pieces: usize,
    pub make: fn(Isa) -> Work,
}

pub const ALL: [Program; 12] = [
    Program { name: "study as run", piece: "a replicate of nine fits", pieces: 1024, make: as_run },
    Program {
        name: "study drawn",
        piece: "a replicate",
        pieces: 4096,
        make: |isa| study(isa, Draw::Coefficients),
    },
    Program {
        name: "study sampled",
        piece: "a replicate",
        pieces: 4096,
        make: |isa| study(isa, Draw::Samples),
    },
    Program { name: "single ml", piece: "a fit", pieces: 50, make: single },
    Program { name: "joint 2x2", piece: "a fit", pieces: 1, make: |isa| joint(isa, 2) },
    Program { name: "joint 4x4", piece: "a fit", pieces: 1, make: |isa| joint(isa, 4) },
    Program { name: "two delays", piece: "a fit", pieces: 1, make: delays },
    Program { name: "duffing 13", piece: "a fit", pieces: 4, make: |isa| oscillator(isa, 13) },
    Program { name: "duffing 52", piece: "a fit", pieces: 1, make: |isa| oscillator(isa, 52) },
    Program { name: "frf", piece: "64 frequencies", pieces: 1, make: frf },
    Program { name: "tones", piece: "a record", pieces: 1, make: sinusoids },
    Program { name: "masked", piece: "a fit", pieces: 1, make: masked },
];

const SETTLED: Options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };
const DT: f64 = DURATION / INTERVALS as f64;

fn noise(channel: u32, count: usize) -> Vec<f64> {
    let mut out = vec![0.0; count];
    let purpose = Purpose::User;
    normals(Address { seed: 1, purpose, channel, replicate: 0, group: 0 }, &mut out);
    out
}

fn noisy(clean: &[f64], sigma: f64, channel: u32) -> Vec<f64> {
    clean.iter().zip(noise(channel, clean.len())).map(|(y, e)| y + sigma * e).collect()
}

fn plain(method: Method, rule: Rule, band: Band, options: Options) -> FitOptions {
    FitOptions {
        structure: Structure::new(2, vec![Some(0)]).unwrap(),
        delays: vec![0.0],
        intersample: vec![None],
        rule,
        method,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band,
        options,
    }
}

fn input() -> Vec<f64> {
    (0..=INTERVALS).map(|k| chirp(k as f64 * DT)).collect()
}

/// The setting of the report's eq. (24): M = 6, N = 256, trapezoid, five reweightings, noise to signal .2.
fn study(isa: Isa, draw: Draw) -> Work {
    let five = Options { tol: 0.0, maxiter: 5, wanted: Wanted::Theta };
    let options = plain(Method::Awls, Rule::Trapezoid, Band::Harmonics(6), five);
    replicates(isa, draw, &[0.2], vec![options], Intervals::None)
}

/// The first study that users see: three levels of noise, three estimators, intervals and their coverage.
fn as_run(isa: Isa) -> Work {
    let options = |method| plain(method, Rule::Gregory, Band::Harmonics(6), SETTLED);
    let estimators = [Method::Ls, Method::Awls, Method::Ml].map(options).to_vec();
    replicates(isa, Draw::Coefficients, &[0.05, 0.2, 0.6], estimators, Intervals::Hc3)
}

fn replicates(
    isa: Isa,
    draw: Draw,
    levels: &[f64],
    estimators: Vec<FitOptions>,
    intervals: Intervals,
) -> Work {
    let y = response();
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64).sqrt();
    let contender = |options| Contender {
        options: Told::Plain(options),
        truth: vec![3.0, 8.0, 5.0],
        intervals,
    };
    let group = Group {
        group: 0,
        dt: DT,
        y: vec![y],
        u: vec![input()],
        free: Vec::new(),
        sigma: levels.iter().map(|nsr| nsr * rms).collect(),
        scale: vec![1.0],
        estimators: estimators.into_iter().map(contender).collect(),
    };
    let quantiles = vec![vec![2.0; group.estimators.len()]];
    let plan = Plan::new(&[group], draw, isa).unwrap();
    Box::new(move |replicates| {
        let run = Run { seed: 1, first: 0, replicates, samples: false };
        black_box(plan.run(&run, &quantiles, 1, &mut |_, _| Control::Continue).unwrap());
    })
}

/// One record by the default band, prepared before.
fn single(isa: Isa) -> Work {
    let (y, u) = (noisy(&response(), 0.1, 0), input());
    let options = plain(Method::Ml, Rule::Gregory, Band::Default, SETTLED);
    let fitter = Fitter::new(options, &[(INTERVALS + 1, Time::Even(DT))], isa).unwrap();
    Box::new(move |fits| {
        for _ in 0..fits {
            black_box(fitter.fit(&[RecordView { y: &y, u: vec![&u] }]).unwrap());
        }
    })
}

fn joint_options(structure: JointStructure, band: Band) -> JointOptions {
    JointOptions {
        intersample: vec![None; structure.paths.len()],
        structure: structure.checked().unwrap(),
        rule: Rule::Gregory,
        method: Method::Ml,
        noise: NoiseModel::output(),
        trend: Trend::None,
        extended: true,
        band,
        options: SETTLED,
    }
}

fn joint_fits(
    options: JointOptions,
    variances: &[Vec<Vec<f64>>],
    (y, u): (Vec<Vec<f64>>, Vec<Vec<f64>>),
    isa: Isa,
) -> Work {
    let sampling = [(y[0].len(), Time::Even(DT))];
    let fitter = JointFitter::new(options, &sampling, variances, isa).unwrap();
    Box::new(move |fits| {
        for _ in 0..fits {
            let record = JointRecord {
                y: y.iter().map(Vec::as_slice).collect(),
                u: u.iter().map(Vec::as_slice).collect(),
            };
            black_box(fitter.fit(&[record]).unwrap());
        }
    })
}

/// So many outputs of as many inputs, a denominator of two poles each, on 22 lines; Σ unknown.
fn joint(isa: Isa, outputs: usize) -> Work {
    let samples = INTERVALS + 1;
    let levels: Vec<Vec<f64>> =
        (0..outputs).map(|k| noise(8 + k as u32, samples / 4 + 1)).collect();
    let u: Vec<Vec<f64>> =
        levels.iter().map(|levels| (0..samples).map(|k| levels[k / 4]).collect()).collect();
    let y = (0..outputs).map(|i| {
        let (a1, a2) = (2.0 + 0.2 * i as f64, 8.0 + i as f64);
        let drive = |k: usize| -> f64 {
            u.iter().enumerate().map(|(j, u)| u[k] * (1.0 + (i + 2 * j) as f64)).sum()
        };
        noisy(&held_response(a1, a2, samples, drive), 0.05, i as u32)
    });
    let y = y.collect();
    let structure = JointStructure {
        orders: vec![2; outputs],
        common: false,
        numerators: vec![vec![Some(0); outputs]; outputs],
        paths: (0..outputs).map(|input| Path { input, delay: Delay::Known(0.0) }).collect(),
        fixed: vec![],
        bounds: vec![],
    };
    let options = joint_options(structure, Band::Harmonics(20));
    let intersample = vec![Some(Hold::Zoh); outputs];
    joint_fits(JointOptions { intersample, ..options }, &[], (y, u), isa)
}

/// y'' + a₁y' + a₂y of a drive held between samples, from rest.
fn held_response(a1: f64, a2: f64, samples: usize, drive: impl Fn(usize) -> f64) -> Vec<f64> {
    let steps = 64;
    let h = DT / f64::from(steps);
    let (mut x, mut v, mut out) = (0.0, 0.0, vec![0.0]);
    for k in 0..samples - 1 {
        for _ in 0..steps {
            // The midpoint rule.
            let (xm, vm) = (x + 0.5 * h * v, v + 0.5 * h * (drive(k) - a1 * v - a2 * x));
            (x, v) = (x + h * vm, v + h * (drive(k) - a1 * vm - a2 * xm));
        }
        out.push(x);
    }
    out
}

/// One output of two held inputs, each late by a time to be found.
fn delays(isa: Isa) -> Work {
    let samples = INTERVALS / 2 + 1;
    let levels = [noise(8, samples), noise(9, samples)];
    let u: Vec<Vec<f64>> =
        levels.iter().map(|levels| (0..samples).map(|k| levels[k / 4]).collect()).collect();
    let drive = |k: usize| 5.0 * u[0][k.saturating_sub(1)] + 3.0 * u[1][k.saturating_sub(2)];
    let y = noisy(&held_response(2.0, 8.0, samples, drive), 0.02, 0);
    let late = Delay::Free { start: 0.05, min: 0.0, max: 0.1 };
    let structure = JointStructure {
        orders: vec![2],
        common: true,
        numerators: vec![vec![Some(0); 2]],
        paths: (0..2).map(|input| Path { input, delay: late }).collect(),
        fixed: vec![],
        bounds: vec![],
    };
    let options = joint_options(structure, Band::Harmonics(10));
    let intersample = vec![Some(Hold::Zoh); 2];
    joint_fits(JointOptions { intersample, ..options }, &[], (vec![y], u), isa)
}

/// One record in sixteen of whose samples nothing is known.
fn masked(isa: Isa) -> Work {
    let structure = JointStructure {
        orders: vec![2],
        common: true,
        numerators: vec![vec![Some(0)]],
        paths: vec![Path { input: 0, delay: Delay::Known(0.0) }],
        fixed: vec![],
        bounds: vec![],
    };
    let variance = |k: usize| if k % 16 == 5 { f64::INFINITY } else { 1.0 };
    let variances = vec![vec![(0..=INTERVALS).map(variance).collect()]];
    let options = joint_options(structure, Band::Default);
    joint_fits(options, &variances, (vec![noisy(&response(), 0.1, 0)], vec![input()]), isa)
}

/// Duffing's oscillator, N = 1024, lines to M + 2.
fn oscillator(isa: Isa, harmonics: usize) -> Work {
    let (count, dt) = (1025, 40.0 / 1024.0);
    let (clean, u) = duffing::record(count, dt, [0.5, 0.0]);
    let y = noisy(&clean, 0.2, 0);
    let options = TermsOptions {
        equations: duffing::equations(Rule::Gregory),
        rule: Rule::Gregory,
        method: Method::Ml,
        flat: false,
        trend: Trend::None,
        band: Band::Harmonics(harmonics),
        levels: Some(vec![0.2]),
        levels_matter: true,
        options: SETTLED,
    };
    let fitter = TermsFitter::new(options, &[(count, Time::Even(dt))], &[], isa).unwrap();
    Box::new(move |fits| {
        for _ in 0..fits {
            black_box(fitter.fit(&[TermsRecord { channels: vec![&y, &u] }]).unwrap());
        }
    })
}

/// Rational neighbourhoods of a response of two outputs of two inputs, reweighted, on records of 1,000 lines.
fn frf(isa: Isa) -> Work {
    let lines = 1001;
    let e: Vec<Vec<f64>> = (0..8).map(|c| noise(20 + c, lines)).collect();
    let u: Vec<Vec<[f64; 2]>> =
        (0..2).map(|j| (0..lines).map(|m| [e[2 * j][m], e[2 * j + 1][m]]).collect()).collect();
    let output = |i: usize| -> Vec<[f64; 2]> {
        let line = |m: usize| {
            let x = m as f64 / 100.0 - 4.0 - i as f64;
            let size = 0.25 + x * x;
            let sum = |part: usize| u[0][m][part] + (1.0 + i as f64) * u[1][m][part] + 0.3;
            let noise = |part: usize| 0.01 * e[4 + 2 * i + part][m];
            let (re, im) = (sum(0), sum(1));
            [(0.5 * re + x * im) / size + noise(0), (0.5 * im - x * re) / size + noise(1)]
        };
        (0..lines).map(line).collect()
    };
    let piece = Piece { omega0: 1.0, half: 12, zero: true, y: vec![output(0), output(1)], u };
    let settings = Settings { family: Family::Rational, degree: 2, weighting: Weighting::Awls };
    let omega: Vec<f64> = (0..64).map(|k| 20.3 + 15.0 * f64::from(k)).collect();
    Box::new(move |times| {
        for _ in 0..times {
            let pieces = std::slice::from_ref(&piece);
            let found = responses(isa, 1, settings, pieces, &omega, &mut |_, _| Control::Continue);
            black_box(found.unwrap());
        }
    })
}

/// Four tones in 512 samples of noise.
fn sinusoids(isa: Isa) -> Work {
    let count = 512;
    let tones = [(0.031, 1.0), (0.034, 0.7), (0.11, 0.5), (0.23, 0.3)];
    let wave = |k: usize| -> f64 {
        tones.iter().map(|(f, a)| a * (std::f64::consts::TAU * f * k as f64 + 7.0 * f).cos()).sum()
    };
    let samples = noisy(&(0..count).map(wave).collect::<Vec<f64>>(), 0.3, 0);
    let options = tones::Options {
        count: 4,
        choose: false,
        damped: false,
        complex: false,
        trend: 1,
        band: (0.0, 0.5),
        lines: 0,
        awls: false,
    };
    let plan = tones::Plan::new(&vec![1.0; count], options, isa).unwrap();
    Box::new(move |records| {
        for _ in 0..records {
            let found = plan.run_many(&[&samples], 1, &mut |_, _| Control::Continue);
            black_box(found.unwrap());
        }
    })
}
