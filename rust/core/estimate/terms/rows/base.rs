//! Columns that are taken out of others: an orthonormal base of them.

use crate::linalg::qr::dot;

/// Columns whose part beside the ones before is smaller than this fraction are dependent.
const DEPENDENT: f64 = 1e-10;

/// Orthonormal columns; their memory is kept from one time to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Base {
    columns: Vec<Vec<f64>>,
    count: usize,
}

impl Base {
    /// Makes it that of the first `rows` of the columns, dependent ones left out; each is cleaned twice.
    pub fn span(&mut self, columns: &[Vec<f64>], rows: usize) {
        self.count = 0;
        for column in columns {
            if self.columns.len() == self.count {
                self.columns.push(Vec::new());
            }
            let (done, rest) = self.columns.split_at_mut(self.count);
            let own = &mut rest[0];
            own.clear();
            own.extend_from_slice(&column[..rows]);
            let size = dot(own, own).sqrt();
            for _ in 0..2 {
                project(done, own);
            }
            let left = dot(own, own).sqrt();
            if left > DEPENDENT * size {
                for x in own.iter_mut() {
                    *x /= left;
                }
                self.count += 1;
            }
        }
    }

    pub fn columns(&self) -> &[Vec<f64>] {
        &self.columns[..self.count]
    }

    /// Takes what the base explains out of a column.
    pub fn project(&self, column: &mut [f64]) {
        project(self.columns(), column);
    }
}

fn project(base: &[Vec<f64>], column: &mut [f64]) {
    for b in base {
        let along = dot(b, column);
        for (x, b) in column.iter_mut().zip(b) {
            *x -= along * b;
        }
    }
}
