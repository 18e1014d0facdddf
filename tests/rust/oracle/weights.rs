//! What joint fits weigh their lines by: Σ found or given, noisy inputs, colour, samples of uneven noise.

use super::fast;
use super::joint::{COUNT, check, fit, options, problem, structure, two};
use super::linear::Columns;
use super::record::Record;
use super::signals::{noise, noisy};
use modfun::Status;
use modfun::estimate::Band;
use modfun::estimate::joint::{Colour, JointOptions, JointStructure, NoiseModel};
use modfun::structure::Method;

/// Σ̂ is (q/ν) Σ Re(e e*)/h of the residuals over A, all of it, and the fit stands still at it.
#[test]
fn an_unknown_covariance_is_that_of_the_residuals() {
    for common in [true, false] {
        let o = options(structure(common), Method::Ml, Band::Harmonics(18));
        let o = JointOptions { noise: NoiseModel::output(), ..o };
        let records = [two(common, 0.1, 0.8, COUNT, 3)];
        let found = check(&o, &records, 1e-4);
        let mut plain = problem(&o, &records, &found);
        let theta = &found.answer.theta;
        let t = plain.transients(theta, false);
        plain.sigma = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
        let rows = plain.rows(theta, Some(&t), Columns::Data, false);
        let mut sums = [[0.0; 2]; 2];
        for pair in rows.residual.chunks(2) {
            for i in 0..2 {
                for j in 0..2 {
                    sums[i][j] += pair[i] * pair[j];
                }
            }
        }
        let freedom = found.answer.degrees_of_freedom as f64;
        for i in 0..2 {
            for j in 0..2 {
                let want = 2.0 / freedom * sums[i][j];
                let size = (sums[0][0] * sums[1][1]).sqrt() * 2.0 / freedom;
                let gap = (found.noise[2 * i + j] - want).abs();
                assert!(
                    gap < 1e-4 * size,
                    "{common} ({i}, {j}): {} for {want}",
                    found.noise[2 * i + j]
                );
            }
        }
        let correlation = found.noise[1] / (found.noise[0] * found.noise[3]).sqrt();
        assert!(correlation > 0.5, "the test's noise is correlated, found {correlation}");
    }
}

#[test]
fn noise_of_inputs_and_given_colour_weigh_the_lines() {
    for common in [true, false] {
        for method in [Method::Awls, Method::Ml] {
            let o = options(structure(common), method, Band::Harmonics(18));
            let lines: Vec<f64> = (0..40).map(|m| 1.0 / (1.0 + 0.1 * f64::from(m))).collect();
            let flat = vec![1.0; 40];
            let coloured = vec![vec![lines.clone(), flat.clone(), flat, lines]];
            let inputs = Some(vec![0.4, 0.1, 0.1, 0.6]);
            for (inputs, spectra) in
                [(inputs.clone(), vec![]), (None, coloured.clone()), (inputs, coloured)]
            {
                let noise = NoiseModel { inputs, spectra, ..o.noise.clone() };
                let mut r = two(common, 0.05, 0.5, COUNT, 8);
                for (k, u) in r.u.iter_mut().enumerate() {
                    *u = noisy(u, 0.05, 2 + k as u32, 8);
                }
                check(&JointOptions { noise, ..o.clone() }, &[r], 1e-5);
            }
        }
    }
}

/// Where the spectrum is that of an autoregression, a fitted colour brings it out.
#[test]
fn the_colour_of_noise_is_read_from_the_residuals() {
    let count = 1025;
    let r = fast::record(2, 1, count, 0.0, 9);
    let e = noise(3, 9, count + 50);
    let mut coloured = vec![0.0; count + 50];
    for k in 1..count + 50 {
        coloured[k] = 0.9 * coloured[k - 1] + 0.03 * e[k];
    }
    let y = r.y[0].iter().zip(&coloured[50..]).map(|(y, e)| y + e).collect();
    let r = Record { y: vec![y], ..r };
    let s = JointStructure {
        orders: vec![2],
        numerators: vec![vec![Some(1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    let o = options(s, Method::Ml, Band::Harmonics(120));
    let fitted = NoiseModel { colour: Colour::Fitted, ..NoiseModel::output() };
    let power = |m: usize| {
        let turned = std::f64::consts::TAU * m as f64 / (count - 1) as f64;
        1.0 / (1.0 + 0.81 - 1.8 * turned.cos())
    };
    let spectra = vec![vec![(0..513).map(power).collect(), vec![1.0; 513]]];
    let told = NoiseModel { spectra, ..NoiseModel::output() };
    let [fitted, told, white] = [fitted, told, NoiseModel::output()]
        .map(|noise| fit(&JointOptions { noise, ..o.clone() }, std::slice::from_ref(&r)).answer);
    assert_eq!(fitted.status, Status::Ok);
    let p = told.theta.len();
    let bse = |a: &modfun::estimate::Answer, k: usize| a.cov_nonrobust[k * (p + 1)].sqrt();
    let mut apart: f64 = 0.0;
    for k in 0..p {
        let ratio = bse(&fitted, k) / bse(&told, k);
        assert!((0.75..1.33).contains(&ratio), "parameter {k}: {ratio}");
        let gap = (fitted.theta[k] - told.theta[k]).abs() / bse(&told, k);
        assert!(gap < 0.5, "parameter {k}: {gap} standard errors from the true colour's");
        apart = apart.max((bse(&white, k) / bse(&told, k) - 1.0).abs());
    }
    assert!(apart > 0.4, "white weights say the same: {apart}");
}

/// Samples of uneven noise, and masked ones, at even instants and at uneven ones.
#[test]
fn uneven_samples_are_weighed_by_their_own_covariance() {
    let s = JointStructure {
        orders: vec![2],
        numerators: vec![vec![Some(1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    for uneven_times in [false, true] {
        let mut r = fast::record(2, 1, 129, 0.1, 12);
        r.variances =
            vec![(0..129).map(|k| 1.0 + 3.0 * f64::from(k) / 128.0 + f64::from(k % 3)).collect()];
        if uneven_times {
            r.times = (0..129)
                .map(|k| r.dt * (f64::from(k) + 0.3 * (0.7 * f64::from(k)).sin()))
                .collect();
        } else {
            (40..46).for_each(|k| r.variances[0][k] = f64::INFINITY);
        }
        for method in [Method::Awls, Method::Ml] {
            let o = options(s.clone(), method, Band::Harmonics(14));
            let o = JointOptions { noise: NoiseModel::output(), ..o };
            check(&o, &[r.clone()], 1e-4);
        }
    }
}

#[test]
fn outputs_of_uneven_noise_share_a_covariance() {
    let mut r = two(false, 0.05, 0.5, 129, 13);
    let variance = |i: u32| (0..129).map(|k| 1.0 + f64::from((k + i) % 4)).collect();
    r.variances = vec![variance(0), variance(2)];
    let o = options(structure(false), Method::Awls, Band::Harmonics(14));
    check(&o, &[r], 1e-4);
}
