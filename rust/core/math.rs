//! Logarithm, sine and cosine by arithmetic alone, so that every processor gives the same bits.
//!
//! The polynomials are minimax fits made for this file (Remez exchange in 60 digits); the stated
//! errors are theirs, before rounding.

use crate::simd::{self, Kernel, LaneBits, Lanes, Wide};

/// 1.5 · 2⁵²: adding and subtracting it rounds to the nearest integer, whose low bits it shows.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// 2π to a double, and what is missing.
const TWO_PI: f64 = std::f64::consts::TAU;
const HALF_PI: f64 = std::f64::consts::FRAC_PI_2;
const HALF_PI_LOW: f64 = 6.123_233_995_736_766e-17;
const SIGN: u64 = 1 << 63;

/// (sin θ − θ)/θ³ in θ², |θ| ≤ π/4; sin θ to 4e-18 relative.
const SIN: [f64; 6] = [
    -0.166_666_666_666_666_3,
    0.008_333_333_333_322_118,
    -0.000_198_412_698_295_895_33,
    2.755_731_362_138_453e-6,
    -2.505_074_776_269_769e-8,
    1.589_623_014_945_251e-10,
];
/// (cos θ − 1 + θ²/2)/θ⁴ in θ², |θ| ≤ π/4; cos θ to 5e-20.
const COS: [f64; 6] = [
    0.041_666_666_666_666_6,
    -0.001_388_888_888_887_413_8,
    2.480_158_728_949_183_7e-5,
    -2.755_731_435_524_498_6e-7,
    2.087_572_368_484_822_3e-9,
    -1.135_966_988_873_933_7e-11,
];
/// (ln m − 2s)/s³ in s², s = (m − 1)/(m + 1), m from √½ to √2; ln m to 2e-16 relative.
const LN: [f64; 6] = [
    0.666_666_666_665_874_9,
    0.400_000_000_521_362_7,
    0.285_714_171_512_527_6,
    0.222_233_702_201_717,
    0.181_236_878_536_814_9,
    0.168_193_003_969_403_73,
];

/// 2ʳ in r, |r| ≤ ½, to 1.9e-9 relative.
const EXP2: [f64; 7] = [
    1.000_000_000_554_166_3,
    0.693_147_205_737_252_6,
    0.240_226_468_906_395_73,
    0.055_503_287_769_976_636,
    0.009_618_488_956_522_791,
    0.001_339_993_120_947_414,
    0.000_153_458_121_587_401_83,
];

/// The polynomial with ascending coefficients at `x`, by Horner's rule.
#[inline(always)]
fn polynomial<L: Lanes, const N: usize>(coefficients: &[f64; N], x: L) -> L {
    let mut sum = L::splat(coefficients[N - 1]);
    for k in (0..N - 1).rev() {
        sum = sum.mul_add(x, L::splat(coefficients[k]));
    }
    sum
}

/// `x` with its sign flipped where the top bit of `bits` is set.
#[inline(always)]
pub(crate) fn flip_sign<L: Lanes>(x: L, bits: L::Bits) -> L {
    L::from_bits(x.to_bits().xor(bits.and(L::Bits::splat(SIGN))))
}

/// `(b, a)` where the lowest bit of `bits` is set, else `(a, b)`.
#[inline(always)]
pub(crate) fn swap<L: Lanes>(a: L, b: L, bits: L::Bits) -> (L, L) {
    // The bit becomes the exponent of 2.0; 0.0 where it is not set.
    let two = L::from_bits(bits.shl::<62>().and(L::Bits::splat(1 << 62)));
    let one = L::splat(1.0);
    (two.select_lt(one, a, b), two.select_lt(one, b, a))
}

/// (sin θ, cos θ) for |θ| ≤ π/4, to 2.3e-16.
#[inline(always)]
pub(crate) fn sin_cos_small<L: Lanes>(theta: L) -> (L, L) {
    let z = theta * theta;
    let sin = (theta * z).mul_add(polynomial(&SIN, z), theta);
    let cos = z.mul_add(L::splat(-0.5), L::splat(1.0));
    (sin, (z * z).mul_add(polynomial(&COS, z), cos))
}

/// (sin 2πx, cos 2πx) for any finite `x`; NaN for infinities and NaN.
///
/// The turns are reduced exactly, so the error is 2.5e-16 relative in the sine near its zeros and
/// absolute elsewhere; quarter turns are exact.
#[inline(always)]
pub fn sin_cos_turns<L: Lanes>(turns: L) -> (L, L) {
    let rounder = L::splat(ROUNDER);
    let part = turns - ((turns + rounder) - rounder);
    // From 2⁵² on every double is an integer. The product keeps NaN and infinity visible.
    let part =
        turns.abs().select_lt(L::splat(4_503_599_627_370_496.0), part, turns * L::splat(0.0));
    let shown = part.mul_add(L::splat(4.0), rounder);
    let quarter = shown.to_bits();
    let rest = (shown - rounder).mul_add(L::splat(-0.25), part);
    let (sin, cos) = sin_cos_small(rest * L::splat(TWO_PI));
    let (sin, cos) = swap(sin, cos, quarter);
    // Quarters 2, 3 turn the sine's sign; 1, 2 the cosine's.
    let next = quarter.add(L::Bits::splat(1));
    (flip_sign(sin, quarter.shl::<62>()), flip_sign(cos, next.shl::<62>()))
}

/// The natural logarithm of a normal positive `x`, to 4e-16 relative, also near 1.
///
/// Zero, subnormals, negative numbers, infinities and NaN give meaningless numbers.
#[inline(always)]
pub fn ln<L: Lanes>(x: L) -> L {
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    // x = 2^e m with m from √½ to √2: moved so that the exponent field steps at √½.
    let moved = x.to_bits().add(L::Bits::splat(ONE - ROOT_HALF));
    let mantissa = moved.and(L::Bits::splat((1 << 52) - 1));
    let m = L::from_bits(mantissa.add(L::Bits::splat(ROOT_HALF)));
    // e + 1023 as the low bits of 2⁵², then as a number.
    let field = moved.shr::<52>().or(L::Bits::splat(0x4330_0000_0000_0000));
    let e = L::from_bits(field) - L::splat(4_503_599_627_370_496.0 + 1023.0);
    let s = (m - L::splat(1.0)) / (m + L::splat(1.0));
    let z = s * s;
    let ln_m = (s * z).mul_add(polynomial(&LN, z), s + s);
    e.mul_add(L::splat(std::f64::consts::LN_2), ln_m)
}

/// 2ˣ for `x` between −1000 and 1000, to 2e-9 relative: as far as a spectrum is known, and cheap. Of what lies
/// beyond, that of the nearer end.
#[inline(always)]
pub fn exp2<L: Lanes>(x: L) -> L {
    let x = x.max(L::splat(-1000.0)).min(L::splat(1000.0));
    let shown = x + L::splat(ROUNDER);
    let r = x - (shown - L::splat(ROUNDER));
    // The low bits of `shown` are what is left of x: they raise the exponent.
    L::from_bits(polynomial(&EXP2, r).to_bits().add(shown.to_bits().shl::<52>()))
}

/// [`ln`] of one number, the same bits as a lane.
#[must_use]
pub fn ln_1(x: f64) -> f64 {
    struct One(f64);
    impl Kernel for One {
        type Output = f64;
        #[inline(always)]
        fn run<L: Lanes>(self) -> f64 {
            let mut out = Wide::ZERO;
            ln(L::splat(self.0)).store(&mut out);
            out.0[0]
        }
    }
    simd::alone(One(x))
}

/// [`sin_cos_turns`] of one number, the same bits as a lane.
#[must_use]
pub fn sin_cos_turns_1(turns: f64) -> (f64, f64) {
    struct One(f64);
    impl Kernel for One {
        type Output = (f64, f64);
        #[inline(always)]
        fn run<L: Lanes>(self) -> (f64, f64) {
            let (mut sin, mut cos) = (Wide::ZERO, Wide::ZERO);
            let both = sin_cos_turns(L::splat(self.0));
            both.0.store(&mut sin);
            both.1.store(&mut cos);
            (sin.0[0], cos.0[0])
        }
    }
    simd::alone(One(turns))
}

/// (cos, sin)(2πk/n), within 1 ulp for n to 2⁵³; n = 0 counts as 1.
///
/// The fraction of a turn is reduced to |θ| ≤ π/4 in integers and multiplied by π/2 in two
/// doubles, so symmetric roots are symmetric to the bit.
#[must_use]
pub fn root_of_unity(k: u64, n: u64) -> (f64, f64) {
    let n = u128::from(n.max(1));
    let k = u128::from(k) % n;
    let quarter = (8 * k + n) / (2 * n);
    let (full, counted) = (4 * k, quarter * n);
    // Rounding of the size alone keeps k and n - k alike.
    let size = full.abs_diff(counted) as f64;
    let divisor = n as f64;
    let high = size / divisor;
    let low = (-high).mul_add(divisor, size) / divisor;
    let theta = high * HALF_PI;
    let theta_low = high.mul_add(HALF_PI, -theta) + high.mul_add(HALF_PI_LOW, low * HALF_PI);

    let z = theta * theta;
    let half = 0.5 * z;
    let top = 1.0 - half;
    let sin = theta + (theta * z).mul_add(horner(&SIN, z), theta_low * top);
    let lost = (1.0 - top) - half;
    let cos = top + (lost + (z * z).mul_add(horner(&COS, z), -(theta * theta_low)));
    let sin = if full < counted { -sin } else { sin };
    match quarter % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

fn horner(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| x.mul_add(sum, *c))
}

/// The quantile of Student's t with `freedom` degrees of freedom where that of the normal distribution is `z`:
/// Fisher and Cornish's expansion to the fourth power of 1/`freedom`, to 1.3e-3 from three degrees on at 95 %.
#[must_use]
pub fn student(z: f64, freedom: f64) -> f64 {
    let (r, q) = (1.0 / freedom, z * z);
    let first = (q + 1.0) / 4.0;
    let second = ((5.0 * q + 16.0) * q + 3.0) / 96.0;
    let third = (((3.0 * q + 19.0) * q + 17.0) * q - 15.0) / 384.0;
    let fourth = ((((79.0 * q + 776.0) * q + 1482.0) * q - 1920.0) * q - 945.0) / 92160.0;
    z * (1.0 + r * (first + r * (second + r * (third + r * fourth))))
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::simd::{Isa, LANES};
    use proptest::prelude::*;

    struct Everything<'a>(&'a [Wide], &'a mut Vec<[Wide; 3]>);

    impl Kernel for Everything<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            for x in self.0 {
                let mut out = [Wide::ZERO; 3];
                let x = L::load(x);
                let (sin, cos) = sin_cos_turns(x);
                sin.store(&mut out[0]);
                cos.store(&mut out[1]);
                ln(x.abs() + L::splat(1e-300)).store(&mut out[2]);
                self.1.push(out);
            }
        }
    }

    #[test]
    fn lanes_and_scalar_twins_have_the_same_bits_on_every_instruction_set() {
        let value = |k: usize| (k as f64 * 0.618_034 - 40.0) * [1e-9, 1e-3, 1.0, 77.0, 1e15][k % 5];
        let x: Vec<Wide> =
            (0..40).map(|r| Wide(std::array::from_fn(|i| value(r * 8 + i)))).collect();
        for isa in Isa::available() {
            let mut out = Vec::new();
            isa.run(Everything(&x, &mut out));
            for (x, got) in x.iter().zip(&out) {
                for k in 0..LANES {
                    let (sin, cos) = sin_cos_turns_1(x.0[k]);
                    let want = [sin, cos, ln_1(x.0[k].abs() + 1e-300)];
                    for (got, want) in got.iter().zip(want) {
                        assert_eq!(got.0[k].to_bits(), want.to_bits(), "{isa:?} at {}", x.0[k]);
                    }
                }
            }
        }
    }

    #[test]
    fn ln_near_one_and_at_powers_of_two() {
        assert_eq!(ln_1(1.0), 0.0);
        for k in 1..2000 {
            let d = f64::from(k) * 1e-16 * f64::from(k * k);
            for x in [1.0 + d, 1.0 - d] {
                let want = (x - 1.0).ln_1p();
                assert!((ln_1(x) - want).abs() <= 5e-16 * want.abs(), "{x}");
            }
        }
        for x in [f64::MIN_POSITIVE, f64::MAX, 2f64.powi(-52), 0.5, 0.707_106_781_186_547_5, 1.5] {
            assert!((ln_1(x) / x.ln() - 1.0).abs() <= 5e-16, "{x}");
        }
    }

    #[test]
    fn powers_of_two_agree_with_libm_and_end() {
        struct Power<'a>(&'a mut Wide);
        impl Kernel for Power<'_> {
            type Output = ();
            #[inline(always)]
            fn run<L: Lanes>(self) {
                exp2(L::load(self.0)).store(self.0);
            }
        }
        let ends = [(-1e9, -1000.0), (1e9, 1000.0), (f64::NEG_INFINITY, -1000.0)];
        let within = (-100_000..=100_000).map(|k| f64::from(k) * 0.01).map(|x| (x, x));
        for (x, want) in within.chain(ends) {
            let mut out = Wide::splat(x);
            simd::alone(Power(&mut out));
            assert!((out.0[0] / f64::exp2(want) - 1.0).abs() < 2e-9, "{x}: {}", out.0[0]);
        }
    }

    #[test]
    fn quantiles_of_student_are_those_of_tables() {
        let z = 1.959_963_984_540_054;
        let table = [(3.0, 3.182_446), (5.0, 2.570_582), (10.0, 2.228_139), (40.0, 2.021_075)];
        for (freedom, want) in table {
            let got = student(z, freedom);
            assert!((got / want - 1.0).abs() < 1.3e-3, "{freedom}: {got}");
        }
        assert_eq!(student(z, f64::INFINITY), z);
    }

    #[test]
    fn whole_and_quarter_turns_are_exact() {
        for x in [
            0.0,
            1.0,
            -3.0,
            4_503_599_627_370_495.0,
            4_503_599_627_370_497.0,
            1e18,
            -1e300,
            f64::MAX,
        ] {
            assert_eq!(sin_cos_turns_1(x), (0.0, 1.0), "{x}");
        }
        for x in [0.25, -0.75, 1.25, 1_000_000.25, 281_474_976_710_656.25] {
            assert_eq!(sin_cos_turns_1(x), (1.0, 0.0), "{x}");
        }
        assert_eq!(sin_cos_turns_1(2_251_799_813_685_249.5), (0.0, -1.0));
        assert_eq!(sin_cos_turns_1(-0.25), (-1.0, 0.0));
        assert!(sin_cos_turns_1(f64::INFINITY).0.is_nan() && sin_cos_turns_1(f64::NAN).1.is_nan());
    }

    #[test]
    fn roots_of_unity_are_symmetric_to_the_bit() {
        for n in [1u64, 2, 3, 4, 7, 8, 12, 256, 257, 1009] {
            for k in 0..n {
                let (c, s) = root_of_unity(k, n);
                let (d, t) = root_of_unity(n - k, n);
                assert!(c == d && s == -t, "{k}/{n}");
                let (far, up) = root_of_unity(k + 3 * n, n);
                assert!(c == far && s == up, "{k}/{n}");
                let angle = std::f64::consts::TAU * k as f64 / n as f64;
                assert!((c - angle.cos()).abs() < 2e-15 && (s - angle.sin()).abs() < 2e-15);
            }
        }
        assert_eq!(root_of_unity(1, 4), (0.0, 1.0));
        assert_eq!(root_of_unity(1, 8).0, root_of_unity(1, 8).1);
        assert_eq!(root_of_unity(1, 12).1, 0.5);
        assert_eq!(root_of_unity(5, 0), (1.0, 0.0));
    }

    #[test]
    fn roots_of_unity_are_within_an_ulp() {
        // libm's sine of a small angle known in two doubles: sin(h + l) = sin h + l cos h.
        for n in [3u64, 10, 257, 1_000_003, (1 << 53) - 1] {
            for j in 0..200u64 {
                let k = (u128::from(n) * u128::from(j) / 1600) as u64;
                let (hi, rest) = (k as f64 / n as f64, n as f64);
                let lo = (-hi).mul_add(rest, k as f64) / rest;
                let theta = hi * TWO_PI;
                let low = hi.mul_add(TWO_PI, -theta) + hi * 4.0 * HALF_PI_LOW + lo * TWO_PI;
                let (c, s) = root_of_unity(k, n);
                let (want_c, want_s) =
                    (theta.cos() - low * theta.sin(), theta.sin() + low * theta.cos());
                // Half an ulp or more of this is the reference.
                assert!((s - want_s).abs() <= 3.4e-16 * want_s.abs(), "{k}/{n}");
                assert!((c - want_c).abs() <= 3.4e-16 * want_c.abs(), "{k}/{n}");
            }
        }
    }

    proptest! {
        #[test]
        fn ln_agrees_with_libm(bits in 0x0010_0000_0000_0000u64..0x7ff0_0000_0000_0000) {
            let x = f64::from_bits(bits);
            let want = x.ln();
            prop_assert!((ln_1(x) - want).abs() <= 6e-16 * want.abs(), "{x}: {} {want}", ln_1(x));
        }

        #[test]
        fn sin_cos_agree_with_libm(quarter in -40i32..40, rest in -0.125f64..0.125, small in 0i32..300) {
            // A reduced angle of any size, which libm needs no reduction for.
            let rest = if quarter == 0 { rest * 2f64.powi(-small) } else { (rest * 4194304.0).round() / 4194304.0 };
            let (s, c) = sin_cos_turns_1(f64::from(quarter) * 0.25 + rest);
            let (sin, cos) = (rest * TWO_PI).sin_cos();
            let (want_s, want_c) = [(sin, cos), (cos, -sin), (-sin, -cos), (-cos, sin)][quarter.rem_euclid(4) as usize];
            prop_assert!((s - want_s).abs() <= 3.4e-16 * want_s.abs(), "{s} {want_s}");
            prop_assert!((c - want_c).abs() <= 3.4e-16 * want_c.abs(), "{c} {want_c}");
        }

        #[test]
        fn sine_is_odd_and_periodic(x in -1e6f64..1e6) {
            let (s, c) = sin_cos_turns_1(x);
            prop_assert_eq!(sin_cos_turns_1(-x), (-s, c));
            prop_assert!((s * s + c * c - 1.0).abs() < 6e-16);
        }
    }
}
