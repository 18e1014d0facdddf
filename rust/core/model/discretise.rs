//! Matrix exponentials by arithmetic alone, and the exact discrete twins of held inputs.

/// Degree of the Taylor polynomial: its remainder at norm 1 is 1/19! = 8e-18.
const DEGREE: usize = 18;

/// φ₀ = e^A, φ₁ = ∫₀¹ e^{Aσ} dσ and φ₂ = ∫₀¹ e^{A(1−σ)} σ dσ of an n × n matrix, row by row.
///
/// With A = Ãh they give the exact response over one sample: e^{Ãh}, a constant input through h φ₁ B,
/// a ramp from 0 to 1 through h φ₂ B. They stand in the first row of
/// exp [[A, I, 0], [0, 0, I], [0, 0, 0]]. The states are balanced by powers of two first, since
/// companion matrices in fast time hold very unlike numbers.
#[must_use]
pub fn phi(n: usize, a: &[f64]) -> [Vec<f64>; 3] {
    let (balanced, by) = balance(n, a);
    let wide = 3 * n;
    let mut augmented = vec![0.0; wide * wide];
    for i in 0..n {
        augmented[i * wide..][..n].copy_from_slice(&balanced[i * n..][..n]);
        augmented[i * wide + n + i] = 1.0;
        augmented[(n + i) * wide + 2 * n + i] = 1.0;
    }
    let whole = exponential(wide, &augmented);
    std::array::from_fn(|block| {
        let entry = |k: usize| {
            let (i, j) = (k / n, k % n);
            whole[i * wide + block * n + j] * (by[i] / by[j])
        };
        (0..n * n).map(entry).collect()
    })
}

/// e^A of a balanced n × n matrix by scaling and squaring: A/2^s to norm ≤ 1, Taylor, s squarings.
#[must_use]
pub fn exponential(n: usize, a: &[f64]) -> Vec<f64> {
    let column = |j: usize| (0..n).map(|i| a[i * n + j].abs()).sum::<f64>();
    let norm = (0..n).map(column).fold(0.0, f64::max);
    let (mut squarings, mut by) = (0, 1.0);
    while norm * by > 1.0 && squarings < 1100 {
        by *= 0.5;
        squarings += 1;
    }
    let scaled: Vec<f64> = a.iter().map(|x| x * by).collect();
    let mut sum = identity(n);
    for k in (1..=DEGREE).rev() {
        sum = product(n, &scaled, &sum);
        for x in &mut sum {
            *x /= k as f64;
        }
        for i in 0..n {
            sum[i * n + i] += 1.0;
        }
    }
    for _ in 0..squarings {
        sum = product(n, &sum, &sum);
    }
    sum
}

/// D⁻¹AD with D = diag(d), d powers of two that make rows and columns alike in size.
#[must_use]
pub fn balance(n: usize, a: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut a, mut by) = (a.to_vec(), vec![1.0; n]);
    for _ in 0..100 {
        let mut settled = true;
        for i in 0..n {
            let others = || (0..n).filter(|&j| j != i);
            let row: f64 = others().map(|j| a[i * n + j].abs()).sum();
            let column: f64 = others().map(|j| a[j * n + i].abs()).sum();
            if !(row > 0.0 && column > 0.0 && (row + column).is_finite()) {
                continue;
            }
            let (mut f, mut c) = (1.0, column);
            while c < 0.5 * row {
                (f, c) = (2.0 * f, 4.0 * c);
            }
            // What quadrupling made infinite stays so.
            while c.is_finite() && c >= 2.0 * row {
                (f, c) = (0.5 * f, 0.25 * c);
            }
            if (c + row) / f < 0.95 * (column + row) {
                settled = false;
                by[i] *= f;
                for j in 0..n {
                    a[i * n + j] /= f;
                    a[j * n + i] *= f;
                }
            }
        }
        if settled {
            break;
        }
    }
    (a, by)
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|k| if k % (n + 1) == 0 { 1.0 } else { 0.0 }).collect()
}

/// Product of two n × n matrices.
fn product(n: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut c = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..n {
            let factor = a[i * n + k];
            if factor != 0.0 {
                for (c, b) in c[i * n..][..n].iter_mut().zip(&b[k * n..][..n]) {
                    *c += factor * b;
                }
            }
        }
    }
    c
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn scalars_are_the_exponential_and_its_integrals() {
        for x in [-40.0_f64, -3.0, -1e-9, 0.0, 1e-5, 0.7, 9.0] {
            let [e, one, two] = phi(1, &[x]);
            assert!((e[0] / x.exp() - 1.0).abs() < 1e-13, "{x} {} {}", e[0], x.exp());
            if x.abs() > 0.5 {
                assert!((one[0] / (x.exp_m1() / x) - 1.0).abs() < 1e-13, "{x}");
                assert!((two[0] / ((x.exp_m1() - x) / (x * x)) - 1.0).abs() < 1e-12, "{x}");
            } else {
                assert!((one[0] - 1.0 - x / 2.0).abs() <= x * x + 1e-15);
                assert!((two[0] - 0.5 - x / 6.0).abs() <= x * x + 1e-15);
            }
        }
    }

    #[test]
    fn undamped_and_integrating_matrices() {
        // x'' = −ω²x in units that differ by 1e9: cos and sin of 0.3 over one sample.
        let w = 1e9;
        let h = 0.3 / w;
        let [e, ..] = phi(2, &[0.0, h, -w * w * h, 0.0]);
        assert!((e[0] - 0.3_f64.cos()).abs() < 1e-15 && (e[1] * w - 0.3_f64.sin()).abs() < 1e-15);
        assert!((e[2] / w + 0.3_f64.sin()).abs() < 1e-15);
        let [e, one, two] = phi(2, &[0.0, 1.0, 0.0, 0.0]);
        assert_eq!(e, [1.0, 1.0, 0.0, 1.0]);
        assert_eq!(one, [1.0, 0.5, 0.0, 1.0]);
        assert!((two[1] - 1.0 / 6.0).abs() < 1e-16 && two[0] == 0.5);
    }

    proptest! {
        #[test]
        fn halves_multiply_to_the_whole(n in 1usize..6, entries in prop::collection::vec(-2.0f64..2.0, 36)) {
            let a = &entries[..n * n];
            let half: Vec<f64> = a.iter().map(|x| 0.5 * x).collect();
            let [whole, integral, _] = phi(n, a);
            let [part, ..] = phi(n, &half);
            let size = whole.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (got, want) in product(n, &part, &part).iter().zip(&whole) {
                prop_assert!((got - want).abs() < 1e-12 * size * size);
            }
            // A φ₁ = e^A − I.
            for (k, (got, want)) in product(n, a, &integral).iter().zip(&whole).enumerate() {
                let one = if k % (n + 1) == 0 { 1.0 } else { 0.0 };
                prop_assert!((got - (want - one)).abs() < 1e-12 * size * size);
            }
        }
    }
}
