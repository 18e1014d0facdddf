//! `ls`: least squares on the differenced rows, in one shot (report, eqs. 14–19).
//!
//! With Q(m; θ) = A(s)Y(m) − B(s)U(m), s = imω₀, and Δⁿ of eq. (10), which annihilates the transient, the criterion
//! is eq. (17),
//!
//! ```text
//! J(θ) = Σ_m |Δⁿ Q(m; θ)|² = |γ₀ + Γθ|²,
//! ```
//!
//! γ₀ = Δⁿ sⁿY and Γ the columns Δⁿ s^{n−j}Y and −Δⁿ s^{n−j}U (eqs. 15, 16), Re and Im stacked (eq. 18). Its
//! minimiser is eq. (19),
//!
//! ```text
//! θ̂ = −(ΓᵀΓ)⁻¹ Γᵀγ₀.
//! ```
//!
//! The report counts the coefficients of A negative, which is the sign here. A trend adds columns in front of θ.

use super::design::Design;
use super::workspace::Workspace;
use crate::linalg::lanes::{eliminate, substitute};
use crate::modulation::{Column, Signal};
use crate::simd::{Kernel, Lanes, Wide};

/// Forms the rows Δⁿ and solves their normal equations for θ, trends first.
///
/// Line 0 carries an unknown constant: it becomes a column of its own rather than a lower band edge,
/// which would cost 40 % of standard deviation.
pub(crate) struct LsStep<'a> {
    pub design: &'a Design,
    pub space: &'a mut Workspace,
}

impl Kernel for LsStep<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let size = d.ls_size();
        let width = size + 1;
        w.global.fill(Wide::ZERO);
        for k in 0..w.records.len() {
            columns_on_lines::<L>(d, w, k);
            w.records[k].instruments.fill(Wide::ZERO);
            let rows = d.records[k].rows;
            for m in rows.first..=rows.last {
                differenced_row::<L>(d, w, k, m);
                if m == rows.first && rows.first_is_real {
                    w.row_im.fill(Wide::ZERO);
                }
                for i in 0..size {
                    let (a, b) = (L::load(&w.row_re[i]), L::load(&w.row_im[i]));
                    for j in i..width {
                        let sum = &mut w.global[i * width + j];
                        let im = b.mul_add(L::load(&w.row_im[j]), L::load(sum));
                        a.mul_add(L::load(&w.row_re[j]), im).store(sum);
                    }
                }
                scatter::<L>(d, w, k, m);
            }
        }
        solve::<L>(w, size, d.parameters());
    }
}

/// Solves the normal equations that stand in `global`, and keeps them.
#[inline(always)]
pub(crate) fn solve<L: Lanes>(w: &mut Workspace, size: usize, parameters: usize) {
    let width = size + 1;
    for i in 0..size {
        let right = &mut w.global[i * width + size];
        (-L::load(right)).store(right);
        w.diagonal[i] = w.global[i * width + i];
    }
    for i in 0..size {
        for j in 0..size {
            w.ls_normal[i * size + j] = w.global[i.min(j) * width + i.max(j)];
        }
    }
    w.trusted = Wide::splat(1.0);
    eliminate::<L>(&mut w.global, size, 0..size, &w.diagonal, true, &mut w.trusted);
    substitute::<L>(&w.global, size, 0..size, &mut w.unknowns);
    w.iterates.theta.now.copy_from_slice(&w.unknowns[size - parameters..size]);
}

/// Value of a column on a line: sign · i^phase · x^power · V.
#[inline(always)]
pub(crate) fn column_value<L: Lanes>(c: &Column, x: f64, re: L, im: L) -> (L, L) {
    let power = (0..c.power).fold(c.sign, |v, _| v * x);
    let v = L::splat(power);
    match c.phase {
        0 => (v * re, v * im),
        1 => (-(v * im), v * re),
        2 => (-(v * re), -(v * im)),
        _ => (v * im, -(v * re)),
    }
}

/// Writes (trend, θ, target) columns of record `k` on its lines.
#[inline(always)]
fn columns_on_lines<L: Lanes>(d: &Design, w: &mut Workspace, k: usize) {
    let (rd, r) = (&d.records[k], &mut w.records[k]);
    let trends = d.ls_trends();
    let width = d.ls_size() + 1;
    for (m, x) in rd.x.iter().enumerate() {
        let out = &mut r.differenced[m * 2 * width..(m + 1) * 2 * width];
        out.fill(Wide::ZERO);
        if d.trend == crate::structure::Trend::Linear {
            out[width + trends - 1] = Wide::splat(rd.transient[(d.transient - 1) * rd.x.len() + m]);
        }
        let theta = &d.columns[d.transient..];
        for (c, column) in theta.iter().chain([&d.target]).enumerate() {
            let at = match column.signal {
                Signal::U(input) => (1 + input) * r.lines + m,
                _ => m,
            };
            let (re, im) = column_value::<L>(column, *x, L::load(&r.re[at]), L::load(&r.im[at]));
            re.store(&mut out[trends + c]);
            im.store(&mut out[width + trends + c]);
        }
    }
}

/// Line that row m reaches with step j: its index, and whether it is mirrored; `None` for line 0 left out.
#[inline(always)]
pub(crate) fn reach(first: usize, line: isize) -> Option<(usize, bool)> {
    (line.unsigned_abs() >= first).then(|| (line.unsigned_abs() - first, line < 0))
}

/// Line that a step with this coefficient leads back to, and the coefficient of Im there, where line 0 has no datum.
#[inline(always)]
pub(crate) fn reach_back(first: usize, line: isize, c: f64) -> Option<(usize, f64)> {
    let (at, mirrored) = reach(first, line)?;
    let sign = match line {
        0 => 0.0,
        _ if mirrored => -c,
        _ => c,
    };
    Some((at, sign))
}

/// Δⁿ of all columns at m into `row_re`, `row_im`.
#[inline(always)]
fn differenced_row<L: Lanes>(d: &Design, w: &mut Workspace, k: usize, m: isize) {
    let width = d.ls_size() + 1;
    let first = d.records[k].lines.first;
    w.row_re[..width].fill(Wide::ZERO);
    w.row_im[..width].fill(Wide::ZERO);
    for (j, c) in d.differences.iter().enumerate() {
        let line = m + j as isize;
        let Some((at, mirrored)) = reach(first, line) else {
            // The unknown constant's own column.
            w.row_re[0] = Wide::splat(*c);
            continue;
        };
        let from = &w.records[k].differenced[at * 2 * width..(at + 1) * 2 * width];
        let (c_re, c_im) = (L::splat(*c), L::splat(if mirrored { -*c } else { *c }));
        for i in 0..width {
            c_re.mul_add(L::load(&from[i]), L::load(&w.row_re[i])).store(&mut w.row_re[i]);
            c_im.mul_add(L::load(&from[width + i]), L::load(&w.row_im[i])).store(&mut w.row_im[i]);
        }
    }
}

/// Adds Δⁿ transposed of the row to the instruments: z = DᵀDΓ, what the estimate weighs the lines by.
#[inline(always)]
fn scatter<L: Lanes>(d: &Design, w: &mut Workspace, k: usize, m: isize) {
    let size = d.ls_size();
    let first = d.records[k].lines.first;
    for (j, c) in d.differences.iter().enumerate() {
        let Some((at, sign)) = reach_back(first, m + j as isize, *c) else { continue };
        let to = &mut w.records[k].instruments[at * 2 * size..(at + 1) * 2 * size];
        let (c_re, c_im) = (L::splat(*c), L::splat(sign));
        for i in 0..size {
            c_re.mul_add(L::load(&w.row_re[i]), L::load(&to[i])).store(&mut to[i]);
            c_im.mul_add(L::load(&w.row_im[i]), L::load(&to[size + i])).store(&mut to[size + i]);
        }
    }
}
