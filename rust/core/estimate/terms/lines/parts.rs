//! Which lines change with θ, so that only these are made anew at another one.

use crate::estimate::terms::equations::{Equations, Lag};
use crate::estimate::terms::sigma::numbers;

/// How much of something is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Nothing,
    /// What changes with θ.
    Moving,
    All,
}

/// How much is made of the signals' coefficients, and of the pairs of their sensitivities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Parts {
    pub signals: Part,
    pub pairs: Part,
}

impl Parts {
    pub const ALL: Parts = Parts { signals: Part::All, pairs: Part::All };
}

/// Signals, pairs, and sensitivities in such pairs, that change with θ.
#[derive(Debug, Clone)]
pub(super) struct Moving {
    signals: Vec<bool>,
    pairs: Vec<bool>,
    slopes: Vec<bool>,
}

impl Moving {
    /// `products`: of each pair, the sensitivities that are multiplied.
    pub fn new(e: &Equations, products: &[Vec<(usize, usize)>]) -> Moving {
        let first = e.channels + numbers(e.noisy.len());
        let takes = e.samples.takes(|input| input >= first);
        let (own, sensed) = takes.split_at(e.signals.len());
        let late = |s: usize| matches!(e.signals[s].lag, Lag::Parameter(_));
        let signals = own.iter().enumerate().map(|(s, takes)| *takes || late(s)).collect();
        let moves = |list: &Vec<(usize, usize)>| list.iter().any(|(a, b)| sensed[*a] || sensed[*b]);
        let pairs: Vec<bool> = products.iter().map(moves).collect();
        let mut slopes = vec![false; sensed.len()];
        for (list, _) in products.iter().zip(&pairs).filter(|(_, moves)| **moves) {
            for (a, b) in list {
                (slopes[*a], slopes[*b]) = (true, true);
            }
        }
        Moving { signals, pairs, slopes }
    }

    pub fn signal(&self, s: usize, part: Part) -> bool {
        in_part(&self.signals, s, part)
    }

    pub fn pair(&self, k: usize, part: Part) -> bool {
        in_part(&self.pairs, k, part)
    }

    pub fn slope(&self, k: usize, part: Part) -> bool {
        in_part(&self.slopes, k, part)
    }
}

fn in_part(moving: &[bool], k: usize, part: Part) -> bool {
    match part {
        Part::Nothing => false,
        Part::Moving => moving[k],
        Part::All => true,
    }
}
