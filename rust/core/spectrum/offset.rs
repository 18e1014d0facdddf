//! The constant about which a channel moves, where it dwarfs the movement: taken out before the sums and put back
//! into V(0), so that neither rounding nor what a rule leaves of a constant at m > 0 reaches the other lines.

use crate::simd::Wide;

/// Samples that are looked at.
const LOOKS: usize = 16;
/// How many times larger than the range of the samples an offset is. Smaller ones cost no digits, and zero-mean
/// noise never has one.
const LARGE: f64 = 4.0;

/// The mean of a few samples of `count` if that is a large offset, else 0; exact for constants.
#[inline(always)]
pub(super) fn offset(count: usize, sample: impl Fn(usize) -> f64) -> f64 {
    let first = sample(0);
    let (mut low, mut high, mut sum) = (first, first, 0.0);
    for look in 1..LOOKS {
        let value = sample(look * (count - 1) / (LOOKS - 1));
        (low, high, sum) = (low.min(value), high.max(value), sum + (value - first));
        let dwarfs = high - low < low.abs().min(high.abs()) / LARGE;
        if !dwarfs {
            return 0.0; // more samples do not make the movement less
        }
    }
    if sum.is_finite() { first + sum / LOOKS as f64 } else { 0.0 }
}

/// The same of eight records.
pub(super) fn offsets(samples: &[Wide]) -> Wide {
    Wide(std::array::from_fn(|lane| offset(samples.len(), |k| samples[k].0[lane])))
}

/// Eight records less their offsets.
pub(super) fn levelled(samples: &[Wide], offsets: &Wide, out: &mut Vec<Wide>) {
    out.clear();
    out.extend(
        samples.iter().map(|v| Wide(std::array::from_fn(|lane| v.0[lane] - offsets.0[lane]))),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::LANES;

    fn of(samples: &[f64]) -> f64 {
        offset(samples.len(), |k| samples[k])
    }

    #[test]
    fn only_what_dwarfs_the_movement_is_an_offset() {
        let wave = |level: f64| -> Vec<f64> {
            (0..100).map(|k| level + ((k * 37) % 100) as f64 / 50.0 - 1.0).collect()
        };
        for level in [-1e9, -20.0, 20.0, 1e9] {
            assert!((of(&wave(level)) - level).abs() < 1.0, "{level}");
        }
        for level in [-7.0, 0.0, 1.0, 7.0] {
            assert_eq!(of(&wave(level)), 0.0, "{level}");
        }
        assert_eq!(of(&[0.3; 3]), 0.3);
        assert_eq!(of(&[0.0; 3]), 0.0);
        for odd in [f64::NAN, f64::INFINITY, -f64::MAX] {
            assert_eq!(of(&[odd, 1.0, 1.0]), 0.0, "{odd}");
        }
        let wide: Vec<Wide> = wave(50.0).into_iter().map(Wide::splat).collect();
        assert_eq!(offsets(&wide).0, [of(&wave(50.0)); LANES]);
    }
}
