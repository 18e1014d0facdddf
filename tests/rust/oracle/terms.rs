//! Equations: the covariance of the lines from every sample's noise, its criterion, slopes taken once more.
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, gradient, inverse, same_covariance, sandwich, whitener};
use super::duffing::{self, op};
use super::fast::{self, OPTIONS};
use super::signals::noisy;
use modfun::Status;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsFit, TermsFitter, TermsOptions, TermsRecord,
};
use modfun::estimate::{Band, Time};
use modfun::quadrature::{Hold, Rule};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::{Method, Trend};
use modfun::tape::{Tape, Written};

const COUNT: usize = 257;
const DT: f64 = 12.0 / 256.0;

/// One record of polynomial signals, sample by sample.
#[derive(Clone)]
struct Sampled {
    signals: Vec<Vec<f64>>,
    /// Signal, channel, and the slope of one in the other.
    slopes: Vec<(usize, usize, Vec<f64>)>,
}

/// Σ g s^k E = T, g a number or a parameter.
struct Oracle {
    orders: Vec<usize>,
    /// Equation, signal, order, parameter or number.
    terms: Vec<(usize, usize, usize, Result<usize, f64>)>,
    levels: Vec<f64>,
    records: Vec<Sampled>,
    last: usize,
}

struct Rows {
    residual: Vec<f64>,
    columns: Vec<Vec<f64>>,
    base: Qr,
    /// v̂ of each record and channel, at noise that enters with the weights of the slopes' own pass.
    noise: Vec<Vec<Vec<f64>>>,
    cluster: Vec<usize>,
}

impl Oracle {
    fn omega(m: usize) -> f64 {
        std::f64::consts::TAU * m as f64 / ((COUNT - 1) as f64 * DT)
    }

    /// Trapezoidal weight of a sample over the record.
    fn weight(k: usize) -> f64 {
        let n = (COUNT - 1) as f64;
        if k == 0 || k == COUNT - 1 { 0.5 / n } else { 1.0 / n }
    }

    fn coefficient(samples: &[f64], m: usize) -> C {
        let each = samples.iter().enumerate();
        each.fold(C::default(), |sum, (k, v)| {
            sum + C::turn(-Oracle::omega(m) * k as f64 * DT) * (v * Oracle::weight(k))
        })
    }

    /// What noise of a sample is worth in a coefficient: the mean of the squared weights, ends count half.
    fn share(k: usize) -> f64 {
        let squares: f64 = (0..COUNT).map(|k| Oracle::weight(k) * Oracle::weight(k)).sum();
        let ends = if k == 0 || k == COUNT - 1 { 0.5 } else { 1.0 };
        (squares * ends / (COUNT - 1) as f64).sqrt()
    }

    fn value(g: Result<usize, f64>, theta: &[f64]) -> f64 {
        g.map_or_else(|number| number, |k| theta[k])
    }

    fn rows(&self, theta: &[f64], denoised: bool) -> Rows {
        let (p, equations) = (theta.len(), self.orders.len());
        let mut out = Rows {
            residual: Vec::new(),
            columns: vec![Vec::new(); p],
            base: Qr::new(&[]),
            noise: Vec::new(),
            cluster: Vec::new(),
        };
        let own_transients: usize = self.orders.iter().sum();
        let mut transient = vec![Vec::new(); own_transients * self.records.len()];
        for (r, record) in self.records.iter().enumerate() {
            let spectra: Vec<Vec<C>> = record
                .signals
                .iter()
                .map(|s| (0..=self.last).map(|m| Oracle::coefficient(s, m)).collect())
                .collect();
            let rows: Vec<(usize, bool, usize)> = (0..=self.last)
                .flat_map(|m| [(m, false), (m, true)])
                .filter(|row| *row != (0, true))
                .flat_map(|(m, im)| (0..equations).map(move |e| (m, im, e)))
                .collect();
            let part = |z: C, im: bool| if im { z.1 } else { z.0 };
            let sum = |m: usize, e: usize, spectra: &[Vec<C>], pick: Option<usize>| {
                let of = self.terms.iter().filter(|t| t.0 == e);
                of.fold(C::default(), |sum, (_, s, k, g)| {
                    let by = match pick {
                        None => Oracle::value(*g, theta),
                        Some(own) => f64::from(u8::from(*g == Ok(own))),
                    };
                    sum + C::power(Oracle::omega(m), *k) * spectra[*s][m] * by
                })
            };
            let raw: Vec<f64> =
                rows.iter().map(|(m, im, e)| part(sum(*m, *e, &spectra, None), *im)).collect();
            // Response of every row to noise of every sample and channel.
            let effect = |&(m, im, e): &(usize, bool, usize)| -> Vec<Vec<f64>> {
                let mut all = vec![vec![0.0; COUNT]; self.levels.len()];
                for (s, c, slope) in &record.slopes {
                    let of = self.terms.iter().filter(|t| t.0 == e && t.1 == *s);
                    let l = of.fold(C::default(), |sum, (_, _, k, g)| {
                        sum + C::power(Oracle::omega(m), *k) * Oracle::value(*g, theta)
                    });
                    for (k, (to, d)) in all[*c].iter_mut().zip(slope).enumerate() {
                        let wave = C::turn(-Oracle::omega(m) * k as f64 * DT);
                        *to += part(l * wave, im) * d;
                    }
                }
                all
            };
            let effects: Vec<Vec<Vec<f64>>> = rows.iter().map(effect).collect();
            let shares: Vec<f64> = (0..COUNT).map(Oracle::share).collect();
            let entry = |i: usize, j: usize| -> f64 {
                let each = effects[i].iter().zip(&effects[j]).zip(&self.levels);
                let one = |((a, b), level): ((&Vec<f64>, &Vec<f64>), &f64)| {
                    let both = a.iter().zip(b).zip(&shares);
                    level * level * both.map(|((a, b), s)| a * b * s * s).sum::<f64>()
                };
                each.map(one).sum()
            };
            let covariance: Vec<Vec<C>> = (0..rows.len())
                .map(|i| (0..rows.len()).map(|j| C(entry(i.max(j), i.min(j)), 0.0)).collect())
                .collect();
            let white = whitener(&covariance);
            let whiten = |v: &[f64]| -> Vec<f64> {
                (0..v.len()).map(|i| (0..=i).map(|j| white[i][j].0 * v[j]).sum()).collect()
            };
            let mut own = Vec::new();
            for (e, order) in self.orders.iter().enumerate() {
                for j in 0..*order {
                    let x = |m: usize| C::power(m as f64 / self.last as f64, j);
                    let value = |(m, im, at): &(usize, bool, usize)| {
                        if *at == e { part(x(*m), *im) } else { 0.0 }
                    };
                    own.push(whiten(&rows.iter().map(value).collect::<Vec<f64>>()));
                }
            }
            let left = Qr::new(&own).rest(&whiten(&raw));
            let lambda: Vec<f64> = (0..rows.len())
                .map(|j| (j..rows.len()).map(|i| white[i][j].0 * left[i]).sum())
                .collect();
            // σ² Σ over rows of effect times λ, before shares.
            let pull: Vec<Vec<f64>> = (0..self.levels.len())
                .map(|c| {
                    let level = self.levels[c] * self.levels[c];
                    let each = |k: usize| {
                        effects.iter().zip(&lambda).map(|(e, l)| e[c][k] * l).sum::<f64>()
                    };
                    (0..COUNT).map(|k| level * each(k)).collect()
                })
                .collect();
            let n = (COUNT - 1) as f64;
            out.noise.push(pull.iter().map(|v| v.iter().map(|x| x / n).collect()).collect());
            let mut clean = spectra.clone();
            for (s, c, slope) in record.slopes.iter().filter(|_| denoised) {
                for m in 0..=self.last {
                    for k in 0..COUNT {
                        let by = shares[k] * shares[k] * slope[k] * pull[*c][k];
                        clean[*s][m] =
                            clean[*s][m] - C::turn(-Oracle::omega(m) * k as f64 * DT) * by;
                    }
                }
            }
            for (k, column) in out.columns.iter_mut().enumerate() {
                let raw: Vec<f64> =
                    rows.iter().map(|(m, im, e)| part(sum(*m, *e, &clean, Some(k)), *im)).collect();
                column.extend(whiten(&raw));
            }
            for (k, column) in transient.iter_mut().enumerate() {
                match k / own_transients == r {
                    true => column.extend(&own[k % own_transients]),
                    false => column.extend(std::iter::repeat_n(0.0, rows.len())),
                }
            }
            out.residual.extend(left);
            out.cluster.extend(rows.iter().map(|(m, im, _)| (r << 20) + 2 * m + usize::from(*im)));
        }
        let base = Qr::new(&transient);
        out.columns.iter_mut().for_each(|c| *c = base.rest(c));
        out.base = base;
        out
    }

    fn criterion(&self, theta: &[f64]) -> f64 {
        let rows = self.rows(theta, false);
        dot(&rows.residual, &rows.residual)
    }

    /// Gauss–Newton's steps from θ to where they end.
    fn settled(&self, theta: &[f64], denoised: bool) -> Vec<f64> {
        let mut theta = theta.to_vec();
        for _ in 0..30 {
            let rows = self.rows(&theta, denoised);
            let step = Qr::new(&rows.columns).solve(&rows.residual);
            theta.iter_mut().zip(&step).for_each(|(t, s)| *t -= s);
            if step.iter().zip(&theta).all(|(s, t)| s.abs() < 1e-9 * t.abs()) {
                return theta;
            }
        }
        panic!("the oracle's own steps do not end");
    }
}

/// Holds estimate, cost, covariances and their degrees of freedom to the oracle's at its own minimum.
#[track_caller]
fn same(found: &TermsFit, oracle: &Oracle, want: &[f64], denoised: bool, what: &str) {
    let a = &found.answer;
    assert_eq!(a.status, Status::Ok, "{what}");
    let rows = oracle.rows(want, denoised);
    let p = want.len();
    let factor = Qr::new(&rows.columns);
    let h = factor.inverse_normal();
    let cost = dot(&rows.residual, &rows.residual);
    let unknowns = p + oracle.orders.iter().sum::<usize>() * oracle.records.len();
    let degrees = rows.residual.len() - unknowns;
    assert_eq!(a.degrees_of_freedom, degrees, "{what}");
    assert!((a.cost / cost - 1.0).abs() < 1e-4, "{what}: cost {} for {cost}", a.cost);
    let variance = cost / degrees as f64;
    assert!((found.scale / variance - 1.0).abs() < 1e-4, "{what}");
    for k in 0..p {
        let bse = (variance * h[k][k]).sqrt();
        assert!(
            (a.theta[k] - want[k]).abs() < 1e-3 * bse,
            "{what} {k}: {} for {}",
            a.theta[k],
            want[k]
        );
    }
    let classical: Vec<Vec<f64>> =
        h.iter().map(|r| r.iter().map(|x| variance * x).collect()).collect();
    same_covariance(&a.cov_nonrobust, &classical, 1e-3, &format!("{what}: classical"));
    // (I − H)⁻¹e of the rows of a line and part.
    let n = rows.residual.len();
    let hat = |i: usize, j: usize| {
        let unit = |k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
        let (a, b) = (unit(i), unit(j));
        let left = |qr: &Qr| dot(&a, &b) - dot(&a, &qr.rest(&b));
        left(&factor) + left(&rows.base)
    };
    let mut meat = vec![vec![0.0; p]; p];
    let mut sums = vec![(0.0, 0.0); p];
    let mut from = 0;
    while from < n {
        let size = rows.cluster[from..].iter().take_while(|c| **c == rows.cluster[from]).count();
        let block: Vec<Vec<f64>> = (0..size)
            .map(|i| {
                let unit = |j: usize| f64::from(u8::from(i == j));
                (0..size).map(|j| unit(j) - hat(from + i, from + j)).collect()
            })
            .collect();
        let x: Vec<f64> =
            inverse(&block).iter().map(|r| dot(r, &rows.residual[from..from + size])).collect();
        let score: Vec<f64> =
            (0..p).map(|k| dot(&rows.columns[k][from..from + size], &x)).collect();
        for a in 0..p {
            (0..p).for_each(|b| meat[a][b] += score[a] * score[b]);
        }
        for i in 0..size {
            for (k, sum) in sums.iter_mut().enumerate() {
                let weight: f64 = (0..p).map(|l| h[k][l] * rows.columns[l][from + i]).sum();
                let own = weight * weight / block[i][i];
                *sum = (sum.0 + own, sum.1 + own * own);
            }
        }
        from += size;
    }
    same_covariance(&a.cov_hc3, &sandwich(&h, &meat), 1e-3, &format!("{what}: HC3"));
    for (k, (own, squares)) in sums.iter().enumerate() {
        let want = (own * own / squares).min(degrees as f64);
        let found = found.hc3_degrees[k];
        assert!((found / want - 1.0).abs() < 1e-2, "{what}: {found} degrees for {want}");
    }
}

fn options(equations: Equations, method: Method, last: Band, levels: &[f64]) -> TermsOptions {
    TermsOptions {
        equations,
        rule: Rule::Trapezoid,
        method,
        flat: false,
        trend: Trend::None,
        band: last,
        levels: Some(levels.to_vec()),
        levels_matter: true,
        options: OPTIONS,
    }
}

fn fit(o: &TermsOptions, dt: f64, records: &[Vec<&[f64]>]) -> TermsFit {
    let sampling: Vec<_> = records.iter().map(|r| (r[0].len(), Time::Even(dt))).collect();
    let records: Vec<_> = records.iter().map(|r| TermsRecord { channels: r.clone() }).collect();
    TermsFitter::new(o.clone(), &sampling, &[], Isa::detect().unwrap())
        .unwrap()
        .fit(&records)
        .unwrap()
}

/// Equations linear in so many parameters: terms as the oracle has them, samples as a tape.
fn equations(
    (orders, terms, parameters): (Vec<usize>, &[(usize, usize, usize, Result<usize, f64>)], usize),
    (formulas, results, signals): (&[Written], Vec<usize>, usize),
    (channels, noisy): (usize, Vec<usize>),
    sensitivities: Vec<(usize, usize)>,
) -> Equations {
    let signal = Signal { kind: Kind::Rule(Rule::Trapezoid), lag: Lag::Known(0.0) };
    let mut written: Vec<Written> = (0..parameters).map(|k| op("input", 0.0, k, 0)).collect();
    let one = written.len();
    written.push(op("constant", 1.0, 0, 0));
    let (mut values, mut slopes, mut by) = (Vec::new(), Vec::new(), Vec::new());
    for (t, (_, _, _, g)) in terms.iter().enumerate() {
        match g {
            Ok(k) => {
                values.push(*k);
                slopes.push((t, *k));
                by.push(one);
            }
            Err(number) => {
                values.push(written.len());
                written.push(op("constant", *number, 0, 0));
            }
        }
    }
    let all = values.into_iter().chain(by).collect();
    let inputs = channels + noisy.len() + parameters;
    Equations {
        orders,
        signals: vec![signal; signals],
        terms: terms
            .iter()
            .map(|(equation, signal, order, _)| Term {
                equation: *equation,
                signal: *signal,
                order: *order,
            })
            .collect(),
        coefficients: Tape::new(&written, parameters, all).unwrap(),
        slopes,
        samples: Tape::new(formulas, inputs, results).unwrap(),
        sensitivities,
        signal_slopes: Vec::new(),
        channels,
        noisy,
        parameters,
        starts: vec![None; parameters],
        bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); parameters],
        linear: true,
    }
}

/// y'' + ay' + by + cy³ = u.
const DUFFING: [(usize, usize, usize, Result<usize, f64>); 5] = [
    (0, 0, 2, Err(1.0)),
    (0, 0, 1, Ok(0)),
    (0, 0, 0, Ok(1)),
    (0, 1, 0, Ok(2)),
    (0, 2, 0, Err(-1.0)),
];

fn duffing() -> Equations {
    duffing::equations(Rule::Trapezoid)
}

/// Runge–Kutta's steps of a system from a state; samples of every state.
fn solved<const N: usize>(
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
    start: [f64; N],
) -> Vec<Vec<f64>> {
    const EACH: usize = 20;
    let h = DT / EACH as f64;
    let (mut x, mut out) = (start, vec![vec![]; N]);
    let along = |x: [f64; N], by: f64, s: [f64; N]| std::array::from_fn(|i| x[i] + by * s[i]);
    for k in 0..COUNT {
        (0..N).for_each(|i| out[i].push(x[i]));
        for j in 0..EACH {
            let t = k as f64 * DT + j as f64 * h;
            let a = slope(t, x);
            let b = slope(t + h / 2.0, along(x, h / 2.0, a));
            let c = slope(t + h / 2.0, along(x, h / 2.0, b));
            let d = slope(t + h, along(x, h, c));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
    }
    out
}

fn oscillation(start: [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    duffing::record(COUNT, DT, start)
}

/// Signals of the oscillator with slopes at `clean`.
fn sampled(y: &[f64], u: &[f64], clean: &[f64], sigma: f64) -> Sampled {
    let s = sigma * sigma;
    Sampled {
        signals: vec![y.to_vec(), y.iter().map(|y| y * y * y - 3.0 * s * y).collect(), u.to_vec()],
        slopes: vec![
            (0, 0, vec![1.0; COUNT]),
            (1, 0, clean.iter().map(|y| 3.0 * y * y - 3.0 * s).collect()),
        ],
    }
}

/// The whole way: the minimum with slopes at the samples, then with slopes where its noise is taken away.
#[test]
fn an_oscillator_is_what_every_samples_noise_says() {
    let (sigma, last) = (0.2, 14);
    let starts = [[0.5, 0.0], [-0.4, 0.3]];
    let clean: Vec<_> = starts.iter().map(|s| oscillation(*s)).collect();
    let noisy: Vec<Vec<f64>> =
        clean.iter().enumerate().map(|(k, (y, _))| noisy(y, sigma, 0, 20 + k as u64)).collect();
    for records in [1, 2] {
        let mut oracle = Oracle {
            orders: vec![2],
            terms: DUFFING.to_vec(),
            levels: vec![sigma],
            records: (0..records)
                .map(|k| sampled(&noisy[k], &clean[k].1, &noisy[k], sigma))
                .collect(),
            last,
        };
        let channels: Vec<Vec<&[f64]>> =
            (0..records).map(|k| vec![&noisy[k][..], &clean[k].1]).collect();
        let band = Band::Harmonics(last - 2);
        let once = oracle.settled(&[0.3, 1.0, 0.5], false);
        let found = fit(&options(duffing(), Method::Awls, band, &[sigma]), DT, &channels);
        same(&found, &oracle, &once, false, "awls");
        let first = oracle.settled(&[0.3, 1.0, 0.5], true);
        let taken = oracle.rows(&first, false).noise;
        for (k, noise) in taken.iter().enumerate() {
            let left: Vec<f64> = noisy[k].iter().zip(&noise[0]).map(|(y, e)| y - e).collect();
            oracle.records[k] = sampled(&noisy[k], &clean[k].1, &left, sigma);
        }
        let second = oracle.settled(&first, true);
        let found = fit(&options(duffing(), Method::Ml, band, &[sigma]), DT, &channels);
        same(&found, &oracle, &second, true, "ml");
        let bse: Vec<f64> = (0..3).map(|k| found.answer.cov_nonrobust[4 * k].sqrt()).collect();
        let moved = first.iter().zip(&second).zip(&bse).map(|((a, b), s)| ((a - b) / s).abs());
        assert!(moved.fold(0.0, f64::max) > 0.02, "slopes at clean samples change nothing here");
        let steps: Vec<f64> = bse.iter().map(|s| 1e-3 * s).collect();
        let slope = gradient(|x| oracle.criterion(x), &second, &steps);
        for (g, s) in slope.iter().zip(&bse) {
            assert!((g * s / found.scale).abs() < 1e-3, "{slope:?}");
        }
    }
}

/// Two equations share the noise of both channels: rows of a line are whitened and counted together.
#[test]
fn two_equations_of_noisy_states_are_what_every_samples_noise_says() {
    // x' = p0 x + p1 xz, z' = p2 z + p3 xz, of noise in both: x, z, xz.
    let terms = [
        (0, 0, 1, Err(-1.0)),
        (0, 0, 0, Ok(0)),
        (0, 2, 0, Ok(1)),
        (1, 1, 1, Err(-1.0)),
        (1, 1, 0, Ok(2)),
        (1, 2, 0, Ok(3)),
    ];
    let truth = [1.2, -0.8, -1.0, 0.9];
    let slope = |_: f64, x: [f64; 2]| {
        [truth[0] * x[0] + truth[1] * x[0] * x[1], truth[2] * x[1] + truth[3] * x[0] * x[1]]
    };
    let states = solved(slope, [1.5, 1.0]);
    let levels = [0.03, 0.05];
    let v: Vec<Vec<f64>> = (0..2).map(|c| noisy(&states[c], levels[c], c as u32, 30)).collect();
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("multiply", 0.0, 0, 1),
        op("constant", 1.0, 0, 0),
    ];
    let e = equations(
        (vec![1, 1], &terms, 4),
        (&formulas, vec![0, 1, 2, 3, 3, 1, 0], 3),
        (2, vec![0, 1]),
        vec![(0, 0), (1, 1), (2, 0), (2, 1)],
    );
    let sampled = Sampled {
        signals: vec![
            v[0].clone(),
            v[1].clone(),
            v[0].iter().zip(&v[1]).map(|(a, b)| a * b).collect(),
        ],
        slopes: vec![
            (0, 0, vec![1.0; COUNT]),
            (1, 1, vec![1.0; COUNT]),
            (2, 0, v[1].clone()),
            (2, 1, v[0].clone()),
        ],
    };
    let oracle = Oracle {
        orders: vec![1, 1],
        terms: terms.to_vec(),
        levels: levels.to_vec(),
        records: vec![sampled],
        last: 13,
    };
    let want = oracle.settled(&truth, false);
    let o = options(e, Method::Awls, Band::Harmonics(12), &levels);
    let found = fit(&o, DT, &[vec![&v[0], &v[1]]]);
    same(&found, &oracle, &want, false, "awls of two equations");
}

/// y'' + ay' + by − cu' − du = 0 of one noisy channel.
fn linear(kind: Kind) -> Equations {
    let terms = [
        (0, 0, 2, Err(1.0)),
        (0, 0, 1, Ok(0)),
        (0, 0, 0, Ok(1)),
        (0, 2, 1, Ok(2)),
        (0, 2, 0, Ok(3)),
    ];
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("constant", 1.0, 0, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 1, 3),
    ];
    let mut e = equations(
        (vec![2], &terms, 4),
        (&formulas, vec![0, 1, 4, 2], 3),
        (2, vec![0]),
        vec![(0, 0)],
    );
    e.signals[2].kind = kind;
    e
}

#[test]
fn a_linear_equation_is_a_transfer_function() {
    for method in [Method::Ls, Method::Wls, Method::Awls, Method::Ml] {
        // Where rows are differenced a trend is taken out in another way.
        let trends = if method == Method::Ls { 1 } else { 3 };
        for trend in [Trend::None, Trend::Constant, Trend::Linear].into_iter().take(trends) {
            let records = [fast::record(2, 1, 257, 0.05, 21), fast::record(2, 1, 257, 0.05, 22)];
            let channels: Vec<Vec<&[f64]>> =
                records.iter().map(|r| vec![&r.y[0][..], &r.u[0][..]]).collect();
            // Without weights the noise counts as the equation's.
            let equation = matches!(method, Method::Ls | Method::Wls);
            let plain = fast::plain(method, trend, equation, &records);
            let o =
                options(linear(Kind::Rule(Rule::Trapezoid)), method, Band::Harmonics(18), &[0.1]);
            let o = TermsOptions { trend, flat: equation, ..o };
            let found = fit(&o, records[0].dt, &channels).answer;
            assert_eq!(
                (found.status, plain.status),
                (Status::Ok, Status::Ok),
                "{method:?} {trend:?}"
            );
            assert_eq!(found.degrees_of_freedom, plain.degrees_of_freedom);
            for (k, (a, b)) in found.theta.iter().zip(&plain.theta).enumerate() {
                let bse = plain.cov_nonrobust[5 * k].sqrt();
                assert!((a - b).abs() < 1e-4 * bse, "{method:?} {trend:?}: {a} {b}");
            }
            let square = |all: &[f64]| all.chunks(4).map(<[f64]>::to_vec).collect::<Vec<_>>();
            let what = format!("{method:?} {trend:?}");
            same_covariance(&found.cov_nonrobust, &square(&plain.cov_nonrobust), 1e-3, &what);
            if method != Method::Ls {
                // The leverage of a differenced row counts the transient in the fast path alone.
                same_covariance(
                    &found.cov_hc3,
                    &square(&plain.cov_hc3),
                    1e-3,
                    &format!("{what}: HC3"),
                );
            }
        }
    }
}

#[test]
fn a_bound_that_binds_holds_the_parameter() {
    let (clean, u) = oscillation([0.5, 0.0]);
    let y = noisy(&clean, 0.1, 0, 23);
    let channels = [vec![&y[..], &u[..]]];
    let band = Band::Harmonics(12);
    let open = fit(&options(duffing(), Method::Ml, band, &[0.1]), DT, &channels);
    for (k, low) in [(0, true), (2, false)] {
        let edge = open.answer.theta[k] * if low { 1.1 } else { 0.9 };
        let mut e = duffing();
        e.bounds[k] = if low { (edge, f64::INFINITY) } else { (f64::NEG_INFINITY, edge) };
        let found = fit(&options(e, Method::Ml, band, &[0.1]), DT, &channels);
        assert_eq!(found.answer.status, Status::Ok);
        assert_eq!(found.answer.theta[k], edge);
        assert_eq!(found.at_bound, (0..3).map(|j| j == k).collect::<Vec<_>>());
        assert_eq!(found.answer.cov_nonrobust[4 * k], 0.0);
        assert!(found.answer.cost > open.answer.cost);
    }
}

/// A free lag of a held input is the free delay of a joint fit.
#[test]
fn a_lag_that_is_a_parameter_is_a_free_delay() {
    let r = super::joint::late(0.8, 385, 0.02, 24);
    let joint = super::joint::free_delay(&r);
    let terms = [(0, 0, 2, Err(1.0)), (0, 0, 1, Ok(0)), (0, 0, 0, Ok(1)), (0, 1, 0, Ok(2))];
    let formulas = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("constant", 1.0, 0, 0),
        op("constant", -1.0, 0, 0),
        op("multiply", 0.0, 1, 3),
    ];
    let mut e =
        equations((vec![2], &terms, 4), (&formulas, vec![0, 4, 2], 2), (2, vec![0]), vec![(0, 0)]);
    e.signals[1] = Signal { kind: Kind::Hold(Hold::Zoh), lag: Lag::Parameter(3) };
    e.bounds[3] = (0.0, 2.5);
    e.linear = false;
    let o = options(e, Method::Ml, Band::Edges(0.0, 18.0), &[0.02]);
    let found = fit(&o, r.dt, &[vec![&r.y[0], &r.u[0]]]).answer;
    assert_eq!(found.status, Status::Ok);
    for (k, (a, b)) in found.theta.iter().zip(&joint.theta).enumerate() {
        let bse = joint.cov_nonrobust[5 * k].sqrt();
        assert!((a - b).abs() < 1e-3 * bse, "{k}: {a} {b}");
    }
}

/// The level that a fit reads from the upper lines, and the band it chooses, are near those that are told.
#[test]
fn levels_are_read_from_the_record_where_none_are_given() {
    let (clean, u) = oscillation([0.5, 0.0]);
    let y = noisy(&clean, 0.1, 0, 25);
    let o = TermsOptions { levels: None, ..options(duffing(), Method::Ml, Band::Default, &[]) };
    let found = fit(&o, DT, &[vec![&y, &u]]);
    assert_eq!(found.answer.status, Status::Ok);
    assert!((found.levels[0] / 0.1 - 1.0).abs() < 0.15, "{}", found.levels[0]);
    assert!((found.scale - 1.0).abs() < 0.5, "{}", found.scale);
    for (k, want) in [0.3, 1.0, 0.5].iter().enumerate() {
        let bse = found.answer.cov_hc3[4 * k].sqrt();
        assert!((found.answer.theta[k] - want).abs() < 4.0 * bse, "{k}: {}", found.answer.theta[k]);
    }
}
