//! Known answers, lane independence, moments and tails of the streams.
//!
//! Seeds are fixed, so each statistical test passes or fails for ever; the bounds are those a
//! correct generator would miss with the probability stated, for an arbitrary seed.
#![allow(clippy::disallowed_methods)]

use super::*;
use proptest::prelude::*;

struct Philox([u32; 4], [u32; 2]);

impl Kernel for Philox {
    type Output = [u64; 4];
    #[inline(always)]
    fn run<L: Lanes>(self) -> [u64; 4] {
        philox(self.0.map(|w| L::Bits::splat(u64::from(w))), self.1).map(|b| b.to_array()[0])
    }
}

#[test]
fn philox_gives_the_published_answers() {
    let known = [
        ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
        ([!0; 4], [!0; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
        (
            [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
            [0xa409_3822, 0x299f_31d0],
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
        ),
    ];
    for isa in Isa::available() {
        for (counter, key, want) in known {
            assert_eq!(isa.run(Philox(counter, key)), want, "{isa:?}");
        }
    }
}

/// The generator in its published scalar form.
fn xoshiro_1(s: &mut [u64; 4]) -> u64 {
    let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
    let t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = s[3].rotate_left(45);
    result
}

#[test]
fn xoshiro_is_the_published_one() {
    struct Draws([u64; 4]);
    impl Kernel for Draws {
        type Output = Vec<u64>;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<u64> {
            let mut x = Xoshiro(self.0.map(L::Bits::splat));
            (0..20).map(|_| x.next().to_array()[0]).collect()
        }
    }
    // First outputs of the reference code at state 1, 2, 3, 4.
    let mut state = [1, 2, 3, 4];
    let scalar: Vec<u64> = (0..20).map(|_| xoshiro_1(&mut state)).collect();
    assert_eq!(scalar[..4], [41_943_041, 58_720_359, 3_588_806_011_781_223, 3_591_011_842_654_386]);
    for isa in Isa::available() {
        assert_eq!(isa.run(Draws([1, 2, 3, 4])), scalar, "{isa:?}");
    }
}

fn block(isa: Isa, seed: u64, channel: u32, first: u64, count: usize) -> Vec<Wide> {
    let mut out = vec![Wide::ZERO; count];
    fill(isa, seed, Purpose::NoiseY, channel, first, 3, &mut out);
    out
}

fn one(seed: u64, channel: u32, replicate: u64, count: usize) -> Vec<f64> {
    let mut out = vec![0.0; count];
    normals(Address { seed, purpose: Purpose::NoiseY, channel, replicate, group: 3 }, &mut out);
    out
}

#[test]
fn rows_are_the_normals_of_each_replicate() {
    for (replicates, length) in [(1, 1), (8, 2), (11, 7), (3, 0), (0, 5)] {
        let first =
            Address { seed: 9, purpose: Purpose::NoiseY, channel: 2, replicate: 13, group: 3 };
        let mut found = vec![0.0; replicates * length];
        rows(Isa::detect().unwrap(), first, length, &mut found);
        let wanted: Vec<f64> = (13..13 + replicates as u64)
            .flat_map(|replicate| one(9, 2, replicate, length))
            .collect();
        assert_eq!(found, wanted, "{replicates} rows of {length}");
    }
}

proptest! {
    #[test]
    fn a_replicate_has_the_same_bits_in_any_lane_block_and_instruction_set(
        seed: u64, channel in 0u32..100, first in prop_oneof![0u64..1000, any::<u64>()], count in 0usize..20,
    ) {
        for isa in Isa::available() {
            let out = block(isa, seed, channel, first, count);
            for lane in 0..LANES {
                let alone = one(seed, channel, first.wrapping_add(lane as u64), count);
                for (wide, alone) in out.iter().zip(&alone) {
                    prop_assert_eq!(wide.0[lane].to_bits(), alone.to_bits());
                }
            }
        }
    }
}

#[test]
fn a_longer_stream_begins_with_the_shorter() {
    let long = one(7, 0, 0, 101);
    for count in [1, 2, 3, 64, 100] {
        assert_eq!(one(7, 0, 0, count), long[..count]);
    }
}

#[test]
fn every_part_of_the_address_matters() {
    let base = Address { seed: 5, purpose: Purpose::NoiseY, channel: 1, replicate: 2, group: 3 };
    let mut seen = Vec::new();
    let others = [
        base,
        Address { seed: 6, ..base },
        Address { seed: 5 | 1 << 40, ..base },
        Address { channel: 2, ..base },
        Address { replicate: 3, ..base },
        Address { replicate: 2 | 1 << 40, ..base },
        Address { group: 4, ..base },
        Address { purpose: Purpose::NoiseU, ..base },
        Address { purpose: Purpose::InitialState, ..base },
        Address { purpose: Purpose::Bootstrap, ..base },
        Address { purpose: Purpose::User, ..base },
    ];
    for address in others {
        let mut first = [0.0; 2];
        normals(address, &mut first);
        assert!(!seen.contains(&first.map(f64::to_bits)), "{address:?}");
        seen.push(first.map(f64::to_bits));
    }
}

#[test]
fn golden_first_normals() {
    let mut got = [0.0; 5];
    normals(
        Address { seed: 24, purpose: Purpose::NoiseY, channel: 0, replicate: 0, group: 0 },
        &mut got,
    );
    let want: [u64; 5] = [
        0x3ff0_baba_6be9_ebe8,
        0xbff3_5253_36ed_0ece,
        0xbfec_3ae4_e916_5d6d,
        0x3fdc_2620_66f9_0316,
        0x3ffa_8ff5_7f4c_66d2,
    ];
    assert_eq!(got.map(f64::to_bits), want, "{got:?}: a new stream needs a new STREAM_VERSION");
}

/// A million normals: 4000 replicates of 250.
fn million() -> Vec<f64> {
    let mut all = vec![0.0; 1_000_000];
    for (replicate, out) in all.chunks_mut(2000).enumerate() {
        let first = replicate as u64 * 8;
        let wide = block(Isa::detect().unwrap(), 11, 0, first, 250);
        for (k, w) in wide.iter().enumerate() {
            for lane in 0..LANES {
                out[lane * 250 + k] = w.0[lane];
            }
        }
    }
    all
}

#[test]
fn moments() {
    let z = million();
    let n = z.len() as f64;
    let moment = |k: i32| z.iter().map(|x| x.powi(k)).sum::<f64>() / n;
    // Each within 4 standard errors of its own: false alarm 6e-5 each. Var z^k = (2k-1)!! - ((k-1)!!)².
    for (k, expected, variance) in [
        (1, 0.0, 1.0),
        (2, 1.0, 2.0),
        (3, 0.0, 15.0),
        (4, 3.0, 96.0),
        (5, 0.0, 945.0),
        (6, 15.0, 10_170.0),
    ] {
        let off = (moment(k) - expected) / f64::sqrt(variance / n);
        assert!(off.abs() < 4.0, "moment {k} off by {off} standard errors");
    }
}

#[test]
fn tails_hold_their_share() {
    let z = million();
    // P(|z| > c); binomial counts within 4 standard deviations: false alarm 6e-5 each
    // (3e-4 for the last, whose count is 57 and skewed).
    for (limit, share) in [
        (1.0, 0.317_310_5),
        (2.0, 0.045_500_26),
        (3.0, 2.699_796e-3),
        (3.5, 4.652_582e-4),
        (4.0, 6.334_248e-5),
    ] {
        let want = share * z.len() as f64;
        for sign in [-1.0, 1.0] {
            let count = z.iter().filter(|x| **x * sign > limit).count() as f64;
            let off = (count - 0.5 * want) / (0.5 * want * (1.0 - 0.5 * share)).sqrt();
            assert!(off.abs() < 4.0, "beyond {limit} × {sign}: {count} for {}", 0.5 * want);
        }
    }
    // The largest of a million lies in (4.2, 6.2) but for 1e-5 + 3e-4 on each side.
    let largest = z.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    assert!(largest > 4.2 && largest < 6.2, "{largest}");
}

/// Φ(x) by the series of Marsaglia, good to 1e-14 here.
fn normal_cdf(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (x, x, 1.0);
    while term.abs() > 1e-17 * sum.abs() {
        k += 2.0;
        term *= x * x / k;
        sum += term;
    }
    0.5 + sum * (-0.5 * x * x - 0.918_938_533_204_672_7).exp()
}

#[test]
fn kolmogorov_smirnov() {
    let mut z = million();
    // Both members of the pairs alone, and all: √n D below 2.2, false alarm 1.2e-4 each.
    let even: Vec<f64> = z.iter().copied().step_by(2).collect();
    let odd: Vec<f64> = z.iter().copied().skip(1).step_by(2).collect();
    z.truncate(500_000);
    for mut sample in [even, odd, z] {
        sample.sort_by(f64::total_cmp);
        let n = sample.len() as f64;
        let distance = sample.iter().enumerate().fold(0.0f64, |d, (k, x)| {
            let f = if *x == 0.0 { 0.5 } else { normal_cdf(*x) };
            d.max(f - k as f64 / n).max((k + 1) as f64 / n - f)
        });
        assert!(distance * n.sqrt() < 2.2, "{}", distance * n.sqrt());
    }
}

#[test]
fn neighbouring_streams_and_draws_are_uncorrelated() {
    // Correlations of 100,000 pairs within 4.5/√n: false alarm 7e-6 each.
    let count = 12_500;
    let correlation = |a: &[f64], b: &[f64]| {
        let sum: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
        sum / (a.len() as f64).sqrt()
    };
    let stream = |seed, channel, group, purpose| {
        let mut out = vec![Wide::ZERO; count];
        fill(Isa::detect().unwrap(), seed, purpose, channel, 0, group, &mut out);
        let lane = |k: usize| out.iter().map(|w| w.0[k]).collect::<Vec<f64>>();
        (0..LANES).flat_map(lane).collect::<Vec<f64>>()
    };
    let base = stream(9, 0, 0, Purpose::NoiseY);
    let square = |x: &[f64]| x.iter().map(|x| (x * x - 1.0) / 2f64.sqrt()).collect::<Vec<f64>>();
    for other in [
        stream(10, 0, 0, Purpose::NoiseY),
        stream(9, 1, 0, Purpose::NoiseY),
        stream(9, 0, 1, Purpose::NoiseY),
        stream(9, 0, 0, Purpose::NoiseU),
        base[count..].iter().chain(&base[..count]).copied().collect(),
    ] {
        assert!(correlation(&base, &other).abs() < 4.5);
        assert!(correlation(&square(&base), &square(&other)).abs() < 4.5);
    }
    for lag in [1, 2, 3, 7, 250] {
        assert!(correlation(&base[lag..], &base[..base.len() - lag]).abs() < 4.5, "lag {lag}");
        let s = square(&base);
        assert!(correlation(&s[lag..], &s[..s.len() - lag]).abs() < 4.5, "squares, lag {lag}");
    }
}
