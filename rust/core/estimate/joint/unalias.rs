//! What sampling folds into the outputs' sums under held inputs, taken out of them (`estimate::aliasing`).

use std::f64::consts::TAU;

use super::design::{JointDesign, TransientColumn};
use super::tile::Across;
use super::workspace::JointWorkspace;
use crate::estimate::aliasing::{
    Aliasing, Fold, Images, LARGE, LARGE_AT_ONCE, MOST_ROUNDS, ROUNDS,
};
use crate::estimate::measured::{Power, TakeOut};
use crate::estimate::{Options, Wanted};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// Takes what the estimate's response folds out of the outputs, of these lanes; from the sums as they were measured. Says
/// how much that changed, in parts of the output.
pub(crate) fn unalias(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointWorkspace,
    of: [bool; LANES],
) -> [f64; LANES] {
    let Some(aliasing) = &d.aliasing else { return [0.0; LANES] };
    let moved = moved(aliasing, d, w);
    let aliasing = moved.as_ref().unwrap_or(aliasing);
    let power = isa.run(Unalias { aliasing, design: d, space: w, of });
    let power = match w.across {
        Across::Replicates => power,
        Across::Lines => power.over_lines(),
    };
    let large = if d.acts_at_once() { LARGE_AT_ONCE } else { LARGE };
    for r in &mut w.records {
        r.measured.judge((&mut r.re, &mut r.im), &power, large, of);
    }
    power.change()
}

impl JointDesign {
    /// Fewest and most rounds of what sampling folds and of the estimate that follows.
    pub(crate) fn rounds_of_folding(&self, o: &Options) -> (usize, usize) {
        match (self.aliasing.is_some() && o.wanted != Wanted::Cost, self.free_delays.is_empty()) {
            (true, true) => (ROUNDS, MOST_ROUNDS),
            // Beside free delays a superfluous pole goes astray in further rounds.
            (true, false) => (ROUNDS, ROUNDS),
            (false, _) => (0, 0),
        }
    }
}

impl JointWorkspace {
    /// Keeps the outputs' sums as they stand.
    pub(crate) fn keep_measured(&mut self) {
        self.records.iter_mut().for_each(|r| r.measured.keep(&r.re, &r.im));
    }
}

/// Foldings where free delays stand, if there are such.
fn moved(aliasing: &Aliasing, d: &JointDesign, w: &JointWorkspace) -> Option<Aliasing> {
    if d.free_delays.is_empty() {
        return None;
    }
    let mut moved = aliasing.clone();
    for record in moved.records.iter_mut().flatten() {
        for (at, s) in d.free_delays.iter().enumerate() {
            if let Some(fold) = &mut record.inputs[*s] {
                let delay = &w.iterates.theta.now[d.free.len() + at];
                *fold = Fold::new(fold.hold, delay.0.map(|v| v * d.delay_scale / record.step));
            }
        }
    }
    Some(moved)
}

struct Unalias<'a> {
    aliasing: &'a Aliasing,
    design: &'a JointDesign,
    space: &'a mut JointWorkspace,
    of: [bool; LANES],
}

impl Kernel for Unalias<'_> {
    type Output = Power;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Power {
        let Unalias { aliasing, design: d, space: w, of } = self;
        let (q, paths) = (d.outputs(), d.paths());
        let mut out = TakeOut::<L>::new(of);
        let transients = w.iterates.transients.iter();
        let each = w.records.iter_mut().zip(&d.records).zip(&aliasing.records);
        for (((r, rd), own), transient) in each.zip(transients) {
            let (Some(record), transient) = (own, &transient.now) else { continue };
            let line = L::splat(rd.lines.omega0 / d.band_edge / TAU);
            for m in 0..r.lines {
                let x = w.across.load::<L>(&rd.x, rd.stride(), 0, m);
                for i in 0..q {
                    let from = d.denominators[i];
                    let a = &w.coefficients[from..from + d.structure.orders[i]];
                    let images = Images::new(a, x, record.span);
                    let mut sum = (L::splat(0.0), L::splat(0.0));
                    for (s, fold) in record.inputs.iter().enumerate() {
                        let (Some(degree), Some(fold)) = (d.structure.numerators[i][s], fold)
                        else {
                            continue;
                        };
                        let from = d.numerators[i * paths + s];
                        let b = &w.coefficients[from..=from + degree];
                        let at = (q + s) * r.lines + m;
                        let u = (L::load(&r.re[at]), L::load(&r.im[at]));
                        let jump = L::load(&r.jumps[s]) * line;
                        let own = fold.of((a, b), &images, u, jump, record.ends);
                        sum = (sum.0 + own.0, sum.1 + own.1);
                    }
                    if record.ends {
                        let own = |(t, _): &(&TransientColumn, &Wide)| t.output == i;
                        let columns = d.transient.iter().zip(transient).filter(own);
                        let columns = columns.map(|(t, value)| (t.column, value));
                        let own = images.ends(columns);
                        sum = (sum.0 + own.0, sum.1 + own.1);
                    }
                    let at = i * r.lines + m;
                    let y = (L::load(&r.measured.re[at]), L::load(&r.measured.im[at]));
                    out.line(y, sum, (&mut r.re[at], &mut r.im[at]));
                }
            }
        }
        out.power()
    }
}
