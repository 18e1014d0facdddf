//! The default band of joint fits: lines chosen as for one output, delays sought on them, and where to start from.

use super::delays;
use super::design::{Colour, JointDesign, NoiseModel};
use super::fitter::{JointFitter, JointRecord, Loaded};
use super::iterate::{JointStart, estimate};
use super::structure::Delay;
use super::uncertainty::Information;
use super::workspace::JointSpace;
use crate::error::{Error, Status};
use crate::estimate::band::{Band, BandRule, Choice, Range, SAME, fewest_lines};
use crate::estimate::fitter::LIVE;
use crate::estimate::{Options, Wanted};
use crate::simd::LANES;
use crate::structure::Method;

/// Most steps, and alternations with Σ, of a fit that chooses the band.
const TRIAL: usize = 15;
/// Most delays tried, over all paths together.
const TRIALS: usize = 128;

impl JointFitter {
    /// Lines, the default rule's account, and where to start from.
    pub(crate) fn choose(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
    ) -> Result<Choice, Error> {
        let given: Vec<Range> = self.records.iter().map(|r| r.range).collect();
        let sought = self.o.band == Band::Default
            && !self.o.noise.equation
            && matches!(self.o.method, Method::Awls | Method::Ml);
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        if !sought {
            let start = match self.o.structure.free_delays().is_empty() {
                true => None,
                false => self.search(loaded, records, &given, &white)?,
            };
            return Ok(Choice { ranges: given, rule: None, theta: start });
        }
        let narrow: Vec<Range> = self.records.iter().map(|r| (0, r.narrow)).collect();
        let last = |r: &[Range]| r.iter().map(|r| r.1).max().unwrap_or(0);
        // Delays are sought on the band where a wrong one shows, and on the narrow one for the second start.
        let search = |ranges: &[Range]| match self.o.structure.free_delays().is_empty() {
            true => Ok(None),
            false => self.search(loaded, records, ranges, &white),
        };
        let first = search(&given)?;
        let d = self.design(&given, &loaded.units, &white)?;
        let mut w = self.space(&d, loaded);
        let (first_cost, theta) = self.trial(&d, &mut w, records, first.as_deref())?;
        let mut rule = BandRule {
            wide: last(&given),
            narrow: last(&narrow),
            costs: [first_cost, f64::INFINITY],
            chosen: last(&given),
        };
        let mut best = theta;
        let second = match narrow == given {
            true => None,
            // Too few lines for the unknowns are no failure of the wide fit.
            false => match self.design(&narrow, &loaded.units, &white) {
                Ok(few) => {
                    let mut space = self.space(&few, loaded);
                    let start = search(&narrow)?;
                    self.trial(&few, &mut space, records, start.as_deref())?.1
                }
                Err(_) => None,
            },
        };
        if let Some(start) = second {
            let (cost, again) = self.trial(&d, &mut w, records, Some(&start))?;
            rule.costs[1] = cost;
            if cost < first_cost + SAME * first_cost.abs() {
                best = again;
            } else if let Some(theta) = &best {
                // The workspace must stand at the estimate that is kept.
                self.trial(&d, &mut w, records, Some(theta))?;
            }
        }
        let ranges = match best {
            Some(_) => self.narrowest(&d, &mut w, &given),
            None => given,
        };
        rule.chosen = last(&ranges);
        Ok(Choice { ranges, rule: Some(rule), theta: best })
    }

    /// Cost that fits may be compared by, and the estimate if there is one.
    fn trial(
        &self,
        d: &JointDesign,
        w: &mut JointSpace,
        records: &[JointRecord<'_>],
        start: Option<&[f64]>,
    ) -> Result<(f64, Option<Vec<f64>>), Error> {
        // To choose a band, an estimate near the minimum will do.
        let maxiter = self.o.options.maxiter.min(TRIAL);
        let options = Options { wanted: Wanted::Cost, maxiter, ..self.o.options };
        let mut delayed = self.delayed(records);
        let mut refresh = |w: &mut JointSpace| delays::refresh(self.isa, d, w, &mut delayed, 1);
        let start = start.map_or(JointStart::Wls, JointStart::Theta);
        let outcome = estimate(self.isa, d, w, LIVE, start, &options, &mut refresh)?;
        let usable = matches!(outcome.status[0], Status::Ok | Status::MaxIter);
        let cost = w.criterion(d, 0);
        Ok(match usable && cost.is_finite() {
            true => (cost, Some(w.theta(d, 0).collect())),
            false => (f64::INFINITY, None),
        })
    }

    /// Estimates from many delays at once, one a lane; the best one's parameters.
    fn search(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
        noise: &NoiseModel,
    ) -> Result<Option<Vec<f64>>, Error> {
        let d = self.design(ranges, &loaded.units, noise)?;
        let mut w = self.space(&d, loaded);
        let free = &d.free_delays;
        // So many of each that all combinations stay within the trials.
        let each = match free.len() {
            1 => TRIALS,
            2 => 11,
            3 => 5,
            _ => 2,
        };
        let grids: Vec<Vec<f64>> = free
            .iter()
            .map(|s| match d.structure.paths[*s].delay {
                Delay::Free { start, min, max } => {
                    // An eighth of the shortest period: from there the way leads down.
                    let step = 0.125 * std::f64::consts::TAU / d.band_edge;
                    let count = (((max - min) / step).ceil() as usize + 1).clamp(2, each);
                    let grid =
                        (0..count).map(|k| min + (max - min) * k as f64 / (count - 1) as f64);
                    std::iter::once(start).chain(grid).collect()
                }
                Delay::Known(delay) => vec![delay],
            })
            .collect();
        let trials: usize = grids.iter().map(Vec::len).product::<usize>().min(16 * TRIALS);
        let mut delayed = self.delayed(records);
        let options = Options { wanted: Wanted::Cost, ..self.o.options };
        let few = Options { maxiter: self.o.options.maxiter.min(2 * TRIAL), ..options };
        let (mut best, mut lowest) = (None, f64::INFINITY);
        for first in (0..trials).step_by(LANES) {
            let count = (trials - first).min(LANES);
            for lane in 0..LANES {
                let mut rest = first + lane.min(count - 1);
                for (at, grid) in grids.iter().enumerate() {
                    let tau = grid[rest % grid.len()];
                    rest /= grid.len();
                    w.iterates.theta.now[d.free.len() + at].0[lane] = tau / d.delay_scale;
                }
            }
            let live = std::array::from_fn(|lane| lane < count);
            let mut refresh =
                |w: &mut JointSpace| delays::refresh(self.isa, &d, w, &mut delayed, LANES);
            // First with the delays where they are, then on from there.
            estimate(self.isa, &d, &mut w, live, JointStart::Held, &few, &mut refresh)?;
            let outcome =
                estimate(self.isa, &d, &mut w, live, JointStart::Here, &few, &mut refresh)?;
            for lane in 0..count {
                let cost = w.criterion(&d, lane);
                let usable = matches!(outcome.status[lane], Status::Ok | Status::MaxIter);
                if usable && cost < lowest {
                    (best, lowest) = (Some(w.theta(&d, lane).collect()), cost);
                }
            }
        }
        Ok(best)
    }

    /// The fewest lines whose standard errors at equal σ stay within the tolerance.
    fn narrowest(&self, d: &JointDesign, w: &mut JointSpace, wide: &[Range]) -> Vec<Range> {
        let omega0: Vec<f64> = self.records.iter().map(|r| r.window.omega0).collect();
        let p = d.parameters();
        fewest_lines(&omega0, wide, |ranges| {
            for ((r, range), rd) in w.records.iter_mut().zip(ranges).zip(&d.records) {
                r.limit = (range.1 + 1).saturating_sub(rd.lines.first).min(rd.used);
            }
            if d.freedom(w.records.iter().map(|r| r.limit)) == 0 {
                return None;
            }
            self.isa.run(Information { design: d, space: w });
            if w.trusted.0[0] == 0.0 {
                super::qr_step::inverse(self.isa, d, w, 0);
            }
            Some((0..p).map(|k| w.inverse[k * p + k].0[0]).collect())
        })
    }
}
