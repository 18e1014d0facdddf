//! One output of a transfer function: its lines in one lane of a workspace.

use super::{C, Driven, Found, Linear, Sampled, plus, times};
use crate::estimate::design::Design;
use crate::estimate::record_workspace::RecordWorkspace;
use crate::modulation::{Column, Signal};
use crate::structure::Noise;

/// Variances of the samples and density of what drives the system.
const LEVELS: usize = 2;

/// Levels of one estimate, in the user's units.
#[derive(Debug, Clone)]
pub struct Levels {
    /// Variance of a sample's noise and power spectral density of the process noise (two-sided, of hertz), of each
    /// output and of each equation.
    pub values: Vec<f64>,
    /// Covariance of θ and these, row major; 0 beside what is 0.
    pub cov: Vec<f64>,
    /// Part of each output's misfit that process noise is, and its standard error.
    pub shares: Vec<(f64, f64)>,
}

/// Memory of the estimates of eight lanes, and what was found.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub driven: Driven,
    /// Of each lane; empty where nothing was found.
    pub found: Vec<Found>,
}

/// The problem of one lane.
pub(crate) struct Output<'a> {
    pub d: &'a Design,
    pub records: &'a [RecordWorkspace],
    pub lane: usize,
    pub theta: Vec<f64>,
}

impl Output<'_> {
    /// Coefficient of a signal on a line of a record; `y` stands for that of the output.
    fn signal(&self, record: usize, signal: Signal, line: usize, y: C) -> C {
        let r = &self.records[record];
        match signal {
            Signal::U(k) => {
                let at = (1 + k) * r.lines + line;
                (r.re[at].0[self.lane], r.im[at].0[self.lane])
            }
            Signal::One => (1.0, 0.0),
            Signal::Y | Signal::Denoised => y,
        }
    }

    /// Output's coefficient.
    fn output(&self, record: usize, line: usize) -> C {
        let r = &self.records[record];
        (r.re[line].0[self.lane], r.im[line].0[self.lane])
    }

    /// Value of a column of θ on a line.
    fn column(&self, record: usize, c: &Column, line: usize, y: C) -> C {
        let x = self.d.records[record].x[line];
        let operator = times(power(x, c), (c.sign, 0.0));
        times(operator, self.signal(record, c.signal, line, y))
    }

    /// Columns of θ.
    fn columns(&self) -> &[Column] {
        &self.d.columns[self.d.transient..]
    }
}

impl Linear for Output<'_> {
    fn parameters(&self) -> usize {
        self.d.parameters()
    }

    fn transients(&self) -> usize {
        self.d.transient
    }

    fn records(&self) -> usize {
        self.d.records.len()
    }

    fn record(&self, record: usize) -> Sampled {
        let own = &self.d.records[record];
        let unit = own.lines.unit_variance;
        // With noise in the equation alone its unit is that of the samples.
        let inside = match self.d.noise {
            Noise::Process => own.lines.omega0 / std::f64::consts::TAU,
            Noise::Output | Noise::Equation => unit,
        };
        Sampled { lines: own.x.len(), from_zero: own.lines.first == 0, variances: [unit, inside] }
    }

    fn measured(&self) -> bool {
        self.d.noise == Noise::Process
    }

    fn set(&mut self, theta: &[f64]) {
        self.theta.clear();
        self.theta.extend_from_slice(theta);
    }

    fn line(&self, record: usize, line: usize, a: &mut [C], r: &mut [C], sizes: &mut [f64]) {
        let d = self.d;
        let (own, y) = (&d.records[record], self.output(record, line));
        let x = own.x[line];
        (a[0], sizes[0]) = (power(x, &d.target), 1.0);
        r[0] = times(a[0], y);
        for (value, c) in self.theta.iter().zip(self.columns()) {
            r[0] = plus(r[0], (*value, 0.0), self.column(record, c, line, y));
        }
        for (value, c) in self.theta[..d.structure.order].iter().zip(self.columns()) {
            a[0] = plus(a[0], (*value, 0.0), power(x, c));
            sizes[0] = sizes[0] * own.size_x[line] + value.abs();
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
        let (y, c) = (self.output(record, line), &self.columns()[parameter]);
        let response = (y.0 - noise[0].0, y.1 - noise[0].1);
        r[0] = self.column(record, c, line, response);
        a[0] = power(self.d.records[record].x[line], c);
        parameter < self.d.structure.order
    }

    fn transient(&self, record: usize, line: usize, column: usize, to: &mut [C]) {
        let own = &self.d.records[record];
        let value = own.transient[column * own.x.len() + line];
        let real = self.d.columns[column].phase.is_multiple_of(2);
        to[0] = if real { (value, 0.0) } else { (0.0, value) };
    }
}

/// (ix)^power of a column.
fn power(x: f64, c: &Column) -> C {
    let size = (0..c.power.max(0)).fold(1.0, |p, _| p * x);
    match c.phase % 4 {
        0 => (size, 0.0),
        1 => (0.0, size),
        2 => (-size, 0.0),
        _ => (0.0, -size),
    }
}

impl Driven {
    /// The cost of one output: of equation noise the sum of squares.
    pub fn cost_of_output(&self, d: &Design, found: &Found) -> f64 {
        match d.noise {
            Noise::Process => self.cost(d.degrees_of_freedom() as f64),
            Noise::Output | Noise::Equation => found.levels[1] * self.misfit(),
        }
    }
}

impl Found {
    /// Levels in the user's units.
    pub fn levels_of_output(&self, d: &Design) -> Levels {
        let equation = (0..d.structure.order).fold(d.unit, |p, _| p * d.band_edge);
        in_units(self, &d.scale, [d.unit * d.unit, equation * equation])
    }
}

/// Levels of one output where parameters and levels have these units; nan where nothing was found.
pub(crate) fn in_units(found: &Found, scale: &[f64], units: [f64; LEVELS]) -> Levels {
    let p = scale.len();
    let unit = |k: usize| if k < p { scale[k] } else { units[k - p] };
    let size = p + LEVELS;
    if found.cov.is_empty() {
        let nothing = |count: usize| vec![f64::NAN; count];
        let (values, cov) = (nothing(LEVELS), nothing(size * size));
        return Levels { values, cov, shares: vec![(f64::NAN, f64::NAN)] };
    }
    let cov = found.cov.iter().enumerate().map(|(k, v)| v * unit(k / size) * unit(k % size));
    Levels {
        values: found.levels.iter().zip(units).map(|(level, unit)| level * unit).collect(),
        cov: cov.collect(),
        shares: found.shares.clone(),
    }
}

impl Refined {
    /// Levels of a lane in the user's units.
    pub fn levels(&self, d: &Design, lane: usize) -> Levels {
        self.found[lane].levels_of_output(d)
    }

    /// Whitened residuals of a lane on the lines of each record; none where nothing was found.
    pub fn residuals(&self, lane: usize) -> Vec<Vec<(f64, f64)>> {
        let found = &self.found[lane];
        if found.levels.is_empty() { Vec::new() } else { self.driven.residuals(found, 0) }
    }
}
