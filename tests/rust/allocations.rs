//! Nothing is allocated inside a replicate: an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{ALL, DURATION, INTERVALS, METHODS, OPTIONS};
use modfun::Status;
use modfun::estimate::{Band, FitOptions, Initial, Start, Workspace, estimate};
use modfun::monte_carlo::{Contender, Draw, Group, Plan, Run, Told};
use modfun::quadrature::Rule;
use modfun::rng::{Purpose, fill};
use modfun::simd::{Isa, Wide};
use modfun::structure::{CovType, Noise, Structure, Trend};
use modfun::threads::Control;

struct Counting;

static COUNT: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code)]
// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: what the caller promises is what `System` asks for.
        unsafe { System.alloc(layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: what the caller promises is what `System` asks for.
        unsafe { System.realloc(at, layout, size) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: what the caller promises is what `System` asks for.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of a call, on all threads.
fn counted(call: impl FnOnce()) -> usize {
    let before = COUNT.load(Ordering::Relaxed);
    call();
    COUNT.load(Ordering::Relaxed) - before
}

/// Noise, sums and estimate with both covariances of eight replicates, one of them for orthogonal factors.
fn pieces() {
    let last = 14;
    let plan = common::plan(last);
    let clean = common::response();
    let block = common::block(1, 0, 0.0, last);
    for isa in Isa::available() {
        for method in METHODS {
            let d = common::design(2, 0, method, Trend::None, last, common::omega0());
            let mut w = Workspace::new(&d);
            common::load(&mut w, &d, &block);
            // An input that never moved in lane 3 leaves b0 undetermined: the pivots of that lane vanish.
            let (re, im) = w.signal_mut(0, 1);
            re.iter_mut().chain(im).for_each(|u| u.0[3] = 0.0);
            let mut samples = vec![Wide::ZERO; INTERVALS + 1];
            let (mut re, mut im) = (vec![Wide::ZERO; last + 1], vec![Wide::ZERO; last + 1]);
            let mut scratch = plan.scratch();
            let mut replicate = |first: u64| {
                fill(isa, 7, Purpose::NoiseY, 0, first, 0, &mut samples);
                for (y, clean) in samples.iter_mut().zip(&clean) {
                    y.0.iter_mut().for_each(|y| *y = clean + 0.1 * *y);
                }
                plan.run_lanes(isa, &samples, &mut re, &mut im, &mut scratch).unwrap();
                let (to_re, to_im) = w.signal_mut(0, 0);
                to_re.copy_from_slice(&re);
                to_im.copy_from_slice(&im);
                estimate(isa, &d, &mut w, ALL, Start::Wls, &OPTIONS)
            };
            replicate(0);
            let mut outcome = None;
            let count = counted(|| {
                for first in 1..5 {
                    outcome = Some(replicate(8 * first));
                }
            });
            assert_eq!(count, 0, "{isa:?} {method:?}: {count} allocations in four blocks");
            let status = outcome.unwrap().status;
            assert_ne!(
                status[3],
                Status::Ok,
                "{isa:?} {method:?}: lane 3 was to need the fallback"
            );
            assert_eq!(status[0], Status::Ok, "{isa:?} {method:?}");
        }
    }
}

fn plan(draw: Draw) -> Plan {
    let estimators = METHODS.map(|method| {
        let options = FitOptions {
            structure: Structure::new(2, vec![Some(0)]).unwrap(),
            delays: vec![0.0],
            intersample: vec![None].into(),
            rule: Rule::Trapezoid,
            method,
            noise: Noise::Output,
            trend: Trend::None,
            extended: true,
            band: Band::Harmonics(6),
            own_levels: true,
            initial: Initial::Unknown,
            states: vec![],
            options: OPTIONS,
        };
        Contender {
            options: Told::Plain(options),
            truth: vec![3.0, 8.0, 5.0],
            intervals: Some(CovType::Hc3),
        }
    });
    let dt = DURATION / INTERVALS as f64;
    let group = Group {
        group: 0,
        dt,
        y: vec![common::response()],
        u: vec![(0..=INTERVALS).map(|k| common::chirp(k as f64 * dt)).collect()],
        free: vec![vec![vec![0.1; INTERVALS + 1]]],
        sigma: vec![0.01, 0.1],
        scale: vec![1.0],
        estimators: estimators.into(),
    };
    Plan::new(&[group], draw, Isa::detect().unwrap()).unwrap()
}

/// A whole study: as many allocations for 8 replicates of a chunk as for all of them.
fn study() {
    for draw in [Draw::Samples, Draw::Coefficients] {
        let plan = plan(draw);
        let count = |replicates| {
            let run = Run { seed: 1, first: 0, replicates, samples: false };
            let quantiles = [vec![2.0; METHODS.len()]];
            let go = || plan.run(&run, &quantiles, 1, &mut |_, _| Control::Continue).unwrap();
            go();
            counted(|| drop(go()))
        };
        let (few, many) = (count(8), count(504));
        assert_eq!(
            few,
            many,
            "{draw:?}: 496 more replicates cost {} allocations",
            many as i64 - few as i64
        );
    }
}

/// Without a harness, since the count is that of the whole process.
fn main() {
    assert!(counted(|| drop(std::hint::black_box(vec![1_u8]))) > 0, "the allocator does not count");
    pieces();
    study();
}
