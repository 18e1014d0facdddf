//! What noise does between samples and lines: spectra of products of slopes, and waves of sources on samples.

use super::complex::{Split, loaded, times};
use crate::error::Error;
use crate::estimate::fit::Time;
use crate::math::{root_of_unity, sin_cos_turns_1};
use crate::quadrature::Rule;
use crate::simd::{Isa, Kernel, LANES, Lanes, Wide};
use crate::spectrum::{CoefficientPlan, Kind, Scratch};

/// Sums Σ w_k² p_k e^{−2πi l t_k/T} over a window, and their counterparts on the samples.
pub(super) struct NoisePlan {
    /// e^{2πi t_k/T} of each sample of the window.
    roots: Split,
    samples: usize,
    /// Highest line.
    highest: usize,
    sums: Sums,
}

enum Sums {
    Even { plan: Box<CoefficientPlan>, intervals: usize, squares: f64 },
    Uneven { squares: Vec<f64>, turns: Vec<f64> },
}

/// Memory for [`NoisePlan::correlate`].
#[derive(Debug, Default)]
pub(super) struct NoiseWorkspace {
    re: Vec<f64>,
    im: Vec<f64>,
    scratch: Scratch,
}

impl NoisePlan {
    /// For a window of `n` intervals.
    pub fn new(time: Time<'_>, n: usize, rule: Rule, highest: usize) -> Result<NoisePlan, Error> {
        let mut roots = Split::zeros(n + 1);
        let sums = match time {
            Time::Even(_) => {
                let lags = (2 * highest).min(n / 2);
                let plan = CoefficientPlan::new(n, lags, Kind::Rule(Rule::Staircase), 0.0, 0)?;
                // The rule's end weights are left to the mean of their squares, as linear models do: so the
                // lines of a linear equation are independent, and the two agree to all digits.
                let squares = rule.weights(n)?.iter().map(|w| w * w).sum::<f64>() / (n * n) as f64;
                for k in 0..=n {
                    (roots.re[k], roots.im[k]) = root_of_unity((k % n) as u64, n as u64);
                }
                Sums::Even { plan: Box::new(plan), intervals: n, squares }
            }
            Time::Uneven(t) => {
                let span = t[n] - t[0];
                let weights = rule.uneven_weights(t)?;
                let squares = weights.iter().map(|q| (q / span) * (q / span)).collect();
                let turns: Vec<f64> = t.iter().map(|x| (x - t[0]) / span).collect();
                for (k, turn) in turns.iter().enumerate() {
                    (roots.im[k], roots.re[k]) = sin_cos_turns_1(*turn);
                }
                Sums::Uneven { squares, turns }
            }
        };
        Ok(NoisePlan { roots, samples: n + 1, highest, sums })
    }

    /// Variance of a line under white noise of variance 1.
    pub fn unit_variance(&self) -> f64 {
        match &self.sums {
            Sums::Even { squares, .. } => *squares,
            Sums::Uneven { squares, .. } => squares.iter().sum(),
        }
    }

    /// Where lag 0 stands in a spectrum.
    pub fn middle(&self) -> usize {
        self.highest
    }

    /// R(l) of a product, one value a sample of the window, lags from −highest to twice the highest line.
    pub fn correlate(
        &self,
        isa: Isa,
        product: &mut [f64],
        room: &mut NoiseWorkspace,
        out: &mut Split,
    ) -> Result<(), Error> {
        let middle = self.highest;
        out.clear(3 * self.highest + 1);
        match &self.sums {
            Sums::Even { plan, intervals, squares } => {
                // The window's last sample has the phase of its first, and both count half.
                product[0] = 0.5 * (product[0] + product[*intervals]);
                let lags = plan.harmonics() + 1;
                room.re.resize(lags, 0.0);
                room.im.resize(lags, 0.0);
                plan.run_in(isa, product, &mut room.re, &mut room.im, &mut room.scratch)?;
                for (lag, (re, im)) in room.re.iter().zip(&room.im).enumerate() {
                    (out.re[middle + lag], out.im[middle + lag]) = (re * squares, im * squares);
                }
                // Lags above N/2 are those of the mirrored sum.
                for lag in lags..=2 * self.highest {
                    let from = middle + intervals - lag;
                    (out.re[middle + lag], out.im[middle + lag]) = (out.re[from], -out.im[from]);
                }
            }
            Sums::Uneven { squares, turns } => {
                for lag in 0..=2 * self.highest {
                    let (mut re, mut im) = (0.0, 0.0);
                    for ((p, w), t) in product.iter().zip(squares).zip(turns) {
                        let (sin, cos) = sin_cos_turns_1(-(lag as f64) * t);
                        re += cos * (p * w);
                        im += sin * (p * w);
                    }
                    (out.re[middle + lag], out.im[middle + lag]) = (re, im);
                }
            }
        }
        for lag in 1..=self.highest {
            (out.re[middle - lag], out.im[middle - lag]) =
                (out.re[middle + lag], -out.im[middle + lag]);
        }
        Ok(())
    }

    /// [`NoisePlan::correlate`] of a product that is the same for all samples: lag 0 alone; whether that is so here.
    pub fn correlate_constant(&self, product: f64, out: &mut Split) -> bool {
        match &self.sums {
            Sums::Even { intervals, squares, .. } if 2 * self.highest < *intervals => {
                out.clear(3 * self.highest + 1);
                out.re[self.highest] = product * squares;
                true
            }
            _ => false,
        }
    }

    /// Memory for [`NoisePlan::correlate_eight`].
    pub fn scratch(&self) -> Scratch {
        match &self.sums {
            Sums::Even { plan, .. } => plan.scratch(),
            Sums::Uneven { .. } => Scratch::default(),
        }
    }

    /// [`NoisePlan::correlate`] of eight records, one a lane, of even samples.
    pub fn correlate_eight(
        &self,
        isa: Isa,
        product: &mut [Wide],
        re: &mut Vec<Wide>,
        im: &mut Vec<Wide>,
        scratch: &mut Scratch,
        out: &mut [[Wide; 2]],
    ) -> Result<(), Error> {
        let Sums::Even { plan, intervals, squares } = &self.sums else { return Ok(()) };
        let (first, last) = (product[0], product[*intervals]);
        product[0] = Wide(std::array::from_fn(|k| 0.5 * (first.0[k] + last.0[k])));
        let lags = plan.harmonics() + 1;
        re.resize(lags, Wide::ZERO);
        im.resize(lags, Wide::ZERO);
        plan.run_lanes(isa, product, re, im, scratch)?;
        let scaled = |x: &Wide| Wide(x.0.map(|x| x * squares));
        let mirrored = |[re, im]: [Wide; 2]| [re, Wide(im.0.map(|x| -x))];
        let (before, ahead) = out.split_at_mut(self.highest);
        for (to, (re, im)) in ahead.iter_mut().zip(re.iter().zip(im)) {
            *to = [scaled(re), scaled(im)];
        }
        for lag in lags..=2 * self.highest {
            ahead[lag] = mirrored(ahead[intervals - lag]);
        }
        for (to, from) in before.iter_mut().rev().zip(&ahead[1..]) {
            *to = mirrored(*from);
        }
        Ok(())
    }

    /// [`NoisePlan::correlate_constant`] of eight records.
    pub fn correlate_eight_constants(&self, product: &Wide, out: &mut [[Wide; 2]]) -> bool {
        match &self.sums {
            Sums::Even { intervals, squares, .. } if 2 * self.highest < *intervals => {
                out.fill([Wide::ZERO; 2]);
                out[self.highest][0] = Wide(product.0.map(|x| x * squares));
                true
            }
            _ => false,
        }
    }

    /// [`NoisePlan::wave`] of eight records, one a lane, of even samples.
    pub fn wave_of_eight(
        &self,
        isa: Isa,
        sources: &[[Wide; 2]],
        first: usize,
        out: &mut Vec<Wide>,
    ) {
        out.resize(self.samples, Wide::ZERO);
        let (roots, intervals) = (&self.roots, self.samples - 1);
        isa.run(WaveOfEight { roots, sources, first, intervals, out });
    }

    /// Re Σ_m z(m) e^{imω₀t}, `count` lines from `first` on, at every sample of the window times its share in a
    /// coefficient.
    pub fn wave(&self, isa: Isa, sources: &Split, count: usize, first: usize, out: &mut Vec<f64>) {
        out.resize(self.samples, 0.0);
        let (intervals, share) = match self.sums {
            Sums::Even { intervals, .. } => (Some(intervals), 1.0 / intervals as f64),
            Sums::Uneven { .. } => (None, 1.0),
        };
        // Two lines a step; behind the last there are zeros.
        let count = count.next_multiple_of(2);
        let (re, im) = (&sources.re[..count], &sources.im[..count]);
        let roots = &self.roots;
        isa.run(Wave { roots, re, im, first, intervals, share, out });
        if let Sums::Uneven { squares, .. } = &self.sums {
            out.iter_mut().zip(squares).for_each(|(x, square)| *x *= square.sqrt());
        }
    }
}

/// Σ Re z cos mω₀t − Im z sin mω₀t, eight samples a register, their e^{imω₀t} by products.
///
/// Of even samples those at k, N − k, and for even N at N/2 − k and N/2 + k, have the same terms but for their signs.
struct Wave<'a> {
    roots: &'a Split,
    re: &'a [f64],
    im: &'a [f64],
    first: usize,
    intervals: Option<usize>,
    share: f64,
    out: &'a mut [f64],
}

impl Kernel for Wave<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Wave { roots, re, im, first, intervals, share, out } = self;
        let halves = intervals.filter(|n| n.is_multiple_of(2)).map(|n| n / 2);
        let entries = match (intervals, halves) {
            (_, Some(half)) => half / 2 + 1,
            (Some(n), _) => n / 2 + 1,
            _ => out.len(),
        };
        let lines = re.as_chunks::<2>().0.iter().zip(im.as_chunks::<2>().0);
        let share = L::splat(share);
        // Where the lines begin with an odd one, it is the second of two that have even parity.
        let parity = if first.is_multiple_of(2) { share } else { -share };
        for start in (0..entries).step_by(LANES) {
            let each = lines.clone().map(|(re, im)| {
                [(L::splat(re[0]), L::splat(im[0])), (L::splat(re[1]), L::splat(im[1]))]
            });
            let [a, b, c, d] = sums(roots.eight(start), first, each);
            let (cos, sin) = (share * (a + c), share * (b + d));
            let (far_cos, far_sin) = (parity * (a - c), parity * (b - d));
            let mut all = [Wide::ZERO; 4];
            (cos - sin).store(&mut all[0]);
            (cos + sin).store(&mut all[1]);
            (far_cos + far_sin).store(&mut all[2]);
            (far_cos - far_sin).store(&mut all[3]);
            let some = LANES.min(entries - start);
            forth(&mut out[start..], &all[0], some);
            if let Some(n) = intervals {
                back(&mut out[..=n - start], &all[1], some);
            }
            if let Some(half) = halves {
                back(&mut out[..=half - start], &all[2], some);
                forth(&mut out[half + start..], &all[3], some);
            }
        }
    }
}

/// Σ Re z cos mω₀t and Σ Im z sin mω₀t of every second line from `first` on, then those of the lines between.
#[inline(always)]
fn sums<L: Lanes>(root: (L, L), first: usize, lines: impl Iterator<Item = [(L, L); 2]>) -> [L; 4] {
    let mut own = (L::splat(1.0), L::splat(0.0));
    for _ in 0..first {
        own = times(own, root);
    }
    let (mut next, square) = (times(own, root), times(root, root));
    let mut sums = [L::splat(0.0); 4];
    for [one, two] in lines {
        let [a, b, c, d] = sums;
        sums = [
            own.0.mul_add(one.0, a),
            own.1.mul_add(one.1, b),
            next.0.mul_add(two.0, c),
            next.1.mul_add(two.1, d),
        ];
        (own, next) = (times(own, square), times(next, square));
    }
    sums
}

/// [`Wave`] of eight records, one a lane, one sample after the other.
struct WaveOfEight<'a> {
    roots: &'a Split,
    sources: &'a [[Wide; 2]],
    first: usize,
    intervals: usize,
    out: &'a mut [Wide],
}

impl Kernel for WaveOfEight<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let WaveOfEight { roots, sources, first, intervals: n, out } = self;
        let half = n.is_multiple_of(2).then_some(n / 2);
        let entries = half.unwrap_or(n) / 2 + 1;
        let share = L::splat(1.0 / n as f64);
        let parity = if first.is_multiple_of(2) { share } else { -share };
        let zero = (L::splat(0.0), L::splat(0.0));
        for k in 0..entries {
            let each = sources
                .chunks(2)
                .map(|two| [loaded::<L>(&two[0]), two.get(1).map_or(zero, loaded::<L>)]);
            let root = (L::splat(roots.re[k]), L::splat(roots.im[k]));
            let [a, b, c, d] = sums(root, first, each);
            let (cos, sin) = (share * (a + c), share * (b + d));
            (cos - sin).store(&mut out[k]);
            (cos + sin).store(&mut out[n - k]);
            if let Some(half) = half {
                let (cos, sin) = (parity * (a - c), parity * (b - d));
                (cos + sin).store(&mut out[half - k]);
                (cos - sin).store(&mut out[half + k]);
            }
        }
    }
}

/// The first numbers, so many, from the beginning on.
#[inline(always)]
fn forth(to: &mut [f64], from: &Wide, some: usize) {
    to.iter_mut().zip(&from.0[..some]).for_each(|(to, x)| *to = *x);
}

/// The same from the end on.
#[inline(always)]
fn back(to: &mut [f64], from: &Wide, some: usize) {
    to.iter_mut().rev().zip(&from.0[..some]).for_each(|(to, x)| *to = *x);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_of_uneven_samples_are_the_plain_sums() {
        let times: Vec<f64> = (0..=12).map(|k| f64::from(k * k)).collect();
        let product: Vec<f64> = (0..=12).map(|k| 1.0 + 0.3 * f64::from(k)).collect();
        let plan = NoisePlan::new(Time::Uneven(&times), 12, Rule::Trapezoid, 4).unwrap();
        let (mut out, mut room) = (Split::zeros(0), NoiseWorkspace::default());
        plan.correlate(Isa::Plain, &mut product.clone(), &mut room, &mut out).unwrap();
        let weights = Rule::Trapezoid.uneven_weights(&times).unwrap();
        for (k, (re, im)) in out.re.iter().zip(&out.im).take(13).enumerate() {
            let lag = k as f64 - 4.0;
            let (mut cosines, mut sines) = (0.0, 0.0);
            for ((t, w), p) in times.iter().zip(&weights).zip(&product) {
                let (sin, cos) = sin_cos_turns_1(lag * t / 144.0);
                cosines += p * (w / 144.0) * (w / 144.0) * cos;
                sines -= p * (w / 144.0) * (w / 144.0) * sin;
            }
            assert!((re - cosines).abs() < 1e-15, "{lag}: {re} {cosines}");
            assert!((im - sines).abs() < 1e-15, "{lag}: {im} {sines}");
        }
    }

    #[test]
    fn waves_are_the_plain_sums_at_every_sample() {
        let value = |k: usize| ((k * 2_654_435_761) % 1009) as f64 / 1009.0 - 0.5;
        let uneven: Vec<f64> = (0..=12).map(|k| f64::from(k * k)).collect();
        // Four samples, two or one mirror each other; odd and even numbers of lines from odd and even ones on.
        for (n, first, count) in [(64, 0, 5), (30, 1, 4), (17, 2, 7), (8, 3, 1), (12, 1, 3)] {
            let time = if n == 12 { Time::Uneven(&uneven) } else { Time::Even(0.5) };
            let plan = NoisePlan::new(time, n, Rule::Trapezoid, first + count - 1).unwrap();
            let mut sources = Split::zeros(count);
            for k in 0..count {
                (sources.re[k], sources.im[k]) = (value(k), value(k + 77));
            }
            let mut out = Vec::new();
            plan.wave(Isa::Plain, &sources, count, first, &mut out);
            let weights = Rule::Trapezoid.uneven_weights(&uneven).unwrap();
            for (k, got) in out.iter().enumerate() {
                let (turns, share) = match time {
                    Time::Even(_) => (k as f64 / n as f64, 1.0 / n as f64),
                    Time::Uneven(t) => (t[k] / t[n], weights[k].abs() / t[n]),
                };
                let term = |m: usize| {
                    let (sin, cos) = sin_cos_turns_1((first + m) as f64 * turns);
                    sources.re[m] * cos - sources.im[m] * sin
                };
                let want = share * (0..count).map(term).sum::<f64>();
                assert!((got - want).abs() < 1e-14, "{n} {first} {k}: {got} {want}");
            }
        }
    }
}
