//! Records to fit: responses of linear systems by small Runge–Kutta steps, smooth and held inputs, noise.

use modfun::rng::{Address, Purpose, normals};

/// A smooth input with lines all over the band, one for each number.
pub fn smooth(k: usize, t: f64) -> f64 {
    let shift = k as f64;
    (t * t / (5.0 + shift)).sin() + 0.6 * ((1.3 + 0.7 * shift) * t + shift).sin() + 0.2
}

pub fn samples(count: usize, dt: f64, of: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..count).map(|k| of(k as f64 * dt)).collect()
}

/// Normals of a channel and replicate.
pub fn noise(channel: u32, replicate: u64, count: usize) -> Vec<f64> {
    let mut out = vec![0.0; count];
    let purpose = Purpose::User;
    normals(Address { seed: 11, purpose, channel, replicate, group: 0 }, &mut out);
    out
}

pub fn noisy(clean: &[f64], sigma: f64, channel: u32, replicate: u64) -> Vec<f64> {
    clean.iter().zip(noise(channel, replicate, clean.len())).map(|(y, e)| y + sigma * e).collect()
}

/// A system A y = Σ B_k u_k: coefficients of A behind the leading one, numerators padded to as many.
pub struct System {
    pub a: Vec<f64>,
    pub b: Vec<Vec<f64>>,
}

impl System {
    /// Samples of the response from a state; `inputs` at (input, sample, time), which may hold a sample's value.
    pub fn response(
        &self,
        inputs: &dyn Fn(usize, usize, f64) -> f64,
        (count, dt): (usize, f64),
        state: &[f64],
    ) -> Vec<f64> {
        const EACH: usize = 20;
        let n = self.a.len();
        let h = dt / EACH as f64;
        let slope = |k: usize, t: f64, x: &[f64]| -> Vec<f64> {
            let next = |i: usize| if i + 1 < n { x[i + 1] } else { 0.0 };
            let drive = |i: usize| {
                self.b.iter().enumerate().map(|(j, b)| b[i] * inputs(j, k, t)).sum::<f64>()
            };
            (0..n).map(|i| next(i) - self.a[i] * x[0] + drive(i)).collect()
        };
        let along = |x: &[f64], by: f64, s: &[f64]| -> Vec<f64> {
            x.iter().zip(s).map(|(x, s)| x + by * s).collect()
        };
        let mut x = state.to_vec();
        let mut out = vec![x[0]];
        for k in 0..count - 1 {
            for j in 0..EACH {
                let t = k as f64 * dt + j as f64 * h;
                let s1 = slope(k, t, &x);
                let s2 = slope(k, t + h / 2.0, &along(&x, h / 2.0, &s1));
                let s3 = slope(k, t + h / 2.0, &along(&x, h / 2.0, &s2));
                let s4 = slope(k, t + h, &along(&x, h, &s3));
                for i in 0..n {
                    x[i] += h / 6.0 * (s1[i] + 2.0 * s2[i] + 2.0 * s3[i] + s4[i]);
                }
            }
            out.push(x[0]);
        }
        out
    }
}
