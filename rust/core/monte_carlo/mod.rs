//! Monte Carlo studies: many replicates of one experiment, summarised.

pub mod summary;
