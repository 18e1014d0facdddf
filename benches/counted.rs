//! One of the programs, so many pieces of it, for `make counts` to count the instructions of: one thread, AVX2.
#![allow(missing_docs, clippy::unwrap_used, clippy::disallowed_methods)]

#[path = "programs.rs"]
mod programs;

use modfun::simd::Isa;
use programs::{ALL, Program};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, pieces] = arguments.as_slice() else {
        // What there is: name, pieces of a count, what a piece is.
        for Program { name, pieces, piece, .. } in &ALL {
            println!("{name}\t{pieces}\t{piece}");
        }
        return ExitCode::SUCCESS;
    };
    let program = ALL.iter().find(|p| p.name == name);
    let (Some(program), Ok(pieces)) = (program, pieces.parse()) else {
        eprintln!("usage: counted [PROGRAM PIECES]; without them: the programs there are");
        return ExitCode::FAILURE;
    };
    if !Isa::available().contains(&Isa::Avx2) {
        eprintln!("this processor, as valgrind shows it, has no AVX2");
        return ExitCode::from(2);
    }
    std::hint::black_box((program.make)(Isa::Avx2)(pieces));
    ExitCode::SUCCESS
}
