//! One step of one lane of a joint problem by orthogonal factors, where pivots were too small to trust.

use super::design::JointDesign;
use super::rows::rows;
use super::step::move_of;
use super::workspace::{JointSpace, QrSpace};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::tiles;
use crate::estimate::rule::Rule;
use crate::linalg::qr::solve_square;
use crate::simd::{Isa, Kernel, Lanes};

/// Relative size below which a column is a combination of the others.
const RANK: f64 = 1e-13;

/// Writes the rows of a tile for all lanes.
struct Tile<'a> {
    design: &'a JointDesign,
    space: &'a mut JointSpace,
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

/// LeftColumns one lane's rows, records stacked. False where the columns are dependent.
fn factor(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointSpace,
    lane: usize,
    weights: RowWeights,
    factors: LeftColumns,
) -> bool {
    let (q, p, nt, size) = (d.outputs(), d.parameters(), d.transient.len(), d.size());
    let width = size + 1;
    w.qr.all.clear();
    let mut full = true;
    for k in 0..w.records.len() {
        w.qr.record.clear();
        for range in tiles(w.records[k].limit, d.tile) {
            isa.run(Tile {
                design: d,
                space: w,
                record: k,
                range: range.clone(),
                weights,
                factors,
            });
            for (t, m) in range.enumerate() {
                let root = d.records[k].weight[m].sqrt();
                for row in t * q..(t + 1) * q {
                    for part in 0..2 {
                        let JointSpace { left, right, qr, .. } = w;
                        let of = &right.all[part * right.part..];
                        let by = &left.all[part * left.part..];
                        for c in 0..width {
                            qr.right[c] = of[row * width + c].0[lane] * root;
                        }
                        for c in 0..size {
                            qr.left[c] = match factors {
                                LeftColumns::Data => qr.right[c],
                                _ => by[row * width + c].0[lane] * root,
                            };
                        }
                        qr.record.push(qr.left.iter().copied(), qr.right.iter().copied());
                    }
                }
            }
        }
        let QrSpace { record, all, kept, .. } = &mut w.qr;
        record.absorb();
        for i in 0..nt {
            let norm = (0..=i).fold(0.0, |s, r| s + record.r(r, i) * record.r(r, i));
            full &= record.r(i, i).abs() > RANK * norm.sqrt();
            for j in 0..=size {
                kept[(k * nt + i) * width + j] =
                    if j < nt { record.r(i, j) } else { record.qt(i, j) };
            }
        }
        for i in nt..size {
            all.push((nt..size).map(|j| record.r(i, j)), (nt..=size).map(|j| record.qt(i, j)));
        }
        all.absorb();
    }
    for j in 0..p {
        let norm = (0..=j).fold(0.0, |s, r| s + w.qr.all.r(r, j) * w.qr.all.r(r, j));
        full &= w.qr.all.r(j, j).abs() > RANK * norm.sqrt();
    }
    full
}

/// Solves one lane: next θ, next T of every record, and the move. False where the columns are dependent.
///
/// Parameters on their bounds stay there.
pub(crate) fn solve(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointSpace,
    lane: usize,
    rule: Rule,
    held: bool,
) -> bool {
    let (p, nt, size) = (d.parameters(), d.transient.len(), d.size());
    let mut full = factor(isa, d, w, lane, rule.weights(), rule.factors());
    let delays = d.free.len();
    w.qr.moving.clear();
    for k in 0..p {
        let (low, high) = d.parameter_bounds(k);
        let stays = (held && k >= delays) || w.pinned[k].0[lane] > 0.0;
        if stays {
            let at = if k >= delays {
                w.iterates.theta.now[k].0[lane]
            } else {
                w.iterates.theta.next[k].0[lane]
            };
            let at = at.clamp(low, high);
            w.qr.solution[k] = if k >= delays { at - w.iterates.theta.now[k].0[lane] } else { at };
        } else {
            w.qr.moving.push(k);
        }
    }
    let QrSpace { all, square, moving, solution, found, scale, .. } = &mut w.qr;
    let count = moving.len();
    // RᵀR of what moves would square the condition: the rows of QᵀΓ suffice where all move.
    for (a, i) in moving.iter().enumerate() {
        for (b, j) in moving.iter().enumerate() {
            square[a * (count + 1) + b] = all.qt(*i, *j);
        }
        let held: f64 =
            (0..p).filter(|j| !moving.contains(j)).map(|j| all.qt(*i, j) * solution[j]).sum();
        square[a * (count + 1) + count] = all.qt(*i, p) - held;
    }
    full &= solve_square(square, count, found, scale) > RANK;
    for (k, value) in moving.iter().zip(found.iter()) {
        solution[*k] = *value;
    }
    let QrSpace { solution, kept, .. } = &w.qr;
    for (k, transient) in w.iterates.transients.iter_mut().enumerate() {
        for i in (0..nt).rev() {
            let row = &kept[(k * nt + i) * (size + 1)..][..size + 1];
            let mut sum = row[size];
            for j in 0..p {
                sum -= row[nt + j] * solution[j];
            }
            for (own, t) in row[..nt].iter().zip(&transient.next).skip(i + 1) {
                sum -= own * t.0[lane];
            }
            transient.next[i].0[lane] = sum / row[i];
        }
    }
    for (k, found) in solution.iter().enumerate() {
        let change = found + if k >= delays { w.iterates.theta.now[k].0[lane] } else { 0.0 };
        let (low, high) = d.parameter_bounds(k);
        w.iterates.theta.next[k].0[lane] = change.clamp(low, high);
    }
    isa.run(Move { design: d, space: w });
    full
}

struct Move<'a> {
    design: &'a JointDesign,
    space: &'a mut JointSpace,
}

impl Kernel for Move<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        move_of::<L>(self.design, self.space);
    }
}

/// Inverse of the normal matrix of one lane, (RᵀR)⁻¹, without squaring the condition number.
pub(crate) fn inverse(isa: Isa, d: &JointDesign, w: &mut JointSpace, lane: usize) -> bool {
    let p = d.parameters();
    let full = factor(isa, d, w, lane, d.final_weights(), d.final_factors());
    let QrSpace { all, square, .. } = &mut w.qr;
    for c in 0..p {
        for i in (0..p).rev() {
            let one = if i == c { 1.0 } else { 0.0 };
            let sum = (i + 1..p).fold(one, |s: f64, j| s - all.r(i, j) * square[j * (p + 1) + c]);
            square[i * (p + 1) + c] = sum / all.r(i, i);
        }
    }
    for i in 0..p {
        for j in 0..p {
            let (a, b) = (&square[i * (p + 1)..][..p], &square[j * (p + 1)..][..p]);
            w.inverse[i * p + j].0[lane] = a.iter().zip(b).fold(0.0, |s: f64, (x, y)| s + x * y);
        }
    }
    full
}
