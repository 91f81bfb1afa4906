//! The buffer of an outlet where fluid comes back through it.
//!
//! What leaves keeps its velocity, so that vortices go out as they are. Where the fluid beside the buffer comes back, that would tear voids:
//! there the buffer follows the fluid, along the normal alone, and is kept full.

use crate::base::{Vector, parallel};
use crate::boundary::side::{Side, outermost};
use crate::neighbours::Grid;
use crate::particles::{ParticleKind, Particles, fresh_ids};
use crate::settings::Settings;

/// How much faster than a particle of the buffer, which may have come back before, the fluid that leaves beside it may be.
const OVERTAKEN: f64 = 10.0;

/// How far around a point beside the buffer the fluid's velocity is averaged [Δx], with weights exp(−r²/Δx²).
const REACH: f64 = 2.5;

/// Distances [Δx] at which a particle of the buffer crowds another one, and from which on a place is void.
const CROWDED: f64 = 0.5;
const VOID: f64 = 0.9;

/// The buffers of the outlets at the end of a step.
pub struct Outlets<'a, const D: usize> {
    pub settings: &'a Settings,
    pub outlets: &'a [Side],
    /// Of the positions before the step.
    pub grid: &'a Grid<D>,
}

impl<const D: usize> Outlets<'_, D> {
    /// Have those of the particles `near` that come back, or fluid comes back beside, or are overtaken, follow the fluid. Returns them.
    pub fn follow(&self, particles: &mut Particles<D>, near: &[usize], time_step: f64) -> Vec<usize> {
        let buffer: Vec<_> = near.iter().copied().filter(|&i| particles.kind[i] == ParticleKind::Outlet).collect();
        let mut beside = vec![None; buffer.len()];
        parallel::for_each(&mut beside, |k, found| {
            let side = outermost(self.outlets, &particles.position[buffer[k]]).map(|(_, side)| side);
            *found = side.and_then(|side| Some((self.beside(particles, side, &particles.position[buffer[k]])?, side)));
        });
        let mut following = Vec::new();
        for (i, found) in buffer.into_iter().zip(beside) {
            let Some((velocity, side)) = found else { continue };
            let kept = particles.velocity[i];
            let [fluid, own] = [velocity, kept].map(|u| -side.inward * u[side.axis]);
            if fluid.min(own) >= 0.0 && fluid <= OVERTAKEN * own {
                continue;
            }
            let along = particles.position[i][side.axis];
            particles.position[i] -= kept * time_step;
            particles.position[i][side.axis] = along;
            particles.velocity[i] = velocity;
            following.push(i);
        }
        following
    }

    /// The mean velocity of the fluid a spacing inside the domain beside a point of a buffer; None without fluid there.
    fn beside(&self, particles: &Particles<D>, side: Side, point: &Vector<D>) -> Option<Vector<D>> {
        let mut foot = *point;
        foot[side.axis] = side.plane + side.inward * self.settings.particle_spacing;
        let (mut total, mut sum) = (0.0, Vector::zeros());
        self.for_each_near(particles, &foot, REACH, |j, distance| {
            if particles.kind[j] == ParticleKind::Fluid {
                let weight = (-distance * distance).exp();
                total += weight;
                sum += particles.velocity[j] * weight;
            }
        });
        (total > 0.0).then(|| sum / total)
    }

    /// `f(j, distance [Δx])` of the real particles that are nearer to a point than `reach` [Δx].
    fn for_each_near(&self, particles: &Particles<D>, point: &Vector<D>, reach: f64, mut f: impl FnMut(usize, f64)) {
        self.grid.for_each_run(&[*point], |run| {
            for j in run.indices.iter().map(|&j| j as usize).filter(|&j| j < particles.real) {
                let distance = (particles.position[j] - point).norm() / self.settings.particle_spacing;
                if distance < reach {
                    f(j, distance);
                }
            }
        });
    }

    /// Of those of `following` that crowd others in the buffer, all but one: they are to go.
    pub fn crowded(&self, particles: &Particles<D>, following: &[usize]) -> Vec<usize> {
        let in_buffer = |j: usize| particles.kind[j] == ParticleKind::Outlet;
        let crowds = |&i: &usize| {
            let mut crowded = false;
            self.for_each_near(particles, &particles.position[i], CROWDED, |j, _| {
                crowded |= in_buffer(j) && particles.id[j] < particles.id[i];
            });
            crowded && in_buffer(i)
        };
        following.iter().copied().filter(crowds).collect()
    }

    /// Put particles where fluid comes back and the buffer is void.
    pub fn fill(&self, particles: &mut Particles<D>) {
        let mut new = Vec::new();
        for &side in self.outlets {
            let rows = self.rows(side);
            let mut found = vec![Vec::new(); rows.len()];
            parallel::for_each(&mut found, |k, found| *found = self.voids(particles, side, &rows[k]));
            new.extend(found.into_iter().flatten());
        }
        for ((place, velocity), id) in new.iter().zip(fresh_ids(&particles.id, new.len())) {
            let added = particles.push_copy(0);
            particles.position[added] = *place;
            particles.velocity[added] = *velocity;
            particles.pressure[added] = 0.0;
            particles.kind[added] = ParticleKind::Outlet;
            (particles.body[added], particles.normal[added], particles.depth[added]) = (0, Vector::zeros(), 0.0);
            particles.id[added] = id;
        }
        particles.real = particles.len();
    }

    /// The middles of the cells of the lattice next to the plane of a side, in its buffer.
    fn rows(&self, side: Side) -> Vec<Vector<D>> {
        let (domain, spacing) = (&self.settings.domain, self.settings.particle_spacing);
        let mut rows = vec![Vector::zeros()];
        for axis in 0..D {
            let along: Vec<f64> = if axis == side.axis {
                vec![side.plane - 0.5 * side.inward * spacing]
            } else {
                let cells = ((domain.upper[axis] - domain.lower[axis]) / spacing).round() as usize;
                (0..cells).map(|k| domain.lower[axis] + (k as f64 + 0.5) * spacing).collect()
            };
            let with = |row: &Vector<D>, x: f64| Vector::from_fn(|k, _| if k == axis { x } else { row[k] });
            rows = rows.iter().flat_map(|row| along.iter().map(move |&x| with(row, x))).collect();
        }
        rows
    }

    /// Void places behind the first one of a row, and the velocity of the fluid there, if it comes back.
    fn voids(&self, particles: &Particles<D>, side: Side, first: &Vector<D>) -> Vec<(Vector<D>, Vector<D>)> {
        let Some(velocity) = self.beside(particles, side, first).filter(|u| side.inward * u[side.axis] > 0.0) else {
            return Vec::new();
        };
        let spacing = self.settings.particle_spacing;
        let cells = (self.settings.buffer_length() / spacing).round() as usize;
        let place = |k: usize| {
            let mut place = *first;
            place[side.axis] -= k as f64 * side.inward * spacing;
            place
        };
        let is_void = |place: &Vector<D>| {
            let mut void = true;
            self.for_each_near(particles, place, VOID, |_, _| void = false);
            void
        };
        (0..cells).map(place).filter(is_void).map(|place| (place, velocity)).collect()
    }
}
