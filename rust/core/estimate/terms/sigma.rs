//! Covariance of the noise of a record's noisy channels.

/// Pivots of a correlation matrix are at least so large: channels whose noise is one and the same are weighed as good as so.
const LEAST_PIVOT: f64 = 1e-4;
/// By what correlations are taken back where they are not.
const BACK: f64 = 0.999;

/// A symmetric, positive definite matrix of samples' noise, one row a noisy channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sigma {
    channels: usize,
    /// Variances, then the covariances of channels (0, 1), (0, 2), …, (1, 2), ….
    numbers: Vec<f64>,
}

/// How many numbers such a matrix has.
pub(crate) fn numbers(channels: usize) -> usize {
    channels * (channels + 1) / 2
}

impl Sigma {
    /// Channels whose noise is independent.
    pub fn independent(variances: Vec<f64>) -> Sigma {
        let channels = variances.len();
        let mut numbers = variances;
        numbers.resize(channels * (channels + 1) / 2, 0.0);
        Sigma { channels, numbers }
    }

    /// From all rows.
    pub fn of(channels: usize, whole: &[f64]) -> Sigma {
        let mut out = Sigma::independent(vec![0.0; channels]);
        for a in 0..channels {
            for b in a..channels {
                out.set(a, b, whole[a * channels + b]);
            }
        }
        out
    }

    fn place(&self, a: usize, b: usize) -> usize {
        Sigma::place_of(self.channels, a, b)
    }

    /// Where a covariance stands among the numbers of so many channels.
    pub fn place_of(channels: usize, a: usize, b: usize) -> usize {
        let (a, b) = (a.min(b), a.max(b));
        if a == b { a } else { channels + a * (2 * channels - a - 1) / 2 + b - a - 1 }
    }

    pub fn get(&self, a: usize, b: usize) -> f64 {
        self.numbers[self.place(a, b)]
    }

    pub fn set(&mut self, a: usize, b: usize, to: f64) {
        let at = self.place(a, b);
        self.numbers[at] = to;
    }

    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Variances, then covariances, as the formulas of signals take them.
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    pub fn variances(&self) -> &[f64] {
        &self.numbers[..self.channels]
    }

    /// Standard deviations.
    pub fn levels(&self) -> Vec<f64> {
        self.variances().iter().map(|v| v.sqrt()).collect()
    }

    /// Row major.
    pub fn correlation(&self) -> Vec<f64> {
        let q = self.channels;
        let one = |k: usize| {
            let (a, b) = (k / q, k % q);
            if a == b { 1.0 } else { self.get(a, b) / (self.get(a, a) * self.get(b, b)).sqrt() }
        };
        (0..q * q).map(one).collect()
    }

    /// The same correlations at other variances.
    pub fn with(&self, variances: &[f64]) -> Sigma {
        let mut out = self.clone();
        let by: Vec<f64> =
            variances.iter().zip(self.variances()).map(|(to, own)| (to / own).sqrt()).collect();
        for a in 0..self.channels {
            out.set(a, a, variances[a]);
            for b in a + 1..self.channels {
                out.set(a, b, self.get(a, b) * by[a] * by[b]);
            }
        }
        out
    }

    /// The same with no variance below these.
    pub fn at_least(&self, least: &[f64]) -> Sigma {
        let raised: Vec<f64> =
            self.variances().iter().zip(least).map(|(own, least)| own.max(*least)).collect();
        if raised == self.variances() { self.clone() } else { self.with(&raised) }
    }

    /// Lower triangular W, Σ = WWᵀ, row major.
    pub fn root(&self) -> Vec<f64> {
        let q = self.channels;
        let whole: Vec<f64> = (0..q * q).map(|k| self.get(k / q, k % q)).collect();
        root(&whole, q).unwrap_or_else(|| {
            let mut own = vec![0.0; q * q];
            self.levels().iter().enumerate().for_each(|(k, s)| own[k * (q + 1)] = *s);
            own
        })
    }

    /// Keeps it positive definite in numbers.
    pub fn kept_definite(mut self) -> Sigma {
        let q = self.channels;
        let pivot = |k: usize, root: &[f64]| root[k * (q + 1)] * root[k * (q + 1)];
        for _ in 0..q * q {
            let own = root(&self.correlation(), q);
            if own.is_some_and(|own| (0..q).all(|k| pivot(k, &own) >= LEAST_PIVOT)) {
                break;
            }
            for a in 0..q {
                for b in a + 1..q {
                    self.set(a, b, BACK * self.get(a, b));
                }
            }
        }
        self
    }
}

/// Lower triangular factor of a symmetric matrix, row major; none where it is not positive definite.
pub(crate) fn root(whole: &[f64], size: usize) -> Option<Vec<f64>> {
    let mut out = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..=i {
            let before: f64 = (0..j).map(|k| out[i * size + k] * out[j * size + k]).sum();
            let left = whole[i * size + j] - before;
            if i > j {
                out[i * size + j] = left / out[j * size + j];
            } else if left > 0.0 {
                out[i * size + i] = left.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Sigma {
        let mut own = Sigma::independent(vec![4.0, 9.0, 1.0]);
        own.set(0, 1, 3.0);
        own.set(2, 0, -0.5);
        own.set(1, 2, 0.6);
        own
    }

    #[test]
    fn a_root_times_itself_is_the_matrix() {
        let (own, w) = (three(), three().root());
        for a in 0..3 {
            for b in 0..3 {
                let sum: f64 = (0..3).map(|k| w[a * 3 + k] * w[b * 3 + k]).sum();
                assert!((sum - own.get(a, b)).abs() < 1e-14, "{a} {b}");
            }
        }
        assert_eq!(own.numbers(), [4.0, 9.0, 1.0, 3.0, -0.5, 0.6]);
    }

    #[test]
    fn other_variances_leave_correlations() {
        let raised = three().at_least(&[16.0, 0.0, 2.0]);
        assert_eq!(raised.variances(), [16.0, 9.0, 2.0]);
        for (a, b) in three().correlation().iter().zip(raised.correlation()) {
            assert!((a - b).abs() < 1e-15);
        }
    }

    #[test]
    fn one_noise_on_two_channels_stays_definite() {
        let mut own = Sigma::independent(vec![1.0, 4.0]);
        own.set(0, 1, 2.0);
        let kept = own.kept_definite();
        assert!(kept.correlation()[1] < 0.99996 && kept.correlation()[1] > 0.995);
        assert!(root(&kept.correlation(), 2).is_some());
    }
}
