//! At a single estimate: standard errors on any part of its lines, covariances, residuals.
//!
//! As for batches (`joint::uncertainty`), by orthogonal factors: with the whitened columns of a record as
//! \[T, J\] = Q R, the rows of J with the transient projected out are those of Q behind T times R's last block. Such
//! blocks of all records stand above one another in one more factor R; then H = R⁻¹R⁻ᵀ, and a leverage is the square
//! of a row of the Q's.

use super::super::growth::Shared;
use super::system::independent;
use super::{Ended, Single};
use crate::error::Status;
use crate::estimate::prior::degrees;
use crate::estimate::spectral::{NoiseSpectrum, Spectral};
use crate::estimate::uncertainty::LEVERAGE;
use crate::linalg::large::{Qr, inverse_of_upper, product, transposed_product};
use crate::linalg::qr::dot;
use crate::simd::{LANES, numbers};

/// The covariances of θ and its normal matrix, in the workspace's units; row major.
pub(crate) struct Covariances {
    pub nonrobust: Vec<f64>,
    pub hc3: Vec<f64>,
    pub spectral: Vec<f64>,
    /// Of each spectral variance.
    pub degrees: Vec<f64>,
    pub noise_spectrum: NoiseSpectrum,
    pub normal: Vec<f64>,
    /// Weighted residuals: records × outputs × lines, (Re, Im).
    pub residuals: Vec<Vec<Vec<(f64, f64)>>>,
    /// Whether the columns were independent.
    pub full: bool,
}

/// Whitened rows of one record at the estimate: columns (T, θ that moves, θ on bounds), and residuals.
pub(crate) struct Columns {
    /// Column after column; a column output by output, Re before Im, lines up to a multiple of eight.
    columns: Vec<f64>,
    residual: Vec<f64>,
    stride: usize,
    used: usize,
}

/// Factors of the first lines of all records.
struct Factored {
    /// R of θ, the part that moves first, and its inverse there.
    triangle: Vec<f64>,
    inverse: Vec<f64>,
    /// Of each record the orthonormal columns (T, then θ that moves) and their rows; none where only R was asked for.
    spans: Vec<(Vec<f64>, usize)>,
    full: bool,
}

impl Single<'_> {
    /// Whitened columns of every record at the estimate, denoised where the method's are.
    pub fn columns(&mut self) -> Vec<Columns> {
        let d = self.d;
        let (q, size, nt) = (d.outputs(), d.size(), d.transient.len());
        let order = self.order();
        let mixed = d.holds_sigma();
        let mut all = Vec::new();
        for k in 0..d.records.len() {
            self.write(k, d.final_weights(), d.final_factors());
            let stride = self.w.residual.part * LANES;
            let rows = 2 * q * stride;
            // Σ is mixed in where the rows do not hold it yet.
            let root = |i: usize, j: usize| match mixed {
                true => f64::from(i == j),
                false => self.w.root[i * q + j].0[0],
            };
            let mut columns = vec![0.0; rows * size];
            let places = (0..nt).chain(order.iter().map(|c| nt + c));
            for (c, to) in places.zip(columns.chunks_exact_mut(rows)) {
                for j in (0..q).filter(|j| self.w.right.has(*j, c)) {
                    let from = self.w.right.at(j, c, 0);
                    let own = numbers(&self.w.right.all[from..from + 2 * self.w.right.part]);
                    add_mixed(to, own, |i| root(i, j), j, q);
                }
            }
            let mut residual = vec![0.0; rows];
            for j in 0..q {
                let own = &numbers(&self.w.residual.all)[j * 2 * stride..(j + 1) * 2 * stride];
                add_mixed(&mut residual, own, |i| root(i, j), j, q);
            }
            all.push(Columns { columns, residual, stride, used: d.records[k].used });
        }
        all
    }

    /// θ's parameters, those on their bounds last.
    fn order(&self) -> Vec<usize> {
        let stays = |k: &usize| self.w.pinned[*k].0[0] > 0.0;
        let (stay, mut order): (Vec<_>, Vec<_>) = (0..self.d.parameters()).partition(stays);
        order.extend(stay);
        order
    }

    /// Variance of the rows.
    fn scale(&self) -> f64 {
        self.w.progress.cost.0[0] / self.d.degrees_of_freedom().max(1) as f64
    }

    fn moving(&self) -> usize {
        self.w.pinned.iter().filter(|on| on.0[0] == 0.0).count()
    }

    /// Variances of θ at σ = 1 on the first `limits` lines of the records; of a parameter on its bound zero.
    pub fn variances(&self, columns: &[Columns], limits: &[usize]) -> Vec<f64> {
        let found = self.factored(columns, limits, false);
        let (order, m) = (self.order(), self.moving());
        let mut variances = vec![0.0; order.len()];
        for (a, k) in order[..m].iter().enumerate() {
            let row = (a..m).map(|b| found.inverse[b * m + a]);
            variances[*k] = row.map(|x| x * x).sum();
        }
        variances
    }

    /// Factors of the first `limits` lines of the records.
    fn factored(&self, columns: &[Columns], limits: &[usize], whole: bool) -> Factored {
        let d = self.d;
        let (q, nt, p) = (d.outputs(), d.transient.len(), d.parameters());
        let (size, m) = (nt + p, self.moving());
        let mut qr = Qr::default();
        let (mut spans, mut full) = (Vec::new(), true);
        let tall = columns.len() * p + d.priors.len();
        let mut stacked = vec![0.0; tall * p];
        let (scale, order) = (self.scale(), self.order());
        for (at, prior) in d.priors.iter().enumerate() {
            for (j, k) in order.iter().enumerate() {
                if *k == prior.parameter {
                    stacked[j * tall + columns.len() * p + at] = prior.entry(scale);
                }
            }
        }
        for (k, (own, limit)) in columns.iter().zip(limits).enumerate() {
            let limit = (*limit).min(own.used);
            let rows = (2 * q * limit).max(size);
            let mut matrix = vec![0.0; rows * size];
            let height = 2 * q * own.stride;
            for (to, from) in
                matrix.chunks_exact_mut(rows).zip(own.columns.chunks_exact(height.max(1)))
            {
                for (part, from) in from.chunks_exact(own.stride).enumerate() {
                    to[part * limit..(part + 1) * limit].copy_from_slice(&from[..limit]);
                }
            }
            qr.factor(&mut matrix, rows, size);
            for j in 0..p {
                let from = &matrix[(nt + j) * rows + nt..][..j + 1];
                stacked[j * tall + k * p..][..j + 1].copy_from_slice(from);
            }
            let transient: Vec<f64> = (0..nt * nt)
                .map(|at| if at % nt <= at / nt { matrix[at / nt * rows + at % nt] } else { 0.0 })
                .collect();
            full &= independent(&transient, nt);
            if whole {
                let mut span = vec![0.0; rows * size];
                qr.q(&matrix, rows, size, &mut span);
                spans.push((span, rows));
            }
        }
        let blocks = stacked.clone();
        qr.factor(&mut stacked, tall, p);
        let upper = |n: usize| -> Vec<f64> {
            (0..n * n)
                .map(|at| if at % n <= at / n { stacked[at / n * tall + at % n] } else { 0.0 })
                .collect()
        };
        let (triangle, leading) = (upper(p), upper(m));
        full &= independent(&leading, m);
        let inverse = inverse_of_upper(&leading, m);
        if whole {
            // Rows of θ's orthonormal columns: those of the record times its block times R⁻¹.
            for (k, (span, rows)) in spans.iter_mut().enumerate() {
                let block: Vec<f64> =
                    (0..p * m).map(|at| blocks[at / p * tall + k * p + at % p]).collect();
                let (mut turn, mut theta) = (vec![0.0; p * m], vec![0.0; *rows * m]);
                product(&block, &inverse, (p, m, m), &mut turn);
                product(&span[nt * *rows..], &turn, (*rows, p, m), &mut theta);
                span.truncate(nt * *rows);
                span.extend(theta);
            }
        }
        Factored { triangle, inverse, spans, full }
    }

    /// Covariances in the user's units, and the outcome with what they tell: without rank they are no numbers.
    pub fn answer(&mut self, ended: Ended) -> (Covariances, Status) {
        let mut found = self.covariances();
        let p = self.d.parameters();
        let lost = |cov: &[f64]| (0..p).any(|k| cov[k * (p + 1)].is_nan());
        let mut status = ended.status;
        if status != Status::NonFinite
            && (!found.full || lost(&found.nonrobust) || lost(&found.hc3))
        {
            status = Status::Rank;
        }
        let scale = |k: usize| self.d.parameter_scale(k);
        for cov in [&mut found.nonrobust, &mut found.hc3, &mut found.spectral] {
            if matches!(status, Status::Rank | Status::NonFinite) {
                cov.fill(f64::NAN);
            }
            for (k, value) in cov.iter_mut().enumerate() {
                *value *= scale(k / p) * scale(k % p);
            }
        }
        (found, status)
    }

    /// The covariances and the residuals at the estimate.
    fn covariances(&mut self) -> Covariances {
        let columns = self.columns();
        let d = self.d;
        let (q, nt, p) = (d.outputs(), d.transient.len(), d.parameters());
        let limits: Vec<usize> = d.records.iter().map(|r| r.used).collect();
        let found = self.factored(&columns, &limits, true);
        let (order, m) = (self.order(), self.moving());
        let lines: usize = limits.iter().map(|limit| 2 * limit).sum();
        // Sums over the outputs of each line, Re and Im apart, weighted by residuals over one less the leverage.
        let mut gains = vec![0.0; lines * m];
        let (mut residuals, mut from) = (Vec::new(), 0);
        let bins = d.bins.terms.len();
        let mut spectral = Spectral::new(bins, q, m);
        let mut shared = Shared::new(d, m);
        let transposed: Vec<f64> =
            (0..m * m).map(|at| found.inverse[at % m * m + at / m]).collect();
        let records = columns.iter().zip(&limits).zip(&found.spans).enumerate();
        for (k, ((own, limit), (span, rows))) in records {
            let mut leverage = vec![0.0; *rows];
            for column in span.chunks_exact(*rows) {
                for (h, x) in leverage.iter_mut().zip(column) {
                    *h += x * x;
                }
            }
            let height = *rows;
            // Influence of each row on θ: R⁻¹ times the rows behind those of the transient.
            let mut influence = vec![0.0; *rows * m];
            product(&span[nt * *rows..], &transposed, (*rows, m, m), &mut influence);
            shared.add_record(&influence, *rows, 2 * limit);
            let mut one = vec![0.0; m];
            let mut record = vec![vec![(0.0, 0.0); *limit]; q];
            for part in 0..2 * q {
                let e = &own.residual[part * own.stride..][..*limit];
                let rows = part * limit..(part + 1) * limit;
                let by: Vec<f64> = e
                    .iter()
                    .zip(&leverage[rows.clone()])
                    .map(|(e, h)| e / (1.0 - h).max(LEVERAGE))
                    .collect();
                for (i, e) in e.iter().enumerate() {
                    let at = part * limit + i;
                    // Line 0 is real.
                    if part % 2 == 0 || d.records[k].lines.first + i > 0 {
                        one.iter_mut()
                            .zip(influence.iter().skip(at).step_by(height))
                            .for_each(|(one, g)| *one = *g);
                        let left = (1.0 - leverage[at]).max(LEVERAGE);
                        let bin = part / 2 * bins + d.bins.of[k][i];
                        spectral.add_row(bin, *e, left, &one);
                    }
                }
                for a in 0..m {
                    let column = &span[(nt + a) * leverage.len()..][rows.clone()];
                    let to = &mut gains[a * lines + from + part % 2 * limit..][..*limit];
                    for ((to, by), x) in to.iter_mut().zip(&by).zip(column) {
                        *to += by * x;
                    }
                }
                for (to, e) in record[part / 2].iter_mut().zip(e) {
                    if part % 2 == 0 { to.0 = *e } else { to.1 = *e }
                }
            }
            residuals.push(record);
            from += 2 * limit;
        }
        let (mut meat, mut half, mut hc3) = (vec![0.0; m * m], vec![0.0; m * m], vec![0.0; m * m]);
        transposed_product(&gains, &gains, lines, (m, m), &mut meat);
        // R⁻¹ M R⁻ᵀ, in two products from the left.
        product(&found.inverse, &meat, (m, m, m), &mut half);
        let turned: Vec<f64> = (0..m * m).map(|at| half[at % m * m + at / m]).collect();
        product(&found.inverse, &turned, (m, m, m), &mut hc3);
        let variance = self.scale();
        let row = |a: usize| (0..m).map(move |b| b * m + a);
        let rows: Vec<Vec<f64>> =
            (0..m).map(|a| row(a).map(|at| found.inverse[at]).collect()).collect();
        let mut all = Covariances {
            nonrobust: vec![0.0; p * p],
            hc3: vec![0.0; p * p],
            spectral: vec![0.0; p * p],
            degrees: vec![f64::INFINITY; p],
            noise_spectrum: NoiseSpectrum::default(),
            normal: vec![0.0; p * p],
            residuals,
            full: found.full,
        };
        let (spectral, freedom, noise_spectrum) = spectral.finish(self.isa, &d.bins, variance);
        all.noise_spectrum = noise_spectrum;
        for (i, own) in order.iter().zip(freedom) {
            all.degrees[*i] = own;
        }
        for (a, i) in order.iter().enumerate() {
            for (b, j) in order.iter().enumerate() {
                if a < m && b < m {
                    all.nonrobust[i * p + j] = variance * dot(&rows[a], &rows[b]);
                    all.hc3[i * p + j] = 0.5 * (hc3[b * m + a] + hc3[a * m + b]);
                    all.spectral[i * p + j] = spectral[a * m + b];
                }
                let (x, y) = (&found.triangle[a * p..][..p], &found.triangle[b * p..][..p]);
                all.normal[i * p + j] = dot(x, y);
            }
        }
        let rest: Vec<f64> = (0..p).map(|k| all.spectral[k * (p + 1)]).collect();
        for prior in &d.priors {
            // Influence of its row on θ, times its standard deviation.
            let by = prior.entry(variance) * variance.sqrt();
            let place = order[..m].iter().position(|k| *k == prior.parameter);
            let Some(own) = place.map(|at| &rows[at]) else { continue };
            let each: Vec<f64> = rows.iter().map(|row| by * dot(row, own)).collect();
            for (a, i) in order[..m].iter().enumerate() {
                for (b, j) in order[..m].iter().enumerate() {
                    all.hc3[i * p + j] += each[a] * each[b];
                    all.spectral[i * p + j] += each[a] * each[b];
                }
            }
        }
        for (k, rest) in rest.iter().enumerate().filter(|_| !d.priors.is_empty()) {
            all.degrees[k] = degrees(all.degrees[k], *rest, all.spectral[k * (p + 1)]);
        }
        if d.estimates_weights() {
            let leading: Vec<f64> =
                (0..m * m).map(|at| found.triangle[at / m * p + at % m]).collect();
            let own: Vec<f64> = rows.iter().map(|row| dot(row, row)).collect();
            let growth = shared.growth(&leading, &own, d.degrees_of_freedom());
            for (i, a) in order[..m].iter().zip(&growth) {
                for (j, b) in order[..m].iter().zip(&growth) {
                    all.nonrobust[i * p + j] *= a * b;
                    all.spectral[i * p + j] *= a * b;
                }
            }
        }
        all
    }
}

/// Adds the rows of output `j` to those of every output that Σ's root mixes them into.
fn add_mixed(to: &mut [f64], own: &[f64], root: impl Fn(usize) -> f64, j: usize, q: usize) {
    for i in j..q {
        let by = root(i);
        if by != 0.0 {
            let to = &mut to[i * own.len()..(i + 1) * own.len()];
            for (to, from) in to.iter_mut().zip(own) {
                *to += by * from;
            }
        }
    }
}
