//! Radau's implicit method of three stages and order 5 for stiff equations, with an error estimate of order 3.
//!
//! Hairer and Wanner, *Solving Ordinary Differential Equations II*, section IV.8: simplified Newton steps on
//! the increments of the stages, whose polynomial of one step is the first guess of the next.

use modfun_dense::Lu;

use super::history::TERMS;
use super::system::{Span, System};
use super::{Method, SAFETY, SHRINK, Tried};

const STAGES: usize = 3;
const GROW: f64 = 8.0;
/// Exponent of the error in the next step: one over the order of the error's estimate and one.
const EXPONENT: f64 = -0.25;
/// Newton steps of a stage system; where they do not settle, the step is halved.
const NEWTON: usize = 10;

const ROOT: f64 = 2.449_489_742_783_178;
/// Instants of the stages in a step.
const C: [f64; STAGES] = [(4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0];
/// Weights of all stages.
const A: [[f64; STAGES]; STAGES] = [
    [(88.0 - 7.0 * ROOT) / 360.0, (296.0 - 169.0 * ROOT) / 1800.0, (3.0 * ROOT - 2.0) / 225.0],
    [(296.0 + 169.0 * ROOT) / 1800.0, (88.0 + 7.0 * ROOT) / 360.0, (-3.0 * ROOT - 2.0) / 225.0],
    [(16.0 - ROOT) / 36.0, (16.0 + ROOT) / 36.0, 1.0 / 9.0],
];
/// Weights of the increments in the error, before the filter (γ/h − J)⁻¹.
const ERROR: [f64; STAGES] = [(-13.0 - 7.0 * ROOT) / 3.0, (-13.0 + 7.0 * ROOT) / 3.0, -1.0 / 3.0];
/// γ, the real eigenvalue of A⁻¹: 3 + 3^⅔ − 3^⅓.
const GAMMA: f64 = 3.637_834_252_744_496;
/// Error of the polynomial of a step in units of what its slope at the beginning lacks: the largest value of
/// the quartic that the stages do not see.
const UNSEEN: f64 = 0.068;

/// Increments, slopes and factors of a step.
pub struct Implicit {
    size: usize,
    states: usize,
    /// Slopes (start, state) where the step begins.
    first: Vec<f64>,
    /// Increments (stage, start, state), and the slopes there.
    increments: Vec<f64>,
    slopes: Vec<f64>,
    /// Derivatives of slopes, (start, slope, state), where the step begins.
    jacobian: Vec<f64>,
    /// Whether that is done.
    fresh: bool,
    stages: Vec<Lu>,
    filter: Vec<Lu>,
    state: Vec<f64>,
    change: Vec<f64>,
    own: Vec<f64>,
    matrix: Vec<f64>,
    /// Length of the step before, and its polynomial s(f₀ + (1 − s)(f₁ + s f₂)), (start, state).
    before: Option<f64>,
    terms: Vec<[f64; STAGES]>,
    /// A step from here was refused, or is the first.
    doubtful: bool,
}

impl Implicit {
    pub fn new(system: &System<'_>) -> Implicit {
        let (n, count) = (system.states, system.problem.count);
        let size = n * count;
        Implicit {
            size,
            states: n,
            first: vec![0.0; size],
            increments: vec![0.0; STAGES * size],
            slopes: vec![0.0; STAGES * size],
            jacobian: vec![0.0; size * n],
            fresh: false,
            stages: (0..count).map(|_| Lu::new(STAGES * n)).collect(),
            filter: (0..count).map(|_| Lu::new(n)).collect(),
            state: vec![0.0; size],
            change: vec![0.0; STAGES * size],
            own: vec![0.0; STAGES * n],
            matrix: vec![0.0; STAGES * STAGES * n * n],
            before: None,
            terms: vec![[0.0; STAGES]; size],
            doubtful: true,
        }
    }

    /// Derivatives of the slopes by differences, of all starts at once.
    fn differentiate(&mut self, system: &mut System<'_>, at: Span, x: &[f64]) {
        let n = self.states;
        let (mut moved, mut slopes) = (x.to_vec(), vec![0.0; self.size]);
        let problem = system.problem;
        for j in 0..n {
            let floor = problem.absolute[j] / problem.relative;
            let step = |x: f64| x + f64::EPSILON.sqrt() * x.abs().max(floor);
            for k in (j..self.size).step_by(n) {
                moved[k] = step(x[k]);
            }
            system.slopes(at.interval, at.t, &moved, &mut slopes);
            for k in (j..self.size).step_by(n) {
                let (own, by) = (k / n * n..(k / n + 1) * n, moved[k] - x[k]);
                let rows = self.jacobian[own.start * n..own.end * n].chunks_exact_mut(n);
                for ((row, slope), first) in rows.zip(&slopes[own.clone()]).zip(&self.first[own]) {
                    row[j] = (slope - first) / by;
                }
                moved[k] = x[k];
            }
        }
        self.fresh = true;
    }

    /// Factors of 1 − h A ⊗ J, and of γ/h − J.
    fn factor(&mut self, h: f64) {
        let n = self.states;
        let wide = STAGES * n;
        for (one, (stages, filter)) in self.stages.iter_mut().zip(&mut self.filter).enumerate() {
            let jacobian = &self.jacobian[one * n * n..][..n * n];
            for (row, to) in self.matrix[..wide * wide].chunks_exact_mut(wide).enumerate() {
                for (column, to) in to.iter_mut().enumerate() {
                    *to = f64::from(row == column)
                        - h * A[row / n][column / n] * jacobian[row % n * n + column % n];
                }
            }
            stages.factor(&self.matrix[..wide * wide]);
            for (k, (to, slope)) in self.matrix.iter_mut().zip(jacobian).enumerate() {
                *to = if k % (n + 1) == 0 { GAMMA / h } else { 0.0 } - slope;
            }
            filter.factor(&self.matrix[..n * n]);
        }
    }

    /// First guess of the increments: the polynomial of the step before goes on.
    fn guess(&mut self, h: f64) {
        let Some(before) = self.before else {
            self.increments.fill(0.0);
            return;
        };
        for (c, to) in C.iter().zip(self.increments.chunks_exact_mut(self.size)) {
            let s = 1.0 + c * h / before;
            for (to, [f0, f1, f2]) in to.iter_mut().zip(&self.terms) {
                *to = s * (f0 + (1.0 - s) * (f1 + s * f2)) - f0;
            }
        }
    }

    /// Newton steps on the increments; how many it took, None where they do not settle.
    fn settle(&mut self, system: &mut System<'_>, at: Span, x: &[f64]) -> Option<usize> {
        let relative = system.problem.relative;
        let enough = (10.0 * f64::EPSILON / relative).max(relative.sqrt().min(0.03));
        let mut before = f64::NAN;
        for taken in 1..=NEWTON {
            for (stage, c) in C.iter().enumerate() {
                let own = stage * self.size..(stage + 1) * self.size;
                for ((to, x), z) in self.state.iter_mut().zip(x).zip(&self.increments[own.clone()])
                {
                    *to = x + z;
                }
                system.slopes(at.interval, at.t + c * at.h, &self.state, &mut self.slopes[own]);
            }
            let change = self.correct(system, at.h, x);
            for (z, change) in self.increments.iter_mut().zip(&self.change) {
                *z += change;
            }
            let rate = change / before;
            let left = if taken == 1 { change } else { change * rate / (1.0 - rate) };
            // Written so that what is no number does not settle.
            if change == 0.0 || (rate < 1.0 || taken == 1) && left <= enough {
                return Some(taken);
            }
            let goes_on = change.is_finite() && (taken == 1 || rate < 1.0);
            if !goes_on {
                return None;
            }
            before = change;
        }
        None
    }

    /// A Newton step, into `change`; its size in units of what errors may be.
    fn correct(&mut self, system: &System<'_>, h: f64, x: &[f64]) -> f64 {
        let (n, size) = (self.states, self.size);
        let mut square = 0.0;
        for (one, factors) in self.stages.iter_mut().enumerate() {
            for (row, to) in self.own.iter_mut().enumerate() {
                let k = one * n + row % n;
                let slope = |stage: usize| A[row / n][stage] * self.slopes[stage * size + k];
                let sum: f64 = (0..STAGES).map(slope).sum();
                *to = h * sum - self.increments[row / n * size + k];
            }
            factors.solve(&mut self.own);
            for (row, change) in self.own.iter().enumerate() {
                let k = one * n + row % n;
                self.change[row / n * size + k] = *change;
                let scaled = change / system.allowed(k, x[k], x[k]);
                square += scaled * scaled;
            }
        }
        (square / (STAGES * size) as f64).sqrt()
    }

    /// The filtered error of the step in units of what it may be, with the slopes given at the beginning.
    fn error(&mut self, system: &System<'_>, h: f64, x: &[f64], new: &[f64], first: &[f64]) -> f64 {
        let (n, size) = (self.states, self.size);
        for (k, to) in self.state.iter_mut().enumerate() {
            let sum: f64 = (0..STAGES).map(|s| ERROR[s] * self.increments[s * size + k]).sum();
            *to = first[k] + sum / h;
        }
        for (own, factors) in self.state.chunks_exact_mut(n).zip(&mut self.filter) {
            factors.solve(own);
        }
        norm(system, &self.state, x, new)
    }

    /// Coefficients of the polynomial through the increments of a state.
    fn polynomial(&self, k: usize) -> [f64; STAGES] {
        let [one, two, end] = std::array::from_fn(|stage| self.increments[stage * self.size + k]);
        let inner = |z: f64, c: f64| (z / c - end) / (1.0 - c);
        let (one, two) = (inner(one, C[0]), inner(two, C[1]));
        let slope = (two - one) / (C[1] - C[0]);
        [end, one - C[0] * slope, slope]
    }

    /// What the polynomial lacks within the step, in the same units.
    fn unseen(&mut self, system: &System<'_>, h: f64, x: &[f64], new: &[f64]) -> f64 {
        for k in 0..self.size {
            let [f0, f1, _] = self.polynomial(k);
            self.state[k] = UNSEEN * (h * self.first[k] - (f0 + f1));
        }
        norm(system, &self.state, x, new)
    }
}

impl Method for Implicit {
    fn begin(&mut self, system: &mut System<'_>, at: Span, x: &[f64]) {
        system.slopes(at.interval, at.t, x, &mut self.first);
        self.fresh = false;
    }

    fn step(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &mut [f64]) -> Tried {
        if !self.fresh {
            self.differentiate(system, at, x);
        }
        self.factor(at.h);
        self.guess(at.h);
        let Some(taken) = self.settle(system, at, x) else {
            (self.doubtful, self.before) = (true, None);
            return Tried { holds: false, factor: 0.5 };
        };
        let end = &self.increments[(STAGES - 1) * self.size..];
        for ((new, x), z) in new.iter_mut().zip(x).zip(end) {
            *new = x + z;
        }
        let first = std::mem::take(&mut self.first);
        let mut error = self.error(system, at.h, x, new, &first);
        if error >= 1.0 && self.doubtful {
            // Filtered once more: right where the first slopes are those of a fast transient.
            for (k, state) in self.state.iter_mut().enumerate() {
                *state += x[k];
            }
            let mut slopes = std::mem::take(&mut self.change);
            system.slopes(at.interval, at.t, &self.state, &mut slopes[..self.size]);
            error = self.error(system, at.h, x, new, &slopes);
            self.change = slopes;
        }
        self.first = first;
        if !system.history.idle() {
            error = error.max(self.unseen(system, at.h, x, new));
        }
        let rounds = 2.0 * NEWTON as f64 + 1.0;
        let wished = SAFETY * rounds / (rounds - 1.0 + taken as f64) * libm::pow(error, EXPONENT);
        let holds = error < 1.0;
        self.doubtful = !holds;
        Tried { holds, factor: if holds { wished.min(GROW) } else { wished.max(SHRINK) } }
    }

    fn accept(&mut self, system: &mut System<'_>, at: Span, x: &[f64], new: &[f64]) {
        for k in 0..self.size {
            self.terms[k] = self.polynomial(k);
        }
        self.before = Some(at.h);
        let terms = &self.terms;
        system.history.push(at.t, at.h, x, |k| {
            let mut all = [0.0; TERMS];
            all[..STAGES].copy_from_slice(&terms[k]);
            all
        });
        self.begin(system, Span { t: at.t + at.h, ..at }, new);
    }

    fn stiff(&self) -> bool {
        false
    }
}

/// Size of an error in units of what it may be.
fn norm(system: &System<'_>, error: &[f64], x: &[f64], new: &[f64]) -> f64 {
    let scaled = error.iter().enumerate().map(|(k, e)| e / system.allowed(k, x[k], new[k]));
    (scaled.map(|e| e * e).sum::<f64>() / error.len() as f64).sqrt()
}
