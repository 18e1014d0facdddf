//! Noise that drives the system: `ml` where the spectrum of the noise depends on θ.
//!
//! A(s)Y = B(s)U + T + G(s)W on the lines, A a square matrix: as many equations as outputs. With noise W of densities Q beside
//! white noise of variances σ² on the samples, r = AY − BU − T has the covariance h_m S_m in Re and in Im of line m,
//!
//! ```text
//! S_m = v A diag(σ²) Aᴴ + G diag(Q) Gᴴ/T      (v the variance of a coefficient under unit noise, T the record's duration),
//! ```
//!
//! and the outputs about the model's response h_m P_m, P = A⁻¹ S A⁻ᴴ. The estimate solves, for each unknown a of (θ, σ², Q) and
//! with the transient at its best,
//!
//! ```text
//! Σ_m tr(P⁻¹ ∂_a P (k_m − ℓ_m − P⁻¹ Δ_m Δ_mᴴ/h)) + 2 Σ_m Re r_mᴴ (h S)⁻¹ ∂_a r̂_m = 0,
//! ```
//!
//! Δ = A⁻¹r the outputs without the response, r̂ the residual with the model's own response for Y, k_m the real rows of
//! an output on line m, ℓ_m the leverage that the columns of transient and θ have in them. Without ℓ these are the equations
//! of maximum likelihood, whose term Σ k log det P no estimate with σ² and Q can do without. A squared residual is
//! expected to be k − ℓ, not k: with ℓ the equations hold on average at the truth, which takes out most of the bias of
//! few lines, as degrees of freedom do for a single level. Where Q is 0 they are `ml` under output noise with
//! σ̂² = cost/degrees of freedom. Without σ² it is white noise in the equations.
//!
//! Where A is singular, on line 0 of an integrator, r = −BU − T does not depend on the output: that line tells of S alone,
//! so A⁻¹ is 0 there and |det A|² a constant.

mod hold;
mod known;
pub(crate) mod output;
mod search;
mod small;
mod worth;

use super::prior::Prior;
use crate::covariance::FLOOR;
use crate::linalg::columns::Columns;
use crate::math::ln_1;
use crate::simd::Isa;
use known::Known;
pub(crate) use small::{C, plus, times};
use small::{add_outer, apply, by, colour, conjugate, factor, gather, invert, spread, whiten};

/// Least of a line's rows that leverage leaves: below what a line without noise has beside the others.
const LEFT: f64 = 1e-12;

/// One record on its lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampled {
    pub lines: usize,
    /// Whether the first of these is line 0, which has no imaginary part.
    pub from_zero: bool,
    /// Variance of a coefficient under unit noise of the samples, and under unit noise of the equations.
    pub variances: [f64; 2],
}

/// What is fitted: equations that are linear in the outputs, on the lines of records. Where nothing else is said, one
/// equation with one noise as it comes.
pub(crate) trait Linear {
    /// Outputs, as many as equations.
    fn outputs(&self) -> usize {
        1
    }
    /// Parameters θ.
    fn parameters(&self) -> usize;
    /// Columns of the transient of a record.
    fn transients(&self) -> usize;
    /// Records.
    fn records(&self) -> usize;
    /// One of them.
    fn record(&self, record: usize) -> Sampled;
    /// Noises that drive the equations.
    fn noises(&self) -> usize {
        1
    }
    /// Whether the samples have noise, too.
    fn measured(&self) -> bool;
    /// Least and most of a parameter.
    fn bounds(&self, _parameter: usize) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
    /// What is known of parameters beforehand.
    fn priors(&self) -> &[Prior] {
        &[]
    }
    /// Makes ready for lines at θ.
    fn set(&mut self, theta: &[f64]);
    /// A, r = AY − BU, and the sum of sizes in each entry of A.
    fn line(&self, record: usize, line: usize, a: &mut [C], r: &mut [C], sizes: &mut [f64]);
    /// ∂A and ∂r by a parameter, the latter where `noise` is taken from the outputs. Whether A depends on it.
    fn slope(
        &self,
        record: usize,
        line: usize,
        parameter: usize,
        noise: &[C],
        a: &mut [C],
        r: &mut [C],
    ) -> bool;
    /// How one of the noises enters the equations: a column of G.
    fn enters(&self, _record: usize, _line: usize, _noise: usize, to: &mut [C]) {
        to[0] = (1.0, 0.0);
    }
    /// ∂G by a parameter, alike; whether it depends on that.
    fn enters_slope(
        &self,
        _record: usize,
        _line: usize,
        _parameter: usize,
        _noise: usize,
        _to: &mut [C],
    ) -> bool {
        false
    }
    /// A column of the transient in each equation.
    fn transient(&self, record: usize, line: usize, column: usize, to: &mut [C]);
    /// Its derivative by a parameter; whether it depends on that.
    fn transient_slope(
        &self,
        _record: usize,
        _line: usize,
        _column: usize,
        _parameter: usize,
        _to: &mut [C],
    ) -> bool {
        false
    }
}

/// Rows of one record: Re of the first output on all lines, then Im, then the other outputs, in whole blocks of eight.
#[derive(Debug, Clone)]
struct Block {
    transient: Columns,
    /// Its coefficients at the point that was evaluated.
    ends: Vec<f64>,
    row: usize,
    rows: usize,
    /// Place of its first line among all.
    line: usize,
    sampled: Sampled,
}

/// What is known of a line besides matrices.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    /// k, the real rows of an output: 1 on line 0, else 2, which is 1/h.
    count: f64,
    /// log det P.
    log_p: f64,
    /// k − ℓ, the mean over outputs.
    left: f64,
    /// |r|² under (hS)⁻¹.
    misfit: f64,
    /// Least |det A|², that of the first θ: 0 before it is known.
    least: f64,
    /// Whether A is singular: on line 0 of an integrator, where no output enters the equation.
    silent: bool,
}

/// What was found, in the model's units.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    pub theta: Vec<f64>,
    /// σ² of each output, then Q of each noise.
    pub levels: Vec<f64>,
    /// Covariance of θ and levels, row major; 0 beside what is 0.
    pub cov: Vec<f64>,
    /// Part of each output's misfit that process noise is, and its standard error.
    pub shares: Vec<(f64, f64)>,
    /// Whitened rows.
    pub residual: Vec<f64>,
}

/// Memory of one estimate.
#[derive(Debug, Clone)]
pub(crate) struct Driven {
    outputs: usize,
    noises: usize,
    parameters: usize,
    blocks: Vec<Block>,
    lines: Vec<Line>,
    /// A, its inverse and the lower factor of S of each line.
    a: Vec<C>,
    inverse: Vec<C>,
    lower: Vec<C>,
    /// Whitened columns of θ without the transient: made orthonormal, and as they are.
    mean: Columns,
    jacobian: Vec<f64>,
    /// L⁻¹A ∂P AᴴL⁻ᴴ of each unknown and line, as real numbers; 0 by levels that are held.
    slopes: Vec<f64>,
    /// The same for (k − ℓ) − the residual's own.
    over: Vec<f64>,
    /// Columns of the step: those of the rows, above those of their variances.
    scoring: Columns,
    /// Whitened residual.
    residual: Vec<f64>,
    rows: Vec<f64>,
    coefficients: Vec<f64>,
    step: Vec<f64>,
    last: Vec<f64>,
    joint: Vec<f64>,
    sandwich: Vec<f64>,
    held: Vec<bool>,
    known: Known,
    space: Workspace,
}

/// Matrices and columns of one line.
#[derive(Debug, Clone)]
struct Workspace {
    a: Vec<C>,
    work: Vec<C>,
    sizes: Vec<f64>,
    r: Vec<C>,
    e: Vec<C>,
    noise: Vec<C>,
    slope: Vec<C>,
    x: Vec<C>,
    y: Vec<C>,
    z: Vec<C>,
}

impl Driven {
    /// Room for estimates of one model.
    pub fn new(model: &impl Linear, isa: Isa) -> Driven {
        let (q, p) = (model.outputs(), model.parameters());
        let unknowns = p + q + model.noises();
        let (mut row, mut line, mut blocks) = (0, 0, Vec::new());
        for k in 0..model.records() {
            let sampled = model.record(k);
            let rows = (2 * q * sampled.lines).next_multiple_of(8);
            let transient = Columns::new(isa, rows, model.transients());
            let ends = vec![0.0; model.transients()];
            blocks.push(Block { transient, ends, row, rows, line, sampled });
            (row, line) = (row + rows, line + sampled.lines);
        }
        let known = Known::new(model.priors());
        let more = known.rows();
        let all = row + (line * q * q).next_multiple_of(8) + more;
        let count = |own: &Block, i: usize| if own.sampled.from_zero && i == 0 { 1.0 } else { 2.0 };
        let lines =
            blocks.iter().flat_map(|own| (0..own.sampled.lines).map(move |i| count(own, i)));
        let lines = lines.map(|count| Line { count, ..Line::default() }).collect();
        let zero = (0.0, 0.0);
        let column = || vec![zero; q];
        Driven {
            outputs: q,
            noises: model.noises(),
            parameters: p,
            blocks,
            lines,
            a: vec![zero; line * q * q],
            inverse: vec![zero; line * q * q],
            lower: vec![zero; line * q * q],
            mean: Columns::new(isa, row + more, p),
            jacobian: vec![0.0; row * p],
            slopes: vec![0.0; line * q * q * unknowns],
            over: vec![0.0; line * q * q],
            scoring: Columns::new(isa, all, unknowns),
            residual: vec![0.0; row],
            rows: vec![0.0; all],
            coefficients: vec![0.0; unknowns.max(model.transients())],
            step: vec![0.0; unknowns],
            last: vec![0.0; unknowns],
            joint: vec![0.0; unknowns * unknowns],
            sandwich: vec![0.0; p * p],
            held: vec![false; unknowns],
            known,
            space: Workspace {
                a: vec![zero; q * q],
                work: vec![zero; q * q],
                sizes: vec![0.0; q * q],
                r: column(),
                e: column(),
                noise: column(),
                slope: column(),
                x: column(),
                y: column(),
                z: column(),
            },
        }
    }

    fn unknowns(&self) -> usize {
        self.parameters + self.outputs + self.noises
    }

    /// Residual at a point with the transient at its best, and what belongs to the lines. Returns the criterion.
    fn evaluate(&mut self, model: &mut impl Linear, theta: &[f64], levels: &[f64]) -> f64 {
        model.set(theta);
        self.known.set(theta);
        let mut criterion = self.known.distance();
        let q = self.outputs;
        let Workspace { a, work, sizes, r, x, .. } = &mut self.space;
        for (k, block) in self.blocks.iter_mut().enumerate() {
            let [unit, inside] = block.sampled.variances;
            let count = block.sampled.lines;
            let rows = &mut self.residual[block.row..][..block.rows];
            rows.fill(0.0);
            for i in 0..count {
                let at = (block.line + i) * q * q;
                model.line(k, i, a, r, sizes);
                self.a[at..at + q * q].copy_from_slice(a);
                let s = &mut self.lower[at..at + q * q];
                s.fill((0.0, 0.0));
                let mut least = 1.0;
                for e in 0..q {
                    let mut largest = 0.0f64;
                    for l in 0..q {
                        let level = unit * levels[l];
                        let size = sizes[e * q + l];
                        largest = largest.max(size);
                        s[e * q + e].0 += FLOOR * level * size * size;
                        for f in 0..=e {
                            let own = &mut s[e * q + f];
                            *own = plus(*own, by(a[e * q + l], level), conjugate(a[f * q + l]));
                        }
                    }
                    least *= largest * largest;
                }
                for (noise, level) in levels[q..].iter().enumerate() {
                    model.enters(k, i, noise, x);
                    for e in 0..q {
                        for f in 0..=e {
                            let own = &mut s[e * q + f];
                            *own = plus(*own, by(x[e], inside * level), conjugate(x[f]));
                        }
                    }
                }
                let det_s = factor(s, q);
                let inverse = &mut self.inverse[at..at + q * q];
                work.copy_from_slice(a);
                let det_a = invert(work, q, inverse);
                let own = &mut self.lines[block.line + i];
                if own.least == 0.0 {
                    own.least = FLOOR * least;
                }
                own.silent = det_a == 0.0;
                let size = det_a.max(own.least);
                inverse.iter_mut().for_each(|own| *own = by(*own, det_a / size));
                own.log_p = ln_1(det_s / size);
                whiten(s, r);
                spread(r, own.count, rows, (count, i));
            }
            block.transient.truncate(0);
            for j in 0..model.transients() {
                let lower = self.lower[block.line * q * q..].chunks(q * q);
                let lines = &self.lines[block.line..];
                block.transient.push(|column| {
                    for (i, (lower, own)) in lower.zip(lines).take(count).enumerate() {
                        model.transient(k, i, j, x);
                        whiten(lower, x);
                        spread(x, own.count, column, (count, i));
                    }
                });
            }
            criterion += block.transient.project(0, rows, &mut block.ends);
            block.transient.back(0, &mut block.ends);
            for (i, own) in self.lines[block.line..][..count].iter_mut().enumerate() {
                own.misfit = (0..2 * q).map(|e| rows[e * count + i] * rows[e * count + i]).sum();
                criterion += own.left * own.log_p;
            }
        }
        criterion
    }

    /// Columns of θ at the point that was evaluated, leverages, and what a step is made of.
    fn linearise(&mut self, model: &impl Linear, theta: &[f64], levels: &[f64]) {
        let (q, p, all) = (self.outputs, self.parameters, self.residual.len());
        let size = q * q;
        let part = self.lines.len() * size;
        self.slopes.fill(0.0);
        let Workspace { a, r, e, noise, slope, x, y, z, .. } = &mut self.space;
        for (k, block) in self.blocks.iter().enumerate() {
            let [unit, inside] = block.sampled.variances;
            let count = block.sampled.lines;
            for i in 0..count {
                let (place, own) = (block.line + i, self.lines[block.line + i]);
                let at = place * size;
                let (lower, inverse) = (&self.lower[at..][..size], &self.inverse[at..][..size]);
                gather(&self.residual[block.row..], own.count, e, (count, i));
                colour(lower, e, r);
                apply(inverse, r, noise);
                for j in 0..p {
                    let depends = model.slope(k, i, j, noise, a, slope);
                    for (column, end) in block.ends.iter().enumerate() {
                        if model.transient_slope(k, i, column, j, x) {
                            for (to, x) in slope.iter_mut().zip(&*x) {
                                *to = (to.0 - end * x.0, to.1 - end * x.1);
                            }
                        }
                    }
                    whiten(lower, slope);
                    let column = &mut self.jacobian[j * all + block.row..][..block.rows];
                    spread(slope, own.count, column, (count, i));
                    // L⁻¹((∂G − ∂A A⁻¹ G) Q Gᴴ + …)L⁻ᴴ, a column of G at a time.
                    for (l, level) in levels[q..].iter().enumerate().filter(|(_, q)| **q > 0.0) {
                        let enters = model.enters_slope(k, i, j, l, slope);
                        if !(depends || enters) {
                            continue;
                        }
                        model.enters(k, i, l, y);
                        x.fill((0.0, 0.0));
                        if depends {
                            apply(inverse, y, z);
                            apply(a, z, x);
                        }
                        for (x, own) in x.iter_mut().zip(&*slope) {
                            *x = if enters { (own.0 - x.0, own.1 - x.1) } else { (-x.0, -x.1) };
                        }
                        whiten(lower, x);
                        whiten(lower, y);
                        let to = &mut self.slopes[j * part + at..][..size];
                        add_outer(x, y, 2.0 * inside * level, to);
                    }
                }
                for l in (0..q).filter(|_| model.measured()) {
                    for (e, to) in x.iter_mut().enumerate() {
                        *to = self.a[at + e * q + l];
                    }
                    whiten(lower, x);
                    add_outer(x, x, unit, &mut self.slopes[(p + l) * part + at..][..size]);
                }
                for l in 0..levels.len() - q {
                    model.enters(k, i, l, x);
                    whiten(lower, x);
                    let to = &mut self.slopes[(p + q + l) * part + at..][..size];
                    add_outer(x, x, inside, to);
                }
            }
        }
        self.mean.truncate(0);
        for j in 0..p {
            let column = &mut self.jacobian[j * all..][..all];
            for block in &self.blocks {
                let rows = &mut column[block.row..][..block.rows];
                block.transient.project(0, rows, &mut self.coefficients[..block.transient.count()]);
            }
            let known = &self.known;
            self.mean.push(|to| {
                to[..all].copy_from_slice(column);
                known.column(j, &mut to[all..]);
            });
        }
        self.leverages();
        self.hold(model, theta, levels);
        self.scoring.truncate(0);
        for unknown in 0..self.unknowns() {
            let free = !self.held[unknown];
            let (jacobian, slopes) = (&self.jacobian, &mut self.slopes[unknown * part..][..part]);
            if !free {
                slopes.fill(0.0);
            }
            let slopes = &*slopes;
            let (lines, known) = (&self.lines, &self.known);
            self.scoring.push(|to| {
                let (mean, rest) = to.split_at_mut(all);
                let (variance, beneath) = rest.split_at_mut(rest.len() - known.rows());
                if free {
                    known.column(unknown, beneath);
                }
                if unknown < p && free {
                    mean.copy_from_slice(&jacobian[unknown * all..][..all]);
                }
                let each = variance.chunks_mut(size).zip(slopes.chunks(size)).zip(lines);
                for ((to, slopes), own) in each {
                    let root = (0.5 * own.left).sqrt();
                    to.iter_mut().zip(slopes).for_each(|(to, slope)| *to = root * slope);
                }
            });
        }
    }
}
