//! Noise levels of several records that are fitted as one problem, estimated with the parameters.
//!
//! With s_k² the mean square of record k's residuals over ν_k degrees of freedom, x_k = ln s_k² + 1/ν_k has variance
//! 2/ν_k about the record's own level. What the x_k vary by beyond that is the variance τ² of the levels themselves
//! (R. DerSimonian, N. Laird, Meta-analysis in clinical trials, 1986), and each level is what x_k and the others say:
//!
//! ```text
//! ln v_k = x̄ + (x_k − x̄) τ²/(τ² + 2/ν_k).
//! ```
//!
//! Records of one level keep equal weights; records whose levels differ plainly get their own.

use super::answer::Answer;
use crate::error::{Error, Status};
use crate::math::ln_1;
use crate::modulation::Lines;

/// Rounds of levels and parameters, and the change of ln v that ends them.
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-3;
/// Least variance of a record over that of the noisiest.
const LEAST: f64 = 1e-12;

/// What the residuals of one record say.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Misfit {
    /// Sum of squares, weighted by the levels that stand.
    pub squares: f64,
    /// Degrees of freedom of it.
    pub freedom: f64,
}

/// Residuals of one record on its lines.
pub(crate) trait Residual {
    /// Sum of squares.
    fn squares(&self) -> f64;
    /// How many real residuals there are.
    fn rows(&self, lines: &Lines) -> usize;
}

impl Residual for Vec<(f64, f64)> {
    fn squares(&self) -> f64 {
        self.iter().map(|(re, im)| re * re + im * im).sum()
    }
    fn rows(&self, lines: &Lines) -> usize {
        // Line 0 has no Im.
        2 * self.len() - usize::from(lines.first == 0)
    }
}

impl Residual for Vec<Vec<(f64, f64)>> {
    fn squares(&self) -> f64 {
        self.iter().map(Residual::squares).sum()
    }
    fn rows(&self, lines: &Lines) -> usize {
        self.iter().map(|output| output.rows(lines)).sum()
    }
}

/// What a fit's residuals (over `sigma` and the levels that stand) say of each record; nothing of a fit that is none.
pub(crate) fn misfits<R: Residual>(
    answer: &Answer,
    sigma: f64,
    residuals: &[R],
) -> Option<Vec<Misfit>> {
    let parameters = answer.theta.len();
    let rows: Vec<usize> =
        residuals.iter().zip(&answer.lines).map(|(r, lines)| r.rows(lines)).collect();
    let all: usize = rows.iter().sum();
    let transient = all.saturating_sub(answer.degrees_of_freedom + parameters) / rows.len();
    // The parameters take from each record's rows alike.
    let left = answer.degrees_of_freedom as f64 / (answer.degrees_of_freedom + parameters) as f64;
    let one = |(r, rows): (&R, &usize)| Misfit {
        squares: r.squares() * sigma * sigma,
        freedom: (rows - transient) as f64 * left,
    };
    let usable = matches!(answer.status, Status::Ok | Status::MaxIter)
        && rows.iter().all(|rows| *rows > transient + parameters);
    usable.then(|| residuals.iter().zip(&rows).map(one).collect())
}

/// Fits again until levels and parameters stand: variances of the records over a common one, of geometric mean 1
/// weighted by their freedom, with the fit they belong to.
///
/// `first` is a fit at the variances `from`; `misfits` of a fit that is none are nothing, and end it.
pub(crate) fn settle<F>(
    from: Vec<f64>,
    first: F,
    misfits: impl Fn(&F) -> Option<Vec<Misfit>>,
    mut again: impl FnMut(&[f64], &F) -> Result<F, Error>,
) -> Result<(Vec<f64>, F), Error> {
    let (mut variances, mut fit) = (from, first);
    for _ in 0..ROUNDS {
        let Some(seen) = misfits(&fit) else { break };
        let Some(next) = levels(&variances, &seen) else { break };
        let change = |(old, new): (&f64, &f64)| ln_1(new / old).abs();
        if variances.iter().zip(&next).map(change).fold(0.0, f64::max) < SETTLED {
            break;
        }
        let other = again(&next, &fit)?;
        if misfits(&other).is_none() {
            break;
        }
        (variances, fit) = (next, other);
    }
    Ok((variances, fit))
}

/// The variances that residuals under `now` tell; none without any residual.
fn levels(now: &[f64], seen: &[Misfit]) -> Option<Vec<f64>> {
    let mean_square = |(v, m): (&f64, &Misfit)| v * m.squares / m.freedom;
    let squares: Vec<f64> = now.iter().zip(seen).map(mean_square).collect();
    let largest = squares.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0 && squares.iter().all(|s| s.is_finite())) {
        return None;
    }
    let own: Vec<f64> = seen.iter().map(|m| 2.0 / m.freedom).collect();
    let x: Vec<f64> =
        squares.iter().zip(&own).map(|(s, own)| ln_1(s.max(LEAST * largest)) + 0.5 * own).collect();
    let spread = spread(&x, &own);
    let mean = mean(&x, own.iter().map(|own| 1.0 / (spread + own)));
    let shrunk = x.iter().zip(&own).map(|(x, own)| mean + (x - mean) * spread / (spread + own));
    let shrunk: Vec<f64> = shrunk.collect();
    let middle = self::mean(&shrunk, seen.iter().map(|m| m.freedom));
    Some(shrunk.iter().map(|x| libm::exp(x - middle)).collect())
}

/// τ²: what numbers of these variances vary by beyond them.
fn spread(x: &[f64], variances: &[f64]) -> f64 {
    let weights = || variances.iter().map(|v| 1.0 / v);
    let mean = mean(x, weights());
    let excess: f64 = x.iter().zip(weights()).map(|(x, w)| w * (x - mean) * (x - mean)).sum();
    let (sum, squares) = (weights().sum::<f64>(), weights().map(|w| w * w).sum::<f64>());
    ((excess - (x.len() - 1) as f64) / (sum - squares / sum)).max(0.0)
}

fn mean(x: &[f64], weights: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut all) = (0.0, 0.0);
    for (x, w) in x.iter().zip(weights) {
        (sum, all) = (sum + w * x, all + w);
    }
    sum / all
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;

    fn misfits(squares: &[f64]) -> Vec<Misfit> {
        squares.iter().map(|s| Misfit { squares: *s, freedom: 41.0 }).collect()
    }

    #[test]
    fn equal_records_have_equal_levels() {
        for squares in [[40.0, 40.0, 40.0], [38.0, 40.0, 43.0]] {
            let found = levels(&[1.0; 3], &misfits(&squares)).unwrap();
            assert!(found.iter().all(|v| (v - 1.0).abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn far_levels_are_those_of_the_residuals() {
        let found = levels(&[1.0; 2], &misfits(&[40.0, 16_000.0])).unwrap();
        let ratio = found[1] / found[0];
        // ln 400 less the share of its standard error: Q = 5.99²/(2·0.0488), τ² = 17.9.
        assert!((ratio.ln() - 400f64.ln() * (1.0 - 0.0488 / 17.94)).abs() < 1e-3, "{ratio}");
        assert!((found[0] * found[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn standing_levels_stay() {
        // Residuals that the levels explain ask for no other ones, but for what shrinks.
        let now = [0.05, 20.0];
        let found = levels(&now, &misfits(&[40.0, 40.0])).unwrap();
        assert!((found[0] / now[0]).ln().abs() < 0.01, "{found:?}");
    }

    #[test]
    fn silent_records_tell_nothing() {
        assert!(levels(&[1.0; 2], &misfits(&[0.0, 0.0])).is_none());
        assert!(levels(&[1.0; 2], &misfits(&[1.0, f64::NAN])).is_none());
    }

    #[test]
    fn rounds_end_where_levels_stand() {
        // Residuals of true variances 1 and 100, whatever the parameters.
        let truth = [1.0, 100.0];
        let under = |v: &[f64]| -> Vec<Misfit> {
            let squares: Vec<f64> = truth.iter().zip(v).map(|(t, v)| 40.0 * t / v).collect();
            misfits(&squares)
        };
        let mut rounds = 0;
        let (found, _) = settle(
            vec![1.0; 2],
            under(&[1.0; 2]),
            |fit| Some(fit.clone()),
            |v, _| {
                rounds += 1;
                Ok(under(v))
            },
        )
        .unwrap();
        assert!((found[1] / found[0] / 100.0).ln().abs() < 0.03, "{found:?}");
        assert!(rounds <= 2, "{rounds}");
    }
}
