//! What is known of a parameter beforehand: one row more in the normal equations.
//!
//! Beside n rows of variance σ² stands (θ_k − mean) σ/sd, whose variance is σ², too; σ² = V/n is that of the weighted
//! residuals V. Where the steps end, ½∇V/σ² + Σ (θ_k − mean)/sd² = 0: the least
//!
//! ```text
//! n log V(θ) + Σ_k ((θ_k − mean_k)/sd_k)²,
//! ```
//!
//! the mode of θ and σ together. The row is as certain as it says: its part of a covariance does not follow the residuals.

use crate::error::Error;
use crate::structure::Method;

/// Most that the logarithm of the criterion takes from priors: far from them it must stay a number.
const MOST: f64 = 300.0;

/// A parameter's mean and standard deviation before the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Which estimated parameter.
    pub parameter: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation, above 0.
    pub sd: f64,
}

impl Prior {
    /// In units of which `unit` is one of the user's.
    pub(crate) fn over(self, unit: f64) -> Prior {
        Prior { mean: self.mean / unit, sd: self.sd / unit, ..self }
    }

    /// Entry of its row where the lines' rows have this variance.
    pub(crate) fn entry(&self, variance: f64) -> f64 {
        variance.sqrt() / self.sd
    }
}

/// Checks priors of so many parameters.
///
/// # Errors
/// [`Error::Spec`] for methods without a variance of the rows, and for what is no prior.
pub(crate) fn check(priors: &[Prior], parameters: usize, method: Method) -> Result<(), Error> {
    if !priors.is_empty() && !matches!(method, Method::Ml | Method::Awls) {
        return Err(Error::Spec(
            "fitting with priors: \"ls\" and \"wls\" do not weigh by the noise; take method=\"ml\" or \"awls\""
                .into(),
        ));
    }
    let sound = |p: &Prior| {
        p.parameter < parameters && p.mean.is_finite() && p.sd > 0.0 && p.sd.is_finite()
    };
    match priors.iter().find(|p| !sound(p)) {
        None => Ok(()),
        Some(p) => Err(Error::Spec(format!(
            "fitting with priors: a mean of {} with the standard deviation {} for parameter {} of {parameters}; \
             give finite numbers, the deviation above 0",
            p.mean, p.sd, p.parameter
        ))),
    }
}

/// Σ ((θ_k − mean)/sd)².
pub(crate) fn distance(priors: &[Prior], theta: impl Fn(usize) -> f64) -> f64 {
    priors.iter().fold(0.0, |sum, p| {
        let z = (theta(p.parameter) - p.mean) / p.sd;
        z.mul_add(z, sum)
    })
}

/// What V is multiplied by, so that it falls where the criterion does.
pub(crate) fn factor(distance: f64, rows: f64) -> f64 {
    libm::exp((distance / rows).min(MOST))
}

/// Degrees of freedom of a variance of which a part is known.
pub(crate) fn degrees(of_rest: f64, rest: f64, all: f64) -> f64 {
    if rest > 0.0 { of_rest * (all / rest) * (all / rest) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_criterion_stays_a_number() {
        let one = [Prior { parameter: 1, mean: 2.0, sd: 1.0 / f64::from(1 << 30) }];
        let far = distance(&one, |k| k as f64);
        assert_eq!(far, (1u64 << 60) as f64);
        assert!(factor(far, 10.0).is_finite());
        assert_eq!(factor(0.0, 10.0), 1.0);
    }

    #[test]
    fn what_is_no_prior_is_refused() {
        let said = |p: Prior, method| check(&[p], 2, method).unwrap_err().to_string();
        let sound = Prior { parameter: 1, mean: 0.0, sd: 1.0 };
        assert!(check(&[sound], 2, Method::Ml).is_ok());
        assert!(said(Prior { sd: 0.0, ..sound }, Method::Ml).contains("above 0"));
        assert!(said(Prior { parameter: 2, ..sound }, Method::Ml).contains("of 2"));
        assert!(said(sound, Method::Ls).contains("awls"));
    }
}
