//! What drives the states of a record: inputs as polynomials between samples, and the exact way from sample to sample.

use super::{Course, Initial};
use crate::quadrature::Hold;
use crate::simd::{LANES, Lanes, Wide};

/// Samples that a smooth input is interpolated through.
const STENCIL: usize = 6;
/// A part of a step that is rounding.
const WHOLE: f64 = 1e-9;
/// Degree of the Taylor polynomial of a matrix exponential: its remainder at norm 1 is 1/19! = 8e-18.
const DEGREE: usize = 18;
/// Squarings of one; more overflow.
const MOST_SQUARINGS: f64 = 64.0;

/// What drives the states of a record.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drives {
    pub(super) inputs: Vec<Drive>,
    /// y, y', … of the free response, in units of the output and seconds; empty: nothing.
    pub(super) state: Vec<f64>,
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

impl Drive {
    /// No input for so many steps.
    pub(super) fn silent(steps: usize) -> Drive {
        Drive { parts: vec![1.0], width: 1, values: vec![Wide::ZERO; steps] }
    }

    pub(super) fn new(
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

impl Drive {
    /// v, v', … at the window's end less those at its start, of A(p)²v = u after an impulse of this size.
    #[inline(always)]
    pub(super) fn ends<L: Lanes>(
        &self,
        square: &[Wide],
        course: &Course,
        impulse: f64,
    ) -> Vec<Wide> {
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

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::model::discretise;
    use crate::simd::{Isa, Kernel};

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
}
