//! Covariance of the lines where samples differ in variance: gaps, outliers, changing noise (dense).
//!
//! With w the quadrature's weights over the window and v the variances of the samples of outputs i and j, over those
//! that Σ means,
//!
//! ```text
//! E V_i(m) V_j(l)* = Σ_ij Q_ij(m − l),    E V_i(m) V_j(l) = Σ_ij Q_ij(m + l),
//! Q_ij(d) = Σ_t w_t² √(m_i m_j) min(v_i/m_i, v_j/m_j) e^{−2πi d t/T},    m the median of v.
//! ```
//!
//! Where v is the same for all outputs, Σ stands apart and one factor serves as long as the samples do.

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

/// Variance of a sample that counts for nothing, over the usual one: its value drops out to nine digits.
const IGNORED: f64 = 1e8;
/// Part of a variance by which two may differ and be one.
const SAME: f64 = 1e-9;

/// When the samples of a window were taken.
enum Instants<'a> {
    /// Evenly, in so many intervals.
    Even(usize),
    /// Each at a phase in turns per harmonic.
    Uneven(&'a [f64]),
}

/// Covariances of the samples of outputs, up to Σ, as sums over them.
#[derive(Debug, Clone)]
pub(crate) struct Sums {
    /// Q of outputs (0, 0), (1, 0), (1, 1), (2, 0), …
    pairs: Arc<Vec<Vec<(f64, f64)>>>,
    outputs: usize,
    first: usize,
    /// One over the standard deviation of all samples beside theirs.
    by: f64,
}

/// What samples of uneven variance make of the lines of a record.
#[derive(Debug, Clone, Default)]
pub(crate) enum Uneven {
    /// All samples of an output are alike.
    #[default]
    No,
    /// One an output: correlated or not, the samples of all differ in one way.
    Each(Vec<Whitener>),
    /// They differ in several ways: what outputs share depends on the sample.
    Together(Sums),
}

impl Uneven {
    pub fn is_none(&self) -> bool {
        matches!(self, Uneven::No)
    }

    /// The same for samples of so many times the variance.
    pub fn of_variance(&self, variance: f64) -> Uneven {
        match self {
            Uneven::No => Uneven::No,
            Uneven::Each(all) => {
                Uneven::Each(all.iter().map(|w| w.of_variance(variance)).collect())
            }
            Uneven::Together(sums) => {
                Uneven::Together(Sums { by: sums.by / variance.sqrt(), ..sums.clone() })
            }
        }
    }
}

impl Sums {
    /// The covariance of `lines` lines of outputs of covariance `sigma`, factored.
    pub fn whitener(&self, sigma: &[f64], lines: usize) -> Whitener {
        let q = self.outputs;
        let rows: Vec<(usize, bool, usize)> = (self.first..self.first + lines)
            .flat_map(|m| [(m, false), (m, true)])
            .filter(|row| *row != (0, true))
            .flat_map(|(m, im)| (0..q).map(move |i| (m, im, i)))
            .collect();
        let size = rows.len();
        let mut covariance = vec![0.0; size * size];
        for (j, (column, a)) in covariance.chunks_exact_mut(size.max(1)).zip(&rows).enumerate() {
            for (to, b) in column.iter_mut().zip(&rows).skip(j) {
                let (high, low) = (a.2.max(b.2), a.2.min(b.2));
                let own = &self.pairs[high * (high + 1) / 2 + low];
                let (sum, gap) = (own[b.0 + a.0], own[b.0 - a.0]);
                let half = match (b.1, a.1) {
                    (false, false) => gap.0 + sum.0,
                    (true, true) => gap.0 - sum.0,
                    (true, false) => gap.1 + sum.1,
                    (false, true) => sum.1 - gap.1,
                };
                *to = 0.5 * half * sigma[high * q + low];
            }
        }
        let factor = Arc::new(Cholesky::new(covariance, size));
        Whitener { factor, by: self.by, first_is_real: self.first == 0, outputs: q }
    }
}

/// Cholesky factor of the covariance of (Re V(0),) Re V(1), Im V(1), …, each of one output or of all.
///
/// The factor of fewer lines is the leading part of that of more.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    factor: Arc<Cholesky>,
    /// One over the standard deviation of all samples beside the factor's.
    by: f64,
    first_is_real: bool,
    outputs: usize,
}

impl Whitener {
    fn of_variance(&self, variance: f64) -> Whitener {
        Whitener { by: self.by / variance.sqrt(), ..self.clone() }
    }

    /// Outputs of one column.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Whitens the columns of `lines` lines that start at some blocks of `all`, output by output, each Re and then Im,
    /// groups of eight lines; what fills up the last group becomes zero. `work` is for the rows in order.
    pub fn whiten(
        &self,
        all: &mut [Wide],
        starts: &[usize],
        (groups, lines): (usize, usize),
        work: &mut Vec<f64>,
    ) {
        let q = self.outputs;
        // Re of line 0 stands alone.
        let skip = if self.first_is_real { q } else { 0 };
        let rows = (2 * q * lines - skip).min(self.factor.size());
        let part = groups * LANES;
        let place = |row: usize| {
            let at = if row < q { row } else { row + skip };
            (2 * (at % q) + at / q % 2) * part + at / (2 * q)
        };
        work.clear();
        for start in starts {
            let column = &numbers(all)[start * LANES..][..2 * q * part];
            work.extend((0..rows).map(|row| column[place(row)]));
        }
        self.factor.whiten(work, rows);
        for (start, own) in starts.iter().zip(work.chunks_exact(rows.max(1))) {
            let column = &mut numbers_mut(all)[start * LANES..][..2 * q * part];
            column.fill(0.0);
            for (row, value) in own.iter().enumerate() {
                column[place(row)] = self.by * value;
            }
        }
    }
}

/// The middle one of the finite numbers, the upper of two.
fn median(of: &[f64]) -> f64 {
    let mut all: Vec<f64> = of.iter().copied().filter(|x| x.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// What the variances of the outputs' samples make of the lines `first` to `last`; `coupled`: Σ is theirs alone.
pub(crate) fn uneven(
    variances: &[Vec<f64>],
    (samples, time): (usize, Time<'_>),
    window: Window,
    rule: Rule,
    (first, last): Range,
    coupled: bool,
) -> Result<Uneven, Error> {
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
    let (mut known, mut usual) = (Vec::new(), Vec::new());
    for v in variances {
        if v.len() != samples || v.iter().any(|x| *x <= 0.0 || x.is_nan()) {
            return Err(Error::Data(format!(
                "fitting with uneven noise: {} variances for {samples} samples, all above zero",
                v.len()
            )));
        }
        let own = &v[window.lead..];
        if own.iter().filter(|x| x.is_finite()).count() < 8 {
            return Err(Error::Data(
                "fitting: fewer than 8 samples of an output are left unmasked".into(),
            ));
        }
        let middle = median(own);
        known.push(own.iter().map(|x| x.min(middle * IGNORED)).collect::<Vec<f64>>());
        usual.push(middle);
    }
    let sums = |power: &mut dyn Iterator<Item = f64>| {
        let power: Vec<f64> = power.zip(&weights).map(|(v, w)| v * w * w).collect();
        sums(&power, &instants, 2 * last)
    };
    let odd = |(own, by): (&Vec<f64>, &f64)| {
        let gap = |(x, first): (&f64, &f64)| (x / by - first / usual[0]).abs() > SAME * (x / by);
        own.iter().zip(&known[0]).any(gap)
    };
    if coupled && known.iter().zip(&usual).any(odd) {
        let mut pairs = Vec::new();
        for i in 0..known.len() {
            for j in 0..=i {
                // Two outputs share the noise of the better sample; what is worse in the other is its own.
                let share = |(a, b): (&f64, &f64)| {
                    (a / usual[i]).min(b / usual[j]) * (usual[i] * usual[j]).sqrt()
                };
                pairs.push(sums(&mut known[i].iter().zip(&known[j]).map(share))?);
            }
        }
        let (pairs, outputs) = (Arc::new(pairs), known.len());
        return Ok(Uneven::Together(Sums { pairs, outputs, first, by: 1.0 }));
    }
    let mut all: Vec<Whitener> = Vec::new();
    for (i, own) in known.iter().enumerate() {
        let whitener = match known[..i].iter().position(|other| other == own) {
            Some(same) => all[same].clone(),
            None => {
                let pairs = Arc::new(vec![sums(&mut own.iter().copied())?]);
                Sums { pairs, outputs: 1, first, by: 1.0 }.whitener(&[1.0], last + 1 - first)
            }
        };
        all.push(whitener);
    }
    Ok(Uneven::Each(all))
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
