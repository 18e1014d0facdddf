//! Statistics of residual lines, by which a fit decides whether to look at its residuals further.
//!
//! Lines are pairs of real and imaginary part, one slice a record, all of one output. The laws of the
//! statistics are left to the caller.

use crate::spectrum::Padded;

/// Lines below which the level over the band, and an event, are not tested.
const FEWEST: usize = 6;
/// Highest lag of the autocorrelation where none is asked for.
const LAGS: usize = 10;

/// Real and imaginary part of a line.
pub type Line = (f64, f64);

/// Ljung-Box statistic over the harmonic index with the autocorrelations at lags 1, 2, … that it is made of.
///
/// q = 2n(n + 1) Σ_k r(k)²/n(k), n lines in all and n(k) pairs at distance k within records. The real part of
/// a product of independent circular lines has variance 1/2 in units of their power, and the mean square of
/// the sum of n powers is n(n + 1): n + 2 is for real numbers. `lags` is at most the shortest record's lines
/// less one, and by default min(10, a quarter of them). None where there is no lag or no power.
#[must_use]
pub fn correlation(records: &[Vec<Line>], lags: Option<usize>) -> Option<(f64, Vec<f64>)> {
    let shortest = records.iter().map(Vec::len).min()?;
    let lags = lags.map_or(LAGS.min(shortest / 4), |lags| lags.min(shortest.saturating_sub(1)));
    let power: f64 = records.iter().flatten().map(square).sum();
    if lags == 0 || power == 0.0 {
        return None;
    }
    let count: usize = records.iter().map(Vec::len).sum();
    let (mut q, mut r) = (0.0, Vec::with_capacity(lags));
    for lag in 1..=lags {
        let product = |(a, b): (&Line, &Line)| a.0 * b.0 + a.1 * b.1;
        let sum: f64 = records.iter().flat_map(|e| e[lag..].iter().zip(e).map(product)).sum();
        let pairs: usize = records.iter().map(|e| e.len() - lag).sum();
        r.push(sum / power);
        q += (sum / power) * (sum / power) / pairs as f64;
    }
    Some((2.0 * count as f64 * (count as f64 + 1.0) * q, r))
}

/// Distance of the cumulated power from a straight line (Kolmogorov-Smirnov), and the rms of the lines in the
/// lower half of the band over that in the upper half.
///
/// None where no record has six lines, or the longest is all zero.
#[must_use]
pub fn colour(records: &[Vec<Line>]) -> Option<(f64, f64)> {
    // The first of the longest: `max_by_key` would take the last.
    let longest = records.iter().rev().max_by_key(|e| e.len())?;
    if longest.len() < FEWEST || longest.iter().all(|e| *e == (0.0, 0.0)) {
        return None;
    }
    let power = pooled_power(records);
    let (count, total): (usize, f64) = (power.len(), power.iter().sum());
    let (mut sum, mut distance) = (0.0, 0.0_f64);
    for (k, one) in power[..count - 1].iter().enumerate() {
        sum += one;
        let apart = (sum / total - (k + 1) as f64 / count as f64).abs();
        if apart > distance || apart.is_nan() {
            distance = apart; // nan stays: nothing is larger
        }
    }
    let (lower, upper) = power.split_at(count / 2);
    let mean = |half: &[f64]| half.iter().sum::<f64>() / half.len() as f64;
    Some((distance, (mean(lower) / mean(upper)).sqrt()))
}

/// Power of the lines of all records, in the order of their place in their band.
#[must_use]
pub fn pooled_power(records: &[Vec<Line>]) -> Vec<f64> {
    if let [one] = records {
        return one.iter().map(square).collect();
    }
    let mut placed: Vec<(f64, f64)> = Vec::with_capacity(records.iter().map(Vec::len).sum());
    for e in records {
        placed.extend(
            e.iter().enumerate().map(|(k, e_k)| ((k + 1) as f64 / e.len() as f64, square(e_k))),
        );
    }
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    placed.into_iter().map(|(_, power)| power).collect()
}

/// Largest fourth difference of samples over their mean: one sample alone shows six times what it is off by.
///
/// 0 where there are fewer than five samples or all differences are zero; nan where a sample is not finite.
#[must_use]
pub fn sharpest(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut last, mut largest, mut total) = ([0.0; 4], 0.0_f64, 0.0);
    let mut count = 0_usize;
    for (k, value) in values.into_iter().enumerate() {
        let mut difference = value;
        for before in &mut last {
            (*before, difference) = (difference, difference - *before);
        }
        if k >= 4 {
            largest = largest.max(difference.abs());
            total += difference.abs();
            count += 1;
        }
    }
    if total == 0.0 { 0.0 } else { largest / (total / count as f64) }
}

/// What cubics through four samples leave of the next one: its rms over that of the samples about their mean.
///
/// 0 where there are fewer than five samples or all lie on one cubic; nan where one is not finite.
#[must_use]
pub fn unforeseen(values: &[f64]) -> f64 {
    if values.len() < 5 {
        return 0.0;
    }
    let count = values.len() as f64;
    let left = |w: &[f64]| (w[0] + w[4]) - 4.0 * (w[1] + w[3]) + 6.0 * w[2];
    let new: f64 = values.windows(5).map(left).map(|d| d * d).sum();
    if new == 0.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / count;
    let all: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    ((new / (count - 4.0)) / (all / count)).sqrt()
}

/// The time at which one short event explains most of the lines of a record, and the share of their power.
///
/// The time is a place on a grid over the record's length that has four times as many points as there are lines.
/// An event at a time t turns the lines by exp(−iωt) together. None below six lines, or without finite power.
#[must_use]
pub fn event(e: &[Line]) -> Option<(usize, f64)> {
    let power: f64 = e.iter().map(square).sum();
    if e.len() < FEWEST || !(power > 0.0 && power < f64::INFINITY) {
        return None;
    }
    let grid = Padded::new(4 * e.len());
    let [re, im] = [|e: &Line| e.0, |e: &Line| e.1]
        .map(|part| grid.run(&e.iter().map(part).collect::<Vec<f64>>()));
    // Σ e exp(iωt) is conj(R) + i conj(I) at t, and R + iI at the mirror image of t.
    let size = |k: usize| match 2 * k <= grid.size() {
        true => power_of(re[k].0 + im[k].1, im[k].0 - re[k].1),
        false => {
            let k = grid.size() - k;
            power_of(re[k].0 - im[k].1, re[k].1 + im[k].0)
        }
    };
    let mut best = (0, size(0));
    for k in 1..grid.size() {
        let own = size(k);
        if own > best.1 {
            best = (k, own);
        }
    }
    Some((best.0, (best.1 / (e.len() as f64 * power)).min(1.0)))
}

fn square(e: &Line) -> f64 {
    power_of(e.0, e.1)
}

fn power_of(re: f64, im: f64) -> f64 {
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::root_of_unity;

    #[test]
    fn equal_lines_are_correlated_and_of_one_level() {
        let (q, r) = correlation(&[vec![(1.0, 0.0); 8]], None).unwrap();
        assert_eq!(r, [7.0 / 8.0, 6.0 / 8.0]);
        assert!((q - 2.0 * 8.0 * 9.0 * (7.0 + 6.0) / 64.0).abs() < 1e-12, "{q}");
        assert_eq!(colour(&[vec![(0.0, 1.0); 8]]), Some((0.0, 1.0)));
    }

    #[test]
    fn records_are_pooled_by_the_place_in_their_band() {
        let records = [vec![(1.0, 0.0), (2.0, 0.0)], (3..7).map(|k| (f64::from(k), 0.0)).collect()];
        assert_eq!(pooled_power(&records), [9.0, 1.0, 16.0, 25.0, 4.0, 36.0]);
    }

    #[test]
    fn few_lines_and_no_power_have_no_verdict() {
        assert!(correlation(&[vec![(1.0, 0.0); 3]], None).is_none());
        assert!(correlation(&[vec![(0.0, 0.0); 9]], None).is_none());
        assert!(colour(&[vec![(1.0, 0.0); 5]]).is_none());
        assert!(colour(&[vec![(0.0, 0.0); 9]]).is_none());
        assert!(colour(&[]).is_none() && correlation(&[], None).is_none());
    }

    #[test]
    fn an_event_is_found_at_its_time() {
        // e^{−2πi·17k/60} of fifteen lines: the 17th of 60 points explains all.
        let e: Vec<Line> =
            (0..15).map(|k| root_of_unity(17 * k, 60)).map(|(c, s)| (3.0 * c, -3.0 * s)).collect();
        for (lines, place) in [(e.clone(), 17), (e.iter().map(|(a, b)| (*a, -b)).collect(), 43)] {
            let (at, share) = event(&lines).unwrap();
            assert_eq!(at, place);
            assert!((share - 1.0).abs() < 1e-12, "{share}");
        }
        assert!(event(&e[..5]).is_none() && event(&[(0.0, 0.0); 9]).is_none());
        assert!(event(&[(f64::NAN, 0.0); 9]).is_none());
    }

    #[test]
    fn cubics_are_foreseen_and_one_sample_is_not() {
        let cubic: Vec<f64> = (0..30).map(f64::from).map(|k| k * (k - 9.0) * (k - 20.0)).collect();
        assert!(unforeseen(&cubic) < 1e-12);
        let mut values = vec![3.0; 24];
        values[9] = 2.0;
        // 1, 4, 6, 4, 1 squared make 70 of twenty differences; the variance is that of one in 24.
        let wanted = (70.0 / 20.0 / (23.0 / 576.0_f64)).sqrt();
        assert!((unforeseen(&values) - wanted).abs() < 1e-12 * wanted);
        assert_eq!(unforeseen(&[1.0, 5.0, 2.0, 9.0]), 0.0);
        assert_eq!(unforeseen(&[2.0; 9]), 0.0);
        assert!(unforeseen(&[1.0, f64::NAN, 2.0, 9.0, 1.0]).is_nan());
    }

    #[test]
    fn one_sample_stands_out() {
        let mut values = vec![0.0; 20];
        values[9] = -1.0;
        // 1, 4, 6, 4, 1 of sixteen differences
        assert!((sharpest(values) - 6.0 * 16.0 / 16.0).abs() < 1e-12);
        assert_eq!(sharpest((0..9).map(f64::from)), 0.0);
        assert_eq!(sharpest([1.0, 5.0, 2.0, 9.0]), 0.0);
        assert!(sharpest([1.0, f64::NAN, 2.0, 9.0, 1.0, 3.0]).is_nan());
    }
}
