//! What a study keeps of its replicates: moments, coverage, outcomes and a histogram, all mergeable.
//!
//! Everything is kept of the *error*, estimate − truth, so that a small bias is not lost in a large
//! value. Floating-point parts ([`ParameterSummary`]) are made a chunk and merged in chunk order:
//! with a fixed chunk size the bits do not depend on who computed which chunk. [`Histogram`] and
//! [`Outcomes`] are integers, so their merge order is free and one a thread is enough.

use crate::Status;

/// Count, mean and sums of powers about the mean (2 to 4) of the errors of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    /// Number of errors.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// Sums of (error − mean)², (…)³ and (…)⁴.
    pub sums: [f64; 3],
}

impl Moments {
    /// The moments of a chunk's errors, in two passes.
    #[must_use]
    pub fn of(errors: &[f64]) -> Moments {
        if errors.is_empty() {
            return Moments::default();
        }
        let n = errors.len() as f64;
        let rough = errors.iter().sum::<f64>() / n;
        // The second sum takes away the rounding of the first.
        let mean = rough + errors.iter().map(|e| e - rough).sum::<f64>() / n;
        let mut sums = [0.0; 3];
        for e in errors {
            let d = e - mean;
            let square = d * d;
            sums[0] += square;
            sums[1] += square * d;
            sums[2] += square * square;
        }
        Moments { count: errors.len() as u64, mean, sums }
    }

    /// Takes in the errors of the chunks that follow (Chan, Golub and LeVeque's rule, to power 4).
    pub fn merge(&mut self, next: &Moments) {
        if self.count == 0 || next.count == 0 {
            if self.count == 0 {
                *self = *next;
            }
            return;
        }
        let (a, b) = (self.count as f64, next.count as f64);
        let n = a + b;
        let d = next.mean - self.mean;
        // Shifts of the two means from the common one.
        let (p, q) = (-d * b / n, d * a / n);
        let (s, t) = (self.sums, next.sums);
        self.sums = [
            s[0] + t[0] + (a * p * p + b * q * q),
            s[1] + t[1] + 3.0 * (p * s[0] + q * t[0]) + (a * p * p * p + b * q * q * q),
            s[2] + t[2]
                + 4.0 * (p * s[1] + q * t[1])
                + 6.0 * (p * p * s[0] + q * q * t[0])
                + (a * p * p * p * p + b * q * q * q * q),
        ];
        self.mean -= p;
        self.count += next.count;
    }

    /// Mean error; NaN without errors, as all figures here.
    #[must_use]
    pub fn bias(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.mean }
    }

    /// Standard deviation about the mean, with n − 1; NaN below two errors.
    #[must_use]
    pub fn sd(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { (self.sums[0] / (self.count - 1) as f64).sqrt() }
    }

    /// Root of the mean squared error.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        (self.bias() * self.bias() + self.central(0)).sqrt()
    }

    /// Monte Carlo standard error of [`Moments::bias`]: sd/√n.
    #[must_use]
    pub fn bias_se(&self) -> f64 {
        self.sd() / (self.count as f64).sqrt()
    }

    /// Monte Carlo standard error of [`Moments::sd`]: √((μ₄ − μ₂²)/n)/(2 sd), for any distribution
    /// with four moments.
    #[must_use]
    pub fn sd_se(&self) -> f64 {
        let spread = self.central(2) - self.central(0) * self.central(0);
        (spread.max(0.0) / self.count as f64).sqrt() / (2.0 * self.sd())
    }

    /// Monte Carlo standard error of [`Moments::rmse`]: √(Var e²/n)/(2 rmse).
    #[must_use]
    pub fn rmse_se(&self) -> f64 {
        let (b, square) = (self.mean, self.mean * self.mean);
        let (m2, m3, m4) = (self.central(0), self.central(1), self.central(2));
        // Var e² with e = b + d.
        let spread = m4 - m2 * m2 + 4.0 * b * m3 + 4.0 * square * m2;
        (spread.max(0.0) / self.count as f64).sqrt() / (2.0 * self.rmse())
    }

    fn central(&self, k: usize) -> f64 {
        self.sums[k] / self.count as f64
    }
}

/// How many intervals covered the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coverage {
    /// Intervals that held the truth.
    pub covered: u64,
    /// Intervals looked at.
    pub count: u64,
}

impl Coverage {
    /// Counts one interval.
    pub fn push(&mut self, covered: bool) {
        self.covered += u64::from(covered);
        self.count += 1;
    }

    /// Adds another's counts.
    pub fn merge(&mut self, other: &Coverage) {
        self.covered += other.covered;
        self.count += other.count;
    }

    /// The covered share; NaN without intervals.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.covered as f64 / self.count as f64
    }

    /// Monte Carlo standard error of the share: √(p(1 − p)/n).
    #[must_use]
    pub fn share_se(&self) -> f64 {
        let p = self.share();
        (p * (1.0 - p) / self.count as f64).sqrt()
    }
}

/// Errors and coverage of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ParameterSummary {
    /// Moments of the errors.
    pub moments: Moments,
    /// Coverage of the classical intervals.
    pub nonrobust: Coverage,
    /// Coverage of the HC3 intervals.
    pub hc3: Coverage,
}

impl ParameterSummary {
    /// Takes in the replicates of the chunks that follow.
    pub fn merge(&mut self, next: &ParameterSummary) {
        self.moments.merge(&next.moments);
        self.nonrobust.merge(&next.nonrobust);
        self.hc3.merge(&next.hc3);
    }
}

/// Fits by their [`Status`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcomes([u64; Status::ALL.len()]);

impl Outcomes {
    /// Counts one fit.
    pub fn push(&mut self, status: Status) {
        self.0[status as usize] += 1;
    }

    /// Adds another's counts.
    pub fn merge(&mut self, other: &Outcomes) {
        for (mine, theirs) in self.0.iter_mut().zip(&other.0) {
            *mine += theirs;
        }
    }

    /// Fits with this outcome.
    #[must_use]
    pub fn count(&self, status: Status) -> u64 {
        self.0[status as usize]
    }

    /// All fits.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }
}

/// Bins an octave: widths of 0.4 to 0.8 % of the error.
const PER_OCTAVE: u64 = 128;
/// Octaves from the smallest error told from zero to the largest told from infinity.
const OCTAVES: u64 = 64;
/// The bits of 2⁻⁴⁴, the smallest relative to the truth's size, without those below a bin.
const FIRST: u64 = (1023 - 44) * PER_OCTAVE;
const SIDE: usize = (PER_OCTAVE * OCTAVES) as usize;

/// Counts of errors in bins of equal relative width, for quantiles in fixed memory (128 kB).
///
/// Errors from 2⁻⁴⁴ to 2²⁰ times the truth's size (its power of two; 1 for a zero truth) are kept
/// to 0.4 %. Smaller ones count as 0, larger ones and infinities as the largest.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// A power of two near the truth's size, and its inverse.
    scale: f64,
    inverse: f64,
    /// From the largest negative error over zero to the largest positive.
    counts: Vec<u64>,
    nans: u64,
}

impl Histogram {
    /// An empty histogram of the errors of a parameter whose true value is `truth`.
    #[must_use]
    pub fn new(truth: f64) -> Histogram {
        // The exponent alone, held to where the inverse is exact too.
        let exponent = f64::from_bits(truth.to_bits() & (0x7ff << 52));
        let usable = truth != 0.0 && (1e-250..1e250).contains(&exponent);
        let scale = if usable { exponent } else { 1.0 };
        Histogram { scale, inverse: 1.0 / scale, counts: vec![0; 2 * SIDE + 1], nans: 0 }
    }

    /// Counts one error.
    #[inline]
    pub fn push(&mut self, error: f64) {
        if error.is_nan() {
            self.nans += 1;
            return;
        }
        // The exponent and the top 7 bits of the mantissa number the bins.
        let bits = (error.abs() * self.inverse).to_bits() >> 45;
        let size = (bits + 1).saturating_sub(FIRST).min(SIDE as u64) as usize;
        let bin = if error < 0.0 { SIDE - size } else { SIDE + size };
        self.counts[bin] += 1;
    }

    /// Adds another's counts; both must be about the same truth.
    pub fn merge(&mut self, other: &Histogram) {
        debug_assert_eq!(self.scale, other.scale, "histograms about different truths");
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts) {
            *mine += theirs;
        }
        self.nans += other.nans;
    }

    /// Errors counted.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.counts.iter().sum::<u64>() + self.nans
    }

    /// The quantile of the errors for `share` in [0, 1] (order statistics interpolated linearly, as
    /// NumPy does), within 0.4 % of the order statistics' sizes.
    ///
    /// NaN where nothing was counted, a NaN was, or `share` is outside.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let n = self.count();
        if n == 0 || self.nans > 0 || !(0.0..=1.0).contains(&share) {
            return f64::NAN;
        }
        let rank = share * (n - 1) as f64;
        let below = rank as u64;
        let (low, high) =
            (self.order_statistic(below), self.order_statistic((below + 1).min(n - 1)));
        low + (high - low) * (rank - below as f64)
    }

    /// The median error.
    #[must_use]
    pub fn median(&self) -> f64 {
        self.quantile(0.5)
    }

    /// The middle of the bin of the error number `rank`, counted from 0.
    fn order_statistic(&self, rank: u64) -> f64 {
        let mut seen = 0;
        let found = self.counts.iter().position(|count| {
            seen += count;
            seen > rank
        });
        found.map_or(f64::NAN, |bin| {
            let size = bin.abs_diff(SIDE) as u64;
            if size == 0 {
                return 0.0;
            }
            // The bin's bits, and half a bin more.
            let middle = f64::from_bits(((FIRST + size - 1) << 45) | 1 << 44) * self.scale;
            if bin < SIDE { -middle } else { middle }
        })
    }
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

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance * b.abs()
    }

    /// Moments by the definition.
    fn direct(e: &[f64]) -> (f64, [f64; 3]) {
        let mean = e.iter().sum::<f64>() / e.len() as f64;
        let sum = |f: fn(f64) -> f64| e.iter().map(|x| f(x - mean)).sum();
        (mean, [sum(|d| d * d), sum(|d| d * d * d), sum(|d| d * d * d * d)])
    }

    proptest! {
        #[test]
        fn merged_moments_are_those_of_all(
            count in 2usize..300, chunk in 1usize..100, mean in -3.0f64..3.0, replicate in 0u64..100,
        ) {
            let e = errors(replicate, count, mean, 0.7);
            let mut merged = Moments::default();
            for chunk in e.chunks(chunk) {
                merged.merge(&Moments::of(chunk));
            }
            let (mean, sums) = direct(&e);
            prop_assert_eq!(merged.count, count as u64);
            prop_assert!((merged.mean - mean).abs() < 1e-14 * (1.0 + mean.abs()));
            for (k, scale) in [(0, sums[0]), (1, sums[2].max(sums[0])), (2, sums[2])] {
                prop_assert!((merged.sums[k] - sums[k]).abs() < 1e-12 * scale, "{merged:?} {sums:?}");
            }
            let square = e.iter().map(|e| e * e).sum::<f64>() / count as f64;
            prop_assert!(close(merged.rmse(), square.sqrt(), 1e-13));
        }

        #[test]
        fn quantiles_are_those_of_the_sorted_errors(
            count in 1usize..400, share in 0.0f64..=1.0, mean in -2.0f64..2.0, truth in -1e3f64..1e3, replicate in 0u64..100,
        ) {
            let mut e = errors(replicate, count, mean * truth, 0.3 * truth.abs() + 1e-6);
            let (mut whole, mut half) = (Histogram::new(truth), Histogram::new(truth));
            let (one, two) = e.split_at(count / 3);
            two.iter().for_each(|e| whole.push(*e));
            one.iter().for_each(|e| half.push(*e));
            whole.merge(&half);
            e.sort_by(f64::total_cmp);
            let rank = share * (count - 1) as f64;
            let (low, high) = (e[rank.floor() as usize], e[rank.ceil() as usize]);
            let want = low + (high - low) * (rank - rank.floor());
            let tolerance = 0.004 * low.abs().max(high.abs());
            prop_assert!((whole.quantile(share) - want).abs() <= tolerance, "{} {want}", whole.quantile(share));
        }
    }

    #[test]
    fn a_small_spread_about_a_large_bias_is_kept() {
        let e = errors(0, 1000, 1e6, 1e-3);
        let mut merged = Moments::default();
        e.chunks(64).for_each(|chunk| merged.merge(&Moments::of(chunk)));
        assert!(close(merged.sd(), 1e-3, 0.1), "{}", merged.sd());
        assert!(close(merged.sd(), Moments::of(&e).sd(), 1e-6));
    }

    #[test]
    fn standard_errors_are_what_repetition_shows() {
        // 2000 studies of 200 replicates with bias: the spread of each figure against its own
        // standard error. Each ratio has a standard error of 1.6 %; bounds of 8 % are 5 of them.
        let studies: Vec<Moments> =
            (0..2000).map(|k| Moments::of(&errors(k, 200, 0.4, 1.3))).collect();
        type Figure = fn(&Moments) -> f64;
        let figures: [(Figure, Figure); 3] = [
            (Moments::bias, Moments::bias_se),
            (Moments::sd, Moments::sd_se),
            (Moments::rmse, Moments::rmse_se),
        ];
        for (k, (figure, se)) in figures.into_iter().enumerate() {
            let spread = Moments::of(&studies.iter().map(figure).collect::<Vec<_>>()).sd();
            let said = Moments::of(&studies.iter().map(se).collect::<Vec<_>>()).mean;
            assert!(close(said, spread, 0.08), "figure {k}: {said} against {spread}");
        }
    }

    #[test]
    fn nothing_and_one_error() {
        let none = Moments::default();
        assert!(none.bias().is_nan() && none.sd().is_nan() && none.rmse().is_nan());
        let one = Moments::of(&[-0.5]);
        assert!(one.bias() == -0.5 && one.rmse() == 0.5 && one.sd().is_nan());
        let mut merged = one;
        merged.merge(&none);
        assert_eq!(merged, one);
        assert!(Moments::of(&[1.0, f64::NAN]).bias().is_nan());
        assert!(Coverage::default().share().is_nan());
        assert!(Histogram::new(1.0).median().is_nan());
    }

    #[test]
    fn coverage_and_outcomes_count() {
        let mut coverage = Coverage::default();
        (0..20).for_each(|k| coverage.push(k != 7));
        let mut twice = coverage;
        twice.merge(&coverage);
        assert_eq!((twice.covered, twice.count, twice.share()), (38, 40, 0.95));
        assert!(close(twice.share_se(), (0.95f64 * 0.05 / 40.0).sqrt(), 1e-15));
        let mut outcomes = Outcomes::default();
        for status in [Status::Ok, Status::Rank, Status::Ok, Status::NonFinite] {
            outcomes.push(status);
        }
        let other = outcomes;
        outcomes.merge(&other);
        assert_eq!(Status::ALL.map(|s| outcomes.count(s)), [4, 0, 2, 2]);
        assert_eq!(outcomes.total(), 8);
    }

    #[test]
    fn the_ends_of_the_histogram() {
        let mut h = Histogram::new(-3.0);
        // The scale is 2: 2⁻⁴³ is the smallest error told from zero, 2²¹ the largest.
        for (error, want) in [
            (0.0, 0.0),
            (1e-13, 0.0),
            (-1e-13, 0.0),
            (1.2e-13, 1.2e-13),
            (-2e6, -2e6),
            (1e9, 2_097_152.0),
            (f64::NEG_INFINITY, -2_097_152.0),
        ] {
            let mut h = Histogram::new(-3.0);
            h.push(error);
            assert!((h.median() - want).abs() <= 0.004 * want.abs(), "{error}: {}", h.median());
        }
        h.push(f64::NAN);
        assert!(h.median().is_nan() && h.count() == 1);
        let mut zero = Histogram::new(0.0);
        zero.push(0.1);
        assert!(close(zero.median(), 0.1, 0.004));
    }
}
