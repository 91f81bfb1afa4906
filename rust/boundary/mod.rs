//! Boundaries: what particles obey, open buffers and solid walls.

mod average;
mod condition;
mod open;
mod profile;
mod solid;

pub use average::{extrapolate_pressure, extrapolate_scalar, extrapolate_vector};
pub use condition::{Condition, PressureRule, VelocityRule, conditions};
pub use open::{MassFlow, end_step};
pub use profile::surface_area;
pub use solid::Walls;
