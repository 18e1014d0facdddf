//! Colour of each channel's noise: an autoregression fitted to the power that residuals show on the lines.
//!
//! A channel's noise has the power it was taken for on a line times |v|² over what that is expected to be, v being the
//! noise that explains the residuals best; where there are as many equations as outputs, that is the periodogram of
//! the outputs' residuals. Colours have a mean square of 1 over the lines, so that levels stay those of the band.

use super::descent::{Ended, usable};
use super::iterate::TermsProblem;
use super::plan::TermsFitter;
use super::rows::TermsWorkspace;
use crate::error::{Error, Status};
use crate::estimate::autoregression::{Autocovariance, FREE_ROUNDS, ROUNDS, SETTLED, share};
use crate::estimate::band::Range;
use crate::estimate::normal_equations::RowWeights;
use crate::modulation::Lines;

/// Lines that tell the colour, over those of the fit.
const WIDER: usize = 4;

impl TermsFitter {
    /// The estimate in noise of the colour that its residuals show, and the colour, until neither changes.
    pub(super) fn colour(
        &self,
        problem: &mut TermsProblem<'_>,
        ranges: &[Range],
        first: Ended,
    ) -> Result<Ended, Error> {
        if !self.o.coloured || self.weights().0 != RowWeights::Adapted {
            return Ok(first);
        }
        let each = ranges.iter().zip(&self.records);
        let wide: Vec<Range> =
            each.map(|(own, plan)| (own.0, own.1.max((WIDER * own.1).min(plan.highest)))).collect();
        let sigmas = problem.sigmas.clone();
        let mut beyond = self.problem(problem.records, sigmas, &wide, TermsWorkspace::default())?;
        let (mut ended, mut orders) = (first, Vec::new());
        for round in 0..ROUNDS {
            if !usable(&ended) {
                return Ok(ended);
            }
            beyond.set_sigmas(problem.sigmas.clone());
            let fixed = (round >= FREE_ROUNDS).then_some(&*orders);
            orders = beyond.recolour(&ended.theta, fixed, ranges)?;
            if problem.take_colours(&beyond) <= SETTLED {
                return Ok(ended);
            }
            let next = self.estimate(problem, Some(&ended.theta))?;
            let nit = ended.nit + next.nit;
            ended = self.learn(problem, Ended { nit, ..next })?;
        }
        Ok(Ended { status: Status::MaxIter, ..ended })
    }
}

impl TermsProblem<'_> {
    /// The colours of a problem on more lines; the largest change.
    fn take_colours(&mut self, beyond: &TermsProblem<'_>) -> f64 {
        let mut changed = 0.0f64;
        for (spot, wider) in self.spots.iter_mut().zip(&beyond.spots) {
            let count = spot.lines.count();
            let colours: Vec<Vec<f64>> =
                wider.colours.iter().map(|own| own[..count].to_vec()).collect();
            for (c, own) in colours.iter().enumerate() {
                for (m, h) in own.iter().enumerate() {
                    let before = spot.colours.get(c).map_or(1.0, |own| own[m]);
                    changed = changed.max((h / before - 1.0).abs());
                }
            }
            spot.colours = colours;
        }
        self.forget_cost();
        changed
    }

    /// Gives the noise the colours that the residuals at θ show, of given orders or of the best ones, with a mean
    /// square of 1 on the lines of these ranges; the orders.
    fn recolour(
        &mut self,
        theta: &[f64],
        orders: Option<&[usize]>,
        ranges: &[Range],
    ) -> Result<Vec<usize>, Error> {
        self.cost(theta, RowWeights::Adapted)?;
        let (isa, e, pairs) = (self.fitter.isa, &self.fitter.o.equations, &self.fitter.pairs);
        let omega = |lines: Lines| {
            let each = (lines.first..=lines.last).map(move |m| m as f64 * lines.omega0);
            each.collect::<Vec<f64>>()
        };
        let places: Vec<Vec<f64>> = self.spots.iter().map(|s| omega(s.lines)).collect();
        let (lines, top) =
            places.iter().flatten().fold((0, 0.0f64), |(n, most), x| (n + 1, most.max(*x)));
        let used: Vec<f64> = (places.iter().zip(ranges).zip(&self.spots))
            .flat_map(|((places, range), spot)| &places[..range.1 + 1 - spot.lines.first])
            .copied()
            .collect();
        let mut colours = vec![Vec::new(); self.spots.len()];
        let mut found = Vec::new();
        self.spots.iter_mut().for_each(|spot| spot.find_sources(isa, pairs));
        for channel in 0..e.noisy.len() {
            let mut covariance = Autocovariance::default();
            for (spot, places) in self.spots.iter().zip(&places) {
                let ratios = spot.power_over_expected(e, pairs, channel);
                for (m, (ratio, x)) in ratios.iter().zip(places).enumerate() {
                    let own = spot.colours.get(channel).map_or(1.0, |h| h[m]);
                    let weight = share(m, places.len(), spot.lines.first == 0);
                    covariance.add(weight * own * own * ratio, *x, top);
                }
            }
            let own = covariance.fitted(lines, orders.map(|orders| orders[channel]));
            let power = |x: &f64| 1.0 / (own.size(*x, top) * own.size(*x, top));
            let mean = used.iter().map(power).sum::<f64>() / used.len() as f64;
            for (to, places) in colours.iter_mut().zip(&places) {
                to.push(places.iter().map(|x| (power(x) / mean).sqrt()).collect::<Vec<f64>>());
            }
            found.push(own.order);
        }
        for (spot, colours) in self.spots.iter_mut().zip(colours) {
            spot.colours = colours;
        }
        self.forget_cost();
        Ok(found)
    }
}
