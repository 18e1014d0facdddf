//! The colour of noise as an autoregression, fitted to a periodogram on the lines there are.
//!
//! The frequencies up to the highest line are taken as a whole band (π there): autocovariances are cosine sums of
//! the periodogram, Levinson's recursion gives the coefficients of each order, and
//! 2n log(prediction error) + order · log 2n over n lines chooses.

use crate::math::{ln_1, sin_cos_turns_1};

/// Longest autoregression: that of two light modes in turbulence above white noise of the sensor needs some ten.
const MOST: usize = 12;
/// Lines an order must have.
const LINES_EACH: usize = 6;
/// Rounds of colour and parameters after which orders no longer change.
pub(crate) const FREE_ROUNDS: usize = 3;
/// Most such rounds, and the largest change of the colour's root after which nothing is left to do.
pub(crate) const ROUNDS: usize = 40;
pub(crate) const SETTLED: f64 = 1e-4;

/// Autocovariances of noise, from its power on lines.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Autocovariance([f64; MOST + 1]);

impl Autocovariance {
    /// Adds a line's power times its weight; `x` of `top` is where it stands in the band.
    pub fn add(&mut self, power: f64, x: f64, top: f64) {
        // cos (k + 1)a = 2 cos a cos ka − cos (k − 1)a.
        let (_, cos) = sin_cos_turns_1(0.5 * x / top);
        let (mut before, mut now) = (cos, 1.0);
        for sum in &mut self.0 {
            *sum += power * now;
            (before, now) = (now, 2.0 * cos * now - before);
        }
    }

    /// The autoregression of the best order for so many lines, or of the given one.
    pub fn fitted(&self, lines: usize, fixed: Option<usize>) -> Autoregression {
        let covariance = &self.0;
        let count = 2.0 * lines as f64;
        let most = MOST.min(lines / LINES_EACH);
        let mut taps = [0.0f64; MOST];
        let mut error = covariance[0];
        let (mut best, mut lowest) =
            (Autoregression { taps, order: 0 }, count * ln_1(error.max(f64::MIN_POSITIVE)));
        for order in 1..=fixed.unwrap_or(most) {
            let sum =
                (1..order).fold(covariance[order], |s, k| s + taps[k - 1] * covariance[order - k]);
            let reflection = -sum / error;
            if reflection.abs() >= 1.0 || reflection.is_nan() {
                break;
            }
            let before = taps;
            for k in 1..order {
                taps[k - 1] = before[k - 1] + reflection * before[order - k - 1];
            }
            taps[order - 1] = reflection;
            error *= 1.0 - reflection * reflection;
            let criterion = count * ln_1(error.max(f64::MIN_POSITIVE)) + order as f64 * ln_1(count);
            if fixed.is_some() || criterion < lowest {
                (best, lowest) = (Autoregression { taps, order }, criterion);
            }
        }
        best
    }
}

/// 1 + Σ a_k e^{−iπkx/top}, whose inverse colours white noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Autoregression {
    taps: [f64; MOST],
    pub order: usize,
}

impl Autoregression {
    /// Its size on a line.
    pub fn size(&self, x: f64, top: f64) -> f64 {
        let (sin, cos) = sin_cos_turns_1(0.5 * x / top);
        let turned = |(re, im): (f64, f64), tap: &f64| {
            let own = re + tap;
            (own * cos + im * sin, im * cos - own * sin)
        };
        let (re, im) = self.taps[..self.order].iter().rev().fold((0.0, 0.0), turned);
        f64::sqrt((1.0 + re) * (1.0 + re) + im * im)
    }
}

/// What the power of line `m` of `count` counts: the ends of the band half, but what is left out below line 1 looks like it.
pub(crate) fn share(m: usize, count: usize, from_zero: bool) -> f64 {
    match (m + 1 == count, m == 0 && !from_zero) {
        (true, _) => 0.5,
        (_, true) => 1.5,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_autoregression_is_found_from_its_covariances() {
        // x_t = .9 x_{t−1} − .2 x_{t−2} + e: ρ1 = .9/1.2, ρ_k = .9 ρ_{k−1} − .2 ρ_{k−2}.
        let mut rho = [0.0; MOST + 1];
        rho[..2].copy_from_slice(&[1.0, 0.75]);
        for k in 2..=MOST {
            rho[k] = 0.9 * rho[k - 1] - 0.2 * rho[k - 2];
        }
        let own = Autocovariance(rho).fitted(1000, None);
        assert_eq!(own.order, 2);
        assert!((own.taps[0] + 0.9).abs() < 1e-12 && (own.taps[1] - 0.2).abs() < 1e-12, "{own:?}");
        assert!(
            (own.size(0.0, 1.0) - 0.3).abs() < 1e-12 && (own.size(1.0, 1.0) - 2.1).abs() < 1e-12
        );
    }

    #[test]
    fn white_noise_has_no_colour() {
        let mut white = Autocovariance::default();
        white.0[..5].copy_from_slice(&[2.0, 0.01, -0.02, 0.0, 0.01]);
        assert_eq!(white.fitted(100, None).order, 0);
    }

    #[test]
    fn power_on_lines_gives_its_autoregression_back() {
        let (top, mut own) = (40.0, Autoregression { taps: [0.0; MOST], order: 2 });
        own.taps[..2].copy_from_slice(&[-0.8, 0.3]);
        let mut found = Autocovariance::default();
        for m in 0..=40 {
            let size = own.size(m as f64, top);
            let share = share(m, 41, true) * if m == 0 { 0.5 } else { 1.0 };
            found.add(share / (size * size), m as f64, top);
        }
        let again = found.fitted(41, Some(2));
        for m in [0, 7, 40] {
            let ratio = again.size(m as f64, top) / own.size(m as f64, top);
            assert!((ratio - 1.0).abs() < 1e-6, "{m} {ratio}");
        }
    }
}
