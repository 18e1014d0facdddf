//! Orthogonal factors of one lane's rows, records stacked: each record has unknowns of its own, its transient, and all
//! share the others.

use super::qr::{Absorber, inverse_of_triangle, solve_square};
use crate::simd::Wide;

/// Relative size below which a column is a combination of the others.
const RANK: f64 = 1e-13;

/// R, QᵀΓ and what solves them; nothing is allocated once it stands.
#[derive(Debug, Clone, Default)]
pub(crate) struct Factor {
    own: usize,
    shared: usize,
    /// Whether sums are fused as those of kernels are: of one output. Plain ones are faster, as in `qr`.
    fused: bool,
    /// Rows of the record at hand, and what all before leave of the shared unknowns.
    record: Absorber,
    all: Absorber,
    /// R of each record's own unknowns with what it needs to be solved: rows × (own + shared + 1).
    kept: Vec<f64>,
    square: Vec<f64>,
    /// The shared unknowns.
    solution: Vec<f64>,
    /// Those that are sought, in order, and their values.
    sought: Vec<usize>,
    found: Vec<f64>,
    scale: Vec<f64>,
}

impl Factor {
    /// For so many unknowns of each record and of all, and tiles of `tile` rows.
    pub fn new(own: usize, shared: usize, records: usize, tile: usize) -> Factor {
        let size = own + shared;
        Factor {
            own,
            shared,
            fused: false,
            record: Absorber::new(size, tile),
            all: Absorber::new(shared, shared),
            kept: vec![0.0; records * own * (size + 1)],
            square: vec![0.0; shared * (shared + 1)],
            solution: vec![0.0; shared],
            sought: Vec::with_capacity(shared),
            found: vec![0.0; shared],
            scale: vec![0.0; shared],
        }
    }

    /// The same with fused sums.
    pub fn fused(self) -> Factor {
        Factor { fused: true, ..self }
    }

    /// s + ab.
    fn add(&self, s: f64, a: f64, b: f64) -> f64 {
        if self.fused { a.mul_add(b, s) } else { s + a * b }
    }

    /// Forgets all records.
    pub fn clear(&mut self) {
        self.all.clear();
        self.record.clear();
    }

    /// Adds a row of J, the record's own columns first, and the row [Γ, g].
    pub fn push(&mut self, j: impl Iterator<Item = f64>, g: impl Iterator<Item = f64>) {
        self.record.push(j, g);
    }

    /// Ends record `k`. False where its own columns are dependent.
    pub fn end_record(&mut self, k: usize) -> bool {
        let Factor { own, shared, record, all, kept, .. } = self;
        let (own, size) = (*own, *own + *shared);
        record.absorb();
        for i in 0..own {
            let row = &mut kept[(k * own + i) * (size + 1)..][..size + 1];
            for (j, to) in row.iter_mut().enumerate() {
                *to = if j < own { record.r(i, j) } else { record.qt(i, j) };
            }
        }
        for i in own..size {
            all.push((own..size).map(|j| record.r(i, j)), (own..=size).map(|j| record.qt(i, j)));
        }
        all.absorb();
        let independent = independent(record, own);
        record.clear();
        independent
    }

    /// Whether the shared columns are independent.
    pub fn is_independent(&self) -> bool {
        independent(&self.all, self.shared)
    }

    /// Solves for the shared unknowns but those that have a value. False where their columns are dependent.
    pub fn solve(&mut self, known: impl Fn(usize) -> Option<f64>) -> bool {
        let Factor { all, square, solution, sought, found, scale, shared, .. } = self;
        sought.clear();
        for (k, to) in solution.iter_mut().enumerate() {
            match known(k) {
                Some(value) => *to = value,
                None => sought.push(k),
            }
        }
        let count = sought.len();
        // RᵀR of what moves would square the condition: the rows of QᵀΓ suffice where all move.
        for (a, i) in sought.iter().enumerate() {
            for (b, j) in sought.iter().enumerate() {
                square[a * (count + 1) + b] = all.qt(*i, *j);
            }
            let held = (0..*shared).filter(|j| !sought.contains(j));
            let held: f64 = held.map(|j| all.qt(*i, j) * solution[j]).sum();
            square[a * (count + 1) + count] = all.qt(*i, *shared) - held;
        }
        let worst = solve_square(square, count, found, scale);
        for (k, value) in sought.iter().zip(found.iter()) {
            solution[*k] = *value;
        }
        worst > RANK
    }

    /// The shared unknowns of the last [`Factor::solve`].
    pub fn solution(&self) -> &[f64] {
        &self.solution
    }

    /// Record `k`'s own unknowns beside these, into a lane.
    pub fn solve_own(&self, k: usize, to: &mut [Wide], lane: usize) {
        let (own, width) = (self.own, self.own + self.shared + 1);
        for i in (0..own).rev() {
            let row = &self.kept[(k * own + i) * width..][..width];
            let mut sum = row[width - 1];
            for (by, x) in row[own..].iter().zip(&self.solution) {
                sum = self.add(sum, -by, *x);
            }
            for (by, x) in row[..own].iter().zip(&*to).skip(i + 1) {
                sum = self.add(sum, -by, x.0[lane]);
            }
            to[i].0[lane] = sum / row[i];
        }
    }

    /// (RᵀR)⁻¹ of the shared unknowns into a lane, without squaring the condition number.
    pub fn inverse(&mut self, to: &mut [Wide], lane: usize) {
        let (p, mut inverse) = (self.shared, std::mem::take(&mut self.square));
        let add = |s: f64, a: f64, b: f64| self.add(s, a, b);
        inverse_of_triangle(p, |i, j| self.all.r(i, j), add, &mut inverse);
        for i in 0..p {
            for j in 0..p {
                let both = inverse[i * p..][..p].iter().zip(&inverse[j * p..][..p]);
                to[i * p + j].0[lane] = both.fold(0.0, |s, (x, y)| add(s, *x, *y));
            }
        }
        self.square = inverse;
    }
}

/// Whether the first `count` columns of an upper triangle are no combinations of those before them.
fn independent(factor: &Absorber, count: usize) -> bool {
    (0..count).all(|j| {
        let norm = (0..=j).fold(0.0, |s, i| s + factor.r(i, j) * factor.r(i, j)).sqrt();
        factor.r(j, j).abs() > RANK * norm
    })
}
