//! How replicates ended: a status for each lane.

use super::band::SAME;
use super::iterates::Progress;
use crate::error::Status;
use crate::simd::{LANES, Wide};

/// Outcome of eight replicates; estimates stay in the workspace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// One per lane.
    pub status: [Status; LANES],
    /// Iterations after the start.
    pub nit: [u32; LANES],
}

/// How one of several fits to the same lines ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    pub status: Status,
    pub cost: f64,
}

impl End {
    /// The cost that fits may be compared by: infinite where there is no estimate.
    pub fn cost(self) -> f64 {
        match self.status {
            Status::Ok | Status::MaxIter if self.cost.is_finite() => self.cost,
            _ => f64::INFINITY,
        }
    }

    /// Whether this is a lower minimum than the other, or the same one and only this has settled. Of two ends in
    /// one minimum the first stays, so that a second start changes no bit where it changes nothing.
    pub fn is_better_than(self, other: End) -> bool {
        let (own, best) = (self.cost(), other.cost());
        let settles = self.status == Status::Ok && other.status == Status::MaxIter;
        own < best * (1.0 - SAME) || (settles && own <= best * (1.0 + SAME))
    }
}

/// Statuses of all lanes. `theta` in the workspace's units, `scale` those of the user; `data` are the
/// coefficients; `dependent` says in which lanes columns were found dependent. A lane that ran out of steps is settled
/// if its last one was no longer than `close`.
pub(crate) fn statuses<'a, D: Iterator<Item = &'a Wide>>(
    close: f64,
    theta: &[Wide],
    scale: impl Fn(usize) -> f64,
    progress: &Progress,
    dependent: [bool; LANES],
    data: impl Fn() -> D,
) -> [Status; LANES] {
    let near = |k: usize| progress.moved.0[k] <= close * close;
    let still = |k: usize| progress.active.0[k] > 0.0 && !near(k);
    let steady = |k: usize| if still(k) { Status::MaxIter } else { Status::Ok };
    // What nearly always holds is asked of all lanes at once.
    if dependent == [false; LANES] && all_finite(theta, &scale, &progress.cost) {
        return std::array::from_fn(steady);
    }
    std::array::from_fn(|k| {
        if !(theta.iter().all(|t| t.0[k].is_finite()) && progress.cost.0[k].is_finite()) {
            let sound = data().all(|x| x.0[k].is_finite());
            return if sound { Status::Rank } else { Status::NonFinite };
        }
        if dependent[k] {
            return Status::Rank;
        }
        // An estimate may leave the range of floating point in the user's units.
        let within = theta.iter().enumerate().all(|(j, t)| (t.0[k] * scale(j)).is_finite());
        if within { steady(k) } else { Status::NonFinite }
    })
}

/// Whether estimates in the user's units and costs are finite in all lanes: no sum of others is. False as well
/// where finite numbers have a sum beyond the largest one.
fn all_finite(theta: &[Wide], scale: impl Fn(usize) -> f64, cost: &Wide) -> bool {
    let mut sum = cost.0;
    for (k, t) in theta.iter().enumerate() {
        let scale = scale(k);
        for (sum, t) in sum.iter_mut().zip(t.0) {
            *sum += t * scale;
        }
    }
    (0..LANES / 2).map(|k| sum[k] + sum[k + LANES / 2]).sum::<f64>().is_finite()
}

/// Lanes in which columns were found dependent, or rounding took over in one of both covariances, where there are any.
pub(crate) fn lost_lanes(
    mut dependent: [bool; LANES],
    covariances: Option<[&[Wide]; 2]>,
    parameters: usize,
) -> [bool; LANES] {
    let lost = covariances.map_or([false; LANES], |both| lost_in_rounding(both, parameters));
    dependent.iter_mut().zip(lost).for_each(|(dependent, lost)| *dependent |= lost);
    dependent
}

/// Lanes in which rounding took over: columns so nearly dependent that a variance came out below 0, or as no number.
fn lost_in_rounding(covariances: [&[Wide]; 2], parameters: usize) -> [bool; LANES] {
    let mut lost = [false; LANES];
    for cov in covariances {
        for variance in cov.iter().step_by(parameters + 1) {
            for (lost, v) in lost.iter_mut().zip(variance.0) {
                *lost |= v.is_nan() | (v < 0.0);
            }
        }
    }
    lost
}
