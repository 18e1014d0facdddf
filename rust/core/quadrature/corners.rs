//! Corners of a smooth signal, at samples and between them, such as a command makes that steps through a lag.

use crate::math::ln_1;

/// How many times what its neighbours leave open, and what the lower quartile of all samples does, a jump of the slope
/// is at least: 8.8 and more where a command steps every four samples, at most 4 in noise and in rounded samples.
const CLEAR: f64 = 8.0;
/// The same between samples, where both sides have one sample less in common: at most 6 in noise.
const CLEARER: f64 = 12.0;
/// How much less than a parabola a decay leaves open.
const CERTAIN: f64 = 64.0;
/// The least part of its range that a jump of the slope is over a sample.
const LEAST: f64 = 1e-9;
/// Least and largest quotients of neighbouring differences that decay: of lags from half a sample on.
const DECAY: std::ops::Range<f64> = 0.13..0.999;
/// Samples that the quartile is taken of, at most.
const MANY: usize = 4096;
/// Samples on each side of a corner.
const SIDE: usize = 3;

/// Samples at which the slope of a signal jumps, and by how much over one sample.
///
/// On either side a cubic goes through the samples, or a decay A + Be^{−t/τ} where it leaves far less open at a
/// further sample. Corners nearer than three samples to each other or to an end are not seen, nor jumps next to the
/// smallest difference, which rounded samples have. Noise leaves much open at most samples, and has none.
#[must_use]
pub fn corners(samples: &[f64]) -> Vec<(usize, f64)> {
    if samples.len() < 2 * SIDE + 1 {
        return Vec::new();
    }
    let step = |k: usize| samples[k + 1] - samples[k];
    let rounding = rounding(samples);
    let jump = |k: usize| {
        let (after, before) =
            ([step(k), step(k + 1), step(k + 2)], [step(k - 1), step(k - 2), step(k - 3)]);
        let (bent, left) = (open(after), open(before));
        // What decays as time goes on grows as it goes back.
        let rising = after[1] / after[0];
        let falling = before[0] / before[1];
        let (after, open_after) = side(after, bent, rising, rising);
        let (before, open_before) = side(before, left, falling, falling.recip());
        (after - before, open_after + open_before)
    };
    let (mut candidates, mut left) = (Vec::new(), Vec::new());
    for k in SIDE..samples.len() - SIDE {
        let (jump, open) = jump(k);
        if (k - SIDE).is_multiple_of(1 + samples.len() / MANY) {
            left.push(open);
        }
        if jump.is_finite() && jump.abs() > CLEAR * open + rounding {
            candidates.push((k, jump, open));
        }
    }
    let least = rounding.max(CLEAR * background(samples, rounding, &mut left));
    let mut found: Vec<(usize, f64)> = Vec::new();
    for (k, jump, open) in candidates {
        if jump.abs() <= CLEAR * open + least {
            continue;
        }
        match found.last_mut() {
            // By chance a decay leads over a corner: the larger jump is one.
            Some(last) if k - last.0 < SIDE => {
                if jump.abs() > last.1.abs() {
                    *last = (k, jump);
                }
            }
            _ => found.push((k, jump)),
        }
    }
    found
}

/// Samples after which, and before the next, the slope of a signal jumps.
///
/// A side leads a step on past three differences; between the steps that both sides lead to lies that of a signal with
/// a corner in it. By rounding some next to corners at samples are among them: those at samples come first.
#[must_use]
pub fn corners_between(samples: &[f64]) -> Vec<usize> {
    if samples.len() < 2 * SIDE + 2 {
        return Vec::new();
    }
    let step = |k: usize| samples[k + 1] - samples[k];
    let rounding = rounding(samples);
    let (mut candidates, mut left) = (Vec::new(), Vec::new());
    for k in SIDE..samples.len() - 1 - SIDE {
        // What decays as time goes on grows as it goes back.
        let (ahead, behind) =
            ([step(k + 1), step(k + 2), step(k + 3)], [step(k - 1), step(k - 2), step(k - 3)]);
        let (after, open_after) = led(ahead, ahead[1] / ahead[0]);
        let (before, open_before) = led(behind, behind[0] / behind[1]);
        let open = open_after + open_before;
        if (k - SIDE).is_multiple_of(1 + samples.len() / MANY) {
            left.push(open);
        }
        let (early, late) = (step(k) - after, step(k) - before);
        let size = (late - early).abs();
        if (early < 0.0) != (late < 0.0) && size > CLEARER * open + rounding {
            candidates.push((k, size, open));
        }
    }
    if candidates.is_empty() {
        return Vec::new();
    }
    let least = background(samples, rounding, &mut left);
    candidates.retain(|(_, size, open)| *size > CLEARER * (open + least));
    candidates.into_iter().map(|(k, ..)| k).collect()
}

/// The least change of a signal over a sample that is no rounding.
fn rounding(samples: &[f64]) -> f64 {
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    LEAST * (high - low)
}

/// What corners have to stand out from everywhere: the smallest difference, as rounded samples have it, and the lower
/// quartile of what is left open.
fn background(samples: &[f64], rounding: f64, left: &mut [f64]) -> f64 {
    let differences = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let quantum = differences.filter(|d| *d > rounding).fold(f64::INFINITY, f64::min);
    let quarter = left.len() / 4;
    quantum.max(*left.select_nth_unstable_by(quarter, f64::total_cmp).1)
}

/// The step next to three differences, nearest first, and what it leaves open: of a cubic, or of a signal that decays
/// by `quotient` a sample, where that is certain beside it.
fn led([near, next, far]: [f64; 3], quotient: f64) -> (f64, f64) {
    let bend = near - 2.0 * next + far;
    let (bent, decay, size) = (bend.abs(), (near * far - next * next).abs(), near.abs());
    match CERTAIN * decay < bent * size && DECAY.contains(&quotient) {
        true => (near * near / next, decay / size),
        false => (2.0 * near - next + bend, bent),
    }
}

/// What a parabola through the samples of the first two differences leaves open at the next.
fn open([near, next, far]: [f64; 3]) -> f64 {
    (far - 2.0 * next + near).abs()
}

/// The slope at the outer end of three differences, nearest first, and what it leaves open: of a signal that decays by
/// `decay` a sample, where that is certain beside the parabola, by `ratio` away from the corner.
fn side([near, next, far]: [f64; 3], bent: f64, decay: f64, ratio: f64) -> (f64, f64) {
    if DECAY.contains(&decay) {
        let left = (far - next * ratio).abs();
        if CERTAIN * left < bent {
            return (near * ln_1(ratio) / (ratio - 1.0), left);
        }
    }
    ((11.0 * near - 7.0 * next + 2.0 * far) / 6.0, bent)
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::{corners, corners_between};

    /// A command that steps every `every` samples, through a lag by `tau` samples, and its corners.
    fn lagged(tau: f64, every: usize, count: usize) -> (Vec<f64>, Vec<(usize, f64)>) {
        let (mut value, mut before) = (0.0, 0.0);
        let (mut samples, mut wanted) = (Vec::new(), Vec::new());
        for k in 0..count {
            let command = ((k / every * 7 + 3) % 11) as f64 - 5.0;
            if k >= 3 && k + 3 < count && command != before {
                wanted.push((k, (command - before) / tau));
            }
            samples.push(value);
            value = command + (value - command) * (-1.0 / tau).exp();
            before = command;
        }
        (samples, wanted)
    }

    #[test]
    fn corners_of_a_lag_are_found_to_rounding() {
        for (tau, every) in [(1.0, 10), (2.0, 13), (5.0, 40), (0.5, 20), (1.0, 4)] {
            let (samples, wanted) = lagged(tau, every, 200);
            let found = corners(&samples);
            assert_eq!(found.len(), wanted.len(), "{tau} {every}");
            for ((at, jump), (k, own)) in found.iter().zip(&wanted) {
                assert_eq!(at, k);
                assert!((jump - own).abs() < 1e-9 * own.abs(), "{tau} {every} {k}: {jump} {own}");
            }
        }
    }

    #[test]
    fn corners_between_samples_are_found() {
        for (tau, late) in [(1.0, 0.3), (2.0, 0.5), (0.5, 0.7), (5.0, 0.2)] {
            let samples: Vec<f64> = (0..60)
                .map(|k| match f64::from(k) - 30.0 - late {
                    past if past < 0.0 => 0.0,
                    past => 1.0 - (-past / tau).exp(),
                })
                .collect();
            assert!(corners_between(&samples).contains(&30), "{tau} {late}");
        }
    }

    #[test]
    fn smooth_signals_steps_and_rounded_samples_have_none() {
        for period in [4.5, 6.3, 8.0, 20.0, 300.0] {
            let sine: Vec<f64> =
                (0..200).map(|k| (std::f64::consts::TAU * f64::from(k) / period).sin()).collect();
            assert!(corners(&sine).is_empty() && corners_between(&sine).is_empty(), "{period}");
        }
        let step: Vec<f64> = (0..40).map(|k| f64::from(k / 20)).collect();
        assert!(
            corners(&step).is_empty()
                && corners(&[1.0; 40]).is_empty()
                && corners(&[0.0; 5]).is_empty()
        );
    }

    #[test]
    fn noise_has_none() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let noise: Vec<f64> = (0..4000).map(|_| uniform() + uniform() + uniform()).collect();
        assert!(corners(&noise).is_empty() && corners_between(&noise).is_empty());
        let mut sum = 0.0;
        let walk: Vec<f64> = noise
            .iter()
            .map(|v| {
                sum += v;
                sum
            })
            .collect();
        assert!(corners(&walk).is_empty() && corners_between(&walk).is_empty());
        let rounded: Vec<f64> = walk.iter().map(|v| (v * 4.0).round() / 4.0).collect();
        assert!(corners(&rounded).is_empty() && corners_between(&rounded).is_empty());
    }
}
