//! Sinusoids in noise.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::simd::Isa;
use modfun::threads::Control;
use modfun::tones::{Options, Plan};
use modfun_fuzz::{Bytes, diagonal, same, sound, told, views};

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let n = b.below(96);
    let options = Options {
        count: b.count(4),
        choose: b.flag(),
        damped: b.flag(),
        complex: b.flag(),
        trend: if b.rarely() { b.count(4) } else { b.below(3) },
        band: (b.near(0.0), b.near(0.5)),
        lines: if b.flag() { 0 } else { b.count(6) },
        awls: b.flag(),
    };
    let weights = b.many(n, |b| b.near(1.0));
    let Some(plan) = told(Plan::new(&weights, options.clone(), b.isa())) else { return };
    let records = b.many(1, |b| b.channel(plan.length(), &[]));
    let given = views(&records);
    let found = told(plan.run_many(&given, 1, &mut |_, _| Control::Continue));
    for one in found.iter().flatten() {
        let kinds = if options.damped { 4 } else { 3 };
        let numbers: Vec<f64> = one
            .tones
            .iter()
            .flat_map(|t| [t.frequency, t.damping])
            .chain(one.amplitude.clone())
            .collect();
        sound(one.status, &numbers, diagonal(&one.cov, kinds * one.tones.len()));
    }
    if let Some(plain) = told(Plan::new(&weights, options, Isa::Plain)) {
        same(&found, &told(plain.run_many(&given, 1, &mut |_, _| Control::Continue)));
    }
});
