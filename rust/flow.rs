//! The flow that a step advances, whatever the scheme.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::Walls;
use crate::forcing::BodyForce;
use crate::frame::Frame;
use crate::motion::{Moment, Motion};
use crate::particles::Particles;
use crate::settings::Settings;
use crate::surface::Surface;

/// What stays the same during a step.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    pub settings: &'a Settings,
    /// Δt.
    pub time_step: f64,
    /// u_max of u^n.
    pub velocity_max: f64,
}

/// Particles, the frame that their derivatives are taken in, what solids show, and the state before the step.
#[derive(Debug)]
pub struct Flow<const D: usize> {
    pub particles: Particles<D>,
    pub frame: Frame<D>,
    pub walls: Walls<D>,
    pub before: Before<D>,
    pub body_force: BodyForce<D>,
    /// Of rigid bodies.
    pub motion: Motion<D>,
    /// Of the frame; of no particles if the fluid fills the domain.
    pub surface: Surface<D>,
}

/// r^n, u^n, p^n of the real particles.
#[derive(Debug, Default)]
pub struct Before<const D: usize> {
    pub position: Vec<Vector<D>>,
    pub velocity: Vec<Vector<D>>,
    pub pressure: Vec<f64>,
}

impl<const D: usize> Flow<D> {
    pub fn new(settings: &Settings, particles: Particles<D>) -> Self {
        let (frame, before, surface) = (Frame::default(), Before::default(), Surface::default());
        let (body_force, motion) = (BodyForce::new(settings), Motion::new(settings));
        Self { particles, frame, walls: Walls::new(settings), before, body_force, motion, surface }
    }

    /// Keep the state before a step, whose frame may stand in the middle of it.
    pub fn remember(&mut self) {
        let Self { particles, frame, before, .. } = self;
        let real = particles.real;
        let start = if frame.start.is_empty() { &particles.position[..real] } else { &frame.start[..] };
        copy(start, &mut before.position);
        copy(&particles.velocity[..real], &mut before.velocity);
        copy(&particles.pressure[..real], &mut before.pressure);
    }

    /// Go back to the state before the step. Returns the particles with the velocities and pressures that it led to, where they stood before.
    pub fn restore(&mut self) -> Particles<D> {
        let Self { particles, before, motion, .. } = self;
        particles.drop_images();
        particles.position.copy_from_slice(&before.position);
        motion.place(Moment::Start, &mut particles.position, &mut particles.normal);
        let failed = particles.clone();
        particles.velocity.copy_from_slice(&before.velocity);
        particles.pressure.copy_from_slice(&before.pressure);
        failed
    }

    /// Solids of rigid bodies take the velocity that they have at n+1.
    pub fn move_solids(&mut self) {
        let Self { particles, frame, motion, .. } = self;
        if !motion.is_none() {
            motion.give_velocity(frame.images.real(&mut particles.velocity));
            frame.images.fill(&mut particles.velocity);
        }
    }

    /// r^{n+1} (12), for everything that moves.
    pub fn advance_positions(&mut self, step: Step) {
        let Self { particles, frame, before, motion, .. } = self;
        let mut position = std::mem::take(&mut particles.position);
        parallel::for_each(frame.images.real(&mut position), |i, r| {
            if !particles.is_fixed(i, &step.settings.bodies) {
                let velocity = before.velocity[i] + particles.velocity[i];
                *r = before.position[i] + velocity * (0.5 * step.time_step);
            }
        });
        motion.place(Moment::End, frame.images.real(&mut position), &mut particles.normal);
        frame.images.fill_positions(&mut position);
        particles.position = position;
        if !motion.is_none() {
            frame.images.fill(&mut particles.normal);
        }
    }
}

fn copy<T: Copy>(from: &[T], to: &mut Vec<T>) {
    to.clear();
    to.extend_from_slice(from);
}
