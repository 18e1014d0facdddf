//! `awls`: weights from the last estimate, again and again (report, section 4.4).
//!
//! White noise on the output gives a line the variance h_m S_m, S_m = |A(s)|² but for a constant. Step k + 1 takes it
//! at the estimate k, in the notation of `wls`:
//!
//! ```text
//! [θ, T]₊ = −(Γ* S⁻¹ Γ)⁻¹ Γ* S⁻¹ γ₀,   S = diag(h_m |A(s; θ_k)|²).
//! ```
//!
//! The gradient of S is left out, so that some bias stays.

use super::iterates::{Progress, Verdict};
use crate::simd::Lanes;

/// Takes every step; a lane has settled when no parameter moves.
#[inline(always)]
pub(crate) fn decide<L: Lanes>(at: &mut Progress<L>, limit: L) -> Verdict<L> {
    let taken = at.active;
    at.active = taken - taken * at.settled(limit);
    Verdict { taken, halved: L::splat(0.0) }
}
