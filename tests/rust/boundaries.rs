//! What may import what: the table of docs/architecture.md, held by reading the core's sources as text.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet};
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
    ("line_tests", &["math", "spectrum"]),
    ("noise_level", &["error", "math", "quadrature", "simd", "spectrum"]),
    ("modulation", &["error", "spectrum", "structure"]),
    ("covariance", &["error", "simd", "spectrum"]),
    ("model", &["error", "linalg", "math"]),
    ("simulate", &["error", "model", "quadrature", "simd", "threads"]),
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
    ("log", &["tape.rs", "tones/awls.rs"], "the core does not log; there it is the logarithm"),
    ("faer", &[], "its instances are compiled in rust/dense, once"),
    (
        "modfun_dense",
        &["integrate/implicit.rs", "linalg/large.rs"],
        "factors of one system; many systems go in lanes",
    ),
    ("modfun_fft", &["spectrum.rs", "spectrum/padded.rs"], "transforms live in spectrum"),
    ("realfft", &[], "its instances are compiled in rust/fft, once"),
    ("rustfft", &[], "its instances are compiled in rust/fft, once"),
    ("rayon", &[], "no thread pool"),
    ("thread", &["threads.rs"], "threads are started in threads.rs"),
    ("thread_local", &["threads.rs"], "no hidden state"),
    ("unsafe", &["simd.rs", "simd/neon.rs", "simd/x86.rs"], "unsafe code lives in simd"),
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

/// A path from the root of the crate: `estimate::joint::Answer`.
type Place = Vec<String>;

/// What a file names: places, and its own re-exports with the places behind them.
#[derive(Default)]
struct Named {
    places: BTreeSet<Place>,
    doors: BTreeMap<String, Place>,
}

/// The module that a file is; none of `lib.rs`.
fn place(file: &str) -> Place {
    let path = file.trim_end_matches(".rs");
    let path = path.strip_suffix("/mod").unwrap_or(if path == "lib" { "" } else { path });
    path.split('/').filter(|part| !part.is_empty()).map(String::from).collect()
}

/// The paths of a `use`, groups written out, without `as`.
fn written_out(path: &str) -> Vec<String> {
    let Some((before, group)) = path.split_once('{') else {
        return vec![path.split(" as ").next().unwrap_or_default().trim().into()];
    };
    let (mut all, mut item, mut level) = (Vec::new(), String::new(), 0);
    for c in group.chars() {
        match c {
            '}' if level == 0 => break,
            ',' if level == 0 => all.push(std::mem::take(&mut item)),
            _ => {
                level += i32::from(c == '{') - i32::from(c == '}');
                item.push(c);
            }
        }
    }
    all.push(item);
    let each = all.iter().filter(|item| !item.trim().is_empty());
    each.flat_map(|item| written_out(&format!("{}{}", before.trim(), item.trim()))).collect()
}

/// A path as written in a module, from the root; `None` for one that begins in none of the crate's modules.
fn rooted(path: &str, module: &Place, modules: &BTreeSet<Place>) -> Option<Place> {
    let mut parts = path.split("::").map(str::trim).filter(|part| !part.is_empty()).peekable();
    let mut from = module.clone();
    match parts.peek()? {
        &"crate" => from.clear(),
        &"self" | &"super" => {}
        child => {
            let own: Place = from.iter().cloned().chain([(*child).into()]).collect();
            if !modules.contains(&own) {
                return None;
            }
        }
    }
    for part in parts {
        match part {
            "crate" | "self" => {}
            "super" => drop(from.pop()),
            _ => from.push(part.into()),
        }
    }
    Some(from)
}

/// Everything that the code of a module names in the crate.
fn all_named(code: &str, module: &Place, modules: &BTreeSet<Place>) -> Named {
    let mut found = Named::default();
    // `pub(in path)` names no item.
    let mut pieces = code.split("pub(in ");
    let mut open = pieces.next().unwrap_or_default().to_string();
    pieces.for_each(|piece| open += &format!("pub({}", piece.split_once(')').map_or("", |p| p.1)));
    let mut rest = String::new();
    for statement in open.split_inclusive(';') {
        let begins =
            |at: &usize| !statement[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let Some(at) = statement.match_indices("use ").map(|(at, _)| at).find(begins) else {
            rest.push_str(statement);
            continue;
        };
        let before = statement[..at].trim_end();
        let public = before.ends_with("pub")
            || before.rsplit_once("pub(").is_some_and(|(_, p)| p.ends_with(')'));
        rest.push_str(before);
        for path in written_out(&statement[at + 4..].trim_end_matches(';').replace('\n', " ")) {
            let Some(place) = rooted(&path, module, modules) else { continue };
            match (public, place.last()) {
                (true, Some(name)) => drop(found.doors.insert(name.clone(), place)),
                _ => drop(found.places.insert(place)),
            }
        }
    }
    let tokens = rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
    let paths = tokens.map(|t| t.trim_matches(':')).filter(|t| t.contains("::"));
    found.places.extend(paths.filter_map(|path| rooted(path, module, modules)));
    found
}

/// Circles of files of which each names the next.
///
/// A file names the file that defines an item, through whatever re-exports. Re-exports and declarations of
/// modules are doors and count for nothing, so that a `mod.rs` may name its children; children may not name what
/// is defined in their `mod.rs` if that names them in turn. A file x.rs beside a folder x/ is the head of parts that
/// were moved out of it for their length: they may name it, and it may name them.
fn circles(sources: &[(String, String)]) -> Vec<String> {
    let modules: BTreeSet<Place> = sources.iter().map(|(file, _)| place(file)).collect();
    let named: BTreeMap<Place, Named> = sources
        .iter()
        .map(|(file, code)| (place(file), all_named(code, &place(file), &modules)))
        .collect();
    let defined_in = |path: &Place| -> Place {
        let mut path = path.clone();
        for _ in 0..8 {
            let depth = (0..=path.len()).rev().find(|d| modules.contains(&path[..*d]));
            let (module, inside) = path.split_at(depth.unwrap_or(0));
            let door = inside.first().and_then(|item| named.get(module)?.doors.get(item));
            match door {
                Some(behind) => path = behind.iter().chain(&inside[1..]).cloned().collect(),
                None => return module.to_vec(),
            }
        }
        Vec::new()
    };
    let files: BTreeMap<Place, &String> = sources.iter().map(|(f, _)| (place(f), f)).collect();
    let edges: BTreeMap<&Place, BTreeSet<Place>> = named
        .iter()
        .map(|(module, named)| {
            let head = |to: &Place| {
                module.len() == to.len() + 1
                    && module.starts_with(to)
                    && !files[to].ends_with("mod.rs")
            };
            let all = named.places.iter().map(&defined_in);
            (module, all.filter(|to| to != module && !to.is_empty() && !head(to)).collect())
        })
        .collect();
    fn visit<'a>(
        at: &'a Place,
        edges: &'a BTreeMap<&Place, BTreeSet<Place>>,
        way: &mut Vec<&'a Place>,
        done: &mut BTreeSet<&'a Place>,
        found: &mut Vec<Vec<Place>>,
    ) {
        if let Some(from) = way.iter().position(|seen| *seen == at) {
            found.push(way[from..].iter().map(|p| (*p).clone()).collect());
        } else if !done.contains(at) {
            way.push(at);
            edges[at].iter().for_each(|to| visit(to, edges, way, done, found));
            done.extend(way.pop());
        }
    }
    let (mut done, mut found) = (BTreeSet::new(), Vec::new());
    edges.keys().for_each(|at| visit(at, &edges, &mut Vec::new(), &mut done, &mut found));
    let line = |circle: &Vec<Place>| {
        let names = circle.iter().chain(circle.first());
        names.map(|place| files[place].as_str()).collect::<Vec<_>>().join(" -> ")
    };
    found.iter().map(line).collect()
}

#[test]
fn no_circle_of_files() {
    let found = circles(&sources());
    assert!(found.is_empty(), "files that name each other in a circle:\n{}", found.join("\n"));
}

#[test]
fn circles_are_seen_through_doors_groups_and_paths() {
    let of = |files: &[(&str, &str)]| {
        let own = |(file, code): &(&str, &str)| ((*file).to_string(), (*code).to_string());
        circles(&files.iter().map(own).collect::<Vec<_>>())
    };
    let door = ("m/mod.rs", "mod a;\nmod b;\npub use a::A;\npub(crate) use b::{B, b};");
    let a = ("m/a.rs", "use crate::m::B;\npub struct A;");
    let b = ("m/b.rs", "pub struct B;\nfn b() { super::a::f::<u8>() }");
    assert_eq!(of(&[door, a, b]), ["m/a.rs -> m/b.rs -> m/a.rs"]);
    assert!(of(&[door, a, ("m/b.rs", "pub struct B;")]).is_empty());
    let grouped = ("m/b.rs", "use crate::{\n    c,\n    m::{a::A as Other, x::Y},\n};");
    assert_eq!(of(&[door, a, grouped]).len(), 1);
    // What is defined in a mod.rs is no child's if the mod.rs names the child.
    let own = ("m/mod.rs", "mod a;\nuse a::A;\npub struct B;");
    assert_eq!(of(&[own, a]), ["m/mod.rs -> m/a.rs -> m/mod.rs"]);
    // Parts and their head.
    let head = ("m.rs", "mod a;\nmod b;\nuse a::A;\npub struct B;");
    assert!(of(&[head, a]).is_empty());
    let other = ("m/b.rs", "use super::a::A;");
    let both = ("m/a.rs", "pub(in crate::m) struct A;\nfn f() { crate::m::b::g() }");
    assert_eq!(of(&[head, both, other]), ["m/a.rs -> m/b.rs -> m/a.rs"]);
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
