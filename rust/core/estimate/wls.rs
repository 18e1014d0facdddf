//! `wls`: one shot with the covariance of white equation noise (report, section 4.4); the start of the others.
//!
//! Weighting the rows of eq. (14) by the covariance of ε of eq. (13), for white e, is least squares on the lines with
//! the transient polynomial T(s) as further unknown:
//!
//! ```text
//! minimise over θ, T:  Σ_m |Q(m; θ) − T(s)|² / h_m,   h₀ = 1, h_m = ½,
//! [θ, T] = −(Γ* H⁻¹ Γ)⁻¹ Γ* H⁻¹ γ₀,                   H = diag(h_m),
//! ```
//!
//! Q − T = γ₀ + Γ[θ, T], γ₀ = sⁿY and Γ the columns s^{n−j}Y, −s^{n−j}U and those of −T. Real parts are meant.

use super::iterates::Verdict;
use crate::simd::Lanes;

/// Takes the step with S = 1, whatever the lane.
#[inline(always)]
pub(crate) fn decide<L: Lanes>() -> Verdict<L> {
    Verdict { taken: L::splat(1.0), halved: L::splat(0.0) }
}
