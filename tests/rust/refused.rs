//! Arguments and numbers from Rust that no record can serve: refused in words before anything of their size is laid
//! out, or a status.
#![allow(clippy::unwrap_used)]

use modfun::estimate::joint::{Delay, JointFitter, JointOptions, JointStructure, NoiseModel, Path};
use modfun::estimate::{Band, FitOptions, Fitter, Initial, Options, RecordView, Time, Wanted};
use modfun::integrate::{Past, Problem, integrate};
use modfun::model::StateSpace;
use modfun::model::discretise::phi;
use modfun::quadrature::Rule;
use modfun::response::{Family, Piece, Settings, Weighting, responses};
use modfun::simd::Isa;
use modfun::simulate::{Input, simulate};
use modfun::spectrum::{CoefficientPlan, Kind};
use modfun::structure::{Method, Noise, Structure, Trend};
use modfun::tape::Tape;
use modfun::threads::Control;
use modfun::tones;
use modfun::{Error, Status};

const N: usize = 65;
const OPTIONS: Options = Options { tol: 1e-9, maxiter: 9, wanted: Wanted::Covariance };

/// The words of a refusal.
fn said<T>(answer: Result<T, Error>) -> String {
    match answer.err().unwrap() {
        Error::Data(text) | Error::Spec(text) => text,
        other => format!("not refused: {other}"),
    }
}

fn options(delay: f64, band: Band) -> FitOptions {
    FitOptions {
        structure: Structure::new(2, vec![Some(0)]).unwrap(),
        delays: vec![delay],
        intersample: vec![None].into(),
        rule: Rule::Gregory,
        method: Method::Ml,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band,
        own_levels: true,
        initial: Initial::Unknown,
        states: vec![],
        options: OPTIONS,
    }
}

fn fitter(delay: f64, band: Band, samples: usize, time: Time<'_>) -> String {
    said(Fitter::new(options(delay, band), &[(samples, time)], Isa::Plain))
}

#[test]
fn steps_and_instants_that_are_no_sampling() {
    for dt in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let text = fitter(0.0, Band::Default, N, Time::Even(dt));
        assert!(text.contains("positive and finite"), "{text}");
    }
    let t: Vec<f64> = (0..N - 2).map(|k| k as f64).collect();
    let text = fitter(0.0, Band::Default, N, Time::Uneven(&t));
    assert!(text.contains("63 instants of 65 samples"), "{text}");
}

#[test]
fn delays_and_harmonics_beyond_all_records() {
    let text = fitter(1e300, Band::Default, N, Time::Even(0.1));
    assert!(text.contains("spent on the delay"), "{text}");
    let text = fitter(0.0, Band::Harmonics(usize::MAX), N, Time::Even(0.1));
    assert!(text.contains("give at most 30"), "{text}");
    for (intervals, lead) in [(usize::MAX, 0), (64, usize::MAX)] {
        let plan = CoefficientPlan::new(intervals, 3, Kind::Rule(Rule::Gregory), 0.0, lead);
        assert!(said(plan).contains("shorter record"));
    }
}

#[test]
fn degrees_whose_sum_is_no_number() {
    let most = Structure::new(usize::MAX, vec![Some(usize::MAX), Some(0)]).unwrap();
    assert_eq!(most.parameters(), usize::MAX);
    let o = FitOptions {
        structure: most,
        delays: vec![0.0; 2],
        intersample: vec![None; 2].into(),
        ..options(0.0, Band::Default)
    };
    let text = said(Fitter::new(o, &[(N, Time::Even(0.1))], Isa::Plain));
    assert!(text.contains("take fewer poles and zeros"), "{text}");
    let text = said(joint(usize::MAX, 0).structure.checked());
    assert!(text.contains("fewer poles and zeros"), "{text}");
}

fn joint(order: usize, input: usize) -> JointOptions {
    let structure = JointStructure {
        orders: vec![order; 2],
        common: false,
        numerators: vec![vec![Some(0)]; 2],
        paths: vec![Path { input, delay: Delay::Known(0.0) }],
        fixed: vec![],
        bounds: vec![],
    };
    JointOptions {
        structure: if order < N { structure.checked().unwrap() } else { structure },
        intersample: vec![None].into(),
        rule: Rule::Gregory,
        method: Method::Ml,
        noise: NoiseModel::output(),
        trend: Trend::None,
        extended: true,
        band: Band::Harmonics(8),
        driven: false,
        own_levels: true,
        priors: vec![],
        options: OPTIONS,
    }
}

#[test]
fn inputs_and_noise_that_a_joint_structure_does_not_have() {
    let refused = |o, variances: &[Vec<Vec<f64>>]| {
        said(JointFitter::new(o, &[(N, Time::Even(0.1))], variances, Isa::Plain))
    };
    let text = refused(joint(2, 1), &[]);
    assert!(text.contains("input 1 where there are 1"), "{text}");
    let noise = NoiseModel { outputs: Some(vec![1.0]), ..NoiseModel::output() };
    let text = refused(JointOptions { noise, ..joint(2, 0) }, &[]);
    assert!(text.contains("not those of 2 outputs and 1 paths"), "{text}");
    let noise = NoiseModel { spectra: vec![vec![vec![1.0; 4]; 3]], ..NoiseModel::output() };
    let text = refused(JointOptions { noise, ..joint(2, 0) }, &[]);
    assert!(text.contains("4 lines where 11 are needed"), "{text}");
    let text = refused(joint(2, 0), &[vec![vec![1.0; N]]]);
    assert!(text.contains("variances of 1 outputs for 2"), "{text}");
    let reversed = JointStructure { bounds: vec![(1.0, -1.0); 6], ..joint(2, 0).structure };
    let text = said(reversed.checked());
    assert!(text.contains("bounds from 1 to -1"), "{text}");
}

#[test]
fn counts_of_lines_and_tones() {
    let channel = vec![vec![[1.0, 0.0]; 40]];
    let piece =
        |half| Piece { omega0: 0.1, half, zero: true, y: channel.clone(), u: channel.clone() };
    for (half, degree) in [(usize::MAX, 2), (6, usize::MAX)] {
        let settings = Settings { family: Family::Rational, degree, weighting: Weighting::Ls };
        let go_on = &mut |_: usize, _: usize| Control::Continue;
        let text = said(responses(Isa::Plain, 1, settings, &[piece(half)], &[1.0], go_on));
        assert!(text.contains("smaller half-width"), "{text}");
    }
    let o = tones::Options {
        count: usize::MAX / 2,
        choose: false,
        damped: true,
        complex: false,
        trend: 1,
        band: (0.0, 0.5),
        lines: 0,
        awls: false,
    };
    assert!(said(tones::Plan::new(&[1.0; 50], o, Isa::Plain)).contains("fewer tones"));
}

#[test]
fn starts_of_an_integration_that_are_not_there() {
    let tape = Tape::new(&[("input".into(), 0.0, 1, 0)], 2, vec![0]).unwrap();
    let problem = Problem {
        tape: &tape,
        grid: &[0.0, 1.0],
        drives: &[],
        terms: usize::MAX,
        pasts: &[],
        starts: &[1.0],
        theta: &[],
        count: 1,
        relative: 1e-6,
        absolute: &[1e-6],
        most: 9,
    };
    for count in [0, 2, usize::MAX] {
        assert!(said(integrate(&Problem { count, ..problem })).contains("do not go"), "{count}");
    }
    let late = Tape::new(&[("input".into(), 0.0, 2, 0)], 3, vec![0]).unwrap();
    for (state, delay) in [(1, 0.5), (0, -0.5), (0, f64::NAN)] {
        let pasts = [Past { state, delay }];
        let text = said(integrate(&Problem { tape: &late, pasts: &pasts, ..problem }));
        assert!(text.contains("a delay is at least 0"), "{text}");
    }
}

#[test]
fn models_whose_size_is_no_number() {
    let nothing = StateSpace { a: &[], b: &[], c: &[], d: &[], states: 0, inputs: 0, outputs: 0 };
    let many = StateSpace { states: usize::MAX, ..nothing };
    assert!(said(many.check()).contains("got 0 entries"));
    let text = said(simulate(&nothing, &[], Input::Zoh(&[]), 0.1, usize::MAX));
    assert!(text.contains("take at most"), "{text}");
}

#[test]
fn balancing_ends_at_the_edge_of_numbers() {
    // Four times the column leaves the range.
    let a = [0.0, 1e308, 4.9e307, 0.0];
    let x = phi(2, &a);
    assert_eq!(x[0].len(), 4);
}

#[test]
fn frequencies_beyond_all_lines_are_those_of_the_last() {
    let channel = |by: f64| (0..40).map(|k| [by * f64::from(k), 1.0]).collect();
    let piece =
        Piece { omega0: 0.1, half: 6, zero: true, y: vec![channel(2.0)], u: vec![channel(1.0)] };
    let settings = Settings { family: Family::Polynomial, degree: 2, weighting: Weighting::Ls };
    let go_on = &mut |_: usize, _: usize| Control::Continue;
    let omega = [-1e300, 1e300, f64::INFINITY, f64::NAN];
    let found = responses(Isa::Plain, 1, settings, &[piece], &omega, go_on).unwrap();
    assert_eq!(found.response.len(), 4);
}

#[test]
fn an_estimate_beyond_numbers_is_not_ok() {
    let fitter =
        Fitter::new(options(0.0, Band::Harmonics(8)), &[(129, Time::Even(0.1))], Isa::Plain)
            .unwrap();
    let u: Vec<f64> = (0..129).map(|k| 1e-160 * libm::sin(0.002 * f64::from(k * k))).collect();
    let y: Vec<f64> = (0..129).map(|k| 1e150 * libm::cos(0.05 * f64::from(k))).collect();
    let fit = fitter.fit(&[RecordView { y: &y, u: vec![&u] }]).unwrap().answer;
    assert!(!fit.theta[2].is_finite());
    assert_eq!(fit.status, Status::NonFinite);
}
