//! A study laid out: noise-free coefficients once, one design an estimator, nothing left to do but draw and fit.

use std::sync::Arc;

use super::coloured::Coloured;
use crate::error::Error;
use crate::estimate::joint::{self, JointFitter, JointOptions, JointRecord};
use crate::estimate::{FitOptions, Fitter, Options, RecordView, Shared, Time, Wanted};
use crate::modulation::Lines;
use crate::rng::{self, Address, Purpose};
use crate::simd::Isa;
use crate::spectrum::CoefficientPlan;
use crate::structure::CovType;

/// Lines beyond which the roots of their covariances take longer to make than most studies run.
const MOST_DRAWN: usize = 512;

/// How noise is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Draw {
    /// A normal a sample.
    Samples,
    /// The Fourier coefficients themselves, with the exact covariance that the rule gives them.
    Coefficients,
}

/// What an estimator of a study is told.
#[derive(Debug, Clone)]
pub enum Told {
    /// One output, free parameters, white noise.
    Plain(FitOptions),
    /// Anything else.
    Joint(Box<JointOptions>),
}

impl Told {
    fn parameters(&self) -> usize {
        match self {
            Told::Plain(o) => o.structure.parameters(),
            Told::Joint(o) => o.structure.parameters(),
        }
    }

    fn options(&self) -> Options {
        match self {
            Told::Plain(o) => o.options,
            Told::Joint(o) => o.options,
        }
    }
}

/// An estimator of a study.
#[derive(Debug, Clone)]
pub struct Contender {
    /// Structure, method and options.
    pub options: Told,
    /// True parameters; 0 where unknown, so that errors are estimates.
    pub truth: Vec<f64>,
    /// Of which kind the intervals are that are counted as covering the truth, where any is.
    pub intervals: Option<CovType>,
}

/// What all cells with the same noise-free record share.
#[derive(Debug, Clone)]
pub struct Group {
    /// Noise group: the part of the random address that leaves out noise level and method.
    pub group: u32,
    /// Step in seconds.
    pub dt: f64,
    /// Noise-free outputs.
    pub y: Vec<Vec<f64>>,
    /// Inputs.
    pub u: Vec<Vec<f64>>,
    /// Response of each output to one standard deviation of each random initial state: \[state\]\[output\].
    pub free: Vec<Vec<Vec<f64>>>,
    /// Noise standard deviations, one a level, in units of `scale`.
    pub sigma: Vec<f64>,
    /// Unit of the noise of each output.
    pub scale: Vec<f64>,
    /// Estimators, all of which see the same noise.
    pub estimators: Vec<Contender>,
}

/// What the replicates of an estimator share.
pub(crate) enum Problem {
    Plain(Arc<Shared>),
    Joint(Box<joint::JointShared>),
}

impl Problem {
    /// Coefficient plans of the signals, outputs first.
    fn plans(&self) -> &[CoefficientPlan] {
        match self {
            Problem::Plain(s) => &s.plans,
            Problem::Joint(s) => &s.plans,
        }
    }

    /// Which input each signal behind the outputs begins with.
    fn input(&self, signal: usize) -> usize {
        match self {
            Problem::Plain(_) => signal,
            Problem::Joint(s) => s.input(signal),
        }
    }

    /// Lines that coefficients are needed on.
    pub fn lines(&self) -> Lines {
        match self {
            Problem::Plain(s) => s.design.records[0].lines,
            Problem::Joint(s) => s.design.records[0].lines,
        }
    }

    fn freedom(&self) -> usize {
        match self {
            Problem::Plain(s) => s.design.degrees_of_freedom(),
            Problem::Joint(s) => s.design.degrees_of_freedom(),
        }
    }
}

/// One estimator of one group: its problem and where its coefficients come from.
pub(crate) struct Task {
    pub problem: Problem,
    pub options: Options,
    pub truth: Vec<f64>,
    pub intervals: Option<CovType>,
    /// Parameters of the estimators before it.
    pub offset: usize,
    /// Which of the group's output plans it uses.
    pub source: usize,
    /// Noise-free input coefficients on lines 0..=last.
    pub inputs: Vec<Pair>,
}

/// Re and Im of coefficients on lines from 0 on.
pub(crate) type Pair = (Vec<f64>, Vec<f64>);

/// Output coefficients of one rule and window: noise-free, of each free response, and of noise.
pub(crate) struct Source {
    pub plan: CoefficientPlan,
    /// Of each output.
    pub y: Vec<Pair>,
    /// Of each output to each state.
    pub free: Vec<Vec<Pair>>,
    /// Its noise, where coefficients are drawn.
    pub coloured: Option<Coloured>,
}

/// A group ready to run.
pub(crate) struct GroupPlan {
    pub group: u32,
    pub samples: usize,
    pub sigma: Vec<f64>,
    pub scale: Vec<f64>,
    pub states: usize,
    /// Inputs, for delays that change from fit to fit.
    pub u: Vec<Vec<f64>>,
    pub sources: Vec<Source>,
    pub tasks: Vec<Task>,
}

/// A study laid out; it can be run for any range of replicates, again and again.
pub struct Plan {
    pub(crate) groups: Vec<GroupPlan>,
    pub(crate) isa: Isa,
}

impl Plan {
    /// Evaluates what no replicate changes.
    ///
    /// # Errors
    /// As a fit of each group's noise-free record.
    pub fn new(groups: &[Group], draw: Draw, isa: Isa) -> Result<Plan, Error> {
        let groups =
            groups.iter().map(|g| GroupPlan::new(g, draw, isa)).collect::<Result<_, _>>()?;
        Ok(Plan { groups, isa })
    }

    /// Whether drawing coefficients is less work than drawing samples, and all estimators of a group take
    /// them by one rule over one window, so that they are those of one record.
    #[must_use]
    pub fn coefficients_pay(&self) -> bool {
        self.groups.iter().all(|g| match &g.sources[..] {
            [source] => {
                let lines = source.plan.harmonics();
                lines <= MOST_DRAWN && lines * lines + 66 * lines < 51 * g.samples
            }
            _ => false,
        })
    }

    /// Noise of a replicate in a group, of unit size, one row an output: what the study draws there, and the
    /// samples behind it where that is coefficients.
    ///
    /// # Errors
    /// [`Error::Spec`] where a study whose estimators take coefficients in several ways drew them: no record
    /// has them all.
    pub fn noise(&self, group: usize, seed: u64, replicate: u64) -> Result<Vec<Vec<f64>>, Error> {
        let g = &self.groups[group];
        let normals = |purpose, output: usize, length| {
            let mut out = vec![0.0; length];
            let channel = output as u32;
            rng::normals(Address { seed, purpose, channel, replicate, group: g.group }, &mut out);
            out
        };
        (0..g.scale.len())
            .map(|output| match &g.sources[..] {
                [Source { coloured: Some(coloured), .. }] => {
                    let mut samples = normals(Purpose::Completion, output, g.samples);
                    let drawn = normals(Purpose::NoiseY, output, coloured.normals());
                    coloured.complete(&drawn, &mut samples);
                    Ok(samples)
                }
                [Source { coloured: None, .. }, ..] | [] => {
                    Ok(normals(Purpose::NoiseY, output, g.samples))
                }
                sources => Err(Error::Spec(format!(
                    "making a record: its coefficients were drawn for {} rules or windows apart, and no record \
                     has them all; run with draw=\"samples\"",
                    sources.len()
                ))),
            })
            .collect()
    }

    /// Degrees of freedom of each group's estimators.
    #[must_use]
    pub fn freedom(&self) -> Vec<Vec<usize>> {
        self.groups.iter().map(|g| g.tasks.iter().map(|t| t.problem.freedom()).collect()).collect()
    }
}

impl GroupPlan {
    /// Tasks of the cells: levels times estimators, estimators fastest.
    pub fn cells(&self) -> impl Iterator<Item = &Task> {
        self.sigma.iter().flat_map(|_| &self.tasks)
    }

    /// Parameters of all estimators together.
    pub fn parameters(&self) -> usize {
        self.tasks.iter().map(|t| t.truth.len()).sum()
    }

    pub fn new(g: &Group, draw: Draw, isa: Isa) -> Result<GroupPlan, Error> {
        let inputs = || g.u.iter().map(Vec::as_slice).collect();
        let y: Vec<&[f64]> = g.y.iter().map(Vec::as_slice).collect();
        let samples = y.first().map_or(0, |y| y.len());
        let sampling = [(samples, Time::Even(g.dt))];
        if y.is_empty() || g.scale.len() != y.len() || g.free.iter().any(|f| f.len() != y.len()) {
            return Err(Error::Spec(format!(
                "planning a study: {} outputs, {} noise units and free responses of other sizes",
                y.len(),
                g.scale.len()
            )));
        }
        let mut sources: Vec<Source> = Vec::new();
        let mut tasks = Vec::with_capacity(g.estimators.len());
        // The widest estimator of each rule and window decides how far its source reaches.
        let mut shared = Vec::with_capacity(g.estimators.len());
        for Contender { options, truth, .. } in &g.estimators {
            if truth.len() != options.parameters() {
                return Err(Error::Spec(format!(
                    "planning a study: {} true values for {} parameters",
                    truth.len(),
                    options.parameters()
                )));
            }
            shared.push(match options {
                Told::Plain(o) => {
                    let record = RecordView { y: y[0], u: inputs() };
                    Problem::Plain(Fitter::new(o.clone(), &sampling, isa)?.shared(&record)?)
                }
                Told::Joint(o) => {
                    let record = JointRecord { y: y.clone(), u: inputs() };
                    let fitter = JointFitter::new((**o).clone(), &sampling, &[], isa)?;
                    Problem::Joint(Box::new(fitter.shared(&record)?))
                }
            });
        }
        let alike = |a: &CoefficientPlan, b: &CoefficientPlan| {
            a.kind() == b.kind() && a.intervals() == b.intervals()
        };
        for s in &shared {
            let plan = &s.plans()[0];
            match sources.iter_mut().find(|have| alike(&have.plan, plan)) {
                Some(have) if have.plan.harmonics() >= plan.harmonics() => {}
                Some(have) => have.plan = plan.clone(),
                None => sources.push(Source {
                    plan: plan.clone(),
                    y: Vec::new(),
                    free: Vec::new(),
                    coloured: None,
                }),
            }
        }
        for source in &mut sources {
            let all = |signals: &Vec<Vec<f64>>| -> Result<Vec<Pair>, Error> {
                signals.iter().map(|v| coefficients(&source.plan, v)).collect()
            };
            (source.y, source.free) =
                (all(&g.y)?, g.free.iter().map(all).collect::<Result<_, _>>()?);
            if draw == Draw::Coefficients {
                source.coloured = Some(Coloured::new(&source.plan)?);
            }
        }
        for (shared, own) in shared.into_iter().zip(&g.estimators) {
            let source =
                sources.iter().position(|s| alike(&s.plan, &shared.plans()[0])).unwrap_or(0);
            let outputs = match &shared {
                Problem::Plain(_) => 1,
                Problem::Joint(_) => y.len(),
            };
            let inputs = shared.plans()[outputs..]
                .iter()
                .enumerate()
                .map(|(signal, plan)| coefficients(plan, &g.u[shared.input(signal)]))
                .collect::<Result<_, _>>()?;
            let offset = tasks.iter().map(|t: &Task| t.truth.len()).sum();
            tasks.push(Task {
                problem: shared,
                options: Options {
                    wanted: match own.intervals {
                        None => Wanted::Theta,
                        Some(_) => Wanted::Covariance,
                    },
                    ..own.options.options()
                },
                truth: own.truth.clone(),
                intervals: own.intervals,
                offset,
                source,
                inputs,
            });
        }
        Ok(GroupPlan {
            group: g.group,
            samples,
            sigma: g.sigma.clone(),
            scale: g.scale.clone(),
            u: g.u.clone(),
            states: g.free.len(),
            sources,
            tasks,
        })
    }
}

fn coefficients(plan: &CoefficientPlan, samples: &[f64]) -> Result<Pair, Error> {
    let lines = plan.harmonics() + 1;
    let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
    plan.run(samples, &mut re, &mut im)?;
    Ok((re, im))
}
