//! Time of the random streams: 257 normals for each of eight replicates, per instruction set.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use modfun::rng::{Purpose, fill};
use modfun::simd::{Isa, LANES, Wide};

fn normals(c: &mut Criterion) {
    let mut group = c.benchmark_group("normals 257");
    for isa in Isa::available() {
        // Elements are replicates, so that the inverse throughput is the time of one.
        group.throughput(Throughput::Elements(LANES as u64));
        let mut out = vec![Wide::ZERO; 257];
        let mut first = 0;
        group.bench_function(format!("{isa:?}"), |b| {
            b.iter(|| {
                fill(isa, 24, Purpose::NoiseY, 0, first, 0, black_box(&mut out));
                first += LANES as u64;
            });
        });
    }
    group.finish();
}

criterion_group!(benches, normals);
criterion_main!(benches);
