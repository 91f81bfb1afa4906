//! The domain, its sides, and the bodies in it.

use serde::{Deserialize, Serialize};

/// What closes one side of the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Boundary {
    None,
    Slip,
    Periodic,
    Inlet,
    Outlet,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// [lower side, upper side] of each direction.
    pub boundaries: Vec<[Boundary; 2]>,
}

/// A solid body or wall: the solid particles with its index.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    pub name: String,
    /// Prescribed velocity.
    pub velocity: Vec<f64>,
    /// Whether the particles move with that velocity (a cavity's lid slides in place: false).
    pub moves: bool,
    /// Point that the torque is taken about. It stays where it is when the body moves.
    pub center: Vec<f64>,
}
