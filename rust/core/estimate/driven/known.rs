//! What is known of parameters beforehand: rows (θ − mean)/sd of unit variance, beneath those of the lines.

use crate::estimate::prior::Prior;

/// Priors, and how far a point is from each.
#[derive(Debug, Clone)]
pub(super) struct Known {
    priors: Vec<Prior>,
    /// (θ − mean)/sd.
    pub surprises: Vec<f64>,
}

impl Known {
    pub fn new(priors: &[Prior]) -> Known {
        Known { priors: priors.to_vec(), surprises: vec![0.0; priors.len()] }
    }

    /// Rows that they take, in whole blocks of eight.
    pub fn rows(&self) -> usize {
        self.priors.len().next_multiple_of(8)
    }

    /// Goes to a point.
    pub fn set(&mut self, theta: &[f64]) {
        for (to, own) in self.surprises.iter_mut().zip(&self.priors) {
            *to = (theta[own.parameter] - own.mean) / own.sd;
        }
    }

    /// Sum of squares of the rows.
    pub fn distance(&self) -> f64 {
        self.surprises.iter().map(|z| z * z).sum()
    }

    /// Writes the column of a parameter into rows of zeros.
    pub fn column(&self, parameter: usize, rows: &mut [f64]) {
        for (to, own) in rows.iter_mut().zip(&self.priors) {
            if own.parameter == parameter {
                *to = 1.0 / own.sd;
            }
        }
    }

    /// Half the slope of the sum of squares by a parameter.
    pub fn pull(&self, parameter: usize) -> f64 {
        let own = self.priors.iter().zip(&self.surprises);
        own.filter(|(own, _)| own.parameter == parameter).map(|(own, z)| z / own.sd).sum()
    }

    /// Of each row its parameter, and that one's standard deviation beforehand.
    pub fn each(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.priors.iter().map(|own| (own.parameter, own.sd))
    }
}
