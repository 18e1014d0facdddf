//! Where tones may be: peaks of what a further tone explains, over a zero-padded grid, best sets kept.

use super::refine::Refiner;
use super::{Options, Tone};
use crate::spectrum::Padded;

/// The grid has this many points a line.
const PADDING: usize = 4;
/// Sets of tones that are kept, and peaks that each is continued with.
const KEPT: usize = 2;
const PEAKS: usize = 2;
/// Peaks nearer than this many lines are one, and so are sets whose tones all are nearer.
const APART: f64 = 1.0;
const SAME: f64 = 0.05;
/// A tone may be two: so far from it, in lines, they are tried.
const SPLIT: f64 = 0.4;
/// Beside tones that are there, a further one needs this part of its square norms.
const DISTINCT: f64 = 1e-3;
/// Dampings that are tried, times the record's length.
const DAMPINGS: [f64; 4] = [0.0, 3.0, 10.0, 30.0];

/// A set of tones and what it leaves.
#[derive(Debug, Clone)]
pub struct State {
    pub tones: Vec<Tone>,
    pub cost: f64,
}

/// One damping of the grid: e^{−dk} times the weights, and the sums of its squares.
#[derive(Debug, Clone)]
struct Envelope {
    damping: f64,
    values: Vec<f64>,
    total: f64,
    /// Σ w²e^{−2dk} at twice each frequency of the grid (real records).
    twice: Vec<(f64, f64)>,
}

/// The grid and what the samples do not change on it.
#[derive(Debug, Clone)]
pub struct Search {
    length: usize,
    complex: bool,
    count: usize,
    transform: Padded,
    /// Indices of the grid, frequency times its size.
    grid: Vec<i64>,
    envelopes: Vec<Envelope>,
}

impl Search {
    pub fn new(weights: &[f64], options: &Options) -> Search {
        let n = weights.len();
        let transform = Padded::new((PADDING * n).next_power_of_two());
        let size = transform.size();
        let dampings = if options.damped { &DAMPINGS[..] } else { &DAMPINGS[..1] };
        let envelope = |damping: f64| {
            let values: Vec<f64> =
                (0..n).map(|k| weights[k] * libm::exp(-damping * k as f64)).collect();
            let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
            let half = transform.run(&squares);
            let twice = (0..=size / 2).map(|k| Padded::at(&half, 2 * k as i64, size)).collect();
            Envelope { damping, total: half[0].0, twice, values }
        };
        let (low, high) = options.band;
        let ends = ((low * size as f64).ceil() as i64, (high * size as f64).floor() as i64);
        let half = size as i64 / 2;
        let within = if options.complex { (1 - half, half) } else { (0, half) };
        Search {
            length: n,
            complex: options.complex,
            count: options.count,
            grid: (ends.0.max(within.0)..=ends.1.min(within.1)).collect(),
            envelopes: dampings.iter().map(|d| envelope(d / n as f64)).collect(),
            transform,
        }
    }

    /// The best set of 0, 1, … tones; ends early where nothing more is found.
    pub fn run(&self, refiner: &mut Refiner) -> Vec<State> {
        let nothing = State { tones: Vec::new(), cost: refiner.cost(&[]) };
        let mut levels = vec![nothing.clone()];
        let mut kept = vec![nothing];
        for _ in 0..self.count {
            let mut next: Vec<State> = Vec::new();
            for state in &kept {
                refiner.cost(&state.tones);
                let further = self
                    .peaks(refiner)
                    .into_iter()
                    .map(|peak| [&state.tones[..], &[peak]].concat());
                for mut tones in further.chain(self.split(&state.tones)) {
                    let cost = refiner.nearly(&mut tones);
                    if cost.is_finite() {
                        tones.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
                        next.push(State { tones, cost });
                    }
                }
            }
            next.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            kept = self.distinct(next);
            let Some(best) = kept.first() else { break };
            levels.push(best.clone());
        }
        levels
    }

    /// The same tones, each in its turn taken as two.
    fn split(&self, tones: &[Tone]) -> Vec<Vec<Tone>> {
        let apart = SPLIT / self.length as f64;
        let two = |i: usize| {
            let mut both = tones.to_vec();
            both[i].frequency -= apart;
            both.push(Tone { frequency: tones[i].frequency + apart, ..tones[i] });
            both
        };
        (0..tones.len()).map(two).collect()
    }

    fn distinct(&self, states: Vec<State>) -> Vec<State> {
        let near = |a: &State, b: &State| {
            a.tones
                .iter()
                .zip(&b.tones)
                .all(|(a, b)| (a.frequency - b.frequency).abs() * (self.length as f64) < SAME)
        };
        let mut kept: Vec<State> = Vec::with_capacity(KEPT);
        for state in states {
            if kept.len() < KEPT && !kept.iter().any(|other| near(&state, other)) {
                kept.push(state);
            }
        }
        kept
    }

    /// The tones that would explain most beside those of the refiner's last cost.
    fn peaks(&self, refiner: &Refiner) -> Vec<Tone> {
        let mut peaks: Vec<(f64, Tone)> = Vec::new();
        for envelope in &self.envelopes {
            let gains = self.gains(refiner, envelope);
            for (k, gain) in gains.iter().enumerate() {
                let before = if k > 0 { gains[k - 1] } else { 0.0 };
                let after = gains.get(k + 1).copied().unwrap_or(0.0);
                if *gain > before && *gain >= after {
                    let frequency = self.grid[k] as f64 / self.transform.size() as f64;
                    peaks.push((*gain, Tone { frequency, damping: envelope.damping }));
                }
            }
        }
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<Tone> = Vec::with_capacity(PEAKS);
        for (_, peak) in peaks {
            let lines =
                |other: &Tone| (peak.frequency - other.frequency).abs() * self.length as f64;
            if chosen.len() < PEAKS && chosen.iter().all(|other| lines(other) >= APART) {
                chosen.push(peak);
            }
        }
        chosen
    }

    /// How much of the residual a tone at each point of the grid explains beside the refiner's columns.
    fn gains(&self, refiner: &Refiner, envelope: &Envelope) -> Vec<f64> {
        let size = self.transform.size();
        let whole = if self.complex { envelope.total } else { envelope.total / 2.0 };
        // Square norms and product of the tone's two columns.
        let mut norms: Vec<[f64; 3]> = self
            .grid
            .iter()
            .map(|k| match self.complex {
                true => [whole, whole, 0.0],
                false => {
                    let (re, im) = envelope.twice[*k as usize];
                    [whole + re / 2.0, whole - re / 2.0, im / 2.0]
                }
            })
            .collect();
        for j in 0..refiner.basis().count() {
            let products = self.products(refiner.basis().q(j), envelope, size);
            for (norm, (a, b)) in norms.iter_mut().zip(products) {
                norm[0] -= a * a;
                norm[1] -= b * b;
                norm[2] -= a * b;
            }
        }
        let least = DISTINCT * whole * whole;
        let gain = |(norm, (a, b)): (&[f64; 3], (f64, f64))| {
            let det = norm[0] * norm[1] - norm[2] * norm[2];
            let explained = norm[1] * a * a - 2.0 * norm[2] * a * b + norm[0] * b * b;
            if det > least { explained / det } else { 0.0 }
        };
        let products = self.products(refiner.residual(), envelope, size);
        norms.iter().zip(products).map(gain).collect()
    }

    /// Products of a column with the tone's two at each point of the grid.
    fn products(&self, column: &[f64], envelope: &Envelope, size: usize) -> Vec<(f64, f64)> {
        let n = self.length;
        let enveloped = |part: &[f64]| -> Vec<(f64, f64)> {
            let values: Vec<f64> = part.iter().zip(&envelope.values).map(|(x, e)| x * e).collect();
            self.transform.run(&values)
        };
        let re = enveloped(&column[..n]);
        if !self.complex {
            return self.grid.iter().map(|k| Padded::at(&re, *k, size)).collect();
        }
        let im = enveloped(&column[n..2 * n]);
        let both = |k: &i64| {
            let (p, q) = (Padded::at(&re, *k, size), Padded::at(&im, *k, size));
            (p.0 - q.1, p.1 + q.0)
        };
        self.grid.iter().map(both).collect()
    }
}
