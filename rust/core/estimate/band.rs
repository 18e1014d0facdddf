//! Which lines a fit uses: as given, or by the default rule.

use crate::structure::Method;

/// Standard errors may grow by this factor when the default band is narrowed.
const TOLERANCE: f64 = 1.01;

/// Part of the wide band, in tenths, from which on a choice meets its end: errors may fall beyond.
const END: usize = 9;

/// Costs that differ by less, in parts of themselves, are those of one minimum.
pub(crate) const SAME: f64 = 1e-9;

/// Precision of an estimate that a band is chosen by, that is only the start of another, or that ran out of steps.
pub(crate) const CLOSE: f64 = 1e-5;

/// First and last line of a record.
pub(crate) type Range = (usize, usize);

/// Which lines are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Band {
    /// By the default rule (docs/core.md, "Default band").
    Default,
    /// From and to, in rad/s.
    Edges(f64, f64),
    /// The report's M: the highest harmonic is M + n.
    Harmonics(usize),
}

/// What the default rule saw and chose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandRule {
    /// Highest line of the wide fit.
    pub wide: usize,
    /// Highest line of the narrow fit that gave the second start.
    pub narrow: usize,
    /// Cost on the wide band from `wls`, and from the narrow fit.
    pub costs: [f64; 2],
    /// Highest line chosen.
    pub chosen: usize,
}

impl BandRule {
    /// Whether the choice ends where the wide band does, so that errors may fall beyond.
    #[must_use]
    pub fn meets_end(&self) -> bool {
        10 * self.chosen >= END * self.wide
    }
}

/// Which lines a fit uses.
pub(crate) struct Choice {
    /// First and last of each record.
    pub ranges: Vec<Range>,
    /// The rule's account, where it chose.
    pub rule: Option<BandRule>,
    /// Where to start from, if not from `wls`.
    pub theta: Option<Vec<f64>>,
}

/// Real equations that are left for the noise: with one, intervals of 95 % held the truth in 79 to 88 %. Of how few
/// intervals: of more, orders that leave none are beyond the record.
const OF_NOISE: usize = 3;
const FEW: usize = 32;

/// Steps that a way to the right minimum takes at most, unless noise is large: a longer one may lead astray.
pub(crate) const MANY: u32 = 10;

/// So many lines at the lower end of each range.
pub(crate) fn lower_ends(ranges: &[Range], lines: impl Iterator<Item = usize>) -> Vec<Range> {
    ranges.iter().zip(lines).map(|((first, last), n)| (*first, (first + n).min(*last))).collect()
}

/// Lines that tell so many unknowns an output: the narrow fit of the default rule, and of second starts, goes so
/// many lines up from its lowest.
pub(crate) fn narrow_lines(unknowns: usize, order: usize) -> usize {
    unknowns.saturating_mul(3).saturating_add(order)
}

/// Highest lines of the default rule, wide and narrow, for so many unknowns an output; the wide one doubled so many
/// times, up to the last line below the fastest that samples show. Intervals: all, and those of the step that most
/// samples keep.
///
/// `ls` and `wls` have no business with lines where noise rules: M = 3# (report, eq. 20). Few samples that become
/// rarer, as of blood, keep as many lines as there are unknowns and end conditions, with two real equations a line. Of
/// few even samples so many lines are taken that the noise has a few equations, at three samples a period or more.
pub(crate) fn default_lines(
    method: Method,
    unknowns: usize,
    order: usize,
    (all, intervals): (usize, usize),
    doublings: u32,
) -> (usize, usize) {
    let narrow = narrow_lines(unknowns, order);
    let mut wide =
        ((intervals / 8).max((intervals / 4).min(16)) << doublings).min((intervals - 1) / 2);
    if intervals < all {
        wide = wide.max((unknowns + order).min(all / 4));
    }
    if intervals < FEW {
        wide = wide.max((unknowns + order + OF_NOISE).div_ceil(2).min(intervals / 3));
    }
    match method {
        Method::Ls | Method::Wls => {
            let only = narrow.min(wide.max(intervals / 2));
            (only, only)
        }
        _ => (wide, narrow.min(wide)),
    }
}

/// Highest line for noise of both kinds instead of the wide one. They are told apart where the system no longer answers, up
/// to 16/3 samples a period; beyond, errors of the quadrature pass for noise of the samples.
pub(crate) fn lines_of_both_noises(wide: usize, intervals: usize) -> usize {
    (wide + wide / 2).min((intervals - 1) / 2)
}

/// The fewest lines that keep all `variances` (at equal σ; none where lines are too few) within the tolerance
/// of those of the wide band; a variance of zero is that of a parameter on its bound. Variances fall as lines
/// join, so halving finds them. `omega0`: line spacing of each record.
pub(crate) fn fewest_lines(
    omega0: &[f64],
    wide: &[Range],
    mut variances: impl FnMut(&[Range]) -> Option<Vec<f64>>,
) -> Vec<Range> {
    let longest = omega0.iter().copied().fold(f64::INFINITY, f64::min);
    let edge = wide.iter().zip(omega0).fold(0.0, |e: f64, (r, omega)| e.max(r.1 as f64 * omega));
    let up_to = |steps: usize| -> Vec<Range> {
        let highest = steps as f64 * longest;
        wide.iter()
            .zip(omega0)
            .map(|(r, omega)| (r.0, r.1.min((highest / omega + 1e-9) as usize).max(1)))
            .collect()
    };
    let top = (edge / longest + 0.5) as usize;
    let Some(reference) = variances(wide) else { return wide.to_vec() };
    let mut good = |steps: usize| {
        let limit = TOLERANCE * TOLERANCE;
        variances(&up_to(steps)).is_some_and(|v| {
            v.iter().zip(&reference).all(|(v, r)| *r == 0.0 || (*v > 0.0 && *v <= limit * r))
        })
    };
    let (mut low, mut high) = (0, top);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if good(middle) { high = middle } else { low = middle }
    }
    if high == top { wide.to_vec() } else { up_to(high) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_leave_the_noise_some_equations() {
        // Three parameters and a constant, two poles: 10 equations at least, at three samples a period.
        let wide = |n| default_lines(Method::Ml, 4, 2, (n, n), 0).0;
        assert_eq!([10, 12, 14, 16, 20, 24, 256].map(wide), [3, 4, 4, 5, 5, 6, 32]);
    }

    #[test]
    fn a_choice_meets_its_end_from_nine_tenths_on() {
        let of = |chosen| BandRule { wide: 40, narrow: 10, costs: [1.0, 1.0], chosen };
        assert_eq!([35, 36, 40].map(|chosen| of(chosen).meets_end()), [false, true, true]);
    }
}
