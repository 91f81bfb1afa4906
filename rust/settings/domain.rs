//! The domain, its sides, and the bodies in it.

use crate::base::error::{Result, setting};
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
    /// Open to the air beyond a free surface: fluid that crosses it is lost.
    Air,
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
    /// Prescribed velocity; if null, that of the particles, which a rule may prescribe, of a body that does not move.
    pub velocity: Option<Vec<f64>>,
    /// Whether the particles move with that velocity.
    pub moves: bool,
    /// Where the particles of a body that moves go round, from and to, coordinates along its velocity: those that pass the end come back at
    /// the beginning, as on a belt.
    #[serde(default)]
    pub belt: Option<[f64; 2]>,
    /// Point that the torque is taken about. It stays where it is when the body moves.
    pub center: Vec<f64>,
}

impl Domain {
    /// Refuse one that is no box of `dimensions`, or whose sides do not leave room for a kernel of `support_radius`.
    pub(super) fn validate(&self, dimensions: usize, support_radius: f64) -> Result<()> {
        let Self { lower, upper, boundaries } = self;
        validate_vector("domain.lower", lower, dimensions)?;
        validate_vector("domain.upper", upper, dimensions)?;
        if boundaries.len() != dimensions {
            return Err(setting("domain.boundaries", format!("must have {dimensions} pairs, one a direction")));
        }
        for (axis, pair) in boundaries.iter().enumerate() {
            if upper[axis] - lower[axis] < support_radius {
                let problem = format!("direction {axis} is shorter than the support radius {support_radius}");
                return Err(setting("domain", problem));
            }
            if (pair[0] == Boundary::Periodic) != (pair[1] == Boundary::Periodic) {
                return Err(setting("domain.boundaries", format!("direction {axis} is periodic on one side only")));
            }
        }
        Ok(())
    }
}

/// Refuse bodies that have the same name, or vectors that are not of `dimensions`.
pub(super) fn validate_bodies(bodies: &[Body], dimensions: usize) -> Result<()> {
    for (k, body) in bodies.iter().enumerate() {
        if bodies[..k].iter().any(|other| other.name == body.name) {
            return Err(setting("bodies", format!("two are named \"{}\"; names must differ", body.name)));
        }
        let name = format!("bodies.{}.velocity", body.name);
        match &body.velocity {
            Some(velocity) => validate_vector(&name, velocity, dimensions)?,
            None if body.moves => return Err(setting(name, "must be given for a body that moves")),
            None => {}
        }
        validate_vector(&format!("bodies.{}.center", body.name), &body.center, dimensions)?;
        if body.belt.is_some_and(|[from, to]| !(body.moves && from.is_finite() && to.is_finite() && from < to)) {
            return Err(setting(
                format!("bodies.{}.belt", body.name),
                "must be two numbers, the lower one first, of a body that moves",
            ));
        }
    }
    Ok(())
}

pub(super) fn validate_vector(name: &str, vector: &[f64], dimensions: usize) -> Result<()> {
    if vector.len() != dimensions || !vector.iter().all(|x| x.is_finite()) {
        return Err(setting(name, format!("must be {dimensions} finite numbers, not {vector:?}")));
    }
    Ok(())
}
