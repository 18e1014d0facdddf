//! How far noise bends signals that depend on θ: beyond its first order nothing is known of what it does.
//!
//! sin(ky) with k next to 1/σ is another signal in every sample, and rows of such signals are explained by little
//! noise. With channels that are moved by ±hσ the second difference of a signal stands beside its first:
//!
//! ```text
//! |E(v + hσ) − 2E(v) + E(v − hσ)| / |E(v + hσ) − E(v − hσ)|,   tan(khσ/2) of sin(ky).
//! ```

use super::{LinesWorkspace, Place, TermsRecordPlan};
use crate::estimate::terms::equations::Equations;

/// h: with one alone, kσ could be a whole number of periods.
const MOVES: [f64; 2] = [1.0, 0.6];

impl TermsRecordPlan {
    /// The largest ratio of the root mean squares of both differences among the signals that depend on θ; 0 of none.
    pub fn bend(&self, e: &Equations, at: &Place<'_>, space: &mut LinesWorkspace) -> f64 {
        let mut moving: Vec<usize> = e.signal_slopes.iter().map(|(s, ..)| *s).collect();
        moving.retain(|s| e.sensitivities.iter().any(|(own, _)| own == s));
        moving.sort_unstable();
        moving.dedup();
        let mut most = 0.0f64;
        for h in MOVES.iter().take(if moving.is_empty() { 0 } else { MOVES.len() }) {
            let [low, mid, high] = [-h, 0.0, *h].map(|by| self.moved(e, at, by, &moving, space));
            for ((low, mid), high) in low.iter().zip(&mid).zip(&high) {
                let each = low.iter().zip(mid).zip(high);
                let (first, second) = each.fold((0.0, 0.0), |(first, second), ((a, b), c)| {
                    let (up, bent) = (c - a, c - 2.0 * b + a);
                    (first + up * up, second + bent * bent)
                });
                most = most.max((second / first).sqrt());
            }
        }
        most
    }

    /// Samples of some signals where each noisy channel is so many standard deviations off.
    fn moved(
        &self,
        e: &Equations,
        at: &Place<'_>,
        by: f64,
        signals: &[usize],
        space: &mut LinesWorkspace,
    ) -> Vec<Vec<f64>> {
        let shifted: Vec<Vec<f64>> = e
            .noisy
            .iter()
            .enumerate()
            .map(|(c, channel)| {
                let step = by * at.sigma.get(c, c).sqrt();
                at.channels[*channel].iter().map(|x| x + step).collect()
            })
            .collect();
        let mut channels = at.channels.to_vec();
        for (channel, own) in e.noisy.iter().zip(&shifted) {
            channels[*channel] = own;
        }
        let at = Place { channels: &channels, sigma: at.sigma, theta: at.theta, clean: &[] };
        self.formulas(e, &at, &[], |k| signals.contains(&k), space);
        signals.iter().map(|s| space.results[*s].clone()).collect()
    }
}
