//! The rows of eight records on the same lines at once, one a lane: what [`Spot`] does for one, with its operations
//! in their order, so that each record has the bits that it has alone.

use super::{DEPENDENT, SILENT, Spot};
use crate::estimate::normal_equations::LeftColumns;
use crate::estimate::terms::complex::{C, Power, late, loaded, times};
use crate::estimate::terms::equations::Equations;
use crate::estimate::terms::lines::{Both, Couple, EightSpectra, Pairs};
use crate::linalg::dense::floor_of;
use crate::linalg::eight::{Panel, back, project, push, squares, whiten, whiten_more};
use crate::simd::{Isa, Kernel, Lanes, Wide};

/// What eight records hold; the rows themselves are those of any of their [`Spot`]s.
#[derive(Default)]
pub(crate) struct Eight {
    pub spectra: EightSpectra,
    /// g of each term, then the slopes.
    values: Vec<Wide>,
    /// L of each equation and noisy signal, and the error of each equation.
    loads: Vec<Both>,
    error: Vec<Both>,
    /// What the lines from m on have with line m: sums of E[Q Q*] and of E[Q Q].
    sums: Vec<[Wide; 4]>,
    /// e^{−s lag} of each late signal on the lines: made outside the kernels, which call no function.
    turns: Vec<Vec<C>>,
    /// Covariance or its factor; transients, residual and columns of θ, whitened. An even number of rows.
    panel: Panel,
    least: Vec<Wide>,
    /// Orthonormal transients.
    base: Vec<Wide>,
    residual: Vec<Wide>,
    pub cost: Wide,
    lambda: Vec<Wide>,
    /// z of each noisy signal.
    pub sources: Vec<Both>,
    denoised: Vec<Both>,
    slopes: Vec<Both>,
    /// Columns of θ, transients taken out.
    columns: Vec<Wide>,
}

/// What is the same for all.
#[derive(Clone, Copy)]
pub(crate) struct Shared<'a> {
    pub equations: &'a Equations,
    pub pairs: &'a Pairs,
    pub spot: &'a Spot,
    pub lags: &'a [f64],
}

impl Eight {
    /// Memory for such records.
    pub fn resize(&mut self, s: Shared<'_>) {
        let Shared { equations: e, pairs, spot, .. } = s;
        let (rows, count, p) = (spot.rows.len(), spot.count(), e.parameters);
        let none = [Wide::ZERO; 2];
        let even = rows.next_multiple_of(2);
        self.values.resize(e.coefficients.results(), Wide::ZERO);
        self.loads.resize(e.orders.len() * pairs.noisy.len() * count, none);
        self.error.resize(e.orders.len() * count, none);
        let turn = |line: usize, lag: f64| {
            late((line + spot.lines.first) as f64 * spot.lines.omega0 * lag)
        };
        let each = s.lags.iter().map(|lag| match *lag {
            0.0 => Vec::new(),
            lag => (0..count).map(|line| turn(line, lag)).collect(),
        });
        self.turns = each.collect();
        self.sums.resize(count, [Wide::ZERO; 4]);
        self.panel.resize(even, columns_of(even, spot) + p);
        self.least.resize(even, Wide::ZERO);
        self.base.resize(spot.transients * rows, Wide::ZERO);
        self.residual.resize(rows, Wide::ZERO);
        self.lambda.resize(rows, Wide::ZERO);
        self.sources.resize(pairs.noisy.len() * count, none);
        self.denoised.resize(e.signals.len() * count, none);
        self.slopes.resize(e.orders.len() * count, none);
        self.columns.resize(p * rows, Wide::ZERO);
    }

    /// Writes a record's signals into its spot.
    pub fn give_signals(&self, lane: usize, spot: &mut Spot) {
        let (count, first) = (spot.count(), spot.lines.first);
        let own = self.spectra.signals.chunks_exact(count);
        spot.spectra.signals.resize_with(own.len(), Default::default);
        for (to, from) in spot.spectra.signals.iter_mut().zip(own) {
            to.clear(first + count);
            for (k, [re, im]) in from.iter().enumerate() {
                (to.re[first + k], to.im[first + k]) = (re.0[lane], im.0[lane]);
            }
        }
    }

    /// Takes a record's coefficients and slopes.
    pub fn set(&mut self, lane: usize, values: &[f64]) {
        self.values.iter_mut().zip(values).for_each(|(to, from)| to.0[lane] = *from);
    }

    /// Whitens the rows and takes out the transients; the weighted sums of squares to `cost`.
    pub fn evaluate(&mut self, isa: Isa, shared: Shared<'_>) {
        isa.run(Evaluate { own: self, s: shared });
    }

    /// Columns ∂/∂θ where they were last evaluated, transients taken out; sources where they are denoised.
    pub fn jacobian(&mut self, isa: Isa, shared: Shared<'_>, factors: LeftColumns) {
        isa.run(Jacobian { own: self, s: shared, factors });
    }

    /// A record's residual, transients taken out.
    pub fn residual(&self, lane: usize) -> impl Iterator<Item = f64> {
        self.residual.iter().map(move |x| x.0[lane])
    }

    /// A record's columns of θ.
    pub fn columns(&self, lane: usize) -> impl Iterator<Item = impl Iterator<Item = f64>> {
        let rows = self.residual.len();
        self.columns.chunks_exact(rows).map(move |c| c.iter().map(move |x| x.0[lane]))
    }

    /// Writes a record's orthonormal transients and its residual into its spot.
    pub fn give_base(&self, lane: usize, spot: &mut Spot) {
        spot.base.truncate(0);
        for q in self.base.chunks_exact(self.residual.len()) {
            spot.base.push_unit(q.iter().map(|x| x.0[lane]));
        }
        spot.residual.clear();
        spot.residual.extend(self.residual(lane));
    }
}

/// Columns before those of θ: rows, transients and residual, whole pairs.
fn columns_of(rows: usize, spot: &Spot) -> usize {
    (rows + spot.transients + 1).next_multiple_of(2)
}

#[inline(always)]
fn stored<L: Lanes>(x: (L, L), to: &mut Both) {
    x.0.store(&mut to[0]);
    x.1.store(&mut to[1]);
}

/// Adds `by` (iω)^k times the values.
#[inline(always)]
fn add_times<L: Lanes>(power: &Power, by: L, values: &[Both], to: &mut [Both]) {
    let (odd, sizes) = power.parts();
    let sign = if odd { -by } else { by };
    for ((to, own), size) in to.iter_mut().zip(values).zip(sizes) {
        let (size, own, sum) = (L::splat(*size), loaded::<L>(own), loaded::<L>(to));
        let (x, y) = if odd { (own.1, own.0) } else { own };
        stored((sum.0 + sign * size * x, sum.1 + by * size * y), to);
    }
}

/// Adds a times the real part of x and c times its imaginary part, b and d likewise.
#[inline(always)]
fn add<L: Lanes>(x: (L, L), (a, b): (L, L), (c, d): (L, L), [re, im]: [&mut Wide; 2]) {
    a.mul_add(x.0, c.mul_add(x.1, L::load(re))).store(re);
    b.mul_add(x.0, d.mul_add(x.1, L::load(im))).store(im);
}

struct Evaluate<'a> {
    own: &'a mut Eight,
    s: Shared<'a>,
}

impl Kernel for Evaluate<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Evaluate { own, s } = self;
        let (rows, nt) = (s.spot.rows.len(), s.spot.transients);
        own.errors::<L>(s);
        own.find_loads::<L>(s);
        own.covariance::<L>(s);
        own.fill::<L>(s);
        let at = own.panel.rows();
        whiten::<L>(&mut own.panel, at + nt + 1, &own.least);
        for c in 0..nt {
            let to = &mut own.base[..(c + 1) * rows];
            let column = own.panel.column(at + c);
            to[c * rows..].iter_mut().zip(column).for_each(|(to, x)| *to = *x);
            push::<L>(to, rows, DEPENDENT);
        }
        let column = own.panel.column(at + nt);
        own.residual.iter_mut().zip(column).for_each(|(to, x)| *to = *x);
        project::<L>(&own.base, &mut own.residual);
        squares::<L>(&own.residual).store(&mut own.cost);
    }
}

impl Eight {
    /// Σ g s^k V of each equation.
    #[inline(always)]
    fn errors<L: Lanes>(&mut self, s: Shared<'_>) {
        let count = s.spot.count();
        self.error.fill([Wide::ZERO; 2]);
        for (term, g) in s.equations.terms.iter().zip(&self.values) {
            let values = &self.spectra.signals[term.signal * count..][..count];
            let to = &mut self.error[term.equation * count..][..count];
            add_times::<L>(&s.spot.powers[term.order], L::load(g), values, to);
        }
    }

    /// How noise on each noisy signal's own coefficient enters each equation: Σ g s^k e^{−s lag}.
    #[inline(always)]
    fn find_loads<L: Lanes>(&mut self, s: Shared<'_>) {
        let (count, noisy) = (s.spot.count(), &s.pairs.noisy);
        self.loads.fill([Wide::ZERO; 2]);
        for (term, g) in s.equations.terms.iter().zip(&self.values) {
            let Some(at) = noisy.iter().position(|s| *s == term.signal) else { continue };
            let (odd, sizes) = s.spot.powers[term.order].parts();
            let to = &mut self.loads[(term.equation * noisy.len() + at) * count..][..count];
            for (to, size) in to.iter_mut().zip(sizes) {
                let part = &mut to[usize::from(odd)];
                (L::load(part) + L::load(g) * L::splat(*size)).store(part);
            }
        }
        for (at, signal) in noisy.iter().enumerate() {
            for equation in 0..s.equations.orders.len() {
                let to = &mut self.loads[(equation * noisy.len() + at) * count..][..count];
                for (to, turn) in to.iter_mut().zip(&self.turns[*signal]) {
                    stored(turned(loaded::<L>(to), *turn), to);
                }
            }
        }
    }

    /// Covariance of the rows, upper triangle.
    #[inline(always)]
    fn covariance<L: Lanes>(&mut self, s: Shared<'_>) {
        let (count, first, q) = (s.spot.count(), s.spot.lines.first, s.equations.orders.len());
        let half = L::splat(0.5);
        // Line 0 has no Im.
        let missing = if first == 0 { q } else { 0 };
        let at = |line: usize| (2 * line * q).saturating_sub(missing);
        for m in 0..count {
            for (a, b) in (0..q * q).map(|k| (k / q, k % q)) {
                self.sums[..count - m].fill([Wide::ZERO; 4]);
                for couple in &s.pairs.couples[a * q + b] {
                    self.add_couple::<L>(s, *couple, m);
                }
                for (l, [dr, di, xr, xi]) in (m..count).zip(&self.sums) {
                    let (d, x) = ((L::load(dr), L::load(di)), (L::load(xr), L::load(xi)));
                    let (row, column) = (at(m) + a, at(l) + b);
                    let panel = &mut self.panel;
                    let mut put = |row: usize, column: usize, value: L| {
                        if column >= row {
                            value.store(panel.at_mut(row, column));
                        }
                    };
                    put(row, column, half * (d.0 + x.0));
                    if l + first > 0 {
                        put(row, column + q, half * (x.1 - d.1));
                    }
                    if m + first > 0 {
                        put(row + q, column, half * (x.1 + d.1));
                        put(row + q, column + q, half * (d.0 - x.0));
                    }
                }
            }
        }
    }

    /// Adds L_i(m) conj(L_j(l) R_ij(l − m)) of the lines l from m on, and of mirrored lines, −l for l,
    /// L_i(m) L_j(l) R_ij(l + m).
    #[inline(always)]
    fn add_couple<L: Lanes>(&mut self, s: Shared<'_>, couple: Couple, m: usize) {
        let (count, first, spectra) = (s.spot.count(), s.spot.lines.first, &self.spectra);
        if spectra.apart[couple.pair] {
            return;
        }
        let (a, b) = loaded::<L>(&self.loads[couple.from * count + m]);
        let to = &self.loads[couple.to * count + m..(couple.to + 1) * count];
        let r = &spectra.pairs[couple.pair * spectra.lags + spectra.middle..];
        let (near, far) = ((b, -a), (-b, a));
        if spectra.white[couple.pair] {
            // White noise has no lag but 0.
            let product = times(loaded::<L>(&to[0]), loaded(&r[0]));
            let [dr, di, xr, xi] = &mut self.sums[0];
            add(product, (a, b), near, [dr, di]);
            if m + first == 0 {
                add(product, (a, b), far, [xr, xi]);
            }
            return;
        }
        let lags = r.iter().zip(&r[2 * (m + first)..]);
        for ((to, (one, other)), [dr, di, xr, xi]) in to.iter().zip(lags).zip(&mut self.sums) {
            let to = loaded::<L>(to);
            add(times(to, loaded(one)), (a, b), near, [dr, di]);
            add(times(to, loaded(other)), (a, b), far, [xr, xi]);
        }
    }

    /// Transient columns, the error beside them, a last row where the rows are odd; the least of the pivots.
    #[inline(always)]
    fn fill<L: Lanes>(&mut self, s: Shared<'_>) {
        let (spot, count) = (s.spot, s.spot.count());
        let (rows, even, nt) = (spot.rows.len(), self.panel.rows(), spot.transients);
        for c in 0..nt {
            let each = self.panel.column_mut(even + c).zip(spot.transient[c..].iter().step_by(nt));
            each.for_each(|(to, t)| *to = Wide::splat(*t));
        }
        let each = self.panel.column_mut(even + nt).zip(&spot.rows);
        each.for_each(|(to, row)| {
            *to = self.error[row.equation * count + row.line][usize::from(row.im)];
        });
        if even > rows {
            for column in 0..even + nt + 1 {
                *self.panel.at_mut(rows, column) = Wide::ZERO;
            }
            self.panel.column_mut(rows).for_each(|to| *to = Wide::ZERO);
            *self.panel.at_mut(rows, rows) = Wide::splat(1.0);
            self.least[rows] = Wide::ZERO;
        }
        let pivot = |i: usize| L::load(self.panel.at(i, i));
        for (i, (to, [a, b])) in self.least.iter_mut().zip(&spot.near).enumerate() {
            let near = L::splat(SILENT) * pivot(*a).max(pivot(*b));
            floor_of(pivot(i)).max(near).store(to);
        }
    }
}

/// The product with one number for all.
#[inline(always)]
fn turned<L: Lanes>(x: (L, L), turn: C) -> (L, L) {
    let (cos, sin) = (L::splat(turn.0), L::splat(turn.1));
    (x.0 * cos - x.1 * sin, x.0 * sin + x.1 * cos)
}

struct Jacobian<'a> {
    own: &'a mut Eight,
    s: Shared<'a>,
    factors: LeftColumns,
}

impl Kernel for Jacobian<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Jacobian { own, s, factors } = self;
        let (count, rows, p) = (s.spot.count(), s.spot.rows.len(), s.equations.parameters);
        own.denoised.copy_from_slice(&own.spectra.signals);
        if factors == LeftColumns::Denoised {
            own.find_sources::<L>(s);
            for signal in 0..s.equations.signals.len() {
                own.denoise::<L>(s, signal);
            }
        }
        let at = columns_of(own.panel.rows(), s.spot);
        let (terms, slopes) = (&s.equations.terms, &own.values[s.equations.terms.len()..]);
        for k in 0..p {
            own.slopes.fill([Wide::ZERO; 2]);
            for ((t, _), slope) in
                s.equations.slopes.iter().zip(slopes).filter(|((_, own), _)| *own == k)
            {
                let term = terms[*t];
                let values = &own.denoised[term.signal * count..][..count];
                let to = &mut own.slopes[term.equation * count..][..count];
                add_times::<L>(&s.spot.powers[term.order], L::load(slope), values, to);
            }
            let column = own.panel.column_mut(at + k);
            for (row, to) in s.spot.rows.iter().zip(column) {
                *to = own.slopes[row.equation * count + row.line][usize::from(row.im)];
            }
        }
        whiten_more::<L>(&mut own.panel, at..at + p);
        for (k, to) in own.columns.chunks_exact_mut(rows).enumerate() {
            let column = own.panel.column(at + k);
            to.iter_mut().zip(column).for_each(|(to, x)| *to = *x);
            project::<L>(&own.base, to);
        }
    }
}

impl Eight {
    /// z_j(l) = Σ over equations of conj(L)(λ_Re + iλ_Im), λ = C⁻¹r, of each noisy signal on the lines.
    #[inline(always)]
    fn find_sources<L: Lanes>(&mut self, s: Shared<'_>) {
        let (count, q) = (s.spot.count(), s.equations.orders.len());
        self.lambda.copy_from_slice(&self.residual);
        back::<L>(&self.panel, &mut self.lambda);
        self.sources.fill([Wide::ZERO; 2]);
        let missing = if s.spot.lines.first == 0 { q } else { 0 };
        for equation in 0..q {
            for &j in &s.pairs.of[equation] {
                let loads = &self.loads[(equation * s.pairs.noisy.len() + j) * count..][..count];
                let to = &mut self.sources[j * count..][..count];
                for (line, (to, load)) in to.iter_mut().zip(loads).enumerate() {
                    let (own, (x, y)) = (loaded::<L>(to), loaded::<L>(load));
                    let at = (2 * line * q).saturating_sub(missing) + equation;
                    let re = L::load(&self.lambda[at]);
                    let sum = if line == 0 && missing > 0 {
                        (own.0 + x * re, own.1 - y * re)
                    } else {
                        let im = L::load(&self.lambda[at + q]);
                        (own.0 + (x * re + y * im), own.1 + (x * im - y * re))
                    };
                    stored(sum, to);
                }
            }
        }
    }

    /// Takes ½ Σ_jl \[R_j(m − l) z_j(l) + R_j(m + l) conj z_j(l)\] from one signal.
    #[inline(always)]
    fn denoise<L: Lanes>(&mut self, s: Shared<'_>, signal: usize) {
        let (count, first, spectra) = (s.spot.count(), s.spot.lines.first, &self.spectra);
        let lags = spectra.lags;
        let (half, places) = (L::splat(0.5), &s.pairs.place[signal]);
        if places.iter().all(Option::is_none) {
            return;
        }
        for m in 0..count {
            let mut sum = (L::splat(0.0), L::splat(0.0));
            for (place, z) in places.iter().zip(self.sources.chunks_exact(count)) {
                let Some(pair) = place.filter(|pair| !spectra.apart[*pair]) else { continue };
                let r = &spectra.pairs[pair * lags..][..lags];
                let middle = spectra.middle;
                if spectra.white[pair] {
                    let (own, near) = (L::load(&r[middle][0]), loaded::<L>(&z[m]));
                    sum = (own.mul_add(near.0, sum.0), own.mul_add(near.1, sum.1));
                    if m + first == 0 {
                        // Line 0 mirrors itself.
                        sum = (own.mul_add(near.0, sum.0), own.mul_add(-near.1, sum.1));
                    }
                    continue;
                }
                let (near, far) = (middle + m + 1 - count, middle + m + 2 * first);
                let (near, far) = (&r[near..near + count], &r[far..far + count]);
                for ((near, far), z) in near.iter().rev().zip(far).zip(z) {
                    let (near, far) = (loaded::<L>(near), loaded::<L>(far));
                    let (x, y) = loaded::<L>(z);
                    sum.0 = y.mul_add(far.1 - near.1, x.mul_add(near.0 + far.0, sum.0));
                    sum.1 = x.mul_add(near.1 + far.1, y.mul_add(near.0 - far.0, sum.1));
                }
            }
            let noise = (half * sum.0, half * sum.1);
            let noise = match self.turns[signal].get(m) {
                Some(turn) => turned(noise, *turn),
                None => noise,
            };
            let to = &mut self.denoised[signal * count + m];
            let own = loaded::<L>(to);
            stored((own.0 - noise.0, own.1 - noise.1), to);
        }
    }
}
