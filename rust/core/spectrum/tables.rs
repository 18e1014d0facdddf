//! Cosines and sines of the folded sums, eight harmonics in a row, and what turns a block to its place.

use crate::math::root_of_unity;
use crate::simd::{LANES, Wide};

/// Entries folded and summed at a time: four of these arrays lie in the first-level cache.
pub(super) const BLOCK: usize = 128;
/// Folded entries up to which the tables cover the whole record; above, those of one block serve all.
const DIRECT: usize = 2048;
/// Blocks whose turns are tabulated one by one; those of more are products.
const FINE: usize = 64;

/// (cos, sin) of eight harmonics.
pub(super) type Row = [Wide; 2];

/// Up to eight of the harmonics `first`, `first + step`, …, which see the same folded samples.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub first: usize,
    pub step: usize,
    pub count: usize,
    /// 2πmk/N: a row an entry, of the whole record or of one block; zeros beyond `count`.
    pub entries: Vec<Row>,
    /// 2πmk₀/N of the blocks' starts as coarse · fine, so that they take little memory and are within two
    /// roundings however long the record. Empty where `entries` covers the record.
    coarse: Vec<Row>,
    fine: Vec<Row>,
}

/// All harmonics 0…M of a window of N intervals: those of either parity for even N, all together for odd.
pub(super) fn groups(intervals: usize, harmonics: usize, length: usize) -> Vec<Group> {
    let turned = length > DIRECT;
    let circle = Circle::new(intervals, !turned);
    let step = if intervals.is_multiple_of(2) { 2 } else { 1 };
    let mut groups = Vec::new();
    for parity in 0..step {
        for first in (parity..=harmonics).step_by(step * LANES) {
            let count = LANES.min((harmonics - first) / step + 1);
            let rows = |number: usize, spacing: usize| -> Vec<Row> {
                let row = |k: usize| circle.row(first, step, count, k * spacing);
                (0..number).map(row).collect()
            };
            let (coarse, fine) = match turned {
                true => (length.div_ceil(BLOCK * FINE), FINE),
                false => (0, 0),
            };
            groups.push(Group {
                first,
                step,
                count,
                entries: rows(if turned { BLOCK } else { length }, 1),
                coarse: rows(coarse, BLOCK * FINE),
                fine: rows(fine, BLOCK),
            });
        }
    }
    groups
}

impl Group {
    /// Whether the tables of one block serve all blocks.
    pub(super) fn turned(&self) -> bool {
        !self.fine.is_empty()
    }

    /// The two rows whose product turns a block to its place.
    pub(super) fn turns(&self, block: usize) -> [&Row; 2] {
        [&self.coarse[block / FINE], &self.fine[block % FINE]]
    }

    /// (cos, sin) that turn one harmonic's sums.
    pub(super) fn turn(&self, block: usize, lane: usize) -> (f64, f64) {
        let [(a, b), (c, d)] = self.turns(block).map(|[cos, sin]| (cos.0[lane], sin.0[lane]));
        (a * c - b * d, b * c + a * d)
    }
}

/// The roots of unity e^{2πik/N}, tabulated where all of them are needed.
struct Circle {
    intervals: usize,
    roots: Vec<(f64, f64)>,
}

impl Circle {
    fn new(intervals: usize, all: bool) -> Circle {
        Circle { intervals, roots: if all { roots(intervals) } else { Vec::new() } }
    }

    /// (cos, sin) of 2πmk/N for the harmonics of a group.
    fn row(&self, first: usize, step: usize, count: usize, k: usize) -> Row {
        let n = self.intervals;
        let mut row = [Wide::ZERO; 2];
        let (mut place, more) = ((first * k) % n, (step * k) % n);
        for lane in 0..count {
            let (cos, sin) = match self.roots.get(place) {
                Some(root) => *root,
                None => root_of_unity(place as u64, n as u64),
            };
            (row[0].0[lane], row[1].0[lane]) = (cos, sin);
            place += more;
            place -= if place >= n { n } else { 0 };
        }
        row
    }
}

/// All e^{2πik/N} as (cos, sin), by symmetry from those of an eighth, a quarter or a half of the circle.
fn roots(n: usize) -> Vec<(f64, f64)> {
    let own = match n % 4 {
        0 => n / 8,
        2 => n / 4,
        _ => n / 2,
    };
    let mut all = Vec::with_capacity(n);
    all.extend((0..=own).map(|k| root_of_unity(k as u64, n as u64)));
    if n.is_multiple_of(4) {
        for k in own + 1..=n / 4 {
            let (cos, sin) = all[n / 4 - k];
            all.push((sin, cos));
        }
    }
    if n.is_multiple_of(2) {
        for k in n / 4 + 1..=n / 2 {
            let (cos, sin) = all[n / 2 - k];
            all.push((-cos, sin));
        }
    }
    for k in n / 2 + 1..n {
        let (cos, sin) = all[n - k];
        all.push((cos, -sin));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_by_symmetry_are_the_roots() {
        for n in (1..70).chain([256, 257, 258, 1000]) {
            let all = roots(n);
            assert_eq!(all.len(), n);
            for (k, (cos, sin)) in all.into_iter().enumerate() {
                assert_eq!((cos, sin), root_of_unity(k as u64, n as u64), "{k}/{n}");
            }
        }
    }
}
