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
    /// Point that the torque is taken about, and that a rigid body turns about; a body with a `velocity` leaves it where it is.
    pub center: Vec<f64>,
    /// What a body is that the fluid moves. One that moves with neither this nor a `velocity` is moved by a rule.
    #[serde(default)]
    pub rigid: Option<Rigid>,
}

/// A rigid body that moves freely. Vectors have one entry a direction.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rigid {
    pub mass: f64,
    /// Moment of inertia about the centre of mass, which is the body's `center`; in 3-D the nine entries of the tensor.
    pub inertia: Vec<f64>,
    /// A constant force beside the fluid's and the body force.
    pub force: Vec<f64>,
    /// Of springs and dampers to where the body was at the start.
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
    /// Along which directions, and then about which axes (one in 2-D), it can move.
    pub free: Vec<bool>,
    /// About what the fluid that it drags along adds to mass and inertia; no result depends on it where the motion is smooth.
    pub added_mass: f64,
    pub added_inertia: f64,
}

impl Body {
    /// Whether it moves as a rigid body, by a rule or freely.
    pub fn is_rigid(&self) -> bool {
        self.moves && self.velocity.is_none()
    }
}

impl Rigid {
    fn validate(&self, name: &str, dimensions: usize) -> Result<()> {
        let refuse = |key: &str, problem: &str| Err(setting(format!("bodies.{name}.rigid.{key}"), problem));
        let turns = if dimensions == 2 { 1 } else { 3 };
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !positive(self.mass) {
            return refuse("mass", "must be a positive number");
        }
        if self.inertia.len() != turns * turns || !(0..turns).all(|k| positive(self.inertia[k * turns + k])) {
            return refuse("inertia", "must be a positive number in 2-D, the nine of a tensor in 3-D");
        }
        let tensor = nalgebra::DMatrix::from_row_slice(turns, turns, &self.inertia);
        if tensor != tensor.transpose() || tensor.cholesky().is_none() {
            return refuse("inertia", "must be a symmetric tensor with positive principal moments");
        }
        if self.free.len() != dimensions + turns {
            return refuse("free", "must say of each direction and axis whether the body can move so");
        }
        if !self.free.contains(&true) {
            return refuse("free", "must leave it a direction or an axis; a body that cannot move is not rigid");
        }
        for (key, value) in [("added_mass", self.added_mass), ("added_inertia", self.added_inertia)] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(key, "must be a number not below zero");
            }
        }
        for (key, vector) in [("force", &self.force), ("stiffness", &self.stiffness), ("damping", &self.damping)] {
            validate_vector(&format!("bodies.{name}.rigid.{key}"), vector, dimensions)?;
            if key != "force" && vector.iter().any(|&value| value < 0.0) {
                return refuse(key, "must not be negative");
            }
        }
        Ok(())
    }
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
        if let Some(velocity) = &body.velocity {
            validate_vector(&format!("bodies.{}.velocity", body.name), velocity, dimensions)?;
        }
        validate_vector(&format!("bodies.{}.center", body.name), &body.center, dimensions)?;
        if let Some(rigid) = &body.rigid {
            if !body.is_rigid() {
                return Err(setting(format!("bodies.{}.rigid", body.name), "needs a body that moves, and no velocity"));
            }
            rigid.validate(&body.name, dimensions)?;
        }
        if body.belt.is_some_and(|[from, to]| {
            !(body.velocity.is_some() && body.moves && from.is_finite() && to.is_finite() && from < to)
        }) {
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
