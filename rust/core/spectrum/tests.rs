//! Tests of the coefficients: every fast path against the naive sum, held signals against integrals.

use super::*;
use crate::math::root_of_unity;
use crate::quadrature::gauss_legendre;
use proptest::prelude::*;

/// Numbers that look random, without a generator.
fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    (0..count).map(|_| next()).collect()
}

fn run(plan: &CoefficientPlan, samples: &[f64]) -> Vec<(f64, f64)> {
    let (mut re, mut im) =
        (vec![f64::NAN; plan.harmonics() + 1], vec![f64::NAN; plan.harmonics() + 1]);
    plan.run(samples, &mut re, &mut im).unwrap();
    re.into_iter().zip(im).collect()
}

/// (1/N) Σ w_k v_k e^{−2πimk/N} as it is written.
fn naive(rule: Rule, v: &[f64], harmonics: usize) -> Vec<(f64, f64)> {
    let n = v.len() - 1;
    let w = rule.weights(n).unwrap();
    let term = |m: usize| {
        (0..=n).fold((0.0, 0.0), |sum, k| {
            let (cos, sin) = root_of_unity((m * k) as u64, n as u64);
            (sum.0 + w[k] * v[k] * cos, sum.1 - w[k] * v[k] * sin)
        })
    };
    (0..=harmonics).map(term).map(|(a, b)| (a / n as f64, b / n as f64)).collect()
}

/// (1/T) ∫₀^T v e^{−imω₀t} dt with T = N, by Gauss cells between all integers and all integers + `kink`.
fn integral(n: usize, m: usize, kink: f64, v: impl Fn(f64) -> f64) -> (f64, f64) {
    let (nodes, weights) = gauss_legendre::<6>();
    let mut sum = (0.0, 0.0);
    // Quarters, so that six nodes are exact at the highest harmonic, too.
    for (k, quarter) in (0..4 * n).map(|i| (i / 4, i % 4)) {
        let part = |low: f64, high: f64, q: usize| low + (high - low) * q as f64 / 4.0;
        let (start, middle, end) = (k as f64, k as f64 + kink, k as f64 + 1.0);
        for (low, high) in [(start, middle), (middle, end)] {
            let (low, high) = (part(low, high, quarter), part(low, high, quarter + 1));
            for (node, weight) in nodes.iter().zip(&weights) {
                let x = low + (high - low) * node;
                let (sin, cos) = sin_cos_turns_1(-(m as f64) * x / n as f64);
                let by = weight * (high - low) * v(x) / n as f64;
                sum = (sum.0 + by * cos, sum.1 + by * sin);
            }
        }
    }
    sum
}

fn far(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a.0 - b.0).abs().max((a.1 - b.1).abs())).fold(0.0, f64::max)
}

#[test]
fn long_records_in_blocks_equal_the_fft() {
    // 20,011 is prime; 16,384 and 16,390 turn blocks of both parities; 70 harmonics take the FFT.
    for n in [16_384, 16_390, 20_011] {
        let v = noise(n + 1, 5);
        let blocks =
            run(&CoefficientPlan::new(n, 64, Kind::Rule(Rule::Gregory), 0.0, 0).unwrap(), &v);
        let fft = run(&CoefficientPlan::new(n, 70, Kind::Rule(Rule::Gregory), 0.0, 0).unwrap(), &v);
        assert!(far(&blocks, &fft[..65]) < 1e-16, "{n} {}", far(&blocks, &fft[..65]));
    }
}

#[test]
fn long_records_are_exact_to_rounding() {
    // Terms added with their rounding errors: what is left is the rounding of each term alone.
    let exact = |v: &[f64], m: usize| {
        let n = v.len() - 1;
        let weights = Weights::new(Rule::Gregory, n).unwrap();
        let mut sums = [(0.0, 0.0); 2];
        for (k, v) in v.iter().enumerate() {
            let (cos, sin) = root_of_unity((m * k) as u64, n as u64);
            for (sum, by) in sums.iter_mut().zip([cos, -sin]) {
                let term = weights.at(k) * v * by;
                let total = sum.0 + term;
                let back = total - sum.0;
                *sum = (total, sum.1 + ((sum.0 - (total - back)) + (term - back)));
            }
        }
        (sums[0].0 / n as f64 + sums[0].1 / n as f64, sums[1].0 / n as f64 + sums[1].1 / n as f64)
    };
    for n in [1 << 20, (1 << 20) + 2, (1 << 20) - 1] {
        let ramp = |(k, v): (usize, f64)| v + 3.0 * (k as f64 / n as f64);
        let v: Vec<f64> = noise(n + 1, 8).into_iter().enumerate().map(ramp).collect();
        let got = run(&CoefficientPlan::new(n, 32, Kind::Rule(Rule::Gregory), 0.0, 0).unwrap(), &v);
        for m in [0, 1, 16, 32] {
            let error = far(&got[m..=m], &[exact(&v, m)]);
            assert!(error < 1e-14, "{n} {m} {error:e}");
        }
    }
}

#[test]
fn every_lane_and_instruction_set_gives_the_bits_of_the_single_record() {
    for (n, lead, delay, top) in [
        (256, 0, 0.0, 11),
        (37, 4, 2.0, 11),
        (12_000, 0, 0.0, 40),
        (12_002, 0, 0.0, 21),
        (5001, 2, 1.0, 20),
        (90, 3, 1.3, 44),
        (130, 0, 0.0, 64),
    ] {
        for kind in Kind::ALL {
            let Ok(plan) = CoefficientPlan::new(n, top, kind, delay, lead) else { continue };
            let mut records: Vec<_> =
                (0..LANES).map(|lane| noise(plan.samples(), lane as u64 + 1)).collect();
            // Two of them about a large offset.
            records.iter_mut().take(2).flatten().for_each(|v| *v -= 1e3);
            let wide: Vec<Wide> = (0..plan.samples())
                .map(|k| Wide(std::array::from_fn(|lane| records[lane][k])))
                .collect();
            for isa in Isa::available() {
                let (mut re, mut im) = (vec![Wide::ZERO; top + 1], vec![Wide::ZERO; top + 1]);
                plan.run_lanes(isa, &wide, &mut re, &mut im, &mut plan.scratch()).unwrap();
                for (lane, record) in records.iter().enumerate() {
                    let (mut a, mut b) = (vec![f64::NAN; top + 1], vec![f64::NAN; top + 1]);
                    plan.run_in(isa, record, &mut a, &mut b, &mut plan.scratch()).unwrap();
                    for m in 0..=top {
                        assert_eq!(
                            (a[m].to_bits(), b[m].to_bits()),
                            (re[m].0[lane].to_bits(), im[m].0[lane].to_bits()),
                            "{isa:?} {kind:?} {n} harmonic {m}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn a_nan_stays_in_its_lane_and_the_slow_paths_serve_lanes() {
    for harmonics in [9, 80] {
        let plan = CoefficientPlan::new(200, harmonics, Kind::Hold(Hold::Foh), 0.5, 1).unwrap();
        let record = noise(plan.samples(), 3);
        let mut wide: Vec<Wide> = record.iter().map(|x| Wide::splat(*x)).collect();
        wide[7].0[2] = f64::NAN;
        let (mut re, mut im) = (vec![Wide::ZERO; harmonics + 1], vec![Wide::ZERO; harmonics + 1]);
        plan.run_lanes(Isa::detect().unwrap(), &wide, &mut re, &mut im, &mut plan.scratch())
            .unwrap();
        for (m, (a, b)) in run(&plan, &record).into_iter().enumerate() {
            assert!(re[m].0[2].is_nan());
            assert_eq!((a, b), (re[m].0[5], im[m].0[5]));
        }
    }
}

#[test]
fn an_offset_reaches_no_other_line() {
    let times: Vec<f64> = (0..=204).map(|k| f64::from(k) + 0.3 * f64::from(k % 3)).collect();
    for (kind, delay) in Kind::ALL.into_iter().flat_map(|kind| [(kind, 0.0), (kind, 2.4)]) {
        for harmonics in [20, 80] {
            let uneven = CoefficientPlan::uneven(&times, harmonics, kind);
            let even = CoefficientPlan::new(200, harmonics, kind, delay, 3);
            for plan in [even.unwrap(), uneven.unwrap()] {
                let moved: Vec<f64> = noise(plan.samples(), 3).iter().map(|v| v + 4e9).collect();
                let level = offset(moved.len(), |k| moved[k]);
                assert!((level - 4e9).abs() < 1.0);
                let about: Vec<f64> = moved.iter().map(|v| v - level).collect();
                let (alone, moved) = (run(&plan, &about), run(&plan, &moved));
                assert_eq!(alone[0].0 + level, moved[0].0);
                assert_eq!(alone[1..], moved[1..], "{kind:?} {delay}");
            }
        }
    }
}

#[test]
fn unit_variance_is_the_sum_of_squared_weights() {
    let plan = CoefficientPlan::new(300, 5, Kind::Rule(Rule::Parabolic), 0.0, 0).unwrap();
    assert!((plan.unit_variance() * 300.0 - 10.0 / 9.0).abs() < 2e-3);
    let t: Vec<f64> = (0..=300).map(|k| 0.1 * f64::from(k)).collect();
    let uneven = CoefficientPlan::uneven(&t, 5, Kind::Rule(Rule::Parabolic)).unwrap();
    assert!((uneven.unit_variance() / plan.unit_variance() - 1.0).abs() < 1e-12);
}

#[test]
fn bad_plans_and_lengths_are_refused_with_numbers() {
    let new = |n, m, delay, lead| {
        CoefficientPlan::new(n, m, Kind::Rule(Rule::Gregory), delay, lead).err()
    };
    assert!(
        matches!(new(64, 33, 0.0, 0), Some(Error::Spec(m)) if m.contains("33") && m.contains("up to 32"))
    );
    assert!(matches!(new(64, 8, 2.5, 2), Some(Error::Spec(m)) if m.contains("2.5")));
    assert!(matches!(new(64, 8, -1.0, 2), Some(Error::Spec(_))));
    assert!(matches!(new(64, 8, f64::NAN, 2), Some(Error::Spec(_))));
    assert!(matches!(new(2, 1, 0.0, 0), Some(Error::Data(m)) if m.contains("has 3")));
    assert!(matches!(new(3, 1, 0.5, 1), Some(Error::Data(m)) if m.contains("has 5")));
    assert!(matches!(Kind::from_name("spline"), Err(Error::Spec(m)) if m.contains("gregory")));
    assert_eq!(Kind::from_name("foh"), Ok(Kind::Hold(Hold::Foh)));
    let plan = CoefficientPlan::new(64, 8, Kind::Rule(Rule::Gregory), 0.0, 3).unwrap();
    let (mut re, mut im) = (vec![0.0; 9], vec![0.0; 9]);
    assert!(
        matches!(plan.run(&[0.0; 65], &mut re, &mut im), Err(Error::Data(m)) if m.contains("68 samples, got 65"))
    );
    assert!(matches!(plan.run(&[0.0; 68], &mut re[..8], &mut im), Err(Error::Data(_))));
}

#[test]
fn interpolation_at_a_fraction_is_exact_for_quintics() {
    let n = 40;
    let v = |x: f64| {
        let s = x / 20.0 - 1.0;
        1.0 + s * (2.0 + s * (-1.0 + s * (0.5 + s * (3.0 - s))))
    };
    for (delay, lead) in [(0.25, 1), (0.25, 5), (3.7, 4)] {
        let plan = CoefficientPlan::new(n, 9, Kind::Rule(Rule::Trapezoid), delay, lead).unwrap();
        let record: Vec<f64> = (0..plan.samples()).map(|k| v(k as f64 - lead as f64)).collect();
        let shifted: Vec<f64> = (0..=n).map(|k| v(k as f64 - delay)).collect();
        assert!(far(&run(&plan, &record), &naive(Rule::Trapezoid, &shifted, 9)) < 1e-14);
    }
}

proptest! {
    #[test]
    fn folded_sums_equal_the_naive_sum(n in 1usize..700, top in 0usize..65, pick in 0usize..4, seed in 1u64..99) {
        let rule = Rule::ALL[pick];
        let harmonics = top.min(n / 2);
        if let Ok(plan) = CoefficientPlan::new(n, harmonics, Kind::Rule(rule), 0.0, 0) {
            let v = noise(n + 1, seed);
            prop_assert!(far(&run(&plan, &v), &naive(rule, &v, harmonics)) < 3e-16 * (1.0 + (n as f64).sqrt()));
        }
    }

    #[test]
    fn the_fft_equals_the_naive_sum(n in 130usize..400, pick in 0usize..4, seed in 1u64..99) {
        let rule = Rule::ALL[pick];
        if let Ok(plan) = CoefficientPlan::new(n, n / 2, Kind::Rule(rule), 0.0, 0) {
            let v = noise(n + 1, seed);
            prop_assert!(far(&run(&plan, &v), &naive(rule, &v, n / 2)) < 1e-15);
        }
    }

    #[test]
    fn a_whole_delay_is_a_shift(n in 8usize..80, delay in 0usize..6, more in 0usize..4, pick in 0usize..6) {
        let kind = Kind::ALL[pick];
        let lead = delay + more;
        let v = noise(lead + n + 1, 9);
        let harmonics = n / 3;
        if let Ok(plan) = CoefficientPlan::new(n, harmonics, kind, delay as f64, lead) {
            let still = CoefficientPlan::new(n, harmonics, kind, 0.0, 0).unwrap();
            prop_assert_eq!(run(&plan, &v), run(&still, &v[more..=more + n]));
        }
    }

    #[test]
    fn held_signals_are_exact(
        n in 2usize..150, whole in 0usize..3, fraction in 0.0f64..1.0, more in 0usize..3, foh in any::<bool>(), m in 0usize..70,
    ) {
        let m = m.min(n / 2);
        let delay = whole as f64 + fraction;
        let lead = whole + 1 + more;
        let plan = CoefficientPlan::new(n, m, Kind::Hold(if foh { Hold::Foh } else { Hold::Zoh }), delay, lead).unwrap();
        let u = noise(plan.samples(), 21);
        let held = |x: f64| {
            let at = x - delay + lead as f64;
            let k = at.floor() as usize;
            if foh { u[k] + (u[k + 1] - u[k]) * (at - k as f64) } else { u[k] }
        };
        let got = run(&plan, &u)[m];
        let want = integral(n, m, fraction, held);
        prop_assert!((got.0 - want.0).abs() < 1e-13 && (got.1 - want.1).abs() < 1e-13, "{got:?} {want:?}");
    }

    #[test]
    fn uneven_times_on_an_even_grid_give_the_even_coefficients(n in 2usize..90, pick in 0usize..6, start in -9.0f64..9.0) {
        let kind = Kind::ALL[pick];
        // Gregory's uneven twin integrates local cubics and has other weights near the ends.
        prop_assume!(kind != Kind::Rule(Rule::Gregory));
        if let Ok(plan) = CoefficientPlan::new(n, n / 2, kind, 0.0, 0) {
            let t: Vec<f64> = (0..=n).map(|k| start + 0.1 * k as f64).collect();
            let v = noise(n + 1, 4);
            let uneven = CoefficientPlan::uneven(&t, n / 2, kind).unwrap();
            prop_assert!(far(&run(&plan, &v), &run(&uneven, &v)) < 1e-12);
        }
    }
}
