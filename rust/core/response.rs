//! Frequency responses without a model: a small least-squares problem around each frequency (report, section 4.9).
//!
//! On the lines near ω the transfer function and what the end conditions of a record add are smooth, so
//! low-degree polynomials of the distance r describe them: A(r)Y = B(r)U + T(r), and the response is B(0), as
//! A(0) = 1. Eight frequencies travel in the lanes of one kernel.

mod factor;
mod local;

use crate::Error;
use crate::simd::{Isa, Kernel, LANES, Lanes};
use crate::threads::{self, Control};
use local::Workspace;

/// What describes the neighbourhood of a frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// A = 1, and rows are differences of neighbouring lines, which annihilate T: the report's.
    Modulating,
    /// A = 1, T fitted: the differences weighted by their covariance.
    Polynomial,
    /// A of the same degree as B, one an output.
    Rational,
}

/// How the rows of a rational neighbourhood are weighted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// All alike.
    Ls,
    /// By 1/|A|² of the last estimate.
    Awls,
    /// As `Awls`, then Gauss–Newton on the residuals of the output.
    Ml,
}

/// The kind of local problem.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// What is fitted.
    pub family: Family,
    /// Degree of B and T (and A).
    pub degree: usize,
    /// Weights of rational neighbourhoods.
    pub weighting: Weighting,
}

/// Coefficients of one record, or of one window of it.
#[derive(Debug, Clone)]
pub struct Piece {
    /// Line spacing, rad/s.
    pub omega0: f64,
    /// Lines on each side of a frequency.
    pub half: usize,
    /// Whether line 0 may be used; not where an unknown offset stands on it.
    pub zero: bool,
    /// Coefficients (output, line), real and imaginary parts, lines 0, 1, ….
    pub y: Vec<Vec<[f64; 2]>>,
    /// Coefficients (input, line).
    pub u: Vec<Vec<[f64; 2]>>,
}

impl Piece {
    /// Lines used around a frequency.
    fn width(&self) -> usize {
        self.half.saturating_mul(2).saturating_add(1)
    }

    /// Highest line.
    fn top(&self) -> usize {
        self.y.iter().chain(&self.u).map(Vec::len).min().unwrap_or(0).saturating_sub(1)
    }

    /// The lines used around ω: those nearest, mirrored below 0 (there `gapless` ones begin instead, so that
    /// differences are of neighbours), shifted where the lines end.
    fn lines(&self, omega: f64, gapless: bool, out: &mut Vec<i64>) {
        let (half, top) = (self.half as i64, self.top() as i64);
        // No frequency lies farther out than the lines and their mirror images.
        let near = (omega / self.omega0).round();
        let centre = near.clamp((half - top) as f64, top as f64) as i64;
        let to = (centre + half).min(top);
        let from = to - 2 * half;
        out.clear();
        if self.zero || from > 0 || to < 0 {
            out.extend(from..=to);
        } else if gapless {
            out.extend(1..=2 * half + 1);
        } else if to < top {
            out.extend((from..=to + 1).filter(|&m| m != 0));
        } else {
            out.extend((from - 1..=to).filter(|&m| m != 0));
        }
    }
}

/// Estimates at each frequency, frequency after frequency; complex numbers as \[re, im\].
#[derive(Debug, Clone, Default)]
pub struct Responses {
    /// Response (output, input); NaN where the inputs do not tell it.
    pub response: Vec<[f64; 2]>,
    /// Covariance E\[(Ĝ − G)(Ĝ − G)\*\] of the responses (output after output), square.
    pub cov: Vec<[f64; 2]>,
    /// Covariance of the outputs' noise on a line, (output, output).
    pub noise: Vec<[f64; 2]>,
    /// Share of each output's power on the lines that the inputs explain.
    pub coherence: Vec<f64>,
    /// Squared error of each output on the line nearest, predicted without it.
    pub left_out: Vec<f64>,
    /// Complex degrees of freedom.
    pub freedom: usize,
}

/// Blocks of eight frequencies in a chunk of work.
const BLOCKS: usize = 16;

/// Local models at the frequencies `omega`, rad/s.
///
/// # Errors
/// [`Error::Spec`] where pieces do not fit together, or have fewer lines than unknowns;
/// [`Error::Cancelled`] after a stop.
pub fn responses(
    isa: Isa,
    threads: usize,
    settings: Settings,
    pieces: &[Piece],
    omega: &[f64],
    progress: &mut dyn FnMut(usize, usize) -> Control,
) -> Result<Responses, Error> {
    let freedom = check(settings, pieces)?;
    let chunk = BLOCKS * LANES;
    let chunks = omega.len().div_ceil(chunk);
    let work = |work: &mut Workspace, k: usize| {
        let mut out = Responses::default();
        for eight in omega[k * chunk..omega.len().min((k + 1) * chunk)].chunks(LANES) {
            if threads::stopped() {
                break;
            }
            isa.run(Eight { work, settings, pieces, omega: eight, out: &mut out });
        }
        out
    };
    let parts = threads::run(threads, chunks, progress, Workspace::default, work)?;
    let mut all = Responses { freedom, ..Responses::default() };
    for part in parts {
        all.response.extend(part.response);
        all.cov.extend(part.cov);
        all.noise.extend(part.noise);
        all.coherence.extend(part.coherence);
        all.left_out.extend(part.left_out);
    }
    Ok(all)
}

struct Eight<'a> {
    work: &'a mut Workspace,
    settings: Settings,
    pieces: &'a [Piece],
    omega: &'a [f64],
    out: &'a mut Responses,
}

impl Kernel for Eight<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        self.work.pack(self.settings, self.pieces, self.omega);
        self.work.solve::<L>(self.settings);
        self.work.unpack(self.omega.len(), self.out);
    }
}

/// Complex degrees of freedom, where there are any.
fn check(settings: Settings, pieces: &[Piece]) -> Result<usize, Error> {
    let Some(first) = pieces.first() else {
        return Err(Error::Spec(
            "frequency response: no record was given; give at least one".into(),
        ));
    };
    let (outputs, inputs) = (first.y.len(), first.u.len());
    let terms = settings.degree.saturating_add(1);
    let own = match settings.family {
        Family::Rational => settings.degree,
        _ => 0,
    };
    let unknowns = terms.saturating_mul(inputs).saturating_add(own);
    let mut rows = 0;
    for piece in pieces {
        let fits = piece.y.len() == outputs && piece.u.len() == inputs;
        if !(fits && outputs > 0 && inputs > 0 && piece.omega0 > 0.0) {
            return Err(Error::Spec(format!(
                "frequency response: a record has {} outputs, {} inputs and lines {} rad/s apart, the first {outputs} and {inputs}; give records of the same channels, with at least one output and one input",
                piece.y.len(),
                piece.u.len(),
                piece.omega0
            )));
        }
        let there = piece.top() + usize::from(piece.zero);
        if piece.width() > there || piece.width() <= terms {
            return Err(Error::Spec(format!(
                "frequency response: {} lines around a frequency (half-width {}) of {there} that the record has, for a transient of {terms} terms; take a smaller half-width or degree, or a longer record",
                piece.width(),
                piece.half
            )));
        }
        rows += piece.width() - terms;
    }
    if rows <= unknowns {
        return Err(Error::Spec(format!(
            "frequency response: {rows} equations are left around a frequency for {unknowns} unknowns of degree {} with {inputs} input(s); take a larger half-width, or a lower degree",
            settings.degree
        )));
    }
    Ok(rows - unknowns)
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn value(k: usize) -> f64 {
        ((k * 2_654_435_761) % 2001) as f64 / 1000.0 - 1.0
    }

    /// Lines of a first-order lag with a transient, from sample to sample: Y = (b U + t)/(1 − a W^m).
    fn lag(lines: usize, seed: usize) -> (Piece, impl Fn(f64) -> [f64; 2]) {
        let gain = |turns: f64| {
            let (re, im) = (1.0 - 0.9 * (TAU * turns).cos(), 0.9 * (TAU * turns).sin());
            let size = re * re + im * im;
            [re / size, -im / size]
        };
        let (mut y, mut u) = (Vec::new(), Vec::new());
        for m in 0..=lines {
            let g = gain(m as f64 / (2 * lines) as f64);
            let v = [value(seed + 7 * m), if m == 0 { 0.0 } else { value(seed + 13 * m + 5) }];
            u.push(v);
            let with_transient = [v[0] + 0.3, v[1]];
            y.push([
                g[0] * with_transient[0] - g[1] * with_transient[1],
                g[0] * with_transient[1] + g[1] * with_transient[0],
            ]);
        }
        let piece = Piece { omega0: 1.0, half: 6, zero: true, y: vec![y], u: vec![u] };
        (piece, move |omega: f64| gain(omega / (2 * lines) as f64))
    }

    fn run(isa: Isa, settings: Settings, pieces: &[Piece], omega: &[f64]) -> Responses {
        responses(isa, 0, settings, pieces, omega, &mut |_, _| Control::Continue).unwrap()
    }

    const RATIONAL: Settings =
        Settings { family: Family::Rational, degree: 2, weighting: Weighting::Ls };

    #[test]
    fn a_lag_with_a_transient_between_lines_and_at_both_ends() {
        let (piece, gain) = lag(100, 3);
        let omega = [0.0, 0.4, 3.0, 50.3, 99.0, 100.0];
        for weighting in [Weighting::Ls, Weighting::Awls, Weighting::Ml] {
            let settings = Settings { weighting, ..RATIONAL };
            let found = run(Isa::Plain, settings, std::slice::from_ref(&piece), &omega);
            assert_eq!(found.freedom, 13 - 8);
            for (got, at) in found.response.iter().zip(omega) {
                let want = gain(at);
                let apart = (got[0] - want[0]).abs().max((got[1] - want[1]).abs());
                assert!(apart < 1e-4 * want[0].hypot(want[1]), "{weighting:?} {at}: {apart:e}");
            }
        }
    }

    #[test]
    fn every_set_and_every_lane_gives_the_same_bits() {
        let (one, _) = lag(60, 3);
        let (other, _) = lag(60, 77);
        let two = Piece { half: 9, u: vec![one.u[0].clone(), other.u[0].clone()], ..one.clone() };
        let omega: Vec<f64> = (0..19).map(|k| 1.3 + 2.9 * k as f64).collect();
        for family in [Family::Modulating, Family::Polynomial, Family::Rational] {
            let settings = Settings { family, weighting: Weighting::Ml, ..RATIONAL };
            let whole = run(Isa::Plain, settings, std::slice::from_ref(&two), &omega);
            for isa in Isa::available() {
                let found = run(isa, settings, std::slice::from_ref(&two), &omega);
                assert_eq!(found.response, whole.response, "{isa:?}");
                assert_eq!(found.cov, whole.cov, "{isa:?}");
            }
            let alone = run(Isa::Plain, settings, std::slice::from_ref(&two), &omega[11..12]);
            assert_eq!(alone.response, whole.response[22..24]);
        }
    }

    #[test]
    fn lines_are_mirrored_shifted_and_without_zero_where_it_holds_an_offset() {
        let (mut piece, _) = lag(20, 1);
        piece.half = 2;
        let mut out = Vec::new();
        let mut lines = |piece: &Piece, omega: f64, gapless: bool| {
            piece.lines(omega, gapless, &mut out);
            out.clone()
        };
        assert_eq!(lines(&piece, 1.2, false), [-1, 0, 1, 2, 3]);
        assert_eq!(lines(&piece, 19.6, false), [16, 17, 18, 19, 20]);
        piece.zero = false;
        assert_eq!(lines(&piece, 1.2, false), [-1, 1, 2, 3, 4]);
        assert_eq!(lines(&piece, 1.2, true), [1, 2, 3, 4, 5]);
        assert_eq!(lines(&piece, 3.0, false), [1, 2, 3, 4, 5]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let (piece, _) = lag(20, 1);
        let call = |settings, pieces: &[Piece]| {
            responses(Isa::Plain, 0, settings, pieces, &[3.0], &mut |_, _| Control::Continue)
                .unwrap_err()
                .to_string()
        };
        assert!(call(RATIONAL, &[]).contains("no record was given"));
        let narrow = Piece { half: 3, ..piece.clone() };
        assert!(call(RATIONAL, &[narrow]).contains("4 equations are left"));
        let wide = Piece { half: 30, ..piece.clone() };
        assert!(call(RATIONAL, &[wide]).contains("61 lines around a frequency"));
        let other = Piece { u: Vec::new(), ..piece.clone() };
        assert!(call(RATIONAL, &[piece, other]).contains("records of the same channels"));
    }
}
