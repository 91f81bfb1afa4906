//! What solids beside a free surface show of the velocity, and how near they let the fluid come.

use crate::base::{Vector, parallel};
use crate::boundary::shepard;
use crate::flow::Flow;
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::settings::Settings;

/// Height over a surface [Δx] from which on a particle comes no nearer, and its distance to a solid that tells of the surface.
const CLOSE: f64 = 0.25;
const BESIDE: f64 = 1.2;

/// Take what is next to a surface no nearer. A pressure that is not below that of the air holds little back where the fluid is thin.
pub fn keep_out<const D: usize>(settings: &Settings, Flow { particles, frame, .. }: &mut Flow<D>) {
    if settings.bodies.is_empty() {
        return;
    }
    let Particles { kind, normal, depth, velocity, .. } = particles;
    let (stencil, spacing) = (&frame.stencil, settings.particle_spacing);
    let walls = velocity.clone();
    parallel::for_each(frame.images.real(velocity), |i, u| {
        if kind[i] != ParticleKind::Fluid {
            return;
        }
        let (row, lane) = stencil.neighbours.row(i);
        for s in row.solid_seen(lane).map(|(entry, _)| entry.j()) {
            let way = stencil.position[i] - stencil.position[s];
            if way.norm_squared() < (BESIDE * spacing).powi(2) && way.dot(&normal[s]) - depth[s] < CLOSE * spacing {
                let approach = (*u - walls[s]).dot(&normal[s]);
                *u -= normal[s] * approach.min(0.0);
            }
        }
    });
    frame.images.fill(velocity);
}

/// Let solids show what is beyond a slip wall in a mirror: the mean of the fluid around, with the other velocity across the wall.
pub fn mirror<const D: usize>(settings: &Settings, frame: &Frame<D>, particles: &Particles<D>, velocity: &mut [Vector<D>]) {
    if settings.bodies.is_empty() {
        return;
    }
    let Particles { real, kind, normal, .. } = particles;
    let seen = &*velocity;
    let shown = |s: usize| {
        let own = particles.velocity[s];
        let mean = shepard(settings, &frame.stencil, s, |j, _| seen[j].into()).map_or(own, Vector::from);
        mean - normal[s] * (2.0 * (mean - own).dot(&normal[s]))
    };
    let shown = of_solids(&kind[..*real], shown);
    let real = frame.images.real(velocity);
    shown.into_iter().for_each(|(s, u)| real[s] = u);
    frame.images.fill(velocity);
}
