//! Boundaries: open buffers and solid walls.

mod open;
mod profile;
mod solid;

pub use open::{MassFlow, deep_in_inlet, end_step};
pub use profile::surface_area;
pub use solid::{Walls, extrapolate, extrapolate_pressure};
