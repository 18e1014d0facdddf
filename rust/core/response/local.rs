//! The neighbourhoods of eight frequencies: packed into lanes, fitted, and taken apart again (report, section 4.9).
//!
//! On the lines near ω, with the distance x = (ω_m − ω)/(half width), degree d, and B, T, A polynomials in x, A(0) = 1:
//!
//! ```text
//! modulating:  minimise Σ_m |Δ^{d+1}(Y − B(x)U)|²,
//! polynomial:  minimise Σ_m |Y − B(x)U − T(x)|²,
//! rational:    minimise Σ_m |A(x)Y − B(x)U − T(x)|² w_m,   w = 1, or 1/|A|² (`awls`, `ml`).
//! ```
//!
//! The response at ω is B(0).

mod noise;

use super::factor::{Complex, Factor, Pair};
use super::{Family, Piece, Responses, Settings, Weighting};
use crate::simd::{LANES, Lanes, Wide};

/// Reweightings of `awls`; a fixed number, so that no lane depends on its neighbours.
const REWEIGHTINGS: usize = 3;
/// Gauss–Newton steps of `ml`.
const STEPS: usize = 10;
/// Shorter and shorter steps tried until the residuals fall.
const HALVINGS: usize = 5;

/// Memory of one worker.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    outputs: usize,
    inputs: usize,
    terms: usize,
    /// Lines of each piece, and rows behind its differences.
    widths: Vec<(usize, usize)>,
    lines: Vec<i64>,
    /// Line that each lane predicts without it.
    centre: [usize; LANES],
    /// Distance from the frequency, 1 at the edge of the first piece.
    distance: Vec<Wide>,
    y: Vec<Pair>,
    u: Vec<Pair>,
    factor: Factor,
    /// A column before its differences are taken.
    stage: Vec<Pair>,
    x: Vec<Pair>,
    trial: Vec<Pair>,
    step: Vec<Pair>,
    /// 1/A, the output that the estimate gives, and what it leaves, on each line.
    inverse: Vec<Pair>,
    model: Vec<Pair>,
    rest: Vec<Pair>,
    small: Vec<Pair>,
    /// Of each output: response, residuals by row, what noise on the output's lines does to a row, and to each
    /// response.
    response: Vec<Pair>,
    residual: Vec<Pair>,
    size: Vec<Pair>,
    gain: Vec<Pair>,
    left_out: Vec<Wide>,
    power: Vec<Wide>,
    noise: Vec<Pair>,
    cov: Vec<Pair>,
}

/// Where the columns of a settings' problem stand.
#[derive(Clone, Copy)]
struct Columns {
    transient: usize,
    slopes: usize,
    own: usize,
    all: usize,
}

impl Workspace {
    fn lines(&self) -> usize {
        self.distance.len()
    }

    fn rows(&self) -> usize {
        self.widths.iter().map(|w| w.1).sum()
    }

    fn columns(&self, settings: Settings) -> Columns {
        let transient = match settings.family {
            Family::Modulating => 0,
            _ => self.terms * self.widths.len(),
        };
        let slopes = transient + settings.degree * self.inputs;
        let own = match settings.family {
            Family::Rational => slopes + settings.degree,
            _ => slopes,
        };
        Columns { transient, slopes, own, all: own + self.inputs }
    }

    /// Takes the lines around up to eight frequencies; lanes without one repeat the last.
    pub fn pack(&mut self, settings: Settings, pieces: &[Piece], omega: &[f64]) {
        let Some((first, last)) = pieces.first().zip(omega.last()) else { return };
        (self.outputs, self.inputs) = (first.y.len(), first.u.len());
        self.terms = settings.degree + 1;
        let differences = match settings.family {
            Family::Modulating => self.terms,
            _ => 0,
        };
        self.widths.clear();
        self.widths.extend(pieces.iter().map(|p| (p.width(), p.width() - differences)));
        let lines: usize = self.widths.iter().map(|w| w.0).sum();
        self.distance.resize(lines, Wide::ZERO);
        self.y.resize(lines * self.outputs, [Wide::ZERO; 2]);
        self.u.resize(lines * self.inputs, [Wide::ZERO; 2]);
        let unit = 1.0 / (first.half as f64 * first.omega0);
        for lane in 0..LANES {
            let at = *omega.get(lane).unwrap_or(last);
            let mut from = 0;
            for piece in pieces {
                piece.lines(at, differences > 0, &mut self.lines);
                for (k, &m) in self.lines.iter().enumerate() {
                    self.distance[from + k].0[lane] = (m as f64 * piece.omega0 - at) * unit;
                    let sign = if m < 0 { -1.0 } else { 1.0 };
                    let line = m.unsigned_abs() as usize;
                    for (channels, to) in [(&piece.y, &mut self.y), (&piece.u, &mut self.u)] {
                        for (c, channel) in channels.iter().enumerate() {
                            let [re, im] = channel[line];
                            let pair = &mut to[c * lines + from + k];
                            pair[0].0[lane] = re;
                            pair[1].0[lane] = sign * im;
                        }
                    }
                }
                from += self.lines.len();
            }
            let near = |k: &usize| self.distance[*k].0[lane].abs();
            self.centre[lane] =
                (0..first.width()).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or(0);
        }
    }

    /// All outputs, one after the other, and their covariance.
    #[inline(always)]
    pub fn solve<L: Lanes>(&mut self, settings: Settings) {
        let columns = self.columns(settings);
        let (lines, rows) = (self.lines(), self.rows());
        let (outputs, inputs) = (self.outputs, self.inputs);
        let none = [Wide::ZERO; 2];
        self.factor.resize(rows, columns.all);
        self.stage.resize(lines, none);
        for buffer in [&mut self.x, &mut self.trial, &mut self.step] {
            buffer.resize(columns.all, none);
        }
        self.inverse.resize(lines, none);
        self.model.resize(lines, none);
        self.rest.resize(lines, none);
        self.small.resize(inputs * inputs, none);
        self.response.resize(outputs * inputs, none);
        self.residual.resize(outputs * rows, none);
        self.gain.resize(outputs * inputs * lines, none);
        self.size.resize(outputs * lines, none);
        self.left_out.resize(outputs * rows, Wide::ZERO);
        self.power.resize(outputs, Wide::ZERO);
        self.noise.resize(outputs * outputs, none);
        self.cov.resize((outputs * inputs) * (outputs * inputs), none);
        for output in 0..outputs {
            self.estimate::<L>(settings, columns, output);
            self.keep::<L>(settings, columns, output);
        }
        self.covariance::<L>(columns);
    }

    #[inline(always)]
    fn estimate<L: Lanes>(&mut self, settings: Settings, columns: Columns, output: usize) {
        for inverse in &mut self.inverse {
            Complex::<L>::one().store(inverse);
        }
        self.write::<L>(columns, output);
        self.factor.reduce::<L>();
        self.factor.solve::<L>(&mut self.x);
        if settings.family != Family::Rational || settings.weighting == Weighting::Ls {
            return;
        }
        for _ in 0..REWEIGHTINGS {
            self.denominator::<L>(columns, false);
            self.write::<L>(columns, output);
            self.factor.reduce::<L>();
            self.factor.solve::<L>(&mut self.x);
        }
        let mut cost = self.linearise::<L>(columns, output);
        if settings.weighting == Weighting::Ml {
            for _ in 0..STEPS {
                self.factor.solve::<L>(&mut self.step);
                self.descend::<L>(columns, output, cost);
                cost = self.linearise::<L>(columns, output);
            }
        }
    }

    /// Columns made of the data, divided by A; the right side is the output.
    #[inline(always)]
    fn write<L: Lanes>(&mut self, columns: Columns, output: usize) {
        let lines = self.lines();
        self.shared_columns::<L>(columns);
        for s in columns.slopes..columns.own {
            let y = &self.y[output * lines..(output + 1) * lines];
            self.stage.copy_from_slice(y);
            self.settle::<L>(s, s - columns.slopes + 1, L::splat(-1.0));
        }
        self.stage.copy_from_slice(&self.y[output * lines..(output + 1) * lines]);
        self.settle::<L>(columns.all, 0, L::splat(1.0));
    }

    /// Columns made of the estimate's own output, free of noise, divided by A; the right side is what it leaves.
    /// Returns the cost.
    #[inline(always)]
    fn linearise<L: Lanes>(&mut self, columns: Columns, output: usize) -> L {
        self.denominator::<L>(columns, false);
        let cost = self.evaluate::<L>(columns, output, false);
        self.shared_columns::<L>(columns);
        for s in columns.slopes..columns.own {
            self.stage.copy_from_slice(&self.model);
            self.settle::<L>(s, s - columns.slopes + 1, L::splat(-1.0));
        }
        for (to, rest) in self.factor.column_mut(columns.all).iter_mut().zip(&self.rest) {
            *to = *rest;
        }
        self.factor.reduce::<L>();
        cost
    }

    /// Columns of T and of the inputs, divided by A.
    #[inline(always)]
    fn shared_columns<L: Lanes>(&mut self, columns: Columns) {
        let (lines, terms) = (self.lines(), self.terms);
        let mut from = 0;
        for piece in 0..columns.transient / terms {
            let to = from + self.widths[piece].0;
            for s in 0..terms {
                for (k, x) in self.stage.iter_mut().enumerate() {
                    let inside = if (from..to).contains(&k) { 1.0 } else { 0.0 };
                    *x = [Wide::splat(inside), Wide::ZERO];
                }
                self.settle::<L>(piece * terms + s, s, L::splat(1.0));
            }
            from = to;
        }
        for j in 0..self.inputs {
            for s in 0..terms {
                let at = match s {
                    0 => columns.own + j,
                    _ => columns.transient + j * (terms - 1) + s - 1,
                };
                self.stage.copy_from_slice(&self.u[j * lines..(j + 1) * lines]);
                self.settle::<L>(at, s, L::splat(1.0));
            }
        }
    }

    /// What is staged times sign·r^power/A becomes a column, differenced where the settings say so.
    #[inline(always)]
    fn settle<L: Lanes>(&mut self, column: usize, power: usize, sign: L) {
        for ((x, r), inverse) in self.stage.iter_mut().zip(&self.distance).zip(&self.inverse) {
            let mut by = sign;
            for _ in 0..power {
                by = by * L::load(r);
            }
            Complex::<L>::load(x).mul(Complex::load(inverse)).scale(by).store(x);
        }
        let (mut from, mut to) = (0, 0);
        for &(width, kept) in &self.widths {
            let staged = &mut self.stage[from..from + width];
            for shorter in (kept..width).rev() {
                for k in 0..shorter {
                    let difference = Complex::<L>::load(&staged[k + 1]);
                    difference.add(Complex::load(&staged[k]).neg()).store(&mut staged[k]);
                }
            }
            self.factor.column_mut(column)[to..to + kept].copy_from_slice(&staged[..kept]);
            from += width;
            to += kept;
        }
    }

    /// 1/A on each line, of the estimate or of a trial.
    #[inline(always)]
    fn denominator<L: Lanes>(&mut self, columns: Columns, trial: bool) {
        let x = if trial { &self.trial } else { &self.x };
        for (inverse, r) in self.inverse.iter_mut().zip(&self.distance) {
            let r = L::load(r);
            let mut a = Complex::<L>::zero();
            for c in x[columns.slopes..columns.own].iter().rev() {
                a = a.add(Complex::load(c)).scale(r);
            }
            a.add(Complex::one()).inverse().store(inverse);
        }
    }

    /// The output that the estimate (or a trial) gives, transient included, and what it leaves; its cost.
    #[inline(always)]
    fn evaluate<L: Lanes>(&mut self, columns: Columns, output: usize, trial: bool) -> L {
        let (lines, terms) = (self.lines(), self.terms);
        let x = if trial { &self.trial } else { &self.x };
        let mut cost = L::splat(0.0);
        let mut k = 0;
        for (piece, &(width, _)) in self.widths.iter().enumerate() {
            for _ in 0..width {
                let r = L::load(&self.distance[k]);
                let mut sum = Complex::<L>::zero();
                for c in x[piece * terms..(piece + 1) * terms].iter().rev() {
                    sum = sum.scale(r).add(Complex::load(c));
                }
                sum = sum.add(explained::<L>(x, columns, &self.u, lines, terms, k, r));
                sum = sum.mul(Complex::load(&self.inverse[k]));
                sum.store(&mut self.model[k]);
                let y = Complex::<L>::load(&self.y[output * lines + k]);
                let rest = y.add(sum.neg());
                rest.store(&mut self.rest[k]);
                cost = cost + rest.square();
                k += 1;
            }
        }
        cost
    }

    /// Takes the step, or as much of it as lowers the cost.
    #[inline(always)]
    fn descend<L: Lanes>(&mut self, columns: Columns, output: usize, cost: L) {
        let (mut length, mut open) = (L::splat(1.0), L::splat(1.0));
        let mut taken = L::splat(0.0);
        for _ in 0..HALVINGS {
            for ((trial, x), step) in self.trial.iter_mut().zip(&self.x).zip(&self.step) {
                Complex::<L>::load(step).scale(length).add(Complex::load(x)).store(trial);
            }
            self.denominator::<L>(columns, true);
            let reached = self.evaluate::<L>(columns, output, true);
            let better = reached.select_lt(cost, open, L::splat(0.0));
            taken = better.choose(length, taken);
            open = better.choose(L::splat(0.0), open);
            if !open.any() {
                break;
            }
            length = length * L::splat(0.5);
        }
        for (x, step) in self.x.iter_mut().zip(&self.step) {
            let moved = Complex::<L>::load(step).scale(taken).add(Complex::load(x));
            let still = Complex::<L>::load(x);
            // A step that was not taken may not be finite.
            let here = L::splat(0.0);
            let re = here.select_lt(taken, moved.re, still.re);
            let im = here.select_lt(taken, moved.im, still.im);
            Complex { re, im }.store(x);
        }
    }

    /// Appends the first `count` lanes to what is known.
    pub fn unpack(&self, count: usize, out: &mut Responses) {
        let rows = self.rows();
        for lane in 0..count {
            let pair = |x: &Pair| [x[0].0[lane], x[1].0[lane]];
            out.response.extend(self.response.iter().map(pair));
            out.cov.extend(self.cov.iter().map(pair));
            out.noise.extend(self.noise.iter().map(pair));
            for i in 0..self.outputs {
                let noise = self.noise[i * self.outputs + i][0].0[lane];
                let power = self.power[i].0[lane];
                let differenced = rows < self.lines();
                out.coherence.push(match differenced {
                    true => power / (power + noise),
                    // Free of what fitting noise would explain, and so at times below zero.
                    false => (1.0 - noise / power).max(0.0),
                });
                let centre = self.centre[lane];
                out.left_out.push(match differenced {
                    true => f64::NAN,
                    false => self.left_out[i * rows + centre].0[lane],
                });
            }
        }
    }
}

/// Σ_j B_j(r) U_j on a line.
#[inline(always)]
fn explained<L: Lanes>(
    x: &[Pair],
    columns: Columns,
    u: &[Pair],
    lines: usize,
    terms: usize,
    k: usize,
    r: L,
) -> Complex<L> {
    let mut sum = Complex::<L>::zero();
    for j in 0..u.len() / lines {
        let mut b = Complex::<L>::zero();
        let slopes = columns.transient + j * (terms - 1);
        for c in x[slopes..slopes + terms - 1].iter().rev() {
            b = b.add(Complex::load(c)).scale(r);
        }
        b = b.add(Complex::load(&x[columns.own + j]));
        sum = b.mul_add(Complex::load(&u[j * lines + k]), sum);
    }
    sum
}
