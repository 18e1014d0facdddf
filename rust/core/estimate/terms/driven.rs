//! Equations that noise drives: linear ones, as many as noisy outputs, on the lines of their records.
//!
//! Noise enters each equation by itself, or through inputs that nobody measured: channels of zeros, the last of the noisy ones,
//! each with a filter that shapes its spectrum.

use super::descent::Ended;
use super::equations::{Equations, Term};
use super::iterate::TermsProblem;
use super::plan::TermsFitter;
use crate::error::{Error, Status};
use crate::estimate::driven::output::Levels;
use crate::estimate::driven::{C, Driven, Found, Linear, Sampled};
use crate::estimate::normal_equations::RowWeights;
use crate::estimate::prior::{self, Prior};
use crate::structure::{Method, Noise};

/// The equations at one θ.
struct Rows<'a, 'b> {
    problem: &'a TermsProblem<'b>,
    noise: Noise,
    /// Slope of each signal by each noisy channel.
    sensitivities: Vec<f64>,
    /// g of each term, then the slopes.
    values: Vec<f64>,
    registers: Vec<f64>,
    /// Columns of the transient.
    transients: usize,
}

/// What was found.
pub(crate) struct DrivenTerms {
    pub ended: Ended,
    pub levels: Levels,
    pub nonrobust: Vec<f64>,
    pub hc3: Vec<f64>,
    pub gram: Vec<f64>,
    pub degrees: Vec<f64>,
    /// Of θ from what was known of it.
    pub distance: f64,
    /// Rows less what was estimated.
    pub freedom: usize,
    /// Of each record and equation.
    pub residuals: Vec<Vec<Vec<(f64, f64)>>>,
}

impl DrivenTerms {
    /// Whether this settled and the other did not, or else is the more likely.
    pub fn is_better(&self, other: &DrivenTerms) -> bool {
        let settled = |own: &DrivenTerms| own.ended.status == Status::Ok;
        let (mine, theirs) = (settled(self), settled(other));
        let cost =
            |own: &DrivenTerms| own.ended.cost * prior::factor(own.distance, own.freedom as f64);
        if mine == theirs { cost(self) < cost(other) } else { mine }
    }
}

impl Equations {
    /// Whether noise that drives them can be told: as many equations as noisy outputs, linear in these, with signals that do
    /// not depend on θ. `shapes`: noisy channels that are no outputs.
    pub(crate) fn can_be_driven(&self, shapes: usize) -> bool {
        self.orders.len() + shapes == self.noisy.len() && !self.moves() && !self.bends()
    }
}

impl<'a, 'b> Rows<'a, 'b> {
    fn new(problem: &'a TermsProblem<'b>, noise: Noise) -> Rows<'a, 'b> {
        let e = &problem.fitter.o.equations;
        let mut sensitivities = vec![0.0; e.signals.len() * e.noisy.len()];
        for (k, (signal, channel)) in e.sensitivities.iter().enumerate() {
            let slope = e.samples.constant(e.signals.len() + k).unwrap_or(f64::NAN);
            sensitivities[signal * e.noisy.len() + channel] = slope;
        }
        let transients = problem.spots.first().map_or(0, |spot| spot.transients);
        Rows {
            problem,
            noise,
            sensitivities,
            values: Vec::new(),
            registers: Vec::new(),
            transients,
        }
    }

    fn equations(&self) -> &Equations {
        &self.problem.fitter.o.equations
    }

    /// Slopes of a signal by the noisy channels.
    fn slopes_of(&self, signal: usize) -> &[f64] {
        let count = self.equations().noisy.len();
        &self.sensitivities[signal * count..][..count]
    }

    /// Adds what a term has of a noise; whether it has any.
    fn enter(
        &self,
        record: usize,
        line: usize,
        noise: usize,
        term: Term,
        by: f64,
        to: &mut [C],
    ) -> bool {
        let slope = self.slopes_of(term.signal)[self.outputs() + noise];
        if slope != 0.0 {
            let s = self.operator(record, line, term.order, term.signal);
            add(&mut to[term.equation], by * slope, s, (1.0, 0.0));
        }
        slope != 0.0
    }

    /// How a noise enters the equations, times `gain`.
    fn enter_by(&self, record: usize, line: usize, noise: usize, gain: f64, to: &mut [C]) {
        to.fill((0.0, 0.0));
        for (term, g) in self.equations().terms.iter().zip(&self.values) {
            self.enter(record, line, noise, *term, g * gain, to);
        }
    }

    /// The same by a parameter; whether it depends on that.
    fn enter_slope_by(
        &self,
        record: usize,
        line: usize,
        parameter: usize,
        (noise, gain): (usize, f64),
        to: &mut [C],
    ) -> bool {
        to.fill((0.0, 0.0));
        let e = self.equations();
        let mut depends = false;
        let slopes = e.slopes.iter().zip(&self.values[e.terms.len()..]);
        for ((t, _), g) in slopes.filter(|((_, own), _)| *own == parameter) {
            depends |= self.enter(record, line, noise, e.terms[*t], g * gain, to);
        }
        depends
    }

    /// What the states of a filter begin and end with enters as its noise does: by s^j/den. Which noise a column of the
    /// transient belongs to, and that factor; none for those of the equations.
    fn end_of(&self, record: usize, line: usize, column: usize) -> Option<(usize, C)> {
        let mut place = column.checked_sub(self.transients)?;
        for (noise, (_, den)) in self.problem.fitter.o.shapes.iter().enumerate() {
            if place + 1 < den.len() {
                let by = over(self.power(record, line, place), self.value(record, line, den));
                return Some((noise, by));
            }
            place -= den.len() - 1;
        }
        None
    }

    fn omega(&self, record: usize, line: usize) -> f64 {
        let lines = self.problem.spots[record].lines;
        (line + lines.first) as f64 * lines.omega0
    }

    /// A polynomial of iω with these coefficients, the highest power first.
    fn value(&self, record: usize, line: usize, coefficients: &[f64]) -> C {
        let omega = self.omega(record, line);
        coefficients.iter().fold((0.0, 0.0), |sum, c| (c - omega * sum.1, omega * sum.0))
    }

    /// (iω)^k in units of the highest line.
    fn power(&self, record: usize, line: usize, k: usize) -> C {
        let lines = self.problem.spots[record].lines;
        let x = (line + lines.first) as f64 / lines.last as f64;
        (0..k).fold((1.0, 0.0), |own, _| (-x * own.1, x * own.0))
    }

    /// Gain of the filter of a noise.
    fn gain(&self, record: usize, line: usize, noise: usize) -> f64 {
        let (num, den) = &self.problem.fitter.o.shapes[noise];
        size(self.value(record, line, num)) / size(self.value(record, line, den))
    }

    /// s^order of a line times e^{−s lag} of a signal.
    fn operator(&self, record: usize, line: usize, order: usize, signal: usize) -> C {
        let spot = &self.problem.spots[record];
        let turn = spot.turn(line, self.equations().lag(signal, &[]));
        let s = spot.power(line, order);
        times(s, turn)
    }
}

fn size(a: C) -> f64 {
    (a.0 * a.0 + a.1 * a.1).sqrt()
}

fn over(a: C, b: C) -> C {
    let size = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / size, (a.1 * b.0 - a.0 * b.1) / size)
}

fn times(a: C, b: C) -> C {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn add(to: &mut C, by: f64, s: C, v: C) {
    to.0 += by * (s.0 * v.0 - s.1 * v.1);
    to.1 += by * (s.0 * v.1 + s.1 * v.0);
}

impl Linear for Rows<'_, '_> {
    fn outputs(&self) -> usize {
        self.equations().orders.len()
    }

    fn parameters(&self) -> usize {
        self.equations().parameters
    }

    fn transients(&self) -> usize {
        let shapes = self.problem.fitter.o.shapes.iter();
        self.transients + shapes.map(|(_, den)| den.len() - 1).sum::<usize>()
    }

    fn records(&self) -> usize {
        self.problem.spots.len()
    }

    fn record(&self, record: usize) -> Sampled {
        let lines = self.problem.spots[record].lines;
        Sampled {
            lines: lines.count(),
            from_zero: lines.first == 0,
            variances: [lines.unit_variance, lines.omega0 / std::f64::consts::TAU],
        }
    }

    fn noises(&self) -> usize {
        let shapes = self.problem.fitter.o.shapes.len();
        if shapes == 0 { self.outputs() } else { shapes }
    }

    fn enters(&self, record: usize, line: usize, noise: usize, to: &mut [C]) {
        to.fill((0.0, 0.0));
        if self.problem.fitter.o.shapes.is_empty() {
            to[noise].0 = 1.0;
            return;
        }
        self.enter_by(record, line, noise, self.gain(record, line, noise), to);
    }

    fn enters_slope(
        &self,
        record: usize,
        line: usize,
        parameter: usize,
        noise: usize,
        to: &mut [C],
    ) -> bool {
        let shaped = !self.problem.fitter.o.shapes.is_empty();
        shaped
            && self.enter_slope_by(
                record,
                line,
                parameter,
                (noise, self.gain(record, line, noise)),
                to,
            )
    }

    fn measured(&self) -> bool {
        self.noise == Noise::Process
    }

    fn bounds(&self, parameter: usize) -> (f64, f64) {
        self.equations().bounds[parameter]
    }

    fn priors(&self) -> &[Prior] {
        &self.problem.fitter.o.priors
    }

    fn set(&mut self, theta: &[f64]) {
        let e = &self.problem.fitter.o.equations;
        self.values.resize(e.coefficients.results(), 0.0);
        e.coefficients.values(theta, &mut self.registers, &mut self.values);
    }

    fn line(&self, record: usize, line: usize, a: &mut [C], r: &mut [C], sizes: &mut [f64]) {
        let (e, q) = (self.equations(), self.outputs());
        a.fill((0.0, 0.0));
        r.fill((0.0, 0.0));
        sizes.fill(0.0);
        let spot = &self.problem.spots[record];
        // Line 0 has the sizes of line 1: an integrator has none there.
        let sized = line.max(usize::from(spot.lines.first == 0));
        for (term, g) in e.terms.iter().zip(&self.values) {
            let s = spot.power(line, term.order);
            add(&mut r[term.equation], *g, s, spot.signal(term.signal, line));
            let own = &self.slopes_of(term.signal)[..q];
            for (channel, slope) in own.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
                let s = self.operator(record, line, term.order, term.signal);
                let at = term.equation * q + channel;
                add(&mut a[at], *g * slope, s, (1.0, 0.0));
                sizes[at] += (*g * slope).abs() * size(spot.power(sized, term.order));
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
        let (e, q) = (self.equations(), self.outputs());
        a.fill((0.0, 0.0));
        r.fill((0.0, 0.0));
        let spot = &self.problem.spots[record];
        let slopes = e.slopes.iter().zip(&self.values[e.terms.len()..]);
        let mut depends = false;
        for ((t, _), g) in slopes.filter(|((_, own), _)| *own == parameter) {
            let term = e.terms[*t];
            let s = spot.power(line, term.order);
            add(&mut r[term.equation], *g, s, spot.signal(term.signal, line));
            let own = &self.slopes_of(term.signal)[..q];
            for (channel, slope) in own.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
                let s = self.operator(record, line, term.order, term.signal);
                add(&mut a[term.equation * q + channel], *g * slope, s, (1.0, 0.0));
                add(&mut r[term.equation], -*g * slope, s, noise[channel]);
                depends = true;
            }
        }
        depends
    }

    fn transient(&self, record: usize, line: usize, column: usize, to: &mut [C]) {
        match self.end_of(record, line, column) {
            None => self.problem.spots[record].transient(line, column, to),
            Some((noise, by)) => {
                self.enter_by(record, line, noise, 1.0, to);
                to.iter_mut().for_each(|own| *own = times(*own, by));
            }
        }
    }

    fn transient_slope(
        &self,
        record: usize,
        line: usize,
        column: usize,
        parameter: usize,
        to: &mut [C],
    ) -> bool {
        let Some((noise, by)) = self.end_of(record, line, column) else { return false };
        let depends = self.enter_slope_by(record, line, parameter, (noise, 1.0), to);
        to.iter_mut().for_each(|own| *own = times(*own, by));
        depends
    }
}

impl TermsFitter {
    /// The kind of noise inside the equations, where there is some and it is estimated by likelihood.
    pub(crate) fn driven(&self) -> Option<Noise> {
        let own = self.o.noise != Noise::Output && self.o.method == Method::Ml;
        (own && self.o.equations.can_be_driven(self.o.shapes.len())).then_some(self.o.noise)
    }

    /// The estimate with the levels of noise inside the equations, from one without.
    ///
    /// # Errors
    /// [`Error::Spec`] where such noise cannot be told.
    pub(crate) fn refine(
        &self,
        problem: &mut TermsProblem<'_>,
        first: &Ended,
        noise: Noise,
    ) -> Result<DrivenTerms, Error> {
        problem.cost(&first.theta, RowWeights::Flat)?;
        let problem = &*problem;
        let e = &self.o.equations;
        let (p, q) = (e.parameters, e.orders.len());
        let mut rows = Rows::new(problem, noise);
        let mut driven = Driven::new(&rows, self.isa);
        let mut found = Found { theta: first.theta.clone(), ..Found::default() };
        let own = &problem.sigmas;
        let mean = |c: usize| own.iter().map(|v| v.get(c, c)).sum::<f64>() / own.len() as f64;
        let start: Vec<f64> = (0..q).map(mean).collect();
        let sought = driven.seek(
            &mut rows,
            &mut found,
            &start,
            (self.o.options.tol, self.o.options.maxiter),
        );
        let more = (rows.transients() - rows.transients) * rows.records();
        let freedom = problem.degrees_of_freedom().saturating_sub(more).max(1);
        let cost = driven.cost(freedom as f64);
        driven.uncertainty(&mut rows, &mut found);
        let status = driven.status(cost, &found, &sought);
        let each: Vec<_> = (0..q).map(|k| driven.residuals(&found, k)).collect();
        let residuals =
            (0..own.len()).map(|r| each.iter().map(|k| k[r].clone()).collect()).collect();
        Ok(DrivenTerms {
            nonrobust: driven.square(|i, j| driven.covariance(i, j)),
            hc3: driven.square(|i, j| driven.sandwich(i, j)),
            gram: driven.unit_gram(),
            degrees: (0..p).map(|k| driven.degrees(k)).collect(),
            residuals,
            distance: driven.distance(),
            freedom,
            ended: Ended {
                theta: found.theta,
                cost,
                status,
                nit: first.nit + sought.steps as u32,
                at_bound: (0..p).map(|k| driven.is_held(k)).collect(),
            },
            levels: Levels { values: found.levels, cov: found.cov, shares: found.shares },
        })
    }
}
