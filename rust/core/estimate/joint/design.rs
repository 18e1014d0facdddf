//! The plan of a joint problem: lines, columns and scales; nothing in it depends on the samples.

use super::structure::{JointSignal, JointStructure, Term};
use super::whitener::Uneven;
use crate::error::Error;
use crate::estimate::aliasing::Aliasing;
use crate::estimate::prior::Prior;
use crate::estimate::spectral::Bins;
use crate::modulation::{Column, Lines, transient_columns};
use crate::simd::LANES;
use crate::structure::{Method, Trend};

/// Lines of one pass: their rows stay in a near cache.
const TILE: usize = 16;

/// Colour of the outputs' noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// White, or as the given spectra say.
    Given,
    /// An autoregression a channel, fitted to the residuals by alternation.
    Fitted,
}

/// What the residuals are weighted by.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// In the equations (S = Σ) rather than on the outputs (S = D Σ D*).
    pub equation: bool,
    /// Σ_y, row major: known up to a common factor, or estimated from the residuals by alternation.
    pub outputs: Option<Vec<f64>>,
    /// Σ_u of the paths, row major, in the units that `outputs` has; `None` for inputs without noise.
    pub inputs: Option<Vec<f64>>,
    /// Colour of the outputs' noise.
    pub colour: Colour,
    /// Power spectra on all lines from 0 on, of each record: outputs, then paths; empty for white.
    pub spectra: Vec<Vec<Vec<f64>>>,
}

impl NoiseModel {
    /// White on the outputs, covariance unknown.
    #[must_use]
    pub fn output() -> NoiseModel {
        NoiseModel {
            equation: false,
            outputs: None,
            inputs: None,
            colour: Colour::Given,
            spectra: Vec::new(),
        }
    }
}

/// Lines of one record with the numbers every pass needs.
#[derive(Debug, Clone)]
pub(crate) struct RecordDesign {
    /// Lines there are coefficients of.
    pub lines: Lines,
    /// How many of them the fit uses at most; those above tell the colour of the noise.
    pub used: usize,
    /// Lines there are; the tables below go on, up to a multiple of eight, with the last one's numbers.
    pub count: usize,
    pub x: Vec<f64>,
    pub size_x: Vec<f64>,
    /// x^k of all lines, k = 0..=highest.
    pub powers: Vec<f64>,
    /// 1/(h · unit variance).
    pub weight: Vec<f64>,
    /// Root of the weight of lines in use; zero of others.
    pub root_weight: Vec<f64>,
    /// Values of each transient column on all lines.
    pub transient: Vec<f64>,
    /// 1/√PSD of outputs, and PSD of paths, on all lines; empty where white.
    pub output_roots: Vec<f64>,
    pub path_spectra: Vec<f64>,
    pub uneven: Uneven,
}

impl RecordDesign {
    /// Length of a table: lines, filled up to a multiple of eight.
    pub fn stride(&self) -> usize {
        self.x.len()
    }
}

/// A transient column of an output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TransientColumn {
    pub output: usize,
    pub column: Column,
}

/// Everything about a joint problem that its samples do not change.
#[derive(Debug, Clone)]
pub struct JointDesign {
    pub(crate) structure: JointStructure,
    pub(crate) method: Method,
    pub(crate) noise: NoiseModel,
    pub(crate) records: Vec<RecordDesign>,
    pub(crate) transient: Vec<TransientColumn>,
    /// Terms of each free coefficient, and of those that are held.
    pub(crate) columns: Vec<Vec<Term>>,
    pub(crate) held: Vec<Term>,
    pub(crate) free: Vec<usize>,
    pub(crate) free_delays: Vec<usize>,
    /// Outputs whose equations each unknown, and last the target, stand in; and whether they are made of an output.
    pub(crate) reach: Vec<Vec<usize>>,
    pub(crate) denoised: Vec<bool>,
    /// What held inputs fold into the outputs' sums, where there are such.
    pub(crate) aliasing: Option<Aliasing>,
    /// For the first estimate, where such inputs act at once.
    pub(crate) seen: Option<Seen>,
    /// First coefficient of denominators, and of numerators [output × path].
    pub(crate) denominators: Vec<usize>,
    pub(crate) numerators: Vec<usize>,
    pub(crate) tile: usize,
    /// Which lines share a level of the noise spectra.
    pub(crate) bins: Bins,
    /// Coefficients in the user's units are those in units of the band edge times this; then delays.
    pub(crate) scale: Vec<f64>,
    pub(crate) delay_scale: f64,
    /// Units of the outputs and paths in the workspace.
    pub(crate) units: Vec<f64>,
    pub(crate) band_edge: f64,
    /// In the workspace's units.
    pub(crate) priors: Vec<Prior>,
}

/// One record of a design: its lines, how many the fit uses, what uneven samples make of them.
#[derive(Debug, Clone)]
pub(crate) struct RecordLines {
    pub lines: Lines,
    pub used: usize,
    pub uneven: Uneven,
}

/// The problem of the first estimate where held inputs act at once (`at_once`).
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    pub design: Box<JointDesign>,
    /// Seconds that the samples come after the middle of each path's hold, where it is turned.
    pub(super) behind: Vec<Option<f64>>,
}

impl JointDesign {
    /// Plans a problem over records that share θ; `units` of outputs, then paths.
    ///
    /// # Errors
    /// [`Error::Data`] where the lines give fewer equations than unknowns.
    pub(crate) fn new(
        structure: &JointStructure,
        method: Method,
        noise: &NoiseModel,
        trend: Trend,
        extended: bool,
        records: Vec<RecordLines>,
        units: Vec<f64>,
    ) -> Result<JointDesign, Error> {
        let outputs = structure.orders.len();
        let transient: Vec<TransientColumn> = (0..outputs)
            .flat_map(|output| {
                transient_columns(structure.orders[output], extended, trend)
                    .into_iter()
                    .map(move |column| TransientColumn { output, column })
            })
            .collect();
        let highest = structure.orders.iter().copied().max().unwrap_or(1);
        let edge = |r: &RecordLines| (r.lines.first + r.used - 1) as f64 * r.lines.omega0;
        let band_edge = records.iter().map(edge).fold(0.0, f64::max);
        let laid: Vec<RecordDesign> = records
            .into_iter()
            .enumerate()
            .map(|(k, r)| {
                let spectra = noise.spectra.get(k).map_or(&[][..], Vec::as_slice);
                record_design(trend, &transient, highest, outputs, band_edge, spectra, r)
            })
            .collect();
        let rows: usize = laid.iter().map(|r| equations(r, r.used) * outputs).sum();
        let (parameters, each) = (structure.parameters(), transient.len());
        if rows <= parameters + each * laid.len() {
            return Err(Error::Data(format!(
                "fitting: {} lines of {outputs} output(s) give {rows} real equations for {} unknowns \
                 ({parameters} parameters and {each} transient terms a record); widen the band or take \
                 fewer poles and zeros",
                laid.iter().map(|r| r.used).sum::<usize>(),
                parameters + each * laid.len(),
            )));
        }
        let terms = structure.terms();
        let power_of = |k: usize| (0..k).fold(1.0, |p, _| p * band_edge);
        let mut scale = vec![1.0; structure.coefficients()];
        for t in &terms {
            let unit = match t.signal {
                JointSignal::Output => 1.0,
                JointSignal::Path(k) => units[t.output] / units[outputs + k],
            };
            scale[t.coefficient] = power_of(structure.orders[t.output]) / power_of(t.power) * unit;
        }
        if !scale.iter().all(|s| (1e-140..1e140).contains(s)) {
            return Err(Error::Data(format!(
                "fitting: with a band up to {band_edge:.3e} rad/s and {highest} poles the parameters leave \
                 the range of numbers; give time in another unit"
            )));
        }
        let free = structure.free();
        let of = |k: &usize| terms.iter().filter(|t| t.coefficient == *k).copied().collect();
        let (denominators, numerators) = structure.places();
        let most = laid.iter().map(|r| r.count).max().unwrap_or(0);
        let columns: Vec<Vec<Term>> = free.iter().map(of).collect();
        let free_delays = structure.free_delays();
        let (reach, denoised) = columns_reach(structure, noise, &transient, &columns, &free_delays);
        let in_use = |r: &RecordDesign| Lines { last: r.lines.first + r.used - 1, ..r.lines };
        let bins = Bins::new(&laid.iter().map(in_use).collect::<Vec<_>>());
        Ok(JointDesign {
            structure: structure.clone(),
            method,
            noise: noise.clone(),
            records: laid,
            transient,
            columns,
            reach,
            denoised,
            held: terms
                .iter()
                .filter(|t| structure.fixed[t.coefficient].is_some())
                .copied()
                .collect(),
            free,
            free_delays,
            denominators,
            numerators: numerators.concat(),
            tile: most.min(TILE),
            scale,
            delay_scale: 1.0 / band_edge,
            units,
            aliasing: None,
            seen: None,
            priors: Vec::new(),
            bins,
            band_edge,
        })
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.structure.orders.len()
    }

    /// Inputs with a delay.
    pub(crate) fn paths(&self) -> usize {
        self.structure.paths.len()
    }

    /// Number of estimated parameters.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.free.len() + self.free_delays.len()
    }

    /// Unknowns of one record's system.
    pub(crate) fn size(&self) -> usize {
        self.transient.len() + self.parameters()
    }

    /// Parameter k in the user's units is that of the workspace times this.
    pub(crate) fn parameter_scale(&self, k: usize) -> f64 {
        self.free.get(k).map_or(self.delay_scale, |c| self.scale[*c])
    }

    /// Bounds of parameter k as the user gave them.
    pub(crate) fn given_bounds(&self, k: usize) -> (f64, f64) {
        match self.free.get(k) {
            Some(c) => self.structure.bounds[*c],
            None => match self.structure.paths[self.free_delays[k - self.free.len()]].delay {
                super::Delay::Free { min, max, .. } => (min, max),
                super::Delay::Known(delay) => (delay, delay),
            },
        }
    }

    /// Bounds of parameter k in the workspace's units.
    pub(crate) fn parameter_bounds(&self, k: usize) -> (f64, f64) {
        let (low, high) = self.given_bounds(k);
        // A unit beyond the range of numbers has no bounds: ∞/∞ and 0/0.
        let own = |bound: f64, none: f64| match bound / self.parameter_scale(k) {
            x if x.is_nan() => none,
            x => x,
        };
        (own(low, f64::NEG_INFINITY), own(high, f64::INFINITY))
    }

    /// Whether any parameter is bounded.
    pub(crate) fn is_bounded(&self) -> bool {
        (0..self.parameters()).any(|k| {
            let (low, high) = self.parameter_bounds(k);
            low.is_finite() || high.is_finite()
        })
    }

    /// Real equations less all unknowns on the first `used` lines of each record.
    pub(crate) fn freedom(&self, used: impl Iterator<Item = usize>) -> usize {
        let outputs = self.outputs();
        let rows: usize =
            self.records.iter().zip(used).map(|(r, used)| equations(r, used) * outputs).sum();
        rows.saturating_sub(self.parameters() + self.transient.len() * self.records.len())
    }

    /// Real equations less all unknowns.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.freedom(self.records.iter().map(|r| r.used))
    }

    /// The lines of each record that the fit uses.
    #[must_use]
    pub fn lines(&self) -> Vec<Lines> {
        let used = |r: &RecordDesign| Lines { last: r.lines.first + r.used - 1, ..r.lines };
        self.records.iter().map(used).collect()
    }

    /// Whether Σ_y comes from the residuals.
    pub(crate) fn estimates_covariance(&self) -> bool {
        self.noise.outputs.is_none() && self.outputs() > 1 && self.noise.inputs.is_none()
    }

    /// Whether the whitened rows of single problems hold Σ: lines, or samples, mix the outputs in their own ways.
    pub(crate) fn holds_sigma(&self) -> bool {
        let mixed = |r: &RecordDesign| matches!(r.uneven, Uneven::Together(_));
        self.noise.inputs.is_some() || self.records.iter().any(mixed)
    }

    /// Whether Σ_y or the colour come from the residuals.
    pub(crate) fn alternates(&self) -> bool {
        let coloured = self.noise.colour == Colour::Fitted && self.noise.inputs.is_none();
        coloured || self.estimates_covariance()
    }

    /// Unit of a weighted residual of output `i`.
    pub(crate) fn residual_unit(&self, i: usize) -> f64 {
        let order = if self.noise.equation { self.structure.orders[i] } else { 0 };
        (0..order).fold(self.units[i], |p, _| p * self.band_edge)
    }
}

/// Real equations of one output on the first `used` lines: two a line, one on line 0.
fn equations(r: &RecordDesign, used: usize) -> usize {
    2 * used - usize::from(r.lines.first == 0 && used > 0)
}

fn record_design(
    trend: Trend,
    transient: &[TransientColumn],
    highest: usize,
    outputs: usize,
    band_edge: f64,
    spectra: &[Vec<f64>],
    record: RecordLines,
) -> RecordDesign {
    let RecordLines { lines, used, uneven } = record;
    // An unknown constant touches line 0 alone: it is left out.
    let first = if trend == Trend::None { lines.first } else { lines.first.max(1) };
    let used = (lines.first + used).saturating_sub(first);
    let lines = Lines { first, ..lines };
    let count = lines.last + 1 - first;
    let padded = first..first + count.next_multiple_of(LANES);
    let x_of = |m: usize| m.min(lines.last) as f64 * lines.omega0 / band_edge;
    let x: Vec<f64> = padded.clone().map(x_of).collect();
    let power = |x: f64, k: usize| (0..k).fold(1.0, |p, _| p * x);
    let value = |x: f64, c: &Column| {
        c.sign * if c.power < 0 { -1.0 / x } else { power(x, c.power.max(0) as usize) }
    };
    let of = |channels: std::ops::Range<usize>, f: fn(f64) -> f64| -> Vec<f64> {
        if spectra.is_empty() {
            return Vec::new();
        }
        let at = |s: usize| padded.clone().map(move |m| f(spectra[s][m.min(lines.last)]));
        channels.flat_map(at).collect()
    };
    let weight: Vec<f64> =
        padded.clone().map(|m| if m == 0 { 1.0 } else { 2.0 } / lines.unit_variance).collect();
    let counts = |(m, weight): (usize, &f64)| if m < used { weight.sqrt() } else { 0.0 };
    RecordDesign {
        count,
        powers: (0..=highest).flat_map(|k| x.iter().map(move |x| power(*x, k))).collect(),
        transient: transient.iter().flat_map(|t| x.iter().map(|x| value(*x, &t.column))).collect(),
        size_x: x.iter().map(|x| x.max(x_of(1))).collect(),
        root_weight: weight.iter().enumerate().map(counts).collect(),
        weight,
        output_roots: of(0..outputs, |s| 1.0 / s.sqrt()),
        path_spectra: of(outputs..spectra.len().max(outputs), |s| s),
        lines,
        used,
        x,
        uneven,
    }
}

/// Outputs whose equations each unknown (transients, coefficients, delays) and last the target stand in, and whether
/// its column changes where the signals are denoised.
fn columns_reach(
    structure: &JointStructure,
    noise: &NoiseModel,
    transient: &[TransientColumn],
    columns: &[Vec<Term>],
    free_delays: &[usize],
) -> (Vec<Vec<usize>>, Vec<bool>) {
    let (mut reach, mut denoised) = (Vec::new(), Vec::new());
    for t in transient {
        reach.push(vec![t.output]);
        denoised.push(false);
    }
    for terms in columns {
        let mut outputs: Vec<usize> = terms.iter().map(|t| t.output).collect();
        outputs.sort_unstable();
        outputs.dedup();
        reach.push(outputs);
        let noisy = |t: &Term| t.signal == JointSignal::Output || noise.inputs.is_some();
        denoised.push(terms.iter().any(noisy));
    }
    for s in free_delays {
        let acts = |i: &usize| structure.numerators[*i][*s].is_some();
        reach.push((0..structure.orders.len()).filter(acts).collect());
        denoised.push(false);
    }
    reach.push((0..structure.orders.len()).collect());
    denoised.push(true);
    (reach, denoised)
}
