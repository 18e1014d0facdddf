//! Takes what sampling folds into the output's sums under held inputs out of them, at the estimate that stands.

use std::f64::consts::TAU;

use super::aliasing::{Aliasing, Images, LARGE, LARGE_AT_ONCE};
use super::design::Design;
use super::measured::{Power, TakeOut};
use super::workspace::Workspace;
use crate::simd::{Isa, Kernel, LANES, Lanes};
use crate::structure::Structure;

/// Takes what the estimate's response folds out of the output, of these lanes; from the sums as they were measured. Says
/// how much that changed, in parts of the output.
pub(crate) fn unalias(isa: Isa, d: &Design, w: &mut Workspace, of: [bool; LANES]) -> [f64; LANES] {
    let Some(aliasing) = &d.aliasing else { return [0.0; LANES] };
    let power = isa.run(Unalias { structure: &d.structure, aliasing, design: d, space: w, of });
    let large = if d.acts_at_once() { LARGE_AT_ONCE } else { LARGE };
    for r in &mut w.records {
        r.measured.judge((&mut r.re, &mut r.im), &power, large, of);
    }
    power.change()
}

struct Unalias<'a> {
    structure: &'a Structure,
    aliasing: &'a Aliasing,
    design: &'a Design,
    space: &'a mut Workspace,
    of: [bool; LANES],
}

impl Kernel for Unalias<'_> {
    type Output = Power;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Power {
        let Unalias { structure, aliasing, design, space: w, of } = self;
        let theta = &w.iterates.theta.now;
        let (a, b) = theta.split_at(structure.order);
        let mut out = TakeOut::<L>::new(of);
        let transients = w.iterates.transients.iter();
        let each = w.records.iter_mut().zip(&design.records).zip(&aliasing.records);
        for (((r, rd), own), transient) in each.zip(transients) {
            let (Some(record), transient) = (own, &transient.now) else { continue };
            let line = L::splat(rd.lines.omega0 / design.band_edge / TAU);
            for (m, x) in rd.x.iter().enumerate() {
                let mut sum = (L::splat(0.0), L::splat(0.0));
                let images = Images::new(a, L::splat(*x), record.span);
                let mut from = 0;
                for (input, (degree, fold)) in
                    structure.numerators.iter().zip(&record.inputs).enumerate()
                {
                    let Some(degree) = degree else { continue };
                    let own = &b[from..=from + degree];
                    from += degree + 1;
                    let Some(fold) = fold else { continue };
                    let at = (1 + input) * r.lines + m;
                    let u = (L::load(&r.re[at]), L::load(&r.im[at]));
                    let jump = L::load(&r.jumps[input]) * line;
                    let own = fold.of((a, own), &images, u, jump, record.ends);
                    sum = (sum.0 + own.0, sum.1 + own.1);
                }
                if record.ends {
                    let columns = design.columns.iter().copied().zip(transient);
                    let own = images.ends(columns);
                    sum = (sum.0 + own.0, sum.1 + own.1);
                }
                let y = (L::load(&r.measured.re[m]), L::load(&r.measured.im[m]));
                out.line(y, sum, (&mut r.re[m], &mut r.im[m]));
            }
        }
        out.power()
    }
}
