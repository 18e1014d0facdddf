//! Monte Carlo studies: many replicates of one experiment, drawn, estimated and summarised in lanes.

mod plan;
mod run;
pub mod summary;

pub use plan::{Draw, Group};
pub use run::{Cell, Intervals, Plan, Run, Samples};
