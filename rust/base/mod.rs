//! The words that everything else speaks: errors, vectors, lanes, parallel loops. They know nothing of particles.

mod algebra;
pub mod error;
pub mod lanes;
pub mod parallel;

pub use algebra::{Matrix, Vector};
pub use error::{Error, Result};
