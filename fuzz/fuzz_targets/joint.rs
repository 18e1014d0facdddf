//! Joint fits of several outputs: coloured and uneven noise, held and bounded parameters, unknown delays.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::estimate::joint::{JointBatch, JointFitter, JointRecord};
use modfun::simd::Isa;
use modfun::threads::Control;
use modfun_fuzz::{Bytes, Sampling, diagonal, same, sound, told, views};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = 9 + b.below(80);
    let sampling = b.times(n);
    let dt = if let Sampling::Even(dt) = sampling { dt } else { 0.5 };
    let Some(options) = b.joint_options(n, dt) else { return };
    let announced = if b.rarely() { b.count(64) } else { n };
    let (isa, records) = (b.isa(), 1 + usize::from(b.rarely()));
    let kinds = vec![(announced, sampling.time()); records];
    let (outputs, inputs) = (options.structure.orders.len(), options.inputs());
    let variances = match b.rarely() {
        true => b.many(records, |b| b.channels(outputs, n)),
        false => Vec::new(),
    };
    let Some(fitter) = told(JointFitter::new(options.clone(), &kinds, &variances, isa)) else {
        return;
    };

    let all = b.many(records, |b| b.channels(outputs + inputs, n));
    let given: Vec<_> = all
        .iter()
        .map(|c| JointRecord { y: views(&c[..outputs]), u: views(&c[outputs..]) })
        .collect();
    let fit = told(fitter.fit(&given));
    if let Some(fit) = fit.as_ref().map(|f| &f.answer) {
        let p = fit.theta.len();
        let errors = diagonal(&fit.cov_nonrobust, p).chain(diagonal(&fit.cov_hc3, p));
        sound(fit.status, &fit.theta, errors);
    }
    if isa != Isa::Plain {
        if let Some(plain) = told(JointFitter::new(options, &kinds, &variances, Isa::Plain)) {
            same(&fit, &told(plain.fit(&given)));
        }
    }
    let batch = JointBatch {
        records,
        y: given.iter().flat_map(|r| r.y.clone()).collect(),
        u: given.iter().flat_map(|r| r.u.clone()).collect(),
    };
    if let Some((many, _)) = told(fitter.fit_many(&batch, 1, &mut |_, _| Control::Continue)) {
        let p = many.theta.len() / many.status.len();
        for (k, status) in many.status.iter().enumerate() {
            let own = k * p..(k + 1) * p;
            sound(*status, &many.theta[own.clone()], many.bse_hc3[own].iter().copied());
        }
    }
});
