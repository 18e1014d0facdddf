//! Fits of one output: alone, from a start, and many at once.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::estimate::{Batch, Fitter, RecordView};
use modfun::simd::Isa;
use modfun::threads::Control;
use modfun_fuzz::{Bytes, Sampling, diagonal, same, sound, told, views};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = 9 + b.below(120);
    let sampling = b.times(n);
    let dt = if let Sampling::Even(dt) = sampling { dt } else { 0.5 };
    let Some(options) = b.fit_options(n, dt) else { return };
    let announced = if b.rarely() { b.count(64) } else { n };
    let (isa, records) = (b.isa(), 1 + usize::from(b.rarely()));
    let kinds = vec![(announced, sampling.time()); records];
    let inputs = options.structure.numerators.len();
    let Some(fitter) = told(Fitter::new(options.clone(), &kinds, isa)) else { return };

    let all = b.many(records, |b| b.channels(1 + inputs, n));
    let given: Vec<_> = all.iter().map(|c| RecordView { y: &c[0], u: views(&c[1..]) }).collect();
    let fit = told(fitter.fit(&given));
    if let Some(fit) = fit.as_ref().map(|f| &f.answer) {
        let p = fit.theta.len();
        let errors = diagonal(&fit.cov_nonrobust, p).chain(diagonal(&fit.cov_hc3, p));
        sound(fit.status, &fit.theta, errors);
    }
    same(&fit, &told(fitter.fit(&given)));
    if let Some(plain) = told(Fitter::new(options, &kinds, Isa::Plain)) {
        same(&fit, &told(plain.fit(&given)));
    }

    let start = b.many(fit.map_or(0, |f| f.answer.theta.len()), Bytes::number);
    if let Some(fit) = told(fitter.fit_best(&given, &[start])) {
        sound(fit.answer.status, &fit.answer.theta, []);
    }
    let batch = Batch {
        y: given.iter().map(|r| r.y).collect(),
        u: given.iter().flat_map(|r| r.u.clone()).collect(),
    };
    if let Some((many, _)) = told(fitter.fit_many(&batch, 1, &mut |_, _| Control::Continue)) {
        let p = many.theta.len() / many.status.len();
        for (k, status) in many.status.iter().enumerate() {
            let own = k * p..(k + 1) * p;
            let errors = many.bse_hc3[own.clone()].iter().chain(&many.bse_nonrobust[own.clone()]);
            sound(*status, &many.theta[own.clone()], errors.copied());
        }
    }
});
