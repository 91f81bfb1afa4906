//! Profiles of the fluid over a wall, continued into its solid particles.
//!
//! At each solid particle under the surface a polynomial in the height over the surface is fitted to the fluid above it, and the
//! solid particles below take its values at their depths. So the compact Laplacian sees a field that is smooth across the surface; an
//! odd mirror image, which Shepard averages amount to, turns the sign of the curvature there and halves it in the first layer. The
//! slope of the velocity at the surface is the wall's shear.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::average::for_each_weighted;
use crate::discretisation::Stencil;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Solid particles less deep than this [Δx] lie under the surface.
const SURFACE_DEPTH: f64 = 0.75;

/// Solid particles less deep than this [Δx] stand for the surface's area: several layers, since one of disordered solids would give
/// 6 % too little.
const AREA_DEPTH: f64 = 3.0;

/// Least product of two unit normals on one piece of wall: corners of more than 45 degrees part it.
const SAME_WALL: f64 = 0.7;

/// Keeps coefficients after the first small where the fluid does not tell of them, as in a single layer, and no more: 1e-3 made the
/// curvature next to a wall a fifth too small.
const RIDGE: f64 = 1e-5;

/// How far on its way to a surface particle, of all, fluid is moved before the nearest one is sought: of two just as near, as on a
/// lattice, neither rounding nor their order decides.
const TIE: f64 = 1e-9;

/// exp(−x) beyond this is neglected.
const NEGLIGIBLE: f64 = 10.0;

/// The profiles below the surface, by solid particle: coefficients of the least-squares fits of `basis`, K functions of the height over
/// Δx, to `field − base(s)`; None for solid particles that are under no fluid or have no normals.
pub fn profiles<const D: usize, const K: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    stencil: &Stencil<D>,
    field: &[Vector<D>],
    base: impl Fn(usize) -> Vector<D> + Sync,
    basis: impl Fn(f64) -> [f64; K] + Sync,
) -> Vec<(usize, Option<[Vector<D>; K]>)> {
    let wall = Wall { settings, particles, stencil };
    let solids = parallel::filter(particles.real, |i| particles.kind[i] == ParticleKind::Solid);
    let surface = solids.par_iter().filter(|&&s| wall.is_surface(s));
    let fits: Vec<_> = surface.filter_map(|&s| Some((s, wall.fit(s, field, base(s), &basis)?))).collect();
    solids.par_iter().map(|&s| (s, wall.profile_at(s, &fits))).collect()
}

/// Area of the surface that solid particle `s` stands for, so that a sum over solids is an integral over the surface: w(s) / Σ w(a) W of
/// the points of the surface above the solids a, W the kernel in the surface's dimension, w falling from 1 to 0 over [`AREA_DEPTH`]. Only
/// solids count, so that it does not change with the fluid around.
pub fn surface_area<const D: usize>(settings: &Settings, particles: &Particles<D>, stencil: &Stencil<D>, s: usize) -> f64 {
    let Particles { normal, depth, .. } = particles;
    let weight = |a: usize| (1.0 - depth[a] / (AREA_DEPTH * settings.particle_spacing)).max(0.0);
    if weight(s) == 0.0 {
        return 0.0;
    }
    let above = |a: usize| stencil.position[a] + normal[a] * depth[a];
    // The other side of a plate may be as near as the next particle.
    let near = stencil.solids_near(settings, s).filter(|&a| normal[a].dot(&normal[s]) > -SAME_WALL);
    with_kernel!(settings.kernel, kernel => {
        let kernel = Smoothing::new(kernel, settings.smoothing_length(), D - 1);
        weight(s) / near.map(|a| weight(a) * kernel.value((above(s) - above(a)).norm())).sum::<f64>()
    })
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

    /// Coefficients of the basis at surface particle `s`. None if no fluid is above: its foot is always on another particle, as with
    /// one in a corner.
    fn fit<const K: usize>(
        &self,
        s: usize,
        field: &[Vector<D>],
        base: Vector<D>,
        basis: impl Fn(f64) -> [f64; K],
    ) -> Option<[Vector<D>; K]> {
        let Self { settings, particles, stencil } = self;
        let (spacing, normal) = (settings.particle_spacing, &particles.normal[s]);
        let (row, lane) = stencil.neighbours.row(s);
        let near = row.flowing_seen(lane);
        let (feet, all_feet) = (self.feet(s), self.surface_near(s).collect::<Vec<_>>());
        let mut is_above = false;
        let mut moments = SMatrix::<f64, K, K>::zeros();
        let mut sums = SMatrix::<f64, K, D>::zeros();
        for_each_weighted(settings, stencil, s, near, |j, weight, r_sj| {
            // A profile is that of the fluid right above: fluid t away along the wall counts exp(−t²/Δx²) times as much.
            let away = (r_sj.norm_squared() - r_sj.dot(normal).powi(2)) / spacing.powi(2);
            if away > NEGLIGIBLE {
                return;
            }
            let place = stencil.position[j] + r_sj * TIE;
            let nearest = self.foot(&place, &all_feet);
            is_above |= nearest == Some(s);
            let foot = nearest.filter(|&a| self.same_wall(a, s)).or_else(|| self.foot(&place, &feet));
            let height = foot.map_or(0.0, |a| self.height(j, a, &feet)) / spacing;
            if height > 0.0 {
                let weight = weight * (-away).exp();
                let basis = SMatrix::<f64, K, 1>::from(basis(height));
                moments += basis * basis.transpose() * weight;
                sums += basis * (field[j] - base).transpose() * weight;
            }
        });
        if !is_above {
            return None;
        }
        let scale = moments[(0, 0)];
        (1..K).for_each(|k| moments[(k, k)] += RIDGE * scale);
        let coefficients = moments.cholesky()?.solve(&sums);
        Some(std::array::from_fn(|k| coefficients.row(k).transpose()))
    }

    /// Surface particles around solid particle `s`, itself among them if it is one.
    fn surface_near(&self, s: usize) -> impl Iterator<Item = usize> {
        self.stencil.solids_near(self.settings, s).filter(|&a| self.is_surface(a))
    }

    /// Those of the same piece of wall.
    fn feet(&self, s: usize) -> Vec<usize> {
        self.surface_near(s).filter(|&a| self.same_wall(a, s)).collect()
    }

    /// The one of `feet` nearest to `place`.
    fn foot(&self, place: &Vector<D>, feet: &[usize]) -> Option<usize> {
        let distance = |a: usize| (place - self.stencil.position[a]).norm_squared();
        feet.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    }

    /// Height of particle `j` over the surface: from its foot, along the mean of the normals there and under `j`, which is what the
    /// height over a circle is.
    fn height(&self, j: usize, foot: usize, feet: &[usize]) -> f64 {
        let Particles { normal, depth, .. } = self.particles;
        let from = |a: usize| self.stencil.position[j] - self.stencil.position[a];
        let square = from(foot).norm_squared();
        // How much further than the foot, in the exponent of a Gaussian of the width Δx.
        let further = |a: usize| (from(a).norm_squared() - square) / self.settings.particle_spacing.powi(2);
        let near = feet.iter().map(|&a| (a, further(a))).filter(|&(_, further)| further < NEGLIGIBLE);
        let below = near.map(|(a, further)| normal[a] * (-further).exp()).sum::<Vector<D>>();
        from(foot).dot(&(normal[foot] + below.normalize())) / 2.0 - depth[foot]
    }

    /// The profile of the surface above solid particle `s`: its own, or the average of those around on the same piece of wall. `fits` are
    /// in the order of the particles.
    fn profile_at<const K: usize>(&self, s: usize, fits: &[(usize, [Vector<D>; K])]) -> Option<[Vector<D>; K]> {
        let fit_of = |a: usize| fits.binary_search_by_key(&a, |fit| fit.0).ok().map(|found| &fits[found].1);
        if let Some(own) = fit_of(s) {
            return Some(*own);
        }
        let (row, lane) = self.stencil.neighbours.row(s);
        let near = row.solid_seen(lane);
        let mut total = 0.0;
        let mut sum = [Vector::zeros(); K];
        for_each_weighted(self.settings, self.stencil, s, near, |a, weight, _| {
            if let Some(fit) = fit_of(a).filter(|_| self.same_wall(a, s)) {
                total += weight;
                sum.iter_mut().zip(fit).for_each(|(sum, fit)| *sum += fit * weight);
            }
        });
        (total > 0.0).then(|| sum.map(|sum| sum / total))
    }
}
