//! `ml`: the criterion of `awls` with the gradient through the covariance, by denoised regressors.
//!
//! [θ, T]₊ = (JᵀS⁻¹Γ)⁻¹ JᵀS⁻¹γ₀ with J made of the model's own response, transient included. Its fixed
//! point is the minimiser of Σ|r|²/S. log det S does not belong in the criterion for θ: the residual is
//! a θ-dependent transform of the data, and its Jacobian cancels it; with it the bias comes back.

use super::design::Design;
use super::pass::{Factors, Step, Weights};
use super::workspace::Workspace;
use super::{Lane, Options, take_step};
use crate::simd::{Isa, LANES};

/// Steps that may raise the cost before steps are halved: the first ones do so on the way to the answer.
const FREE_STEPS: u32 = 10;
/// Square of a move so small that, where it is no smaller than the one before, it is rounding.
const FLOOR: f64 = 1e-14;
/// Rise of the cost that rounding explains.
const ROUNDING: f64 = 1.0 + 1e-10;
/// Halvings in a row before the lane gives up.
const HALVINGS: u32 = 12;

/// Steps until no parameter moves; a lane that has settled keeps its bits.
pub(crate) fn iterate(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    lanes: &mut [Lane; LANES],
    o: &Options,
) {
    let mut best = [f64::INFINITY; LANES];
    let mut halvings = [0; LANES];
    let mut last = [f64::INFINITY; LANES];
    for _ in 0..o.maxiter {
        if lanes.iter().all(|l| l.done) {
            return;
        }
        isa.run(Step {
            design: d,
            space: w,
            weights: Weights::Adapted,
            factors: Factors::Instrument,
        });
        take_step(d, w, lanes, Weights::Adapted, Factors::Instrument);
        let mut taken = [false; LANES];
        for (k, lane) in lanes.iter_mut().enumerate().filter(|(_, l)| !l.done) {
            let cost = w.cost.0[k];
            let rises = cost.is_nan() || cost > best[k] * ROUNDING;
            taken[k] = lane.nit <= FREE_STEPS || !rises || halvings[k] >= HALVINGS;
            if taken[k] {
                halvings[k] = 0;
                best[k] = cost;
                let moved = w.moved.0[k];
                lane.done = moved <= o.tol * o.tol || (moved <= FLOOR && moved >= last[k]);
                last[k] = moved;
            } else {
                halvings[k] += 1;
                w.halve(k);
            }
            lane.nit += 1;
        }
        w.keep(&taken);
        w.accept(&taken);
    }
}
