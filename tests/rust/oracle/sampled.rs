//! Equations as the oracle sees them: rows whitened by what the noise of every sample does to each of them.
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, inverse, same_covariance, sandwich, whitener};
use modfun::Status;
use modfun::estimate::terms::TermsFit;

pub const COUNT: usize = 257;
pub const DT: f64 = 12.0 / 256.0;

/// One record of polynomial signals, sample by sample.
#[derive(Clone)]
pub struct Sampled {
    pub signals: Vec<Vec<f64>>,
    /// Signal, channel, and the slope of one in the other.
    pub slopes: Vec<(usize, usize, Vec<f64>)>,
}

/// A term: equation, signal, order, parameter or number.
pub type Gained = (usize, usize, usize, Result<usize, f64>);

/// Σ g s^k E = T, g a number or a parameter.
pub struct Oracle {
    pub orders: Vec<usize>,
    pub terms: Vec<Gained>,
    pub levels: Vec<f64>,
    pub records: Vec<Sampled>,
    pub last: usize,
}

pub struct Rows {
    pub residual: Vec<f64>,
    pub columns: Vec<Vec<f64>>,
    pub base: Qr,
    /// v̂ of each record and channel, at noise that enters with the weights of the slopes' own pass.
    pub noise: Vec<Vec<Vec<f64>>>,
    pub cluster: Vec<usize>,
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

    pub fn rows(&self, theta: &[f64], denoised: bool) -> Rows {
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

    pub fn criterion(&self, theta: &[f64]) -> f64 {
        let rows = self.rows(theta, false);
        dot(&rows.residual, &rows.residual)
    }

    /// Gauss–Newton's steps from θ to where they end.
    pub fn settled(&self, theta: &[f64], denoised: bool) -> Vec<f64> {
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
pub fn same(found: &TermsFit, oracle: &Oracle, want: &[f64], denoised: bool, what: &str) {
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
