//! Complex numbers as far as lines need them: one as a pair, many with their real and imaginary parts apart.

use std::ops::{AddAssign, Mul};

use crate::simd::{LANES, Lanes};

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

    pub fn get(&self, k: usize) -> C {
        C(self.re[k], self.im[k])
    }

    pub fn set(&mut self, k: usize, to: C) {
        (self.re[k], self.im[k]) = (to.0, to.1);
    }

    /// Eight of them, from `k` on.
    #[inline(always)]
    pub fn eight<L: Lanes>(&self, k: usize) -> (L, L) {
        (eight(&self.re, k), eight(&self.im, k))
    }
}

/// Eight numbers from `k` on.
#[inline(always)]
fn eight<L: Lanes>(all: &[f64], k: usize) -> L {
    L::load_any(all[k..k + LANES].first_chunk().unwrap_or(&[0.0; LANES]))
}

/// Eight neighbours from each of `count` places on, the first at `from`.
#[inline(always)]
pub(crate) fn windows(
    all: &[f64],
    from: usize,
    count: usize,
) -> impl DoubleEndedIterator<Item = &[f64; LANES]> + ExactSizeIterator {
    let own = &all[from..from + count + LANES - 1];
    own.windows(LANES).map(|eight| eight.first_chunk().unwrap_or(&[0.0; LANES]))
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
        let (re, im) = (&values.re[first..], &values.im[first..]);
        let own = to.re.iter_mut().zip(&mut to.im).zip(re.iter().zip(im)).zip(&self.size);
        if self.odd {
            for (((a, b), (re, im)), size) in own {
                let by = by * size;
                (*a, *b) = (*a - by * im, *b + by * re);
            }
        } else {
            for (((a, b), (re, im)), size) in own {
                let by = by * size;
                (*a, *b) = (*a + by * re, *b + by * im);
            }
        }
    }
}

/// e^{−ix}.
pub(crate) fn late(x: f64) -> C {
    let (sin, cos) = crate::math::sin_cos_turns_1(-x / std::f64::consts::TAU);
    C(cos, sin)
}
