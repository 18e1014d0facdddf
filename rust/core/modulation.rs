//! From Fourier coefficients to equations: the columns on the lines, the transient polynomial, Δⁿ.
//!
//! On line m the equation error is Σ_j g_j (iω)^{k_j} V_j(m) − T(iω), ω = mω₀ (docs/core.md). Frequencies are
//! divided by the upper band edge, so x = ω/ω_B runs over 0..1 and all powers stay of order one.

use crate::structure::{Structure, Trend};

/// The lines of one record that are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lines {
    /// Lowest harmonic used.
    pub first: usize,
    /// Highest harmonic used, K = M + n.
    pub last: usize,
    /// Resolving frequency ω₀ = 2π/T in rad/s.
    pub omega0: f64,
    /// Variance of a Fourier coefficient under white sample noise of variance one, Σw²/N².
    pub unit_variance: f64,
}

impl Lines {
    /// How many.
    #[must_use]
    pub fn count(&self) -> usize {
        self.last + 1 - self.first
    }
}

/// What a column is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Signal {
    /// The output's Fourier coefficients.
    Y,
    /// Those of input k.
    U(usize),
    /// The constant one: columns of the transient and of a drift.
    One,
    /// The denoised output of the last iterate.
    Denoised,
}

/// One column: sign · i^phase · x^power · V(m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// V.
    pub signal: Signal,
    /// Power of x; −1 only for the column of a drift.
    pub power: i32,
    /// Power of i, modulo 4.
    pub phase: u8,
    /// +1 or −1.
    pub sign: f64,
}

impl Column {
    fn operator(signal: Signal, power: usize, sign: f64) -> Column {
        Column { signal, power: power as i32, phase: (power % 4) as u8, sign }
    }
}

/// Columns of the transient polynomial T and of a drift.
///
/// With all rows (`extended`) T has n real coefficients: even powers in the real rows, odd ones in
/// the imaginary rows. The report's range 0..M differences them one sided, and 2n − 1 columns vanish.
#[must_use]
pub fn transient_columns(order: usize, extended: bool, trend: Trend) -> Vec<Column> {
    let column = |power: usize, phase: usize| Column {
        signal: Signal::One,
        power: power as i32,
        phase: phase as u8,
        sign: -1.0,
    };
    let mut all: Vec<Column> = if extended {
        (0..order).map(|j| column(j, j % 2)).collect()
    } else {
        (0..order).map(|j| column(j, 0)).chain((1..order).map(|j| column(j, 1))).collect()
    };
    if trend == Trend::Linear {
        all.push(Column { signal: Signal::One, power: -1, phase: 3, sign: -1.0 });
    }
    all
}

/// Columns of θ (report, eq. 16): s^k Y with plus, s^k U with minus.
#[must_use]
pub fn parameter_columns(structure: &Structure) -> Vec<Column> {
    let column = |(signal, power): (usize, usize)| match signal {
        0 => Column::operator(Signal::Y, power, 1.0),
        k => Column::operator(Signal::U(k - 1), power, -1.0),
    };
    structure.terms().into_iter().map(column).collect()
}

/// The column with coefficient one, sⁿY.
#[must_use]
pub fn target_column(structure: &Structure) -> Column {
    Column::operator(Signal::Y, structure.order, 1.0)
}

/// Signed binomials of Δⁿ (report, eq. 10): Δⁿ Q(m) = Σ_j (−1)^{n−j} C(n, j) Q(m + j).
#[must_use]
pub fn difference_weights(order: usize) -> Vec<f64> {
    let mut c = vec![1.0];
    for _ in 0..order {
        let shifted = std::iter::once(0.0).chain(c.iter().copied());
        let padded = c.iter().copied().chain(std::iter::once(0.0));
        c = shifted.zip(padded).map(|(up, here)| up - here).collect();
    }
    c
}

/// The modulating indices m of the differenced rows, and whether the first row is real.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rows {
    /// Lowest index, −⌊n/2⌋ when extended.
    pub first: isize,
    /// Highest index M = K − n.
    pub last: isize,
    /// The first row is its own mirror image: only its real part counts.
    pub first_is_real: bool,
}

/// Rows for the lines `first..=last`; a lower band edge starts Δⁿ there.
#[must_use]
pub fn rows(order: usize, first: usize, last: usize, extended: bool) -> Rows {
    let half = (order / 2) as isize;
    let mirrored = extended && first == 0;
    Rows {
        first: if mirrored { -half } else { first as isize },
        last: last as isize - order as isize,
        first_is_real: mirrored && order.is_multiple_of(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_the_report() {
        assert_eq!(difference_weights(1), vec![-1.0, 1.0]);
        assert_eq!(difference_weights(2), vec![1.0, -2.0, 1.0]);
        assert_eq!(difference_weights(3), vec![-1.0, 3.0, -3.0, 1.0]);
    }

    #[test]
    fn differences_annihilate_the_transient() {
        for order in 1..6 {
            let c = difference_weights(order);
            for power in 0..order {
                let sum: f64 = (0..=order)
                    .map(|j| c[j] * (0..power).fold(1.0, |v, _| v * (j as f64 - 3.0)))
                    .sum();
                assert_eq!(sum, 0.0, "order {order}, power {power}");
            }
        }
    }

    #[test]
    fn equations_counted_as_in_the_text() {
        // 2M + n + 1 real equations with all rows, 2M + 2 with the report's range.
        for (order, m) in [(1, 5), (2, 6), (3, 9), (4, 11)] {
            let all = rows(order, 0, m + order, true);
            let count = 2 * (all.last - all.first + 1) - all.first_is_real as isize;
            assert_eq!(count as usize, 2 * m + order + 1);
            let lines = 2 * (m + order) + 1;
            assert_eq!(lines - transient_columns(order, true, Trend::None).len(), count as usize);
            let short = rows(order, 0, m + order, false);
            assert_eq!(2 * (short.last - short.first + 1) as usize, 2 * m + 2);
            assert_eq!(lines - transient_columns(order, false, Trend::None).len(), 2 * m + 2);
        }
    }
}
