//! Delays of joint fits, known and free, of inputs held or straight between samples.

use super::fast;
use super::joint::{COUNT, DT, check, fit, options};
use super::record::Record;
use super::signals::{System, noise, noisy, samples, smooth};
use modfun::Status;
use modfun::estimate::Band;
use modfun::estimate::joint::{Delay, JointOptions, JointStructure, NoiseModel, Path};
use modfun::quadrature::Hold;
use modfun::structure::Method;

/// y = 5/(s² + 1.6s + 9) of a held input, late by τ.
pub fn late(tau: f64, count: usize, sigma: f64, seed: u64) -> Record {
    let levels = noise(5, seed, count);
    let u: Vec<f64> = (0..count).map(|k| levels[k / 4]).collect();
    let system = System { a: vec![1.6, 9.0], b: vec![vec![0.0, 5.0]] };
    let value = |_: usize, _: usize, t: f64| u[(((t - tau) / DT + 1e-9).floor().max(0.0)) as usize];
    let clean = system.response(&value, (count, DT), &[0.0, 0.0]);
    Record { y: vec![noisy(&clean, sigma, 6, seed)], u: vec![u], dt: DT, ..Record::default() }
}

fn delayed(delay: Delay, method: Method, band: Band) -> JointOptions {
    let s = JointStructure {
        orders: vec![2],
        common: true,
        numerators: vec![vec![Some(0)]],
        paths: vec![Path { input: 0, delay }],
        fixed: vec![],
        bounds: vec![],
    };
    let o = options(s, method, band);
    JointOptions { noise: NoiseModel::output(), intersample: vec![Some(Hold::Zoh)].into(), ..o }
}

#[test]
fn known_delays_move_the_input() {
    for tau in [0.0, 0.3, 0.4 * DT, 5.0 * DT] {
        let o = delayed(Delay::Known(tau), Method::Ml, Band::Harmonics(25));
        // Two rounds of what is folded end below a thousandth of a standard error.
        check(&o, &[late(tau, COUNT, 0.02, 14)], 3e-4);
    }
}

/// Inputs that are straight between samples, and smooth ones whose delay is known only between samples.
#[test]
fn delays_of_inputs_straight_between_samples_are_exact() {
    for delay in [Delay::Known(0.3), Delay::Free { start: 0.7, min: 0.0, max: 1.2 }] {
        let r = fast::record(2, 1, 385, 0.05, 18);
        // The input that acted came earlier by as much.
        let u = samples(385, DT, |t| smooth(0, t + 0.35));
        let o = delayed(delay, Method::Ml, Band::Edges(0.0, 12.0));
        let structure = JointStructure { numerators: vec![vec![Some(1)]], ..o.structure.clone() };
        let o = JointOptions {
            structure: JointStructure { fixed: vec![], bounds: vec![], ..structure }
                .checked()
                .unwrap(),
            intersample: vec![Some(Hold::Foh)].into(),
            ..o
        };
        // Two rounds of what is folded end below a hundredth of a standard error where a delay follows, too.
        check(&o, &[Record { u: vec![u], ..r }], 1e-2);
    }
}

/// From starts on both sides, and from afar, where only the search over the bounds finds the way.
#[test]
fn free_delays_are_found_and_stand_where_the_criterion_is_flat() {
    let true_delay = 0.8;
    for start in [0.0, 0.7, 1.0, 2.4] {
        for method in [Method::Awls, Method::Ml] {
            let delay = Delay::Free { start, min: 0.0, max: 2.5 };
            let o = delayed(delay, method, Band::Edges(0.0, 18.0));
            let found = check(&o, &[late(true_delay, 385, 0.02, 15)], 1e-3);
            let tau = found.answer.theta[3];
            let bse = found.answer.cov_nonrobust[15].sqrt();
            assert!((tau - true_delay).abs() < 5.0 * bse && bse < 0.05, "{start}: {tau} ± {bse}");
        }
    }
}

#[test]
fn the_default_band_seeks_delays_too() {
    let o = delayed(Delay::Free { start: 2.4, min: 0.0, max: 2.5 }, Method::Ml, Band::Default);
    let found = fit(&o, &[late(0.8, 385, 0.02, 16)]);
    assert_eq!(found.answer.status, Status::Ok);
    let bse = found.answer.cov_nonrobust[15].sqrt();
    assert!((found.answer.theta[3] - 0.8).abs() < 5.0 * bse, "{}", found.answer.theta[3]);
}

/// The fit of a free delay up to 2.5 s, for others to be held to.
pub fn free_delay(r: &Record) -> modfun::estimate::Answer {
    let delay = Delay::Free { start: 0.7, min: 0.0, max: 2.5 };
    fit(&delayed(delay, Method::Ml, Band::Edges(0.0, 18.0)), std::slice::from_ref(r)).answer
}
