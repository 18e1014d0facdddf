//! An oracle: the formulas of docs/core.md written out a second time, in plain loops and dense algebra, held to all
//! five estimators. It shares no code with the core beyond the types of its calls.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::disallowed_methods)]

#[path = "oracle/batch.rs"]
mod batch;
#[path = "oracle/delays.rs"]
mod delays;
#[path = "oracle/dense.rs"]
mod dense;
#[path = "oracle/driven.rs"]
mod driven;
#[path = "common/duffing.rs"]
mod duffing;
#[path = "oracle/fast.rs"]
mod fast;
#[path = "oracle/joint.rs"]
mod joint;
#[path = "oracle/linear.rs"]
mod linear;
#[path = "oracle/record.rs"]
mod record;
#[path = "oracle/response.rs"]
mod response;
#[path = "oracle/sampled.rs"]
mod sampled;
#[path = "oracle/signals.rs"]
mod signals;
#[path = "oracle/study.rs"]
mod study;
#[path = "oracle/terms.rs"]
mod terms;
#[path = "oracle/tones.rs"]
mod tones;
#[path = "oracle/weights.rs"]
mod weights;
