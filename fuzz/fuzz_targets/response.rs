//! Frequency responses without a model.
#![no_main]

use libfuzzer_sys::fuzz_target;
use modfun::response::{Family, Piece, Settings, Weighting, responses};
use modfun::simd::Isa;
use modfun::threads::Control;
use modfun_fuzz::{Bytes, same, told};

fn signals(b: &mut Bytes<'_>, count: usize, lines: usize) -> Vec<Vec<[f64; 2]>> {
    b.many(count, |b| {
        let parts = b.channels(2, lines);
        parts[0].iter().zip(&parts[1]).map(|(re, im)| [*re, *im]).collect()
    })
}

fuzz_target!(|bytes: &[u8]| {
    let b = &mut Bytes::new(bytes);
    let settings = Settings {
        family: b.of(&[Family::Modulating, Family::Polynomial, Family::Rational]),
        degree: b.count(4),
        weighting: b.of(&[Weighting::Ls, Weighting::Awls, Weighting::Ml]),
    };
    let (outputs, inputs) = (b.below(4), b.below(4));
    let count = b.below(3);
    let pieces = b.many(count, |b| {
        let lines = b.below(48);
        let outputs = if b.rarely() { b.below(4) } else { outputs };
        Piece {
            omega0: b.near(0.5),
            half: b.count(12),
            zero: b.flag(),
            y: signals(b, outputs, lines),
            u: signals(b, inputs, lines),
        }
    });
    let some = b.below(12);
    let omega = b.many(some, |b| {
        let line = b.below(50) as f64 * 0.5;
        b.near(line)
    });
    let at = |isa| responses(isa, 1, settings, &pieces, &omega, &mut |_, _| Control::Continue);
    let found = told(at(b.isa()));
    if let Some(found) = &found {
        assert_eq!(found.response.len(), outputs * inputs * omega.len());
        for k in 0..omega.len() {
            let size = outputs * inputs;
            for i in 0..size {
                let variance = found.cov[k * size * size + i * (size + 1)][0];
                assert!(!(variance < 0.0), "a variance of {variance}");
            }
        }
    }
    same(&found, &told(at(Isa::Plain)));
});
