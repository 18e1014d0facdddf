//! Iterates of eight replicates, and where each replicate stands.

use crate::simd::{Kernel, LANES, Lanes, Wide};

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

    /// The largest squared effect of the step on the equations, relative to their largest term: on a line where A
    /// vanishes the target may be nothing. The first `terms` unknowns are coefficients, which have terms.
    #[inline(always)]
    pub fn moved<L: Lanes>(&self, column_size: &[Wide], target_size: &Wide, terms: usize) -> L {
        let mut largest = L::load(target_size);
        let mut moved = L::splat(0.0);
        let steps = self.now.iter().zip(&self.next);
        for (k, ((from, to), column)) in steps.zip(column_size).enumerate() {
            let (from, column) = (L::load(from), L::load(column).abs());
            let change = L::load(to) - from;
            // The maximum that lets NaN pass: it must not read as settled.
            let effect = change * change * column;
            moved = effect.select_lt(moved, moved, effect);
            if k < terms {
                let own = from * from * column;
                largest = own.select_lt(largest, largest, own);
            }
        }
        moved / largest
    }
}

/// [`Iterate::moved`] where steps were replaced.
pub(crate) struct Move<'a> {
    pub theta: &'a Iterate,
    pub column_size: &'a [Wide],
    pub target_size: &'a Wide,
    pub terms: usize,
    pub moved: &'a mut Wide,
}

impl Kernel for Move<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Move { theta, column_size, target_size, terms, moved } = self;
        theta.moved::<L>(column_size, target_size, terms).store(moved);
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

    /// Copies the lanes `of` of the current iterate from others.
    pub fn copy(&mut self, from: &Iterates, of: [bool; LANES]) {
        copy(&from.theta.now, &mut self.theta.now, of);
        for (from, to) in from.transients.iter().zip(&mut self.transients) {
            copy(&from.now, &mut to.now, of);
        }
    }

    /// Copies one lane of the current iterate from a lane of others.
    pub fn take_lane(&mut self, lane: usize, from: &Iterates, of: usize) {
        let transients = self.transients.iter_mut().zip(&from.transients);
        let pairs = transients.map(|(to, from)| (&mut to.now, &from.now));
        for (to, from) in std::iter::once((&mut self.theta.now, &from.theta.now)).chain(pairs) {
            to.iter_mut().zip(from).for_each(|(to, from)| to.0[lane] = from.0[of]);
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
        halve(of, &self.theta.best, &mut self.theta.now);
        for t in &mut self.transients {
            halve(of, &t.best, &mut t.now);
        }
    }
}

fn copy(from: &[Wide], to: &mut [Wide], of: [bool; LANES]) {
    for (from, to) in from.iter().zip(to) {
        for lane in (0..LANES).filter(|lane| of[*lane]) {
            to.0[lane] = from.0[lane];
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
fn halve<L: Lanes>(of: L, from: &[Wide], to: &mut [Wide]) {
    for (from, to) in from.iter().zip(to) {
        half_way(of, L::load(from), L::load(to)).store(to);
    }
}

/// `here`, and in the lanes `of` half way back to `from`.
#[inline(always)]
pub(crate) fn half_way<L: Lanes>(of: L, from: L, here: L) -> L {
    of.choose(L::splat(0.5) * (here + from), here)
}

/// Where eight replicates stand, one number per lane.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Progress<T = Wide> {
    /// 1 in lanes that still iterate, else 0.
    pub active: T,
    /// Iterations after the start.
    pub nit: T,
    /// Cost at the current iterate, and the lowest so far.
    pub cost: T,
    pub best: T,
    /// Largest squared change of a parameter in the last step, as its effect relative to the largest
    /// term; that of the step before.
    pub moved: T,
    pub last_move: T,
    /// Steps halved in a row.
    pub halvings: T,
}

/// What becomes of a step, as masks: lanes that take it, lanes that go half way back to the best iterate.
pub(crate) struct Verdict<L> {
    pub taken: L,
    pub halved: L,
}

impl<L: Lanes> Progress<L> {
    /// Writes it to memory.
    #[inline(always)]
    pub fn store(self, to: &mut Progress) {
        self.active.store(&mut to.active);
        self.nit.store(&mut to.nit);
        self.cost.store(&mut to.cost);
        self.best.store(&mut to.best);
        self.moved.store(&mut to.moved);
        self.last_move.store(&mut to.last_move);
        self.halvings.store(&mut to.halvings);
    }

    /// Active lanes whose step small pivots spoiled.
    #[inline(always)]
    pub fn unsound(&self, trusted: L) -> L {
        // A step that is not finite shows as a move that is not.
        let sound = self.moved.select_lt(L::splat(f64::INFINITY), trusted, L::splat(0.0));
        self.active - self.active * sound
    }

    /// Lanes that moved by no more than the limit, or are lost: from a step that is not finite, orthogonal
    /// factors or not, no way leads back.
    #[inline(always)]
    pub fn settled(&self, limit: L) -> L {
        let lost = self.moved.select_lt(L::splat(f64::INFINITY), L::splat(0.0), L::splat(1.0));
        at_most(self.moved, limit).max(lost)
    }
}

impl Progress {
    /// Reads it from memory.
    #[inline(always)]
    pub fn load<L: Lanes>(&self) -> Progress<L> {
        Progress {
            active: L::load(&self.active),
            nit: L::load(&self.nit),
            cost: L::load(&self.cost),
            best: L::load(&self.best),
            moved: L::load(&self.moved),
            last_move: L::load(&self.last_move),
            halvings: L::load(&self.halvings),
        }
    }

    /// Nothing known yet: the live lanes iterate, the others do not.
    pub fn begin(&mut self, live: [bool; LANES]) {
        self.nit = Wide::ZERO;
        self.again(Wide(live.map(f64::from)));
    }

    /// Active lanes whose step small pivots spoiled; a step that is not finite shows as a move that is not.
    pub fn spoiled(&self, trusted: &Wide) -> [bool; LANES] {
        std::array::from_fn(|k| {
            let sound = trusted.0[k] > 0.0 && self.moved.0[k].is_finite();
            !sound && self.active.0[k] != 0.0
        })
    }

    /// These lanes iterate anew from where they stand.
    pub fn again(&mut self, lanes: Wide) {
        self.active = lanes;
        self.best = Wide::splat(f64::INFINITY);
        self.last_move = Wide::splat(f64::INFINITY);
        self.halvings = Wide::ZERO;
    }
}

/// a ≤ b as a mask; true where either is no number.
#[inline(always)]
pub(crate) fn at_most<L: Lanes>(a: L, b: L) -> L {
    b.select_lt(a, L::splat(0.0), L::splat(1.0))
}
