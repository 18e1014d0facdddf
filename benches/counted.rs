//! A study of so many replicates, for `make counts` to count the instructions of: one thread, AVX2.
//!
//! The setting of the report's eq. (24): M = 6, N = 256, trapezoid, five reweightings, a noise-to-signal
//! ratio of .2.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/rust/common/mod.rs"]
mod common;

use common::{DURATION, INTERVALS};
use modfun::estimate::{Band, FitOptions, Options, Wanted};
use modfun::monte_carlo::{Contender, Draw, Group, Intervals, Plan, Run, Told};
use modfun::quadrature::Rule;
use modfun::simd::Isa;
use modfun::structure::{Method, Noise, Structure, Trend};
use modfun::threads::Control;
use std::process::ExitCode;

fn main() -> ExitCode {
    let argument = std::env::args().nth(1).and_then(|text| text.parse().ok());
    let Some(replicates) = argument else {
        eprintln!("usage: counted REPLICATES");
        return ExitCode::FAILURE;
    };
    if !Isa::available().contains(&Isa::Avx2) {
        eprintln!("this processor, as valgrind shows it, has no AVX2");
        return ExitCode::from(2);
    }
    let dt = DURATION / INTERVALS as f64;
    let y = common::response();
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64).sqrt();
    let options = FitOptions {
        structure: Structure::new(2, vec![Some(0)]).unwrap(),
        delays: vec![0.0],
        intersample: vec![None],
        rule: Rule::Trapezoid,
        method: Method::Awls,
        noise: Noise::Output,
        trend: Trend::None,
        extended: true,
        band: Band::Harmonics(6),
        options: Options { tol: 0.0, maxiter: 5, wanted: Wanted::Theta },
    };
    let group = Group {
        group: 0,
        dt,
        y: vec![y],
        u: vec![(0..=INTERVALS).map(|k| common::chirp(k as f64 * dt)).collect()],
        free: Vec::new(),
        sigma: vec![0.2 * rms],
        scale: vec![1.0],
        estimators: vec![Contender {
            options: Told::Plain(options),
            truth: vec![3.0, 8.0, 5.0],
            intervals: Intervals::None,
        }],
    };
    let plan = Plan::new(&[group], Draw::Samples, Isa::Avx2).unwrap();
    let run = Run { seed: 1, first: 0, replicates, samples: false };
    let cells = plan.run(&run, &[vec![2.0]], 1, &mut |_, _| Control::Continue).unwrap();
    println!("{replicates} replicates, {} iterations", cells[0][0].iterations);
    ExitCode::SUCCESS
}
