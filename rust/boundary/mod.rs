//! Boundaries: images across slip walls and periodic sides, open buffers, solid walls.

mod images;
mod open;
mod solid;

pub use images::Images;
pub use open::{MassFlow, end_step, inlet_depth};
pub use solid::{Walls, shepard};
