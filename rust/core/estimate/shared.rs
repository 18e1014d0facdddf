//! What the records of a batch share: lines, design, plans, and memory of the workers.

use std::sync::Arc;

use super::band::Range;
use super::design::Design;
use super::spare::Spare;
use super::workspace::Workspace;
use crate::simd::Wide;
use crate::spectrum::{CoefficientPlan, Scratch};

/// The problem all replicates share: lines, design and how samples become coefficients.
pub(crate) struct Shared {
    pub design: Arc<Design>,
    pub plans: Vec<CoefficientPlan>,
    /// First and last line as asked for.
    pub range: Range,
    pub workers: Spare<BatchWorkspace>,
}

impl Shared {
    pub fn new(design: Design, plans: Vec<CoefficientPlan>, range: Range) -> Shared {
        Shared { design: Arc::new(design), plans, range, workers: Spare::new() }
    }

    pub fn worker(&self) -> BatchWorkspace {
        let (samples, lines) = (self.plans[0].samples(), self.plans[0].harmonics() + 1);
        BatchWorkspace {
            space: Workspace::new(&self.design),
            scratch: self.plans.iter().map(CoefficientPlan::scratch).collect(),
            samples: vec![Wide::ZERO; samples],
            re: vec![Wide::ZERO; lines],
            im: vec![Wide::ZERO; lines],
            one: [vec![0.0; lines], vec![0.0; lines]],
        }
    }
}

/// One worker's memory for blocks of records.
pub(crate) struct BatchWorkspace {
    pub space: Workspace,
    pub scratch: Vec<Scratch>,
    pub samples: Vec<Wide>,
    pub re: Vec<Wide>,
    pub im: Vec<Wide>,
    /// Re and Im of one record.
    pub one: [Vec<f64>; 2],
}
