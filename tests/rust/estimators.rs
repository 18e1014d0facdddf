//! Properties every estimator has, whatever the data: the same bits in any lane and on any instruction set,
//! no neighbour's influence, scale invariance, agreement with orthogonal factors.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{ALL, Block, METHODS, answers, block, design, omega0, thetas};
use modfun::Status;
use modfun::estimate::{Options, Start, Wanted, Workspace, estimate};
use modfun::simd::{Isa, LANES, Wide};
use modfun::structure::{Method, Trend};
use proptest::prelude::*;

/// What varies: method, orders, trend, band, noise.
#[derive(Debug, Clone)]
struct Case {
    method: Method,
    order: usize,
    zeros: usize,
    trend: Trend,
    last: usize,
    sigma: f64,
    seed: u64,
}

impl Case {
    fn block(&self) -> Block {
        block(self.seed, 0, self.sigma, self.last)
    }

    fn design(&self, omega0: f64) -> modfun::estimate::Design {
        design(self.order, self.zeros, self.method, self.trend, self.last, omega0)
    }
}

prop_compose! {
    fn cases()(
        method in 0_usize..4,
        (order, zeros) in (1_usize..5).prop_flat_map(|n| (Just(n), 0..n)),
        trend in 0_usize..3,
        last in 14_usize..40,
        sigma in 0.01_f64..0.4,
        seed in 0_u64..1000,
    ) -> Case {
        let trend = [Trend::None, Trend::Constant, Trend::Linear][trend];
        Case { method: METHODS[method], order, zeros, trend, last, sigma, seed }
    }
}

/// Every signal of a block through a function of (line, lanes).
fn each(block: &mut Block, change: impl Fn(&mut [f64; LANES])) {
    let parts = [&mut block.y.0, &mut block.y.1, &mut block.u.0, &mut block.u.1];
    parts.into_iter().flatten().for_each(|w| change(&mut w.0));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_instruction_set_gives_the_same_bits(case in cases()) {
        let (d, block) = (case.design(omega0()), case.block());
        let plain = answers(Isa::Plain, &d, &block, ALL);
        for isa in Isa::available() {
            prop_assert_eq!(&answers(isa, &d, &block, ALL), &plain, "{:?}", isa);
        }
    }

    #[test]
    fn a_lane_does_not_feel_its_place_nor_its_neighbours(case in cases(), shift in 1..LANES, bad in 0..LANES) {
        let (d, block) = (case.design(omega0()), case.block());
        let isa = Isa::detect().unwrap();
        let all = answers(isa, &d, &block, ALL);

        let mut turned = block.clone();
        each(&mut turned, |w| w.rotate_right(shift));
        let elsewhere = answers(isa, &d, &turned, ALL);
        for lane in 0..LANES {
            prop_assert_eq!(&elsewhere[(lane + shift) % LANES], &all[lane], "from lane {}", lane);
        }

        let mut spoiled = block.clone();
        spoiled.y.0[3].0[bad] = f64::NAN;
        let beside = answers(isa, &d, &spoiled, ALL);
        for lane in (0..LANES).filter(|lane| *lane != bad) {
            prop_assert_eq!(&beside[lane], &all[lane], "lane {} beside NaN in {}", lane, bad);
        }
        let (_, outcome) = thetas(&d, &spoiled);
        prop_assert_eq!(outcome.status[bad], Status::NonFinite);

        let alone = answers(isa, &d, &block, std::array::from_fn(|lane| lane == bad));
        prop_assert_eq!(&alone[bad], &all[bad], "lane {} alone", bad);
    }

    /// Units that differ by powers of two change no bit of a, and b by exactly that power.
    #[test]
    fn units_do_not_matter(case in cases(), volts in -30_i32..30, ticks in -30_i32..30) {
        let two = |k: i32| if k < 0 { 1.0 / (1_u64 << -k) as f64 } else { (1_u64 << k) as f64 };
        let (gain, rate) = (two(volts), two(ticks));
        let block = case.block();
        let mut scaled = block.clone();
        for w in scaled.y.0.iter_mut().chain(&mut scaled.y.1) {
            *w = Wide(w.0.map(|y| y * gain));
        }
        let (d, other) = (case.design(omega0()), case.design(omega0() * rate));
        let (theta, outcome) = thetas(&d, &block);
        let (theirs, their_outcome) = thetas(&other, &scaled);
        prop_assert_eq!(outcome, their_outcome);
        let power = |k: usize| (0..k).fold(1.0, |p, _| p * rate);
        for lane in (0..LANES).filter(|lane| outcome.status[*lane] == Status::Ok) {
            for (k, (a, b)) in theta[lane].iter().zip(&theirs[lane]).enumerate() {
                let n = case.order;
                let factor = if k < n {
                    power(k + 1)
                } else {
                    // b of s^j beside the leading sⁿ.
                    gain * power(n - (case.zeros - (k - n)))
                };
                prop_assert_eq!(a * factor, *b, "parameter {} of lane {}", k, lane);
            }
        }
    }
}

/// Least squares by orthogonal projections (Gram–Schmidt, twice), columns then right side.
fn least_squares(mut columns: Vec<Vec<f64>>, unknowns: usize) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut r = vec![vec![0.0; unknowns + 1]; unknowns];
    for j in 0..=unknowns {
        for _ in 0..2 {
            for i in 0..j {
                let c = dot(&columns[i], &columns[j]);
                r[i][j] += c;
                let base = columns[i].clone();
                columns[j].iter_mut().zip(base).for_each(|(x, q)| *x -= c * q);
            }
        }
        if j < unknowns {
            r[j][j] = dot(&columns[j], &columns[j]).sqrt();
            let norm = r[j][j];
            columns[j].iter_mut().for_each(|x| *x /= norm);
        }
    }
    let mut x = vec![0.0; unknowns];
    for i in (0..unknowns).rev() {
        let known: f64 = (i + 1..unknowns).map(|j| r[i][j] * x[j]).sum();
        x[i] = (r[i][unknowns] - known) / r[i][i];
    }
    x
}

/// θ of `wls` on one lane, rows written out: Y sⁿ + Σ a Y s^… − Σ b U s^… − T = 0 on lines 0..=last.
fn wls_rows(block: &Block, lane: usize, order: usize, zeros: usize, last: usize) -> Vec<f64> {
    let edge = last as f64;
    let rows: Vec<(usize, bool)> =
        (0..=last).flat_map(|m| [(m, false), (m, true)]).filter(|row| *row != (0, true)).collect();
    let column = |v: Option<&(Vec<Wide>, Vec<Wide>)>, power: usize, sign: f64| -> Vec<f64> {
        let value = |&(m, imaginary): &(usize, bool)| {
            let mut z = v.map_or((1.0, 0.0), |(re, im)| (re[m].0[lane], im[m].0[lane]));
            for _ in 0..power {
                z = (-z.1 * m as f64 / edge, z.0 * m as f64 / edge);
            }
            let weight = if m == 0 { 1.0 } else { std::f64::consts::SQRT_2 };
            sign * weight * if imaginary { z.1 } else { z.0 }
        };
        rows.iter().map(value).collect()
    };
    let mut columns: Vec<_> = (0..order).map(|k| column(None, k, -1.0)).collect();
    columns.extend((0..order).rev().map(|k| column(Some(&block.y), k, 1.0)));
    columns.extend((0..=zeros).rev().map(|k| column(Some(&block.u), k, -1.0)));
    columns.push(column(Some(&block.y), order, -1.0));
    let unknowns = columns.len() - 1;
    // The coefficient of s^k in units of the band edge, in the user's: times edge^(n − k).
    let powers = (0..order).rev().chain((0..=zeros).rev());
    let unit = |k: usize| (k..order).fold(1.0, |p, _| p * edge * omega0());
    least_squares(columns, unknowns)[order..].iter().zip(powers).map(|(x, k)| x * unit(k)).collect()
}

/// Normal equations where they are sound, orthogonal factors where not: the same answer from order 1 to 8.
#[test]
fn both_paths_agree_with_orthogonal_factors() {
    let last = 40;
    for sigma in [0.2, 1e-3, 1e-6] {
        let block = block(5, 0, sigma, last);
        for order in 1..=8 {
            let zeros = order - 1;
            // Above 6 the columns' own condition leaves fewer digits to either path.
            let tolerance = if order <= 6 { 1e-6 } else { 1e-4 };
            let d = design(order, zeros, Method::Wls, Trend::None, last, omega0());
            let (theta, outcome) = thetas(&d, &block);
            assert_eq!(outcome.status, [Status::Ok; LANES], "sigma {sigma}, order {order}");
            for (lane, theta) in theta.iter().enumerate() {
                let want = wls_rows(&block, lane, order, zeros, last);
                for (k, (a, b)) in theta.iter().zip(&want).enumerate() {
                    let size =
                        b.abs().max(1e-3 * want.iter().fold(0.0, |m: f64, x| m.max(x.abs())));
                    let error = (a - b).abs() / size;
                    assert!(
                        error < tolerance,
                        "sigma {sigma}, order {order}, lane {lane}, parameter {k}: {a} {b}"
                    );
                }
            }
        }
    }
}

/// Records on which whole steps of `ml` go round in circles or off: halved steps settle. They start from the lane's
/// `wls` estimate as it is given, so that there is no second start.
#[test]
fn halved_steps_settle_where_whole_ones_do_not() {
    let options = Options { tol: 1e-9, maxiter: 100, wanted: Wanted::Cost };
    for (order, zeros, last, sigma, seed, lane) in [
        (1, 0, 16, 0.6, 3, 0),
        (2, 1, 24, 2.0, 1, 7),
        (2, 1, 40, 0.6, 2, 5),
        (3, 0, 12, 0.6, 3, 0),
        (3, 2, 60, 2.0, 2, 6),
        (4, 3, 16, 1.0, 0, 5),
    ] {
        let records = block(seed, 0, sigma, last);
        let flat = design(order, zeros, Method::Wls, Trend::None, last, omega0());
        let start = &thetas(&flat, &records).0[lane];
        let d = design(order, zeros, Method::Ml, Trend::None, last, omega0());
        let mut w = Workspace::new(&d);
        common::load(&mut w, &d, &records);
        let isa = Isa::detect().unwrap();
        let found = estimate(isa, &d, &mut w, ALL, Start::Theta(start), &options);
        let nit = found.nit[lane];
        assert_eq!(found.status[lane], Status::Ok, "order {order}, M + n = {last}: {nit} steps");
        assert!(nit > 12, "order {order}, M + n = {last}: no step was halved in {nit}");
    }
}

/// Of several starts a lane each ends where it would from that start alone, to the bit.
#[test]
fn starts_in_lanes_are_starts_alone() {
    let isa = Isa::detect().unwrap();
    let options = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };
    for (order, zeros, method, trend) in [
        (2, 0, Method::Ml, Trend::None),
        (2, 1, Method::Awls, Trend::Constant),
        (4, 2, Method::Ml, Trend::Constant),
    ] {
        let d = design(order, zeros, method, trend, 60, omega0());
        let of = block(5, 0, 0.2, 60);
        let same = |(re, im): &(Vec<Wide>, Vec<Wide>)| {
            let first = |all: &[Wide]| all.iter().map(|x| Wide::splat(x.0[0])).collect();
            (first(re), first(im))
        };
        let one = Block { y: same(&of.y), u: same(&of.u) };
        let found = |start: Start<'_>, live: [bool; LANES]| {
            let mut w = Workspace::new(&d);
            common::load(&mut w, &d, &one);
            let outcome = estimate(isa, &d, &mut w, live, start, &options);
            let theta: Vec<f64> = w.theta(&d, 0).collect();
            (theta, (0..LANES).map(|k| common::bits(&d, &w, &outcome, k)).collect::<Vec<_>>())
        };
        let first = std::array::from_fn(|lane| lane == 0);
        let (theta, alone) = found(Start::Wls, first);
        let starts: Vec<Vec<f64>> =
            [1.1, 0.8].iter().map(|by| theta.iter().map(|t| t * by).collect()).collect();
        let (_, together) =
            found(Start::Each(&starts), std::array::from_fn(|lane| lane <= starts.len()));
        assert_eq!(together[0], alone[0], "{order} poles, {method:?}");
        for (k, start) in starts.iter().enumerate() {
            let (_, own) = found(Start::Theta(start), first);
            assert_eq!(together[k + 1], own[0], "{order} poles, {method:?}, start {k}");
        }
    }
}
