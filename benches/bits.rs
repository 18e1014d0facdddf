//! What random streams, Fourier coefficients and the programs of programs.rs find, bit by bit, to be compared
//! between processors. One thread, so that it runs under emulators too.
//!
//! A line is: exact or close, name, place, bits, number. What is exact has the same bits on every processor; what
//! is close goes through an FFT or faer, whose kernels are the processor's.
#![allow(missing_docs, clippy::unwrap_used, clippy::disallowed_methods)]

#[path = "programs.rs"]
mod programs;

use modfun::quadrature::{Hold, Rule};
use modfun::rng::{Address, Purpose, rows};
use modfun::simd::Isa;
use modfun::spectrum::{CoefficientPlan, Kind};

fn say(exact: bool, name: &str, numbers: &[f64]) {
    let kind = if exact { "exact" } else { "close" };
    for (place, x) in numbers.iter().enumerate() {
        // Which NaN it is differs by processor and means nothing.
        let bits = if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
        println!("{kind}\t{name}\t{place}\t{bits:016x}\t{x:e}");
    }
}

fn main() {
    let isa = Isa::detect().unwrap();
    let at = |channel, replicate| Address {
        seed: 24,
        purpose: Purpose::NoiseY,
        channel,
        replicate,
        group: 0,
    };
    let length = 257;
    let mut normals = vec![0.0; 12 * length];
    rows(isa, at(0, 3), length, &mut normals);
    say(true, "normals", &normals);
    let plans = [
        ("coefficients", 60, Kind::Rule(Rule::Gregory)),
        ("coefficients, held", 20, Kind::Hold(Hold::Zoh)),
        ("coefficients, FFT", 100, Kind::Rule(Rule::Gregory)),
    ];
    for (name, harmonics, kind) in plans {
        let plan = CoefficientPlan::new(length - 1, harmonics, kind, 0.0, 0).unwrap();
        let (mut re, mut im) = (vec![0.0; harmonics + 1], vec![0.0; harmonics + 1]);
        plan.run(&normals[..length], &mut re, &mut im).unwrap();
        say(harmonics <= 64, name, &[re, im].concat());
    }
    for program in &programs::ALL {
        say(program.exact, program.name, &(program.make)(isa)(program.pieces.min(16)));
    }
}
