//! Exact coefficients of signals that are held between samples, from plain sums of the samples.

use super::source::Records;
use super::{CoefficientPlan, Kind};
use crate::math::root_of_unity;
use crate::quadrature::{Hold, times};

/// What turns the plain sum F(m) of held values into the coefficient: α F + β₀ (u_N − u_0) + β₁ (u_{N+1} − u_1).
#[derive(Debug, Clone, Copy)]
pub(super) struct HoldFactor {
    pub(super) sum: (f64, f64),
    pub(super) ends: [(f64, f64); 2],
}

impl HoldFactor {
    /// With F₁ = W⁻(F + u_N − u_0), F₂ = W⁻(F₁ + u_{N+1} − u_1) the sums shifted by one and two samples,
    /// W⁻ = e^{ix}, the coefficient is c₀F + c₁F₁ + c₂F₂.
    pub(super) fn new(hold: Hold, m: usize, intervals: usize, ahead: f64) -> HoldFactor {
        let [c0, c1, c2] = hold.cell(m as f64 / intervals as f64, ahead);
        let shift = root_of_unity(m as u64, intervals as u64);
        let (once, twice) = (times(c1, shift), times(times(c2, shift), shift));
        let both = (once.0 + twice.0, once.1 + twice.1);
        let by = 1.0 / intervals as f64;
        let second = times(c2, shift);
        HoldFactor {
            sum: (c0.0 + both.0, c0.1 + both.1),
            ends: [(by * both.0, by * both.1), (by * second.0, by * second.1)],
        }
    }
}

impl CoefficientPlan {
    /// The same plan, which writes into `im[0]`, where a coefficient has nothing, what a held signal jumps by from the
    /// window's end to its beginning, v(0) − v(T): what sampling folds depends on it.
    #[must_use]
    pub(crate) fn with_jump(mut self) -> CoefficientPlan {
        if let Kind::Hold(hold) = self.kind {
            self.jump = Some(hold.start(self.ahead));
        }
        self
    }

    /// Makes the plain sums of held values coefficients.
    #[inline(always)]
    pub(super) fn hold<R: Records>(
        &self,
        samples: &[R::Stored],
        re: &mut [R::Stored],
        im: &mut [R::Stored],
    ) {
        if self.holds.is_empty() {
            return;
        }
        let sample = |k: usize| R::load(&samples[self.first + k]);
        let mut both = [sample(self.intervals) - sample(0), R::zero()];
        if self.first < self.lead {
            both[1] = sample(self.intervals + 1) - sample(1);
        }
        for ((factor, re), im) in self.holds.iter().zip(re).zip(im.iter_mut()) {
            let (x, y) = (R::load(re), R::load(im));
            let mut real = R::scaled(x, factor.sum.0) - R::scaled(y, factor.sum.1);
            let mut imag = R::scaled(x, factor.sum.1) + R::scaled(y, factor.sum.0);
            for (by, end) in factor.ends.iter().zip(both) {
                real = R::add_scaled(end, by.0, real);
                imag = R::add_scaled(end, by.1, imag);
            }
            R::store(real, re);
            R::store(imag, im);
        }
        if let Some([first, second]) = self.jump {
            let jump = R::add_scaled(both[1], -second, R::scaled(both[0], -first));
            R::store(jump, &mut im[0]);
        }
    }
}
