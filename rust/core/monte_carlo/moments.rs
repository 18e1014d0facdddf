//! Moments of the errors of one parameter, made a chunk and merged in a fixed order.
//!
//! Everything is kept of the *error*, estimate − truth, so that a small bias is not lost in a large
//! value. With a fixed chunk size the bits do not depend on who computed which chunk.

use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// Count, mean and sums of powers about the mean (2 to 4) of the errors of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    /// Number of errors.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// Sums of (error − mean)², (…)³ and (…)⁴.
    pub sums: [f64; 3],
}

impl Moments {
    /// The moments of a chunk's errors, in two passes.
    #[must_use]
    pub fn of(isa: Isa, errors: &[f64]) -> Moments {
        if errors.is_empty() {
            return Moments::default();
        }
        let n = errors.len() as f64;
        let sums = |about| isa.run(Sums { errors, about });
        let rough = sums(0.0)[0] / n;
        // The second sum takes away the rounding of the first.
        let mean = rough + sums(rough)[0] / n;
        let [_, square, cube, fourth] = sums(mean);
        Moments { count: errors.len() as u64, mean, sums: [square, cube, fourth] }
    }

    /// Takes in the errors of the chunks that follow (Chan, Golub and LeVeque's rule, to power 4).
    pub fn merge(&mut self, next: &Moments) {
        if self.count == 0 || next.count == 0 {
            if self.count == 0 {
                *self = *next;
            }
            return;
        }
        let (a, b) = (self.count as f64, next.count as f64);
        let n = a + b;
        let d = next.mean - self.mean;
        // Shifts of the two means from the common one.
        let (p, q) = (-d * b / n, d * a / n);
        let (s, t) = (self.sums, next.sums);
        self.sums = [
            s[0] + t[0] + (a * p * p + b * q * q),
            s[1] + t[1] + 3.0 * (p * s[0] + q * t[0]) + (a * p * p * p + b * q * q * q),
            s[2] + t[2]
                + 4.0 * (p * s[1] + q * t[1])
                + 6.0 * (p * p * s[0] + q * q * t[0])
                + (a * p * p * p * p + b * q * q * q * q),
        ];
        self.mean -= p;
        self.count += next.count;
    }

    /// Mean error; NaN without errors, as all figures here.
    #[must_use]
    pub fn bias(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.mean }
    }

    /// Standard deviation about the mean, with n − 1; NaN below two errors.
    #[must_use]
    pub fn sd(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { (self.sums[0] / (self.count - 1) as f64).sqrt() }
    }

    /// Root of the mean squared error.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        (self.bias() * self.bias() + self.central(0)).sqrt()
    }

    /// Monte Carlo standard error of [`Moments::bias`]: sd/√n.
    #[must_use]
    pub fn bias_se(&self) -> f64 {
        self.sd() / (self.count as f64).sqrt()
    }

    /// Monte Carlo standard error of [`Moments::sd`]: √((μ₄ − μ₂²)/n)/(2 sd), for any distribution
    /// with four moments.
    #[must_use]
    pub fn sd_se(&self) -> f64 {
        let spread = self.central(2) - self.central(0) * self.central(0);
        self.root_se(spread, self.sd())
    }

    /// Monte Carlo standard error of [`Moments::rmse`]: √(Var e²/n)/(2 rmse).
    #[must_use]
    pub fn rmse_se(&self) -> f64 {
        let (b, square) = (self.mean, self.mean * self.mean);
        let (m2, m3, m4) = (self.central(0), self.central(1), self.central(2));
        // Var e² with e = b + d.
        let spread = m4 - m2 * m2 + 4.0 * b * m3 + 4.0 * square * m2;
        self.root_se(spread, self.rmse())
    }

    /// Standard error of a root, by the delta method; without any noise the root 0 is exact.
    fn root_se(&self, spread: f64, root: f64) -> f64 {
        if root == 0.0 { 0.0 } else { (spread.max(0.0) / self.count as f64).sqrt() / (2.0 * root) }
    }

    fn central(&self, k: usize) -> f64 {
        self.sums[k] / self.count as f64
    }
}

/// Sums of the first four powers of the errors about a number, in eight partial sums that do not wait for each other.
struct Sums<'a> {
    errors: &'a [f64],
    about: f64,
}

impl Kernel for Sums<'_> {
    type Output = [f64; 4];
    #[inline(always)]
    fn run<L: Lanes>(self) -> [f64; 4] {
        let (eights, rest) = self.errors.as_chunks::<LANES>();
        let mut partial = [L::splat(0.0); 4];
        for eight in eights {
            let d = L::load_any(eight) - L::splat(self.about);
            let square = d * d;
            for (sum, power) in partial.iter_mut().zip([d, square, square * d, square * square]) {
                *sum = *sum + power;
            }
        }
        let mut total = [0.0; 4];
        for (total, partial) in total.iter_mut().zip(partial) {
            let mut lanes = Wide::ZERO;
            partial.store(&mut lanes);
            *total = lanes.0.iter().sum();
        }
        for e in rest {
            let d = e - self.about;
            let square = d * d;
            for (sum, power) in total.iter_mut().zip([d, square, square * d, square * square]) {
                *sum += power;
            }
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Address, Purpose, normals};
    use proptest::prelude::*;

    fn errors(replicate: u64, count: usize, mean: f64, sd: f64) -> Vec<f64> {
        let mut z = vec![0.0; count];
        let address = Address { seed: 1, purpose: Purpose::User, channel: 0, replicate, group: 0 };
        normals(address, &mut z);
        z.iter().map(|z| mean + sd * z).collect()
    }

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance * b.abs()
    }

    fn of(errors: &[f64]) -> Moments {
        Moments::of(Isa::detect().unwrap(), errors)
    }

    /// Moments by the definition.
    fn direct(e: &[f64]) -> (f64, [f64; 3]) {
        let mean = e.iter().sum::<f64>() / e.len() as f64;
        let sum = |f: fn(f64) -> f64| e.iter().map(|x| f(x - mean)).sum();
        (mean, [sum(|d| d * d), sum(|d| d * d * d), sum(|d| d * d * d * d)])
    }

    proptest! {
        #[test]
        fn merged_moments_are_those_of_all(
            count in 2usize..300, chunk in 1usize..100, mean in -3.0f64..3.0, replicate in 0u64..100,
        ) {
            let e = errors(replicate, count, mean, 0.7);
            let mut merged = Moments::default();
            for chunk in e.chunks(chunk) {
                merged.merge(&of(chunk));
            }
            let (mean, sums) = direct(&e);
            prop_assert_eq!(merged.count, count as u64);
            prop_assert!((merged.mean - mean).abs() < 1e-14 * (1.0 + mean.abs()));
            for (k, scale) in [(0, sums[0]), (1, sums[2].max(sums[0])), (2, sums[2])] {
                prop_assert!((merged.sums[k] - sums[k]).abs() < 1e-12 * scale, "{merged:?} {sums:?}");
            }
            let square = e.iter().map(|e| e * e).sum::<f64>() / count as f64;
            prop_assert!(close(merged.rmse(), square.sqrt(), 1e-13));
        }
    }

    #[test]
    fn a_small_spread_about_a_large_bias_is_kept() {
        let e = errors(0, 1000, 1e6, 1e-3);
        let mut merged = Moments::default();
        e.chunks(64).for_each(|chunk| merged.merge(&of(chunk)));
        assert!(close(merged.sd(), 1e-3, 0.1), "{}", merged.sd());
        assert!(close(merged.sd(), of(&e).sd(), 1e-6));
    }

    #[test]
    fn standard_errors_are_what_repetition_shows() {
        // 2000 studies of 200 replicates with bias: the spread of each figure against its own
        // standard error. Each ratio has a standard error of 1.6 %; bounds of 8 % are 5 of them.
        let studies: Vec<Moments> = (0..2000).map(|k| of(&errors(k, 200, 0.4, 1.3))).collect();
        type Figure = fn(&Moments) -> f64;
        let figures: [(Figure, Figure); 3] = [
            (Moments::bias, Moments::bias_se),
            (Moments::sd, Moments::sd_se),
            (Moments::rmse, Moments::rmse_se),
        ];
        for (k, (figure, se)) in figures.into_iter().enumerate() {
            let spread = of(&studies.iter().map(figure).collect::<Vec<_>>()).sd();
            let said = of(&studies.iter().map(se).collect::<Vec<_>>()).mean;
            assert!(close(said, spread, 0.08), "figure {k}: {said} against {spread}");
        }
    }

    #[test]
    fn nothing_and_one_error() {
        let none = Moments::default();
        assert!(none.bias().is_nan() && none.sd().is_nan() && none.rmse().is_nan());
        let one = of(&[-0.5]);
        assert!(one.bias() == -0.5 && one.rmse() == 0.5 && one.sd().is_nan());
        let mut merged = one;
        merged.merge(&none);
        assert_eq!(merged, one);
        assert!(of(&[1.0, f64::NAN]).bias().is_nan());
    }
}
