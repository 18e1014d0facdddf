//! What all targets share: bytes become numbers and options that are hard on the core, and answers are held
//! to what they promise.
#![allow(clippy::disallowed_methods)]

mod formulas;
mod options;

use std::fmt::Debug;

use arbitrary::Unstructured;
use modfun::simd::Isa;
use modfun::{Error, Status};

/// Bytes that are read as choices; zeros where they are used up.
pub struct Bytes<'a>(Unstructured<'a>);

impl<'a> Bytes<'a> {
    /// From what the fuzzer offers.
    pub fn new(bytes: &'a [u8]) -> Bytes<'a> {
        Bytes(Unstructured::new(bytes))
    }

    /// A whole number below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        self.0.int_in_range(0..=n.max(1) - 1).unwrap_or(0)
    }

    /// Heads or tails.
    pub fn flag(&mut self) -> bool {
        self.below(2) == 1
    }

    /// Once in sixteen times.
    pub fn rarely(&mut self) -> bool {
        self.below(16) == 15
    }

    /// One of several.
    pub fn of<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())].clone()
    }

    /// So many of something.
    pub fn many<T>(&mut self, count: usize, mut one: impl FnMut(&mut Self) -> T) -> Vec<T> {
        (0..count).map(|_| one(self)).collect()
    }

    /// A count below `usual`; rarely one that nobody has memory for.
    pub fn count(&mut self, usual: usize) -> usize {
        match self.rarely() {
            true => self.of(&[
                0,
                1 << 40,
                usize::MAX / 2,
                usize::MAX / 2 + 1,
                usize::MAX - 1,
                usize::MAX,
            ]),
            false => self.below(usual),
        }
    }

    /// A number: most often ordinary, else from the ends of the range or none at all.
    pub fn number(&mut self) -> f64 {
        let size = match self.below(12) {
            0 => 0.0,
            1 => f64::NAN,
            2 => f64::INFINITY,
            3 => 1e308,
            4 => 5e-324,
            5 => f64::from_bits(self.0.arbitrary().unwrap_or(0)),
            6 => 10f64.powi(self.below(617) as i32 - 308),
            7 => 1.0 + f64::EPSILON,
            8 => self.below(5) as f64,
            _ => (1 + self.below(1 << 16)) as f64 / 1000.0,
        };
        if self.flag() { -size } else { size }
    }

    /// A number that is `usual`, but rarely.
    pub fn near(&mut self, usual: f64) -> f64 {
        if self.rarely() { self.number() } else { usual }
    }

    /// A size of signals: most often one.
    fn size(&mut self) -> f64 {
        match self.below(4) {
            0 => 10f64.powi(self.below(617) as i32 - 308),
            _ => 1.0,
        }
    }

    /// Samples of one channel: still, alternating, collinear with an earlier one, its response and so on.
    pub fn channel(&mut self, n: usize, earlier: &[Vec<f64>]) -> Vec<f64> {
        let kind = self.below(12);
        let (size, level) = (self.size(), self.number());
        let mut seed = 1 + self.below(256) as u64;
        let mut noise = || {
            // Marsaglia's xorshift: noise enough to be no signal.
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let other = earlier.last().filter(|u| u.len() == n);
        let turns = 0.01 + self.below(64) as f64 / 128.0;
        let mut state = [0.0; 2];
        let mut one = |k: usize| match (kind, other) {
            (0, _) => level,
            (1, _) => [1.0, -1.0][k % 2],
            (2, _) => k as f64 / n as f64,
            (3, _) => f64::from(k == n / 2),
            (4, _) => level + level * f64::EPSILON * noise(),
            (5, Some(u)) => level * u[k],
            (6, _) => (std::f64::consts::TAU * turns * k as f64).sin(),
            (7, _) => f64::from(noise() > 0.0),
            (8..=10, Some(u)) => {
                // A damped oscillator that the other channel drives.
                let next = [state[1], 1.7 * state[1] - 0.8 * state[0] + 0.1 * u[k]];
                state = next;
                next[1] + if kind == 8 { 0.0 } else { 0.01 * noise() }
            }
            _ => noise(),
        };
        let mut samples: Vec<f64> = (0..n).map(|k| size * one(k)).collect();
        if self.rarely() && n > 0 {
            let at = self.below(n);
            samples[at] = self.number();
        }
        samples
    }

    /// Several channels of one record, the last one first: what is measured answers what drives.
    pub fn channels(&mut self, count: usize, n: usize) -> Vec<Vec<f64>> {
        let mut all = Vec::with_capacity(count);
        for _ in 0..count {
            // Rarely one of another length.
            let own = if self.rarely() && self.rarely() { self.below(n + 2) } else { n };
            all.push(self.channel(own, &all));
        }
        all.reverse();
        all
    }

    /// Instants or a step.
    pub fn times(&mut self, n: usize) -> Sampling {
        match self.below(8) {
            7 => {
                let mut t = self.near(0.0);
                let mut next = |b: &mut Self| {
                    let step = 0.01 + b.below(256) as f64 / 256.0;
                    t += b.near(step);
                    t
                };
                let own = if self.rarely() { self.below(n + 2) } else { n };
                Sampling::Uneven(self.many(own, &mut next))
            }
            6 => Sampling::Even(self.number()),
            _ => Sampling::Even(self.of(&[0.1, 1.0, 1e-9, 1e9])),
        }
    }

    /// An instruction set of this processor.
    pub fn isa(&mut self) -> Isa {
        self.of(&Isa::available())
    }
}

/// A step or instants, owned.
#[derive(Debug, Clone)]
pub enum Sampling {
    /// A step.
    Even(f64),
    /// Instants.
    Uneven(Vec<f64>),
}

impl Sampling {
    /// As the core takes it.
    pub fn time(&self) -> modfun::estimate::Time<'_> {
        match self {
            Sampling::Even(dt) => modfun::estimate::Time::Even(*dt),
            Sampling::Uneven(t) => modfun::estimate::Time::Uneven(t),
        }
    }
}

/// Channels as the core takes them.
pub fn views(channels: &[Vec<f64>]) -> Vec<&[f64]> {
    channels.iter().map(Vec::as_slice).collect()
}

/// An answer, or nothing where it was refused in words; a panic in a thread is a defect.
pub fn told<T>(answer: Result<T, Error>) -> Option<T> {
    match answer {
        Ok(answer) => Some(answer),
        Err(Error::Data(text) | Error::Spec(text)) => {
            assert!(!text.is_empty());
            None
        }
        Err(other) => panic!("{other}"),
    }
}

/// Two answers to one question have the same bits (any nan is nan).
pub fn same(one: &impl Debug, other: &impl Debug) {
    assert_eq!(format!("{one:?}"), format!("{other:?}"));
}

/// Estimates that are called ok are numbers, and no standard error is negative.
pub fn sound(status: Status, theta: &[f64], errors: impl IntoIterator<Item = f64>) {
    if status == Status::Ok {
        assert!(theta.iter().all(|v| v.is_finite()), "ok, with {theta:?}");
        for error in errors {
            assert!(!(error < 0.0), "ok, with a standard error or variance of {error}");
        }
    }
}

/// The diagonal of a square matrix.
pub fn diagonal(square: &[f64], size: usize) -> impl Iterator<Item = f64> + '_ {
    square.iter().step_by(size + 1).copied()
}
