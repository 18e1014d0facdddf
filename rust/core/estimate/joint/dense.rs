//! Covariance of the lines where samples differ in variance: gaps, outliers, changing noise (dense, fixed).

use super::tile::Rows;
use crate::simd::{Lanes, Wide};

/// Standard deviation of a sample that counts for nothing, over the largest of the others: its value drops
/// out to nine digits.
const IGNORED: f64 = 1e4;

/// Inverse of the Cholesky factor of the covariance of (Re V(0),) Re V(1), Im V(1), …, row after row.
///
/// The factor of fewer lines is the leading part of that of more.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    inverse: Vec<f64>,
    size: usize,
}

impl Whitener {
    /// From each sample's variance (infinite: ignored), its quadrature weight over the window's length, and
    /// its phase in turns per harmonic; `weight` = 1/h of each line is taken out again by the caller's.
    pub fn new(
        variances: &[f64],
        weights: &[f64],
        turns: &[f64],
        first: usize,
        last: usize,
    ) -> Whitener {
        let most = variances.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let most = if most > 0.0 { most } else { 1.0 };
        let of = |v: &f64| if v.is_finite() { *v } else { most * IGNORED * IGNORED };
        // Q(d) = Σ w² σ² e^{−2πi d t/T}, d = 0..=2·last.
        let q: Vec<(f64, f64)> = (0..=2 * last)
            .map(|d| {
                let each = variances.iter().zip(weights).zip(turns);
                each.fold((0.0, 0.0), |(re, im), ((v, w), t)| {
                    let (sin, cos) = crate::math::sin_cos_turns_1(-(d as f64) * t);
                    let power = of(v) * w * w;
                    (power.mul_add(cos, re), power.mul_add(sin, im))
                })
            })
            .collect();
        let rows: Vec<(usize, bool)> = (first..=last)
            .flat_map(|m| [(m, false), (m, true)])
            .filter(|row| *row != (0, true))
            .collect();
        let size = rows.len();
        let entry = |a: (usize, bool), b: (usize, bool)| {
            let sum = q[a.0 + b.0];
            let gap = q[a.0.abs_diff(b.0)];
            // Q(m − l) for m < l is the conjugate.
            let gap = if a.0 >= b.0 { gap } else { (gap.0, -gap.1) };
            match (a.1, b.1) {
                (false, false) => 0.5 * (gap.0 + sum.0),
                (true, true) => 0.5 * (gap.0 - sum.0),
                (true, false) => 0.5 * (gap.1 + sum.1),
                (false, true) => 0.5 * (sum.1 - gap.1),
            }
        };
        let mut l: Vec<f64> = vec![0.0; size * size];
        for j in 0..size {
            for i in j..size {
                let own = (0..j).fold(entry(rows[i], rows[j]), |s, c| {
                    (-l[i * size + c]).mul_add(l[j * size + c], s)
                });
                l[i * size + j] =
                    if i == j { own.max(f64::MIN_POSITIVE).sqrt() } else { own / l[j * size + j] };
            }
        }
        let mut inverse = vec![0.0; size * size];
        for c in 0..size {
            for i in c..size {
                let one = if i == c { 1.0 } else { 0.0 };
                let sum = (c..i)
                    .fold(one, |s: f64, j| (-l[i * size + j]).mul_add(inverse[j * size + c], s));
                inverse[i * size + c] = sum / l[i * size + i];
            }
        }
        Whitener { inverse, size }
    }

    /// Whitens the rows of output `i` of all `lines` in use: `place` = (outputs, i, lines, whether the first
    /// is line 0).
    #[inline(always)]
    pub fn apply<L: Lanes>(
        &self,
        rows: &mut Rows,
        width: usize,
        place: (usize, usize, usize, bool),
    ) {
        let (q, i, lines, first_is_real) = place;
        let count = (2 * lines - usize::from(first_is_real)).min(self.size);
        for row in (0..count).rev() {
            for c in 0..width {
                let mut sum = L::splat(0.0);
                for from in 0..=row {
                    let (t, im) = at(from, first_is_real);
                    let part: &[Wide] = if im { &rows.im } else { &rows.re };
                    let value = L::load(&part[(t * q + i) * width + c]);
                    sum = L::splat(self.inverse[row * self.size + from]).mul_add(value, sum);
                }
                let (t, im) = at(row, first_is_real);
                let part = if im { &mut rows.im } else { &mut rows.re };
                sum.store(&mut part[(t * q + i) * width + c]);
            }
        }
    }
}

/// Line and part (whether imaginary) of a row.
#[inline(always)]
fn at(row: usize, first_is_real: bool) -> (usize, bool) {
    let row = row + usize::from(first_is_real && row > 0);
    (row / 2, row % 2 == 1)
}
