//! Inputs at the delays of each lane: coefficients of u(t − τ) on the window and their slope in τ.

use super::design::JointDesign;
use super::structure::Delay;
use super::tile::Across;
use super::workspace::JointWorkspace;
use crate::error::Error;
use crate::quadrature::Hold;
use crate::simd::{Isa, LANES, Wide, numbers_mut};
use crate::spectrum::{Kind, Shifted};

/// What one record's delayed inputs are made from.
pub(crate) struct Delayed<'a> {
    /// Samples of each path's input, one set for all lanes or one a lane.
    pub samples: Vec<Vec<&'a [f64]>>,
    /// How each path's input behaves between samples.
    pub kinds: &'a [Kind],
    pub dt: f64,
    pub lead: usize,
    pub intervals: usize,
    /// Coefficients of the inputs with a free delay, as `samples`; made when first wanted.
    pub tables: Vec<Vec<Shifted>>,
}

impl Delayed<'_> {
    /// The coefficients of a path's input in a lane, up to line `highest`.
    fn table(
        &mut self,
        isa: Isa,
        path: usize,
        lane: usize,
        highest: usize,
    ) -> Result<&mut Shifted, Error> {
        self.tables.resize_with(self.samples.len(), Vec::new);
        let (own, made) = (&self.samples[path], &mut self.tables[path]);
        while made.len() < own.len() {
            let room = (self.intervals, self.lead);
            made.push(Shifted::new(isa, own[made.len()], self.kinds[path], room, highest)?);
        }
        let last = made.len() - 1;
        Ok(&mut made[lane.min(last)])
    }
}

/// Writes U(m; τ) and dU/dτ = −(iωU + (u(T−τ) − u(−τ))/T) at the delays of the first `lanes` lanes; the
/// other lanes get those of the last. Of a single problem the lanes hold lines.
pub(crate) fn refresh(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    records: &mut [Delayed<'_>],
    lanes: usize,
) -> Result<(), Error> {
    let (q, paths) = (d.outputs(), d.paths());
    for (k, record) in records.iter_mut().enumerate() {
        let (first, count) = (d.records[k].lines.first, d.records[k].count);
        let highest = d.records[k].lines.last;
        let omega0 = d.records[k].lines.omega0;
        let duration = record.intervals as f64 * record.dt;
        let (mut re, mut im) = (vec![0.0; highest + 1], vec![0.0; highest + 1]);
        for (at, s) in d.free_delays.iter().enumerate() {
            let Delay::Free { min, max, .. } = d.structure.paths[*s].delay else { continue };
            let unit = d.units[q + s];
            for lane in 0..if w.across == Across::Lines { 1 } else { LANES } {
                let from = lane.min(lanes - 1);
                let tau = w.iterates.theta.now[d.free.len() + at].0[from] * d.delay_scale;
                let tau = if tau.is_finite() { tau.clamp(min, max) } else { min };
                if from == lane {
                    let steps = tau / record.dt;
                    record.table(isa, *s, lane, highest)?.write(steps, &mut re, &mut im)?;
                    let jump = std::mem::take(&mut im[0]) / unit;
                    let own = &record.samples[*s];
                    let samples = own[lane.min(own.len() - 1)];
                    let kind = record.kinds[*s];
                    let at = |position: f64| value_at(samples, position, kind);
                    let start = record.lead as f64 - steps;
                    let rise = (at(start + record.intervals as f64) - at(start)) / duration;
                    let (across, r) = (w.across, &mut w.records[k]);
                    let lines = r.lines;
                    match across {
                        Across::Replicates => r.jumps[*s].0[lane] = jump,
                        Across::Lines => r.jumps[*s] = Wide::splat(jump),
                    }
                    let (to_re, to_im) = (numbers_mut(&mut r.re), numbers_mut(&mut r.im));
                    // Of one lane, or of lines one after another.
                    let place = |signal: usize, m: usize| match across {
                        Across::Replicates => (signal * lines + m) * LANES + lane,
                        Across::Lines => signal * lines * LANES + m,
                    };
                    for m in 0..count {
                        let omega = (first + m) as f64 * omega0;
                        let (x, y) = (re[first + m], im[first + m]);
                        let (to, slope) = (place(q + s, m), place(q + paths + s, m));
                        to_re[to] = x / unit;
                        to_im[to] = y / unit;
                        to_re[slope] = (omega * y - rise) / unit * d.delay_scale;
                        to_im[slope] = -omega * x / unit * d.delay_scale;
                    }
                } else {
                    let r = &mut w.records[k];
                    r.jumps[*s].0[lane] = r.jumps[*s].0[from];
                    for signal in [q + s, q + paths + s] {
                        for m in signal * count..(signal + 1) * count {
                            r.re[m].0[lane] = r.re[m].0[from];
                            r.im[m].0[lane] = r.im[m].0[from];
                        }
                    }
                }
            }
        }
    }
    Ok(())
}

/// Value of an input between samples.
fn value_at(samples: &[f64], position: f64, kind: Kind) -> f64 {
    let last = samples.len() - 1;
    let position = position.clamp(0.0, last as f64);
    let cell = (position.floor() as usize).min(last.saturating_sub(1));
    let part = position - cell as f64;
    match kind {
        Kind::Hold(Hold::Zoh) => {
            // A hair before a sample its value holds already.
            samples[if part > 1.0 - 1e-9 { cell + 1 } else { cell }]
        }
        Kind::Hold(_) => samples[cell] + part * (samples[cell + 1] - samples[cell]),
        Kind::Rule(_) => {
            // Lagrange through four samples around.
            let from = cell.saturating_sub(1).min((last + 1).saturating_sub(4));
            let x = position - from as f64;
            let points = 4.min(last + 1);
            (0..points).fold(0.0, |sum, i| {
                let own = (0..points)
                    .filter(|j| *j != i)
                    .fold(1.0, |p, j| p * (x - j as f64) / (i as f64 - j as f64));
                sum + samples[from + i] * own
            })
        }
    }
}
