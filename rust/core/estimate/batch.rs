//! Many fits of one structure at once: eight records a block, blocks over threads, the same bits as one by one.

use super::fit::{Band, FitOptions, RecordView, Time, fit};
use super::window::{Window, coefficient_plans};
use super::{Design, Outcome, Start, Wanted, Workspace, estimate};
use crate::error::{Error, Status};
use crate::modulation::Lines;
use crate::simd::{Isa, LANES, Wide};
use crate::spectrum::{CoefficientPlan, Scratch};
use crate::threads::{self, Control};

/// Records a chunk, the unit of scheduling.
pub(crate) const CHUNK: usize = 64 * LANES;

/// Samples of many records of one length and step, (replicate, channel, time) with time last.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// Outputs, replicate after replicate.
    pub y: &'a [f64],
    /// Inputs: of every replicate, or one set for all.
    pub u: &'a [f64],
    /// Whether `u` is one set for all.
    pub shared: bool,
    /// Samples a channel.
    pub samples: usize,
    /// Step in seconds.
    pub dt: f64,
}

/// Results of many fits, replicate after replicate.
#[derive(Debug, Clone, Default)]
pub struct Many {
    /// Estimates.
    pub theta: Vec<f64>,
    /// Classical standard errors; empty where not asked for.
    pub bse_nonrobust: Vec<f64>,
    /// HC3 standard errors; empty where not asked for.
    pub bse_hc3: Vec<f64>,
    /// Outcomes.
    pub status: Vec<Status>,
    /// Weighted sums of squares.
    pub cost: Vec<f64>,
    /// Iterations.
    pub nit: Vec<u32>,
}

/// The problem all replicates share: lines, design and how samples become coefficients.
#[derive(Clone)]
pub(crate) struct Shared {
    pub design: Design,
    pub plans: Vec<CoefficientPlan>,
}

impl Shared {
    /// Lines as given, or those the default rule finds on one record.
    pub fn new(record: &RecordView<'_>, o: &FitOptions, isa: Isa) -> Result<Shared, Error> {
        o.check()?;
        let window = Window::new(record.y.len(), record.time, o)?;
        let (first, last) = match window.given(o)? {
            Some(range) => range,
            None => {
                let found = fit(std::slice::from_ref(record), o, isa)?;
                let last = found.lines.first().map_or(0, |l| l.last);
                (0, last)
            }
        };
        let plans = coefficient_plans(o, record.time, window, last)?;
        let lines = Lines {
            first,
            last,
            omega0: window.omega0,
            unit_variance: plans.first().map_or(1.0, CoefficientPlan::unit_variance),
        };
        let design = Design::new(&o.structure, o.method, o.noise, o.trend, o.extended, &[lines])?;
        Ok(Shared { design, plans })
    }
}

/// One worker's memory for blocks of records.
struct Worker {
    space: Workspace,
    scratch: Vec<Scratch>,
    samples: Vec<Wide>,
    re: Vec<Wide>,
    im: Vec<Wide>,
    inputs_loaded: bool,
}

/// Copies coefficients of the used lines into the workspace.
pub(crate) fn load(space: &mut Workspace, signal: usize, lines: Lines, re: &[Wide], im: &[Wide]) {
    let (to_re, to_im) = space.signal_mut(0, signal);
    to_re.copy_from_slice(&re[lines.first..=lines.last]);
    to_im.copy_from_slice(&im[lines.first..=lines.last]);
}

/// Fits every record of a batch.
///
/// The band is as given, or chosen on the first record free of missing values and used for all.
///
/// # Errors
/// As [`fit`]; [`Error::Cancelled`] and [`Error::Internal`] from the threads.
pub fn fit_many(
    batch: &Batch<'_>,
    o: &FitOptions,
    isa: Isa,
    thread_count: usize,
    progress: &mut dyn FnMut(usize, usize) -> Control,
) -> Result<(Many, Design), Error> {
    let n = batch.samples;
    let inputs = o.structure.numerators.len();
    let replicates = batch.y.len().checked_div(n).unwrap_or(0);
    let channel = |r: usize, k: usize| {
        let at = (if batch.shared { k } else { r * inputs + k }) * n;
        &batch.u[at..at + n]
    };
    let view = |r: usize| RecordView {
        y: &batch.y[r * n..(r + 1) * n],
        u: (0..inputs).map(|k| channel(r, k)).collect(),
        time: Time::Even(batch.dt),
    };
    if replicates == 0 {
        return Err(Error::Data("fitting a batch: it holds no replicate".into()));
    }
    let sound = |r: &usize| view(*r).y.iter().all(|v| v.is_finite());
    let chooser = match o.band {
        Band::Default => (0..replicates).find(sound).unwrap_or(0),
        _ => 0,
    };
    let shared = Shared::new(&view(chooser), o, isa)?;
    let (d, lines) = (&shared.design, shared.design.lines()[0]);
    let p = d.parameters();
    let make = || Worker {
        space: Workspace::new(d),
        scratch: shared.plans.iter().map(CoefficientPlan::scratch).collect(),
        samples: vec![Wide::ZERO; n],
        re: vec![Wide::ZERO; lines.last + 1],
        im: vec![Wide::ZERO; lines.last + 1],
        inputs_loaded: false,
    };
    let work = |w: &mut Worker, chunk: usize, stop: &std::sync::atomic::AtomicBool| {
        let mut out = Many::default();
        let (from, to) = (chunk * CHUNK, ((chunk + 1) * CHUNK).min(replicates));
        for first in (from..to).step_by(LANES) {
            if stop.load(std::sync::atomic::Ordering::Relaxed) {
                break;
            }
            let count = (to - first).min(LANES);
            for (k, plan) in shared.plans.iter().enumerate() {
                if k > 0 && batch.shared && w.inputs_loaded {
                    continue;
                }
                for lane in 0..LANES {
                    // Spare lanes repeat the last record: finite work, thrown away.
                    let r = first + lane.min(count - 1);
                    let from = if k == 0 { view_y(batch, r) } else { channel(r, k - 1) };
                    for (to, value) in w.samples.iter_mut().zip(from) {
                        to.0[lane] = *value;
                    }
                }
                plan.run_lanes(isa, &w.samples, &mut w.re, &mut w.im, &mut w.scratch[k])?;
                load(&mut w.space, k, lines, &w.re, &w.im);
            }
            w.inputs_loaded = true;
            let live = std::array::from_fn(|lane| lane < count);
            let outcome = estimate(isa, d, &mut w.space, live, Start::Wls, &o.options);
            for lane in 0..count {
                out.push(d, &w.space, lane, &outcome, o.options.wanted == Wanted::Covariance);
            }
        }
        Ok(out)
    };
    let chunks = replicates.div_ceil(CHUNK);
    let parts = threads::run(thread_count, chunks, progress, make, work)?;
    let mut all = Many::default();
    all.theta.reserve(replicates * p);
    for part in parts {
        all.append(part?);
    }
    Ok((all, shared.design.clone()))
}

fn view_y<'a>(batch: &Batch<'a>, r: usize) -> &'a [f64] {
    &batch.y[r * batch.samples..(r + 1) * batch.samples]
}

impl Many {
    /// Adds one lane's results.
    fn push(
        &mut self,
        d: &Design,
        w: &Workspace,
        lane: usize,
        outcome: &Outcome,
        covariance: bool,
    ) {
        self.theta.extend(w.theta(d, lane));
        if covariance {
            self.bse_nonrobust.extend(w.bse_nonrobust(d, lane));
            self.bse_hc3.extend(w.bse_hc3(d, lane));
        }
        self.status.push(outcome.status[lane]);
        self.cost.push(w.cost(lane) * d.cost_unit() * d.cost_unit());
        self.nit.push(outcome.nit[lane]);
    }

    fn append(&mut self, mut other: Many) {
        self.theta.append(&mut other.theta);
        self.bse_nonrobust.append(&mut other.bse_nonrobust);
        self.bse_hc3.append(&mut other.bse_hc3);
        self.status.append(&mut other.status);
        self.cost.append(&mut other.cost);
        self.nit.append(&mut other.nit);
    }
}
