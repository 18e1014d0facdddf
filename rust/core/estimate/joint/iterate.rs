//! The loop of a joint problem: steps until none moves, then Σ and the colour of the noise from the residuals, and again.

use super::colour;
use super::design::{Colour, JointDesign};
use super::rows::rows;
use super::step::step;
use super::uncertainty;
use super::workspace::JointSpace;
use crate::error::{Error, Status};
use crate::estimate::iterate::Rule;
use crate::estimate::iterates::unsound;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::outcome::{Outcome, lost_in_rounding, statuses};
use crate::estimate::pass::tiles;
use crate::estimate::{Options, Wanted};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::structure::Method;
use crate::threads::stopped;

/// Alternations of θ with Σ and the colour, and most steps of θ in one.
pub(super) const ROUNDS: usize = 40;
const STEPS: usize = 10;
/// Largest change of Σ (as correlations) and of the colour's root after which nothing is left to do.
const SETTLED: f64 = 1e-6;
pub(super) const COLOUR_SETTLED: f64 = 1e-4;
/// Smallest variance of an output, and of what the others leave of it.
pub(super) const FLOOR: f64 = 1e-14;
const OWN: f64 = 1e-8;

/// What keeps the coefficients of delayed inputs at the current delays; called when they have changed.
pub(crate) type Refresh<'a> = dyn FnMut(&mut JointSpace) -> Result<(), Error> + 'a;

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
    w: &mut JointSpace,
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
            iterate(isa, d, w, Rule::Wls, o, true, refresh)?;
        }
    }
    let rule = match d.method {
        Method::Ml => Rule::Ml,
        Method::Awls => Rule::Awls,
        // `wls` has taken its one step.
        Method::Ls | Method::Wls => Rule::Wls,
    };
    if rule != Rule::Wls {
        iterate(isa, d, w, rule, o, held, refresh)?;
        if d.alternates() {
            alternate(isa, d, w, live, rule, o, held, refresh)?;
        }
    } else {
        w.progress.active = Wide::ZERO;
        if d.alternates() {
            let mut changed = Wide::ZERO;
            isa.run(Covariance { design: d, space: w, changed: &mut changed });
        }
    }
    if o.wanted != Wanted::Theta {
        uncertainty::finish(isa, d, w, live, o.wanted == Wanted::Covariance);
    }
    let asked = o.wanted == Wanted::Covariance;
    let status = status(d, w, asked);
    for (k, status) in status.iter().enumerate() {
        if matches!(status, Status::Rank | Status::NonFinite) {
            for c in w.cov_hc3.iter_mut().chain(&mut w.cov_nonrobust) {
                c.0[k] = f64::NAN;
            }
        }
    }
    Ok(Outcome { status, nit: w.progress.nit.0.map(|nit| nit as u32) })
}

fn status(d: &JointDesign, w: &JointSpace, with_covariance: bool) -> [Status; LANES] {
    let p = w.iterates.theta.now.len();
    let mut dependent = w.dependent;
    if with_covariance {
        for (k, dependent) in dependent.iter_mut().enumerate() {
            *dependent |= lost_in_rounding([&w.cov_nonrobust, &w.cov_hc3], p, k);
        }
    }
    let data = || w.records.iter().flat_map(|r| r.re.iter().chain(&r.im));
    statuses(&w.iterates.theta.now, |k| d.parameter_scale(k), &w.progress, dependent, data)
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

struct Iteration<'a> {
    design: &'a JointDesign,
    space: &'a mut JointSpace,
    rule: Rule,
    held: bool,
    limit: f64,
    left: &'a mut usize,
    mended: &'a mut bool,
}

impl Kernel for Iteration<'_> {
    type Output = Came;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Came {
        let Iteration { design: d, space: w, rule, held, limit, left, mended } = self;
        let limit = L::splat(limit);
        while *left > 0 && L::load(&w.progress.active).any() && !stopped() {
            if !*mended {
                step::<L>(d, w, rule.weights(), rule.factors(), held);
                if unsound::<L>(&w.progress, &w.trusted).any() {
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

/// Iterates the active lanes at most `maxiter` times.
fn iterate(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointSpace,
    rule: Rule,
    o: &Options,
    held: bool,
    refresh: &mut Refresh<'_>,
) -> Result<(), Error> {
    let mut left = if rule == Rule::Wls { 1 } else { o.maxiter };
    let mut mended = false;
    loop {
        let came = isa.run(Iteration {
            design: d,
            space: w,
            rule,
            held,
            limit: o.tol * o.tol,
            left: &mut left,
            mended: &mut mended,
        });
        match came {
            Came::Home => return Ok(()),
            Came::NewDelays => refresh(w)?,
            Came::SmallPivots => {
                for lane in 0..LANES {
                    let sound = w.trusted.0[lane] > 0.0 && w.progress.moved.0[lane].is_finite();
                    if sound || w.progress.active.0[lane] == 0.0 {
                        continue;
                    }
                    let full = super::qr_step::solve(isa, d, w, lane, rule, held);
                    w.dependent[lane] = !full;
                    if !full && rule == Rule::Wls {
                        // Dependent columns in the start: nothing to iterate from.
                        w.progress.active.0[lane] = 0.0;
                    }
                }
                mended = true;
            }
        }
    }
}

/// Σ and the colour from the residuals, θ again, until neither changes.
#[allow(clippy::too_many_arguments)]
fn alternate(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointSpace,
    live: [bool; LANES],
    rule: Rule,
    o: &Options,
    held: bool,
    refresh: &mut Refresh<'_>,
) -> Result<(), Error> {
    let mut going: [bool; LANES] =
        std::array::from_fn(|k| live[k] && w.progress.cost.0[k].is_finite() && !w.dependent[k]);
    let unsettled = w.progress.active;
    let few = Options { maxiter: o.maxiter.min(STEPS), ..*o };
    for round in 0..ROUNDS.min(o.maxiter) {
        let mut changed = Wide::ZERO;
        let mut recoloured = [0.0; LANES];
        if d.noise.colour == Colour::Fitted {
            recoloured = colour::refit(isa, d, w, round, going);
        }
        isa.run(Covariance { design: d, space: w, changed: &mut changed });
        for k in 0..LANES {
            // Steps that did not settle go on with the new Σ.
            let still = changed.0[k] <= SETTLED && recoloured[k] <= COLOUR_SETTLED;
            going[k] &= !(still && w.progress.active.0[k] == 0.0);
        }
        if !going.contains(&true) {
            break;
        }
        w.progress.again(Wide(going.map(f64::from)));
        iterate(isa, d, w, rule, &few, held, refresh)?;
    }
    for k in 0..LANES {
        let lost = live[k] && unsettled.0[k] > 0.0 && !w.progress.cost.0[k].is_finite();
        w.progress.active.0[k] = f64::from(going[k] || lost);
    }
    Ok(())
}

impl JointSpace {
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
        let JointSpace { sigma, root, triangle: l, .. } = self;
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

/// Σ̂ from the weighted residuals of the lines in use; how much it changed.
struct Covariance<'a> {
    design: &'a JointDesign,
    space: &'a mut JointSpace,
    changed: &'a mut Wide,
}

impl Kernel for Covariance<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Covariance { design: d, space: w, changed } = self;
        if d.outputs() == 1 || d.noise.outputs.is_some() {
            return;
        }
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
                        let (re, im) = super::step::pair::<L>(&w.residual, t * q + i);
                        for j in 0..=i {
                            let (x, y) = super::step::pair::<L>(&w.residual, t * q + j);
                            let sum = &mut w.sigma[i * q + j];
                            let own = re.mul_add(x, im * y) * weight;
                            own.mul_add(each, L::load(sum)).store(sum);
                        }
                        let r = &w.records[k];
                        let y = (L::load(&r.re[i * lines + m]), L::load(&r.im[i * lines + m]));
                        let power = L::splat(d.records[k].weight[m]) * y.0.mul_add(y.0, y.1 * y.1);
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
        let mut most = L::splat(0.0);
        for i in 0..q {
            for j in 0..=i {
                let size = L::load(&w.sigma[i * q + i]) * L::load(&w.sigma[j * q + j]);
                let gap = L::load(&w.sigma[i * q + j]) - L::load(&w.sigma_before[i * q + j]);
                let own = gap.abs() / size.sqrt();
                most = own.select_lt(most, most, own);
            }
        }
        most.store(changed);
        w.take_root(q);
    }
}
