//! At a joint estimate: transients, cost, the covariances of θ, residuals.
//!
//! As for one output (`estimate::uncertainty`), with the rows of all outputs of a line whitened together by W,
//! W S W* = 1. With J_mi the whitened row of output i, Re and Im apart, transients projected out, e_mi its whitened
//! residual and h_mi its leverage,
//!
//! ```text
//! H = (Σ_mi J_miᵀ J_mi)⁻¹,   classical:  σ̂² H,
//!                            HC3:        H (Σ_m g_mᵀ g_m) H,   g_m = Σ_i J_mi e_mi / (1 − h_mi).
//! ```
//!
//! HC3 adds the outputs up before squaring, so that what is left of the correlation between them is allowed for. The
//! spectral covariance has a spectrum for each whitened output. Where Σ is estimated, the other two grow (`growth`);
//! HC3 is wide enough.

use super::design::JointDesign;
use super::growth::{Grow, add_line};
use super::qr_step;
use super::rows::rows;
use super::step::{clear, record_system};
use super::workspace::JointWorkspace;
use crate::estimate::covariances::Kinds;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::{add_parameter_block, copy, tiles};
use crate::estimate::spectral::Finish;
use crate::estimate::uncertainty::{LEVERAGE, project};
use crate::linalg::lanes::{eliminate, invert, substitute};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::structure::Method;

impl JointDesign {
    /// RowWeights that belong to the estimate.
    pub(crate) fn final_weights(&self) -> RowWeights {
        if self.method == Method::Wls { RowWeights::Flat } else { RowWeights::Adapted }
    }

    /// Columns of the information at the estimate.
    pub(crate) fn final_factors(&self) -> LeftColumns {
        if self.method == Method::Ml { LeftColumns::Denoised } else { LeftColumns::Data }
    }
}

/// Completes estimates.
pub(crate) fn finish(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    live: [bool; LANES],
    covariance: bool,
) {
    if d.method == Method::Wls || d.method == Method::Awls {
        isa.run(Transients { design: d, space: w });
    }
    isa.run(Information { design: d, space: w });
    if !covariance {
        return;
    }
    for lane in (0..LANES).filter(|k| live[*k]) {
        if w.trusted.0[lane] == 0.0 {
            qr_step::inverse(isa, d, w, lane);
        }
    }
    isa.run(Sandwich { design: d, space: w });
    if w.covariances.kinds.spectral {
        let freedom = d.freedom(w.records.iter().map(|r| r.limit)).max(1);
        let (spectral, by) = (&mut w.covariances.spectral, 1.0 / freedom as f64);
        isa.run(Finish { spectral, bins: &d.bins, cost: &w.progress.cost, by });
    }
    if d.estimates_weights() {
        isa.run(Grow { design: d, space: w });
    }
}

/// T of every record by least squares at the current θ.
pub(crate) struct Transients<'a> {
    pub design: &'a JointDesign,
    pub space: &'a mut JointWorkspace,
}

impl Kernel for Transients<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let (nt, size) = (d.transient.len(), d.size());
        let mut trusted = Wide::splat(1.0);
        for k in 0..w.records.len() {
            record_system::<L>(d, w, k, d.final_weights(), LeftColumns::Data);
            let JointWorkspace { records, iterates, unknowns, diagonal, .. } = &mut *w;
            let r = &mut records[k];
            eliminate::<L>(&mut r.matrix, size, 0..nt, diagonal, false, &mut trusted);
            copy::<L>(&iterates.theta.now, &mut unknowns[nt..size]);
            // Of a delay the system holds the change: none.
            clear::<L>(&mut unknowns[nt + d.free.len()..size]);
            substitute::<L>(&r.matrix, size, 0..nt, unknowns);
            copy::<L>(&unknowns[..nt], &mut iterates.transients[k].now);
        }
    }
}

/// Cost, normal matrix of θ with the transient projected out, and its inverse, on the lines in use.
pub(crate) struct Information<'a> {
    pub design: &'a JointDesign,
    pub space: &'a mut JointWorkspace,
}

impl Kernel for Information<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let (p, nt, size) = (d.parameters(), d.transient.len(), d.size());
        let mut trusted = Wide::splat(1.0);
        let mut cost = L::splat(0.0);
        clear::<L>(&mut w.global);
        for k in 0..w.records.len() {
            cost = cost + record_system::<L>(d, w, k, d.final_weights(), d.final_factors());
            let JointWorkspace { records, square, work, diagonal, global, .. } = &mut *w;
            let r = &mut records[k];
            for i in 0..nt {
                copy::<L>(
                    &r.matrix[i * (size + 1)..i * (size + 1) + nt],
                    &mut square[i * nt..(i + 1) * nt],
                );
            }
            if nt > 0 {
                invert::<L>(square, nt, &mut r.transient_inverse, work, &mut trusted);
            }
            eliminate::<L>(&mut r.matrix, size, 0..nt, diagonal, false, &mut trusted);
            project::<L>(&r.matrix, nt, size, &mut r.projection);
            add_parameter_block::<L>(&r.matrix, nt, size, global, false);
        }
        cost.store(&mut w.progress.cost);
        for i in 0..p {
            copy::<L>(&w.global[i * (p + 1)..i * (p + 1) + p], &mut w.gram[i * p..(i + 1) * p]);
        }
        // A parameter on its bound has no error of its own; the others have theirs given it.
        copy::<L>(&w.gram, &mut w.square[..p * p]);
        for k in 0..p {
            let off = L::splat(1.0) - L::load(&w.pinned[k]);
            for j in 0..p {
                if j != k {
                    for at in [k * p + j, j * p + k] {
                        (off * L::load(&w.square[at])).store(&mut w.square[at]);
                    }
                }
            }
        }
        invert::<L>(&w.square, p, &mut w.inverse, &mut w.work, &mut trusted);
        for k in 0..p {
            let off = L::splat(1.0) - L::load(&w.pinned[k]);
            let own = &mut w.inverse[k * p + k];
            (off * L::load(own)).store(own);
        }
        w.trusted = trusted;
    }
}

/// Both covariances from the inverse, the rows and the residuals.
struct Sandwich<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
}

impl Kernel for Sandwich<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let (q, p) = (d.outputs(), d.parameters());
        let (weights, factors) = (d.final_weights(), d.final_factors());
        clear::<L>(&mut w.meat);
        w.covariances.spectral.clear();
        clear::<L>(&mut w.shared);
        let Kinds { spectral, .. } = w.covariances.kinds;
        for k in 0..w.records.len() {
            for range in tiles(w.records[k].limit, d.tile) {
                // Denoised on both sides, or data: `right` holds them.
                rows::<L>(d, w, k, range.clone(), weights, factors, true);
                for (t, m) in range.enumerate() {
                    let weight = L::splat(d.records[k].weight[m]);
                    clear::<L>(&mut w.z[0]);
                    clear::<L>(&mut w.z[1]);
                    for i in 0..q {
                        row::<L>(d, w, k, t * q + i, weight);
                        if spectral {
                            count::<L>(d, w, k, (m, i));
                        }
                    }
                    if d.estimates_weights() {
                        add_line::<L>(d, w, weight);
                    }
                    for a in 0..p {
                        let (x, y) = (L::load(&w.z[0][a]), L::load(&w.z[1][a]));
                        for b in 0..p {
                            let own = &mut w.meat[a * p + b];
                            let im = y.mul_add(L::load(&w.z[1][b]), L::load(own));
                            x.mul_add(L::load(&w.z[0][b]), im).store(own);
                        }
                    }
                }
            }
        }
        let freedom = d.freedom(w.records.iter().map(|r| r.limit)).max(1);
        let variance = L::load(&w.progress.cost) * L::splat(1.0 / freedom as f64);
        for i in 0..p {
            for j in 0..p {
                let mut sum = L::splat(0.0);
                for a in 0..p {
                    let left = L::load(&w.inverse[i * p + a]);
                    for b in 0..p {
                        let by = left * L::load(&w.meat[a * p + b]);
                        sum = by.mul_add(L::load(&w.inverse[b * p + j]), sum);
                    }
                }
                sum.store(&mut w.covariances.hc3[i * p + j]);
                (L::load(&w.inverse[i * p + j]) * variance)
                    .store(&mut w.covariances.nonrobust[i * p + j]);
            }
        }
    }
}

/// Adds weight · J e/(1 − h) of one output's rows of a line to `z`, J with the transient projected out.
#[inline(always)]
fn row<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, k: usize, at: usize, weight: L) {
    let (p, nt, width) = (d.parameters(), d.transient.len(), d.size() + 1);
    let (r, output) = (&w.records[k], at % d.outputs());
    for c in 0..p {
        let mut own = w.right.get::<L>(at * width + nt + c);
        for t in 0..nt {
            let column = w.right.get::<L>(at * width + t);
            let by = -L::load(&r.projection[t * p + c]);
            own = (column.0.mul_add(by, own.0), column.1.mul_add(by, own.1));
        }
        own.0.store(&mut w.row[0][c]);
        own.1.store(&mut w.row[1][c]);
    }
    for part in 0..2 {
        let mut h = L::splat(0.0);
        for a in 0..nt {
            for b in 0..nt {
                let (x, y) = (w.right.get::<L>(at * width + a), w.right.get::<L>(at * width + b));
                let (x, y) = if part == 0 { (x.0, y.0) } else { (x.1, y.1) };
                h = (x * y).mul_add(L::load(&r.transient_inverse[a * nt + b]), h);
            }
        }
        for a in 0..p {
            let mut own = L::splat(0.0);
            for b in 0..p {
                own = L::load(&w.inverse[a * p + b]).mul_add(L::load(&w.row[part][b]), own);
            }
            own.store(&mut w.influence[part][output * p + a]);
            h = own.mul_add(L::load(&w.row[part][a]), h);
        }
        let e = w.residual.get::<L>(at);
        let e = if part == 0 { e.0 } else { e.1 };
        let left = (-h).mul_add(weight, L::splat(1.0)).max(L::splat(LEVERAGE));
        left.store(&mut w.left_over[part]);
        (weight * e * e).store(&mut w.squares[part]);
        let by = weight * e / left;
        for a in 0..p {
            let own = &mut w.z[part][a];
            by.mul_add(L::load(&w.row[part][a]), L::load(own)).store(own);
        }
    }
}

/// Takes the two rows of an output, as `row` left them, into its noise spectrum.
#[inline(always)]
fn count<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, k: usize, (m, output): (usize, usize)) {
    let r = &d.records[k];
    let at = output * d.bins.terms.len() + d.bins.of[k][m];
    // Line 0 is real.
    let parts = if r.lines.first + m == 0 { 1 } else { 2 };
    for part in 0..parts {
        w.covariances.spectral.add(at, L::load(&w.squares[part]), L::load(&w.left_over[part]));
    }
    let own = output * d.parameters()..(output + 1) * d.parameters();
    let [re, im] = &w.influence;
    w.covariances.spectral.add_products(at, (&re[own.clone()], &im[own]), L::splat(r.weight[m]));
}
