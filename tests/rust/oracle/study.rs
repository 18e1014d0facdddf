//! Studies and streams: noise of the level that was asked for, initial states, coverage and counts by hand.

use super::dense::dot;
use super::fast::OPTIONS;
use super::signals::{System, noise, samples, smooth};
use modfun::estimate::joint::{
    Delay, JointFitter, JointOptions, JointRecord, JointStructure, NoiseModel, Path,
};
use modfun::estimate::{Band, FitOptions, Fitter, Initial, RecordView, Stream, Time};
use modfun::math::student;
use modfun::monte_carlo::histogram::quantile;
use modfun::monte_carlo::{Cell, Contender, Draw, Group, Plan, Run, Told};
use modfun::quadrature::Rule;
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::structure::{CovType, Method, Noise, Structure, Trend};
use modfun::threads::Control;

const COUNT: usize = 257;
const DT: f64 = 10.0 / 256.0;
const TRUTH: [f64; 3] = [1.6, 9.0, 5.0];
const SIGMA: f64 = 0.05;
const REPLICATES: usize = 600;

fn options(method: Method) -> FitOptions {
    FitOptions {
        structure: Structure::new(2, vec![Some(0)]).unwrap(),
        delays: vec![0.0],
        intersample: vec![None].into(),
        rule: Rule::Trapezoid,
        method,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band: Band::Harmonics(16),
        own_levels: false,
        initial: Initial::Unknown,
        states: vec![],
        options: OPTIONS,
    }
}

fn joint() -> JointOptions {
    let structure = JointStructure {
        orders: vec![2, 2],
        common: true,
        numerators: vec![vec![Some(0)], vec![Some(1)]],
        paths: vec![Path { input: 0, delay: Delay::Known(0.0) }],
        fixed: vec![],
        bounds: vec![],
    };
    JointOptions {
        structure: structure.checked().unwrap(),
        intersample: vec![None].into(),
        rule: Rule::Trapezoid,
        method: Method::Ml,
        noise: NoiseModel { outputs: Some(vec![1.0, 0.0, 0.0, 4.0]), ..NoiseModel::output() },
        trend: Trend::None,
        extended: true,
        band: Band::Harmonics(16),
        driven: false,
        own_levels: false,
        priors: vec![],
        options: OPTIONS,
    }
}

fn input() -> Vec<f64> {
    samples(COUNT, DT, |t| smooth(0, t))
}

fn response(b: [f64; 2], state: [f64; 2]) -> Vec<f64> {
    let system = System { a: vec![1.6, 9.0], b: vec![b.to_vec()] };
    system.response(&|_, _, t| smooth(0, t), (COUNT, DT), &state)
}

/// What a unit of the first state adds to an output, less the forced response.
fn free(state: [f64; 2]) -> Vec<f64> {
    let still = System { a: vec![1.6, 9.0], b: vec![vec![0.0, 0.0]] };
    still.response(&|_, _, _| 0.0, (COUNT, DT), &state)
}

fn group(
    told: Told,
    truth: Vec<f64>,
    intervals: Option<CovType>,
    states: Vec<Vec<Vec<f64>>>,
) -> Group {
    let two = matches!(told, Told::Joint(_));
    let mut y = vec![response([0.0, 5.0], [0.0; 2])];
    let mut scale = vec![1.0];
    if two {
        y.push(response([1.0, 2.0], [0.0; 2]));
        scale.push(2.0);
    }
    Group {
        group: 3,
        dt: DT,
        y,
        u: vec![input()],
        free: states,
        sigma: vec![0.0, SIGMA],
        scale,
        estimators: vec![Contender { options: told, truth, intervals }],
    }
}

/// Cells of the two levels.
fn run(group: &Group, draw: Draw, quantile: f64) -> Vec<Cell> {
    let plan = Plan::new(std::slice::from_ref(group), draw, Isa::detect().unwrap()).unwrap();
    let run = Run { seed: 5, first: 7, replicates: REPLICATES, samples: true };
    plan.run(&run, &[vec![quantile]], 1, &mut |_, _| Control::Continue).unwrap().swap_remove(0)
}

/// Noise of a replicate of the group's streams.
fn drawn(purpose: Purpose, channel: u32, replicate: u64, count: usize) -> Vec<f64> {
    let mut out = vec![0.0; count];
    normals(Address { seed: 5, purpose, channel, replicate, group: 3 }, &mut out);
    out
}

/// Every replicate fitted by itself, from samples made by hand: θ and HC3 or classical standard errors.
fn alone(
    group: &Group,
    replicate: u64,
    kind: Option<CovType>,
    quantile: f64,
) -> (Vec<f64>, Vec<f64>) {
    let z = drawn(Purpose::InitialState, 0, replicate, group.free.len());
    let records: Vec<Vec<f64>> = (0..group.y.len())
        .map(|i| {
            let e = drawn(Purpose::NoiseY, i as u32, replicate, COUNT);
            (0..COUNT)
                .map(|k| {
                    let start: f64 = z.iter().zip(&group.free).map(|(z, f)| z * f[i][k]).sum();
                    group.y[i][k] + start + SIGMA * group.scale[i] * e[k]
                })
                .collect()
        })
        .collect();
    let isa = Isa::detect().unwrap();
    let u = input();
    let sampling = [(COUNT, Time::Even(DT))];
    let answer = match &group.estimators[0].options {
        Told::Plain(o) => {
            let view = RecordView { y: &records[0], u: vec![&u] };
            Fitter::new(o.clone(), &sampling, isa).unwrap().fit(&[view]).unwrap().answer
        }
        Told::Joint(o) => {
            let view = JointRecord { y: records.iter().map(Vec::as_slice).collect(), u: vec![&u] };
            JointFitter::new((**o).clone(), &sampling, &[], isa)
                .unwrap()
                .fit(&[view])
                .unwrap()
                .answer
        }
    };
    let p = answer.theta.len();
    // Half widths over `quantile`: of a spectrum that is estimated with degrees of freedom of its own.
    let width = |k: usize, cov: &[f64], by: f64| cov[k * (p + 1)].sqrt() * by;
    let bse = (0..p)
        .map(|k| match kind {
            Some(CovType::Spectral) => {
                width(k, &answer.cov_spectral, student(quantile, answer.degrees[k]) / quantile)
            }
            Some(CovType::Hc3) => width(k, &answer.cov_hc3, 1.0),
            _ => width(k, &answer.cov_nonrobust, 1.0),
        })
        .collect();
    (answer.theta, bse)
}

/// Each estimate, moments, coverage, bins: those of fits one by one.
fn check(group: &Group, quantile_of: f64) {
    let cell = &run(group, Draw::Samples, quantile_of)[1];
    let kind = group.estimators[0].intervals;
    let truth = &group.estimators[0].truth;
    let p = truth.len();
    let fits: Vec<(Vec<f64>, Vec<f64>)> =
        (0..REPLICATES as u64).map(|k| alone(group, 7 + k, kind, quantile_of)).collect();
    assert_eq!(cell.status[0], REPLICATES as u64, "{:?}", cell.status);
    for (k, (theta, bse)) in fits.iter().enumerate() {
        for j in 0..p {
            let gap = (cell.samples[k * p + j] - theta[j]).abs();
            assert!(gap < 1e-5 * bse[j], "replicate {k}, parameter {j}: {gap}");
        }
    }
    for j in 0..p {
        let errors: Vec<f64> = fits.iter().map(|(theta, _)| theta[j] - truth[j]).collect();
        let n = REPLICATES as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let square: f64 = errors.iter().map(|e| (e - mean) * (e - mean)).sum();
        let sd = (square / (n - 1.0)).sqrt();
        assert_eq!(cell.moments[j].count, REPLICATES as u64);
        assert!((cell.moments[j].bias() - mean).abs() < 1e-5 * sd);
        assert!((cell.moments[j].sd() / sd - 1.0).abs() < 1e-5);
        let inside = |factor: f64| {
            let one = |((theta, bse), e): (&(Vec<f64>, Vec<f64>), &f64)| {
                theta[j].is_finite() && e.abs() <= factor * quantile_of * bse[j]
            };
            fits.iter().zip(&errors).filter(|both| one(*both)).count() as u64
        };
        // Rounding may move a replicate across the bound.
        let (least, most) = (inside(1.0 - 1e-5), inside(1.0 + 1e-5));
        assert!(
            (least..=most).contains(&cell.covered[j]),
            "{} of {least}..{most}",
            cell.covered[j]
        );
        assert!(most < REPLICATES as u64, "coverage that cannot be too large");
        let counted: u64 = cell.bins[j].iter().map(|(_, count)| count).sum();
        assert_eq!(counted, REPLICATES as u64);
        let mut sorted = errors.clone();
        sorted.sort_by(f64::total_cmp);
        for share in [0.1, 0.5, 0.9] {
            let rank = share * (n - 1.0);
            let (low, part) = (rank as usize, rank.fract());
            let want = sorted[low] + part * (sorted[low + 1] - sorted[low]);
            let found = quantile(&cell.bins[j], truth[j], share);
            assert!((found - want).abs() < 0.01 * sd, "{share}: {found} {want}");
        }
    }
}

#[test]
fn a_study_counts_what_its_replicates_give() {
    for (method, intervals) in [
        (Method::Ml, Some(CovType::Hc3)),
        (Method::Ml, Some(CovType::Spectral)),
        (Method::Awls, Some(CovType::Nonrobust)),
        (Method::Ls, Some(CovType::Spectral)),
    ] {
        check(&group(Told::Plain(options(method)), TRUTH.to_vec(), intervals, vec![]), 1.2);
    }
}

#[test]
fn random_initial_states_add_their_responses() {
    let states = vec![vec![free([0.4, 0.0])], vec![free([0.0, 1.5])]];
    check(
        &group(Told::Plain(options(Method::Ml)), TRUTH.to_vec(), Some(CovType::Spectral), states),
        1.2,
    );
}

#[test]
fn a_study_of_joint_fits_counts_what_its_replicates_give() {
    let truth = vec![1.6, 9.0, 5.0, 1.0, 2.0];
    check(&group(Told::Joint(Box::new(joint())), truth, Some(CovType::Spectral), vec![]), 1.2);
}

/// Coefficients drawn have the spread of those of samples drawn, and the first level has no noise.
#[test]
fn coefficients_drawn_are_as_noisy_as_samples() {
    let one = group(Told::Plain(options(Method::Ml)), TRUTH.to_vec(), None, vec![]);
    let (of_samples, of_lines) =
        (run(&one, Draw::Samples, 0.0), run(&one, Draw::Coefficients, 0.0));
    for j in 0..3 {
        assert!(of_lines[0].moments[j].sd() < 1e-8 && of_samples[0].moments[j].sd() < 1e-8);
        // Each has a standard error of 2.9 %: four of their difference's.
        let ratio = of_lines[1].moments[j].sd() / of_samples[1].moments[j].sd();
        assert!((ratio - 1.0).abs() < 0.16, "parameter {j}: {ratio}");
    }
}

/// Windows of a stream from the latest back, and their weights.
#[test]
fn a_stream_is_a_fit_of_its_weighted_windows() {
    let (intervals, windows) = (COUNT - 1, 3);
    let total = intervals * windows + 40;
    let u = samples(total, DT, |t| smooth(0, t));
    let system = System { a: vec![1.6, 9.0], b: vec![vec![0.0, 5.0]] };
    let clean = system.response(&|_, _, t| smooth(0, t), (total, DT), &[0.0; 2]);
    let y: Vec<f64> = clean.iter().zip(noise(9, 1, total)).map(|(y, e)| y + SIGMA * e).collect();
    let weights = [1.0, 0.6, 0.3];
    let isa = Isa::detect().unwrap();
    for method in [Method::Awls, Method::Ml] {
        let mut stream = Stream::<Fitter>::new(options(method), COUNT, DT, &weights, isa).unwrap();
        for (k, (y, u)) in y.iter().zip(&u).enumerate() {
            stream.push(&[*y, *u]);
            assert_eq!(stream.windows(), (k / intervals).min(windows), "after {} samples", k + 1);
        }
        let found = stream.fit().unwrap().answer;
        // The same windows as records of their own, each multiplied by its weight.
        let cut = |v: &[f64], back: usize| -> Vec<f64> {
            let to = total - back * intervals;
            v[to - COUNT..to].iter().map(|x| weights[back] * x).collect()
        };
        let records: Vec<(Vec<f64>, Vec<f64>)> =
            (0..windows).map(|back| (cut(&y, back), cut(&u, back))).collect();
        let views: Vec<RecordView<'_>> =
            records.iter().map(|(y, u)| RecordView { y, u: vec![u] }).collect();
        let sampling = vec![(COUNT, Time::Even(DT)); windows];
        let want =
            Fitter::new(options(method), &sampling, isa).unwrap().fit(&views).unwrap().answer;
        let now = stream.now().unwrap();
        for k in 0..3 {
            let bse = want.cov_hc3[4 * k].sqrt();
            assert!((found.theta[k] - want.theta[k]).abs() < 1e-5 * bse);
            assert!((now.theta[k] - want.theta[k]).abs() < 1e-5 * bse);
            assert!((now.bse_hc3[k] / bse - 1.0).abs() < 1e-5);
        }
        // Moments eight at a time, and one by one.
        let mut other = Stream::<Fitter>::new(options(method), COUNT, DT, &weights, isa).unwrap();
        let all: Vec<Vec<f64>> = y.iter().zip(&u).map(|(y, u)| vec![*y, *u]).collect();
        let (counts, followed) = other.follow(&all, 50).unwrap();
        assert_eq!(counts.len() * 3, followed.theta.len());
        let mut third = Stream::<Fitter>::new(options(method), COUNT, DT, &weights, isa).unwrap();
        for (k, sample) in all.iter().enumerate() {
            third.push(sample);
            if let Some(at) = counts.iter().position(|c| *c == k as u64 + 1) {
                let now = third.now().unwrap();
                let gap: Vec<f64> = (0..3)
                    .map(|j| (now.theta[j] - followed.theta[3 * at + j]) / now.bse_hc3[j])
                    .collect();
                assert!(dot(&gap, &gap) < 1e-8, "{gap:?}");
            }
        }
    }
}
