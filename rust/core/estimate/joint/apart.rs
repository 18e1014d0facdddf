//! Outputs that share no parameter: each is fitted alone first, which tells where several delays start.

use super::design::NoiseModel;
use super::fitter::{Alone, JointFitter, JointOptions, JointRecord};
use super::structure::JointStructure;
use crate::error::Status;
use crate::estimate::fit::Time;
use crate::estimate::prior::Prior;

impl JointStructure {
    /// Whether outputs share neither denominator nor estimated delay, and two delays or more are estimated: the grid
    /// of all of them is coarse, those of each output are fine.
    fn is_apart(&self) -> bool {
        let free = self.free_delays();
        let users =
            |path: &usize| self.numerators.iter().filter(|row| row[*path].is_some()).count();
        !self.common
            && self.orders.len() > 1
            && free.len() > 1
            && free.iter().all(|p| users(p) == 1)
    }

    /// One output's structure, and the places of its parameters.
    fn alone(&self, output: usize) -> (JointStructure, Vec<usize>) {
        let row = &self.numerators[output];
        let own: Vec<usize> = (0..row.len()).filter(|path| row[*path].is_some()).collect();
        let (denominators, numerators) = self.places();
        let mut coefficients: Vec<usize> =
            (denominators[output]..denominators[output] + self.orders[output]).collect();
        for path in &own {
            let first = numerators[output][*path];
            coefficients.extend(first..=first + row[*path].unwrap_or(0));
        }
        let (free, delays) = (self.free(), self.free_delays());
        let of_coefficient = |k: &usize| free.binary_search(k).ok();
        let of_delay = |path: &usize| delays.binary_search(path).ok().map(|at| free.len() + at);
        let places = coefficients.iter().filter_map(of_coefficient);
        let places = places.chain(own.iter().filter_map(of_delay)).collect();
        let structure = JointStructure {
            orders: vec![self.orders[output]],
            common: false,
            numerators: vec![own.iter().map(|path| row[*path]).collect()],
            paths: own.iter().map(|path| self.paths[*path]).collect(),
            fixed: coefficients.iter().map(|k| self.fixed[*k]).collect(),
            bounds: coefficients.iter().map(|k| self.bounds[*k]).collect(),
        };
        (structure, places)
    }
}

impl JointFitter {
    /// Fitters of each output; none where the outputs are not apart.
    pub(super) fn alone(&self) -> Vec<Alone> {
        let o = &self.o;
        let white = o.noise.inputs.is_none() && o.noise.spectra.is_empty();
        if !(o.structure.is_apart() && white) {
            return Vec::new();
        }
        let sampling: Vec<_> = self.records.iter().map(|r| (r.samples, Time::Even(r.dt))).collect();
        let one = |output: usize| {
            let (structure, places) = o.structure.alone(output);
            let own = |prior: &Prior| {
                let parameter = places.iter().position(|at| *at == prior.parameter)?;
                Some(Prior { parameter, ..*prior })
            };
            let options = JointOptions {
                structure,
                noise: NoiseModel { outputs: None, ..o.noise.clone() },
                priors: o.priors.iter().filter_map(own).collect(),
                ..o.clone()
            };
            let of_output = |all: &Vec<Vec<f64>>| all.get(output).cloned().into_iter().collect();
            let variances: Vec<Vec<Vec<f64>>> = self.variances.iter().map(of_output).collect();
            let fitter = JointFitter::new(options, &sampling, &variances, self.isa).ok()?;
            Some(Alone { output, fitter, places })
        };
        (0..o.structure.orders.len()).map(one).collect::<Option<_>>().unwrap_or_default()
    }

    /// The parameters of all outputs, each fitted alone; nothing where outputs are not apart or one has no estimate.
    pub(super) fn estimate_apart(&self, records: &[JointRecord<'_>]) -> Option<Vec<f64>> {
        let mut theta = vec![f64::NAN; self.o.structure.parameters()];
        for Alone { output, fitter, places } in self.alone.get_or_init(|| self.alone()) {
            let own: Vec<JointRecord<'_>> = records
                .iter()
                .map(|r| JointRecord { y: vec![r.y[*output]], u: r.u.clone() })
                .collect();
            let found = fitter.fit(&own).ok()?.answer;
            if !matches!(found.status, Status::Ok | Status::MaxIter) {
                return None;
            }
            places.iter().zip(found.theta).for_each(|(at, value)| theta[*at] = value);
        }
        theta.iter().all(|value| value.is_finite()).then_some(theta)
    }
}
