//! `ls`: least squares on the differenced rows (report, eqs. 14–19), and the covariance of such an estimate.
//!
//! ```text
//! J(θ) = Σ_m |Δⁿ Q(m; θ)|²,   Gauss–Newton steps where Q is not linear in θ.
//! ```

use super::descent::Ended;
use super::iterate::TermsProblem;
use super::rows::{DEPENDENT, Row, Spot};
use crate::error::{Error, Status};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::linalg::columns::Columns;
use crate::modulation::{difference_weights, rows};
use crate::simd::Isa;
use crate::structure::Trend;
use crate::threads::stopped;

/// Δⁿ of the rows of one record: a row of (row, factor) each; the drift's columns behind those of line 0.
struct Differences {
    rows: Vec<Vec<(usize, f64)>>,
    nuisance: Vec<Vec<f64>>,
}

impl Differences {
    fn new(spot: &Spot, orders: &[usize], trend: Trend) -> Differences {
        let mut out = Differences { rows: Vec::new(), nuisance: Vec::new() };
        let first = spot.lines.first;
        for (equation, order) in orders.iter().enumerate() {
            let weights = difference_weights(*order);
            // Line 0 that a trend leaves out is a column of its own, not a lower edge.
            let all = rows(*order, spot.lowest, spot.lines.last, true);
            let mut constant = vec![0.0; out.rows.len()];
            for m in all.first..=all.last {
                for im in [false, true] {
                    if im && m == all.first && all.first_is_real {
                        continue;
                    }
                    let mut row = Vec::new();
                    let mut missing = 0.0;
                    for (j, c) in weights.iter().enumerate() {
                        let line = m + j as isize;
                        let at = line.unsigned_abs();
                        if at < first {
                            missing += if im { 0.0 } else { *c };
                            continue;
                        }
                        let wanted = Row { line: at - first, im, equation };
                        let sign = if im && line < 0 { -*c } else { *c };
                        if let Some(k) = spot.rows.iter().position(|r| *r == wanted) {
                            row.push((k, sign));
                        }
                    }
                    out.rows.push(row);
                    constant.push(missing);
                }
            }
            if constant.iter().any(|c| *c != 0.0) {
                out.nuisance.push(constant);
            }
            if trend == Trend::Linear {
                let drift: Vec<f64> = spot
                    .rows
                    .iter()
                    .map(|r| match r.equation == equation && r.im {
                        true => 1.0 / (r.line + first) as f64,
                        false => 0.0,
                    })
                    .collect();
                let column = out.of(&drift);
                out.nuisance.push(column);
            }
        }
        for column in &mut out.nuisance {
            column.resize(out.rows.len(), 0.0);
        }
        out
    }

    fn of(&self, values: &[f64]) -> Vec<f64> {
        let each = self.rows.iter();
        each.map(|row| row.iter().map(|(k, c)| c * values[*k]).sum()).collect()
    }

    fn transposed(&self, values: &[f64], size: usize) -> Vec<f64> {
        let mut out = vec![0.0; size];
        for (row, value) in self.rows.iter().zip(values) {
            for (k, c) in row {
                out[*k] += c * value;
            }
        }
        out
    }

    /// Takes the nuisance columns out of a differenced one.
    fn clean(&self, isa: Isa, column: &mut Vec<f64>) {
        let rows = column.len();
        let mut base = Columns::new(isa, rows, self.nuisance.len()).judged_by(DEPENDENT);
        for own in &self.nuisance {
            base.push_rows(own);
        }
        column.resize(base.rows(), 0.0);
        base.project(0, column, &mut vec![0.0; self.nuisance.len()]);
        column.truncate(rows);
    }
}

impl TermsProblem<'_> {
    /// The estimate by least squares on the differenced rows.
    pub(crate) fn differenced(&mut self, tol: f64, maxiter: usize) -> Result<Ended, Error> {
        let mut theta = self.begin(None)?;
        let mut ended = Status::MaxIter;
        let (mut nit, mut at_bound) = (0, vec![false; theta.len()]);
        while (nit as usize) < maxiter && !stopped() {
            self.cost(&theta, RowWeights::Flat)?;
            self.jacobian(LeftColumns::Data);
            self.difference();
            self.step(&theta);
            let step = self.last_step();
            nit += 1;
            if !step.full || !step.moved.is_finite() {
                let sound = self.residual.iter().all(|x| x.is_finite());
                ended = if sound { Status::Rank } else { Status::NonFinite };
                break;
            }
            for (t, by) in theta.iter_mut().zip(&step.by) {
                *t += by;
            }
            at_bound.clone_from(&step.at_bound);
            let moved = step.moved;
            self.fitter.o.equations.clip(&mut theta);
            if moved < tol || self.fitter.o.equations.linear {
                ended = Status::Ok;
                break;
            }
        }
        let cost = self.cost(&theta, RowWeights::Flat)?;
        Ok(Ended { theta, cost, status: ended, nit, at_bound })
    }

    /// Replaces columns and residual of the lines by those of the differenced rows.
    fn difference(&mut self) {
        let o = &self.fitter.o;
        let (mut columns, mut residual) = (vec![Vec::new(); self.columns.len()], Vec::new());
        for spot in &self.spots {
            let d = Differences::new(spot, &o.equations.orders, o.trend);
            for (to, from) in columns.iter_mut().zip(&spot.columns) {
                let mut own = d.of(&unweighted(spot, from));
                d.clean(self.fitter.isa, &mut own);
                to.extend(own);
            }
            let error = spot.rows.iter().map(|r| {
                let q = &spot.error[r.equation];
                if r.im { q.im[r.line] } else { q.re[r.line] }
            });
            let mut own = d.of(&error.collect::<Vec<f64>>());
            d.clean(self.fitter.isa, &mut own);
            residual.extend(own);
        }
        self.columns = columns;
        self.residual = residual;
    }

    /// Instruments of the lines, DᵀDΓ, in units of their standard deviations.
    pub(crate) fn instruments(&self) -> Vec<Vec<f64>> {
        let o = &self.fitter.o;
        let mut out = vec![Vec::new(); self.columns.len()];
        for spot in &self.spots {
            let d = Differences::new(spot, &o.equations.orders, o.trend);
            for (to, from) in out.iter_mut().zip(&spot.columns) {
                let mut own = d.of(&unweighted(spot, from));
                d.clean(self.fitter.isa, &mut own);
                let back = d.transposed(&own, spot.rows.len());
                to.extend(back.iter().zip(spot.flat()).map(|(z, sd)| z * sd));
            }
        }
        out
    }
}

/// A column of the lines before it was divided by its rows' standard deviations.
fn unweighted(spot: &Spot, column: &[f64]) -> Vec<f64> {
    column.iter().zip(spot.flat()).map(|(x, sd)| x * sd).collect()
}
