//! The uncertainty of a small problem whose sizes are known when it is compiled.
//!
//! It does what `uncertainty` does, operation by operation and to the bit, but meets each line once.

use super::shape::{POWERS, SUMS, Shape};
use super::solve::entry;
use super::steps::read;
use super::sums::{Lines, Signals, accumulate, prepare, products};
use super::tables::{StraightWorkspace, Tables};
use super::weights::weigh;
use crate::estimate::spectral::Spectral;
use crate::estimate::uncertainty::{
    LEVERAGE, OBLIQUE_LEVERAGE, deleted, freedom, mirror, project, scale,
};
use crate::estimate::{covariances::Kinds, workspace::Workspace};
use crate::linalg::lanes::{eliminate, invert, substitute};
use crate::simd::{Kernel, Lanes, Wide};
use crate::structure::Method;

/// T and cost at an estimate, and with `covariance` both covariances of θ.
pub(super) struct Errors<'a, const N: usize, const I: usize, const Z: usize, const S: usize> {
    pub tables: &'a Tables,
    /// Bin of the noise spectrum of each line.
    pub bins: &'a [usize],
    pub space: &'a mut Workspace,
    /// 1 in the lanes whose pivots matter.
    pub live: Wide,
    pub degrees_of_freedom: usize,
    pub method: Method,
    pub covariance: bool,
}

impl<const N: usize, const I: usize, const Z: usize, const S: usize> Kernel
    for Errors<'_, N, I, Z, S>
{
    /// Whether all pivots may be trusted; else the general path is needed.
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        if !L::HINTS {
            return false;
        }
        let Errors { tables, bins, space: w, live, degrees_of_freedom, method, covariance } = self;
        let p = S - N;
        let Workspace { records, iterates, progress, straight, diagonal, unknowns, .. } = w;
        let r = &mut records[0];
        let count = r.limit;
        let signals = Signals { re: &r.re, im: &r.im, lines: r.lines };
        let mut lines = Lines {
            weights: &mut w.weights[..count],
            hat: (&mut w.hat_re[..count], &mut w.hat_im[..count]),
            residual: (&mut w.residual_re[..count], &mut w.residual_im[..count]),
        };
        let (theta, transient) = (&iterates.theta.now, &mut iterates.transients[0].now);
        prepare::<L, N, I, Z>(tables, straight, &signals);

        // T by least squares at θ.
        let at = read::<L, S, N>(transient, theta);
        weigh::<L, N, I, Z, S, false, false>(tables, &signals, &mut lines, &at);
        sums::<L, N, I, Z>(straight, lines.weights);
        assemble::<L, N, I, Z, S>(&straight.sums, &mut r.matrix, diagonal);
        transient_block::<L, N, S>(&r.matrix, &mut w.square);
        let mut trusted = Wide::splat(1.0);
        eliminate::<L>(&mut r.matrix, S, 0..N, diagonal, true, &mut trusted);
        unknowns[N..S].copy_from_slice(theta);
        substitute::<L>(&r.matrix, S, 0..N, unknowns);
        transient.copy_from_slice(&unknowns[..N]);

        // Residuals, and for `ml` the system whose columns are denoised.
        let at = read::<L, S, N>(transient, theta);
        let cost = match method {
            Method::Ml => weigh::<L, N, I, Z, S, true, true>(tables, &signals, &mut lines, &at),
            _ => weigh::<L, N, I, Z, S, true, false>(tables, &signals, &mut lines, &at),
        };
        cost.store(&mut progress.cost);
        if !covariance {
            return true;
        }
        if method == Method::Ml {
            denoise::<L, N, I, Z>(tables, straight, &signals, &lines);
            sums::<L, N, I, Z>(straight, lines.weights);
            assemble::<L, N, I, Z, S>(&straight.sums, &mut r.matrix, diagonal);
            trusted = Wide::splat(1.0);
            eliminate::<L>(&mut r.matrix, S, 0..N, diagonal, true, &mut trusted);
        }
        invert::<L>(&w.square, N, &mut r.transient_inverse, &mut w.work, &mut trusted);
        project::<L>(&r.matrix, N, S, &mut r.projection);
        for i in 0..p {
            for j in i..p {
                let entry = L::load(&r.matrix[(N + i) * (S + 1) + N + j]);
                entry.store(&mut w.gram[i * p + j]);
                entry.store(&mut w.gram[j * p + i]);
            }
        }
        let differenced = method == Method::Ls;
        let normal = if differenced { &w.ls_normal } else { &w.gram };
        invert::<L>(normal, p, &mut w.inverse, &mut w.work, &mut trusted);
        let untrusted = L::load(&live) - L::load(&live) * L::load(&trusted);
        if untrusted.any() && !differenced {
            return false;
        }
        let output: (&[Wide], &[Wide]) = match method {
            Method::Ml => (lines.hat.0, lines.hat.1),
            _ => (&r.re[..count], &r.im[..count]),
        };
        let by = Projected {
            projection: &r.projection,
            transient_inverse: &r.transient_inverse,
            inverse: &w.inverse,
            instruments: &r.instruments,
            bins,
        };
        w.covariances.spectral.clear();
        let (spectral, kinds) = (&mut w.covariances.spectral, w.covariances.kinds);
        let none = Kinds { hc3: false, spectral: false };
        let found = match differenced {
            false if kinds == none => [[(L::splat(0.0), L::splat(0.0)); S]; S],
            true => {
                rows::<L, N, I, Z, S, true>(tables, &signals, output, &lines, &by, spectral, kinds)
            }
            false => {
                rows::<L, N, I, Z, S, false>(tables, &signals, output, &lines, &by, spectral, kinds)
            }
        };
        let variance = cost * L::splat(1.0 / degrees_of_freedom as f64);
        for i in 0..p {
            for j in i..p {
                let (hc3, unit) = found[N + i][N + j];
                hc3.store(&mut w.covariances.hc3[i * p + j]);
                if differenced {
                    (unit * variance).store(&mut w.covariances.nonrobust[i * p + j]);
                }
            }
        }
        mirror(p, &mut w.covariances.hc3);
        match differenced {
            true => mirror(p, &mut w.covariances.nonrobust),
            false => scale::<L>(variance, &w.inverse, &mut w.covariances.nonrobust),
        }
        true
    }
}

/// All sums of the data.
#[inline(always)]
fn sums<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    space: &mut StraightWorkspace,
    weights: &[Wide],
) {
    let table = const { &Shape::<N, I, Z>::TABLE };
    let StraightWorkspace { own, shared, sums, .. } = space;
    let (mine, others) = sums.split_at_mut(table.own);
    accumulate::<L>(own, table.own, 0, weights, mine);
    accumulate::<L>(shared, table.shared, 0, weights, &mut others[..table.shared]);
}

/// The products of the denoised output in place of those of the output.
#[inline(always)]
fn denoise<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    tables: &Tables,
    space: &mut StraightWorkspace,
    signals: &Signals<'_>,
    lines: &Lines<'_>,
) {
    let count = const { Shape::<N, I, Z>::TABLE.own };
    space.output_ready = false;
    let places = space.own.chunks_exact_mut(count).zip(&tables.powers);
    for (m, (to, powers)) in places.enumerate().take(lines.weights.len()) {
        let hat = (L::load(&lines.hat.0[m]), L::load(&lines.hat.1[m]));
        products::<L, N, I, Z, true>(signals, hat, m, powers, to);
    }
}

/// The system that the sums of the data make, upper triangle, and its diagonal apart.
#[inline(always)]
fn assemble<L: Lanes, const N: usize, const I: usize, const Z: usize, const S: usize>(
    sums: &[Wide],
    matrix: &mut [Wide],
    diagonal: &mut [Wide],
) {
    let sums = &sums[..SUMS];
    // Written out, since the row must be known where it is compiled.
    macro_rules! rows {
        ($($i:literal)*) => {$(
            if $i < S {
                let row = &mut matrix[$i * (S + 1)..][..S + 1];
                for j in $i..=S {
                    entry::<L, N, I, Z>(sums, true, $i, j).store(&mut row[j]);
                }
                L::load(&row[$i]).store(&mut diagonal[$i]);
            }
        )*};
    }
    rows!(0 1 2 3 4 5 6 7 8);
}

/// TᵀWT.
#[inline(always)]
fn transient_block<L: Lanes, const N: usize, const S: usize>(matrix: &[Wide], to: &mut [Wide]) {
    for i in 0..N {
        for j in i..N {
            L::load(&matrix[i * (S + 1) + j]).store(&mut to[i * N + j]);
        }
    }
}

/// What projects the transient out, the inverse of what is left, and the instruments of `ls`.
struct Projected<'a> {
    projection: &'a [Wide],
    transient_inverse: &'a [Wide],
    inverse: &'a [Wide],
    instruments: &'a [Wide],
    /// Bin of each line.
    bins: &'a [usize],
}

/// Σ (Hz)(Hz)ᵀ v over the rows of all lines, upper triangle, θ behind the transient: with the v of HC3, and of
/// differenced rows also with their variances. Columns are made of this output.
#[inline(always)]
fn rows<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const DIFFERENCED: bool,
>(
    tables: &Tables,
    signals: &Signals<'_>,
    output: (&[Wide], &[Wide]),
    lines: &Lines<'_>,
    by: &Projected<'_>,
    spectral: &mut Spectral,
    kinds: Kinds,
) -> [[(L, L); S]; S] {
    let (zero, p) = (L::splat(0.0), S - N);
    let floor = L::splat(if DIFFERENCED { OBLIQUE_LEVERAGE } else { LEVERAGE });
    let mut cov = [[(zero, zero); S]; S];
    let count = lines.weights.len();
    for (m, powers) in tables.powers[..count].iter().enumerate() {
        let weight = L::load(&lines.weights[m]);
        let output = (L::load(&output.0[m]), L::load(&output.1[m]));
        let mut row = [(zero, zero); S];
        for c in N..S {
            row[c] = column::<L, N, Z>(c, output, signals, m, powers);
        }
        for c in N..S {
            for t in 0..N {
                let value = L::splat(powers[t]);
                let along = L::load(&by.projection[t * p + c - N]);
                if t % 2 == 0 {
                    row[c].0 = value.mul_add(along, row[c].0);
                } else {
                    row[c].1 = value.mul_add(along, row[c].1);
                }
            }
        }
        let mut own = (zero, zero);
        for i in 0..N {
            for j in 0..N {
                if i % 2 != j % 2 {
                    continue;
                }
                let value = L::splat(powers[i] * powers[j]);
                let inverse = L::load(&by.transient_inverse[i * N + j]);
                if i % 2 == 0 {
                    own.0 = value.mul_add(inverse, own.0);
                } else {
                    own.1 = value.mul_add(inverse, own.1);
                }
            }
        }
        let mut z = [(zero, zero); S];
        for c in N..S {
            z[c] = if DIFFERENCED {
                let from = &by.instruments[m * 2 * p..][..2 * p];
                (L::load(&from[c - N]), L::load(&from[p + c - N]))
            } else {
                (row[c].0 * weight, row[c].1 * weight)
            };
        }
        let mut influence = [(zero, zero); S];
        let mut h = (zero, zero);
        for i in N..S {
            let mut s = (zero, zero);
            for j in N..S {
                let along = L::load(&by.inverse[(i - N) * p + j - N]);
                s.0 = along.mul_add(z[j].0, s.0);
                s.1 = along.mul_add(z[j].1, s.1);
            }
            h = (s.0.mul_add(row[i].0, h.0), s.1.mul_add(row[i].1, h.1));
            influence[i] = s;
        }
        let residual = (L::load(&lines.residual.0[m]), L::load(&lines.residual.1[m]));
        let left = freedom((own.0.mul_add(weight, h.0), own.1.mul_add(weight, h.1)), floor);
        if kinds.hc3 {
            let (f_re, f_im) = deleted(residual, left);
            for i in N..S {
                let (a, b) = (influence[i].0 * f_re, influence[i].1 * f_im);
                for j in i..S {
                    let sum = b.mul_add(influence[j].1, cov[i][j].0);
                    cov[i][j].0 = a.mul_add(influence[j].0, sum);
                }
            }
        }
        let v = L::splat(1.0) / weight;
        if DIFFERENCED {
            for i in N..S {
                let (a, b) = (influence[i].0 * v, influence[i].1 * v);
                for j in i..S {
                    let sum = b.mul_add(influence[j].1, cov[i][j].1);
                    cov[i][j].1 = a.mul_add(influence[j].0, sum);
                }
            }
        }
        if !kinds.spectral {
            continue;
        }
        let square = residual.1.mul_add(residual.1, residual.0 * residual.0) * weight;
        let left = if tables.x[m] == 0.0 { left.0 } else { left.0 + left.1 };
        spectral.add(by.bins[m], square, left);
        let sum = spectral.influence(by.bins[m]);
        let mut at = 0;
        for i in N..S {
            let (a, b) = (influence[i].0 * v, influence[i].1 * v);
            for j in i..S {
                let own = b.mul_add(influence[j].1, L::load(&sum[at]));
                a.mul_add(influence[j].0, own).store(&mut sum[at]);
                at += 1;
            }
        }
    }
    cov
}

/// Column `c` of [T, θ] on a line, with this output; that before θ is the target.
#[inline(always)]
pub(super) fn column<L: Lanes, const N: usize, const Z: usize>(
    c: usize,
    output: (L, L),
    signals: &Signals<'_>,
    m: usize,
    powers: &[f64; POWERS],
) -> (L, L) {
    if c < 2 * N {
        let power = 2 * N - 1 - c;
        return turned(power, output, L::splat(powers[power]));
    }
    let (input, power) = ((c - 2 * N) / Z, Z - 1 - (c - 2 * N) % Z);
    turned(power, signals.at::<L>(1 + input, m), L::splat(-powers[power]))
}

/// i^k times a value and a coefficient.
#[inline(always)]
fn turned<L: Lanes>(k: usize, (re, im): (L, L), value: L) -> (L, L) {
    match k % 4 {
        0 => (value * re, value * im),
        1 => (-(value * im), value * re),
        2 => (-(value * re), -(value * im)),
        _ => (value * im, -(value * re)),
    }
}
