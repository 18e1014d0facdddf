//! Cholesky factors of a dense covariance and what they whiten: rows of a panel, eight columns a register.

use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers, numbers_mut};

/// A matrix in row-major order whose rows are filled up to whole registers.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    rows: usize,
    width: usize,
    data: Vec<Wide>,
}

impl Panel {
    /// Zeros; what stands there stays where the shape does. Memory is kept where it suffices.
    pub fn resize(&mut self, rows: usize, columns: usize) {
        let width = columns.div_ceil(LANES);
        if (rows, width) != (self.rows, self.width) {
            (self.rows, self.width) = (rows, width);
            self.data.clear();
            self.data.resize(rows * width, Wide::ZERO);
        }
    }

    /// A column, from the first row on.
    pub fn column(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let all = &numbers(&self.data)[column.min(self.data.len() * LANES)..];
        all.iter().step_by((self.width * LANES).max(1)).copied()
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

    /// The numbers of a row, filled up.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f64] {
        numbers(&self.data[row * self.width..(row + 1) * self.width])
    }

    /// As [`Panel::row`], to be written.
    pub fn row_mut(&mut self, row: usize) -> &mut [f64] {
        numbers_mut(&mut self.data[row * self.width..(row + 1) * self.width])
    }
}

/// Rows that are taken out of those below in one sweep: a row is read and written once for all of them, in the
/// order, and so with the bits, of one after the other.
const RANK: usize = 4;
/// Pivots are not taken below this fraction of what stood there first.
const FLOOR: f64 = 1e-13;

/// Replaces the upper triangle of C in `panel` by its factor R, C = RᵀR, and the columns beside it by R⁻ᵀ of
/// them.
///
/// `panel` is \[C | columns\]; pivots below `least` (one a row) are lifted to it.
pub fn whiten(isa: Isa, panel: &mut Panel, least: &[f64]) {
    isa.across().run(Whiten { panel, least });
}

/// Replaces `columns` by R⁻ᵀ of them, R the factor that [`whiten`] left in `factor`.
pub fn whiten_more(isa: Isa, factor: &Panel, columns: &mut Panel) {
    if columns.width > 0 {
        isa.across().run(WhitenMore { factor, columns });
    }
}

/// Solves Rx = b in place, R the factor that [`whiten`] left in `factor`; b ends in zeros.
pub fn back(isa: Isa, factor: &Panel, b: &mut [Wide]) {
    isa.across().run(Back { factor, b });
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
        let mut end = 0;
        while end < rows {
            let first = end;
            end = (first + RANK).min(rows);
            let (above, below) = panel.data.split_at_mut(end * width);
            let own = &mut above[first * width..];
            for j in first..end {
                let (own, later) = own[(j - first) * width..].split_at_mut(width);
                let block = j / LANES;
                let pivot = own[block].0[j % LANES];
                // NaN stays NaN.
                let pivot = if pivot < least[j] { least[j] } else { pivot };
                let root = pivot.sqrt();
                scale::<L>(&mut own[block..], 1.0 / root);
                // Of a pivot that was lifted the diagonal is not what was divided.
                own[block].0[j % LANES] = root;
                for (i, row) in (j + 1..).zip(later.chunks_exact_mut(width)) {
                    let from = i / LANES;
                    take::<L>(own[from].0[i % LANES], &own[from..], &mut row[from..]);
                }
            }
            if below.is_empty() {
                break;
            }
            let own = four(own, width);
            for block in end / LANES..rows.div_ceil(LANES) {
                let (a, b, c, d) = own;
                let own = (&a[block..], &b[block..], &c[block..], &d[block..]);
                let some = end.max(block * LANES)..rows.min((block + 1) * LANES);
                let each = below[(some.start - end) * width..].chunks_exact_mut(width);
                for (i, row) in some.zip(each) {
                    sweep::<L>(element(own, i), own, &mut row[block..]);
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
        let mut end = 0;
        while end < rows {
            let first = end;
            end = (first + RANK).min(rows);
            let (above, below) = columns.data.split_at_mut(end * width);
            let own = &mut above[first * width..];
            let pivots = &factor.data[first * factor.width..end * factor.width];
            for j in first..end {
                let (own, later) = own[(j - first) * width..].split_at_mut(width);
                let pivots = &pivots[(j - first) * factor.width..];
                scale::<L>(own, 1.0 / pivots[j / LANES].0[j % LANES]);
                for (i, row) in (j + 1..).zip(later.chunks_exact_mut(width)) {
                    take::<L>(pivots[i / LANES].0[i % LANES], own, row);
                }
            }
            if below.is_empty() {
                break;
            }
            let (own, pivots) = (four(own, width), four(pivots, factor.width));
            for block in end / LANES..rows.div_ceil(LANES) {
                let (a, b, c, d) = pivots;
                let pivots = (&a[block..], &b[block..], &c[block..], &d[block..]);
                let some = end.max(block * LANES)..rows.min((block + 1) * LANES);
                let each = below[(some.start - end) * width..].chunks_exact_mut(width);
                for (i, row) in some.zip(each) {
                    sweep::<L>(element(pivots, i), own, row);
                }
            }
        }
    }
}

#[inline(always)]
fn scale<L: Lanes>(row: &mut [Wide], by: f64) {
    let by = L::splat(by);
    for x in row {
        (L::load(x) * by).store(x);
    }
}

/// Takes `factor` times a row out of one below.
#[inline(always)]
fn take<L: Lanes>(factor: f64, from: &[Wide], row: &mut [Wide]) {
    let by = L::splat(-factor);
    for (x, y) in row.iter_mut().zip(from) {
        by.mul_add(L::load(y), L::load(x)).store(x);
    }
}

/// [`RANK`] rows, or their ends.
type Four<'a> = (&'a [Wide], &'a [Wide], &'a [Wide], &'a [Wide]);

#[inline(always)]
fn four(rows: &[Wide], width: usize) -> Four<'_> {
    let (a, rest) = rows.split_at(width);
    let (b, rest) = rest.split_at(width);
    let (c, rest) = rest.split_at(width);
    (a, b, c, &rest[..width])
}

/// Element `i` modulo the lanes of the first registers.
#[inline(always)]
fn element((a, b, c, d): Four<'_>, i: usize) -> [f64; RANK] {
    let lane = i % LANES;
    [a[0].0[lane], b[0].0[lane], c[0].0[lane], d[0].0[lane]]
}

/// Takes four rows, each times its factor, out of one below.
#[inline(always)]
fn sweep<L: Lanes>([f, g, h, i]: [f64; RANK], (a, b, c, d): Four<'_>, row: &mut [Wide]) {
    let (f, g, h, i) = (L::splat(-f), L::splat(-g), L::splat(-h), L::splat(-i));
    let own = row.len();
    let (a, b, c, d) = (&a[..own], &b[..own], &c[..own], &d[..own]);
    for k in 0..own {
        let sum = f.mul_add(L::load(&a[k]), L::load(&row[k]));
        let sum = g.mul_add(L::load(&b[k]), sum);
        let sum = h.mul_add(L::load(&c[k]), sum);
        i.mul_add(L::load(&d[k]), sum).store(&mut row[k]);
    }
}

struct Back<'a> {
    factor: &'a Panel,
    b: &'a mut [Wide],
}

impl Kernel for Back<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Back { factor, b } = self;
        let rows = factor.rows;
        for j in (0..rows).rev() {
            let block = j / LANES;
            let row = &factor.data[j * factor.width..(j + 1) * factor.width];
            // Registers that are solved for in lanes, the rest of their own register one by one.
            let mut sums = L::splat(0.0);
            let last = rows.div_ceil(LANES);
            for (r, x) in row[block + 1..last].iter().zip(&b[block + 1..last]) {
                sums = L::load(r).mul_add(L::load(x), sums);
            }
            let mut far = Wide::ZERO;
            sums.store(&mut far);
            let (own, r) = (&mut b[block].0, &row[block].0);
            let mut sum = own[j % LANES] - far.0.iter().sum::<f64>();
            for k in j % LANES + 1..LANES.min(rows - block * LANES) {
                sum -= r[k] * own[k];
            }
            own[j % LANES] = sum / r[j % LANES];
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
                let mut x = vec![Wide::ZERO; n.div_ceil(LANES)];
                for i in 0..n {
                    numbers_mut(&mut x)[i] = p.get(i, n + j);
                }
                back(isa, &p, &mut x);
                let x = numbers(&x);
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
