//! A frame: the particle positions at which derivatives are taken, with their images, neighbours and stencil.

use crate::base::Vector;
use crate::base::parallel::{self, CHUNK};
use crate::discretisation::Stencil;
use crate::faces::Faces;
use crate::halo::Images;
use crate::motion::{Moment, Motion};
use crate::neighbours::Grid;
use crate::particles::Particles;
use crate::settings::{DerivativeFrame, Settings};
use rayon::prelude::*;

/// How far the particles will go while the neighbours of a frame are in use.
#[derive(Clone, Copy, Debug, Default)]
pub struct Travel {
    pub time_step: f64,
    pub velocity_max: f64,
    /// How far of u^n Δt the particles go before the search: ½ for the frame in the middle of the step.
    pub fraction: f64,
}

/// Part of u_max Δt by which two particles may approach each other beyond what their velocities at r^n make them, before the
/// neighbours are searched again: what acceleration within the step adds.
const SKIN: f64 = 0.1;

/// How far in Δx the frame may be from the positions that an iteration of Algorithm 1 has reached: later iterations move particles
/// by less. Algorithms 1 and 2 are apart by u Δt, some thousand times as much.
const FRAME_TOLERANCE: f64 = 1e-5;

/// Reach in Δx of the grid whose order the particles are put into: its cells of 2 Δx hold whole clusters where particles lie on a
/// lattice, and nearly so elsewhere.
const CLUSTER_REACH: f64 = 4.0;

#[derive(Debug, Default)]
pub struct Frame<const D: usize> {
    pub images: Images<D>,
    pub grid: Grid<D>,
    pub stencil: Stencil<D>,
    pub faces: Faces<D>,
    /// Where the particles are expected while the list is in use: r^n + u^n Δt. Empty if the list is for r^n only.
    expected: Vec<Vector<D>>,
    /// r^n of the real particles, if the frame is not there.
    pub start: Vec<Vector<D>>,
    /// How much two particles may approach each other from there.
    skin: f64,
    /// Distance within which the grid finds particles.
    reach: f64,
}

impl<const D: usize> Frame<D> {
    /// Create the images of the particles, search neighbours and evaluate the stencil. With `reorder` the particles are first
    /// put into cell order. If the derivatives will follow the particles, the list holds neighbours at r^n and at r^n + u^n Δt.
    pub fn search(&mut self, settings: &Settings, particles: &mut Particles<D>, travel: Travel, reorder: bool) {
        self.search_around(settings, particles, travel, reorder, &mut Motion::default());
    }

    /// The same with bodies in `motion`, which stand where they are in the frame.
    pub fn search_around(
        &mut self,
        settings: &Settings,
        particles: &mut Particles<D>,
        travel: Travel,
        reorder: bool,
        motion: &mut Motion<D>,
    ) {
        let follows = settings.derivative_frame == DerivativeFrame::Updated;
        let lasts = follows && !settings.search_every_iteration;
        let moves = follows || travel.fraction > 0.0;
        let distance = if moves { (travel.velocity_max * travel.time_step).min(settings.particle_spacing) } else { 0.0 };
        self.skin = if lasts { SKIN * distance } else { 0.0 };
        self.reach = search_radius(settings) + self.skin + if lasts { 2.0 * distance } else { 0.0 };
        particles.drop_images();
        if reorder {
            self.grid.build(
                &particles.position,
                &particles.id,
                CLUSTER_REACH * settings.particle_spacing,
                settings.bounds(),
            );
            particles.reorder(self.grid.order());
        }
        motion.locate(particles);
        // Images that come within reach during the step, too.
        self.images.create(particles, &settings.domain, search_radius(settings) + 3.0 * distance);
        self.faces.find(particles);
        self.start.clear();
        if travel.fraction > 0.0 {
            self.start.extend_from_slice(&particles.position[..particles.real]);
            let mut position = std::mem::take(&mut particles.position);
            parallel::for_each(self.images.real(&mut position), |i, r| {
                if !particles.is_fixed(i, &settings.bodies) {
                    *r += particles.velocity[i] * (travel.fraction * travel.time_step);
                }
            });
            motion.place(Moment::Frame, self.images.real(&mut position), &mut particles.normal);
            self.images.fill_positions(&mut position);
            particles.position = position;
            if !motion.is_none() {
                self.images.fill(&mut particles.normal);
            }
        }
        self.expected.clear();
        if lasts {
            self.expected.extend_from_slice(&particles.position);
            parallel::for_each(&mut self.expected, |i, r| {
                if !particles.is_fixed(i, &settings.bodies) {
                    *r += particles.velocity[i] * travel.time_step;
                }
            });
        }
        self.list_neighbours(settings, particles);
        self.evaluate(settings, particles);
    }

    /// Evaluate the stencil again after particles (and images) have moved within the step. A frame that lasts is kept while it is
    /// within [`FRAME_TOLERANCE`] of where they are.
    pub fn update(&mut self, settings: &Settings, particles: &Particles<D>) {
        if self.expected.is_empty() {
            self.list_neighbours(settings, particles);
        } else if !farther(&self.stencil.position, particles, FRAME_TOLERANCE * settings.particle_spacing) {
            return;
        } else if farther(&self.expected, particles, 0.5 * self.skin) {
            self.expected.copy_from_slice(&particles.position);
            self.list_neighbours(settings, particles);
        }
        self.evaluate(settings, particles);
    }

    fn list_neighbours(&mut self, settings: &Settings, particles: &Particles<D>) {
        self.grid.build(&particles.position, &particles.id, self.reach, settings.bounds());
        let expected = (!self.expected.is_empty()).then_some(&self.expected[..]);
        self.stencil.neighbours.search(particles, expected, &self.grid, search_radius(settings) + self.skin);
    }

    fn evaluate(&mut self, settings: &Settings, particles: &Particles<D>) {
        let images = &self.images;
        let faces = &self.faces;
        self.stencil.neighbours.share_out(faces.is_empty(), |cluster, entries, out| {
            faces.share_out(particles, cluster, entries, out);
        });
        images.blank(&mut self.stencil.volume, particles.len());
        self.stencil.evaluate(settings, particles, |volume| images.fill(volume));
    }
}

/// Whether any particle is farther than `distance` from its position in `from`.
fn farther<const D: usize>(from: &[Vector<D>], particles: &Particles<D>, distance: f64) -> bool {
    let positions = from[..particles.real].par_iter().zip(&particles.position).with_min_len(CHUNK);
    positions.any(|(from, position)| (position - from).norm_squared() > distance * distance)
}

/// A hair more than what counts as a neighbour, so that the list is complete whatever rounding does.
fn search_radius(settings: &Settings) -> f64 {
    settings.neighbour_distance() * (1.0 + 5e-7)
}
