//! Time of the programs whose instructions `make counts` counts, by the same names, on the best instruction set.
#![allow(missing_docs, clippy::unwrap_used, clippy::disallowed_methods)]

#[path = "programs.rs"]
mod programs;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use modfun::simd::Isa;

fn fits(c: &mut Criterion) {
    let isa = Isa::detect().unwrap();
    let mut group = c.benchmark_group("fits");
    group.sample_size(10);
    for program in &programs::ALL {
        let mut work = (program.make)(isa);
        group.throughput(Throughput::Elements(program.pieces as u64));
        let id = BenchmarkId::new(program.name, program.piece);
        group.bench_function(id, |b| b.iter(|| work(program.pieces)));
    }
    group.finish();
}

criterion_group!(benches, fits);
criterion_main!(benches);
