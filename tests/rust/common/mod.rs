//! Blocks of eight noisy records of the report's example (24) and their estimates, through the public calls.
#![allow(dead_code, clippy::disallowed_methods)]

use modfun::estimate::{Design, Options, Outcome, Start, Wanted, Workspace, estimate};
use modfun::math::sin_cos_turns_1;
use modfun::modulation::Lines;
use modfun::quadrature::Rule;
use modfun::rng::{Purpose, fill};
use modfun::simd::{Isa, LANES, Wide};
use modfun::spectrum::{CoefficientPlan, Kind};
use modfun::structure::{CovType, Method, Noise, Structure, Trend};

pub const INTERVALS: usize = 256;
pub const DURATION: f64 = 10.0;
pub const METHODS: [Method; 4] = [Method::Ls, Method::Wls, Method::Awls, Method::Ml];
pub const ALL: [bool; LANES] = [true; LANES];
pub const OPTIONS: Options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };

/// The input u = sin(t²/5), the same bits on every system.
pub fn chirp(t: f64) -> f64 {
    sin_cos_turns_1(t * t / (5.0 * std::f64::consts::TAU)).0
}

/// y'' + 3y' + 8y = 5u from rest, by the classical fourth-order Runge–Kutta rule at 16 steps a sample.
pub fn response() -> Vec<f64> {
    let slope = |t: f64, x: [f64; 2]| [x[1], 5.0 * chirp(t) - 3.0 * x[1] - 8.0 * x[0]];
    let h = DURATION / INTERVALS as f64 / 16.0;
    let (mut x, mut out) = ([0.0; 2], vec![0.0]);
    for k in 0..16 * INTERVALS {
        let t = k as f64 * h;
        let at = |d: f64, s: [f64; 2]| [x[0] + d * s[0], x[1] + d * s[1]];
        let a = slope(t, x);
        let b = slope(t + h / 2.0, at(h / 2.0, a));
        let c = slope(t + h / 2.0, at(h / 2.0, b));
        let d = slope(t + h, at(h, c));
        for i in 0..2 {
            x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
        if k % 16 == 15 {
            out.push(x[0]);
        }
    }
    out
}

/// Coefficients of eight records on the lines 0..=last.
#[derive(Clone)]
pub struct Block {
    pub y: (Vec<Wide>, Vec<Wide>),
    pub u: (Vec<Wide>, Vec<Wide>),
}

pub fn plan(last: usize) -> CoefficientPlan {
    CoefficientPlan::new(INTERVALS, last, Kind::Rule(Rule::Trapezoid), 0.0, 0).unwrap()
}

pub fn transform(plan: &CoefficientPlan, samples: &[Wide]) -> (Vec<Wide>, Vec<Wide>) {
    let zeros = vec![Wide::ZERO; plan.harmonics() + 1];
    let (mut re, mut im) = (zeros.clone(), zeros);
    plan.run_lanes(Isa::Plain, samples, &mut re, &mut im, &mut plan.scratch()).unwrap();
    (re, im)
}

/// Eight records with noise of standard deviation `sigma`, replicates `first..first + 8`.
pub fn block(seed: u64, first: u64, sigma: f64, last: usize) -> Block {
    let plan = plan(last);
    let mut y = vec![Wide::ZERO; INTERVALS + 1];
    fill(Isa::Plain, seed, Purpose::NoiseY, 0, first, 0, &mut y);
    for (y, clean) in y.iter_mut().zip(response()) {
        *y = Wide(y.0.map(|e| clean + sigma * e));
    }
    let step = DURATION / INTERVALS as f64;
    let u: Vec<_> = (0..=INTERVALS).map(|k| Wide::splat(chirp(k as f64 * step))).collect();
    Block { y: transform(&plan, &y), u: transform(&plan, &u) }
}

/// Design of `order` poles and one input of `zeros` zeros on the lines 0..=last.
pub fn design(
    order: usize,
    zeros: usize,
    method: Method,
    trend: Trend,
    last: usize,
    omega0: f64,
) -> Design {
    let structure = Structure::new(order, vec![Some(zeros)]).unwrap();
    let first = usize::from(trend != Trend::None && method != Method::Ls);
    let lines = Lines { first, last, omega0, unit_variance: plan(last).unit_variance() };
    Design::new(&structure, method, Noise::Output, trend, true, &[lines]).unwrap()
}

pub fn omega0() -> f64 {
    std::f64::consts::TAU / DURATION
}

/// Writes a block's used lines into a workspace.
pub fn load(space: &mut Workspace, d: &Design, block: &Block) {
    let first = d.lines()[0].first;
    for (signal, (re, im)) in [&block.y, &block.u].into_iter().enumerate() {
        let (to_re, to_im) = space.signal_mut(0, signal);
        to_re.copy_from_slice(&re[first..]);
        to_im.copy_from_slice(&im[first..]);
    }
}

/// All of a lane's results as bits: θ, cost, both covariances, status, iterations.
pub fn bits(d: &Design, w: &Workspace, outcome: &Outcome, lane: usize) -> Vec<u64> {
    let numbers = w.theta(d, lane).chain([w.cost(lane)]).chain(w.covariance(d, lane, CovType::Hc3));
    let bits = numbers.chain(w.covariance(d, lane, CovType::Nonrobust)).map(f64::to_bits);
    bits.chain([outcome.status[lane] as u64, u64::from(outcome.nit[lane])]).collect()
}

/// Estimates of the live lanes of a block, as bits.
pub fn answers(isa: Isa, d: &Design, block: &Block, live: [bool; LANES]) -> Vec<Vec<u64>> {
    let mut w = Workspace::new(d);
    load(&mut w, d, block);
    let outcome = estimate(isa, d, &mut w, live, Start::Wls, &OPTIONS);
    (0..LANES).map(|lane| bits(d, &w, &outcome, lane)).collect()
}

/// θ and statuses of all eight lanes.
pub fn thetas(d: &Design, block: &Block) -> (Vec<Vec<f64>>, Outcome) {
    let mut w = Workspace::new(d);
    load(&mut w, d, block);
    let outcome = estimate(Isa::detect().unwrap(), d, &mut w, ALL, Start::Wls, &OPTIONS);
    ((0..LANES).map(|lane| w.theta(d, lane).collect()).collect(), outcome)
}
