//! Noise in lanes: noise-free coefficients plus noise, and coefficients drawn with their covariance.

use super::plan::Source;
use crate::estimate::Workspace;
use crate::modulation::Lines;
use crate::simd::{Isa, Kernel, Lanes, Wide};

/// Y = Y₀ + Σ z F + σE on the used lines.
pub(crate) struct Noisy<'a> {
    pub source: &'a Source,
    pub noise: &'a (Vec<Wide>, Vec<Wide>),
    pub initial: &'a [Wide],
    pub sigma: f64,
    pub lines: Lines,
    pub space: &'a mut Workspace,
}

impl Kernel for Noisy<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Noisy { source, noise, initial, sigma, lines, space } = self;
        let (to_re, to_im) = space.signal_mut(0, 0);
        let used = lines.first..=lines.last;
        add_noise::<L>(to_re, &source.y.0[used.clone()], &noise.0[used.clone()], sigma);
        add_noise::<L>(to_im, &source.y.1[used.clone()], &noise.1[used.clone()], sigma);
        for (z, free) in initial.iter().zip(&source.free) {
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
