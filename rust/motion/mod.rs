//! Bodies that move as rigid ones: as a rule tells, or as the fluid and other forces make them.
//!
//! The particles of such a body are always its shape, turned and displaced, so that it keeps its form however far it goes. The shape is not
//! kept from run to run: its coordinates are multiples of a length so small that it does not matter, and so much larger than rounding that
//! the positions at any time tell it to the last bit ([`GRAIN`]).
//!
//! A step takes derivatives where the body is in its frame, and makes the velocity u^{n+1} free of divergence, so solids
//! show that of the body at the end of the step.
//!
//! A free body obeys M dV/dt = F, F being what acts at the end of a step. With F of the step before, a light body would swing up, because
//! the fluid answers. What it answers within the step is therefore taken for granted. Where a Poisson equation is solved that
//! is the acceleration of the mass that the body drags along, M_a; with an estimate M̂ of it
//!
//! ```text
//! (M + M̂) A^{n+1} = F^n + M̂ A^n,
//! ```
//!
//! and an error of A falls by |M̂ − M_a|/(M + M̂) a step. Where the pressure travels as waves of a speed c, as in the other schemes, a surface S
//! that changes its velocity feels −ρ c S of that at once, and the rest comes with the waves; with an acceleration Ā that follows A slowly,
//! and goes on as A changes, so that it makes no difference to smooth motion (one that lags behind would add energy to what swings),
//!
//! ```text
//! (M + ρ c S Δt) A^{n+1} = F^n + ρ c S Δt Ā^n.
//! ```
//!
//! Likewise rotation. Where c is given, as in weakly compressible schemes, M A^{n+1} = F^n does with ρ c S Δt < M/2.

mod contact;
mod limits;
mod pose;

pub use pose::{Following, NUMBERS, Pose};

use crate::base::Vector;
use crate::base::error::{Error, Result, setting};
use crate::particles::{ParticleKind, Particles};
use crate::settings::{Body, Boundary, Rigid, Settings};
use nalgebra::{Rotation3, Vector3};
use pose::FOLLOWING;

/// Coordinates in a body's own axes are multiples of this part of Δx, normals of this number.
const GRAIN: f64 = 1.0 / (1u64 << 30) as f64;

/// Solids less deep than this [Δx] lie under the surface.
const LAYER: f64 = 0.75;

/// How far [Δx] from where its velocity takes it a particle of a body may be that a rule moves: if that velocity is the same before and
/// after, and at most.
const JUMP: [f64; 2] = [0.05, 0.5];

/// The poses of all bodies that a rule moves, in their order, at a time.
pub type MotionRule = Box<dyn FnMut(f64) -> Result<Vec<Pose>> + Send + Sync>;

/// A time of the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    Start,
    /// When its frame is.
    Frame,
    End,
}

/// All rigid bodies that move.
#[derive(Debug)]
pub struct Motion<const D: usize> {
    bodies: Vec<Moving<D>>,
    /// Of the settings' bodies, where in `bodies` each is.
    place_of: Vec<Option<usize>>,
    /// Of the solids in these bodies, by id. Empty until the first step.
    shape: Vec<Shape<D>>,
    /// Index of the particle, and of its shape, as they are stored now.
    members: Vec<(usize, usize)>,
    /// Lengths of the domain's periodic directions; zero of others.
    period: Vector<D>,
    spacing: f64,
}

#[derive(Debug)]
struct Moving<const D: usize> {
    body: u16,
    center: Vector<D>,
    /// Of a free body.
    rigid: Option<Rigid>,
    start: Pose,
    frame: Pose,
    end: Pose,
    /// How far its particles are from its centre.
    radius: f64,
    /// Whether a slip wall across each axis cuts it.
    is_cut: [bool; D],
    /// The body force of the step, if it is free.
    body_force: Vector3<f64>,
    /// The fluid's mass in the layer Δx over its surface, and the moment of inertia of that for what pushes it as the body turns.
    layer: f64,
    layer_inertia: f64,
}

/// Place and normal of a solid particle in the axes of its body.
#[derive(Clone, Copy, Debug)]
struct Shape<const D: usize> {
    id: u64,
    body: usize,
    arm: Vector<D>,
    normal: Vector<D>,
    /// The surface above it, whose velocity it has.
    surface: Vector<D>,
    /// Whether it lies under the surface.
    outer: bool,
}

impl<const D: usize> Default for Motion<D> {
    fn default() -> Self {
        let (bodies, place_of, shape, members) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { bodies, place_of, shape, members, period: Vector::zeros(), spacing: 0.0 }
    }
}

impl<const D: usize> Motion<D> {
    pub fn new(settings: &Settings) -> Self {
        let mut motion = Self { spacing: settings.particle_spacing, ..Self::default() };
        for (index, body) in settings.bodies.iter().enumerate() {
            let moving = body.is_rigid();
            motion.place_of.push(moving.then_some(motion.bodies.len()));
            if moving {
                motion.bodies.push(Moving {
                    body: index as u16,
                    center: Vector::from_column_slice(&body.center),
                    rigid: body.rigid.clone(),
                    start: Pose::default(),
                    frame: Pose::default(),
                    end: Pose::default(),
                    radius: 0.0,
                    is_cut: [false; D],
                    body_force: Vector3::zeros(),
                    layer: 0.0,
                    layer_inertia: 0.0,
                });
            }
        }
        let domain = &settings.domain;
        let periodic = |axis: usize| domain.boundaries[axis][0] == Boundary::Periodic;
        motion.period =
            Vector::from_fn(|axis, _| if periodic(axis) { domain.upper[axis] - domain.lower[axis] } else { 0.0 });
        motion
    }

    pub fn is_none(&self) -> bool {
        self.bodies.is_empty()
    }

    /// How many bodies a rule has to move.
    pub fn told(&self) -> usize {
        self.bodies.iter().filter(|body| body.rigid.is_none()).count()
    }

    /// The pose of each of the settings' bodies at the end of the last step; of those that do not move so, none.
    pub fn poses(&self) -> Vec<Pose> {
        self.place_of.iter().map(|place| place.map_or_else(Pose::default, |place| self.bodies[place].start)).collect()
    }

    /// Go on with free bodies in such `poses`, one for each of the settings' bodies.
    pub fn set_poses(&mut self, poses: &[Pose]) {
        self.bodies.iter_mut().for_each(|body| body.start = poses[body.body as usize]);
    }

    /// Be ready for a step at `time`: the first time, take the shape of the bodies from the particles, and give these their velocities. In the
    /// first step of all, free bodies have no acceleration yet.
    pub fn start(
        &mut self,
        settings: &Settings,
        particles: &mut Particles<D>,
        rule: &mut Option<MotionRule>,
        time: f64,
        is_first: bool,
    ) -> Result<()> {
        if self.is_none() || !self.shape.is_empty() {
            return Ok(());
        }
        self.tell(rule, time, Moment::Start)?;
        let grain = GRAIN * settings.particle_spacing;
        for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
            let Some(body) = self.place_of[particles.body[i] as usize] else { continue };
            let Moving { center, start, radius, is_cut, .. } = &mut self.bodies[body];
            contact::note_cuts(settings, &particles.position[i], particles.depth[i], is_cut);
            let arm = particles.position[i] - (*center + Vector::from_fn(|k, _| start.displacement[k]));
            let arm = arm - self.period.zip_map(&arm, whole_periods);
            let back = |v: &Vector<D>, grain: f64| turned(&-start.angle, v).map(|x| (x / grain).round() * grain);
            *radius = radius.max(arm.norm());
            // Not of unit length to the last bit: that could be nearer to other multiples.
            let normal = back(&particles.normal[i], GRAIN);
            let (arm, outer) = (back(&arm, grain), particles.depth[i] < LAYER * settings.particle_spacing);
            let surface = arm + normal * particles.depth[i];
            self.shape.push(Shape { id: particles.id[i], body, arm, normal, surface, outer });
        }
        self.shape.sort_unstable_by_key(|shape| shape.id);
        let mass = settings.density * settings.particle_spacing.powi(D as i32);
        for shape in self.shape.iter().filter(|shape| shape.outer) {
            let body = &mut self.bodies[shape.body];
            body.layer += mass;
            body.layer_inertia += mass * spatial(&shape.arm).cross(&spatial(&shape.normal)).norm_squared();
        }
        // A fluid at rest that has no pressure yet answers to the first acceleration with the mass that it takes along.
        let begins = is_first && particles.pressure[..particles.real].iter().all(|&p| p == 0.0);
        for body in &mut self.bodies {
            if let Some(rigid) = body.rigid.as_ref().filter(|_| begins) {
                let at_once = [rigid.added_mass, rigid.added_inertia];
                let constant = Vector3::from_fn(|k, _| settings.body_force.get(k).copied().unwrap_or(0.0));
                body.start.respond::<D>(rigid, at_once, [constant * rigid.mass, Vector3::zeros()], 0.0);
                body.start.follow(1.0);
            }
            (body.frame, body.end) = (body.start, body.start);
        }
        self.locate(particles);
        self.place(Moment::Start, &mut particles.position, &mut particles.normal);
        self.give_velocity(&mut particles.velocity);
        Ok(())
    }

    /// Find where the bodies will be after `time_step`, and after the `fraction` of it at which the frame is.
    pub fn advance(&mut self, rule: &mut Option<MotionRule>, time: f64, time_step: f64, fraction: f64) -> Result<()> {
        if self.is_none() {
            return Ok(());
        }
        for body in self.bodies.iter_mut().filter(|body| body.rigid.is_some()) {
            body.frame = body.start.after::<D>(fraction * time_step);
            body.end = body.start.after::<D>(time_step);
        }
        self.tell(rule, time + fraction * time_step, Moment::Frame)?;
        self.tell(rule, time + time_step, Moment::End)?;
        for body in self.bodies.iter().filter(|body| body.rigid.is_none()) {
            let Moving { start, end, radius, .. } = body;
            let moves = (end.displacement - start.displacement, start.velocity, end.velocity, "comes", 1.0);
            let turns = (end.turned_since::<D>(start), start.spin, end.spin, "turns", *radius);
            for (way, before, after, what, arm) in [moves, turns] {
                let beside = (way - (before + after) * (0.5 * time_step)).norm();
                // Where the velocity changes at once, within the step, as much as this is no jump.
                let kink = 0.5 * (after - before).norm() * time_step;
                let [least, most] = JUMP.map(|jump| jump * self.spacing);
                if beside * arm > (least + 1.1 * kink * arm).min(most) {
                    let problem =
                        format!("jumps at time {time:.6}: a body {what} {beside:.3} beside what its velocity says");
                    return Err(Error::Array { name: "motion", problem });
                }
            }
        }
        Ok(())
    }

    /// Ask the rule where the bodies are that it moves.
    fn tell(&mut self, rule: &mut Option<MotionRule>, time: f64, moment: Moment) -> Result<()> {
        let told = self.told();
        if told == 0 {
            return Ok(());
        }
        let Some(rule) = rule else {
            return Err(setting("bodies", "one moves, is not free, and has neither a velocity nor a rule for its motion"));
        };
        let poses = rule(time)?;
        if poses.len() != told {
            let problem = format!("is of {} bodies, where {told} are moved by it", poses.len());
            return Err(Error::Array { name: "motion", problem });
        }
        if !poses.iter().flat_map(Pose::numbers).all(f64::is_finite) {
            let problem = format!("at time {time:.6} is not finite");
            return Err(Error::Array { name: "motion", problem });
        }
        let bodies = self.bodies.iter_mut().filter(|body| body.rigid.is_none());
        for (body, pose) in bodies.zip(poses) {
            *body.pose_mut(moment) = pose;
        }
        Ok(())
    }

    /// Find the particles of the bodies, in the order in which they are stored.
    pub fn locate(&mut self, particles: &Particles<D>) {
        self.members.clear();
        if self.shape.is_empty() {
            return;
        }
        for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
            if self.place_of[particles.body[i] as usize].is_some()
                && let Ok(shape) = self.shape.binary_search_by_key(&particles.id[i], |shape| shape.id)
            {
                self.members.push((i, shape));
            }
        }
    }

    /// Put the particles where they are at a moment of the step.
    pub fn place(&self, moment: Moment, position: &mut [Vector<D>], normal: &mut [Vector<D>]) {
        let turn: Vec<_> = self.bodies.iter().map(|body| Rotation3::from_scaled_axis(body.pose(moment).angle)).collect();
        for &(i, shape) in &self.members {
            let Shape { body, arm, normal: outward, .. } = &self.shape[shape];
            let Moving { center, .. } = &self.bodies[*body];
            let displacement = self.bodies[*body].pose(moment).displacement;
            let there = *center + Vector::from_fn(|k, _| displacement[k]) + rotated(&turn[*body], arm);
            position[i] = there + self.period.zip_map(&(position[i] - there), whole_periods);
            normal[i] = rotated(&turn[*body], outward);
        }
    }

    /// Give them the velocities that the surface above them has at the end of the step.
    pub fn give_velocity(&self, velocity: &mut [Vector<D>]) {
        for &(i, shape) in &self.members {
            let Shape { body, surface, .. } = &self.shape[shape];
            let Pose { angle, velocity: speed, spin, .. } = self.bodies[*body].end;
            let arm = spatial(&turned(&angle, surface));
            let all = speed + spin.cross(&arm);
            velocity[i] = Vector::from_fn(|k, _| all[k]);
        }
    }

    /// Set `out` to the accelerations of the first `count` particles at the end of the step, zero but of these bodies; empty if there are none.
    /// As their velocities, they are those of the surface above them.
    pub fn accelerations(&self, count: usize, out: &mut Vec<Vector<D>>) {
        out.clear();
        if self.is_none() {
            return;
        }
        out.resize(count, Vector::zeros());
        for &(i, shape) in &self.members {
            let Shape { body, surface, .. } = &self.shape[shape];
            let Pose { angle, spin, acceleration, angular_acceleration, .. } = self.bodies[*body].end;
            let arm = spatial(&turned(&angle, surface));
            let all = acceleration + angular_acceleration.cross(&arm) + spin.cross(&spin.cross(&arm));
            out[i] = Vector::from_fn(|k, _| all[k]);
        }
    }

    /// The centre of a body of the settings in the frame of the step.
    pub fn center(&self, body: usize, bodies: &[Body]) -> Vector<D> {
        let center = Vector::from_column_slice(&bodies[body].center);
        match self.place_of.get(body).copied().flatten() {
            Some(place) => center + Vector::from_fn(|k, _| self.bodies[place].frame.displacement[k]),
            None => center,
        }
    }

    /// The vector from a body's centre to one of its particles, if the body may lie across a periodic side.
    pub fn arm(&self, body: usize, arm: Vector<D>) -> Vector<D> {
        match self.place_of.get(body).copied().flatten() {
            Some(_) => arm - self.period.zip_map(&arm, whole_periods),
            None => arm,
        }
    }

    /// Let free bodies feel the body force of a step: what is `constant` of it, and the mean of the rest over their particles.
    pub fn feel(&mut self, constant: Vector<D>, varying: impl Fn(usize) -> Vector<D>) {
        if self.bodies.iter().all(|body| body.rigid.is_none()) {
            return;
        }
        // In an order that does not depend on how particles are stored.
        let mut felt: Vec<_> = self.members.iter().map(|&(i, shape)| (shape, varying(i))).collect();
        felt.sort_unstable_by_key(|&(shape, _)| shape);
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let own = || felt.iter().filter(|(shape, _)| self.shape[*shape].body == number).map(|(_, force)| force);
            let mean = own().sum::<Vector<D>>() / own().count().max(1) as f64;
            body.body_force = spatial(&(constant + mean));
        }
    }

    /// The bodies are where the step has led to; `loads` are forces and torques of the fluid on each of the settings' bodies, and `reach` is
    /// how far the pressure travels in a step over Δx.
    pub fn end(&mut self, time_step: f64, reach: f64, loads: impl Fn(usize) -> [Vector3<f64>; 2]) {
        for body in &mut self.bodies {
            body.start = body.end;
            if let Some(rigid) = &body.rigid {
                let [force, torque] = loads(body.body as usize);
                let acting = [force + body.body_force * rigid.mass, torque];
                let (at_once, following) = if reach.is_finite() {
                    ([body.layer, body.layer_inertia].map(|layer| reach * layer), FOLLOWING)
                } else {
                    ([rigid.added_mass, rigid.added_inertia], 1.0)
                };
                body.start.respond::<D>(rigid, at_once, acting, 0.5 * time_step);
                body.start.follow(following);
            }
        }
    }
}

impl<const D: usize> Moving<D> {
    fn pose(&self, moment: Moment) -> &Pose {
        match moment {
            Moment::Start => &self.start,
            Moment::Frame => &self.frame,
            Moment::End => &self.end,
        }
    }

    fn pose_mut(&mut self, moment: Moment) -> &mut Pose {
        match moment {
            Moment::Start => &mut self.start,
            Moment::Frame => &mut self.frame,
            Moment::End => &mut self.end,
        }
    }
}

/// The whole periods in a length; none where there is no period.
fn whole_periods(period: f64, length: f64) -> f64 {
    if period > 0.0 { period * (length / period).round() } else { 0.0 }
}

fn spatial<const D: usize>(v: &Vector<D>) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < D { v[k] } else { 0.0 })
}

fn rotated<const D: usize>(rotation: &Rotation3<f64>, v: &Vector<D>) -> Vector<D> {
    let rotated = rotation * spatial(v);
    Vector::from_fn(|k, _| rotated[k])
}

fn turned<const D: usize>(angle: &Vector3<f64>, v: &Vector<D>) -> Vector<D> {
    rotated(&Rotation3::from_scaled_axis(*angle), v)
}
