//! `awls`: weights from the last estimate, again and again (report, section 4.4).

use super::iterate::settled;
use super::workspace::Workspace;
use crate::simd::Lanes;

/// Takes every step; a lane has settled when no parameter moves.
#[inline(always)]
pub(crate) fn take<L: Lanes>(w: &mut Workspace, limit: L) {
    let active = L::load(&w.active);
    w.advance::<L>(active);
    (active - active * settled::<L>(w, limit)).store(&mut w.active);
}
