//! Noise that drives the system: one output with coefficients that are held, bounded or known beforehand.

use super::design::JointDesign;
use super::fit::JointFit;
use super::fitter::JointFitter;
use super::single::{Ended, Single};
use super::structure::{JointSignal, Term};
use super::workspace::JointRecordWorkspace;
use crate::error::Status;
use crate::estimate::driven::output::{Levels, in_units};
use crate::estimate::driven::{C, Driven, Found, Linear, Sampled, plus, times};
use crate::estimate::prior::Prior;
use crate::simd::{LANES, numbers};

/// The equation A(s)Y = B(s)U on the lines of a single problem.
struct Row<'a> {
    d: &'a JointDesign,
    records: &'a [JointRecordWorkspace],
    theta: Vec<f64>,
}

impl Row<'_> {
    fn signal(&self, record: usize, signal: JointSignal, line: usize) -> C {
        let r = &self.records[record];
        let at = match signal {
            JointSignal::Output => 0,
            JointSignal::Path(k) => 1 + k,
        };
        let at = at * r.lines * LANES + line;
        (numbers(&r.re)[at], numbers(&r.im)[at])
    }

    /// Adds `by` times a term of r to it, with `y` for the output.
    fn add(&self, to: &mut C, by: f64, t: Term, (record, line): (usize, usize), y: C) {
        let s = power(self.d.records[record].x[line], t.power);
        let own = match t.signal {
            JointSignal::Output => times(s, y),
            path => times((-s.0, -s.1), self.signal(record, path, line)),
        };
        *to = plus(*to, (by, 0.0), own);
    }

    /// Every term but the leading one, with its coefficient.
    fn terms(&self) -> impl Iterator<Item = (f64, Term)> + '_ {
        let d = self.d;
        let free = self.theta.iter().zip(&d.columns);
        let free = free.flat_map(|(value, terms)| terms.iter().map(|t| (*value, *t)));
        let held = d.held.iter().map(|t| {
            let value = d.structure.fixed[t.coefficient].unwrap_or(0.0);
            (value / d.scale[t.coefficient], *t)
        });
        free.chain(held)
    }
}

/// (ix)^k.
fn power(x: f64, k: usize) -> C {
    (0..k).fold((1.0, 0.0), |own, _| (-x * own.1, x * own.0))
}

impl Linear for Row<'_> {
    fn parameters(&self) -> usize {
        self.d.parameters()
    }

    fn transients(&self) -> usize {
        self.d.transient.len()
    }

    fn records(&self) -> usize {
        self.d.records.len()
    }

    fn record(&self, record: usize) -> Sampled {
        let own = &self.d.records[record];
        Sampled {
            lines: own.used,
            from_zero: own.lines.first == 0,
            variances: [own.lines.unit_variance, own.lines.omega0 / std::f64::consts::TAU],
        }
    }

    fn measured(&self) -> bool {
        true
    }

    fn bounds(&self, parameter: usize) -> (f64, f64) {
        self.d.parameter_bounds(parameter)
    }

    fn priors(&self) -> &[Prior] {
        &self.d.priors
    }

    fn set(&mut self, theta: &[f64]) {
        self.theta.clear();
        self.theta.extend_from_slice(theta);
    }

    fn line(&self, record: usize, line: usize, a: &mut [C], r: &mut [C], sizes: &mut [f64]) {
        let own = &self.d.records[record];
        let order = self.d.structure.orders[0];
        let size = |k: usize| (0..k).fold(1.0, |own_size, _| own_size * own.size_x[line]);
        let y = self.signal(record, JointSignal::Output, line);
        (a[0], sizes[0]) = (power(own.x[line], order), size(order));
        r[0] = times(a[0], y);
        for (value, t) in self.terms() {
            self.add(&mut r[0], value, t, (record, line), y);
            if t.signal == JointSignal::Output {
                a[0] = plus(a[0], (value, 0.0), power(own.x[line], t.power));
                sizes[0] += value.abs() * size(t.power);
            }
        }
    }

    fn slope(
        &self,
        record: usize,
        line: usize,
        parameter: usize,
        noise: &[C],
        a: &mut [C],
        r: &mut [C],
    ) -> bool {
        let y = self.signal(record, JointSignal::Output, line);
        let response = (y.0 - noise[0].0, y.1 - noise[0].1);
        (a[0], r[0]) = ((0.0, 0.0), (0.0, 0.0));
        let mut depends = false;
        for t in &self.d.columns[parameter] {
            self.add(&mut r[0], 1.0, *t, (record, line), response);
            if t.signal == JointSignal::Output {
                a[0] = plus(a[0], (1.0, 0.0), power(self.d.records[record].x[line], t.power));
                depends = true;
            }
        }
        depends
    }

    fn transient(&self, record: usize, line: usize, column: usize, to: &mut [C]) {
        let own = &self.d.records[record];
        let value = own.transient[column * own.stride() + line];
        let real = self.d.transient[column].column.phase.is_multiple_of(2);
        to[0] = if real { (value, 0.0) } else { (0.0, value) };
    }
}

impl JointFitter {
    /// The fit with the levels of noise inside the system, from where one without such noise ended.
    pub(super) fn driven(
        &self,
        d: &JointDesign,
        single: &Single<'_>,
        mut fit: JointFit,
        ended: Ended,
    ) -> JointFit {
        let p = d.parameters();
        let mut row = Row { d, records: &single.w.records, theta: Vec::new() };
        let mut driven = Driven::new(&row, self.isa);
        let mut found = Found { theta: single.estimates(), ..Found::default() };
        if found.theta.iter().any(|t| !t.is_finite()) {
            return fit;
        }
        let limits = (self.o.options.tol, self.o.options.maxiter);
        let sought = driven.seek(&mut row, &mut found, &[1.0], limits);
        let freedom = fit.answer.degrees_of_freedom as f64;
        let unit = d.units[0] * d.units[0];
        let cost = driven.cost(freedom) * unit;
        driven.uncertainty(&mut row, &mut found);
        let equation = (0..d.structure.orders[0]).fold(d.units[0], |own, _| own * d.band_edge);
        let scale: Vec<f64> = (0..p).map(|k| d.parameter_scale(k)).collect();
        let Levels { values, cov, shares } = in_units(&found, &scale, [unit, equation * equation]);
        let answer = &mut fit.answer;
        answer.status = driven.status(cost, &found, &sought);
        let useless = matches!(answer.status, Status::NonFinite | Status::Rank);
        let own = |k: usize| if useless { f64::NAN } else { scale[k] };
        answer.nit = ended.nit + sought.steps as u32;
        answer.theta = found.theta.iter().zip(&scale).map(|(t, unit)| t * unit).collect();
        answer.cov_nonrobust = driven.square(|i, j| driven.covariance(i, j) * own(i) * own(j));
        answer.cov_spectral.clone_from(&answer.cov_nonrobust);
        answer.cov_hc3 = driven.square(|i, j| driven.sandwich(i, j) * own(i) * own(j));
        answer.gram = driven.unit_gram();
        answer.degrees = (0..p).map(|k| driven.degrees(k)).collect();
        answer.cost = cost;
        let variance = cost / freedom;
        JointFit {
            levels: Some(Levels { values, cov, shares }),
            scale: variance / unit,
            noise: vec![variance],
            at_bound: (0..p).map(|k| driven.is_held(k)).collect(),
            residuals: driven.residuals(&found, 0).into_iter().map(|own| vec![own]).collect(),
            ..fit
        }
    }
}
