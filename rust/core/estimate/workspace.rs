//! Scratch of one worker: the coefficients of eight replicates and everything a pass writes. Made once, never grown.

use super::design::Design;
use super::iterate::Progress;
use super::qr_step::QrStep;
use crate::simd::{LANES, Wide};

/// One record of eight replicates.
#[derive(Debug, Clone)]
pub(crate) struct RecordSpace {
    /// Signals (output, inputs, the constant one) × lines.
    pub re: Vec<Wide>,
    /// Imaginary parts, alike.
    pub im: Vec<Wide>,
    /// Products on the lines of a tile, and how many lines that is.
    pub products: Vec<Wide>,
    pub rows: usize,
    /// Whether the products that no output enters are those of the inputs.
    pub inputs_ready: bool,
    /// System of this record: (transient + θ) × (one more).
    pub matrix: Vec<Wide>,
    /// Coefficients of the transient at the current iterate, where a step leads, and at the best so far.
    pub transient: Vec<Wide>,
    pub next_transient: Vec<Wide>,
    pub best_transient: Vec<Wide>,
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

/// Scratch for one [`Design`].
#[derive(Debug, Clone)]
pub struct Workspace {
    pub(crate) records: Vec<RecordSpace>,
    /// On the lines of a tile: λ, their weights; A and 1/|A|².
    pub(crate) weights: Vec<Wide>,
    pub(crate) a_re: Vec<Wide>,
    pub(crate) a_im: Vec<Wide>,
    pub(crate) inverse_square: Vec<Wide>,
    /// Denoised output and residual on the lines of a tile.
    pub(crate) hat_re: Vec<Wide>,
    pub(crate) hat_im: Vec<Wide>,
    pub(crate) residual_re: Vec<Wide>,
    pub(crate) residual_im: Vec<Wide>,
    pub(crate) sums: Vec<Wide>,
    pub(crate) diagonal: Vec<Wide>,
    /// System in θ alone, summed over records.
    pub(crate) global: Vec<Wide>,
    /// θ at the current iterate, where a step leads, and at the best so far.
    pub(crate) theta: Vec<Wide>,
    pub(crate) next: Vec<Wide>,
    pub(crate) best_theta: Vec<Wide>,
    pub(crate) progress: Progress,
    /// Lanes in which the last step by orthogonal factors met dependent columns.
    pub(crate) dependent: [bool; LANES],
    /// Scratch for one record's unknowns.
    pub(crate) unknowns: Vec<Wide>,
    /// Size of the target column, Σ w|γ₀|², and of each θ column: what convergence is judged by.
    pub(crate) target_size: Wide,
    pub(crate) column_size: Vec<Wide>,
    /// Zero in lanes where the last system's pivots were too small.
    pub(crate) trusted: Wide,
    pub(crate) inverse: Vec<Wide>,
    pub(crate) square: Vec<Wide>,
    /// Normal matrix of the differenced rows.
    pub(crate) ls_normal: Vec<Wide>,
    pub(crate) work: Vec<Wide>,
    pub(crate) meat: Vec<Wide>,
    pub(crate) classical: Vec<Wide>,
    /// Covariances of θ in units of the band edge, and the normal matrix.
    pub(crate) cov_hc3: Vec<Wide>,
    pub(crate) cov_nonrobust: Vec<Wide>,
    pub(crate) gram: Vec<Wide>,
    pub(crate) row_re: Vec<Wide>,
    pub(crate) row_im: Vec<Wide>,
    pub(crate) z_re: Vec<Wide>,
    pub(crate) z_im: Vec<Wide>,
    pub(crate) qr: QrStep,
}

impl Workspace {
    /// Room for one design.
    #[must_use]
    pub fn new(d: &Design) -> Workspace {
        let inputs = d.structure.numerators.len();
        let (size, p, tile) = (d.size(), d.parameters(), d.tile);
        let wide = |n: usize| vec![Wide::ZERO; n];
        let ls = d.method == crate::structure::Method::Ls;
        let records = d
            .records
            .iter()
            .map(|r| RecordSpace {
                re: {
                    let mut re = wide((1 + inputs) * r.x.len());
                    re.resize((2 + inputs) * r.x.len(), Wide::splat(1.0));
                    re
                },
                im: wide((2 + inputs) * r.x.len()),
                products: wide(d.products.count * r.x.len().min(tile)),
                rows: r.x.len().min(tile),
                inputs_ready: false,
                matrix: wide(size * (size + 1)),
                transient: wide(d.transient),
                next_transient: wide(d.transient),
                best_transient: wide(d.transient),
                projection: wide(d.transient * p),
                flat_projection: wide(d.transient * p),
                transient_inverse: wide(d.transient * d.transient),
                differenced: wide(if ls { r.x.len() * 2 * (d.ls_size() + 1) } else { 0 }),
                instruments: wide(if ls { r.x.len() * 2 * d.ls_size() } else { 0 }),
                lines: r.x.len(),
                limit: r.x.len(),
            })
            .collect();
        let extra = d.ls_size();
        Workspace {
            records,
            weights: wide(tile),
            a_re: wide(tile),
            a_im: wide(tile),
            inverse_square: wide(tile),
            hat_re: wide(tile),
            hat_im: wide(tile),
            residual_re: wide(tile),
            residual_im: wide(tile),
            // And a zero, for entries that vanish.
            sums: wide(d.products.count + 1),
            diagonal: wide(size.max(extra)),
            global: wide(extra * (extra + 1)),
            theta: wide(p),
            next: wide(p),
            best_theta: wide(p),
            progress: Progress::default(),
            dependent: [false; LANES],
            unknowns: wide(size.max(extra)),
            target_size: Wide::ZERO,
            column_size: wide(extra),
            trusted: Wide::ZERO,
            inverse: wide(extra * extra),
            square: wide((extra * extra).max(d.transient * d.transient)),
            ls_normal: wide(extra * extra),
            work: wide(size.max(extra) * (size.max(extra) + 1)),
            meat: wide(extra * extra),
            classical: wide(extra * extra),
            cov_hc3: wide(p * p),
            cov_nonrobust: wide(p * p),
            gram: wide(p * p),
            row_re: wide(extra + 1),
            row_im: wide(extra + 1),
            z_re: wide(extra),
            z_im: wide(extra),
            qr: QrStep::new(d),
        }
    }

    /// Where the coefficients of one record and signal (0 the output, 1 + k input k) are written.
    pub fn signal_mut(&mut self, record: usize, signal: usize) -> (&mut [Wide], &mut [Wide]) {
        let r = &mut self.records[record];
        r.inputs_ready &= signal == 0;
        let range = signal * r.lines..(signal + 1) * r.lines;
        (&mut r.re[range.clone()], &mut r.im[range])
    }
}
