//! Counts of errors in bins of equal relative width: medians and quantiles in fixed memory.
//!
//! Counts are integers, so the order in which they are added is free. What is kept and merged is the
//! list of occupied bins; all bins (128 kB) exist only while errors are being counted.

/// Bins an octave: widths of 0.4 to 0.8 % of the error.
const PER_OCTAVE: u64 = 128;
/// Octaves from the smallest error told from zero to the largest told from infinity.
const OCTAVES: u64 = 64;
/// The bits of 2⁻⁴⁴, the smallest relative to the truth's size, without those below a bin.
const FIRST: u64 = (1023 - 44) * PER_OCTAVE;
const SIDE: usize = (PER_OCTAVE * OCTAVES) as usize;
/// The last bin counts what is not a number.
const NANS: usize = 2 * SIDE + 1;
/// Bins of one parameter.
pub const BINS: usize = NANS + 1;

/// An occupied bin and its count.
pub type Occupied = (u16, u64);

/// Errors of one parameter being counted.
///
/// Errors from 2⁻⁴⁴ to 2²⁰ times the truth's size (its power of two; 1 for a zero truth) are kept
/// to 0.4 %. Smaller ones count as 0; larger ones and infinities are counted, but a quantile that lies
/// among them is NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// The inverse of a power of two near the truth's size.
    inverse: f64,
    /// From the largest negative error over zero to the largest positive, then what is no number.
    counts: Vec<u64>,
}

/// A power of two near the truth's size: its exponent alone, held to where the inverse is exact too.
fn scale(truth: f64) -> f64 {
    let exponent = f64::from_bits(truth.to_bits() & (0x7ff << 52));
    if truth != 0.0 && (1e-250..1e250).contains(&exponent) { exponent } else { 1.0 }
}

impl Histogram {
    /// An empty histogram of the errors of a parameter whose true value is `truth`.
    #[must_use]
    pub fn new(truth: f64) -> Histogram {
        Histogram { inverse: 1.0 / scale(truth), counts: vec![0; BINS] }
    }

    /// Counts one error.
    #[inline]
    pub fn push(&mut self, error: f64) {
        // The exponent and the top 7 bits of the mantissa number the bins.
        let bits = (error.abs() * self.inverse).to_bits() >> 45;
        let size = (bits + 1).saturating_sub(FIRST).min(SIDE as u64) as usize;
        let bin = if error.is_nan() {
            NANS
        } else if error < 0.0 {
            SIDE - size
        } else {
            SIDE + size
        };
        self.counts[bin] += 1;
    }

    /// The bins that hold something, in order.
    #[must_use]
    pub fn occupied(&self) -> Vec<Occupied> {
        let some = || self.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        let mut out = Vec::with_capacity(some().count());
        out.extend(some().map(|(bin, count)| (bin as u16, *count)));
        out
    }
}

/// The quantile of counted errors for `share` in [0, 1] (order statistics interpolated linearly, as
/// NumPy does), within 0.4 % of the order statistics' sizes.
///
/// NaN where nothing was counted, a NaN was, `share` is outside, or the errors there are too large.
#[must_use]
pub fn quantile(occupied: &[Occupied], truth: f64, share: f64) -> f64 {
    let n: u64 = occupied.iter().map(|(_, count)| count).sum();
    let nan = occupied.last().is_some_and(|(bin, _)| usize::from(*bin) >= NANS);
    if n == 0 || nan || !(0.0..=1.0).contains(&share) {
        return f64::NAN;
    }
    let rank = share * (n - 1) as f64;
    let below = rank as u64;
    let scale = scale(truth);
    let low = order_statistic(occupied, below) * scale;
    let part = rank - below as f64;
    if part == 0.0 {
        return low;
    }
    low + (order_statistic(occupied, below + 1) * scale - low) * part
}

/// The middle of the bin of the error number `rank`, counted from 0, in units of the scale.
fn order_statistic(occupied: &[Occupied], rank: u64) -> f64 {
    let mut seen = 0;
    let found = occupied.iter().find(|(_, count)| {
        seen += count;
        seen > rank
    });
    found.map_or(f64::NAN, |(bin, _)| {
        let bin = usize::from(*bin);
        let size = bin.abs_diff(SIDE) as u64;
        if size == 0 {
            return 0.0;
        }
        if size == SIDE as u64 {
            return f64::NAN;
        }
        // The bin's bits, and half a bin more.
        let middle = f64::from_bits(((FIRST + size - 1) << 45) | 1 << 44);
        if bin < SIDE { -middle } else { middle }
    })
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

    fn counted(errors: &[f64], truth: f64) -> Vec<Occupied> {
        let mut h = Histogram::new(truth);
        errors.iter().for_each(|e| h.push(*e));
        h.occupied()
    }

    fn median(errors: &[f64], truth: f64) -> f64 {
        quantile(&counted(errors, truth), truth, 0.5)
    }

    proptest! {
        #[test]
        fn quantiles_are_those_of_the_sorted_errors(
            count in 1usize..400, share in 0.0f64..=1.0, mean in -2.0f64..2.0, truth in -1e3f64..1e3,
            replicate in 0u64..100,
        ) {
            let mut e = errors(replicate, count, mean * truth, 0.3 * truth.abs() + 1e-6);
            let got = quantile(&counted(&e, truth), truth, share);
            e.sort_by(f64::total_cmp);
            let rank = share * (count - 1) as f64;
            let (low, high) = (e[rank.floor() as usize], e[rank.ceil() as usize]);
            let want = low + (high - low) * (rank - rank.floor());
            let tolerance = 0.004 * low.abs().max(high.abs());
            prop_assert!((got - want).abs() <= tolerance, "{got} {want}");
        }
    }

    #[test]
    fn the_ends_of_the_histogram() {
        // The scale is 2: 2⁻⁴³ is the smallest error told from zero, 2²¹ the largest.
        for (error, want) in
            [(0.0, 0.0), (1e-13, 0.0), (-1e-13, 0.0), (1.2e-13, 1.2e-13), (-2e6, -2e6)]
        {
            let got = median(&[error], -3.0);
            assert!((got - want).abs() <= 0.004 * want.abs(), "{error}: {got}");
        }
        for error in [1e9, -2.1e6, f64::NEG_INFINITY] {
            assert!(median(&[error], -3.0).is_nan(), "{error}");
            // The others keep their quantiles.
            assert!((quantile(&counted(&[error, 1.0, 1.0], -3.0), -3.0, 0.5) - 1.0).abs() < 0.004);
        }
        assert!((median(&[0.1], 0.0) - 0.1).abs() <= 0.0004);
        assert!(median(&[0.1, f64::NAN], 1.0).is_nan());
        assert!(median(&[], 1.0).is_nan());
        assert!(quantile(&counted(&[1.0], 1.0), 1.0, 1.5).is_nan());
    }
}
