//! The iteration of a small problem whose sizes are known when it is compiled: sums, system and iterate in registers.
//!
//! It does what `pass::step` and `iterate` do, operation by operation and to the bit.

use super::shape::{INPUTS, ONE, OUTPUT, POWERS, SUMS, Shape};
use super::tables::{Space, Tables};
use crate::covariance::{polynomial, variance};
use crate::estimate::iterates::half_way;
use crate::estimate::rule::{ASK, Rule, Run};
use crate::estimate::workspace::Workspace;
use crate::linalg::lanes::judge;
use crate::simd::{Kernel, Lanes, Wide};
use crate::threads::stopped;

/// Sums that registers hold at once.
const RUN: usize = 5;

/// Iterates the active lanes, as long as all pivots may be trusted.
pub(super) struct Steps<'a, const N: usize, const I: usize, const Z: usize, const S: usize> {
    pub tables: &'a Tables,
    pub space: &'a mut Workspace,
    pub run: &'a mut Run,
}

/// What a step finds.
struct Step<L, const S: usize> {
    next: [L; S],
    trusted: L,
    moved: L,
    cost: L,
}

impl<const N: usize, const I: usize, const Z: usize, const S: usize> Kernel
    for Steps<'_, N, I, Z, S>
{
    /// Whether it came to its end; else the next step waits for the general path.
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        if !L::HINTS {
            return false;
        }
        let Steps { tables, space, run } = self;
        match run.rule {
            Rule::Ml => iterate::<L, N, I, Z, S, true>(tables, space, run),
            Rule::Wls | Rule::Awls => iterate::<L, N, I, Z, S, false>(tables, space, run),
        }
    }
}

#[inline(always)]
fn iterate<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const ML: bool,
>(
    tables: &Tables,
    w: &mut Workspace,
    run: &mut Run,
) -> bool {
    let Workspace { records, iterates, progress, weights, straight, .. } = w;
    let Workspace { hat_re, hat_im, residual_re, residual_im, .. } = w;
    let r = &mut records[0];
    let lines = r.limit;
    let signals = Signals { re: &r.re, im: &r.im, lines: r.lines };
    prepare::<L, N, I, Z>(tables, straight, &signals);
    let mut on = Lines {
        weights: &mut weights[..lines],
        hat: (&mut hat_re[..lines], &mut hat_im[..lines]),
        residual: (&mut residual_re[..lines], &mut residual_im[..lines]),
    };
    let (theta, transient) = (&mut iterates.theta, &mut iterates.transients[0]);
    let mut now = read::<L, S, N>(&transient.now, &theta.now);
    let mut best = now;
    if ML {
        best = read::<L, S, N>(&transient.best, &theta.best);
    }
    let mut at = progress.load::<L>();
    let limit = L::splat(run.limit);
    let mut sound = true;
    while run.left > 0 && at.active.any() {
        if run.left.is_multiple_of(ASK) && stopped() {
            break;
        }
        let flat = run.rule == Rule::Wls;
        let found = step::<L, N, I, Z, S, ML>(tables, straight, &signals, &mut on, &now, flat);
        (at.moved, at.cost) = (found.moved, found.cost);
        if at.unsound(found.trusted).any() {
            sound = false;
            break;
        }
        run.left -= 1;
        if !flat {
            at.nit = at.nit + at.active;
        }
        let verdict = run.rule.decide(&mut at, limit);
        for k in 0..S {
            if ML {
                best[k] = verdict.taken.choose(now[k], best[k]);
                now[k] = half_way(verdict.halved, best[k], now[k]);
            }
            now[k] = verdict.taken.choose(found.next[k], now[k]);
        }
    }
    write::<L, S, N>(&now, &mut transient.now, &mut theta.now);
    if ML {
        write::<L, S, N>(&best, &mut transient.best, &mut theta.best);
    }
    at.store(progress);
    sound
}

#[inline(always)]
pub(super) fn read<L: Lanes, const S: usize, const N: usize>(
    transient: &[Wide],
    theta: &[Wide],
) -> [L; S] {
    let mut all = [L::splat(0.0); S];
    for k in 0..S {
        all[k] = L::load(if k < N { &transient[k] } else { &theta[k - N] });
    }
    all
}

#[inline(always)]
fn write<L: Lanes, const S: usize, const N: usize>(
    all: &[L; S],
    transient: &mut [Wide],
    theta: &mut [Wide],
) {
    for k in 0..S {
        all[k].store(if k < N { &mut transient[k] } else { &mut theta[k - N] });
    }
}

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
}

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
    space: &mut Space,
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
    let mut sides = [output; 1 + INPUTS];
    for k in 1..=I {
        sides[k] = signals.at::<L>(k, m);
    }
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
fn side<L: Lanes>(sides: &[(L, L); 1 + INPUTS], signal: usize) -> (L, L) {
    if signal == ONE { (L::splat(1.0), L::splat(0.0)) } else { sides[signal] }
}

/// Re of conj(a)·b for an even power, else Im; a is a signal.
#[inline(always)]
fn product<L: Lanes>(sides: &[(L, L); 1 + INPUTS], signal: usize, b: (L, L), power: usize) -> L {
    let even = power.is_multiple_of(2);
    if signal == ONE {
        return if even { b.0 } else { b.1 };
    }
    let a = sides[signal];
    if even { a.0.mul_add(b.0, a.1 * b.1) } else { a.0.mul_add(b.1, -(a.1 * b.0)) }
}

/// The next iterate by the system at this one.
#[inline(always)]
fn step<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const ML: bool,
>(
    tables: &Tables,
    space: &mut Space,
    signals: &Signals<'_>,
    on: &mut Lines<'_>,
    now: &[L; S],
    flat: bool,
) -> Step<L, S> {
    let table = const { &Shape::<N, I, Z>::TABLE };
    let mut cost = L::splat(0.0);
    if flat {
        for (to, weight) in on.weights.iter_mut().zip(&tables.weight) {
            L::splat(*weight).store(to);
        }
    } else {
        cost = weigh::<L, N, I, Z, S, false, ML>(tables, signals, on, now);
    }
    let Space { own, shared, sums, .. } = space;
    let sums = &mut sums[..SUMS];
    // Of the output with itself `ml` needs the size of the target alone.
    let first = if ML { table.target } else { 0 };
    accumulate::<L>(own, table.own, first, on.weights, &mut sums[first..table.own]);
    let with_shared = table.own + table.shared;
    accumulate::<L>(shared, table.shared, 0, on.weights, &mut sums[table.own..with_shared]);
    if ML {
        beside::<L, N, I, Z>(tables, signals, on, &mut sums[with_shared..]);
    }
    let solved = match ML {
        true => solve::<L, N, I, Z, S, false>(sums),
        false => solve::<L, N, I, Z, S, true>(sums),
    };
    let mut largest = L::load(&sums[table.target]);
    let mut moved = L::splat(0.0);
    for k in N..S {
        let size = solved.diagonal[k].abs();
        let change = solved.unknowns[k] - now[k];
        // The maximum that lets NaN pass: it must not read as settled.
        let effect = change * change * size;
        moved = effect.select_lt(moved, moved, effect);
        let own = now[k] * now[k] * size;
        largest = own.select_lt(largest, largest, own);
    }
    Step { next: solved.unknowns, trusted: solved.trusted, moved: moved / largest, cost }
}

/// λ of the lines at an iterate; where asked for the residual r and the denoised output. Returns Σ λ|r|², where one
/// was.
#[inline(always)]
pub(super) fn weigh<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const RESIDUAL: bool,
    const MODEL: bool,
>(
    tables: &Tables,
    signals: &Signals<'_>,
    on: &mut Lines<'_>,
    at: &[L; S],
) -> L {
    // Copies that no store below can change stay in registers.
    let mut theta = [Wide::ZERO; S];
    for k in 0..S {
        at[k].store(&mut theta[k]);
    }
    let (denominator, numerators) = (&theta[N..2 * N], &theta[2 * N..]);
    let lines = on.weights.len();
    let (x, size_x, weight) =
        (&tables.x[..lines], &tables.size_x[..lines], &tables.weight[..lines]);
    let powers = &tables.powers[..lines];
    let weights = &mut on.weights[..lines];
    let (hat_re, hat_im) = (&mut on.hat.0[..lines], &mut on.hat.1[..lines]);
    let mut cost = L::splat(0.0);
    for m in 0..lines {
        let point = L::splat(x[m]);
        let a = polynomial::<L>(true, denominator, point);
        let inverse = L::splat(1.0) / variance::<L>(a, denominator, L::splat(size_x[m]));
        let lambda = L::splat(weight[m]) * inverse;
        lambda.store(&mut weights[m]);
        if !RESIDUAL && !MODEL {
            continue;
        }
        let y = signals.at::<L>(OUTPUT, m);
        let mut re = (-a.1).mul_add(y.1, a.0 * y.0);
        let mut im = a.1.mul_add(y.0, a.0 * y.1);
        for k in 0..I {
            let (p, q) = signals.at::<L>(1 + k, m);
            let b = polynomial::<L>(false, &numerators[k * Z..(k + 1) * Z], point);
            re = (-b.0).mul_add(p, re);
            im = (-b.0).mul_add(q, im);
            if Z > 1 {
                re = b.1.mul_add(q, re);
                im = (-b.1).mul_add(p, im);
            }
        }
        for j in 0..N {
            let value = L::splat(-powers[m][j]);
            if j % 2 == 0 {
                re = value.mul_add(at[j], re);
            } else {
                im = value.mul_add(at[j], im);
            }
        }
        cost = lambda.mul_add(re.mul_add(re, im * im), cost);
        if RESIDUAL {
            re.store(&mut on.residual.0[m]);
            im.store(&mut on.residual.1[m]);
        }
        if MODEL {
            (y.0 - a.0.mul_add(re, a.1 * im) * inverse).store(&mut hat_re[m]);
            (y.1 - a.0.mul_add(im, -(a.1 * re)) * inverse).store(&mut hat_im[m]);
        }
    }
    cost
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
fn beside<L: Lanes, const N: usize, const I: usize, const Z: usize>(
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
        let mut sides = [signals.at::<L>(OUTPUT, m); 1 + INPUTS];
        for k in 1..=I {
            sides[k] = signals.at::<L>(k, m);
        }
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

/// The solution of a system, with what is asked about it.
struct Solved<L, const S: usize> {
    unknowns: [L; S],
    /// The diagonal before elimination.
    diagonal: [L; S],
    trusted: L,
}

/// Solves the system that sums make, as `linalg::lanes` does.
#[inline(always)]
fn solve<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const SYMMETRIC: bool,
>(
    sums: &[Wide],
) -> Solved<L, S> {
    let zero = L::splat(0.0);
    let (mut m, mut right) = ([[zero; S]; S], [zero; S]);
    let mut solved = Solved { unknowns: [zero; S], diagonal: [zero; S], trusted: L::splat(1.0) };
    // Written out, since the number of earlier rows must be known where a row is compiled.
    macro_rules! rows {
        ($($i:literal)*) => {$(
            if $i < S {
                reduce::<L, N, I, Z, S, $i, SYMMETRIC>(sums, &mut m, &mut right, &mut solved);
            }
        )*};
    }
    rows!(0 1 2 3 4 5 6 7 8);
    for i in (0..S).rev() {
        let mut sum = right[i];
        for j in i + 1..S {
            sum = (-m[i][j]).mul_add(solved.unknowns[j], sum);
        }
        solved.unknowns[i] = sum * m[i][i];
    }
    solved
}

/// Row `R` less its multiples of the rows before; its inverse pivot stands on the diagonal.
#[inline(always)]
fn reduce<
    L: Lanes,
    const N: usize,
    const I: usize,
    const Z: usize,
    const S: usize,
    const R: usize,
    const SYMMETRIC: bool,
>(
    sums: &[Wide],
    m: &mut [[L; S]; S],
    right: &mut [L; S],
    solved: &mut Solved<L, S>,
) {
    let first = if SYMMETRIC { R } else { 0 };
    let mut own = [L::splat(0.0); S];
    for j in first..S {
        own[j] = entry::<L, N, I, Z>(sums, SYMMETRIC, R, j);
    }
    let mut last = entry::<L, N, I, Z>(sums, SYMMETRIC, R, S);
    let before = own[R];
    for k in 0..R {
        // Even and odd powers of the transient never meet.
        if R < N && (R - k) % 2 == 1 {
            continue;
        }
        let lead = if SYMMETRIC { m[k][R] } else { own[k] };
        let factor = -(lead * m[k][k]);
        for j in if SYMMETRIC { R } else { k + 1 }..S {
            own[j] = factor.mul_add(m[k][j], own[j]);
        }
        last = factor.mul_add(right[k], last);
    }
    solved.diagonal[R] = before;
    solved.trusted = judge(own[R], before, solved.trusted);
    own[R] = L::splat(1.0) / own[R];
    (m[R], right[R]) = (own, last);
}

#[inline(always)]
pub(super) fn entry<L: Lanes, const N: usize, const I: usize, const Z: usize>(
    sums: &[Wide],
    symmetric: bool,
    i: usize,
    j: usize,
) -> L {
    let e = Shape::<N, I, Z>::TABLE.entry(symmetric, i, j);
    if e.from == SUMS {
        return L::splat(0.0);
    }
    let sum = L::load(&sums[e.from]);
    if e.negative { -sum } else { sum }
}
