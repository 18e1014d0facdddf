//! Fits of equations: formulas that mean something (Duffing's oscillator) and others.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::estimate::terms::{
    Equations, Lag, Signal, Term, TermsFitter, TermsOptions, TermsRecord,
};
use modfun::simd::Isa;
use modfun::spectrum::Kind;
use modfun::structure::Noise;
use modfun::tape::{Tape, Written};
use modfun_fuzz::{Bytes, Sampling, diagonal, same, sound, told, views};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = 9 + b.below(60);
    let sampling = b.times(n);
    let dt = if let Sampling::Even(dt) = sampling { dt } else { 0.5 };
    let Some(equations) = (if b.flag() { duffing(b) } else { any(b, dt) }) else { return };
    let channels = equations.channels;
    let noisy = if b.rarely() { b.below(4) } else { equations.noisy.len() };
    let options = TermsOptions {
        rule: b.rule(),
        method: b.method(),
        shapes: Vec::new(),
        noise: b.of(&[Noise::Output, Noise::Equation, Noise::Process]),
        trend: b.trend(),
        band: b.band(n as f64 * dt),
        levels: b.flag().then(|| b.many(noisy, |b| b.near(0.01))),
        levels_matter: b.flag(),
        learn: b.flag(),
        priors: vec![],
        options: b.iteration(),
        equations,
    };
    let uneven = match b.rarely() {
        true => vec![b.channels(noisy, n)],
        false => Vec::new(),
    };
    let kinds = [(n, sampling.time())];
    let isa = b.isa();
    let Some(fitter) = told(TermsFitter::new(options.clone(), &kinds, &uneven, isa)) else {
        return;
    };
    let record = b.channels(channels, n);
    let given = [TermsRecord { channels: views(&record) }];
    let fit = told(fitter.fit(&given));
    if let Some(fit) = fit.as_ref().map(|f| &f.answer) {
        let p = fit.theta.len();
        let errors = diagonal(&fit.cov_nonrobust, p).chain(diagonal(&fit.cov_hc3, p));
        sound(fit.status, &fit.theta, errors);
    }
    if let Some(plain) = told(TermsFitter::new(options, &kinds, &uneven, Isa::Plain)) {
        same(&fit, &told(plain.fit(&given)));
    }
});

fn op(name: &str, value: f64, a: usize, b: usize) -> Written {
    (name.to_owned(), value, a, b)
}

fn bounds(b: &mut Bytes<'_>, count: usize) -> Vec<(f64, f64)> {
    b.many(count, |b| (b.near(f64::NEG_INFINITY), b.near(f64::INFINITY)))
}

/// p²y + a p y + b y + c(y³ − 3σ²y) = u of the channels y, u.
fn duffing(b: &mut Bytes<'_>) -> Option<Equations> {
    let samples = [
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -3.0, 0, 0),
        op("multiply", 0.0, 3, 2),
        op("whole", 3.0, 0, 0),
        op("multiply", 0.0, 4, 0),
        op("add", 0.0, 5, 6),
        op("constant", 1.0, 0, 0),
        op("whole", 2.0, 0, 0),
        op("constant", 3.0, 0, 0),
        op("multiply", 0.0, 10, 9),
        op("add", 0.0, 11, 4),
    ];
    let coefficients = [
        op("constant", 1.0, 0, 0),
        op("input", 0.0, 0, 0),
        op("input", 0.0, 1, 0),
        op("input", 0.0, 2, 0),
        op("constant", -1.0, 0, 0),
    ];
    let signal = Signal { kind: Kind::Rule(b.rule()).into(), lag: Lag::Known(0.0) };
    let term = |signal, order| Term { equation: 0, signal, order };
    Some(Equations {
        orders: vec![2],
        signals: vec![signal; 3],
        terms: vec![term(0, 2), term(0, 1), term(0, 0), term(1, 0), term(2, 0)],
        coefficients: told(Tape::new(&coefficients, 3, vec![0, 1, 2, 3, 4, 0, 0, 0]))?,
        slopes: vec![(1, 0), (2, 1), (3, 2)],
        samples: told(Tape::new(&samples, 6, vec![0, 7, 1, 8, 12]))?,
        sensitivities: vec![(0, 0), (1, 0)],
        signal_slopes: Vec::new(),
        channels: 2,
        noisy: vec![0],
        parameters: 3,
        starts: b.many(3, |b| b.rarely().then(|| b.number())),
        near: b.rarely(),
        bounds: bounds(b, 3),
        linear: true,
    })
}

/// Terms of signals and coefficients that need not mean anything.
fn any(b: &mut Bytes<'_>, dt: f64) -> Option<Equations> {
    let (channels, parameters) = (1 + b.below(3), b.below(4));
    let (noise, equations) = (1 + b.below(2), 1 + b.below(2));
    let noisy = b.many(noise, |b| b.below(channels));
    let orders = b.many(equations, |b| if b.rarely() { b.count(5) } else { b.below(3) });
    let count = 1 + b.below(3);
    let signals = b.many(count, |b| Signal {
        kind: if b.flag() { Kind::Rule(b.rule()) } else { b.of(&Kind::ALL) }.into(),
        lag: match b.below(8) {
            7 => Lag::Parameter(b.below(parameters + 1)),
            6 => Lag::Known(b.near(2.0 * dt)),
            _ => Lag::Known(0.0),
        },
    });
    let some = 1 + b.below(5);
    let terms = b.many(some, |b| {
        let equation = b.below(orders.len());
        let highest = orders[equation].min(8);
        let order = if b.rarely() { b.count(9) } else { b.below(highest + 1) };
        Term { equation, signal: b.below(count), order }
    });
    let slopes = b.many(parameters, |b| (b.below(terms.len()), b.below(parameters)));
    let sensitivities = b.many(1, |b| (b.below(count), b.below(noisy.len())));
    let moved = if b.rarely() { 1 } else { 0 };
    let signal_slopes =
        b.many(moved, |b| (b.below(count), b.below(parameters + 1), b.below(count)));
    let inputs = channels + noisy.len() + parameters;
    let written = b.formulas(inputs);
    let places = b.results(count + sensitivities.len(), written.len());
    let samples = told(Tape::new(&written, inputs, places))?;
    let written = b.formulas(parameters);
    let places = b.results(terms.len() + slopes.len(), written.len());
    let coefficients = told(Tape::new(&written, parameters, places))?;
    let linear = b.flag();
    Some(Equations {
        orders,
        signals,
        terms,
        coefficients,
        slopes,
        samples,
        sensitivities,
        signal_slopes,
        channels,
        noisy,
        parameters,
        starts: b.many(parameters, |b| b.rarely().then(|| b.number())),
        near: b.rarely(),
        bounds: bounds(b, parameters),
        linear,
    })
}
