//! What may import what: the table of docs/architecture.md, held by reading the core's sources as text.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A module of the core and the modules it may name. Whoever adds a module puts it here: after all it names.
const TABLE: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("simd", &["error"]),
    ("math", &["simd"]),
    ("threads", &["error"]),
    ("structure", &["error"]),
    ("tape", &["error"]),
    ("rng", &["math", "simd"]),
    ("linalg", &["simd"]),
    ("quadrature", &["error", "math"]),
    ("spectrum", &["error", "math", "quadrature", "simd"]),
    ("noise_level", &["error", "math", "quadrature", "simd", "spectrum"]),
    ("modulation", &["error", "spectrum", "structure"]),
    ("covariance", &["error", "simd", "spectrum"]),
    ("model", &["error", "linalg", "math"]),
    ("simulate", &["error", "model", "quadrature", "threads"]),
    ("integrate", &["error", "tape", "threads"]),
    ("tones", &["error", "linalg", "math", "simd", "spectrum", "threads"]),
    ("response", &["error", "simd", "threads"]),
    (
        "estimate",
        &[
            "covariance",
            "error",
            "linalg",
            "math",
            "modulation",
            "noise_level",
            "quadrature",
            "simd",
            "spectrum",
            "structure",
            "tape",
            "threads",
        ],
    ),
    (
        "monte_carlo",
        &[
            "error",
            "estimate",
            "math",
            "modulation",
            "quadrature",
            "rng",
            "simd",
            "spectrum",
            "structure",
            "threads",
        ],
    ),
];

/// Text that only some files may hold (none: no file), with the reason.
const WORDS: &[(&str, &[&str], &str)] = &[
    ("pyo3", &[], "the core has never heard of Python"),
    ("numpy", &[], "the core has never heard of Python"),
    ("println", &[], "the core does not print"),
    ("eprintln", &[], "the core does not print"),
    ("print", &[], "the core does not print"),
    ("dbg", &[], "the core does not print"),
    ("log", &["tape.rs", "tones/lines.rs"], "the core does not log; there it is the logarithm"),
    ("faer", &[], "its instances are compiled in rust/dense, once"),
    ("modfun_dense", &["integrate/implicit.rs"], "factors of one system; many systems go in lanes"),
    ("modfun_fft", &["spectrum.rs", "spectrum/padded.rs"], "transforms live in spectrum"),
    ("realfft", &[], "its instances are compiled in rust/fft, once"),
    ("rustfft", &[], "its instances are compiled in rust/fft, once"),
    ("rayon", &[], "no thread pool"),
    ("thread", &["threads.rs"], "threads are started in threads.rs"),
    ("thread_local", &["threads.rs"], "no hidden state"),
    ("unsafe", &["simd.rs", "simd/x86.rs"], "unsafe code lives in simd"),
    ("fs", &[], "numerics only, no files"),
    ("io", &[], "numerics only, no files"),
    ("net", &[], "numerics only, no network"),
    ("process", &[], "numerics only, no processes"),
    ("env", &["simd.rs", "threads.rs"], "results do not depend on the environment"),
    ("Instant", &["threads.rs"], "results do not depend on time"),
    ("SystemTime", &[], "results do not depend on time"),
    ("HashMap", &[], "its order differs from run to run"),
    ("HashSet", &[], "its order differs from run to run"),
];

/// Methods whose last bits are those of the system's libm, or unspecified.
const LIBM: &[&str] = &[
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh",
    "asinh", "acosh", "atanh", "exp", "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10",
    "powi", "powf", "cbrt", "hypot",
];

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("rust/core")
}

/// Name inside rust/core and code without comments, strings and tests, of every file but the tests.
fn sources() -> Vec<(String, String)> {
    fn walk(folder: &Path, out: &mut Vec<PathBuf>) {
        let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        for path in entries.map(|e| e.unwrap().path()) {
            if path.is_dir() {
                walk(&path, out);
            } else if path.extension().is_some_and(|e| e == "rs")
                && path.file_stem().unwrap() != "tests"
            {
                out.push(path);
            }
        }
    }
    let mut paths = Vec::new();
    walk(&core(), &mut paths);
    paths.sort();
    let name = |p: &Path| p.strip_prefix(core()).unwrap().to_string_lossy().replace('\\', "/");
    paths.iter().map(|p| (name(p), shipped(&fs::read_to_string(p).unwrap()))).collect()
}

/// Code without what follows `#[cfg(test)]`, comments and strings. Tests stand last in a file.
fn shipped(text: &str) -> String {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let mut out = String::new();
    for line in code.lines() {
        let line = line.split("//").next().unwrap_or_default();
        // Every second piece stands between quotation marks.
        out.extend(line.split('"').step_by(2).flat_map(|piece| [piece, " "]));
        out.push('\n');
    }
    out
}

/// Words of a text.
fn words(code: &str) -> impl Iterator<Item = &str> {
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty())
}

/// The top module a file belongs to.
fn module(file: &str) -> &str {
    file.split('/').next().unwrap_or_default().trim_end_matches(".rs")
}

/// Modules of the crate that a file's paths name: `crate::x`, `crate::{x::y, z}`, and `super` from the top.
fn named(file: &str, code: &str) -> BTreeSet<String> {
    let depth = file.matches('/').count() + usize::from(!file.ends_with("/mod.rs"));
    let root = "super::".repeat(depth.max(1));
    let packed: String = code.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut found = BTreeSet::new();
    let mut found_by_super = BTreeSet::new();
    for (prefix, found) in [("crate::", &mut found), (&root, &mut found_by_super)] {
        for rest in packed.split(prefix).skip(1) {
            if let Some(group) = rest.strip_prefix('{') {
                let mut level = 0;
                let mut item = String::new();
                for c in group.chars() {
                    match c {
                        '{' => level += 1,
                        '}' if level == 0 => break,
                        '}' => level -= 1,
                        ',' if level == 0 => {
                            found.extend(words(&item).next().map(String::from));
                            item.clear();
                        }
                        _ if level == 0 => item.push(c),
                        _ => {}
                    }
                }
                found.extend(words(&item).next().map(String::from));
            } else {
                found.extend(words(rest).next().map(String::from));
            }
        }
    }
    // From an inline module `super` names items of the same file; those are no modules of the crate.
    found.extend(found_by_super.into_iter().filter(|n| TABLE.iter().any(|(name, _)| name == n)));
    // Items of the root are re-exports of `error`.
    found
        .into_iter()
        .map(|n| if n == "Error" || n == "Status" { "error".into() } else { n })
        .collect()
}

#[test]
fn imports_point_one_way() {
    let mut faults = Vec::new();
    for (file, code) in sources().iter().filter(|(file, _)| file != "lib.rs") {
        let module = module(file);
        let Some((_, allowed)) = TABLE.iter().find(|(name, _)| *name == module) else {
            faults.push(format!(
                "{file}: module `{module}` is not in the table of tests/rust/boundaries.rs"
            ));
            continue;
        };
        for name in named(file, code) {
            if name != module && !allowed.contains(&name.as_str()) {
                faults.push(format!(
                    "{file}: `{module}` may not name `{name}`; allowed: {allowed:?}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_table_itself_points_one_way_and_knows_every_module() {
    for (k, (name, allowed)) in TABLE.iter().enumerate() {
        for other in *allowed {
            let known = TABLE[..k].iter().any(|(earlier, _)| earlier == other);
            assert!(known, "`{name}` names `{other}`, which does not stand before it in the table");
        }
        let exists = core().join(format!("{name}.rs")).exists() || core().join(name).is_dir();
        assert!(exists, "`{name}` of the table is no module of rust/core");
    }
}

#[test]
fn words_stand_only_where_they_may() {
    let mut faults = Vec::new();
    for (file, code) in sources() {
        for (number, line) in code.lines().enumerate() {
            for (word, allowed, reason) in WORDS {
                if !allowed.contains(&file.as_str()) && words(line).any(|w| w == *word) {
                    faults.push(format!(
                        "{file}:{}: `{word}`: {reason}: {}",
                        number + 1,
                        line.trim()
                    ));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Calls of the system's libm in a line, as methods and as paths.
fn libm_calls(line: &str) -> Vec<&'static str> {
    let called = |name: &&&str| {
        line.contains(&format!(".{name}()"))
            || (matches!(**name, "powi" | "powf" | "atan2" | "hypot" | "log")
                && line.contains(&format!(".{name}(")))
            || line.contains(&format!("f64::{name}")) && !line.contains(&format!("f64::{name}_"))
    };
    LIBM.iter().filter(called).copied().collect()
}

#[test]
fn no_libm() {
    let mut faults = Vec::new();
    for (file, code) in sources() {
        for (number, line) in code.lines().enumerate() {
            for name in libm_calls(line) {
                faults.push(format!(
                    "{file}:{}: {name} differs by processor: {}",
                    number + 1,
                    line.trim()
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_readers_above_see_what_they_look_for() {
    let code =
        "use crate::{simd::{Isa, Wide}, rng};\nuse crate::Error;\nlet x = crate::threads::run();";
    let found = named("spectrum/folded.rs", code);
    let want: BTreeSet<String> = ["error", "rng", "simd", "threads"].map(String::from).into();
    assert_eq!(found, want);
    assert_eq!(named("math.rs", "use super::rng;").first().map(String::as_str), Some("rng"));
    assert_eq!(named("estimate/ml.rs", "use super::super::rng::fill;").len(), 1);
    assert!(named("estimate/ml.rs", "use super::design::Design;").is_empty());
    assert!(named("estimate/mod.rs", "use super::rng;").contains("rng"));
    let text = "a(\"unsafe\"); // unsafe\n#[cfg(test)]\nmod tests { unsafe }";
    assert!(!words(&shipped(text)).any(|w| w == "unsafe"));
    assert_eq!(libm_calls("let a = x.sin() + f64::exp(y) + z.powi(2);"), ["sin", "exp", "powi"]);
    assert!(libm_calls("math::ln::<L>(x); x.map(f64::sqrt); sin_cos_turns(x)").is_empty());
}
