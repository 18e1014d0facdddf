//! The outputs' sums as they were measured, and what is taken out of them.

use super::aliasing::Aliasing;
use crate::simd::{LANES, Lanes, Wide};

/// What is taken out of the outputs' sums, of some lanes.
pub(crate) struct TakeOut<L> {
    of: L,
    taken: L,
    all: L,
    changed: L,
}

/// Power of what was taken out of the outputs, of these, and of what changed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Power {
    pub taken: Wide,
    pub all: Wide,
    pub changed: Wide,
}

impl<L: Lanes> TakeOut<L> {
    /// Nothing yet; of these lanes alone sums change.
    #[inline(always)]
    pub fn new(of: [bool; LANES]) -> TakeOut<L> {
        let zero = L::splat(0.0);
        TakeOut { of: L::load(&Wide(of.map(f64::from))), taken: zero, all: zero, changed: zero }
    }

    /// Puts the measured sum of a line less what is folded into it into its place.
    #[inline(always)]
    pub fn line(&mut self, y: (L, L), folded: (L, L), (re, im): (&mut Wide, &mut Wide)) {
        let half = L::splat(0.5);
        let before = (L::load(re), L::load(im));
        let after = (y.0 - folded.0, y.1 - folded.1);
        let change = (after.0 - before.0, after.1 - before.1);
        half.select_lt(self.of, after.0, before.0).store(re);
        half.select_lt(self.of, after.1, before.1).store(im);
        self.changed = change.0.mul_add(change.0, change.1.mul_add(change.1, self.changed));
        self.taken = folded.0.mul_add(folded.0, folded.1.mul_add(folded.1, self.taken));
        self.all = y.0.mul_add(y.0, y.1.mul_add(y.1, self.all));
    }

    /// What was taken out of all lines.
    #[inline(always)]
    pub fn power(self) -> Power {
        let mut power = Power { taken: Wide::ZERO, all: Wide::ZERO, changed: Wide::ZERO };
        self.taken.store(&mut power.taken);
        self.all.store(&mut power.all);
        self.changed.store(&mut power.changed);
        power
    }
}

impl Power {
    /// The same where lines stand in the lanes: that of all in each.
    pub fn over_lines(&self) -> Power {
        let sum = |own: Wide| Wide::splat(own.0.iter().sum());
        Power { taken: sum(self.taken), all: sum(self.all), changed: sum(self.changed) }
    }

    /// How much the sums changed, in parts of the outputs.
    pub fn change(&self) -> [f64; LANES] {
        std::array::from_fn(|k| match self.changed.0[k] > 0.0 {
            true => (self.changed.0[k] / self.all.0[k]).sqrt(),
            false => 0.0,
        })
    }
}

/// The outputs' sums as they were measured.
#[derive(Debug, Clone, Default)]
pub(crate) struct Measured {
    pub re: Vec<Wide>,
    pub im: Vec<Wide>,
}

impl Measured {
    /// Room for so many numbers, none where nothing is folded.
    pub fn new(aliasing: Option<&Aliasing>, count: usize) -> Measured {
        let room = || vec![Wide::ZERO; aliasing.map_or(0, |_| count)];
        Measured { re: room(), im: room() }
    }

    /// Keeps the first of these.
    pub fn keep(&mut self, re: &[Wide], im: &[Wide]) {
        let count = self.re.len();
        self.re.copy_from_slice(&re[..count]);
        self.im.copy_from_slice(&im[..count]);
    }

    /// Puts all lanes back.
    pub fn give_back(&self, re: &mut [Wide], im: &mut [Wide]) {
        (0..LANES).for_each(|lane| self.put_back(re, im, lane));
    }

    /// Puts one lane back.
    fn put_back(&self, re: &mut [Wide], im: &mut [Wide], lane: usize) {
        for (to, from) in re.iter_mut().zip(&self.re).chain(im.iter_mut().zip(&self.im)) {
            to.0[lane] = from.0[lane];
        }
    }

    /// Puts back those of these lanes in which what was taken out has more than this part of the output's power.
    pub fn judge(
        &self,
        (re, im): (&mut [Wide], &mut [Wide]),
        power: &Power,
        large: f64,
        of: [bool; LANES],
    ) {
        for lane in (0..LANES).filter(|k| of[*k]) {
            // NaN is not little, either.
            let little = power.taken.0[lane] <= large * power.all.0[lane];
            if !little {
                self.put_back(re, im, lane);
            }
        }
    }
}
