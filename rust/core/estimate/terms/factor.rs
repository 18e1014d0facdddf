//! Orthogonal factors of columns: the least squares solution beside them, and R⁻¹.

use crate::linalg::qr::triangularise;

/// Sine of the angle below which a column depends on the ones before it.
const DEPENDENT: f64 = 1e-9;

/// R of some columns and Qᵀ of what stands beside them; memory is kept.
#[derive(Debug, Default)]
pub(crate) struct Factor {
    columns: usize,
    height: usize,
    left: Vec<f64>,
    right: Vec<f64>,
}

impl Factor {
    /// Factors the columns named, beside them the residual.
    pub fn set(&mut self, columns: &[Vec<f64>], free: &[usize], residual: Option<&[f64]>) {
        let rows = columns.first().map_or(0, Vec::len);
        (self.columns, self.height) = (free.len(), rows.max(free.len()).max(1));
        self.left.clear();
        for (k, own) in free.iter().enumerate() {
            self.left.extend_from_slice(&columns[*own]);
            self.left.resize((k + 1) * self.height, 0.0);
        }
        self.right.clear();
        if let Some(residual) = residual {
            self.right.extend_from_slice(residual);
            self.right.resize(self.height, 0.0);
        }
        triangularise(&mut self.left, &mut self.right, self.columns, (self.height, self.height));
    }

    /// R(i, j), j ≥ i.
    pub fn r(&self, i: usize, j: usize) -> f64 {
        self.left[j * self.height + i]
    }

    /// Minimiser of |r + Σ x_k c_k|, and whether the columns are independent.
    pub fn solve(&self, x: &mut Vec<f64>) -> bool {
        let n = self.columns;
        x.clear();
        x.resize(n, 0.0);
        let mut full = true;
        for k in (0..n).rev() {
            let size = (0..=k).map(|i| self.r(i, k) * self.r(i, k)).sum::<f64>().sqrt();
            let pivot = self.r(k, k);
            full &= pivot.abs() > DEPENDENT * size;
            let sum = (k + 1..n).fold(-self.right[k], |s, j| s - self.r(k, j) * x[j]);
            x[k] = sum / pivot;
        }
        full
    }

    /// R⁻¹, row major, upper triangular.
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.columns;
        let mut inverse = vec![0.0; n * n];
        for j in 0..n {
            inverse[j * n + j] = 1.0 / self.r(j, j);
            for i in (0..j).rev() {
                let sum: f64 = (i + 1..=j).map(|k| self.r(i, k) * inverse[k * n + j]).sum();
                inverse[i * n + j] = -sum / self.r(i, i);
            }
        }
        inverse
    }
}
