//! The default band of joint fits: lines chosen as for one output, delays sought on them, and where to start from.

use super::delays;
use super::design::{Colour, NoiseModel};
use super::fitter::{JointFitter, JointRecord, Loaded};
use super::iterate::{JointStart, estimate};
use super::single::Single;
use super::structure::Delay;
use super::workspace::JointWorkspace;
use crate::error::{Error, Status};
use crate::estimate::band::{Band, BandRule, CLOSE, Choice, Range, SAME, fewest_lines, lower_ends};
use crate::estimate::{Options, Outcome, Wanted};
use crate::simd::LANES;
use crate::structure::Method;

/// Most steps, and alternations with Σ, of a fit that chooses the band.
const TRIAL: usize = 15;
/// Precision of a first look at delays, and its steps.
const LOOK: f64 = 1e-4;
const GLANCE: usize = 6;
/// Most delays tried, over all paths together.
const TRIALS: usize = 128;

impl JointFitter {
    /// Lines, the default rule's account, and where to start from. `before`: the estimate over a narrower band that
    /// such a rule chose, which is a third start.
    pub(crate) fn choose(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<Choice, Error> {
        let given = self.ranges();
        let sought = self.o.band == Band::Default && self.adapts() && !self.o.driven;
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        // After a fit over a narrower band delays need not be sought anew.
        let seeks = !self.o.structure.free_delays().is_empty();
        let known = before.filter(|_| seeks).map(<[f64]>::to_vec);
        let begun = known.or_else(|| self.estimate_apart(records));
        if !sought {
            let start = self.search(loaded, records, &given, begun.as_deref())?;
            return Ok(Choice { ranges: given, rule: None, theta: start });
        }
        let narrow = self.narrow(&given);
        let last = |r: &[Range]| r.iter().map(|r| r.1).max().unwrap_or(0);
        // Delays are sought on the band where a wrong one shows, and on the narrow one for the second start.
        let first = self.search(loaded, records, &given, begun.as_deref())?;
        let d = self.design(&given, &loaded.scales, &white, true)?;
        let mut best = self.single(&d, loaded);
        let (first_cost, _) = self.trial(&mut best, records, first.as_deref(), None)?;
        let mut rule = BandRule {
            wide: last(&given),
            narrow: last(&narrow),
            costs: [first_cost, f64::INFINITY],
            chosen: last(&given),
        };
        let mut least = first_cost;
        let second = self.narrow_estimate(loaded, records, &given, begun.as_deref())?;
        for (at, start) in [second.as_deref(), before].into_iter().enumerate() {
            let Some(start) = start else { continue };
            let mut other = self.single(&d, loaded);
            let near = least.is_finite().then(|| best.estimates());
            let (cost, same) = self.trial(&mut other, records, Some(start), near.as_deref())?;
            // Where it is the same, what it would come to stands already.
            let cost = if same { least } else { cost };
            if at == 0 {
                rule.costs[1] = cost;
            }
            if !same && (cost < least - SAME * least.abs() || !least.is_finite()) {
                (best, least) = (other, cost);
            }
        }
        let found = least.is_finite();
        let (ranges, theta) = match found {
            true => (self.narrowest(&mut best, &given), Some(best.w.theta(&d, 0).collect())),
            false => (given, None),
        };
        rule.chosen = last(&ranges);
        Ok(Choice { ranges, rule: Some(rule), theta })
    }

    /// Lines as given, else up to the widest of the default rule.
    pub(super) fn ranges(&self) -> Vec<Range> {
        self.records.iter().map(|r| r.range).collect()
    }

    /// Whether the weights follow the parameters.
    pub(super) fn adapts(&self) -> bool {
        !self.o.noise.equation && matches!(self.o.method, Method::Awls | Method::Ml)
    }

    /// Few lines at the lower end of each range.
    pub(super) fn narrow(&self, ranges: &[Range]) -> Vec<Range> {
        lower_ends(ranges, self.records.iter().map(|r| r.narrow))
    }

    /// The second start of a fit on these lines, where they are more than few: the estimate on few of them, if there
    /// is one.
    pub(crate) fn narrow_estimate(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
        begun: Option<&[f64]>,
    ) -> Result<Option<Vec<f64>>, Error> {
        let narrow = self.narrow(ranges);
        if !self.adapts() || narrow == ranges {
            return Ok(None);
        }
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        // Too few lines for the unknowns are no failure of the wide fit.
        let Ok(few) = self.design(&narrow, &loaded.scales, &white, true) else { return Ok(None) };
        let mut few = self.single(&few, loaded);
        let start = self.search(loaded, records, &narrow, begun)?;
        let (cost, _) = self.trial(&mut few, records, start.as_deref(), None)?;
        Ok(cost.is_finite().then(|| few.w.theta(few.d, 0).collect()))
    }

    /// Options of a fit that need not come to its end.
    pub(crate) fn few_steps(&self) -> Options {
        Options { maxiter: self.o.options.maxiter.min(TRIAL), ..self.o.options }
    }

    /// Cost that fits may be compared by, infinite where there is no estimate; and whether the way led `near` another
    /// estimate, where it ends.
    fn trial(
        &self,
        single: &mut Single<'_>,
        records: &[JointRecord<'_>],
        start: Option<&[f64]>,
        near: Option<&[f64]>,
    ) -> Result<(f64, bool), Error> {
        // To choose a band, an estimate near the minimum will do.
        let tol = self.o.options.tol.max(CLOSE);
        let options = Options { tol, wanted: Wanted::Cost, ..self.few_steps() };
        let mut delayed = self.delayed(records);
        let d = single.d;
        let mut refresh = |w: &mut JointWorkspace| delays::refresh(self.isa, d, w, &mut delayed, 1);
        let start = start.map_or(JointStart::Wls, JointStart::Theta);
        let ended = single.estimate(start, &options, near, &mut refresh)?;
        let cost = single.criterion();
        let usable = matches!(ended.status, Status::Ok | Status::MaxIter) && cost.is_finite();
        Ok((if usable { cost } else { f64::INFINITY }, ended.near))
    }

    /// Estimates from many delays at once, one a lane; the best one's parameters, or those that are known before
    /// (`begun`). Nothing where no delays are to be found.
    fn search(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
        begun: Option<&[f64]>,
    ) -> Result<Option<Vec<f64>>, Error> {
        if let Some(theta) = begun {
            return Ok(Some(theta.to_vec()));
        }
        if self.o.structure.free_delays().is_empty() {
            return Ok(None);
        }
        // Starts are good enough without what is known of worse samples.
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        let d = self.design(ranges, &loaded.scales, &white, false)?;
        let mut w = self.space(&d, loaded);
        let free = &d.free_delays;
        // So many of each that all combinations stay within the trials.
        let each = match free.len() {
            1 => TRIALS,
            2 => 11,
            3 => 5,
            _ => 2,
        };
        let mut fine = true;
        let grids: Vec<Vec<f64>> = free
            .iter()
            .map(|s| match d.structure.paths[*s].delay {
                Delay::Free { start, min, max } => {
                    // An eighth of the shortest period: from there the way leads down.
                    let step = 0.125 * std::f64::consts::TAU / d.band_edge;
                    let wanted = ((max - min) / step).ceil() as usize + 1;
                    fine &= wanted <= each;
                    let count = wanted.clamp(2, each);
                    let grid =
                        (0..count).map(|k| min + (max - min) * k as f64 / (count - 1) as f64);
                    let mut grid: Vec<f64> = grid.chain([start]).collect();
                    grid.sort_by(f64::total_cmp);
                    grid
                }
                Delay::Known(delay) => vec![delay],
            })
            .collect();
        let trials: usize = grids.iter().map(Vec::len).product::<usize>().min(16 * TRIALS);
        let mut delayed = self.delayed(records);
        let mut refresh =
            |w: &mut JointWorkspace| delays::refresh(self.isa, &d, w, &mut delayed, LANES);
        // Puts delays into lanes; which of these count.
        let place = |w: &mut JointWorkspace, some: &[usize]| {
            for lane in 0..LANES {
                let mut rest = some[lane.min(some.len() - 1)];
                for (at, grid) in grids.iter().enumerate() {
                    let tau = grid[rest % grid.len()];
                    rest /= grid.len();
                    w.iterates.theta.now[d.free.len() + at].0[lane] = tau / d.delay_scale;
                }
            }
            std::array::from_fn(|lane| lane < some.len())
        };
        let cost = |w: &JointWorkspace, outcome: &Outcome, lane: usize| match outcome.status[lane] {
            Status::Ok | Status::MaxIter => w.criterion(&d, lane),
            _ => f64::INFINITY,
        };
        let options = Options { wanted: Wanted::Cost, ..self.o.options };
        let mut followed: Vec<usize> = (0..trials).collect();
        if fine {
            // A look at all says from where it is worth to go on.
            let tol = options.tol.max(LOOK);
            let look = Options { tol, maxiter: options.maxiter.min(GLANCE), ..options };
            let mut costs = Vec::with_capacity(trials);
            for some in followed.chunks(LANES) {
                let live = place(&mut w, some);
                let start = JointStart::Held;
                let outcome = estimate(self.isa, &d, &mut w, live, start, &look, &mut refresh)?;
                costs.extend((0..some.len()).map(|lane| cost(&w, &outcome, lane)));
            }
            let sizes: Vec<usize> = grids.iter().map(Vec::len).collect();
            followed.retain(|trial| is_least(&costs, &sizes, *trial));
        }
        let tol = options.tol.max(CLOSE);
        let few = Options { tol, maxiter: options.maxiter.min(2 * TRIAL), ..options };
        let (mut best, mut lowest) = (None, f64::INFINITY);
        for some in followed.chunks(LANES) {
            let live = place(&mut w, some);
            // First with the delays where they are, then on from there.
            estimate(self.isa, &d, &mut w, live, JointStart::Held, &few, &mut refresh)?;
            let outcome =
                estimate(self.isa, &d, &mut w, live, JointStart::Here, &few, &mut refresh)?;
            for lane in 0..some.len() {
                let cost = cost(&w, &outcome, lane);
                if cost < lowest {
                    (best, lowest) = (Some(w.theta(&d, lane).collect()), cost);
                }
            }
        }
        Ok(best)
    }

    /// The fewest lines whose standard errors at equal σ stay within the tolerance.
    fn narrowest(&self, single: &mut Single<'_>, wide: &[Range]) -> Vec<Range> {
        let d = single.d;
        let omega0: Vec<f64> = self.records.iter().map(|r| r.window.omega0).collect();
        let columns = single.columns();
        fewest_lines(&omega0, wide, |ranges| {
            let each = d.records.iter().zip(ranges);
            let limits: Vec<usize> = each
                .map(|(rd, range)| (range.1 + 1).saturating_sub(rd.lines.first).min(rd.used))
                .collect();
            let enough = d.freedom(limits.iter().copied()) > 0;
            enough.then(|| single.variances(&columns, &limits))
        })
    }
}

/// Whether none of its neighbours in a grid of these sizes, first index fastest, undercuts a trial.
fn is_least(costs: &[f64], sizes: &[usize], trial: usize) -> bool {
    let lower = |other: usize| costs.get(other).is_some_and(|cost| *cost < costs[trial]);
    let mut stride = 1;
    costs[trial].is_finite()
        && sizes.iter().all(|size| {
            let (own, across) = (trial / stride % size, stride);
            stride *= size;
            !(own > 0 && lower(trial - across) || own + 1 < *size && lower(trial + across))
        })
}
