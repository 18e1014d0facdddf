//! What may be fitted: orders of one output's differential equation, and what stands beside it.

use crate::error::Error;

/// A(p) y = Σ_k B_k(p) u_k with A monic of degree `order` (report, eq. 11).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Structure {
    /// Degree n of the denominator.
    pub order: usize,
    /// Degree of the numerator of each input; `None` where an input has no path.
    pub numerators: Vec<Option<usize>>,
    /// Coefficients of the transient polynomial: the order; more where structures of several orders
    /// are compared, so that all of them see the same residual space.
    pub transient: usize,
}

impl Structure {
    /// Checks the degrees.
    ///
    /// # Errors
    /// [`Error::Spec`] where the order is zero or a numerator's degree exceeds it.
    pub fn new(order: usize, numerators: Vec<Option<usize>>) -> Result<Structure, Error> {
        if order == 0 {
            return Err(Error::Spec(
                "building the structure: 0 poles leave nothing to modulate; give at least 1".into(),
            ));
        }
        for (k, degree) in numerators.iter().enumerate() {
            if let Some(degree) = degree
                && *degree > order
            {
                return Err(Error::Spec(format!(
                    "building the structure: input {k} has {degree} zeros but there are {order} poles; \
                     give at most as many zeros as poles"
                )));
            }
        }
        Ok(Structure { order, numerators, transient: order })
    }

    /// The same with so many transient coefficients, which is modulating of that order.
    ///
    /// # Errors
    /// [`Error::Spec`] where they are fewer than the poles.
    pub fn with_transient(self, transient: usize) -> Result<Structure, Error> {
        if transient < self.order {
            return Err(Error::Spec(format!(
                "building the structure: {transient} transient terms do not hold the end conditions of {} poles; \
                 give at least as many",
                self.order
            )));
        }
        Ok(Structure { transient, ..self })
    }

    /// Number of unknown coefficients, the # of the report.
    #[must_use]
    pub fn parameters(&self) -> usize {
        let each = self.numerators.iter().flatten();
        each.fold(self.order, |sum, d| sum.saturating_add(*d).saturating_add(1))
    }

    /// Power of s that each parameter multiplies, and its signal (0 the output, 1 + k input k),
    /// in the order of θ: a_1…a_n, then the numerators in descending powers.
    #[must_use]
    pub fn terms(&self) -> Vec<(usize, usize)> {
        let denominator = (0..self.order).rev().map(|power| (0, power));
        let numerators = self.numerators.iter().enumerate().flat_map(|(k, degree)| {
            degree.map(|d| (0..=d).rev().map(move |power| (1 + k, power))).into_iter().flatten()
        });
        denominator.chain(numerators).collect()
    }
}

/// Offset and drift of the output that the record may carry besides the response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trend {
    /// None.
    None,
    /// An unknown constant: line 0 is left out.
    Constant,
    /// An unknown straight line: line 0 is left out and a column 1/s joins the transient.
    Linear,
}

impl Trend {
    /// Its unknowns.
    pub(crate) fn terms(self) -> usize {
        match self {
            Trend::None => 0,
            Trend::Constant => 1,
            Trend::Linear => 2,
        }
    }
}

/// Where the noise enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// White on the sampled output.
    Output,
    /// White in the differential equation (report, section 4.4).
    Equation,
    /// Both, of levels that are estimated.
    Process,
}

/// How θ is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Least squares on the differenced rows (report, eqs. 17–19).
    Ls,
    /// Weighted by the covariance of white equation noise.
    Wls,
    /// Weighted by the covariance at the last estimate, repeated (report, section 4.4).
    Awls,
    /// The same criterion with the gradient through the covariance.
    Ml,
}

/// What standard errors take the noise for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CovType {
    /// White, of one level.
    Nonrobust,
    /// Anything: each row shows its own level.
    Hc3,
    /// Coloured, with a spectrum that is smooth.
    Spectral,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_follow_the_order_of_theta() {
        let s = Structure::new(2, vec![Some(1), None, Some(0)]).unwrap();
        assert_eq!(s.parameters(), 5);
        assert_eq!(s.terms(), vec![(0, 1), (0, 0), (1, 1), (1, 0), (3, 0)]);
    }

    #[test]
    fn improper_structures_are_refused_with_the_cure() {
        let text = Structure::new(2, vec![Some(3)]).unwrap_err().to_string();
        assert!(text.contains("3 zeros") && text.contains("2 poles"), "{text}");
        assert!(Structure::new(0, vec![]).is_err());
        let text = Structure::new(2, vec![]).unwrap().with_transient(1).unwrap_err().to_string();
        assert!(text.contains("1 transient") && text.contains("2 poles"), "{text}");
    }
}
