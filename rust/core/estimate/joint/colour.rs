//! Colour of the outputs' noise: an autoregression fitted to the periodogram of their residuals.

use super::design::JointDesign;
use super::rows::rows;
use super::tile::Across;
use super::workspace::JointWorkspace;
use crate::estimate::autoregression::{Autocovariance, FREE_ROUNDS, share};
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::tiles;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// Fits the colour of each live lane again; returns by how much its root changed, relative to its size.
///
/// On the lines that the fit uses, the periodogram is raised by rows over degrees of freedom.
pub(crate) fn refit(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    round: usize,
    live: [bool; LANES],
) -> [f64; LANES] {
    let q = d.outputs();
    let mut power: Vec<Vec<Wide>> =
        w.records.iter().map(|r| vec![Wide::ZERO; r.lines * q]).collect();
    isa.run(Periodogram { design: d, space: w, power: &mut power });
    let rows: usize = d.records.iter().map(|r| 2 * r.used * q).sum();
    let raised = rows as f64 / d.degrees_of_freedom().max(1) as f64;
    let top =
        d.records.iter().fold(0.0, |most: f64, r| most.max(r.x.last().copied().unwrap_or(0.0)));
    let lines: usize = d.records.iter().map(|r| r.count).sum();
    let mut changed = [0.0; LANES];
    for lane in (0..LANES).filter(|k| live[*k]) {
        for i in 0..q {
            let mut covariance = Autocovariance::default();
            for (rd, power) in d.records.iter().zip(&power) {
                for m in 0..rd.count {
                    let by = if m < rd.used { raised } else { 1.0 };
                    let weight = by * share(m, rd.count, rd.lines.first == 0);
                    let (block, at) = w.across.place(m, lane);
                    covariance.add(weight * power[block * q + i].0[at], rd.x[m], top);
                }
            }
            let fixed = (round >= FREE_ROUNDS).then_some(w.colour_orders[lane * q + i]);
            let own = covariance.fitted(lines, fixed);
            w.colour_orders[lane * q + i] = own.order;
            for (r, rd) in w.records.iter_mut().zip(&d.records) {
                for m in 0..rd.count {
                    let root = own.size(rd.x[m], top);
                    let (block, at) = w.across.place(m, lane);
                    let own = &mut r.colour[block * q + i].0[at];
                    changed[lane] = f64::max(changed[lane], (root - *own).abs() / root);
                    *own = root;
                }
            }
        }
    }
    changed
}

/// |z|²/unit variance of the uncoloured residuals r/A on all lines there are.
struct Periodogram<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    power: &'a mut [Vec<Wide>],
}

impl Kernel for Periodogram<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Periodogram { design: d, space: w, power } = self;
        let q = d.outputs();
        w.beyond = true;
        for (k, own) in power.iter_mut().enumerate() {
            let tile = if w.across == Across::Lines { w.residual.part } else { d.tile };
            for range in tiles(w.records[k].lines, tile) {
                rows::<L>(d, w, k, range.clone(), RowWeights::Adapted, LeftColumns::Data, false);
                for (t, m) in range.enumerate() {
                    // Rows of single problems are weighted.
                    let weight = match w.across {
                        Across::Replicates => d.records[k].weight[m] * 0.5,
                        Across::Lines => 0.5,
                    };
                    let weight = L::splat(weight);
                    for i in 0..q {
                        let (re, im) = w.residual.get::<L>(w.residual.at(i, 0, t));
                        let root = L::load(&w.records[k].colour[m * q + i]);
                        let size = weight * re.mul_add(re, im * im) / (root * root);
                        size.store(&mut own[m * q + i]);
                    }
                }
            }
        }
        w.beyond = false;
    }
}
