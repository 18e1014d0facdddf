//! Monte Carlo studies of a few replicates.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::monte_carlo::{Contender, Draw, Group, Plan, Run, Told};
use modfun::simd::Isa;
use modfun::structure::CovType;
use modfun::threads::Control;
use modfun_fuzz::{Bytes, same, told};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = 9 + b.below(60);
    let dt = b.near(0.1);
    let Some(joint) = b.joint_options(n, dt) else { return };
    let Some(plain) = b.fit_options(n, dt) else { return };
    let (told_of, outputs, inputs, parameters) = match b.flag() {
        true => {
            let sizes = (plain.structure.numerators.len(), plain.structure.parameters());
            (Told::Plain(plain), 1, sizes.0, sizes.1)
        }
        false => {
            let s = &joint.structure;
            let sizes = (s.orders.len(), joint.inputs(), s.parameters());
            (Told::Joint(Box::new(joint)), sizes.0, sizes.1, sizes.2)
        }
    };
    if parameters > 100 {
        return;
    }
    let contender = Contender {
        options: told_of,
        truth: b.many(parameters, |b| b.near(1.0)),
        intervals: b.of(&[
            None,
            Some(CovType::Nonrobust),
            Some(CovType::Hc3),
            Some(CovType::Spectral),
        ]),
    };
    let record = b.channels(outputs + inputs, n);
    let (states, levels) = (b.below(2), b.below(3));
    let group = Group {
        group: b.below(9) as u32,
        dt,
        y: record[..outputs].to_vec(),
        u: record[outputs..].to_vec(),
        free: b.many(states, |b| b.channels(outputs, n)),
        sigma: b.many(levels, |b| b.near(0.1)),
        scale: b.many(outputs, |b| b.near(1.0)),
        estimators: vec![contender; 1],
    };
    let draw = b.of(&[Draw::Samples, Draw::Coefficients]);
    let run = Run {
        seed: b.count(100) as u64,
        first: b.count(100) as u64,
        replicates: b.below(20),
        samples: b.flag(),
    };
    let quantile = b.near(2.0);
    let at = |isa| {
        let plan = told(Plan::new(std::slice::from_ref(&group), draw, isa))?;
        told(plan.run(&run, &[vec![quantile]], 1, &mut |_, _| Control::Continue))
    };
    let found = at(b.isa());
    for cell in found.iter().flatten().flatten() {
        assert_eq!(cell.status.iter().sum::<u64>(), run.replicates as u64);
    }
    same(&found, &at(Isa::Plain));
});
