//! A frame: the particle positions at which derivatives are taken, with their images, neighbours and stencil.

use crate::boundary::Images;
use crate::neighbours::Grid;
use crate::parallel::CHUNK;
use crate::particles::{Particles, Vector};
use crate::settings::{DerivativeFrame, Settings};
use crate::stencil::Stencil;
use rayon::prelude::*;

#[derive(Debug, Default)]
pub struct Frame<const D: usize> {
    pub images: Images<D>,
    pub grid: Grid<D>,
    pub stencil: Stencil<D>,
    /// Positions that the neighbour list was made at, and how much two particles may approach before it must be renewed.
    searched: Vec<Vector<D>>,
    skin: f64,
}

impl<const D: usize> Frame<D> {
    /// Create the images of the particles, search neighbours and evaluate the stencil. The list stays complete until two
    /// particles have approached each other by `skin`. With `reorder` the particles are first put into cell order.
    pub fn search(&mut self, settings: &Settings, particles: &mut Particles<D>, skin: f64, reorder: bool) {
        let radius = search_radius(settings) + skin;
        self.skin = skin;
        particles.drop_images();
        if reorder {
            self.grid.build(&particles.position, radius, settings.bounds());
            particles.reorder(self.grid.order());
        }
        // Twice the skin, so that a list renewed within the step finds its images too.
        self.images.create(particles, &settings.domain, radius + skin);
        self.list_neighbours(settings, particles);
        self.evaluate(settings, particles);
    }

    /// Evaluate the stencil again after particles (and images) have moved within the step.
    pub fn update(&mut self, settings: &Settings, particles: &Particles<D>) {
        if settings.search_every_iteration || self.is_stale(particles) {
            self.list_neighbours(settings, particles);
        }
        self.evaluate(settings, particles);
    }

    fn list_neighbours(&mut self, settings: &Settings, particles: &Particles<D>) {
        // A list for one set of positions only needs no skin.
        let lasts = settings.derivative_frame == DerivativeFrame::Updated && !settings.search_every_iteration;
        let radius = search_radius(settings) + if lasts { self.skin } else { 0.0 };
        self.grid.build(&particles.position, radius, settings.bounds());
        self.stencil.neighbours.search(particles, &self.grid, radius);
        self.searched.clear();
        if lasts {
            self.searched.extend_from_slice(&particles.position[..particles.real]);
        }
    }

    fn is_stale(&self, particles: &Particles<D>) -> bool {
        let limit = (0.5 * self.skin).powi(2);
        let moved = self.searched.par_iter().zip(&particles.position).with_min_len(CHUNK);
        moved.any(|(old, new)| (new - old).norm_squared() > limit)
    }

    fn evaluate(&mut self, settings: &Settings, particles: &Particles<D>) {
        let images = &self.images;
        self.stencil.evaluate(settings, particles, |volume| images.scalars(volume));
    }
}

/// A hair more than what counts as a neighbour, so that the list is complete whatever rounding does.
fn search_radius(settings: &Settings) -> f64 {
    settings.neighbour_distance() * (1.0 + 5e-7)
}
