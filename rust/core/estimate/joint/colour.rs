//! Colour of the outputs' noise: an autoregression fitted to the residuals' periodogram on the lines there are.

use super::design::JointDesign;
use super::rows::rows;
use super::tile::Across;
use super::workspace::JointSpace;
use crate::estimate::normal_equations::{LeftColumns, RowWeights};
use crate::estimate::pass::tiles;
use crate::math::{ln_1, sin_cos_turns_1};
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};

/// Longest autoregression.
const MOST: usize = 4;
/// Lines an order must have.
const LINES_EACH: usize = 6;
/// Rounds after which orders no longer change.
const FREE_ROUNDS: usize = 3;

/// Fits the colour of each live lane again; returns by how much its root changed, relative to its size.
///
/// The frequencies up to the highest line are taken as a whole band (π there): autocovariances are cosine
/// sums of the periodogram, Levinson's recursion gives the coefficients of each order, and
/// 2n log(prediction error) + order · log 2n over n lines chooses. On the lines that the fit uses, the
/// periodogram is raised by rows over degrees of freedom.
pub(crate) fn refit(
    isa: Isa,
    d: &JointDesign,
    w: &mut JointSpace,
    round: usize,
    live: [bool; LANES],
) -> [f64; LANES] {
    let q = d.outputs();
    let mut power: Vec<Vec<Wide>> =
        w.records.iter().map(|r| vec![Wide::ZERO; r.lines * q]).collect();
    isa.run(Periodogram { design: d, space: w, power: &mut power });
    let rows: usize = d.records.iter().map(|r| 2 * r.used * q).sum();
    let raised = rows as f64 / d.degrees_of_freedom().max(1) as f64;
    let top =
        d.records.iter().fold(0.0, |most: f64, r| most.max(r.x.last().copied().unwrap_or(0.0)));
    let lines: usize = d.records.iter().map(|r| r.count).sum();
    let mut changed = [0.0; LANES];
    for lane in (0..LANES).filter(|k| live[*k]) {
        for i in 0..q {
            let most = if round < FREE_ROUNDS { MOST } else { w.colour_orders[lane * q + i] };
            let mut covariance = [0.0; MOST + 1];
            for (rd, power) in d.records.iter().zip(&power) {
                for m in 0..rd.count {
                    let by = if m < rd.used { raised } else { 1.0 };
                    // The ends of the band count half; what is left out below line 1 looks like it.
                    let end = m + 1 == rd.count;
                    let below = if m == 0 && rd.lines.first > 0 { 1.5 } else { 1.0 };
                    let weight = by * if end { 0.5 } else { below };
                    for (lag, sum) in covariance.iter_mut().enumerate().take(most + 1) {
                        let (_, cos) = sin_cos_turns_1(0.5 * lag as f64 * rd.x[m] / top);
                        let (block, at) = w.across.place(m, lane);
                        *sum += weight * power[block * q + i].0[at] * cos;
                    }
                }
            }
            let fixed = (round >= FREE_ROUNDS).then_some(most);
            let taps = levinson(&covariance, lines, fixed);
            w.colour_orders[lane * q + i] = taps.1;
            for (r, rd) in w.records.iter_mut().zip(&d.records) {
                for m in 0..rd.count {
                    let (mut re, mut im) = (1.0, 0.0);
                    for (k, tap) in taps.0.iter().enumerate().take(taps.1) {
                        let turns = 0.5 * (k + 1) as f64 * rd.x[m] / top;
                        let (sin, cos) = sin_cos_turns_1(turns);
                        re += tap * cos;
                        im -= tap * sin;
                    }
                    let root = f64::sqrt(re * re + im * im);
                    let (block, at) = w.across.place(m, lane);
                    let own = &mut r.colour[block * q + i].0[at];
                    changed[lane] = f64::max(changed[lane], (root - *own).abs() / root);
                    *own = root;
                }
            }
        }
    }
    changed
}

/// Coefficients of the best order, or of the given one, and the order.
fn levinson(
    covariance: &[f64; MOST + 1],
    lines: usize,
    fixed: Option<usize>,
) -> ([f64; MOST], usize) {
    let count = 2.0 * lines as f64;
    let most = MOST.min(lines / LINES_EACH);
    let mut taps = [0.0f64; MOST];
    let mut error = covariance[0];
    let (mut best, mut lowest) = ((taps, 0), count * ln_1(error.max(f64::MIN_POSITIVE)));
    for order in 1..=fixed.unwrap_or(most) {
        let sum =
            (1..order).fold(covariance[order], |s, k| s + taps[k - 1] * covariance[order - k]);
        let reflection = -sum / error;
        if reflection.abs() >= 1.0 || reflection.is_nan() {
            break;
        }
        let before = taps;
        for k in 1..order {
            taps[k - 1] = before[k - 1] + reflection * before[order - k - 1];
        }
        taps[order - 1] = reflection;
        error *= 1.0 - reflection * reflection;
        let criterion = count * ln_1(error.max(f64::MIN_POSITIVE)) + order as f64 * ln_1(count);
        if fixed.is_some() || criterion < lowest {
            (best, lowest) = ((taps, order), criterion);
        }
    }
    best
}

/// |z|²/unit variance of the uncoloured residuals r/A on all lines there are.
struct Periodogram<'a> {
    design: &'a JointDesign,
    space: &'a mut JointSpace,
    power: &'a mut [Vec<Wide>],
}

impl Kernel for Periodogram<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Periodogram { design: d, space: w, power } = self;
        let q = d.outputs();
        w.beyond = true;
        for (k, own) in power.iter_mut().enumerate() {
            let tile = if w.across == Across::Lines { w.residual.part } else { d.tile };
            for range in tiles(w.records[k].lines, tile) {
                rows::<L>(d, w, k, range.clone(), RowWeights::Adapted, LeftColumns::Data, false);
                for (t, m) in range.enumerate() {
                    // Rows of single problems are weighted.
                    let weight = match w.across {
                        Across::Replicates => d.records[k].weight[m] * 0.5,
                        Across::Lines => 0.5,
                    };
                    let weight = L::splat(weight);
                    for i in 0..q {
                        let (re, im) = w.residual.get::<L>(w.residual.at(i, 0, t));
                        let root = L::load(&w.records[k].colour[m * q + i]);
                        let size = weight * re.mul_add(re, im * im) / (root * root);
                        size.store(&mut own[m * q + i]);
                    }
                }
            }
        }
        w.beyond = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_autoregression_is_found_from_its_covariances() {
        // x_t = .9 x_{t−1} − .2 x_{t−2} + e: ρ1 = .9/1.2, ρ_k = .9 ρ_{k−1} − .2 ρ_{k−2}.
        let mut rho = [1.0, 0.75, 0.0, 0.0, 0.0];
        for k in 2..5 {
            rho[k] = 0.9 * rho[k - 1] - 0.2 * rho[k - 2];
        }
        let (taps, order) = levinson(&rho, 1000, None);
        assert_eq!(order, 2);
        assert!((taps[0] + 0.9).abs() < 1e-12 && (taps[1] - 0.2).abs() < 1e-12, "{taps:?}");
    }

    #[test]
    fn white_noise_has_no_colour() {
        assert_eq!(levinson(&[2.0, 0.01, -0.02, 0.0, 0.01], 100, None).1, 0);
    }
}
