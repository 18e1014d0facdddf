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

    /// All rows, to be written.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        numbers_mut(&mut self.data).chunks_exact_mut((self.width * LANES).max(1))
    }

    /// What stands on the diagonal.
    pub fn diagonal(&self) -> impl Iterator<Item = f64> + '_ {
        let step = self.width * LANES + 1;
        numbers(&self.data).iter().step_by(step).take(self.rows).copied()
    }

    /// How far right of the diagonal numbers stand at most, of the square that begins each row.
    fn reach(&self) -> usize {
        let last = |row: usize| self.row(row)[..self.rows].iter().rposition(|x| *x != 0.0);
        (0..self.rows)
            .map(|row| last(row).map_or(0, |at| at.saturating_sub(row)))
            .max()
            .unwrap_or(0)
    }

    /// As [`Panel::row`], to be written.
    pub fn row_mut(&mut self, row: usize) -> &mut [f64] {
        numbers_mut(&mut self.data[row * self.width..(row + 1) * self.width])
    }
}

/// Rows that are made at once, a register of each: the rows above are taken out of them one after the other.
const RANK: usize = 4;
/// Pivots are not taken below this fraction of what stood there first.
const FLOOR: f64 = 1e-13;

/// Replaces the upper triangle of C in `panel` by its factor R, C = RᵀR, and the columns beside it by R⁻ᵀ of
/// them.
///
/// `panel` is \[C | columns\]; pivots below `least` (one a row) are lifted to it.
pub fn whiten(isa: Isa, panel: &mut Panel, least: &[f64]) {
    isa.run(Whiten { panel, least });
}

/// Replaces `columns` by R⁻ᵀ of them, R the factor that [`whiten`] left in `factor`.
pub fn whiten_more(isa: Isa, factor: &Panel, columns: &mut Panel) {
    if columns.width > 0 {
        isa.run(WhitenMore { factor, columns });
    }
}

/// Solves Rx = b in place, R the factor that [`whiten`] left in `factor`; b ends in zeros.
pub fn back(isa: Isa, factor: &Panel, b: &mut [Wide]) {
    isa.run(Back { factor, b });
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
        let (rows, width, reach) = (panel.rows, panel.width, panel.reach());
        for first in (0..rows).step_by(RANK) {
            let (above, own) = panel.data.split_at_mut(first * width);
            let own = &mut own[..RANK.min(rows - first) * width];
            // Rows further up have nothing in common with these: white noise of different lines has not.
            let above = &above[first.saturating_sub(reach) * width..];
            let empty = (first + RANK + reach).div_ceil(LANES)..rows / LANES;
            let block = first / LANES;
            let mut strip = Strip::<L>::load(own, width, block);
            strip.reduce(above, width, above, width, first, block);
            let pivots = strip.pivot(first % LANES, &least[first..]);
            strip.store(own, width, block);
            // Of a pivot that was lifted the diagonal is not what was divided.
            for (k, row) in own.chunks_exact_mut(width).enumerate() {
                row[block].0[first % LANES + k] = pivots.roots[k];
            }
            for block in (block + 1..width).filter(|block| !empty.contains(block)) {
                let mut strip = Strip::<L>::load(own, width, block);
                strip.reduce(above, width, above, width, first, block);
                strip.finish(&pivots);
                strip.store(own, width, block);
            }
        }
    }
}

/// The least that [`whiten`] may let a pivot become: a fraction of what stands on the diagonal.
#[must_use]
pub fn floor(pivot: f64) -> f64 {
    (pivot * FLOOR).max(f64::MIN_POSITIVE)
}

/// [`floor`] of eight pivots.
#[inline(always)]
pub(crate) fn floor_of<L: Lanes>(pivot: L) -> L {
    (pivot * L::splat(FLOOR)).max(L::splat(f64::MIN_POSITIVE))
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
        let (rows, width, reach) = (columns.rows, columns.width, factor.reach());
        for first in (0..rows).step_by(RANK) {
            let (above, own) = columns.data.split_at_mut(first * width);
            let own = &mut own[..RANK.min(rows - first) * width];
            let (done, rest) = factor.data.split_at(first * factor.width);
            let start = first.saturating_sub(reach);
            let (done, above) = (&done[start * factor.width..], &above[start * width..]);
            let pivots = Pivots::of(rest, factor.width, first);
            for block in 0..width {
                let mut strip = Strip::<L>::load(own, width, block);
                strip.reduce(done, factor.width, above, width, first, block);
                strip.finish(&pivots);
                strip.store(own, width, block);
            }
        }
    }
}

/// What is done to a strip's rows among themselves: each is scaled and taken out of those behind it.
struct Pivots {
    /// The factor's diagonal.
    roots: [f64; RANK],
    inverses: [f64; RANK],
    /// Of a row (first) those of the rows behind it.
    factors: [[f64; RANK]; RANK],
}

impl Pivots {
    const NONE: Pivots =
        Pivots { roots: [1.0; RANK], inverses: [1.0; RANK], factors: [[0.0; RANK]; RANK] };

    /// Those of the strip from row `first` on, whose rows of the factor are these.
    #[inline(always)]
    fn of(rows: &[Wide], width: usize, first: usize) -> Pivots {
        let mut own = Pivots::NONE;
        for (k, row) in rows.chunks_exact(width).take(RANK).enumerate() {
            own.factors[k] = *four(&row[first / LANES], first);
            own.roots[k] = own.factors[k][k];
            own.inverses[k] = 1.0 / own.roots[k];
        }
        own
    }
}

/// The numbers of a strip's own columns in a register that holds them.
#[inline(always)]
fn four(from: &Wide, first: usize) -> &[f64; RANK] {
    &from.0.as_chunks().0[first % LANES / RANK]
}

/// The same register of each row of a strip; of rows beyond the last, numbers that nothing reads.
struct Strip<L>([L; RANK]);

impl<L: Lanes> Strip<L> {
    #[inline(always)]
    fn load(rows: &[Wide], width: usize, block: usize) -> Strip<L> {
        let mut own = [L::splat(0.0); RANK];
        for (own, row) in own.iter_mut().zip(rows.chunks_exact(width)) {
            *own = L::load(&row[block]);
        }
        Strip(own)
    }

    #[inline(always)]
    fn store(&self, rows: &mut [Wide], width: usize, block: usize) {
        for (own, row) in self.0.iter().zip(rows.chunks_exact_mut(width)) {
            own.store(&mut row[block]);
        }
    }

    /// Takes the rows above out, each by the factors of its pivot row.
    #[inline(always)]
    fn reduce(
        &mut self,
        pivots: &[Wide],
        long: usize,
        above: &[Wide],
        width: usize,
        first: usize,
        block: usize,
    ) {
        let mut own = self.0;
        for (pivots, row) in pivots.chunks_exact(long).zip(above.chunks_exact(width)) {
            let (by, x) = (four(&pivots[first / LANES], first), L::load(&row[block]));
            for k in 0..RANK {
                own[k] = L::splat(-by[k]).mul_add(x, own[k]);
            }
        }
        self.0 = own;
    }

    /// Makes the rows of the factor that hold the strip's own pivots, lane `at` and on; of the diagonal the quotient.
    #[inline(always)]
    fn pivot(&mut self, at: usize, least: &[f64]) -> Pivots {
        let (mut out, mut own) = (Pivots::NONE, Wide::ZERO);
        for k in 0..RANK {
            self.0[k].store(&mut own);
            let numbers = four(&own, at);
            let (pivot, least) = (numbers[k], least.get(k).copied().unwrap_or(1.0));
            // NaN stays NaN.
            let pivot = if pivot < least { least } else { pivot };
            out.roots[k] = pivot.sqrt();
            out.inverses[k] = 1.0 / out.roots[k];
            out.factors[k] = numbers.map(|x| x * out.inverses[k]);
            self.forward(k, &out);
        }
        out
    }

    /// Whitens the rows among themselves.
    #[inline(always)]
    fn finish(&mut self, pivots: &Pivots) {
        for k in 0..RANK {
            self.forward(k, pivots);
        }
    }

    /// Scales a row and takes it out of those behind it.
    #[inline(always)]
    fn forward(&mut self, k: usize, pivots: &Pivots) {
        let own = self.0[k] * L::splat(pivots.inverses[k]);
        self.0[k] = own;
        for i in k + 1..RANK {
            self.0[i] = L::splat(-pivots.factors[k][i]).mul_add(own, self.0[i]);
        }
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
            least.clear();
            least.extend(p.diagonal().map(floor));
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
    fn what_only_neighbours_share_is_whitened_to_the_same_bits_as_with_a_far_number() {
        // A number in the corner that is lost in the sum makes the panel dense and changes no other one.
        let (n, c, near) = (43, 3, 5);
        let whitened = |corner: f64| {
            let (mut p, mut more, mut least) = (Panel::default(), Panel::default(), Vec::new());
            p.resize(n, n + c);
            more.resize(n, c);
            for i in 0..n {
                for j in i..n.min(i + near) {
                    p.set(i, j, if i == j { 4.0 } else { value(i * 37 + j * 11) });
                }
                for j in 0..c {
                    p.set(i, n + j, value(i * 7 + j * 101));
                    more.set(i, j, value(i * 7 + j * 101));
                }
            }
            p.set(0, n - 1, corner);
            least.extend(p.diagonal().map(floor));
            whiten(Isa::Plain, &mut p, &least);
            whiten_more(Isa::Plain, &p, &mut more);
            let upper = |i: usize| {
                (i..n + c).filter(move |j| *j != n - 1 || i + near >= n).map(move |j| (i, j))
            };
            let all: Vec<u64> =
                (0..n).flat_map(upper).map(|(i, j)| (p.get(i, j) + 0.0).to_bits()).collect();
            let beside: Vec<u64> =
                (0..n * c).map(|k| (more.get(k / c, k % c) + 0.0).to_bits()).collect();
            (p.reach(), all, beside)
        };
        let (dense, banded) = (whitened(1e-300), whitened(0.0));
        assert_eq!((dense.0, banded.0), (n - 1, near - 1));
        assert!(dense.1 == banded.1 && dense.2 == banded.2);
    }

    #[test]
    fn singular_covariances_are_lifted() {
        let (mut p, mut least) = (Panel::default(), Vec::new());
        p.resize(2, 3);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            p.set(i, j, 4.0);
        }
        p.set(1, 2, 1.0);
        least.extend(p.diagonal().map(floor));
        whiten(Isa::Plain, &mut p, &least);
        assert!(p.get(1, 1) > 0.0 && p.get(1, 2) * p.get(1, 1) == 1.0);
    }
}
