//! The rows of one record at one θ: equation error, its covariance, what whitens them, and the Jacobian.
//!
//! A row is Re or Im of an equation on a line. With λ = C⁻¹r the noise that best explains the residual r is
//! v̂ = ΣLᵀλ; J is made of the signals without it, E − (∂E/∂v)v̂, which makes Jᵀ C⁻¹ r the exact gradient of
//! ½ rᵀC(θ)⁻¹r (docs/core.md, "Terms").

mod denoised;

use super::complex::C;
use super::equations::Equations;
use super::lines::{Pairs, Spectra};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::linalg::dense::{Panel, whiten, whiten_more};
use crate::modulation::Lines;
use crate::simd::Isa;
use crate::structure::Trend;

/// Variance of a row on which noise has no say, over that of its neighbours.
const SILENT: f64 = 1e-9;
/// Columns whose part beside the ones before is smaller than this fraction are dependent.
const DEPENDENT: f64 = 1e-10;

/// Re or Im of an equation on a line (position among the lines).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    pub line: usize,
    pub im: bool,
    pub equation: usize,
}

/// One record on its lines.
pub(crate) struct Spot {
    pub lines: Lines,
    /// Lowest line of the band, before a trend takes line 0.
    pub lowest: usize,
    pub rows: Vec<Row>,
    /// Row of (line, im, equation); none for Im of line 0.
    place: Vec<Option<usize>>,
    /// (iω)^k of each line.
    powers: Vec<Vec<C>>,
    /// Transient and drift columns, row by row.
    transient: Vec<Vec<f64>>,
    /// Standard deviation of a row under flat weights.
    flat: Vec<f64>,
    pub spectra: Spectra,
    /// L on each line: (equation, noisy signal, line).
    loads: Vec<C>,
    /// Equation error on each line: (equation, line).
    pub error: Vec<C>,
    panel: Panel,
    more: Panel,
    least: Vec<f64>,
    /// Whitened transient columns, and an orthonormal base of them.
    whitened: Vec<Vec<f64>>,
    base: Vec<Vec<f64>>,
    /// Whitened residual, the transient's part taken out.
    pub residual: Vec<f64>,
    /// Whitened columns of θ, transient not taken out.
    pub columns: Vec<Vec<f64>>,
    lambda: Vec<f64>,
    denoised: Vec<Vec<C>>,
    weights: RowWeights,
}

impl Spot {
    pub fn new(e: &Equations, lines: Lines, trend: Trend, flat: &[f64]) -> Spot {
        let lowest = lines.first;
        let first = if trend == Trend::None { lines.first } else { lines.first.max(1) };
        let lines = Lines { first, ..lines };
        let count = lines.last + 1 - first;
        let equations = e.orders.len();
        let mut rows = Vec::new();
        let mut place = vec![None; count * 2 * equations];
        for line in 0..count {
            for im in [false, true] {
                if im && line + first == 0 {
                    continue;
                }
                for equation in 0..equations {
                    place[(line * 2 + usize::from(im)) * equations + equation] = Some(rows.len());
                    rows.push(Row { line, im, equation });
                }
            }
        }
        let highest = e.orders.iter().copied().max().unwrap_or(0);
        let omega = |line: usize| (line + first) as f64 * lines.omega0;
        // One power more than the equations have: a delay's slope is −s V.
        let powers = (0..=highest + 1)
            .map(|k| (0..count).map(|line| C::power(omega(line), k)).collect())
            .collect();
        let edge = lines.last as f64;
        let mut transient = Vec::new();
        for (equation, order) in e.orders.iter().enumerate() {
            let mut column = |im: bool, value: &dyn Fn(f64) -> f64| {
                transient.push(
                    rows.iter()
                        .map(|r| match r.equation == equation && r.im == im {
                            true => value((r.line + first) as f64),
                            false => 0.0,
                        })
                        .collect::<Vec<f64>>(),
                );
            };
            for k in 0..*order {
                // Even powers of s are real, odd ones imaginary, and so are Chebyshev's polynomials of iω.
                column(k % 2 == 1, &|m| chebyshev(k, m / edge));
            }
            if trend == Trend::Linear {
                column(true, &|m| 1.0 / m);
            }
        }
        let share = |r: &Row| if r.line + first == 0 { 1.0 } else { 0.5 };
        let flat = rows
            .iter()
            .map(|r| (share(r) * lines.unit_variance * flat[r.equation]).sqrt())
            .collect();
        Spot {
            lowest,
            lines,
            place,
            powers,
            transient,
            flat,
            spectra: Spectra::default(),
            loads: Vec::new(),
            error: vec![C::default(); equations * count],
            panel: Panel::default(),
            more: Panel::default(),
            least: Vec::new(),
            whitened: Vec::new(),
            base: Vec::new(),
            residual: vec![0.0; rows.len()],
            columns: vec![vec![0.0; rows.len()]; e.parameters],
            lambda: Vec::new(),
            denoised: Vec::new(),
            weights: RowWeights::Flat,
            rows,
        }
    }

    fn count(&self) -> usize {
        self.lines.last + 1 - self.lines.first
    }

    /// Unknowns besides θ.
    pub fn transients(&self) -> usize {
        self.transient.len()
    }

    /// Whitens the rows at coefficients `g` and takes out the transient; the weighted sum of squares.
    pub fn evaluate(
        &mut self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        g: &[f64],
        lags: &[f64],
        weights: RowWeights,
    ) -> f64 {
        self.weights = weights;
        self.errors(e, g);
        let (rows, width) = (self.rows.len(), self.transient.len() + 1);
        match weights {
            RowWeights::Flat => {
                self.panel.resize(rows, width);
                self.fill_columns(0);
                for (i, sd) in self.flat.iter().enumerate() {
                    for j in 0..width {
                        self.panel.set(i, j, self.panel.get(i, j) / sd);
                    }
                }
                self.take_out(0);
            }
            RowWeights::Adapted => {
                self.panel.resize(rows, rows + width);
                self.load_lines(e, pairs, g, lags);
                self.covariance(e, pairs);
                self.fill_columns(rows);
                self.floors(e.orders.len());
                whiten(isa, &mut self.panel, &self.least);
                self.take_out(rows);
            }
        }
        self.residual.iter().map(|x| x * x).sum()
    }

    /// Σ g s^k V of each equation.
    fn errors(&mut self, e: &Equations, g: &[f64]) {
        let (count, first) = (self.count(), self.lines.first);
        self.error.fill(C::default());
        for (term, g) in e.terms.iter().zip(g) {
            let own = &mut self.error[term.equation * count..][..count];
            let values = &self.spectra.signals[term.signal][first..];
            for ((to, v), p) in own.iter_mut().zip(values).zip(&self.powers[term.order]) {
                *to += *p * *v * *g;
            }
        }
    }

    /// Writes transient columns and the equation error from column `at` on.
    fn fill_columns(&mut self, at: usize) {
        let count = self.count();
        for (i, row) in self.rows.iter().enumerate() {
            for (c, column) in self.transient.iter().enumerate() {
                self.panel.set(i, at + c, column[i]);
            }
            let q = self.error[row.equation * count + row.line];
            self.panel.set(i, at + self.transient.len(), if row.im { q.1 } else { q.0 });
        }
    }

    /// How noise on each noisy signal's own coefficient enters each equation: Σ g s^k e^{−s lag}.
    fn load_lines(&mut self, e: &Equations, pairs: &Pairs, g: &[f64], lags: &[f64]) {
        let (count, first) = (self.count(), self.lines.first);
        let own = pairs.noisy.len();
        self.loads.clear();
        self.loads.resize(e.orders.len() * own * count, C::default());
        for (term, g) in e.terms.iter().zip(g) {
            let Some(at) = pairs.noisy.iter().position(|s| *s == term.signal) else { continue };
            let to = &mut self.loads[(term.equation * own + at) * count..][..count];
            for (to, p) in to.iter_mut().zip(&self.powers[term.order]) {
                *to += *p * *g;
            }
        }
        for (at, s) in pairs.noisy.iter().enumerate().filter(|(_, s)| lags[**s] != 0.0) {
            for equation in 0..e.orders.len() {
                let to = &mut self.loads[(equation * own + at) * count..][..count];
                for (line, to) in to.iter_mut().enumerate() {
                    *to = *to * late((line + first) as f64 * self.lines.omega0 * lags[*s]);
                }
            }
        }
    }

    /// Covariance of the rows, upper triangle.
    fn covariance(&mut self, e: &Equations, pairs: &Pairs) {
        let (count, first) = (self.count(), self.lines.first);
        let (equations, own) = (e.orders.len(), pairs.noisy.len());
        // E[Q(m) Q(l)*] and E[Q(m) Q(l)] of one m, equation and other equation, over l.
        let (mut direct, mut mirrored) = (vec![C::default(); count], vec![C::default(); count]);
        for m in 0..count {
            for a in 0..equations {
                for b in 0..equations {
                    direct[m..].fill(C::default());
                    mirrored[m..].fill(C::default());
                    for (i, s) in pairs.noisy.iter().enumerate() {
                        let from = self.loads[(a * own + i) * count + m];
                        for j in 0..own {
                            let Some(pair) = pairs.place[*s][j] else { continue };
                            let to = &self.loads[(b * own + j) * count..][m..count];
                            let r = &self.spectra.pairs[pair];
                            let (near, far) = (&r[..count - m], &r[2 * (m + first)..]);
                            let sums = direct[m..].iter_mut().zip(&mut mirrored[m..]);
                            for ((d, x), ((to, near), far)) in
                                sums.zip(to.iter().zip(near).zip(far))
                            {
                                *d += from * (*to * *near).conj();
                                *x += from * (*to * *far);
                            }
                        }
                    }
                    for l in m..count {
                        let (d, x) = (direct[l], mirrored[l]);
                        let entries = [
                            (false, false, d.0 + x.0),
                            (true, true, d.0 - x.0),
                            (false, true, x.1 - d.1),
                            (true, false, x.1 + d.1),
                        ];
                        for (im_a, im_b, value) in entries {
                            let i = self.place[(m * 2 + usize::from(im_a)) * equations + a];
                            let j = self.place[(l * 2 + usize::from(im_b)) * equations + b];
                            if let (Some(i), Some(j)) = (i, j) {
                                self.panel.set(i, j, 0.5 * value);
                            }
                        }
                    }
                }
            }
        }
    }

    /// The least that a row's pivot may be: what rounding leaves, and next to nothing of what it is on the
    /// neighbouring lines, so that a row on which the noise has no say keeps a finite weight.
    fn floors(&mut self, equations: usize) {
        self.panel.floors(&mut self.least);
        for (k, row) in self.rows.iter().enumerate() {
            let at = |line: usize| (line * 2 + usize::from(row.im)) * equations + row.equation;
            let near = [row.line.checked_sub(1), Some(row.line + 1)].into_iter().flatten();
            let places = near.filter_map(|line| self.place.get(at(line)).copied().flatten());
            let most = places.map(|i| self.panel.get(i, i)).fold(0.0, f64::max);
            self.least[k] = self.least[k].max(SILENT * most);
        }
    }

    /// Orthonormal transient columns from those whitened at column `at`, and the residual beside them.
    fn take_out(&mut self, at: usize) {
        let (rows, nt) = (self.rows.len(), self.transient.len());
        self.whitened.resize_with(nt, Vec::new);
        for (c, column) in self.whitened.iter_mut().enumerate() {
            column.clear();
            column.extend((0..rows).map(|i| self.panel.get(i, at + c)));
        }
        orthonormal(&self.whitened, rows, &mut self.base);
        self.residual.clear();
        self.residual.extend((0..rows).map(|i| self.panel.get(i, at + nt)));
        project(&self.base, &mut self.residual);
    }

    /// Columns ∂/∂θ of the rows, whitened as [`Spot::evaluate`] left it; the transient is not taken out.
    pub fn jacobian(
        &mut self,
        isa: Isa,
        e: &Equations,
        pairs: &Pairs,
        values: &[f64],
        lags: &[f64],
        factors: LeftColumns,
    ) {
        self.denoise(pairs, lags, factors);
        let (count, equations) = (self.count(), e.orders.len());
        let rows = self.rows.len();
        let mut lines = std::mem::take(&mut self.lambda);
        self.more.resize(rows, e.parameters);
        let (g, slopes) = values.split_at(e.terms.len());
        for k in 0..e.parameters {
            lines.clear();
            lines.resize(2 * equations * count, 0.0);
            let mut add = |equation: usize, order: usize, signal: usize, by: f64| {
                let values = self.denoised[signal].iter().zip(&self.powers[order]);
                let to = lines[2 * equation * count..].chunks_exact_mut(2);
                for ((v, p), to) in values.zip(to) {
                    let value = *p * *v * by;
                    to[0] += value.0;
                    to[1] += value.1;
                }
            };
            for ((t, _), slope) in e.slopes.iter().zip(slopes).filter(|((_, own), _)| *own == k) {
                let term = e.terms[*t];
                add(term.equation, term.order, term.signal, *slope);
            }
            for (s, _, to) in e.signal_slopes.iter().filter(|(_, own, _)| *own == k) {
                for (term, g) in e.terms.iter().zip(g).filter(|(t, _)| t.signal == *s) {
                    add(term.equation, term.order, *to, *g);
                }
            }
            for (s, _) in e.free_lags().filter(|(_, own)| *own == k) {
                for (term, g) in e.terms.iter().zip(g).filter(|(t, _)| t.signal == s) {
                    add(term.equation, term.order + 1, s, -*g);
                }
            }
            for (i, row) in self.rows.iter().enumerate() {
                let value = lines[2 * (row.equation * count + row.line) + usize::from(row.im)];
                self.more.set(i, k, value);
            }
        }
        self.lambda = lines;
        match self.weights {
            RowWeights::Flat => {
                for (i, sd) in self.flat.iter().enumerate() {
                    for k in 0..e.parameters {
                        self.more.set(i, k, self.more.get(i, k) / sd);
                    }
                }
            }
            RowWeights::Adapted => whiten_more(isa, &self.panel, &mut self.more),
        }
        for (k, column) in self.columns.iter_mut().enumerate() {
            for (i, to) in column.iter_mut().enumerate() {
                *to = self.more.get(i, k);
            }
        }
    }

    /// How many rows the lines up to and including `last` have.
    pub fn rows_up_to(&self, last: usize) -> usize {
        self.rows.iter().take_while(|r| r.line + self.lines.first <= last).count()
    }

    /// Columns of θ with the transient taken out, on the first `rows` rows alone.
    pub fn projected(&self, rows: usize, out: &mut Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut base = Vec::new();
        orthonormal(&self.whitened, rows, &mut base);
        out.resize_with(self.columns.len(), Vec::new);
        for (to, from) in out.iter_mut().zip(&self.columns) {
            to.clear();
            to.extend_from_slice(&from[..rows]);
            project(&base, to);
        }
        base
    }

    /// The base of the whitened transient columns on all rows.
    pub fn base(&self) -> &[Vec<f64>] {
        &self.base
    }

    /// Removes what the transient explains.
    pub fn project(&self, column: &mut [f64]) {
        project(&self.base, column);
    }

    /// Standard deviation of each row under flat weights.
    pub fn flat(&self) -> &[f64] {
        &self.flat
    }

    /// (iω)^k on the lines in use.
    pub fn power(&self, k: usize) -> &[C] {
        &self.powers[k]
    }
}

/// e^{−ix}.
fn late(x: f64) -> C {
    let (sin, cos) = crate::math::sin_cos_turns_1(-x / std::f64::consts::TAU);
    C(cos, sin)
}

/// Polynomials of iω with the parity of their degree, real factors: T_k(x) of Chebyshev.
fn chebyshev(k: usize, x: f64) -> f64 {
    let (mut before, mut own) = (1.0, x);
    if k == 0 {
        return 1.0;
    }
    for _ in 1..k {
        (before, own) = (own, 2.0 * x * own - before);
    }
    own
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Orthonormal base of the first `rows` of the columns, dependent ones left out; each is cleaned twice.
pub(crate) fn orthonormal(columns: &[Vec<f64>], rows: usize, base: &mut Vec<Vec<f64>>) {
    base.clear();
    for column in columns {
        let mut own = column[..rows].to_vec();
        let size = dot(&own, &own).sqrt();
        for _ in 0..2 {
            project(base, &mut own);
        }
        let left = dot(&own, &own).sqrt();
        if left > DEPENDENT * size {
            for x in &mut own {
                *x /= left;
            }
            base.push(own);
        }
    }
}

/// Removes what an orthonormal base explains.
pub(crate) fn project(base: &[Vec<f64>], column: &mut [f64]) {
    for b in base {
        let along = dot(b, column);
        for (x, b) in column.iter_mut().zip(b) {
            *x -= along * b;
        }
    }
}
