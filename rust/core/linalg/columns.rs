//! Columns made orthonormal one after another: least squares where columns come and go at the right end.

use super::qr::inverse_of_triangle;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// A column of which less than this is left beside the ones before depends on them, unless told otherwise.
const DEPENDENT: f64 = 1e-7;

/// The factors of C = QR, grown column by column (Gram–Schmidt, each column twice).
///
/// Sums run in eight parts, so that all instruction sets give the same bits; the number of rows is a multiple of
/// eight, filled up with zeros.
#[derive(Debug, Clone)]
pub struct Columns {
    isa: Isa,
    rows: usize,
    dependent: f64,
    count: usize,
    q: Vec<f64>,
    /// Column j of R stands at j·capacity.
    r: Vec<f64>,
    capacity: usize,
}

impl Columns {
    /// Room for `capacity` columns of `rows` rows, filled up to a multiple of eight.
    #[must_use]
    pub fn new(isa: Isa, rows: usize, capacity: usize) -> Columns {
        let rows = rows.next_multiple_of(LANES);
        let (q, r) = (vec![0.0; rows * capacity], vec![0.0; capacity * capacity]);
        Columns { isa, rows, dependent: DEPENDENT, count: 0, q, r, capacity }
    }

    /// The same for another bound of what depends on those before.
    #[must_use]
    pub fn judged_by(self, dependent: f64) -> Columns {
        Columns { dependent, ..self }
    }

    /// Number of rows, those filled up included.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns there is room for.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Number of columns.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Column `j` of Q.
    #[must_use]
    pub fn q(&self, j: usize) -> &[f64] {
        &self.q[j * self.rows..][..self.rows]
    }

    /// R(i, j), i ≤ j.
    #[must_use]
    pub fn r(&self, i: usize, j: usize) -> f64 {
        self.r[j * self.capacity + i]
    }

    /// R⁻¹ of all columns, row major, upper triangular.
    #[must_use]
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.count;
        let mut inverse = vec![0.0; n * n];
        inverse_of_triangle(n, |i, j| self.r(i, j), |s, a, b| s + a * b, &mut inverse);
        inverse
    }

    /// Forgets all columns but the first `count`.
    pub fn truncate(&mut self, count: usize) {
        self.count = self.count.min(count);
    }

    /// Adds the column that `write` puts into zeroed memory. False where it depends on those before, or is not
    /// finite: then it is taken as zero, and its coefficient is.
    pub fn push(&mut self, write: impl FnOnce(&mut [f64])) -> bool {
        let j = self.count;
        let (before, rest) = self.q.split_at_mut(j * self.rows);
        let column = &mut rest[..self.rows];
        column.fill(0.0);
        write(column);
        let r = &mut self.r[j * self.capacity..][..j + 1];
        r.fill(0.0);
        let (size, left) =
            self.isa.run(Orthogonal { q: before, column: &mut *column, coefficients: &mut r[..j] });
        let independent = left > self.dependent * size;
        if independent {
            r[j] = left;
            self.isa.run(Scale { column, by: 1.0 / left });
        } else {
            r[j] = 0.0;
            column.fill(0.0);
        }
        self.count += 1;
        independent
    }

    /// Adds a column as it is; the rows behind it are zero.
    pub fn push_rows(&mut self, column: &[f64]) -> bool {
        self.push(|to| to[..column.len()].copy_from_slice(column))
    }

    /// Adds a column that is orthonormal to those before, or zero.
    pub fn push_unit(&mut self, column: impl Iterator<Item = f64>) {
        let j = self.count;
        let to = &mut self.q[j * self.rows..][..self.rows];
        to.fill(0.0);
        to.iter_mut().zip(column).for_each(|(to, x)| *to = x);
        self.r[j * self.capacity..][..=j].fill(0.0);
        self.count += 1;
    }

    /// Takes from `y` what the columns from `first` on explain; their coefficients of Q go to `b`. Returns ‖y‖².
    pub fn project(&self, first: usize, y: &mut [f64], b: &mut [f64]) -> f64 {
        let q = &self.q[first * self.rows..self.count * self.rows];
        b.fill(0.0);
        let (_, left) = self.isa.run(Orthogonal { q, column: y, coefficients: b });
        left * left
    }

    /// Solves R x = b for the columns from `first` on, in place; those before are left out.
    pub fn back(&self, first: usize, b: &mut [f64]) {
        for j in (first..self.count).rev() {
            let pivot = self.r(j, j);
            let x = if pivot > 0.0 { b[j - first] / pivot } else { 0.0 };
            b[j - first] = x;
            for i in first..j {
                b[i - first] -= self.r(i, j) * x;
            }
        }
    }
}

struct Scale<'a> {
    column: &'a mut [f64],
    by: f64,
}

impl Kernel for Scale<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for block in self.column.as_chunks_mut::<LANES>().0 {
            write(L::load_any(block) * L::splat(self.by), block);
        }
    }
}

/// Takes the columns of `q` out of `column`, twice; returns its norms before and after.
struct Orthogonal<'a> {
    q: &'a [f64],
    column: &'a mut [f64],
    coefficients: &'a mut [f64],
}

impl Kernel for Orthogonal<'_> {
    type Output = (f64, f64);
    #[inline(always)]
    fn run<L: Lanes>(self) -> (f64, f64) {
        let rows = self.column.len();
        let size = dot::<L>(self.column, self.column);
        for _ in 0..2 {
            for (j, r) in self.coefficients.iter_mut().enumerate() {
                let q = &self.q[j * rows..][..rows];
                let by = dot::<L>(q, self.column);
                *r += by;
                let factor = L::splat(-by);
                let (q, _) = q.as_chunks::<LANES>();
                for (block, q) in self.column.as_chunks_mut::<LANES>().0.iter_mut().zip(q) {
                    write(factor.mul_add(L::load_any(q), L::load_any(block)), block);
                }
            }
        }
        (size.sqrt(), dot::<L>(self.column, self.column).sqrt())
    }
}

#[inline(always)]
fn write<L: Lanes>(x: L, to: &mut [f64; LANES]) {
    let mut lanes = Wide::ZERO;
    x.store(&mut lanes);
    *to = lanes.0;
}

#[inline(always)]
fn dot<L: Lanes>(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = L::splat(0.0);
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        sums = L::load_any(a).mul_add(L::load_any(b), sums);
    }
    let mut lanes = [0.0; LANES];
    write(sums, &mut lanes);
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    fn filled(isa: Isa) -> Columns {
        let mut c = Columns::new(isa, 24, 5);
        for j in 0..4 {
            assert!(c.push(|x| (0..21).for_each(|k| x[k] = value(k * 7 + j * 31))));
        }
        c
    }

    #[test]
    fn least_squares_and_the_same_bits_on_every_set() {
        let plain = filled(Isa::Plain);
        for isa in Isa::available() {
            let c = filled(isa);
            assert!(c.q.iter().zip(&plain.q).all(|(a, b)| a.to_bits() == b.to_bits()), "{isa:?}");
            let mut y: Vec<f64> =
                (0..24).map(|k| if k < 21 { value(k + 500) } else { 0.0 }).collect();
            let all = y.clone();
            let mut b = vec![0.0; 4];
            let cost = c.project(0, &mut y, &mut b);
            c.back(0, &mut b);
            let left =
                |k: usize| all[k] - (0..4).map(|j| b[j] * value(k * 7 + j * 31)).sum::<f64>();
            let sum: f64 = (0..21).map(|k| left(k) * left(k)).sum();
            assert!((sum - cost).abs() < 1e-12 * cost);
            let inverse = c.inverse();
            for k in 0..16 {
                let sum: f64 = (0..4).map(|l| inverse[k / 4 * 4 + l] * c.r(l, k % 4)).sum();
                let unit = f64::from(u8::from(k / 4 == k % 4));
                assert!(k % 4 < k / 4 || (sum - unit).abs() < 1e-12, "{k}: {sum}");
            }
            for j in 0..4 {
                let normal: f64 = (0..21).map(|k| left(k) * value(k * 7 + j * 31)).sum();
                assert!(normal.abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_dependent_column_is_told_and_counts_for_nothing() {
        let mut c = filled(Isa::Plain);
        c.truncate(2);
        let sum = |k: usize| value(k * 7) - 3.0 * value(k * 7 + 31);
        assert!(!c.push(|x| (0..21).for_each(|k| x[k] = sum(k))));
        assert!(c.q(2).iter().all(|x| *x == 0.0) && c.count() == 3);
        let (mut y, mut b) = (vec![0.5; 24], vec![0.0; 3]);
        c.project(0, &mut y, &mut b);
        c.back(0, &mut b);
        assert_eq!(b[2], 0.0);
    }
}
