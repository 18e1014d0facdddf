//! Lines in bins no wider than an eighth of their frequency, and Chebyshev polynomials at the middle of each.

use super::TERMS;
use crate::math::ln_1;
use crate::modulation::Lines;

/// Terms that all products of two of them are sums of.
pub(super) const PRODUCTS: usize = 2 * TERMS - 1;
/// T_0, T_1 and on at one place.
pub(super) type Terms = [f64; PRODUCTS];
/// Width of a bin over its frequency.
const WIDTH: f64 = 0.125;

/// Which lines stand together, and the terms there.
#[derive(Debug, Clone)]
pub(crate) struct Bins {
    /// Bin of each line of each record.
    pub of: Vec<Vec<usize>>,
    /// T_j at the middle of each bin.
    pub terms: Vec<Terms>,
    /// Mean frequency of each bin, rad/s.
    pub omega: Vec<f64>,
}

impl Bins {
    /// For these lines of records that share their noise.
    pub fn new(lines: &[Lines]) -> Bins {
        let unit = lines.iter().fold(f64::INFINITY, |unit, l| unit.min(l.omega0));
        let place = |l: &Lines, m: usize| m as f64 * l.omega0 / unit;
        let highest = lines.iter().fold(1.0, |top: f64, l| top.max(place(l, l.last)));
        // Records whose lengths no number compares.
        let highest = highest.min(f64::MAX);
        let mut edges = vec![0.5];
        while let Some(edge) = edges.last().copied().filter(|edge| *edge <= highest) {
            edges.push(edge + (edge * WIDTH).round().max(1.0));
        }
        let bin = |x: f64| edges.partition_point(|edge| *edge <= x);
        let mut found = vec![(0.0, 0.0, 0.0); edges.len() + 1];
        for l in lines {
            for m in l.first..=l.last {
                let x = place(l, m);
                let own = &mut found[bin(x)];
                *own = (own.0 + 1.0, own.1 + ln_1(1.0 + x), own.2 + x);
            }
        }
        // Bins that hold no line have no number.
        let mut number = vec![0; found.len()];
        let (mut terms, mut omega) = (Vec::new(), Vec::new());
        for (number, (count, sum, places)) in number.iter_mut().zip(found) {
            *number = terms.len();
            if count > 0.0 {
                omega.push(unit * places / count);
                terms.push(chebyshev(2.0 * sum / (count * ln_1(1.0 + highest)) - 1.0));
            }
        }
        let of = lines
            .iter()
            .map(|l| (l.first..=l.last).map(|m| number[bin(place(l, m))]).collect())
            .collect();
        Bins { of, terms, omega }
    }
}

fn chebyshev(x: f64) -> Terms {
    let mut t = [1.0; PRODUCTS];
    t[1] = x;
    for k in 2..PRODUCTS {
        t[k] = 2.0 * x * t[k - 1] - t[k - 2];
    }
    t
}
