//! One step of a single problem: orthogonal factors of each output's own columns, coupled by Σ⁻¹.
//!
//! With L_i = Q_i R_i the left columns of output i of a record, Γ_j and g_j the right ones, and P = Σ⁻¹, the step
//! solves Lᵀ (P ⊗ 1) (Γ x − g) = 0. Where each unknown stands in one block and moves, the factors R_i drop out:
//!
//! ```text
//! Σ_j P_ij (Q_iᵀ Γ_j) x_j = Σ_j P_ij Q_iᵀ g_j.
//! ```
//!
//! Unknowns that outputs or records share, or that are held, leave S = \[R_1; R_2; …\] with the columns of what moves:
//! its orthogonal factor takes the part of the R_i. The condition enters once, whatever the case.

use super::super::design::JointDesign;
use super::super::tile::Block;
use super::super::workspace::JointWorkspace;
use crate::linalg::large::{Lu, Qr, transposed_product};
use crate::linalg::qr::dot;
use crate::simd::{LANES, numbers, numbers_mut};

/// Relative size below which a column is a combination of the others.
pub(super) const RANK: f64 = 1e-13;

/// What the blocks of all records give to the system of a step, and the system.
pub(super) struct System {
    blocks: Vec<Block>,
    qr: Qr,
    lu: Option<(Lu, usize)>,
    /// Q of a block; and of each record and block, R and QᵀΓ, Qᵀg of every block of that record.
    q: Vec<f64>,
    triangles: Vec<Vec<f64>>,
    products: Vec<Vec<f64>>,
    /// Squared sizes of the right columns of each record and block, the target's last.
    sizes: Vec<Vec<f64>>,
    /// Sums of products of the outputs' residuals over all records.
    pub squares: Vec<f64>,
    full: bool,
}

/// What a step found: unknowns (transients of each record, θ), and whether the columns were independent.
pub(super) struct Found {
    pub unknowns: Vec<f64>,
    pub full: bool,
}

impl System {
    pub fn new(d: &JointDesign, blocks: Vec<Block>) -> System {
        let count = blocks.len() * d.records.len();
        let widest = blocks.iter().map(|b| b.columns.len() * b.height).max().unwrap_or(0);
        System {
            qr: Qr::default(),
            lu: None,
            q: vec![0.0; widest * LANES],
            triangles: vec![Vec::new(); count],
            products: vec![Vec::new(); count * blocks.len()],
            sizes: vec![Vec::new(); count],
            squares: vec![0.0; d.outputs() * d.outputs()],
            full: true,
            blocks,
        }
    }

    pub fn begin(&mut self) {
        self.full = true;
        self.squares.fill(0.0);
    }

    /// Factors the rows of record `k` that stand in the workspace; `coupled`: Σ may have more than its diagonal.
    pub fn add_record(&mut self, w: &mut JointWorkspace, k: usize, coupled: bool) {
        self.add_residual(w);
        let System { blocks, qr, q, triangles, products, sizes, full, .. } = self;
        let count = blocks.len();
        for (a, block) in blocks.iter().enumerate() {
            let (rows, p) = (block.height * LANES, block.columns.len());
            let left = &mut w.left.all[block.from..block.from + p * block.height];
            let left = numbers_mut(left);
            qr.factor(left, rows, p);
            let triangle = &mut triangles[k * count + a];
            triangle.clear();
            triangle.resize(p * p, 0.0);
            for (j, column) in triangle.chunks_exact_mut(p.max(1)).enumerate() {
                column[..=j].copy_from_slice(&left[j * rows..=j * rows + j]);
            }
            *full &= independent(triangle, p);
            let q = &mut q[..rows * p];
            qr.q(left, rows, p, q);
            for (b, other) in blocks.iter().enumerate() {
                if a != b && !coupled {
                    continue;
                }
                let width = other.columns.len() + 1;
                let right = &w.right.all[other.from..other.from + width * other.height];
                let to = &mut products[(k * count + a) * count + b];
                to.resize(p * width, 0.0);
                transposed_product(q, numbers(right), rows, (p, width), to);
            }
            let right = &w.right.all[block.from..block.from + (p + 1) * block.height];
            let own = numbers(right).chunks_exact(rows);
            sizes[k * count + a] = own.map(|column| dot(column, column)).collect();
        }
    }

    /// Adds the products of the outputs' residuals that stand in the workspace.
    pub fn add_residual(&mut self, w: &JointWorkspace) {
        let outputs = self.squares.len().isqrt();
        let residual = numbers(&w.residual.all);
        let each = residual.len() / outputs.max(1);
        for i in 0..outputs {
            for j in 0..=i {
                let (a, b) = (&residual[i * each..][..each], &residual[j * each..][..each]);
                let sum = self.squares[i * outputs + j] + dot(a, b);
                self.squares[i * outputs + j] = sum;
                self.squares[j * outputs + i] = sum;
            }
        }
    }

    /// Squared sizes of θ's columns, and of the target, each output's rows counted by the diagonal of P.
    pub fn column_sizes(&self, d: &JointDesign, coupling: &[f64], sizes: &mut Vec<f64>) -> f64 {
        let (nt, q) = (d.transient.len(), d.outputs());
        sizes.clear();
        sizes.resize(d.parameters(), 0.0);
        let mut target = 0.0;
        for (own, block) in self.sizes.iter().zip(self.blocks.iter().cycle()) {
            let by = self.coupled(block, block, coupling, q);
            for (c, size) in block.columns.iter().zip(own) {
                if *c >= nt {
                    sizes[c - nt] += by * size;
                }
            }
            target += by * own.last().copied().unwrap_or(0.0);
        }
        target
    }

    /// P between two blocks: one where a block holds all outputs, whitened together.
    fn coupled(&self, a: &Block, b: &Block, coupling: &[f64], outputs: usize) -> f64 {
        match (&a.outputs[..], &b.outputs[..]) {
            ([i], [j]) if self.blocks.len() > 1 || outputs == 1 => coupling[i * outputs + j],
            _ => 1.0,
        }
    }

    /// Number of an unknown of record `k`: transients of all records, then θ.
    fn place(d: &JointDesign, k: usize, column: usize) -> usize {
        let nt = d.transient.len();
        if column < nt { k * nt + column } else { d.records.len() * nt + column - nt }
    }

    /// Solves for all unknowns but those that are `pinned` to a value; `priors` are rows of one unknown each: which,
    /// its factor, the target.
    pub fn solve(
        &mut self,
        d: &JointDesign,
        coupling: &[f64],
        pinned: &[Option<f64>],
        priors: &[(usize, f64, f64)],
    ) -> Found {
        let (count, records, q) = (self.blocks.len(), d.records.len(), d.outputs());
        let all = pinned.len();
        let moving: Vec<usize> = (0..all).filter(|k| pinned[*k].is_none()).collect();
        let n = moving.len();
        let own: usize = self.blocks.iter().map(|b| b.columns.len()).sum();
        let tall = records * own + priors.len();
        // Rows of all blocks, one after another; columns of all unknowns and the target.
        let mut system = vec![0.0; tall * (all + 1)];
        let mut row = 0;
        for k in 0..records {
            for (a, block) in self.blocks.iter().enumerate() {
                let p = block.columns.len();
                for (b, other) in self.blocks.iter().enumerate() {
                    let by = self.coupled(block, other, coupling, q);
                    let own = &self.products[(k * count + a) * count + b];
                    if by == 0.0 || own.is_empty() {
                        continue;
                    }
                    let places = other.columns.iter().map(|c| System::place(d, k, *c));
                    for (c, from) in places.chain([all]).zip(own.chunks_exact(p.max(1))) {
                        let to = &mut system[c * tall + row..][..p];
                        for (to, from) in to.iter_mut().zip(from) {
                            *to += by * from;
                        }
                    }
                }
                row += p;
            }
        }
        for (at, (unknown, by, target)) in priors.iter().enumerate() {
            system[unknown * tall + row + at] = *by;
            system[all * tall + row + at] = *target;
        }
        let mut unknowns: Vec<f64> = pinned.iter().map(|value| value.unwrap_or(0.0)).collect();
        let (before, target) = system.split_at_mut(all * tall);
        for (value, column) in unknowns.iter().zip(before.chunks_exact(tall.max(1))) {
            if *value != 0.0 {
                for (to, from) in target.iter_mut().zip(column) {
                    *to -= value * from;
                }
            }
        }
        let mut full = self.full;
        let (mut matrix, mut right) = (Vec::with_capacity(n * n), target.to_vec());
        for c in &moving {
            matrix.extend_from_slice(&before[c * tall..(c + 1) * tall]);
        }
        if n < tall || n < all {
            // The span of the left columns of what moves.
            let mut basis = vec![0.0; tall * n];
            let mut slot = vec![None; all];
            for (to, c) in moving.iter().enumerate() {
                slot[*c] = Some(to);
            }
            let mut row = 0;
            for k in 0..records {
                for (a, block) in self.blocks.iter().enumerate() {
                    let p = block.columns.len();
                    let own = self.triangles[k * count + a].chunks_exact(p.max(1));
                    for (c, from) in block.columns.iter().zip(own) {
                        if let Some(to) = slot[System::place(d, k, *c)] {
                            basis[to * tall + row..][..p].copy_from_slice(from);
                        }
                    }
                    row += p;
                }
            }
            for (at, (unknown, by, _)) in priors.iter().enumerate() {
                if let Some(to) = slot[*unknown] {
                    basis[to * tall + row + at] = *by;
                }
            }
            self.qr.factor(&mut basis, tall, n);
            let mut triangle = vec![0.0; n * n];
            for (j, column) in triangle.chunks_exact_mut(n.max(1)).enumerate() {
                column[..=j].copy_from_slice(&basis[j * tall..=j * tall + j]);
            }
            full = independent(&triangle, n);
            let mut span = vec![0.0; tall * n];
            self.qr.q(&basis, tall, n, &mut span);
            let (mut square, mut short) = (vec![0.0; n * n], vec![0.0; n]);
            transposed_product(&span, &matrix, tall, (n, n), &mut square);
            transposed_product(&span, &right, tall, (n, 1), &mut short);
            (matrix, right) = (square, short);
        }
        full &= self.solve_square(&mut matrix, &mut right);
        for (c, value) in moving.iter().zip(&right) {
            unknowns[*c] = *value;
        }
        Found { unknowns, full }
    }

    /// Solves a square system in place, its columns scaled to one size; false where it is singular.
    fn solve_square(&mut self, matrix: &mut [f64], right: &mut [f64]) -> bool {
        let n = right.len();
        if n == 0 {
            return true;
        }
        let mut scale = Vec::with_capacity(n);
        for column in matrix.chunks_exact_mut(n) {
            let size = dot(column, column).sqrt();
            let by = if size > 0.0 { 1.0 / size } else { 1.0 };
            column.iter_mut().for_each(|x| *x *= by);
            scale.push(by);
        }
        if self.lu.as_ref().is_some_and(|(_, size)| *size != n) {
            self.lu = None;
        }
        let (lu, _) = self.lu.get_or_insert_with(|| (Lu::new(n), n));
        lu.factor_columns(matrix);
        lu.solve(right);
        for (x, by) in right.iter_mut().zip(&scale) {
            *x *= by;
        }
        lu.smallest_pivot() > RANK
    }

    /// Residuals' weighted sum of squares.
    pub fn cost(&self, coupling: &[f64]) -> f64 {
        match self.blocks.len() * self.blocks.len() == self.squares.len() {
            true => dot(&self.squares, coupling),
            false => self.squares.iter().step_by(self.squares.len().isqrt() + 1).sum(),
        }
    }
}

/// Whether no column of a triangle is a combination of those before it.
pub(super) fn independent(triangle: &[f64], size: usize) -> bool {
    triangle
        .chunks_exact(size.max(1))
        .enumerate()
        .all(|(j, column)| column[j].abs() > RANK * dot(&column[..=j], &column[..=j]).sqrt())
}
