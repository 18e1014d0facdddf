//! The straight path: one record, one output, up to three poles and two inputs, without run-time sizes.
//!
//! What most fits and nearly all Monte Carlo replicates are. Nothing here is another method: the general path gives
//! the same bits, and takes over where a pivot is too small to trust.
#![allow(clippy::needless_range_loop)] // small matrices are written by row and column, as on paper

mod errors;
mod ls;
mod shape;
mod solve;
mod steps;
mod sums;
pub(crate) mod tables;
mod weights;

use super::design::Design;
use super::rule::Run;
use super::workspace::Workspace;
use crate::simd::{Isa, LANES, Wide};
use errors::Errors;
use ls::Ls;
use steps::Steps;
use tables::shapes;

/// Iterates as [`super::iterate::iterate`] does, until the end or until a step needs the general path. Returns
/// whether it came to its end.
pub(super) fn iterate(isa: Isa, d: &Design, w: &mut Workspace, run: &mut Run) -> bool {
    let Some(tables) = &d.straight else { return false };
    macro_rules! steps {
        ($n:literal, $i:literal, $z:literal, $s:literal) => {
            isa.run(Steps::<$n, $i, $z, $s> { tables, space: w, run })
        };
    }
    shapes!(tables.sizes, steps, false)
}

/// `ls`, where the problem is one for it. Returns whether it was.
pub(super) fn ls(isa: Isa, d: &Design, w: &mut Workspace) -> bool {
    let Some(tables) = &d.straight else { return false };
    let powers = &tables.powers;
    macro_rules! ls {
        ($n:literal, $i:literal, $z:literal, $s:literal) => {
            isa.run(Ls::<$n, $i, $z, $s> { design: d, powers, space: w })
        };
    }
    shapes!(tables.sizes, ls, false)
}

/// Completes estimates as [`super::uncertainty::finish`] does, unless that takes the general path. Returns whether
/// it did.
pub(super) fn finish(
    isa: Isa,
    d: &Design,
    w: &mut Workspace,
    live: [bool; LANES],
    covariance: bool,
) -> bool {
    let Some(tables) = &d.straight else { return false };
    let (live, method) = (Wide(live.map(f64::from)), d.method);
    let degrees_of_freedom = d.degrees_of_freedom();
    macro_rules! errors {
        ($n:literal, $i:literal, $z:literal, $s:literal) => {
            isa.run(Errors::<$n, $i, $z, $s> {
                tables,
                bins: &d.bins.of[0],
                space: w,
                live,
                degrees_of_freedom,
                method,
                covariance,
            })
        };
    }
    shapes!(tables.sizes, errors, false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{Options, Start, Wanted, estimate};
    use crate::modulation::Lines;
    use crate::rng::{Address, Purpose, normals};
    use crate::structure::{Method, Noise, Structure, Trend};

    /// Coefficients of inputs and of the response of a lag, a resonance or both (`poles`) in noise of size `noise`.
    fn fill(w: &mut Workspace, poles: usize, inputs: usize, first: usize, last: usize, noise: f64) {
        let mut z = vec![0.0; 2 * (last + 1) * (1 + inputs) * LANES];
        let (purpose, channel) = (Purpose::User, (inputs * 100 + last) as u32);
        normals(Address { seed: 3, purpose, channel, replicate: 0, group: 0 }, &mut z);
        let mut z = z.into_iter();
        let mut next = || Wide(std::array::from_fn(|_| z.next().unwrap()));
        let u: Vec<(Wide, Wide)> =
            (0..inputs * (last + 1 - first)).map(|_| (next(), next())).collect();
        for (k, u) in u.chunks(last + 1 - first).enumerate() {
            let (re, im) = w.signal_mut(0, 1 + k);
            for ((re, im), u) in re.iter_mut().zip(im).zip(u) {
                (*re, *im) = *u;
            }
        }
        let (re, im) = w.signal_mut(0, 0);
        for m in 0..re.len() {
            let x = (first + m) as f64 / last as f64;
            let (lag, mode) = ((0.5, x), (0.3 - x * x, 0.2 * x));
            let (a, b) = match poles {
                1 => lag,
                2 => mode,
                _ => (lag.0 * mode.0 - lag.1 * mode.1, lag.0 * mode.1 + lag.1 * mode.0),
            };
            let gain = (a / (a * a + b * b), -b / (a * a + b * b));
            let (e, f) = (next(), next());
            for k in 0..LANES {
                let sum = |part: fn(&(Wide, Wide)) -> Wide| {
                    (0..inputs).map(|i| part(&u[i * (last + 1 - first) + m]).0[k]).sum::<f64>()
                };
                let (p, q) = (sum(|u| u.0), sum(|u| u.1));
                re[m].0[k] = gain.0 * p - gain.1 * q + noise * e.0[k];
                im[m].0[k] = gain.0 * q + gain.1 * p + noise * f.0[k];
            }
        }
    }

    #[test]
    fn the_straight_path_has_the_bits_of_the_general_one() {
        let isa = Isa::detect().unwrap();
        let shapes = [(1, 1, 1), (2, 1, 1), (2, 1, 2), (2, 2, 1), (3, 1, 1), (3, 1, 3)];
        for (poles, inputs, z) in shapes {
            for (method, trend) in [
                (Method::Ls, Trend::None),
                (Method::Awls, Trend::None),
                (Method::Ml, Trend::Constant),
                (Method::Ml, Trend::None),
            ] {
                let structure = Structure::new(poles, vec![Some(z - 1); inputs]).unwrap();
                for (last, noise) in [(14, 0.3), (14, 0.01), (70, 1.0)] {
                    let lines = Lines { first: 0, last, omega0: 0.6, unit_variance: 0.004 };
                    let first = usize::from(trend == Trend::Constant);
                    let straight =
                        Design::new(&structure, method, Noise::Output, trend, true, &[lines])
                            .unwrap();
                    assert!(straight.straight.is_some(), "{poles} {inputs} {z}");
                    let general = Design { straight: None, ..straight.clone() };
                    let found = [&straight, &general].map(|d| {
                        let mut w = Workspace::new(d);
                        fill(&mut w, poles, inputs, first, last, noise);
                        let o = Options { tol: 1e-9, maxiter: 50, wanted: Wanted::Covariance };
                        let outcome = estimate(isa, d, &mut w, [true; LANES], Start::Wls, &o);
                        let lanes = |all: &[Wide]| -> Vec<[u64; LANES]> {
                            all.iter().map(|v| v.0.map(f64::to_bits)).collect()
                        };
                        let numbers = [
                            lanes(&w.iterates.theta.now),
                            lanes(&w.iterates.transients[0].now),
                            lanes(&[w.progress.cost]),
                            lanes(&w.gram),
                            lanes(&w.covariances.nonrobust),
                            lanes(&w.covariances.hc3),
                            lanes(&w.covariances.spectral.cov),
                            lanes(&w.covariances.spectral.degrees),
                        ];
                        (outcome, numbers)
                    });
                    let sound =
                        found[0].0.status.iter().filter(|s| **s == crate::error::Status::Ok);
                    assert!(sound.count() > 4, "{poles} {inputs} {z} {method:?}: {:?}", found[0].0);
                    assert_eq!(
                        found[0], found[1],
                        "{poles} {inputs} {z} {method:?} {trend:?} {last}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_has_no_compiled_shape_takes_the_general_path() {
        let lines = Lines { first: 0, last: 20, omega0: 0.6, unit_variance: 0.004 };
        let design = |numerators, trend, method| {
            let structure = Structure::new(2, numerators).unwrap();
            Design::new(&structure, method, Noise::Output, trend, true, &[lines]).unwrap().straight
        };
        assert!(design(vec![Some(0)], Trend::None, Method::Ml).is_some());
        assert!(design(vec![Some(0)], Trend::None, Method::Ls).is_some());
        assert!(design(vec![Some(0)], Trend::Constant, Method::Ls).is_none());
        assert!(design(vec![Some(0)], Trend::Linear, Method::Ml).is_none());
        assert!(design(vec![Some(0), Some(1)], Trend::None, Method::Ml).is_none());
        assert!(design(vec![Some(0), None], Trend::None, Method::Ml).is_none());
        assert!(design(vec![Some(2)], Trend::None, Method::Ml).is_none());
        assert!(design(vec![], Trend::None, Method::Ml).is_none());
        assert!(design(vec![Some(0)], Trend::None, Method::Wls).is_none());
    }
}
