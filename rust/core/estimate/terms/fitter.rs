//! Fits of equations to records, with everything a user sees.

use super::descent::{Ended, usable};
use super::iterate::TermsProblem;
use super::lines::TermsRecordPlan;
use super::plan::{TermsFitter, TermsRecord};
use super::rows::{Spot, TermsWorkspace};
use super::sigma::Sigma;
use super::uncertainty::Worth;
use crate::error::{Error, Status};
use crate::estimate::answer::Answer;
use crate::estimate::band::{Band, BandRule, Choice, Range, SAME, fewest_lines};
use crate::estimate::driven::output::Levels;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::options::Options;
use crate::structure::Method;

/// A noise level is taken to be at least this part of the channel's size.
const SILENT: f64 = 1e-9;
/// A band of more than so many times the lines that tell the unknowns is wide.
const WIDE: usize = 2;
/// Standard deviations of a correlation in the high band that are no chance.
const CORRELATED: f64 = 3.0;
/// Precision of an estimate that slopes are taken at.
const START: f64 = 1e-4;
/// A finished fit.
#[derive(Debug, Clone)]
pub struct TermsFit {
    /// Estimates, covariances, outcome.
    pub answer: Answer,
    /// Variance of the noise over that of the levels: cost over degrees of freedom.
    pub scale: f64,
    /// Standard deviation of each noisy channel of each record that weighed the rows.
    pub levels: Vec<Vec<f64>>,
    /// The same as given, or as seen in the high band.
    pub seen: Vec<Vec<f64>>,
    /// Correlation of the noise of these channels, of each record, row major.
    pub correlation: Vec<Vec<f64>>,
    /// Degrees of freedom of each HC3 standard error (Satterthwaite).
    pub hc3_degrees: Vec<f64>,
    /// Whether each parameter stands at a bound.
    pub at_bound: Vec<bool>,
    /// Residuals of each record and equation over σ: unit variance in Re and Im.
    pub residuals: Vec<Vec<Vec<(f64, f64)>>>,
    /// How far noise bends signals that depend on θ (`lines/bend.rs`); beyond ½ the cost says nothing.
    pub bend: f64,
    /// Where noise drives the equations: what of it, and what of the samples.
    pub driven: Option<Levels>,
}

impl TermsFitter {
    /// Fits one set of parameters to one record, or to several as one problem.
    ///
    /// # Errors
    /// [`Error::Data`] for what the caller can mend; failures of the numbers are a [`Status`].
    pub fn fit(&self, records: &[TermsRecord<'_>]) -> Result<TermsFit, Error> {
        self.check(records)?;
        let seen = self.sigmas(records)?;
        let sigmas = self.first_sigmas(records, &seen)?;
        let chosen = self.choose(records, &sigmas)?;
        let mut lent = self.workers.lend();
        let worker = lent.get_or(TermsWorkspace::default);
        let (mut fit, back) = self.finish(records, sigmas, &chosen, std::mem::take(worker))?;
        *worker = back;
        if fit.driven.is_none() {
            fit.seen = seen.iter().map(Sigma::levels).collect();
        }
        Ok(fit)
    }

    /// The estimate on the lines chosen, with everything a user sees.
    pub(crate) fn finish(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: Vec<Sigma>,
        chosen: &Choice,
        worker: TermsWorkspace,
    ) -> Result<(TermsFit, TermsWorkspace), Error> {
        if let Some(noise) = self.driven() {
            return self.finish_driven(records, sigmas, chosen, worker, noise);
        }
        let other = match &chosen.theta {
            Some(_) => None,
            None => self.narrow_guess(records, &sigmas, &chosen.ranges)?,
        };
        let mut problem = self.problem(records, sigmas, &chosen.ranges, worker)?;
        let mut ended = self.estimate(&mut problem, chosen.theta.as_deref())?;
        if let Some(theta) = other {
            let second = self.estimate(&mut problem, Some(&theta))?;
            ended = problem.better(ended, second);
        }
        let ended = self.learn(&mut problem, ended)?;
        let ended = self.colour(&mut problem, &chosen.ranges, ended)?;
        let ended = self.again(&mut problem, ended)?;
        let fit = self.finished(&mut problem, &ended, chosen.rule)?;
        Ok((fit, problem.into_worker()))
    }

    pub(crate) fn check(&self, records: &[TermsRecord<'_>]) -> Result<(), Error> {
        let shapes = records.len() == self.records.len()
            && records.iter().zip(&self.records).all(|(r, plan)| {
                r.channels.len() == self.o.equations.channels
                    && r.channels.iter().all(|c| c.len() == plan.samples)
            });
        if shapes {
            return Ok(());
        }
        Err(Error::Data(format!(
            "fitting: {} records do not have the {} channels and the lengths that were planned for",
            records.len(),
            self.o.equations.channels
        )))
    }

    /// Covariance of the noisy channels of each record: as given, else from the band that signals leave empty.
    pub(crate) fn sigmas(&self, records: &[TermsRecord<'_>]) -> Result<Vec<Sigma>, Error> {
        if let Some(levels) = &self.o.levels {
            let own = Sigma::independent(levels.iter().map(|s| s * s).collect());
            return Ok(vec![own; records.len()]);
        }
        let own = records.iter().zip(&self.records);
        own.map(|(record, plan)| self.sigma(record, plan)).collect()
    }

    fn sigma(&self, record: &TermsRecord<'_>, plan: &TermsRecordPlan) -> Result<Sigma, Error> {
        let e = &self.o.equations;
        let order = e.orders.iter().copied().max().unwrap_or(1);
        let channels: Vec<&[f64]> =
            e.noisy.iter().map(|c| &record.channels[*c][plan.window.lead..]).collect();
        let seen = match plan.dt.is_nan() {
            false => plan.noise_level(order).and_then(|own| own.covariance(self.isa, &channels)),
            true => Err(Error::Data(
                "fitting: the samples are uneven in time, so that their noise level cannot be seen; \
                 give it with noise=mf.Noise(y=...)"
                    .into(),
            )),
        };
        let (seen, doubt) = match seen {
            Err(error) if self.o.levels_matter => return Err(error),
            Err(_) => (Sigma::independent(vec![1.0; channels.len()]), 1.0),
            Ok((whole, doubt)) => (Sigma::of(channels.len(), &whole), doubt),
        };
        let least = |samples: &&[f64]| {
            let own = SILENT * samples.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            (own * own).max(f64::MIN_POSITIVE)
        };
        let mut own = seen.at_least(&channels.iter().map(least).collect::<Vec<f64>>());
        let together = |r: f64| self.o.learn && r.abs() > CORRELATED * doubt;
        let q = channels.len();
        let correlation = own.correlation();
        for (a, b) in (0..q * q).map(|k| (k / q, k % q)).filter(|(a, b)| a < b) {
            if !together(correlation[a * q + b]) {
                own.set(a, b, 0.0);
            }
        }
        Ok(own.kept_definite())
    }

    pub(crate) fn problem<'a>(
        &'a self,
        records: &'a [TermsRecord<'a>],
        sigmas: Vec<Sigma>,
        ranges: &[Range],
        worker: TermsWorkspace,
    ) -> Result<TermsProblem<'a>, Error> {
        let e = &self.o.equations;
        let (mut rows, mut unknowns) = (0, e.parameters);
        let equations = e.orders.len();
        let unit = vec![1.0; equations];
        let TermsWorkspace { space, spots } = worker;
        // Those of several equations are in units of the last record.
        let mut old = spots.into_iter().filter(|_| equations == 1);
        let mut spots = Vec::new();
        for (plan, (first, last)) in self.records.iter().zip(ranges) {
            let lines = plan.lines(*first, *last);
            let spot = match old.next() {
                Some(spot) if spot.of(lines) => spot.uncoloured(),
                _ => Spot::new(self.isa, e, lines, self.o.trend, &unit),
            };
            rows += spot.rows.len();
            unknowns += spot.transients;
            spots.push(spot);
        }
        if rows <= unknowns {
            return Err(Error::Data(format!(
                "fitting: the lines up to {:.4} rad/s give {rows} real equations for {unknowns} unknowns \
                 (parameters, end conditions and trend); widen the band or take longer records",
                ranges
                    .iter()
                    .zip(&self.records)
                    .fold(0.0, |m: f64, (r, p)| { m.max(r.1 as f64 * p.window.omega0) })
            )));
        }
        let mut problem = TermsProblem::new(self, records, sigmas, spots, space);
        if equations > 1 {
            // Flat weights compare equations by what they hold without parameters.
            problem.cost(&vec![0.0; e.parameters], RowWeights::Flat)?;
            let power = problem.target_power();
            let largest = power.iter().copied().fold(0.0, f64::max);
            let sound =
                |p: &f64| if *p > SILENT * largest { *p } else { largest.max(f64::MIN_POSITIVE) };
            let power: Vec<f64> = power.iter().map(sound).collect();
            let each = self.records.iter().zip(ranges);
            problem.replace(each.map(|(plan, (first, last))| {
                Spot::new(self.isa, e, plan.lines(*first, *last), self.o.trend, &power)
            }));
        }
        Ok(problem)
    }

    /// An estimate on few lines, where a wide band of nonlinear signals or free lags was given: there unweighted
    /// rows may be ruled by noise, and what they say is no start.
    fn narrow_guess(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: &[Sigma],
        ranges: &[Range],
    ) -> Result<Option<Vec<f64>>, Error> {
        if !self.looks_on_few(ranges) || self.o.equations.near().is_some() {
            return Ok(None);
        }
        let Ok(mut few) =
            self.problem(records, sigmas.to_vec(), &self.narrow, TermsWorkspace::default())
        else {
            return Ok(None); // too few lines for the unknowns
        };
        let guess = self.estimate(&mut few, None)?;
        Ok(usable(&guess).then_some(guess.theta))
    }

    /// Whether there is an estimate on few lines first.
    pub(super) fn looks_on_few(&self, ranges: &[Range]) -> bool {
        let wide = ranges.iter().zip(&self.narrow).any(|(own, few)| own.1 > WIDE * few.1);
        wide && (self.refines() || self.o.equations.free_lags().next().is_some())
    }

    /// Estimates from θ, or from where one may begin without.
    pub(super) fn estimate(
        &self,
        problem: &mut TermsProblem<'_>,
        from: Option<&[f64]>,
    ) -> Result<Ended, Error> {
        let (weights, factors) = self.weights();
        let Options { tol, maxiter, .. } = self.o.options;
        if self.o.method == Method::Ls {
            return problem.differenced(tol, maxiter);
        }
        let start = match from {
            Some(theta) => theta.to_vec(),
            None => problem.begin(None)?,
        };
        problem.iterate(start, weights, factors, self.first_tolerance(), maxiter)
    }

    /// How exact the first estimate is: what is only a start for slopes elsewhere need not be.
    pub(super) fn first_tolerance(&self) -> f64 {
        let tol = self.o.options.tol;
        if self.refines() { tol.max(START) } else { tol }
    }

    /// Whether slopes are taken a second time, where the first estimate's noise is taken away.
    pub(super) fn refines(&self) -> bool {
        self.weights().1 == LeftColumns::Denoised && self.o.equations.bends()
    }

    /// The estimate once more, with slopes at channels that the first one's noise was taken from.
    fn again(&self, problem: &mut TermsProblem<'_>, first: Ended) -> Result<Ended, Error> {
        let (weights, factors) = self.weights();
        if !usable(&first) || !self.refines() {
            return Ok(first);
        }
        problem.relinearise(&first.theta)?;
        let Options { tol, maxiter, .. } = self.o.options;
        let second = problem.iterate(first.theta.clone(), weights, factors, tol, maxiter)?;
        let nit = first.nit + second.nit;
        Ok(Ended { nit, ..second })
    }

    /// Whether the default rule looks at the samples.
    pub(super) fn band_is_sought(&self) -> bool {
        self.o.band == Band::Default && self.weights().0 == RowWeights::Adapted
    }

    /// Lines as given, or by the default rule: wide from two starts, then the fewest that lose nothing.
    pub(crate) fn choose(
        &self,
        records: &[TermsRecord<'_>],
        sigmas: &[Sigma],
    ) -> Result<Choice, Error> {
        if !self.band_is_sought() {
            return Ok(Choice { ranges: self.given.clone(), rule: None, theta: None });
        }
        let last = |r: &[Range]| r.iter().map(|r| r.1).max().unwrap_or(0);
        let wide = self.widest(records, sigmas)?;
        let mut all = self.problem(records, sigmas.to_vec(), &wide, TermsWorkspace::default())?;
        let first = self.estimate(&mut all, None)?;
        let mut rule = BandRule {
            wide: last(&wide),
            narrow: last(&self.narrow),
            costs: [first.cost, f64::INFINITY],
            chosen: last(&wide),
        };
        let mut best = Some(first).filter(usable);
        if self.narrow != wide
            && let Ok(mut few) =
                self.problem(records, sigmas.to_vec(), &self.narrow, TermsWorkspace::default())
        {
            let start = self.estimate(&mut few, None)?;
            if usable(&start) {
                let second = self.estimate(&mut all, Some(&start.theta))?;
                rule.costs[1] = second.cost;
                let lower = best.as_ref().is_none_or(|b| second.cost < b.cost * (1.0 - SAME));
                if usable(&second) && lower {
                    best = Some(second);
                }
            }
        }
        let Some(best) = best else {
            return Ok(Choice { ranges: wide, rule: Some(rule), theta: None });
        };
        if self.driven().is_some() {
            // The levels of both kinds of noise need all lines.
            let ranges = wide.iter().zip(&self.records).map(|(own, plan)| (own.0, plan.highest));
            return Ok(Choice { ranges: ranges.collect(), rule: None, theta: Some(best.theta) });
        }
        let (weights, factors) = self.weights();
        all.cost(&best.theta, weights)?;
        all.jacobian(factors);
        let omega0: Vec<f64> = self.records.iter().map(|r| r.window.omega0).collect();
        let ranges = fewest_lines(&omega0, &wide, |ranges| {
            let last: Vec<usize> = ranges.iter().map(|r| r.1).collect();
            all.variances_up_to(&last, &best.at_bound)
        });
        rule.chosen = last(&ranges);
        Ok(Choice { ranges, rule: Some(rule), theta: Some(best.theta) })
    }

    /// The wide band: as planned, for nonlinear signals no wider than the channels show more than noise, since
    /// what noise makes of such a signal beyond would pass for information.
    fn widest(&self, records: &[TermsRecord<'_>], sigmas: &[Sigma]) -> Result<Vec<Range>, Error> {
        let e = &self.o.equations;
        let mut ranges = self.given.clone();
        if !e.bends() {
            return Ok(ranges);
        }
        let order = e.orders.iter().copied().max().unwrap_or(1);
        let own = ranges.iter_mut().zip(&self.narrow).zip(self.records.iter().zip(records));
        for (((range, narrow), (plan, record)), sigma) in own.zip(sigmas) {
            if plan.dt.is_nan() {
                continue;
            }
            let channels = &record.channels;
            let variances = sigma.variances();
            let edge = plan.signal_edge(self.isa, channels, &e.noisy, variances, order, range.1)?;
            range.1 = range.1.min(edge.max(narrow.1));
        }
        Ok(ranges)
    }

    pub(super) fn finished(
        &self,
        problem: &mut TermsProblem<'_>,
        ended: &Ended,
        band_rule: Option<BandRule>,
    ) -> Result<TermsFit, Error> {
        let (weights, factors) = self.weights();
        let cost = problem.cost(&ended.theta, weights)?;
        problem.jacobian(factors);
        let fit = self.told(problem, ended, cost, band_rule);
        Ok(TermsFit { bend: problem.bend(&ended.theta), ..fit })
    }

    /// The same where cost, columns and residual at the estimate stand.
    pub(super) fn told(
        &self,
        problem: &TermsProblem<'_>,
        ended: &Ended,
        cost: f64,
        band_rule: Option<BandRule>,
    ) -> TermsFit {
        let degrees = problem.degrees_of_freedom();
        let scale = cost / degrees as f64;
        let p = self.o.equations.parameters;
        let worth = match (ended.status, self.o.method) {
            (Status::Rank | Status::NonFinite, _) => Worth::unknown(p),
            (_, Method::Ls) => problem.differenced_worth(scale, degrees),
            _ => problem.worth(scale, &ended.at_bound),
        };
        // No variance is known better than the noise that scales it.
        let hc3_degrees = worth.degrees.iter().map(|d| d.min(degrees as f64)).collect();
        let by = 1.0 / scale.sqrt();
        let residuals = problem
            .spots
            .iter()
            .map(|spot| {
                let mut each =
                    vec![vec![(0.0, 0.0); spot.lines.count()]; self.o.equations.orders.len()];
                for (row, value) in spot.rows.iter().zip(&spot.residual) {
                    let to = &mut each[row.equation][row.line];
                    *(if row.im { &mut to.1 } else { &mut to.0 }) = value * by;
                }
                each
            })
            .collect();
        let seen: Vec<_> = problem.sigmas.iter().map(Sigma::levels).collect();
        TermsFit {
            answer: Answer {
                theta: ended.theta.clone(),
                cov_nonrobust: worth.nonrobust,
                cov_hc3: worth.hc3,
                cov_spectral: worth.spectral.0,
                degrees: worth.spectral.1,
                noise_spectrum: worth.spectral.2,
                gram: worth.gram,
                cost,
                degrees_of_freedom: degrees,
                status: ended.status,
                nit: ended.nit,
                lines: problem.spots.iter().map(|s| s.lines).collect(),
                band_rule,
            },
            scale,
            levels: seen.clone(),
            seen,
            correlation: problem.sigmas.iter().map(Sigma::correlation).collect(),
            hc3_degrees,
            at_bound: ended.at_bound.clone(),
            residuals,
            bend: 0.0,
            driven: None,
        }
    }
}
