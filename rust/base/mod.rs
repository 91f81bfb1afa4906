//! The words that everything else speaks: errors, vectors, lanes, parallel loops. They know nothing of particles.

mod algebra;
pub mod error;
mod exact_sum;
pub mod lanes;
pub mod parallel;

pub use algebra::{Matrix, Tensor, Vector, symmetric_eigen};
pub use error::{Error, Result};
pub use exact_sum::{ExactSum, exact_sums};
