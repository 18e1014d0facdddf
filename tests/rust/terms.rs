//! Fits of equations in the core: Duffing's oscillator, bits on every processor, and input that is none.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

#[path = "common/duffing.rs"]
mod duffing;

use duffing::TRUE;
use modfun::Status;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsBatch, TermsFitter, TermsOptions, TermsRecord,
};
use modfun::estimate::{Answer, Band, Many, Options, Prior, Time, Wanted};
use modfun::quadrature::Rule;
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Noise, Trend};
use modfun::tape::Tape;
use modfun::threads::Control;
use proptest::prelude::*;

const N: usize = 512;
const DT: f64 = 20.0 / N as f64;

fn clean() -> (Vec<f64>, Vec<f64>) {
    duffing::record(N + 1, DT, [0.5, 0.0])
}

fn fitter(band: Band, level: Option<f64>, isa: Isa) -> TermsFitter {
    TermsFitter::new(options(band, level), &[(N + 1, Time::Even(DT))], &[], isa).unwrap()
}

fn options(band: Band, level: Option<f64>) -> TermsOptions {
    let options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };
    TermsOptions {
        equations: duffing::equations(Rule::Gregory),
        rule: Rule::Gregory,
        method: Method::Ml,
        noise: Noise::Output,
        shapes: Vec::new(),
        trend: Trend::None,
        band,
        levels: level.map(|s| vec![s]),
        levels_matter: true,
        learn: false,
        coloured: false,
        priors: vec![],
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
    let records: Vec<Vec<f64>> = (0..21).map(|k| noisy(&y, 0.2, k)).collect();
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
fn a_spoiled_record_leaves_nothing_behind() {
    let (y, u) = clean();
    let mut records: Vec<Vec<f64>> = (0..4).map(|k| noisy(&y, 0.2, k)).collect();
    records[0][7] = 1e300;
    records[2][9] = f64::NAN;
    for last in 9..17 {
        let fitter = |band| fitter(band, Some(0.2), Isa::detect().unwrap());
        let own = fitter(Band::Harmonics(last));
        for k in [1, 3] {
            let alone = fit(&fitter(Band::Harmonics(last)), &records[k], &u);
            fit(&own, &records[k - 1], &u);
            assert_eq!(fit(&own, &records[k], &u).theta, alone.theta, "to line {last}");
            assert_eq!(alone.status, Status::Ok);
        }
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
        let mut e = duffing::equations(Rule::Gregory);
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

/// y₁' + θ₀y₁ + θ₁y₁y₂ = u and y₂'(t − h) + θ₂y₂(t − h) = θ₃y₁, noise on y₁ and y₂.
fn pair(h: f64) -> Equations {
    let op = duffing::op;
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("multiply", 0.0, 0, 1),
        op("constant", 1.0, 0, 0),
    ];
    let coefficients = [
        op("constant", 1.0, 0, 0),
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("constant", -1.0, 0, 0),
        op("input", 0.0, 2, 0),
        op("input", 0.0, 3, 0),
        op("multiply", 0.0, 5, 3),
    ];
    let signal = |lag| Signal { kind: Kind::Rule(Rule::Gregory).into(), lag: Lag::Known(lag) };
    let term = |equation, signal, order| Term { equation, signal, order };
    Equations {
        orders: vec![1, 1],
        // y₁, y₁y₂, u, y₂(t − h).
        signals: vec![signal(0.0), signal(0.0), signal(0.0), signal(h)],
        terms: vec![
            term(0, 0, 1),
            term(0, 0, 0),
            term(0, 1, 0),
            term(0, 2, 0),
            term(1, 3, 1),
            term(1, 3, 0),
            term(1, 0, 0),
        ],
        coefficients: Tape::new(&coefficients, 4, vec![0, 1, 2, 3, 0, 4, 6, 0, 0, 0, 3]).unwrap(),
        slopes: vec![(1, 0), (2, 1), (5, 2), (6, 3)],
        samples: Tape::new(&formulas, 10, vec![0, 3, 2, 1, 4, 1, 0, 4]).unwrap(),
        sensitivities: vec![(0, 0), (1, 0), (1, 1), (3, 1)],
        signal_slopes: Vec::new(),
        channels: 3,
        noisy: vec![0, 1],
        parameters: 4,
        starts: vec![None; 4],
        near: false,
        bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); 4],
        linear: true,
    }
}

/// A record of the pair, channels y₁, y₂, u; y₂ late by one sample.
fn pair_record() -> [Vec<f64>; 3] {
    let (steps, mut x) = (20, [0.4, -0.3]);
    let h = DT / f64::from(steps);
    let [mut a, mut b] = [vec![x[0]], vec![x[1]]];
    for k in 0..N * steps as usize {
        let u = duffing::drive(k as f64 * h);
        let slope = [u - 0.5 * x[0] - 0.3 * x[0] * x[1], 0.6 * x[0] - 0.8 * x[1]];
        x = [x[0] + h * slope[0], x[1] + h * slope[1]];
        if (k + 1) % steps as usize == 0 {
            a.push(x[0]);
            b.push(x[1]);
        }
    }
    [a, b, (0..=N).map(|k| duffing::drive(k as f64 * DT)).collect()]
}

/// Duffing's oscillator with θ₀² in the place of θ₀.
fn squared() -> Equations {
    let mut e = duffing::equations(Rule::Gregory);
    let op = duffing::op;
    let written = [
        op("constant", 1.0, 0, 0),
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 1, 1),
        op("add", 0.0, 1, 1),
    ];
    e.coefficients = Tape::new(&written, 3, vec![0, 5, 2, 3, 4, 6, 0, 0]).unwrap();
    e.linear = false;
    e
}

fn bits(many: &Many, record: usize) -> Vec<u64> {
    let p = many.theta.len() / many.status.len();
    let own = |all: &[f64]| all[record * p..(record + 1) * p].to_vec();
    let mut all = own(&many.theta);
    for other in [&many.bse_nonrobust, &many.bse_hc3, &many.bse_spectral, &many.degrees] {
        all.extend(own(other));
    }
    all.extend(own(&many.hc3_degrees));
    all.extend([many.cost[record], f64::from(many.nit[record])]);
    all.iter().map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Two records of a batch are fitted one by one; many go in eights. One of these may be spoiled.
    #[test]
    fn records_that_go_together_have_the_bits_that_they_have_alone(
        which in 0_usize..4,
        awls in any::<bool>(),
        trend in 0_usize..3,
        last in 6_usize..24,
        known in any::<bool>(),
        told in any::<bool>(),
        count in 3_usize..20,
        sigma in 0.01_f64..0.6,
        bad in 0_usize..8,
        seed in 0_u64..1000,
    ) {
        let mut e = match which {
            0 => duffing::equations(Rule::Gregory),
            1 => squared(),
            _ => pair(if which == 2 { 0.0 } else { DT }),
        };
        let clean = match which {
            0 | 1 => { let (y, u) = clean(); vec![y, u] }
            _ => pair_record().to_vec(),
        };
        if told {
            e.bounds[1] = (0.25, 0.95);
        }
        let priors = if told { vec![Prior { parameter: 0, mean: 0.4, sd: 0.1 }] } else { vec![] };
        let levels = known.then(|| vec![sigma; e.noisy.len()]);
        let noisy_channels = e.noisy.len();
        let o = TermsOptions {
            equations: e,
            method: if awls { Method::Awls } else { Method::Ml },
            trend: [Trend::None, Trend::Constant, Trend::Linear][trend],
            levels,
            levels_matter: false,
            priors: if awls { vec![] } else { priors },
            ..options(Band::Harmonics(last), None)
        };
        let fitter = TermsFitter::new(o, &[(N + 1, Time::Even(DT))], &[], Isa::detect().unwrap());
        let fitter = fitter.unwrap();
        let mut records: Vec<Vec<Vec<f64>>> = (0..count as u64)
            .map(|k| {
                let mut own = clean.clone();
                for (c, channel) in own.iter_mut().enumerate().take(noisy_channels) {
                    *channel = noisy(channel, sigma, seed + 50 * k + c as u64);
                }
                own
            })
            .collect();
        if let Some(spoiled) = records.get_mut(bad).filter(|_| bad > 0) {
            match bad % 4 {
                0 => spoiled[0].fill(0.0),
                1 => spoiled[0][7] = f64::NAN,
                2 => spoiled[0][N] = 1e300,
                _ => spoiled[0].fill(-3.0),
            }
        }
        let fit = |records: &[&Vec<Vec<f64>>]| {
            let own = records.iter().map(|r| r.iter().map(Vec::as_slice).collect());
            let records = own.map(|channels| TermsRecord { channels }).collect();
            fitter.fit_many(&TermsBatch { records }, 1, &mut |_, _| Control::Continue).unwrap().0
        };
        let together = fit(&records.iter().collect::<Vec<_>>());
        for k in 1..count {
            let two = fit(&[&records[0], &records[k]]);
            prop_assert_eq!(two.status[1], together.status[k]);
            prop_assert_eq!(bits(&two, 1), bits(&together, k), "record {} of {}", k, count);
            if k == 1 {
                prop_assert_eq!(bits(&two, 0), bits(&together, 0));
            }
        }
    }
}
