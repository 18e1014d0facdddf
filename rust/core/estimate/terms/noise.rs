//! What noise does between samples and lines: spectra of products of slopes, and waves of sources on samples.

use super::complex::Split;
use crate::error::Error;
use crate::estimate::fit::Time;
use crate::math::{root_of_unity, sin_cos_turns_1};
use crate::quadrature::Rule;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers_mut};
use crate::spectrum::{CoefficientPlan, Kind, Scratch};

/// Sums Σ w_k² p_k e^{−2πi l t_k/T} over a window, and their counterparts on the samples.
pub(super) struct NoisePlan {
    /// e^{2πi t_k/T} of each sample of the window, zeros up to two whole registers.
    roots: Split,
    samples: usize,
    /// Highest line.
    highest: usize,
    sums: Sums,
}

enum Sums {
    Even { plan: Box<CoefficientPlan>, intervals: usize, squares: f64 },
    Uneven { squares: Vec<f64>, turns: Vec<f64> },
}

/// Memory for [`NoisePlan::correlate`].
#[derive(Debug, Default)]
pub(super) struct Room {
    re: Vec<f64>,
    im: Vec<f64>,
    scratch: Scratch,
}

impl NoisePlan {
    /// For a window of `n` intervals.
    pub fn new(time: Time<'_>, n: usize, rule: Rule, highest: usize) -> Result<NoisePlan, Error> {
        let mut roots = Split::zeros((n + 1).next_multiple_of(2 * LANES));
        let sums = match time {
            Time::Even(_) => {
                let lags = (2 * highest).min(n / 2);
                let plan = CoefficientPlan::new(n, lags, Kind::Rule(Rule::Staircase), 0.0, 0)?;
                // The rule's end weights are left to the mean of their squares, as linear models do: so the
                // lines of a linear equation are independent, and the two agree to all digits.
                let squares = rule.weights(n)?.iter().map(|w| w * w).sum::<f64>() / (n * n) as f64;
                for k in 0..=n {
                    (roots.re[k], roots.im[k]) = root_of_unity((k % n) as u64, n as u64);
                }
                Sums::Even { plan: Box::new(plan), intervals: n, squares }
            }
            Time::Uneven(t) => {
                let span = t[n] - t[0];
                let weights = rule.uneven_weights(t)?;
                let squares = weights.iter().map(|q| (q / span) * (q / span)).collect();
                let turns: Vec<f64> = t.iter().map(|x| (x - t[0]) / span).collect();
                for (k, turn) in turns.iter().enumerate() {
                    (roots.im[k], roots.re[k]) = sin_cos_turns_1(*turn);
                }
                Sums::Uneven { squares, turns }
            }
        };
        Ok(NoisePlan { roots, samples: n + 1, highest, sums })
    }

    /// Variance of a line under white noise of variance 1.
    pub fn unit_variance(&self) -> f64 {
        match &self.sums {
            Sums::Even { squares, .. } => *squares,
            Sums::Uneven { squares, .. } => squares.iter().sum(),
        }
    }

    /// Where lag 0 stands in a spectrum.
    pub fn middle(&self) -> usize {
        self.highest
    }

    /// R(l) of a product, one value a sample of the window, lags from −highest to twice the highest line.
    pub fn correlate(
        &self,
        isa: Isa,
        product: &mut [f64],
        room: &mut Room,
        out: &mut Split,
    ) -> Result<(), Error> {
        let middle = self.highest;
        out.clear(3 * self.highest + 1);
        match &self.sums {
            Sums::Even { plan, intervals, squares } => {
                // The window's last sample has the phase of its first, and both count half.
                product[0] = 0.5 * (product[0] + product[*intervals]);
                let lags = plan.harmonics() + 1;
                room.re.resize(lags, 0.0);
                room.im.resize(lags, 0.0);
                plan.run_in(isa, product, &mut room.re, &mut room.im, &mut room.scratch)?;
                for (lag, (re, im)) in room.re.iter().zip(&room.im).enumerate() {
                    (out.re[middle + lag], out.im[middle + lag]) = (re * squares, im * squares);
                }
                // Lags above N/2 are those of the mirrored sum.
                for lag in lags..=2 * self.highest {
                    let from = middle + intervals - lag;
                    (out.re[middle + lag], out.im[middle + lag]) = (out.re[from], -out.im[from]);
                }
            }
            Sums::Uneven { squares, turns } => {
                for lag in 0..=2 * self.highest {
                    let (mut re, mut im) = (0.0, 0.0);
                    for ((p, w), t) in product.iter().zip(squares).zip(turns) {
                        let (sin, cos) = sin_cos_turns_1(-(lag as f64) * t);
                        re += cos * (p * w);
                        im += sin * (p * w);
                    }
                    (out.re[middle + lag], out.im[middle + lag]) = (re, im);
                }
            }
        }
        for lag in 1..=self.highest {
            (out.re[middle - lag], out.im[middle - lag]) =
                (out.re[middle + lag], -out.im[middle + lag]);
        }
        Ok(())
    }

    /// [`NoisePlan::correlate`] of a product that is the same for all samples: lag 0 alone; whether that is so here.
    pub fn correlate_constant(&self, product: f64, out: &mut Split) -> bool {
        match &self.sums {
            Sums::Even { intervals, squares, .. } if 2 * self.highest < *intervals => {
                out.clear(3 * self.highest + 1);
                out.re[self.highest] = product * squares;
                true
            }
            _ => false,
        }
    }

    /// Re Σ_m z(m) e^{imω₀t}, lines from `first` on, at every sample of the window times its share in a
    /// coefficient; filled up to whole registers.
    pub fn wave(&self, isa: Isa, sources: &Split, count: usize, first: usize, out: &mut Vec<Wide>) {
        out.resize(self.samples.div_ceil(LANES), Wide::ZERO);
        let (re, im) = (&sources.re[..count], &sources.im[..count]);
        isa.across().run(Wave { roots: &self.roots, re, im, first, out });
        let own = numbers_mut(out).iter_mut();
        match &self.sums {
            Sums::Even { intervals, .. } => {
                let share = 1.0 / *intervals as f64;
                own.for_each(|x| *x *= share);
            }
            Sums::Uneven { squares, .. } => {
                own.zip(squares).for_each(|(x, square)| *x *= square.sqrt());
            }
        }
    }
}

/// Horner's rule in e^{iω₀t}, eight samples a register, two registers at once.
struct Wave<'a> {
    roots: &'a Split,
    re: &'a [f64],
    im: &'a [f64],
    first: usize,
    out: &'a mut [Wide],
}

impl Kernel for Wave<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for (pair, out) in self.out.chunks_mut(2).enumerate() {
            let a = self.roots.eight::<L>(2 * pair * LANES);
            let b = self.roots.eight::<L>((2 * pair + 1) * LANES);
            let zero = L::splat(0.0);
            let (mut x, mut y) = ((zero, zero), (zero, zero));
            for (re, im) in self.re.iter().zip(self.im).rev() {
                let z = (L::splat(*re), L::splat(*im));
                x = turned(x, a, z);
                y = turned(y, b, z);
            }
            for _ in 0..self.first {
                x = turned(x, a, (zero, zero));
                y = turned(y, b, (zero, zero));
            }
            x.0.store(&mut out[0]);
            if let Some(out) = out.get_mut(1) {
                y.0.store(out);
            }
        }
    }
}

/// x·by + z.
#[inline(always)]
fn turned<L: Lanes>(x: (L, L), by: (L, L), z: (L, L)) -> (L, L) {
    (x.0.mul_add(by.0, (-x.1).mul_add(by.1, z.0)), x.0.mul_add(by.1, x.1.mul_add(by.0, z.1)))
}
