//! Registers of eight replicates and the run-time choice of instruction set: `unsafe` stands here and in `simd/` alone.
//!
//! A kernel is written once, generic over [`Lanes`], and runs through [`Isa::run`]. Data lives in
//! [`Wide`] arrays that know nothing of instruction sets. All sets give the same bits, since every
//! operation here is a single IEEE operation and nothing is contracted.
#![allow(unsafe_code)]

use crate::Error;
use plain::Plain;
use std::ops::{Add, Div, Mul, Neg, Sub};

#[cfg(target_arch = "aarch64")]
mod neon;
mod plain;
#[cfg(target_arch = "x86_64")]
mod x86;

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

/// The numbers of memory blocks, one after another.
#[must_use]
pub fn numbers(blocks: &[Wide]) -> &[f64] {
    // SAFETY: a block is eight doubles without padding (size 64, checked below), and the lifetime is the slice's.
    unsafe { std::slice::from_raw_parts(blocks.as_ptr().cast(), blocks.len() * LANES) }
}

/// As [`numbers`], to be written.
#[must_use]
pub fn numbers_mut(blocks: &mut [Wide]) -> &mut [f64] {
    // SAFETY: as in `numbers`; the borrow is unique.
    unsafe { std::slice::from_raw_parts_mut(blocks.as_mut_ptr().cast(), blocks.len() * LANES) }
}

const _: () = assert!(size_of::<Wide>() == LANES * size_of::<f64>());

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

    /// Whether kernels for fixed small sizes are worth their code.
    const HINTS: bool;

    /// The same value in all lanes.
    fn splat(x: f64) -> Self;
    /// Reads a memory block.
    fn load(from: &Wide) -> Self;
    /// Reads eight neighbours from anywhere.
    fn load_any(from: &[f64; LANES]) -> Self;
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
    /// The smaller operand; the second where either is NaN.
    fn min(self, b: Self) -> Self;
    /// `a` where `self < than`, else `b` (also where the comparison meets a NaN).
    fn select_lt(self, than: Self, a: Self, b: Self) -> Self;
    /// `a` where this mask is 1, `b` where it is 0.
    #[inline(always)]
    fn choose(self, a: Self, b: Self) -> Self {
        Self::splat(0.5).select_lt(self, a, b)
    }
    /// Whether any lane is above zero.
    #[inline(always)]
    fn any(self) -> bool {
        let mut lanes = Wide::ZERO;
        self.store(&mut lanes);
        lanes.0.iter().any(|x| *x > 0.0)
    }
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
    /// 128-bit registers of 64-bit Arm, in fours.
    Neon,
    /// Arrays of eight, any processor.
    Plain,
}

impl Isa {
    /// What this processor has, best first; `Plain` always.
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
        #[cfg(target_arch = "aarch64")]
        all.push(Isa::Neon);
        all.push(Isa::Plain);
        all
    }

    /// The best set of this processor, or the one that `MODFUN_ISA` names: avx512, avx2, neon or plain.
    ///
    /// # Errors
    /// [`Error::Spec`] where there is no such set, or not on this processor.
    pub fn detect() -> Result<Isa, Error> {
        Isa::named(&std::env::var("MODFUN_ISA").unwrap_or_default())
    }

    fn named(name: &str) -> Result<Isa, Error> {
        let available = Isa::available();
        let (isa, needs) = match name {
            "" => return Ok(available.first().copied().unwrap_or(Isa::Plain)),
            "avx512" => (Isa::Avx512, "AVX-512 (F and DQ)"),
            "avx2" => (Isa::Avx2, "AVX2 with FMA"),
            "neon" => (Isa::Neon, "NEON"),
            "plain" => (Isa::Plain, "arrays"),
            _ => {
                return Err(Error::Spec(format!(
                    "MODFUN_ISA={name:?} is not one of \"avx512\", \"avx2\", \"neon\", \"plain\"; unset it, and the best that the processor has is taken"
                )));
            }
        };
        match available.contains(&isa) {
            true => Ok(isa),
            false => Err(Error::Spec(format!(
                "MODFUN_ISA={name}: this processor has no {needs}; unset it, and the best that it has is taken"
            ))),
        }
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
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => kernel.run::<neon::Neon>(),
            _ => kernel.run::<Plain<LANES>>(),
        }
    }
}

/// Runs a kernel on lane 0 alone, for one number: the bits are those of a lane.
pub fn alone<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Plain<1>>()
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
                    x.min(y),
                    x.select_lt(y, L::splat(1.0), x),
                    L::from_bits(i.add(j)),
                    L::from_bits(i.xor(j)),
                    L::from_bits(i.and(j).or(seven)),
                    L::from_bits(i.shl::<7>()),
                    L::from_bits(i.shr::<13>()),
                    L::from_bits(i.mul32(j)),
                    L::from_bits(counted),
                    L::load_any(&a.0),
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
    fn a_set_is_named_or_refused() {
        let available = Isa::available();
        assert_eq!(Isa::named("").unwrap(), available[0]);
        let all = [Isa::Avx512, Isa::Avx2, Isa::Neon, Isa::Plain];
        for (name, isa) in ["avx512", "avx2", "neon", "plain"].into_iter().zip(all) {
            match Isa::named(name) {
                Ok(found) => assert!(found == isa && available.contains(&isa), "{name}: {found:?}"),
                Err(e) => assert!(!available.contains(&isa), "{e}"),
            }
        }
        assert!(Isa::named("avx3").unwrap_err().to_string().contains("\"avx2\""));
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
            for (got, want) in run(isa).iter().zip(&plain) {
                for k in 0..LANES {
                    assert_eq!(got.0[k].to_bits(), want.0[k].to_bits(), "{isa:?} lane {k}");
                }
            }
        }
        assert_eq!(plain[5].0[0], a[0].0[0].mul_add(b[0].0[0], 0.5));
    }
}
