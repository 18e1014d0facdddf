//! The lines of a fit that was given none: wide enough for the estimate, and not an error bar wider.
//!
//! With N intervals, n poles and # unknowns, trend terms included:
//!
//! ```text
//! wide    K  = max(⌊N/8⌋, min(⌊N/4⌋, 16)),        narrow  k₀ = min(3# + n, K),
//! chosen  k* = min { k : se_i(k) ≤ 1.01 se_i(K) for every parameter i, at equal σ }.
//! ```
//!
//! The wide fit starts from `wls` and from the narrow fit; the lower cost counts. `ls` and `wls` take M = 3#, which
//! is the report's guideline (eq. 20).

use super::band::{BandRule, Choice, Range, SAME, fewest_lines};
use super::fitter::{Desk, Fitter, Problem};
use super::options::Start;
use super::pass::prepare;
use super::uncertainty::{Information, mend_inverse};
use crate::error::Error;

impl Fitter {
    /// The default rule: fit wide from `wls` and from the narrow fit, keep the lower cost; then the
    /// fewest lines that keep every standard error within 1 % of the wide one's at equal σ.
    pub(crate) fn default_band(&self, desk: &mut Desk, wide: Vec<Range>) -> Result<Choice, Error> {
        let narrow: Vec<Range> = self.records.iter().map(|r| (0, r.narrow)).collect();
        let last = |r: &[Range]| r.iter().map(|r| r.1).max().unwrap_or(0);
        let mut all = self.problem(desk, &wide)?;
        let (first_cost, first) = all.trial(self, Start::Wls);
        let mut rule = BandRule {
            wide: last(&wide),
            narrow: last(&narrow),
            costs: [first_cost, f64::INFINITY],
            chosen: last(&wide),
        };
        let mut best = first;
        if let Some(start) = (narrow != wide).then(|| self.start(desk, &narrow)).flatten() {
            let (cost, second) = all.trial(self, Start::Theta(&start));
            rule.costs[1] = cost;
            if cost < first_cost * (1.0 + SAME) {
                best = second;
            } else if let Some(theta) = &best {
                // The workspace must stand at the estimate that is kept.
                all.trial(self, Start::Theta(theta));
            }
        }
        let ranges = match best {
            Some(_) => self.narrowest(&mut all, &wide),
            None => wide,
        };
        rule.chosen = last(&ranges);
        desk.keep(all);
        Ok(Choice { ranges, rule: Some(rule), theta: best })
    }

    /// The estimate of the narrow fit, where there is one.
    fn start(&self, desk: &mut Desk, narrow: &[Range]) -> Option<Vec<f64>> {
        let mut few = self.problem(desk, narrow).ok()?;
        let (_, theta) = few.trial(self, Start::Wls);
        desk.keep(few);
        theta
    }

    /// The fewest lines whose standard errors at equal σ stay within the tolerance.
    fn narrowest(&self, problem: &mut Problem, wide: &[Range]) -> Vec<Range> {
        let (d, w) = (&problem.design, &mut problem.space);
        let omega0: Vec<f64> = self.records.iter().map(|r| r.window.omega0).collect();
        let p = d.parameters();
        prepare(self.isa, d, w);
        fewest_lines(&omega0, wide, |ranges| {
            let mut equations = 0;
            for ((r, range), lines) in w.records.iter_mut().zip(ranges).zip(d.lines()) {
                r.limit = (range.1 + 1).saturating_sub(lines.first).min(r.lines);
                equations += 2 * r.limit - usize::from(lines.first == 0);
            }
            if equations <= d.parameters() + d.transient * w.records.len() {
                return None;
            }
            self.isa.run(Information { design: d, space: w, covariance: true });
            mend_inverse(d, w, 0);
            Some((0..p).map(|k| w.inverse[k * p + k].0[0]).collect())
        })
    }
}
