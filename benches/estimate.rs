//! Time of a replicate and its parts in the setting of the report's eq. (24): M = 6, N = 256, trapezoid.
//!
//! Elements are replicates, so that the inverse throughput is the time of one.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/rust/common/mod.rs"]
mod common;

use common::{ALL, Block, INTERVALS};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use modfun::estimate::{
    Band, Design, FitOptions, Fitter, Initial, Options, RecordView, Start, Time, Wanted, Workspace,
    estimate,
};
use modfun::quadrature::Rule;
use modfun::rng::{Address, Purpose, fill, normals};
use modfun::simd::{Isa, LANES, Wide};
use modfun::structure::{Method, Noise, Structure, Trend};
use std::hint::black_box;

/// M + n.
const LAST: usize = 8;
const FIVE: Options = Options { tol: 0.0, maxiter: 5, wanted: Wanted::Theta };
const SETTLED: Options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Theta };

fn problem(method: Method) -> (Design, Workspace, Block) {
    let d = common::design(2, 0, method, Trend::None, LAST, common::omega0());
    let block = common::block(1, 0, 0.1, LAST);
    let mut w = Workspace::new(&d);
    common::load(&mut w, &d, &block);
    (d, w, block)
}

/// Estimates from coefficients: the start alone, one step more, five, and to 1e-9.
fn estimates(c: &mut Criterion) {
    let mut group = c.benchmark_group("estimate");
    group.throughput(Throughput::Elements(LANES as u64));
    let steps = |maxiter| Options { maxiter, ..FIVE };
    for isa in Isa::available() {
        for (name, method, options) in [
            ("ls", Method::Ls, FIVE),
            ("wls", Method::Wls, FIVE),
            ("awls, 1 step", Method::Awls, steps(1)),
            ("awls, 5 steps", Method::Awls, FIVE),
            ("awls to 1e-9", Method::Awls, SETTLED),
            ("ml, 1 step", Method::Ml, steps(1)),
            ("ml to 1e-9", Method::Ml, SETTLED),
            ("ml to 1e-9, covariances", Method::Ml, common::OPTIONS),
        ] {
            let (d, mut w, _) = problem(method);
            group.bench_function(format!("{isa:?} {name}"), |b| {
                b.iter(|| estimate(isa, &d, black_box(&mut w), ALL, Start::Wls, &options));
            });
        }
    }
    group.finish();
}

/// Noise, sums, estimate.
fn replicate(c: &mut Criterion) {
    let mut group = c.benchmark_group("replicate");
    group.throughput(Throughput::Elements(LANES as u64));
    let plan = common::plan(LAST);
    for isa in Isa::available() {
        for (name, method, options) in
            [("awls, 5 steps", Method::Awls, FIVE), ("ml to 1e-9", Method::Ml, SETTLED)]
        {
            let (d, mut w, clean) = problem(method);
            let mut samples = vec![Wide::ZERO; INTERVALS + 1];
            let (mut re, mut im) = (vec![Wide::ZERO; LAST + 1], vec![Wide::ZERO; LAST + 1]);
            let mut scratch = plan.scratch();
            let mut first = 0;
            group.bench_function(format!("{isa:?} {name}"), |b| {
                b.iter(|| {
                    fill(isa, 1, Purpose::NoiseY, 0, first, 0, &mut samples);
                    first += LANES as u64;
                    plan.run_lanes(isa, &samples, &mut re, &mut im, &mut scratch).unwrap();
                    let (to_re, to_im) = w.signal_mut(0, 0);
                    for (to, (clean, noise)) in to_re.iter_mut().zip(clean.y.0.iter().zip(&re)) {
                        *to =
                            Wide(std::array::from_fn(|k| 0.1_f64.mul_add(noise.0[k], clean.0[k])));
                    }
                    for (to, (clean, noise)) in to_im.iter_mut().zip(clean.y.1.iter().zip(&im)) {
                        *to =
                            Wide(std::array::from_fn(|k| 0.1_f64.mul_add(noise.0[k], clean.0[k])));
                    }
                    estimate(isa, &d, black_box(&mut w), ALL, Start::Wls, &options)
                });
            });
        }
    }
    group.finish();
}

/// One record from samples to covariances, prepared before; and the preparation.
fn single(c: &mut Criterion) {
    let mut group = c.benchmark_group("single fit");
    let dt = common::DURATION / INTERVALS as f64;
    let u: Vec<f64> = (0..=INTERVALS).map(|k| common::chirp(k as f64 * dt)).collect();
    let mut noise = vec![0.0; INTERVALS + 1];
    let at = Address { seed: 1, purpose: Purpose::NoiseY, channel: 0, replicate: 0, group: 0 };
    normals(at, &mut noise);
    let y: Vec<f64> = common::response().iter().zip(&noise).map(|(y, e)| y + 0.1 * e).collect();
    let record = [RecordView { y: &y, u: vec![&u] }];
    for (name, method, band) in [
        ("awls, M = 6", Method::Awls, Band::Harmonics(6)),
        ("ml, M = 6", Method::Ml, Band::Harmonics(6)),
        ("ml, default band", Method::Ml, Band::Default),
    ] {
        let options = FitOptions {
            structure: Structure::new(2, vec![Some(0)]).unwrap(),
            delays: vec![0.0],
            intersample: vec![None].into(),
            rule: Rule::Gregory,
            method,
            noise: Noise::Output,
            trend: Trend::None,
            extended: true,
            band,
            own_levels: true,
            initial: Initial::Unknown,
            states: vec![],
            options: common::OPTIONS,
        };
        let make = || {
            Fitter::new(options.clone(), &[(INTERVALS + 1, Time::Even(dt))], Isa::detect().unwrap())
                .unwrap()
        };
        let fitter = make();
        group.bench_function(name, |b| b.iter(|| fitter.fit(black_box(&record)).unwrap()));
        group.bench_function(format!("{name}, prepared anew"), |b| {
            b.iter(|| make().fit(black_box(&record)).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, estimates, replicate, single);
criterion_main!(benches);
