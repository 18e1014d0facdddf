//! How many poles are unstable, without the poles.

/// Roots of sⁿ + a₁ sⁿ⁻¹ + … + aₙ with a positive real part: sign changes in the first column of Routh's scheme. Roots
/// on the imaginary axis count, too.
pub(crate) fn unstable_poles(a: &[f64]) -> usize {
    let mut all: Vec<f64> = std::iter::once(1.0).chain(a.iter().copied()).collect();
    unstable_roots(&mut all)
}

/// The same of a polynomial with its first coefficient, in place of which the scheme's first column is written: two rows
/// stand in it in turn.
pub(crate) fn unstable_roots(row: &mut [f64]) -> usize {
    let mut changes = 0;
    for k in 1..row.len() {
        let ratio = row[k - 1] / row[k];
        // NaN is no sign, either.
        let same = ratio > 0.0;
        changes += usize::from(!same);
        for j in (k + 1..row.len() - 1).step_by(2) {
            row[j] -= ratio * row[j + 1];
        }
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::unstable_poles;

    /// Coefficients after the first of Π (s − pole), pairs by their upper pole.
    fn polynomial(real: &[f64], pairs: &[(f64, f64)]) -> Vec<f64> {
        let factors = real.iter().map(|p| vec![1.0, -p]);
        let pairs = pairs.iter().map(|(re, im)| vec![1.0, -2.0 * re, re * re + im * im]);
        let mut product = vec![1.0];
        for factor in factors.chain(pairs) {
            let mut next = vec![0.0; product.len() + factor.len() - 1];
            for (i, a) in product.iter().enumerate() {
                for (j, b) in factor.iter().enumerate() {
                    next[i + j] += a * b;
                }
            }
            product = next;
        }
        product.split_off(1)
    }

    #[test]
    fn unstable_poles_are_counted() {
        for (real, pairs, wanted) in [
            (&[-1.0][..], &[][..], 0),
            (&[70.0], &[], 1),
            (&[-200.0, 3.0], &[], 1),
            (&[-2.0], &[(-0.01, 40.0)], 0),
            (&[-2.0], &[(0.01, 40.0)], 2),
            (&[-0.1, 5.0], &[(0.5, 3.0), (-4.0, 100.0)], 3),
            (&[1.0, 2.0, 3.0], &[(1.0, 1.0)], 5),
            (&[-1e-3, -1e3], &[(-1.0, 1e3), (-2.0, 7.0)], 0),
            (&[], &[(0.0, 1.0)], 1),
        ] {
            assert_eq!(unstable_poles(&polynomial(real, pairs)), wanted, "{real:?} {pairs:?}");
        }
    }
}
