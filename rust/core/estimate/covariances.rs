//! Covariances of θ in eight lanes: classical, HC3 and spectral.

use super::spectral::Spectral;
use crate::simd::{LANES, Wide};
use crate::structure::CovType;

/// Which covariances are computed besides the classical one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Kinds {
    pub hc3: bool,
    pub spectral: bool,
}

impl Default for Kinds {
    fn default() -> Kinds {
        Kinds { hc3: true, spectral: true }
    }
}

impl Kinds {
    /// What is needed for one kind.
    pub fn only(kind: CovType) -> Kinds {
        Kinds { hc3: kind == CovType::Hc3, spectral: kind == CovType::Spectral }
    }
}

/// Row major, in the units of the workspace; `unit` of a parameter leads to those of the user.
#[derive(Debug, Clone, Default)]
pub(crate) struct Covariances {
    pub nonrobust: Vec<Wide>,
    pub hc3: Vec<Wide>,
    /// What is known of the noise spectra, and the covariance that follows.
    pub spectral: Spectral,
    /// What is computed of them.
    pub kinds: Kinds,
}

impl Covariances {
    /// Room for so many parameters, bins of the noise spectra and channels.
    pub fn new(parameters: usize, bins: usize, channels: usize) -> Covariances {
        let none = vec![Wide::ZERO; parameters * parameters];
        let spectral = Spectral::new(bins, channels, parameters);
        Covariances { nonrobust: none.clone(), hc3: none, spectral, kinds: Kinds::default() }
    }

    fn of(&self, kind: CovType) -> &[Wide] {
        match kind {
            CovType::Nonrobust => &self.nonrobust,
            CovType::Hc3 => &self.hc3,
            CovType::Spectral => &self.spectral.cov,
        }
    }

    /// Those that tell of columns so nearly dependent that rounding took over.
    pub fn judged(&self) -> [&[Wide]; 2] {
        [&self.nonrobust, &self.hc3]
    }

    /// No covariance rather than a wrong one, where the parameters are not determined.
    pub fn forget(&mut self, lane: usize) {
        let others = self.nonrobust.iter_mut().chain(&mut self.spectral.cov);
        for c in self.hc3.iter_mut().chain(others) {
            c.0[lane] = f64::NAN;
        }
    }

    /// Variance of parameter `k` of every lane.
    pub fn variance(&self, kind: CovType, k: usize, unit: f64) -> [f64; LANES] {
        let scale = unit * unit;
        self.of(kind)[k * (self.spectral.degrees.len() + 1)].0.map(|v| v * scale)
    }

    /// Standard errors of one lane.
    pub fn errors<'a>(
        &'a self,
        kind: CovType,
        lane: usize,
        unit: impl Fn(usize) -> f64 + 'a,
    ) -> impl Iterator<Item = f64> + 'a {
        let variances = self.of(kind).iter().step_by(self.spectral.degrees.len() + 1);
        variances.enumerate().map(move |(k, v)| v.0[lane].sqrt() * unit(k))
    }

    /// Covariance of one lane.
    pub fn square(&self, kind: CovType, lane: usize, unit: impl Fn(usize) -> f64) -> Vec<f64> {
        let p = self.spectral.degrees.len();
        let each = self.of(kind).iter().enumerate();
        each.map(|(k, v)| v.0[lane] * unit(k / p) * unit(k % p)).collect()
    }

    /// Degrees of freedom of each spectral variance of one lane.
    pub fn degrees(&self, lane: usize) -> impl Iterator<Item = f64> + '_ {
        self.spectral.degrees.iter().map(move |v| v.0[lane])
    }
}
