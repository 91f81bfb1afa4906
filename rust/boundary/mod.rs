//! Boundaries: images across slip walls and periodic sides, open buffers, solid walls.

mod images;
mod open;
mod poison;
mod profile;
mod solid;

pub use images::Images;
pub use open::{MassFlow, deep_in_inlet, end_step};
pub use poison::Poison;
pub use profile::surface_area;
pub use solid::{Walls, extrapolate};
