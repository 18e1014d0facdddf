//! Noise in lanes: noise-free coefficients plus noise, and coefficients drawn with their covariance.

use super::plan::Source;
use crate::modulation::Lines;
use crate::simd::{Isa, Kernel, Lanes, Wide};

/// Y = Y₀ + Σ z F + σE of one output on the used lines.
pub(crate) struct Noisy<'a> {
    pub source: &'a Source,
    pub output: usize,
    pub noise: &'a (Vec<Wide>, Vec<Wide>),
    pub initial: &'a [Wide],
    pub sigma: f64,
    pub lines: Lines,
    pub to: (&'a mut [Wide], &'a mut [Wide]),
}

impl Kernel for Noisy<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Noisy { source, output, noise, initial, sigma, lines, to: (to_re, to_im) } = self;
        let used = lines.first..=lines.last;
        let y = &source.y[output];
        add_noise::<L>(to_re, &y.0[used.clone()], &noise.0[used.clone()], sigma);
        add_noise::<L>(to_im, &y.1[used.clone()], &noise.1[used.clone()], sigma);
        for (z, free) in initial.iter().zip(&source.free) {
            let free = &free[output];
            add_free::<L>(to_re, &free.0[used.clone()], z);
            add_free::<L>(to_im, &free.1[used.clone()], z);
        }
    }
}

#[inline(always)]
fn add_noise<L: Lanes>(to: &mut [Wide], clean: &[f64], noise: &[Wide], sigma: f64) {
    for ((to, clean), noise) in to.iter_mut().zip(clean).zip(noise) {
        L::splat(sigma).mul_add(L::load(noise), L::splat(*clean)).store(to);
    }
}

#[inline(always)]
fn add_free<L: Lanes>(to: &mut [Wide], free: &[f64], z: &Wide) {
    for (to, free) in to.iter_mut().zip(free) {
        L::splat(*free).mul_add(L::load(z), L::load(to)).store(to);
    }
}

/// Coefficients with the rule's own covariance from independent normals.
pub(crate) fn colour(
    isa: Isa,
    source: &Source,
    normals: &[Wide],
    re: &mut [Wide],
    im: &mut [Wide],
) {
    struct Colour<'a>(&'a Source, &'a [Wide], &'a mut [Wide], &'a mut [Wide]);
    impl Kernel for Colour<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            let size = 2 * self.0.plan.harmonics() + 1;
            for i in 0..size {
                let mut sum = L::splat(0.0);
                for (root, z) in self.0.root[i * size..=i * size + i].iter().zip(self.1) {
                    sum = L::splat(*root).mul_add(L::load(z), sum);
                }
                let to = if i == 0 || i % 2 == 1 {
                    &mut self.2[i.div_ceil(2)]
                } else {
                    &mut self.3[i / 2]
                };
                sum.store(to);
            }
        }
    }
    isa.run(Colour(source, normals, re, im));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{Band, FitOptions, Options, Wanted};
    use crate::monte_carlo::plan::{Contender, Draw, Group, Intervals, Plan, Told};
    use crate::quadrature::Rule;
    use crate::rng::{self, Purpose};
    use crate::simd::LANES;
    use crate::structure::{Method, Noise, Structure, Trend};

    const INTERVALS: usize = 32;
    const BLOCKS: u64 = 125_000;

    fn plan(rule: Rule) -> Plan {
        let options = FitOptions {
            structure: Structure::new(1, vec![]).unwrap(),
            delays: vec![],
            intersample: vec![],
            rule,
            method: Method::Ls,
            noise: Noise::Output,
            trend: Trend::None,
            extended: true,
            band: Band::Harmonics(4),
            options: Options { tol: 1e-9, maxiter: 1, wanted: Wanted::Theta },
        };
        let options = Told::Plain(options);
        let estimators = vec![Contender { options, truth: vec![1.0], intervals: Intervals::None }];
        let y = vec![(0..=INTERVALS).map(|k| k as f64).collect()];
        let group = Group {
            group: 3,
            dt: 0.1,
            y,
            u: vec![],
            free: vec![],
            sigma: vec![1.0],
            scale: vec![1.0],
            estimators,
        };
        Plan::new(&[group], Draw::Coefficients, Isa::detect().unwrap()).unwrap()
    }

    /// Re V(0), Re V(1), Im V(1), … of a million records, summed to their means and second moments.
    fn moments(source: &Source, drawn: bool) -> (Vec<f64>, Vec<f64>) {
        let isa = Isa::detect().unwrap();
        let (size, lines) = (2 * source.plan.harmonics() + 1, source.plan.harmonics() + 1);
        let mut normals = vec![Wide::ZERO; if drawn { size } else { INTERVALS + 1 }];
        let (mut re, mut im) = (vec![Wide::ZERO; lines], vec![Wide::ZERO; lines]);
        let mut scratch = source.plan.scratch();
        let (mut mean, mut second) = (vec![0.0; size], vec![0.0; size * size]);
        for block in 0..BLOCKS {
            let first = block * LANES as u64;
            rng::fill(isa, 11, Purpose::NoiseY, 0, first, 3, &mut normals);
            match drawn {
                true => colour(isa, source, &normals, &mut re, &mut im),
                false => {
                    source.plan.run_lanes(isa, &normals, &mut re, &mut im, &mut scratch).unwrap()
                }
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
            let plan = plan(rule);
            let source = &plan.groups[0].sources[0];
            let size = 2 * source.plan.harmonics() + 1;
            let exact = |i: usize, j: usize| {
                (0..=i.min(j))
                    .map(|k| source.root[i * size + k] * source.root[j * size + k])
                    .sum::<f64>()
            };
            let records = (BLOCKS * LANES as u64) as f64;
            for drawn in [false, true] {
                let (mean, second) = moments(source, drawn);
                for i in 0..size {
                    assert!(
                        mean[i].abs() < 5.5 * (exact(i, i) / records).sqrt(),
                        "{rule:?} {drawn} {i}"
                    );
                    for j in 0..=i {
                        let own = exact(i, j);
                        let error = ((exact(i, i) * exact(j, j) + own * own) / records).sqrt();
                        let gap = (second[i * size + j] - own).abs();
                        assert!(gap < 5.5 * error, "{rule:?} {drawn} {i} {j}: {}", gap / error);
                    }
                }
            }
        }
    }
}
