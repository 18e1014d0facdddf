//! Workspace of a joint problem: coefficients of eight replicates and everything a pass writes.

use super::design::{JointDesign, RecordDesign};
use super::tile::{Across, Block, Rows};
use crate::estimate::covariances::Covariances;
use crate::estimate::iterates::{Iterates, Progress};
use crate::estimate::measured::Measured;
use crate::linalg::stacked::Factor;
use crate::math::ln_1;
use crate::simd::{LANES, Wide};

/// One record of eight replicates.
#[derive(Debug, Clone, Default)]
pub(crate) struct JointRecordWorkspace {
    /// Signals (outputs, paths, derivatives of the paths by their delay) × lines.
    pub re: Vec<Wide>,
    pub im: Vec<Wide>,
    /// What each path's input jumps by from the record's end to its beginning, where it is held.
    pub jumps: Vec<Wide>,
    /// The outputs as their sums were, where held inputs fold into them.
    pub measured: Measured,
    /// System of this record, (transient + θ) × (one more).
    pub matrix: Vec<Wide>,
    /// (TᵀWT)⁻¹TᵀWJ, transient × θ, and (TᵀWT)⁻¹.
    pub projection: Vec<Wide>,
    pub transient_inverse: Vec<Wide>,
    /// 1/√(power spectrum) of each output's noise on each line: one where white.
    pub colour: Vec<Wide>,
    /// Lines there are, and lines in use.
    pub lines: usize,
    pub limit: usize,
}

/// Workspace for one [`JointDesign`].
#[derive(Debug, Clone, Default)]
pub struct JointWorkspace {
    pub(crate) across: Across,
    /// Whether lines beyond those in use are wanted, too.
    pub(crate) beyond: bool,
    /// Whether W is diagonal, so that outputs without a column need no zeros: rows of single records.
    pub(crate) apart: bool,
    pub(crate) records: Vec<JointRecordWorkspace>,
    /// Columns the step weighs by, of the data, whitened; and the whitened residual.
    pub(crate) left: Rows,
    pub(crate) right: Rows,
    pub(crate) residual: Rows,
    /// Of one line: A, B, W, the denoised signals, one column.
    pub(crate) a: [Vec<Wide>; 2],
    pub(crate) b: [Vec<Wide>; 2],
    pub(crate) white: [Vec<Wide>; 2],
    pub(crate) factor: [Vec<Wide>; 2],
    pub(crate) hat: [Vec<Wide>; 2],
    pub(crate) column: [Vec<Wide>; 2],
    pub(crate) back: [Vec<Wide>; 2],
    /// Lower triangular inverse root of Σ, and Σ itself.
    pub(crate) root: Vec<Wide>,
    pub(crate) sigma: Vec<Wide>,
    pub(crate) sigma_before: Vec<Wide>,
    pub(crate) triangle: Vec<f64>,
    /// Order of the colour of each lane and output.
    pub(crate) colour_orders: Vec<usize>,
    /// All coefficients, held ones included, in the workspace's units.
    pub(crate) coefficients: Vec<Wide>,
    /// Estimated coefficients and delays, and the transients.
    pub(crate) iterates: Iterates,
    pub(crate) progress: Progress,
    pub(crate) dependent: [bool; LANES],
    pub(crate) diagonal: Vec<Wide>,
    pub(crate) global: Vec<Wide>,
    pub(crate) global_work: Vec<Wide>,
    /// 1 where a parameter stands at a bound.
    pub(crate) pinned: Vec<Wide>,
    pub(crate) unknowns: Vec<Wide>,
    pub(crate) target_size: Wide,
    pub(crate) column_size: Vec<Wide>,
    pub(crate) trusted: Wide,
    pub(crate) square: Vec<Wide>,
    pub(crate) work: Vec<Wide>,
    pub(crate) gram: Vec<Wide>,
    pub(crate) inverse: Vec<Wide>,
    pub(crate) meat: Vec<Wide>,
    pub(crate) covariances: Covariances,
    /// Influence of the two rows of each output of a line on θ, and its sums over the lines (`growth`).
    pub(crate) influence: [Vec<Wide>; 2],
    pub(crate) shared: Vec<Wide>,
    /// Their squared whitened residuals, and what leverages leave of them.
    pub(crate) squares: [Wide; 2],
    pub(crate) left_over: [Wide; 2],
    pub(crate) z: [Vec<Wide>; 2],
    pub(crate) row: [Vec<Wide>; 2],
    /// Of a step by orthogonal factors.
    pub(crate) qr: Factor,
}

impl JointWorkspace {
    /// Room for one design.
    #[must_use]
    pub fn new(d: &JointDesign) -> JointWorkspace {
        let (q, paths, size, p) = (d.outputs(), d.paths(), d.size(), d.parameters());
        let nt = d.transient.len();
        let wide = |n: usize| vec![Wide::ZERO; n];
        let pair = |n: usize| [wide(n), wide(n)];
        let rows = |columns: usize| Rows::tiled(d.tile, q, columns);
        let records = d
            .records
            .iter()
            .map(|r| JointRecordWorkspace {
                re: wide((q + 2 * paths) * r.count),
                im: wide((q + 2 * paths) * r.count),
                jumps: wide(paths),
                measured: Measured::new(d.aliasing.as_ref(), q * r.count),
                matrix: wide(size * (size + 1)),
                projection: wide(nt * p),
                transient_inverse: wide(nt * nt),
                colour: vec![Wide::splat(1.0); r.count * q],
                lines: r.count,
                limit: r.used,
            })
            .collect();
        JointWorkspace {
            records,
            left: rows(size + 1),
            right: rows(size + 1),
            residual: rows(1),
            sigma_before: wide(q * q),
            diagonal: wide(size),
            global: wide(p * (p + 1)),
            global_work: wide(p * (p + 1)),
            unknowns: wide(size),
            column_size: wide(p),
            square: wide(nt.max(p) * nt.max(p)),
            work: wide(size * (size + 1)),
            gram: wide(p * p),
            inverse: wide(p * p),
            meat: wide(p * p),
            covariances: Covariances::new(p, d.bins.terms.len(), q),
            influence: pair(q * p),
            shared: wide(d.pairs() * p * p),
            z: pair(p),
            row: pair(p),
            qr: Factor::new(nt, p, d.records.len(), 2 * d.tile * q),
            ..JointWorkspace::shared(d, Across::Replicates, false)
        }
    }

    /// What both kinds of workspaces have.
    fn shared(d: &JointDesign, across: Across, apart: bool) -> JointWorkspace {
        let (q, paths, p) = (d.outputs(), d.paths(), d.parameters());
        let wide = |n: usize| vec![Wide::ZERO; n];
        let pair = |n: usize| [wide(n), wide(n)];
        JointWorkspace {
            across,
            apart,
            a: pair(q),
            b: pair(q * paths),
            white: pair(q * q),
            factor: pair(q * q),
            hat: pair(q + paths),
            column: pair(q),
            back: pair(q),
            root: wide(q * q),
            sigma: wide(q * q),
            triangle: vec![0.0; q * q],
            colour_orders: vec![0; LANES * q],
            coefficients: wide(d.structure.coefficients()),
            iterates: Iterates::new(p, d.transient.len(), d.records.len()),
            pinned: wide(p),
            ..JointWorkspace::default()
        }
    }

    /// Room for one design with eight lines in the lanes, and the blocks of its rows: steps of batches want more.
    pub(crate) fn single(d: &JointDesign) -> (JointWorkspace, Vec<Block>) {
        let (q, paths) = (d.outputs(), d.paths());
        let wide = |n: usize| vec![Wide::ZERO; n];
        let record = |r: &RecordDesign| {
            let lines = r.stride() / LANES;
            JointRecordWorkspace {
                re: wide((q + 2 * paths) * lines),
                im: wide((q + 2 * paths) * lines),
                jumps: wide(paths),
                measured: Measured::new(d.aliasing.as_ref(), q * lines),
                colour: vec![Wide::splat(1.0); lines * q],
                lines,
                limit: lines,
                ..JointRecordWorkspace::default()
            }
        };
        let apart = !d.holds_sigma() || q == 1;
        let blocks: Vec<Vec<usize>> = match apart {
            true => (0..q).map(|i| vec![i]).collect(),
            false => vec![(0..q).collect()],
        };
        let reach = match apart {
            true => d.reach.clone(),
            false => vec![(0..q).collect(); d.size() + 1],
        };
        // At least as many rows as columns, zeros where a record has too few lines.
        let most = d.records.iter().map(|r| r.used.div_ceil(LANES)).max().unwrap_or(0);
        let groups = most.max(d.size().div_ceil(2 * LANES));
        let (rows, laid) = Rows::stacked(groups, q, &blocks, &reach);
        let space = JointWorkspace {
            records: d.records.iter().map(record).collect(),
            left: rows.clone(),
            right: rows,
            residual: Rows::single(groups, q),
            ..JointWorkspace::shared(d, Across::Lines, apart)
        };
        (space, laid)
    }

    /// Zeros behind the first `groups` of eight lines of all rows.
    pub(crate) fn clear_rest(&mut self, groups: usize) {
        for rows in [&mut self.left, &mut self.right, &mut self.residual] {
            if groups < rows.part {
                for own in rows.all.chunks_exact_mut(rows.part) {
                    own[groups..].fill(Wide::ZERO);
                }
            }
        }
    }

    /// Where the coefficients of one record and signal (outputs, paths, derivatives of paths) are written; of a
    /// single problem eight lines a block.
    pub(crate) fn signal_mut(
        &mut self,
        record: usize,
        signal: usize,
    ) -> (&mut [Wide], &mut [Wide]) {
        let r = &mut self.records[record];
        let range = signal * r.lines..(signal + 1) * r.lines;
        (&mut r.re[range.clone()], &mut r.im[range])
    }

    /// Keeps what a path's held input jumps by, which line 0 of its coefficients came with: the workspace's own are
    /// written, from line `first` on.
    pub(crate) fn keep_jump(
        &mut self,
        d: &JointDesign,
        record: usize,
        signal: usize,
        write: impl FnOnce(&mut Wide),
    ) {
        let r = &mut self.records[record];
        let path = signal.checked_sub(d.outputs());
        if let Some(jump) = path.and_then(|path| r.jumps.get_mut(path)) {
            write(jump);
            if d.records[record].lines.first == 0 {
                // Of a single problem the first of eight lines.
                let line = &mut r.im[signal * r.lines];
                match self.across {
                    Across::Replicates => *line = Wide::ZERO,
                    Across::Lines => line.0[0] = 0.0,
                }
            }
        }
    }

    /// Writes the coefficients that θ and the held values make, in the workspace's units.
    pub(crate) fn spread_theta(&mut self, d: &JointDesign) {
        for (k, held) in d.structure.fixed.iter().enumerate() {
            if let Some(value) = held {
                self.coefficients[k] = Wide::splat(value / d.scale[k]);
            }
        }
        for (k, value) in d.free.iter().zip(&self.iterates.theta.now) {
            self.coefficients[*k] = *value;
        }
    }

    /// Estimates of one lane in the user's units.
    pub fn theta<'a>(&'a self, d: &'a JointDesign, lane: usize) -> impl Iterator<Item = f64> + 'a {
        self.iterates.theta.now.iter().enumerate().map(move |(k, t)| {
            let value = t.0[lane] * d.parameter_scale(k);
            // On a bound it is the bound, whatever the units have rounded.
            let (low, high) = d.given_bounds(k);
            let near = |bound: &f64| (value - bound).abs() <= 4.0 * f64::EPSILON * bound.abs();
            [low, high].into_iter().find(|bound| bound.is_finite() && near(bound)).unwrap_or(value)
        })
    }

    /// Parameter `k` of every lane in the user's units.
    pub(crate) fn parameter(&self, d: &JointDesign, k: usize) -> [f64; LANES] {
        self.iterates.theta.now[k].0.map(|t| t * d.parameter_scale(k))
    }

    /// What fits on the same lines are compared by: the weighted sum of squares where Σ is known, else
    /// N log det Σ̂.
    pub(crate) fn criterion(&self, d: &JointDesign, lane: usize) -> f64 {
        if d.outputs() == 1 || d.noise.outputs.is_some() {
            return self.progress.cost.0[lane];
        }
        let q = d.outputs();
        // The diagonal of the inverse root: det Σ = Π 1/root².
        let sum: f64 = (0..q).map(|i| -2.0 * ln_1(self.root[i * q + i].0[lane])).sum();
        d.degrees_of_freedom() as f64 * sum
    }
}
