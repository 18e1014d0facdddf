//! Dense algebra of the oracle's own: complex numbers, Householder least squares, inverses, differences.
#![allow(clippy::needless_range_loop)]

use std::ops::{Add, Mul, Neg, Sub};

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct C(pub f64, pub f64);

impl C {
    /// i^k x^k.
    pub fn power(x: f64, k: usize) -> C {
        (0..k).fold(C(1.0, 0.0), |p, _| p * C(0.0, x))
    }

    /// e^{ix}.
    pub fn turn(x: f64) -> C {
        C(x.cos(), x.sin())
    }

    pub fn conj(self) -> C {
        C(self.0, -self.1)
    }

    pub fn square(self) -> f64 {
        self.0 * self.0 + self.1 * self.1
    }

    pub fn size(self) -> f64 {
        self.square().sqrt()
    }

    pub fn inverse(self) -> C {
        self.conj() * (1.0 / self.square())
    }
}

impl Add for C {
    type Output = C;
    fn add(self, b: C) -> C {
        C(self.0 + b.0, self.1 + b.1)
    }
}

impl Sub for C {
    type Output = C;
    fn sub(self, b: C) -> C {
        C(self.0 - b.0, self.1 - b.1)
    }
}

impl Neg for C {
    type Output = C;
    fn neg(self) -> C {
        C(-self.0, -self.1)
    }
}

impl Mul for C {
    type Output = C;
    fn mul(self, b: C) -> C {
        C(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }
}

impl Mul<f64> for C {
    type Output = C;
    fn mul(self, b: f64) -> C {
        C(self.0 * b, self.1 * b)
    }
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Householder's factors of columns, each scaled to unit length first.
pub struct Qr {
    reflectors: Vec<Vec<f64>>,
    r: Vec<Vec<f64>>,
    scale: Vec<f64>,
}

impl Qr {
    pub fn new(columns: &[Vec<f64>]) -> Qr {
        let mut qr = Qr { reflectors: Vec::new(), r: Vec::new(), scale: Vec::new() };
        for (k, column) in columns.iter().enumerate() {
            let size = dot(column, column).sqrt();
            let mut v: Vec<f64> = column.iter().map(|x| x / size).collect();
            qr.turn(&mut v);
            let rest = dot(&v[k..], &v[k..]).sqrt();
            let pivot = if v[k] > 0.0 { -rest } else { rest };
            let mut r = v[..k].to_vec();
            r.push(pivot);
            qr.r.push(r);
            qr.scale.push(size);
            v[..k].fill(0.0);
            v[k] -= pivot;
            let norm = dot(&v, &v).sqrt();
            qr.reflectors.push(v.iter().map(|x| x / norm).collect());
        }
        qr
    }

    /// Qᵀv.
    fn turn(&self, v: &mut [f64]) {
        for h in &self.reflectors {
            let by = 2.0 * dot(h, v);
            v.iter_mut().zip(h).for_each(|(v, h)| *v -= by * h);
        }
    }

    /// R⁻¹ of the first elements of a vector, in the columns' own units.
    fn back(&self, v: &[f64]) -> Vec<f64> {
        let n = self.r.len();
        let mut x = vec![0.0; n];
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| self.r[j][i] * x[j]).sum();
            x[i] = (v[i] - known) / self.r[i][i];
        }
        x.iter().zip(&self.scale).map(|(x, s)| x / s).collect()
    }

    /// The minimiser of |v − Σ x c|.
    pub fn solve(&self, v: &[f64]) -> Vec<f64> {
        let mut turned = v.to_vec();
        self.turn(&mut turned);
        self.back(&turned)
    }

    /// What the columns leave of a vector.
    pub fn rest(&self, v: &[f64]) -> Vec<f64> {
        let mut turned = v.to_vec();
        self.turn(&mut turned);
        turned[..self.r.len()].fill(0.0);
        for h in self.reflectors.iter().rev() {
            let by = 2.0 * dot(h, &turned);
            turned.iter_mut().zip(h).for_each(|(v, h)| *v -= by * h);
        }
        turned
    }

    /// (RᵀR)⁻¹.
    pub fn inverse_normal(&self) -> Vec<Vec<f64>> {
        let n = self.r.len();
        let unit = |k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
        let inverse: Vec<Vec<f64>> = (0..n).map(|k| self.back(&unit(k))).collect();
        let entry = |i: usize, j: usize| (0..n).map(|k| inverse[k][i] * inverse[k][j]).sum();
        (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
    }

    /// Leverage of each of so many rows.
    pub fn leverages(&self, rows: usize) -> Vec<f64> {
        let one = |row: usize| {
            let mut v = vec![0.0; rows];
            v[row] = 1.0;
            self.turn(&mut v);
            dot(&v[..self.r.len()], &v[..self.r.len()])
        };
        (0..rows).map(one).collect()
    }
}

/// The inverse of a square matrix, by elimination with pivots.
pub fn inverse(a: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = a.len();
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let unit = (0..n).map(|j| f64::from(u8::from(i == j)));
            a[i].iter().copied().chain(unit).collect()
        })
        .collect();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs()));
        rows.swap(k, best.unwrap());
        let pivot = rows[k][k];
        rows[k].iter_mut().for_each(|x| *x /= pivot);
        let own = rows[k].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            let by = row[k];
            if i != k {
                row.iter_mut().zip(&own).for_each(|(x, o)| *x -= by * o);
            }
        }
    }
    rows.into_iter().map(|row| row[n..].to_vec()).collect()
}

/// H M Hᵀ.
pub fn sandwich(h: &[Vec<f64>], m: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = h.len();
    let left: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| (0..n).map(|k| h[i][k] * m[k][j]).sum()).collect()).collect();
    (0..n).map(|i| (0..n).map(|j| dot(&left[i], &h[j])).collect()).collect()
}

/// The inverse of the lower factor of a Hermitian matrix.
pub fn whitener(s: &[Vec<C>]) -> Vec<Vec<C>> {
    let n = s.len();
    let mut l = vec![vec![C::default(); n]; n];
    for j in 0..n {
        for i in j..n {
            let sum = (0..j).fold(s[i][j], |sum, k| sum - l[i][k] * l[j][k].conj());
            l[i][j] = if i == j { C(sum.0.sqrt(), 0.0) } else { sum * (1.0 / l[j][j].0) };
        }
    }
    let mut inverse = vec![vec![C::default(); n]; n];
    for c in 0..n {
        for i in c..n {
            let unit = C(f64::from(u8::from(i == c)), 0.0);
            let sum = (c..i).fold(unit, |sum, j| sum - l[i][j] * inverse[j][c]);
            inverse[i][c] = sum * (1.0 / l[i][i].0);
        }
    }
    inverse
}

/// The gradient by central differences with these steps.
pub fn gradient(f: impl Fn(&[f64]) -> f64, at: &[f64], steps: &[f64]) -> Vec<f64> {
    let moved = |k: usize, by: f64| {
        let mut x = at.to_vec();
        x[k] += by;
        f(&x)
    };
    (0..at.len()).map(|k| (moved(k, steps[k]) - moved(k, -steps[k])) / (2.0 * steps[k])).collect()
}

/// Second derivatives by central differences with these steps.
pub fn hessian(f: impl Fn(&[f64]) -> f64, at: &[f64], steps: &[f64]) -> Vec<Vec<f64>> {
    let n = at.len();
    let entry = |i: usize, j: usize| {
        let corner = |a: f64, b: f64| {
            let mut x = at.to_vec();
            x[i] += a * steps[i];
            x[j] += b * steps[j];
            f(&x)
        };
        let sum = corner(1.0, 1.0) - corner(1.0, -1.0) - corner(-1.0, 1.0) + corner(-1.0, -1.0);
        sum / (4.0 * steps[i] * steps[j])
    };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

/// Holds a covariance (row major) to that of the oracle, in parts of the standard errors.
#[track_caller]
pub fn same_covariance(found: &[f64], want: &[Vec<f64>], within: f64, what: &str) {
    let n = want.len();
    assert_eq!(found.len(), n * n, "{what}");
    for i in 0..n {
        for j in 0..n {
            let size = (want[i][i] * want[j][j]).sqrt();
            let gap = (found[i * n + j] - want[i][j]).abs() / size;
            assert!(gap < within, "{what} ({i}, {j}): {} for {}", found[i * n + j], want[i][j]);
        }
    }
}
