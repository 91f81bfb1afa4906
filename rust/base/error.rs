//! The one error type of the crate. Every variant carries what a user needs to mend it.

use thiserror::Error;

#[derive(Debug, Error)]
pub enum Error {
    /// A setting cannot be used.
    #[error("setting `{name}`: {problem}")]
    Setting { name: String, problem: String },

    /// An array of the initial state cannot be used.
    #[error("array `{name}`: {problem}")]
    Array { name: &'static str, problem: String },

    /// A field lost its meaning. The simulation still holds the state before the failing step.
    #[error(
        "the solution diverged at step {step}, time {time:.6}: {field} of particle {particle} at {position:?} is {value}; {cause}"
    )]
    Diverged { step: u64, time: f64, particle: u64, position: Vec<f64>, field: &'static str, value: f64, cause: String },
}

pub type Result<T> = std::result::Result<T, Error>;

/// A setting that cannot be used, and why.
pub(crate) fn setting(name: impl Into<String>, problem: impl Into<String>) -> Error {
    Error::Setting { name: name.into(), problem: problem.into() }
}
