//! How dependent the columns of a least squares problem can at most be, for less than eigenvalues cost.

/// No less than the condition number of columns with this normal matrix (row major, unit diagonal): with
/// G = LLᵀ, λ_max ≤ tr G = p and 1/λ_min ≤ tr G⁻¹ = ‖L⁻¹‖². Infinite where there is no such L.
pub(crate) fn condition_bound(gram: &[f64], p: usize) -> f64 {
    let mut l = gram.to_vec();
    let mut inverse = vec![0.0; p * p];
    let mut trace = 0.0;
    for i in 0..p {
        for j in 0..=i {
            let dot = (0..j).fold(l[i * p + j], |s, k| s - l[i * p + k] * l[j * p + k]);
            l[i * p + j] = if i == j { dot.sqrt() } else { dot / l[j * p + j] };
        }
        let pivot = l[i * p + i];
        let sound = pivot > 0.0 && pivot.is_finite();
        if !sound {
            return f64::INFINITY;
        }
        for j in 0..=i {
            let unit = if i == j { 1.0 } else { 0.0 };
            let dot = (j..i).fold(unit, |s: f64, k| s - l[i * p + k] * inverse[k * p + j]);
            inverse[i * p + j] = dot / pivot;
            trace += dot / pivot * (dot / pivot);
        }
    }
    (p as f64 * trace).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_columns_with_a_known_angle() {
        for r in [0.0, 0.5, -0.9, 0.999_999_999] {
            let exact = f64::sqrt((1.0 + f64::abs(r)) / (1.0 - f64::abs(r)));
            let bound = condition_bound(&[1.0, r, r, 1.0], 2);
            assert!(bound >= exact * (1.0 - 1e-7) && bound <= 2.0 * exact, "{r}: {exact} {bound}");
        }
    }

    #[test]
    fn dependent_columns_and_no_numbers() {
        for bad in [[1.0, 1.0, 1.0, 1.0], [1.0, 1.1, 1.1, 1.0], [f64::NAN; 4], [0.0; 4]] {
            assert_eq!(condition_bound(&bad, 2), f64::INFINITY, "{bad:?}");
        }
        assert_eq!(condition_bound(&[1.0], 1), 1.0);
    }
}
