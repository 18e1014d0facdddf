//! Iterates of eight replicates, and where each replicate stands.

use crate::simd::{LANES, Lanes, Wide};

/// Unknowns at the current iterate, where a step leads, and at the best iterate so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Iterate {
    pub now: Vec<Wide>,
    pub next: Vec<Wide>,
    pub best: Vec<Wide>,
}

impl Iterate {
    fn new(unknowns: usize) -> Iterate {
        let none = vec![Wide::ZERO; unknowns];
        Iterate { now: none.clone(), next: none.clone(), best: none }
    }
}

/// All unknowns of a problem: θ, and the coefficients of each record's transient.
#[derive(Debug, Clone, Default)]
pub(crate) struct Iterates {
    pub theta: Iterate,
    pub transients: Vec<Iterate>,
}

impl Iterates {
    /// For so many parameters, and so many transient coefficients in each of `records`.
    pub fn new(parameters: usize, transient: usize, records: usize) -> Iterates {
        Iterates {
            theta: Iterate::new(parameters),
            transients: (0..records).map(|_| Iterate::new(transient)).collect(),
        }
    }

    /// Makes the next iterate the current one in the lanes `of`.
    #[inline(always)]
    pub fn advance<L: Lanes>(&mut self, of: L) {
        choose(of, &self.theta.next, &mut self.theta.now);
        for t in &mut self.transients {
            choose(of, &t.next, &mut t.now);
        }
    }

    /// Remembers the current iterate as the best so far in the lanes `of`.
    #[inline(always)]
    pub fn keep<L: Lanes>(&mut self, of: L) {
        choose(of, &self.theta.now, &mut self.theta.best);
        for t in &mut self.transients {
            choose(of, &t.now, &mut t.best);
        }
    }

    /// Moves the current iterate half way back to the best so far in the lanes `of`.
    #[inline(always)]
    pub fn halve<L: Lanes>(&mut self, of: L) {
        half_way(of, &self.theta.best, &mut self.theta.now);
        for t in &mut self.transients {
            half_way(of, &t.best, &mut t.now);
        }
    }
}

#[inline(always)]
fn choose<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        of.choose(L::load(from), L::load(to)).store(to);
    }
}

#[inline(always)]
fn half_way<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        let here = L::load(to);
        of.choose(L::splat(0.5) * (here + L::load(from)), here).store(to);
    }
}

/// Where eight replicates stand, one number per lane.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Progress {
    /// 1 in lanes that still iterate, else 0.
    pub active: Wide,
    /// Iterations after the start.
    pub nit: Wide,
    /// Cost at the current iterate, and the lowest so far.
    pub cost: Wide,
    pub best: Wide,
    /// Largest squared change of a parameter in the last step, as its effect relative to the largest
    /// term; that of the step before.
    pub moved: Wide,
    pub last_move: Wide,
    /// Steps halved in a row.
    pub halvings: Wide,
}

impl Progress {
    /// Nothing known yet: the live lanes iterate, the others do not.
    pub fn begin(&mut self, live: [bool; LANES]) {
        self.nit = Wide::ZERO;
        self.again(Wide(live.map(f64::from)));
    }

    /// These lanes iterate anew from where they stand.
    pub fn again(&mut self, lanes: Wide) {
        self.active = lanes;
        self.best = Wide::splat(f64::INFINITY);
        self.last_move = Wide::splat(f64::INFINITY);
        self.halvings = Wide::ZERO;
    }
}

/// Active lanes whose step small pivots spoiled.
#[inline(always)]
pub(crate) fn unsound<L: Lanes>(progress: &Progress, trusted: &Wide) -> L {
    let (active, trusted) = (L::load(&progress.active), L::load(trusted));
    // A step that is not finite shows as a move that is not.
    let sound = L::load(&progress.moved).select_lt(L::splat(f64::INFINITY), trusted, L::splat(0.0));
    active - active * sound
}

/// a ≤ b as a mask; true where either is no number.
#[inline(always)]
pub(crate) fn at_most<L: Lanes>(a: L, b: L) -> L {
    b.select_lt(a, L::splat(0.0), L::splat(1.0))
}

/// Lanes that moved by no more than the limit, or are lost: from a step that is not finite, orthogonal
/// factors or not, no way leads back.
#[inline(always)]
pub(crate) fn settled<L: Lanes>(progress: &Progress, limit: L) -> L {
    let moved = L::load(&progress.moved);
    let lost = moved.select_lt(L::splat(f64::INFINITY), L::splat(0.0), L::splat(1.0));
    at_most(moved, limit).max(lost)
}
