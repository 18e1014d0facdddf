//! Householder factors for one ill-conditioned system: rows are absorbed tile by tile, nothing is allocated.
//!
//! It solves JᵀΓθ = −Jᵀg without forming the product, so that the condition number enters once and
//! not squared. Written out rather than taken from a library because it must give the same bits on
//! every processor and allocate nothing inside a replicate.

/// Factors of the stacked rows seen so far: J = QR, and the part of Qᵀ\[Γ, g\] that R needs.
#[derive(Debug, Clone, Default)]
pub struct Absorber {
    columns: usize,
    /// Leading `columns` rows: R and QᵀΓ; behind them the tile's rows. Column major.
    j: Vec<f64>,
    g: Vec<f64>,
    height: usize,
    filled: usize,
}

impl Absorber {
    /// For `columns` unknowns and tiles of at most `tile` rows.
    #[must_use]
    pub fn new(columns: usize, tile: usize) -> Absorber {
        let height = columns + tile;
        Absorber {
            columns,
            j: vec![0.0; height * columns],
            g: vec![0.0; height * (columns + 1)],
            height,
            filled: columns,
        }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.j.fill(0.0);
        self.g.fill(0.0);
        self.filled = self.columns;
    }

    /// Adds a row of J and the row [Γ, g]; absorbs the tile when it is full.
    pub fn push(&mut self, j: impl Iterator<Item = f64>, g: impl Iterator<Item = f64>) {
        if self.filled == self.height {
            self.absorb();
        }
        for (c, value) in j.take(self.columns).enumerate() {
            self.j[c * self.height + self.filled] = value;
        }
        for (c, value) in g.take(self.columns + 1).enumerate() {
            self.g[c * self.height + self.filled] = value;
        }
        self.filled += 1;
    }

    /// Triangularises what stands: afterwards only the leading `columns` rows matter.
    pub fn absorb(&mut self) {
        triangularise(&mut self.j, &mut self.g, self.columns, (self.height, self.filled));
        self.filled = self.columns;
    }

    /// R(i, j), upper triangular after [`Absorber::absorb`].
    #[must_use]
    pub fn r(&self, i: usize, j: usize) -> f64 {
        self.j[j * self.height + i]
    }

    /// (Qᵀ\[Γ, g\])(i, j).
    #[must_use]
    pub fn qt(&self, i: usize, j: usize) -> f64 {
        self.g[j * self.height + i]
    }
}

/// Householder's reflections that make the `columns` leading ones of `left` triangular, applied to those of `right`
/// too: column major, `height` apart, the first `rows` rows of each.
pub(crate) fn triangularise(
    left: &mut [f64],
    right: &mut [f64],
    columns: usize,
    (height, rows): (usize, usize),
) {
    for k in 0..columns {
        let (done, rest) = left.split_at_mut((k + 1) * height);
        let v = &mut done[k * height..k * height + rows];
        // Above a tile R is triangular: rows k+1..columns of column k are zero already.
        let norm = dot(&v[k..], &v[k..]).sqrt();
        if norm == 0.0 || !norm.is_finite() {
            continue;
        }
        let alpha = if v[k] > 0.0 { -norm } else { norm };
        v[k] -= alpha;
        let scale = 1.0 / (norm * (norm + (v[k] + alpha).abs()));
        for column in rest.chunks_exact_mut(height).chain(right.chunks_exact_mut(height)) {
            let column = &mut column[k..rows];
            let factor = -scale * dot(&v[k..], column);
            for (c, x) in column.iter_mut().zip(&v[k..]) {
                *c += factor * x;
            }
        }
        v[k] = alpha;
        v[k + 1..].fill(0.0);
    }
}

/// In eight sums, so that they go side by side; plain products, since a scalar fused one is a call where the
/// processor is not known. Both are the same on every processor.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, rest_a) = a.as_chunks::<8>();
    let (b, rest_b) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (x, y) in a.iter().zip(b) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}

/// R⁻¹ of an upper triangular matrix, row major, of which R(i, j) with i ≤ j is asked for; `add` makes s + ab. What
/// stands in `inverse` is lost.
pub(crate) fn inverse_of_triangle(
    size: usize,
    r: impl Fn(usize, usize) -> f64,
    add: impl Fn(f64, f64, f64) -> f64,
    inverse: &mut [f64],
) {
    inverse.fill(0.0);
    for j in 0..size {
        inverse[j * size + j] = 1.0 / r(j, j);
        for i in (0..j).rev() {
            let sum = (i + 1..=j).fold(0.0, |s, k| add(s, r(i, k), inverse[k * size + j]));
            inverse[i * size + j] = -sum / r(i, i);
        }
    }
}

/// Solves the square system by elimination with column scaling and partial pivoting, in place.
///
/// `a` is row major `size` × (`size` + 1) with the right side last; the solution replaces it. Returns
/// the smallest pivot relative to its scaled column: 0 or NaN where the matrix is singular. Plain products as
/// in `dot`: five times as fast as fused ones at 36 unknowns.
pub fn solve_square(a: &mut [f64], size: usize, x: &mut [f64], scale: &mut [f64]) -> f64 {
    let w = size + 1;
    for j in 0..size {
        let norm = (0..size).map(|i| a[i * w + j] * a[i * w + j]).sum::<f64>().sqrt();
        scale[j] = if norm > 0.0 { 1.0 / norm } else { 1.0 };
        for i in 0..size {
            a[i * w + j] *= scale[j];
        }
    }
    let mut worst = f64::INFINITY;
    for k in 0..size {
        let best =
            (k..size).fold(k, |p, i| if a[i * w + k].abs() > a[p * w + k].abs() { i } else { p });
        if best != k {
            let (above, below) = a.split_at_mut(best * w);
            above[k * w..(k + 1) * w].swap_with_slice(&mut below[..w]);
        }
        let pivot = a[k * w + k];
        worst = if pivot.abs() < worst { pivot.abs() } else { worst };
        if pivot == 0.0 || !pivot.is_finite() {
            return 0.0;
        }
        let (above, below) = a.split_at_mut((k + 1) * w);
        let top = &above[k * w + k + 1..];
        for row in below.chunks_exact_mut(w).take(size - k - 1) {
            let factor = row[k] / pivot;
            for (x, top) in row[k + 1..].iter_mut().zip(top) {
                *x -= factor * top;
            }
        }
    }
    for i in (0..size).rev() {
        let (row, known) = (&a[i * w..(i + 1) * w], &x[i + 1..size]);
        let sum: f64 = row[i + 1..size].iter().zip(known).map(|(a, x)| a * x).sum();
        x[i] = (row[size] - sum) / row[i];
    }
    for j in 0..size {
        x[j] *= scale[j];
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5
    }

    #[test]
    fn factors_reproduce_the_normal_equations_for_any_tile() {
        let (rows, c) = (23, 4);
        let j = |r: usize, k: usize| value(r * 7 + k * 31 + 1);
        let g = |r: usize, k: usize| value(r * 11 + k * 17 + 5);
        for tile in [1, 5, 23, 40] {
            let mut a = Absorber::new(c, tile);
            for r in 0..rows {
                a.push((0..c).map(|k| j(r, k)), (0..=c).map(|k| g(r, k)));
            }
            a.absorb();
            for p in 0..c {
                for q in 0..=c {
                    let want: f64 = (0..rows).map(|r| j(r, p) * g(r, q)).sum();
                    let got: f64 = (0..c).map(|i| a.r(i, p) * a.qt(i, q)).sum();
                    assert!((want - got).abs() < 1e-13, "tile {tile}");
                }
            }
        }
    }

    #[test]
    fn square_systems_and_singular_ones() {
        let n = 5;
        let m: Vec<f64> = (0..n * (n + 1)).map(|k| value(k * k + 3)).collect();
        let (mut a, mut x, mut s) = (m.clone(), vec![0.0; n], vec![0.0; n]);
        assert!(solve_square(&mut a, n, &mut x, &mut s) > 1e-4);
        for i in 0..n {
            let sum: f64 = (0..n).map(|j| m[i * (n + 1) + j] * x[j]).sum();
            assert!((sum - m[i * (n + 1) + n]).abs() < 1e-12);
        }
        let mut singular = vec![1.0, 2.0, 0.0, 2.0, 4.0, 1.0];
        assert!(solve_square(&mut singular, 2, &mut x, &mut s) < 1e-15);
    }
}
