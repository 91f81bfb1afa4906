//! Copies of particles beyond slip walls and periodic sides.

mod images;
mod poison;

pub use images::{Images, Mirrored};
pub use poison::Poison;
