//! One step of one lane by orthogonal factors, where the pivots of the fast path were too small to trust.

use super::design::{Design, TILE};
use super::iterates::Iterates;
use super::normal_equations::{LeftColumns, RowWeights};
use super::record_workspace::RecordWorkspace;
use super::rest::Tie;
use crate::covariance::FLOOR;
use crate::linalg::stacked::Factor;
use crate::modulation::{Column, Signal};
use crate::simd::Wide;

/// Which lane's rows, weighted how, made of which output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub lane: usize,
    pub weights: RowWeights,
    pub factors: LeftColumns,
}

/// Workspace of the fallback.
#[derive(Debug, Clone)]
pub(crate) struct QrStep {
    factor: Factor,
    left: Vec<f64>,
    right: Vec<f64>,
    theta: Vec<f64>,
    transient: Vec<f64>,
}

impl QrStep {
    pub fn new(d: &Design) -> QrStep {
        let (p, size) = (d.parameters(), d.size());
        QrStep {
            factor: Factor::new(d.transient, p, d.records.len(), 2 * d.tile.min(TILE)).fused(),
            left: vec![0.0; 2 * size],
            right: vec![0.0; 2 * (size + 1)],
            theta: vec![0.0; p],
            transient: vec![0.0; d.transient],
        }
    }

    /// Factors of one lane's rows, records stacked. False where the columns are dependent.
    fn factor(
        &mut self,
        d: &Design,
        records: &[RecordWorkspace],
        from: &Iterates,
        at: Place,
    ) -> bool {
        let size = d.size();
        for (to, from) in self.theta.iter_mut().zip(&from.theta.now) {
            *to = from.0[at.lane];
        }
        self.factor.clear();
        let mut full_rank = true;
        for (k, r) in records.iter().enumerate() {
            for (to, from) in self.transient.iter_mut().zip(&from.transients[k].now) {
                *to = from.0[at.lane];
            }
            for m in 0..r.limit {
                self.rows(d, k, r, m, at);
            }
            for i in (0..r.tie.tied).filter(|_| r.tie.active) {
                // T = 0 is left of a coefficient that follows θ.
                let one = |j: usize| if j == i { 1.0 } else { 0.0 };
                self.factor.push((0..size).map(one), (0..=size).map(one));
            }
            full_rank &= self.factor.end_record(k);
        }
        full_rank & self.factor.is_independent()
    }

    /// Solves one lane: next θ and next T of every record. False where the columns are dependent.
    pub fn solve(
        &mut self,
        d: &Design,
        records: &[RecordWorkspace],
        iterates: &mut Iterates,
        at: Place,
    ) -> bool {
        let (p, lane) = (d.parameters(), at.lane);
        let mut full_rank = self.factor(d, records, iterates, at);
        full_rank &= self.factor.solve(|_| None);
        let solution = self.factor.solution();
        for (to, from) in iterates.theta.next.iter_mut().zip(solution) {
            to.0[lane] = *from;
        }
        for (k, transient) in iterates.transients.iter_mut().enumerate() {
            self.factor.solve_own(k, &mut transient.next, lane);
            let tie = &records[k].tie;
            for i in (0..tie.tied).filter(|_| tie.active) {
                let row = tie.slopes[i * p..][..p].iter().zip(solution);
                transient.next[i].0[lane] =
                    row.fold(tie.base[i].0[lane], |sum, (d, x)| d.0[lane].mul_add(*x, sum));
            }
        }
        full_rank
    }

    /// Inverse of the normal matrix of one lane, without ever squaring the condition number.
    pub fn inverse(
        &mut self,
        d: &Design,
        records: &[RecordWorkspace],
        iterates: &Iterates,
        out: &mut [Wide],
        at: Place,
    ) {
        self.factor(d, records, iterates, at);
        self.factor.inverse(out, at.lane);
    }

    /// The real and the imaginary row of a line, weighted, into the record's factors.
    fn rows(&mut self, d: &Design, k: usize, r: &RecordWorkspace, m: usize, at: Place) {
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
        let (left, right, factor) = (&self.left, &self.right, &mut self.factor);
        factor.push(left[..size].iter().copied(), right[..=size].iter().copied());
        factor.push(left[size..].iter().copied(), right[size + 1..].iter().copied());
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
