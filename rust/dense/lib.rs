//! Dense factorisations: a crate of its own, so that a change of a kernel does not compile them again.
//!
//! Matrices are column major; every call runs on one thread, and memory grows to the largest size asked for.
#![forbid(unsafe_code)]

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor as llt;
use faer::linalg::householder;
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::linalg::matmul::matmul;
use faer::linalg::qr::no_pivoting::factor as qr;
use faer::linalg::{triangular_inverse, triangular_solve};
use faer::perm::PermRef;
use faer::{Accum, Conj, MatMut, MatRef, Par, Spec};

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
        self.factor_own();
    }

    /// Factors a matrix given column by column.
    ///
    /// # Panics
    /// Where it has another size.
    pub fn factor_columns(&mut self, matrix: &[f64]) {
        self.factors.copy_from_slice(matrix);
        self.factor_own();
    }

    fn factor_own(&mut self) {
        let n = self.size;
        let factors = MatMut::from_column_major_slice_mut(&mut self.factors, n, n);
        let memory = MemStack::new(&mut self.memory);
        let (rows, places) = (&mut self.rows, &mut self.places);
        factor::lu_in_place(factors, rows, places, Par::Seq, memory, Spec::default());
    }

    /// The smallest pivot: 0 where the matrix is singular, not finite where a number of it is not.
    #[must_use]
    pub fn smallest_pivot(&self) -> f64 {
        let pivots = (0..self.size).map(|k| self.factors[k * self.size + k].abs());
        pivots.fold(f64::INFINITY, |least, p| if p >= least { least } else { p })
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

/// A = QR by Householder reflections.
#[derive(Default)]
pub struct Qr {
    coefficients: Vec<f64>,
    block: usize,
    memory: Option<(MemBuffer, usize)>,
}

impl Qr {
    /// Replaces a matrix by R, on and above its diagonal, and what [`Qr::q`] needs below.
    ///
    /// # Panics
    /// Where it has not `rows` × `columns` elements, or fewer rows than columns.
    pub fn factor(&mut self, matrix: &mut [f64], rows: usize, columns: usize) {
        assert!(rows >= columns, "an orthogonal factor has at least as many rows as columns");
        if columns == 0 {
            return;
        }
        self.block = qr::recommended_block_size::<f64>(rows, columns);
        self.coefficients.resize(self.block * columns, 0.0);
        let need =
            qr::qr_in_place_scratch::<f64>(rows, columns, self.block, Par::Seq, Spec::default());
        let stack = reserve(&mut self.memory, need);
        let matrix = MatMut::from_column_major_slice_mut(matrix, rows, columns);
        let coefficients =
            MatMut::from_column_major_slice_mut(&mut self.coefficients, self.block, columns);
        qr::qr_in_place(matrix, coefficients, Par::Seq, stack, Spec::default());
    }

    /// Writes the first `columns` columns of Q from the matrix that [`Qr::factor`] left last.
    ///
    /// # Panics
    /// Where a size is another than that of [`Qr::factor`].
    pub fn q(&mut self, factors: &[f64], rows: usize, columns: usize, q: &mut [f64]) {
        q.fill(0.0);
        if columns == 0 {
            return;
        }
        for (j, column) in q.chunks_exact_mut(rows).enumerate() {
            column[j] = 1.0;
        }
        let need = householder::apply_block_householder_sequence_on_the_left_in_place_scratch::<f64>(
            rows, self.block, columns,
        );
        let stack = reserve(&mut self.memory, need);
        householder::apply_block_householder_sequence_on_the_left_in_place_with_conj(
            MatRef::from_column_major_slice(factors, rows, columns),
            MatRef::from_column_major_slice(&self.coefficients, self.block, columns),
            Conj::No,
            MatMut::from_column_major_slice_mut(q, rows, columns),
            Par::Seq,
            stack,
        );
    }
}

fn reserve(memory: &mut Option<(MemBuffer, usize)>, need: StackReq) -> &mut MemStack {
    let bytes = need.size_bytes();
    if memory.as_ref().is_some_and(|(_, size)| *size < bytes) {
        *memory = None;
    }
    MemStack::new(&mut memory.get_or_insert_with(|| (MemBuffer::new(need), bytes)).0)
}

/// AᵀB of matrices of `rows` rows: A with `left` columns, B with `right`; written over `out`, `left` × `right`.
///
/// # Panics
/// Where a length does not fit.
pub fn transposed_product(
    a: &[f64],
    b: &[f64],
    rows: usize,
    (left, right): (usize, usize),
    out: &mut [f64],
) {
    let a = MatRef::from_column_major_slice(a, rows, left);
    let b = MatRef::from_column_major_slice(b, rows, right);
    let out = MatMut::from_column_major_slice_mut(out, left, right);
    matmul(out, Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
}

/// AB of A with `rows` × `inner` elements and B with `inner` × `columns`; written over `out`.
///
/// # Panics
/// Where a length does not fit.
pub fn product(
    a: &[f64],
    b: &[f64],
    (rows, inner, columns): (usize, usize, usize),
    out: &mut [f64],
) {
    let a = MatRef::from_column_major_slice(a, rows, inner);
    let b = MatRef::from_column_major_slice(b, inner, columns);
    let out = MatMut::from_column_major_slice_mut(out, rows, columns);
    matmul(out, Accum::Replace, a, b, 1.0, Par::Seq);
}

/// The inverse of an upper triangle, zeros below; of a singular one it is not finite.
///
/// # Panics
/// Where the matrix has not `size`² elements.
#[must_use]
pub fn inverse_of_upper(upper: &[f64], size: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; size * size];
    let upper = MatRef::from_column_major_slice(upper, size, size);
    let to = MatMut::from_column_major_slice_mut(&mut inverse, size, size);
    triangular_inverse::invert_upper_triangular(to, upper, Par::Seq);
    inverse
}

/// The lower Cholesky factor of a covariance.
#[derive(Debug, Clone)]
pub struct Cholesky {
    size: usize,
    factor: Vec<f64>,
}

impl Cholesky {
    /// Of a symmetric matrix whose lower triangle is given; pivots are not taken below the smallest number.
    ///
    /// # Panics
    /// Where it has not `size`² elements.
    #[must_use]
    pub fn new(mut matrix: Vec<f64>, size: usize) -> Cholesky {
        let least = llt::LltRegularization {
            dynamic_regularization_delta: f64::MIN_POSITIVE,
            dynamic_regularization_epsilon: f64::MIN_POSITIVE,
        };
        let need = llt::cholesky_in_place_scratch::<f64>(size, Par::Seq, Spec::default());
        let mut memory = MemBuffer::new(need);
        let stack = MemStack::new(&mut memory);
        let own = MatMut::from_column_major_slice_mut(&mut matrix, size, size);
        if llt::cholesky_in_place(own, least, Par::Seq, stack, Spec::default()).is_err() {
            // No number came of it: whatever is whitened says so.
            matrix.fill(f64::NAN);
        }
        Cholesky { size, factor: matrix }
    }

    /// Rows of the factor.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// L⁻¹ of columns of `rows` rows, L the factor's leading part, in place.
    ///
    /// # Panics
    /// Where the factor has fewer rows or `columns` is no whole number of them.
    pub fn whiten(&self, columns: &mut [f64], rows: usize) {
        if rows == 0 {
            return;
        }
        let count = columns.len() / rows;
        let factor = MatRef::from_column_major_slice(&self.factor, self.size, self.size);
        let columns = MatMut::from_column_major_slice_mut(columns, rows, count);
        let leading = factor.submatrix(0, 0, rows, rows);
        triangular_solve::solve_lower_triangular_in_place(leading, columns, Par::Seq);
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

    fn some(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    #[test]
    fn orthogonal_factors_multiply_to_the_matrix_whatever_came_before() {
        let mut qr = Qr::default();
        for (rows, columns) in [(1, 1), (5, 3), (40, 40), (7, 0), (200, 33), (12, 12), (400, 3)] {
            let own = |k: usize| some(k * k + 3) + 4.0 * f64::from(k % rows == k / rows);
            let matrix: Vec<f64> = (0..rows * columns).map(own).collect();
            let mut factors = matrix.clone();
            qr.factor(&mut factors, rows, columns);
            let mut q = vec![f64::NAN; rows * columns];
            qr.q(&factors, rows, columns, &mut q);
            let mut r = vec![0.0; columns * columns];
            for j in 0..columns {
                r[j * columns..=j * columns + j].copy_from_slice(&factors[j * rows..=j * rows + j]);
            }
            let (mut back, mut one) = (vec![0.0; rows * columns], vec![0.0; columns * columns]);
            product(&q, &r, (rows, columns, columns), &mut back);
            transposed_product(&q, &q, rows, (columns, columns), &mut one);
            for (a, b) in back.iter().zip(&matrix) {
                assert!((a - b).abs() < 1e-13, "{rows} x {columns}: {a} {b}");
            }
            let inverse = inverse_of_upper(&r, columns);
            let mut unit = vec![0.0; columns * columns];
            product(&r, &inverse, (columns, columns, columns), &mut unit);
            for k in 0..columns * columns {
                let want = f64::from(k % columns == k / columns);
                assert!((one[k] - want).abs() < 1e-13, "{rows} x {columns}");
                assert!((unit[k] - want).abs() < 1e-10, "{rows} x {columns}");
            }
        }
    }

    #[test]
    fn whitened_columns_have_no_covariance_and_leading_parts_serve_fewer_rows() {
        let n = 30;
        let root: Vec<f64> = (0..n * n).map(|k| some(k * k + 1)).collect();
        let mut covariance = vec![0.0; n * n];
        transposed_product(&root, &root, n, (n, n), &mut covariance);
        (0..n).for_each(|k| covariance[k * (n + 1)] += 0.1);
        let cholesky = Cholesky::new(covariance.clone(), n);
        for rows in [0, 1, 17, n] {
            let mut white: Vec<f64> = (0..rows * rows)
                .map(|k| covariance[k / rows.max(1) * n + k % rows.max(1)])
                .collect();
            cholesky.whiten(&mut white, rows);
            // L⁻¹C = Lᵀ: its products are C again.
            let mut back = vec![0.0; rows * rows];
            transposed_product(&white, &white, rows, (rows, rows), &mut back);
            for i in 0..rows {
                for j in 0..rows {
                    let want = covariance[i * n + j];
                    assert!((back[i * rows + j] - want).abs() < 1e-12, "{rows}");
                }
            }
        }
    }

    #[test]
    fn no_covariance_whitens_to_no_numbers() {
        let mut column = [1.0, 1.0];
        Cholesky::new(vec![f64::NAN; 4], 2).whiten(&mut column, 2);
        assert!(column.iter().any(|x| x.is_nan()));
    }

    #[test]
    fn pivots_tell_a_singular_matrix() {
        let mut lu = Lu::new(2);
        lu.factor(&[1.0, 2.0, 2.0, 4.0]);
        assert!(lu.smallest_pivot() < 1e-15);
        lu.factor(&[1.0, f64::NAN, 2.0, 4.0]);
        let least = lu.smallest_pivot();
        assert!(least.is_nan() || least <= 1e-15, "{least}");
    }
}
