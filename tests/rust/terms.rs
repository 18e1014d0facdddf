//! Fits of equations in the core: Duffing's oscillator, bits on every processor, and input that is none.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use modfun::Status;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsBatch, TermsFitter, TermsOptions, TermsRecord,
};
use modfun::estimate::{Answer, Band, Options, Time, Wanted};
use modfun::quadrature::Rule;
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Trend};
use modfun::tape::{Tape, Written};
use modfun::threads::Control;

const N: usize = 512;
const DT: f64 = 20.0 / N as f64;
const TRUE: [f64; 3] = [0.3, 1.0, 0.5];

fn drive(t: f64) -> f64 {
    2.0 * (1.1 * t).sin() + 1.5 * (2.3 * t + 1.0).sin() + (0.45 * t).sin()
}

/// y'' + .3y' + y + .5y³ = u from (.5, 0) by small Runge–Kutta steps.
fn clean() -> (Vec<f64>, Vec<f64>) {
    let slope = |t: f64, x: [f64; 2]| {
        [x[1], drive(t) - TRUE[0] * x[1] - TRUE[1] * x[0] - TRUE[2] * x[0] * x[0] * x[0]]
    };
    let steps = 40;
    let h = DT / f64::from(steps);
    let (mut x, mut y) = ([0.5, 0.0], vec![0.5]);
    for k in 0..N {
        for j in 0..steps {
            let t = k as f64 * DT + f64::from(j) * h;
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
    (y, (0..=N).map(|k| drive(k as f64 * DT)).collect())
}

fn op(name: &str, value: f64, a: usize, b: usize) -> Written {
    (name.to_owned(), value, a, b)
}

/// Channels y, u; signals y, y³ − 3σ²y, u and the slopes 1, 3y² − 3σ².
fn duffing() -> Equations {
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
    let signal = Signal { kind: Kind::Rule(Rule::Gregory), lag: Lag::Known(0.0) };
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
        bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); 3],
        linear: true,
    }
}

fn fitter(band: Band, level: Option<f64>, isa: Isa) -> TermsFitter {
    TermsFitter::new(options(band, level), &[(N + 1, Time::Even(DT))], &[], isa).unwrap()
}

fn options(band: Band, level: Option<f64>) -> TermsOptions {
    let options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };
    TermsOptions {
        equations: duffing(),
        rule: Rule::Gregory,
        method: Method::Ml,
        flat: false,
        trend: Trend::None,
        band,
        levels: level.map(|s| vec![s]),
        levels_matter: true,
        options,
    }
}

fn noisy(y: &[f64], sigma: f64, replicate: u64) -> Vec<f64> {
    let mut e = vec![0.0; y.len()];
    let purpose = Purpose::User;
    normals(Address { seed: 3, purpose, channel: 0, replicate, group: 0 }, &mut e);
    y.iter().zip(&e).map(|(y, e)| y + sigma * e).collect()
}

fn fit(fitter: &TermsFitter, y: &[f64], u: &[f64]) -> Answer {
    fitter.fit(&[TermsRecord { channels: vec![y, u] }]).unwrap().answer
}

#[test]
fn parameters_come_back_without_noise() {
    let (y, u) = clean();
    for band in [Band::Harmonics(11), Band::Default] {
        let found = fit(&fitter(band, None, Isa::detect().unwrap()), &y, &u);
        assert_eq!(found.status, Status::Ok);
        for (found, want) in found.theta.iter().zip(TRUE) {
            assert!((found / want - 1.0).abs() < 2e-5, "{band:?}: {found} for {want}");
        }
    }
}

#[test]
fn bits_are_the_same_on_every_processor_and_in_a_batch() {
    let (y, u) = clean();
    let records: Vec<Vec<f64>> = (0..5).map(|k| noisy(&y, 0.2, k)).collect();
    let mut first: Option<Vec<u64>> = None;
    for isa in Isa::available() {
        let fitter = fitter(Band::Harmonics(11), Some(0.2), isa);
        let bits: Vec<u64> =
            records.iter().flat_map(|y| fit(&fitter, y, &u).theta).map(f64::to_bits).collect();
        let batch = TermsBatch {
            records: records.iter().map(|y| TermsRecord { channels: vec![y, &u] }).collect(),
        };
        for threads in [1, 2] {
            let (many, _, _) =
                fitter.fit_many(&batch, threads, &mut |_, _| Control::Continue).unwrap();
            let own: Vec<u64> = many.theta.iter().map(|t| t.to_bits()).collect();
            assert_eq!(own, bits, "{isa:?}, {threads} threads");
        }
        assert_eq!(*first.get_or_insert(bits.clone()), bits, "{isa:?}");
    }
}

#[test]
fn values_that_are_no_signal_end_in_a_status() {
    let (y, u) = clean();
    let isa = Isa::detect().unwrap();
    for bad in [f64::NAN, f64::INFINITY, 1e308, -1e200, 5e-324] {
        for place in [0, N / 2, N] {
            let mut spoiled = noisy(&y, 0.1, 0);
            spoiled[place] = bad;
            for level in [None, Some(0.1)] {
                let found = fit(&fitter(Band::Harmonics(11), level, isa), &spoiled, &u);
                let sound = found.theta.iter().all(|t| t.is_finite());
                assert!(sound || found.status != Status::Ok, "{bad} at {place}");
            }
        }
    }
    for constant in [0.0, 1.0, 1e300, 1e-300] {
        let flat = vec![constant; N + 1];
        let found = fit(&fitter(Band::Harmonics(11), None, isa), &flat, &u);
        assert_ne!(found.status, Status::Ok, "a channel that stands at {constant}");
    }
}

#[test]
fn equations_that_do_not_fit_together_are_refused() {
    let o = |change: &dyn Fn(&mut Equations)| {
        let mut e = duffing();
        change(&mut e);
        e.check().unwrap_err().to_string()
    };
    assert!(o(&|e| e.terms[0].signal = 9).contains("equations do not fit"));
    assert!(o(&|e| e.slopes.clear()).contains("coefficients do not fit"));
    assert!(o(&|e| e.sensitivities[0] = (9, 0)).contains("signals do not fit"));
    assert!(o(&|e| e.noisy = vec![7]).contains("channels do not fit"));
    assert!(o(&|e| e.bounds.clear()).contains("starts and bounds"));
    assert!(o(&|e| e.signals[0].lag = Lag::Parameter(0)).contains("delays"));
    let few = [vec![vec![1.0; N]]];
    let fitter = TermsFitter::new(
        options(Band::Default, None),
        &[(N + 1, Time::Even(DT))],
        &few,
        Isa::Plain,
    );
    assert!(fitter.err().unwrap().to_string().contains("variances of"));
}
