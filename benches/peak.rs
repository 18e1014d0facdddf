//! Multiply-adds the processor can do: the limit that docs/performance.md sets times beside.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use modfun::simd::{Isa, Kernel, LANES, Lanes, Wide};
use std::hint::black_box;

/// Independent chains, as many as registers hold on AVX2; each so long.
const CHAINS: usize = 6;
const LENGTH: usize = 1000;

struct Chains<'a>(&'a [Wide; CHAINS], &'a mut [Wide; CHAINS]);

impl Kernel for Chains<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let mut sums = [L::splat(0.0); CHAINS];
        let (x, y) = (L::load(&self.0[0]), L::load(&self.0[1]));
        for _ in 0..LENGTH {
            for sum in &mut sums {
                *sum = sum.mul_add(x, y);
            }
        }
        for (sum, to) in sums.into_iter().zip(&mut *self.1) {
            sum.store(to);
        }
    }
}

fn peak(c: &mut Criterion) {
    let mut group = c.benchmark_group("multiply-adds");
    group.throughput(Throughput::Elements((LENGTH * CHAINS * LANES) as u64));
    for isa in Isa::available().into_iter().filter(|isa| *isa != Isa::Plain) {
        let (from, mut to) = ([Wide::splat(0.5); CHAINS], [Wide::ZERO; CHAINS]);
        group.bench_function(format!("{isa:?}"), |b| {
            b.iter(|| isa.run(Chains(black_box(&from), &mut to)));
        });
    }
    group.finish();
}

criterion_group!(benches, peak);
criterion_main!(benches);
