//! What may be fitted jointly: denominators of the outputs, paths, held and bounded coefficients, delays.

use crate::error::Error;

/// Coefficients that no record tells apart.
const MOST: usize = 1 << 20;

/// Delay of an input on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delay {
    /// Known, in seconds.
    Known(f64),
    /// To be found between two bounds, in seconds.
    Free {
        /// Tried besides the grid between the bounds.
        start: f64,
        /// Least.
        min: f64,
        /// Most; the window starts this late.
        max: f64,
    },
}

impl Delay {
    /// The longest it may be.
    #[must_use]
    pub fn longest(self) -> f64 {
        match self {
            Delay::Known(delay) => delay,
            Delay::Free { max, .. } => max,
        }
    }
}

/// An input with a delay; several paths may share it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Which input.
    pub input: usize,
    /// How late it acts.
    pub delay: Delay,
}

/// A_i(p) y_i = Σ_k B_ik(p) u_k(t − τ_k) for outputs i; the A_i are one and the same where `common`
/// (report, eq. 25), else each output has its own (eq. 26).
#[derive(Debug, Clone, PartialEq)]
pub struct JointStructure {
    /// Degree of each output's denominator.
    pub orders: Vec<usize>,
    /// Whether all outputs share one.
    pub common: bool,
    /// Degree of the numerator of each output and path; `None` where there is none.
    pub numerators: Vec<Vec<Option<usize>>>,
    /// Inputs with their delays.
    pub paths: Vec<Path>,
    /// Value of each coefficient that is not estimated.
    pub fixed: Vec<Option<f64>>,
    /// Least and most of each coefficient.
    pub bounds: Vec<(f64, f64)>,
}

/// Which signal a coefficient multiplies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointSignal {
    Output,
    Path(usize),
}

/// Coefficient × s^power × signal in the equation of an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    pub coefficient: usize,
    pub output: usize,
    pub signal: JointSignal,
    pub power: usize,
}

impl JointStructure {
    /// Checks degrees and lengths; `fixed` and `bounds` empty: nothing is held.
    ///
    /// # Errors
    /// [`Error::Spec`] naming what does not fit.
    pub fn checked(mut self) -> Result<JointStructure, Error> {
        let outputs = self.orders.len();
        let wrong = |text: String| Err(Error::Spec(format!("building the structure: {text}")));
        if outputs == 0 || self.orders.contains(&0) {
            return wrong(
                "an output with 0 poles leaves nothing to modulate; give at least 1".into(),
            );
        }
        if self.common && self.orders.iter().any(|n| *n != self.orders[0]) {
            return wrong(format!("a common denominator has one degree, not {:?}", self.orders));
        }
        if self.numerators.len() != outputs
            || self.numerators.iter().any(|row| row.len() != self.paths.len())
        {
            return wrong(format!(
                "{} rows of numerators for {outputs} outputs and {} paths",
                self.numerators.len(),
                self.paths.len()
            ));
        }
        for (row, order) in self.numerators.iter().zip(&self.orders) {
            if let Some(degree) = row.iter().flatten().find(|d| *d > order) {
                return wrong(format!(
                    "{degree} zeros but {order} poles; give at most as many zeros as poles"
                ));
            }
        }
        let count = self.coefficients();
        if count > MOST {
            return wrong(format!(
                "{count} coefficients; give fewer poles and zeros, at most {MOST}"
            ));
        }
        if self.fixed.is_empty() {
            self.fixed = vec![None; count];
        }
        if self.bounds.is_empty() {
            self.bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); count];
        }
        if self.fixed.len() != count || self.bounds.len() != count {
            return wrong(format!(
                "{} held values and {} bounds for {count} coefficients",
                self.fixed.len(),
                self.bounds.len()
            ));
        }
        if self.fixed.iter().flatten().any(|v| !v.is_finite()) {
            return wrong("a held coefficient is not finite".into());
        }
        let reversed = |(low, high): &&(f64, f64)| low.is_nan() || high.is_nan() || low > high;
        if let Some((low, high)) = self.bounds.iter().find(reversed) {
            return wrong(format!("bounds from {low} to {high}; give the lower one first"));
        }
        for path in &self.paths {
            let sound = match path.delay {
                Delay::Known(delay) => delay >= 0.0 && delay.is_finite(),
                Delay::Free { start, min, max } => {
                    min >= 0.0 && min < max && max.is_finite() && (min..=max).contains(&start)
                }
            };
            if !sound {
                return wrong(format!(
                    "the delay {:?} is no time, or its bounds do not hold the start; delays are in \
                     seconds, 0 <= min <= start <= max",
                    path.delay
                ));
            }
        }
        Ok(self)
    }

    /// Number of coefficients, held ones included.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        let own = if self.common { &self.orders[..1] } else { &self.orders };
        let numerators = self.numerators.iter().flatten().flatten().map(|d| d.saturating_add(1));
        own.iter().copied().chain(numerators).fold(0, usize::saturating_add)
    }

    /// Coefficients that are estimated.
    #[must_use]
    pub fn free(&self) -> Vec<usize> {
        (0..self.fixed.len()).filter(|k| self.fixed[*k].is_none()).collect()
    }

    /// Paths whose delay is estimated.
    #[must_use]
    pub fn free_delays(&self) -> Vec<usize> {
        let free = |k: &usize| matches!(self.paths[*k].delay, Delay::Free { .. });
        (0..self.paths.len()).filter(free).collect()
    }

    /// Number of estimated parameters: coefficients, then delays.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.free().len() + self.free_delays().len()
    }

    /// Longest delay in seconds.
    #[must_use]
    pub fn longest_delay(&self) -> f64 {
        self.paths.iter().fold(0.0, |most: f64, p| most.max(p.delay.longest()))
    }

    /// First coefficient of each output's denominator, and of each numerator [output][path].
    pub(crate) fn places(&self) -> (Vec<usize>, Vec<Vec<usize>>) {
        let (mut denominators, mut numerators) = (Vec::new(), Vec::new());
        let mut next = if self.common { self.orders[0] } else { 0 };
        for (order, row) in self.orders.iter().zip(&self.numerators) {
            if self.common {
                denominators.push(0);
            } else {
                denominators.push(next);
                next += order;
            }
            let place = |degree: &Option<usize>| {
                let at = next;
                next += degree.map_or(0, |d| d + 1);
                at
            };
            numerators.push(row.iter().map(place).collect());
        }
        (denominators, numerators)
    }

    /// Each denominator that these parameters make, without the leading 1.
    pub(crate) fn denominators(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let mut free = theta.iter().copied();
        let all: Vec<f64> =
            self.fixed.iter().map_while(|held| held.or_else(|| free.next())).collect();
        let places = self.places().0.into_iter().zip(&self.orders);
        let each = places.map(|(from, order)| all[from..from + order].to_vec());
        each.take(if self.common { 1 } else { self.orders.len() }).collect()
    }

    /// All terms but the leading ones, sⁿY.
    pub(crate) fn terms(&self) -> Vec<Term> {
        let (denominators, numerators) = self.places();
        let mut all = Vec::new();
        for (output, order) in self.orders.iter().enumerate() {
            for j in 0..*order {
                let (coefficient, power) = (denominators[output] + j, order - 1 - j);
                all.push(Term { coefficient, output, signal: JointSignal::Output, power });
            }
            for (path, degree) in self.numerators[output].iter().enumerate() {
                for j in 0..degree.map_or(0, |d| d + 1) {
                    let power = degree.unwrap_or(0) - j;
                    let coefficient = numerators[output][path] + j;
                    all.push(Term { coefficient, output, signal: JointSignal::Path(path), power });
                }
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two(common: bool) -> JointStructure {
        JointStructure {
            orders: vec![2, 2],
            common,
            numerators: vec![vec![Some(1), None], vec![Some(0), Some(1)]],
            paths: vec![
                Path { input: 0, delay: Delay::Known(0.0) },
                Path { input: 1, delay: Delay::Free { start: 0.1, min: 0.0, max: 0.4 } },
            ],
            fixed: vec![],
            bounds: vec![],
        }
        .checked()
        .unwrap()
    }

    #[test]
    fn shared_denominators_count_once() {
        assert_eq!((two(true).coefficients(), two(false).coefficients()), (7, 9));
        assert_eq!((two(true).parameters(), two(false).parameters()), (8, 10));
        assert_eq!(two(true).places(), (vec![0, 0], vec![vec![2, 4], vec![4, 5]]));
        assert_eq!(two(false).places(), (vec![0, 4], vec![vec![2, 4], vec![6, 7]]));
    }

    #[test]
    fn denominators_have_their_held_values() {
        let mut s = two(false);
        s.fixed[1] = Some(7.0);
        let theta = [0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 0.2];
        assert_eq!(s.denominators(&theta), [[0.0, 7.0], [4.0, 5.0]]);
        let theta = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.2];
        assert_eq!(two(true).denominators(&theta), [[0.0, 1.0]]);
    }

    #[test]
    fn terms_name_output_signal_and_power() {
        let of = |output: usize| -> Vec<(usize, JointSignal, usize)> {
            let own = |t: &Term| (t.output == output).then_some((t.coefficient, t.signal, t.power));
            two(true).terms().iter().filter_map(own).collect()
        };
        use JointSignal::{Output, Path};
        assert_eq!(of(0), [(0, Output, 1), (1, Output, 0), (2, Path(0), 1), (3, Path(0), 0)]);
        assert_eq!(
            of(1),
            [(0, Output, 1), (1, Output, 0), (4, Path(0), 0), (5, Path(1), 1), (6, Path(1), 0)]
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let refused = |change: fn(&mut JointStructure), word: &str| {
            let mut s = two(true);
            change(&mut s);
            let text = s.checked().unwrap_err().to_string();
            assert!(text.contains(word), "{text}");
        };
        refused(|s| s.orders = vec![2, 3], "one degree");
        refused(|s| s.numerators[0][0] = Some(3), "3 zeros");
        refused(|s| s.fixed.push(None), "held values");
        refused(|s| s.paths[1].delay = Delay::Known(-1.0), "seconds");
    }
}
