//! Workspace of one record: its coefficients, what a pass makes of them, and its system.

use super::measured::Measured;
use super::rest::Tie;
use crate::simd::Wide;

/// One record of eight replicates.
#[derive(Debug, Clone)]
pub(crate) struct RecordWorkspace {
    /// Signals (output, inputs, the constant one) × lines.
    pub re: Vec<Wide>,
    /// Imaginary parts, alike.
    pub im: Vec<Wide>,
    /// What each input jumps by from the record's end to its beginning, where it is held.
    pub jumps: Vec<Wide>,
    /// The output as its sums were, where held inputs fold into it.
    pub measured: Measured,
    /// The transient as a function of θ, where the record begins in a known state.
    pub tie: Tie,
    /// Products on the lines of a tile, and how many lines that is.
    pub products: Vec<Wide>,
    pub rows: usize,
    /// Whether the products that no output enters are those of the inputs.
    pub inputs_ready: bool,
    /// System of this record: (transient + θ) × (one more).
    pub matrix: Vec<Wide>,
    /// (TᵀWT)⁻¹TᵀWJ, transient × θ, and (TᵀWT)⁻¹: what projects the transient out of a row.
    pub projection: Vec<Wide>,
    pub flat_projection: Vec<Wide>,
    pub transient_inverse: Vec<Wide>,
    /// Columns on the lines for `ls`, (trend, θ, target) × (Re, Im) a line, and DᵀD of them.
    pub differenced: Vec<Wide>,
    pub instruments: Vec<Wide>,
    /// Lines there are.
    pub lines: usize,
    /// Lines in use, at most all: the band rule asks for fewer.
    pub limit: usize,
}
