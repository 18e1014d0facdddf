//! Tests of the rules: exact integrals of polynomials and exponentials, published decimals, bad input.

use super::*;
use proptest::prelude::*;

fn power(x: f64, j: usize) -> f64 {
    (0..j).fold(1.0, |p, _| p * x)
}

/// Highest degree that a rule integrates exactly.
fn degree(rule: Rule) -> usize {
    match rule {
        Rule::Staircase => 0,
        Rule::Trapezoid => 1,
        Rule::Parabolic | Rule::Gregory => 3,
    }
}

#[test]
fn gregory_has_the_published_decimals_and_exact_fractions() {
    let weights = Rule::Gregory.weights(20).unwrap();
    for (w, want) in weights.iter().zip([0.348_611, 1.245_833, 0.879_167, 1.026_389, 1.0]) {
        assert!((w - want).abs() < 5e-7, "{w} {want}");
    }
    let exact: Vec<Ratio> =
        [(-469, 720), (59, 240), (-29, 240), (19, 720)].map(|(a, b)| Ratio::new(a, b)).into();
    assert_eq!(end_corrections::<4>().to_vec(), exact);
    assert_eq!(Rule::Parabolic.weights(4).unwrap(), [1.0, 4.0, 2.0, 4.0, 1.0].map(|x| x / 3.0));
    assert_eq!(Rule::Trapezoid.weights(3).unwrap(), [0.5, 1.0, 1.0, 0.5]);
    assert_eq!(Rule::Staircase.weights(3).unwrap(), [1.0, 1.0, 1.0, 0.0]);
}

#[test]
fn every_rule_has_its_order() {
    // ∫₀¹ e^{2x} dx; the exponential by its own quadrature-free value.
    let e = std::f64::consts::E;
    let exact = 0.5 * (e * e - 1.0);
    let exponential = |x: f64| {
        let (mut sum, mut term) = (0.0, 1.0);
        for k in 1..60 {
            sum += term;
            term *= 2.0 * x / f64::from(k);
        }
        sum
    };
    let error = |rule: Rule, n: usize| {
        let w = rule.weights(n).unwrap();
        let sum: f64 =
            w.iter().enumerate().map(|(k, w)| w * exponential(k as f64 / n as f64)).sum();
        (sum / n as f64 - exact).abs()
    };
    for (rule, order) in Rule::ALL.into_iter().zip([1, 2, 4, 5]) {
        let gain = error(rule, 32) / error(rule, 64);
        let want = power(2.0, order);
        assert!(gain > 0.8 * want && gain < 1.25 * want, "{rule:?} {gain}");
    }
}

#[test]
fn mean_square_weight_is_the_factor_on_noise() {
    for (rule, want) in Rule::ALL.into_iter().zip([1.0, 1.0, 10.0 / 9.0, 1.0]) {
        let n = 4096;
        let mean = rule.weights(n).unwrap().iter().map(|w| w * w).sum::<f64>() / n as f64;
        assert!((mean - want).abs() < 1e-3, "{rule:?} {mean}");
    }
}

#[test]
fn short_weights_are_those_of_the_whole_window() {
    for rule in Rule::ALL {
        for n in (1..60).chain([255, 256]) {
            let Ok(all) = rule.weights(n) else { continue };
            let short = Weights::new(rule, n).unwrap();
            let at: Vec<f64> = (0..=n).map(|k| short.at(k)).collect();
            assert_eq!(at, all, "{rule:?} {n}");
            let inner = short.inner();
            for k in short.edge()..(n + 1).saturating_sub(short.edge()) {
                assert_eq!(all[k], inner[k % 2], "{rule:?} {n} {k}");
            }
            let squares: f64 = all.iter().map(|w| w * w).sum();
            assert!((short.sum_of_squares() / squares - 1.0).abs() < 1e-14, "{rule:?} {n}");
        }
    }
    let edges = Rule::ALL.map(|rule| Weights::new(rule, 1_000_000).unwrap().edge());
    assert_eq!(edges, [1, 1, 1, 4]);
}

#[test]
fn too_few_samples_and_odd_intervals_are_said_with_numbers() {
    assert!(
        matches!(Rule::Gregory.weights(2), Err(Error::Data(m)) if m.contains("4 samples") && m.contains("has 3"))
    );
    assert!(
        matches!(Rule::Parabolic.weights(7), Err(Error::Spec(m)) if m.contains("has 7") && m.contains("gregory"))
    );
    assert!(matches!(Rule::Trapezoid.weights(0), Err(Error::Data(_))));
    assert!(
        matches!(Rule::Trapezoid.uneven_weights(&[0.0, 1.0, 1.0]), Err(Error::Data(m)) if m.contains("t[2] = 1"))
    );
    assert!(matches!(Rule::Trapezoid.uneven_weights(&[0.0, f64::NAN]), Err(Error::Data(_))));
    assert!(matches!(Rule::Trapezoid.uneven_weights(&[]), Err(Error::Data(_))));
}

#[test]
fn gauss_legendre_integrates_polynomials_of_degree_eleven() {
    let (nodes, weights) = gauss_legendre::<6>();
    assert!(nodes.windows(2).all(|pair| pair[0] < pair[1]));
    for j in 0..12 {
        let sum: f64 = nodes.iter().zip(&weights).map(|(x, w)| w * power(*x, j)).sum();
        assert!((sum - 1.0 / (j + 1) as f64).abs() < 2e-16 * 4.0, "{j} {sum}");
    }
    let (nodes, weights) = gauss_legendre::<3>();
    assert!((nodes[1] - 0.5).abs() < 1e-16 && (weights[1] - 4.0 / 9.0).abs() < 1e-15);
}

/// ∫ of f(σ) e^{−ixσ} over [low, high] by many Gauss cells: an oracle that knows no closed form.
fn integral(low: f64, high: f64, turns: f64, f: impl Fn(f64) -> f64) -> (f64, f64) {
    let (nodes, weights) = gauss_legendre::<6>();
    let (mut re, mut im) = (0.0, 0.0);
    for cell in 0..16 {
        for (node, weight) in nodes.iter().zip(&weights) {
            let x = low + (high - low) * (f64::from(cell) + node) / 16.0;
            let (sin, cos) = sin_cos_turns_1(-turns * x);
            re += weight * f(x) * cos;
            im += weight * f(x) * sin;
        }
    }
    ((high - low) / 16.0 * re, (high - low) / 16.0 * im)
}

#[test]
fn cell_moments_keep_full_relative_accuracy_at_small_angles() {
    for turns in [0.0, 1e-12, 1e-7, 1e-3, 0.159, 0.16, 0.3, 0.5] {
        let (a, b) = cell_moments(turns);
        let wanted = [integral(0.0, 1.0, turns, |_| 1.0), integral(0.0, 1.0, turns, |s| s)];
        for (got, want) in [a, b].into_iter().zip(wanted) {
            assert!((got.0 - want.0).abs() < 2e-15, "{turns}: {got:?} {want:?}");
            assert!(
                (got.1 - want.1).abs() <= 2e-15 * want.1.abs().max(turns),
                "{turns}: {got:?} {want:?}"
            );
        }
    }
}

proptest! {
    #[test]
    fn rules_are_exact_for_their_polynomials(n in 1usize..60, pick in 0usize..4) {
        let rule = Rule::ALL[pick];
        if let Ok(weights) = rule.weights(n) {
            for j in 0..=degree(rule) {
                let sum: f64 = weights.iter().enumerate().map(|(k, w)| w * power(k as f64, j)).sum();
                let exact = power(n as f64, j + 1) / (j + 1) as f64;
                prop_assert!((sum - exact).abs() < 1e-12 * exact, "{rule:?} {n} {j} {sum} {exact}");
            }
        }
    }

    // Of eight samples and more, as records have: with fewer, large weights of close samples may be cut.
    #[test]
    fn uneven_weights_are_exact_for_local_polynomials(
        steps in prop::collection::vec(0.5f64..1.0, 7..40), pick in 0usize..4, start in -5.0f64..5.0,
    ) {
        let rule = Rule::ALL[pick];
        let t: Vec<f64> = std::iter::once(0.0).chain(steps).scan(start, |x, h| { *x += h; Some(*x) }).collect();
        if let Ok(q) = rule.uneven_weights(&t) {
            let exact_degree = if rule == Rule::Parabolic { 2 } else { degree(rule) };
            let span = t[t.len() - 1] - t[0];
            for j in 0..=exact_degree {
                let sum: f64 = q.iter().zip(&t).map(|(q, t)| q * power((t - start) / span, j)).sum();
                let exact = span / (j + 1) as f64;
                prop_assert!((sum - exact).abs() < 1e-11 * span, "{rule:?} {j} {sum} {exact}");
            }
        }
    }

    #[test]
    fn close_samples_get_no_large_weights(
        sizes in prop::collection::vec((0.1f64..1.0, 0usize..9), 3..40), start in -5.0f64..5.0,
    ) {
        let steps: Vec<f64> = sizes.iter().map(|&(size, tenths)| size * power(0.1, tenths)).collect();
        // Each interval's weights are at most twice its length, and straight lines stay exact.
        let t: Vec<f64> = std::iter::once(0.0).chain(steps).scan(start, |x, h| { *x += h; Some(*x) }).collect();
        let q = Rule::Gregory.uneven_weights(&t).unwrap();
        let span = t[t.len() - 1] - t[0];
        let size: f64 = q.iter().map(|q| q.abs()).sum();
        prop_assert!(size < 2.0 * span * (1.0 + 1e-12), "{size} {span}");
        for j in 0..=1 {
            let sum: f64 = q.iter().zip(&t).map(|(q, t)| q * power((t - start) / span, j)).sum();
            prop_assert!((sum - span / (j + 1) as f64).abs() < 1e-9 * span);
        }
        for (k, q) in q.iter().enumerate() {
            let reach = t[(k + MOST).min(t.len() - 1)] - t[k.saturating_sub(MOST)];
            prop_assert!(q.abs() <= 2.0 * reach);
        }
    }

    #[test]
    fn uneven_parabolic_and_trapezoid_on_an_even_grid_are_the_rules(n in 1usize..20, pick in 0usize..3) {
        let rule = Rule::ALL[pick];
        let t: Vec<f64> = (0..=2 * n).map(|k| k as f64).collect();
        let (even, uneven) = (rule.weights(2 * n).unwrap(), rule.uneven_weights(&t).unwrap());
        for (a, b) in even.iter().zip(&uneven) {
            prop_assert!((a - b).abs() < 1e-13);
        }
    }

    #[test]
    fn held_cells_split_by_a_fraction_are_exact(
        turns in -0.5f64..0.5, ahead in 0.0f64..1.0, u in prop::array::uniform3(-1.0f64..1.0), foh in any::<bool>(),
    ) {
        let hold = if foh { Hold::Foh } else { Hold::Zoh };
        let value = |s: f64, cell: usize| {
            if foh { u[cell] + (u[cell + 1] - u[cell]) * (s - cell as f64) } else { u[cell] }
        };
        let one = integral(0.0, 1.0 - ahead, turns, |s| value(s + ahead, 0));
        let two = integral(1.0 - ahead, 1.0, turns, |s| value(s + ahead, 1));
        let factors = hold.cell(turns, ahead);
        let got = factors.iter().zip(u).fold((0.0, 0.0), |sum, (f, u)| plus(sum, scale(u, *f)));
        prop_assert!((got.0 - one.0 - two.0).abs() < 1e-14);
        prop_assert!((got.1 - one.1 - two.1).abs() < 1e-14);
    }
}
