//! Noise of Fourier coefficients: its covariance, numbers that have it, and samples whose coefficients they are.
//!
//! A rule with weights w makes V(m) = (1/N) Σ w_k e_k e^{−imθ_k}, θ_k = 2πk/N, of white samples e. The weights
//! are the same from either end, so real and imaginary parts do not correlate, and with
//! C(p) = (1/N²) Σ w_k² cos pθ_k cov(Re V(m), Re V(j)) = ½(C(m − j) + C(m + j)), with a minus between for Im.

use crate::error::Error;
use crate::math::sin_cos_turns_1;
use crate::quadrature::Weights;
use crate::simd::{Isa, Kernel, Lanes, Wide};
use crate::spectrum::{CoefficientPlan, Kind};

/// Coefficients of white noise of variance one under one rule and window.
pub(crate) struct Coloured {
    weights: Weights,
    lead: usize,
    harmonics: usize,
    /// Roots of the covariances of Re V(0…M) and Im V(1…M), lower triangles row after row.
    roots: [Vec<f64>; 2],
}

impl Coloured {
    /// # Errors
    /// [`Error::Spec`] for what is no rule.
    pub fn new(plan: &CoefficientPlan) -> Result<Coloured, Error> {
        let Kind::Rule(rule) = plan.kind() else {
            return Err(Error::Spec(
                "drawing coefficients: outputs are integrated by a rule".into(),
            ));
        };
        let (intervals, harmonics) = (plan.intervals(), plan.harmonics());
        let weights = Weights::new(rule, intervals)?;
        let squares = squares(plan, &weights)?;
        // C has period N and is even.
        let at = |p: usize| squares[(p % intervals).min(intervals - p % intervals)];
        let root = |first: usize, sign: f64| {
            cholesky(harmonics + 1 - first, |i, j| 0.5 * (at(i - j) + sign * at(i + j + 2 * first)))
        };
        let roots = [root(0, 1.0), root(1, -1.0)];
        Ok(Coloured { weights, lead: plan.samples() - intervals - 1, harmonics, roots })
    }

    /// Normals that a record takes.
    pub fn normals(&self) -> usize {
        2 * self.harmonics + 1
    }

    /// Coefficients from independent normals, those of Re V(0), Re V(1), Im V(1), ….
    pub fn colour(&self, isa: Isa, normals: &[Wide], re: &mut [Wide], im: &mut [Wide]) {
        isa.run(Colour { roots: &self.roots, normals, re, im });
    }

    /// White samples whose coefficients are those that [`Coloured::colour`] makes of `normals`; the rest of
    /// them as `free`, independent samples, has it.
    ///
    /// With v = Le the coefficients and S = LLᵀ, e = f + LᵀS⁻¹(v − Lf) is white noise given v.
    pub fn complete(&self, normals: &[f64], free: &mut [f64]) {
        let intervals = self.weights.intervals();
        let turns: Vec<(f64, f64)> =
            (0..intervals).map(|k| sin_cos_turns_1(k as f64 / intervals as f64)).collect();
        let part = |im: bool, at: usize| {
            let (sin, cos) = turns[at % intervals];
            if im { -sin } else { cos }
        };
        let weight = |k: usize| self.weights.at(k) / intervals as f64;
        let own = &free[self.lead..];
        let mut more = vec![0.0; own.len()];
        for (im, root) in [false, true].into_iter().zip(&self.roots) {
            let first = usize::from(im);
            let size = self.harmonics + 1 - first;
            // z less what the free samples hold, and back through the root: Rᵀa = z − R⁻¹Lf.
            let mut a: Vec<f64> = (0..size)
                .map(|i| {
                    let m = i + first;
                    own.iter().enumerate().map(|(k, e)| weight(k) * e * part(im, m * k)).sum()
                })
                .collect();
            for i in 0..size {
                let row = &root[i * (i + 1) / 2..][..=i];
                let known: f64 = row[..i].iter().zip(&a).map(|(r, a)| r * a).sum();
                a[i] = if row[i] > 0.0 { (a[i] - known) / row[i] } else { 0.0 };
            }
            for (i, a) in a.iter_mut().enumerate() {
                let m = i + first;
                *a = normals[if m == 0 { 0 } else { 2 * m - 1 + first }] - *a;
            }
            for i in (0..size).rev() {
                let row = &root[i * (i + 1) / 2..][..=i];
                a[i] = if row[i] > 0.0 { a[i] / row[i] } else { 0.0 };
                let own = a[i];
                for (a, r) in a[..i].iter_mut().zip(row) {
                    *a -= r * own;
                }
            }
            for (k, more) in more.iter_mut().enumerate() {
                let sum: f64 =
                    a.iter().enumerate().map(|(i, a)| a * part(im, (i + first) * k)).sum();
                *more += weight(k) * sum;
            }
        }
        for (e, more) in free[self.lead..].iter_mut().zip(more) {
            *e += more;
        }
    }
}

/// C(0), C(1), … as far as lines 0…M meet, or to N/2, from where C repeats.
fn squares(plan: &CoefficientPlan, weights: &Weights) -> Result<Vec<f64>, Error> {
    let intervals = plan.intervals();
    let most = (2 * plan.harmonics()).min(intervals / 2);
    let twice = CoefficientPlan::new(intervals, most, plan.kind(), 0.0, 0)?;
    let samples: Vec<f64> = (0..=intervals).map(|k| weights.at(k) / intervals as f64).collect();
    let (mut re, mut im) = (vec![0.0; most + 1], vec![0.0; most + 1]);
    twice.run(&samples, &mut re, &mut im)?;
    Ok(re)
}

/// Lower triangle, row after row, of the root of a covariance; zero where it has no more rank.
fn cholesky(size: usize, cov: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut root: Vec<f64> = Vec::with_capacity(size * (size + 1) / 2);
    for i in 0..size {
        let first = root.len();
        for j in 0..=i {
            let other = j * (j + 1) / 2;
            let dot: f64 = (0..j).map(|k| root[first + k] * root[other + k]).sum();
            let left = cov(i, j) - dot;
            root.push(match (i == j, i == j || root[other + j] > 0.0) {
                (true, _) => left.max(0.0).sqrt(),
                (false, true) => left / root[other + j],
                (false, false) => 0.0,
            });
        }
    }
    root
}

struct Colour<'a> {
    roots: &'a [Vec<f64>; 2],
    normals: &'a [Wide],
    re: &'a mut [Wide],
    im: &'a mut [Wide],
}

impl Kernel for Colour<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Colour { roots: [even, odd], normals, re, im } = self;
        let (constant, pairs) = (&normals[0], normals[1..].as_chunks::<2>().0);
        let (mut even, mut odd) = (&even[..], &odd[..]);
        for (m, re) in re.iter_mut().enumerate() {
            let (row, rest) = even.split_at(m + 1);
            even = rest;
            let mut sum = L::splat(row[0]) * L::load(constant);
            for (root, [z, _]) in row[1..].iter().zip(pairs) {
                sum = L::splat(*root).mul_add(L::load(z), sum);
            }
            sum.store(re);
        }
        for (m, im) in im.iter_mut().enumerate() {
            let (row, rest) = odd.split_at(m);
            odd = rest;
            let mut sum = L::splat(0.0);
            for (root, [_, z]) in row.iter().zip(pairs) {
                sum = L::splat(*root).mul_add(L::load(z), sum);
            }
            sum.store(im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::Rule;
    use crate::rng::{self, Address, Purpose};
    use crate::simd::LANES;

    const INTERVALS: usize = 32;
    const BLOCKS: u64 = 125_000;

    fn plan(rule: Rule, harmonics: usize) -> CoefficientPlan {
        CoefficientPlan::new(INTERVALS, harmonics, Kind::Rule(rule), 0.0, 3).unwrap()
    }

    /// Re V(0), Re V(1), Im V(1), … of one record.
    fn coefficients(plan: &CoefficientPlan, samples: &[f64]) -> Vec<f64> {
        let lines = plan.harmonics() + 1;
        let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
        plan.run(samples, &mut re, &mut im).unwrap();
        (0..2 * lines - 1)
            .map(|i| if i == 0 || i % 2 == 1 { re[i.div_ceil(2)] } else { im[i / 2] })
            .collect()
    }

    /// Their covariance: Σ v vᵀ of those of each unit sample.
    fn covariance(plan: &CoefficientPlan) -> Vec<Vec<f64>> {
        let units: Vec<Vec<f64>> = (0..plan.samples())
            .map(|k| {
                let unit: Vec<f64> =
                    (0..plan.samples()).map(|j| if j == k { 1.0 } else { 0.0 }).collect();
                coefficients(plan, &unit)
            })
            .collect();
        let size = 2 * plan.harmonics() + 1;
        let entry = |i: usize, j: usize| units.iter().map(|v| v[i] * v[j]).sum();
        (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect()
    }

    /// What normals become, one after the other.
    fn coloured(noise: &Coloured, normals: &[f64]) -> Vec<f64> {
        let wide: Vec<Wide> = normals.iter().map(|z| Wide::splat(*z)).collect();
        let lines = noise.harmonics + 1;
        let (mut re, mut im) = (vec![Wide::ZERO; lines], vec![Wide::ZERO; lines]);
        noise.colour(Isa::detect().unwrap(), &wide, &mut re, &mut im);
        (0..2 * lines - 1)
            .map(|i| if i == 0 || i % 2 == 1 { re[i.div_ceil(2)].0[5] } else { im[i / 2].0[5] })
            .collect()
    }

    const RULES: [Rule; 4] = [Rule::Gregory, Rule::Trapezoid, Rule::Parabolic, Rule::Staircase];

    #[test]
    fn the_roots_have_the_covariance_of_unit_samples() {
        for rule in RULES {
            for harmonics in [0, 1, 4, 9, INTERVALS / 2] {
                let plan = plan(rule, harmonics);
                let (noise, wanted) = (Coloured::new(&plan).unwrap(), covariance(&plan));
                let size = noise.normals();
                let columns: Vec<Vec<f64>> = (0..size)
                    .map(|k| {
                        let unit: Vec<f64> =
                            (0..size).map(|j| if j == k { 1.0 } else { 0.0 }).collect();
                        coloured(&noise, &unit)
                    })
                    .collect();
                for i in 0..size {
                    for j in 0..size {
                        let found: f64 = columns.iter().map(|c| c[i] * c[j]).sum();
                        let gap = (found - wanted[i][j]).abs();
                        assert!(gap < 1e-15, "{rule:?} {harmonics} {i} {j}: {gap:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn completed_samples_have_the_coefficients_that_were_drawn() {
        for (k, rule) in RULES.into_iter().enumerate() {
            for harmonics in [0, 4, 12] {
                let plan = plan(rule, harmonics);
                let noise = Coloured::new(&plan).unwrap();
                let draw = |replicate, length| {
                    let mut out = vec![0.0; length];
                    let purpose = Purpose::NoiseY;
                    let group = k as u32;
                    rng::normals(
                        Address { seed: 4, purpose, channel: 0, replicate, group },
                        &mut out,
                    );
                    out
                };
                let (normals, mut samples) = (draw(0, noise.normals()), draw(1, plan.samples()));
                noise.complete(&normals, &mut samples);
                let gap = coefficients(&plan, &samples)
                    .iter()
                    .zip(coloured(&noise, &normals))
                    .fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
                assert!(gap < 1e-15, "{rule:?} {harmonics}: {gap:e}");
            }
        }
    }

    #[test]
    fn completed_samples_are_white() {
        // The map of normals and free samples to samples, made column by column: its covariance is the identity.
        for rule in RULES {
            let plan = plan(rule, 5);
            let noise = Coloured::new(&plan).unwrap();
            let (size, samples) = (noise.normals(), plan.samples());
            let columns: Vec<Vec<f64>> = (0..size + samples)
                .map(|k| {
                    let one = |j: usize| if j == k { 1.0 } else { 0.0 };
                    let normals: Vec<f64> = (0..size).map(one).collect();
                    let mut free: Vec<f64> = (size..size + samples).map(one).collect();
                    noise.complete(&normals, &mut free);
                    free
                })
                .collect();
            for i in 0..samples {
                for j in 0..=i {
                    let found: f64 = columns.iter().map(|c| c[i] * c[j]).sum();
                    let wanted = if i == j { 1.0 } else { 0.0 };
                    assert!((found - wanted).abs() < 1e-13, "{rule:?} {i} {j}: {found}");
                }
            }
        }
    }

    /// Re V(0), Re V(1), Im V(1), … of a million records, summed to their means and second moments.
    fn moments(plan: &CoefficientPlan, drawn: bool) -> (Vec<f64>, Vec<f64>) {
        let isa = Isa::detect().unwrap();
        let noise = Coloured::new(plan).unwrap();
        let (size, lines) = (noise.normals(), plan.harmonics() + 1);
        let mut normals = vec![Wide::ZERO; if drawn { size } else { plan.samples() }];
        let (mut re, mut im) = (vec![Wide::ZERO; lines], vec![Wide::ZERO; lines]);
        let mut scratch = plan.scratch();
        let (mut mean, mut second) = (vec![0.0; size], vec![0.0; size * size]);
        for block in 0..BLOCKS {
            let first = block * LANES as u64;
            rng::fill(isa, 11, Purpose::NoiseY, 0, first, 3, &mut normals);
            match drawn {
                true => noise.colour(isa, &normals, &mut re, &mut im),
                false => plan.run_lanes(isa, &normals, &mut re, &mut im, &mut scratch).unwrap(),
            }
            for lane in 0..LANES {
                let v: Vec<f64> = (0..size)
                    .map(|i| if i == 0 || i % 2 == 1 { &re[i.div_ceil(2)] } else { &im[i / 2] }.0[lane])
                    .collect();
                for i in 0..size {
                    mean[i] += v[i];
                    for j in 0..=i {
                        second[i * size + j] += v[i] * v[j];
                    }
                }
            }
        }
        let records = (BLOCKS * LANES as u64) as f64;
        mean.iter_mut().chain(&mut second).for_each(|sum| *sum /= records);
        (mean, second)
    }

    #[test]
    fn sampled_and_drawn_coefficients_have_the_same_moments() {
        // Each of at most 11 means and 66 second moments within 5.5 standard errors of the exact value, in
        // 2 rules and 2 ways of drawing: false alarm in at most 308 · 4e-8 = 1.2e-5 of seeds.
        for rule in [Rule::Trapezoid, Rule::Parabolic] {
            let plan = plan(rule, 4);
            let exact = covariance(&plan);
            let size = exact.len();
            let records = (BLOCKS * LANES as u64) as f64;
            for drawn in [false, true] {
                let (mean, second) = moments(&plan, drawn);
                for i in 0..size {
                    assert!(
                        mean[i].abs() < 5.5 * (exact[i][i] / records).sqrt(),
                        "{rule:?} {drawn} {i}"
                    );
                    for j in 0..=i {
                        let own = exact[i][j];
                        let error = ((exact[i][i] * exact[j][j] + own * own) / records).sqrt();
                        let gap = (second[i * size + j] - own).abs();
                        assert!(gap < 5.5 * error, "{rule:?} {drawn} {i} {j}: {}", gap / error);
                    }
                }
            }
        }
    }
}
