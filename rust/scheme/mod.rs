//! Time integration schemes.

mod alsph;
mod projection;

pub use alsph::{Alsph, Outcome, Step};
pub use projection::relaxation;
