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

use super::factor::{Complex, Factor, Pair};
use super::{Family, Piece, Responses, Settings, Weighting};
use crate::simd::{LANES, Lanes, Wide};

/// Reweightings of `awls`; a fixed number, so that no lane depends on its neighbours.
const REWEIGHTINGS: usize = 3;
/// Gauss–Newton steps of `ml`.
const STEPS: usize = 10;
/// Shorter and shorter steps tried until the residuals fall.
const HALVINGS: usize = 5;

/// Scratch memory of one worker.
#[derive(Debug, Clone, Default)]
pub struct Work {
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

impl Work {
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

    /// Keeps of an output what its covariance with others is made of.
    #[inline(always)]
    fn keep<L: Lanes>(&mut self, settings: Settings, columns: Columns, output: usize) {
        let (lines, rows, inputs) = (self.lines(), self.rows(), self.inputs);
        let plain = settings.family == Family::Rational && settings.weighting == Weighting::Ls;
        if settings.family == Family::Rational {
            self.denominator::<L>(columns, false);
        }
        for r in 0..rows {
            let mut leverage = L::splat(0.0);
            for j in 0..columns.all {
                leverage = leverage + Complex::<L>::load(&self.factor.column(j)[r]).square();
            }
            let rest = Complex::<L>::load(&self.factor.column(columns.all)[r]);
            let one = L::splat(1.0);
            (rest.square() / ((one - leverage) * (one - leverage)))
                .store(&mut self.left_out[output * rows + r]);
            rest.store(&mut self.residual[output * rows + r]);
        }
        // The inverse of R's last block, upper triangular.
        for b in 0..inputs {
            for a in (0..=b).rev() {
                let mut sum = if a == b { Complex::<L>::one() } else { Complex::zero() };
                for c in a + 1..=b {
                    let upper =
                        Complex::<L>::load(self.factor.upper(columns.own + a, columns.own + c));
                    sum = upper.neg().mul_add(Complex::load(&self.small[c * inputs + b]), sum);
                }
                sum.scale(L::load(self.factor.inverse(columns.own + a)))
                    .store(&mut self.small[a * inputs + b]);
            }
        }
        for a in 0..inputs {
            for r in 0..rows {
                let mut sum = Complex::<L>::zero();
                for b in a..inputs {
                    let q = Complex::<L>::load(&self.factor.column(columns.own + b)[r]).conj();
                    sum = Complex::load(&self.small[a * inputs + b]).mul_add(q, sum);
                }
                sum.store(&mut self.stage[r]);
            }
            self.gain_on_lines::<L>(output * inputs + a, plain);
        }
        for k in 0..lines {
            let mut size = Complex::<L>::one();
            if plain {
                size = Complex::<L>::load(&self.inverse[k]).inverse();
            }
            size.store(&mut self.size[output * lines + k]);
        }
        // An input that does not move, or moves as another does, tells nothing.
        let mut told = L::splat(1.0);
        for b in 0..inputs {
            let inverse = L::load(self.factor.inverse(columns.own + b));
            told = L::splat(0.0).select_lt(inverse, told, L::splat(f64::NAN));
        }
        for a in 0..inputs {
            Complex::<L>::load(&self.x[columns.own + a])
                .scale(told)
                .store(&mut self.response[output * inputs + a]);
        }
        self.power_without_transient::<L>(columns, output);
    }

    /// Mean square of what of the output is no transient; where T is not fitted, of what the inputs explain.
    #[inline(always)]
    fn power_without_transient<L: Lanes>(&mut self, columns: Columns, output: usize) {
        let (lines, terms) = (self.lines(), self.terms);
        let (mut power, mut k) = (L::splat(0.0), 0);
        for (piece, &(width, _)) in self.widths.iter().enumerate() {
            for _ in 0..width {
                let r = L::load(&self.distance[k]);
                let inverse = Complex::load(&self.inverse[k]);
                let part = if columns.transient == 0 {
                    explained::<L>(&self.x, columns, &self.u, lines, terms, k, r).mul(inverse)
                } else {
                    let mut sum = Complex::<L>::zero();
                    for c in self.x[piece * terms..(piece + 1) * terms].iter().rev() {
                        sum = sum.scale(r).add(Complex::load(c));
                    }
                    sum.mul(inverse).neg().add(Complex::load(&self.y[output * lines + k]))
                };
                power = power + part.square();
                k += 1;
            }
        }
        (power / L::splat(lines as f64)).store(&mut self.power[output]);
    }

    /// What is staged by rows, the response's gain for what stands on them, as its gain for the output's noise on
    /// the lines.
    #[inline(always)]
    fn gain_on_lines<L: Lanes>(&mut self, path: usize, plain: bool) {
        let lines = self.lines();
        let gain = &mut self.gain[path * lines..(path + 1) * lines];
        transpose::<L>(&self.widths, &self.stage, gain);
        if plain {
            // The noise on these rows is A times that of the output.
            for (x, inverse) in gain.iter_mut().zip(&self.inverse) {
                Complex::<L>::load(x).mul(Complex::load(inverse).inverse()).store(x);
            }
        }
    }

    /// What unit noise on the lines leaves as sum of squares on the rows.
    #[inline(always)]
    fn left<L: Lanes>(&mut self, columns: Columns) -> L {
        let (lines, rows) = (self.lines(), self.rows());
        if rows == lines {
            return L::splat((rows - columns.all) as f64);
        }
        // Of differences: the squares of their coefficients, less what lies along the columns.
        let binomial = (1..=self.terms).fold(1.0, |c, k| c * (self.terms + k) as f64 / k as f64);
        let mut left = L::splat(rows as f64 * binomial);
        for j in 0..columns.all {
            transpose::<L>(&self.widths, self.factor.column(j), &mut self.model);
            for x in &self.model {
                left = left - Complex::<L>::load(x).square();
            }
        }
        left
    }

    /// Covariance of the noise and of all responses.
    #[inline(always)]
    fn covariance<L: Lanes>(&mut self, columns: Columns) {
        let (lines, rows) = (self.lines(), self.rows());
        let (inputs, outputs) = (self.inputs, self.outputs);
        let scale = self.left::<L>(columns) * L::splat(1.0 / lines as f64);
        let paths = outputs * inputs;
        for i in 0..outputs {
            for k in 0..outputs {
                let (mut sum, mut size) = (Complex::<L>::zero(), Complex::<L>::zero());
                for r in 0..rows {
                    let other = Complex::<L>::load(&self.residual[k * rows + r]).conj();
                    sum = Complex::load(&self.residual[i * rows + r]).mul_add(other, sum);
                }
                for r in 0..lines {
                    let other = Complex::<L>::load(&self.size[k * lines + r]).conj();
                    size = Complex::load(&self.size[i * lines + r]).mul_add(other, size);
                }
                let noise = sum.mul(size.scale(scale).inverse());
                noise.store(&mut self.noise[i * outputs + k]);
                for a in 0..inputs {
                    for b in 0..inputs {
                        let (p, q) = (i * inputs + a, k * inputs + b);
                        let mut sum = Complex::<L>::zero();
                        for r in 0..lines {
                            let other = Complex::<L>::load(&self.gain[q * lines + r]).conj();
                            sum = Complex::load(&self.gain[p * lines + r]).mul_add(other, sum);
                        }
                        sum.mul(noise).store(&mut self.cov[p * paths + q]);
                    }
                }
            }
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

/// From rows, differences of lines, back to lines by the differences' transpose.
#[inline(always)]
fn transpose<L: Lanes>(widths: &[(usize, usize)], rows: &[Pair], lines: &mut [Pair]) {
    let (mut from, mut to) = (0, 0);
    for &(width, kept) in widths {
        let own = &mut lines[to..to + width];
        own[..kept].copy_from_slice(&rows[from..from + kept]);
        for last in kept..width {
            own[last] = [Wide::ZERO; 2];
            for k in (0..=last).rev() {
                let mut value = Complex::<L>::load(&own[k]).neg();
                if k > 0 {
                    value = value.add(Complex::load(&own[k - 1]));
                }
                value.store(&mut own[k]);
            }
        }
        from += kept;
        to += width;
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
