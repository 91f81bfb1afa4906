//! Time integration schemes.

mod alsph;

pub use alsph::{Alsph, Outcome, Step};
