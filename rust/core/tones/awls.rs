//! `awls`: tones from the lines around them by reweighted least squares.
//!
//! On the lines z = e^{2πim/n} of n samples, A(z)Y(m) of a sum of tones is exactly a polynomial in z, what the ends
//! of the record add. Undamped tones: A = Π(z + 1/z − x_i), x_i = 2cos ω_i, real there; damped ones:
//! A = Π(z + |λ_i|²/z − 2Re λ_i). Divided by A itself, the last estimate of which weighs the lines, all columns are
//! sums of the sections' fractions: A_next/A = 1 + Σ(δ_i + ε_i/z)/s_i, T/A = Σ(α_i z + β_i)/s_i.

use std::f64::consts::TAU;

use super::Tone;
use super::lines::Lines;
use super::refine::Refiner;
use crate::Status;
use crate::linalg::columns::Columns;
use crate::math::sin_cos_turns_1;
use crate::simd::{Isa, LANES};

/// Reweightings at most; they end where no tone moves by more than this part of a line.
const STEPS: usize = 60;
const SETTLED: f64 = 1e-9;
/// A tone on a line is taken to be so far beside it, in lines: its weight would be infinite.
const BESIDE: f64 = 1e-4;

/// Complex numbers as pairs.
type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn over(a: Complex, b: Complex) -> Complex {
    let size = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / size, (a.1 * b.0 - a.0 * b.1) / size)
}

fn minus(a: Complex, b: Complex) -> Complex {
    (a.0 - b.0, a.1 - b.1)
}

/// Reweighted least squares on the lines of a real record that `refiner` sees; moves the tones.
pub fn awls(
    refiner: &Refiner,
    lines: &Lines,
    tones: &mut [Tone],
    damped: bool,
    isa: Isa,
) -> (usize, Status) {
    let n = lines.length() as f64;
    let points: Vec<Complex> = lines
        .indices()
        .iter()
        .map(|m| sin_cos_turns_1(*m as f64 / n))
        .map(|(sin, cos)| (cos, sin))
        .collect();
    for step in 1..=STEPS {
        let Some(moves) = fractions(refiner.seen(), &points, tones, damped, n, isa) else {
            return (step, Status::Rank);
        };
        let next = if damped { damped_roots(tones, &moves) } else { undamped_roots(tones, &moves) };
        let mut furthest: f64 = 0.0;
        for (tone, next) in tones.iter_mut().zip(next) {
            let by =
                (tone.frequency - next.frequency).abs() + (tone.damping - next.damping).abs() / TAU;
            furthest = if by * n > furthest { by * n } else { furthest };
            *tone = next;
        }
        if !tones.iter().all(|t| t.frequency.is_finite() && t.damping.is_finite()) {
            return (step, Status::Rank);
        }
        if furthest < SETTLED {
            return (step, Status::Ok);
        }
    }
    (STEPS, Status::MaxIter)
}

/// δ_i (and ε_i) of the weighted least squares at the tones.
fn fractions(
    y: &[f64],
    points: &[Complex],
    tones: &[Tone],
    damped: bool,
    n: f64,
    isa: Isa,
) -> Option<Vec<f64>> {
    let size = points.len();
    let kinds = if damped { 4 } else { 3 };
    if 2 * size <= kinds * tones.len() {
        return None;
    }
    let rows = (2 * size).next_multiple_of(LANES);
    let mut columns = Columns::new(isa, rows, kinds * tones.len());
    let mut independent = true;
    for kind in 0..kinds {
        for tone in tones {
            let (cos, decay) = section(tone, n);
            independent &= columns.push(|x| {
                for (j, z) in points.iter().enumerate() {
                    let back = (z.0, -z.1);
                    let s =
                        (z.0 + decay * decay * z.0 - 2.0 * decay * cos, z.1 - decay * decay * z.1);
                    let seen = (-y[j], -y[size + j]);
                    let over_s = match kind {
                        0 => over(*z, s),
                        1 => over((1.0, 0.0), s),
                        2 => over(seen, s),
                        _ => over(times(seen, back), s),
                    };
                    (x[j], x[size + j]) = over_s;
                }
            });
        }
    }
    let mut left = vec![0.0; rows];
    left[..2 * size].copy_from_slice(&y[..2 * size]);
    let mut b = vec![0.0; kinds * tones.len()];
    columns.project(0, &mut left, &mut b);
    columns.back(0, &mut b);
    independent.then(|| b[2 * tones.len()..].to_vec())
}

/// cos ω and |λ| of a tone, a little beside the next line.
fn section(tone: &Tone, n: f64) -> (f64, f64) {
    let place = tone.frequency * n;
    let beside = place - (place + 0.5).floor();
    let clear = if tone.damping == 0.0 && beside.abs() < BESIDE {
        place - beside + if beside < 0.0 { -BESIDE } else { BESIDE }
    } else {
        place
    };
    (sin_cos_turns_1(clear / n).1, libm::exp(-tone.damping))
}

/// Roots x of Π(x − x_i)·(1 + Σ δ_i/(x − x_i)); pairs that left the real axis stand beside one another on it.
fn undamped_roots(tones: &[Tone], moves: &[f64]) -> Vec<Tone> {
    let poles: Vec<Complex> =
        tones.iter().map(|t| (2.0 * sin_cos_turns_1(t.frequency).1, 0.0)).collect();
    let residues: Vec<Complex> = moves.iter().map(|m| (*m, 0.0)).collect();
    let numerator = |x: Complex| {
        let mut all = (1.0, 0.0);
        let mut sum = (0.0, 0.0);
        for (i, residue) in residues.iter().enumerate() {
            let others = (0..poles.len()).filter(|j| *j != i).map(|j| minus(x, poles[j]));
            let term = times(*residue, others.fold((1.0, 0.0), times));
            sum = (sum.0 + term.0, sum.1 + term.1);
            all = times(all, minus(x, poles[i]));
        }
        (all.0 + sum.0, all.1 + sum.1)
    };
    let roots = durand_kerner(&poles, numerator);
    let tone = |x: &Complex| {
        let cos = (0.5 * (x.0 + x.1)).clamp(-1.0, 1.0);
        Tone { frequency: libm::acos(cos) / TAU, damping: 0.0 }
    };
    roots.iter().map(tone).collect()
}

/// Roots z of Π q_i(z)·(1 + Σ(δ_i z + ε_i)/q_i(z)), q_i = z² − 2Re λ_i z + |λ_i|²: the upper of each pair.
fn damped_roots(tones: &[Tone], moves: &[f64]) -> Vec<Tone> {
    let q = tones.len();
    let upper: Vec<Complex> = tones
        .iter()
        .map(|t| {
            let (sin, cos) = sin_cos_turns_1(t.frequency);
            let decay = libm::exp(-t.damping);
            (decay * cos, decay * sin)
        })
        .collect();
    let quadratic =
        |z: Complex, i: usize| times(minus(z, upper[i]), minus(z, (upper[i].0, -upper[i].1)));
    let numerator = |z: Complex| {
        let mut all = (1.0, 0.0);
        let mut sum = (0.0, 0.0);
        for i in 0..q {
            let own = (moves[i] * z.0 + moves[q + i], moves[i] * z.1);
            let others = (0..q).filter(|j| *j != i).map(|j| quadratic(z, j));
            let term = times(own, others.fold((1.0, 0.0), times));
            sum = (sum.0 + term.0, sum.1 + term.1);
            all = times(all, quadratic(z, i));
        }
        (all.0 + sum.0, all.1 + sum.1)
    };
    let starts: Vec<Complex> =
        upper.iter().copied().chain(upper.iter().map(|z| (z.0, -z.1))).collect();
    let mut roots = durand_kerner(&starts, numerator);
    roots.sort_by(|a, b| b.1.total_cmp(&a.1));
    let tone = |z: &Complex| Tone {
        frequency: libm::atan2(z.1.abs(), z.0) / TAU,
        damping: -libm::log(libm::hypot(z.0, z.1)),
    };
    roots.iter().take(q).map(tone).collect()
}

/// All roots of a monic polynomial, from starts near them.
fn durand_kerner(starts: &[Complex], polynomial: impl Fn(Complex) -> Complex) -> Vec<Complex> {
    // Off the real axis, so that pairs may leave it.
    let beside = |(k, z): (usize, &Complex)| (z.0, z.1 + 1e-9 * (k + 1) as f64);
    let mut roots: Vec<Complex> = starts.iter().enumerate().map(beside).collect();
    for _ in 0..200 {
        let mut furthest: f64 = 0.0;
        for i in 0..roots.len() {
            let others = (0..roots.len()).filter(|j| *j != i).map(|j| minus(roots[i], roots[j]));
            let by = over(polynomial(roots[i]), others.fold((1.0, 0.0), times));
            roots[i] = minus(roots[i], by);
            furthest = by.0.abs().max(by.1.abs()).max(furthest);
        }
        if furthest < 1e-15 {
            break;
        }
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_a_polynomial_on_and_off_the_axis() {
        // (x − 1)(x² + 1) from poor starts.
        let polynomial = |x: Complex| {
            times(minus(x, (1.0, 0.0)), {
                let square = times(x, x);
                (square.0 + 1.0, square.1)
            })
        };
        let mut roots = durand_kerner(&[(0.9, 0.0), (0.2, 0.0), (-0.3, 0.0)], polynomial);
        roots.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (got, want) in roots.iter().zip([(0.0, -1.0), (1.0, 0.0), (0.0, 1.0)]) {
            assert!((got.0 - want.0).abs() < 1e-12 && (got.1 - want.1).abs() < 1e-12);
        }
    }
}
