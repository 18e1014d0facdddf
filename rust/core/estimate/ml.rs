//! `ml`: the minimum of the criterion whose weights follow θ, by denoised regressors.
//!
//! ```text
//! minimise over θ, T:  V(θ, T) = Σ_m |r(m)|² / S_m,   r = A(s)Y − B(s)U − T(s) = γ₀ + Γ[θ, T],
//!                      S_m = h_m |A(s)|²,  h₀ = 1, h_m = ½.
//! ```
//!
//! As r/A = Y − Ŷ with the model's own response Ŷ = (BU + T)/A, transient included, half the gradient is
//! Re J* S⁻¹ r, where J has the columns of Γ with Ŷ in place of Y. The step sets it to zero with J and S held:
//!
//! ```text
//! [θ, T]₊ = −(J* S⁻¹ Γ)⁻¹ J* S⁻¹ γ₀.
//! ```
//!
//! Its fixed point is a minimum of V. log det S does not belong in the criterion for θ: the residual is a θ-dependent
//! transform of the data, and its Jacobian cancels it; with it the bias comes back.

use super::iterates::{Progress, Verdict, at_most};
use crate::simd::Lanes;

/// Steps that may raise the cost before steps are halved: the first ones do so on the way to the answer.
const FREE_STEPS: f64 = 10.0;
/// Square of a move so small that, where it is no smaller than the one before, it is rounding.
const FLOOR: f64 = 1e-14;
/// Rise of the cost that rounding explains.
const ROUNDING: f64 = 1.0 + 1e-10;
/// Halvings in a row before a step is taken all the same.
const HALVINGS: f64 = 12.0;

/// Takes a step unless the cost has risen on the way to it; then the way is halved.
#[inline(always)]
pub(crate) fn decide<L: Lanes>(at: &mut Progress<L>, limit: L) -> Verdict<L> {
    let active = at.active;
    // False where the cost is no number.
    let no_higher = at_most(at.cost, at.best * L::splat(ROUNDING));
    let falls = at.cost.select_lt(L::splat(f64::INFINITY), no_higher, L::splat(0.0));
    let free = at_most(at.nit, L::splat(FREE_STEPS + 1.0));
    let worn = at_most(L::splat(HALVINGS), at.halvings);
    let taken = active * falls.max(free).max(worn);
    let rounding = at_most(at.moved, L::splat(FLOOR)) * at_most(at.last_move, at.moved);
    let done = at.settled(limit).max(rounding);

    at.best = taken.choose(at.cost, at.best);
    at.last_move = taken.choose(at.moved, at.last_move);
    at.halvings = taken.choose(L::splat(0.0), at.halvings + active);
    at.active = active - active * taken * done;
    Verdict { taken, halved: active - taken }
}
