//! The rows of one record at one θ: equation error, its covariance, what whitens them, and the Jacobian.
//!
//! A row is Re or Im of an equation on a line. With λ = C⁻¹r the noise that best explains the residual r is
//! v̂ = ΣLᵀλ; J is made of the signals without it, E − (∂E/∂v)v̂, which makes Jᵀ C⁻¹ r the exact gradient of
//! ½ rᵀC(θ)⁻¹r (docs/core.md, "Terms").

mod colour;
mod covariance;
mod denoised;
mod eight;

use super::complex::{C, Power, Split, late};
use super::equations::Equations;
use super::lines::{LinesWorkspace, Pairs, Spectra};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::linalg::columns::Columns;
use crate::linalg::dense::{Panel, floor, whiten, whiten_more};
use crate::linalg::qr::dot;
use crate::math::ln_1;
use crate::modulation::Lines;
use crate::simd::{Isa, LANES, Wide};
use crate::structure::Trend;
use covariance::Entries;
pub(crate) use eight::{Eight, Shared};

/// Variance of a row on which noise has no say, over that of its neighbours.
const SILENT: f64 = 1e-9;
/// A transient column of which less than this is left beside the ones before is one of them.
pub(crate) const DEPENDENT: f64 = 1e-10;

/// What one worker keeps from one problem to the next.
#[derive(Default)]
pub(crate) struct TermsWorkspace {
    pub space: LinesWorkspace,
    /// Rows of the last problem, for one on the same lines.
    pub spots: Vec<Spot>,
}

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
    /// The rows of the neighbouring lines; twice the one there is at the edges.
    near: Vec<[usize; 2]>,
    /// (iω)^k of each line.
    powers: Vec<Power>,
    /// Transient and drift columns, row major.
    transient: Vec<f64>,
    /// Unknowns besides θ.
    pub transients: usize,
    /// Standard deviation of a row under flat weights.
    flat: Vec<f64>,
    pub spectra: Spectra,
    /// Root of the noise's power on the lines over its mean, of each noisy channel; none if white.
    pub colours: Vec<Vec<f64>>,
    /// L on the lines, of each equation and noisy signal.
    loads: Vec<Split>,
    /// Equation error on the lines, of each equation.
    pub error: Vec<Split>,
    entries: Entries,
    panel: Panel,
    more: Panel,
    pivots: Vec<f64>,
    least: Vec<f64>,
    /// Orthonormal base of the whitened transient columns; a column filled up, and its shares of them.
    base: Columns,
    filled: Vec<f64>,
    shares: Vec<f64>,
    /// Whitened residual, the transient's part taken out.
    pub residual: Vec<f64>,
    /// Whitened columns of θ, transient not taken out.
    pub columns: Vec<Vec<f64>>,
    /// C⁻¹r.
    lambda: Vec<Wide>,
    /// z of each noisy signal, see [`Spot::find_sources`].
    pub sources: Vec<Split>,
    /// Lines of one signal's noise, and of all signals without theirs.
    noise: Vec<Wide>,
    denoised: Vec<Split>,
    /// A column of θ on the lines, of each equation.
    slopes: Vec<Split>,
    weights: RowWeights,
}

impl Spot {
    pub fn new(isa: Isa, e: &Equations, lines: Lines, trend: Trend, flat: &[f64]) -> Spot {
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
        let near = rows.iter().enumerate().map(|(k, row)| {
            let at = |line: usize| (line * 2 + usize::from(row.im)) * equations + row.equation;
            let there = |line: usize| place.get(at(line)).copied().flatten();
            let (before, after) = (row.line.checked_sub(1).and_then(there), there(row.line + 1));
            let one = before.or(after).unwrap_or(k);
            [before.unwrap_or(one), after.unwrap_or(one)]
        });
        let near = near.collect();
        let highest = e.orders.iter().copied().max().unwrap_or(0);
        let omega = |line: usize| (line + first) as f64 * lines.omega0;
        // One power more than the equations have: a delay's slope is −s V.
        let powers = (0..=highest + 1).map(|k| Power::new(k, (0..count).map(omega))).collect();
        let edge = lines.last as f64;
        let mut transient: Vec<Vec<f64>> = Vec::new();
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
        let transients = transient.len();
        let across = (0..rows.len()).flat_map(|i| transient.iter().map(move |c| c[i])).collect();
        let share = |r: &Row| if r.line + first == 0 { 1.0 } else { 0.5 };
        let flat = rows
            .iter()
            .map(|r| (share(r) * lines.unit_variance * flat[r.equation]).sqrt())
            .collect();
        Spot {
            lowest,
            lines,
            near,
            powers,
            transient: across,
            transients,
            flat,
            spectra: Spectra::default(),
            colours: Vec::new(),
            loads: Vec::new(),
            error: vec![Split::zeros(count); equations],
            entries: Entries::default(),
            panel: Panel::default(),
            more: Panel::default(),
            pivots: Vec::new(),
            least: Vec::new(),
            base: Columns::new(isa, rows.len(), transients).judged_by(DEPENDENT),
            filled: vec![0.0; rows.len().next_multiple_of(LANES)],
            shares: vec![0.0; transients],
            residual: vec![0.0; rows.len()],
            columns: vec![vec![0.0; rows.len()]; e.parameters],
            lambda: Vec::new(),
            sources: Vec::new(),
            noise: Vec::new(),
            denoised: Vec::new(),
            slopes: vec![Split::zeros(count); equations],
            weights: RowWeights::Flat,
            rows,
        }
    }

    /// Whether these are the rows of such lines.
    pub fn of(&self, lines: Lines) -> bool {
        (self.lowest, self.lines.last, self.lines.omega0) == (lines.first, lines.last, lines.omega0)
    }

    fn count(&self) -> usize {
        self.lines.count()
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
        let (rows, width) = (self.rows.len(), self.transients + 1);
        match weights {
            RowWeights::Flat => {
                self.panel.resize(rows, width);
                self.fill_columns(0);
                for (i, sd) in self.flat.iter().enumerate() {
                    for x in &mut self.panel.row_mut(i)[..width] {
                        *x /= sd;
                    }
                }
                self.take_out(0);
            }
            RowWeights::Adapted => {
                self.panel.resize(rows, rows + width);
                self.load_lines(e, pairs, g, lags);
                self.covariance(isa, e.orders.len(), pairs);
                self.fill_columns(rows);
                self.floors();
                whiten(isa, &mut self.panel, &self.least);
                self.take_out(rows);
            }
        }
        dot(&self.residual, &self.residual)
    }

    /// log det of the rows' covariance where [`Spot::evaluate`] last took adapted weights.
    pub fn log_det(&self) -> f64 {
        (0..self.rows.len()).map(|i| 2.0 * ln_1(self.panel.row(i)[i])).sum()
    }

    /// Σ g s^k V of each equation.
    fn errors(&mut self, e: &Equations, g: &[f64]) {
        let (count, first) = (self.count(), self.lines.first);
        for to in &mut self.error {
            to.clear(count);
        }
        for (term, g) in e.terms.iter().zip(g) {
            let values = &self.spectra.signals[term.signal];
            self.powers[term.order].add_times(*g, values, first, &mut self.error[term.equation]);
        }
    }

    /// Writes transient columns and the equation error from column `at` on.
    fn fill_columns(&mut self, at: usize) {
        let nt = self.transients;
        for (i, (row, to)) in self.rows.iter().zip(self.panel.rows_mut()).enumerate() {
            // Behind the columns zeros: a NaN that stood there would stay, and reach rows that are solved for.
            to[at + nt + 1..].fill(0.0);
            let (to, error) = to[at..=at + nt].split_at_mut(nt);
            for (to, t) in to.iter_mut().zip(&self.transient[i * nt..]) {
                *to = *t;
            }
            error[0] = self.error[row.equation].part(row.im)[row.line];
        }
    }

    /// How noise on each noisy signal's own coefficient enters each equation: Σ g s^k e^{−s lag}.
    fn load_lines(&mut self, e: &Equations, pairs: &Pairs, g: &[f64], lags: &[f64]) {
        let (count, first) = (self.count(), self.lines.first);
        let own = pairs.noisy.len();
        self.loads.resize_with(e.orders.len() * own, Split::default);
        for to in &mut self.loads {
            to.clear(count);
        }
        for (term, g) in e.terms.iter().zip(g) {
            let Some(at) = pairs.noisy.iter().position(|s| *s == term.signal) else { continue };
            self.powers[term.order].add(*g, &mut self.loads[term.equation * own + at]);
        }
        for (at, s) in pairs.noisy.iter().enumerate().filter(|(_, s)| lags[**s] != 0.0) {
            for equation in 0..e.orders.len() {
                let to = &mut self.loads[equation * own + at];
                for line in 0..count {
                    let turn = late((line + first) as f64 * self.lines.omega0 * lags[*s]);
                    to.set(line, to.get(line) * turn);
                }
            }
        }
        self.colour_loads(e, pairs);
    }

    /// The least that a row's pivot may be: what rounding leaves, and next to nothing of what it is on the
    /// neighbouring lines, so that a row on which the noise has no say keeps a finite weight.
    fn floors(&mut self) {
        self.pivots.clear();
        self.pivots.extend(self.panel.diagonal());
        self.least.clear();
        let own = self.pivots.iter().map(|pivot| floor(*pivot));
        self.least.extend(
            own.zip(&self.near)
                .map(|(least, [a, b])| least.max(SILENT * self.pivots[*a].max(self.pivots[*b]))),
        );
    }

    /// Orthonormal transient columns from those whitened at column `at`, and the residual beside them.
    fn take_out(&mut self, at: usize) {
        let (rows, nt) = (self.rows.len(), self.transients);
        span(&mut self.base, &self.panel, at, rows);
        // Behind the rows zeros, whatever stood there: a NaN would stay for good.
        self.filled.fill(0.0);
        let whole = self.panel.column(at + nt);
        self.filled.iter_mut().zip(whole).for_each(|(to, x)| *to = x);
        self.base.project(0, &mut self.filled, &mut self.shares);
        self.residual.copy_from_slice(&self.filled[..rows]);
    }

    /// Takes what the transient explains out of a whitened column.
    pub fn take_transient(&mut self, column: &mut [f64]) {
        self.filled.fill(0.0);
        self.filled[..column.len()].copy_from_slice(column);
        self.base.project(0, &mut self.filled, &mut self.shares);
        column.copy_from_slice(&self.filled[..column.len()]);
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
        self.denoise(isa, e, pairs, lags, factors);
        let count = self.count();
        self.more.resize(self.rows.len(), e.parameters);
        let (g, slopes) = values.split_at(e.terms.len());
        for k in 0..e.parameters {
            for to in &mut self.slopes {
                to.clear(count);
            }
            let mut add = |equation: usize, order: usize, signal: usize, by: f64| {
                let values = &self.denoised[signal];
                self.powers[order].add_times(by, values, 0, &mut self.slopes[equation]);
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
            for (row, to) in self.rows.iter().zip(self.more.rows_mut()) {
                to[k] = self.slopes[row.equation].part(row.im)[row.line];
            }
        }
        match self.weights {
            RowWeights::Flat => {
                for (i, sd) in self.flat.iter().enumerate() {
                    for x in &mut self.more.row_mut(i)[..e.parameters] {
                        *x /= sd;
                    }
                }
            }
            RowWeights::Adapted => whiten_more(isa, &self.panel, &mut self.more),
        }
        for (k, column) in self.columns.iter_mut().enumerate() {
            column.clear();
            column.extend(self.more.column(k));
        }
    }

    /// How many rows the lines up to and including `last` have.
    pub fn rows_up_to(&self, last: usize) -> usize {
        self.rows.iter().take_while(|r| r.line + self.lines.first <= last).count()
    }

    /// Appends the columns of θ with the transient taken out, on the first `rows` rows alone; how many columns
    /// were taken out.
    pub fn projected(&self, isa: Isa, rows: usize, out: &mut [Vec<f64>]) -> usize {
        let at = match self.weights {
            RowWeights::Flat => 0,
            RowWeights::Adapted => self.rows.len(),
        };
        let mut base = Columns::new(isa, rows, self.transients).judged_by(DEPENDENT);
        span(&mut base, &self.panel, at, rows);
        let (mut own, mut shares) = (vec![0.0; base.rows()], vec![0.0; self.transients]);
        for (to, from) in out.iter_mut().zip(&self.columns) {
            own[..rows].copy_from_slice(&from[..rows]);
            base.project(0, &mut own, &mut shares);
            to.extend_from_slice(&own[..rows]);
        }
        (0..base.count()).filter(|c| base.r(*c, *c) > 0.0).count()
    }

    /// Orthonormal columns that span the whitened transient.
    pub fn base(&self) -> impl Iterator<Item = &[f64]> {
        (0..self.base.count()).map(|c| &self.base.q(c)[..self.rows.len()])
    }

    /// (iω)^order on a line.
    pub fn power(&self, line: usize, order: usize) -> (f64, f64) {
        self.powers[order].at(line)
    }

    /// e^{−iω lag} on a line.
    pub fn turn(&self, line: usize, lag: f64) -> (f64, f64) {
        if lag == 0.0 {
            return (1.0, 0.0);
        }
        let C(re, im) = late((line + self.lines.first) as f64 * self.lines.omega0 * lag);
        (re, im)
    }

    /// Coefficient of a signal on a line.
    pub fn signal(&self, signal: usize, line: usize) -> (f64, f64) {
        let C(re, im) = self.spectra.signals[signal].get(line + self.lines.first);
        (re, im)
    }

    /// A column of the transient in each equation on a line.
    pub fn transient(&self, line: usize, column: usize, to: &mut [(f64, f64)]) {
        let from_zero = usize::from(self.lines.first == 0);
        let first = (2 * line - from_zero * usize::from(line > 0)) * to.len();
        let at = |row: usize| self.transient[row * self.transients + column];
        let real = from_zero == 1 && line == 0;
        let equations = to.len();
        for (equation, to) in to.iter_mut().enumerate() {
            let im = if real { 0.0 } else { at(first + equations + equation) };
            *to = (at(first + equation), im);
        }
    }

    /// Standard deviation of each row under flat weights.
    pub fn flat(&self) -> &[f64] {
        &self.flat
    }

    /// Adds to each line `by` (iω)^k V of a signal.
    pub fn add(&self, signal: usize, order: usize, by: f64, to: &mut Split) {
        let values = &self.spectra.signals[signal];
        self.powers[order].add_times(by, values, self.lines.first, to);
    }
}

/// Makes it the base of the first `rows` of the transient columns that stand whitened from column `at` on.
fn span(base: &mut Columns, panel: &Panel, at: usize, rows: usize) {
    let transients = base.capacity();
    base.truncate(0);
    for c in 0..transients {
        let own = panel.column(at + c).take(rows);
        base.push(|to| to.iter_mut().zip(own).for_each(|(to, x)| *to = x));
    }
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
