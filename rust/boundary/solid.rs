//! Solid walls: what velocity and pressure a solid particle shows to the fluid. (20)

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::profile::profiles;
use crate::discretisation::Stencil;
use crate::frame::Frame;
use crate::halo::{Mirrored, Poison};
use crate::kernel::{Smoothing, with_kernel};
use crate::neighbours::Entry;
use crate::particles::{ParticleKind, Particles};
use crate::settings::{Settings, WallPressure, WallVelocity};
use rayon::prelude::*;

/// Largest ratio of the distances of solid and fluid from the surface: β_max − 1 of Morris, Fox and Zhu (1997).
const LARGEST_DISTANCE_RATIO: f64 = 0.5;

/// The wall rule of a simulation.
#[derive(Debug)]
pub struct Walls<const D: usize> {
    rule: WallVelocity,
    /// Velocity that solid particles show to the viscous term, real particles and images (not used by the pairwise rule).
    pub viscous_velocity: Vec<Vector<D>>,
    /// ∂u/∂n at the surface next to each solid particle, if known, real particles; empty unless the rule is `cubic`.
    pub slope: Vec<Option<Vector<D>>>,
    /// What the viscous term takes off the velocity of each particle to be of fourth order, real particles and images; empty at
    /// second order. See [`Walls::sharpen`].
    pub dispersion: Vec<Vector<D>>,
}

impl<const D: usize> Walls<D> {
    pub fn new(settings: &Settings) -> Self {
        Self { rule: settings.wall_velocity, viscous_velocity: Vec::new(), slope: Vec::new(), dispersion: Vec::new() }
    }

    /// Renew the velocities that solid particles show to the viscous term.
    pub fn see(&mut self, settings: &Settings, particles: &Particles<D>, frame: &Frame<D>) {
        match self.rule {
            WallVelocity::Paper | WallVelocity::Morris => {}
            WallVelocity::Adami => self.mirror(settings, particles, frame),
            WallVelocity::Cubic => {
                let (velocity, spacing) = (&particles.velocity, settings.particle_spacing);
                let basis = |n: f64| [n, n * n / 2.0, n * n * n / 6.0];
                let found = profiles(settings, particles, &frame.stencil, velocity, |s| velocity[s], basis);
                frame.images.blank(&mut self.slope, particles.real);
                let seen = found.into_iter().map(|(s, profile)| {
                    self.slope[s] = profile.map(|profile| profile[0] / spacing);
                    (s, velocity[s] + value_at(profile, basis(-particles.depth[s] / spacing)))
                });
                let seen = seen.collect();
                self.show(particles, frame, seen);
            }
        }
    }

    /// Let the velocities that the shift sees at solid particles follow. A cubic would not do: its large gradients next to a wall
    /// that is badly resolved feed on themselves.
    pub fn see_for_shift(&mut self, settings: &Settings, particles: &Particles<D>, frame: &Frame<D>) {
        if self.rule == WallVelocity::Cubic {
            self.mirror(settings, particles, frame);
        }
    }

    /// 2 u_wall minus the Shepard average of the fluid's velocity (Adami, Hu and Adams 2012, eq. 23).
    fn mirror(&mut self, settings: &Settings, particles: &Particles<D>, frame: &Frame<D>) {
        let Particles { real, kind, velocity, .. } = particles;
        let solids = (0..*real).into_par_iter().filter(|&i| kind[i] == ParticleKind::Solid);
        let average = |i| shepard(settings, &frame.stencil, i, |j, _| velocity[j].into()).map(Vector::from);
        let seen = solids.map(|i| (i, average(i).map_or(velocity[i], |average| velocity[i] * 2.0 - average))).collect();
        self.show(particles, frame, seen);
    }

    fn show(&mut self, particles: &Particles<D>, frame: &Frame<D>, seen: Vec<(usize, Vector<D>)>) {
        frame.images.blank(&mut self.viscous_velocity, particles.len());
        seen.into_iter().for_each(|(s, seen)| self.viscous_velocity[s] = seen);
        frame.images.fill(&mut self.viscous_velocity);
    }

    /// Set [`Walls::dispersion`] to `factor` ∇²u of the real particles. The compact Laplacian of a wave is too
    /// small by `factor` k² of it; that of u − dispersion is right to fourth order.
    pub fn sharpen(
        &mut self,
        settings: &Settings,
        particles: &Particles<D>,
        frame: &Frame<D>,
        laplacian: impl Fn(usize) -> Vector<D> + Sync,
        factor: f64,
    ) {
        let Particles { real, kind, .. } = particles;
        let dispersion = &mut self.dispersion;
        frame.images.blank(dispersion, particles.len());
        parallel::for_each(&mut dispersion[..*real], |i, out| {
            *out = if kind[i] == ParticleKind::Fluid { laplacian(i) * factor } else { Vector::zeros() };
        });
        frame.images.fill(dispersion);
        let basis = |n: f64| [1.0, n];
        let solids = profiles(settings, particles, &frame.stencil, dispersion, |_| Vector::zeros(), basis);
        if !solids.is_empty() {
            let dispersion_of_real = frame.images.real(dispersion);
            for (s, profile) in solids {
                dispersion_of_real[s] = value_at(profile, basis(-particles.depth[s] / settings.particle_spacing));
            }
            frame.images.fill(dispersion);
        }
    }

    /// Velocity of solid particle `s` in the viscous term of particle `i`. To one another solids show the wall's velocity.
    #[inline(always)]
    pub fn seen_by(&self, particles: &Particles<D>, s: usize, i: usize) -> Vector<D> {
        if particles.kind[i] == ParticleKind::Solid {
            return particles.velocity[s];
        }
        match self.rule {
            WallVelocity::Paper => particles.velocity[s],
            WallVelocity::Adami | WallVelocity::Cubic => self.viscous_velocity[s],
            WallVelocity::Morris => {
                let depth = particles.depth[s];
                let height = (particles.position[i] - particles.position[s]).dot(&particles.normal[s]) - depth;
                let ratio = (depth / height.max(f64::MIN_POSITIVE)).min(LARGEST_DISTANCE_RATIO);
                particles.velocity[s] - (particles.velocity[i] - particles.velocity[s]) * ratio
            }
        }
    }
}

/// Zero without a profile.
fn value_at<const D: usize, const K: usize>(profile: Option<[Vector<D>; K]>, basis: [f64; K]) -> Vector<D> {
    profile.map_or_else(Vector::zeros, |profile| (0..K).map(|k| profile[k] * basis[k]).sum())
}

/// Σ W field_j / Σ W over the flowing neighbours of particle `i`, of the value that `at` gives for j and r_ij. None without
/// neighbours.
fn shepard<const D: usize, const N: usize>(
    settings: &Settings,
    stencil: &Stencil<D>,
    i: usize,
    at: impl Fn(usize, Vector<D>) -> [f64; N],
) -> Option<[f64; N]> {
    let mut total = 0.0;
    let mut sum = [0.0; N];
    let (row, lane) = stencil.neighbours.row(i);
    for_each_weighted(settings, stencil, i, row.flowing_seen(lane), |j, weight, r_ij| {
        let value = at(j, r_ij);
        total += weight;
        for k in 0..N {
            sum[k] += weight * value[k];
        }
    });
    (total > 0.0).then(|| sum.map(|s| s / total))
}

/// Give each solid particle of `field` the Shepard average of what `at(field, j, r_ij)` says of the flowing neighbours, as `of` makes it
/// of N numbers; of zeros without neighbours. `kind` is that of the real particles. Images are renewed before and after.
fn extrapolate<T: Mirrored<D> + Poison, const D: usize, const N: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    kind: &[ParticleKind],
    field: &mut [T],
    at: impl Fn(&[T], usize, Vector<D>) -> [f64; N] + Sync,
    of: impl Fn([f64; N]) -> T + Sync,
) {
    frame.images.fill(field);
    let values = &*field;
    let average = |i| of(shepard(settings, &frame.stencil, i, |j, r_ij| at(values, j, r_ij)).unwrap_or([0.0; N]));
    let solids = (0..kind.len()).into_par_iter().filter(|&i| kind[i] == ParticleKind::Solid);
    let extrapolated: Vec<(usize, T)> = solids.map(|i| (i, average(i))).collect();
    if !extrapolated.is_empty() {
        let real = frame.images.real(field);
        extrapolated.into_iter().for_each(|(i, value)| real[i] = value);
        frame.images.fill(field);
    }
}

/// Solid particles show the mean of what the fluid around them has: ∂/∂n = 0.
pub fn extrapolate_scalar<const D: usize>(settings: &Settings, frame: &Frame<D>, kind: &[ParticleKind], field: &mut [f64]) {
    extrapolate(settings, frame, kind, field, |field, j, _| [field[j]], |[mean]| mean);
}

/// [`extrapolate_scalar`] of a vector.
pub fn extrapolate_vector<const D: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    kind: &[ParticleKind],
    field: &mut [Vector<D>],
) {
    extrapolate(settings, frame, kind, field, |field, j, _| field[j].into(), Vector::<D>::from);
}

/// The pressure of solid particles: the Shepard average of the fluid's, with the hydrostatic term (Adami, Hu and Adams 2012, eq. 27; bodies
/// do not accelerate) or continued along its `gradient`, which only the rule [`WallPressure::Linear`] reads.
pub fn extrapolate_pressure<const D: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    Particles { real, kind, pressure, .. }: &mut Particles<D>,
    gradient: &[Vector<D>],
) {
    let hydrostatic = Vector::<D>::from_column_slice(&settings.body_force) * settings.density;
    let slope = |j: usize| if settings.wall_pressure == WallPressure::Linear { gradient[j] } else { hydrostatic };
    let continued = |pressure: &[f64], j: usize, r_ij: Vector<D>| [pressure[j] + slope(j).dot(&r_ij)];
    extrapolate(settings, frame, &kind[..*real], pressure, continued, |[pressure]| pressure);
}

/// `f(j, W_ij, r_ij)` for those of the neighbours `near` of particle `i`, each with how much is seen of it, a factor of W, that are in its
/// support. Others of its cluster's may be there too, and what they carry may be stale.
pub fn for_each_weighted<const D: usize>(
    settings: &Settings,
    stencil: &Stencil<D>,
    i: usize,
    near: impl Iterator<Item = (Entry, f64)>,
    mut f: impl FnMut(usize, f64, Vector<D>),
) {
    with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        for (entry, share) in near {
            let r_ij = stencil.position[i] - stencil.position[entry.j()];
            let weight = share * kernel.value(r_ij.norm());
            if weight != 0.0 {
                f(entry.j(), weight, r_ij);
            }
        }
    });
}
