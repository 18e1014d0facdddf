//! What noise does to the responses of a neighbourhood: gains for it, and covariances.

use super::{Columns, Workspace, explained};
use crate::response::factor::{Complex, Pair};
use crate::response::{Family, Settings, Weighting};
use crate::simd::{Lanes, Wide};

impl Workspace {
    /// Keeps of an output what its covariance with others is made of.
    #[inline(always)]
    pub(super) fn keep<L: Lanes>(&mut self, settings: Settings, columns: Columns, output: usize) {
        let (lines, rows, inputs) = (self.lines(), self.rows(), self.inputs);
        let plain = settings.family == Family::Rational && settings.weighting == Weighting::Ls;
        if settings.family == Family::Rational {
            self.denominator::<L>(columns, false);
        }
        for r in 0..rows {
            let mut leverage = L::splat(0.0);
            for j in 0..columns.all {
                leverage = leverage + Complex::<L>::load(&self.factor.column(j)[r]).square();
            }
            let rest = Complex::<L>::load(&self.factor.column(columns.all)[r]);
            let one = L::splat(1.0);
            (rest.square() / ((one - leverage) * (one - leverage)))
                .store(&mut self.left_out[output * rows + r]);
            rest.store(&mut self.residual[output * rows + r]);
        }
        // The inverse of R's last block, upper triangular.
        for b in 0..inputs {
            for a in (0..=b).rev() {
                let mut sum = if a == b { Complex::<L>::one() } else { Complex::zero() };
                for c in a + 1..=b {
                    let upper =
                        Complex::<L>::load(self.factor.upper(columns.own + a, columns.own + c));
                    sum = upper.neg().mul_add(Complex::load(&self.small[c * inputs + b]), sum);
                }
                sum.scale(L::load(self.factor.inverse(columns.own + a)))
                    .store(&mut self.small[a * inputs + b]);
            }
        }
        for a in 0..inputs {
            for r in 0..rows {
                let mut sum = Complex::<L>::zero();
                for b in a..inputs {
                    let q = Complex::<L>::load(&self.factor.column(columns.own + b)[r]).conj();
                    sum = Complex::load(&self.small[a * inputs + b]).mul_add(q, sum);
                }
                sum.store(&mut self.stage[r]);
            }
            self.gain_on_lines::<L>(output * inputs + a, plain);
        }
        for k in 0..lines {
            let mut size = Complex::<L>::one();
            if plain {
                size = Complex::<L>::load(&self.inverse[k]).inverse();
            }
            size.store(&mut self.size[output * lines + k]);
        }
        // An input that does not move, or moves as another does, tells nothing.
        let mut told = L::splat(1.0);
        for b in 0..inputs {
            let inverse = L::load(self.factor.inverse(columns.own + b));
            told = L::splat(0.0).select_lt(inverse, told, L::splat(f64::NAN));
        }
        for a in 0..inputs {
            Complex::<L>::load(&self.x[columns.own + a])
                .scale(told)
                .store(&mut self.response[output * inputs + a]);
        }
        self.power_without_transient::<L>(columns, output);
    }

    /// Mean square of what of the output is no transient; where T is not fitted, of what the inputs explain.
    #[inline(always)]
    fn power_without_transient<L: Lanes>(&mut self, columns: Columns, output: usize) {
        let (lines, terms) = (self.lines(), self.terms);
        let (mut power, mut k) = (L::splat(0.0), 0);
        for (piece, &(width, _)) in self.widths.iter().enumerate() {
            for _ in 0..width {
                let r = L::load(&self.distance[k]);
                let inverse = Complex::load(&self.inverse[k]);
                let part = if columns.transient == 0 {
                    explained::<L>(&self.x, columns, &self.u, lines, terms, k, r).mul(inverse)
                } else {
                    let mut sum = Complex::<L>::zero();
                    for c in self.x[piece * terms..(piece + 1) * terms].iter().rev() {
                        sum = sum.scale(r).add(Complex::load(c));
                    }
                    sum.mul(inverse).neg().add(Complex::load(&self.y[output * lines + k]))
                };
                power = power + part.square();
                k += 1;
            }
        }
        (power / L::splat(lines as f64)).store(&mut self.power[output]);
    }

    /// What is staged by rows, the response's gain for what stands on them, as its gain for the output's noise on
    /// the lines.
    #[inline(always)]
    fn gain_on_lines<L: Lanes>(&mut self, path: usize, plain: bool) {
        let lines = self.lines();
        let gain = &mut self.gain[path * lines..(path + 1) * lines];
        transpose::<L>(&self.widths, &self.stage, gain);
        if plain {
            // The noise on these rows is A times that of the output.
            for (x, inverse) in gain.iter_mut().zip(&self.inverse) {
                Complex::<L>::load(x).mul(Complex::load(inverse).inverse()).store(x);
            }
        }
    }

    /// What unit noise on the lines leaves as sum of squares on the rows.
    #[inline(always)]
    fn left<L: Lanes>(&mut self, columns: Columns) -> L {
        let (lines, rows) = (self.lines(), self.rows());
        if rows == lines {
            return L::splat((rows - columns.all) as f64);
        }
        // Of differences: the squares of their coefficients, less what lies along the columns.
        let binomial = (1..=self.terms).fold(1.0, |c, k| c * (self.terms + k) as f64 / k as f64);
        let mut left = L::splat(rows as f64 * binomial);
        for j in 0..columns.all {
            transpose::<L>(&self.widths, self.factor.column(j), &mut self.model);
            for x in &self.model {
                left = left - Complex::<L>::load(x).square();
            }
        }
        left
    }

    /// Covariance of the noise and of all responses.
    #[inline(always)]
    pub(super) fn covariance<L: Lanes>(&mut self, columns: Columns) {
        let (lines, rows) = (self.lines(), self.rows());
        let (inputs, outputs) = (self.inputs, self.outputs);
        let scale = self.left::<L>(columns) * L::splat(1.0 / lines as f64);
        let paths = outputs * inputs;
        for i in 0..outputs {
            for k in 0..outputs {
                let (mut sum, mut size) = (Complex::<L>::zero(), Complex::<L>::zero());
                for r in 0..rows {
                    let other = Complex::<L>::load(&self.residual[k * rows + r]).conj();
                    sum = Complex::load(&self.residual[i * rows + r]).mul_add(other, sum);
                }
                for r in 0..lines {
                    let other = Complex::<L>::load(&self.size[k * lines + r]).conj();
                    size = Complex::load(&self.size[i * lines + r]).mul_add(other, size);
                }
                let noise = sum.mul(size.scale(scale).inverse());
                noise.store(&mut self.noise[i * outputs + k]);
                for a in 0..inputs {
                    for b in 0..inputs {
                        let (p, q) = (i * inputs + a, k * inputs + b);
                        let mut sum = Complex::<L>::zero();
                        for r in 0..lines {
                            let other = Complex::<L>::load(&self.gain[q * lines + r]).conj();
                            sum = Complex::load(&self.gain[p * lines + r]).mul_add(other, sum);
                        }
                        sum.mul(noise).store(&mut self.cov[p * paths + q]);
                    }
                }
            }
        }
    }
}

/// From rows, differences of lines, back to lines by the differences' transpose.
#[inline(always)]
fn transpose<L: Lanes>(widths: &[(usize, usize)], rows: &[Pair], lines: &mut [Pair]) {
    let (mut from, mut to) = (0, 0);
    for &(width, kept) in widths {
        let own = &mut lines[to..to + width];
        own[..kept].copy_from_slice(&rows[from..from + kept]);
        for last in kept..width {
            own[last] = [Wide::ZERO; 2];
            for k in (0..=last).rev() {
                let mut value = Complex::<L>::load(&own[k]).neg();
                if k > 0 {
                    value = value.add(Complex::load(&own[k - 1]));
                }
                value.store(&mut own[k]);
            }
        }
        from += kept;
        to += width;
    }
}
