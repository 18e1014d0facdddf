//! Standard deviation of white measurement noise from the harmonics that the signal leaves empty.

use crate::Error;
use crate::quadrature::Rule;
use crate::simd::Isa;
use crate::spectrum::{CoefficientPlan, Kind};

/// Lines that the mean must at least run over.
const LEAST: usize = 4;
/// Intervals of a piece of a long record: no more memory is needed, and thousands of lines a piece are averaged.
const PIECE: usize = 1 << 15;

/// Standard deviation σ̂ of white noise on evenly spaced samples.
///
/// σ̂² is the mean of |Δ^q V(m)|² over m = N/4…N/2−q, q = `order` + 2, over its value at unit noise,
/// C(2q, q) Σw²/N². N/4 is rounded up, or down where too few lines are left otherwise. The difference Δ^q removes
/// what the ends of the record leak into the upper harmonics, which is smooth in m. A record of more than 2¹⁶ intervals
/// is cut into pieces of 2¹⁵, whose σ̂² are averaged. Right only where the signal is empty there and the noise white: filtered records show less
/// than they carry.
///
/// # Errors
/// [`Error::Data`] where the record is too short for at least four such lines; as [`Isa::detect`].
pub fn noise_level(samples: &[f64], order: usize) -> Result<f64, Error> {
    NoiseLevel::new(samples.len(), order)?.of(Isa::detect()?, samples)
}

/// What [`noise_level`] needs for records of one length.
pub(crate) struct NoiseLevel {
    plan: CoefficientPlan,
    /// First line.
    low: usize,
    /// Order of the difference.
    q: usize,
    /// Number of pieces.
    pieces: usize,
}

impl NoiseLevel {
    /// For so many samples.
    pub fn new(samples: usize, order: usize) -> Result<NoiseLevel, Error> {
        let intervals = samples.saturating_sub(1);
        let q = order.saturating_add(2);
        let least = q.saturating_mul(8).max(PIECE);
        let piece = if intervals >= 2 * PIECE { least.min(intervals) } else { intervals };
        let low = piece.div_ceil(4).min((piece / 2 + 1).saturating_sub(q.saturating_add(LEAST)));
        if low == 0 || low < piece / 4 {
            return Err(Error::Data(format!(
                "the noise level at order {order} needs at least {} samples, the record has {samples}; take a longer record, or give the noise, noise=mf.Noise(y=...)",
                q.saturating_add(LEAST).saturating_mul(4) - 5,
            )));
        }
        let plan = CoefficientPlan::new(piece, piece / 2, Kind::Rule(Rule::Trapezoid), 0.0, 0)?;
        Ok(NoiseLevel { plan, low, q, pieces: intervals / piece })
    }

    /// σ̂ of samples of that length.
    pub fn of(&self, isa: Isa, samples: &[f64]) -> Result<f64, Error> {
        Ok(self.covariance(isa, &[samples])?.0[0].sqrt())
    }

    /// Covariance of the noise of channels of that length, row major, and the standard deviation of a correlation where
    /// there is none.
    pub fn covariance(&self, isa: Isa, channels: &[&[f64]]) -> Result<(Vec<f64>, f64), Error> {
        let (plan, low, q, piece) = (&self.plan, self.low, self.q, self.plan.intervals());
        let top = piece / 2;
        let mut lines = vec![[vec![0.0; top + 1], vec![0.0; top + 1]]; channels.len()];
        let mut scratch = plan.scratch();
        let size = channels.len();
        let mut power = vec![0.0; size * size];
        for first in (0..self.pieces).map(|k| k * piece) {
            for (samples, [re, im]) in channels.iter().zip(&mut lines) {
                plan.run_in(isa, &samples[first..=first + piece], re, im, &mut scratch)?;
                for part in [re, im] {
                    for round in 0..q {
                        for m in low..=top - round - 1 {
                            part[m] = part[m + 1] - part[m];
                        }
                    }
                }
            }
            for (a, left) in lines.iter().enumerate() {
                for (b, right) in lines.iter().enumerate() {
                    let part = |part: usize, m: usize| left[part][m] * right[part][m];
                    let each = (low..=top - q).map(|m| part(0, m) + part(1, m));
                    power[a * size + b] += each.sum::<f64>();
                }
            }
        }
        let count = (self.pieces * (top - q - low + 1)) as f64;
        // C(2q, q) = Π (q + i)/i.
        let choose = |q: usize| -> f64 { (1..=q).map(|i| (q + i) as f64 / i as f64).product() };
        let unit = count * choose(q) * plan.unit_variance();
        power.iter_mut().for_each(|p| *p /= unit);
        // Differenced lines are correlated as C(2q, q + k)/C(2q, q), whose squares add up to C(4q, 2q)/C(2q, q)².
        let doubt = (choose(2 * q) / (2.0 * count)).sqrt() / choose(q);
        Ok((power, doubt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Address, Purpose, normals};

    #[test]
    fn white_noise_on_a_transient_is_found() {
        // Four standard deviations of the estimate: of N/4 differenced lines, and of pieces.
        for (n, sigma, within) in [(1024, 1e-6, 0.15), (1024, 40.0, 0.15), (200_000, 0.3, 0.02)] {
            let mut noise = vec![0.0; n + 1];
            let purpose = Purpose::User;
            normals(Address { seed: 7, purpose, channel: 0, replicate: 0, group: 0 }, &mut noise);
            let samples: Vec<f64> = noise
                .iter()
                .enumerate()
                .map(|(k, e)| {
                    let t = k as f64 / n as f64;
                    5.0 * t * t - 3.0 * t + 1.0 + sigma * e
                })
                .collect();
            let level = noise_level(&samples, 2).unwrap();
            assert!((level / sigma - 1.0).abs() < within, "{level} {sigma}");
        }
    }

    #[test]
    fn a_smooth_transient_has_no_noise() {
        let samples: Vec<f64> = (0..=256).map(|k| f64::from(k * k) / 65_536.0).collect();
        assert!(noise_level(&samples, 2).unwrap() < 1e-6);
    }

    #[test]
    fn short_records_are_refused_with_the_length_that_serves() {
        assert!(
            matches!(noise_level(&[0.0; 26], 2), Err(Error::Data(m)) if m.contains("at least 27 samples"))
        );
        for samples in 27..40 {
            assert!(noise_level(&vec![0.0; samples], 2).is_ok(), "{samples} samples");
        }
        assert!(noise_level(&[], 2).is_err());
    }
}
