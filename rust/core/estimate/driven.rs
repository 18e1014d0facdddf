//! Process noise: `ml` where noise drives the system itself, so that its spectrum depends on θ.
//!
//! With white noise of density Q on the right of the equation beside white noise of variance σ² on the samples of
//! the output, r = AY − BU − T has the variance h_m S_m in Re and in Im of line m,
//!
//! ```text
//! S_m = σ² v |A|² + Q/T      (v the variance of a coefficient under unit noise, T the record's duration),
//! ```
//!
//! and the output about the model's response that of h_m P_m, P_m = S_m/|A|². The estimate solves, for each unknown a
//! of (θ, σ², Q) and with the transient at its best,
//!
//! ```text
//! Σ_m ∂_a log P_m (k_m − ℓ_m − |r_m|²/(h_m S_m)) + 2 Σ_m Re r_m* ∂_a r̂_m/(h_m S_m) = 0,
//! ```
//!
//! r̂ the residual with the model's own response Ŷ for Y, k_m the real rows of line m, ℓ_m the leverage that the
//! columns of transient and θ have in them. Without ℓ these are the equations of maximum likelihood, whose term
//! Σ k_m log P_m no estimate with σ² and Q can do without. A squared residual is expected to be k − ℓ, not k: with ℓ the
//! equations hold on average at the truth, which takes out most of the bias of few lines, as degrees of freedom do for
//! a single level. Where Q is 0 they are `ml` under output noise with σ̂² = cost/degrees of freedom.
//!
//! Steps are scoring: least squares on the whitened rows and a row a line for its variance,
//!
//! ```text
//! J̃_m a + r̃_m,    √((k−ℓ)/2) (∂ log P_m a + 1 − |r|²/(hS (k−ℓ))),
//! ```
//!
//! halved until Σ (k−ℓ) log P + |r|²/(hS) at the ℓ that stands has fallen. Levels end at 0 where the equations
//! ask for less. `noise="equation"` is the case σ² = 0. One lane after the other, in plain numbers.

use super::design::Design;
use super::record_space::RecordSpace;
use crate::covariance::FLOOR;
use crate::linalg::columns::Columns;
use crate::math::ln_1;
use crate::modulation::{Column, Signal};
use crate::simd::{Isa, LANES};
use crate::structure::Noise;

/// Variances of measurement and process.
const LEVELS: usize = 2;
/// Square of a step in standard errors that ends the iteration, over the tolerance of a relative change.
const CLOSE: f64 = 1e-3;
/// Halvings of a step before the search ends.
const HALVINGS: usize = 14;
/// Cosine of steps that lie along each other, and the most that one is multiplied by.
const ALONG: f64 = 0.9;
const LONGEST: f64 = 4.0;
/// Rise of the criterion that rounding explains.
const ROUNDING: f64 = 1e-12;
/// Least of a line's rows that leverage leaves.
const LEFT: f64 = 1e-6;

/// A complex number.
type C = (f64, f64);

fn times(a: C, b: C) -> C {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn square(a: C) -> f64 {
    a.0 * a.0 + a.1 * a.1
}

/// Whole blocks of eight.
fn padded(rows: usize) -> usize {
    rows.next_multiple_of(8)
}

/// Levels of one estimate, in the user's units.
#[derive(Debug, Clone)]
pub struct Levels {
    /// Variance of a sample's noise and power spectral density of the process noise (two-sided, of hertz).
    pub values: [f64; LEVELS],
    /// Covariance of θ and these, row major; 0 beside what is 0.
    pub cov: Vec<f64>,
}

/// Rows of one record: Re of each line, then Im, in whole blocks of eight.
#[derive(Debug, Clone)]
struct Block {
    transient: Columns,
    row: usize,
    rows: usize,
    line: usize,
    lines: usize,
}

/// Memory of one estimate, and what was found in each lane.
#[derive(Debug, Clone)]
pub(crate) struct Driven {
    blocks: Vec<Block>,
    /// Whitened columns of θ without the transient: made orthonormal, and as they are.
    mean: Columns,
    jacobian: Vec<f64>,
    /// ∂ log P of each line by each unknown, 0 by levels that are held.
    slopes: Vec<f64>,
    /// The same above a row a line for its variance.
    scoring: Columns,
    /// Whitened residual.
    residual: Vec<f64>,
    rows: Vec<f64>,
    coefficients: Vec<f64>,
    lines: Vec<Line>,
    step: Vec<f64>,
    /// The step before.
    last: Vec<f64>,
    inverse: Vec<f64>,
    joint: Vec<f64>,
    sandwich: Vec<f64>,
    found: Vec<Found>,
}

/// What was found in one lane, in the workspace's units.
#[derive(Debug, Clone, Default)]
struct Found {
    theta: Vec<f64>,
    levels: [f64; LEVELS],
    cov: Vec<f64>,
    residual: Vec<f64>,
}

/// What is known of a line.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    /// A, and |A|² above its floor.
    a: C,
    size: f64,
    /// Variance S of one unit of each level.
    units: [f64; LEVELS],
    s: f64,
    /// 1/√(hS).
    root: f64,
    /// k − ℓ.
    left: f64,
    /// |r|²/(hS).
    misfit: f64,
}

/// The problem of one lane.
pub(crate) struct Problem<'a> {
    pub d: &'a Design,
    pub records: &'a [RecordSpace],
    pub lane: usize,
}

/// How a search ended.
pub(crate) struct Sought {
    pub steps: usize,
    pub settled: bool,
    pub cost: f64,
}

impl Problem<'_> {
    /// Coefficient of a signal on a line of a record; `y` stands for that of the output.
    fn signal(&self, record: usize, signal: Signal, line: usize, y: C) -> C {
        let r = &self.records[record];
        match signal {
            Signal::U(k) => {
                let at = (1 + k) * r.lines + line;
                (r.re[at].0[self.lane], r.im[at].0[self.lane])
            }
            Signal::One => (1.0, 0.0),
            Signal::Y | Signal::Denoised => y,
        }
    }

    /// Output's coefficient.
    fn output(&self, record: usize, line: usize) -> C {
        let r = &self.records[record];
        (r.re[line].0[self.lane], r.im[line].0[self.lane])
    }

    /// Value of a column of θ on a line.
    fn column(&self, record: usize, c: &Column, line: usize, y: C) -> C {
        let x = self.d.records[record].x[line];
        let operator = times(power(x, c), (c.sign, 0.0));
        times(operator, self.signal(record, c.signal, line, y))
    }

    /// Columns of θ, and the one with coefficient 1.
    fn columns(&self) -> &[Column] {
        &self.d.columns[self.d.transient..]
    }

    /// Whether a level is sought.
    fn seeks(&self, level: usize) -> bool {
        level == 1 || self.d.noise == Noise::Process
    }

    /// Real rows of a line.
    fn rows(&self, record: usize, line: usize) -> f64 {
        if self.d.records[record].lines.first + line == 0 { 1.0 } else { 2.0 }
    }
}

/// (ix)^power of a column.
fn power(x: f64, c: &Column) -> C {
    let size = (0..c.power.max(0)).fold(1.0, |p, _| p * x);
    match c.phase % 4 {
        0 => (size, 0.0),
        1 => (0.0, size),
        2 => (-size, 0.0),
        _ => (0.0, -size),
    }
}

impl Driven {
    /// Room for one design.
    pub fn new(d: &Design, isa: Isa) -> Driven {
        let (p, unknowns) = (d.parameters(), d.parameters() + LEVELS);
        let (mut row, mut line, mut blocks) = (0, 0, Vec::new());
        for r in &d.records {
            let (lines, rows) = (r.x.len(), padded(2 * r.x.len()));
            let transient = Columns::new(isa, rows, d.transient);
            blocks.push(Block { transient, row, rows, line, lines });
            (row, line) = (row + rows, line + lines);
        }
        let all = row + padded(line);
        let point = Found {
            theta: vec![0.0; p],
            levels: [0.0; LEVELS],
            cov: vec![0.0; unknowns * unknowns],
            residual: vec![0.0; row],
        };
        Driven {
            blocks,
            mean: Columns::new(isa, row, p),
            jacobian: vec![0.0; row * p],
            slopes: vec![0.0; line * unknowns],
            scoring: Columns::new(isa, all, unknowns),
            residual: vec![0.0; row],
            rows: vec![0.0; all],
            coefficients: vec![0.0; unknowns.max(d.transient)],
            lines: vec![Line::default(); line],
            step: vec![0.0; unknowns],
            last: vec![0.0; unknowns],
            inverse: vec![0.0; unknowns * unknowns],
            joint: vec![0.0; unknowns * unknowns],
            sandwich: vec![0.0; unknowns * unknowns],
            found: vec![point; LANES],
        }
    }

    /// Residual at a point with the transient at its best, and what belongs to the lines. Returns the criterion.
    fn evaluate(&mut self, at: &Problem<'_>, theta: &[f64], levels: [f64; LEVELS]) -> f64 {
        let d = at.d;
        let (order, count) = (d.structure.order, d.transient);
        let mut criterion = 0.0;
        for (k, block) in self.blocks.iter_mut().enumerate() {
            let rd = &d.records[k];
            let rows = &mut self.residual[block.row..][..block.rows];
            rows.fill(0.0);
            let lines = &mut self.lines[block.line..][..block.lines];
            for (i, own) in lines.iter_mut().enumerate() {
                let y = at.output(k, i);
                let (mut a, mut size) = (power(rd.x[i], &d.target), 1.0);
                let mut r = times(a, y);
                for (value, c) in theta.iter().zip(at.columns()) {
                    let z = at.column(k, c, i, y);
                    r = (r.0 + value * z.0, r.1 + value * z.1);
                }
                for (value, c) in theta[..order].iter().zip(at.columns()) {
                    let s = power(rd.x[i], c);
                    a = (a.0 + value * s.0, a.1 + value * s.1);
                    size = size * rd.size_x[i] + value.abs();
                }
                own.a = a;
                own.size = square(a).max(size * size * FLOOR);
                // The weights of the design are 1/(hv).
                let inside = match d.noise {
                    Noise::Process => rd.lines.omega0 / std::f64::consts::TAU,
                    Noise::Output | Noise::Equation => rd.lines.unit_variance,
                };
                own.units = [rd.lines.unit_variance * own.size, inside];
                own.s = levels[0] * own.units[0] + levels[1] * own.units[1];
                own.root = (rd.weight[i] * rd.lines.unit_variance / own.s).sqrt();
                (rows[i], rows[block.lines + i]) = (r.0 * own.root, r.1 * own.root);
            }
            block.transient.truncate(0);
            for (j, c) in d.columns[..count].iter().enumerate() {
                let values = &rd.transient[j * rd.x.len()..][..block.lines];
                let first = if c.phase % 2 == 0 { 0 } else { block.lines };
                block.transient.push(|column| {
                    for ((to, value), own) in column[first..].iter_mut().zip(values).zip(&*lines) {
                        *to = value * own.root;
                    }
                });
            }
            criterion += block.transient.project(0, rows, &mut self.coefficients[..count]);
            for (i, own) in lines.iter_mut().enumerate() {
                own.misfit = rows[i] * rows[i] + rows[block.lines + i] * rows[block.lines + i];
                criterion += own.left * ln_1(own.s / own.size);
            }
        }
        criterion
    }

    /// Columns of θ at the point that was evaluated, leverages, and what scoring is made of.
    fn linearise(&mut self, at: &Problem<'_>, levels: [f64; LEVELS]) {
        let d = at.d;
        let (p, order, all) = (d.parameters(), d.structure.order, self.residual.len());
        self.mean.truncate(0);
        for (j, c) in at.columns().iter().enumerate() {
            let column = &mut self.jacobian[j * all..][..all];
            column.fill(0.0);
            for (k, block) in self.blocks.iter().enumerate() {
                let rows = &mut column[block.row..][..block.rows];
                for (i, own) in self.lines[block.line..][..block.lines].iter().enumerate() {
                    let r = &self.residual[block.row..];
                    let r = (r[i] / own.root, r[block.lines + i] / own.root);
                    let (y, noise) = (at.output(k, i), times(r, (own.a.0, -own.a.1)));
                    let hat = (y.0 - noise.0 / own.size, y.1 - noise.1 / own.size);
                    let z = at.column(k, c, i, hat);
                    (rows[i], rows[block.lines + i]) = (z.0 * own.root, z.1 * own.root);
                }
                block.transient.project(0, rows, &mut self.coefficients[..d.transient]);
            }
            self.mean.push(|to| to.copy_from_slice(column));
        }
        for (k, block) in self.blocks.iter().enumerate() {
            for i in 0..block.lines {
                let both = [block.row + i, block.row + block.lines + i];
                let own = &mut self.lines[block.line + i];
                let leverage = both.into_iter().map(|row| leverage(block, &self.mean, row));
                own.left = (at.rows(k, i) - leverage.sum::<f64>()).max(LEFT);
            }
        }
        self.scoring.truncate(0);
        for unknown in 0..p + LEVELS {
            let level = unknown.checked_sub(p);
            // A level of 0 stays where the equations ask for less.
            let held = level.is_some_and(|l| {
                let more = |own: &Line| own.units[l] / own.s * (own.misfit - own.left);
                let more: f64 = self.lines.iter().map(more).sum();
                !at.seeks(l) || (levels[l] == 0.0 && more <= 0.0)
            });
            let slopes = &mut self.slopes[unknown * self.lines.len()..][..self.lines.len()];
            let x = d.records.iter().flat_map(|r| &r.x);
            for ((slope, own), x) in slopes.iter_mut().zip(&self.lines).zip(x) {
                *slope = match level {
                    _ if held => 0.0,
                    Some(level) => own.units[level] / own.s,
                    None if unknown < order => {
                        let inside = levels[1] * own.units[1] / own.s;
                        let conjugate = (own.a.0, -own.a.1);
                        let by = times(power(*x, &at.columns()[unknown]), conjugate).0;
                        -2.0 * inside * by / own.size
                    }
                    None => 0.0,
                };
            }
            let jacobian = &self.jacobian;
            self.scoring.push(|to| {
                let (mean, variance) = to.split_at_mut(all);
                if level.is_none() {
                    mean.copy_from_slice(&jacobian[unknown * all..][..all]);
                }
                for ((to, slope), own) in variance.iter_mut().zip(slopes).zip(&self.lines) {
                    *to = (0.5 * own.left).sqrt() * *slope;
                }
            });
        }
    }

    /// The step from the point that was linearised; the square of its length in standard errors.
    fn solve(&mut self) -> f64 {
        let all = self.residual.len();
        self.rows.fill(0.0);
        self.rows[..all].copy_from_slice(&self.residual);
        for (to, own) in self.rows[all..].iter_mut().zip(&self.lines) {
            *to = (own.left - own.misfit) / (2.0 * own.left).sqrt();
        }
        self.scoring.project(0, &mut self.rows, &mut self.step);
        let length = self.step.iter().map(|b| b * b).sum();
        self.scoring.back(0, &mut self.step);
        self.step.iter_mut().for_each(|s| *s = -*s);
        length
    }

    /// Seeks the estimate of a lane from these parameters.
    pub fn seek(
        &mut self,
        at: &Problem<'_>,
        theta: impl Iterator<Item = f64>,
        tol: f64,
        most: usize,
    ) -> Sought {
        let mut here = std::mem::take(&mut self.found[at.lane]);
        here.theta.iter_mut().zip(theta).for_each(|(to, from)| *to = from);
        let (steps, settled) = self.search(at, &mut here.theta, &mut here.levels, tol, most);
        here.residual.copy_from_slice(&self.residual);
        here.cov.fill(f64::NAN);
        let cost = self.cost(at, here.levels);
        self.found[at.lane] = here;
        Sought { steps, settled, cost }
    }

    /// Nothing was found in a lane.
    pub fn forget(&mut self, lane: usize) {
        let Found { levels, cov, residual, .. } = &mut self.found[lane];
        levels.iter_mut().chain(cov).chain(residual).for_each(|x| *x = f64::NAN);
    }

    /// Parameters that were found in a lane.
    pub fn theta(&self, lane: usize) -> &[f64] {
        &self.found[lane].theta
    }

    /// Of equation noise the sum of squares. Of both kinds what it would be in white noise on the output of the same
    /// likelihood, the geometric mean of P over the rows: so costs compare as likelihoods do.
    fn cost(&self, at: &Problem<'_>, levels: [f64; LEVELS]) -> f64 {
        if at.d.noise != Noise::Process {
            return levels[1] * self.lines.iter().map(|own| own.misfit).sum::<f64>();
        }
        let (mut sum, mut all) = (0.0, 0.0);
        for (k, block) in self.blocks.iter().enumerate() {
            let unit = at.d.records[k].lines.unit_variance;
            for (i, own) in self.lines[block.line..][..block.lines].iter().enumerate() {
                let rows = at.rows(k, i);
                (sum, all) = (sum + rows * ln_1(own.s / (own.size * unit)), all + rows);
            }
        }
        libm::exp(sum / all) * at.d.degrees_of_freedom() as f64
    }

    fn search(
        &mut self,
        at: &Problem<'_>,
        theta: &mut [f64],
        levels: &mut [f64; LEVELS],
        tol: f64,
        most: usize,
    ) -> (usize, bool) {
        *levels = self.first_levels(at, theta);
        let (mut steps, mut taken) = (0, 0.0);
        self.evaluate(at, theta, *levels);
        while steps < most {
            self.linearise(at, *levels);
            let length = self.solve();
            if !length.is_finite() {
                return (steps, false);
            }
            steps += 1;
            let whole = self.relaxation(taken);
            self.last.copy_from_slice(&self.step);
            let Some(part) = self.advance(at, theta, levels, whole) else {
                // Where noise is rounding, so is the criterion.
                return (steps, length <= tol.sqrt());
            };
            taken = part;
            if part * part * length <= CLOSE * tol {
                return (steps, true);
            }
        }
        (steps, false)
    }

    /// What to multiply the step by: where it lies along the last one, of which the part `taken` was, the equations are
    /// as good as linear on that line, and both steps say where they vanish. Expected information stands for the
    /// slopes of the equations, and is too large or too small where noise is other than assumed.
    fn relaxation(&self, taken: f64) -> f64 {
        let unknowns = self.step.len();
        let whitened = |step: &[f64], i: usize| -> f64 {
            (i..unknowns).map(|j| self.scoring.r(i, j) * step[j]).sum()
        };
        let (mut own, mut other, mut both) = (0.0, 0.0, 0.0);
        for i in 0..unknowns {
            let (now, last) = (whitened(&self.step, i), whitened(&self.last, i));
            (own, other, both) = (own + now * now, other + last * last, both + now * last);
        }
        if taken == 0.0 || both * both < ALONG * ALONG * own * other {
            return 1.0;
        }
        let slope = (1.0 - both / other) / taken;
        if slope > 1.0 / LONGEST { 1.0 / slope } else { LONGEST }
    }

    /// Takes the step times `whole`, or as much of that as lowers the criterion: which part. None where no part does.
    fn advance(
        &mut self,
        at: &Problem<'_>,
        theta: &mut [f64],
        levels: &mut [f64; LEVELS],
        whole: f64,
    ) -> Option<f64> {
        let before = self.criterion();
        let (p, mut part) = (theta.len(), whole);
        let step = std::mem::take(&mut self.step);
        let mut taken = None;
        for _ in 0..=HALVINGS {
            let mut next = *levels;
            for (next, step) in next.iter_mut().zip(&step[p..]) {
                *next = (*next + part * step).max(0.0);
            }
            theta.iter_mut().zip(&step).for_each(|(to, step)| *to += part * step);
            let some = next.iter().any(|level| *level > 0.0);
            if some && self.evaluate(at, theta, next) <= before + ROUNDING * before.abs() {
                (*levels, taken) = (next, Some(part));
                break;
            }
            theta.iter_mut().zip(&step).for_each(|(to, step)| *to -= part * step);
            part *= 0.5;
        }
        self.step = step;
        if taken.is_none() {
            self.evaluate(at, theta, *levels);
        }
        taken
    }

    /// The criterion of the point that was evaluated, at the leverages that stand.
    fn criterion(&self) -> f64 {
        let one = |own: &Line| own.left * ln_1(own.s / own.size) + own.misfit;
        self.lines.iter().map(one).sum()
    }

    /// Levels to start from: each such that it alone, or on the middle of the lines, is what the residuals show.
    fn first_levels(&mut self, at: &Problem<'_>, theta: &[f64]) -> [f64; LEVELS] {
        let alone = if at.seeks(0) { [1.0, 0.0] } else { [0.0, 1.0] };
        self.evaluate(at, theta, alone);
        let squares: f64 = self.lines.iter().map(|own| own.misfit).sum();
        let one = squares / at.d.degrees_of_freedom() as f64;
        let ratio = |own: &Line| ln_1(own.units[0] / own.units[1]);
        let ratio = self.lines.iter().map(ratio).sum::<f64>() / self.lines.len() as f64;
        if at.seeks(0) { [one, one * libm::exp(ratio)] } else { [0.0, one] }
    }

    /// Covariances at the estimate that was found last: the joint one from the information, and that of the parameters
    /// row by row.
    pub fn uncertainty(&mut self, at: &Problem<'_>) {
        self.linearise(at, self.found[at.lane].levels);
        let (p, unknowns) = (self.parameters(), self.step.len());
        for j in 0..unknowns {
            let column = &mut self.inverse[j * unknowns..][..unknowns];
            column.fill(0.0);
            column[j] = 1.0;
            self.scoring.back(0, column);
            if self.scoring.r(j, j) == 0.0 {
                column.fill(0.0);
            }
        }
        for i in 0..unknowns {
            for j in 0..unknowns {
                let each = (0..unknowns)
                    .map(|k| self.inverse[k * unknowns + i] * self.inverse[k * unknowns + j]);
                self.joint[i * unknowns + j] = each.sum();
            }
        }
        let all = self.residual.len();
        self.sandwich.fill(0.0);
        let mut score = std::mem::take(&mut self.step);
        let mut influence = std::mem::take(&mut self.coefficients);
        for block in &self.blocks {
            for i in 0..block.lines {
                for row in [block.row + i, block.row + block.lines + i] {
                    let free = (1.0 - leverage(block, &self.mean, row)).max(LEFT);
                    let e = self.residual[row];
                    // Im of line 0 is no row.
                    if e == 0.0 {
                        continue;
                    }
                    for (unknown, score) in score.iter_mut().enumerate() {
                        let slope = self.slopes[unknown * self.lines.len() + block.line + i];
                        let mean =
                            if unknown < p { self.jacobian[unknown * all + row] } else { 0.0 };
                        *score = mean * e / free + 0.5 * slope * (1.0 - e * e / free);
                    }
                    for (i, to) in influence.iter_mut().enumerate().take(p) {
                        let row = &self.joint[i * unknowns..][..unknowns];
                        *to = row.iter().zip(&score).map(|(c, s)| c * s).sum();
                    }
                    for i in 0..p {
                        for j in 0..p {
                            self.sandwich[i * p + j] += influence[i] * influence[j];
                        }
                    }
                }
            }
        }
        (self.step, self.coefficients) = (score, influence);
        self.found[at.lane].cov.copy_from_slice(&self.joint);
    }

    fn parameters(&self) -> usize {
        self.step.len() - LEVELS
    }

    /// Covariance of two parameters.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.joint[i * self.step.len() + j]
    }

    /// The same row by row.
    pub fn sandwich(&self, i: usize, j: usize) -> f64 {
        self.sandwich[i * self.parameters() + j]
    }

    /// Entry of the normal matrix of the whitened columns of θ.
    pub fn gram(&self, i: usize, j: usize) -> f64 {
        (0..=i.min(j)).map(|k| self.mean.r(k, i) * self.mean.r(k, j)).sum()
    }

    /// Whether the column of a parameter depends on those before it.
    pub fn is_dependent(&self, parameter: usize) -> bool {
        self.mean.r(parameter, parameter) == 0.0
    }

    /// Degrees of freedom of the variance of a parameter, from the scatter of the levels that it rests on.
    pub fn degrees(&self, parameter: usize) -> f64 {
        let (p, unknowns, all) = (self.parameters(), self.step.len(), self.residual.len());
        let (mut total, mut share) = (0.0, [0.0; LEVELS]);
        for block in &self.blocks {
            for i in 0..block.lines {
                let own = &self.lines[block.line + i];
                for row in [block.row + i, block.row + block.lines + i] {
                    let each = (0..p).map(|k| {
                        self.joint[parameter * unknowns + k] * self.jacobian[k * all + row]
                    });
                    let influence: f64 = each.sum();
                    total += influence * influence;
                    for (share, unit) in share.iter_mut().zip(own.units) {
                        *share += influence * influence * unit / own.s;
                    }
                }
            }
        }
        let cov = |i: usize, j: usize| self.joint[(p + i) * unknowns + p + j];
        let each = (0..LEVELS * LEVELS).map(|k| {
            let (i, j) = (k / LEVELS, k % LEVELS);
            share[i] * share[j] * cov(i, j)
        });
        2.0 * total * total / each.sum::<f64>()
    }
}

/// Leverage of a row, that of the transient and that of θ.
fn leverage(block: &Block, mean: &Columns, row: usize) -> f64 {
    let square = |q: &Columns, row: usize| -> f64 {
        (0..q.count()).map(|j| q.q(j)[row] * q.q(j)[row]).sum()
    };
    square(&block.transient, row - block.row) + square(mean, row)
}

impl Driven {
    /// Levels of a lane in the user's units.
    pub fn levels(&self, d: &Design, lane: usize) -> Levels {
        let p = d.parameters();
        let found = &self.found[lane];
        let equation = (0..d.structure.order).fold(d.unit, |p, _| p * d.band_edge);
        let units = [d.unit * d.unit, equation * equation];
        let unit = |k: usize| if k < p { d.scale[k] } else { units[k - p] };
        let size = p + LEVELS;
        let cov = found.cov.iter().enumerate().map(|(k, v)| v * unit(k / size) * unit(k % size));
        Levels {
            values: [found.levels[0] * units[0], found.levels[1] * units[1]],
            cov: cov.collect(),
        }
    }

    /// Whitened residuals of a lane on the lines of each record.
    pub fn residuals(&self, lane: usize) -> Vec<Vec<(f64, f64)>> {
        let of = |block: &Block| {
            let rows = &self.found[lane].residual[block.row..];
            (0..block.lines).map(|i| (rows[i], rows[block.lines + i])).collect()
        };
        self.blocks.iter().map(of).collect()
    }
}
