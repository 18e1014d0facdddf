//! A level of noise in lanes: noise-free coefficients plus σ times those of unit noise.

use super::plan::Source;
use crate::modulation::Lines;
use crate::simd::{Kernel, Lanes, Wide};

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
