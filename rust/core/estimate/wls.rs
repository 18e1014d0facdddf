//! `wls`: one shot with the covariance of white equation noise (report, section 4.4); the start of the others.

use super::iterates::Iterates;
use crate::simd::Lanes;

/// Takes the step with S = 1, whatever the lane.
#[inline(always)]
pub(crate) fn take<L: Lanes>(iterates: &mut Iterates) {
    iterates.advance::<L>(L::splat(1.0));
}
