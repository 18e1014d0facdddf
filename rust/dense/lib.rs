//! Dense factorisations: a crate of its own, so that a change of a kernel does not compile them again.
#![forbid(unsafe_code)]

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::{MatMut, MatRef, Par, Spec};

/// LU factors of a square matrix, with rows exchanged; one thread, memory made once.
pub struct Lu {
    size: usize,
    /// Column by column.
    factors: Vec<f64>,
    rows: Vec<usize>,
    places: Vec<usize>,
    memory: MemBuffer,
}

impl Lu {
    /// For matrices of `size` rows.
    #[must_use]
    pub fn new(size: usize) -> Lu {
        let factor =
            factor::lu_in_place_scratch::<usize, f64>(size, size, Par::Seq, Spec::default());
        let solve = solve::solve_in_place_scratch::<usize, f64>(size, 1, Par::Seq);
        Lu {
            size,
            factors: vec![0.0; size * size],
            rows: (0..size).collect(),
            places: (0..size).collect(),
            memory: MemBuffer::new(factor.or(solve)),
        }
    }

    /// Factors a matrix given row by row.
    ///
    /// # Panics
    /// Where it has another size.
    pub fn factor(&mut self, matrix: &[f64]) {
        let n = self.size;
        assert_eq!(matrix.len(), n * n, "the matrix has the size of its factors");
        for (i, row) in matrix.chunks_exact(n.max(1)).enumerate() {
            for (j, value) in row.iter().enumerate() {
                self.factors[j * n + i] = *value;
            }
        }
        let factors = MatMut::from_column_major_slice_mut(&mut self.factors, n, n);
        let memory = MemStack::new(&mut self.memory);
        let (rows, places) = (&mut self.rows, &mut self.places);
        factor::lu_in_place(factors, rows, places, Par::Seq, memory, Spec::default());
    }

    /// Solves for a right side, in place. Of a singular matrix the solution is not finite.
    ///
    /// # Panics
    /// Where it has another size.
    pub fn solve(&mut self, right: &mut [f64]) {
        let n = self.size;
        assert_eq!(right.len(), n, "the right side has the size of the factors");
        let factors = MatRef::from_column_major_slice(&self.factors, n, n);
        let rows = PermRef::new_checked(&self.rows, &self.places, n);
        let right = MatMut::from_column_major_slice_mut(right, n, 1);
        let memory = MemStack::new(&mut self.memory);
        solve::solve_in_place(factors, factors, rows, right, Par::Seq, memory);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_meet_their_equations_at_any_size_and_factors_serve_many() {
        for n in [0, 1, 2, 3, 5, 8, 17, 40, 96] {
            let value = |k: usize| ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5;
            let mut lu = Lu::new(n);
            for round in 0..2 {
                let matrix: Vec<f64> = (0..n * n).map(|k| value(k * k + round)).collect();
                lu.factor(&matrix);
                for right in 0..2 {
                    let wanted: Vec<f64> = (0..n).map(|k| value(k + 7 * right)).collect();
                    let mut x = wanted.clone();
                    lu.solve(&mut x);
                    for (row, wanted) in matrix.chunks_exact(n.max(1)).zip(&wanted) {
                        let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
                        assert!((sum - wanted).abs() < 1e-10, "{n}: {sum} {wanted}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_finite_solution() {
        let mut lu = Lu::new(2);
        lu.factor(&[1.0, 2.0, 2.0, 4.0]);
        let mut x = [1.0, 1.0];
        lu.solve(&mut x);
        assert!(x.iter().any(|x| !x.is_finite()));
    }
}
