//! The exceptions of the engine.

use crate::base::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

create_exception!(
    _alsph,
    SolverError,
    PyRuntimeError,
    "The computation broke down; args[0] names step, time, particle, position and field."
);
create_exception!(
    _alsph,
    ConfigError,
    PyValueError,
    "The settings or the arrays cannot be used; args[0] says what, where and how to mend it."
);

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Diverged { .. } => SolverError::new_err(error.to_string()),
            Error::Setting { .. } | Error::Array { .. } => ConfigError::new_err(error.to_string()),
        }
    }
}

pub(super) fn array_error(name: &'static str, problem: impl Into<String>) -> PyErr {
    Error::Array { name, problem: problem.into() }.into()
}
