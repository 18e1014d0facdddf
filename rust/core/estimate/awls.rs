//! `awls`: weights from the last estimate, again and again (report, section 4.4).

use super::iterates::{Iterates, Progress, settled};
use crate::simd::Lanes;

/// Takes every step; a lane has settled when no parameter moves.
#[inline(always)]
pub(crate) fn take<L: Lanes>(iterates: &mut Iterates, progress: &mut Progress, limit: L) {
    let active = L::load(&progress.active);
    iterates.advance::<L>(active);
    (active - active * settled::<L>(progress, limit)).store(&mut progress.active);
}
