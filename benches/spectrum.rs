//! Time of the few-harmonic sums against their size and against the FFT.

#![allow(clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use modfun::quadrature::{Hold, Rule};
use modfun::simd::{Isa, LANES, Wide};
use modfun::spectrum::{CoefficientPlan, Kind};
use std::hint::black_box;

/// Eight records at once: 257 samples and 9 harmonics are the setting of the report's eq. (24).
fn lanes(c: &mut Criterion) {
    let mut group = c.benchmark_group("sums of eight records");
    group.throughput(Throughput::Elements(LANES as u64));
    for (intervals, harmonics) in [(256, 8), (256, 31), (255, 8), (1024, 22)] {
        for isa in Isa::available().into_iter().filter(|isa| matches!(isa, Isa::Avx512 | Isa::Avx2))
        {
            for rule in [Rule::Trapezoid, Rule::Gregory, Rule::Parabolic] {
                let Ok(plan) = CoefficientPlan::new(intervals, harmonics, Kind::Rule(rule), 0.0, 0)
                else {
                    continue;
                };
                let samples: Vec<_> = (0..=intervals)
                    .map(|k| Wide(std::array::from_fn(|i| ((k * (i + 3)) % 17) as f64)))
                    .collect();
                let (mut re, mut im) =
                    (vec![Wide::ZERO; harmonics + 1], vec![Wide::ZERO; harmonics + 1]);
                let mut scratch = plan.scratch();
                let name = BenchmarkId::new(
                    format!("{isa:?} {}", rule.name()),
                    format!("{intervals}x{harmonics}"),
                );
                group.bench_function(name, |b| {
                    b.iter(|| {
                        plan.run_lanes(isa, black_box(&samples), &mut re, &mut im, &mut scratch)
                    });
                });
            }
        }
    }
    group.finish();
}

/// One record: folded sums up to 64 harmonics, the FFT above.
fn single(c: &mut Criterion) {
    let mut group = c.benchmark_group("one record");
    for (intervals, harmonics) in [
        (256, 8),
        (256, 32),
        (256, 64),
        (256, 65),
        (1009, 65),
        (4096, 32),
        (1 << 18, 32),
        (1 << 22, 32),
    ] {
        let Ok(plan) =
            CoefficientPlan::new(intervals, harmonics, Kind::Rule(Rule::Gregory), 0.0, 0)
        else {
            continue;
        };
        let samples: Vec<_> = (0..=intervals).map(|k| (k % 17) as f64).collect();
        let (mut re, mut im) = (vec![0.0; harmonics + 1], vec![0.0; harmonics + 1]);
        let mut scratch = plan.scratch();
        group.bench_function(format!("{intervals}x{harmonics}"), |b| {
            b.iter(|| {
                plan.run_in(
                    Isa::detect().unwrap(),
                    black_box(&samples),
                    &mut re,
                    &mut im,
                    &mut scratch,
                )
            });
        });
    }
    group.finish();
}

/// What a record costs before its first coefficient.
fn plans(c: &mut Criterion) {
    let mut group = c.benchmark_group("plan");
    for (intervals, harmonics) in [(256, 8), (256, 32), (4096, 32), (1 << 22, 32)] {
        for kind in [Kind::Rule(Rule::Gregory), Kind::Hold(Hold::Zoh)] {
            let name = format!("{intervals}x{harmonics} {}", kind.name());
            group.bench_function(name, |b| {
                b.iter(|| CoefficientPlan::new(black_box(intervals), harmonics, kind, 0.0, 0));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, lanes, single, plans);
criterion_main!(benches);
