//! Fits of equations in the core: Duffing's oscillator, bits on every processor, and input that is none.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

#[path = "common/duffing.rs"]
mod duffing;

use duffing::TRUE;
use modfun::Status;
use modfun::estimate::terms::{Equations, Lag, TermsBatch, TermsFitter, TermsOptions, TermsRecord};
use modfun::estimate::{Answer, Band, Options, Time, Wanted};
use modfun::quadrature::Rule;
use modfun::rng::{Address, Purpose, normals};
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Trend};
use modfun::threads::Control;

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
