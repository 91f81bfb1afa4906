//! What images and solids beside a free surface show of pressure and velocity, and how near solids let the fluid come.

use super::Terms;
use crate::base::Vector;
use crate::boundary::shepard;
use crate::flow::{Flow, Step};
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, Place, of_solids};
use crate::settings::Settings;
use rayon::prelude::*;

/// Height over a surface [Δx] from which on a particle comes no nearer, and its distance to a solid that tells of the surface.
const CLOSE: f64 = 0.25;
const BESIDE: f64 = 1.2;

/// What a solid has taken of the velocity of a particle that came too near.
#[derive(Clone, Copy)]
struct Held<const D: usize> {
    id: u64,
    /// The solid, or its image; that which has taken most, if it was not the only one.
    by: usize,
    change: Vector<D>,
}

impl<const D: usize> Terms<D> {
    /// The pressure that images and solids show, which is not below that of the air where none is.
    pub(super) fn extend_pressure(&self, step: Step, flow: &mut Flow<D>) {
        self.extend_pressure_above(self.least_pressure(), step, flow);
    }

    /// The same, of solids not below `least`.
    pub(super) fn extend_pressure_above(&self, least: f64, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, body_force, surface, .. } = flow;
        let (place, settings) = (&surface.place, step.settings);
        let fill = |particles: &mut Particles<D>| {
            frame.images.fill_pressure(&mut particles.pressure, &particles.position, |i| match place[i] {
                Place::Inside | Place::Near => body_force.at(i) * settings.density,
                Place::AtSurface | Place::Isolated => Vector::zeros(),
            });
        };
        fill(particles);
        if settings.bodies.is_empty() {
            return;
        }
        let pressure = &particles.pressure;
        let shown = |s: usize| {
            let mean = shepard(settings, &frame.stencil, s, |j, r_sj| {
                // Nothing is known of the pressure beyond what is at the surface, which may be falling.
                let known = if surface.is_at_surface(j) { 0.0 } else { settings.density };
                [pressure[j] + (body_force.at(j) - body_force.acceleration_of_wall(s)).dot(&r_sj) * known]
            });
            let [p] = mean.unwrap_or([0.0]);
            p.max(least)
        };
        let shown = of_solids(&particles.kind[..particles.real], shown);
        let real = frame.images.real(&mut particles.pressure);
        shown.into_iter().for_each(|(s, p)| real[s] = p);
        fill(particles);
    }

    /// Let nothing come too near to solids, which feel that.
    pub(super) fn hold(&mut self, step: Step, flow: &mut Flow<D>) {
        let Step { settings, time_step, .. } = step;
        let mass = settings.density * settings.particle_spacing.powi(D as i32);
        for Held { by, change, .. } in keep_out(settings, flow) {
            let Flow { particles, frame, .. } = &*flow;
            let change = frame.images.at_source(particles.real, by, change);
            self.reaction[frame.images.source(particles.real, by)] -= change * (mass / time_step);
        }
    }
}

/// Take what is next to a surface no nearer. A pressure that is not below that of the air holds little back where the fluid is thin. Returns
/// what solids have taken, in an order that does not depend on how particles are stored.
fn keep_out<const D: usize>(settings: &Settings, Flow { particles, frame, .. }: &mut Flow<D>) -> Vec<Held<D>> {
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
