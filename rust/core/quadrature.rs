//! Quadrature: weights that turn samples into integrals, for rules, held inputs and uneven samples.
//!
//! A rule integrates samples v_0…v_N over a window of N intervals, (1/N) Σ w_k v_k; its weights follow
//! from moment conditions, which are solved here in exact fractions. A held input is integrated
//! exactly, cell by cell ([`Hold::cell`]).

use crate::Error;
use crate::math::sin_cos_turns_1;

mod corners;
mod weights;
pub use corners::{corners, corners_between};
pub(crate) use weights::Weights;

/// How a sampled signal is integrated when nothing is known of it between the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Left rectangles, report eq. (21a): error of order 1.
    Staircase,
    /// Report eq. (21b): error of order 2.
    Trapezoid,
    /// Simpson's rule, report eq. (21c): order 4, an even number of intervals, noise variance × 10/9.
    Parabolic,
    /// Gregory's rule with four end weights: order 5, any number of intervals from 3 on.
    Gregory,
}

/// How an input runs between its samples when that is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// Constant from each sample to the next.
    Zoh,
    /// Straight from each sample to the next.
    Foh,
}

/// Sizes of the weights of an interval, over its length, beyond which they amplify noise; those of even samples are 7/6.
const LARGEST: f64 = 2.0;
/// Most samples that a cubic is fitted to.
const MOST: usize = 10;

impl Rule {
    /// All rules, lowest order first.
    pub const ALL: [Rule; 4] = [Rule::Staircase, Rule::Trapezoid, Rule::Parabolic, Rule::Gregory];

    /// The name users see.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Rule::Staircase => "staircase",
            Rule::Trapezoid => "trapezoid",
            Rule::Parabolic => "parabolic",
            Rule::Gregory => "gregory",
        }
    }

    /// Samples that one local interpolant of the rule passes through.
    #[must_use]
    pub fn points(self) -> usize {
        match self {
            Rule::Staircase => 1,
            Rule::Trapezoid => 2,
            Rule::Parabolic => 3,
            Rule::Gregory => 4,
        }
    }

    /// Refuses a number of intervals that the rule cannot integrate.
    ///
    /// # Errors
    /// [`Error::Data`] where there are too few samples, [`Error::Spec`] where the parabolic rule meets
    /// an odd number of intervals.
    pub fn check(self, intervals: usize) -> Result<(), Error> {
        let least = (self.points() - 1).max(1);
        if intervals < least {
            return Err(Error::Data(format!(
                "the {} rule needs at least {} samples, the window has {}; take a longer record or rule=\"staircase\"",
                self.name(),
                least + 1,
                intervals + 1
            )));
        }
        if self == Rule::Parabolic && intervals % 2 == 1 {
            return Err(Error::Spec(format!(
                "the parabolic rule needs an even number of intervals, the window has {intervals} ({} samples); leave out a sample or use rule=\"gregory\"",
                intervals + 1
            )));
        }
        Ok(())
    }

    /// The weights w_0…w_N in units of the sampling interval; they sum to `intervals`.
    ///
    /// The ends of the trapezoid and of Gregory's rule differ from the plain sum by c_k, k < p, with
    /// Σ_k c_k k^j = B_{j+1}/(j+1) = −ζ(−j) for j < p (B₁ = −½): then the sum over k ≥ 0 integrates
    /// x^j, j < p, without an end term. Corrections of both ends add up where they meet.
    ///
    /// # Errors
    /// As [`Rule::check`].
    pub fn weights(self, intervals: usize) -> Result<Vec<f64>, Error> {
        self.check(intervals)?;
        let mut weights = vec![1.0; intervals + 1];
        match self {
            Rule::Staircase => weights[intervals] = 0.0,
            Rule::Trapezoid => correct_ends(&mut weights, &end_corrections::<1>()),
            Rule::Gregory => correct_ends(&mut weights, &end_corrections::<4>()),
            Rule::Parabolic => {
                let panel = panel_weights();
                weights.fill(0.0);
                for start in (0..intervals).step_by(2) {
                    for (w, p) in weights[start..].iter_mut().zip(&panel) {
                        *w += p.value();
                    }
                }
            }
        }
        Ok(weights)
    }

    /// Weights q_0…q_N of samples at the times `t` (increasing), in units of `t`; they sum to t_N − t_0.
    ///
    /// Each interval is integrated over the interpolant through neighbouring samples: constant from
    /// the left, linear, quadratic over pairs of intervals, cubic through the four samples around. Where samples
    /// lie close together the weights of such a cubic are large beside its interval, and their noise would
    /// outweigh all others: there it is fitted to more samples around, and at last mixed with the straight line.
    ///
    /// # Errors
    /// As [`Rule::check`]; [`Error::Data`] where times do not increase or are not finite.
    pub fn uneven_weights(self, t: &[f64]) -> Result<Vec<f64>, Error> {
        check_times(t)?;
        let intervals = t.len() - 1;
        self.check(intervals)?;
        let mut weights = vec![0.0; t.len()];
        let step = if self == Rule::Parabolic { 2 } else { 1 };
        for k in (0..intervals).step_by(step) {
            if self == Rule::Gregory {
                cubic_interval(t, k, &mut weights);
                continue;
            }
            let nodes = &t[k..k + self.points()];
            for (i, weight) in weights[k..].iter_mut().take(nodes.len()).enumerate() {
                *weight += integrate_lagrange(nodes, i, t[k], t[k + step]);
            }
        }
        Ok(weights)
    }
}

impl Hold {
    /// The name users see.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Hold::Zoh => "zoh",
            Hold::Foh => "foh",
        }
    }

    /// What the first two samples count in the signal's value at the start of a cell that it comes `ahead` of.
    pub(crate) fn start(self, ahead: f64) -> [f64; 2] {
        match self {
            Hold::Zoh => [1.0, 0.0],
            Hold::Foh => [1.0 - ahead, ahead],
        }
    }

    /// What the samples of one cell contribute to ∫₀¹ u(σ) e^{−ixσ} dσ, x = 2π·`turns`, when the signal
    /// comes `ahead` of its own grid by a part of a cell.
    ///
    /// At σ the signal stands at σ + `ahead` in its cells (0 ≤ `ahead` < 1), so that the cell splits in
    /// two. Returned are the complex factors (re, im) of u_k, u_{k+1}, u_{k+2}.
    #[must_use]
    pub fn cell(self, turns: f64, ahead: f64) -> [(f64, f64); 3] {
        let rest = 1.0 - ahead;
        let (a, b) = cell_moments(turns * rest);
        let (p, q) = cell_moments(turns * ahead);
        let (sin, cos) = sin_cos_turns_1(-turns * rest);
        let later = (cos, sin);
        match self {
            Hold::Zoh => [scale(rest, a), times(later, scale(ahead, p)), (0.0, 0.0)],
            Hold::Foh => {
                let rise = scale(rest * rest, b);
                let middle = plus(rise, scale(ahead * rest, a));
                let fall = plus(scale(ahead, p), scale(-ahead * ahead, q));
                [
                    plus(scale(rest * rest, a), scale(-1.0, rise)),
                    plus(middle, times(later, fall)),
                    times(later, scale(ahead * ahead, q)),
                ]
            }
        }
    }
}

/// ∫₀¹ e^{−ixσ} dσ and ∫₀¹ σ e^{−ixσ} dσ as (re, im), x = 2π·`turns`.
///
/// The closed forms (1−e^{−ix})/(ix) and (1−e^{−ix}(1+ix))/(ix)² cancel for small x; below 1 the power
/// series is summed, at most 20 terms.
#[must_use]
pub fn cell_moments(turns: f64) -> ((f64, f64), (f64, f64)) {
    let x = std::f64::consts::TAU * turns;
    if x.abs() < 1.0 {
        let (mut zeroth, mut first) = ((0.0, 0.0), (0.0, 0.0));
        let mut term = (1.0, 0.0); // (−ix)^k / k!
        for k in 0..20 {
            let k = f64::from(k);
            zeroth = plus(zeroth, scale(1.0 / (k + 1.0), term));
            first = plus(first, scale(1.0 / (k + 2.0), term));
            term = scale(x / (k + 1.0), (term.1, -term.0));
        }
        return (zeroth, first);
    }
    let (sin, cos) = sin_cos_turns_1(turns);
    let zeroth = (sin / x, (cos - 1.0) / x);
    // By parts: (zeroth − e^{−ix}) / (ix).
    let rest = (zeroth.0 - cos, zeroth.1 + sin);
    (zeroth, (rest.1 / x, -rest.0 / x))
}

/// Nodes in (0, 1), increasing, and weights (sum 1) of the Gauss–Legendre rule with `Q` nodes.
///
/// Roots of the Legendre polynomial by bisection between sign changes and Newton steps.
#[must_use]
pub fn gauss_legendre<const Q: usize>() -> ([f64; Q], [f64; Q]) {
    let (mut nodes, mut weights) = ([0.5; Q], [1.0; Q]);
    let cells = 40 * Q * Q;
    let mut found = 0;
    for cell in 0..cells {
        // An odd number of grid points per half keeps roots, zero among them, inside the cells.
        let edge = |i: usize| (2 * i) as f64 / cells as f64 - 1.0 - 0.3 / cells as f64;
        let (mut low, mut high) = (edge(cell), edge(cell + 1));
        let sign = legendre::<Q>(low).0;
        if found == Q || sign * legendre::<Q>(high).0 > 0.0 {
            continue;
        }
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if sign * legendre::<Q>(middle).0 > 0.0 { low = middle } else { high = middle }
        }
        let mut x = 0.5 * (low + high);
        for _ in 0..3 {
            let (value, slope) = legendre::<Q>(x);
            x -= value / slope;
        }
        let slope = legendre::<Q>(x).1;
        nodes[found] = 0.5 * (1.0 + x);
        weights[found] = 1.0 / ((1.0 - x * x) * slope * slope);
        found += 1;
    }
    (nodes, weights)
}

/// Value and slope of the Legendre polynomial of degree `Q`.
fn legendre<const Q: usize>(x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=Q {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, Q as f64 * (x * value - before) / (x * x - 1.0))
}

/// Refuses times that do not increase or are not finite.
pub(crate) fn check_times(t: &[f64]) -> Result<(), Error> {
    if t.len() < 2 {
        return Err(Error::Data(format!("at least 2 sample times are needed, got {}", t.len())));
    }
    if let Some(k) = t.iter().position(|x| !x.is_finite()) {
        return Err(Error::Data(format!("sample time {k} is {}; remove that sample", t[k])));
    }
    if let Some(k) = t.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(Error::Data(format!(
            "sample times must increase, but t[{}] = {} follows t[{k}] = {}; sort the record or remove the sample",
            k + 1,
            t[k + 1],
            t[k]
        )));
    }
    Ok(())
}

/// Adds the weights of interval `k`: of the cubic through the samples around it, as many as keep them small.
fn cubic_interval(t: &[f64], k: usize, weights: &mut [f64]) {
    let length = t[k + 1] - t[k];
    let (mut own, mut part, mut first) = ([0.0; MOST], 1.0, 0);
    for count in (4..=MOST).step_by(2).filter(|count| *count <= t.len()) {
        first = (k + 1).saturating_sub(count / 2).min(t.len() - count);
        own.fill(0.0);
        integrate_cubic(&t[first..first + count], (t[k], t[k + 1]), &mut own);
        let size: f64 = own.iter().map(|q| q.abs()).sum();
        part = ((LARGEST - 1.0) * length / (size - length)).clamp(0.0, 1.0);
        if size <= LARGEST * length {
            part = 1.0;
            break;
        }
    }
    for (weight, q) in weights[first..].iter_mut().zip(&own) {
        *weight += part * q;
    }
    for weight in &mut weights[k..=k + 1] {
        *weight += 0.5 * (1.0 - part) * length;
    }
}

/// What each node has of the integral of the cubic that is closest to them in the least squares, by polynomials
/// that are orthogonal on the nodes.
fn integrate_cubic(nodes: &[f64], (low, high): (f64, f64), out: &mut [f64]) {
    let (places, gauss) = gauss_legendre::<2>();
    let (middle, half) =
        (0.5 * (nodes[0] + nodes[nodes.len() - 1]), 0.5 * (nodes[nodes.len() - 1] - nodes[0]));
    let scaled = |t: f64| (t - middle) / half;
    let at = places.map(|p| scaled(low + (high - low) * p));
    // Values of the polynomials on the nodes, then at both places.
    let count = nodes.len();
    let x = |i: usize| if i < count { scaled(nodes[i]) } else { at[i - count] };
    let mut all = [([1.0; MOST + 2], 0.0); 4];
    for degree in 0..4 {
        let (lower, rest) = all.split_at_mut(degree);
        let (now, power) = &mut rest[0];
        if let Some((before, _)) = lower.last() {
            for (i, value) in now[..count + 2].iter_mut().enumerate() {
                *value = x(i) * before[i];
            }
        }
        // Twice: on two clusters of nodes a square nearly vanishes, and once would leave rounding of its size.
        for _ in 0..2 {
            for (p, power) in lower.iter() {
                let along = dot(&now[..count], &p[..count]) / power;
                now[..count + 2].iter_mut().zip(p).for_each(|(value, p)| *value -= along * p);
            }
        }
        *power = dot(&now[..count], &now[..count]);
        let mean = gauss[0] * now[count] + gauss[1] * now[count + 1];
        for (to, p) in out.iter_mut().zip(&now[..count]) {
            *to += p * (high - low) * mean / *power;
        }
    }
}

/// Σ aᵢ bᵢ.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// ∫ from `low` to `high` of the Lagrange polynomial `i` on up to four nodes: two Gauss nodes are exact.
fn integrate_lagrange(nodes: &[f64], i: usize, low: f64, high: f64) -> f64 {
    let (places, weights) = gauss_legendre::<2>();
    let mut sum = 0.0;
    for (place, weight) in places.iter().zip(&weights) {
        let x = low + place * (high - low);
        let others = nodes.iter().enumerate().filter(|&(j, _)| j != i);
        sum += weight * others.map(|(_, node)| (x - node) / (nodes[i] - node)).product::<f64>();
    }
    sum * (high - low)
}

/// Adds the end corrections at both ends.
fn correct_ends(weights: &mut [f64], corrections: &[Ratio]) {
    let last = weights.len() - 1;
    for (k, c) in corrections.iter().enumerate() {
        weights[k] += c.value();
        weights[last - k] += c.value();
    }
}

/// The corrections c_0…c_{P−1} of one end.
fn end_corrections<const P: usize>() -> [Ratio; P] {
    let bernoulli = bernoulli(P + 1);
    solve_moments(std::array::from_fn(|j| bernoulli[j + 1].over(j as i128 + 1)))
}

/// Weights on 0, 1, 2 that integrate 1, x, x² over [0, 2].
fn panel_weights() -> [Ratio; 3] {
    solve_moments(std::array::from_fn(|j| Ratio::new(1 << (j + 1), j as i128 + 1)))
}

/// Bernoulli numbers B_0… from Σ_{j≤m} C(m+1, j) B_j = 0, so that B_1 = −½.
fn bernoulli(count: usize) -> Vec<Ratio> {
    let mut numbers = vec![Ratio::new(1, 1)];
    for m in 1..count {
        let (mut sum, mut choose) = (Ratio::new(0, 1), 1_i128);
        for (j, b) in numbers.iter().enumerate() {
            sum = sum.minus(b.times(Ratio::new(choose, 1)));
            choose = choose * (m + 1 - j) as i128 / (j as i128 + 1);
        }
        numbers.push(sum.over(m as i128 + 1));
    }
    numbers
}

/// Solves Σ_k c_k k^j = `moments[j]` on the nodes k = 0…P−1 by elimination.
fn solve_moments<const P: usize>(moments: [Ratio; P]) -> [Ratio; P] {
    let mut right = moments;
    let mut rows: [[Ratio; P]; P] =
        std::array::from_fn(|j| std::array::from_fn(|k| Ratio::new((k as i128).pow(j as u32), 1)));
    for pivot in 0..P {
        // A Vandermonde matrix on increasing nodes needs no exchange of rows.
        for row in (0..P).filter(|&row| row != pivot) {
            let factor = rows[row][pivot].divided(rows[pivot][pivot]);
            let take = rows[pivot];
            for (entry, p) in rows[row].iter_mut().zip(take) {
                *entry = entry.minus(factor.times(p));
            }
            right[row] = right[row].minus(factor.times(right[pivot]));
        }
    }
    std::array::from_fn(|k| right[k].divided(rows[k][k]))
}

/// An exact fraction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ratio {
    over: i128,
    under: i128,
}

impl Ratio {
    fn new(over: i128, under: i128) -> Ratio {
        let (mut a, mut b) = (over.abs(), under.abs());
        while b != 0 {
            (a, b) = (b, a % b);
        }
        let by = a.max(1) * under.signum();
        Ratio { over: over / by, under: under / by }
    }
    fn minus(self, b: Ratio) -> Ratio {
        Ratio::new(self.over * b.under - b.over * self.under, self.under * b.under)
    }
    fn times(self, b: Ratio) -> Ratio {
        Ratio::new(self.over * b.over, self.under * b.under)
    }
    fn divided(self, b: Ratio) -> Ratio {
        Ratio::new(self.over * b.under, self.under * b.over)
    }
    fn over(self, b: i128) -> Ratio {
        Ratio::new(self.over, self.under * b)
    }
    fn value(self) -> f64 {
        self.over as f64 / self.under as f64
    }
}

fn plus(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 + b.0, a.1 + b.1)
}

fn scale(by: f64, a: (f64, f64)) -> (f64, f64) {
    (by * a.0, by * a.1)
}

pub(crate) fn times(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

#[cfg(test)]
mod tests;
