//! The plan of one estimation problem: columns, sums, lines and scales; nothing in it depends on the data.

use super::aliasing::Aliasing;
use super::band::narrow_lines;
use super::rest::KnownStart;
use super::spectral::Bins;
use super::straight::tables::{Tables, sizes};
use super::sums::{Products, SumPlan, plan_sums};
use crate::error::Error;
use crate::modulation::{
    Column, Lines, Rows, difference_weights, parameter_columns, rows, target_column,
    transient_columns,
};
use crate::structure::{Method, Noise, Structure, Trend};

/// Lines of one pass that stay in the nearest cache; longer records go tile by tile.
pub(crate) const TILE: usize = 256;

/// Lines of one record with the numbers every pass needs.
#[derive(Debug, Clone)]
pub(crate) struct RecordDesign {
    /// First and last line, resolving frequency, variance unit.
    pub lines: Lines,
    /// x = mω₀/ω_B of each line.
    pub x: Vec<f64>,
    /// max(x, that of line 1): where the size of A is judged.
    pub size_x: Vec<f64>,
    /// Powers of x that products have, as they want them.
    pub powers: Vec<f64>,
    /// 1/(h · unit variance): h = 1 on line 0, else ½.
    pub weight: Vec<f64>,
    /// Real values of the transient columns, column after column on all lines.
    pub transient: Vec<f64>,
    /// Rows of Δⁿ for `ls`.
    pub rows: Rows,
}

/// Everything about a problem that its samples do not change.
#[derive(Debug, Clone)]
pub struct Design {
    pub(crate) structure: Structure,
    pub(crate) method: Method,
    pub(crate) noise: Noise,
    pub(crate) trend: Trend,
    pub(crate) records: Vec<RecordDesign>,
    /// Transient columns of each record, then those of θ.
    pub(crate) columns: Vec<Column>,
    pub(crate) target: Column,
    pub(crate) transient: usize,
    pub(super) parameters: usize,
    pub(crate) products: Products,
    /// JᵀWΓ with J = Γ.
    pub(crate) symmetric: SumPlan,
    /// JᵀWΓ with J from the denoised output.
    pub(crate) instrument: SumPlan,
    pub(crate) tile: usize,
    /// What the straight path needs, where the problem is one for it.
    pub(crate) straight: Option<Tables>,
    /// What held inputs fold into the output's sums, where there are such.
    pub(crate) aliasing: Option<Aliasing>,
    /// Where the records begin in a known state.
    pub(crate) known_start: Option<KnownStart>,
    /// Which lines share a level of the noise spectrum.
    pub(crate) bins: Bins,
    pub(crate) differences: Vec<f64>,
    /// θ in the user's units is θ in units of the band edge times this.
    pub(crate) scale: Vec<f64>,
    /// Unit of the output in the workspace.
    pub(crate) unit: f64,
    pub(crate) band_edge: f64,
}

impl Design {
    /// Plans a problem over records that share θ.
    ///
    /// # Errors
    /// [`Error::Data`] where the lines give fewer equations than unknowns.
    pub fn new(
        structure: &Structure,
        method: Method,
        noise: Noise,
        trend: Trend,
        extended: bool,
        lines: &[Lines],
    ) -> Result<Design, Error> {
        let (n, q) = (structure.order, structure.transient);
        let transient_cols = transient_columns(q, extended, trend);
        let transient = transient_cols.len();
        let mut columns = transient_cols;
        columns.extend(parameter_columns(structure));
        let target = target_column(structure);
        let band_edge = lines.iter().fold(0.0, |edge: f64, l| edge.max(l.last as f64 * l.omega0));

        let by_model = method == Method::Ml && noise != Noise::Equation;
        let (products, symmetric, instrument) =
            plan_sums(&columns, target, structure.numerators.len(), by_model);

        let records: Vec<RecordDesign> = lines
            .iter()
            .map(|l| {
                let own = &columns[..transient];
                record_design(structure, trend, extended, l, band_edge, own, &products)
            })
            .collect();
        let rows: usize = records.iter().map(equations).sum();
        let unknowns = structure.parameters() + transient * lines.len();
        if rows <= unknowns {
            return Err(Error::Data(format!(
                "fitting: {} lines give {rows} real equations for {unknowns} unknowns \
                 ({} parameters and {transient} transient terms a record); widen the band or take fewer poles and zeros",
                records.iter().map(|r| r.x.len()).sum::<usize>(),
                structure.parameters(),
            )));
        }
        let power_of = |k: usize| (0..k).fold(1.0, |p, _| p * band_edge);
        let scale: Vec<f64> =
            structure.terms().iter().map(|(_, power)| power_of(n) / power_of(*power)).collect();
        // Squares of the units of the parameters stand in the covariances.
        let usable = |s: &f64| (1e-140..1e140).contains(s);
        if !scale.iter().all(usable) {
            return Err(Error::Data(format!(
                "fitting: with a band up to {band_edge:.3e} rad/s and {n} poles the parameters leave the range \
                 of numbers; give time in another unit"
            )));
        }
        let bins = Bins::new(&records.iter().map(|r| r.lines).collect::<Vec<_>>());
        let straight = match &records[..] {
            [r] if r.x.len() <= TILE => sizes(structure, method, noise, trend, extended)
                .map(|sizes| Tables::new(sizes, &r.x, &r.size_x, &r.weight)),
            _ => None,
        };
        Ok(Design {
            structure: structure.clone(),
            method,
            noise,
            trend,
            transient,
            parameters: structure.parameters(),
            products,
            symmetric,
            instrument,
            tile: records.iter().map(|r| r.x.len()).max().unwrap_or(0).min(TILE),
            records,
            columns,
            target,
            bins,
            differences: difference_weights(q),
            scale,
            unit: 1.0,
            band_edge,
            straight,
            aliasing: None,
            known_start: None,
        })
    }

    /// Says that the workspace will hold the channels in these units (output first): powers of two, so
    /// that no digit changes, only the range that squares of squares reach.
    pub(crate) fn set_units(&mut self, units: &[f64]) {
        self.unit = units.first().copied().unwrap_or(1.0);
        for (scale, (signal, _)) in self.scale.iter_mut().zip(self.structure.terms()) {
            *scale *= self.unit / units.get(signal).copied().unwrap_or(1.0);
        }
    }

    /// Number of parameters.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Coefficients of a record's transient that θ determines.
    pub(crate) fn tied(&self) -> usize {
        self.known_start.as_ref().map_or(0, |_| self.structure.transient)
    }

    /// Unknowns of one record's system: transient and θ.
    pub(crate) fn size(&self) -> usize {
        self.transient + self.parameters()
    }

    /// Columns of the differenced system: those of trends, and θ.
    pub(crate) fn ls_size(&self) -> usize {
        self.ls_trends() + self.parameters()
    }

    /// Columns of trends that the differenced rows need: one for line 0, one for 1/s.
    pub(crate) fn ls_trends(&self) -> usize {
        let meets_line_0 = self.records.iter().any(|r| r.rows.first <= 0);
        match self.trend {
            Trend::None => 0,
            Trend::Constant => usize::from(meets_line_0),
            Trend::Linear => 1 + usize::from(meets_line_0),
        }
    }

    /// Real equations less all unknowns.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        let rows: usize = self.records.iter().map(equations).sum();
        rows - self.parameters() - (self.transient - self.tied()) * self.records.len()
    }

    /// Lines of a record that a second start is found on.
    pub(crate) fn few_lines(&self) -> usize {
        // Line 0 is one more.
        narrow_lines(self.parameters + self.trend.terms(), self.structure.order) + 1
    }

    /// Whether so many lines of each record give more equations than there are unknowns.
    pub(crate) fn determined(&self, lines: impl Iterator<Item = usize>) -> bool {
        let each = self.records.iter().zip(lines);
        let rows =
            each.map(|(r, lines)| 2 * lines - usize::from(r.lines.first == 0)).sum::<usize>();
        rows > self.parameters + self.transient * self.records.len()
    }

    /// The lines of each record.
    #[must_use]
    pub fn lines(&self) -> Vec<Lines> {
        self.records.iter().map(|r| r.lines).collect()
    }

    /// The weights that belong to the noise, once θ is known.
    pub(crate) fn final_weights(&self) -> super::normal_equations::RowWeights {
        match self.noise {
            Noise::Output | Noise::Process => super::normal_equations::RowWeights::Adapted,
            Noise::Equation => super::normal_equations::RowWeights::Flat,
        }
    }

    /// Unit of a weighted residual: that of the output, or of the equation for equation noise.
    pub(crate) fn cost_unit(&self) -> f64 {
        match self.noise {
            Noise::Output | Noise::Process => self.unit,
            Noise::Equation => (0..self.structure.order).fold(self.unit, |p, _| p * self.band_edge),
        }
    }

    /// Columns of the information at the estimate: the model's own response for `ml`.
    pub(crate) fn final_factors(&self) -> super::normal_equations::LeftColumns {
        match (self.method, self.noise) {
            (Method::Ml, Noise::Output | Noise::Process) => {
                super::normal_equations::LeftColumns::Denoised
            }
            _ => super::normal_equations::LeftColumns::Data,
        }
    }

    /// `wls` under output noise: estimated with weights that are not those of its noise.
    pub(crate) fn keeps_flat_weights(&self) -> bool {
        self.method == Method::Wls && self.noise != Noise::Equation
    }

    /// Whether the weight depends on θ.
    pub(crate) fn adapts(&self) -> bool {
        self.noise != Noise::Equation && matches!(self.method, Method::Awls | Method::Ml)
    }

    /// Whether noise drives the system itself and `ml` counts how its spectrum depends on θ.
    pub(crate) fn driven(&self) -> bool {
        self.noise != Noise::Output && self.method == Method::Ml
    }
}

/// Real equations on the lines of one record: two a line, one on line 0.
fn equations(r: &RecordDesign) -> usize {
    2 * r.x.len() - usize::from(r.lines.first == 0)
}

fn record_design(
    structure: &Structure,
    trend: Trend,
    extended: bool,
    lines: &Lines,
    band_edge: f64,
    transient: &[Column],
    products: &Products,
) -> RecordDesign {
    // An unknown constant touches line 0 alone: it is left out.
    let first = if trend == Trend::None { lines.first } else { lines.first.max(1) };
    let used = Lines { first, ..*lines };
    let x_of = |m: usize| m as f64 * lines.omega0 / band_edge;
    let x: Vec<f64> = (first..=lines.last).map(x_of).collect();
    let weight = (first..=lines.last)
        .map(|m| if m == 0 { 1.0 } else { 2.0 } / lines.unit_variance)
        .collect();
    let value = |x: f64, c: &Column| {
        let power = (0..c.power.max(0)).fold(1.0, |p, _| p * x);
        c.sign * if c.power < 0 { -1.0 / x } else { power }
    };
    RecordDesign {
        transient: transient.iter().flat_map(|c| x.iter().map(|x| value(*x, c))).collect(),
        size_x: x.iter().map(|x| x.max(x_of(1))).collect(),
        powers: products.powers_of(&x),
        rows: rows(structure.transient, lines.first, lines.last, extended),
        lines: used,
        x,
        weight,
    }
}
