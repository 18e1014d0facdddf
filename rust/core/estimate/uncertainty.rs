//! At the estimate: the transient that belongs to it, cost, and covariance of θ: classical, HC3 and spectral.
//!
//! Every estimator solves Σ_i z_i(γ_i θ + γ₀ᵢ) = 0 over rows i (Re and Im of each line) with instruments z; columns
//! have the transient projected out. With H = (Σ_i z_i γ_i)⁻¹ its covariance is
//!
//! ```text
//! cov θ̂ = H (Σ_i z_i z_iᵀ v_i) Hᵀ,
//! v_i = σ̂² · (variance of the row),  σ̂² = cost / degrees of freedom    classical,
//! v_i = e_i² / (1 − h_i)²                                             HC3,
//! v_i = s(ω_i) · (variance of the row)                                spectral, see `spectral`,
//! ```
//!
//! e_i the residual, h_i the leverage of the row. HC3 assumes nothing about the colour of the noise. Where the
//! instruments are the weighted columns themselves (`awls`, and `ml` with J for Γ) the classical one is σ̂²(J* S⁻¹ J)⁻¹.

use super::covariances::Kinds;
use super::design::Design;
use super::ls::column_value;
use super::normal_equations::{LeftColumns, RowWeights};
use super::pass::{add_parameter_block, lines, prepare, record_system, tiles};
use super::qr_step::Place;
use super::workspace::Workspace;
use crate::linalg::lanes::{eliminate, invert, substitute};
use crate::modulation::Signal;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::structure::Method;

/// Leaves (1 − h) of a row that determines a parameter alone above zero.
pub(crate) const LEVERAGE: f64 = 1e-6;
/// The same for `ls`.
pub(crate) const OBLIQUE_LEVERAGE: f64 = 0.25;

/// Completes estimates: T, cost, and with `covariance` the covariances, in units of the band edge.
pub(crate) fn finish(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    covariance: bool,
) {
    prepare(isa, d, w);
    isa.run(Transients { design: d, space: w });
    isa.run(Information { design: d, space: w, covariance });
    if !covariance {
        return;
    }
    for lane in (0..LANES).filter(|k| live[*k]) {
        mend_inverse(d, w, lane);
    }
    isa.run(Sandwich { design: d, space: w });
}

/// Takes the inverse of one lane from orthogonal factors where its pivots were too small.
pub(crate) fn mend_inverse(d: &Design, w: &mut Workspace, lane: usize) {
    if w.trusted.0[lane] > 0.0 || d.method == Method::Ls {
        return;
    }
    let weights = if d.keeps_flat_weights() { RowWeights::Flat } else { d.final_weights() };
    let at = Place { lane, weights, factors: d.final_factors() };
    w.qr.inverse(d, &w.records, &w.iterates, &mut w.inverse, at);
}

/// Completes T at a given θ: what an iteration started from θ needs.
pub(crate) struct Transients<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
}

impl Kernel for Transients<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        transients::<L>(self.design, self.space, self.design.final_weights());
    }
}

/// Cost and normal matrix of θ on the lines in use, at the current θ and T; with `covariance` also the
/// inverse H that belongs to the estimator's instruments.
pub(crate) struct Information<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
    pub covariance: bool,
}

impl Kernel for Information<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let mut trusted = information::<L>(d, w, d.final_weights());
        if self.covariance {
            let (differenced, flat) = (d.method == Method::Ls, d.keeps_flat_weights());
            if flat {
                flat_information::<L>(d, w, &mut trusted);
            }
            let (normal, size) = match (differenced, flat) {
                (true, _) => (&w.ls_normal, d.ls_size()),
                (_, true) => (&w.square, d.parameters()),
                _ => (&w.gram, d.parameters()),
            };
            invert::<L>(normal, size, &mut w.inverse, &mut w.work, &mut trusted);
        }
        w.trusted = trusted;
    }
}

/// Both covariances from H, the instruments and the residuals.
struct Sandwich<'a> {
    design: &'a Design,
    space: &'a mut Workspace,
}

impl Kernel for Sandwich<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        covariances::<L>(self.design, self.space, self.design.final_weights());
    }
}

/// T of every record by least squares at the current θ.
#[inline(always)]
fn transients<L: Lanes>(d: &Design, w: &mut Workspace, weights: RowWeights) {
    let (nt, size) = (d.transient, d.size());
    let mut trusted = Wide::splat(1.0);
    for k in 0..w.records.len() {
        record_system::<L>(d, w, k, weights, LeftColumns::Data, false);
        let r = &mut w.records[k];
        eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, true, &mut trusted);
        w.unknowns[nt..size].copy_from_slice(&w.iterates.theta.now);
        substitute::<L>(&r.matrix, size, 0..nt, &mut w.unknowns);
        let now = &mut w.iterates.transients[k].now;
        now.copy_from_slice(&w.unknowns[..nt]);
        if r.tie.active {
            r.tie.at::<L>(&w.iterates.theta.now, now);
        }
    }
}

/// Normal matrix of θ with the transient projected out into `gram`, projections and (TᵀWT)⁻¹ a
/// record, and the cost. Columns are denoised for `ml`.
#[inline(always)]
fn information<L: Lanes>(d: &Design, w: &mut Workspace, weights: RowWeights) -> Wide {
    let (p, nt, size) = (d.parameters(), d.transient, d.size());
    let factors = d.final_factors();
    let width = p + 1;
    let mut trusted = Wide::splat(1.0);
    let mut cost = L::splat(0.0);
    w.global[..p * width].fill(Wide::ZERO);
    for k in 0..w.records.len() {
        let c = record_system::<L>(d, w, k, weights, factors, true);
        cost = cost + c;
        let r = &mut w.records[k];
        for i in 0..nt {
            for j in i..nt {
                w.square[i * nt + j] = r.matrix[i * (size + 1) + j];
            }
        }
        if nt > 0 {
            invert::<L>(&w.square, nt, &mut r.transient_inverse, &mut w.work, &mut trusted);
        }
        if r.tie.active {
            for i in 0..r.tie.tied {
                L::splat(0.0).store(&mut r.transient_inverse[i * nt + i]);
            }
        }
        eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, true, &mut trusted);
        project::<L>(&r.matrix, nt, size, &mut r.projection);
        if r.tie.active {
            r.tie.project(&mut r.projection);
        }
        add_parameter_block::<L>(&r.matrix, nt, size, &mut w.global, true);
    }
    cost.store(&mut w.progress.cost);
    for i in 0..p {
        for j in i..p {
            w.gram[i * p + j] = w.global[i * width + j];
            w.gram[j * p + i] = w.global[i * width + j];
        }
    }
    trusted
}

/// (TᵀWT)⁻¹TᵀWJ from the eliminated rows of the transient.
#[inline(always)]
pub(crate) fn project<L: Lanes>(matrix: &[Wide], nt: usize, size: usize, projection: &mut [Wide]) {
    let p = size - nt;
    for c in 0..p {
        for t in (0..nt).rev() {
            let row = &matrix[t * (size + 1)..(t + 1) * (size + 1)];
            let mut sum = L::load(&row[nt + c]);
            for j in t + 1..nt {
                sum = (-L::load(&row[j])).mul_add(L::load(&projection[j * p + c]), sum);
            }
            (sum * L::load(&row[t])).store(&mut projection[t * p + c]);
        }
    }
}

/// Instruments of `wls` at the end: the same rows under flat weights. Their normal matrix into `square`.
#[inline(always)]
fn flat_information<L: Lanes>(d: &Design, w: &mut Workspace, trusted: &mut Wide) {
    let (p, nt, size) = (d.parameters(), d.transient, d.size());
    w.global[..p * (p + 1)].fill(Wide::ZERO);
    for k in 0..w.records.len() {
        record_system::<L>(d, w, k, RowWeights::Flat, LeftColumns::Data, false);
        let r = &mut w.records[k];
        eliminate::<L>(&mut r.matrix, size, 0..nt, &w.diagonal, true, trusted);
        project::<L>(&r.matrix, nt, size, &mut r.flat_projection);
        if r.tie.active {
            r.tie.project(&mut r.flat_projection);
        }
        add_parameter_block::<L>(&r.matrix, nt, size, &mut w.global, true);
    }
    for i in 0..p {
        for j in i..p {
            w.square[i * p + j] = w.global[i * (p + 1) + j];
        }
    }
}

/// Both covariances from H, the instruments z and the residuals: sums of (Hz)(Hz)ᵀ v over the rows.
#[inline(always)]
fn covariances<L: Lanes>(d: &Design, w: &mut Workspace, weights: RowWeights) {
    let p = d.parameters();
    let (differenced, flat) = (d.method == Method::Ls, d.keeps_flat_weights());
    let size = if differenced { d.ls_size() } else { p };
    w.covariances.hc3.fill(Wide::ZERO);
    w.covariances.nonrobust.fill(Wide::ZERO);
    w.covariances.spectral.clear();
    let sandwich = differenced || flat;
    let Kinds { hc3, spectral } = w.covariances.kinds;
    // Leverages of an oblique projection are no fractions: those of `ls` pass one.
    let floor = L::splat(if differenced { OBLIQUE_LEVERAGE } else { LEVERAGE });
    for k in 0..w.records.len() {
        for range in tiles(w.records[k].limit, d.tile) {
            lines::<L>(d, w, k, range.clone(), weights, true);
            for (i, m) in range.enumerate() {
                let weight = L::load(&w.weights[i]);
                projected_row::<L>(d, w, k, m, i);
                instruments::<L>(d, w, k, m, weight, differenced, flat);
                let own = transient_leverage::<L>(d, w, k, m);
                let (h_re, h_im) = influence::<L>(w, size, size - p);
                let (e_re, e_im) = (L::load(&w.residual_re[i]), L::load(&w.residual_im[i]));
                let left =
                    freedom((own.0.mul_add(weight, h_re), own.1.mul_add(weight, h_im)), floor);
                if hc3 {
                    let f = deleted((e_re, e_im), left);
                    outer::<L>(&w.influence_re, &w.influence_im, f, p, &mut w.covariances.hc3);
                }
                let v = L::splat(1.0) / weight;
                if sandwich {
                    outer::<L>(
                        &w.influence_re,
                        &w.influence_im,
                        (v, v),
                        p,
                        &mut w.covariances.nonrobust,
                    );
                }
                if !spectral {
                    continue;
                }
                let bin = d.bins.of[k][m];
                let square = e_im.mul_add(e_im, e_re * e_re) * weight;
                let left = if d.records[k].lines.first + m == 0 { left.0 } else { left.0 + left.1 };
                w.covariances.spectral.add(bin, square, left);
                w.covariances.spectral.add_products(bin, (&w.influence_re, &w.influence_im), v);
            }
        }
    }
    mirror(p, &mut w.covariances.hc3);
    let variance = L::load(&w.progress.cost) * L::splat(1.0 / d.degrees_of_freedom() as f64);
    if sandwich {
        for own in &mut w.covariances.nonrobust {
            (L::load(own) * variance).store(own);
        }
        mirror(p, &mut w.covariances.nonrobust);
    } else {
        scale::<L>(variance, &w.inverse, &mut w.covariances.nonrobust);
    }
}

/// A covariance for noise of another variance than 1.
#[inline(always)]
pub(crate) fn scale<L: Lanes>(variance: L, unit: &[Wide], cov: &mut [Wide]) {
    for (to, unit) in cov.iter_mut().zip(unit) {
        (L::load(unit) * variance).store(to);
    }
}

/// What the leverages of the two rows of a line leave of them.
#[inline(always)]
pub(crate) fn freedom<L: Lanes>(h: (L, L), floor: L) -> (L, L) {
    ((L::splat(1.0) - h.0).max(floor), (L::splat(1.0) - h.1).max(floor))
}

/// Squares of the residuals that an estimate without the row would have.
#[inline(always)]
pub(crate) fn deleted<L: Lanes>(e: (L, L), left: (L, L)) -> (L, L) {
    let scaled = (e.0 / left.0, e.1 / left.1);
    (scaled.0 * scaled.0, scaled.1 * scaled.1)
}

/// The lower triangle as the upper one.
pub(crate) fn mirror(size: usize, cov: &mut [Wide]) {
    for i in 0..size {
        for j in 0..i {
            cov[i * size + j] = cov[j * size + i];
        }
    }
}

/// θ columns of one line less their projection on the transient, into `row_re`, `row_im`.
#[inline(always)]
fn projected_row<L: Lanes>(d: &Design, w: &mut Workspace, k: usize, m: usize, i: usize) {
    let (rd, r) = (&d.records[k], &w.records[k]);
    let (p, nt) = (d.parameters(), d.transient);
    for (c, column) in d.columns[nt..].iter().enumerate() {
        let (re, im) = match column.signal {
            Signal::U(input) => {
                let at = (1 + input) * r.lines + m;
                (L::load(&r.re[at]), L::load(&r.im[at]))
            }
            _ if d.final_factors() == LeftColumns::Denoised => {
                (L::load(&w.hat_re[i]), L::load(&w.hat_im[i]))
            }
            _ => (L::load(&r.re[m]), L::load(&r.im[m])),
        };
        let (mut re, mut im) = column_value::<L>(column, rd.x[m], re, im);
        for (t, own) in d.columns[..nt].iter().enumerate() {
            let value = L::splat(-rd.transient[t * rd.x.len() + m]);
            let by = L::load(&r.projection[t * p + c]);
            if own.phase % 2 == 0 {
                re = value.mul_add(by, re);
            } else {
                im = value.mul_add(by, im);
            }
        }
        re.store(&mut w.row_re[c]);
        im.store(&mut w.row_im[c]);
    }
}

/// What the estimator weighs this line by, into `z_re`, `z_im`.
#[inline(always)]
fn instruments<L: Lanes>(
    d: &Design,
    w: &mut Workspace,
    k: usize,
    m: usize,
    weight: L,
    differenced: bool,
    flat: bool,
) {
    let (rd, r) = (&d.records[k], &w.records[k]);
    let (p, nt) = (d.parameters(), d.transient);
    if differenced {
        let size = d.ls_size();
        let from = &r.instruments[m * 2 * size..(m + 1) * 2 * size];
        w.z_re[..size].copy_from_slice(&from[..size]);
        w.z_im[..size].copy_from_slice(&from[size..]);
        return;
    }
    for c in 0..p {
        let (mut re, mut im) = (L::load(&w.row_re[c]), L::load(&w.row_im[c]));
        let mut scale = weight;
        if flat {
            // From the projection under the final weights to the one under flat weights.
            scale = L::splat(rd.weight[m]);
            for (t, own) in d.columns[..nt].iter().enumerate() {
                let value = L::splat(rd.transient[t * rd.x.len() + m]);
                let by = L::load(&r.projection[t * p + c]) - L::load(&r.flat_projection[t * p + c]);
                if own.phase % 2 == 0 {
                    re = value.mul_add(by, re);
                } else {
                    im = value.mul_add(by, im);
                }
            }
        }
        (re * scale).store(&mut w.z_re[c]);
        (im * scale).store(&mut w.z_im[c]);
    }
}

/// t (TᵀWT)⁻¹ tᵀ of the two rows of a line.
#[inline(always)]
fn transient_leverage<L: Lanes>(d: &Design, w: &Workspace, k: usize, m: usize) -> (L, L) {
    let (rd, r, nt) = (&d.records[k], &w.records[k], d.transient);
    let mut own = (L::splat(0.0), L::splat(0.0));
    for i in 0..nt {
        for j in 0..nt {
            let (a, b) = (d.columns[i].phase % 2, d.columns[j].phase % 2);
            if a != b {
                continue;
            }
            let value =
                L::splat(rd.transient[i * rd.x.len() + m] * rd.transient[j * rd.x.len() + m]);
            let by = L::load(&r.transient_inverse[i * nt + j]);
            if a == 0 {
                own.0 = value.mul_add(by, own.0);
            } else {
                own.1 = value.mul_add(by, own.1);
            }
        }
    }
    own
}

/// Influence Hz of the two rows of a line on θ, and their leverages γHz; trend columns of `ls` vanish in γ.
#[inline(always)]
fn influence<L: Lanes>(w: &mut Workspace, size: usize, extra: usize) -> (L, L) {
    let mut h = (L::splat(0.0), L::splat(0.0));
    for i in extra..size {
        let mut s = (L::splat(0.0), L::splat(0.0));
        for j in 0..size {
            let by = L::load(&w.inverse[i * size + j]);
            s.0 = by.mul_add(L::load(&w.z_re[j]), s.0);
            s.1 = by.mul_add(L::load(&w.z_im[j]), s.1);
        }
        s.0.store(&mut w.influence_re[i - extra]);
        s.1.store(&mut w.influence_im[i - extra]);
        h.0 = s.0.mul_add(L::load(&w.row_re[i - extra]), h.0);
        h.1 = s.1.mul_add(L::load(&w.row_im[i - extra]), h.1);
    }
    h
}

/// sum += s sᵀ f for the real and the imaginary row, upper triangle.
#[inline(always)]
fn outer<L: Lanes>(re: &[Wide], im: &[Wide], f: (L, L), size: usize, sum: &mut [Wide]) {
    for i in 0..size {
        let (a, b) = (L::load(&re[i]) * f.0, L::load(&im[i]) * f.1);
        for j in i..size {
            let s = &mut sum[i * size + j];
            let own = b.mul_add(L::load(&im[j]), L::load(s));
            a.mul_add(L::load(&re[j]), own).store(s);
        }
    }
}

/// Weighted residuals of every line (unit variance times σ), for a single fit.
pub(crate) struct Residuals<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
    pub out: &'a mut Vec<Vec<[Wide; 2]>>,
}

impl Kernel for Residuals<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        for k in 0..w.records.len() {
            let mut all = vec![[Wide::ZERO; 2]; w.records[k].limit];
            for range in tiles(w.records[k].limit, d.tile) {
                lines::<L>(d, w, k, range.clone(), d.final_weights(), true);
                for (i, m) in range.enumerate() {
                    let root = L::load(&w.weights[i]).sqrt();
                    (root * L::load(&w.residual_re[i])).store(&mut all[m][0]);
                    (root * L::load(&w.residual_im[i])).store(&mut all[m][1]);
                }
            }
            self.out.push(all);
        }
    }
}
