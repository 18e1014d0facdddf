//! The weights of a rule over a window of any length, kept as those of a short one.

use super::Rule;
use crate::Error;

/// Samples at each end whose weights may be anything; even, and no rule corrects more than 4.
const ENDS: usize = 8;

/// Weights w_0…w_N in units of the sampling interval, without a number a sample.
///
/// Between the ends the weights of every rule repeat with period 2, so those of a short window, as odd or
/// even as the long one, tell them all.
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    intervals: usize,
    short: Vec<f64>,
}

impl Weights {
    /// # Errors
    /// As [`Rule::check`].
    pub fn new(rule: Rule, intervals: usize) -> Result<Weights, Error> {
        let short = rule.weights(intervals.min(2 * ENDS + intervals % 2))?;
        Ok(Weights { intervals, short })
    }

    /// Intervals N of the window.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// w_k.
    #[inline]
    pub fn at(&self, k: usize) -> f64 {
        let from_end = self.intervals - k;
        if k < ENDS {
            self.short[k]
        } else if from_end < ENDS {
            self.short[self.short.len() - 1 - from_end]
        } else {
            self.short[ENDS + k % 2]
        }
    }

    /// The weights between the ends of even, odd k.
    pub fn inner(&self) -> [f64; 2] {
        match self.short.get(ENDS..) {
            Some([even, odd, ..]) => [*even, *odd],
            _ => [1.0; 2],
        }
    }

    /// Samples at each end whose weights are not the inner ones.
    pub fn edge(&self) -> usize {
        let inner = self.inner();
        let odd = |k: usize| self.at(k) != inner[k % 2];
        let most = ENDS.min(self.intervals / 2);
        (0..=most).rev().find(|k| odd(*k) || odd(self.intervals - k)).map_or(0, |k| k + 1)
    }

    /// Σ w_k².
    pub fn sum_of_squares(&self) -> f64 {
        let squares = |weights: &[f64]| weights.iter().map(|w| w * w).sum::<f64>();
        let pairs = (self.intervals + 1 - self.short.len()) / 2;
        let pair = self.short.get(ENDS..ENDS + 2).map_or(0.0, squares);
        pairs as f64 * pair + squares(&self.short)
    }
}
