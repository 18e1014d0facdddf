//! Products of the signals on the lines, and their weighted sums.

use super::shape::{INPUTS, ONE, OUTPUT, POWERS, Shape};
use super::tables::{StraightWorkspace, Tables};
use crate::simd::{Lanes, Wide};

/// Sums that registers hold at once.
const RUN: usize = 5;

/// Coefficients of the output and the inputs on the lines.
pub(super) struct Signals<'a> {
    pub re: &'a [Wide],
    pub im: &'a [Wide],
    pub lines: usize,
}

impl Signals<'_> {
    #[inline(always)]
    pub fn at<L: Lanes>(&self, signal: usize, line: usize) -> (L, L) {
        let at = signal * self.lines + line;
        (L::load(&self.re[at]), L::load(&self.im[at]))
    }

    /// This output and the inputs on a line.
    #[inline(always)]
    fn sides<L: Lanes, const I: usize>(&self, output: (L, L), line: usize) -> Sides<L> {
        let mut sides = [output; 1 + INPUTS];
        for k in 1..=I {
            sides[k] = self.at::<L>(k, line);
        }
        sides
    }
}

/// An output and inputs, on one line.
type Sides<L> = [(L, L); 1 + INPUTS];

/// What is written on the lines: weights, denoised output, residual.
pub(super) struct Lines<'a> {
    pub weights: &'a mut [Wide],
    pub hat: (&'a mut [Wide], &'a mut [Wide]),
    pub residual: (&'a mut [Wide], &'a mut [Wide]),
}

/// Products that θ does not change, where they are not there.
#[inline(always)]
pub(super) fn prepare<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    tables: &Tables,
    space: &mut StraightWorkspace,
    signals: &Signals<'_>,
) {
    let (own, shared) = const { (Shape::<N, I, Z>::TABLE.own, Shape::<N, I, Z>::TABLE.shared) };
    if !space.output_ready {
        let places = space.own.chunks_exact_mut(own).zip(&tables.powers);
        for (m, (to, powers)) in places.enumerate() {
            products::<L, N, I, Z, true>(signals, signals.at::<L>(OUTPUT, m), m, powers, to);
        }
        space.output_ready = true;
    }
    if !space.inputs_ready {
        let none = (L::splat(0.0), L::splat(0.0));
        let places = space.shared.chunks_exact_mut(shared).zip(&tables.powers);
        for (m, (to, powers)) in places.enumerate() {
            products::<L, N, I, Z, false>(signals, none, m, powers, to);
        }
        space.inputs_ready = true;
    }
}

/// The products of a line that this output enters (`OWN`), or those that none does.
#[inline(always)]
pub(super) fn products<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const OWN: bool,
>(
    signals: &Signals<'_>,
    output: (L, L),
    m: usize,
    powers: &[f64; POWERS],
    to: &mut [Wide],
) {
    let (own, shared) = const { (Shape::<N, I, Z>::TABLE.own, Shape::<N, I, Z>::TABLE.shared) };
    let (first, count) = if OWN { (0, own) } else { (own, shared) };
    let sides = signals.sides::<L, I>(output, m);
    let to = &mut to[..count];
    // Written out, since which product it is must be known where it is compiled.
    macro_rules! write {
        ($($k:literal)*) => {$(
            if $k < count {
                let t = &Shape::<N, I, Z>::TABLE.terms[first + $k];
                let part = product(&sides, t.left, side(&sides, t.right), t.power);
                (part * L::splat(powers[t.power])).store(&mut to[$k]);
            }
        )*};
    }
    write!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
}

#[inline(always)]
fn side<L: Lanes>(sides: &Sides<L>, signal: usize) -> (L, L) {
    if signal == ONE { (L::splat(1.0), L::splat(0.0)) } else { sides[signal] }
}

/// Re of conj(a)·b for an even power, else Im; a is a signal.
#[inline(always)]
fn product<L: Lanes>(sides: &Sides<L>, signal: usize, b: (L, L), power: usize) -> L {
    let even = power.is_multiple_of(2);
    if signal == ONE {
        return if even { b.0 } else { b.1 };
    }
    let a = sides[signal];
    if even { a.0.mul_add(b.0, a.1 * b.1) } else { a.0.mul_add(b.1, -(a.1 * b.0)) }
}

/// Σ λ · product over the lines, of the products from number `first` on of `count` a line.
#[inline(always)]
pub(super) fn accumulate<L: Lanes>(
    products: &[Wide],
    count: usize,
    first: usize,
    weights: &[Wide],
    sums: &mut [Wide],
) {
    macro_rules! run {
        ($($k:literal)*) => {$(
            let from = first + $k * RUN;
            if from < count {
                let to = &mut sums[$k * RUN..];
                match count - from {
                    1 => together::<L, 1>(products, count, from, weights, to),
                    2 => together::<L, 2>(products, count, from, weights, to),
                    3 => together::<L, 3>(products, count, from, weights, to),
                    4 => together::<L, 4>(products, count, from, weights, to),
                    _ => together::<L, RUN>(products, count, from, weights, to),
                }
            }
        )*};
    }
    run!(0 1 2 3);
}

#[inline(always)]
fn together<L: Lanes, const W: usize>(
    products: &[Wide],
    count: usize,
    from: usize,
    weights: &[Wide],
    sums: &mut [Wide],
) {
    let mut acc = [L::splat(0.0); W];
    // Two lines a turn: a loop over the few lines of a small problem is mostly overhead.
    let (pairs, last) = weights.as_chunks::<2>();
    for ([first, second], lines) in pairs.iter().zip(products.chunks_exact(2 * count)) {
        let (first, second) = (L::load(first), L::load(second));
        let (own, next) = (&lines[from..from + W], &lines[count + from..count + from + W]);
        for i in 0..W {
            acc[i] = second.mul_add(L::load(&next[i]), first.mul_add(L::load(&own[i]), acc[i]));
        }
    }
    if let [weight] = last {
        let (weight, own) = (L::load(weight), &products[2 * pairs.len() * count + from..][..W]);
        for i in 0..W {
            acc[i] = weight.mul_add(L::load(&own[i]), acc[i]);
        }
    }
    for i in 0..W {
        acc[i].store(&mut sums[i]);
    }
}

/// Σ λ · product of the products with the denoised output, which each step makes anew.
#[inline(always)]
pub(super) fn beside<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    tables: &Tables,
    signals: &Signals<'_>,
    on: &Lines<'_>,
    sums: &mut [Wide],
) {
    let count = const { Shape::<N, I, Z>::TABLE.beside };
    macro_rules! run {
        ($($k:literal)*) => {$(
            if $k * RUN < count {
                let to = &mut sums[$k * RUN..];
                match count - $k * RUN {
                    1 => with_model::<L, N, I, Z, $k, 1>(tables, signals, on, to),
                    2 => with_model::<L, N, I, Z, $k, 2>(tables, signals, on, to),
                    3 => with_model::<L, N, I, Z, $k, 3>(tables, signals, on, to),
                    4 => with_model::<L, N, I, Z, $k, 4>(tables, signals, on, to),
                    _ => with_model::<L, N, I, Z, $k, RUN>(tables, signals, on, to),
                }
            }
        )*};
    }
    run!(0 1 2 3);
}

#[inline(always)]
fn with_model<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const K: usize,
    const W: usize,
>(
    tables: &Tables,
    signals: &Signals<'_>,
    on: &Lines<'_>,
    sums: &mut [Wide],
) {
    let first = const { Shape::<N, I, Z>::TABLE.own + Shape::<N, I, Z>::TABLE.shared + K * RUN };
    let lines = on.weights.len();
    let (hat_re, hat_im) = (&on.hat.0[..lines], &on.hat.1[..lines]);
    let powers = &tables.powers[..lines];
    let mut acc = [L::splat(0.0); W];
    for m in 0..lines {
        let lambda = L::load(&on.weights[m]);
        let hat = (L::load(&hat_re[m]), L::load(&hat_im[m]));
        let sides = signals.sides::<L, I>(signals.at(OUTPUT, m), m);
        for i in 0..W {
            let t = &Shape::<N, I, Z>::TABLE.terms[first + i];
            let product = product(&sides, t.left, hat, t.power) * L::splat(powers[m][t.power]);
            acc[i] = lambda.mul_add(product, acc[i]);
        }
    }
    for i in 0..W {
        acc[i].store(&mut sums[i]);
    }
}
