//! Frequency responses: every neighbourhood as a complex least-squares problem written out.
#![allow(clippy::needless_range_loop)]

use super::dense::{C, Qr, dot, sandwich};
use super::signals::noise;
use modfun::response::{Family, Piece, Responses, Settings, Weighting, responses};
use modfun::simd::Isa;
use modfun::threads::Control;

const LINES: usize = 90;
/// Gauss–Newton steps of `ml`.
const STEPS: usize = 10;

/// Lines of two outputs of two inputs: smooth gains, transients as smooth, noise that the outputs share.
fn piece(seed: u64, half: usize, sigma: f64) -> Piece {
    let e: Vec<Vec<f64>> = (0..8).map(|c| noise(40 + c, seed, LINES + 1)).collect();
    let gain = |i: usize, j: usize, x: f64| {
        let pole = C(0.4 + 0.1 * i as f64, x - 0.3 * j as f64);
        pole.inverse() * (1.0 + i as f64 - 0.5 * j as f64)
    };
    let u: Vec<Vec<C>> = (0..2)
        .map(|j| {
            let line = |m: usize| C(e[2 * j][m], if m == 0 { 0.0 } else { e[2 * j + 1][m] });
            (0..=LINES).map(line).collect()
        })
        .collect();
    let y = |i: usize| -> Vec<[f64; 2]> {
        (0..=LINES)
            .map(|m| {
                let x = m as f64 / 30.0;
                let clean =
                    gain(i, 0, x) * u[0][m] + gain(i, 1, x) * u[1][m] + gain(i, 0, x) * C(0.3, 0.0);
                let own = C(e[4][m], e[5][m]) * 0.6 + C(e[6][m], e[7][m]) * (i as f64);
                let all = clean + own * sigma;
                [all.0, if m == 0 { 0.0 } else { all.1 }]
            })
            .collect()
    };
    let pairs = |v: &Vec<C>| v.iter().map(|c| [c.0, c.1]).collect();
    Piece { omega0: 1.0, half, zero: true, y: vec![y(0), y(1)], u: u.iter().map(pairs).collect() }
}

fn run(settings: Settings, pieces: &[Piece], omega: &[f64]) -> Responses {
    let isa = Isa::detect().unwrap();
    responses(isa, 1, settings, pieces, omega, &mut |_, _| Control::Continue).unwrap()
}

/// Complex columns as real ones: (Re; Im) and that of i times the column.
fn real(columns: &[Vec<C>]) -> Vec<Vec<f64>> {
    let split =
        |c: Vec<C>| c.iter().map(|z| z.0).chain(c.iter().map(|z| z.1)).collect::<Vec<f64>>();
    let turned = |c: &Vec<C>| c.iter().map(|z| *z * C(0.0, 1.0)).collect::<Vec<C>>();
    columns.iter().flat_map(|c| [split(c.clone()), split(turned(c))]).collect()
}

/// One output around a frequency: B and T (and A) at their best, weights 1/|A|² of a last estimate.
struct Local {
    x: Vec<f64>,
    y: Vec<Vec<C>>,
    u: Vec<Vec<C>>,
    /// Which piece each line is of.
    own: Vec<usize>,
    pieces: usize,
    degree: usize,
}

impl Local {
    fn new(pieces: &[Piece], omega: f64, degree: usize) -> Local {
        let (mut x, mut own) = (Vec::new(), Vec::new());
        let (mut y, mut u) = (vec![Vec::new(); 2], vec![Vec::new(); 2]);
        for (k, p) in pieces.iter().enumerate() {
            let centre = (omega / p.omega0).round() as usize;
            for m in centre - p.half..=centre + p.half {
                x.push((m as f64 * p.omega0 - omega) / (pieces[0].half as f64 * pieces[0].omega0));
                own.push(k);
                for c in 0..2 {
                    y[c].push(C(p.y[c][m][0], p.y[c][m][1]));
                    u[c].push(C(p.u[c][m][0], p.u[c][m][1]));
                }
            }
        }
        Local { x, y, u, own, pieces: pieces.len(), degree }
    }

    /// x^k of each line, of one piece alone or times a signal.
    fn powers(&self, k: usize, times: impl Fn(usize) -> C) -> Vec<C> {
        (0..self.x.len()).map(|i| times(i) * (0..k).fold(1.0, |p, _| p * self.x[i])).collect()
    }

    /// Columns of T of each piece, of B of each input (constant terms last), of A where `own` is given.
    fn columns(&self, own: Option<&[C]>) -> Vec<Vec<C>> {
        let mut all = Vec::new();
        for piece in 0..self.pieces {
            for k in 0..=self.degree {
                let inside = |i: usize| C(f64::from(u8::from(self.own[i] == piece)), 0.0);
                all.push(self.powers(k, inside));
            }
        }
        if let Some(y) = own {
            (1..=self.degree).for_each(|k| all.push(self.powers(k, |i| -y[i])));
        }
        for u in &self.u {
            (1..=self.degree).for_each(|k| all.push(self.powers(k, |i| u[i])));
        }
        for u in &self.u {
            all.push(u.clone());
        }
        all
    }

    /// A on the lines of an estimate.
    fn denominator(&self, x: &[C]) -> Vec<C> {
        let from = self.pieces * (self.degree + 1);
        let one = |i: usize| {
            let mut power = 1.0;
            (1..=self.degree).fold(C(1.0, 0.0), |sum, k| {
                power *= self.x[i];
                sum + x[from + k - 1] * power
            })
        };
        (0..self.x.len()).map(one).collect()
    }

    /// The output of an estimate, transient included.
    fn model(&self, x: &[C]) -> Vec<C> {
        let columns = self.columns(Some(&vec![C::default(); self.x.len()]));
        let sum = |k: usize| columns.iter().zip(x).fold(C::default(), |s, (c, x)| s + c[k] * *x);
        self.denominator(x).iter().enumerate().map(|(k, a)| sum(k) * a.inverse()).collect()
    }

    /// The first of five steps, each half the one before, that lowers what is left of y; else none.
    fn lower(&self, x: &[C], by: &[C], y: &[C]) -> Vec<C> {
        let cost =
            |x: &[C]| -> f64 { self.model(x).iter().zip(y).map(|(m, y)| (*y - *m).square()).sum() };
        let trial = |k: i32| -> Vec<C> {
            x.iter().zip(by).map(|(x, b)| *x + *b * 0.5_f64.powi(k)).collect()
        };
        (0..5).map(trial).find(|t| cost(t) < cost(x)).unwrap_or_else(|| x.to_vec())
    }

    /// Least squares of `right` on columns, both divided by `a`; the estimate.
    fn solve(&self, columns: &[Vec<C>], right: &[C], a: &[C]) -> Vec<C> {
        let over = |c: &Vec<C>| c.iter().zip(a).map(|(z, a)| *z * a.inverse()).collect::<Vec<C>>();
        let columns: Vec<Vec<C>> = columns.iter().map(over).collect();
        let right = over(&right.to_vec());
        let flat: Vec<f64> = right.iter().map(|z| z.0).chain(right.iter().map(|z| z.1)).collect();
        Qr::new(&real(&columns)).solve(&flat).chunks(2).map(|z| C(z[0], z[1])).collect()
    }
}

/// (Gain on the lines' noise of each response of an output, residuals, leverages) of weighted columns.
fn worth(columns: &[Vec<C>], right: &[C]) -> (Vec<Vec<C>>, Vec<C>, Vec<f64>) {
    let lines = right.len();
    let qr = Qr::new(&real(columns));
    let flat: Vec<f64> = right.iter().map(|z| z.0).chain(right.iter().map(|z| z.1)).collect();
    let rest = qr.rest(&flat);
    let unit = |k: usize| (0..2 * lines).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
    let solved: Vec<Vec<f64>> = (0..lines).map(|k| qr.solve(&unit(k))).collect();
    let n = columns.len();
    let gain =
        (n - 2..n).map(|c| solved.iter().map(|s| C(s[2 * c], s[2 * c + 1])).collect()).collect();
    let leverages = qr.leverages(2 * lines)[..lines].to_vec();
    ((gain), (0..lines).map(|i| C(rest[i], rest[lines + i])).collect(), leverages)
}

fn close(a: [f64; 2], b: C, within: f64) -> bool {
    (C(a[0], a[1]) - b).size() < within
}

#[test]
fn polynomials_and_rationals_are_local_least_squares() {
    let omega = [20.0, 33.4, 47.0, 58.7].map(|m: f64| 0.7 * m);
    for pieces in [vec![piece(1, 14, 0.002)], vec![piece(1, 14, 0.002), piece(2, 11, 0.002)]] {
        for (family, weighting) in [
            (Family::Polynomial, Weighting::Ls),
            (Family::Rational, Weighting::Awls),
            (Family::Rational, Weighting::Ml),
        ] {
            let settings = Settings { family, degree: 2, weighting };
            let found = run(settings, &pieces, &omega);
            for (at, omega) in omega.iter().enumerate() {
                let what = format!("{settings:?} {omega}");
                let local = Local::new(&pieces, *omega, 2);
                let (mut gains, mut rests, mut levels, mut freedom) = (vec![], vec![], vec![], 0);
                for i in 0..2 {
                    let own = (family == Family::Rational).then_some(&local.y[i][..]);
                    let data = local.columns(own);
                    let mut a = vec![C(1.0, 0.0); local.x.len()];
                    let mut x = local.solve(&data, &local.y[i], &a);
                    let mut last = data.clone();
                    let mut right: Vec<C> = local.y[i].clone();
                    if family == Family::Rational {
                        for _ in 0..3 {
                            a = local.denominator(&x);
                            x = local.solve(&data, &local.y[i], &a);
                        }
                        // Columns of the estimate's own output; the right side is what it leaves.
                        let steps = if weighting == Weighting::Ml { STEPS } else { 0 };
                        for step in 0..=steps {
                            a = local.denominator(&x);
                            let model = local.model(&x);
                            last = local.columns(Some(&model));
                            right =
                                (0..a.len()).map(|k| (local.y[i][k] - model[k]) * a[k]).collect();
                            if step < steps {
                                let by = local.solve(&last, &right, &a);
                                x = local.lower(&x, &by, &local.y[i]);
                            }
                        }
                    }
                    let over = |c: &Vec<C>| {
                        c.iter().zip(&a).map(|(z, a)| *z * a.inverse()).collect::<Vec<C>>()
                    };
                    let weighted: Vec<Vec<C>> = last.iter().map(over).collect();
                    let (gain, rest, leverage) = worth(&weighted, &over(&right));
                    freedom = local.x.len() - weighted.len();
                    let n = x.len();
                    let scale = x[n - 2].size() + x[n - 1].size();
                    for j in 0..2 {
                        let got = found.response[(at * 2 + i) * 2 + j];
                        let near = if weighting == Weighting::Ml { 1e-5 } else { 1e-8 };
                        assert!(
                            close(got, x[n - 2 + j], near * scale),
                            "{what}: {got:?} {:?}",
                            x[n - 2 + j]
                        );
                    }
                    let centre = (0..2 * pieces[0].half + 1)
                        .min_by(|a, b| local.x[*a].abs().total_cmp(&local.x[*b].abs()))
                        .unwrap();
                    let left = rest[centre].square() / (1.0 - leverage[centre]).powi(2);
                    levels.push((found.left_out[at * 2 + i], left));
                    gains.extend(gain);
                    rests.push(rest);
                }
                assert_eq!(found.freedom, freedom, "{what}");
                let within = if weighting == Weighting::Ml { 1e-3 } else { 1e-6 };
                for (got, want) in levels {
                    assert!((got / want - 1.0).abs() < within, "{what}: {got} {want}");
                }
                for i in 0..2 {
                    for k in 0..2 {
                        let sum = rests[i].iter().zip(&rests[k]);
                        let sum = sum.fold(C::default(), |s, (a, b)| s + *a * b.conj());
                        let noise = sum * (1.0 / freedom as f64);
                        let size = found.noise[at * 4 + 3 * i][0];
                        assert!(
                            close(found.noise[at * 4 + 2 * i + k], noise, within * size),
                            "{what}: noise"
                        );
                        for a in 0..2 {
                            for b in 0..2 {
                                let (p, q) = (2 * i + a, 2 * k + b);
                                let sum = gains[p].iter().zip(&gains[q]);
                                let sum = sum.fold(C::default(), |s, (a, b)| s + *a * b.conj());
                                let got = found.cov[at * 16 + 4 * p + q];
                                let size = found.cov[at * 16 + 5 * p][0];
                                assert!(
                                    close(got, sum * noise, 10.0 * within * size),
                                    "{what}: {got:?} {sum:?}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Differences of the lines annihilate T: the response, and its covariance from noise on the lines.
#[test]
fn modulating_neighbourhoods_are_differences_of_lines() {
    let pieces = [piece(3, 14, 0.01)];
    let settings = Settings { family: Family::Modulating, degree: 2, weighting: Weighting::Ls };
    let omega = [25.0, 40.3].map(|m: f64| 0.7 * m);
    let found = run(settings, &pieces, &omega);
    for (at, omega) in omega.iter().enumerate() {
        let local = Local::new(&pieces, *omega, 2);
        let columns = local.columns(None).split_off(3);
        let difference = |c: &[C]| -> Vec<C> {
            let mut c = c.to_vec();
            for _ in 0..3 {
                c = c.windows(2).map(|w| w[1] - w[0]).collect();
            }
            c
        };
        let rows: Vec<Vec<C>> = columns.iter().map(|c| difference(c)).collect();
        let n = local.x.len();
        let flat =
            |c: &[C]| c.iter().map(|z| z.0).chain(c.iter().map(|z| z.1)).collect::<Vec<f64>>();
        let qr = Qr::new(&real(&rows));
        // What every line does to the estimate.
        let unit =
            |k: usize| (0..n).map(|i| C(f64::from(u8::from(i == k)), 0.0)).collect::<Vec<C>>();
        let effects: Vec<Vec<f64>> =
            (0..n).map(|k| qr.solve(&flat(&difference(&unit(k))))).collect();
        let left = |v: &[C]| qr.rest(&flat(&difference(v)));
        // Noise of variance one on all lines leaves so much, Re and Im of each line alike.
        let whole: f64 = (0..n).map(|k| left(&unit(k))).map(|r| dot(&r, &r)).sum();
        for i in 0..2 {
            let x = qr.solve(&flat(&difference(&local.y[i])));
            for j in 0..2 {
                let want = C(x[8 + 2 * j], x[9 + 2 * j]);
                assert!(
                    close(found.response[(at * 2 + i) * 2 + j], want, 1e-8 * want.size()),
                    "{omega}"
                );
            }
            let rest = left(&local.y[i]);
            let noise = dot(&rest, &rest) / whole;
            let got = found.noise[at * 4 + 3 * i][0];
            assert!((got / noise - 1.0).abs() < 1e-6, "{omega}: {got} {noise}");
            for a in 0..2 {
                let square = |e: &Vec<f64>| e[8 + 2 * a].powi(2) + e[9 + 2 * a].powi(2);
                let want = noise * effects.iter().map(square).sum::<f64>();
                let got = found.cov[at * 16 + 5 * (2 * i + a)][0];
                assert!((got / want - 1.0).abs() < 1e-6, "{omega}: {got} {want}");
            }
        }
    }
}

/// Without a transient or an A of its own the covariance is the inverse normal matrix, times the noise.
#[test]
fn the_covariance_is_the_inverse_normal_matrix() {
    let pieces = [piece(4, 14, 0.02)];
    let settings = Settings { family: Family::Polynomial, degree: 2, weighting: Weighting::Ls };
    let found = run(settings, &pieces, &[28.0]);
    let local = Local::new(&pieces, 28.0, 2);
    let columns = real(&local.columns(None));
    let h = Qr::new(&columns).inverse_normal();
    let n = columns.len();
    // The real and imaginary part of an estimate: half the complex variance each.
    let unit: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    let whole = sandwich(&unit, &h);
    for a in 0..2 {
        let at = n - 4 + 2 * a;
        let want = found.noise[0][0] * 0.5 * (whole[at][at] + whole[at + 1][at + 1]);
        assert!((found.cov[5 * a][0] / want - 1.0).abs() < 1e-8, "{} {want}", found.cov[5 * a][0]);
    }
}
