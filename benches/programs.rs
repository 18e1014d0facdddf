//! What is counted, timed and compared: one program for each kind of estimation, on records that never change.
//!
//! `counted.rs` counts their instructions on AVX2, `fits.rs` times them on the best set, `bits.rs` prints what
//! they find. They start no thread and call no function of the system's libm.

#![allow(dead_code)] // none of the three uses all of it

#[path = "../tests/rust/common/mod.rs"]
mod common;
#[path = "../tests/rust/common/duffing.rs"]
mod duffing;

use common::{DURATION, INTERVALS, chirp, response};
use modfun::estimate::joint::{
    Delay, JointBatch, JointFitter, JointOptions, JointRecord, JointStructure, NoiseModel, Path,
};
use modfun::estimate::terms::{TermsFitter, TermsOptions, TermsRecord};
use modfun::estimate::{
    Answer, Band, Batch, FitOptions, Fitter, Initial, Many, Options, RecordView, Stream, Time,
    Wanted,
};
use modfun::math::sin_cos_turns_1;
use modfun::monte_carlo::{Contender, Draw, Group, Plan, Run, Told};
use modfun::quadrature::{Hold, Rule};
use modfun::response::{Family, Piece, Settings, Weighting, responses};
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::structure::{CovType, Method, Noise, Structure, Trend};
use modfun::threads::Control;
use modfun::tones;
use std::f64::consts::TAU;

/// Does so many pieces of the work, and says what the last one found.
pub type Work = Box<dyn FnMut(usize) -> Vec<f64>>;

/// A program by its name.
pub struct Program {
    pub name: &'static str,
    /// What one piece is.
    pub piece: &'static str,
    /// Pieces of a count; it is made of twice as many less these.
    pub pieces: usize,
    /// Whether every processor finds the same bits: else an FFT or faer takes the kernels of its processor.
    pub exact: bool,
    pub make: fn(Isa) -> Work,
}

const fn program(
    name: &'static str,
    piece: &'static str,
    pieces: usize,
    exact: bool,
    make: fn(Isa) -> Work,
) -> Program {
    Program { name, piece, pieces, exact, make }
}

pub const ALL: [Program; 15] = [
    program("study as run", "a replicate of nine fits", 1024, true, as_run),
    program("study drawn", "a replicate", 4096, true, |isa| study(isa, Draw::Coefficients)),
    program("study sampled", "a replicate", 4096, true, |isa| study(isa, Draw::Samples)),
    program("single ml", "a fit", 50, true, single),
    program("fit_many", "a record", 512, true, many),
    program("stream", "a sample and an estimate", 50, true, stream),
    program("joint 2x2", "a fit", 1, false, |isa| joint(isa, 2)),
    program("joint 4x4", "a fit", 1, false, |isa| joint(isa, 4)),
    program("joint many", "a record", 16, true, joint_many),
    program("two delays", "a fit", 1, false, delays),
    program("duffing 13", "a fit", 4, true, |isa| oscillator(isa, 13)),
    program("duffing 52", "a fit", 1, false, |isa| oscillator(isa, 52)),
    program("frf", "64 frequencies", 1, true, frf),
    program("tones", "a record", 1, false, sinusoids),
    program("masked", "a fit", 1, false, masked),
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

fn numbers(answer: &Answer) -> Vec<f64> {
    let all = [&answer.theta, &answer.cov_nonrobust, &answer.cov_hc3];
    let rest = [answer.cost, f64::from(answer.nit)];
    all.into_iter().flatten().copied().chain(rest).collect()
}

fn of_many(found: &Many) -> Vec<f64> {
    let all = [&found.theta, &found.bse_nonrobust, &found.bse_hc3, &found.cost];
    all.into_iter().flatten().copied().collect()
}

fn plain(method: Method, rule: Rule, band: Band, options: Options) -> FitOptions {
    FitOptions {
        structure: Structure::new(2, vec![Some(0)]).unwrap(),
        delays: vec![0.0],
        intersample: vec![None].into(),
        rule,
        method,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band,
        own_levels: true,
        initial: Initial::Unknown,
        states: vec![],
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
    replicates(isa, draw, &[0.2], vec![options], None)
}

/// The first study that users see: three levels of noise, three estimators, intervals and their coverage.
fn as_run(isa: Isa) -> Work {
    let options = |method| plain(method, Rule::Gregory, Band::Harmonics(6), SETTLED);
    let estimators = [Method::Ls, Method::Awls, Method::Ml].map(options).to_vec();
    replicates(isa, Draw::Coefficients, &[0.05, 0.2, 0.6], estimators, Some(CovType::Spectral))
}

fn replicates(
    isa: Isa,
    draw: Draw,
    levels: &[f64],
    estimators: Vec<FitOptions>,
    intervals: Option<CovType>,
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
        let groups = plan.run(&run, &quantiles, 0, &mut |_, _| Control::Continue).unwrap();
        let mut out = Vec::new();
        for cell in groups.iter().flatten() {
            out.extend(cell.moments.iter().flat_map(|m| [m.mean, m.sums[0], m.sums[1], m.sums[2]]));
            let counts = cell.covered.iter().chain(&cell.status).chain([&cell.iterations]);
            out.extend(counts.map(|count| *count as f64));
        }
        out
    })
}

/// The last of what a piece of work finds, done so many times.
fn last(times: usize, mut piece: impl FnMut() -> Vec<f64>) -> Vec<f64> {
    (0..times).map(|_| piece()).last().unwrap_or_default()
}

/// One record by the default band, prepared before.
fn single(isa: Isa) -> Work {
    let (y, u) = (noisy(&response(), 0.1, 0), input());
    let options = plain(Method::Ml, Rule::Gregory, Band::Default, SETTLED);
    let fitter = Fitter::new(options, &[(INTERVALS + 1, Time::Even(DT))], isa).unwrap();
    Box::new(move |fits| {
        last(fits, || numbers(&fitter.fit(&[RecordView { y: &y, u: vec![&u] }]).unwrap().answer))
    })
}

/// Records of one input in a batch, on lines that are given.
fn many(isa: Isa) -> Work {
    let options = plain(Method::Ml, Rule::Gregory, Band::Harmonics(16), SETTLED);
    let fitter = Fitter::new(options, &[(INTERVALS + 1, Time::Even(DT))], isa).unwrap();
    let y: Vec<Vec<f64>> = (0..64).map(|k| noisy(&response(), 0.1, k)).collect();
    let u = input();
    Box::new(move |records| {
        let y = y.iter().cycle().take(records).map(Vec::as_slice).collect();
        let batch = Batch { y, u: vec![&u] };
        of_many(&fitter.fit_many(&batch, 0, &mut |_, _| Control::Continue).unwrap().0)
    })
}

/// An estimate after each sample of a stream, from the last hundred.
fn stream(isa: Isa) -> Work {
    let options = plain(Method::Ml, Rule::Gregory, Band::Harmonics(6), SETTLED);
    let mut stream: Stream<Fitter> = Stream::new(options, 101, DT, &[1.0], isa).unwrap();
    let (y, u) = (noisy(&response(), 0.1, 0), input());
    (0..=100).for_each(|k| stream.push(&[y[k], u[k]]));
    let mut at = 100;
    Box::new(move |estimates| {
        last(estimates, || {
            at = (at + 1) % y.len();
            stream.push(&[y[at], u[at]]);
            numbers(&stream.fit().unwrap().answer)
        })
    })
}

fn joint_options(structure: JointStructure, band: Band) -> JointOptions {
    JointOptions {
        intersample: vec![None; structure.paths.len()].into(),
        structure: structure.checked().unwrap(),
        rule: Rule::Gregory,
        method: Method::Ml,
        noise: NoiseModel::output(),
        trend: Trend::None,
        extended: true,
        band,
        driven: false,
        own_levels: true,
        priors: vec![],
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
        last(fits, || {
            let record = JointRecord {
                y: y.iter().map(Vec::as_slice).collect(),
                u: u.iter().map(Vec::as_slice).collect(),
            };
            let found = fitter.fit(&[record]).unwrap();
            numbers(&found.answer).into_iter().chain(found.noise).collect()
        })
    })
}

/// Held inputs, and as many outputs without noise, of two poles each.
fn square(outputs: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
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
        held_response(a1, a2, samples, drive)
    });
    (y.collect(), u)
}

/// What fits such records: a denominator an output, on 22 lines, Σ unknown.
fn square_options(outputs: usize) -> JointOptions {
    let structure = JointStructure {
        orders: vec![2; outputs],
        common: false,
        numerators: vec![vec![Some(0); outputs]; outputs],
        paths: (0..outputs).map(|input| Path { input, delay: Delay::Known(0.0) }).collect(),
        fixed: vec![],
        bounds: vec![],
    };
    let options = joint_options(structure, Band::Harmonics(20));
    JointOptions { intersample: vec![Some(Hold::Zoh); outputs].into(), ..options }
}

fn joint(isa: Isa, outputs: usize) -> Work {
    let (clean, u) = square(outputs);
    let y = clean.iter().enumerate().map(|(i, y)| noisy(y, 0.05, i as u32)).collect();
    joint_fits(square_options(outputs), &[], (y, u), isa)
}

/// Records of two outputs, eight of them a register.
fn joint_many(isa: Isa) -> Work {
    let (clean, u) = square(2);
    let channel = |k: u32| noisy(&clean[(k % 2) as usize], 0.05, k);
    let y: Vec<Vec<f64>> = (0..32).map(channel).collect();
    let sampling = [(y[0].len(), Time::Even(DT))];
    let fitter = JointFitter::new(square_options(2), &sampling, &[], isa).unwrap();
    Box::new(move |records| {
        let y = y.iter().cycle().take(2 * records).map(Vec::as_slice).collect();
        let batch = JointBatch { y, u: u.iter().map(Vec::as_slice).collect(), records };
        let all = fitter.fit_many(&batch, 0, &mut |_, _| Control::Continue);
        of_many(&all.unwrap().0)
    })
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
    let intersample = vec![Some(Hold::Zoh); 2].into();
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
        noise: Noise::Output,
        shapes: Vec::new(),
        trend: Trend::None,
        band: Band::Harmonics(harmonics),
        levels: Some(vec![0.2]),
        levels_matter: true,
        learn: false,
        coloured: false,
        priors: vec![],
        options: SETTLED,
    };
    let fitter = TermsFitter::new(options, &[(count, Time::Even(dt))], &[], isa).unwrap();
    Box::new(move |fits| {
        last(fits, || {
            numbers(&fitter.fit(&[TermsRecord { channels: vec![&y, &u] }]).unwrap().answer)
        })
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
        last(times, || {
            let pieces = std::slice::from_ref(&piece);
            let all = responses(isa, 0, settings, pieces, &omega, &mut |_, _| Control::Continue);
            let found = all.unwrap();
            [found.response, found.cov, found.noise].concat().as_flattened().to_vec()
        })
    })
}

/// Four tones in 512 samples of noise.
fn sinusoids(isa: Isa) -> Work {
    let count = 512;
    let tones = [(0.031, 1.0), (0.034, 0.7), (0.11, 0.5), (0.23, 0.3)];
    let wave = |k: usize| -> f64 {
        tones.iter().map(|(f, a)| a * sin_cos_turns_1(f * k as f64 + 7.0 * f / TAU).1).sum()
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
        last(records, || {
            let all = plan.run_many(&[&samples], 0, &mut |_, _| Control::Continue).unwrap();
            let mut out: Vec<f64> = all[0].tones.iter().map(|t| t.frequency).collect();
            out.extend([&all[0].amplitude, &all[0].phase, &all[0].cov].into_iter().flatten());
            out
        })
    })
}
