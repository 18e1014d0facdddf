//! Held inputs that act at once (`estimate::at_once`), in joint fits.
//!
//! The first estimate takes such inputs as they are seen from the samples. Its structure has the numerators B″ of these,
//! all coefficients free: what is held or bounded of B would bind none of B″. An output on which the input does not act
//! at once sees it turned, too, B″ = B (1 + sk) of one degree more. From there on what is folded and the estimate take
//! turns, each half the way.

use super::design::{JointDesign, Seen};
use super::iterate::{JointStart, Refresh};
use super::single::{Run, Single};
use super::structure::{JointSignal, JointStructure, Term};
use super::unalias::unalias;
use super::workspace::JointWorkspace;
use crate::error::{Error, Status};
use crate::estimate::aliasing::{Fold, Record};
use crate::estimate::at_once::part;
use crate::estimate::rest::moved;
use crate::estimate::{Options, Outcome, Wanted};
use crate::math::sin_cos_turns_1;
use crate::quadrature::Hold;
use crate::simd::{Isa, LANES, Wide, numbers_mut};

/// Most rounds of what is folded and of the estimate.
const ROUNDS: usize = 40;
/// Change of the parameters, in parts of them, at which they stand; and where the cost alone is wanted.
const SETTLED: f64 = 1e-6;
const NEARLY: f64 = 1e-3;

impl Seen {
    /// Where an input with a known delay acts at once on an output of `d`; `make` plans the problem of a structure.
    pub fn new(
        d: &JointDesign,
        make: impl FnOnce(&JointStructure) -> Result<JointDesign, Error>,
    ) -> Option<Seen> {
        let aliasing = d.aliasing.as_ref()?;
        let turned = |s: usize| {
            let held = |r: &Record| Some(held(r, s)?.behind * r.step);
            let mut held = aliasing.records.iter().flatten().filter_map(held);
            held.next().filter(|_| d.path_acts_at_once(s))
        };
        let behind: Vec<Option<f64>> = (0..d.paths()).map(turned).collect();
        if behind.iter().all(Option::is_none) || !d.acts_at_once() {
            return None;
        }
        // Too few lines for the unknowns: it does without.
        let design = Box::new(make(&seen(&d.structure, &behind)).ok()?);
        Some(Seen { design, behind })
    }

    /// The parameters of `d` that these of the seen inputs are, within their bounds.
    fn parameters(&self, d: &JointDesign, theta: &[f64]) -> Vec<f64> {
        let (own, seen) = (&d.structure, &self.design.structure);
        let mut free = theta.iter().copied();
        let all: Vec<Wide> = seen
            .fixed
            .iter()
            .map_while(|held| held.or_else(|| free.next()))
            .map(Wide::splat)
            .collect();
        let (denominators, numerators) = seen.places();
        let (from, places) = own.places();
        let mut found = vec![Wide::ZERO; own.coefficients()];
        for (i, row) in own.numerators.iter().enumerate() {
            let a = &all[denominators[i]..denominators[i] + own.orders[i]];
            found[from[i]..][..a.len()].copy_from_slice(a);
            for (s, degree) in row.iter().enumerate() {
                let (Some(degree), Some(wide)) = (*degree, seen.numerators[i][s]) else { continue };
                let mut b = all[numerators[i][s]..=numerators[i][s] + wide].to_vec();
                let none = vec![Wide::ZERO; wide];
                if let Some(k) = self.behind[s] {
                    part(if degree == wide { a } else { &none }, &mut b, k, 0);
                }
                found[places[i][s]..=places[i][s] + degree].copy_from_slice(&b[wide - degree..]);
            }
        }
        let within = |k: &usize| found[*k].0[0].max(own.bounds[*k].0).min(own.bounds[*k].1);
        own.free().iter().map(within).collect()
    }
}

/// The folding of a path's input in a record, where it is held.
fn held(record: &Record, path: usize) -> Option<&Fold> {
    record.inputs[path].as_ref().filter(|f| f.hold == Hold::Zoh)
}

/// The structure with the numerators of turned paths, bounds left out.
fn seen(own: &JointStructure, behind: &[Option<f64>]) -> JointStructure {
    let mut to = own.clone();
    for (row, order) in to.numerators.iter_mut().zip(&own.orders) {
        for (degree, behind) in row.iter_mut().zip(behind) {
            if let (Some(degree), Some(_)) = (degree, behind) {
                *degree = (*degree + 1).min(*order);
            }
        }
    }
    to.fixed = vec![None; to.coefficients()];
    to.bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); to.coefficients()];
    // What is held of the others and of denominators stays.
    let held = |t: &Term| match t.signal {
        JointSignal::Output => true,
        JointSignal::Path(s) => behind[s].is_none(),
    };
    let pairs = to.terms().into_iter().filter(held).zip(own.terms().into_iter().filter(held));
    for (to_term, own_term) in pairs {
        to.fixed[to_term.coefficient] = own.fixed[own_term.coefficient];
    }
    to
}

impl JointDesign {
    /// Whether a held input with a known delay acts at once on some output.
    pub(crate) fn acts_at_once(&self) -> bool {
        self.free_delays.is_empty() && (0..self.paths()).any(|s| self.path_acts_at_once(s))
    }

    fn path_acts_at_once(&self, s: usize) -> bool {
        let records = self.aliasing.iter().flat_map(|a| a.records.iter().flatten());
        let mut folds = records.filter_map(|r| r.inputs[s].as_ref());
        let mut each = self.structure.orders.iter().zip(&self.structure.numerators);
        folds.any(|f| f.hold == Hold::Zoh) && each.any(|(order, row)| row[s] == Some(*order))
    }
}

impl Single<'_> {
    /// The first estimate of inputs that act at once, in the user's units.
    pub(super) fn as_seen(&self, o: &Options) -> Result<Option<Vec<f64>>, Error> {
        let Some(seen) = &self.d.seen else { return Ok(None) };
        let d = &*seen.design;
        let mut other = Single::new(self.isa, d);
        for (k, from) in self.w.records.iter().enumerate() {
            let lines = d.records[k].lines;
            let record = self.d.aliasing.as_ref().and_then(|a| a.records[k].as_ref());
            let held = |s: &usize| record.is_some_and(|r| held(r, *s).is_some());
            for signal in 0..d.outputs() + d.paths() {
                let (re, im) = match signal < d.outputs() {
                    true => (&from.measured.re, &from.measured.im),
                    false => (&from.re, &from.im),
                };
                let (to_re, to_im) = other.w.signal_mut(k, signal);
                let own = signal * from.lines..signal * from.lines + to_re.len();
                to_re.copy_from_slice(&re[own.clone()]);
                to_im.copy_from_slice(&im[own]);
                let path = signal.checked_sub(d.outputs());
                let Some(behind) = path.filter(held).and_then(|s| seen.behind[s]) else {
                    continue;
                };
                let turns = -behind * lines.omega0 / std::f64::consts::TAU;
                let each = numbers_mut(to_re).iter_mut().zip(numbers_mut(to_im));
                for (m, (re, im)) in each.enumerate() {
                    let (sin, cos) = sin_cos_turns_1(turns * (lines.first + m) as f64);
                    (*re, *im) = (cos * *re - sin * *im, cos * *im + sin * *re);
                }
            }
        }
        other.estimate(JointStart::Wls, o, None, &mut |_| Ok(()))?;
        let theta: Vec<f64> = other.w.theta(d, 0).collect();
        let sound = theta.iter().all(|x| x.is_finite());
        Ok(sound.then(|| seen.parameters(self.d, &theta)))
    }

    /// Rounds of what is folded and of half the way to the estimate that follows, until it stands; steps taken.
    pub(super) fn rounds_at_once(
        &mut self,
        run: Run<'_>,
        mut known: bool,
        o: &Options,
        refresh: &mut Refresh<'_>,
    ) -> Result<f64, Error> {
        let settled = if o.wanted == Wanted::Cost { NEARLY } else { SETTLED };
        let (mut nit, mut left) = (0.0, true);
        for _ in 0..ROUNDS {
            if known {
                self.fold();
            }
            let before = self.estimates();
            nit += self.again();
            nit += self.settle(run, known, None, refresh)?.0;
            let now = self.estimates();
            if known {
                for (to, (now, before)) in
                    self.w.iterates.theta.now.iter_mut().zip(now.iter().zip(&before))
                {
                    *to = Wide::splat(0.5 * (now + before));
                }
                self.w.spread_theta(self.d);
                refresh(&mut self.w)?;
                left = moved(settled, before.into_iter().zip(now));
            }
            known = true;
            if !left {
                break;
            }
        }
        self.fold();
        if left {
            self.w.progress.active = Wide::splat(1.0);
        }
        Ok(nit)
    }

    /// Takes what the estimate that stands folds out of the outputs.
    fn fold(&mut self) {
        self.find_transients();
        unalias(self.isa, self.d, &mut self.w, [true; LANES]);
        self.find_transients();
    }
}

/// Estimates what stands in the lanes of a batch, each lane as a single problem.
pub(super) fn one_by_one(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    live: [bool; LANES],
    o: &Options,
) -> Result<Outcome, Error> {
    let (mut single, p) = (Single::new(isa, d), d.parameters());
    let mut outcome = Outcome { status: [Status::Ok; LANES], nit: [0; LANES] };
    for lane in (0..LANES).filter(|lane| live[*lane]) {
        for (k, from) in w.records.iter().enumerate() {
            for signal in 0..d.outputs() + d.paths() {
                let (re, im) = single.w.signal_mut(k, signal);
                let own = signal * from.lines..(signal + 1) * from.lines;
                for (to, from) in [(re, &from.re[own.clone()]), (im, &from.im[own])] {
                    for (to, from) in numbers_mut(to).iter_mut().zip(from) {
                        *to = from.0[lane];
                    }
                }
            }
            let jumps = single.w.records[k].jumps.iter_mut().zip(&from.jumps);
            jumps.for_each(|(to, from)| *to = Wide::splat(from.0[lane]));
        }
        single.w.keep_measured();
        let ended = single.estimate(JointStart::Wls, o, None, &mut |_| Ok(()))?;
        let (found, status) = single.answer(ended);
        (outcome.status[lane], outcome.nit[lane]) = (status, ended.nit);
        w.progress.cost.0[lane] = single.w.progress.cost.0[0];
        let each = [
            (&mut w.iterates.theta.now, &single.w.iterates.theta.now),
            (&mut w.sigma, &single.w.sigma),
        ];
        for (to, from) in each {
            to.iter_mut().zip(from).for_each(|(to, from)| to.0[lane] = from.0[0]);
        }
        let each = [
            (&mut w.covariances.nonrobust, &found.nonrobust),
            (&mut w.covariances.hc3, &found.hc3),
            (&mut w.covariances.spectral.cov, &found.spectral),
        ];
        for (to, from) in each {
            for (at, (to, from)) in to.iter_mut().zip(from).enumerate() {
                // In the workspace's units.
                to.0[lane] = from / (d.parameter_scale(at / p) * d.parameter_scale(at % p));
            }
        }
        for (to, from) in w.covariances.spectral.degrees.iter_mut().zip(&found.degrees) {
            to.0[lane] = *from;
        }
    }
    Ok(outcome)
}
