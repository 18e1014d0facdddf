//! Registers of eight replicates and the run-time choice of instruction set: the one file with `unsafe`.
//!
//! A kernel is written once, generic over [`Lanes`], and runs through [`Isa::run`]. Data lives in
//! [`Wide`] arrays that know nothing of instruction sets. All sets give the same bits, since every
//! operation here is a single IEEE operation and nothing is contracted.
#![allow(unsafe_code)]

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Replicates that travel together.
pub const LANES: usize = 8;

/// Eight doubles, one a replicate, as they lie in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Wide(pub [f64; LANES]);

impl Wide {
    /// All lanes zero.
    pub const ZERO: Wide = Wide([0.0; LANES]);

    /// The same value in all lanes.
    #[must_use]
    pub const fn splat(x: f64) -> Wide {
        Wide([x; LANES])
    }
}

impl Default for Wide {
    fn default() -> Wide {
        Wide::ZERO
    }
}

/// One register (or pair, or array) of replicates.
///
/// Bit operations act on the same storage seen as `u64` lanes (`Self::Bits`).
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The unsigned 64-bit integers of the same lanes.
    type Bits: LaneBits;

    /// The same value in all lanes.
    fn splat(x: f64) -> Self;
    /// Reads a memory block.
    fn load(from: &Wide) -> Self;
    /// Writes a memory block.
    fn store(self, to: &mut Wide);
    /// `self * b + c` with one rounding.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The larger operand; the second where either is NaN.
    fn max(self, b: Self) -> Self;
    /// `a` where `self < than`, else `b` (also where the comparison meets a NaN).
    fn select_lt(self, than: Self, a: Self, b: Self) -> Self;
    /// The bit pattern.
    fn to_bits(self) -> Self::Bits;
    /// From the bit pattern.
    fn from_bits(bits: Self::Bits) -> Self;
}

/// Unsigned 64-bit integers in lanes, with what the random streams and the logarithm need.
pub trait LaneBits: Copy {
    /// The same value in all lanes.
    fn splat(x: u64) -> Self;
    /// Eight values, one a lane.
    fn from_array(x: [u64; LANES]) -> Self;
    /// Eight values, one a lane.
    fn to_array(self) -> [u64; LANES];
    /// Wrapping sum.
    fn add(self, b: Self) -> Self;
    /// Exclusive or.
    fn xor(self, b: Self) -> Self;
    /// And.
    fn and(self, b: Self) -> Self;
    /// Or.
    fn or(self, b: Self) -> Self;
    /// Shift left by a constant.
    fn shl<const K: i32>(self) -> Self;
    /// Shift right by a constant, zeros enter.
    fn shr<const K: i32>(self) -> Self;
    /// Product of the low 32 bits of each lane, 64 bits wide.
    fn mul32(self, b: Self) -> Self;
}

/// A computation that is written for any register type.
///
/// `run` and everything generic it calls must be `#[inline(always)]`, or the instruction set is lost.
pub trait Kernel {
    /// What it returns.
    type Output;
    /// The computation.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// The instruction sets there are kernels for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// 512-bit registers (F and DQ).
    Avx512,
    /// 256-bit registers with fused multiply-add.
    Avx2,
    /// Arrays of eight, any processor.
    Plain,
    /// Only lane 0: the plain twin that tests compare with.
    One,
}

impl Isa {
    /// What this processor has, best first; `Plain` and `One` always.
    #[must_use]
    pub fn available() -> Vec<Isa> {
        let mut all = Vec::with_capacity(4);
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                all.push(Isa::Avx512);
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                all.push(Isa::Avx2);
            }
        }
        all.extend([Isa::Plain, Isa::One]);
        all
    }

    /// The best set of this processor; `MODFUN_ISA` = avx512 | avx2 | plain restricts the choice.
    #[must_use]
    pub fn detect() -> Isa {
        let limit = std::env::var("MODFUN_ISA").unwrap_or_default();
        let skip = match limit.as_str() {
            "avx2" => &[Isa::Avx512][..],
            "plain" => &[Isa::Avx512, Isa::Avx2][..],
            _ => &[][..],
        };
        let best = Isa::available().into_iter().find(|isa| !skip.contains(isa));
        best.unwrap_or(Isa::Plain)
    }

    /// Runs a kernel compiled for this set (for `Plain` where the processor lacks it).
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") =>
            {
                // SAFETY: the features were just detected.
                unsafe { x86::run_avx512(kernel) }
            }
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") => {
                // SAFETY: the features were just detected.
                unsafe { x86::run_avx2(kernel) }
            }
            Isa::One => kernel.run::<Plain<1>>(),
            _ => kernel.run::<Plain<LANES>>(),
        }
    }
}

/// Arrays of lanes, the portable register.
#[derive(Clone, Copy)]
struct Plain<const N: usize>([f64; N]);

/// Arrays of integers, the portable register.
#[derive(Clone, Copy)]
struct PlainBits<const N: usize>([u64; N]);

macro_rules! plain_operator {
    ($($op:ident $f:ident),*) => {$(
        impl<const N: usize> $op for Plain<N> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, b: Self) -> Self {
                Plain(std::array::from_fn(|i| self.0[i].$f(b.0[i])))
            }
        }
    )*};
}
plain_operator!(Add add, Sub sub, Mul mul, Div div);

impl<const N: usize> Neg for Plain<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Plain(self.0.map(|x| -x))
    }
}

impl<const N: usize> Lanes for Plain<N> {
    type Bits = PlainBits<N>;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Plain([x; N])
    }
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Plain(std::array::from_fn(|i| from.0[i]))
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        to.0[..N].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Plain(std::array::from_fn(|i| self.0[i].mul_add(b.0[i], c.0[i])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Plain(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Plain(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // The comparison of x86's maxpd, so that NaN travels alike on all sets.
        Plain(std::array::from_fn(|i| if self.0[i] > b.0[i] { self.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    fn select_lt(self, than: Self, a: Self, b: Self) -> Self {
        Plain(std::array::from_fn(|i| if self.0[i] < than.0[i] { a.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    fn to_bits(self) -> PlainBits<N> {
        PlainBits(self.0.map(f64::to_bits))
    }
    #[inline(always)]
    fn from_bits(bits: PlainBits<N>) -> Self {
        Plain(bits.0.map(f64::from_bits))
    }
}

impl<const N: usize> LaneBits for PlainBits<N> {
    #[inline(always)]
    fn splat(x: u64) -> Self {
        PlainBits([x; N])
    }
    #[inline(always)]
    fn from_array(x: [u64; LANES]) -> Self {
        PlainBits(std::array::from_fn(|i| x[i]))
    }
    #[inline(always)]
    fn to_array(self) -> [u64; LANES] {
        std::array::from_fn(|i| if i < N { self.0[i] } else { 0 })
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        PlainBits(std::array::from_fn(|i| self.0[i].wrapping_add(b.0[i])))
    }
    #[inline(always)]
    fn xor(self, b: Self) -> Self {
        PlainBits(std::array::from_fn(|i| self.0[i] ^ b.0[i]))
    }
    #[inline(always)]
    fn and(self, b: Self) -> Self {
        PlainBits(std::array::from_fn(|i| self.0[i] & b.0[i]))
    }
    #[inline(always)]
    fn or(self, b: Self) -> Self {
        PlainBits(std::array::from_fn(|i| self.0[i] | b.0[i]))
    }
    #[inline(always)]
    fn shl<const K: i32>(self) -> Self {
        PlainBits(self.0.map(|x| x << K))
    }
    #[inline(always)]
    fn shr<const K: i32>(self) -> Self {
        PlainBits(self.0.map(|x| x >> K))
    }
    #[inline(always)]
    fn mul32(self, b: Self) -> Self {
        let low = 0xffff_ffff;
        PlainBits(std::array::from_fn(|i| (self.0[i] & low) * (b.0[i] & low)))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    //! The two x86 register types. They are private and reached only through [`super::Isa::run`],
    //! which has checked the processor: that is what makes every `unsafe` below sound.

    use super::{Add, Div, Kernel, LANES, LaneBits, Lanes, Mul, Neg, Sub, Wide};
    use std::arch::x86_64::*;

    #[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
    pub(super) unsafe fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx512>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    #[derive(Clone, Copy)]
    struct Avx2(__m256d, __m256d);
    #[derive(Clone, Copy)]
    struct Avx2Bits(__m256i, __m256i);
    #[derive(Clone, Copy)]
    struct Avx512(__m512d);
    #[derive(Clone, Copy)]
    struct Avx512Bits(__m512i);

    macro_rules! operators {
        ($($op:ident $f:ident $two:ident $one:ident),*) => {$(
            impl $op for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $f(self, b: Self) -> Self {
                    unsafe { Avx2($two(self.0, b.0), $two(self.1, b.1)) }
                }
            }
            impl $op for Avx512 {
                type Output = Self;
                #[inline(always)]
                fn $f(self, b: Self) -> Self {
                    unsafe { Avx512($one(self.0, b.0)) }
                }
            }
        )*};
    }
    operators!(
        Add add _mm256_add_pd _mm512_add_pd,
        Sub sub _mm256_sub_pd _mm512_sub_pd,
        Mul mul _mm256_mul_pd _mm512_mul_pd,
        Div div _mm256_div_pd _mm512_div_pd
    );

    impl Neg for Avx2 {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            unsafe {
                let sign = _mm256_set1_pd(-0.0);
                Avx2(_mm256_xor_pd(self.0, sign), _mm256_xor_pd(self.1, sign))
            }
        }
    }

    impl Neg for Avx512 {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            unsafe { Avx512(_mm512_xor_pd(self.0, _mm512_set1_pd(-0.0))) }
        }
    }

    impl Lanes for Avx2 {
        type Bits = Avx2Bits;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            unsafe { Avx2(_mm256_set1_pd(x), _mm256_set1_pd(x)) }
        }
        #[inline(always)]
        fn load(from: &Wide) -> Self {
            unsafe {
                let p = from.0.as_ptr();
                Avx2(_mm256_load_pd(p), _mm256_load_pd(p.add(4)))
            }
        }
        #[inline(always)]
        fn store(self, to: &mut Wide) {
            unsafe {
                let p = to.0.as_mut_ptr();
                _mm256_store_pd(p, self.0);
                _mm256_store_pd(p.add(4), self.1);
            }
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            unsafe { Avx2(_mm256_fmadd_pd(self.0, b.0, c.0), _mm256_fmadd_pd(self.1, b.1, c.1)) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            unsafe { Avx2(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe {
                let sign = _mm256_set1_pd(-0.0);
                Avx2(_mm256_andnot_pd(sign, self.0), _mm256_andnot_pd(sign, self.1))
            }
        }
        #[inline(always)]
        fn max(self, b: Self) -> Self {
            unsafe { Avx2(_mm256_max_pd(self.0, b.0), _mm256_max_pd(self.1, b.1)) }
        }
        #[inline(always)]
        fn select_lt(self, than: Self, a: Self, b: Self) -> Self {
            unsafe {
                Avx2(
                    _mm256_blendv_pd(b.0, a.0, _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, than.0)),
                    _mm256_blendv_pd(b.1, a.1, _mm256_cmp_pd::<_CMP_LT_OQ>(self.1, than.1)),
                )
            }
        }
        #[inline(always)]
        fn to_bits(self) -> Avx2Bits {
            unsafe { Avx2Bits(_mm256_castpd_si256(self.0), _mm256_castpd_si256(self.1)) }
        }
        #[inline(always)]
        fn from_bits(bits: Avx2Bits) -> Self {
            unsafe { Avx2(_mm256_castsi256_pd(bits.0), _mm256_castsi256_pd(bits.1)) }
        }
    }

    impl Lanes for Avx512 {
        type Bits = Avx512Bits;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            unsafe { Avx512(_mm512_set1_pd(x)) }
        }
        #[inline(always)]
        fn load(from: &Wide) -> Self {
            unsafe { Avx512(_mm512_load_pd(from.0.as_ptr())) }
        }
        #[inline(always)]
        fn store(self, to: &mut Wide) {
            unsafe { _mm512_store_pd(to.0.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            unsafe { Avx512(_mm512_fmadd_pd(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            unsafe { Avx512(_mm512_sqrt_pd(self.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { Avx512(_mm512_andnot_pd(_mm512_set1_pd(-0.0), self.0)) }
        }
        #[inline(always)]
        fn max(self, b: Self) -> Self {
            unsafe { Avx512(_mm512_max_pd(self.0, b.0)) }
        }
        #[inline(always)]
        fn select_lt(self, than: Self, a: Self, b: Self) -> Self {
            unsafe {
                let mask = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, than.0);
                Avx512(_mm512_mask_blend_pd(mask, b.0, a.0))
            }
        }
        #[inline(always)]
        fn to_bits(self) -> Avx512Bits {
            unsafe { Avx512Bits(_mm512_castpd_si512(self.0)) }
        }
        #[inline(always)]
        fn from_bits(bits: Avx512Bits) -> Self {
            unsafe { Avx512(_mm512_castsi512_pd(bits.0)) }
        }
    }

    macro_rules! bit_operation {
        ($($f:ident $two:ident $one:ident),*) => {
            impl LaneBits for Avx2Bits {
                #[inline(always)]
                fn splat(x: u64) -> Self {
                    unsafe { Avx2Bits(_mm256_set1_epi64x(x as i64), _mm256_set1_epi64x(x as i64)) }
                }
                #[inline(always)]
                fn from_array(x: [u64; LANES]) -> Self {
                    unsafe {
                        let p = x.as_ptr().cast::<__m256i>();
                        Avx2Bits(_mm256_loadu_si256(p), _mm256_loadu_si256(p.add(1)))
                    }
                }
                #[inline(always)]
                fn to_array(self) -> [u64; LANES] {
                    let mut x = [0; LANES];
                    unsafe {
                        let p = x.as_mut_ptr().cast::<__m256i>();
                        _mm256_storeu_si256(p, self.0);
                        _mm256_storeu_si256(p.add(1), self.1);
                    }
                    x
                }
                #[inline(always)]
                fn shl<const K: i32>(self) -> Self {
                    unsafe { Avx2Bits(_mm256_slli_epi64::<K>(self.0), _mm256_slli_epi64::<K>(self.1)) }
                }
                #[inline(always)]
                fn shr<const K: i32>(self) -> Self {
                    unsafe { Avx2Bits(_mm256_srli_epi64::<K>(self.0), _mm256_srli_epi64::<K>(self.1)) }
                }
                $(#[inline(always)]
                fn $f(self, b: Self) -> Self {
                    unsafe { Avx2Bits($two(self.0, b.0), $two(self.1, b.1)) }
                })*
            }
            impl LaneBits for Avx512Bits {
                #[inline(always)]
                fn splat(x: u64) -> Self {
                    unsafe { Avx512Bits(_mm512_set1_epi64(x as i64)) }
                }
                #[inline(always)]
                fn from_array(x: [u64; LANES]) -> Self {
                    unsafe { Avx512Bits(_mm512_loadu_si512(x.as_ptr().cast())) }
                }
                #[inline(always)]
                fn to_array(self) -> [u64; LANES] {
                    let mut x = [0; LANES];
                    unsafe { _mm512_storeu_si512(x.as_mut_ptr().cast(), self.0) };
                    x
                }
                #[inline(always)]
                fn shl<const K: i32>(self) -> Self {
                    // The shift count of this width is unsigned; a variable count becomes a constant again.
                    unsafe { Avx512Bits(_mm512_sll_epi64(self.0, _mm_cvtsi32_si128(K))) }
                }
                #[inline(always)]
                fn shr<const K: i32>(self) -> Self {
                    unsafe { Avx512Bits(_mm512_srl_epi64(self.0, _mm_cvtsi32_si128(K))) }
                }
                $(#[inline(always)]
                fn $f(self, b: Self) -> Self {
                    unsafe { Avx512Bits($one(self.0, b.0)) }
                })*
            }
        };
    }
    bit_operation!(
        add _mm256_add_epi64 _mm512_add_epi64,
        xor _mm256_xor_si256 _mm512_xor_si512,
        and _mm256_and_si256 _mm512_and_si512,
        or _mm256_or_si256 _mm512_or_si512,
        mul32 _mm256_mul_epu32 _mm512_mul_epu32
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    struct EveryOperation<'a> {
        a: &'a [Wide],
        b: &'a [Wide],
        out: &'a mut Vec<Wide>,
    }

    impl Kernel for EveryOperation<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            for (a, b) in self.a.iter().zip(self.b) {
                let (x, y) = (L::load(a), L::load(b));
                let (i, j) = (x.to_bits(), y.to_bits());
                let seven = L::Bits::splat(0x7777_0000_7777_0001);
                let counted = L::Bits::from_array(i.to_array());
                let results = [
                    x + y,
                    x - y,
                    x * y,
                    x / y,
                    -x,
                    x.mul_add(y, L::splat(0.5)),
                    x.abs().sqrt(),
                    x.max(y),
                    x.select_lt(y, L::splat(1.0), x),
                    L::from_bits(i.add(j)),
                    L::from_bits(i.xor(j)),
                    L::from_bits(i.and(j).or(seven)),
                    L::from_bits(i.shl::<7>()),
                    L::from_bits(i.shr::<13>()),
                    L::from_bits(i.mul32(j)),
                    L::from_bits(counted),
                ];
                for r in results {
                    let mut w = Wide::ZERO;
                    r.store(&mut w);
                    self.out.push(w);
                }
            }
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let value = |k: usize| ((k * 2_654_435_761) % 2001) as f64 / 37.0 - 27.0;
        let a: Vec<Wide> =
            (0..5).map(|r| Wide(std::array::from_fn(|i| value(r * 8 + i)))).collect();
        let b: Vec<Wide> =
            (0..5).map(|r| Wide(std::array::from_fn(|i| value(r * 8 + i + 71)))).collect();
        let run = |isa: Isa| {
            let mut out = Vec::new();
            isa.run(EveryOperation { a: &a, b: &b, out: &mut out });
            out
        };
        let plain = run(Isa::Plain);
        for isa in Isa::available() {
            let lanes = if isa == Isa::One { 1 } else { LANES };
            for (got, want) in run(isa).iter().zip(&plain) {
                for k in 0..lanes {
                    assert_eq!(got.0[k].to_bits(), want.0[k].to_bits(), "{isa:?} lane {k}");
                }
            }
        }
        assert_eq!(plain[5].0[0], a[0].0[0].mul_add(b[0].0[0], 0.5));
    }
}
