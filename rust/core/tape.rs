//! Formulas as lists of operations: nonlinear signals of sampled channels, coefficients of parameters.
//!
//! A tape holds one operation after the other, each on results of earlier ones. It comes from outside, so
//! that everything about it is checked once, when it is made; what runs afterwards cannot fail.

use std::ops::Range;

use crate::Error;

/// Samples that run through all operations before the next ones.
const TILE: usize = 128;

/// One operation; numbers are positions of earlier operations.
#[derive(Debug, Clone, Copy)]
enum Op {
    Constant(f64),
    Input(usize),
    Add(usize, usize),
    Multiply(usize, usize),
    Divide(usize, usize),
    Whole(usize, i32),
    Raise(usize, usize),
    Pair(fn(f64, f64) -> f64, usize, usize),
    Call(fn(f64) -> f64, usize),
}

impl Op {
    /// The operations whose results it takes.
    fn operands(self) -> impl Iterator<Item = usize> {
        let (a, b) = match self {
            Op::Constant(_) | Op::Input(_) => (None, None),
            Op::Whole(a, _) | Op::Call(_, a) => (Some(a), None),
            Op::Add(a, b) | Op::Multiply(a, b) | Op::Divide(a, b) => (Some(a), Some(b)),
            Op::Raise(a, b) | Op::Pair(_, a, b) => (Some(a), Some(b)),
        };
        a.into_iter().chain(b)
    }
}

/// What a tape is made of: a name, a number (of "constant", and the exponent of "whole"), two positions.
pub type Written = (String, f64, usize, usize);

/// What an input is.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// One value a sample.
    Series(&'a [f64]),
    /// The same for all.
    Value(f64),
    /// These again and again, a power of two of them: records that stand sample by sample beside each other.
    Cycle(&'a [f64]),
}

/// A list of operations with the positions of its results.
#[derive(Debug, Clone)]
pub struct Tape {
    ops: Vec<Op>,
    outputs: Vec<usize>,
    inputs: usize,
}

/// A name and what it calls.
type Call = (&'static str, fn(f64) -> f64);

/// Functions of one argument. The library's are the same on every processor.
const CALLS: &[Call] = &[
    ("sin", libm::sin),
    ("cos", libm::cos),
    ("tan", libm::tan),
    ("asin", libm::asin),
    ("acos", libm::acos),
    ("atan", libm::atan),
    ("sinh", libm::sinh),
    ("cosh", libm::cosh),
    ("tanh", libm::tanh),
    ("exp", libm::exp),
    ("ln", libm::log),
    ("sqrt", f64::sqrt),
    ("abs", f64::abs),
    ("sign", sign),
    ("floor", f64::floor),
    ("step", step),
];

/// A name and what it calls, of two.
type Pair = (&'static str, fn(f64, f64) -> f64);

/// Functions of two arguments.
const PAIRS: &[Pair] =
    &[("min", f64::min), ("max", f64::max), ("less", less), ("less_equal", less_equal)];

fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

fn step(x: f64) -> f64 {
    if x >= 0.0 { 1.0 } else { x.min(0.0) * 0.0 }
}

fn less(a: f64, b: f64) -> f64 {
    f64::from(a < b)
}

fn less_equal(a: f64, b: f64) -> f64 {
    f64::from(a <= b)
}

impl Tape {
    /// From operations as written, the number of inputs and the positions of the results.
    ///
    /// # Errors
    /// [`Error::Spec`] for a name that is none, or a position that is not earlier.
    pub fn new(written: &[Written], inputs: usize, outputs: Vec<usize>) -> Result<Tape, Error> {
        let mut ops = Vec::with_capacity(written.len());
        for (at, (name, value, a, b)) in written.iter().enumerate() {
            let early = |position: usize| match position < at {
                true => Ok(position),
                false => Err(Error::Spec(format!(
                    "reading a formula: operation {at} (\"{name}\") takes the result of operation \
                     {position}, which does not come before it"
                ))),
            };
            let call = CALLS.iter().find(|(own, _)| own == name);
            let pair = PAIRS.iter().find(|(own, _)| own == name);
            ops.push(match (name.as_str(), call, pair) {
                (_, Some((_, f)), _) => Op::Call(*f, early(*a)?),
                (_, _, Some((_, f))) => Op::Pair(*f, early(*a)?, early(*b)?),
                ("constant", ..) => Op::Constant(*value),
                ("input", ..) if *a < inputs => Op::Input(*a),
                ("add", ..) => Op::Add(early(*a)?, early(*b)?),
                ("multiply", ..) => Op::Multiply(early(*a)?, early(*b)?),
                ("divide", ..) => Op::Divide(early(*a)?, early(*b)?),
                ("whole", ..) if value.abs() <= 64.0 => Op::Whole(early(*a)?, *value as i32),
                ("raise", ..) => Op::Raise(early(*a)?, early(*b)?),
                _ => {
                    return Err(Error::Spec(format!(
                        "reading a formula: operation {at}, \"{name}\" of {value}, {a}, {b} with {inputs} \
                         inputs, is not one that exists"
                    )));
                }
            });
        }
        if let Some(bad) = outputs.iter().find(|k| **k >= ops.len()) {
            return Err(Error::Spec(format!(
                "reading a formula: result {bad} of {} operations does not exist",
                ops.len()
            )));
        }
        Ok(Tape { ops, outputs, inputs })
    }

    /// Number of results.
    #[must_use]
    pub fn results(&self) -> usize {
        self.outputs.len()
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Whether result `k` is the same number for all samples, and which.
    #[must_use]
    pub fn constant(&self, k: usize) -> Option<f64> {
        match self.ops[self.outputs[k]] {
            Op::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// Whether each result takes one of these inputs.
    #[must_use]
    pub fn takes(&self, input: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut takes = vec![false; self.ops.len()];
        for (at, op) in self.ops.iter().enumerate() {
            takes[at] = match *op {
                Op::Input(k) => input(k),
                _ => op.operands().any(|k| takes[k]),
            };
        }
        self.outputs.iter().map(|k| takes[*k]).collect()
    }

    /// Writes the results that are wanted, one value a sample, into `out[k][..samples]`; `registers` is scratch.
    ///
    /// A missing input, or one of too few samples, reads as NaN.
    pub fn run(
        &self,
        wanted: impl Fn(usize) -> bool,
        inputs: &[Input<'_>],
        samples: usize,
        registers: &mut Vec<f64>,
        out: &mut [&mut [f64]],
    ) {
        registers.resize(self.ops.len() * TILE, 0.0);
        let mut used = vec![false; self.ops.len()];
        self.outputs.iter().enumerate().for_each(|(k, at)| used[*at] |= wanted(k));
        for (at, op) in self.ops.iter().enumerate().rev() {
            op.operands().for_each(|k| used[k] |= used[at]);
        }
        // What is the same for all samples stands in its register from the start.
        let mut varies = vec![false; self.ops.len()];
        for (at, op) in self.ops.iter().enumerate().filter(|(at, _)| used[*at]) {
            varies[at] = match *op {
                Op::Input(k) => matches!(inputs.get(k), Some(Input::Series(_))),
                _ => op.operands().any(|k| varies[k]),
            };
            if !varies[at] {
                self.operate(at, inputs, 0..TILE, registers);
            }
        }
        for start in (0..samples).step_by(TILE) {
            let tile = start..samples.min(start + TILE);
            for at in (0..self.ops.len()).filter(|at| varies[*at]) {
                self.operate(at, inputs, tile.clone(), registers);
            }
            let each = out.iter_mut().zip(&self.outputs).enumerate();
            for (_, (out, k)) in each.filter(|(k, _)| wanted(*k)) {
                out[tile.clone()].copy_from_slice(self.operand(*k, inputs, &tile, registers));
            }
        }
    }

    /// What operation `k` made of the samples of a tile.
    fn operand<'a>(
        &self,
        k: usize,
        inputs: &'a [Input<'_>],
        tile: &Range<usize>,
        registers: &'a [f64],
    ) -> &'a [f64] {
        if let Op::Input(input) = self.ops[k]
            && let Some(Input::Series(values)) = inputs.get(input)
            && let Some(own) = values.get(tile.clone())
        {
            return own;
        }
        &registers[k * TILE..][..tile.len()]
    }

    /// Runs operation `at` over the samples of a tile.
    fn operate(&self, at: usize, inputs: &[Input<'_>], tile: Range<usize>, registers: &mut [f64]) {
        let (done, rest) = registers.split_at_mut(at * TILE);
        let to = &mut rest[..tile.len()];
        let of = |k: usize| self.operand(k, inputs, &tile, done);
        match self.ops[at] {
            Op::Constant(value) => to.fill(value),
            Op::Input(k) => match inputs.get(k) {
                Some(Input::Value(value)) => to.fill(*value),
                Some(Input::Cycle(values)) => {
                    to.iter_mut().zip(values.iter().cycle()).for_each(|(to, value)| *to = *value);
                }
                // Read where it stands.
                Some(Input::Series(values)) if values.len() >= tile.end => {}
                _ => to.fill(f64::NAN),
            },
            Op::Add(a, b) => each(to, of(a), of(b), |a, b| a + b),
            Op::Multiply(a, b) => each(to, of(a), of(b), |a, b| a * b),
            Op::Divide(a, b) => each(to, of(a), of(b), |a, b| a / b),
            Op::Raise(a, b) => each(to, of(a), of(b), libm::pow),
            Op::Pair(f, a, b) => each(to, of(a), of(b), f),
            Op::Call(f, a) => {
                for (to, a) in to.iter_mut().zip(of(a)) {
                    *to = f(*a);
                }
            }
            Op::Whole(a, power) => whole(to, of(a), power),
        }
    }

    /// Every result for single values.
    pub fn values(&self, inputs: &[f64], registers: &mut Vec<f64>, out: &mut [f64]) {
        registers.clear();
        for op in &self.ops {
            let value = match *op {
                Op::Constant(value) => value,
                Op::Input(k) => inputs.get(k).copied().unwrap_or(f64::NAN),
                Op::Add(a, b) => registers[a] + registers[b],
                Op::Multiply(a, b) => registers[a] * registers[b],
                Op::Divide(a, b) => registers[a] / registers[b],
                Op::Raise(a, b) => libm::pow(registers[a], registers[b]),
                Op::Pair(f, a, b) => f(registers[a], registers[b]),
                Op::Call(f, a) => f(registers[a]),
                Op::Whole(a, power) => {
                    let mut out = [0.0];
                    whole(&mut out, &[registers[a]], power);
                    out[0]
                }
            };
            registers.push(value);
        }
        for (out, k) in out.iter_mut().zip(&self.outputs) {
            *out = registers[*k];
        }
    }
}

#[inline]
fn each(to: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) {
    for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
        *to = f(*a, *b);
    }
}

/// Whole powers by repeated squaring.
fn whole(to: &mut [f64], a: &[f64], power: i32) {
    match power {
        2 => each(to, a, a, |x, y| x * y),
        3 => each(to, a, a, |x, y| x * x * y),
        _ => {
            for (to, a) in to.iter_mut().zip(a) {
                let (mut result, mut square, mut left) = (1.0, *a, power.unsigned_abs());
                while left > 0 {
                    if left % 2 == 1 {
                        result *= square;
                    }
                    square *= square;
                    left /= 2;
                }
                *to = if power < 0 { 1.0 / result } else { result };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn op(name: &str, value: f64, a: usize, b: usize) -> Written {
        (name.to_owned(), value, a, b)
    }

    #[test]
    fn samples_and_single_values_agree_over_tiles() {
        // y³ − 3v·y and cos(y)/y of channel y and value v.
        let written = [
            op("input", 0.0, 0, 0),
            op("input", 0.0, 1, 0),
            op("whole", 3.0, 0, 0),
            op("multiply", 0.0, 0, 1),
            op("constant", -3.0, 0, 0),
            op("multiply", 0.0, 3, 4),
            op("add", 0.0, 2, 5),
            op("cos", 0.0, 0, 0),
            op("divide", 0.0, 7, 0),
            op("whole", -5.0, 0, 0),
        ];
        let tape = Tape::new(&written, 2, vec![6, 8, 9]).unwrap();
        let y: Vec<f64> = (1..=300).map(|k| f64::from(k) / 100.0).collect();
        let mut out = vec![vec![0.0; 300]; 3];
        let mut scratch = Vec::new();
        let inputs = [Input::Series(&y), Input::Value(0.25)];
        let run = |first: usize, inputs: &[Input<'_>], out: &mut [Vec<f64>]| {
            let mut out: Vec<&mut [f64]> = out.iter_mut().map(Vec::as_mut_slice).collect();
            tape.run(|k| k >= first, inputs, 300, &mut Vec::new(), &mut out);
        };
        run(0, &inputs, &mut out);
        for (k, y) in y.iter().enumerate() {
            let mut one = [0.0; 3];
            tape.values(&[*y, 0.25], &mut scratch, &mut one);
            assert_eq!([out[0][k], out[1][k], out[2][k]], one);
            assert!((one[0] - (y * y * y - 0.75 * y)).abs() < 1e-12);
            assert!((one[2] * y * y * y * y * y - 1.0).abs() < 1e-12);
        }
        let mut last = vec![vec![7.0; 300]; 3];
        run(1, &inputs, &mut last);
        assert!(last[0] == [7.0; 300] && last[1..] == out[1..]);
        assert_eq!(tape.takes(|input| input == 1), [true, false, false]);
        let mut cycle = vec![vec![0.0; 300]; 3];
        run(0, &[Input::Series(&y), Input::Cycle(&[0.25, 0.5])], &mut cycle);
        for (k, y) in y.iter().enumerate() {
            let mut one = [0.0; 3];
            tape.values(&[*y, if k % 2 == 0 { 0.25 } else { 0.5 }], &mut scratch, &mut one);
            assert_eq!([cycle[0][k], cycle[1][k], cycle[2][k]], one);
        }
    }

    #[test]
    fn what_is_not_a_formula_is_refused() {
        let late = Tape::new(&[op("sin", 0.0, 0, 0)], 0, vec![0]);
        assert!(matches!(late, Err(Error::Spec(m)) if m.contains("does not come before")));
        let unknown = Tape::new(&[op("system", 0.0, 0, 0)], 0, vec![0]);
        assert!(matches!(unknown, Err(Error::Spec(m)) if m.contains("\"system\"")));
        assert!(Tape::new(&[op("input", 0.0, 1, 0)], 1, vec![0]).is_err());
        assert!(Tape::new(&[op("constant", 2.0, 0, 0)], 0, vec![1]).is_err());
    }

    #[test]
    fn a_missing_input_is_not_a_number() {
        let tape = Tape::new(&[op("input", 0.0, 0, 0)], 1, vec![0]).unwrap();
        let mut out = [0.0; 3];
        tape.run(|_| true, &[Input::Series(&[1.0])], 3, &mut Vec::new(), &mut [&mut out]);
        assert!(out.iter().all(|x| x.is_nan()));
    }
}
