//! Gauss–Newton on the samples, or on lines: frequencies and dampings move, amplitudes and trend are eliminated.
//!
//! ```text
//! minimise over ω, d:  min over trend, α, β of Σ_k w_k² (y_k − trend_k − Σ_i e^{−d_i k}(α_i cos ω_i k + β_i sin ω_i k))²
//! ```
//!
//! (report, section 4.10). The columns of trend and tones are made orthonormal; a step is that of the residual on the
//! derivatives of the columns, taken beside the columns themselves (variable projection), and is halved until the sum
//! of squares falls.

use std::f64::consts::TAU;

use super::lines::Lines;
use super::{Options, Tone};
use crate::Status;
use crate::linalg::columns::Columns;
use crate::math::sin_cos_turns_1;
use crate::simd::{Isa, LANES};
use crate::threads::stopped;

/// Steps at most, and those of a candidate of the search.
const STEPS: usize = 100;
const FEW_STEPS: usize = 12;
/// Steps end below this part of a line's width, 1/n; candidates' earlier.
const SETTLED: f64 = 1e-9;
const NEARLY: f64 = 1e-3;
/// No step is longer, in lines.
const LONGEST: f64 = 0.5;
const HALVINGS: usize = 8;

/// One record and the memory for fits to it.
#[derive(Debug)]
pub struct Refiner {
    length: usize,
    damped: bool,
    complex: bool,
    trend: usize,
    /// Where the fit sees lines only.
    lines: Option<Lines>,
    /// A sample's weight and index; complex records: twice.
    weights: Vec<f64>,
    index: Vec<f64>,
    y: Vec<f64>,
    /// What the fit sees of y, and what is left of it: samples or lines, filled up with zeros.
    seen: Vec<f64>,
    residual: Vec<f64>,
    /// Re and Im part of each tone over the samples, as they stood before they were made orthonormal.
    parts: Vec<f64>,
    columns: Columns,
    coefficients: Vec<f64>,
}

/// Amplitudes, phases and the covariance at given tones.
pub struct Solved {
    pub amplitude: Vec<f64>,
    pub phase: Vec<f64>,
    pub cov: Vec<f64>,
    pub independent: bool,
}

impl Refiner {
    pub fn new(weights: &[f64], options: &Options, isa: Isa) -> Refiner {
        let (n, copies) = (weights.len(), if options.complex { 2 } else { 1 });
        let trend = options.trend * copies;
        let unknowns = 4 * options.count + trend;
        let rows = (copies * n).next_multiple_of(LANES);
        Refiner {
            length: n,
            damped: options.damped,
            complex: options.complex,
            trend,
            lines: None,
            weights: weights.repeat(copies),
            index: (0..copies * n).map(|k| (k % n) as f64).collect(),
            y: vec![0.0; copies * n],
            seen: vec![0.0; rows],
            residual: vec![0.0; rows],
            parts: vec![0.0; copies * n * 2 * options.count],
            columns: Columns::new(isa, rows, unknowns),
            coefficients: vec![0.0; unknowns],
        }
    }

    /// The record that all else is about.
    pub fn take(&mut self, samples: &[f64]) {
        for (y, (x, w)) in self.y.iter_mut().zip(samples.iter().zip(&self.weights)) {
            *y = x * w;
        }
        self.seen[..self.y.len()].copy_from_slice(&self.y);
    }

    /// The same record seen on lines alone, without the trend that was found beside `tones`.
    pub fn on(&mut self, lines: Lines, tones: &[Tone], isa: Isa) -> Refiner {
        self.cost(tones);
        let rows = lines.rows().next_multiple_of(LANES);
        let mut y = self.y.clone();
        for k in 0..self.trend {
            let column = self.trend_column(k);
            y.iter_mut().zip(&column).for_each(|(y, x)| *y -= self.coefficients[k] * x);
        }
        let mut seen = vec![0.0; rows];
        lines.see(&y, &mut seen);
        Refiner {
            trend: 0,
            lines: Some(lines),
            y,
            seen,
            residual: vec![0.0; rows],
            columns: Columns::new(isa, rows, self.coefficients.len()),
            weights: self.weights.clone(),
            index: self.index.clone(),
            parts: self.parts.clone(),
            coefficients: self.coefficients.clone(),
            ..*self
        }
    }

    /// What the fit sees of the record.
    pub fn seen(&self) -> &[f64] {
        &self.seen
    }

    /// What the tones of the last [`Refiner::cost`] leave, weighted.
    pub fn residual(&self) -> &[f64] {
        &self.residual
    }

    /// Orthonormal columns of the trend and the tones of the last [`Refiner::cost`].
    pub fn basis(&self) -> &Columns {
        &self.columns
    }

    /// Sum of squares that tones leave, best amplitudes and trend taken; infinite where tones coincide.
    pub fn cost(&mut self, tones: &[Tone]) -> f64 {
        self.columns.truncate(0);
        let mut independent = self.push_trend();
        let rows = self.y.len();
        for (i, tone) in tones.iter().enumerate() {
            self.write_parts(i, *tone);
            for half in [2 * i, 2 * i + 1] {
                let part = &self.parts[half * rows..][..rows];
                independent &= push(&mut self.columns, self.lines.as_ref(), part);
            }
        }
        self.residual.copy_from_slice(&self.seen);
        let b = &mut self.coefficients[..self.trend + 2 * tones.len()];
        let cost = self.columns.project(0, &mut self.residual, b);
        self.columns.back(0, b);
        if independent { cost } else { f64::INFINITY }
    }

    fn push_trend(&mut self) -> bool {
        (0..self.trend).fold(true, |independent, k| {
            let column = self.trend_column(k);
            push(&mut self.columns, self.lines.as_ref(), &column) && independent
        })
    }

    /// 1, then the sample's place about the middle; of complex records each as real and as imaginary part.
    fn trend_column(&self, k: usize) -> Vec<f64> {
        let (n, copies) = (self.length, if self.complex { 2 } else { 1 });
        let middle = (n as f64 - 1.0) / 2.0;
        let value = |j: usize| if k < copies { 1.0 } else { (j as f64 - middle) / n as f64 };
        let mut column = vec![0.0; self.y.len()];
        let first = k % copies * n;
        (0..n).for_each(|j| column[first + j] = self.weights[j] * value(j));
        column
    }

    /// Re λᵏ and Re iλᵏ of a real record; of a complex one λᵏ and iλᵏ, real parts first.
    fn write_parts(&mut self, i: usize, tone: Tone) {
        let (rows, n) = (self.y.len(), self.length);
        let (first, second) = self.parts[2 * i * rows..][..2 * rows].split_at_mut(rows);
        let (sin, cos) = sin_cos_turns_1(tone.frequency);
        let decay = libm::exp(-tone.damping);
        let (re, im) = (decay * cos, decay * sin);
        let (mut a, mut b) = (1.0, 0.0);
        for k in 0..n {
            let w = self.weights[k];
            (first[k], second[k]) = (w * a, -w * b);
            if self.complex {
                (first[n + k], second[n + k]) = (w * b, w * a);
            }
            (a, b) = (a * re - b * im, a * im + b * re);
        }
    }

    /// Adds p times the first part of tone `i` and q times its second, or that times the sample's index.
    fn push_mix(&mut self, i: usize, (p, q): (f64, f64), indexed: bool) -> bool {
        let rows = self.y.len();
        let (first, second) = self.parts[2 * i * rows..][..2 * rows].split_at(rows);
        let mix = first.iter().zip(second).map(|(u, v)| p * u + q * v);
        let column: Vec<f64> = match indexed {
            true => mix.zip(&self.index).map(|(x, k)| k * x).collect(),
            false => mix.collect(),
        };
        push(&mut self.columns, self.lines.as_ref(), &column)
    }

    /// Adds the derivative by frequency, or by damping, of tone `i` with amplitudes (a, b).
    fn push_slope(&mut self, i: usize, (a, b): (f64, f64), damping: bool) -> bool {
        // d/dω: Re ik(a + ib)λᵏ; d/dd: −k times the tone itself.
        self.push_mix(i, if damping { (-a, -b) } else { (-b, a) }, true)
    }

    /// A candidate of the search, refined until it can be compared with others.
    pub fn nearly(&mut self, tones: &mut [Tone]) -> f64 {
        self.descend(tones, FEW_STEPS, NEARLY).0
    }

    /// The minimum near the tones: cost, steps, status.
    pub fn settle(&mut self, tones: &mut [Tone]) -> (f64, usize, Status) {
        self.descend(tones, STEPS, SETTLED)
    }

    fn descend(&mut self, tones: &mut [Tone], steps: usize, small: f64) -> (f64, usize, Status) {
        let n = self.length as f64;
        let mut cost = self.cost(tones);
        for step in 1..=steps {
            if !cost.is_finite() {
                return (cost, step, Status::Rank);
            }
            if stopped() {
                break;
            }
            let moves = self.moves(tones);
            let longest =
                moves.iter().fold(0.0, |most: f64, m| most.max(m.0.abs()).max(m.1.abs() / TAU)) * n;
            let mut by = if longest > LONGEST { LONGEST / longest } else { 1.0 };
            let start: Vec<Tone> = tones.to_vec();
            let mut halvings = 0;
            loop {
                for ((tone, from), (frequency, damping)) in tones.iter_mut().zip(&start).zip(&moves)
                {
                    tone.frequency = self.wrapped(from.frequency + by * frequency);
                    tone.damping = from.damping + by * damping;
                }
                let next = self.cost(tones);
                if next <= cost {
                    cost = next;
                    break;
                }
                halvings += 1;
                if halvings > HALVINGS || by * longest < small {
                    tones.copy_from_slice(&start);
                    cost = self.cost(tones);
                    let status = if longest < NEARLY { Status::Ok } else { Status::MaxIter };
                    return (cost, step, status);
                }
                by *= 0.5;
            }
            if by * longest < small {
                return (cost, step, Status::Ok);
            }
        }
        (cost, steps, Status::MaxIter)
    }

    /// Gauss–Newton moves of frequencies (turns) and dampings at the tones of the last [`Refiner::cost`].
    fn moves(&mut self, tones: &[Tone]) -> Vec<(f64, f64)> {
        let linear = self.columns.count();
        let frees = if self.damped { 2 } else { 1 };
        for i in 0..tones.len() {
            let c =
                (self.coefficients[self.trend + 2 * i], self.coefficients[self.trend + 2 * i + 1]);
            for free in 0..frees {
                self.push_slope(i, c, free == 1);
            }
        }
        let mut b = vec![0.0; frees * tones.len()];
        let mut left = std::mem::take(&mut self.residual);
        self.columns.project(linear, &mut left, &mut b);
        self.residual = left;
        self.columns.back(linear, &mut b);
        self.columns.truncate(linear);
        b.chunks_exact(frees).map(|m| (m[0] / TAU, if frees == 2 { m[1] } else { 0.0 })).collect()
    }

    /// A real record's frequencies lie in [0, ½], a complex one's in (−½, ½].
    fn wrapped(&self, frequency: f64) -> f64 {
        let near = frequency - (frequency + 0.5).floor();
        if self.complex { near } else { near.abs() }
    }

    /// Coefficients of the trend beside these tones.
    pub fn trend(&mut self, tones: &[Tone]) -> Vec<f64> {
        self.cost(tones);
        self.coefficients[..self.trend].to_vec()
    }

    /// Amplitudes and phases, and their covariance with the tones' for noise of this variance.
    pub fn solve(&mut self, tones: &[Tone], variance: f64) -> Solved {
        let mut independent = self.cost(tones).is_finite();
        let linear = self.coefficients[..self.trend + 2 * tones.len()].to_vec();
        let complex: Vec<(f64, f64)> =
            linear[self.trend..].chunks_exact(2).map(|c| (c[0], c[1])).collect();
        let amplitude: Vec<f64> = complex.iter().map(|c| libm::hypot(c.0, c.1)).collect();
        let phase = complex.iter().map(|c| libm::atan2(c.1, c.0)).collect();
        self.columns.truncate(self.trend);
        for damping in [false, true].into_iter().take(if self.damped { 2 } else { 1 }) {
            for (i, c) in complex.iter().enumerate() {
                independent &= self.push_slope(i, *c, damping);
            }
        }
        for by_phase in [false, true] {
            for (i, (c, size)) in complex.iter().zip(&amplitude).enumerate() {
                let mix = if by_phase { (-c.1, c.0) } else { (c.0 / size, c.1 / size) };
                independent &= self.push_mix(i, mix, false);
            }
        }
        let cov = self.covariance(self.trend, variance);
        Solved { amplitude, phase, cov, independent }
    }

    /// R⁻¹Qᵀ diag(noise variance) Q R⁻ᵀ of the columns from `first` on.
    fn covariance(&self, first: usize, variance: f64) -> Vec<f64> {
        let p = self.columns.count() - first;
        let mut inverse = vec![0.0; p * p];
        for (j, column) in inverse.chunks_exact_mut(p.max(1)).enumerate() {
            column[j] = 1.0;
            self.columns.back(first, column);
        }
        let at = |i: usize, j: usize| inverse[j * p + i];
        let middle = match &self.lines {
            Some(lines) => self.noise(&lines.levels(&self.residual, &self.leverages())),
            None => (0..p * p).map(|k| if k / p == k % p { variance } else { 0.0 }).collect(),
        };
        let half: Vec<f64> = (0..p * p)
            .map(|k| (k / p..p).map(|l| at(k / p, l) * middle[l * p + k % p]).sum())
            .collect();
        (0..p * p).map(|k| (k % p..p).map(|l| half[k / p * p + l] * at(k % p, l)).sum()).collect()
    }

    /// Qᵀ diag(levels) Q.
    fn noise(&self, levels: &[f64]) -> Vec<f64> {
        let p = self.columns.count();
        let entry = |i: usize, j: usize| -> f64 {
            let both = self.columns.q(i).iter().zip(self.columns.q(j));
            both.zip(levels).map(|((a, b), s)| a * b * s).sum()
        };
        (0..p * p).map(|k| entry(k / p, k % p)).collect()
    }

    /// Σ_j Q(i, j)² of each row.
    fn leverages(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.seen.len()];
        for j in 0..self.columns.count() {
            sums.iter_mut().zip(self.columns.q(j)).for_each(|(sum, q)| *sum += q * q);
        }
        sums
    }
}

/// Adds a column over the samples as the fit sees it.
fn push(columns: &mut Columns, lines: Option<&Lines>, column: &[f64]) -> bool {
    columns.push(|x| match lines {
        Some(lines) => lines.see(column, x),
        None => x[..column.len()].copy_from_slice(column),
    })
}
