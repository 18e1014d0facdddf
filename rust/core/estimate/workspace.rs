//! Workspace of one worker: the coefficients of eight replicates and everything a pass writes. Made once, never grown.

use std::sync::Arc;

use super::covariances::Covariances;
use super::design::Design;
use super::driven::output::Refined;
use super::iterates::{Iterates, Progress};
use super::measured::Measured;
use super::qr_step::QrStep;
use super::record_workspace::RecordWorkspace;
use super::rest::{Drives, Tie};
use super::straight::tables::StraightWorkspace;
use crate::simd::{LANES, Wide};
use crate::structure::CovType;

/// Workspace for one [`Design`].
#[derive(Debug, Clone)]
pub struct Workspace {
    pub(crate) records: Vec<RecordWorkspace>,
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
    /// Whether the products of the records are those of their coefficients.
    pub(crate) prepared: bool,
    pub(crate) straight: StraightWorkspace,
    pub(crate) diagonal: Vec<Wide>,
    /// System in θ alone, summed over records.
    pub(crate) global: Vec<Wide>,
    pub(crate) iterates: Iterates,
    /// Where lanes stood before they went from a second start.
    pub(crate) before: Iterates,
    /// θ before a round of what sampling folds.
    pub(crate) before_round: Vec<Wide>,
    /// Where one lane's coefficients go from eight starts at once, once that was needed.
    pub(crate) other: Option<Box<Workspace>>,
    pub(crate) progress: Progress,
    /// Lanes in which the last step by orthogonal factors met dependent columns.
    pub(crate) dependent: [bool; LANES],
    /// Workspace for one record's unknowns.
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
    /// Covariances of θ in units of the band edge, and the normal matrix.
    pub(crate) covariances: Covariances,
    pub(crate) gram: Vec<Wide>,
    /// Where noise drives the system, once it was needed.
    pub(crate) refined: Option<Box<Refined>>,
    pub(crate) row_re: Vec<Wide>,
    pub(crate) row_im: Vec<Wide>,
    pub(crate) z_re: Vec<Wide>,
    pub(crate) z_im: Vec<Wide>,
    pub(crate) influence_re: Vec<Wide>,
    pub(crate) influence_im: Vec<Wide>,
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
            .map(|r| RecordWorkspace {
                re: {
                    let mut re = wide((1 + inputs) * r.x.len());
                    re.resize((2 + inputs) * r.x.len(), Wide::splat(1.0));
                    re
                },
                im: wide((2 + inputs) * r.x.len()),
                jumps: wide(inputs),
                // Inputs that act at once are turned for a while.
                measured: Measured::new(
                    d.aliasing.as_ref(),
                    if d.acts_at_once() { (1 + inputs) * r.x.len() } else { r.x.len() },
                ),
                tie: Tie::new(d.tied(), p),
                products: wide(d.products.count * r.x.len().min(tile)),
                rows: r.x.len().min(tile),
                inputs_ready: false,
                matrix: wide(size * (size + 1)),
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
            prepared: false,
            straight: StraightWorkspace::new(d.straight.as_ref()),
            diagonal: wide(size.max(extra)),
            global: wide(extra * (extra + 1)),
            iterates: Iterates::new(p, d.transient, d.records.len()),
            before: Iterates::new(p, d.transient, d.records.len()),
            before_round: wide(p),
            other: None,
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
            covariances: Covariances::new(p, d.bins.terms.len(), 1),
            gram: wide(p * p),
            refined: None,
            row_re: wide(extra + 1),
            row_im: wide(extra + 1),
            z_re: wide(extra),
            z_im: wide(extra),
            influence_re: wide(p),
            influence_im: wide(p),
            qr: QrStep::new(d),
        }
    }

    /// Where the coefficients of one record and signal (0 the output, 1 + k input k) are written.
    pub fn signal_mut(&mut self, record: usize, signal: usize) -> (&mut [Wide], &mut [Wide]) {
        let r = &mut self.records[record];
        r.inputs_ready &= signal == 0;
        self.straight.inputs_ready &= signal == 0;
        let range = signal * r.lines..(signal + 1) * r.lines;
        (&mut r.re[range.clone()], &mut r.im[range])
    }

    /// Keeps what a held input jumps by, which line 0 of its coefficients came with: the workspace's own are written, from
    /// line `first` on.
    pub(crate) fn keep_jump(
        &mut self,
        record: usize,
        signal: usize,
        first: usize,
        write: impl FnOnce(&mut Wide),
    ) {
        let r = &mut self.records[record];
        if let Some(jump) = signal.checked_sub(1).and_then(|input| r.jumps.get_mut(input)) {
            write(jump);
            if first == 0 {
                r.im[signal * r.lines] = Wide::ZERO;
            }
        }
    }

    /// Room for the ways of one lane from eight starts, before the first is needed: replicates allocate nothing.
    pub(crate) fn make_other(&mut self, d: &Design) {
        self.other.get_or_insert_with(|| Box::new(Workspace::new(d)));
    }

    /// One lane's coefficients of another workspace of the same design, in all lanes.
    pub(crate) fn load_lane(&mut self, from: &Workspace, lane: usize) {
        for (to, from) in self.records.iter_mut().zip(&from.records) {
            let values = to.re.iter_mut().zip(&from.re).chain(to.im.iter_mut().zip(&from.im));
            values.for_each(|(to, from)| *to = Wide::splat(from.0[lane]));
            to.inputs_ready = false;
        }
        self.straight.inputs_ready = false;
    }

    /// Nothing known yet: the live lanes iterate, the others do not.
    pub(crate) fn begin(&mut self, live: [bool; LANES]) {
        self.progress.begin(live);
        self.dependent = [false; LANES];
        self.forget_products();
    }

    /// Products of the data are to be written anew: at the estimate the model's own response stands in them.
    pub(crate) fn forget_products(&mut self) {
        self.prepared = false;
        self.straight.output_ready = false;
    }

    /// θ of one lane in the user's units.
    pub fn theta<'a>(&'a self, d: &'a Design, lane: usize) -> impl Iterator<Item = f64> + 'a {
        self.iterates.theta.now.iter().zip(&d.scale).map(move |(t, s)| t.0[lane] * s)
    }

    /// What the inputs of the one record do to states from a known start.
    pub(crate) fn set_drives(&mut self, drives: Drives) {
        self.records[0].tie.drives = Arc::new(drives);
    }

    /// Parameter `k` of every lane in the user's units.
    pub(crate) fn parameter(&self, d: &Design, k: usize) -> [f64; LANES] {
        self.iterates.theta.now[k].0.map(|t| t * d.scale[k])
    }

    /// Whitened squared residuals of one lane, summed.
    pub fn cost(&self, lane: usize) -> f64 {
        self.progress.cost.0[lane]
    }

    /// Covariance of one lane in the user's units, row major.
    pub fn covariance(&self, d: &Design, lane: usize, kind: CovType) -> Vec<f64> {
        self.covariances.square(kind, lane, |k| d.scale[k])
    }
}
