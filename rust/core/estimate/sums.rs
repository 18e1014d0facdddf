//! The weighted sums over lines that normal matrices are made of: which are needed, and the kernel that forms them.
//!
//! As s is imaginary, every entry of JᵀWΓ is ± Σ_m w x^k Re or Im of conj(V)W for two signals. Entries
//! share sums; each distinct one is formed once.

use crate::modulation::{Column, Signal};
use crate::simd::{Lanes, Wide};

/// Re or Im of conj(left) · right on every line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Product {
    pub left: Signal,
    pub right: Signal,
    pub imaginary: bool,
}

/// One entry of the system: row, column, which sum, and its sign.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    pub at: usize,
    pub sum: usize,
    pub sign: f64,
}

/// Sums taken together: up to four powers of one product.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Group {
    product: usize,
    count: usize,
    powers: [usize; 4],
    sum: usize,
}

/// All sums of one kind of system.
#[derive(Debug, Clone, Default)]
pub(crate) struct SumPlan {
    pub groups: Vec<Group>,
    pub entries: Vec<Entry>,
    pub count: usize,
}

/// The lowest power of x among all sums; a drift's column brings negative ones.
pub(crate) fn lowest_power(columns: &[Column]) -> i32 {
    2 * columns.iter().map(|c| c.power).min().unwrap_or(0).min(0)
}

impl SumPlan {
    /// Plans the system with rows `left` and columns `right`, the last of `right` being the target
    /// (it enters with the opposite sign, as a right side). `symmetric`: upper triangle only.
    pub fn new(
        left: &[Column],
        right: &[Column],
        symmetric: bool,
        lowest: i32,
        products: &mut Vec<Product>,
    ) -> SumPlan {
        let mut wanted: Vec<(usize, usize)> = Vec::new(); // (product, power index)
        let mut entries: Vec<(usize, (usize, usize), f64)> = Vec::new();
        let width = right.len();
        for (i, l) in left.iter().enumerate() {
            for (j, r) in right.iter().enumerate().skip(if symmetric { i } else { 0 }) {
                let Some((product, sign)) = product_of(l, r) else { continue };
                let index = products.iter().position(|p| *p == product).unwrap_or_else(|| {
                    products.push(product);
                    products.len() - 1
                });
                let key = (index, (l.power + r.power - lowest) as usize);
                if !wanted.contains(&key) {
                    wanted.push(key);
                }
                let target = if j + 1 == width { -1.0 } else { 1.0 };
                entries.push((i * width + j, key, sign * target));
            }
        }
        wanted.sort_unstable();
        let mut groups: Vec<Group> = Vec::new();
        for (sum, (product, power)) in wanted.iter().enumerate() {
            match groups.last_mut() {
                Some(g) if g.product == *product && g.count < 4 => {
                    g.powers[g.count] = *power;
                    g.count += 1;
                }
                _ => groups.push(Group { product: *product, count: 1, powers: [*power; 4], sum }),
            }
        }
        let entries = entries
            .into_iter()
            .filter_map(|(at, key, sign)| {
                wanted.binary_search(&key).ok().map(|sum| Entry { at, sum, sign })
            })
            .collect();
        SumPlan { groups, entries, count: wanted.len() }
    }

    /// Adds this tile's sums: `products` and `powers` are laid out with `stride` lines a row.
    #[inline(always)]
    pub fn accumulate<L: Lanes>(
        &self,
        products: &[Wide],
        powers: &[Wide],
        stride: usize,
        lines: usize,
        sums: &mut [Wide],
    ) {
        for g in &self.groups {
            let product = &products[g.product * stride..][..lines];
            let sums = &mut sums[g.sum..g.sum + g.count];
            match g.count {
                1 => group::<L, 1>(g, product, powers, stride, sums),
                2 => group::<L, 2>(g, product, powers, stride, sums),
                3 => group::<L, 3>(g, product, powers, stride, sums),
                _ => group::<L, 4>(g, product, powers, stride, sums),
            }
        }
    }

    /// Writes the sums into the matrix.
    #[inline(always)]
    pub fn assemble<L: Lanes>(&self, sums: &[Wide], matrix: &mut [Wide]) {
        for e in &self.entries {
            (L::load(&sums[e.sum]) * L::splat(e.sign)).store(&mut matrix[e.at]);
        }
    }
}

#[inline(always)]
fn group<L: Lanes, const N: usize>(
    g: &Group,
    product: &[Wide],
    powers: &[Wide],
    stride: usize,
    sums: &mut [Wide],
) {
    // Loops rather than closures: a closure that is not inlined loses the instruction set.
    let mut w: [&[Wide]; N] = [&[]; N];
    let mut acc = [L::splat(0.0); N];
    for i in 0..N {
        w[i] = &powers[g.powers[i] * stride..][..product.len()];
        acc[i] = L::load(&sums[i]);
    }
    for line in 0..product.len() {
        let v = L::load(&product[line]);
        for i in 0..N {
            acc[i] = L::load(&w[i][line]).mul_add(v, acc[i]);
        }
    }
    for i in 0..N {
        acc[i].store(&mut sums[i]);
    }
}

/// Re(conj(l) r) of two columns on a line, as a product of signals and a sign; `None` where it vanishes.
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
    Some((Product { left, right, imaginary }, sign))
}
