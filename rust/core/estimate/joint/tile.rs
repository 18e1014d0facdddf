//! What stands in the lanes, and where the rows of the lines that are processed together lie.

use super::design::RecordDesign;
use crate::simd::{LANES, Lanes, Wide};

/// What the eight lanes of a workspace hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Across {
    /// The same line of eight replicates: for batches of small problems.
    #[default]
    Replicates,
    /// Eight neighbouring lines of one record: its columns then lie in memory one after another.
    Lines,
}

impl Across {
    /// Row `row` of a table whose rows have `stride` numbers, at line (or eight lines) `m`.
    #[inline(always)]
    pub fn load<L: Lanes>(self, table: &[f64], stride: usize, row: usize, m: usize) -> L {
        let own = &table[row * stride..(row + 1) * stride];
        match self {
            Across::Replicates => L::splat(own[m]),
            Across::Lines => L::load_any(&own.as_chunks().0[m]),
        }
    }

    /// The block of a line's number, and its lane, in what is kept a line: `lane` where the lanes are replicates.
    pub fn place(self, m: usize, lane: usize) -> (usize, usize) {
        match self {
            Across::Replicates => (m, lane),
            Across::Lines => (m / LANES, m % LANES),
        }
    }

    /// 1/√PSD of an output's noise at line (or eight lines) `m`, where spectra are given.
    pub fn root(self, of: &RecordDesign, output: usize, m: usize) -> Wide {
        let own = &of.output_roots[output * of.stride()..];
        match self {
            Across::Replicates => Wide::splat(own[m]),
            Across::Lines => Wide(own.as_chunks().0[m]),
        }
    }
}

/// A column that an output has not.
const NONE: usize = usize::MAX;

/// Rows of lines: columns (unknowns, target) of each output and line, Re and Im.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    pub all: Vec<Wide>,
    /// Where the first line's real part of an output's column stands: output × column.
    start: Vec<usize>,
    width: usize,
    /// From a real part to the imaginary one, and from a line to the next.
    pub part: usize,
    line: usize,
}

/// Outputs whose rows are factored together: one, or all where each line's noise couples them.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub outputs: Vec<usize>,
    /// Its unknowns; behind their columns stands that of the target.
    pub columns: Vec<usize>,
    /// First number of its columns, and numbers of one.
    pub from: usize,
    pub height: usize,
}

impl Rows {
    /// Line by line, a line output by output, an output column by column.
    pub fn tiled(lines: usize, outputs: usize, width: usize) -> Rows {
        let part = lines * outputs * width;
        let start = (0..outputs * width).collect();
        Rows { all: vec![Wide::ZERO; 2 * part], start, width, part, line: outputs * width }
    }

    /// Block by block, a block column by column, a column output by output, and no column of outputs that have
    /// none; `reach` says which have. `groups` of eight lines.
    pub fn stacked(
        groups: usize,
        outputs: usize,
        blocks: &[Vec<usize>],
        reach: &[Vec<usize>],
    ) -> (Rows, Vec<Block>) {
        let width = reach.len();
        let mut start = vec![NONE; outputs * width];
        let (mut from, mut laid) = (0, Vec::new());
        for own in blocks {
            let height = 2 * groups * own.len();
            let stands = |c: &usize| reach[*c].iter().any(|i| own.contains(i));
            let columns: Vec<usize> = (0..width).filter(stands).collect();
            for (slot, c) in columns.iter().enumerate() {
                for (place, i) in own.iter().enumerate() {
                    start[i * width + c] = from + slot * height + place * 2 * groups;
                }
            }
            let unknowns = columns.iter().copied().filter(|c| *c + 1 < width).collect();
            laid.push(Block { outputs: own.clone(), columns: unknowns, from, height });
            from += columns.len() * height;
        }
        let rows = Rows { all: vec![Wide::ZERO; from], start, width, part: groups, line: 1 };
        (rows, laid)
    }

    /// One column for each output: residuals.
    pub fn single(groups: usize, outputs: usize) -> Rows {
        let start = (0..outputs).map(|i| i * 2 * groups).collect();
        Rows { all: vec![Wide::ZERO; 2 * groups * outputs], start, width: 1, part: groups, line: 1 }
    }

    /// Where the real part of an output's column stands on a line; the column must be there.
    #[inline(always)]
    pub fn at(&self, output: usize, column: usize, line: usize) -> usize {
        self.start[output * self.width + column] + line * self.line
    }

    /// Whether an output has a column.
    pub fn has(&self, output: usize, column: usize) -> bool {
        self.start[output * self.width + column] != NONE
    }

    #[inline(always)]
    pub fn get<L: Lanes>(&self, at: usize) -> (L, L) {
        (L::load(&self.all[at]), L::load(&self.all[at + self.part]))
    }

    #[inline(always)]
    pub fn set<L: Lanes>(&mut self, at: usize, value: (L, L)) {
        value.0.store(&mut self.all[at]);
        value.1.store(&mut self.all[at + self.part]);
    }
}
