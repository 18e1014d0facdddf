//! One step of one lane by orthogonal factors, where the pivots of the fast path were too small to trust.

use super::design::{Design, TILE};
use super::iterates::Iterates;
use super::normal_equations::{LeftColumns, RowWeights};
use super::record_space::RecordSpace;
use super::rest::Tie;
use crate::covariance::FLOOR;
use crate::linalg::qr::{Absorber, solve_square};
use crate::modulation::{Column, Signal};
use crate::simd::Wide;

/// Relative size below which a column is a combination of the others.
const RANK: f64 = 1e-13;

/// Which lane's rows, weighted how, made of which output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub lane: usize,
    pub weights: RowWeights,
    pub factors: LeftColumns,
}

/// Scratch of the fallback.
#[derive(Debug, Clone)]
pub(crate) struct QrStep {
    record: Absorber,
    all: Absorber,
    left: Vec<f64>,
    right: Vec<f64>,
    square: Vec<f64>,
    solution: Vec<f64>,
    scale: Vec<f64>,
    theta: Vec<f64>,
    transient: Vec<f64>,
    /// R of each record's transient with what it needs to be solved: rows × (size + 1).
    kept: Vec<f64>,
}

impl QrStep {
    pub fn new(d: &Design) -> QrStep {
        let (p, size) = (d.parameters(), d.size());
        let rows = 2 * d.tile.min(TILE);
        QrStep {
            record: Absorber::new(size, rows),
            all: Absorber::new(p, p),
            left: vec![0.0; 2 * size],
            right: vec![0.0; 2 * (size + 1)],
            square: vec![0.0; p * (p + 1)],
            solution: vec![0.0; p],
            scale: vec![0.0; p],
            theta: vec![0.0; p],
            transient: vec![0.0; d.transient],
            kept: vec![0.0; d.records.len() * d.transient * (size + 1)],
        }
    }

    /// LeftColumns one lane's rows, records stacked. False where the columns are dependent.
    fn factor(&mut self, d: &Design, records: &[RecordSpace], from: &Iterates, at: Place) -> bool {
        let (p, nt, size) = (d.parameters(), d.transient, d.size());
        let lane = at.lane;
        for (to, from) in self.theta.iter_mut().zip(&from.theta.now) {
            *to = from.0[lane];
        }
        self.all.clear();
        let mut full_rank = true;
        for (k, r) in records.iter().enumerate() {
            for (to, from) in self.transient.iter_mut().zip(&from.transients[k].now) {
                *to = from.0[lane];
            }
            self.record.clear();
            for m in 0..r.limit {
                self.rows(d, k, r, m, at);
            }
            for i in (0..r.tie.tied).filter(|_| r.tie.active) {
                // T = 0 is left of a coefficient that follows θ.
                let one = |j: usize| if j == i { 1.0 } else { 0.0 };
                self.record.push((0..size).map(one), (0..=size).map(one));
            }
            self.record.absorb();
            for i in 0..nt {
                let norm =
                    (0..=i).fold(0.0, |s, q| self.record.r(q, i).mul_add(self.record.r(q, i), s));
                full_rank &= self.record.r(i, i).abs() > RANK * norm.sqrt();
                for j in 0..=size {
                    let at = (k * nt + i) * (size + 1) + j;
                    self.kept[at] = if j < nt { self.record.r(i, j) } else { self.record.qt(i, j) };
                }
            }
            for i in nt..size {
                let (record, all) = (&self.record, &mut self.all);
                all.push((nt..size).map(|j| record.r(i, j)), (nt..=size).map(|j| record.qt(i, j)));
            }
            self.all.absorb();
        }
        for j in 0..p {
            let norm =
                (0..=j).fold(0.0, |s, q| self.all.r(q, j).mul_add(self.all.r(q, j), s)).sqrt();
            full_rank &= self.all.r(j, j).abs() > RANK * norm;
        }
        full_rank
    }

    /// Solves one lane: next θ and next T of every record. False where the columns are dependent.
    pub fn solve(
        &mut self,
        d: &Design,
        records: &[RecordSpace],
        iterates: &mut Iterates,
        at: Place,
    ) -> bool {
        let (p, nt, size) = (d.parameters(), d.transient, d.size());
        let lane = at.lane;
        let mut full_rank = self.factor(d, records, iterates, at);
        for i in 0..p {
            for j in 0..=p {
                self.square[i * (p + 1) + j] = self.all.qt(i, j);
            }
        }
        let worst = solve_square(&mut self.square, p, &mut self.solution, &mut self.scale);
        full_rank &= worst > RANK;
        for (to, from) in iterates.theta.next.iter_mut().zip(&self.solution) {
            to.0[lane] = *from;
        }
        for (k, transient) in iterates.transients.iter_mut().enumerate() {
            for i in (0..nt).rev() {
                let row = &self.kept[(k * nt + i) * (size + 1)..][..size + 1];
                let mut sum = row[size];
                for j in 0..p {
                    sum = (-row[nt + j]).mul_add(self.solution[j], sum);
                }
                for (own, t) in row[..nt].iter().zip(&transient.next).skip(i + 1) {
                    sum = (-own).mul_add(t.0[lane], sum);
                }
                transient.next[i].0[lane] = sum / row[i];
            }
            let tie = &records[k].tie;
            for i in (0..tie.tied).filter(|_| tie.active) {
                let row = tie.slopes[i * p..][..p].iter().zip(&self.solution);
                transient.next[i].0[lane] =
                    row.fold(tie.base[i].0[lane], |sum, (d, x)| d.0[lane].mul_add(*x, sum));
            }
        }
        full_rank
    }

    /// Inverse of the normal matrix of one lane, (RᵀR)⁻¹, without ever squaring the condition number.
    pub fn inverse(
        &mut self,
        d: &Design,
        records: &[RecordSpace],
        iterates: &Iterates,
        out: &mut [Wide],
        at: Place,
    ) -> bool {
        let p = d.parameters();
        let full_rank = self.factor(d, records, iterates, at);
        // Rows of R⁻¹ in `square`, upper triangular.
        for c in 0..p {
            for i in (0..p).rev() {
                let one = if i == c { 1.0 } else { 0.0 };
                let sum = (i + 1..p).fold(one, |s: f64, j| {
                    (-self.all.r(i, j)).mul_add(self.square[j * (p + 1) + c], s)
                });
                self.square[i * (p + 1) + c] = sum / self.all.r(i, i);
            }
        }
        for i in 0..p {
            for j in 0..p {
                let (a, b) = (&self.square[i * (p + 1)..][..p], &self.square[j * (p + 1)..][..p]);
                let dot = a.iter().zip(b).fold(0.0, |s: f64, (x, y)| x.mul_add(*y, s));
                out[i * p + j].0[at.lane] = dot;
            }
        }
        full_rank
    }

    /// The real and the imaginary row of a line, weighted, into the record's factors.
    fn rows(&mut self, d: &Design, k: usize, r: &RecordSpace, m: usize, at: Place) {
        let Place { lane, weights, factors } = at;
        let (rd, nt, size, n) = (&d.records[k], d.transient, d.size(), d.structure.order);
        let x = rd.x[m];
        let signal = |s: Signal| match s {
            Signal::U(input) => {
                let at = (1 + input) * r.lines + m;
                (r.re[at].0[lane], r.im[at].0[lane])
            }
            _ => (r.re[m].0[lane], r.im[m].0[lane]),
        };
        let horner = |lead: f64, c: &[f64]| {
            c.iter().fold((lead, 0.0), |(re, im): (f64, f64), c| ((-im).mul_add(x, *c), re * x))
        };
        let a = horner(1.0, &self.theta[..n]);
        let size_a = self.theta[..n].iter().fold(1.0, |s: f64, c| s.mul_add(rd.size_x[m], c.abs()));
        let square = a.0.mul_add(a.0, a.1 * a.1).max(FLOOR * size_a * size_a);
        let weight = match weights {
            RowWeights::Flat => rd.weight[m],
            RowWeights::Adapted => rd.weight[m] / square,
        };
        let y = signal(Signal::Y);
        let mut hat = y;
        if factors != LeftColumns::Data {
            let mut res = (a.0.mul_add(y.0, -(a.1 * y.1)), a.0.mul_add(y.1, a.1 * y.0));
            let mut first = n;
            for (input, degree) in d.structure.numerators.iter().enumerate() {
                let Some(degree) = degree else { continue };
                let b = horner(0.0, &self.theta[first..=first + degree]);
                first += degree + 1;
                let u = signal(Signal::U(input));
                res.0 -= b.0.mul_add(u.0, -(b.1 * u.1));
                res.1 -= b.0.mul_add(u.1, b.1 * u.0);
            }
            for (j, column) in d.columns[..nt].iter().enumerate() {
                let value = rd.transient[j * rd.x.len() + m] * self.transient[j];
                if column.phase % 2 == 0 { res.0 += value } else { res.1 += value }
            }
            hat.0 -= a.0.mul_add(res.0, a.1 * res.1) / square;
            hat.1 -= a.0.mul_add(res.1, -(a.1 * res.0)) / square;
        }
        let root = weight.sqrt();
        let operator = |c: &Column, v: (f64, f64)| {
            let s = (0..c.power).fold(c.sign, |s, _| s * x) * root;
            match c.phase {
                0 => (s * v.0, s * v.1),
                1 => (-s * v.1, s * v.0),
                2 => (-s * v.0, -s * v.1),
                _ => (s * v.1, -s * v.0),
            }
        };
        for (j, c) in d.columns.iter().chain([&d.target]).enumerate() {
            let (right, left) = if j < nt {
                let value = rd.transient[j * rd.x.len() + m] * root;
                let pair = if c.phase % 2 == 0 { (value, 0.0) } else { (0.0, value) };
                (pair, pair)
            } else if c.signal == Signal::Y {
                let data = operator(c, y);
                let model = operator(c, hat);
                (
                    if factors == LeftColumns::Denoised { model } else { data },
                    if factors == LeftColumns::Data { data } else { model },
                )
            } else {
                let value = operator(c, signal(c.signal));
                (value, value)
            };
            if j == size {
                self.right[j] = -right.0;
                self.right[size + 1 + j] = -right.1;
            } else {
                self.left[j] = left.0;
                self.left[size + j] = left.1;
                self.right[j] = right.0;
                self.right[size + 1 + j] = right.1;
            }
        }
        if r.tie.active {
            self.tie(&r.tie, nt, size, lane);
        }
        let (left, right, record) = (&self.left, &self.right, &mut self.record);
        record.push(left[..size].iter().copied(), right[..=size].iter().copied());
        record.push(left[size..].iter().copied(), right[size + 1..].iter().copied());
    }

    /// Puts T = t + Dθ into both rows of a line.
    fn tie(&mut self, tie: &Tie, nt: usize, size: usize, lane: usize) {
        let p = size - nt;
        for i in 0..tie.tied {
            for half in 0..2 {
                let (left, right) =
                    (&mut self.left[half * size..], &mut self.right[half * (size + 1)..]);
                let own = (std::mem::take(&mut left[i]), std::mem::take(&mut right[i]));
                for (j, slope) in tie.slopes[i * p..][..p].iter().enumerate() {
                    left[nt + j] += own.0 * slope.0[lane];
                    right[nt + j] += own.1 * slope.0[lane];
                }
                right[size] -= own.1 * tie.base[i].0[lane];
            }
        }
    }
}
