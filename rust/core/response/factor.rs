//! Complex least squares in lanes: columns made orthonormal one after the other, the right side last.

use crate::simd::{Lanes, Wide};

/// Complex numbers in lanes, as they lie in memory.
pub type Pair = [Wide; 2];

/// A column whose remainder is below this share of its square is left out: it is the others' sum.
const DEPENDENT: f64 = 1e-26;

/// A complex number in registers.
#[derive(Clone, Copy)]
pub struct Complex<L> {
    /// Real part.
    pub re: L,
    /// Imaginary part.
    pub im: L,
}

impl<L: Lanes> Complex<L> {
    #[inline(always)]
    pub fn zero() -> Self {
        Complex { re: L::splat(0.0), im: L::splat(0.0) }
    }

    #[inline(always)]
    pub fn one() -> Self {
        Complex { re: L::splat(1.0), im: L::splat(0.0) }
    }

    #[inline(always)]
    pub fn load(from: &Pair) -> Self {
        Complex { re: L::load(&from[0]), im: L::load(&from[1]) }
    }

    #[inline(always)]
    pub fn store(self, to: &mut Pair) {
        self.re.store(&mut to[0]);
        self.im.store(&mut to[1]);
    }

    /// self · b + c.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        Complex {
            re: (-self.im).mul_add(b.im, self.re.mul_add(b.re, c.re)),
            im: self.im.mul_add(b.re, self.re.mul_add(b.im, c.im)),
        }
    }

    #[inline(always)]
    pub fn mul(self, b: Self) -> Self {
        self.mul_add(b, Complex::zero())
    }

    #[inline(always)]
    pub fn add(self, b: Self) -> Self {
        Complex { re: self.re + b.re, im: self.im + b.im }
    }

    #[inline(always)]
    pub fn conj(self) -> Self {
        Complex { re: self.re, im: -self.im }
    }

    #[inline(always)]
    pub fn neg(self) -> Self {
        Complex { re: -self.re, im: -self.im }
    }

    #[inline(always)]
    pub fn scale(self, by: L) -> Self {
        Complex { re: self.re * by, im: self.im * by }
    }

    /// |self|².
    #[inline(always)]
    pub fn square(self) -> L {
        self.re.mul_add(self.re, self.im * self.im)
    }

    /// 1/self, 0 for 0.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let square = self.square();
        let by = L::splat(0.0).select_lt(square, L::splat(1.0) / square, L::splat(0.0));
        Complex { re: self.re * by, im: -(self.im * by) }
    }
}

/// Columns and what orthonormalising them leaves.
#[derive(Debug, Clone, Default)]
pub struct Factor {
    rows: usize,
    columns: usize,
    /// Column after column, the right side behind them; after [`Factor::reduce`] Q, and the residual.
    pub data: Vec<Pair>,
    /// R, column after column with the right side's behind them, each as long as there are columns.
    triangle: Vec<Pair>,
    /// 1 over R's diagonal; 0 for a column that was left out.
    inverse: Vec<Wide>,
}

impl Factor {
    /// Makes room; what stands in the columns is left to be written.
    pub fn resize(&mut self, rows: usize, columns: usize) {
        (self.rows, self.columns) = (rows, columns);
        self.data.resize(rows * (columns + 1), [Wide::ZERO; 2]);
        self.triangle.resize(columns * (columns + 1), [Wide::ZERO; 2]);
        self.inverse.resize(columns, Wide::ZERO);
    }

    /// A column, or the right side behind the last.
    pub fn column_mut(&mut self, j: usize) -> &mut [Pair] {
        &mut self.data[j * self.rows..(j + 1) * self.rows]
    }

    /// As [`Factor::column_mut`], to read.
    pub fn column(&self, j: usize) -> &[Pair] {
        &self.data[j * self.rows..(j + 1) * self.rows]
    }

    /// 1 over R's diagonal element; 0 for a column that was left out.
    pub fn inverse(&self, j: usize) -> &Wide {
        &self.inverse[j]
    }

    /// R(i, j).
    pub fn upper(&self, i: usize, j: usize) -> &Pair {
        &self.triangle[j * self.columns + i]
    }

    /// Gram–Schmidt, later columns freed of each as it comes: as exact as reflections for least squares, since the
    /// right side goes the same way.
    #[inline(always)]
    pub fn reduce<L: Lanes>(&mut self) {
        let (rows, columns) = (self.rows, self.columns);
        for j in 0..columns {
            let sum = norm::<L>(&self.data[j * rows..(j + 1) * rows]);
            sum.store(&mut self.inverse[j]);
        }
        for j in 0..columns {
            let (before, after) = self.data.split_at_mut((j + 1) * rows);
            let own = &mut before[j * rows..];
            let whole = L::load(&self.inverse[j]);
            let left = norm::<L>(own);
            let none = L::splat(0.0);
            let least = whole * L::splat(DEPENDENT);
            let by = least.select_lt(left, L::splat(1.0) / left.sqrt(), none);
            by.store(&mut self.inverse[j]);
            let diagonal = Complex { re: left.sqrt(), im: none };
            diagonal.store(&mut self.triangle[j * columns + j]);
            for x in own.iter_mut() {
                Complex::<L>::load(x).scale(by).store(x);
            }
            let mut k = j + 1;
            let mut pairs = after.chunks_exact_mut(2 * rows);
            for two in pairs.by_ref() {
                let (first, second) = two.split_at_mut(rows);
                let dots = project::<L, 2>(own, [first, second]);
                for dot in dots {
                    dot.store(&mut self.triangle[k * columns + j]);
                    k += 1;
                }
            }
            let last = pairs.into_remainder();
            if !last.is_empty() {
                let [dot] = project::<L, 1>(own, [last]);
                dot.store(&mut self.triangle[k * columns + j]);
            }
        }
    }

    /// The solution; 0 for columns that were left out.
    #[inline(always)]
    pub fn solve<L: Lanes>(&self, out: &mut [Pair]) {
        for i in (0..self.columns).rev() {
            let mut sum = Complex::<L>::load(self.upper(i, self.columns));
            for (j, x) in out.iter().enumerate().take(self.columns).skip(i + 1) {
                sum = Complex::load(self.upper(i, j)).neg().mul_add(Complex::load(x), sum);
            }
            sum.scale(L::load(&self.inverse[i])).store(&mut out[i]);
        }
    }
}

#[inline(always)]
fn norm<L: Lanes>(column: &[Pair]) -> L {
    let mut sum = L::splat(0.0);
    for x in column {
        sum = sum + Complex::<L>::load(x).square();
    }
    sum
}

/// Takes from K columns their parts along a unit column; returns these. Two at once read the unit column once.
#[inline(always)]
fn project<L: Lanes, const K: usize>(unit: &[Pair], later: [&mut [Pair]; K]) -> [Complex<L>; K] {
    let mut dots = [Complex::<L>::zero(); K];
    for (r, q) in unit.iter().enumerate() {
        let q = Complex::<L>::load(q).conj();
        for k in 0..K {
            dots[k] = q.mul_add(Complex::load(&later[k][r]), dots[k]);
        }
    }
    for (r, q) in unit.iter().enumerate() {
        let q = Complex::<L>::load(q);
        for k in 0..K {
            let x = &mut later[k][r];
            dots[k].neg().mul_add(q, Complex::load(x)).store(x);
        }
    }
    dots
}
