//! The linear problem written out: rows, criterion, covariances (docs/core.md).
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, inverse, sandwich, whitener};
use super::record::{Between, Record};
use modfun::structure::Trend;

/// A problem: outputs by the trapezoidal rule, inputs as they are between samples.
#[derive(Debug, Clone)]
pub struct Problem {
    pub orders: Vec<usize>,
    pub common: bool,
    /// Of each output and input.
    pub numerators: Vec<Vec<Option<usize>>>,
    /// Coefficients that are not estimated.
    pub fixed: Vec<Option<f64>>,
    /// Delay of each input; none: estimated.
    pub delays: Vec<Option<f64>>,
    pub inputs: Between,
    pub trend: Trend,
    pub extended: bool,
    pub equation: bool,
    /// Noise of the outputs and of the inputs.
    pub sigma: Vec<Vec<f64>>,
    pub input_sigma: Vec<Vec<f64>>,
    pub records: Vec<Record>,
    /// What stands in the outputs' coefficients too much, see `fold`: record, line, output.
    pub folded: Vec<Vec<Vec<C>>>,
}

/// Which signals the columns of θ are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Columns {
    Data,
    Denoised,
}

/// Whitened rows.
pub struct Rows {
    pub residual: Vec<f64>,
    pub columns: Vec<Vec<f64>>,
    pub transient: Vec<Vec<f64>>,
    /// Rows of one line and part are neighbours and share a number.
    pub cluster: Vec<usize>,
}

/// What a problem says of an estimate.
pub struct Worth {
    /// Whitened residuals over their standard deviation, in the rows' order.
    pub residual: Vec<f64>,
    pub cost: f64,
    pub degrees: usize,
    pub classical: Vec<Vec<f64>>,
    pub hc3: Vec<Vec<f64>>,
    /// The step that would still be taken, in standard errors.
    pub step: Vec<f64>,
}

impl Problem {
    pub fn outputs(&self) -> usize {
        self.orders.len()
    }

    fn paths(&self) -> usize {
        self.delays.len()
    }

    /// First coefficient of each denominator and numerator.
    fn places(&self) -> (Vec<usize>, Vec<Vec<usize>>) {
        let (mut a, mut b, mut next) = (Vec::new(), Vec::new(), 0);
        for (i, row) in self.numerators.iter().enumerate() {
            if i == 0 || !self.common {
                a.push(next);
                next += self.orders[i];
            } else {
                a.push(a[0]);
            }
            let mut own = Vec::new();
            for degree in row {
                own.push(next);
                next += degree.map_or(0, |d| d + 1);
            }
            b.push(own);
        }
        (a, b)
    }

    pub fn coefficients(&self) -> usize {
        let a: usize = if self.common { self.orders[0] } else { self.orders.iter().sum() };
        a + self.numerators.iter().flatten().flatten().map(|d| d + 1).sum::<usize>()
    }

    fn free(&self) -> Vec<usize> {
        (0..self.coefficients())
            .filter(|k| self.fixed.get(*k).is_none_or(Option::is_none))
            .collect()
    }

    /// All coefficients, and the delays.
    pub fn expand(&self, theta: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let free = self.free();
        let mut all: Vec<f64> = (0..self.coefficients())
            .map(|k| self.fixed.get(k).copied().flatten().unwrap_or(0.0))
            .collect();
        for (k, value) in free.iter().zip(theta) {
            all[*k] = *value;
        }
        let mut late = theta[free.len()..].iter();
        let tau = self.delays.iter().map(|d| d.unwrap_or_else(|| *late.next().unwrap())).collect();
        (all, tau)
    }

    fn input(&self, r: &Record, k: usize, m: usize, tau: f64) -> C {
        match self.inputs {
            Between::Samples => r.coefficient(&r.u[k], m),
            Between::Zoh => r.held(&r.u[k], m, tau, false),
            Between::Foh => r.held(&r.u[k], m, tau, true),
        }
    }

    /// Coefficients of outputs and delayed inputs: record, line, signal.
    fn signals(&self, tau: &[f64]) -> Vec<Vec<Vec<C>>> {
        let of = |k: usize, r: &Record, at: usize, m: usize| {
            let folded = |i: usize| self.folded.get(k).map_or(C::default(), |own| own[at][i]);
            let y = r.y.iter().enumerate().map(|(i, y)| r.coefficient(y, m) - folded(i));
            y.chain((0..self.paths()).map(|k| self.input(r, k, m, tau[k]))).collect()
        };
        let lines = |(k, r): (usize, &Record)| {
            r.line_numbers(self.trend).enumerate().map(|(at, m)| of(k, r, at, m)).collect()
        };
        self.records.iter().enumerate().map(lines).collect()
    }

    /// What plain sums over samples fold into the outputs at θ under held inputs: their lines m + jN one by one.
    pub fn fold(&mut self, theta: &[f64]) {
        const MOST: isize = 300;
        if self.inputs == Between::Samples {
            return;
        }
        let (all, tau) = self.expand(theta);
        // The transient follows what is folded, and that the transient.
        for _ in 0..3 {
            let t = self.transients(theta, false);
            let each: Vec<usize> =
                self.orders.iter().map(|n| self.transient(*n, 1.0).len()).collect();
            let own: usize = each.iter().sum();
            let mut folded = Vec::new();
            for (k, r) in self.records.iter().enumerate() {
                let count = (r.y[0].len() - 1 - r.lead) as isize;
                let line = |m: usize| {
                    let mut sum = vec![C::default(); self.outputs()];
                    for j in (-MOST..=MOST).filter(|j| *j != 0) {
                        let far = m as isize + j * count;
                        let omega = far as f64 * r.omega0();
                        let (a, b) = self.polynomials(&all, omega);
                        let mut at = k * own;
                        for i in 0..self.outputs() {
                            let mut one = C::default();
                            for s in 0..self.paths() {
                                let u = self.input(r, s, far.unsigned_abs(), tau[s]);
                                one = one + b[i][s] * if far < 0 { u.conj() } else { u };
                            }
                            for value in self.transient(self.orders[i], omega * self.records[0].dt)
                            {
                                one = one - value * t[at];
                                at += 1;
                            }
                            sum[i] = sum[i] + one * a[i].inverse();
                        }
                    }
                    sum
                };
                folded.push(r.line_numbers(self.trend).map(line).collect());
            }
            self.folded = folded;
        }
    }

    /// A_i and B_ik on a line.
    fn polynomials(&self, all: &[f64], omega: f64) -> (Vec<C>, Vec<Vec<C>>) {
        let (a_at, b_at) = self.places();
        let a = (0..self.outputs()).map(|i| {
            let n = self.orders[i];
            (0..n).fold(C::power(omega, n), |sum, j| {
                sum + C::power(omega, n - 1 - j) * all[a_at[i] + j]
            })
        });
        let b = |i: usize, k: usize| {
            let degree = self.numerators[i][k].map_or(0, |d| d + 1);
            (0..degree).fold(C::default(), |sum, j| {
                sum + C::power(omega, degree - 1 - j) * all[b_at[i][k] + j]
            })
        };
        let b = (0..self.outputs()).map(|i| (0..self.paths()).map(|k| b(i, k)).collect());
        (a.collect(), b.collect())
    }

    /// Transient columns of an output on a line: T(s), where the report's range is used more of them.
    fn transient(&self, order: usize, x: f64) -> Vec<C> {
        let mut all: Vec<C> = match self.extended {
            true => (0..order).map(|j| C::power(x, j)).collect(),
            false => {
                let real = (0..order).map(|j| C(C::power(x, j).size(), 0.0));
                real.chain((1..order).map(|j| C(0.0, C::power(x, j).size()))).collect()
            }
        };
        if self.trend == Trend::Linear {
            all.push(C(0.0, 1.0 / x));
        }
        all
    }

    /// Σ_y of a line, colour included.
    fn output_noise(&self, r: &Record, m: usize, i: usize, j: usize) -> f64 {
        match r.spectra.is_empty() {
            true => self.sigma[i][j],
            false => self.sigma[i][j] * (r.spectra[i][m] * r.spectra[j][m]).sqrt(),
        }
    }

    fn input_noise(&self, r: &Record, m: usize, s: usize, v: usize) -> f64 {
        let q = self.outputs();
        match r.spectra.is_empty() {
            true => self.input_sigma[s][v],
            false => self.input_sigma[s][v] * (r.spectra[q + s][m] * r.spectra[q + v][m]).sqrt(),
        }
    }

    /// W with W S W* = 1 on a line, or that with S = 1 of the flat weights.
    fn white(&self, r: &Record, m: usize, a: &[C], b: &[Vec<C>], flat: bool) -> Vec<Vec<C>> {
        let q = self.outputs();
        let diagonal = |of: &dyn Fn(usize) -> C| -> Vec<Vec<C>> {
            (0..q)
                .map(|i| (0..q).map(|j| if i == j { of(i) } else { C::default() }).collect())
                .collect()
        };
        if flat {
            return diagonal(&|_| C(1.0, 0.0));
        }
        if !self.input_sigma.is_empty() {
            let entry = |i: usize, j: usize| {
                let mut sum = a[i] * a[j].conj() * self.output_noise(r, m, i, j);
                for s in 0..self.paths() {
                    for v in 0..self.paths() {
                        sum = sum + b[i][s] * b[j][v].conj() * self.input_noise(r, m, s, v);
                    }
                }
                sum
            };
            let s: Vec<Vec<C>> = (0..q).map(|i| (0..q).map(|j| entry(i, j)).collect()).collect();
            return whitener(&s);
        }
        let own = |i: usize| match (self.equation, self.common && r.variances.is_empty()) {
            (true, _) => C(1.0, 0.0),
            // Outputs with one denominator are turned alike, so that nothing need turn.
            (false, true) => C(1.0 / a[i].size(), 0.0),
            (false, false) => a[i].inverse(),
        };
        if !r.variances.is_empty() {
            // Σ follows after the samples' own variances.
            return diagonal(&own);
        }
        let sigma: Vec<Vec<C>> = (0..q)
            .map(|i| (0..q).map(|j| C(self.output_noise(r, m, i, j), 0.0)).collect())
            .collect();
        let mut w = whitener(&sigma);
        for row in &mut w {
            for (j, value) in row.iter_mut().enumerate() {
                *value = *value * own(j);
            }
        }
        w
    }

    /// Rows at θ with the residual less transients `t`, of data or with the noise taken out.
    pub fn rows(&self, theta: &[f64], t: Option<&[f64]>, columns: Columns, flat: bool) -> Rows {
        let (all, tau) = self.expand(theta);
        let signals = self.signals(&tau);
        let (q, paths, p) = (self.outputs(), self.paths(), theta.len());
        let (free, (a_at, b_at)) = (self.free(), self.places());
        let each: Vec<usize> = self.orders.iter().map(|n| self.transient(*n, 1.0).len()).collect();
        let own_transients: usize = each.iter().sum();
        let transients = own_transients * self.records.len();
        let width = p + transients + 1;
        let (mut out, mut cluster) = (vec![Vec::new(); width], Vec::new());
        for (k, r) in self.records.iter().enumerate() {
            let from_row = out[0].len();
            for (at, m) in r.line_numbers(self.trend).enumerate() {
                let omega = m as f64 * r.omega0();
                let v = &signals[k][at];
                let (a, b) = self.polynomials(&all, omega);
                let white = self.white(r, m, &a, &b, flat);
                // Of each output: columns of θ, transients, residual.
                let mut raw = vec![vec![C::default(); width]; q];
                let mut start = p + k * own_transients;
                for i in 0..q {
                    let mut sum = a[i] * v[i];
                    for s in 0..paths {
                        sum = sum - b[i][s] * v[q + s];
                    }
                    for value in self.transient(self.orders[i], omega * self.records[0].dt) {
                        raw[i][start] = value;
                        if let Some(t) = t {
                            sum = sum + value * t[start - p];
                        }
                        start += 1;
                    }
                    raw[i][width - 1] = sum;
                }
                let mut hat = v.clone();
                if columns == Columns::Denoised {
                    self.denoise(r, m, (&a, &b), &white, &raw, &mut hat);
                }
                for i in 0..q {
                    let mut add = |coefficient: usize, value: C| {
                        if let Some(c) = free.iter().position(|own| *own == coefficient) {
                            raw[i][c] = raw[i][c] + value;
                        }
                    };
                    for j in 0..self.orders[i] {
                        add(a_at[i] + j, C::power(omega, self.orders[i] - 1 - j) * hat[i]);
                    }
                    for s in 0..paths {
                        for j in 0..self.numerators[i][s].map_or(0, |d| d + 1) {
                            let power = self.numerators[i][s].unwrap() - j;
                            add(b_at[i][s] + j, -(C::power(omega, power) * hat[q + s]));
                        }
                    }
                    let late = (0..paths).filter(|s| self.delays[*s].is_none());
                    for (c, s) in (free.len()..).zip(late) {
                        let step = 1e-4 * r.dt;
                        let near = |by: f64| self.input(r, s, m, tau[s] + by);
                        let slope = (near(step) - near(-step)) * (0.5 / step);
                        raw[i][c] = -(b[i][s] * slope);
                    }
                }
                let dense = !r.variances.is_empty() && !flat;
                let h = if m == 0 { 1.0 } else { 0.5 };
                let scale = if dense { 1.0 } else { (1.0 / (h * r.unit_variance())).sqrt() };
                for part in 0..if m == 0 { 1 } else { 2 } {
                    for i in 0..q {
                        cluster.push((k << 20) + 2 * m + part);
                        for c in 0..width {
                            let sum =
                                (0..=i).fold(C::default(), |sum, j| sum + white[i][j] * raw[j][c]);
                            out[c].push(scale * if part == 0 { sum.0 } else { sum.1 });
                        }
                    }
                }
            }
            if !r.variances.is_empty() && !flat {
                self.whiten_samples(r, &mut out, from_row);
            }
        }
        let residual = out.pop().unwrap();
        let transient = out.split_off(p);
        Rows { residual, columns: out, transient, cluster }
    }

    /// v − V L* S⁻¹ r, L = (D, −B).
    fn denoise(
        &self,
        r: &Record,
        m: usize,
        (a, b): (&[C], &[Vec<C>]),
        white: &[Vec<C>],
        raw: &[Vec<C>],
        hat: &mut [C],
    ) {
        let q = self.outputs();
        let residual: Vec<C> = raw.iter().map(|row| row[row.len() - 1]).collect();
        if !r.variances.is_empty() {
            (0..q).for_each(|i| hat[i] = hat[i] - a[i].inverse() * residual[i]);
            return;
        }
        let once: Vec<C> = (0..q)
            .map(|i| (0..q).fold(C::default(), |sum, j| sum + white[i][j] * residual[j]))
            .collect();
        let twice: Vec<C> = (0..q)
            .map(|j| (0..q).fold(C::default(), |sum, i| sum + white[i][j].conj() * once[i]))
            .collect();
        for i in 0..q {
            for j in 0..q {
                hat[i] = hat[i] - a[j].conj() * twice[j] * self.output_noise(r, m, i, j);
            }
        }
        for s in 0..if self.input_sigma.is_empty() { 0 } else { self.paths() } {
            for v in 0..self.paths() {
                for j in 0..q {
                    hat[q + s] =
                        hat[q + s] + b[j][v].conj() * twice[j] * self.input_noise(r, m, s, v);
                }
            }
        }
    }

    /// Rows of samples of uneven variance: the dense covariance of all lines of all outputs. Two outputs share the
    /// noise of the better one of two samples, by their usual variances; what is worse in the other is its own.
    fn whiten_samples(&self, r: &Record, out: &mut [Vec<f64>], from: usize) {
        let q = self.outputs();
        let (t, _, weights) = r.window();
        let rows: Vec<(usize, bool)> = r
            .line_numbers(self.trend)
            .flat_map(|m| [(m, false), (m, true)])
            .filter(|row| *row != (0, true))
            .collect();
        let wave = |(m, im): &(usize, bool)| -> Vec<f64> {
            let turned = t.iter().map(|t| C::turn(-(*m as f64) * r.omega0() * t));
            turned.map(|z| if *im { z.1 } else { z.0 }).collect()
        };
        let waves: Vec<Vec<f64>> = rows.iter().map(wave).collect();
        let usual: Vec<f64> = (0..q)
            .map(|i| {
                let own = r.variances[i][r.lead..].iter().copied();
                let mut known: Vec<f64> = own.filter(|v| v.is_finite()).collect();
                known.sort_by(f64::total_cmp);
                known[known.len() / 2]
            })
            .collect();
        let over = |i: usize, k: usize| (r.variances[i][r.lead + k] / usual[i]).min(1e8);
        let entry = |(a, i): (usize, usize), (b, j): (usize, usize)| {
            let shared = |k: usize| over(i, k).min(over(j, k)) * weights[k] * weights[k];
            let sum: f64 = (0..t.len()).map(|k| shared(k) * waves[a][k] * waves[b][k]).sum();
            C(self.sigma[i][j] * (usual[i] * usual[j]).sqrt() * sum, 0.0)
        };
        let places: Vec<(usize, usize)> =
            (0..rows.len()).flat_map(|k| (0..q).map(move |i| (k, i))).collect();
        let covariance: Vec<Vec<C>> =
            places.iter().map(|a| places.iter().map(|b| entry(*a, *b)).collect()).collect();
        let white = whitener(&covariance);
        for column in out.iter_mut() {
            let own = column[from..].to_vec();
            for (row, to) in white.iter().zip(&mut column[from..]) {
                *to = row.iter().zip(&own).map(|(w, x)| w.0 * x).sum();
            }
        }
    }

    /// The criterion, transients at their best: Σ |W r|²/h.
    pub fn criterion(&self, theta: &[f64]) -> f64 {
        let rows = self.rows(theta, None, Columns::Data, false);
        let rest = Qr::new(&rows.transient).rest(&rows.residual);
        dot(&rest, &rest)
    }

    /// Transients at θ, whitened with the noise or flat.
    pub fn transients(&self, theta: &[f64], flat: bool) -> Vec<f64> {
        let rows = self.rows(theta, None, Columns::Data, flat);
        Qr::new(&rows.transient).solve(&rows.residual).iter().map(|t| -t).collect()
    }

    /// By how much variances grow because Σ is estimated (Kenward and Roger 1997), for white noise that is Σ's alone:
    /// 1 + 2 (H C H)/H over ν − q − 1, C = Σ_ij cov(Σ_ij, Σ_kl) (X_iᵀX_l δ_jk − X_iᵀX_j H X_kᵀX_l).
    pub fn growth(&self, theta: &[f64], columns: Columns) -> Vec<f64> {
        let (q, p) = (self.outputs(), theta.len());
        let t = self.transients(theta, false);
        let rows = self.rows(theta, Some(&t), columns, false);
        let base = Qr::new(&rows.transient);
        let z: Vec<Vec<f64>> = rows.columns.iter().map(|c| base.rest(c)).collect();
        let h = Qr::new(&z).inverse_normal();
        let degrees = (rows.residual.len() - p - rows.transient.len()) as f64 / q as f64;
        // Rows of a line and part stand together, output by output.
        let part =
            |a: usize, i: usize| z[a].iter().skip(i).step_by(q).copied().collect::<Vec<f64>>();
        let parts: Vec<Vec<Vec<f64>>> =
            (0..p).map(|a| (0..q).map(|i| part(a, i)).collect()).collect();
        let influence = |k: usize, i: usize| -> Vec<f64> {
            let n = parts[0][i].len();
            (0..n).map(|r| (0..p).map(|a| h[k][a] * parts[a][i][r]).sum()).collect()
        };
        let one = |k: usize| {
            let own: Vec<Vec<f64>> = (0..q).map(|i| influence(k, i)).collect();
            let turned = |i: usize, j: usize| -> Vec<f64> {
                (0..p).map(|a| dot(&own[i], &parts[a][j])).collect()
            };
            let mut sum = 0.0;
            for i in 0..q {
                for j in 0..q {
                    for (x, y) in [(i, j), (j, i)] {
                        // cov(Σ_ij, Σ_xy) is 1 for these, twice where i = j.
                        let second = if j == x { dot(&own[i], &own[y]) } else { 0.0 };
                        let (left, right) = (turned(i, j), turned(y, x));
                        let bent: f64 = (0..p).map(|a| left[a] * dot(&h[a], &right)).sum();
                        sum += second - bent;
                    }
                }
            }
            1.0 + 2.0 * sum / (h[k][k] * (degrees - q as f64 - 1.0))
        };
        (0..p).map(one).collect()
    }

    /// Covariances and the step that is left at θ.
    pub fn worth(&self, theta: &[f64], columns: Columns) -> Worth {
        let t = self.transients(theta, false);
        let rows = self.rows(theta, Some(&t), columns, false);
        let data = self.rows(theta, Some(&t), Columns::Data, false);
        let base = Qr::new(&rows.transient);
        let z: Vec<Vec<f64>> = rows.columns.iter().map(|c| base.rest(c)).collect();
        let residual = &rows.residual;
        let factor = Qr::new(&z);
        let h = factor.inverse_normal();
        let cost = dot(residual, residual);
        let p = theta.len();
        let degrees = residual.len() - p - rows.transient.len();
        let variance = cost / degrees as f64;
        let classical: Vec<Vec<f64>> =
            h.iter().map(|row| row.iter().map(|x| variance * x).collect()).collect();
        let (own, shared) = (factor.leverages(residual.len()), base.leverages(residual.len()));
        let mut meat = vec![vec![0.0; p]; p];
        let mut from = 0;
        while from < residual.len() {
            let same =
                rows.cluster[from..].iter().take_while(|c| **c == rows.cluster[from]).count();
            let score: Vec<f64> = (0..p)
                .map(|c| {
                    let each = from..from + same;
                    each.map(|i| z[c][i] * residual[i] / (1.0 - own[i] - shared[i])).sum()
                })
                .collect();
            for a in 0..p {
                for b in 0..p {
                    meat[a][b] += score[a] * score[b];
                }
            }
            from += same;
        }
        // The step solves ZᵀΓ δ = −Zᵀr.
        let system: Vec<Vec<f64>> =
            (0..p).map(|a| (0..p).map(|b| dot(&z[a], &data.columns[b])).collect()).collect();
        let right: Vec<f64> = z.iter().map(|z| dot(z, residual)).collect();
        let step = inverse(&system)
            .iter()
            .enumerate()
            .map(|(k, row)| -dot(row, &right) / classical[k][k].sqrt())
            .collect();
        Worth {
            residual: residual.iter().map(|r| r / variance.sqrt()).collect(),
            cost,
            degrees,
            hc3: sandwich(&h, &meat),
            classical,
            step,
        }
    }
}
