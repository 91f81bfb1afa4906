//! What a caller prescribes by place and time: a body force beside that of the settings, and the velocity of surfaces that stay in place.

use crate::base::{Error, Result, Vector};
use crate::frame::Frame;
use crate::motion::MotionRule;
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;

/// A vector at each of the positions, in their order, at a time. The same for a position whatever the others are, if runs are to
/// be the same to the last bit.
pub type Rule<const D: usize> = Box<dyn FnMut(&[Vector<D>], f64) -> Result<Vec<Vector<D>>> + Send + Sync>;

/// The rules of a simulation, each asked once a step, at the positions of its derivatives and for the time in the middle of it.
#[derive(Default)]
pub struct Forcing<const D: usize> {
    /// Body force per unit mass, added to that of the settings.
    pub body_force: Option<Rule<D>>,
    /// Velocity of the surface above the solid particles of bodies that have none of their own.
    pub surface_velocity: Option<Rule<D>>,
    /// Poses of the bodies that move, and are not free.
    pub motion: Option<MotionRule>,
}

/// The body force per unit mass.
#[derive(Debug)]
pub struct BodyForce<const D: usize> {
    constant: Vector<D>,
    /// What a rule adds, real particles and images; empty without.
    field: Vec<Vector<D>>,
    /// Accelerations of solid particles, real ones; empty if none is accelerated.
    pub walls: Vec<Vector<D>>,
}

impl<const D: usize> BodyForce<D> {
    pub fn new(settings: &Settings) -> Self {
        Self { constant: Vector::from_column_slice(&settings.body_force), field: Vec::new(), walls: Vec::new() }
    }

    /// Acceleration of solid particle `i`.
    pub fn acceleration_of_wall(&self, i: usize) -> Vector<D> {
        self.walls.get(i).copied().unwrap_or_else(Vector::zeros)
    }

    /// The constant part.
    pub fn constant(&self) -> Vector<D> {
        self.constant
    }

    /// What a rule adds on particle `i`.
    pub fn varying(&self, i: usize) -> Vector<D> {
        self.field.get(i).copied().unwrap_or_else(Vector::zeros)
    }

    /// That on particle `i`.
    #[inline]
    pub fn at(&self, i: usize) -> Vector<D> {
        self.field.get(i).map_or(self.constant, |force| self.constant + force)
    }
}

impl<const D: usize> Forcing<D> {
    /// Ask the rules for the step whose middle is at `time`.
    pub fn apply(
        &mut self,
        settings: &Settings,
        particles: &mut Particles<D>,
        frame: &Frame<D>,
        force: &mut BodyForce<D>,
        time: f64,
    ) -> Result<()> {
        let position = &particles.position[..particles.real];
        if let Some(rule) = &mut self.body_force {
            let values = asked("body force", rule, position, time)?;
            frame.images.blank(&mut force.field, particles.len());
            frame.images.real(&mut force.field).copy_from_slice(&values);
            frame.images.fill(&mut force.field);
        } else {
            force.field.clear();
        }
        if let Some(rule) = &mut self.surface_velocity {
            let own = |i: &usize| {
                let body = &settings.bodies[particles.body[*i] as usize];
                body.velocity.is_none() && !body.moves
            };
            let solid = |i: &usize| particles.kind[*i] == ParticleKind::Solid;
            let solids: Vec<_> = (0..particles.real).filter(solid).filter(own).collect();
            // Of the surface above, not of the particle: one that turns is slower inside.
            let above = |&i: &usize| position[i] + particles.normal[i] * particles.depth[i];
            let position: Vec<_> = solids.iter().map(above).collect();
            let values = asked("surface velocity", rule, &position, time)?;
            let velocity = frame.images.real(&mut particles.velocity);
            solids.into_iter().zip(values).for_each(|(i, value)| velocity[i] = value);
            frame.images.fill(&mut particles.velocity);
        }
        Ok(())
    }
}

fn asked<const D: usize>(
    name: &'static str,
    rule: &mut Rule<D>,
    position: &[Vector<D>],
    time: f64,
) -> Result<Vec<Vector<D>>> {
    let values = rule(position, time)?;
    if values.len() != position.len() {
        return Err(Error::Array { name, problem: format!("{} rows for {} particles", values.len(), position.len()) });
    }
    let finite = |value: &Vector<D>| value.iter().all(|x| x.is_finite());
    match values.iter().position(|value| !finite(value)) {
        Some(k) => {
            let (value, place) = (values[k].as_slice(), position[k].as_slice());
            Err(Error::Array { name, problem: format!("is {value:?} at {place:?}, time {time:.6}; all must be finite") })
        }
        None => Ok(values),
    }
}
