//! Cholesky factors of a dense covariance and what they whiten: rows of a panel, eight columns a register.

use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// A matrix in row-major order whose rows are filled up to whole registers.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    rows: usize,
    width: usize,
    data: Vec<Wide>,
}

impl Panel {
    /// Zeros; memory is kept where it suffices.
    pub fn resize(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.width = columns.div_ceil(LANES);
        self.data.clear();
        self.data.resize(rows * self.width, Wide::ZERO);
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// An element.
    #[must_use]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.data[row * self.width + column / LANES].0[column % LANES]
    }

    /// Sets an element.
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        self.data[row * self.width + column / LANES].0[column % LANES] = value;
    }

    /// The registers of a row.
    pub fn row_mut(&mut self, row: usize) -> &mut [Wide] {
        &mut self.data[row * self.width..(row + 1) * self.width]
    }
}

/// Pivots are not taken below this fraction of what stood there first.
const FLOOR: f64 = 1e-13;

/// Replaces the upper triangle of C in `panel` by its factor R, C = RᵀR, and the columns beside it by R⁻ᵀ of
/// them.
///
/// `panel` is \[C | columns\]; pivots below `least` (one a row) are lifted to it.
pub fn whiten(isa: Isa, panel: &mut Panel, least: &[f64]) {
    across(isa).run(Whiten { panel, least });
}

/// Replaces `columns` by R⁻ᵀ of them, R the factor that [`whiten`] left in `factor`.
pub fn whiten_more(isa: Isa, factor: &Panel, columns: &mut Panel) {
    across(isa).run(WhitenMore { factor, columns });
}

/// Lanes are columns here, so that one lane will not do.
fn across(isa: Isa) -> Isa {
    if isa == Isa::One { Isa::Plain } else { isa }
}

struct Whiten<'a> {
    panel: &'a mut Panel,
    least: &'a [f64],
}

impl Kernel for Whiten<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Whiten { panel, least } = self;
        let (rows, width) = (panel.rows, panel.width);
        for j in 0..rows {
            let (above, below) = panel.data.split_at_mut((j + 1) * width);
            let own = &mut above[j * width..];
            let block = j / LANES;
            let pivot = own[block].0[j % LANES];
            let floor = least[j];
            // NaN stays NaN.
            let pivot = if pivot < floor { floor } else { pivot };
            let by = L::splat(1.0 / pivot.sqrt());
            for x in &mut own[block..] {
                (L::load(x) * by).store(x);
            }
            // Of a pivot that was lifted the diagonal is not what was divided.
            own[block].0[j % LANES] = pivot.sqrt();
            for i in j + 1..rows {
                let factor = L::splat(-own[i / LANES].0[i % LANES]);
                let from = i / LANES;
                let row = &mut below[(i - j - 1) * width..(i - j) * width];
                for (x, y) in row[from..].iter_mut().zip(&own[from..]) {
                    factor.mul_add(L::load(y), L::load(x)).store(x);
                }
            }
        }
    }
}

impl Panel {
    /// Floors for [`whiten`]: a fraction of what stands on the diagonal.
    pub fn floors(&self, out: &mut Vec<f64>) {
        out.clear();
        out.extend((0..self.rows).map(|j| (self.get(j, j) * FLOOR).max(f64::MIN_POSITIVE)));
    }
}

struct WhitenMore<'a> {
    factor: &'a Panel,
    columns: &'a mut Panel,
}

impl Kernel for WhitenMore<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let WhitenMore { factor, columns } = self;
        let (rows, width) = (columns.rows, columns.width);
        for j in 0..rows {
            let (above, below) = columns.data.split_at_mut((j + 1) * width);
            let own = &mut above[j * width..];
            let row = &factor.data[j * factor.width..(j + 1) * factor.width];
            let by = L::splat(1.0 / row[j / LANES].0[j % LANES]);
            for x in own.iter_mut() {
                (L::load(x) * by).store(x);
            }
            for i in j + 1..rows {
                let by = L::splat(-row[i / LANES].0[i % LANES]);
                let to = &mut below[(i - j - 1) * width..(i - j) * width];
                for (x, y) in to.iter_mut().zip(own.iter()) {
                    by.mul_add(L::load(y), L::load(x)).store(x);
                }
            }
        }
    }
}

impl Panel {
    /// Solves Rx = b in place, R the factor that [`whiten`] left here.
    pub fn back(&self, b: &mut [f64]) {
        for j in (0..b.len()).rev() {
            let sum = (j + 1..b.len()).fold(b[j], |s, i| s - self.get(j, i) * b[i]);
            b[j] = sum / self.get(j, j);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    #[test]
    fn whitened_columns_solve_the_normal_equations_on_every_processor() {
        let (n, c) = (19, 3);
        let g = |i: usize, j: usize| value(i * 37 + j * 11 + 3);
        let cov = |i: usize, j: usize| {
            (0..n).map(|k| g(i, k) * g(j, k)).sum::<f64>() + f64::from(u8::from(i == j))
        };
        let b = |i: usize, j: usize| value(i * 7 + j * 101 + 5);
        let mut first: Option<Vec<u64>> = None;
        for isa in Isa::available() {
            let (mut p, mut more, mut least) = (Panel::default(), Panel::default(), Vec::new());
            p.resize(n, n + c);
            more.resize(n, c);
            for i in 0..n {
                for j in 0..n {
                    p.set(i, j, cov(i, j));
                }
                for j in 0..c {
                    p.set(i, n + j, b(i, j));
                    more.set(i, j, b(i, j));
                }
            }
            p.floors(&mut least);
            whiten(isa, &mut p, &least);
            whiten_more(isa, &p, &mut more);
            for j in 0..c {
                // R⁻¹R⁻ᵀb = C⁻¹b.
                let mut x: Vec<f64> = (0..n).map(|i| p.get(i, n + j)).collect();
                p.back(&mut x);
                for i in 0..n {
                    let back: f64 = (0..n).map(|k| cov(i, k) * x[k]).sum();
                    assert!((back - b(i, j)).abs() < 1e-10, "{isa:?}");
                    assert!((p.get(i, n + j) - more.get(i, j)).abs() < 1e-13);
                }
            }
            let bits: Vec<u64> = (0..n)
                .flat_map(|i| (0..c).map(move |j| (i, j)))
                .map(|(i, j)| p.get(i, n + j).to_bits())
                .collect();
            assert_eq!(*first.get_or_insert(bits.clone()), bits, "{isa:?}");
        }
    }

    #[test]
    fn singular_covariances_are_lifted() {
        let (mut p, mut least) = (Panel::default(), Vec::new());
        p.resize(2, 3);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            p.set(i, j, 4.0);
        }
        p.set(1, 2, 1.0);
        p.floors(&mut least);
        whiten(Isa::Plain, &mut p, &least);
        assert!(p.get(1, 1) > 0.0 && p.get(1, 2) * p.get(1, 1) == 1.0);
    }
}
