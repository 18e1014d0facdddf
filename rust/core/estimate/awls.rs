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

use super::iterates::{Iterates, Progress, settled};
use crate::simd::Lanes;

/// Takes every step; a lane has settled when no parameter moves.
#[inline(always)]
pub(crate) fn take<L: Lanes>(iterates: &mut Iterates, progress: &mut Progress, limit: L) {
    let active = L::load(&progress.active);
    iterates.advance::<L>(active);
    (active - active * settled::<L>(progress, limit)).store(&mut progress.active);
}
