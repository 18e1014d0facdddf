//! Rows of the lines that are processed together.

use crate::simd::Wide;

/// Rows of the lines of a tile: (line, output) × (unknowns, target).
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub re: Vec<Wide>,
    pub im: Vec<Wide>,
}
