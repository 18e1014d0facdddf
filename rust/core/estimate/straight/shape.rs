//! Small problems whose sizes are known when they are compiled: the sums their systems are made of, and where each
//! stands.
//!
//! Every entry of JᵀWΓ is ± Σ_m λ x^k P, P the real part of conj(V)W for two signals where k is even and its
//! imaginary part where k is odd: a sum is named by its signals and its power. The signs are those of `sums.rs`.

/// N poles, and I inputs with Z numerator coefficients each; the transient has N coefficients.
pub(super) struct Shape<const N: usize, const I: usize, const Z: usize>;

impl<const N: usize, const I: usize, const Z: usize> Shape<N, I, Z> {
    pub const TABLE: Table = table(N, I, Z);
}

/// Signals: the output, the constant one, the denoised output; inputs from 1 on.
pub(super) const OUTPUT: usize = 0;
pub(super) const ONE: usize = 8;
const DENOISED: usize = 9;

/// Most inputs of a shape, most powers of x, most sums, most entries of a system.
pub(super) const INPUTS: usize = 2;
pub(super) const POWERS: usize = 8;
pub(super) const SUMS: usize = 48;
const ENTRIES: usize = 96;

/// One sum: two signals, the power of x.
#[derive(Clone, Copy)]
pub(super) struct Term {
    pub left: usize,
    pub right: usize,
    pub power: usize,
}

/// An entry of a system: a sum with its sign; [`SUMS`] where it vanishes.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub from: usize,
    pub negative: bool,
}

/// Sums and systems of a shape. The sums lie in this order: those with the output, those that no output enters,
/// those with the denoised output.
pub(super) struct Table {
    pub terms: [Term; SUMS],
    pub own: usize,
    pub shared: usize,
    pub beside: usize,
    /// Size of the target column: the last sum of the output with itself.
    pub target: usize,
    /// Upper triangle of the system whose columns are the same on both sides, row after row.
    symmetric: [Entry; ENTRIES],
    /// The system with the denoised output on the left.
    instrument: [Entry; ENTRIES],
    unknowns: usize,
}

impl Table {
    /// The entry at row `i` and column `j`; of the symmetric system the upper triangle.
    pub const fn entry(&self, symmetric: bool, i: usize, j: usize) -> Entry {
        let n = self.unknowns;
        if symmetric {
            self.symmetric[(i * (2 * n + 3 - i)) / 2 + j - i]
        } else {
            self.instrument[i * (n + 1) + j]
        }
    }

    const fn push(&mut self, at: usize, left: usize, right: usize, powers: usize) -> usize {
        let (mut at, mut power) = (at, 0);
        while power < powers {
            self.terms[at] = Term { left, right, power };
            at += 1;
            // The imaginary part of conj(V)V vanishes.
            power += if left == right { 2 } else { 1 };
        }
        at
    }

    const fn find(&self, left: usize, right: usize, power: usize) -> usize {
        let mut k = 0;
        while k < self.own + self.shared + self.beside {
            let t = self.terms[k];
            if t.left == left && t.right == right && t.power == power {
                return k;
            }
            k += 1;
        }
        SUMS
    }

    /// The entry of two columns; the last one, the target, enters as a right side.
    const fn pair(&self, l: Column, r: Column, target: bool) -> Entry {
        // Re(i^d G) is Re G, −Im G, −Re G, Im G for d = 0, 1, 2, 3.
        let turn = (r.phase + 4 - l.phase) % 4;
        let imaginary = turn % 2 == 1;
        let mut negative = (l.negative != r.negative) != (turn == 1 || turn == 2);
        let swapped = l.signal > r.signal;
        if imaginary && l.signal == r.signal {
            return Entry { from: SUMS, negative: false };
        }
        if swapped && imaginary {
            negative = !negative;
        }
        let (left, right) = if swapped { (r.signal, l.signal) } else { (l.signal, r.signal) };
        let from = self.find(left, right, l.power + r.power);
        Entry { from, negative: negative != target }
    }
}

/// sign · i^phase · x^power · V.
#[derive(Clone, Copy)]
struct Column {
    signal: usize,
    power: usize,
    phase: usize,
    negative: bool,
}

/// Column `j` of [T, θ | target].
const fn column(n: usize, z: usize, inputs: usize, j: usize) -> Column {
    if j < n {
        Column { signal: ONE, power: j, phase: j % 2, negative: true }
    } else if j < 2 * n {
        let power = 2 * n - 1 - j;
        Column { signal: OUTPUT, power, phase: power % 4, negative: false }
    } else if j < 2 * n + z * inputs {
        let power = z - 1 - (j - 2 * n) % z;
        Column { signal: 1 + (j - 2 * n) / z, power, phase: power % 4, negative: true }
    } else {
        Column { signal: OUTPUT, power: n, phase: n % 4, negative: false }
    }
}

const fn table(n: usize, inputs: usize, z: usize) -> Table {
    let unknowns = 2 * n + z * inputs;
    let none = Entry { from: SUMS, negative: false };
    let mut t = Table {
        terms: [Term { left: OUTPUT, right: OUTPUT, power: 0 }; SUMS],
        own: 0,
        shared: 0,
        beside: 0,
        target: n,
        symmetric: [none; ENTRIES],
        instrument: [none; ENTRIES],
        unknowns,
    };
    let mut at = t.push(0, OUTPUT, OUTPUT, 2 * n + 1);
    let mut k = 1;
    while k <= inputs {
        at = t.push(at, OUTPUT, k, n + z);
        k += 1;
    }
    t.own = t.push(at, OUTPUT, ONE, 2 * n);
    at = t.own;
    k = 1;
    while k <= inputs {
        let mut l = k;
        while l <= inputs {
            at = t.push(at, k, l, 2 * z - 1);
            l += 1;
        }
        at = t.push(at, k, ONE, n + z - 1);
        k += 1;
    }
    at = t.push(at, ONE, ONE, 2 * n - 1);
    t.shared = at - t.own;
    at = t.push(at, OUTPUT, DENOISED, 2 * n);
    k = 1;
    while k <= inputs {
        at = t.push(at, k, DENOISED, n + z - 1);
        k += 1;
    }
    t.beside = t.push(at, ONE, DENOISED, 2 * n - 1) - t.own - t.shared;
    let (mut i, mut upper, mut all) = (0, 0, 0);
    while i < unknowns {
        let l = column(n, z, inputs, i);
        let model = Column { signal: if l.signal == OUTPUT { DENOISED } else { l.signal }, ..l };
        let mut j = 0;
        while j <= unknowns {
            let r = column(n, z, inputs, j);
            if j >= i {
                t.symmetric[upper] = t.pair(l, r, j == unknowns);
                upper += 1;
            }
            t.instrument[all] = t.pair(model, r, j == unknowns);
            all += 1;
            j += 1;
        }
        i += 1;
    }
    t
}
