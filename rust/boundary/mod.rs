//! Boundaries: what particles obey, open buffers and solid walls.

mod average;
mod condition;
mod flux;
mod open;
mod outlet;
mod profile;
mod side;
mod solid;

pub use average::{
    extend_pressure, extrapolate_pressure, extrapolate_scalar, extrapolate_vector, for_each_weighted, shepard,
};
pub use condition::{Condition, PressureRule, VelocityRule, conditions};
pub use flux::add_wall_flux;
pub use open::{MassFlow, end_step};
pub use profile::surface_area;
pub use solid::Walls;
