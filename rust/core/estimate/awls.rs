//! `awls`: weights from the last estimate, again and again (report, section 4.4).

use super::iterate::{Iterates, settled};
use crate::simd::Lanes;

/// Takes every step; a lane has settled when no parameter moves.
#[inline(always)]
pub(crate) fn take<L: Lanes>(w: &mut impl Iterates, limit: L) {
    let active = L::load(&w.progress().active);
    w.advance::<L>(active);
    let progress = w.progress();
    (active - active * settled::<L>(progress, limit)).store(&mut progress.active);
}
