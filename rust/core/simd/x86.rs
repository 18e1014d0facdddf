//! The two x86 register types. They are private and reached only through [`super::Isa::run`],
//! which has checked the processor: that is what makes every `unsafe` below sound. Operations on registers
//! need no more; those that touch memory say why they may.
#![allow(clippy::undocumented_unsafe_blocks)] // the reason above is that of all others

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
    const HINTS: bool = true;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Avx2(_mm256_set1_pd(x), _mm256_set1_pd(x)) }
    }
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        // SAFETY: a `Wide` holds eight numbers and is aligned to 64 bytes.
        unsafe {
            let p = from.0.as_ptr();
            Avx2(_mm256_load_pd(p), _mm256_load_pd(p.add(4)))
        }
    }
    #[inline(always)]
    fn load_any(from: &[f64; LANES]) -> Self {
        // SAFETY: eight numbers are there, aligned as it happens.
        unsafe {
            let p = from.as_ptr();
            Avx2(_mm256_loadu_pd(p), _mm256_loadu_pd(p.add(4)))
        }
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        // SAFETY: a `Wide` holds eight numbers and is aligned to 64 bytes.
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
    fn min(self, b: Self) -> Self {
        unsafe { Avx2(_mm256_min_pd(self.0, b.0), _mm256_min_pd(self.1, b.1)) }
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
    fn any(self) -> bool {
        unsafe {
            let zero = _mm256_setzero_pd();
            let above = _mm256_or_pd(
                _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, zero),
                _mm256_cmp_pd::<_CMP_GT_OQ>(self.1, zero),
            );
            _mm256_movemask_pd(above) != 0
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
    const HINTS: bool = true;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Avx512(_mm512_set1_pd(x)) }
    }
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        // SAFETY: a `Wide` holds eight numbers and is aligned to 64 bytes.
        unsafe { Avx512(_mm512_load_pd(from.0.as_ptr())) }
    }
    #[inline(always)]
    fn load_any(from: &[f64; LANES]) -> Self {
        // SAFETY: eight numbers are there, aligned as it happens.
        unsafe { Avx512(_mm512_loadu_pd(from.as_ptr())) }
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        // SAFETY: a `Wide` holds eight numbers and is aligned to 64 bytes.
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
    fn min(self, b: Self) -> Self {
        unsafe { Avx512(_mm512_min_pd(self.0, b.0)) }
    }
    #[inline(always)]
    fn select_lt(self, than: Self, a: Self, b: Self) -> Self {
        unsafe {
            let mask = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, than.0);
            Avx512(_mm512_mask_blend_pd(mask, b.0, a.0))
        }
    }
    #[inline(always)]
    fn any(self) -> bool {
        unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_pd()) != 0 }
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
                // SAFETY: eight numbers are there, aligned as it happens.
                unsafe {
                    let p = x.as_ptr().cast::<__m256i>();
                    Avx2Bits(_mm256_loadu_si256(p), _mm256_loadu_si256(p.add(1)))
                }
            }
            #[inline(always)]
            fn to_array(self) -> [u64; LANES] {
                let mut x = [0; LANES];
                // SAFETY: eight numbers are there, aligned as it happens.
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
                // SAFETY: eight numbers are there, aligned as it happens.
                unsafe { Avx512Bits(_mm512_loadu_si512(x.as_ptr().cast())) }
            }
            #[inline(always)]
            fn to_array(self) -> [u64; LANES] {
                let mut x = [0; LANES];
                // SAFETY: eight numbers are there, aligned as it happens.
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
