//! The estimate of one record, or of several as one problem: eight lines in the lanes, steps by orthogonal factors.
//!
//! Steps and their stopping are those of a batch (`super::iterate`).

mod information;
mod rows;
mod sigma;
mod system;

use super::design::{Colour, JointDesign};
use super::iterate::{FLOOR, JointStart, LONGER, Refresh};
use super::tile::Block;
use super::unalias::unalias;
use super::whitener::Whitener;
use super::workspace::JointWorkspace;
use crate::error::{Error, Status};
use crate::estimate::Options;
use crate::estimate::aliasing::Changes;
use crate::estimate::band::CLOSE;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::outcome::statuses;
use crate::estimate::prior::{self, Prior};
use crate::estimate::rule::Rule;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide, numbers, numbers_mut};
use crate::structure::Method;
use crate::threads::stopped;
use system::{Found, System};

pub(crate) use information::Covariances;

/// Standard errors within which two estimates are one: another way to it need not be followed further.
const NEAR: f64 = 1e-3;

/// A single problem with its coefficients, and where its estimate stands.
pub(crate) struct Single<'d> {
    pub d: &'d JointDesign,
    pub w: JointWorkspace,
    pub(super) isa: Isa,
    blocks: Vec<Block>,
    system: System,
    /// Σ⁻¹, row major.
    coupling: Vec<f64>,
    /// Of each record whose samples mix the outputs, at the Σ that stands.
    factors: Vec<Option<Whitener>>,
    /// Squared sizes of θ's columns.
    sizes: Vec<f64>,
    /// Least variance of each output.
    least: Vec<f64>,
    dependent: bool,
    work: Vec<f64>,
}

/// How an estimate ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ended {
    pub status: Status,
    pub nit: u32,
    /// Whether it came so near to the other estimate that it would end there.
    pub near: bool,
}

/// How one run of steps goes.
#[derive(Clone, Copy)]
pub(super) struct Run<'a> {
    rule: Rule,
    most: usize,
    limit: f64,
    /// Delays stay.
    held: bool,
    /// Σ is that of each step's residuals.
    fresh: bool,
    near: Option<&'a [f64]>,
}

impl<'d> Single<'d> {
    /// Room for one design; coefficients are still to be written.
    pub fn new(isa: Isa, d: &'d JointDesign) -> Single<'d> {
        let (w, blocks) = JointWorkspace::single(d);
        let q = d.outputs();
        Single {
            d,
            isa,
            system: System::new(d, blocks.clone()),
            blocks,
            coupling: vec![0.0; q * q],
            factors: vec![None; d.records.len()],
            sizes: Vec::new(),
            least: vec![0.0; q],
            dependent: false,
            work: Vec::new(),
            w,
        }
    }

    /// Writes the coefficients of a record's signal, given from line 0 on, in units of `unit`.
    pub fn load(&mut self, record: usize, signal: usize, (re, im): (&[f64], &[f64]), unit: f64) {
        let lines = self.d.records[record].lines;
        let (to_re, to_im) = self.w.signal_mut(record, signal);
        for (to, from) in [(to_re, re), (to_im, im)] {
            for (to, from) in numbers_mut(to).iter_mut().zip(&from[lines.first..=lines.last]) {
                *to = from / unit;
            }
        }
        let jump = Wide::splat(im[0] / unit);
        self.w.keep_jump(self.d, record, signal, |to| *to = jump);
    }

    /// Estimates θ from the coefficients in the workspace; `near`: another estimate, in the workspace's units.
    pub fn estimate(
        &mut self,
        start: JointStart<'_>,
        o: &Options,
        near: Option<&[f64]>,
        refresh: &mut Refresh<'_>,
    ) -> Result<Ended, Error> {
        let d = self.d;
        self.begin();
        let rule = match d.method {
            Method::Ml => Rule::Ml,
            Method::Awls => Rule::Awls,
            // `wls` takes its one step.
            Method::Ls | Method::Wls => Rule::Wls,
        };
        let limit = o.tol * o.tol;
        let run = Run { rule, most: o.maxiter, limit, held: false, fresh: false, near: None };
        let estimated = d.estimates_covariance();
        let seen = match start {
            JointStart::Theta(_) => None,
            _ => self.as_seen(o)?,
        };
        let start = seen.as_deref().map_or(start, JointStart::Theta);
        let known = match start {
            JointStart::Theta(theta) => {
                for (k, (to, value)) in self.w.iterates.theta.now.iter_mut().zip(theta).enumerate()
                {
                    *to = Wide::splat(value / d.parameter_scale(k));
                }
                self.w.spread_theta(d);
                refresh(&mut self.w)?;
                self.find_transients();
                true
            }
            JointStart::Wls | JointStart::Held | JointStart::Here => {
                self.w.iterates.theta.now[..d.free.len()].fill(Wide::ZERO);
                self.w.spread_theta(d);
                refresh(&mut self.w)?;
                let run = Run { rule: Rule::Wls, most: 1, held: true, ..run };
                self.iterate(run, refresh)?;
                false
            }
        };
        let (mut nit, mut came_near) = (0.0, false);
        if rule != Rule::Wls && d.acts_at_once() {
            nit = self.rounds_at_once(run, known, o, refresh)?;
        } else if rule != Rule::Wls {
            let (rounds, most) = d.rounds_of_folding(o);
            // What is folded need not be known to the last digit before the last round.
            let rough = o.tol.max(CLOSE) * o.tol.max(CLOSE);
            let first = Run { limit: if rounds > 0 { rough } else { limit }, ..run };
            (nit, came_near) = self.settle(first, known, near, refresh)?;
            let (mut round, mut more, mut changes) = (0, rounds > 0, Changes::NONE);
            while more && round < most {
                round += 1;
                let changed = unalias(self.isa, d, &mut self.w, [true; LANES])[0];
                self.find_transients();
                nit += self.again();
                let run = Run { limit: if round < rounds { rough } else { limit }, ..run };
                nit += self.settle(run, true, None, refresh)?.0;
                more = changes.go_on(changed) || round < rounds;
            }
        } else {
            self.w.progress.active = Wide::ZERO;
        }
        if d.method != Method::Ml {
            if estimated {
                self.measure();
                self.take_covariance();
            }
            self.find_transients();
        }
        self.measure();
        if estimated {
            self.take_covariance();
        }
        self.w.progress.cost = Wide::splat(self.system.cost(&self.coupling));
        nit += self.w.progress.nit.0[0];
        Ok(Ended { status: self.status(), nit: nit as u32, near: came_near })
    }

    /// Steps under the weights that count, until θ and the noise stand; steps before the last count, and whether the
    /// way came near another estimate.
    pub(super) fn settle(
        &mut self,
        run: Run<'_>,
        known: bool,
        near: Option<&[f64]>,
        refresh: &mut Refresh<'_>,
    ) -> Result<(f64, bool), Error> {
        let d = self.d;
        let estimated = d.estimates_covariance();
        let (mut nit, mut came_near) = (0.0, false);
        let last = !estimated && d.noise.colour == Colour::Given;
        if last || !known {
            let near = near.filter(|_| last);
            came_near = self.iterate(Run { near, ..run }, refresh)?;
        }
        let alive = !self.dependent && self.w.progress.cost.0[0].is_finite();
        // Rows that hold Σ take the last one's.
        let fresh = estimated && !d.holds_sigma();
        if alive && fresh && d.noise.colour == Colour::Given {
            nit = self.again();
            let most = run.most.saturating_mul(LONGER);
            came_near = self.iterate(Run { most, fresh: true, near, ..run }, refresh)?;
        } else if alive && d.alternates() {
            nit = self.again();
            self.alternate(Run { fresh, ..run }, refresh)?;
        }
        Ok((nit, came_near))
    }

    fn begin(&mut self) {
        self.w.progress.begin([true; LANES]);
        self.dependent = false;
        self.w.begin_noise(self.d);
        self.couple();
        let q = self.d.outputs();
        let each = q as f64 / self.d.degrees_of_freedom().max(1) as f64;
        self.least.fill(0.0);
        for (r, rd) in self.w.records.iter().zip(&self.d.records) {
            for (i, least) in self.least.iter_mut().enumerate() {
                let own = i * r.lines..(i + 1) * r.lines;
                let (re, im) = (numbers(&r.re[own.clone()]), numbers(&r.im[own]));
                let parts = re.iter().zip(im).zip(&rd.weight).take(rd.used);
                *least +=
                    parts.map(|((x, y), by)| by * (x * x + y * y)).sum::<f64>() * each * FLOOR;
            }
        }
    }

    /// Goes on with a fresh count of steps; returns those so far.
    pub(super) fn again(&mut self) -> f64 {
        let nit = self.w.progress.nit.0[0];
        self.w.progress.nit = Wide::ZERO;
        self.w.progress.again(Wide::splat(1.0));
        nit
    }

    /// Steps until none moves; true where they came near to another estimate.
    fn iterate(&mut self, run: Run<'_>, refresh: &mut Refresh<'_>) -> Result<bool, Error> {
        for _ in 0..run.most {
            if self.w.progress.active.0[0] == 0.0 || stopped() {
                break;
            }
            self.form(run.rule.weights(), run.rule.factors(), run.fresh);
            let cost = match run.fresh {
                true => {
                    self.take_covariance();
                    self.determinant()
                }
                false => self.system.cost(&self.coupling),
            };
            let scale = if run.fresh { 1.0 } else { cost / self.d.degrees_of_freedom() as f64 };
            self.w.progress.cost = Wide::splat(cost * self.surprise(run.fresh));
            let target = self.system.column_sizes(self.d, &self.coupling, &mut self.sizes);
            let found = self.solve(run.held, scale);
            self.dependent = !found.full;
            self.take_step(&found, target);
            if !found.full && run.rule == Rule::Wls {
                // Dependent columns in the start: nothing to iterate from.
                self.w.progress.active = Wide::ZERO;
            }
            if run.rule != Rule::Wls {
                self.w.progress.nit = Wide::splat(self.w.progress.nit.0[0] + 1.0);
            }
            self.isa.run(Take { rule: run.rule, space: &mut self.w, limit: run.limit });
            self.w.spread_theta(self.d);
            if !run.held && !self.d.free_delays.is_empty() {
                refresh(&mut self.w)?;
            }
            if run.near.is_some_and(|theta| self.is_near(theta, scale)) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether θ lies within a fraction of a standard error of another estimate, each parameter by itself.
    fn is_near(&self, theta: &[f64], scale: f64) -> bool {
        self.w.iterates.theta.now.iter().zip(theta).zip(&self.sizes).all(|((now, theta), size)| {
            let gap = now.0[0] - theta;
            gap * gap * size <= NEAR * NEAR * scale
        })
    }

    /// Rows of all records at the current θ and T, factored.
    fn form(&mut self, weights: RowWeights, factors: LeftColumns, fresh: bool) {
        self.system.begin();
        let q = self.d.outputs();
        let coupled = fresh || (0..q * q).any(|k| k % (q + 1) != 0 && self.coupling[k] != 0.0);
        for k in 0..self.d.records.len() {
            self.write(k, weights, factors);
            self.system.add_record(&mut self.w, k, coupled);
        }
    }

    /// Residuals of all records at the current θ and T.
    fn measure(&mut self) {
        self.system.begin();
        for k in 0..self.d.records.len() {
            self.write(k, self.d.final_weights(), LeftColumns::Data);
            self.system.add_residual(&self.w);
        }
    }

    /// Transients of every record by least squares at the current θ.
    pub(super) fn find_transients(&mut self) {
        self.form(self.d.final_weights(), LeftColumns::Data, false);
        let from = self.d.records.len() * self.d.transient.len();
        let mut pinned = vec![None; from];
        pinned.extend(self.w.iterates.theta.now.iter().enumerate().map(|(k, theta)| {
            // Of a delay the system holds the change: none.
            Some(if k < self.d.free.len() { theta.0[0] } else { 0.0 })
        }));
        let found = self.system.solve(self.d, &self.coupling, &pinned, &[]);
        let each = self.d.transient.len();
        for (k, value) in found.unknowns[..from].iter().enumerate() {
            self.w.iterates.transients[k / each].now[k % each] = Wide::splat(*value);
        }
    }

    /// Solves for all unknowns; what would leave its bounds is set on them, and the rest solved again.
    /// Rows have the variance `scale`.
    fn solve(&mut self, held: bool, scale: f64) -> Found {
        let d = self.d;
        let (p, delays) = (d.parameters(), d.free.len());
        let from = d.records.len() * d.transient.len();
        let mut pinned = vec![None; from + p];
        if held {
            pinned[from + delays..].fill(Some(0.0));
        }
        let bounded = d.is_bounded();
        let now = |w: &JointWorkspace, k: usize| match k < delays {
            true => 0.0,
            false => w.iterates.theta.now[k].0[0],
        };
        let prior = |p: &Prior| {
            let by = p.entry(scale);
            (from + p.parameter, by, by * (p.mean - now(&self.w, p.parameter)))
        };
        let priors: Vec<_> = d.priors.iter().map(prior).collect();
        loop {
            let mut found = self.system.solve(d, &self.coupling, &pinned, &priors);
            let mut fresh = false;
            for k in 0..p {
                let value = found.unknowns[from + k] + now(&self.w, k);
                let (low, high) = d.parameter_bounds(k);
                let slack = 1e-12 * (low.abs().min(high.abs()) + f64::MIN_POSITIVE);
                let outside = value < low - slack || value > high + slack;
                if bounded && outside && pinned[from + k].is_none() {
                    pinned[from + k] = Some(value.clamp(low, high) - now(&self.w, k));
                    fresh = true;
                }
            }
            if fresh {
                continue;
            }
            for k in 0..p {
                self.w.pinned[k] = Wide::splat(f64::from(pinned[from + k].is_some()));
                if k >= delays {
                    let value = found.unknowns[from + k] + now(&self.w, k);
                    let (low, high) = d.parameter_bounds(k);
                    found.unknowns[from + k] =
                        if value.is_nan() { value } else { value.clamp(low, high) };
                }
            }
            return found;
        }
    }

    /// Where the step leads, and how far, relative to the largest term of the equations.
    fn take_step(&mut self, found: &Found, target: f64) {
        let d = self.d;
        let each = d.transient.len();
        let from = d.records.len() * each;
        let iterates = &mut self.w.iterates;
        for (k, value) in found.unknowns[..from].iter().enumerate() {
            iterates.transients[k / each].next[k % each] = Wide::splat(*value);
        }
        let (mut largest, mut moved) = (target, 0.0);
        for (k, value) in found.unknowns[from..].iter().enumerate() {
            iterates.theta.next[k] = Wide::splat(*value);
            let now = iterates.theta.now[k].0[0];
            let effect = (value - now) * (value - now) * self.sizes[k];
            // NaN must not read as settled.
            moved = if effect <= moved { moved } else { effect };
            let own = now * now * self.sizes[k];
            if k < d.free.len() && own > largest {
                largest = own;
            }
        }
        self.w.progress.moved = Wide::splat(moved / largest);
    }

    fn status(&self) -> Status {
        let data = || self.w.records.iter().flat_map(|r| r.re.iter().chain(&r.im));
        let scale = |k: usize| self.d.parameter_scale(k);
        let (theta, progress) = (&self.w.iterates.theta.now, &self.w.progress);
        let all = statuses(0.0, theta, scale, progress, [self.dependent; LANES], data);
        // Numbers of any line spoil the one estimate.
        if all.contains(&Status::NonFinite) { Status::NonFinite } else { all[0] }
    }

    /// θ in the workspace's units.
    pub fn estimates(&self) -> Vec<f64> {
        self.w.iterates.theta.now.iter().map(|theta| theta.0[0]).collect()
    }

    /// What fits on the same lines are compared by.
    pub fn criterion(&self) -> f64 {
        let own = self.w.criterion(self.d, 0);
        match self.d.outputs() == 1 || self.d.noise.outputs.is_some() {
            true => own * self.surprise(false),
            false => own + self.d.outputs() as f64 * self.distance(),
        }
    }

    /// How far θ is from what was known of it.
    fn distance(&self) -> f64 {
        prior::distance(&self.d.priors, |k| self.w.iterates.theta.now[k].0[0])
    }

    /// What the cost, or √det Σ̂ of residuals (`fresh`), is multiplied by for that.
    fn surprise(&self, fresh: bool) -> f64 {
        let rows = self.d.degrees_of_freedom() as f64;
        let each = if fresh { 0.5 * self.d.outputs() as f64 } else { 1.0 };
        prior::factor(each * self.distance(), rows)
    }
}

/// Takes a step, or part of the way back.
struct Take<'a> {
    rule: Rule,
    space: &'a mut JointWorkspace,
    limit: f64,
}

impl Kernel for Take<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let w = self.space;
        self.rule.take::<L>(&mut w.iterates, &mut w.progress, L::splat(self.limit));
    }
}
