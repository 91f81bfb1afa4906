//! Solid walls: what velocity a solid particle shows to the fluid.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::average::shepard;
use crate::boundary::profile::profiles;
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::settings::{Settings, WallVelocity};

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
        let average = |i| shepard(settings, &frame.stencil, i, |j, _| velocity[j].into()).map(Vector::from);
        let seen = of_solids(&kind[..*real], |i| average(i).map_or(velocity[i], |average| velocity[i] * 2.0 - average));
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
