//! Records that begin in a known state: their transient as a function of the parameters.
//!
//! The lines see the states at both ends through the transient T alone, and free coefficients of T leave both unknown.
//! Where the record begins at rest, z = A(p)⁻¹u runs from nothing. With δ_i = (z⁽ⁱ⁾(end) − z⁽ⁱ⁾(start))/T of the
//! window, y = B(p)z and u = A(p)z, integration by parts gives AY − BU = T(s), Bezout's form of A and B in δ:
//!
//! ```text
//! T(s) = Σ_d s^d Σ_{k,l} e α_k β_l δ_{k+l−1−d},     e = 1 where k ≤ d < l, −1 where l ≤ d < k.
//! ```
//!
//! It is linear in B. Its slopes by α_j follow from v = A(p)⁻²u, of which z = A(p)v is made: ∂z/∂α_j = −p^j v. The
//! response from sample to sample is exact for held inputs; smooth ones go through polynomials of six samples. A given
//! state adds the response to an impulse through Σ_l s^l Σ_{k>l} α_k y⁽ᵏ⁻¹⁻ˡ⁾(0), which begins with y, y', … as given.

use std::sync::Arc;

use crate::modulation::Column;
use crate::quadrature::Hold;
use crate::simd::{LANES, Lanes, Wide};
use crate::structure::Structure;

/// Samples that a smooth input is interpolated through.
const STENCIL: usize = 6;
/// Most rounds of the transient and of the estimate that follows, and the relative change of θ that ends them.
pub(crate) const ROUNDS: usize = 20;
pub(crate) const SETTLED: f64 = 1e-4;
/// Degree of the Taylor polynomial of a matrix exponential: its remainder at norm 1 is 1/19! = 8e-18.
const DEGREE: usize = 18;
/// Squarings of one; more overflow.
const MOST_SQUARINGS: f64 = 64.0;
/// A part of a step that is rounding.
const WHOLE: f64 = 1e-9;

/// What is known of the state at a record's first sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Initial {
    /// Nothing.
    Unknown,
    /// Nothing moved, and the inputs act from the first sample on; late ones were before as they begin.
    Zero,
    /// All was steady under the inputs' first values.
    Rest,
    /// That at the record's end: whole periods of a steady response.
    Periodic,
}

/// One record as its states run through it.
#[derive(Debug, Clone)]
pub(crate) struct Course {
    /// In units of the band edge, and in seconds.
    pub step: f64,
    pub seconds: f64,
    /// Steps before the window, and in it.
    pub lead: usize,
    pub intervals: usize,
}

/// A problem whose records begin in a known state.
#[derive(Debug, Clone)]
pub(crate) struct KnownStart {
    pub courses: Vec<Course>,
    /// How each input runs between samples, and how many seconds it is late.
    pub inputs: Vec<(Option<Hold>, f64)>,
    pub initial: Initial,
    /// y, y', … of the free response of each record, if they are given.
    pub states: Vec<Vec<f64>>,
}

/// What drives the states of a record.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drives {
    inputs: Vec<Drive>,
    /// y, y', … of the free response, in units of the output and seconds; empty: nothing.
    state: Vec<f64>,
}

/// An input as polynomials between breakpoints: one a step, two where it changes within a step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drive {
    /// Lengths of the parts of a step.
    parts: Vec<f64>,
    /// Coefficients of each polynomial.
    width: usize,
    /// Of each part of each step, the coefficients of σⁱ/i!, σ from 0 to 1 in the part.
    values: Vec<Wide>,
}

/// T of a record by θ: t + Dθ.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tie {
    pub drives: Arc<Drives>,
    /// Coefficients that are tied, and how many numbers θ has.
    pub tied: usize,
    parameters: usize,
    /// t, then D row by row.
    pub base: Vec<Wide>,
    pub slopes: Vec<Wide>,
    /// Whether it is in force.
    pub active: bool,
}

/// Whether parameters have moved by more than this part of them, from what they were and what they are.
pub(crate) fn moved(settled: f64, theta: impl Iterator<Item = (f64, f64)>) -> bool {
    let (mut change, mut size) = (0.0, 0.0);
    for (before, now) in theta {
        change += (now - before) * (now - before);
        size += now * now;
    }
    change > settled * settled * size
}

impl KnownStart {
    /// Whether the transient is nothing, whatever θ.
    pub fn periodic(&self) -> bool {
        self.initial == Initial::Periodic
    }

    /// What the inputs of record `k` and the state do: eight lanes, a function of (lane) each.
    pub fn drives<'a>(
        &self,
        k: usize,
        units: &[f64],
        samples: impl Fn(usize, usize) -> &'a [f64],
    ) -> Drives {
        let course = &self.courses[k];
        let one = |(input, (hold, late)): (usize, &(Option<Hold>, f64))| {
            let lanes: [&[f64]; LANES] = std::array::from_fn(|lane| samples(lane, input));
            let unit = units.get(1 + input).copied().unwrap_or(1.0);
            let late = late / course.seconds;
            Drive::new(*hold, late, self.initial, course.lead + course.intervals, unit, lanes)
        };
        let unit = units.first().copied().unwrap_or(1.0);
        let state = self.states.get(k).into_iter().flatten().map(|x| x / unit);
        Drives { inputs: self.inputs.iter().enumerate().map(one).collect(), state: state.collect() }
    }
}

impl Drive {
    /// No input for so many steps.
    fn silent(steps: usize) -> Drive {
        Drive { parts: vec![1.0], width: 1, values: vec![Wide::ZERO; steps] }
    }

    fn new(
        hold: Option<Hold>,
        late: f64,
        initial: Initial,
        steps: usize,
        unit: f64,
        samples: [&[f64]; LANES],
    ) -> Drive {
        let width = match hold {
            Some(Hold::Zoh) => 1,
            Some(Hold::Foh) => 2,
            None => STENCIL,
        };
        let whole = late.floor();
        let part = late - whole;
        let (whole, part) = match part {
            p if p < WHOLE => (whole as usize, 0.0),
            p if p > 1.0 - WHOLE => (whole as usize + 1, 0.0),
            p => (whole as usize, p),
        };
        let parts = if part == 0.0 { vec![1.0] } else { vec![part, 1.0 - part] };
        let mut values = vec![Wide::ZERO; steps * parts.len() * width];
        for lane in 0..LANES {
            let u = samples[lane];
            if lane > 0 && std::ptr::eq(u, samples[0]) {
                values.iter_mut().for_each(|v| v.0[lane] = v.0[0]);
                continue;
            }
            let base = if initial == Initial::Rest { u[0] } else { 0.0 };
            for k in 0..steps {
                for (at, length) in parts.iter().enumerate() {
                    // The step of the input that acts here, and where in it the part begins.
                    let (source, from) = match (part > 0.0, at) {
                        (true, 0) => (k.checked_sub(whole + 1), 1.0 - part),
                        _ => (k.checked_sub(whole), 0.0),
                    };
                    let mut own = match source {
                        Some(source) => between(hold, u, base, source),
                        // As it began, so it was.
                        None => std::array::from_fn(|i| if i == 0 { u[0] - base } else { 0.0 }),
                    };
                    shift(&mut own[..width], from, *length);
                    let to = &mut values[(k * parts.len() + at) * width..][..width];
                    for (to, value) in to.iter_mut().zip(&own) {
                        to.0[lane] = value / unit;
                    }
                }
            }
        }
        Drive { parts, width, values }
    }
}

/// The input between samples k and k + 1: coefficients of σⁱ/i!.
fn between(hold: Option<Hold>, u: &[f64], base: f64, k: usize) -> [f64; STENCIL] {
    let mut c = [0.0; STENCIL];
    match hold {
        Some(Hold::Zoh) => c[0] = u[k] - base,
        Some(Hold::Foh) => (c[0], c[1]) = (u[k] - base, u[k + 1] - u[k]),
        None => {
            let first = k.saturating_sub(STENCIL / 2 - 1).min(u.len() - STENCIL);
            // Newton's divided differences at whole numbers, then powers of σ = position − k.
            let mut d: [f64; STENCIL] = std::array::from_fn(|i| u[first + i] - base);
            for order in 1..STENCIL {
                for i in (order..STENCIL).rev() {
                    d[i] = (d[i] - d[i - 1]) / order as f64;
                }
            }
            for i in (0..STENCIL).rev() {
                // c ← c·(σ − (first + i − k)) + d_i.
                let node = (first + i) as f64 - k as f64;
                for j in (0..STENCIL).rev() {
                    let below = if j > 0 { c[j - 1] } else { d[i] };
                    c[j] = below - node * c[j];
                }
            }
            let mut factorial = 1.0;
            for (i, c) in c.iter_mut().enumerate().skip(1) {
                factorial *= i as f64;
                *c *= factorial;
            }
        }
    }
    c
}

/// Σ c_i σⁱ/i! in σ = from + length·σ'.
fn shift(c: &mut [f64], from: f64, length: f64) {
    if from != 0.0 {
        for i in 0..c.len() {
            let (mut sum, mut by) = (0.0, 1.0);
            for (k, next) in c[i..].iter().enumerate() {
                sum += by * next;
                by *= from / (k + 1) as f64;
            }
            c[i] = sum;
        }
    }
    let mut by = 1.0;
    for c in c {
        *c *= by;
        by *= length;
    }
}

/// One part of a step of v = A⁻²u: the states' matrix, and what each coefficient of the input adds.
struct Part {
    free: Vec<Wide>,
    gains: Vec<Wide>,
}

impl Part {
    /// `square`: the coefficients of A² in rising powers; `h`: the length of the part.
    #[inline(always)]
    fn new<L: Lanes>(square: &[Wide], width: usize, h: f64) -> Part {
        let n = square.len() - 1;
        let size = n + width;
        // d/dσ of the states and of the input's derivatives.
        let mut m = vec![Wide::ZERO; size * size];
        for i in 0..n {
            m[i * size + i + 1] = Wide::splat(h);
        }
        for (k, c) in square[..n].iter().enumerate() {
            (L::load(c) * L::splat(-h)).store(&mut m[(n - 1) * size + k]);
        }
        for i in n..size - 1 {
            m[i * size + i + 1] = Wide::splat(1.0);
        }
        let whole = exponential::<L>(size, m);
        let rows = || whole.chunks_exact(size).take(n);
        Part {
            free: rows().flat_map(|row| &row[..n]).copied().collect(),
            gains: (n..size).flat_map(|j| rows().map(move |row| row[j])).collect(),
        }
    }
}

/// e^M in every lane by scaling and squaring, as each lane needs it.
#[inline(always)]
fn exponential<L: Lanes>(n: usize, mut m: Vec<Wide>) -> Vec<Wide> {
    let (mut scale, mut squarings) = ([1.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let column = |j: usize| m[j..].iter().step_by(n).map(|x| x.0[lane].abs()).sum::<f64>();
        let norm = (0..n).map(column).fold(0.0, f64::max);
        while norm * scale[lane] > 1.0 && squarings[lane] < MOST_SQUARINGS {
            scale[lane] *= 0.5;
            squarings[lane] += 1.0;
        }
    }
    let by = L::load(&Wide(scale));
    for x in &mut m {
        (L::load(x) * by).store(x);
    }
    let mut sum = vec![Wide::ZERO; n * n];
    let mut next = sum.clone();
    for i in 0..n {
        sum[i * n + i] = Wide::splat(1.0);
    }
    for k in (1..=DEGREE).rev() {
        product::<L>(n, &m, &sum, &mut next);
        let part = L::splat(1.0 / k as f64);
        for x in &mut next {
            (L::load(x) * part).store(x);
        }
        for i in 0..n {
            let x = &mut next[i * n + i];
            (L::load(x) + L::splat(1.0)).store(x);
        }
        std::mem::swap(&mut sum, &mut next);
    }
    let most = squarings.iter().copied().fold(0.0, f64::max);
    let wanted = L::load(&Wide(squarings));
    for done in 0..most as usize {
        product::<L>(n, &sum, &sum, &mut next);
        let done = L::splat(done as f64);
        for (sum, next) in sum.iter_mut().zip(&next) {
            done.select_lt(wanted, L::load(next), L::load(sum)).store(sum);
        }
    }
    sum
}

#[inline(always)]
fn product<L: Lanes>(n: usize, a: &[Wide], b: &[Wide], out: &mut [Wide]) {
    for (a, out) in a.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
        for (j, out) in out.iter_mut().enumerate() {
            let mut sum = L::splat(0.0);
            for (k, a) in a.iter().enumerate() {
                sum = L::load(a).mul_add(L::load(&b[k * n + j]), sum);
            }
            sum.store(out);
        }
    }
}

impl Tie {
    /// For `tied` coefficients and θ of so many numbers.
    pub fn new(tied: usize, parameters: usize) -> Tie {
        let wide = |n: usize| vec![Wide::ZERO; n];
        Tie {
            drives: Arc::default(),
            tied,
            parameters,
            base: wide(tied),
            slopes: wide(tied * parameters),
            active: false,
        }
    }

    /// In force or not; where it is, T is nothing until it is set.
    pub fn begin(&mut self, active: bool) {
        self.active = active;
        self.base.fill(Wide::ZERO);
        self.slopes.fill(Wide::ZERO);
    }

    /// T at θ.
    #[inline(always)]
    pub fn at<L: Lanes>(&self, theta: &[Wide], out: &mut [Wide]) {
        for (i, out) in out[..self.tied].iter_mut().enumerate() {
            let mut sum = L::load(&self.base[i]);
            let row = &self.slopes[i * self.parameters..][..self.parameters];
            for (slope, theta) in row.iter().zip(theta) {
                sum = L::load(slope).mul_add(L::load(theta), sum);
            }
            sum.store(out);
        }
    }

    /// The system [T, θ | target] with T = t + Dθ put in: what is left of T's own equations is T = 0.
    #[inline(always)]
    pub fn put_in<L: Lanes>(
        &self,
        m: &mut [Wide],
        diagonal: &mut [Wide],
        transient: usize,
        symmetric: bool,
    ) {
        let (p, size) = (self.parameters, transient + self.parameters);
        let width = size + 1;
        if symmetric {
            for i in 0..size {
                for j in 0..i {
                    m[i * width + j] = m[j * width + i];
                }
            }
        }
        for r in 0..size {
            let row = &mut m[r * width..][..width];
            for i in 0..self.tied {
                let own = L::load(&row[i]);
                for j in 0..p {
                    let to = &mut row[transient + j];
                    own.mul_add(L::load(&self.slopes[i * p + j]), L::load(to)).store(to);
                }
                (-own).mul_add(L::load(&self.base[i]), L::load(&row[size])).store(&mut row[size]);
            }
        }
        for i in 0..self.tied {
            for j in 0..p {
                let slope = L::load(&self.slopes[i * p + j]);
                for c in 0..width {
                    let from = L::load(&m[i * width + c]);
                    let to = &mut m[(transient + j) * width + c];
                    from.mul_add(slope, L::load(to)).store(to);
                }
            }
        }
        for i in 0..self.tied {
            for c in 0..size {
                L::splat(0.0).store(&mut m[i * width + c]);
                L::splat(0.0).store(&mut m[c * width + i]);
            }
            L::splat(0.0).store(&mut m[i * width + size]);
            L::load(&diagonal[i]).store(&mut m[i * width + i]);
        }
        for j in 0..size {
            L::load(&m[j * width + j]).store(&mut diagonal[j]);
        }
    }

    /// What takes T out of a row of θ: its projection on the free columns stays, tied ones follow θ.
    #[inline(always)]
    pub fn project(&self, projection: &mut [Wide]) {
        for (to, slope) in projection.iter_mut().zip(&self.slopes) {
            *to = Wide(slope.0.map(|v| -v));
        }
    }

    /// t and D at θ, time in units of the band edge.
    #[inline(always)]
    pub fn set<L: Lanes>(
        &mut self,
        structure: &Structure,
        columns: &[Column],
        course: &Course,
        theta: &[Wide],
    ) {
        let (n, p) = (structure.order, self.parameters);
        self.base.fill(Wide::ZERO);
        self.slopes.fill(Wide::ZERO);
        // Rising powers, monic.
        let mut a: Vec<Wide> = theta[..n].iter().rev().copied().collect();
        a.push(Wide::splat(1.0));
        let mut square = vec![Wide::ZERO; 2 * n + 1];
        for i in 0..=n {
            for j in 0..=n {
                let sum = &mut square[i + j];
                L::load(&a[i]).mul_add(L::load(&a[j]), L::load(sum)).store(sum);
            }
        }
        let drives = Arc::clone(&self.drives);
        let mut first = n;
        for (degree, drive) in structure.numerators.iter().zip(&drives.inputs) {
            let Some(degree) = degree else { continue };
            let b: Vec<Wide> = theta[first..=first + degree].iter().rev().copied().collect();
            let v = drive.ends::<L>(&square, course, 0.0);
            self.add::<L>(columns, course, (&a, &b, &v), |row, l, by| {
                let to = &mut row[first + degree - l];
                (L::load(to) + by).store(to);
            });
            first += degree + 1;
        }
        if !drives.state.is_empty() {
            let (rate, mut power) = (course.seconds / course.step, 1.0);
            let mut own = drives.state.clone();
            for x in &mut own {
                *x *= power;
                power *= rate;
            }
            let through = |l: usize| {
                let mut sum = Wide::ZERO;
                for (a, x) in a[l + 1..].iter().zip(&own) {
                    (L::load(a).mul_add(L::splat(*x), L::load(&sum))).store(&mut sum);
                }
                sum
            };
            let b: Vec<Wide> = (0..n).map(through).collect();
            let silent = Drive::silent(course.lead + course.intervals);
            let v = silent.ends::<L>(&square, course, 1.0);
            self.add::<L>(columns, course, (&a, &b, &v), |row, l, by| {
                for (k, x) in (l + 1..n).zip(&own) {
                    let to = &mut row[n - 1 - k];
                    by.mul_add(L::splat(*x), L::load(to)).store(to);
                }
            });
        }
        // t = T − Dθ.
        for d in 0..self.tied {
            let mut sum = L::load(&self.base[d]);
            for (slope, theta) in self.slopes[d * p..][..p].iter().zip(theta) {
                sum = (-L::load(slope)).mul_add(L::load(theta), sum);
            }
            sum.store(&mut self.base[d]);
        }
        self.active = true;
    }

    /// Adds what y = B(p)z, A(p)z = u leaves in T, and its slopes; `by_beta` puts those by β_l into a row.
    #[inline(always)]
    fn add<L: Lanes>(
        &mut self,
        columns: &[Column],
        course: &Course,
        (a, b, v): (&[Wide], &[Wide], &[Wide]),
        by_beta: impl Fn(&mut [Wide], usize, L),
    ) {
        let (n, p) = (a.len() - 1, self.parameters);
        let per_duration = L::splat(1.0 / (course.step * course.intervals as f64));
        // δ_i of z = A(p)v.
        let mut z = vec![Wide::ZERO; n];
        for (i, z) in z.iter_mut().enumerate() {
            let mut sum = L::splat(0.0);
            for (k, a) in a.iter().enumerate() {
                let known = i + k < 2 * n;
                sum = if known { L::load(a).mul_add(L::load(&v[i + k]), sum) } else { sum };
            }
            (sum * per_duration).store(z);
        }
        for (d, column) in columns[..self.tied.min(n)].iter().enumerate() {
            // Columns hold −x^d where s^d is i^d x^d.
            let sign = if d / 2 % 2 == 0 { 1.0 } else { -1.0 } * -column.sign;
            let sign = L::splat(sign);
            let row = &mut self.slopes[d * p..][..p];
            let mut value = L::splat(0.0);
            for k in 0..=n {
                for (l, beta) in b.iter().enumerate() {
                    let up = k <= d && d < l;
                    if !(up || (l <= d && d < k)) {
                        continue;
                    }
                    let e = if up { sign } else { -sign };
                    let i = k + l - 1 - d;
                    let (alpha, beta) = (L::load(&a[k]) * e, L::load(beta));
                    let delta = L::load(&z[i]);
                    value = (alpha * beta).mul_add(delta, value);
                    // By β_l, and by α_k where it stands as a factor.
                    by_beta(row, l, alpha * delta);
                    if k < n {
                        let to = &mut row[n - 1 - k];
                        (beta * e).mul_add(delta, L::load(to)).store(to);
                    }
                    // By each α_j through z.
                    let both = -(alpha * beta) * per_duration;
                    for j in 0..n {
                        let to = &mut row[n - 1 - j];
                        both.mul_add(L::load(&v[i + j]), L::load(to)).store(to);
                    }
                }
            }
            let base = &mut self.base[d];
            (L::load(base) + value).store(base);
        }
    }
}

impl Drive {
    /// v, v', … at the window's end less those at its start, of A(p)²v = u after an impulse of this size.
    #[inline(always)]
    fn ends<L: Lanes>(&self, square: &[Wide], course: &Course, impulse: f64) -> Vec<Wide> {
        let n = square.len() - 1;
        let mut parts = Vec::with_capacity(self.parts.len());
        for length in &self.parts {
            parts.push(Part::new::<L>(square, self.width, length * course.step));
        }
        let (mut x, mut next) = (vec![Wide::ZERO; n], vec![Wide::ZERO; n]);
        x[n - 1] = Wide::splat(impulse);
        let mut start = x.clone();
        let mut values = self.values.chunks_exact(self.width);
        for k in 0..course.lead + course.intervals {
            if k == course.lead {
                start.copy_from_slice(&x);
            }
            for (part, own) in parts.iter().zip(&mut values) {
                for (i, next) in next.iter_mut().enumerate() {
                    let mut sum = L::splat(0.0);
                    for (free, x) in part.free[i * n..][..n].iter().zip(&x) {
                        sum = L::load(free).mul_add(L::load(x), sum);
                    }
                    for (j, value) in own.iter().enumerate() {
                        sum = L::load(&part.gains[j * n + i]).mul_add(L::load(value), sum);
                    }
                    sum.store(next);
                }
                std::mem::swap(&mut x, &mut next);
            }
        }
        for (x, start) in x.iter_mut().zip(&start) {
            (L::load(x) - L::load(start)).store(x);
        }
        x
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::model::discretise;
    use crate::modulation::transient_columns;
    use crate::simd::{Isa, Kernel};
    use crate::structure::Trend;

    const THETA: [f64; 4] = [0.7, 0.4, 0.3, 0.2]; // s² + .7 s + .4, .3 s + .2
    const STEPS: usize = 40;

    struct Exponential(usize, Vec<Wide>);

    impl Kernel for Exponential {
        type Output = Vec<Wide>;
        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<Wide> {
            exponential::<L>(self.0, self.1)
        }
    }

    #[test]
    fn exponentials_of_lanes_are_those_of_one_matrix() {
        let own = |lane: usize| -> Vec<f64> {
            (0..9).map(|k| (k as f64 * 1.3 + lane as f64).sin() * (lane + 1) as f64).collect()
        };
        let all = (0..9).map(|k| Wide(std::array::from_fn(|lane| own(lane)[k]))).collect();
        let found = Isa::Plain.run(Exponential(3, all));
        for lane in 0..LANES {
            let wanted = discretise::exponential(3, &own(lane));
            for (found, wanted) in found.iter().zip(&wanted) {
                assert!((found.0[lane] - wanted).abs() <= 1e-12 * wanted.abs().max(1.0));
            }
        }
    }

    #[test]
    fn inputs_go_through_their_samples() {
        let u: Vec<f64> = (0..12).map(|k| (0.4 * k as f64).sin()).collect();
        for k in 0..11 {
            let sum = |c: [f64; STENCIL], at: f64| {
                let mut by = 1.0;
                let part = |(i, c): (usize, &f64)| {
                    by *= if i > 0 { at / i as f64 } else { 1.0 };
                    c * by
                };
                c.iter().enumerate().map(part).sum::<f64>()
            };
            let smooth = between(None, &u, 0.1, k);
            assert!((sum(smooth, 0.5) + 0.1 - (0.4 * (k as f64 + 0.5)).sin()).abs() < 2e-4);
            for hold in [None, Some(Hold::Foh)] {
                let c = between(hold, &u, 0.1, k);
                assert!((sum(c, 0.0) + 0.1 - u[k]).abs() < 1e-12);
                assert!((sum(c, 1.0) + 0.1 - u[k + 1]).abs() < 1e-12);
                let mut late = c;
                shift(&mut late, 0.25, 0.5);
                assert!((sum(late, 0.6) - sum(c, 0.55)).abs() < 1e-12);
            }
            assert_eq!(between(Some(Hold::Zoh), &u, 0.0, k)[..2], [u[k], 0.0]);
        }
    }

    struct Set<'a>(&'a mut Tie, &'a Structure, &'a [Wide]);

    impl Kernel for Set<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            let course = Course { step: 0.3, seconds: 1.0, lead: 0, intervals: STEPS };
            let columns = transient_columns(self.1.order, true, Trend::None);
            self.0.set::<L>(self.1, &columns, &course, self.2);
        }
    }

    /// T at θ and its slopes.
    fn tied(
        structure: &Structure,
        theta: &[f64],
        hold: Option<Hold>,
        state: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = (0..=STEPS).map(|k| (0.2 * k as f64).cos()).collect();
        let mut tie = Tie::new(structure.order, theta.len());
        let drive = Drive::new(hold, 0.0, Initial::Zero, STEPS, 1.0, [&u; LANES]);
        tie.drives = Arc::new(Drives { inputs: vec![drive], state: state.to_vec() });
        let wide: Vec<Wide> = theta.iter().map(|x| Wide::splat(*x)).collect();
        Isa::Plain.run(Set(&mut tie, structure, &wide));
        let row = |d: usize| {
            let slopes = tie.slopes[d * theta.len()..][..theta.len()].iter().zip(theta);
            slopes.fold(tie.base[d].0[0], |sum, (slope, x)| sum + slope.0[0] * x)
        };
        let values = (0..structure.order).map(row).collect();
        (values, tie.slopes.iter().map(|x| x.0[0]).collect())
    }

    #[test]
    fn one_pole_has_its_end_for_a_transient() {
        let structure = Structure::new(1, vec![Some(0)]).unwrap();
        let (a, b, h) = (0.8f64, 0.5f64, 0.3f64);
        let decay = (-a * h).exp();
        let end =
            (0..STEPS).fold(0.0, |z, k| decay * z + (1.0 - decay) / a * (0.2 * k as f64).cos());
        let (found, _) = tied(&structure, &[a, b], Some(Hold::Zoh), &[]);
        assert!((found[0].abs() - b * end.abs() / (STEPS as f64 * h)).abs() < 1e-12);
        // From a state, what decays of it as well.
        let (moved, _) = tied(&structure, &[a, b], Some(Hold::Zoh), &[0.6]);
        let decayed = 0.6 * ((-a * h * STEPS as f64).exp() - 1.0) / (STEPS as f64 * h);
        let sign = (found[0] * end).signum();
        assert!((moved[0] - found[0] - sign * decayed).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let structure = Structure::new(2, vec![Some(1)]).unwrap();
        let cases = [(Some(Hold::Zoh), vec![]), (Some(Hold::Foh), vec![0.4, -0.7]), (None, vec![])];
        for (hold, state) in cases {
            let (_, slopes) = tied(&structure, &THETA, hold, &state);
            for k in 0..THETA.len() {
                let moved = |by: f64| {
                    let mut theta = THETA;
                    theta[k] += by;
                    tied(&structure, &theta, hold, &state).0
                };
                for (d, (up, down)) in moved(1e-5).iter().zip(moved(-1e-5)).enumerate() {
                    let wanted = (up - down) / 2e-5;
                    assert!(
                        (slopes[d * THETA.len() + k] - wanted).abs() < 1e-8,
                        "{hold:?} {d} {k}"
                    );
                }
            }
        }
    }
}
