//! Profiles of the fluid over a wall, continued into its solid particles.
//!
//! At each solid particle under the surface a polynomial in the height over the surface is fitted to the fluid around, and the
//! solid particles below take its values at their depths. So the compact Laplacian sees a field that is smooth across the surface; an
//! odd mirror image, which Shepard averages amount to, turns the sign of the curvature there and halves it in the first layer.

use crate::boundary::solid::for_each_weighted;
use crate::parallel;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::Settings;
use crate::stencil::Stencil;
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Solid particles less deep than this [Δx] lie under the surface.
const SURFACE_DEPTH: f64 = 0.75;

/// Least product of two unit normals on one piece of wall: corners of more than 45 degrees part it.
const SAME_WALL: f64 = 0.7;

/// Keeps coefficients after the first small where the fluid does not tell of them, as in a single layer.
const RIDGE: f64 = 1e-3;

/// Values that `field` would have at the solid particles if it went on below the surface as above it: `base(s)` and what the
/// least-squares fit of `basis`, K functions of the height over Δx, says of `field − base(s)`. Solid particles that are under no fluid
/// or have no normals get `base(s)`. Returns pairs of index and value.
pub fn continued<const D: usize, const K: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    stencil: &Stencil<D>,
    field: &[Vector<D>],
    base: impl Fn(usize) -> Vector<D> + Sync,
    basis: impl Fn(f64) -> [f64; K] + Sync,
) -> Vec<(usize, Vector<D>)> {
    let wall = Wall { settings, particles, stencil };
    let solids = parallel::filter(particles.real, |i| particles.kind[i] == ParticleKind::Solid);
    let surface = solids.par_iter().filter(|&&s| wall.is_surface(s));
    let fits: Vec<_> = surface.filter_map(|&s| Some((s, wall.fit(s, field, base(s), &basis)?))).collect();
    solids.par_iter().map(|&s| (s, base(s) + wall.evaluate(s, &fits, &basis))).collect()
}

struct Wall<'a, const D: usize> {
    settings: &'a Settings,
    particles: &'a Particles<D>,
    stencil: &'a Stencil<D>,
}

impl<const D: usize> Wall<'_, D> {
    fn is_surface(&self, s: usize) -> bool {
        self.particles.depth[s] < SURFACE_DEPTH * self.settings.particle_spacing
    }

    fn same_wall(&self, a: usize, b: usize) -> bool {
        self.particles.normal[a].dot(&self.particles.normal[b]) > SAME_WALL
    }

    /// Coefficients of the basis at surface particle `s`. None without fluid above.
    fn fit<const K: usize>(
        &self,
        s: usize,
        field: &[Vector<D>],
        base: Vector<D>,
        basis: impl Fn(f64) -> [f64; K],
    ) -> Option<[Vector<D>; K]> {
        let row = self.stencil.neighbours.row(s).0;
        let feet = row.solid().iter().map(|entry| entry.j()).filter(|&a| self.is_surface(a) && self.same_wall(a, s));
        let feet: Vec<usize> = feet.collect();
        let mut moments = SMatrix::<f64, K, K>::zeros();
        let mut sums = SMatrix::<f64, K, D>::zeros();
        for_each_weighted(self.settings, self.stencil, s, row.flowing(), |j, weight, _| {
            let height = self.height(j, &feet) / self.settings.particle_spacing;
            if height > 0.0 {
                let basis = SMatrix::<f64, K, 1>::from(basis(height));
                moments += basis * basis.transpose() * weight;
                sums += basis * (field[j] - base).transpose() * weight;
            }
        });
        let scale = moments[(0, 0)];
        (1..K).for_each(|k| moments[(k, k)] += RIDGE * scale);
        let coefficients = moments.cholesky()?.solve(&sums);
        Some(std::array::from_fn(|k| coefficients.row(k).transpose()))
    }

    /// Height of particle `j` over the surface, along the normal of the nearest of `feet`; zero without any.
    fn height(&self, j: usize, feet: &[usize]) -> f64 {
        let Particles { normal, depth, .. } = self.particles;
        let from = |a: usize| self.stencil.position[j] - self.stencil.position[a];
        let nearest = feet.iter().copied().min_by(|&a, &b| from(a).norm_squared().total_cmp(&from(b).norm_squared()));
        nearest.map_or(0.0, |a| from(a).dot(&normal[a]) - depth[a])
    }

    /// The profile of the surface above solid particle `s` at its depth. `fits` are in the order of the particles.
    fn evaluate<const K: usize>(
        &self,
        s: usize,
        fits: &[(usize, [Vector<D>; K])],
        basis: impl Fn(f64) -> [f64; K],
    ) -> Vector<D> {
        let basis = basis(-self.particles.depth[s] / self.settings.particle_spacing);
        let at = |fit: &[Vector<D>; K]| (0..K).map(|k| fit[k] * basis[k]).sum::<Vector<D>>();
        let fit_of = |a: usize| fits.binary_search_by_key(&a, |fit| fit.0).ok().map(|found| &fits[found].1);
        if let Some(own) = fit_of(s) {
            return at(own);
        }
        let near = self.stencil.neighbours.row(s).0.solid();
        let mut total = 0.0;
        let mut sum = Vector::zeros();
        for_each_weighted(self.settings, self.stencil, s, near, |a, weight, _| {
            if let Some(fit) = fit_of(a).filter(|_| self.same_wall(a, s)) {
                total += weight;
                sum += at(fit) * weight;
            }
        });
        if total > 0.0 { sum / total } else { sum }
    }
}
