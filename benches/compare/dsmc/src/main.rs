//! The crate dsmc's SRIVC on given records, timed in rounds, for the comparison with modfun.
//!
//! The file named on the command line holds little-endian doubles: samples a record, records, sampling
//! interval, cutoff of the first filter in rad/s, the input, the records one after the other. For each
//! line "iterations tolerance" on standard input all records are estimated; the answer is a line with
//! nanoseconds a record, failures, and the means of a1, a2 and b0.

use dsmc::system_identification::iv::srivc::{Initialization, InterSample, SrivcOptions, identify};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: dsmc-rival FILE")?;
    let bytes = std::fs::read(path)?;
    let values: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
        .collect();
    let (samples, records) = (values[0] as usize, values[1] as usize);
    let (dt, cutoff) = (values[2], values[3]);
    let (u, y) = values[4..].split_at(samples);
    for line in std::io::stdin().lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let mut next = || words.next().ok_or("two numbers a line");
        let options = SrivcOptions {
            input_intersample: InterSample::FirstOrderHold,
            max_iterations: next()?.parse()?,
            tolerance: next()?.parse()?,
            ..SrivcOptions::default()
        };
        let start = Initialization::StateVariableFilter(cutoff);
        let (mut sums, mut failures) = ([0.0; 3], 0);
        let clock = Instant::now();
        for record in y.chunks_exact(samples) {
            match identify(u, record, dt, 2, 0, &start, &options) {
                Ok(found) => {
                    for (sum, value) in sums.iter_mut().zip(found.parameter.iter()) {
                        *sum += value;
                    }
                }
                Err(_) => failures += 1,
            }
        }
        let each = clock.elapsed().as_nanos() as f64 / records as f64;
        let good = f64::from((records - failures) as u32);
        println!("{each} {failures} {} {} {}", sums[0] / good, sums[1] / good, sums[2] / good);
    }
    Ok(())
}
