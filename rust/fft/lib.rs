//! Real Fourier transforms of any length: a crate of its own, so that a change of a kernel does not compile them again.
#![forbid(unsafe_code)]

use std::cell::RefCell;
use std::sync::Arc;

pub use realfft::RealToComplex;
pub use realfft::num_complex::Complex;

/// Transforms that a thread keeps: to plan one of a thousand numbers takes three times as long as to run it.
const KEPT: usize = 8;
/// Longer ones are not kept: they would hold megabytes.
const LONGEST: usize = 1 << 14;

type Transform = Arc<dyn RealToComplex<f64>>;

thread_local! {
    /// The last lengths asked for, the newest at the end.
    static RECENT: RefCell<Vec<Transform>> = const { RefCell::new(Vec::new()) };
}

/// The transform of `length` real numbers, X(m) = Σ_k x(k) e^{−2πimk/length}, m = 0…length/2.
#[must_use]
pub fn forward(length: usize) -> Transform {
    let plan = || realfft::RealFftPlanner::new().plan_fft_forward(length);
    if length > LONGEST {
        return plan();
    }
    RECENT.with_borrow_mut(|recent| {
        let found = match recent.iter().position(|one| one.len() == length) {
            Some(at) => recent.remove(at),
            None => plan(),
        };
        if recent.len() == KEPT {
            recent.remove(0);
        }
        recent.push(found.clone());
        found
    })
}
