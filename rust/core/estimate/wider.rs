//! Whether an estimate over a wider band than the default rule's takes the place of the one before.
//!
//! It does where it is worth it and says the same of the record:
//!
//! * a standard error falls by a factor of 1.1 and none rises by that, each at the residual level of its own lines;
//! * residuals do not become quieter by more than that, or than chance: where noise is not white, more of the quiet
//!   lines do not make anything better known that loud ones determine;
//! * the estimate has moved by no more than its errors allow, in any direction: Δᵀ C⁻¹ Δ ≤ (√p + 3)² with the
//!   covariance C before (the test of Hausman, 1978). A model that misses what lies beyond moves;
//! * no denominator has more unstable poles. A pole that no line of the narrower band determines has infinite errors,
//!   so that it may go through infinity, and comes back on the right.

use super::answer::Answer;
use super::band::Range;
use super::routh::unstable_poles;
use crate::error::Status;
use crate::linalg::qr::solve_square;

/// Factor by which a standard error has to fall, and may rise.
const GAIN: f64 = 1.1;
/// Standard deviations that chance is given.
const CHANCE: f64 = 3.0;

/// An estimate, the noise variances of its outputs and its denominators without the leading 1.
pub(crate) struct Candidate<'a> {
    pub answer: &'a Answer,
    pub levels: Vec<f64>,
    pub denominators: Vec<Vec<f64>>,
}

impl Candidate<'_> {
    /// Whether the estimate over a wider band is to be taken for this one.
    pub(crate) fn yields_to(&self, wider: &Candidate<'_>) -> bool {
        wider.answer.status == Status::Ok
            && is_surer(&wider.answer.variances(), &self.answer.variances())
            && self.has_the_level_of(wider)
            // One that did not settle is no estimate to agree with.
            && (self.answer.status != Status::Ok || self.agrees_with(wider))
            && self.is_as_unstable_as(wider)
    }

    fn has_the_level_of(&self, wider: &Candidate<'_>) -> bool {
        let spread =
            |a: &Candidate<'_>| 2.0 * a.levels.len() as f64 / a.answer.degrees_of_freedom as f64;
        // Variances of levels of which one counts lines of the other, too.
        let chance = CHANCE * (spread(self) - spread(wider)).max(0.0).sqrt();
        let most = f64::max(1.0 + chance, GAIN * GAIN);
        self.levels.iter().zip(&wider.levels).all(|(own, wider)| *own <= most * wider)
    }

    fn agrees_with(&self, wider: &Candidate<'_>) -> bool {
        let (own, p) = (self.answer, self.answer.theta.len());
        let error: Vec<f64> = own.variances().iter().map(|v| v.sqrt()).collect();
        // A parameter on its bound has no error.
        let free: Vec<usize> = (0..p).filter(|k| error[*k] > 0.0).collect();
        let moved: Vec<f64> =
            free.iter().map(|k| (wider.answer.theta[*k] - own.theta[*k]) / error[*k]).collect();
        // Correlations, and the move beside them.
        let row = |(i, moved): (&usize, &f64)| -> Vec<f64> {
            let one = |j: &usize| own.cov_nonrobust[i * p + j] / (error[*i] * error[*j]);
            free.iter().map(one).chain([*moved]).collect()
        };
        let mut system: Vec<f64> = free.iter().zip(&moved).flat_map(row).collect();
        let (mut x, mut scale) = (vec![f64::NAN; free.len()], vec![0.0; free.len()]);
        solve_square(&mut system, free.len(), &mut x, &mut scale);
        let distance = x.iter().zip(&moved).fold(0.0, |sum, (x, moved)| sum + x * moved);
        let most = (free.len() as f64).sqrt() + CHANCE;
        distance <= most * most
    }

    fn is_as_unstable_as(&self, wider: &Candidate<'_>) -> bool {
        let mut each = self.denominators.iter().zip(&wider.denominators);
        each.all(|(own, wider)| unstable_poles(wider) <= unstable_poles(own))
    }
}

/// Whether records have more lines than those of before: samples show no more at some time.
pub(crate) fn reaches_further(wider: &[Range], before: &[Range]) -> bool {
    wider.iter().zip(before).any(|(wider, before)| wider.1 > before.1)
}

/// Whether a variance falls by the square of the gain and none rises by it.
fn is_surer(wider: &[f64], before: &[f64]) -> bool {
    // A parameter on its bound has no variance.
    let free = wider.iter().zip(before).filter(|(wider, before)| **wider != 0.0 || **before != 0.0);
    let ratios: Vec<f64> = free.map(|(wider, before)| wider / before).collect();
    ratios.iter().any(|r| *r < 1.0 / (GAIN * GAIN)) && ratios.iter().all(|r| *r <= GAIN * GAIN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::NoiseSpectrum;

    /// Two parameters with these errors and a correlation of 0.9, from so many equations.
    fn answer(theta: [f64; 2], errors: [f64; 2], degrees_of_freedom: usize) -> Answer {
        let [a, b] = errors;
        let cov = vec![a * a, 0.9 * a * b, 0.9 * a * b, b * b];
        Answer {
            theta: theta.to_vec(),
            cov_nonrobust: cov.clone(),
            cov_hc3: cov.clone(),
            cov_spectral: cov,
            degrees: vec![100.0; 2],
            noise_spectrum: NoiseSpectrum::default(),
            gram: vec![1.0, 0.0, 0.0, 1.0],
            cost: 1.0,
            degrees_of_freedom,
            status: Status::Ok,
            nit: 5,
            lines: Vec::new(),
            band_rule: None,
        }
    }

    fn yields(own: &Answer, wider: &Answer, levels: [f64; 2]) -> bool {
        let [own, wider] = [(own, levels[0]), (wider, levels[1])].map(|(answer, level)| {
            Candidate { answer, levels: vec![level], denominators: vec![answer.theta.clone()] }
        });
        own.yields_to(&wider)
    }

    #[test]
    fn a_surer_estimate_that_agrees_is_taken() {
        let own = answer([3.0, 8.0], [0.3, 0.5], 200);
        let surer = answer([3.1, 8.2], [0.2, 0.5], 400);
        assert!(yields(&own, &surer, [1.0, 1.0]));
        let no_surer = answer([3.1, 8.2], [0.28, 0.5], 400);
        assert!(!yields(&own, &no_surer, [1.0, 1.0]));
        let less_sure = answer([3.1, 8.2], [0.2, 0.6], 400);
        assert!(!yields(&own, &less_sure, [1.0, 1.0]));
        let mut lost = surer.clone();
        lost.status = Status::MaxIter;
        assert!(!yields(&own, &lost, [1.0, 1.0]));
    }

    #[test]
    fn an_estimate_that_moves_against_the_correlation_is_refused() {
        let own = answer([3.0, 8.0], [0.3, 0.5], 200);
        // 1.5 errors each: along the correlation that is chance, across it 6.7 standard deviations.
        assert!(yields(&own, &answer([3.45, 8.75], [0.1, 0.2], 400), [1.0, 1.0]));
        assert!(!yields(&own, &answer([3.45, 7.25], [0.1, 0.2], 400), [1.0, 1.0]));
    }

    #[test]
    fn quieter_residuals_are_refused_where_they_are_no_chance() {
        let own = answer([3.0, 8.0], [0.3, 0.5], 200);
        let wider = answer([3.1, 8.2], [0.2, 0.3], 400);
        assert!(yields(&own, &wider, [1.0, 0.85]));
        assert!(!yields(&own, &wider, [1.0, 0.7]));
        // Of few equations more is chance.
        let (own, wider) = (answer([3.0, 8.0], [0.3, 0.5], 20), answer([3.1, 8.2], [0.2, 0.3], 40));
        assert!(yields(&own, &wider, [1.0, 0.7]));
    }

    #[test]
    fn a_pole_on_the_right_is_refused() {
        // s² + a₁ s + a₂ with a pole that no line determines: from −160 to +160 rad/s.
        let own = answer([163.0, 480.0], [150.0, 450.0], 200);
        let wider = answer([-157.0, -480.0], [20.0, 60.0], 400);
        assert!(own.theta[0] - wider.theta[0] < 5.0 * 150.0);
        assert!(!yields(&own, &wider, [1.0, 1.0]));
        assert!(yields(&own, &answer([100.0, 300.0], [20.0, 60.0], 400), [1.0, 1.0]));
        // As unstable as before is no reason.
        assert!(yields(&wider, &answer([-150.0, -470.0], [2.0, 6.0], 900), [1.0, 1.0]));
    }

    #[test]
    fn a_parameter_on_its_bound_has_no_error() {
        let own = answer([3.0, 8.0], [0.3, 0.0], 200);
        assert!(yields(&own, &answer([3.1, 8.0], [0.2, 0.0], 400), [1.0, 1.0]));
        assert!(!yields(&own, &answer([7.0, 8.0], [0.2, 0.0], 400), [1.0, 1.0]));
    }
}
