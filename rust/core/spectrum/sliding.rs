//! Coefficients of the last window of a stream of samples, by a recursion whose errors do not grow.
//!
//! A plan's coefficient is Σ_j c_j(m) v_j over the samples of its window, with c_j(m) = g(m) e^{−2πimj/N} but
//! for a few samples at either end (end weights, holds, taps of a delay). The middle part slides: one sample
//! comes, one goes, with the phase of their number in the stream. Sums that samples leave again keep the
//! rounding of all that passed; so a second set of sums counts only the samples since the last multiple of N,
//! and takes the place of the first when it has seen a whole window. Where a sample leaves that is much larger
//! than what stays, the sums are made anew at once.

use crate::error::Error;
use crate::math::root_of_unity;
use crate::quadrature::times;

use super::{CoefficientPlan, Scratch, Sums, offset::offset};
use crate::simd::Isa;

/// Samples at either end of the middle part whose coefficients are looked at one by one.
const ENDS: usize = 16;
/// Below this part of the middle's coefficient a difference is rounding.
const ROUNDING: f64 = 1e-13;
/// A sample so many times larger than all sums leaves rounding behind that counts.
const LARGE: f64 = 1e3;

/// Coefficients of one channel over a window that slides along its samples.
#[derive(Debug, Clone)]
pub struct Sliding {
    intervals: usize,
    /// Place in the window of the middle part's first sample.
    first: usize,
    /// The window's samples, the latest at `(count − 1) % samples`.
    ring: Vec<f64>,
    /// The plan's sums of a constant one.
    constant: Vec<(f64, f64)>,
    /// Samples so far.
    count: u64,
    /// e^{2πik/N}, k = 0…N−1: (cos, sin).
    roots: Vec<(f64, f64)>,
    /// Sums over the last N samples of the middle part, and over those since a multiple of N.
    window: Vec<(f64, f64)>,
    block: Vec<(f64, f64)>,
    /// g(m).
    gain: Vec<(f64, f64)>,
    ends: Vec<End>,
}

/// A sample with coefficients of its own: its place in the window, and what it adds to g(m) e^{−2πimj/N}.
type End = (usize, Vec<(f64, f64)>);

impl Sliding {
    /// For the coefficients of a plan of even samples.
    ///
    /// # Errors
    /// [`Error::Spec`] for the parabolic rule, whose weights alternate, and for uneven samples.
    pub fn new(plan: &CoefficientPlan) -> Result<Sliding, Error> {
        if matches!(plan.sums, Sums::Uneven { .. }) {
            return Err(Error::Spec(
                "a stream has one step; for uneven samples fit records instead".into(),
            ));
        }
        let (n, samples, first) = (plan.intervals, plan.samples(), plan.first);
        let roots: Vec<_> = (0..n).map(|k| root_of_unity(k as u64, n as u64)).collect();
        let zeros = vec![(0.0, 0.0); plan.harmonics + 1];
        let turn = |m: usize, j: usize| {
            // e^{−2πim(j − first)/N}
            let (cos, sin) = roots[(m * ((j + n - first % n) % n)) % n];
            (cos, -sin)
        };
        let middle = first + n / 2;
        let gain = unit(plan, middle)?;
        let gain: Vec<_> = gain
            .iter()
            .enumerate()
            .map(|(m, c)| {
                let (re, im) = turn(m, middle);
                times(*c, (re, -im))
            })
            .collect();
        let size = gain.iter().fold(0.0, |most: f64, g| most.max(g.0.abs().max(g.1.abs())));
        let place = |j: usize| -> Result<Option<End>, Error> {
            let inside = (first..first + n).contains(&j);
            let own = unit(plan, j)?;
            let off: Vec<_> = own
                .iter()
                .zip(&gain)
                .enumerate()
                .map(|(m, (c, g))| {
                    let usual = if inside { times(*g, turn(m, j)) } else { (0.0, 0.0) };
                    (c.0 - usual.0, c.1 - usual.1)
                })
                .collect();
            let counts = off.iter().any(|d| d.0.abs().max(d.1.abs()) > ROUNDING * size);
            Ok(counts.then_some((j, off)))
        };
        if n > 3 * ENDS && place(middle + 1)?.is_some() {
            return Err(Error::Spec(
                "a stream cannot slide rule=\"parabolic\": its weights depend on whether a sample is odd or \
                 even; use \"gregory\""
                    .into(),
            ));
        }
        let near = |j: &usize| n <= 3 * ENDS || *j < first + ENDS || *j + ENDS >= first + n;
        let ends = (0..samples).filter(near).map(place).filter_map(Result::transpose);
        Ok(Sliding {
            intervals: n,
            first,
            ring: vec![0.0; samples],
            constant: sums(plan, &vec![1.0; samples])?,
            count: 0,
            window: zeros.clone(),
            block: zeros,
            ends: ends.collect::<Result<_, Error>>()?,
            gain,
            roots,
        })
    }

    /// Samples of a window.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.ring.len()
    }

    /// Intervals N of a window.
    #[must_use]
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Samples so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Whether there are samples for a whole window.
    #[must_use]
    pub fn ready(&self) -> bool {
        self.count >= self.ring.len() as u64
    }

    /// The sample at a place of the window, 0 the oldest; of no use before [`Sliding::ready`].
    #[must_use]
    pub fn at(&self, place: usize) -> f64 {
        let size = self.ring.len() as u64;
        self.ring[((self.count + place as u64) % size) as usize]
    }

    /// Takes one more sample; the window moves on by one.
    pub fn push(&mut self, sample: f64) {
        let (n, size) = (self.intervals as u64, self.ring.len() as u64);
        let slot = (self.count % size) as usize;
        // The middle part lags by the samples after it; the one that leaves it may stand in the new one's slot.
        let lag = size - n - self.first as u64;
        if let Some(entering) = self.count.checked_sub(lag) {
            let held = |number: u64| self.ring[(number % size) as usize];
            let leaving = entering.checked_sub(n).map_or(0.0, held);
            self.slide(held(entering), leaving, (entering % n) as usize);
            // As a rule the first sum says no.
            let small = |(re, im): &(f64, f64)| {
                let size = re.abs().max(im.abs());
                size.is_nan() || leaving.abs() > LARGE * size
            };
            if self.window.iter().all(small) {
                self.renew(entering);
            }
        }
        self.ring[slot] = sample;
        self.count += 1;
    }

    /// Sums made anew of the N samples up to this one, number `last` of the stream.
    fn renew(&mut self, last: u64) {
        let (n, size) = (self.intervals as u64, self.ring.len() as u64);
        self.window.fill((0.0, 0.0));
        self.block.fill((0.0, 0.0));
        for number in (last + 1).saturating_sub(n)..=last {
            let (sample, phase) = (self.ring[(number % size) as usize], number % n);
            for (m, (window, block)) in self.window.iter_mut().zip(&mut self.block).enumerate() {
                let (cos, sin) = self.roots[(m as u64 * phase % n) as usize];
                *window = (window.0 + sample * cos, window.1 - sample * sin);
                // The block holds what came after the last multiple of N.
                if number / n == (last + 1) / n {
                    *block = (block.0 + sample * cos, block.1 - sample * sin);
                }
            }
        }
    }

    fn slide(&mut self, new: f64, old: f64, phase: usize) {
        let n = self.intervals;
        let change = new - old;
        let mut at = 0;
        for (window, block) in self.window.iter_mut().zip(&mut self.block) {
            let (cos, sin) = self.roots[at];
            *window = (window.0 + change * cos, window.1 - change * sin);
            *block = (block.0 + new * cos, block.1 - new * sin);
            at += phase;
            if at >= n {
                at -= n;
            }
        }
        if phase + 1 == n {
            std::mem::swap(&mut self.window, &mut self.block);
            self.block.fill((0.0, 0.0));
        }
    }

    /// Coefficients V(0)…V(M) of the last window; of no use before [`Sliding::ready`].
    pub fn coefficients(&self, re: &mut [f64], im: &mut [f64]) {
        let (n, size) = (self.intervals as u64, self.ring.len() as u64);
        // The middle part's first sample has the phase of its number in the stream.
        let begin = (self.count + self.first as u64).saturating_sub(size);
        let phase = (begin % n) as usize;
        let mut at = 0;
        for (m, (sum, gain)) in self.window.iter().zip(&self.gain).enumerate() {
            let turned = times(times(*sum, self.roots[at]), *gain);
            (re[m], im[m]) = turned;
            at += phase;
            if at >= self.intervals {
                at -= self.intervals;
            }
        }
        let offset = offset(self.samples(), |place| self.at(place));
        let values = self.ends.iter().map(|(place, own)| (self.at(*place), own));
        for (value, own) in values.chain([(-offset, &self.constant)]) {
            for ((re, im), c) in re.iter_mut().zip(im.iter_mut()).zip(own) {
                *re += value * c.0;
                *im += value * c.1;
            }
        }
        re[0] += offset;
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.count = 0;
        for sums in [&mut self.window, &mut self.block] {
            sums.fill((0.0, 0.0));
        }
    }
}

/// A plan's coefficients of a sample of size one.
fn unit(plan: &CoefficientPlan, place: usize) -> Result<Vec<(f64, f64)>, Error> {
    let mut record = vec![0.0; plan.samples()];
    record[place] = 1.0;
    sums(plan, &record)
}

/// A plan's coefficients of a record as it is.
fn sums(plan: &CoefficientPlan, record: &[f64]) -> Result<Vec<(f64, f64)>, Error> {
    let (mut re, mut im) = (vec![0.0; plan.harmonics + 1], vec![0.0; plan.harmonics + 1]);
    plan.sum(Isa::detect()?, record, &mut re, &mut im, &mut Scratch::default())?;
    Ok(re.into_iter().zip(im).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{Hold, Rule};
    use crate::spectrum::Kind;
    use proptest::prelude::*;

    /// Numbers that look random, without a generator.
    fn sample(k: u64) -> f64 {
        let mut z = k.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678_9abc_def1);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    /// Largest difference from the plan's own coefficients of the last window, over their size.
    fn off(plan: &CoefficientPlan, sliding: &Sliding, sample: impl Fn(u64) -> f64) -> f64 {
        let last: Vec<f64> = (0..plan.samples() as u64)
            .map(|j| sample(sliding.count() - plan.samples() as u64 + j))
            .collect();
        let lines = plan.harmonics() + 1;
        let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
        plan.run(&last, &mut re, &mut im).unwrap();
        let (mut own_re, mut own_im) = (vec![0.0; lines], vec![0.0; lines]);
        sliding.coefficients(&mut own_re, &mut own_im);
        let size = re.iter().chain(&im).fold(0.0, |most: f64, v| most.max(v.abs()));
        let pairs = re.iter().zip(&own_re).chain(im.iter().zip(&own_im));
        pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / size
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn slides_every_kind_and_delay(
            intervals in 12usize..200,
            part in 0.05f64..0.5,
            kind in prop::sample::select(vec![
                Kind::Rule(Rule::Staircase), Kind::Rule(Rule::Trapezoid), Kind::Rule(Rule::Gregory),
                Kind::Hold(Hold::Zoh), Kind::Hold(Hold::Foh),
            ]),
            delay in prop_oneof![Just(0.0), Just(3.0), 0.0f64..9.0],
            extra in 0usize..5,
            more in 0u64..700,
        ) {
            let lead = delay.ceil() as usize + extra;
            let harmonics = (part * intervals as f64) as usize;
            let plan = CoefficientPlan::new(intervals, harmonics, kind, delay, lead).unwrap();
            let mut sliding = Sliding::new(&plan).unwrap();
            for k in 0..plan.samples() as u64 + more {
                prop_assert!(!sliding.ready());
                sliding.push(sample(k));
                if sliding.ready() {
                    break;
                }
            }
            for k in sliding.count()..sliding.count() + more {
                sliding.push(sample(k));
            }
            prop_assert!(off(&plan, &sliding, sample) < 1e-12);
        }
    }

    #[test]
    fn an_offset_is_taken_out_as_from_a_record() {
        for level in [100.0, -1e6] {
            let signal = |k: u64| level + sample(k);
            let plan = CoefficientPlan::new(300, 75, Kind::Rule(Rule::Gregory), 2.5, 3).unwrap();
            let mut sliding = Sliding::new(&plan).unwrap();
            (0..2000).for_each(|k| sliding.push(signal(k)));
            assert!(off(&plan, &sliding, signal) < 1e-14, "{level}");
        }
    }

    #[test]
    fn many_harmonics_and_few_samples() {
        for (intervals, harmonics) in [(300, 90), (8, 4), (40, 20), (47, 5)] {
            let plan =
                CoefficientPlan::new(intervals, harmonics, Kind::Rule(Rule::Gregory), 0.0, 0)
                    .unwrap();
            let mut sliding = Sliding::new(&plan).unwrap();
            for k in 0..1000 {
                sliding.push(sample(k));
            }
            assert!(off(&plan, &sliding, sample) < 1e-12);
        }
    }

    #[test]
    fn ten_million_samples_leave_no_drift() {
        // A large one in between would stay behind in sums that samples leave again.
        let signal = |k: u64| sample(k) + if k % 3_000_001 == 17 { 1e9 } else { 0.0 };
        let plan = CoefficientPlan::new(500, 32, Kind::Rule(Rule::Gregory), 0.0, 0).unwrap();
        let mut sliding = Sliding::new(&plan).unwrap();
        for k in 0..10_000_000 {
            sliding.push(signal(k));
        }
        assert!(off(&plan, &sliding, signal) < 1e-13, "{}", off(&plan, &sliding, signal));
    }

    #[test]
    fn a_spike_is_gone_when_it_leaves() {
        for (intervals, spike) in [(500, 1e36), (64, 1e15), (77, -1e9)] {
            for at in [3, 40, 499, 500, 777] {
                let signal = |k: u64| sample(k) + if k == at { spike } else { 0.0 };
                let plan =
                    CoefficientPlan::new(intervals, 20, Kind::Rule(Rule::Gregory), 0.0, 0).unwrap();
                let mut sliding = Sliding::new(&plan).unwrap();
                for k in 0..at + 3 * intervals as u64 {
                    sliding.push(signal(k));
                    if k > at + intervals as u64 {
                        assert!(
                            off(&plan, &sliding, signal) < 1e-10,
                            "{intervals} {spike} {at} {k}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn cleared_is_new() {
        let plan = CoefficientPlan::new(60, 7, Kind::Hold(Hold::Foh), 1.5, 3).unwrap();
        let (mut used, mut fresh) = (Sliding::new(&plan).unwrap(), Sliding::new(&plan).unwrap());
        (0..97).for_each(|k| used.push(sample(k)));
        used.clear();
        (0..150).for_each(|k| {
            used.push(sample(k));
            fresh.push(sample(k));
        });
        let (mut a, mut b) = (vec![0.0; 16], vec![0.0; 16]);
        let (a_re, a_im) = a.split_at_mut(8);
        used.coefficients(a_re, a_im);
        let (b_re, b_im) = b.split_at_mut(8);
        fresh.coefficients(b_re, b_im);
        assert_eq!(a, b);
    }

    #[test]
    fn what_cannot_slide_is_refused() {
        let parabolic = CoefficientPlan::new(200, 9, Kind::Rule(Rule::Parabolic), 0.0, 0).unwrap();
        assert!(Sliding::new(&parabolic).unwrap_err().to_string().contains("gregory"));
        let t: Vec<f64> = (0..50).map(f64::from).collect();
        let uneven = CoefficientPlan::uneven(&t, 5, Kind::Rule(Rule::Trapezoid)).unwrap();
        assert!(Sliding::new(&uneven).unwrap_err().to_string().contains("one step"));
    }
}
