//! Addressed random streams and their standard normals, eight replicates at a time.
//!
//! An address (seed, purpose, channel, replicate, group) passes through Philox4x32-10 (Salmon,
//! Moraes, Dror and Shaw 2011), which gives the state of a xoshiro256++ generator (Blackman and
//! Vigna 2019); its draws become normals by Box and Muller's transform in pairs. A replicate's
//! normals depend on its address alone: not on its neighbours, block, thread or processor.

use crate::math::{flip_sign, ln, sin_cos_small, swap};
use crate::simd::{self, Isa, Kernel, LANES, LaneBits, Lanes, Wide};

/// Changes whenever the same address gives other numbers; study manifests hold it.
pub const STREAM_VERSION: u32 = 1;

/// What the numbers are for; streams of different purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Measurement noise on an output.
    NoiseY = 0,
    /// Measurement noise on an input.
    NoiseU = 1,
    /// Random initial states.
    InitialState = 2,
    /// Resampling.
    Bootstrap = 3,
    /// A user's own functions.
    User = 4,
    /// What is free in a record whose coefficients were drawn.
    Completion = 5,
}

impl Purpose {
    /// All purposes, in the order of their codes.
    pub const ALL: [Purpose; 6] = [
        Purpose::NoiseY,
        Purpose::NoiseU,
        Purpose::InitialState,
        Purpose::Bootstrap,
        Purpose::User,
        Purpose::Completion,
    ];

    /// The name in the Python interface and in manifests.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Purpose::NoiseY => "noise_y",
            Purpose::NoiseU => "noise_u",
            Purpose::InitialState => "initial_state",
            Purpose::Bootstrap => "bootstrap",
            Purpose::User => "user",
            Purpose::Completion => "completion",
        }
    }
}

/// Where a stream begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// The study's seed, the key of the cipher.
    pub seed: u64,
    /// What for.
    pub purpose: Purpose,
    /// Channel, below 2²⁷ (higher bits are dropped).
    pub channel: u32,
    /// Replicate; in lanes that of lane 0.
    pub replicate: u64,
    /// Noise group: cells of a study that share their noise share the group.
    pub group: u32,
}

/// Ten rounds of Philox4x32; each lane holds 32-bit words in its low half.
#[inline(always)]
fn philox<B: LaneBits>(mut counter: [B; 4], key: [u32; 2]) -> [B; 4] {
    const WEYL: [u32; 2] = [0x9e37_79b9, 0xbb67_ae85];
    let multiplier = [B::splat(0xd251_1f53), B::splat(0xcd9e_8d57)];
    let low = B::splat(0xffff_ffff);
    let mut round_key = key;
    for _ in 0..10 {
        let (p, q) = (multiplier[0].mul32(counter[0]), multiplier[1].mul32(counter[2]));
        let k = [B::splat(u64::from(round_key[0])), B::splat(u64::from(round_key[1]))];
        counter = [
            q.shr::<32>().xor(counter[1]).xor(k[0]),
            q.and(low),
            p.shr::<32>().xor(counter[3]).xor(k[1]),
            p.and(low),
        ];
        round_key = [round_key[0].wrapping_add(WEYL[0]), round_key[1].wrapping_add(WEYL[1])];
    }
    counter
}

#[inline(always)]
fn rotate_left<B: LaneBits, const LEFT: i32, const RIGHT: i32>(x: B) -> B {
    x.shl::<LEFT>().or(x.shr::<RIGHT>())
}

/// xoshiro256++ in lanes.
#[derive(Clone, Copy)]
struct Xoshiro<B>([B; 4]);

impl<B: LaneBits> Xoshiro<B> {
    #[inline(always)]
    fn next(&mut self) -> B {
        let [a, b, c, d] = self.0;
        let result = rotate_left::<B, 23, 41>(a.add(d)).add(a);
        let (c, d) = (c.xor(a), d.xor(b));
        self.0 = [a.xor(d), b.xor(c), c.xor(b.shl::<17>()), rotate_left::<B, 45, 19>(d)];
        result
    }
}

/// Standard normals of the replicates `address.replicate ..`, one a lane.
#[derive(Clone, Copy)]
pub struct NormalStream<L: Lanes>(Xoshiro<L::Bits>);

impl<L: Lanes> NormalStream<L> {
    /// The stream at an address; lane k belongs to replicate `address.replicate + k`.
    #[inline(always)]
    #[must_use]
    pub fn new(address: Address) -> Self {
        let replicate: [u64; LANES] =
            std::array::from_fn(|k| address.replicate.wrapping_add(k as u64));
        let replicate = L::Bits::from_array(replicate);
        let low = replicate.and(L::Bits::splat(0xffff_ffff));
        let high = replicate.shr::<32>();
        let group = L::Bits::splat(u64::from(address.group));
        let key = [address.seed as u32, (address.seed >> 32) as u32];
        let place = ((address.purpose as u32) << 28) | ((address.channel & 0x07ff_ffff) << 1);
        // No closures here: one that is not inlined loses the instruction set.
        let a = philox([low, high, group, L::Bits::splat(u64::from(place))], key);
        let b = philox([low, high, group, L::Bits::splat(u64::from(place | 1))], key);
        // Never all zero: the cipher maps one address in 2²⁵⁶ there.
        NormalStream(Xoshiro([
            a[0].or(a[1].shl::<32>()),
            a[2].or(a[3].shl::<32>()),
            b[0].or(b[1].shl::<32>()),
            b[2].or(b[3].shl::<32>()),
        ]))
    }

    /// The next two normals of each lane.
    #[inline(always)]
    pub fn pair(&mut self) -> (L, L) {
        let (first, second) = self.draws();
        turn(radius_squared(first), second)
    }

    /// The next two draws of each lane, as bit patterns.
    #[inline(always)]
    fn draws(&mut self) -> (L, L) {
        let (first, second) = (self.0.next(), self.0.next());
        (L::from_bits(first), L::from_bits(second))
    }
}

/// The top 52 bits as a number in [1, 2).
#[inline(always)]
fn mantissa<L: Lanes>(bits: L::Bits) -> L {
    L::from_bits(bits.shr::<12>().or(L::Bits::splat(0x3ff0_0000_0000_0000)))
}

/// −2 ln u, u in (0, 1] in steps of 2⁻⁵²: a radius up to 8.49.
#[inline(always)]
fn radius_squared<L: Lanes>(draw: L) -> L {
    ln(L::splat(2.0) - mantissa::<L>(draw.to_bits())) * L::splat(-2.0)
}

/// The point at this radius whose angle is uniform: within an eighth of a turn of an axis by the
/// top 52 bits, the axis and its direction by two bits of the lowest twelve.
#[inline(always)]
fn turn<L: Lanes>(radius_squared: L, draw: L) -> (L, L) {
    let bits = draw.to_bits();
    let quarter = L::splat(std::f64::consts::FRAC_PI_2);
    let angle = mantissa::<L>(bits).mul_add(quarter, L::splat(-1.5 * std::f64::consts::FRAC_PI_2));
    let (sin, cos) = sin_cos_small(angle);
    let (a, b) = swap(flip_sign(cos, bits.shl::<63>()), sin, bits.shr::<1>());
    let radius = radius_squared.sqrt();
    (radius * a, radius * b)
}

struct Fill<'a> {
    address: Address,
    out: &'a mut [Wide],
}

impl Kernel for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        // A pair takes about as many instructions as a processor looks ahead, and logarithm and
        // root are one long chain of them. Three short loops over a block, kept in `out` itself,
        // let it work on several pairs at once: a fifth less time than pair by pair.
        const BLOCK: usize = 64;
        let mut stream = NormalStream::<L>::new(self.address);
        for block in self.out.chunks_mut(BLOCK) {
            let (pairs, last) = block.as_chunks_mut::<2>();
            for [a, b] in &mut *pairs {
                let (x, y) = stream.draws();
                x.store(a);
                y.store(b);
            }
            for [a, _] in &mut *pairs {
                radius_squared(L::load(a)).store(a);
            }
            for [a, b] in pairs {
                let (x, y) = turn(L::load(a), L::load(b));
                x.store(a);
                y.store(b);
            }
            for a in last {
                stream.pair().0.store(a);
            }
        }
    }
}

/// Writes `out.len()` standard normals for each of the replicates `first_replicate ..`, one a lane.
///
/// Normals come in pairs; of an odd count the spare one is dropped.
pub fn fill(
    isa: Isa,
    seed: u64,
    purpose: Purpose,
    channel: u32,
    first_replicate: u64,
    group: u32,
    out: &mut [Wide],
) {
    let address = Address { seed, purpose, channel, replicate: first_replicate, group };
    isa.run(Fill { address, out });
}

/// The first `out.len()` normals of one replicate, the same bits as a lane of [`fill`].
pub fn normals(address: Address, out: &mut [f64]) {
    struct One<'a>(Address, &'a mut [f64]);
    impl Kernel for One<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            let mut stream = NormalStream::<L>::new(self.0);
            let mut pair = [Wide::ZERO; 2];
            for out in self.1.chunks_mut(2) {
                let (x, y) = stream.pair();
                x.store(&mut pair[0]);
                y.store(&mut pair[1]);
                for (out, from) in out.iter_mut().zip(&pair) {
                    *out = from.0[0];
                }
            }
        }
    }
    simd::alone(One(address, out));
}

/// Rows of normals, one for each of the replicates `first.replicate ..`: the same bits as [`normals`] of each.
pub fn rows(isa: Isa, first: Address, length: usize, out: &mut [f64]) {
    let mut lanes = vec![Wide::ZERO; length];
    let Address { seed, purpose, channel, mut replicate, group } = first;
    for block in out.chunks_mut((LANES * length).max(1)) {
        fill(isa, seed, purpose, channel, replicate, group, &mut lanes);
        for (lane, row) in block.chunks_mut(length.max(1)).enumerate() {
            for (to, from) in row.iter_mut().zip(&lanes) {
                *to = from.0[lane];
            }
        }
        replicate = replicate.wrapping_add(LANES as u64);
    }
}

#[cfg(test)]
mod tests;
