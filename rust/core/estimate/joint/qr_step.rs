//! One step of one lane of a joint problem by orthogonal factors, where pivots were too small to trust.

use super::design::JointDesign;
use super::rows::rows;
use super::tile::Rows;
use super::workspace::JointWorkspace;
use crate::estimate::iterates::Iterate;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::tiles;
use crate::estimate::rule::Rule;
use crate::simd::{Isa, Kernel, Lanes};

/// Writes the rows of a tile for all lanes.
struct Tile<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    record: usize,
    range: std::ops::Range<usize>,
    weights: RowWeights,
    factors: LeftColumns,
}

impl Kernel for Tile<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        rows::<L>(
            self.design,
            self.space,
            self.record,
            self.range,
            self.weights,
            self.factors,
            true,
        );
    }
}

/// Factors of one lane's rows, records stacked. False where the columns are dependent.
fn factor(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    lane: usize,
    weights: RowWeights,
    factors: LeftColumns,
) -> bool {
    let (q, size) = (d.outputs(), d.size());
    let width = size + 1;
    w.qr.clear();
    let mut full = true;
    for k in 0..w.records.len() {
        for range in tiles(w.records[k].limit, d.tile) {
            isa.run(Tile {
                design: d,
                space: w,
                record: k,
                range: range.clone(),
                weights,
                factors,
            });
            let JointWorkspace { left, right, qr, .. } = w;
            let left = if factors == LeftColumns::Data { &*right } else { &*left };
            for (t, m) in range.enumerate() {
                let root = d.records[k].weight[m].sqrt();
                for row in t * q..(t + 1) * q {
                    for part in 0..2 {
                        let number = |rows: &Rows, c: usize| {
                            rows.all[part * rows.part + row * width + c].0[lane] * root
                        };
                        qr.push(
                            (0..size).map(|c| number(left, c)),
                            (0..width).map(|c| number(right, c)),
                        );
                    }
                }
            }
        }
        full &= w.qr.end_record(k);
    }
    full & w.qr.is_independent()
}

/// Solves one lane: next θ, next T of every record. False where the columns are dependent.
///
/// Parameters on their bounds stay there.
pub(crate) fn solve(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    lane: usize,
    rule: Rule,
    held: bool,
) -> bool {
    let mut full = factor(isa, d, w, lane, rule.weights(), rule.factors());
    let delays = d.free.len();
    let JointWorkspace { qr, pinned, iterates, .. } = w;
    let Iterate { now, next, .. } = &mut iterates.theta;
    // Of a delay the system holds the change.
    let origin = |k: usize| if k >= delays { now[k].0[lane] } else { 0.0 };
    full &= qr.solve(|k| {
        let (low, high) = d.parameter_bounds(k);
        let at = if k >= delays { &now[k] } else { &next[k] };
        let stays = (held && k >= delays) || pinned[k].0[lane] > 0.0;
        stays.then(|| at.0[lane].clamp(low, high) - origin(k))
    });
    for (k, transient) in iterates.transients.iter_mut().enumerate() {
        qr.solve_own(k, &mut transient.next, lane);
    }
    for (k, found) in qr.solution().iter().enumerate() {
        let (low, high) = d.parameter_bounds(k);
        next[k].0[lane] = (found + origin(k)).clamp(low, high);
    }
    full
}

/// Inverse of the normal matrix of one lane, without squaring the condition number.
pub(crate) fn inverse(isa: Isa, d: &JointDesign, w: &mut JointWorkspace, lane: usize) {
    factor(isa, d, w, lane, d.final_weights(), d.final_factors());
    w.qr.inverse(&mut w.inverse, lane);
}
