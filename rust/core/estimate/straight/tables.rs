//! What the straight path needs of a problem, made once, and the memory of its products and sums.

use super::shape::{POWERS, SUMS, Shape};
use crate::simd::Wide;
use crate::structure::{Method, Noise, Structure, Trend};

/// Poles, inputs, coefficients of each numerator.
pub(crate) type Sizes = (usize, usize, usize);

/// What a line needs, and which kernel is meant.
#[derive(Debug, Clone)]
pub(crate) struct Tables {
    pub sizes: Sizes,
    /// x, max(x, that of line 1), and 1/(h · unit variance).
    pub x: Vec<f64>,
    pub size_x: Vec<f64>,
    pub weight: Vec<f64>,
    /// Powers of x from 0 on.
    pub powers: Vec<[f64; POWERS]>,
}

/// Products and sums of a problem.
#[derive(Debug, Clone, Default)]
pub(crate) struct StraightWorkspace {
    /// Products on the lines, line after line: those with the output, those without.
    pub own: Vec<Wide>,
    pub shared: Vec<Wide>,
    pub sums: Vec<Wide>,
    /// Whether they are those of the coefficients that stand in the workspace.
    pub output_ready: bool,
    pub inputs_ready: bool,
}

/// Does `$use` with the shape of these sizes. No other shapes are compiled: each takes code and build time.
macro_rules! shapes {
    ($sizes:expr, $use:ident, $otherwise:expr) => {
        match $sizes {
            (1, 1, 1) => $use!(1, 1, 1, 3),
            (2, 1, 1) => $use!(2, 1, 1, 5),
            (2, 1, 2) => $use!(2, 1, 2, 6),
            (2, 2, 1) => $use!(2, 2, 1, 6),
            (3, 1, 1) => $use!(3, 1, 1, 7),
            (3, 1, 3) => $use!(3, 1, 3, 9),
            _ => $otherwise,
        }
    };
}
pub(super) use shapes;

/// The sizes of a problem on one record, where it has a shape that is compiled.
pub(crate) fn sizes(
    structure: &Structure,
    method: Method,
    noise: Noise,
    trend: Trend,
    extended: bool,
) -> Option<Sizes> {
    let Structure { order, numerators, transient } = structure;
    let degree = (*numerators.first()?)?;
    let trendless = match method {
        Method::Ls => trend == Trend::None,
        Method::Wls => false,
        Method::Awls | Method::Ml => trend != Trend::Linear,
    };
    let alike = numerators.iter().all(|other| *other == Some(degree));
    macro_rules! known {
        ($n:literal, $i:literal, $z:literal, $s:literal) => {
            true
        };
    }
    let sizes = (*order, numerators.len(), degree + 1);
    let plain = extended && transient == order && noise != Noise::Equation;
    (plain && trendless && alike && shapes!(sizes, known, false)).then_some(sizes)
}

impl Tables {
    /// For lines at these x, judged by these sizes and with these weights.
    pub fn new(sizes: Sizes, x: &[f64], size_x: &[f64], weight: &[f64]) -> Tables {
        let powers = |x: &f64| {
            let mut power = 1.0;
            std::array::from_fn(|k| {
                power *= if k == 0 { 1.0 } else { *x };
                power
            })
        };
        Tables {
            sizes,
            x: x.to_vec(),
            size_x: size_x.to_vec(),
            weight: weight.to_vec(),
            powers: x.iter().map(powers).collect(),
        }
    }
}

impl StraightWorkspace {
    /// Room for a problem.
    pub fn new(tables: Option<&Tables>) -> StraightWorkspace {
        let Some(Tables { sizes, x, .. }) = tables else { return StraightWorkspace::default() };
        macro_rules! counts {
            ($n:literal, $i:literal, $z:literal, $s:literal) => {{
                let table = &Shape::<$n, $i, $z>::TABLE;
                (table.own, table.shared)
            }};
        }
        let (own, shared) = shapes!(*sizes, counts, (0, 0));
        StraightWorkspace {
            own: vec![Wide::ZERO; own * x.len()],
            shared: vec![Wide::ZERO; shared * x.len()],
            sums: vec![Wide::ZERO; SUMS],
            output_ready: false,
            inputs_ready: false,
        }
    }
}
