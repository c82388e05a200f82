//! The one error type of the crate, which depends on no other module.

use std::fmt;

/// What can go wrong with input. "No plan found" is not an error: it is a status in `Plans`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Error {
    /// An argument or a datum is impossible: the text names it and the expected values.
    InvalidInput(String),
    /// A setting has an impossible value.
    Setting {
        /// Its dotted name.
        name: String,
        /// What is expected of it.
        message: String,
    },
    /// The road network does not connect a start with a goal.
    NoRoute(String),
    /// `Scene`, `Predictions` or `Plans` belong to another time step than the world's.
    WrongTimeStep {
        /// What was handed over ("predictions", "plans").
        what: &'static str,
        /// The world's time step.
        expected: i64,
        /// The time step of what was handed over.
        found: i64,
    },
    /// No participant, lanelet or agent has this id.
    UnknownId {
        /// Kind of thing looked up ("lanelet", "agent", ...).
        what: &'static str,
        /// The id.
        id: i64,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidInput(message) | Self::NoRoute(message) => f.write_str(message),
            Self::Setting { name, message } => write!(f, "{name} {message}"),
            Self::WrongTimeStep { what, expected, found } => {
                write!(f, "{what} belong to time step {found}, the world is at time step {expected}")
            }
            Self::UnknownId { what, id } => write!(f, "there is no {what} with id {id}"),
        }
    }
}

impl std::error::Error for Error {}

/// Result with the crate's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// `InvalidInput` from anything that can be shown.
    pub fn invalid(message: impl Into<String>) -> Self {
        Self::InvalidInput(message.into())
    }
}
