//! Time integration schemes.

mod alsph;
mod projection;

pub use alsph::{Alsph, Derived, Outcome, Step};
pub use projection::relaxation;
