//! Takes what sampling folds into the output's sums under held inputs out of them, at the estimate that stands.

use std::f64::consts::TAU;

use super::aliasing::{Aliasing, Images, LARGE, LARGE_AT_ONCE};
use super::design::Design;
use super::workspace::Workspace;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
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
    std::array::from_fn(|k| match power[2].0[k] > 0.0 {
        true => (power[2].0[k] / power[1].0[k]).sqrt(),
        false => 0.0,
    })
}

struct Unalias<'a> {
    structure: &'a Structure,
    aliasing: &'a Aliasing,
    design: &'a Design,
    space: &'a mut Workspace,
    of: [bool; LANES],
}

impl Kernel for Unalias<'_> {
    /// Power of what was taken out, of the output, and of what changed.
    type Output = [Wide; 3];
    #[inline(always)]
    fn run<L: Lanes>(self) -> [Wide; 3] {
        let Unalias { structure, aliasing, design, space: w, of } = self;
        let (of, half) = (L::load(&Wide(of.map(f64::from))), L::splat(0.5));
        let theta = &w.iterates.theta.now;
        let (a, b) = theta.split_at(structure.order);
        let mut power = [L::splat(0.0); 3];
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
                let before = (L::load(&r.re[m]), L::load(&r.im[m]));
                let after = (y.0 - sum.0, y.1 - sum.1);
                let change = (after.0 - before.0, after.1 - before.1);
                power[2] = change.0.mul_add(change.0, change.1.mul_add(change.1, power[2]));
                half.select_lt(of, after.0, before.0).store(&mut r.re[m]);
                half.select_lt(of, after.1, before.1).store(&mut r.im[m]);
                power[0] = sum.0.mul_add(sum.0, sum.1.mul_add(sum.1, power[0]));
                power[1] = y.0.mul_add(y.0, y.1.mul_add(y.1, power[1]));
            }
        }
        let mut out = [Wide::ZERO; 3];
        power[0].store(&mut out[0]);
        power[1].store(&mut out[1]);
        power[2].store(&mut out[2]);
        out
    }
}
