//! The crate dsmc's SRIVC on given records, timed in rounds, for the comparison with modfun.
//!
//! The file named on the command line holds little-endian doubles: samples a record, records, sampling
//! interval, cutoff of the first filter in rad/s, poles, zeros, 1 for an input held between samples (0: linear),
//! the first sample of the sums, the input, the records one after the other. For each line "iterations
//! tolerance" on standard input all records are estimated; the answer is nanoseconds a record, then a1, …, an,
//! b0, …, bm of each record, NaN where it was not found or did not converge.

use dsmc::system_identification::iv::srivc::{Initialization, InterSample, SrivcOptions, identify};
use std::error::Error;
use std::time::Instant;

const HEAD: usize = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: dsmc-rival FILE")?;
    let bytes = std::fs::read(path)?;
    let values: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    let (samples, records) = (values[0] as usize, values[1] as usize);
    let (dt, cutoff) = (values[2], values[3]);
    let (poles, zeros) = (values[4] as usize, values[5] as usize);
    let hold = if values[6] == 1.0 { InterSample::ZeroOrderHold } else { InterSample::FirstOrderHold };
    let (u, y) = values[HEAD..].split_at(samples);
    for line in std::io::stdin().lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let mut next = || words.next().ok_or("two numbers a line");
        let options = SrivcOptions {
            input_intersample: hold,
            max_iterations: next()?.parse()?,
            tolerance: next()?.parse()?,
            evaluated_from: values[7] as usize,
            ..SrivcOptions::default()
        };
        let start = Initialization::StateVariableFilter(cutoff);
        let mut found = Vec::with_capacity(records);
        let clock = Instant::now();
        for record in y.chunks_exact(samples) {
            found.push(identify(u, record, dt, poles, zeros, &start, &options));
        }
        print!("{}", clock.elapsed().as_nanos() as f64 / records as f64);
        for each in found {
            match each {
                Ok(result) if result.converged => {
                    result.parameter.iter().for_each(|value| print!(" {value}"));
                }
                _ => (0..=poles + zeros).for_each(|_| print!(" NaN")),
            }
        }
        println!();
    }
    Ok(())
}
