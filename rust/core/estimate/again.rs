//! The estimate once more, where what was taken out of the output has changed.

use super::design::Design;
use super::iterate::iterate;
use super::options::Options;
use super::pass::prepare;
use super::rule::Rule;
use super::workspace::Workspace;
use super::{ls, straight, uncertainty};
use crate::simd::{Isa, LANES, Wide};
use crate::structure::Method;

/// How an estimate of the eight lanes is carried on, again and again.
#[derive(Clone, Copy)]
pub(super) struct Estimation<'a> {
    pub isa: Isa,
    pub design: &'a Design,
    /// Its steps; none where the start is all.
    pub rule: Option<Rule>,
    pub options: &'a Options,
}

impl Estimation<'_> {
    /// The estimate once more, from where it stands, of an output that has changed a little.
    pub fn again(&self, w: &mut Workspace, live: [bool; LANES]) {
        let Estimation { isa, design: d, rule, options: o } = *self;
        let nit = w.progress.nit;
        w.begin(live);
        match (rule, d.method) {
            (Some(rule), _) => {
                prepare(isa, d, w);
                isa.run(uncertainty::Transients { design: d, space: w });
                iterate(isa, d, w, rule, o);
            }
            (None, Method::Ls) => {
                if !straight::ls(isa, d, w) {
                    isa.run(ls::LsStep { design: d, space: w });
                }
            }
            (None, _) => iterate(isa, d, w, Rule::Wls, o),
        }
        if rule.is_none() {
            w.progress.active = Wide::ZERO;
        }
        for lane in 0..LANES {
            w.progress.nit.0[lane] += nit.0[lane];
        }
    }
}
