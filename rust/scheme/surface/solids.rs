//! What solids beside a free surface show of the velocity, and how near they let the fluid come.

use crate::base::Vector;
use crate::boundary::shepard;
use crate::flow::Flow;
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::settings::Settings;
use rayon::prelude::*;

/// Height over a surface [Δx] from which on a particle comes no nearer, and its distance to a solid that tells of the surface.
const CLOSE: f64 = 0.25;
const BESIDE: f64 = 1.2;

/// What a solid has taken of the velocity of a particle that came too near.
#[derive(Clone, Copy)]
pub struct Held<const D: usize> {
    id: u64,
    /// The solid, or its image; that which has taken most, if it was not the only one.
    pub by: usize,
    pub change: Vector<D>,
}

/// Take what is next to a surface no nearer. A pressure that is not below that of the air holds little back where the fluid is thin. Returns
/// what solids have taken, in an order that does not depend on how particles are stored.
pub fn keep_out<const D: usize>(settings: &Settings, Flow { particles, frame, .. }: &mut Flow<D>) -> Vec<Held<D>> {
    if settings.bodies.is_empty() {
        return Vec::new();
    }
    let Particles { real, kind, normal, depth, velocity, id, .. } = particles;
    let (stencil, spacing) = (&frame.stencil, settings.particle_spacing);
    let close = |i: usize, s: usize| {
        let way = stencil.position[i] - stencil.position[s];
        way.norm_squared() < (BESIDE * spacing).powi(2) && way.dot(&normal[s]) - depth[s] < CLOSE * spacing
    };
    let hold = |i: usize| {
        let (mut u, mut most, mut by) = (velocity[i], 0.0, None);
        let (row, lane) = stencil.neighbours.row(i);
        for s in row.solid_seen(lane).map(|(entry, _)| entry.j()).filter(|&s| close(i, s)) {
            let approach = (u - velocity[s]).dot(&normal[s]);
            if approach < 0.0 {
                u -= normal[s] * approach;
                by = if approach < most { Some(s) } else { by };
                most = approach.min(most);
            }
        }
        by.map(|by| (i, Held { id: id[i], by, change: u - velocity[i] }))
    };
    let fluid = (0..*real).into_par_iter().filter(|&i| kind[i] == ParticleKind::Fluid);
    let held: Vec<_> = fluid.filter_map(hold).collect();
    held.iter().for_each(|(i, held)| velocity[*i] += held.change);
    frame.images.fill(velocity);
    let mut held: Vec<_> = held.into_iter().map(|(_, held)| held).collect();
    held.sort_unstable_by_key(|held| held.id);
    held
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
