//! Factors of eight matrices at once, one a lane, with the operations of `dense` and `columns` in their order: each
//! lane has the bits that it has alone.

use crate::simd::{LANES, Lanes, Wide};
use std::ops::Range;

/// A matrix of an even number of rows, two columns after two others, so that sums over rows read memory in order.
#[derive(Default)]
pub struct Panel {
    rows: usize,
    data: Vec<[Wide; 2]>,
}

/// What two rows of a factor do to a column among themselves.
struct Pair<L> {
    inverses: [L; 2],
    /// Of the first row in the second.
    factor: L,
}

impl Panel {
    /// Memory for such a matrix; what stood there is not moved.
    pub fn resize(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.data.resize(columns.div_ceil(2) * rows, [Wide::ZERO; 2]);
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// An element.
    #[inline(always)]
    pub fn at(&self, row: usize, column: usize) -> &Wide {
        &self.data[column / 2 * self.rows + row][column % 2]
    }

    /// An element, to be written.
    #[inline(always)]
    pub fn at_mut(&mut self, row: usize, column: usize) -> &mut Wide {
        &mut self.data[column / 2 * self.rows + row][column % 2]
    }

    /// A column.
    pub fn column(&self, column: usize) -> impl Iterator<Item = &Wide> {
        self.data[column / 2 * self.rows..].iter().take(self.rows).map(move |x| &x[column % 2])
    }

    /// A column, to be written.
    pub fn column_mut(&mut self, column: usize) -> impl Iterator<Item = &mut Wide> {
        let from = &mut self.data[column / 2 * self.rows..];
        from.iter_mut().take(self.rows).map(move |x| &mut x[column % 2])
    }
}

/// Replaces the upper triangle of C by its factor R, C = RᵀR, and the columns beside it by R⁻ᵀ of them; pivots
/// below `least` are lifted to it. `panel` begins with \[C | columns\], so many in all, filled up to an even number.
#[inline(always)]
pub fn whiten<L: Lanes>(panel: &mut Panel, columns: usize, least: &[Wide]) {
    let rows = panel.rows;
    let columns = &mut panel.data[..columns.div_ceil(2) * rows];
    for (first, least) in (0..).step_by(2).zip(least.as_chunks::<2>().0) {
        let (done, rest) = columns.split_at_mut((first / 2 + 1) * rows);
        let own = &mut done[first / 2 * rows..];
        let [[a, b], [_, c]] = reduced::<L>(own, own, first);
        let root = lifted(a, &least[0]).sqrt();
        let inverse = L::splat(1.0) / root;
        let factor = b * inverse;
        let last = lifted((-factor).mul_add(factor, c), &least[1]).sqrt();
        root.store(&mut own[first][0]);
        factor.store(&mut own[first][1]);
        last.store(&mut own[first + 1][1]);
        let pair = Pair { inverses: [inverse, L::splat(1.0) / last], factor };
        for other in rest.chunks_exact_mut(rows) {
            finish(&pair, own, other, first);
        }
    }
}

/// Replaces these columns of `panel`, whole pairs, by R⁻ᵀ of them, R the factor that [`whiten`] left.
#[inline(always)]
pub fn whiten_more<L: Lanes>(panel: &mut Panel, columns: Range<usize>) {
    let rows = panel.rows;
    let (factors, rest) = panel.data.split_at_mut(columns.start / 2 * rows);
    let rest = &mut rest[..columns.len().div_ceil(2) * rows];
    for (own, first) in factors.chunks_exact(rows).zip((0..rows).step_by(2)) {
        let inverse = |root: &Wide| L::splat(1.0) / L::load(root);
        let pair = Pair {
            inverses: [inverse(&own[first][0]), inverse(&own[first + 1][1])],
            factor: L::load(&own[first][1]),
        };
        for other in rest.chunks_exact_mut(rows) {
            finish(&pair, own, other, first);
        }
    }
}

/// NaN stays NaN.
#[inline(always)]
fn lifted<L: Lanes>(pivot: L, least: &Wide) -> L {
    let least = L::load(least);
    pivot.select_lt(least, least, pivot)
}

/// Two columns of two rows, the rows above taken out one after the other by the factors of their pivots.
#[inline(always)]
fn reduced<L: Lanes>(pivots: &[[Wide; 2]], columns: &[[Wide; 2]], first: usize) -> [[L; 2]; 2] {
    let (above, own) = columns.split_at(first);
    let mut tile = [&own[0], &own[1]].map(|row| [L::load(&row[0]), L::load(&row[1])]);
    for (by, row) in pivots.iter().zip(above) {
        let by = [-L::load(&by[0]), -L::load(&by[1])];
        let (x, y) = (L::load(&row[0]), L::load(&row[1]));
        for k in 0..2 {
            tile[k] = [by[k].mul_add(x, tile[k][0]), by[k].mul_add(y, tile[k][1])];
        }
    }
    tile
}

/// Whitens two columns of two rows.
#[inline(always)]
fn finish<L: Lanes>(pair: &Pair<L>, pivots: &[[Wide; 2]], columns: &mut [[Wide; 2]], first: usize) {
    let tile = reduced::<L>(pivots, columns, first);
    for k in 0..2 {
        let own = tile[0][k] * pair.inverses[0];
        let next = (-pair.factor).mul_add(own, tile[1][k]) * pair.inverses[1];
        own.store(&mut columns[first][k]);
        next.store(&mut columns[first + 1][k]);
    }
}

/// Solves Rx = b in place, R the factor of so many rows that [`whiten`] left in `panel`.
#[inline(always)]
pub fn back<L: Lanes>(panel: &Panel, x: &mut [Wide]) {
    let size = x.len();
    for j in (0..size).rev() {
        let term = |k: usize| (L::load(panel.at(j, k)), L::load(&x[k]));
        // `dense` sums whole registers in eight parts, the rest of its own register one by one.
        let near = (j / LANES * LANES + LANES).min(size);
        let mut parts = [L::splat(0.0); LANES];
        for k in near..size {
            let (r, x) = term(k);
            parts[k % LANES] = r.mul_add(x, parts[k % LANES]);
        }
        let mut sum = L::load(&x[j]) - total(parts);
        for k in j + 1..near {
            let (r, x) = term(k);
            sum = sum - r * x;
        }
        let own = sum / L::load(panel.at(j, j));
        own.store(&mut x[j]);
    }
}

#[inline(always)]
fn total<L: Lanes>([first, rest @ ..]: [L; LANES]) -> L {
    rest.into_iter().fold(first, |sum, part| sum + part)
}

/// Makes the last of the columns of `q`, each of so many rows, orthonormal to those before; zero where less than
/// `dependent` of it is left beside them.
#[inline(always)]
pub fn push<L: Lanes>(q: &mut [Wide], rows: usize, dependent: f64) {
    let (before, column) = q.split_at_mut(q.len() - rows);
    let size = dot::<L>(column, column).sqrt();
    project::<L>(before, column);
    let left = dot::<L>(column, column).sqrt();
    let (least, zero) = (L::splat(dependent) * size, L::splat(0.0));
    let by = L::splat(1.0) / left;
    for x in column {
        least.select_lt(left, L::load(x) * by, zero).store(x);
    }
}

/// Takes the columns of `q` out of one, twice.
#[inline(always)]
pub fn project<L: Lanes>(q: &[Wide], column: &mut [Wide]) {
    for _ in 0..2 {
        for q in q.chunks_exact(column.len()) {
            let by = -dot::<L>(q, column);
            for (x, q) in column.iter_mut().zip(q) {
                by.mul_add(L::load(q), L::load(x)).store(x);
            }
        }
    }
}

/// In eight parts.
#[inline(always)]
fn dot<L: Lanes>(a: &[Wide], b: &[Wide]) -> L {
    let mut parts = [L::splat(0.0); LANES];
    for (a, b) in a.chunks(LANES).zip(b.chunks(LANES)) {
        for (part, (a, b)) in parts.iter_mut().zip(a.iter().zip(b)) {
            *part = L::load(a).mul_add(L::load(b), *part);
        }
    }
    total(parts)
}

/// Sum of squares as `qr::dot` adds it.
#[inline(always)]
pub fn squares<L: Lanes>(x: &[Wide]) -> L {
    let (eights, rest) = x.as_chunks::<LANES>();
    let mut parts = [L::splat(0.0); LANES];
    for own in eights {
        for (part, x) in parts.iter_mut().zip(own) {
            *part = *part + L::load(x) * L::load(x);
        }
    }
    let rest = rest.iter().fold(L::splat(-0.0), |sum, x| sum + L::load(x) * L::load(x));
    total(parts) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::columns::Columns;
    use crate::linalg::dense::{self, floor};
    use crate::simd::{Isa, Kernel, numbers, numbers_mut};

    const ROWS: usize = 22;
    const BESIDE: usize = 2;
    const MORE: usize = 3;
    const WIDTH: usize = ROWS + BESIDE + MORE;

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    /// C = GGᵀ, of one lane singular, and columns.
    fn element(lane: usize, i: usize, j: usize) -> f64 {
        let g = |i: usize, k: usize| value(lane * 311 + i.min(ROWS - 2 + lane % 7) * 37 + k * 11);
        match j < ROWS {
            true => (0..ROWS).map(|k| g(i, k) * g(j, k)).sum(),
            false => value(lane * 97 + i * 13 + j * 7),
        }
    }

    struct All<'a> {
        panel: &'a mut Panel,
        least: &'a [Wide],
        x: &'a mut [Wide],
        q: &'a mut [Wide],
        column: &'a mut [Wide],
    }

    impl Kernel for All<'_> {
        type Output = Wide;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Wide {
            let All { panel, least, x, q, column } = self;
            whiten::<L>(panel, ROWS + BESIDE, least);
            whiten_more::<L>(panel, ROWS + BESIDE..WIDTH);
            back::<L>(panel, x);
            for k in 1..=q.len() / ROWS {
                push::<L>(&mut q[..k * ROWS], ROWS, 1e-10);
            }
            project::<L>(q, column);
            let mut out = Wide::ZERO;
            squares::<L>(&column[..ROWS - 3]).store(&mut out);
            out
        }
    }

    #[test]
    fn every_lane_has_the_bits_of_one_matrix_alone() {
        let wide = |f: &dyn Fn(usize) -> f64| Wide(std::array::from_fn(f));
        for isa in Isa::available() {
            let mut panel = Panel::default();
            panel.resize(ROWS, WIDTH);
            for (i, j) in (0..ROWS * WIDTH).map(|k| (k / WIDTH, k % WIDTH)) {
                *panel.at_mut(i, j) = wide(&|lane| element(lane, i, j));
            }
            let least: Vec<Wide> =
                (0..ROWS).map(|i| wide(&|lane| floor(element(lane, i, i)))).collect();
            let column = |c: usize| -> Vec<Wide> {
                // The second is a part of the first in one lane.
                let own = |lane: usize, i: usize| match (c, lane) {
                    (1, 3) => 0.5 * value(3 * 53 + i * 5),
                    _ => value(lane * 53 + i * 5 + c * 401),
                };
                (0..ROWS).map(|i| wide(&|lane| own(lane, i))).collect()
            };
            let (mut x, mut last) = (column(5), column(6));
            let mut q = [column(0), column(1), column(2)].concat();
            let (right, start, side) = (x.clone(), q.clone(), last.clone());
            let sum = isa.run(All {
                panel: &mut panel,
                least: &least,
                x: &mut x,
                q: &mut q,
                column: &mut last,
            });
            for lane in 0..LANES {
                let (mut one, mut more) = (dense::Panel::default(), dense::Panel::default());
                one.resize(ROWS, ROWS + BESIDE);
                more.resize(ROWS, MORE);
                for (i, j) in (0..ROWS * WIDTH).map(|k| (k / WIDTH, k % WIDTH)) {
                    match j.checked_sub(ROWS + BESIDE) {
                        Some(c) => more.set(i, c, element(lane, i, j)),
                        None => one.set(i, j, element(lane, i, j)),
                    }
                }
                let own: Vec<f64> = least.iter().map(|l| l.0[lane]).collect();
                dense::whiten(isa, &mut one, &own);
                dense::whiten_more(isa, &one, &mut more);
                for i in 0..ROWS {
                    for j in i..WIDTH {
                        let want = match j.checked_sub(ROWS + BESIDE) {
                            Some(c) => more.get(i, c),
                            None => one.get(i, j),
                        };
                        let found = panel.at(i, j).0[lane];
                        assert_eq!(found.to_bits(), want.to_bits(), "{isa:?} {lane} {i} {j}");
                    }
                }
                let mut b = vec![Wide::ZERO; ROWS.div_ceil(LANES)];
                let each = numbers_mut(&mut b).iter_mut().zip(&right);
                each.for_each(|(to, from)| *to = from.0[lane]);
                dense::back(isa, &one, &mut b);
                let same = |own: &[Wide], alone: &[f64]| {
                    let each = own.iter().zip(alone);
                    each.for_each(|(own, x)| assert_eq!(own.0[lane].to_bits(), x.to_bits()));
                };
                same(&x, numbers(&b));
                let mut base = Columns::new(isa, ROWS, 3).judged_by(1e-10);
                for (k, c) in start.chunks(ROWS).enumerate() {
                    let own: Vec<f64> = c.iter().map(|x| x.0[lane]).collect();
                    assert_eq!(base.push_rows(&own), !(k == 1 && lane == 3), "{lane} {k}");
                }
                for (k, c) in q.chunks(ROWS).enumerate() {
                    same(c, base.q(k));
                }
                let mut left: Vec<f64> = side.iter().map(|x| x.0[lane]).collect();
                left.resize(base.rows(), 0.0);
                base.project(0, &mut left, &mut [0.0; 3]);
                same(&last, &left);
                let short = &left[..ROWS - 3];
                assert_eq!(sum.0[lane], crate::linalg::qr::dot(short, short));
            }
        }
    }
}
