//! Standard errors from a smooth noise spectrum: right whatever the colour of the noise, as long as it is no single line.
//!
//! Each row i of an estimate has influence g_i on θ, leverage h_i and a whitened residual e_i whose variance is the
//! noise spectrum s at its line. Estimators differ in g and h only, so that for all of them
//!
//! ```text
//! cov θ̂ = Σ_i g_i g_iᵀ s(ω_i),      log s = Σ_j c_j T_j(x),  x = log(1 + m) on [−1, 1],
//! ```
//!
//! with Chebyshev polynomials T_j. The c are those of a gamma regression, E e_i² = (1 − h_i) s with 1 − h_i degrees of
//! freedom, with normal priors that leave c₀ free and let the spectrum fall or rise by many powers of ten, but not from
//! line to line. The curvature of its likelihood does not depend on c: half the degrees of freedom of each line times
//! T Tᵀ. So four scoring steps with one factor suffice from where the logarithms of the squares lead, and the
//! variance of log(g s gᵀ) follows: it makes the degrees of freedom of Student's t, ν = 2/var, for each parameter. ν is
//! at least 2, since the prior is wider than real spectra: the constant of an equation hangs on line 0 alone, which leaves
//! no residual, and would have ν = 0.1; its error lies within 3.2 to 4.7 standard errors in 95 % of records, in noise
//! from white to AR(0.95), and t with ν = 2 allows 4.3.
//!
//! Lines are put together in bins no wider than an eighth of their frequency. A line of the spectrum that stands alone,
//! a hum, is smoothed over; HC3 allows for it where enough lines carry the information.

mod bins;

pub(crate) use bins::Bins;

use crate::math::{exp2, ln};
use crate::simd::{Isa, Kernel, Lanes, Wide};
use bins::{PRODUCTS, Terms};
use std::f64::consts::LN_2;

/// Terms of the logarithm of the spectrum.
const TERMS: usize = 6;
/// 2 ln 2/variance of the terms: standard deviations of 4, 2, 1.5, 1 and 0.7 behind the constant one, of ln s.
const PRIOR: [f64; TERMS] = {
    let unit = 2.0 * LN_2;
    [0.0, unit / 16.0, unit / 4.0, unit / 2.25, unit, unit / 0.49]
};
/// Scoring steps behind the start; more change standard errors by a few thousandths.
const STEPS: usize = 4;
/// No coefficient changes by more in one step.
const LONGEST: f64 = 1.5 / LN_2;
/// Least level of a bin over that of all that the start believes.
const LEAST: f64 = 1e-3;
/// Least degrees of freedom of a variance.
const FEWEST: f64 = 2.0;
/// The noise spectrum that standard errors were made with, over that of white noise of the fit's level.
#[derive(Debug, Clone, Default)]
pub struct NoiseSpectrum {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Of each whitened channel and frequency.
    pub power: Vec<Vec<f64>>,
    /// Standard deviation of the logarithm of each.
    pub log_error: Vec<Vec<f64>>,
}

/// What is summed over the rows of eight estimates, and the spectra and covariances made of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectral {
    bins: usize,
    parameters: usize,
    /// Σe² and Σ(1 − h) of each channel and bin.
    square: Vec<Wide>,
    freedom: Vec<Wide>,
    /// Σ g gᵀ, upper triangles.
    influence: Vec<Wide>,
    /// s of each channel and bin.
    spectrum: Vec<Wide>,
    /// Of each channel that of the information on its coefficients.
    factor: Vec<Factor<Wide>>,
    /// Covariance of θ, and the degrees of freedom of each variance.
    pub cov: Vec<Wide>,
    pub degrees: Vec<Wide>,
}

impl Spectral {
    /// Room for so many bins, channels of white noise and parameters.
    pub fn new(bins: usize, channels: usize, parameters: usize) -> Spectral {
        let (all, p) = (bins * channels, parameters);
        let wide = |n: usize| vec![Wide::ZERO; n];
        Spectral {
            bins,
            parameters,
            square: wide(all),
            freedom: wide(all),
            influence: wide(all * p * (p + 1) / 2),
            spectrum: wide(all),
            factor: vec![Factor::default(); channels],
            cov: wide(p * p),
            degrees: wide(p),
        }
    }

    /// No rows yet.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.square.fill(Wide::ZERO);
        self.freedom.fill(Wide::ZERO);
        self.influence.fill(Wide::ZERO);
    }

    /// Takes in rows of one channel: squares of whitened residuals, and degrees of freedom.
    #[inline(always)]
    pub fn add<L: Lanes>(&mut self, at: usize, square: L, freedom: L) {
        (L::load(&self.square[at]) + square).store(&mut self.square[at]);
        (L::load(&self.freedom[at]) + freedom).store(&mut self.freedom[at]);
    }

    /// Where the products of influences of a channel and bin are summed.
    #[inline(always)]
    pub fn influence(&mut self, at: usize) -> &mut [Wide] {
        let size = self.parameters * (self.parameters + 1) / 2;
        &mut self.influence[at * size..(at + 1) * size]
    }

    /// Takes in the influences of the real and the imaginary row of a line, their products times `v`.
    #[inline(always)]
    pub fn add_products<L: Lanes>(&mut self, at: usize, (re, im): (&[Wide], &[Wide]), v: L) {
        let p = self.parameters;
        let mut to = self.influence(at).iter_mut();
        for i in 0..p {
            let (a, b) = (L::load(&re[i]) * v, L::load(&im[i]) * v);
            for (j, to) in (i..p).zip(to.by_ref()) {
                let own = b.mul_add(L::load(&im[j]), L::load(to));
                a.mul_add(L::load(&re[j]), own).store(to);
            }
        }
    }

    /// The spectra of all channels, in units of `variance`.
    #[inline(always)]
    fn regress<L: Lanes>(&mut self, bins: &[Terms], variance: L) {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let unit = one / variance.max(L::splat(f64::MIN_POSITIVE));
        let squares = self.square.chunks_exact_mut(self.bins);
        let channels = squares.zip(self.freedom.chunks_exact(self.bins));
        let spectra = self.spectrum.chunks_exact_mut(self.bins).zip(&mut self.factor);
        for ((squares, freedoms), (spectrum, to)) in channels.zip(spectra) {
            let mut total = zero;
            for square in squares.iter_mut() {
                let own = L::load(square) * unit;
                own.store(square);
                total = total + own;
            }
            let low = gathered::<L, TERMS>(bins, 0, freedoms);
            let high = gathered::<L, { PRODUCTS - TERMS }>(bins, TERMS, freedoms);
            let factor = factored(&low, &high);
            // The start: a regression of logarithms, whose mean is about 1/freedom too low.
            let least = (total / low[0] * L::splat(LEAST)).max(L::splat(1e-30));
            for ((square, freedom), to) in squares.iter().zip(freedoms).zip(spectrum.iter_mut()) {
                let freedom = L::load(freedom);
                let seen = ln((L::load(square) / freedom).max(least));
                seen.mul_add(freedom, freedom.min(one)).store(to);
            }
            let mut c = solved(&factor, gathered(bins, 0, spectrum));
            for _ in 0..STEPS {
                let rows = squares.iter().zip(freedoms).zip(spectrum.iter_mut());
                for (t, ((square, freedom), to)) in bins.iter().zip(rows) {
                    let expected = exp2(-level(t, &c));
                    L::load(square).mul_add(expected, -L::load(freedom)).store(to);
                }
                let mut slope = gathered(bins, 0, spectrum);
                for i in 0..TERMS {
                    slope[i] = c[i].mul_add(L::splat(-PRIOR[i]), slope[i]);
                }
                let step = solved(&factor, slope);
                for i in 0..TERMS {
                    c[i] = c[i] + step[i].max(L::splat(-LONGEST)).min(L::splat(LONGEST));
                }
            }
            for (t, to) in bins.iter().zip(spectrum) {
                exp2(level(t, &c)).store(to);
            }
            for i in 0..TERMS {
                for j in i..TERMS {
                    factor[i][j].store(&mut to[i][j]);
                }
            }
        }
    }

    /// Covariance and degrees of freedom from spectra and influences.
    #[inline(always)]
    fn covariance<L: Lanes>(&mut self, bins: &[Terms], variance: L) {
        let p = self.parameters;
        let size = p * (p + 1) / 2;
        let fewest = L::splat(FEWEST);
        let mut at = 0;
        for i in 0..p {
            // The variance of a sum of spectra, and its own variance.
            let (mut sum, mut var) = (L::splat(0.0), L::splat(0.0));
            let mut influence = self.influence[at..].iter().step_by(size);
            for (spectrum, factor) in self.spectrum.chunks_exact(self.bins).zip(&self.factor) {
                let mut share = [L::splat(0.0); TERMS];
                for ((t, s), own) in bins.iter().zip(spectrum).zip(influence.by_ref()) {
                    along(&mut share, &t[..TERMS], L::load(own) * L::load(s));
                }
                sum = sum + share[0];
                var = var + variance_of(factor, share);
            }
            // A parameter on its bound has no influence.
            let scale = L::splat(1.0) / sum.max(L::splat(f64::MIN_POSITIVE));
            (L::splat(2.0) / (var * scale * scale)).max(fewest).store(&mut self.degrees[i]);
            (sum * variance).store(&mut self.cov[i * p + i]);
            for j in i + 1..p {
                let mut sum = L::splat(0.0);
                let influence = self.influence[at + j - i..].iter().step_by(size);
                for (own, s) in influence.zip(&self.spectrum) {
                    sum = L::load(own).mul_add(L::load(s), sum);
                }
                (sum * variance).store(&mut self.cov[i * p + j]);
                (sum * variance).store(&mut self.cov[j * p + i]);
            }
            at += p - i;
        }
    }
}

impl Spectral {
    /// The spectra of one lane.
    pub fn told(&self, bins: &Bins, lane: usize) -> NoiseSpectrum {
        let blocks = self.spectrum.chunks_exact(self.bins.max(1));
        let error = |t: &Terms, m: &Factor<Wide>| {
            let (mut of, mut sum) = (*t, 0.0);
            for i in 0..TERMS {
                sum += of[i] * of[i] * m[i][i].0[lane];
                for j in i + 1..TERMS {
                    of[j] -= m[i][j].0[lane] * of[i];
                }
            }
            (2.0 * LN_2 * sum).sqrt()
        };
        let errors = |factor: &Factor<Wide>| bins.terms.iter().map(|t| error(t, factor)).collect();
        NoiseSpectrum {
            omega: bins.omega.clone(),
            power: blocks.map(|own| own.iter().map(|s| s.0[lane]).collect()).collect(),
            log_error: self.factor.iter().map(errors).collect(),
        }
    }
}

/// Spectra and covariances of what was summed, of a noise variance of `cost` times `by`.
pub(crate) struct Finish<'a> {
    pub spectral: &'a mut Spectral,
    pub bins: &'a Bins,
    pub cost: &'a Wide,
    pub by: f64,
}

impl Kernel for Finish<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let variance = L::load(self.cost) * L::splat(self.by);
        self.spectral.regress::<L>(&self.bins.terms, variance);
        self.spectral.covariance::<L>(&self.bins.terms, variance);
    }
}

/// One estimate, whose rows come one after the other.
impl Spectral {
    /// Takes in a row of a channel and bin: its whitened residual, what its leverage leaves of it, and its influence.
    pub fn add_row(&mut self, at: usize, residual: f64, freedom: f64, influence: &[f64]) {
        self.square[at].0[0] += residual * residual;
        self.freedom[at].0[0] += freedom;
        let mut to = self.influence(at).iter_mut();
        for (i, left) in influence.iter().enumerate() {
            for (right, to) in influence[i..].iter().zip(to.by_ref()) {
                to.0[0] += left * right;
            }
        }
    }

    /// Covariance, degrees of freedom and spectra of what was taken in.
    pub fn finish(
        mut self,
        isa: Isa,
        bins: &Bins,
        variance: f64,
    ) -> (Vec<f64>, Vec<f64>, NoiseSpectrum) {
        let cost = Wide::splat(variance);
        isa.run(Finish { spectral: &mut self, bins, cost: &cost, by: 1.0 });
        let numbers = |all: &[Wide]| all.iter().map(|v| v.0[0]).collect();
        (numbers(&self.cov), numbers(&self.degrees), self.told(bins, 0))
    }
}

/// Sums over the bins of so many terms times a value.
#[inline(always)]
fn gathered<L: Lanes, const N: usize>(bins: &[Terms], first: usize, values: &[Wide]) -> [L; N] {
    let mut sums = [L::splat(0.0); N];
    for (t, value) in bins.iter().zip(values) {
        along(&mut sums, &t[first..first + N], L::load(value));
    }
    sums
}

/// sum += t value.
#[inline(always)]
fn along<L: Lanes, const N: usize>(sum: &mut [L; N], t: &[f64], value: L) {
    for (sum, t) in sum.iter_mut().zip(t) {
        *sum = value.mul_add(L::splat(*t), *sum);
    }
}

/// log₂ s where the terms are `t`.
#[inline(always)]
fn level<L: Lanes>(t: &Terms, c: &[L; TERMS]) -> L {
    let mut sum = c[0];
    for (t, c) in t[1..].iter().zip(&c[1..]) {
        sum = c.mul_add(L::splat(*t), sum);
    }
    sum
}

/// UᵀDU: U above the diagonal, 1/D on it.
type Factor<T> = [[T; TERMS]; TERMS];

/// The factor of 2 ln 2 times the information, as steps in powers of two need it, from the sums of degrees of freedom
/// times T_k: T_i T_j = ½ (T_{i+j} + T_{j−i}).
#[inline(always)]
#[allow(clippy::needless_range_loop)] // by row and column, as on paper; copies of rows cost a quarter more
fn factored<L: Lanes>(low: &[L; TERMS], high: &[L; PRODUCTS - TERMS]) -> Factor<L> {
    let mut m = [[L::splat(0.0); TERMS]; TERMS];
    for i in 0..TERMS {
        for j in i..TERMS {
            let sum = if i + j < TERMS { low[i + j] } else { high[i + j - TERMS] };
            let prior = if i == j { PRIOR[i] } else { 0.0 };
            m[i][j] = (sum + low[j - i]).mul_add(L::splat(0.5 * LN_2), L::splat(prior));
        }
    }
    for k in 0..TERMS {
        let inverse = L::splat(1.0) / m[k][k];
        for i in k + 1..TERMS {
            let by = m[k][i] * inverse;
            for j in i..TERMS {
                m[i][j] = (-by).mul_add(m[k][j], m[i][j]);
            }
            m[k][i] = by;
        }
        m[k][k] = inverse;
    }
    m
}

/// The solution of UᵀDU x = this.
#[inline(always)]
fn solved<L: Lanes>(m: &Factor<L>, mut x: [L; TERMS]) -> [L; TERMS] {
    for i in 0..TERMS {
        for j in i + 1..TERMS {
            x[j] = (-m[i][j]).mul_add(x[i], x[j]);
        }
    }
    for i in 0..TERMS {
        x[i] = x[i] * m[i][i];
    }
    for j in (0..TERMS).rev() {
        for i in 0..j {
            x[i] = (-m[i][j]).mul_add(x[j], x[i]);
        }
    }
    x
}

/// The variance of a combination of the coefficients of ln s.
#[inline(always)]
fn variance_of<L: Lanes>(m: &Factor<Wide>, mut of: [L; TERMS]) -> L {
    let mut sum = L::splat(0.0);
    for i in 0..TERMS {
        sum = (of[i] * of[i]).mul_add(L::load(&m[i][i]), sum);
        for j in i + 1..TERMS {
            of[j] = (-L::load(&m[i][j])).mul_add(of[i], of[j]);
        }
    }
    sum * L::splat(2.0 * LN_2)
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::modulation::Lines;
    use crate::simd::LANES;

    /// A matrix of the sums of degrees of freedom times a vector, solved for: the vector.
    struct Solved([f64; TERMS]);

    impl Kernel for Solved {
        type Output = [f64; TERMS];
        fn run<L: Lanes>(self) -> [f64; TERMS] {
            let low = [9.0, 1.0, -0.5, 0.3, 0.2, -0.1];
            let high: [f64; PRODUCTS - TERMS] = std::array::from_fn(|k| 0.4 - 0.1 * k as f64);
            let entry = |i: usize, j: usize| {
                let sum = if i + j < TERMS { low[i + j] } else { high[i + j - TERMS] };
                0.5 * LN_2 * (sum + low[i.abs_diff(j)]) + if i == j { PRIOR[i] } else { 0.0 }
            };
            let product: [f64; TERMS] =
                std::array::from_fn(|i| (0..TERMS).map(|j| entry(i, j) * self.0[j]).sum());
            let factor = factored::<L>(&low.map(L::splat), &high.map(L::splat));
            solved(&factor, product.map(L::splat)).map(|x| {
                let mut out = Wide::ZERO;
                x.store(&mut out);
                out.0[0]
            })
        }
    }

    #[test]
    fn factors_solve_their_equations() {
        let want = [1.0, -2.0, 0.5, 3.0, -1.5, 0.25];
        for (found, want) in Isa::Plain.run(Solved(want)).iter().zip(want) {
            assert!((found - want).abs() < 1e-12, "{found} {want}");
        }
    }

    fn lines(first: usize, last: usize, omega0: f64) -> Lines {
        Lines { first, last, omega0, unit_variance: 0.01 }
    }

    #[test]
    fn bins_are_narrow_and_every_line_has_one() {
        let records = [lines(1, 300, 0.5), lines(0, 90, 2.0)];
        let bins = Bins::new(&records);
        let mut span = vec![(f64::INFINITY, 0.0f64); bins.terms.len()];
        for (l, of) in records.iter().zip(&bins.of) {
            assert_eq!(of.len(), l.last - l.first + 1);
            for (m, bin) in (l.first..).zip(of) {
                let x = m as f64 * l.omega0 / 0.5;
                span[*bin] = (span[*bin].0.min(x), span[*bin].1.max(x));
            }
        }
        assert!(bins.terms.len() < 50);
        for (k, (low, high)) in span.iter().enumerate() {
            assert!(high - low <= (0.125 * low + 0.51).floor().max(0.0), "{k}: {low} to {high}");
            assert!(bins.terms[k][1].abs() <= 1.0 && (bins.terms[k][0] - 1.0).abs() < 1e-15);
        }
        assert!(bins.terms.windows(2).all(|pair| pair[0][1] < pair[1][1]));
        let far = Bins::new(&[lines(0, 5, 1e-200), lines(0, 5, 1e200)]);
        assert!(far.terms.len() < 20, "{}", far.terms.len());
    }

    /// Rows whose squares are what is expected of this spectrum, two a line, one parameter.
    fn expected(bins: &Bins, s: impl Fn(usize) -> f64) -> Spectral {
        let mut sums = Spectral::new(bins.terms.len(), 1, 1);
        for (m, bin) in bins.of[0].iter().enumerate() {
            for _ in 0..2 {
                sums.add_row(*bin, (0.9 * s(m)).sqrt(), 0.9, &[1.0 / (1.0 + m as f64)]);
            }
        }
        sums
    }

    #[test]
    fn smooth_spectra_are_found_and_carry_the_covariance() {
        let bins = Bins::new(&[lines(1, 60, 1.0)]);
        let falling = |m: usize| 30.0 / (2.0 + m as f64);
        for s in [|_| 7.0, falling] {
            let want: f64 = (0..60).map(|m| 2.0 * s(m) / (1.0 + m as f64).powi(2)).sum();
            let (cov, degrees, told) = expected(&bins, s).finish(Isa::Plain, &bins, 0.3);
            let level = told.power[0][20] * 0.3 / s(told.omega[20] as usize - 1);
            assert!((0.8..1.25).contains(&level), "{level}");
            assert!(told.log_error[0].iter().all(|e| (0.05..2.0).contains(e)), "{told:?}");
            // The prior draws the steep one to a flat one.
            assert!((cov[0] / want - 1.0).abs() < 0.12, "{} {want}", cov[0]);
            assert!(degrees[0] > 2.0 && degrees[0] < 20.0, "{}", degrees[0]);
        }
        let (cov, ..) = expected(&bins, |_| 0.0).finish(Isa::Plain, &bins, 0.0);
        assert_eq!(cov[0], 0.0);
    }

    #[test]
    fn eight_estimates_have_the_bits_of_one() {
        let bins = Bins::new(&[lines(0, 20, 1.0)]);
        let one = expected(&bins, |m| 1.0 + (m % 5) as f64);
        let (cov, degrees, _) = one.clone().finish(Isa::Plain, &bins, 2.0);
        for isa in Isa::available() {
            let mut all = one.clone();
            for sums in [&mut all.square, &mut all.freedom, &mut all.influence] {
                sums.iter_mut().for_each(|v| *v = Wide([v.0[0]; LANES]));
            }
            let cost = Wide::splat(2.0);
            isa.run(Finish { spectral: &mut all, bins: &bins, cost: &cost, by: 1.0 });
            for lane in 0..LANES {
                assert_eq!(all.cov[0].0[lane].to_bits(), cov[0].to_bits(), "{isa:?}");
                assert_eq!(all.degrees[0].0[lane].to_bits(), degrees[0].to_bits(), "{isa:?}");
            }
        }
    }
}
