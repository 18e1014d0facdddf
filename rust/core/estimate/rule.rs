//! How the next iterate is found, when it is taken, and where an iteration stands.

use super::iterates::{Iterates, Progress, Verdict};
use super::normal_equations::{LeftColumns, RowWeights};
use super::{awls, ml, wls};
use crate::simd::Lanes;

/// Steps after which it is asked whether to go on.
pub(crate) const ASK: usize = 8;

/// How the next iterate is found and when it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rule {
    /// A single step with flat weights.
    Wls,
    /// Steps with the weights of the last estimate.
    Awls,
    /// Steps with these weights and the denoised output, halved where they lead up.
    Ml,
}

impl Rule {
    pub(crate) fn weights(self) -> RowWeights {
        if self == Rule::Wls { RowWeights::Flat } else { RowWeights::Adapted }
    }

    pub(crate) fn factors(self) -> LeftColumns {
        if self == Rule::Ml { LeftColumns::Instrument } else { LeftColumns::Data }
    }

    /// Takes the step that was found, or part of the way back.
    #[inline(always)]
    pub(crate) fn take<L: Lanes>(self, iterates: &mut Iterates, progress: &mut Progress, limit: L) {
        let mut at = progress.load::<L>();
        let Verdict { taken, halved } = self.decide(&mut at, limit);
        at.store(progress);
        if self == Rule::Ml {
            iterates.keep::<L>(taken);
            iterates.halve::<L>(halved);
        }
        iterates.advance::<L>(taken);
    }

    /// What becomes of the step that was found.
    #[inline(always)]
    pub(crate) fn decide<L: Lanes>(self, at: &mut Progress<L>, limit: L) -> Verdict<L> {
        match self {
            Rule::Wls => wls::decide(),
            Rule::Awls => awls::decide(at, limit),
            Rule::Ml => ml::decide(at, limit),
        }
    }
}

/// Where an iteration stands.
pub(crate) struct Run {
    pub rule: Rule,
    pub left: usize,
    pub limit: f64,
    /// The step that waits was mended: take it as it is.
    pub mended: bool,
}
