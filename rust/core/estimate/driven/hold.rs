//! What leverage leaves of each line, and what does not move.

use super::small::{add_outer, gather};
use super::{Block, Driven, LEFT, Linear};
use crate::linalg::columns::Columns;

impl Driven {
    /// What leverage leaves of each line's rows, and by how much the residual is less than that.
    pub(super) fn leverages(&mut self) {
        let q = self.outputs;
        self.over.fill(0.0);
        for block in &self.blocks {
            let count = block.sampled.lines;
            for i in 0..count {
                let own = &mut self.lines[block.line + i];
                let rows = (0..2 * q).map(|e| block.row + e * count + i);
                let taken: f64 = rows.map(|row| leverage(block, &self.mean, row)).sum();
                own.left = (own.count - taken / q as f64).max(LEFT);
                let e = &mut self.space.e;
                gather(&self.residual[block.row..], own.count, e, (count, i));
                let over = &mut self.over[(block.line + i) * q * q..][..q * q];
                over[..q].fill(own.left);
                add_outer(e, e, -own.count, over);
            }
        }
    }

    /// Levels of 0 of which the equations ask for less stay, as do parameters that are pushed against a bound.
    pub(super) fn hold(&mut self, model: &impl Linear, theta: &[f64], levels: &[f64]) {
        let (q, p, all) = (self.outputs, self.parameters, self.residual.len());
        let part = self.over.len();
        let falls = |slopes: &[f64]| slopes.iter().zip(&self.over).map(|(a, b)| a * b).sum::<f64>();
        let slopes = self.slopes.chunks(part);
        let held = slopes.zip(&mut self.held).enumerate().map(|(k, (own, held))| (k, own, held));
        for (unknown, slopes, held) in held {
            let falls = falls(slopes);
            let Some(at) = theta.get(unknown) else {
                let level = unknown - p;
                let absent = level < q && !model.measured();
                *held = absent || (levels[level] == 0.0 && falls >= 0.0);
                continue;
            };
            let own = self.jacobian[unknown * all..][..all].iter().zip(&self.residual);
            let own = own.map(|(a, b)| a * b).sum::<f64>() + self.known.pull(unknown);
            let falls = falls + 2.0 * own;
            let (low, high) = model.bounds(unknown);
            *held = (*at <= low && falls >= 0.0) || (*at >= high && falls <= 0.0);
        }
    }
}

/// Leverage of a row, that of the transient and that of θ.
fn leverage(block: &Block, mean: &Columns, row: usize) -> f64 {
    let square = |q: &Columns, row: usize| -> f64 {
        (0..q.count()).map(|j| q.q(j)[row] * q.q(j)[row]).sum()
    };
    square(&block.transient, row - block.row) + square(mean, row)
}
