//! Transforms of samples with zeros behind them, whose fine grid shows peaks.

use std::sync::Arc;

use modfun_fft::{Complex, RealToComplex};

/// The transform Σ_k x(k) e^{−2πimk/size} of real numbers, zeros behind them: a fine grid for peaks.
#[derive(Clone)]
pub struct Padded {
    transform: Arc<dyn RealToComplex<f64>>,
}

impl std::fmt::Debug for Padded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Padded({})", self.size())
    }
}

impl Padded {
    /// For up to `size` numbers.
    #[must_use]
    pub fn new(size: usize) -> Padded {
        Padded { transform: modfun_fft::forward(size) }
    }

    /// Points of the grid, both halves.
    #[must_use]
    pub fn size(&self) -> usize {
        self.transform.len()
    }

    /// (Re, Im) at m = 0…size/2 of at most `size` numbers.
    #[must_use]
    pub fn run(&self, x: &[f64]) -> Vec<(f64, f64)> {
        let mut padded = vec![0.0; self.size()];
        padded[..x.len()].copy_from_slice(x);
        let mut out = vec![Complex::default(); self.transform.complex_len()];
        let mut work = vec![Complex::default(); self.transform.get_scratch_len()];
        // Lengths agree by construction.
        let _ = self.transform.process_with_scratch(&mut padded, &mut out, &mut work);
        out.iter().map(|c| (c.re, c.im)).collect()
    }

    /// The transform of real numbers at any m, from the half that [`Padded::run`] gives.
    #[must_use]
    pub fn at(half: &[(f64, f64)], m: i64, size: usize) -> (f64, f64) {
        let m = m.rem_euclid(size as i64) as usize;
        match m <= size / 2 {
            true => half[m],
            false => (half[size - m].0, -half[size - m].1),
        }
    }
}
