//! The lines of a fit that was given none: wide enough for the estimate, and not an error bar wider.
//!
//! With N intervals, n poles and # unknowns, trend terms included:
//!
//! ```text
//! wide    K  = max(⌊N/8⌋, min(⌊N/4⌋, 16)),        narrow  k₀ = min(3# + n, K),
//! chosen  k* = min { k : se_i(k) ≤ 1.01 se_i(K) for every parameter i, at equal σ }.
//! ```
//!
//! Where k* ≥ 0.9 K, errors may fall beyond: the rule is asked again with 2K, up to the last line that even samples
//! show, and its answer taken where it is surer and says the same of the record (`wider.rs`).
//!
//! The wide fit starts from `wls` and from the narrow fit; the lower cost counts. `ls` and `wls` take M = 3#, which
//! is the report's guideline (eq. 20).

use super::band::{BandRule, Choice, Range, SAME, fewest_lines, lower_ends};
use super::fitter::{FitWorkspace, Fitter, Problem};
use super::options::Start;
use super::pass::prepare;
use super::second_start::{is_long, lowest, unstable};
use super::uncertainty::{Information, mend_inverse};
use crate::error::Error;
use crate::simd::LANES;
use crate::structure::{Method, Noise};

/// Costs of two ways that differ by more, in parts of themselves, are of two minima: they come close to their ends only.
const APART: f64 = 1e-6;

impl Fitter {
    /// The default rule: fit wide from `wls` and from the narrow fit, keep the lower cost; then the
    /// fewest lines that keep every standard error within 1 % of the wide one's at equal σ.
    /// `before`: the estimate over a narrower band that such a rule chose, which is a third start.
    pub(crate) fn default_band(
        &self,
        space: &mut FitWorkspace,
        wide: Vec<Range>,
        before: Option<&[f64]>,
    ) -> Result<Choice, Error> {
        let narrow = self.narrow(&wide);
        let last = |r: &[Range]| r.iter().map(|r| r.1).max().unwrap_or(0);
        let second = self.narrow_estimate(space, &wide);
        let mut all = self.problem(space, &wide)?;
        let starts: Vec<Vec<f64>> = match before {
            // The narrow start keeps its place in the account.
            Some(before) => vec![second.unwrap_or_else(|| before.to_vec()), before.to_vec()],
            None => second.into_iter().collect(),
        };
        let costs = all.trial(self, &starts);
        let mut lane = usize::from(costs[1] < costs[0] * (1.0 + SAME));
        if costs[2] < costs[lane] * (1.0 - SAME) {
            lane = 2;
        }
        let mut cost = costs[lane];
        let astray = may_have_gone_astray(&mut all, &costs[..=starts.len()], lane);
        if astray {
            (lane, cost) = self.go_from_filters(&mut all, lane, cost);
        }
        let mut theta: Option<Vec<f64>> =
            cost.is_finite().then(|| all.space.theta(&all.design, lane).collect());
        let (most, few) = (last(&wide), last(&narrow));
        let ranges = match theta {
            Some(_) => self.narrowest(&mut all, &wide, lane),
            None => wide,
        };
        space.keep(all);
        if let Some(theta) = theta.as_mut().filter(|_| astray) {
            // Another minimum may be the lowest on fewer lines.
            *theta = self.lower_from_filters(space, &ranges, theta)?;
        }
        let [first, second, ..] = costs;
        let chosen = last(&ranges);
        let rule = BandRule { wide: most, narrow: few, costs: [first, second], chosen };
        Ok(Choice { ranges, rule: Some(rule), theta })
    }

    /// The estimate that these parameters or regressions behind filters lead to, close to its end.
    pub(super) fn lower_from_filters(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
        theta: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let mut problem = self.problem(space, ranges)?;
        let cost = problem.trial_from(self, Start::Theta(theta))[0];
        let (lane, _) = self.go_from_filters(&mut problem, 0, cost);
        let theta = problem.space.theta(&problem.design, lane).collect();
        space.keep(problem);
        Ok(theta)
    }

    /// Goes again from regressions behind filters and says which lane is best then, and its cost: one of these, if its cost
    /// is lower and no more of its poles are unstable. Else all stays as it was.
    fn go_from_filters(&self, problem: &mut Problem, lane: usize, cost: f64) -> (usize, f64) {
        let most = unstable(&problem.design, &mut problem.space, lane);
        problem.space.before.copy(&problem.space.iterates, [true; LANES]);
        let costs = problem.trial_from(self, Start::Filtered);
        let best = lowest(&problem.design, &mut problem.space, costs, (cost, most));
        match best {
            Some(best) => (best, costs[best]),
            None => {
                let w = &mut problem.space;
                w.iterates.copy(&w.before, [true; LANES]);
                (lane, cost)
            }
        }
    }

    /// Few lines at the lower end of each range.
    pub(super) fn narrow(&self, ranges: &[Range]) -> Vec<Range> {
        lower_ends(ranges, self.records.iter().map(|r| r.narrow))
    }

    /// The second start of a fit on these lines: the estimate on few of them, where they are more than few and it
    /// has one. Where noise rules the upper lines, `wls` on all of them may lead astray.
    pub(crate) fn narrow_estimate(
        &self,
        space: &mut FitWorkspace,
        ranges: &[Range],
    ) -> Option<Vec<f64>> {
        let adapts =
            self.o.noise == Noise::Output && matches!(self.o.method, Method::Awls | Method::Ml);
        let narrow = self.narrow(ranges);
        if !adapts || narrow == ranges {
            return None;
        }
        let mut few = self.problem(space, &narrow).ok()?;
        let found = few.trial(self, &[])[0].is_finite();
        let theta = found.then(|| few.space.theta(&few.design, 0).collect());
        space.keep(few);
        theta
    }

    /// The fewest lines whose standard errors at equal σ stay within the tolerance, at the estimate of a lane.
    fn narrowest(&self, problem: &mut Problem, wide: &[Range], lane: usize) -> Vec<Range> {
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
            mend_inverse(d, w, lane);
            Some((0..p).map(|k| w.inverse[k * p + k].0[lane]).collect())
        })
    }
}

/// Whether ways to these costs, in the first lanes, were so long or their ends so far apart that all may have led
/// astray; or the best of them, to an unstable system.
fn may_have_gone_astray(problem: &mut Problem, costs: &[f64], best: usize) -> bool {
    let same = |cost: &f64| (cost - costs[0]).abs() <= APART * costs[0];
    (0..costs.len()).any(|lane| is_long(&problem.space, lane))
        || !costs.iter().all(same)
        || unstable(&problem.design, &mut problem.space, best) > 0
}
