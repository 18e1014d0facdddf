//! Formulas and their integration.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::integrate::{Outcome, Past, Problem, integrate};
use modfun::tape::{Input, Tape};
use modfun_fuzz::{Bytes, same, told, views};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let (states, drives, parameters) = (b.below(4), b.below(3), b.below(3));
    let pasts = b.below(3);
    let inputs = 1 + states + drives + pasts + parameters;
    let written = b.formulas(inputs);
    let places = b.results(states, written.len());
    let Some(tape) = told(Tape::new(&written, inputs, places)) else { return };

    // The same at once and one by one.
    let n = b.below(70);
    let given = b.channels(inputs, n);
    let mut columns = vec![vec![0.0; n]; states];
    let series: Vec<Input<'_>> = views(&given).into_iter().map(Input::Series).collect();
    tape.run(&series, n, &mut Vec::new(), &mut columns);
    let mut values = vec![0.0; states];
    for k in 0..n.min(4) {
        if given.iter().any(|c| c.len() != n) {
            break;
        }
        let now: Vec<f64> = given.iter().map(|c| c[k]).collect();
        tape.values(&now, &mut Vec::new(), &mut values);
        same(&values, &columns.iter().map(|c| c[k]).collect::<Vec<_>>());
    }

    let (count, samples) = (b.below(3), b.below(12));
    let terms = b.below(4);
    let mut t = b.near(0.0);
    let grid = b.many(samples, |b| {
        t += b.near(0.25);
        t
    });
    let coefficients = drives * samples.saturating_sub(1) * terms;
    let problem = Problem {
        tape: &tape,
        grid: &grid,
        drives: &b.many(coefficients, Bytes::number),
        terms: if b.rarely() { b.count(8) } else { terms },
        pasts: &b.many(pasts, |b| Past { state: b.below(states.max(1)), delay: b.near(0.1) }),
        starts: &b.many(count * states, Bytes::number),
        theta: &b.many(count * parameters, Bytes::number),
        count: if b.rarely() { b.count(8) } else { count },
        relative: b.near(1e-6),
        absolute: &b.many(states, |b| b.near(1e-6)),
        most: b.below(400),
    };
    let Some(outcome) = told(integrate(&problem)) else { return };
    if let Outcome::Done(x) = &outcome {
        assert_eq!(x.len(), problem.starts.len() * grid.len().max(1));
    }
    same(&Some(outcome), &told(integrate(&problem)));
});
