//! Covariance of θ at the estimate: classical, HC3 clustered over the equations of a row, and spectral with a noise
//! spectrum for each whitened equation.
//!
//! The transient is projected out of the columns, so that all is that of a regression on them; leverage counts
//! the transient's part.

use super::iterate::TermsProblem;
use crate::estimate::prior;
use crate::estimate::spectral::{Bins, NoiseSpectrum, Spectral};
use crate::linalg::columns::Columns;
use crate::linalg::qr::{dot, solve_square};
use crate::simd::Isa;

/// A row with less than this left of it beside its leverage is fitted as good as exactly: what it shows of
/// noise is nothing, and the classical variance stands for it.
const LEVERAGE: f64 = 1e-3;

/// Leaves (1 − h) well above zero in `ls`: its rows are not the residuals that are minimised.
const OBLIQUE_LEVERAGE: f64 = 0.25;

/// What an estimate is worth.
#[derive(Debug, Clone)]
pub(crate) struct Worth {
    /// Row major.
    pub nonrobust: Vec<f64>,
    /// Row major.
    pub hc3: Vec<f64>,
    /// Normal matrix of the columns, unit diagonal.
    pub gram: Vec<f64>,
    /// Degrees of freedom of each HC3 variance: few where few rows carry a parameter.
    pub degrees: Vec<f64>,
    /// Row major, the degrees of freedom of each variance, and the spectra it rests on.
    pub spectral: (Vec<f64>, Vec<f64>, NoiseSpectrum),
}

impl Worth {
    /// Of a fit that has none.
    pub fn unknown(p: usize) -> Worth {
        let square = || vec![f64::NAN; p * p];
        Worth {
            nonrobust: square(),
            hc3: square(),
            gram: square(),
            degrees: vec![f64::NAN; p],
            spectral: (square(), vec![f64::NAN; p], NoiseSpectrum::default()),
        }
    }
}

impl TermsProblem<'_> {
    /// Covariances from columns and residual that stand; parameters at a bound have none.
    pub fn worth(&self, variance: f64, at_bound: &[bool]) -> Worth {
        let p = self.columns.len();
        let free: Vec<usize> = (0..p).filter(|k| !at_bound[*k]).collect();
        let inverse = inverse_factor(self.fitter.isa, &self.columns, &free);
        let n = free.len();
        let h = |i: usize, j: usize| -> f64 {
            (i.max(j)..n).map(|k| inverse[i * n + k] * inverse[j * n + k]).sum()
        };
        let normal: Vec<f64> = (0..n * n).map(|k| h(k / n, k % n)).collect();
        let q = self.orthonormal(&free, &inverse);
        let meat = self.meat(&free, &q, variance);
        let mut out = Worth {
            nonrobust: vec![0.0; p * p],
            hc3: vec![0.0; p * p],
            gram: vec![0.0; p * p],
            degrees: vec![f64::INFINITY; p],
            spectral: (vec![0.0; p * p], vec![f64::INFINITY; p], NoiseSpectrum::default()),
        };
        let hat = self.hat(&q);
        let own = self.spectral(&free, variance, |i, to| {
            for (row, to) in normal.chunks(n.max(1)).zip(to) {
                *to = row.iter().zip(&free).map(|(h, k)| h * self.columns[*k][i]).sum();
            }
            (1.0 - hat[i]).max(LEVERAGE)
        });
        out.spectral.2 = own.2;
        for (a, k) in free.iter().enumerate() {
            out.spectral.1[*k] = own.1[a];
            for (b, l) in free.iter().enumerate() {
                out.spectral.0[k * p + l] = own.0[a * n + b];
            }
        }
        for (k, d) in free.iter().zip(self.degrees(&free, &hat, &normal)) {
            out.degrees[*k] = d;
        }
        for (i, a) in free.iter().enumerate() {
            for (j, b) in free.iter().enumerate() {
                out.nonrobust[a * p + b] = variance * normal[i * n + j];
                let row =
                    |k: usize| (0..n).map(|l| meat[k * n + l] * normal[l * n + j]).sum::<f64>();
                out.hc3[a * p + b] = (0..n).map(|k| normal[i * n + k] * row(k)).sum();
            }
        }
        let sizes: Vec<f64> = self.columns.iter().map(|c| dot(c, c).sqrt()).collect();
        for a in 0..p {
            for b in 0..p {
                let both = dot(&self.columns[a], &self.columns[b]);
                let held = at_bound[a] || at_bound[b];
                out.gram[a * p + b] = match (a == b, held) {
                    (true, _) => 1.0,
                    (_, true) => 0.0,
                    _ => both / (sizes[a] * sizes[b]),
                };
            }
        }
        out
    }

    /// The columns that are free times R⁻¹: the rows of the hat matrix, but for the transient's part.
    fn orthonormal(&self, free: &[usize], inverse: &[f64]) -> Vec<Vec<f64>> {
        let n = free.len();
        let mut out = vec![vec![0.0; self.residual.len()]; n];
        for (k, to) in out.iter_mut().enumerate() {
            for (l, own) in free[..=k].iter().enumerate() {
                let by = inverse[l * n + k];
                to.iter_mut().zip(&self.columns[*own]).for_each(|(to, c)| *to += by * c);
            }
        }
        out
    }

    /// Leverages of all rows; those of priors are 1.
    fn hat(&self, q: &[Vec<f64>]) -> Vec<f64> {
        let mut hat = vec![0.0; self.residual.len()];
        let add = |hat: &mut [f64], own: &[f64]| {
            hat.iter_mut().zip(own).for_each(|(h, x)| *h += x * x);
        };
        q.iter().for_each(|own| add(&mut hat, own));
        let mut at = 0;
        for spot in &self.spots {
            spot.base().for_each(|own| add(&mut hat[at..], own));
            at += spot.rows.len();
        }
        // What was known of a parameter is known whatever its leverage.
        hat[at..].fill(1.0);
        hat
    }

    /// Covariance of the free parameters from a smooth noise spectrum of each equation; `row` writes the influence of
    /// a row and says what its leverage leaves.
    fn spectral(
        &self,
        free: &[usize],
        variance: f64,
        row: impl Fn(usize, &mut [f64]) -> f64,
    ) -> (Vec<f64>, Vec<f64>, NoiseSpectrum) {
        let lines: Vec<_> = self.spots.iter().map(|spot| spot.lines).collect();
        let bins = Bins::new(&lines);
        let count = bins.terms.len();
        let equations = self.spots.iter().flat_map(|s| &s.rows).map(|r| r.equation + 1).max();
        let mut sums = Spectral::new(count, equations.unwrap_or(1), free.len());
        let mut influence = vec![0.0; free.len()];
        let rows = self.spots.iter().zip(&bins.of);
        let places = rows.flat_map(|(s, bins)| s.rows.iter().map(|r| (r.equation, bins[r.line])));
        for ((i, e), (equation, bin)) in self.residual.iter().enumerate().zip(places) {
            let left = row(i, &mut influence);
            sums.add_row(equation * count + bin, *e, left, &influence);
        }
        let (mut cov, mut degrees, told) = sums.finish(self.fitter.isa, &bins, variance);
        let n = free.len();
        let rest: Vec<f64> = (0..n).map(|k| cov[k * (n + 1)]).collect();
        let lines: usize = self.spots.iter().map(|s| s.rows.len()).sum();
        for i in lines..self.residual.len() {
            row(i, &mut influence);
            for (k, cov) in cov.iter_mut().enumerate() {
                *cov += variance * influence[k / n] * influence[k % n];
            }
        }
        for (k, rest) in rest.iter().enumerate().filter(|_| lines < self.residual.len()) {
            degrees[k] = prior::degrees(degrees[k], *rest, cov[k * (n + 1)]);
        }
        (cov, degrees, told)
    }

    /// (Σ a)²/Σ a² with a = E²/(1 − h), E the weight of a row in a parameter (Satterthwaite).
    fn degrees(&self, free: &[usize], hat: &[f64], normal: &[f64]) -> Vec<f64> {
        let n = free.len();
        let mut weight = vec![0.0; hat.len()];
        let one = |row: &[f64]| {
            weight.fill(0.0);
            for (k, by) in free.iter().zip(row) {
                weight.iter_mut().zip(&self.columns[*k]).for_each(|(w, c)| *w += by * c);
            }
            let (mut sum, mut squares) = (0.0, 0.0);
            for (w, hat) in weight.iter().zip(hat) {
                let left = 1.0 - hat;
                // A variance that is taken as known is as good as many.
                let known = left < LEVERAGE;
                let a = if known { w * w } else { w * w / left };
                sum += a;
                squares += if known { 0.0 } else { a * a };
            }
            sum * sum / squares.max(f64::MIN_POSITIVE)
        };
        normal.chunks(n.max(1)).map(one).collect()
    }

    /// Σ over clusters of (Jᵀ(I − H)⁻¹e)(…)ᵀ.
    fn meat(&self, free: &[usize], q: &[Vec<f64>], variance: f64) -> Vec<f64> {
        let n = free.len();
        let mut meat = vec![0.0; n * n];
        let mut at = 0;
        let (mut a, mut x, mut scale, mut score) = (vec![], vec![], vec![], vec![0.0; n]);
        for spot in &self.spots {
            let mut from = 0;
            while from < spot.rows.len() {
                let first = spot.rows[from];
                let same = |r: &&super::rows::Row| r.line == first.line && r.im == first.im;
                let size = spot.rows[from..].iter().take_while(same).count();
                let hat = |i: usize, j: usize| -> f64 {
                    let (i, j) = (from + i, from + j);
                    q.iter().map(|q| q[at + i] * q[at + j]).sum::<f64>()
                        + spot.base().map(|b| b[i] * b[j]).sum::<f64>()
                };
                a.clear();
                for i in 0..size {
                    a.extend((0..size).map(|j| if i == j { 1.0 - hat(i, j) } else { -hat(i, j) }));
                    a.push(self.residual[at + from + i]);
                }
                let width = size + 1;
                let exact = (0..size).any(|i| a[i * width + i] < LEVERAGE);
                for i in (0..size).filter(|_| exact) {
                    // Rows of the cluster by themselves, each at least as large as noise makes it.
                    let own = a[i * width + i];
                    a[i * width..i * width + size].fill(0.0);
                    a[i * width + i] = 1.0;
                    let sign = self.residual[at + from + i].signum();
                    if own < LEVERAGE {
                        a[i * width + size] = sign * variance.sqrt();
                    } else {
                        a[i * width + size] /= own;
                    }
                }
                x.resize(size, 0.0);
                scale.resize(size, 0.0);
                solve_square(&mut a, size, &mut x, &mut scale);
                for (score, k) in score.iter_mut().zip(free) {
                    let own = &self.columns[*k][at + from..];
                    *score = x.iter().zip(own).map(|(x, c)| x * c).sum();
                }
                for i in 0..n {
                    for j in 0..n {
                        meat[i * n + j] += score[i] * score[j];
                    }
                }
                from += size;
            }
            at += spot.rows.len();
        }
        // Rows of priors have the variance that they say.
        for i in at..self.residual.len() {
            for (score, k) in score.iter_mut().zip(free) {
                *score = variance.sqrt() * self.columns[*k][i];
            }
            for (k, meat) in meat.iter_mut().enumerate() {
                *meat += score[k / n] * score[k % n];
            }
        }
        meat
    }

    /// Covariances of `ls`: its instruments, applied to the residuals of the lines.
    pub fn differenced_worth(&self, variance: f64, degrees: usize) -> Worth {
        let p = self.columns.len();
        let z = self.instruments();
        // H = (ZᵀΓ)⁻¹ with Γ, Z on the whitened lines.
        let mut system: Vec<f64> = Vec::new();
        let mut h = vec![0.0; p * p];
        for j in 0..p {
            system.clear();
            for own in &z {
                system.extend(self.columns.iter().map(|c| dot(own, c)));
                system.push(0.0);
            }
            system[j * (p + 1) + p] = 1.0;
            let (mut x, mut scale) = (vec![0.0; p], vec![0.0; p]);
            solve_square(&mut system, p, &mut x, &mut scale);
            for (i, value) in x.iter().enumerate() {
                h[i * p + j] = *value;
            }
        }
        let (mut plain, mut robust) = (vec![0.0; p * p], vec![0.0; p * p]);
        let row = |i: usize, effect: &mut [f64]| {
            for (k, effect) in effect.iter_mut().enumerate() {
                *effect = (0..p).map(|l| h[k * p + l] * z[l][i]).sum::<f64>();
            }
            let leverage: f64 = effect.iter().zip(&self.columns).map(|(x, c)| x * c[i]).sum();
            (1.0 - leverage).max(OBLIQUE_LEVERAGE)
        };
        let mut effect = vec![0.0; p];
        for (i, e) in self.residual.iter().enumerate() {
            let left = e / row(i, &mut effect);
            for a in 0..p {
                for b in 0..p {
                    plain[a * p + b] += variance * effect[a] * effect[b];
                    robust[a * p + b] += left * left * effect[a] * effect[b];
                }
            }
        }
        let gram = self.worth(variance, &vec![false; p]).gram;
        let free: Vec<usize> = (0..p).collect();
        let spectral = self.spectral(&free, variance, row);
        Worth { nonrobust: plain, hc3: robust, gram, degrees: vec![degrees as f64; p], spectral }
    }

    /// Variances at unit noise of the columns on the lines up to `last` of each record; none where too few, as
    /// the fit counts them: with parameters at bounds, which may leave these, and without priors.
    pub fn variances_up_to(&self, last: &[usize], at_bound: &[bool]) -> Option<Vec<f64>> {
        let p = self.columns.len();
        let mut all: Vec<Vec<f64>> = vec![Vec::new(); p];
        let mut spent = 0;
        for (spot, last) in self.spots.iter().zip(last) {
            spent += spot.projected(self.fitter.isa, spot.rows_up_to(*last), &mut all);
        }
        if all.first().map_or(0, Vec::len) <= p + spent {
            return None;
        }
        let lines: usize = self.spots.iter().map(|s| s.rows.len()).sum();
        for (to, from) in all.iter_mut().zip(&self.columns) {
            to.extend_from_slice(&from[lines..]); // of priors
        }
        let free: Vec<usize> = (0..p).filter(|k| !at_bound[*k]).collect();
        let n = free.len();
        let inverse = inverse_factor(self.fitter.isa, &all, &free);
        let mut out = vec![0.0; p];
        for (i, k) in free.iter().enumerate() {
            out[*k] = (i..n).map(|j| inverse[i * n + j] * inverse[i * n + j]).sum();
        }
        Some(out)
    }
}

/// R⁻¹ of the columns' factor, row major, upper triangular.
fn inverse_factor(isa: Isa, columns: &[Vec<f64>], free: &[usize]) -> Vec<f64> {
    let rows = columns.first().map_or(0, Vec::len);
    let mut factor = Columns::new(isa, rows, free.len()).judged_by(0.0);
    for k in free {
        factor.push_rows(&columns[*k]);
    }
    factor.inverse()
}
