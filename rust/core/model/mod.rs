//! Linear models with numbers: state space and its exact discretisation.

pub mod discretise;

use crate::Error;

/// A state-space model x' = Ax + Bu, y = Cx + Du; matrices row by row, any number of inputs and outputs.
#[derive(Debug, Clone, Copy)]
pub struct StateSpace<'a> {
    /// (states, states).
    pub a: &'a [f64],
    /// (states, inputs).
    pub b: &'a [f64],
    /// (outputs, states).
    pub c: &'a [f64],
    /// (outputs, inputs).
    pub d: &'a [f64],
    /// Number of states.
    pub states: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of outputs.
    pub outputs: usize,
}

impl StateSpace<'_> {
    /// Refuses matrices whose lengths do not fit the dimensions or whose entries are not finite.
    ///
    /// # Errors
    /// [`Error::Spec`] naming the matrix.
    pub fn check(&self) -> Result<(), Error> {
        let (n, p, q) = (self.states, self.inputs, self.outputs);
        let all =
            [("A", self.a, n, n), ("B", self.b, n, p), ("C", self.c, q, n), ("D", self.d, q, p)];
        for (name, matrix, rows, columns) in all {
            if Some(matrix.len()) != rows.checked_mul(columns) {
                return Err(Error::Spec(format!(
                    "{name} must be {rows} × {columns} for {n} states, {p} inputs and {q} outputs, got {} entries; give matrices that fit each other",
                    matrix.len()
                )));
            }
            if let Some(k) = matrix.iter().position(|x| !x.is_finite()) {
                return Err(Error::Spec(format!(
                    "entry ({}, {}) of {name} is {}; a model has finite numbers",
                    k / columns,
                    k % columns,
                    matrix[k]
                )));
            }
        }
        Ok(())
    }
}
