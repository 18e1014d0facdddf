//! The transient of a record as a function of the parameters: T = t + Dθ, in force where the start is known.

use std::sync::Arc;

use super::Course;
use super::drive::{Drive, Drives};
use crate::modulation::Column;
use crate::simd::{Lanes, Wide};
use crate::structure::Structure;

/// T of a record by θ: t + Dθ.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tie {
    pub drives: Arc<Drives>,
    /// Coefficients that are tied, and how many numbers θ has.
    pub tied: usize,
    parameters: usize,
    /// t, then D row by row.
    pub base: Vec<Wide>,
    pub slopes: Vec<Wide>,
    /// Whether it is in force.
    pub active: bool,
}

impl Tie {
    /// For `tied` coefficients and θ of so many numbers.
    pub fn new(tied: usize, parameters: usize) -> Tie {
        let wide = |n: usize| vec![Wide::ZERO; n];
        Tie {
            drives: Arc::default(),
            tied,
            parameters,
            base: wide(tied),
            slopes: wide(tied * parameters),
            active: false,
        }
    }

    /// In force or not; where it is, T is nothing until it is set.
    pub fn begin(&mut self, active: bool) {
        self.active = active;
        self.base.fill(Wide::ZERO);
        self.slopes.fill(Wide::ZERO);
    }

    /// T at θ.
    #[inline(always)]
    pub fn at<L: Lanes>(&self, theta: &[Wide], out: &mut [Wide]) {
        for (i, out) in out[..self.tied].iter_mut().enumerate() {
            let mut sum = L::load(&self.base[i]);
            let row = &self.slopes[i * self.parameters..][..self.parameters];
            for (slope, theta) in row.iter().zip(theta) {
                sum = L::load(slope).mul_add(L::load(theta), sum);
            }
            sum.store(out);
        }
    }

    /// The system [T, θ | target] with T = t + Dθ put in: what is left of T's own equations is T = 0.
    #[inline(always)]
    pub fn put_in<L: Lanes>(
        &self,
        m: &mut [Wide],
        diagonal: &mut [Wide],
        transient: usize,
        symmetric: bool,
    ) {
        let (p, size) = (self.parameters, transient + self.parameters);
        let width = size + 1;
        if symmetric {
            for i in 0..size {
                for j in 0..i {
                    m[i * width + j] = m[j * width + i];
                }
            }
        }
        for r in 0..size {
            let row = &mut m[r * width..][..width];
            for i in 0..self.tied {
                let own = L::load(&row[i]);
                for j in 0..p {
                    let to = &mut row[transient + j];
                    own.mul_add(L::load(&self.slopes[i * p + j]), L::load(to)).store(to);
                }
                (-own).mul_add(L::load(&self.base[i]), L::load(&row[size])).store(&mut row[size]);
            }
        }
        for i in 0..self.tied {
            for j in 0..p {
                let slope = L::load(&self.slopes[i * p + j]);
                for c in 0..width {
                    let from = L::load(&m[i * width + c]);
                    let to = &mut m[(transient + j) * width + c];
                    from.mul_add(slope, L::load(to)).store(to);
                }
            }
        }
        for i in 0..self.tied {
            for c in 0..size {
                L::splat(0.0).store(&mut m[i * width + c]);
                L::splat(0.0).store(&mut m[c * width + i]);
            }
            L::splat(0.0).store(&mut m[i * width + size]);
            L::load(&diagonal[i]).store(&mut m[i * width + i]);
        }
        for j in 0..size {
            L::load(&m[j * width + j]).store(&mut diagonal[j]);
        }
    }

    /// What takes T out of a row of θ: its projection on the free columns stays, tied ones follow θ.
    #[inline(always)]
    pub fn project(&self, projection: &mut [Wide]) {
        for (to, slope) in projection.iter_mut().zip(&self.slopes) {
            *to = Wide(slope.0.map(|v| -v));
        }
    }

    /// t and D at θ, time in units of the band edge.
    #[inline(always)]
    pub fn set<L: Lanes>(
        &mut self,
        structure: &Structure,
        columns: &[Column],
        course: &Course,
        theta: &[Wide],
    ) {
        let (n, p) = (structure.order, self.parameters);
        self.base.fill(Wide::ZERO);
        self.slopes.fill(Wide::ZERO);
        // Rising powers, monic.
        let mut a: Vec<Wide> = theta[..n].iter().rev().copied().collect();
        a.push(Wide::splat(1.0));
        let mut square = vec![Wide::ZERO; 2 * n + 1];
        for i in 0..=n {
            for j in 0..=n {
                let sum = &mut square[i + j];
                L::load(&a[i]).mul_add(L::load(&a[j]), L::load(sum)).store(sum);
            }
        }
        let drives = Arc::clone(&self.drives);
        let mut first = n;
        for (degree, drive) in structure.numerators.iter().zip(&drives.inputs) {
            let Some(degree) = degree else { continue };
            let b: Vec<Wide> = theta[first..=first + degree].iter().rev().copied().collect();
            let v = drive.ends::<L>(&square, course, 0.0);
            self.add::<L>(columns, course, (&a, &b, &v), |row, l, by| {
                let to = &mut row[first + degree - l];
                (L::load(to) + by).store(to);
            });
            first += degree + 1;
        }
        if !drives.state.is_empty() {
            let (rate, mut power) = (course.seconds / course.step, 1.0);
            let mut own = drives.state.clone();
            for x in &mut own {
                *x *= power;
                power *= rate;
            }
            let through = |l: usize| {
                let mut sum = Wide::ZERO;
                for (a, x) in a[l + 1..].iter().zip(&own) {
                    (L::load(a).mul_add(L::splat(*x), L::load(&sum))).store(&mut sum);
                }
                sum
            };
            let b: Vec<Wide> = (0..n).map(through).collect();
            let silent = Drive::silent(course.lead + course.intervals);
            let v = silent.ends::<L>(&square, course, 1.0);
            self.add::<L>(columns, course, (&a, &b, &v), |row, l, by| {
                for (k, x) in (l + 1..n).zip(&own) {
                    let to = &mut row[n - 1 - k];
                    by.mul_add(L::splat(*x), L::load(to)).store(to);
                }
            });
        }
        // t = T − Dθ.
        for d in 0..self.tied {
            let mut sum = L::load(&self.base[d]);
            for (slope, theta) in self.slopes[d * p..][..p].iter().zip(theta) {
                sum = (-L::load(slope)).mul_add(L::load(theta), sum);
            }
            sum.store(&mut self.base[d]);
        }
        self.active = true;
    }

    /// Adds what y = B(p)z, A(p)z = u leaves in T, and its slopes; `by_beta` puts those by β_l into a row.
    #[inline(always)]
    fn add<L: Lanes>(
        &mut self,
        columns: &[Column],
        course: &Course,
        (a, b, v): (&[Wide], &[Wide], &[Wide]),
        by_beta: impl Fn(&mut [Wide], usize, L),
    ) {
        let (n, p) = (a.len() - 1, self.parameters);
        let per_duration = L::splat(1.0 / (course.step * course.intervals as f64));
        // δ_i of z = A(p)v.
        let mut z = vec![Wide::ZERO; n];
        for (i, z) in z.iter_mut().enumerate() {
            let mut sum = L::splat(0.0);
            for (k, a) in a.iter().enumerate() {
                let known = i + k < 2 * n;
                sum = if known { L::load(a).mul_add(L::load(&v[i + k]), sum) } else { sum };
            }
            (sum * per_duration).store(z);
        }
        for (d, column) in columns[..self.tied.min(n)].iter().enumerate() {
            // Columns hold −x^d where s^d is i^d x^d.
            let sign = if d / 2 % 2 == 0 { 1.0 } else { -1.0 } * -column.sign;
            let sign = L::splat(sign);
            let row = &mut self.slopes[d * p..][..p];
            let mut value = L::splat(0.0);
            for k in 0..=n {
                for (l, beta) in b.iter().enumerate() {
                    let up = k <= d && d < l;
                    if !(up || (l <= d && d < k)) {
                        continue;
                    }
                    let e = if up { sign } else { -sign };
                    let i = k + l - 1 - d;
                    let (alpha, beta) = (L::load(&a[k]) * e, L::load(beta));
                    let delta = L::load(&z[i]);
                    value = (alpha * beta).mul_add(delta, value);
                    // By β_l, and by α_k where it stands as a factor.
                    by_beta(row, l, alpha * delta);
                    if k < n {
                        let to = &mut row[n - 1 - k];
                        (beta * e).mul_add(delta, L::load(to)).store(to);
                    }
                    // By each α_j through z.
                    let both = -(alpha * beta) * per_duration;
                    for j in 0..n {
                        let to = &mut row[n - 1 - j];
                        both.mul_add(L::load(&v[i + j]), L::load(to)).store(to);
                    }
                }
            }
            let base = &mut self.base[d];
            (L::load(base) + value).store(base);
        }
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::super::Initial;
    use super::*;
    use crate::modulation::transient_columns;
    use crate::quadrature::Hold;
    use crate::simd::{Isa, Kernel, LANES};
    use crate::structure::Trend;

    const THETA: [f64; 4] = [0.7, 0.4, 0.3, 0.2]; // s² + .7 s + .4, .3 s + .2
    const STEPS: usize = 40;

    struct Set<'a>(&'a mut Tie, &'a Structure, &'a [Wide]);

    impl Kernel for Set<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            let course = Course { step: 0.3, seconds: 1.0, lead: 0, intervals: STEPS };
            let columns = transient_columns(self.1.order, true, Trend::None);
            self.0.set::<L>(self.1, &columns, &course, self.2);
        }
    }

    /// T at θ and its slopes.
    fn tied(
        structure: &Structure,
        theta: &[f64],
        hold: Option<Hold>,
        state: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = (0..=STEPS).map(|k| (0.2 * k as f64).cos()).collect();
        let mut tie = Tie::new(structure.order, theta.len());
        let drive = Drive::new(hold, 0.0, Initial::Zero, STEPS, 1.0, [&u; LANES]);
        tie.drives = Arc::new(Drives { inputs: vec![drive], state: state.to_vec() });
        let wide: Vec<Wide> = theta.iter().map(|x| Wide::splat(*x)).collect();
        Isa::Plain.run(Set(&mut tie, structure, &wide));
        let row = |d: usize| {
            let slopes = tie.slopes[d * theta.len()..][..theta.len()].iter().zip(theta);
            slopes.fold(tie.base[d].0[0], |sum, (slope, x)| sum + slope.0[0] * x)
        };
        let values = (0..structure.order).map(row).collect();
        (values, tie.slopes.iter().map(|x| x.0[0]).collect())
    }

    #[test]
    fn one_pole_has_its_end_for_a_transient() {
        let structure = Structure::new(1, vec![Some(0)]).unwrap();
        let (a, b, h) = (0.8f64, 0.5f64, 0.3f64);
        let decay = (-a * h).exp();
        let end =
            (0..STEPS).fold(0.0, |z, k| decay * z + (1.0 - decay) / a * (0.2 * k as f64).cos());
        let (found, _) = tied(&structure, &[a, b], Some(Hold::Zoh), &[]);
        assert!((found[0].abs() - b * end.abs() / (STEPS as f64 * h)).abs() < 1e-12);
        // From a state, what decays of it as well.
        let (moved, _) = tied(&structure, &[a, b], Some(Hold::Zoh), &[0.6]);
        let decayed = 0.6 * ((-a * h * STEPS as f64).exp() - 1.0) / (STEPS as f64 * h);
        let sign = (found[0] * end).signum();
        assert!((moved[0] - found[0] - sign * decayed).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let structure = Structure::new(2, vec![Some(1)]).unwrap();
        let cases = [(Some(Hold::Zoh), vec![]), (Some(Hold::Foh), vec![0.4, -0.7]), (None, vec![])];
        for (hold, state) in cases {
            let (_, slopes) = tied(&structure, &THETA, hold, &state);
            for k in 0..THETA.len() {
                let moved = |by: f64| {
                    let mut theta = THETA;
                    theta[k] += by;
                    tied(&structure, &theta, hold, &state).0
                };
                for (d, (up, down)) in moved(1e-5).iter().zip(moved(-1e-5)).enumerate() {
                    let wanted = (up - down) / 2e-5;
                    assert!(
                        (slopes[d * THETA.len() + k] - wanted).abs() < 1e-8,
                        "{hold:?} {d} {k}"
                    );
                }
            }
        }
    }
}
