//! Complex numbers as far as lines need them: one as a pair, many with their real and imaginary parts apart.

use std::ops::{AddAssign, Mul};

use crate::simd::{LANES, Lanes, Wide};

/// Real and imaginary part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct C(pub f64, pub f64);

impl AddAssign for C {
    #[inline]
    fn add_assign(&mut self, b: C) {
        *self = C(self.0 + b.0, self.1 + b.1);
    }
}

impl Mul for C {
    type Output = C;
    #[inline]
    fn mul(self, b: C) -> C {
        C(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }
}

/// Numbers of neighbouring lines or samples, eight zeros behind them: a register may be read from anywhere.
#[derive(Debug, Clone, Default)]
pub(crate) struct Split {
    pub re: Vec<f64>,
    pub im: Vec<f64>,
}

impl Split {
    /// So many zeros.
    pub fn zeros(count: usize) -> Split {
        let mut own = Split::default();
        own.clear(count);
        own
    }

    /// Makes it so many zeros; memory is kept where it suffices.
    pub fn clear(&mut self, count: usize) {
        for part in [&mut self.re, &mut self.im] {
            part.clear();
            part.resize(count + LANES, 0.0);
        }
    }

    /// Makes it these numbers.
    pub fn copy(&mut self, re: &[f64], im: &[f64]) {
        self.clear(re.len());
        self.re[..re.len()].copy_from_slice(re);
        self.im[..im.len()].copy_from_slice(im);
    }

    /// Imaginary parts, or real ones.
    pub fn part(&self, im: bool) -> &[f64] {
        if im { &self.im } else { &self.re }
    }

    pub fn get(&self, k: usize) -> C {
        C(self.re[k], self.im[k])
    }

    pub fn set(&mut self, k: usize, to: C) {
        (self.re[k], self.im[k]) = (to.0, to.1);
    }

    /// Eight of them from each place on.
    pub fn windows(&self, to: &mut Windows) {
        to.clear();
        let each = self.re.windows(LANES).zip(self.im.windows(LANES)).take(self.re.len() - LANES);
        to.extend(each.map(|(re, im)| [re, im].map(window)));
    }

    /// Eight of them, from `k` on.
    #[inline(always)]
    pub fn eight<L: Lanes>(&self, k: usize) -> (L, L) {
        (eight(&self.re, k), eight(&self.im, k))
    }
}

/// Eight numbers from each place on, real and imaginary parts: a register may begin anywhere at no cost.
pub(crate) type Windows = Vec<[Wide; 2]>;

fn window(eight: &[f64]) -> Wide {
    Wide(eight.first_chunk().copied().unwrap_or_default())
}

/// Eight numbers of both parts.
#[inline(always)]
pub(crate) fn loaded<L: Lanes>([re, im]: &[Wide; 2]) -> (L, L) {
    (L::load(re), L::load(im))
}

/// Eight products.
#[inline(always)]
pub(crate) fn times<L: Lanes>(x: (L, L), by: (L, L)) -> (L, L) {
    (x.0.mul_add(by.0, (-x.1) * by.1), x.0.mul_add(by.1, x.1 * by.0))
}

/// Eight numbers from `k` on.
#[inline(always)]
fn eight<L: Lanes>(all: &[f64], k: usize) -> L {
    L::load_any(all[k..k + LANES].first_chunk().unwrap_or(&[0.0; LANES]))
}

/// (iω)^k of the lines: a real size, times i for odd k.
#[derive(Debug, Clone)]
pub(crate) struct Power {
    odd: bool,
    size: Vec<f64>,
}

impl Power {
    pub fn new(k: usize, omega: impl Iterator<Item = f64>) -> Power {
        let sign = if k % 4 < 2 { 1.0 } else { -1.0 };
        let size = omega.map(|w| (0..k).fold(sign, |p, _| p * w)).collect();
        Power { odd: k % 2 == 1, size }
    }

    /// Whether i stands before the sizes of the lines, and these.
    #[inline(always)]
    pub fn parts(&self) -> (bool, &[f64]) {
        (self.odd, &self.size)
    }

    /// (iω)^k of a line.
    pub fn at(&self, line: usize) -> (f64, f64) {
        if self.odd { (0.0, self.size[line]) } else { (self.size[line], 0.0) }
    }

    /// Adds `by` (iω)^k to each.
    pub fn add(&self, by: f64, to: &mut Split) {
        let part = if self.odd { &mut to.im } else { &mut to.re };
        for (to, size) in part.iter_mut().zip(&self.size) {
            *to += by * size;
        }
    }

    /// Adds `by` (iω)^k times the values, those from `first` on.
    pub fn add_times(&self, by: f64, values: &Split, first: usize, to: &mut Split) {
        let count = self.size.len();
        let (re, im) = (&values.re[first..first + count], &values.im[first..first + count]);
        let (sign, x, y) = if self.odd { (-by, im, re) } else { (by, re, im) };
        let (a, b) = (&mut to.re[..count], &mut to.im[..count]);
        for k in 0..count {
            a[k] += sign * self.size[k] * x[k];
            b[k] += by * self.size[k] * y[k];
        }
    }
}

/// e^{−ix}.
pub(crate) fn late(x: f64) -> C {
    let (sin, cos) = crate::math::sin_cos_turns_1(-x / std::f64::consts::TAU);
    C(cos, sin)
}
