//! The weighted sums over lines that normal matrices are made of: which are needed, and the kernels that form them.
//!
//! As s is imaginary, every entry of JᵀWΓ is ± Σ_m λ x^k Re or Im of conj(V)W for two signals, λ the
//! weight of a line. Entries share sums. What does not depend on θ, x^k times the product, is written
//! once a replicate; a step is left with λ and one multiply-add a sum and line.

use super::record_workspace::RecordWorkspace;
use crate::linalg::lanes::Entry;
use crate::modulation::{Column, Signal};
use crate::simd::{Lanes, Wide};
use std::ops::Range;

/// x^power times Re or Im of conj(left)·right, on every line.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Product {
    left: Signal,
    right: Signal,
    imaginary: bool,
    power: i32,
}

/// Products of the same two signals, which are written together: parts of one kind, or in turn real and imaginary.
#[derive(Debug, Clone)]
struct Family {
    /// The output stands on the left; the denoised output on the right.
    output: bool,
    beside: bool,
    /// The right side is the output, too.
    square: bool,
    /// Places of the two signals in the workspace.
    left: usize,
    right: usize,
    /// Place of the first among all products, and how many stand in the families before.
    first: usize,
    before: usize,
    /// Powers of x.
    powers: Vec<i32>,
    /// Whether the first product is an imaginary part, and whether imaginary and real parts alternate.
    imaginary: bool,
    alternates: bool,
}

impl Family {
    /// Whether a product of this part may follow.
    fn continues_with(&self, imaginary: bool) -> bool {
        let turned = imaginary != self.imaginary;
        let count = self.powers.len();
        count == 1 || turned == (self.alternates && count % 2 == 1)
    }
}

/// Products summed together, in a run: as many sums as registers hold.
const MOST: usize = 6;
const LEAST: usize = 4;

/// All products of a problem: those of the data first, then those with the denoised output.
///
/// They lie in runs of equal width, in each line after line; what fills a run up stays zero.
#[derive(Debug, Clone, Default)]
pub(crate) struct Products {
    families: Vec<Family>,
    width: usize,
    /// Places there are, a multiple of the width.
    pub count: usize,
    /// Place of x^2n |Y|², the size of the target column.
    pub target: usize,
}

/// One kind of system: the runs it sums, and its entries, sums with their signs.
#[derive(Debug, Clone, Default)]
pub(crate) struct SumPlan {
    runs: Range<usize>,
    pub entries: Vec<Entry>,
}

/// Products and systems of a problem with these columns and so many inputs: of the data with themselves,
/// and with `instrument` also the one whose rows are made of the denoised output.
pub(crate) fn plan_sums(
    columns: &[Column],
    target: Column,
    inputs: usize,
    instrument: bool,
) -> (Products, SumPlan, SumPlan) {
    let right: Vec<Column> = columns.iter().copied().chain([target]).collect();
    let model = |c: &Column| match c.signal {
        Signal::Y => Column { signal: Signal::Denoised, ..*c },
        _ => *c,
    };
    let left: Vec<Column> = columns.iter().map(model).collect();
    let symmetric = pairs(columns, &right, true);
    let instrument = if instrument { pairs(&left, &right, false) } else { Vec::new() };
    let size =
        Product { left: Signal::Y, right: Signal::Y, imaginary: false, power: 2 * target.power };
    let mut all: Vec<Product> =
        symmetric.iter().chain(&instrument).filter_map(|(p, _)| *p).chain([size]).collect();
    all.sort_by_key(|p| (p.class(), p.left, p.right, p.power, p.imaginary));
    all.dedup();
    // The width that leaves least of the last run empty.
    let data = all.iter().filter(|p| p.class() < BESIDE).count();
    let width = (LEAST..=MOST).rev().min_by_key(|w| data.next_multiple_of(*w)).unwrap_or(MOST);
    let data_runs = data.div_ceil(width);
    let place = |k: usize| if k < data { k } else { data_runs * width + (k - data) };
    let signal = |signal: Signal| match signal {
        Signal::Y | Signal::Denoised => 0,
        Signal::U(k) => 1 + k,
        Signal::One => 1 + inputs,
    };
    let mut families: Vec<Family> = Vec::new();
    for (k, p) in all.iter().enumerate() {
        let before = k.checked_sub(1).map(|k| all[k]);
        let joins = before.is_some_and(|b| (b.left, b.right) == (p.left, p.right));
        match families.last_mut() {
            Some(f) if joins && place(k) % width != 0 && f.continues_with(p.imaginary) => {
                f.alternates = f.imaginary != p.imaginary || f.alternates;
                f.powers.push(p.power);
            }
            _ => families.push(Family {
                output: p.left == Signal::Y && p.right != Signal::Denoised,
                beside: p.right == Signal::Denoised,
                square: p.right == Signal::Y,
                left: signal(p.left),
                right: signal(p.right),
                first: place(k),
                before: k,
                powers: vec![p.power],
                imaginary: p.imaginary,
                alternates: false,
            }),
        }
    }
    let found = |product: &Option<Product>| all.iter().position(|p| Some(*p) == *product);
    let count = data_runs * width + (all.len() - data).next_multiple_of(width);
    let plan = |entries: &[(Option<Product>, f64)], runs: Range<usize>| {
        // One sum more than there are places stays zero.
        let entry = |(product, sign): &(Option<Product>, f64)| Entry {
            from: found(product).map_or(count, place),
            sign: *sign,
        };
        SumPlan { runs, entries: entries.iter().map(entry).collect() }
    };
    // What the steps of `ml` sum: their own products, and the run that holds the target's size.
    let target = found(&Some(size)).map_or(count, place);
    let symmetric = plan(&symmetric, 0..data_runs);
    let instrument = plan(&instrument, target / width..count / width);
    (Products { families, width, count, target }, symmetric, instrument)
}

/// Entries (product, sign), row after row, of a system with rows `left` and columns `right`, the last of
/// which is the target: it enters with the opposite sign, as a right side. `symmetric`: upper triangle only.
fn pairs(left: &[Column], right: &[Column], symmetric: bool) -> Vec<(Option<Product>, f64)> {
    let mut entries = Vec::new();
    for (i, l) in left.iter().enumerate() {
        for (j, r) in right.iter().enumerate().skip(if symmetric { i } else { 0 }) {
            let target = if j + 1 == right.len() { -1.0 } else { 1.0 };
            let found = product_of(l, r);
            let sign = found.map_or(1.0, |(_, sign)| sign * target);
            entries.push((found.map(|(product, _)| product), sign));
        }
    }
    entries
}

/// Re(conj(l) r) of two columns on a line, as a product and a sign; `None` where it vanishes.
fn product_of(l: &Column, r: &Column) -> Option<(Product, f64)> {
    // Re(i^d G) is Re G, −Im G, −Re G, Im G for d = 0, 1, 2, 3.
    let turn = (r.phase + 4 - l.phase) % 4;
    let imaginary = turn % 2 == 1;
    let mut sign = l.sign * r.sign * if turn == 1 || turn == 2 { -1.0 } else { 1.0 };
    let (mut left, mut right) = (l.signal, r.signal);
    if imaginary && left == right {
        return None;
    }
    if left > right {
        std::mem::swap(&mut left, &mut right);
        if imaginary {
            sign = -sign;
        }
    }
    Some((Product { left, right, imaginary, power: l.power + r.power }, sign))
}

/// The class of products with the denoised output.
const BESIDE: usize = 2;

impl Product {
    /// 0: the output with itself; 1: other data; 2: with the denoised output.
    fn class(&self) -> usize {
        match (self.left, self.right) {
            (_, Signal::Denoised) => BESIDE,
            (Signal::Y, Signal::Y) => 0,
            _ => 1,
        }
    }
}

/// Which products of the data are written.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Data {
    /// None: they are there.
    Nothing,
    /// Those that the output enters.
    Outputs,
    /// All.
    All,
}

/// A denoised output, and what becomes of it.
#[derive(Clone, Copy)]
pub(crate) struct Model<'a> {
    pub re: &'a [Wide],
    pub im: &'a [Wide],
    /// It stands for the output in the products of the data; otherwise beside it, in products of its own.
    pub replaces: bool,
}

impl Products {
    /// The factors x^k on all lines of a record, family after family.
    pub fn powers_of(&self, x: &[f64]) -> Vec<f64> {
        let power = |x: f64, k: i32| {
            let size = (0..k.unsigned_abs()).fold(1.0, |p: f64, _| p * x);
            if k < 0 { 1.0 / size } else { size }
        };
        let of = |f: &Family| -> Vec<f64> {
            x.iter().flat_map(|x| f.powers.iter().map(|k| power(*x, *k))).collect()
        };
        self.families.iter().flat_map(of).collect()
    }

    /// Writes products on the lines `range` of a record; `powers` as [`Products::powers_of`] gives them.
    #[inline(always)]
    pub fn write<L: Lanes>(
        &self,
        r: &mut RecordWorkspace,
        range: Range<usize>,
        powers: &[f64],
        data: Data,
        model: Option<Model<'_>>,
    ) {
        let RecordWorkspace { re, im, products, lines, rows, .. } = r;
        let (lines, rows) = (*lines, *rows);
        let (part, width) = (range.len(), self.width);
        let (replaces, besides) = match model {
            Some(m) => (m.replaces, !m.replaces),
            None => (false, false),
        };
        for f in &self.families {
            let replaced = replaces && f.output;
            let of_data = !f.beside && (data == Data::All || (data == Data::Outputs && f.output));
            if !(replaced || (besides && f.beside) || of_data) {
                continue;
            }
            let (left, right) = (f.left * lines + range.start, f.right * lines + range.start);
            let mut a = (&re[left..left + part], &im[left..left + part]);
            let mut b = (&re[right..right + part], &im[right..right + part]);
            if let Some(m) = model {
                let hat = (&m.re[..part], &m.im[..part]);
                if replaced {
                    a = hat;
                }
                if f.beside || (replaced && f.square) {
                    b = hat;
                }
            }
            let count = f.powers.len();
            let powers = &powers[f.before * lines + range.start * count..][..part * count];
            let at = f.first % width;
            let to = &mut products[(f.first - at) * rows..][..part * width];
            let to = (to, width, at);
            let from = (a, b, f.imaginary);
            match (count, f.alternates) {
                (1, _) => write_family::<L, 1, false>(from, powers, to),
                (2, false) => write_family::<L, 2, false>(from, powers, to),
                (3, false) => write_family::<L, 3, false>(from, powers, to),
                (4, false) => write_family::<L, 4, false>(from, powers, to),
                (5, false) => write_family::<L, 5, false>(from, powers, to),
                (_, false) => write_family::<L, 6, false>(from, powers, to),
                (2, true) => write_family::<L, 2, true>(from, powers, to),
                (3, true) => write_family::<L, 3, true>(from, powers, to),
                (4, true) => write_family::<L, 4, true>(from, powers, to),
                (5, true) => write_family::<L, 5, true>(from, powers, to),
                (_, true) => write_family::<L, 6, true>(from, powers, to),
            }
        }
    }

    /// Adds Σ λ · product over the lines of a tile for the runs of a system; the tile that `begins` a
    /// record starts from zero.
    #[inline(always)]
    pub fn accumulate<L: Lanes>(
        &self,
        plan: &SumPlan,
        r: &RecordWorkspace,
        weights: &[Wide],
        begins: bool,
        sums: &mut [Wide],
    ) {
        match self.width {
            4 => together::<L, 4>(plan, r, weights, begins, sums),
            5 => together::<L, 5>(plan, r, weights, begins, sums),
            _ => together::<L, 6>(plan, r, weights, begins, sums),
        }
    }
}

type Complex<'a> = (&'a [Wide], &'a [Wide]);

/// Im (`imaginary`) or Re of conj(a)·b, or with `ALTERNATES` both in turn, times `N` powers of x on each line, to
/// a run with so many products per line, from its place `at` on.
#[inline(always)]
fn write_family<L: Lanes, const N: usize, const ALTERNATES: bool>(
    (a, b, imaginary): (Complex<'_>, Complex<'_>, bool),
    powers: &[f64],
    (to, width, at): (&mut [Wide], usize, usize),
) {
    let powers = powers.as_chunks::<N>().0;
    for i in 0..powers.len().min(a.0.len()).min(a.1.len()).min(b.0.len()).min(b.1.len()) {
        let (p, q) = (L::load(&a.0[i]), L::load(&a.1[i]));
        let (re, im) = (L::load(&b.0[i]), L::load(&b.1[i]));
        let (even, odd) = if imaginary {
            (p.mul_add(im, -(q * re)), p.mul_add(re, q * im))
        } else {
            (p.mul_add(re, q * im), p.mul_add(im, -(q * re)))
        };
        let to = &mut to[i * width + at..][..N];
        for k in 0..N {
            let part = if ALTERNATES && k % 2 == 1 { odd } else { even };
            (part * L::splat(powers[i][k])).store(&mut to[k]);
        }
    }
}

/// Sums of the runs of a plan, `N` products wide.
#[inline(always)]
fn together<L: Lanes, const N: usize>(
    plan: &SumPlan,
    r: &RecordWorkspace,
    weights: &[Wide],
    begins: bool,
    sums: &mut [Wide],
) {
    let (products, sums) = (r.products.as_chunks::<N>().0, sums.as_chunks_mut::<N>().0);
    for run in plan.runs.clone() {
        let (own, sums) = (&products[run * r.rows..][..weights.len()], &mut sums[run]);
        let mut acc = [L::splat(0.0); N];
        if !begins {
            for i in 0..N {
                acc[i] = L::load(&sums[i]);
            }
        }
        for line in 0..weights.len() {
            let weight = L::load(&weights[line]);
            for i in 0..N {
                acc[i] = weight.mul_add(L::load(&own[line][i]), acc[i]);
            }
        }
        for i in 0..N {
            acc[i].store(&mut sums[i]);
        }
    }
}
