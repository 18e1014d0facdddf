//! Samples to coefficients, at once and sliding; noise levels; responses of linear models.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::model::StateSpace;
use modfun::noise_level::noise_level;
use modfun::simd::{Isa, Wide};
use modfun::simulate::{Input, NODES, simulate};
use modfun::spectrum::{CoefficientPlan, Kind, Scratch, Sliding};
use modfun_fuzz::{Bytes, Sampling, same, told};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    match b.below(4) {
        0 => model(b),
        1 => {
            let n = b.below(200);
            let samples = b.channel(n, &[]);
            let order = b.count(5);
            same(&told(noise_level(&samples, order)), &told(noise_level(&samples, order)));
        }
        _ => coefficients(b),
    }
});

fn coefficients(b: &mut Bytes<'_>) {
    let kind = b.of(&Kind::ALL);
    let intervals = b.count(200);
    let harmonics = b.count(100);
    let plan = match b.times(intervals.min(200)) {
        Sampling::Uneven(t) => CoefficientPlan::uneven(&t, harmonics, kind),
        Sampling::Even(_) => {
            let lead = b.count(8);
            let delay = b.of(&[0.0, 0.0, 1.0, 1.5, 2.25]);
            CoefficientPlan::new(intervals, harmonics, kind, b.near(delay), lead)
        }
    };
    let Some(plan) = told(plan) else { return };
    let own = if b.rarely() { b.below(64) } else { plan.samples() };
    let samples = b.channel(own, &[]);
    let lines = plan.harmonics() + 1;
    let run = |isa: Isa| {
        let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
        told(plan.run_in(isa, &samples, &mut re, &mut im, &mut Scratch::default()))
            .map(|()| (re, im))
    };
    let one = run(b.isa());
    same(&one, &run(Isa::Plain));
    let wide: Vec<Wide> = samples.iter().map(|v| Wide::splat(*v)).collect();
    let (mut re, mut im) = (vec![Wide::ZERO; lines], vec![Wide::ZERO; lines]);
    let lanes = plan.run_lanes(b.isa(), &wide, &mut re, &mut im, &mut plan.scratch());
    let lane = |k: usize| -> (Vec<f64>, Vec<f64>) {
        (re.iter().map(|w| w.0[k]).collect(), im.iter().map(|w| w.0[k]).collect())
    };
    if told(lanes).is_some() {
        (0..8).for_each(|k| same(&one, &Some(lane(k))));
    }
    if let Some(mut sliding) = told(Sliding::new(&plan)) {
        samples.iter().cycle().take(2 * samples.len() + 3).for_each(|v| sliding.push(*v));
        let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
        sliding.coefficients(&mut re, &mut im);
    }
}

fn model(b: &mut Bytes<'_>) {
    let (states, inputs, outputs) = (b.below(4), b.below(3), b.below(3));
    let intervals = b.below(24);
    let count = if b.rarely() { b.count(24) } else { intervals };
    let matrix = |b: &mut Bytes<'_>, size: usize| b.many(size, |b| b.near(0.5));
    let (a, c) = (matrix(b, states * states), matrix(b, outputs * states));
    let (drive, direct) = (matrix(b, states * inputs), matrix(b, outputs * inputs));
    let announced = if b.rarely() { b.count(4) } else { states };
    let system =
        StateSpace { a: &a, b: &drive, c: &c, d: &direct, states: announced, inputs, outputs };
    let samples = b.channel(inputs * (intervals + 1), &[]);
    let nodes = b.channel(inputs * intervals * NODES, &[]);
    let input =
        b.of(&[Input::Zoh(&samples), Input::Foh(&samples), Input::Smooth(&samples, &nodes)]);
    let x0 = matrix(b, states);
    let dt = b.near(0.1);
    let once = told(simulate(&system, &x0, input, dt, count));
    if let Some(y) = &once {
        assert_eq!(y.len(), outputs * (count + 1));
    }
    same(&once, &told(simulate(&system, &x0, input, dt, count)));
}
