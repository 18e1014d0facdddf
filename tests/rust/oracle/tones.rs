//! Sinusoids: the minimum over frequencies and dampings, its covariance, and the lines around the tones.
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, inverse, same_covariance};
use super::signals::noise;
use modfun::Status;
use modfun::simd::Isa;
use modfun::threads::Control;
use modfun::tones::{Found, Options, Plan};

const COUNT: usize = 160;
const TAU: f64 = std::f64::consts::TAU;

/// Frequency (turns a sample), damping, amplitude, phase.
const TRUE: [[f64; 4]; 2] = [[0.0713, 0.004, 1.0, 0.4], [0.0921, 0.011, 0.7, -1.1]];

fn tone(k: f64, [f, d, a, p]: [f64; 4]) -> f64 {
    a * (-d * k).exp() * (TAU * f * k + p).cos()
}

fn record(damped: bool, sigma: f64, seed: u64) -> Vec<f64> {
    let e = noise(60, seed, COUNT);
    (0..COUNT)
        .map(|k| {
            let k64 = k as f64;
            let still = |t: [f64; 4]| if damped { t } else { [t[0], 0.0, t[2], t[3]] };
            TRUE.iter().map(|t| tone(k64, still(*t))).sum::<f64>()
                + 0.3
                + 0.002 * k64
                + sigma * e[k]
        })
        .collect()
}

fn options(damped: bool) -> Options {
    Options {
        count: 2,
        choose: false,
        damped,
        complex: false,
        trend: 2,
        band: (0.0, 0.5),
        lines: 0,
        awls: false,
    }
}

fn run(weights: &[f64], o: Options, samples: &[f64]) -> Found {
    let plan = Plan::new(weights, o, Isa::detect().unwrap()).unwrap();
    plan.run_many(&[samples], 1, &mut |_, _| Control::Continue).unwrap().remove(0)
}

/// Frequencies, dampings, amplitudes, phases, then the trend: the model's samples.
fn model(v: &[f64], damped: bool) -> Vec<f64> {
    let at = |i: usize| {
        let shift = if damped { 4 } else { 2 };
        let damping = if damped { v[2 + i] } else { 0.0 };
        [v[i] / TAU, damping, v[shift + i], v[shift + 2 + i]]
    };
    let linear = if damped { 8 } else { 6 };
    (0..COUNT)
        .map(|k| {
            let k = k as f64;
            let trend = v[linear] + v[linear + 1] * (k - (COUNT - 1) as f64 / 2.0) / COUNT as f64;
            (0..2).map(|i| tone(k, at(i))).sum::<f64>() + trend
        })
        .collect()
}

fn vector(found: &Found, damped: bool) -> Vec<f64> {
    let frequencies = found.tones.iter().map(|t| TAU * t.frequency);
    let dampings = found.tones.iter().filter(|_| damped).map(|t| t.damping);
    let rest = found.amplitude.iter().chain(&found.phase).chain(&found.trend).copied();
    frequencies.chain(dampings).chain(rest).collect()
}

/// Columns ∂(weighted model)/∂v by differences.
fn slopes(v: &[f64], damped: bool, weights: &[f64]) -> Vec<Vec<f64>> {
    (0..v.len())
        .map(|k| {
            let near = |by: f64| {
                let mut x = v.to_vec();
                x[k] += by;
                model(&x, damped)
            };
            let (up, down) = (near(1e-6), near(-1e-6));
            (0..COUNT).map(|i| weights[i] * (up[i] - down[i]) / 2e-6).collect()
        })
        .collect()
}

#[test]
fn tones_stand_at_the_least_squares_with_its_covariance() {
    for damped in [false, true] {
        for masked in [false, true] {
            let weights: Vec<f64> = (0..COUNT)
                .map(|k| {
                    if masked && (50..60).contains(&k) {
                        0.0
                    } else {
                        1.0 + 0.5 * f64::from(u8::from(masked && k % 2 == 0))
                    }
                })
                .collect();
            let y = record(damped, 0.05, 1);
            let found = run(&weights, options(damped), &y);
            assert_eq!(found.status, Status::Ok);
            let v = vector(&found, damped);
            let rest: Vec<f64> = y
                .iter()
                .zip(model(&v, damped))
                .zip(&weights)
                .map(|((y, m), w)| w * (y - m))
                .collect();
            let cost = dot(&rest, &rest);
            assert!((found.cost / cost - 1.0).abs() < 1e-8, "{} {cost}", found.cost);
            let seen = weights.iter().filter(|w| **w > 0.0).count();
            assert_eq!(found.df, seen - v.len());
            assert!((found.variance / (cost / found.df as f64) - 1.0).abs() < 1e-8);
            let columns = slopes(&v, damped, &weights);
            let h = Qr::new(&columns).inverse_normal();
            let step = Qr::new(&columns).solve(&rest);
            for (k, s) in step.iter().enumerate() {
                let bse = (found.variance * h[k][k]).sqrt();
                assert!(s.abs() < 1e-4 * bse, "{damped} {masked}: {s} of {bse} is left of {k}");
            }
            let p = v.len() - 2;
            let want: Vec<Vec<f64>> =
                (0..p).map(|i| (0..p).map(|j| found.variance * h[i][j]).collect()).collect();
            same_covariance(&found.cov, &want, 1e-4, &format!("damped {damped}, masked {masked}"));
        }
    }
}

/// What is left on the lines around tones is least too, and the covariance is that of noise on these lines.
#[test]
fn tones_on_lines_stand_at_the_least_squares_of_the_lines() {
    let y = record(true, 0.05, 2);
    let o = Options { trend: 0, lines: 12, ..options(true) };
    let samples: Vec<f64> = y.iter().enumerate().map(|(k, y)| y - 0.3 - 0.002 * k as f64).collect();
    let found = run(&[1.0; COUNT], o, &samples);
    assert_eq!(found.status, Status::Ok);
    let lines = lines_around(&found, 12);
    let see = |v: &[f64]| -> Vec<f64> {
        let scale = (2.0 / COUNT as f64).sqrt();
        let turned = |m: usize, k: usize| TAU * (m * k % COUNT) as f64 / COUNT as f64;
        let cos = lines
            .iter()
            .map(|m| (0..COUNT).map(|k| v[k] * turned(*m, k).cos()).sum::<f64>() * scale);
        let sin = lines
            .iter()
            .map(|m| (0..COUNT).map(|k| -v[k] * turned(*m, k).sin()).sum::<f64>() * scale);
        cos.chain(sin).collect()
    };
    let mut v = vector(&found, true);
    v.extend([0.0, 0.0]);
    let modelled = model(&v, true);
    let left: Vec<f64> = samples.iter().zip(&modelled).map(|(y, m)| y - m).collect();
    let rest = see(&left);
    let cost = dot(&rest, &rest);
    assert!((found.cost / cost - 1.0).abs() < 1e-6, "{} {cost}", found.cost);
    assert_eq!(found.df, 2 * lines.len() - 8);
    let columns: Vec<Vec<f64>> =
        slopes(&v, true, &[1.0; COUNT])[..8].iter().map(|c| see(c)).collect();
    let qr = Qr::new(&columns);
    let h = qr.inverse_normal();
    for (k, s) in qr.solve(&rest).iter().enumerate() {
        assert!(s.abs() < 1e-4 * (found.variance * h[k][k]).sqrt(), "{s} is left of {k}");
    }
    // Noise of each line from what is left on those up to 8 away, over what the tones leave of them.
    let leverages = qr.leverages(rest.len());
    let size = lines.len();
    let level = |j: usize| {
        let near: Vec<usize> = (0..size).filter(|k| lines[*k].abs_diff(lines[j]) <= 8).collect();
        let left: f64 = near.iter().map(|k| rest[*k].powi(2) + rest[size + k].powi(2)).sum();
        left / near.iter().map(|k| 2.0 - leverages[*k] - leverages[size + k]).sum::<f64>()
    };
    let meat: Vec<Vec<f64>> = (0..8)
        .map(|a| {
            let entry = |b: usize| {
                (0..2 * size).map(|i| columns[a][i] * columns[b][i] * level(i % size)).sum()
            };
            (0..8).map(entry).collect()
        })
        .collect();
    same_covariance(&found.cov, &super::dense::sandwich(&h, &meat), 1e-3, "lines");
}

/// Lines of a real record up to so many on each side of its tones.
fn lines_around(found: &Found, reach: usize) -> Vec<usize> {
    let mut lines: Vec<usize> = found
        .tones
        .iter()
        .map(|t| (t.frequency * COUNT as f64).floor() as usize)
        .flat_map(|below| (below + 1).saturating_sub(reach).max(1)..=below + reach)
        .collect();
    lines.sort_unstable();
    lines.dedup();
    lines
}

/// Where reweighting ends, least squares on Y(1 + Σ(δ + ε/z)/s) = Σ(αz + β)/s, s = z + |λ|²/z − 2Re λ, says that
/// no δ and ε is left, by their own standard errors.
#[test]
fn reweighted_lines_stand_where_their_equation_does() {
    for damped in [false, true] {
        let o = Options { lines: 16, awls: true, ..options(damped) };
        let y = record(damped, 0.01, 3);
        let found = run(&[1.0; COUNT], o, &y);
        assert_eq!(found.status, Status::Ok);
        let middle = (COUNT - 1) as f64 / 2.0;
        let flat = y
            .iter()
            .enumerate()
            .map(|(k, y)| y - found.trend[0] - found.trend[1] * (k as f64 - middle) / COUNT as f64);
        let flat: Vec<f64> = flat.collect();
        let (mut columns, mut right) = (vec![Vec::new(); if damped { 8 } else { 6 }], Vec::new());
        for m in lines_around(&found, 16) {
            let z = C::turn(TAU * m as f64 / COUNT as f64);
            let sum = |sum: C, (k, y): (usize, &f64)| {
                sum + C::turn(-TAU * (m * k % COUNT) as f64 / COUNT as f64) * *y
            };
            let seen = flat.iter().enumerate().fold(C::default(), sum);
            right.extend([seen.0, seen.1]);
            for (i, tone) in found.tones.iter().enumerate() {
                let decay = if damped { (-tone.damping).exp() } else { 1.0 };
                let back = z.conj();
                let s =
                    z + back * (decay * decay) - C(2.0 * decay * (TAU * tone.frequency).cos(), 0.0);
                let over = [z, C(1.0, 0.0), seen, seen * back].map(|x| x * s.inverse());
                for (kind, value) in over.iter().enumerate().take(columns.len() / 2) {
                    columns[2 * kind + i].extend([value.0, value.1]);
                }
            }
        }
        let qr = Qr::new(&columns);
        let (solved, h, rest) = (qr.solve(&right), qr.inverse_normal(), qr.rest(&right));
        let variance = dot(&rest, &rest) / (right.len() - columns.len()) as f64;
        for k in 4..columns.len() {
            let part = solved[k] / (variance * h[k][k]).sqrt();
            assert!(part.abs() < 1e-3, "damped {damped}: {part} standard errors are left of {k}");
        }
        let p = if damped { 8 } else { 6 };
        for (i, (tone, want)) in found.tones.iter().zip(TRUE).enumerate() {
            let bse = found.cov[i * (p + 1)].sqrt() / TAU;
            assert!((tone.frequency - want[0]).abs() < 6.0 * bse, "{damped}: {tone:?} {bse}");
        }
    }
}

#[test]
fn complex_records_and_a_number_to_be_chosen() {
    let e = noise(61, 4, 2 * COUNT);
    let part = |k: usize, im: bool| {
        let shift = if im { -TAU / 4.0 } else { 0.0 };
        TRUE.iter().map(|t| tone(k as f64, [-t[0], t[1], t[2], t[3] + shift])).sum::<f64>()
    };
    let samples: Vec<f64> = (0..COUNT)
        .map(|k| part(k, false) + 0.05 * e[k])
        .chain((0..COUNT).map(|k| part(k, true) + 0.05 * e[COUNT + k]))
        .collect();
    let o = Options {
        count: 4,
        choose: true,
        complex: true,
        trend: 0,
        band: (-0.5, 0.5),
        ..options(true)
    };
    let found = run(&[1.0; COUNT], o, &samples);
    assert_eq!((found.status, found.tones.len()), (Status::Ok, 2));
    for (tone, (want, i)) in found.tones.iter().rev().zip(TRUE.iter().zip([1, 0])) {
        let bse = found.cov[i * 9].sqrt() / TAU;
        assert!((tone.frequency + want[0]).abs() < 5.0 * bse, "{tone:?} {bse}");
    }
    assert_eq!(found.df, 2 * COUNT - 8);
    assert!((found.variance.sqrt() / 0.05 - 1.0).abs() < 0.2);
    // Each of two equal parts of the noise is as large: the covariance of a single tone alone, by its formula.
    let alone: Vec<f64> = (0..2)
        .flat_map(|im| (0..COUNT).map(move |k| (k, im)))
        .map(|(k, im)| {
            let shift = if im == 1 { -TAU / 4.0 } else { 0.0 };
            tone(k as f64, [0.1, 0.0, 1.0, shift]) + 0.05 * e[im * COUNT + k]
        })
        .collect();
    let o = Options {
        count: 1,
        damped: false,
        complex: true,
        trend: 0,
        band: (-0.5, 0.5),
        ..options(false)
    };
    let found = run(&[1.0; COUNT], o, &alone);
    let n = COUNT as f64;
    let a = found.amplitude[0];
    let (s1, s2) = (n * (n - 1.0) / 2.0, (n - 1.0) * n * (2.0 * n - 1.0) / 6.0);
    let normal = [[a * a * s2, a * a * s1], [a * a * s1, a * a * n]].map(|r| r.to_vec());
    let want = found.variance * inverse(&normal)[0][0];
    assert!((found.cov[0] / want - 1.0).abs() < 1e-6, "{} {want}", found.cov[0]);
}
