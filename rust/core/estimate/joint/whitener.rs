//! Covariance of the lines where samples differ in variance: gaps, outliers, changing noise (dense, fixed).

use crate::error::Error;
use crate::estimate::band::Range;
use crate::estimate::fit::Time;
use crate::estimate::window::Window;
use crate::linalg::large::Cholesky;
use crate::math::sin_cos_turns_1;
use crate::quadrature::Rule;
use crate::simd::{LANES, Wide, numbers, numbers_mut};
use crate::spectrum::{CoefficientPlan, Kind};
use std::sync::Arc;

/// Standard deviation of a sample that counts for nothing, over the largest of the others: its value drops
/// out to nine digits.
const IGNORED: f64 = 1e4;

/// When the samples of a window were taken.
enum Instants<'a> {
    /// Evenly, in so many intervals.
    Even(usize),
    /// Each at a phase in turns per harmonic.
    Uneven(&'a [f64]),
}

/// Cholesky factor of the covariance of (Re V(0),) Re V(1), Im V(1), …
///
/// The factor of fewer lines is the leading part of that of more.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    factor: Arc<Cholesky>,
    /// One over the standard deviation of all samples beside the factor's.
    by: f64,
    first_is_real: bool,
}

impl Whitener {
    /// From each sample's variance (infinite: ignored) and its quadrature weight over the window's length, for the
    /// lines `first` to `last`.
    fn new(
        variances: &[f64],
        weights: &[f64],
        instants: &Instants<'_>,
        first: usize,
        last: usize,
    ) -> Result<Whitener, Error> {
        let most = variances.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let most = if most > 0.0 { most } else { 1.0 };
        let of = |v: &f64| if v.is_finite() { *v } else { most * IGNORED * IGNORED };
        let power: Vec<f64> = variances.iter().zip(weights).map(|(v, w)| of(v) * w * w).collect();
        let q = sums(&power, instants, 2 * last)?;
        let rows: Vec<(usize, bool)> = (first..=last)
            .flat_map(|m| [(m, false), (m, true)])
            .filter(|row| *row != (0, true))
            .collect();
        let size = rows.len();
        let entry = |a: (usize, bool), b: (usize, bool)| {
            let sum = q[a.0 + b.0];
            let gap = q[a.0.abs_diff(b.0)];
            // Q(m − l) for m < l is the conjugate.
            let gap = if a.0 >= b.0 { gap } else { (gap.0, -gap.1) };
            match (a.1, b.1) {
                (false, false) => 0.5 * (gap.0 + sum.0),
                (true, true) => 0.5 * (gap.0 - sum.0),
                (true, false) => 0.5 * (gap.1 + sum.1),
                (false, true) => 0.5 * (sum.1 - gap.1),
            }
        };
        let mut covariance = vec![0.0; size * size];
        for (j, column) in covariance.chunks_exact_mut(size.max(1)).enumerate() {
            for i in j..size {
                column[i] = entry(rows[i], rows[j]);
            }
        }
        let factor = Arc::new(Cholesky::new(covariance, size));
        Ok(Whitener { factor, by: 1.0, first_is_real: first == 0 })
    }

    /// The same for samples of so many times the variance.
    pub fn of_variance(&self, variance: f64) -> Whitener {
        Whitener { by: self.by / variance.sqrt(), ..self.clone() }
    }

    /// Whitens the columns of `lines` lines that start at some blocks of `all`, each Re and then Im, groups of eight
    /// lines; what fills up the last group becomes zero. `work` is for the rows in order.
    pub fn whiten(
        &self,
        all: &mut [Wide],
        starts: &[usize],
        (groups, lines): (usize, usize),
        work: &mut Vec<f64>,
    ) {
        let rows = (2 * lines - usize::from(self.first_is_real)).min(self.factor.size());
        let part = groups * LANES;
        // Re of line 0 stands alone.
        let skip = usize::from(self.first_is_real);
        let place = |row: usize| match row {
            0 => 0,
            row => (row + skip) / 2 + (row + skip) % 2 * part,
        };
        work.clear();
        for start in starts {
            let column = &numbers(all)[start * LANES..][..2 * part];
            work.extend((0..rows).map(|row| column[place(row)]));
        }
        self.factor.whiten(work, rows);
        for (start, own) in starts.iter().zip(work.chunks_exact(rows.max(1))) {
            let column = &mut numbers_mut(all)[start * LANES..][..2 * part];
            column.fill(0.0);
            for (row, value) in own.iter().enumerate() {
                column[place(row)] = self.by * value;
            }
        }
    }
}

/// Whiteners of the lines `first` to `last` of each output, from the variances of its samples.
pub(crate) fn whiteners(
    variances: &[Vec<f64>],
    (samples, time): (usize, Time<'_>),
    window: Window,
    rule: Rule,
    (first, last): Range,
) -> Result<Vec<Whitener>, Error> {
    let intervals = window.intervals;
    let mut turns = Vec::new();
    let (instants, weights): (Instants<'_>, Vec<f64>) = match time {
        Time::Even(_) => (
            Instants::Even(intervals),
            rule.weights(intervals)?.iter().map(|w| w / intervals as f64).collect(),
        ),
        Time::Uneven(t) => {
            let span = t[samples - 1] - t[0];
            turns.extend(t.iter().map(|x| (x - t[0]) / span));
            let weights = rule.uneven_weights(t)?.iter().map(|w| w / span).collect();
            (Instants::Uneven(&turns), weights)
        }
    };
    let mut all: Vec<Whitener> = Vec::new();
    for (i, v) in variances.iter().enumerate() {
        if v.len() != samples || v.iter().any(|x| *x <= 0.0 || x.is_nan()) {
            return Err(Error::Data(format!(
                "fitting with uneven noise: {} variances for {samples} samples, all above zero",
                v.len()
            )));
        }
        if v[window.lead..].iter().filter(|x| x.is_finite()).count() < 8 {
            return Err(Error::Data(
                "fitting: fewer than 8 samples of an output are left unmasked".into(),
            ));
        }
        let own = match variances[..i].iter().position(|other| other == v) {
            Some(same) => all[same].clone(),
            None => Whitener::new(&v[window.lead..], &weights, &instants, first, last)?,
        };
        all.push(own);
    }
    Ok(all)
}

/// Q(d) = Σ p e^{−2πi d t/T} over samples, d = 0..=`highest`.
fn sums(power: &[f64], instants: &Instants<'_>, highest: usize) -> Result<Vec<(f64, f64)>, Error> {
    match instants {
        Instants::Even(intervals) => {
            let (n, half) = (*intervals, highest.min(intervals / 2));
            // A plain sum; the last sample falls on the first.
            let plan = CoefficientPlan::new(n, half, Kind::Rule(Rule::Staircase), 0.0, 0)?;
            let mut period = power.to_vec();
            period[0] += power[n];
            let (mut re, mut im) = (vec![0.0; half + 1], vec![0.0; half + 1]);
            plan.run(&period, &mut re, &mut im)?;
            let at = |d: usize| match d % n {
                d if d <= half => (re[d] * n as f64, im[d] * n as f64),
                d => (re[n - d] * n as f64, -im[n - d] * n as f64),
            };
            Ok((0..=highest).map(at).collect())
        }
        Instants::Uneven(turns) => {
            let one = |d: usize| {
                power.iter().zip(*turns).fold((0.0, 0.0), |(re, im), (p, t)| {
                    let (sin, cos) = sin_cos_turns_1(-(d as f64) * t);
                    (re + p * cos, im + p * sin)
                })
            };
            Ok((0..=highest).map(one).collect())
        }
    }
}
