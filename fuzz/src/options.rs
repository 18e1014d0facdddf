//! Options of fits, most of them of use.

use modfun::estimate::joint::{Colour, Delay, JointOptions, JointStructure, NoiseModel, Path};
use modfun::estimate::{Band, FitOptions, Initial, Options, Wanted};
use modfun::quadrature::{Hold, Rule};
use modfun::structure::{Method, Noise, Structure, Trend};

use crate::{Bytes, told};

const METHODS: [Method; 4] = [Method::Ls, Method::Wls, Method::Awls, Method::Ml];
const TRENDS: [Trend; 4] = [Trend::None, Trend::None, Trend::Constant, Trend::Linear];
const HOLDS: [Option<Hold>; 3] = [None, Some(Hold::Zoh), Some(Hold::Foh)];

impl Bytes<'_> {
    /// An estimator.
    pub fn method(&mut self) -> Method {
        self.of(&METHODS)
    }

    /// Offset and drift.
    pub fn trend(&mut self) -> Trend {
        self.of(&TRENDS)
    }

    /// A quadrature rule.
    pub fn rule(&mut self) -> Rule {
        if self.flag() { Rule::Gregory } else { self.of(&Rule::ALL) }
    }

    /// How an input runs between samples.
    pub fn hold(&mut self) -> Option<Hold> {
        self.of(&HOLDS)
    }

    /// Lines of a record of so many seconds.
    pub fn band(&mut self, seconds: f64) -> Band {
        match self.below(4) {
            0 | 1 => Band::Default,
            2 => Band::Harmonics(self.count(24)),
            _ => {
                let line = std::f64::consts::TAU / seconds;
                let (low, high) = (self.below(4), 4 + self.below(32));
                Band::Edges(self.near(low as f64 * line), self.near(high as f64 * line))
            }
        }
    }

    /// When an iteration stops.
    pub fn iteration(&mut self) -> Options {
        Options {
            tol: self.near(1e-9),
            maxiter: self.of(&[0, 1, 5, 30]),
            wanted: self.of(&[Wanted::Covariance, Wanted::Cost, Wanted::Theta]),
        }
    }

    fn degree(&mut self, order: usize) -> Option<usize> {
        match self.below(8) {
            0 => None,
            1 => Some(self.count(4)),
            k => Some(k.min(order.saturating_sub(1))),
        }
    }

    /// A delay in seconds, most often none.
    fn delay(&mut self, dt: f64) -> f64 {
        let steps = [0.0, 0.0, 0.0, 1.0, 2.5][self.below(5)];
        self.near(steps * dt)
    }

    /// How one output is fitted to records of `n` samples, `dt` seconds apart.
    pub fn fit_options(&mut self, n: usize, dt: f64) -> Option<FitOptions> {
        let order = if self.rarely() { self.count(8) } else { 1 + self.below(4) };
        let inputs = self.below(4);
        let numerators = self.many(inputs, |b| b.degree(order));
        let mut structure = told(Structure::new(order, numerators))?;
        if self.rarely() {
            let transient = self.count(8);
            structure = told(structure.with_transient(transient))?;
        }
        let given = if self.rarely() { self.below(4) } else { inputs };
        Some(FitOptions {
            structure,
            delays: self.many(given, |b| b.delay(dt)),
            intersample: self.many(inputs, Self::hold).into(),
            rule: self.rule(),
            method: self.method(),
            noise: self.of(&[Noise::Output, Noise::Output, Noise::Equation]),
            trend: self.trend(),
            extended: !self.rarely(),
            band: self.band(n as f64 * dt),
            own_levels: !self.rarely(),
            initial: self.of(&[Initial::Unknown, Initial::Unknown, Initial::Zero, Initial::Rest]),
            states: vec![],
            options: self.iteration(),
        })
    }

    fn path(&mut self, inputs: usize, dt: f64) -> Path {
        let input = if self.rarely() { self.count(4) } else { self.below(inputs) };
        let delay = match self.below(6) {
            5 => {
                Delay::Free { start: self.delay(dt), min: self.near(0.0), max: self.near(4.0 * dt) }
            }
            _ => Delay::Known(self.delay(dt)),
        };
        Path { input, delay }
    }

    fn noise_model(&mut self, outputs: usize, paths: usize) -> NoiseModel {
        let square = |b: &mut Self, size: usize| {
            let own = if b.rarely() { b.below(4) } else { size };
            let mut all = vec![0.0; own * own];
            for k in 0..own {
                all[k * (own + 1)] = b.near(1.0);
            }
            if b.rarely() && !all.is_empty() {
                let at = b.below(all.len());
                all[at] = b.number();
            }
            all
        };
        NoiseModel {
            equation: self.rarely(),
            outputs: self.flag().then(|| square(self, outputs)),
            inputs: self.rarely().then(|| square(self, paths)),
            colour: if self.rarely() { Colour::Fitted } else { Colour::Given },
            spectra: match self.rarely() {
                true => {
                    let lines = self.below(80);
                    vec![self.many(outputs + paths, |b| b.channel(lines, &[]))]
                }
                false => Vec::new(),
            },
        }
    }

    /// How several outputs are fitted jointly.
    pub fn joint_options(&mut self, n: usize, dt: f64) -> Option<JointOptions> {
        let (outputs, inputs) = (1 + self.below(3), self.below(3));
        let paths = if inputs == 0 { 0 } else { self.below(4) };
        let common = self.rarely();
        let order = 1 + self.below(3);
        let orders = self.many(outputs, |b| if b.rarely() { b.count(4) } else { order });
        let rows = self.many(outputs, |b| b.many(paths, |b| b.degree(order)));
        let mut structure = JointStructure {
            orders,
            common,
            numerators: rows,
            paths: self.many(paths, |b| b.path(inputs, dt)),
            fixed: Vec::new(),
            bounds: Vec::new(),
        };
        let count =
            if structure.orders.iter().all(|n| *n < 8) { outputs * (4 + 5 * paths) } else { 0 };
        if self.rarely() {
            structure.fixed = self.many(count, |b| b.rarely().then(|| b.number()));
            structure.fixed.truncate(structure.coefficients());
        }
        if self.rarely() {
            structure.bounds =
                self.many(count, |b| (b.near(f64::NEG_INFINITY), b.near(f64::INFINITY)));
            structure.bounds.truncate(structure.coefficients());
        }
        Some(JointOptions {
            structure: told(structure.checked())?,
            intersample: self.many(inputs, Self::hold).into(),
            rule: self.rule(),
            method: self.of(&[Method::Ml, Method::Awls, Method::Wls]),
            noise: self.noise_model(outputs, paths),
            trend: self.trend(),
            extended: !self.rarely(),
            band: self.band(n as f64 * dt),
            driven: false,
            own_levels: !self.rarely(),
            priors: vec![],
            options: self.iteration(),
        })
    }
}
