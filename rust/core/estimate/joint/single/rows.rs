//! The rows of a single problem: written eight lines at a time, whitened where samples are uneven.

use super::super::design::JointDesign;
use super::super::rows::rows;
use super::super::whitener::Uneven;
use super::super::workspace::JointWorkspace;
use super::Single;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::simd::{Kernel, LANES, Lanes};

impl Single<'_> {
    /// Writes the rows of record `k`; on the left stand those of the data where nothing is denoised.
    pub(super) fn write(&mut self, k: usize, weights: RowWeights, factors: LeftColumns) {
        let d = self.d;
        let rd = &d.records[k];
        let groups = rd.used.div_ceil(LANES);
        self.w.clear_rest(groups);
        self.isa.run(WriteRows {
            design: d,
            space: &mut self.w,
            record: k,
            groups,
            weights,
            factors,
        });
        let data = factors == LeftColumns::Data;
        if weights == RowWeights::Adapted {
            self.whiten(k, data);
        }
        if data {
            let JointWorkspace { left, right, .. } = &mut self.w;
            left.all.copy_from_slice(&right.all);
        }
    }

    /// Whitens the rows of record `k` where its samples are uneven.
    fn whiten(&mut self, k: usize, data: bool) {
        let Single { d, w, blocks, factors, work, .. } = self;
        let (rd, groups) = (&d.records[k], w.residual.part);
        let each = match &rd.uneven {
            Uneven::No => return,
            Uneven::Each(all) => &all[..],
            Uneven::Together(sums) => {
                let factor = &mut factors[k];
                if factor.is_none() {
                    let sigma: Vec<f64> = w.sigma.iter().map(|v| v.0[0]).collect();
                    *factor = Some(sums.whitener(&sigma, rd.used));
                }
                factor.as_slice()
            }
        };
        let part = 2 * groups;
        let size = (groups, rd.used);
        for block in blocks.iter() {
            // One whitens all outputs at once, or each its own.
            for (at, i) in block.outputs.iter().enumerate().take(each.len()) {
                let whitener = &each[*i];
                let place = |slot: usize| block.from + slot * block.height + at * part;
                let right: Vec<usize> = (0..=block.columns.len()).map(place).collect();
                whitener.whiten(&mut w.right.all, &right, size, work);
                whitener.whiten(&mut w.residual.all, &[i * part], size, work);
                if data {
                    continue;
                }
                let denoised = |slot: &usize| d.denoised[block.columns[*slot]];
                let (own, others): (Vec<usize>, Vec<usize>) =
                    (0..block.columns.len()).partition(denoised);
                let left: Vec<usize> = own.into_iter().map(place).collect();
                whitener.whiten(&mut w.left.all, &left, size, work);
                for start in others.into_iter().map(place) {
                    let own = start..start + part * whitener.outputs();
                    w.left.all[own.clone()].copy_from_slice(&w.right.all[own]);
                }
            }
        }
    }
}

/// Writes the rows of a record.
struct WriteRows<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    record: usize,
    groups: usize,
    weights: RowWeights,
    factors: LeftColumns,
}

impl Kernel for WriteRows<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let WriteRows { design: d, space: w, record, groups, weights, factors } = self;
        let even = d.records[record].uneven.is_none();
        let whole = d.noise.inputs.is_some() || (even && d.holds_sigma());
        rows::<L>(d, w, record, 0..groups, weights, factors, whole);
    }
}
