//! Noise to covariance of the lines: one number a line for linear models, the weight of that line.
//!
//! White noise on the output makes line m of the equation error independent of the others, with
//! variance h_m S_m, S_m = σ²|A(iω)|²/N (docs/core.md, "Weights").

use crate::simd::{Lanes, Wide};

/// Below this fraction of its size without cancellation |A|² counts as zero: the weight of a line on
/// an undamped mode stays finite. Relative to the line itself, so that wide bands keep their weights.
pub(crate) const FLOOR: f64 = 1e-9;

/// A polynomial with descending coefficients at s = ix, x the same in all lanes or not; `monic`: a leading one stands before them.
///
/// Even and odd powers by Horner's rule in −x²: real and imaginary part.
#[inline(always)]
pub(crate) fn polynomial<L: Lanes>(monic: bool, descending: &[Wide], x: L) -> (L, L) {
    let square = -x * x;
    let degree = descending.len();
    let mut parts = [L::splat(0.0); 2];
    if monic {
        parts[degree % 2] = L::splat(1.0);
    }
    for (j, c) in descending.iter().enumerate() {
        let part = (degree - 1 - j) % 2;
        // The first coefficient of a part starts it.
        let starts = j + usize::from(monic) < 2;
        let c = L::load(c);
        parts[part] = if starts { c } else { parts[part].mul_add(square, c) };
    }
    (parts[0], parts[1] * x)
}

/// |A|² as the variance of a line uses it: never below the floor that its size at `x` sets.
#[inline(always)]
pub(crate) fn variance<L: Lanes>(a: (L, L), denominator: &[Wide], x: L) -> L {
    let mut size = L::splat(1.0);
    for c in denominator {
        size = size.mul_add(x, L::load(c).abs());
    }
    let square = a.0.mul_add(a.0, a.1 * a.1);
    square.max(size * size * L::splat(FLOOR))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Isa, Kernel};

    struct At(f64);
    impl Kernel for At {
        type Output = (f64, f64, f64);
        #[inline(always)]
        fn run<L: Lanes>(self) -> (f64, f64, f64) {
            let c = [Wide::splat(3.0), Wide::splat(8.0)];
            let a = polynomial::<L>(true, &c, L::splat(self.0));
            let v = variance::<L>(a, &c, L::splat(self.0));
            let mut out = [Wide::ZERO; 3];
            a.0.store(&mut out[0]);
            a.1.store(&mut out[1]);
            v.store(&mut out[2]);
            (out[0].0[0], out[1].0[0], out[2].0[0])
        }
    }

    #[test]
    fn horner_on_the_imaginary_axis() {
        for isa in Isa::available() {
            assert_eq!(isa.run(At(2.0)), (4.0, 6.0, 52.0));
        }
    }

    struct Undamped;
    impl Kernel for Undamped {
        type Output = f64;
        #[inline(always)]
        fn run<L: Lanes>(self) -> f64 {
            let c = [Wide::ZERO, Wide::splat(1.0)];
            let a = polynomial::<L>(true, &c, L::splat(1.0));
            let mut out = Wide::ZERO;
            variance::<L>(a, &c, L::splat(1.0)).store(&mut out);
            out.0[0]
        }
    }

    #[test]
    fn a_line_on_an_undamped_mode_keeps_a_finite_weight() {
        assert_eq!(Isa::Plain.run(Undamped), 4.0 * FLOOR);
    }
}
