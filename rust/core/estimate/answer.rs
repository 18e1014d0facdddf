//! What every kind of fit answers: estimates, their covariances, and how the estimation ended.

use super::band::BandRule;
use super::spectral::NoiseSpectrum;
use crate::error::Status;
use crate::linalg::condition::condition_bound;
use crate::modulation::Lines;

/// Estimates of one fit with their covariances, and how it ended.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Estimates in the user's units; of joint fits the free coefficients, then free delays in seconds.
    pub theta: Vec<f64>,
    /// Classical covariance, row major.
    pub cov_nonrobust: Vec<f64>,
    /// HC3 covariance, row major.
    pub cov_hc3: Vec<f64>,
    /// Covariance from a smooth noise spectrum, row major.
    pub cov_spectral: Vec<f64>,
    /// Degrees of freedom of each of its variances.
    pub degrees: Vec<f64>,
    /// The spectra that it rests on.
    pub noise_spectrum: NoiseSpectrum,
    /// Normal matrix of the whitened columns with the transient projected out, unit diagonal.
    pub gram: Vec<f64>,
    /// Σ|r|²/(hS), the weighted sum of squared residuals: in units of the output squared for one output, of Σ̂
    /// for several, of the levels' variances for equations.
    pub cost: f64,
    /// Real equations less unknowns.
    pub degrees_of_freedom: usize,
    /// Outcome.
    pub status: Status,
    /// Iterations after the start.
    pub nit: u32,
    /// Lines of each record.
    pub lines: Vec<Lines>,
    /// What the default rule saw and chose, where it was asked.
    pub band_rule: Option<BandRule>,
}

impl Answer {
    /// Classical variances.
    pub(crate) fn variances(&self) -> Vec<f64> {
        self.cov_nonrobust.iter().step_by(self.theta.len() + 1).copied().collect()
    }

    /// At least the condition number of the columns; infinite where they are dependent.
    #[must_use]
    pub fn condition_bound(&self) -> f64 {
        condition_bound(&self.gram, self.theta.len())
    }
}

/// A normal matrix of so many parameters, with its rows and columns scaled to a unit diagonal.
pub(crate) fn unit_diagonal(normal: impl Fn(usize) -> f64, parameters: usize) -> Vec<f64> {
    let p = parameters;
    let root: Vec<f64> = (0..p).map(|k| normal(k * (p + 1)).sqrt()).collect();
    (0..p * p).map(|k| normal(k) / (root[k / p] * root[k % p])).collect()
}
