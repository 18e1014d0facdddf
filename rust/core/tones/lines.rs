//! Lines of a record around its tones: which they are, and what is seen on them.

use super::Tone;
use crate::spectrum::Padded;

/// Lines over which noise is taken to be equally strong.
const NEAR: i64 = 8;

/// Lines of a record, and how they are seen: Re and Im, noise of the samples' variance.
#[derive(Debug, Clone)]
pub struct Lines {
    transform: Padded,
    length: usize,
    complex: bool,
    indices: Vec<i64>,
}

impl Lines {
    /// `reach` lines on each side of each tone; of real records neither 0 nor half the sampling rate.
    pub fn around(tones: &[Tone], reach: usize, length: usize, complex: bool) -> Lines {
        let mut indices: Vec<i64> = Vec::new();
        // As many on each side are all of them.
        let reach = reach.min(length) as i64;
        for tone in tones {
            let below = (tone.frequency * length as f64).floor() as i64;
            indices.extend(below + 1 - reach..=below + reach);
        }
        if complex {
            indices.iter_mut().for_each(|m| *m = m.rem_euclid(length as i64));
        } else {
            indices.retain(|m| *m > 0 && 2 * *m < length as i64);
        }
        indices.sort_unstable();
        indices.dedup();
        Lines { transform: Padded::new(length), length, complex, indices }
    }

    /// Real numbers that are seen.
    pub fn rows(&self) -> usize {
        2 * self.indices.len()
    }

    /// The noise variance at each number that is seen, from what is left of the lines up to [`NEAR`] away.
    pub fn levels(&self, residual: &[f64], leverages: &[f64]) -> Vec<f64> {
        let size = self.indices.len();
        let pair = |of: &dyn Fn(usize) -> f64, j: usize| of(j) + of(size + j);
        let level = |m: &i64| {
            let near = || (0..size).filter(|j| (self.indices[*j] - m).abs() <= NEAR);
            let left: f64 = near().map(|j| pair(&|k| residual[k] * residual[k], j)).sum();
            let free: f64 = near().map(|j| pair(&|k| 1.0 - leverages[k], j)).sum();
            left / free
        };
        let levels: Vec<f64> = self.indices.iter().map(level).collect();
        let mut rows = levels.repeat(2);
        rows.resize(residual.len(), 0.0);
        rows
    }

    /// The lines of samples: real parts, then imaginary parts.
    pub fn see(&self, samples: &[f64], out: &mut [f64]) {
        let (n, size) = (self.length, self.indices.len());
        let re = self.transform.run(&samples[..n]);
        let im = if self.complex { self.transform.run(&samples[n..2 * n]) } else { Vec::new() };
        let scale = (if self.complex { 1.0 } else { 2.0 } / n as f64).sqrt();
        for (j, m) in self.indices.iter().enumerate() {
            let p = Padded::at(&re, *m, n);
            let (a, b) = match self.complex {
                true => {
                    let q = Padded::at(&im, *m, n);
                    (p.0 - q.1, p.1 + q.0)
                }
                false => p,
            };
            (out[j], out[size + j]) = (scale * a, scale * b);
        }
    }

    /// Samples of the record.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The lines, as multiples of the line spacing.
    pub fn indices(&self) -> &[i64] {
        &self.indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stand_around_the_tones() {
        let tones =
            [Tone { frequency: 0.02, damping: 0.0 }, Tone { frequency: 0.25, damping: 0.0 }];
        let real = Lines::around(&tones, 2, 40, false);
        assert_eq!(real.indices, [1, 2, 9, 10, 11, 12]);
        assert_eq!(Lines::around(&tones[..1], 2, 40, true).indices, [0, 1, 2, 39]);
    }
}
