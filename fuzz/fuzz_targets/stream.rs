//! Estimates from a window that slides along samples, of one output and of several.
#![no_main]

use std::fmt::Debug;

use libfuzzer_sys::fuzz_target;
use modfun::Status;
use modfun::estimate::joint::{JointFit, JointFitter};
use modfun::estimate::{Fit, Fitter, Slider, Stream};
use modfun::simd::Isa;
use modfun_fuzz::{Bytes, same, sound, told};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = if b.rarely() { b.count(60) } else { 9 + b.below(50) };
    let dt = b.near(0.1);
    if b.flag() {
        let Some(options) = b.fit_options(n, dt) else { return };
        let channels = 1 + options.structure.numerators.len();
        run::<Fitter>(b, options, channels, n, dt);
    } else {
        let Some(options) = b.joint_options(n, dt) else { return };
        let channels = options.structure.orders.len() + options.inputs();
        run::<JointFitter>(b, options, channels, n, dt);
    }
});

/// What of a fit is looked at.
trait Parts: Debug {
    fn parts(&self) -> (Status, &[f64]);
}

impl Parts for Fit {
    fn parts(&self) -> (Status, &[f64]) {
        (self.answer.status, &self.answer.theta)
    }
}

impl Parts for JointFit {
    fn parts(&self) -> (Status, &[f64]) {
        (self.answer.status, &self.answer.theta)
    }
}

fn run<F: Slider>(b: &mut Bytes<'_>, options: F::Options, channels: usize, n: usize, dt: f64)
where
    F::Fit: Parts,
{
    let windows = b.below(3);
    let weights = b.many(windows, |b| b.near(0.5));
    let make = |isa| told(Stream::<F>::new(options.clone(), n, dt, &weights, isa));
    let Some(mut stream) = make(b.isa()) else { return };
    let pushed = n.min(60) + b.below(120);
    let record: Vec<Vec<f64>> = b.channels(channels, pushed);
    let length = record.iter().map(Vec::len).min().unwrap_or(0);
    let samples: Vec<Vec<f64>> =
        (0..length).map(|k| record.iter().map(|c| c[k]).collect()).collect();
    let every = b.count(32) as u64;
    let found = told(stream.follow(&samples, every));
    if let Some((_, many)) = &found {
        let p = many.theta.len() / many.status.len().max(1);
        for (k, status) in many.status.iter().enumerate() {
            let own = k * p..(k + 1) * p;
            sound(*status, &many.theta[own.clone()], many.bse_hc3[own].iter().copied());
        }
    }
    let last = told(stream.fit());
    if let Some(fit) = &last {
        let (status, theta) = fit.parts();
        sound(status, theta, []);
    }
    let Some(mut plain) = make(Isa::Plain) else { return };
    same(&found, &told(plain.follow(&samples, every)));
    same(&last, &told(plain.fit()));
    same(&told(stream.now()), &told(plain.now()));
}
