//! The loop of a batch: steps until none moves, then with Σ from each step's residuals, and again for each new colour.

use super::colour;
use super::design::{Colour, JointDesign};
use super::rows::rows;
use super::step::step;
use super::unalias::unalias;
use super::uncertainty;
use super::workspace::JointWorkspace;
use crate::error::{Error, Status};
use crate::estimate::aliasing::Changes;
use crate::estimate::autoregression;
use crate::estimate::band::CLOSE;
use crate::estimate::iterates::Move;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::outcome::{Outcome, lost_lanes, statuses};
use crate::estimate::pass::tiles;
use crate::estimate::rule::Rule;
use crate::estimate::{Options, Wanted};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::structure::Method;
use crate::threads::stopped;

/// Steps with Σ from the residuals, over those with Σ = 1.
pub(super) const LONGER: usize = 4;
/// Smallest variance of an output, and of what the others leave of it.
pub(super) const FLOOR: f64 = 1e-14;
const OWN: f64 = 1e-8;

/// What keeps the coefficients of delayed inputs at the current delays; called when they have changed.
pub(crate) type Refresh<'a> = dyn FnMut(&mut JointWorkspace) -> Result<(), Error> + 'a;

/// Where an iteration starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum JointStart<'a> {
    /// From `wls`, at the delays that stand in the workspace.
    Wls,
    /// From `wls` with delays held all the way: for a first look from many of them.
    Held,
    /// From where the workspace stands.
    Here,
    /// From given parameters in the user's units, the same in all lanes.
    Theta(&'a [f64]),
}

/// Estimates θ from the coefficients in the workspace; `live` lanes only.
pub(crate) fn estimate(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    live: [bool; LANES],
    start: JointStart<'_>,
    o: &Options,
    refresh: &mut Refresh<'_>,
) -> Result<Outcome, Error> {
    w.progress.begin(live);
    w.dependent = [false; LANES];
    w.begin_noise(d);
    let held = start == JointStart::Held;
    match start {
        JointStart::Theta(theta) => {
            for (k, (to, value)) in w.iterates.theta.now.iter_mut().zip(theta).enumerate() {
                *to = Wide::splat(value / d.parameter_scale(k));
            }
            w.spread_theta(d);
            refresh(w)?;
            isa.run(uncertainty::Transients { design: d, space: w });
        }
        JointStart::Here => {}
        JointStart::Wls | JointStart::Held => {
            w.iterates.theta.now[..d.free.len()].fill(Wide::ZERO);
            w.spread_theta(d);
            refresh(w)?;
            let run = Run { rule: Rule::Wls, most: 1, limit: 0.0, held: true, fresh: false };
            iterate(isa, d, w, run, refresh)?;
        }
    }
    let rule = match d.method {
        Method::Ml => Rule::Ml,
        Method::Awls => Rule::Awls,
        // `wls` has taken its one step.
        Method::Ls | Method::Wls => Rule::Wls,
    };
    let run = Run { rule, most: o.maxiter, limit: o.tol * o.tol, held, fresh: false };
    if rule != Rule::Wls {
        let (rounds, most) = d.rounds_of_folding(o);
        // What is folded need not be known to the last digit before the last round.
        let rough = o.tol.max(CLOSE) * o.tol.max(CLOSE);
        w.keep_measured();
        let (mut left, mut changes) = (live, [Changes::NONE; LANES]);
        let mut changed = [0.0; LANES];
        for round in 0..=most {
            let (nit, active, cost) = (w.progress.nit, w.progress.active, w.progress.cost);
            let dependent = w.dependent;
            if round > 0 {
                changed = unalias(isa, d, w, left);
                w.progress.begin(left);
                w.dependent = [false; LANES];
                isa.run(uncertainty::Transients { design: d, space: w });
            }
            let run = Run { limit: if round < rounds { rough } else { run.limit }, ..run };
            iterate(isa, d, w, run, refresh)?;
            if d.alternates() {
                settle_noise(isa, d, w, left, run, refresh)?;
            }
            for k in 0..LANES {
                if round > 0 {
                    w.progress.nit.0[k] += nit.0[k];
                }
                if !left[k] {
                    // As it ended.
                    (w.progress.active.0[k], w.progress.cost.0[k]) = (active.0[k], cost.0[k]);
                    w.dependent[k] = dependent[k];
                    continue;
                }
                let more = round > 0 && changes[k].go_on(changed[k]);
                left[k] = round < rounds || more;
            }
            if left == [false; LANES] {
                break;
            }
        }
    } else {
        w.progress.active = Wide::ZERO;
    }
    if d.estimates_covariance() {
        isa.run(Covariance { design: d, space: w, of: live });
    }
    if o.wanted != Wanted::Theta {
        uncertainty::finish(isa, d, w, live, o.wanted == Wanted::Covariance);
    }
    let asked = o.wanted == Wanted::Covariance;
    let status = status(d, w, asked);
    for (k, status) in status.iter().enumerate() {
        if matches!(status, Status::Rank | Status::NonFinite) {
            w.covariances.forget(k);
        }
    }
    Ok(Outcome { status, nit: w.progress.nit.0.map(|nit| nit as u32) })
}

fn status(d: &JointDesign, w: &JointWorkspace, with_covariance: bool) -> [Status; LANES] {
    let theta = &w.iterates.theta.now;
    let covariances = with_covariance.then(|| w.covariances.judged());
    let lost = lost_lanes(w.dependent, covariances, theta.len());
    let data = || w.records.iter().flat_map(|r| r.re.iter().chain(&r.im));
    statuses(0.0, theta, |k| d.parameter_scale(k), &w.progress, lost, data)
}

/// How far a call of the vector code came.
#[derive(PartialEq)]
enum Came {
    /// To its end.
    Home,
    /// A lane needs orthogonal factors.
    SmallPivots,
    /// The delays have changed.
    NewDelays,
}

/// How one run of steps goes.
#[derive(Clone, Copy)]
struct Run {
    rule: Rule,
    most: usize,
    limit: f64,
    /// Delays stay.
    held: bool,
    /// Σ is that of each step's residuals.
    fresh: bool,
}

struct Iteration<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    run: Run,
    left: &'a mut usize,
    mended: &'a mut bool,
}

impl Kernel for Iteration<'_> {
    type Output = Came;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Came {
        let Iteration { design: d, space: w, run, left, mended } = self;
        let Run { rule, held, fresh, .. } = run;
        let limit = L::splat(run.limit);
        while *left > 0 && L::load(&w.progress.active).any() && !stopped() {
            if !*mended {
                if fresh {
                    covariance::<L>(d, w, L::load(&w.progress.active));
                }
                step::<L>(d, w, rule.weights(), rule.factors(), held);
                if fresh {
                    w.progress.cost = determinant::<L>(d, w);
                }
                if w.progress.load::<L>().unsound(L::load(&w.trusted)).any() {
                    return Came::SmallPivots;
                }
            }
            *mended = false;
            *left -= 1;
            if rule != Rule::Wls {
                (L::load(&w.progress.nit) + L::load(&w.progress.active)).store(&mut w.progress.nit);
            }
            rule.take::<L>(&mut w.iterates, &mut w.progress, limit);
            w.spread_theta(d);
            if !held && !d.free_delays.is_empty() {
                return Came::NewDelays;
            }
        }
        Came::Home
    }
}

/// Iterates the active lanes at most so many times.
fn iterate(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    run: Run,
    refresh: &mut Refresh<'_>,
) -> Result<(), Error> {
    let mut left = run.most;
    let mut mended = false;
    loop {
        let (left, mended) = (&mut left, &mut mended);
        match isa.run(Iteration { design: d, space: w, run, left, mended }) {
            Came::Home => return Ok(()),
            Came::NewDelays => refresh(w)?,
            Came::SmallPivots => {
                let spoiled = w.progress.spoiled(&w.trusted);
                for lane in (0..LANES).filter(|k| spoiled[*k]) {
                    let full = super::qr_step::solve(isa, d, w, lane, run.rule, run.held);
                    w.dependent[lane] = !full;
                    if !full && run.rule == Rule::Wls {
                        // Dependent columns in the start: nothing to iterate from.
                        w.progress.active.0[lane] = 0.0;
                    }
                }
                isa.run(Move {
                    theta: &w.iterates.theta,
                    column_size: &w.column_size,
                    target_size: &w.target_size,
                    terms: d.free.len(),
                    moved: &mut w.progress.moved,
                });
                *mended = true;
            }
        }
    }
}

/// Goes on from θ at Σ = 1 and white noise, with Σ and the colour that the residuals show.
fn settle_noise(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    live: [bool; LANES],
    run: Run,
    refresh: &mut Refresh<'_>,
) -> Result<(), Error> {
    let mut going: [bool; LANES] =
        std::array::from_fn(|k| live[k] && w.progress.cost.0[k].is_finite() && !w.dependent[k]);
    let (unsettled, before) = (w.progress.active, w.progress.nit);
    let run = Run { fresh: d.estimates_covariance(), ..run };
    w.progress.nit = Wide::ZERO;
    if d.noise.colour == Colour::Given {
        w.progress.again(Wide(going.map(f64::from)));
        let most = run.most.saturating_mul(LONGER);
        iterate(isa, d, w, Run { most, ..run }, refresh)?;
        going = w.progress.active.0.map(|active| active > 0.0);
    } else {
        for round in 0..autoregression::ROUNDS.min(run.most) {
            let recoloured = colour::refit(isa, d, w, round, going);
            for k in 0..LANES {
                let still =
                    recoloured[k] <= autoregression::SETTLED && w.progress.active.0[k] == 0.0;
                going[k] &= round == 0 || !(still || w.dependent[k]);
            }
            if !going.contains(&true) {
                break;
            }
            w.progress.again(Wide(going.map(f64::from)));
            iterate(isa, d, w, run, refresh)?;
        }
    }
    for k in 0..LANES {
        w.progress.nit.0[k] += before.0[k];
        let lost = live[k] && unsettled.0[k] > 0.0 && !w.progress.cost.0[k].is_finite();
        w.progress.active.0[k] = f64::from(going[k] || lost);
    }
    Ok(())
}

impl JointWorkspace {
    /// Σ as given, or one; no colour but what is given.
    pub(crate) fn begin_noise(&mut self, d: &JointDesign) {
        let q = d.outputs();
        for i in 0..q {
            for j in 0..q {
                let unit = f64::from(i == j);
                let value = d
                    .noise
                    .outputs
                    .as_ref()
                    .map_or(unit, |s| s[i * q + j] / (d.residual_unit(i) * d.residual_unit(j)));
                self.sigma[i * q + j] = Wide::splat(value);
            }
        }
        self.take_root(q);
        for (r, rd) in self.records.iter_mut().zip(&d.records) {
            match rd.output_roots.is_empty() {
                true => r.colour.fill(Wide::splat(1.0)),
                false => {
                    for m in 0..r.lines {
                        for i in 0..q {
                            r.colour[m * q + i] = self.across.root(rd, i, m);
                        }
                    }
                }
            }
        }
    }

    /// Inverse of the lower Cholesky factor of Σ, lane by lane; called from vector code, so that no scalar
    /// multiply-add may stand here.
    pub(crate) fn take_root(&mut self, q: usize) {
        let JointWorkspace { sigma, root, triangle: l, .. } = self;
        for lane in 0..LANES {
            for j in 0..q {
                for i in j..q {
                    let own = (0..j)
                        .fold(sigma[i * q + j].0[lane], |s, c| s - l[i * q + c] * l[j * q + c]);
                    let least = OWN * sigma[j * q + j].0[lane];
                    l[i * q + j] = if i == j { own.max(least).sqrt() } else { own / l[j * q + j] };
                }
            }
            for c in 0..q {
                for i in c..q {
                    let one = if i == c { 1.0 } else { 0.0 };
                    let sum =
                        (c..i).fold(one, |s: f64, j| s - l[i * q + j] * root[j * q + c].0[lane]);
                    root[i * q + c].0[lane] = sum / l[i * q + i];
                }
            }
        }
    }
}

/// Σ̂ from the weighted residuals of the lines in use, in some lanes.
struct Covariance<'a> {
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    of: [bool; LANES],
}

impl Kernel for Covariance<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        covariance::<L>(self.design, self.space, L::load(&Wide(self.of.map(f64::from))));
    }
}

/// Σ̂ at the current θ and T, in the lanes `of`; the others keep theirs.
#[inline(always)]
fn covariance<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, of: L) {
    let q = d.outputs();
    let used = w.records.iter().map(|r| r.limit);
    let each = L::splat(q as f64 / d.freedom(used).max(1) as f64);
    w.sigma_before.copy_from_slice(&w.sigma);
    super::step::clear::<L>(&mut w.sigma);
    super::step::clear::<L>(&mut w.hat[0][..q]);
    for k in 0..w.records.len() {
        for range in tiles(w.records[k].limit, d.tile) {
            rows::<L>(d, w, k, range.clone(), RowWeights::Adapted, LeftColumns::Data, false);
            for (t, m) in range.enumerate() {
                let weight = L::splat(d.records[k].weight[m]);
                let lines = w.records[k].lines;
                for i in 0..q {
                    let (re, im) = w.residual.get::<L>(t * q + i);
                    for j in 0..=i {
                        let (x, y) = w.residual.get::<L>(t * q + j);
                        let sum = &mut w.sigma[i * q + j];
                        let own = re.mul_add(x, im * y) * weight;
                        own.mul_add(each, L::load(sum)).store(sum);
                    }
                    let r = &w.records[k];
                    let y = (L::load(&r.re[i * lines + m]), L::load(&r.im[i * lines + m]));
                    let power = weight * y.0.mul_add(y.0, y.1 * y.1);
                    power.mul_add(each, L::load(&w.hat[0][i])).store(&mut w.hat[0][i]);
                }
            }
        }
    }
    for i in 0..q {
        let least = L::load(&w.hat[0][i]) * L::splat(FLOOR);
        L::load(&w.sigma[i * q + i]).max(least).store(&mut w.sigma[i * q + i]);
        for j in 0..i {
            w.sigma[j * q + i] = w.sigma[i * q + j];
        }
    }
    for (sigma, before) in w.sigma.iter_mut().zip(&w.sigma_before) {
        of.choose(L::load(sigma), L::load(before)).store(sigma);
    }
    w.take_root(q);
}

/// √det Σ̂: falls where log det Σ̂ does.
#[inline(always)]
fn determinant<L: Lanes>(d: &JointDesign, w: &JointWorkspace) -> Wide {
    let q = d.outputs();
    let product = (0..q).fold(L::splat(1.0), |p, i| p * L::load(&w.root[i * (q + 1)]));
    let mut all = Wide::ZERO;
    (L::splat(1.0) / product).store(&mut all);
    all
}
