//! What the normal equations of a step are formed of: the weights of the rows, and the columns on the left.

/// What the rows are weighted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RowWeights {
    /// S = 1: the covariance of white equation noise.
    Flat,
    /// S at the current θ: |A|² for white noise on the output.
    Adapted,
}

/// Which output the columns of θ on the left are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeftColumns {
    /// The data on both sides.
    Data,
    /// The denoised output on the left, the data on the right: the step of `ml`.
    Instrument,
    /// The denoised output on both sides: the information at the estimate.
    Denoised,
}
