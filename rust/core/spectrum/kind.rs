//! How the samples of a channel stand for a signal: smooth, or held between them.

use crate::Error;
use crate::quadrature::{Hold, Rule};

/// How the samples of a channel stand for a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Smooth: a quadrature rule.
    Rule(Rule),
    /// Held between the samples: exact coefficients.
    Hold(Hold),
}

impl Kind {
    /// All kinds, rules first.
    pub const ALL: [Kind; 6] = [
        Kind::Rule(Rule::Staircase),
        Kind::Rule(Rule::Trapezoid),
        Kind::Rule(Rule::Parabolic),
        Kind::Rule(Rule::Gregory),
        Kind::Hold(Hold::Zoh),
        Kind::Hold(Hold::Foh),
    ];

    /// The name users see.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Kind::Rule(rule) => rule.name(),
            Kind::Hold(hold) => hold.name(),
        }
    }

    /// The kind of that name.
    ///
    /// # Errors
    /// [`Error::Spec`] with the list of names.
    pub fn from_name(name: &str) -> Result<Kind, Error> {
        Kind::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
            let names: Vec<_> =
                Kind::ALL.iter().map(|kind| format!("\"{}\"", kind.name())).collect();
            Error::Spec(format!(
                "there is no quadrature rule or hold \"{name}\"; use one of {}",
                names.join(", ")
            ))
        })
    }
}
