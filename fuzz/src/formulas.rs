//! Formulas as the core takes them.

use modfun::tape::Written;

use crate::Bytes;

const NAMES: &str = "add multiply divide whole raise constant input min max less less_equal sin cos tan asin acos \
                     atan sinh cosh tanh exp ln sqrt abs sign floor step nothing";

impl Bytes<'_> {
    /// So many inputs one after the other, then operations on what comes before; rarely on what does not.
    pub fn formulas(&mut self, inputs: usize) -> Vec<Written> {
        let names: Vec<&str> = NAMES.split_whitespace().collect();
        let mut all: Vec<Written> = (0..inputs).map(|k| ("input".into(), 0.0, k, 0)).collect();
        for _ in 0..self.below(12) {
            let (at, name) = (all.len(), names[self.below(names.len())]);
            let power = self.below(5) as f64 - 1.0;
            let value = if name == "whole" { self.near(power) } else { self.number() };
            let place =
                |b: &mut Self| if b.rarely() && b.rarely() { b.count(99) } else { b.below(at) };
            let (one, other) = (place(self), place(self));
            all.push((name.into(), value, one, other));
        }
        if all.is_empty() {
            all.push(("constant".into(), self.number(), 0, 0));
        }
        all
    }

    /// Results of formulas.
    pub fn results(&mut self, count: usize, formulas: usize) -> Vec<usize> {
        self.many(count, |b| if b.rarely() && b.rarely() { b.count(99) } else { b.below(formulas) })
    }
}
