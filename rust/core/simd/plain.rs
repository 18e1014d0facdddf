//! Registers made of arrays: eight lanes for any processor, one lane for single numbers.

use super::{Add, Div, LANES, LaneBits, Lanes, Mul, Neg, Sub, Wide};

/// Arrays of lanes, the portable register.
#[derive(Clone, Copy)]
pub(super) struct Plain<const N: usize>([f64; N]);

/// Arrays of integers, the portable register.
#[derive(Clone, Copy)]
pub(super) struct PlainBits<const N: usize>([u64; N]);

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
    const HINTS: bool = false;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Plain([x; N])
    }
    #[inline(always)]
    fn load(from: &Wide) -> Self {
        Plain::load_any(&from.0)
    }
    #[inline(always)]
    fn load_any(from: &[f64; LANES]) -> Self {
        Plain(std::array::from_fn(|i| from[i]))
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        to.0[..N].copy_from_slice(&self.0);
    }
    // Without the instruction each lane is a call: once here rather than all over the kernels.
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
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
    fn min(self, b: Self) -> Self {
        Plain(std::array::from_fn(|i| if self.0[i] < b.0[i] { self.0[i] } else { b.0[i] }))
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
