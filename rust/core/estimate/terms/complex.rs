//! Complex numbers as pairs, as far as lines need them.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Real and imaginary part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct C(pub f64, pub f64);

impl C {
    /// The conjugate.
    #[inline]
    pub fn conj(self) -> C {
        C(self.0, -self.1)
    }

    /// (iω)^k.
    pub fn power(omega: f64, k: usize) -> C {
        let size = (0..k).fold(1.0, |p, _| p * omega);
        match k % 4 {
            0 => C(size, 0.0),
            1 => C(0.0, size),
            2 => C(-size, 0.0),
            _ => C(0.0, -size),
        }
    }
}

impl Add for C {
    type Output = C;
    #[inline]
    fn add(self, b: C) -> C {
        C(self.0 + b.0, self.1 + b.1)
    }
}

impl AddAssign for C {
    #[inline]
    fn add_assign(&mut self, b: C) {
        *self = *self + b;
    }
}

impl Sub for C {
    type Output = C;
    #[inline]
    fn sub(self, b: C) -> C {
        C(self.0 - b.0, self.1 - b.1)
    }
}

impl Neg for C {
    type Output = C;
    #[inline]
    fn neg(self) -> C {
        C(-self.0, -self.1)
    }
}

impl Mul for C {
    type Output = C;
    #[inline]
    fn mul(self, b: C) -> C {
        C(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }
}

impl Mul<f64> for C {
    type Output = C;
    #[inline]
    fn mul(self, b: f64) -> C {
        C(self.0 * b, self.1 * b)
    }
}
