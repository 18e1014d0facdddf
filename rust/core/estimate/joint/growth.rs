//! By how much errors grow because the covariance of the outputs' noise, and with it the weights, is estimated too.
//!
//! With l_mi = H J_miᵀ the influences of output i's whitened rows on θ, and ν degrees of freedom an output,
//!
//! ```text
//! cov θ̂ = H + 2/(ν − q − 1) [(q + 1) Σ_i P_ii − Σ_i 2 P_ii H⁻¹ P_ii − Σ_{i<j} P_ij H⁻¹ P_ij],
//! P_ii = Σ_m l_mi l_miᵀ,   P_ij = Σ_m (l_mi l_mjᵀ + l_mj l_miᵀ).
//! ```
//!
//! One half is what estimates lose to weights that scatter, the other what H of these weights leaves out (M. G. Kenward
//! and J. H. Roger, Biometrics 53, 1997). Weights are made of Σ̂⁻¹, which scatters as 1/(ν − q − 1) where Σ̂ scatters
//! as 1/ν. The variance of each parameter grows by its own ratio; correlations stay.

use super::design::JointDesign;
use super::workspace::JointWorkspace;
use crate::linalg::large::{product, transposed_product};
use crate::simd::{Kernel, Lanes};
use crate::structure::Method;

impl JointDesign {
    /// Whether the weights that θ was found with are estimates.
    pub(super) fn estimates_weights(&self) -> bool {
        self.estimates_covariance() && matches!(self.method, Method::Ml | Method::Awls)
    }

    /// Pairs of outputs whose influences are summed.
    pub(super) fn pairs(&self) -> usize {
        let q = self.outputs();
        if self.estimates_weights() { q * (q + 1) / 2 } else { 0 }
    }
}

/// 2/(ν − q − 1) for `freedom` degrees of freedom of all outputs.
fn scatter(freedom: usize, outputs: usize) -> f64 {
    let q = outputs as f64;
    2.0 / (freedom as f64 / q - q - 1.0).max(1.0)
}

/// Takes in the influences of a line of variance 1/`weight`, as they stand in the workspace.
#[inline(always)]
pub(super) fn add_line<L: Lanes>(d: &JointDesign, w: &mut JointWorkspace, weight: L) {
    let (q, p) = (d.outputs(), d.parameters());
    let of = |part: usize, i: usize, a: usize| L::load(&w.influence[part][i * p + a]);
    let mut to = w.shared.iter_mut();
    for i in 0..q {
        for j in i..q {
            for a in 0..p {
                let (re, im) = (of(0, i, a) * weight, of(1, i, a) * weight);
                let (other_re, other_im) = (of(0, j, a) * weight, of(1, j, a) * weight);
                for (b, to) in (0..p).zip(to.by_ref()) {
                    let mut sum = re.mul_add(of(0, j, b), L::load(to));
                    sum = im.mul_add(of(1, j, b), sum);
                    if i < j {
                        sum = other_re.mul_add(of(0, i, b), sum);
                        sum = other_im.mul_add(of(1, i, b), sum);
                    }
                    sum.store(to);
                }
            }
        }
    }
}

/// Lets the covariances in the workspace grow.
pub(super) struct Grow<'a> {
    pub design: &'a JointDesign,
    pub space: &'a mut JointWorkspace,
}

impl Kernel for Grow<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (d, w) = (self.design, self.space);
        let (q, p) = (d.outputs(), d.parameters());
        let by = L::splat(scatter(d.freedom(w.records.iter().map(|r| r.limit)), q));
        let (zero, least) = (L::splat(0.0), L::splat(f64::MIN_POSITIVE));
        for a in 0..p {
            let mut lost = zero;
            let mut pairs = w.shared.chunks_exact(p * p);
            for i in 0..q {
                for (j, own) in (i..q).zip(pairs.by_ref()) {
                    let row = &own[a * p..(a + 1) * p];
                    let mut square = zero;
                    for (c, left) in row.iter().enumerate() {
                        let gram = &w.gram[c * p..(c + 1) * p];
                        let sum = gram.iter().zip(row).fold(zero, |sum, (gram, right)| {
                            L::load(gram).mul_add(L::load(right), sum)
                        });
                        square = L::load(left).mul_add(sum, square);
                    }
                    let all = L::splat((q + 1) as f64) * L::load(&row[a]);
                    lost = lost + if i == j { all - square - square } else { -square };
                }
            }
            // On a bound a parameter has neither.
            let own = L::load(&w.inverse[a * p + a]).max(least);
            let ratio = (by * lost.max(zero) / own) + L::splat(1.0);
            ratio.sqrt().store(&mut w.unknowns[a]);
        }
        for cov in [&mut w.covariances.nonrobust, &mut w.covariances.spectral.cov] {
            for (at, value) in cov.iter_mut().enumerate() {
                let by = L::load(&w.unknowns[at / p]) * L::load(&w.unknowns[at % p]);
                (by * L::load(value)).store(value);
            }
        }
    }
}

/// The same sums of a single problem of so many outputs and parameters.
pub(super) struct Shared {
    q: usize,
    p: usize,
    pairs: Vec<Vec<f64>>,
}

impl Shared {
    pub fn new(d: &JointDesign, parameters: usize) -> Shared {
        let pairs = vec![vec![0.0; parameters * parameters]; d.pairs()];
        Shared { q: d.outputs(), p: parameters, pairs }
    }

    /// Takes in the influences of a record: columns of `height`, of which each output has `rows`.
    pub fn add_record(&mut self, influence: &[f64], height: usize, rows: usize) {
        let (q, p) = (self.q, self.p);
        if self.pairs.is_empty() || height == 0 {
            return;
        }
        let mut pairs = self.pairs.iter_mut();
        let own = |i: usize| -> Vec<f64> {
            let columns = influence.chunks_exact(height);
            columns.flat_map(|column| &column[i * rows..(i + 1) * rows]).copied().collect()
        };
        let outputs: Vec<Vec<f64>> = (0..q).map(own).collect();
        let mut sum = vec![0.0; p * p];
        for i in 0..q {
            for (j, to) in (i..q).zip(pairs.by_ref()) {
                transposed_product(&outputs[i], &outputs[j], rows, (p, p), &mut sum);
                for (at, to) in to.iter_mut().enumerate() {
                    *to += sum[at] + if i < j { sum[at % p * p + at / p] } else { 0.0 };
                }
            }
        }
    }

    /// By how much each error grows, from H⁻¹ = RᵀR and the variances in H.
    pub fn growth(&self, triangle: &[f64], variances: &[f64], freedom: usize) -> Vec<f64> {
        let (q, p) = (self.q, self.p);
        let (mut lost, mut turned) = (vec![0.0; p], vec![0.0; p * p]);
        let mut pairs = self.pairs.iter();
        for i in 0..q {
            for (j, own) in (i..q).zip(pairs.by_ref()) {
                product(triangle, own, (p, p, p), &mut turned);
                for (a, (lost, column)) in lost.iter_mut().zip(turned.chunks_exact(p)).enumerate() {
                    let square: f64 = column.iter().map(|x| x * x).sum();
                    let all = (q + 1) as f64 * own[a * (p + 1)];
                    *lost += if i == j { all - 2.0 * square } else { -square };
                }
            }
        }
        let by = scatter(freedom, q);
        let each = lost.iter().zip(variances);
        each.map(|(lost, own)| (1.0 + by * lost.max(0.0) / own.max(f64::MIN_POSITIVE)).sqrt())
            .collect()
    }
}
