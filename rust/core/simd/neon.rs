//! Four registers of two for 64-bit Arm, every processor of which has them: that is what makes every `unsafe`
//! below sound. Operations on registers need no more; those that touch memory say why they may.
#![allow(clippy::undocumented_unsafe_blocks)] // the reason above is that of all others

use super::{Add, Div, LANES, LaneBits, Lanes, Mul, Neg, Sub, Wide};
use std::arch::aarch64::*;

const PAIRS: usize = LANES / 2;

#[derive(Clone, Copy)]
pub(super) struct Neon([float64x2_t; PAIRS]);
#[derive(Clone, Copy)]
pub(super) struct NeonBits([uint64x2_t; PAIRS]);

/// What `f` makes of each pair of lanes.
#[inline(always)]
fn each<T>(f: impl Fn(usize) -> T) -> [T; PAIRS] {
    [f(0), f(1), f(2), f(3)]
}

macro_rules! operators {
    ($($op:ident $f:ident $two:ident),*) => {$(
        impl $op for Neon {
            type Output = Self;
            #[inline(always)]
            fn $f(self, b: Self) -> Self {
                unsafe { Neon(each(|k| $two(self.0[k], b.0[k]))) }
            }
        }
    )*};
}
operators!(Add add vaddq_f64, Sub sub vsubq_f64, Mul mul vmulq_f64, Div div vdivq_f64);

impl Neg for Neon {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        unsafe { Neon(each(|k| vnegq_f64(self.0[k]))) }
    }
}

impl Lanes for Neon {
    type Bits = NeonBits;
    const HINTS: bool = true;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Neon([vdupq_n_f64(x); PAIRS]) }
    }
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Neon::load_any(&from.0)
    }
    #[inline(always)]
    fn load_any(from: &[f64; LANES]) -> Self {
        // SAFETY: eight numbers are there, and loads need no alignment but that of a number.
        unsafe { Neon(each(|k| vld1q_f64(from.as_ptr().add(2 * k)))) }
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        let p = to.0.as_mut_ptr();
        // SAFETY: a `Wide` holds eight numbers, and stores need no alignment but that of a number.
        unsafe { each(|k| vst1q_f64(p.add(2 * k), self.0[k])) };
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Neon(each(|k| vfmaq_f64(c.0[k], self.0[k], b.0[k]))) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Neon(each(|k| vsqrtq_f64(self.0[k]))) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Neon(each(|k| vabsq_f64(self.0[k]))) }
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // The instruction for it hands on a NaN of either operand; x86's takes the second.
        unsafe { Neon(each(|k| vbslq_f64(vcgtq_f64(self.0[k], b.0[k]), self.0[k], b.0[k]))) }
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        unsafe { Neon(each(|k| vbslq_f64(vcltq_f64(self.0[k], b.0[k]), self.0[k], b.0[k]))) }
    }
    #[inline(always)]
    fn select_lt(self, than: Self, a: Self, b: Self) -> Self {
        unsafe { Neon(each(|k| vbslq_f64(vcltq_f64(self.0[k], than.0[k]), a.0[k], b.0[k]))) }
    }
    #[inline(always)]
    fn any(self) -> bool {
        unsafe {
            let above = each(|k| vcgtzq_f64(self.0[k]));
            let all = vorrq_u64(vorrq_u64(above[0], above[1]), vorrq_u64(above[2], above[3]));
            vmaxvq_u32(vreinterpretq_u32_u64(all)) != 0
        }
    }
    #[inline(always)]
    fn to_bits(self) -> NeonBits {
        unsafe { NeonBits(each(|k| vreinterpretq_u64_f64(self.0[k]))) }
    }
    #[inline(always)]
    fn from_bits(bits: NeonBits) -> Self {
        unsafe { Neon(each(|k| vreinterpretq_f64_u64(bits.0[k]))) }
    }
}

macro_rules! bit_operations {
    ($($f:ident $two:ident),*) => {
        impl LaneBits for NeonBits {
            #[inline(always)]
            fn splat(x: u64) -> Self {
                unsafe { NeonBits([vdupq_n_u64(x); PAIRS]) }
            }
            #[inline(always)]
            fn from_array(x: [u64; LANES]) -> Self {
                // SAFETY: eight numbers are there, and loads need no alignment but that of a number.
                unsafe { NeonBits(each(|k| vld1q_u64(x.as_ptr().add(2 * k)))) }
            }
            #[inline(always)]
            fn to_array(self) -> [u64; LANES] {
                let mut x = [0; LANES];
                let p = x.as_mut_ptr();
                // SAFETY: eight numbers are there, and stores need no alignment but that of a number.
                unsafe { each(|k| vst1q_u64(p.add(2 * k), self.0[k])) };
                x
            }
            #[inline(always)]
            fn shl<const K: i32>(self) -> Self {
                unsafe { NeonBits(each(|k| vshlq_n_u64::<K>(self.0[k]))) }
            }
            #[inline(always)]
            fn shr<const K: i32>(self) -> Self {
                unsafe { NeonBits(each(|k| vshrq_n_u64::<K>(self.0[k]))) }
            }
            #[inline(always)]
            fn mul32(self, b: Self) -> Self {
                unsafe { NeonBits(each(|k| vmull_u32(vmovn_u64(self.0[k]), vmovn_u64(b.0[k])))) }
            }
            $(#[inline(always)]
            fn $f(self, b: Self) -> Self {
                unsafe { NeonBits(each(|k| $two(self.0[k], b.0[k]))) }
            })*
        }
    };
}
bit_operations!(add vaddq_u64, xor veorq_u64, and vandq_u64, or vorrq_u64);
