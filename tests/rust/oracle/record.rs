//! Records as the oracle sees them: samples, lines, coefficients as plain sums and exact integrals.

use super::dense::C;
use modfun::structure::Trend;

/// What inputs are between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Between {
    /// Known at the samples alone, and on time.
    Samples,
    Zoh,
    Foh,
}

/// One record and its lines.
#[derive(Debug, Clone, Default)]
pub struct Record {
    pub y: Vec<Vec<f64>>,
    pub u: Vec<Vec<f64>>,
    pub dt: f64,
    /// Samples before the window.
    pub lead: usize,
    pub lines: (usize, usize),
    /// Power of the outputs' noise, then of the paths', on each line from 0 on; empty: white.
    pub spectra: Vec<Vec<f64>>,
    /// Variance of each sample of each output; empty: equal.
    pub variances: Vec<Vec<f64>>,
    /// Instants, where they are uneven.
    pub times: Vec<f64>,
}

impl Record {
    /// Sample times from the window's start on, its length, and the trapezoidal weights over it.
    pub fn window(&self) -> (Vec<f64>, f64, Vec<f64>) {
        let n = self.y[0].len() - self.lead;
        let t: Vec<f64> = match self.times.is_empty() {
            true => (0..n).map(|k| k as f64 * self.dt).collect(),
            false => self.times.iter().map(|t| t - self.times[0]).collect(),
        };
        let span = t[n - 1];
        let weight = |k: usize| 0.5 * (t[(k + 1).min(n - 1)] - t[k.max(1) - 1]) / span;
        let weights = (0..n).map(weight).collect();
        (t, span, weights)
    }

    pub fn omega0(&self) -> f64 {
        std::f64::consts::TAU / self.window().1
    }

    /// Variance of a coefficient under noise of variance one.
    pub fn unit_variance(&self) -> f64 {
        self.window().2.iter().map(|w| w * w).sum()
    }

    pub fn coefficient(&self, samples: &[f64], m: usize) -> C {
        let (t, _, weights) = self.window();
        let omega = m as f64 * self.omega0();
        let each = samples[self.lead..].iter().zip(t.iter().zip(&weights));
        each.fold(C::default(), |sum, (v, (t, w))| sum + C::turn(-omega * t) * (v * w))
    }

    /// Exact coefficient of an input that is late by τ, constant or straight between its samples.
    pub fn held(&self, samples: &[f64], m: usize, tau: f64, straight: bool) -> C {
        let span = self.window().1;
        let omega = m as f64 * self.omega0();
        let mut sum = C::default();
        for (j, v) in samples.iter().enumerate() {
            let from = (j as f64 - self.lead as f64) * self.dt + tau;
            let (a, b) = (from.max(0.0), (from + self.dt).min(span));
            if b <= a {
                continue;
            }
            let next = samples.get(j + 1).filter(|_| straight).unwrap_or(v);
            let slope = (next - v) / self.dt;
            let at = |t: f64| v + slope * (t - from);
            if m == 0 {
                sum = sum + C(0.5 * (b - a) * (at(a) + at(b)), 0.0);
                continue;
            }
            // By parts: ∫ v e^{−iωt} = [v e^{−iωt} i/ω] + v'/ω² [e^{−iωt}].
            let (start, end) = (C::turn(-omega * a), C::turn(-omega * b));
            sum = sum + (end * at(b) - start * at(a)) * C(0.0, 1.0 / omega);
            sum = sum + (end - start) * (slope / (omega * omega));
        }
        sum * (1.0 / span)
    }

    pub fn line_numbers(&self, trend: Trend) -> std::ops::RangeInclusive<usize> {
        let first = if trend == Trend::None { self.lines.0 } else { self.lines.0.max(1) };
        first..=self.lines.1
    }
}
