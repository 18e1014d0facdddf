//! Workspace of one estimator of a study, of one output or joint.

use super::plan::{GroupPlan, Problem, Task};
use crate::error::Error;
use crate::estimate::batch::load;
use crate::estimate::covariances::Kinds;
use crate::estimate::joint::JointWorkspace;
use crate::estimate::{Outcome, Start, Workspace, estimate};
use crate::simd::{Isa, LANES, Wide};

/// Coefficients of eight replicates with all that an estimate needs.
pub(crate) enum TaskWorkspace {
    Plain(Box<Workspace>),
    Joint(Box<JointWorkspace>),
}

impl TaskWorkspace {
    /// With the inputs of a task loaded.
    pub fn new(g: &GroupPlan, task: &Task) -> TaskWorkspace {
        let splat = |v: &Vec<f64>| v.iter().map(|x| Wide::splat(*x)).collect::<Vec<_>>();
        match &task.problem {
            Problem::Plain(shared) => {
                let d = &shared.design;
                let mut space = Workspace::new(d);
                space.make_other(d);
                for (k, (re, im)) in task.inputs.iter().enumerate() {
                    load(&mut space, 1 + k, d.lines()[0], &splat(re), &splat(im));
                }
                if let Some(known) = d.known_start.as_ref().filter(|known| !known.periodic()) {
                    space.set_drives(known.drives(0, &[], |_, input| &g.u[input]));
                }
                space.covariances.kinds = task.intervals.map_or_else(Kinds::default, Kinds::only);
                TaskWorkspace::Plain(Box::new(space))
            }
            Problem::Joint(shared) => {
                let mut space = JointWorkspace::new(&shared.design);
                let outputs = shared.design.outputs();
                for (k, (re, im)) in task.inputs.iter().enumerate() {
                    shared.load(&mut space, outputs + k, &splat(re), &splat(im));
                }
                space.covariances.kinds = task.intervals.map_or_else(Kinds::default, Kinds::only);
                TaskWorkspace::Joint(Box::new(space))
            }
        }
    }

    /// Outputs that the estimator sees.
    pub fn outputs(&self, task: &Task) -> usize {
        match &task.problem {
            Problem::Plain(_) => 1,
            Problem::Joint(shared) => shared.design.outputs(),
        }
    }

    /// Where an output's coefficients are written, in the user's units.
    pub fn signal_mut(&mut self, output: usize) -> (&mut [Wide], &mut [Wide]) {
        match self {
            TaskWorkspace::Plain(space) => space.signal_mut(0, output),
            TaskWorkspace::Joint(space) => space.signal_mut(0, output),
        }
    }

    /// Estimates from what stands in it.
    pub fn estimate(
        &mut self,
        isa: Isa,
        g: &GroupPlan,
        task: &Task,
        live: [bool; LANES],
    ) -> Result<Outcome, Error> {
        match (self, &task.problem) {
            (TaskWorkspace::Plain(space), Problem::Plain(shared)) => {
                Ok(estimate(isa, &shared.design, space, live, Start::Wls, &task.options))
            }
            (TaskWorkspace::Joint(space), Problem::Joint(shared)) => {
                shared.to_units(space);
                let paths = 0..shared.kinds.len();
                let samples = paths.map(|s| vec![g.u[shared.input(s)].as_slice()]).collect();
                shared.estimate(isa, space, live, samples, &task.options)
            }
            _ => Err(Error::Internal("a study's workspace is not that of its estimator".into())),
        }
    }

    /// Parameter `k` of every lane in the user's units.
    pub fn parameter(&self, task: &Task, k: usize) -> [f64; LANES] {
        match (self, &task.problem) {
            (TaskWorkspace::Plain(space), Problem::Plain(shared)) => {
                space.parameter(&shared.design, k)
            }
            (TaskWorkspace::Joint(space), Problem::Joint(shared)) => {
                space.parameter(&shared.design, k)
            }
            _ => [f64::NAN; LANES],
        }
    }

    /// Variance of parameter `k` of every lane, of the kind that the task counts.
    pub fn parameter_variance(&self, task: &Task, k: usize) -> [f64; LANES] {
        match (self, &task.problem, task.intervals) {
            (TaskWorkspace::Plain(space), Problem::Plain(shared), Some(kind)) => {
                space.covariances.variance(kind, k, shared.design.scale[k])
            }
            (TaskWorkspace::Joint(space), Problem::Joint(shared), Some(kind)) => {
                space.covariances.variance(kind, k, shared.design.parameter_scale(k))
            }
            _ => [f64::NAN; LANES],
        }
    }

    /// Degrees of freedom of the variance of parameter `k` of every lane, where the noise spectrum is estimated.
    pub fn degrees(&self, k: usize) -> [f64; LANES] {
        match self {
            TaskWorkspace::Plain(space) => space.covariances.spectral.degrees[k].0,
            TaskWorkspace::Joint(space) => space.covariances.spectral.degrees[k].0,
        }
    }
}
