//! Small complex matrices, row major: what one line of a few outputs needs.

/// A complex number.
pub(crate) type C = (f64, f64);

pub(crate) fn times(a: C, b: C) -> C {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

/// a + b c.
pub(crate) fn plus(a: C, b: C, c: C) -> C {
    (a.0 + b.0 * c.0 - b.1 * c.1, a.1 + b.0 * c.1 + b.1 * c.0)
}

/// a − b c.
fn less(a: C, b: C, c: C) -> C {
    (a.0 - b.0 * c.0 + b.1 * c.1, a.1 - b.0 * c.1 - b.1 * c.0)
}

pub(crate) fn conjugate(a: C) -> C {
    (a.0, -a.1)
}

pub(crate) fn by(a: C, factor: f64) -> C {
    (a.0 * factor, a.1 * factor)
}

pub(crate) fn square(a: C) -> f64 {
    a.0 * a.0 + a.1 * a.1
}

/// `out` = `a` `x` of one column.
pub(crate) fn apply(a: &[C], x: &[C], out: &mut [C]) {
    for (to, row) in out.iter_mut().zip(a.chunks(x.len())) {
        *to = row.iter().zip(x).fold((0.0, 0.0), |sum, (a, x)| plus(sum, *a, *x));
    }
}

/// The inverse of `a` (which is lost) into `out`, and |det a|²; zeros and 0 where it has none.
pub(crate) fn invert(a: &mut [C], n: usize, out: &mut [C]) -> f64 {
    out.fill((0.0, 0.0));
    for i in 0..n {
        out[i * n + i].0 = 1.0;
    }
    let mut det = 1.0;
    for j in 0..n {
        let mut best = j;
        for i in j + 1..n {
            if square(a[i * n + j]) > square(a[best * n + j]) {
                best = i;
            }
        }
        let size = square(a[best * n + j]);
        det *= size;
        if size.is_nan() || size <= 0.0 {
            out.fill((0.0, 0.0));
            return 0.0;
        }
        for k in 0..n {
            a.swap(j * n + k, best * n + k);
            out.swap(j * n + k, best * n + k);
        }
        let inverse = by(conjugate(a[j * n + j]), 1.0 / size);
        for k in 0..n {
            a[j * n + k] = times(a[j * n + k], inverse);
            out[j * n + k] = times(out[j * n + k], inverse);
        }
        for i in (0..n).filter(|i| *i != j) {
            let factor = a[i * n + j];
            for k in 0..n {
                a[i * n + k] = less(a[i * n + k], factor, a[j * n + k]);
                out[i * n + k] = less(out[i * n + k], factor, out[j * n + k]);
            }
        }
    }
    det
}

/// The lower factor of a Hermitian matrix in its place, and the product of the squares of its pivots.
pub(crate) fn factor(s: &mut [C], n: usize) -> f64 {
    let mut det = 1.0;
    for j in 0..n {
        let mut pivot = s[j * n + j].0;
        for k in 0..j {
            pivot -= square(s[j * n + k]);
        }
        det *= pivot;
        let root = pivot.sqrt();
        s[j * n + j] = (root, 0.0);
        for i in j + 1..n {
            let mut own = s[i * n + j];
            for k in 0..j {
                own = less(own, s[i * n + k], conjugate(s[j * n + k]));
            }
            s[i * n + j] = by(own, 1.0 / root);
        }
    }
    det
}

/// `x` = L⁻¹ `x`.
pub(crate) fn whiten(l: &[C], x: &mut [C]) {
    let n = x.len();
    for i in 0..n {
        let mut own = x[i];
        for k in 0..i {
            own = less(own, l[i * n + k], x[k]);
        }
        x[i] = by(own, 1.0 / l[i * n + i].0);
    }
}

/// `out` = L `x`.
pub(crate) fn colour(l: &[C], x: &[C], out: &mut [C]) {
    let n = x.len();
    for (i, to) in out.iter_mut().enumerate() {
        *to = (0..=i).fold((0.0, 0.0), |sum, k| plus(sum, l[i * n + k], x[k]));
    }
}

/// Writes a line's outputs as rows of unit variance, `count` real ones each.
pub(super) fn spread(from: &[C], count: f64, rows: &mut [f64], (lines, line): (usize, usize)) {
    let root = count.sqrt();
    for (e, own) in from.iter().enumerate() {
        rows[2 * e * lines + line] = own.0 * root;
        rows[(2 * e + 1) * lines + line] = own.1 * root;
    }
}

/// The reverse.
pub(super) fn gather(rows: &[f64], count: f64, to: &mut [C], (lines, line): (usize, usize)) {
    let root = 1.0 / count.sqrt();
    for (e, own) in to.iter_mut().enumerate() {
        *own = (rows[2 * e * lines + line] * root, rows[(2 * e + 1) * lines + line] * root);
    }
}

/// Adds `by` (x yᴴ + y xᴴ)/2 to a Hermitian matrix written as real numbers, so that products of two such are
/// traces: the diagonal, then √2 times Re and Im of what is above it.
pub(crate) fn add_outer(x: &[C], y: &[C], by: f64, out: &mut [f64]) {
    let n = x.len();
    let mut at = n;
    for i in 0..n {
        out[i] += by * (x[i].0 * y[i].0 + x[i].1 * y[i].1);
        for k in i + 1..n {
            let (a, b) = (times(x[i], conjugate(y[k])), times(y[i], conjugate(x[k])));
            let half = by * std::f64::consts::FRAC_1_SQRT_2;
            out[at] += half * (a.0 + b.0);
            out[at + 1] += half * (a.1 + b.1);
            at += 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [C; 9] = [
        (2.0, 1.0),
        (0.3, -0.4),
        (0.1, 0.0),
        (-1.0, 0.5),
        (0.0, 3.0),
        (0.2, 0.7),
        (0.6, 0.0),
        (0.0, -0.2),
        (1.5, -1.0),
    ];

    #[test]
    fn an_inverse_undoes_its_matrix() {
        let (mut lost, mut inverse) = (A, [(0.0, 0.0); 9]);
        assert!(invert(&mut lost, 3, &mut inverse) > 0.0);
        for j in 0..3 {
            let column: Vec<C> = (0..3).map(|i| A[i * 3 + j]).collect();
            let mut out = [(0.0, 0.0); 3];
            apply(&inverse, &column, &mut out);
            for (i, own) in out.iter().enumerate() {
                assert!((own.0 - f64::from(u8::from(i == j))).abs() < 1e-14);
                assert!(own.1.abs() < 1e-14);
            }
        }
    }

    #[test]
    fn determinants_agree_and_factors_colour_back() {
        // S = A Aᴴ has the determinant |det A|².
        let mut s = [(0.0, 0.0); 9];
        for i in 0..3 {
            for j in 0..3 {
                s[i * 3 + j] = (0..3)
                    .fold((0.0, 0.0), |sum, k| plus(sum, A[i * 3 + k], conjugate(A[j * 3 + k])));
            }
        }
        let whole = s;
        let det = factor(&mut s, 3);
        let (mut lost, mut inverse) = (A, [(0.0, 0.0); 9]);
        let other = invert(&mut lost, 3, &mut inverse);
        assert!((det / other - 1.0).abs() < 1e-13);
        let x = [(1.0, -2.0), (0.5, 0.0), (0.0, 3.0)];
        let mut out = [(0.0, 0.0); 3];
        colour(&s, &x, &mut out);
        whiten(&s, &mut out);
        assert!(out.iter().zip(&x).all(|(a, b)| square((a.0 - b.0, a.1 - b.1)) < 1e-26));
        // tr(S x xᴴ) = |Lᴴx|².
        let (mut left, mut right) = ([0.0; 9], [0.0; 9]);
        for k in 0..3 {
            let column: Vec<C> = (0..3).map(|i| A[i * 3 + k]).collect();
            add_outer(&column, &column, 1.0, &mut left);
        }
        add_outer(&x, &x, 1.0, &mut right);
        let trace: f64 = left.iter().zip(&right).map(|(a, b)| a * b).sum();
        let mut sx = [(0.0, 0.0); 3];
        apply(&whole, &x, &mut sx);
        let plain: f64 = x.iter().zip(&sx).map(|(x, s)| times(conjugate(*x), *s).0).sum();
        assert!((trace / plain - 1.0).abs() < 1e-13);
    }

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        let (mut a, mut out) = ([(1.0, 0.0), (2.0, 0.0), (2.0, 0.0), (4.0, 0.0)], [(1.0, 1.0); 4]);
        assert_eq!(invert(&mut a, 2, &mut out), 0.0);
        assert_eq!(out, [(0.0, 0.0); 4]);
    }
}
