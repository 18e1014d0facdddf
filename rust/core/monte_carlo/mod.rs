//! Monte Carlo studies: many replicates of one experiment, drawn, estimated and summed up in lanes.

mod coloured;
mod draw;
pub mod histogram;
pub mod moments;
mod plan;
mod run;
mod workspace;

pub use plan::{Contender, Draw, Group, Plan, Told};
pub use run::{Cell, Run};
