//! What can go wrong: the caller's mistakes (`Error`) and the outcome of one fit (`Status`).

use std::fmt;

/// A mistake of the caller, said in words that name the cure.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// The samples do not allow what was asked: shapes, lengths, values that are not finite.
    Data(String),
    /// What was asked is not a model, band or option that exists.
    Spec(String),
    /// A worker panicked: a defect of this library, never of the data.
    Internal(String),
    /// The caller asked to stop.
    Cancelled,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Data(text) | Error::Spec(text) | Error::Internal(text) => f.write_str(text),
            Error::Cancelled => f.write_str("cancelled"),
        }
    }
}

impl std::error::Error for Error {}

/// The outcome of one fit; a failed fit is data, not an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Status {
    /// The estimate is the minimiser asked for.
    #[default]
    Ok = 0,
    /// The iteration did not settle within `maxiter`.
    MaxIter = 1,
    /// The regressors do not determine the parameters.
    Rank = 2,
    /// Samples or numbers on the way are not finite.
    NonFinite = 3,
}

impl Status {
    /// All outcomes, in the order of their codes.
    pub const ALL: [Status; 4] = [Status::Ok, Status::MaxIter, Status::Rank, Status::NonFinite];

    /// The name users see.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Status::Ok => "ok",
            Status::MaxIter => "maxiter",
            Status::Rank => "rank",
            Status::NonFinite => "nonfinite",
        }
    }
}
