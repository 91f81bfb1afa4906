//! Solid walls: what velocity and pressure a solid particle shows to the fluid. (20)

use crate::kernel::{Kernel, Smoothing};
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::{Settings, WallVelocity};
use crate::stencil::Stencil;
use crate::with_kernel;
use rayon::prelude::*;

/// Largest ratio of the distances of solid and fluid from the surface: β_max − 1 of Morris, Fox and Zhu (1997).
const LARGEST_DISTANCE_RATIO: f64 = 0.5;

/// The wall rule of a simulation.
#[derive(Debug)]
pub struct Walls<const D: usize> {
    rule: WallVelocity,
    /// Velocity that solid particles show to the viscous term, real particles and images (not used by the pairwise rule).
    pub viscous_velocity: Vec<Vector<D>>,
}

impl<const D: usize> Walls<D> {
    pub fn new(settings: &Settings) -> Self {
        Self { rule: settings.wall_velocity, viscous_velocity: Vec::new() }
    }

    /// Velocity of solid particle `s` in the viscous term of particle `i`. To one another solids show the wall's velocity.
    #[inline(always)]
    pub fn seen_by(&self, particles: &Particles<D>, s: usize, i: usize) -> Vector<D> {
        if particles.kind[i] == ParticleKind::Solid {
            return particles.velocity[s];
        }
        match self.rule {
            WallVelocity::Paper => particles.velocity[s],
            WallVelocity::Adami => self.viscous_velocity[s],
            WallVelocity::Morris => {
                let depth = particles.depth[s];
                let height = (particles.position[i] - particles.position[s]).dot(&particles.normal[s]) - depth;
                let ratio = (depth / height.max(f64::MIN_POSITIVE)).min(LARGEST_DISTANCE_RATIO);
                particles.velocity[s] - (particles.velocity[i] - particles.velocity[s]) * ratio
            }
        }
    }
}

/// Σ W field_j / Σ W over the flowing neighbours of particle `i`, of the value that `at` gives for j and r_ij. None without
/// neighbours.
pub fn shepard<const D: usize, const N: usize>(
    settings: &Settings,
    stencil: &Stencil<D>,
    i: usize,
    at: impl Fn(usize, Vector<D>) -> [f64; N],
) -> Option<[f64; N]> {
    with_kernel!(settings.kernel, K => average(Smoothing::<K>::new(settings.smoothing_length(), D), stencil, i, at))
}

/// Give each solid particle of `field` the Shepard average of what `at(field, j, r_ij)` says of the flowing neighbours; zero
/// without neighbours. `kind` is that of the real particles.
pub fn extrapolate<const D: usize>(
    settings: &Settings,
    stencil: &Stencil<D>,
    kind: &[ParticleKind],
    field: &mut [f64],
    at: impl Fn(&[f64], usize, Vector<D>) -> f64 + Sync,
) {
    let values = &*field;
    let average = |i| shepard(settings, stencil, i, |j, r_ij| [at(values, j, r_ij)]).map_or(0.0, |[average]| average);
    let solids = (0..kind.len()).into_par_iter().filter(|&i| kind[i] == ParticleKind::Solid);
    let extrapolated: Vec<(usize, f64)> = solids.map(|i| (i, average(i))).collect();
    extrapolated.into_iter().for_each(|(i, value)| field[i] = value);
}

fn average<K: Kernel, const D: usize, const N: usize>(
    kernel: Smoothing<K>,
    stencil: &Stencil<D>,
    i: usize,
    at: impl Fn(usize, Vector<D>) -> [f64; N],
) -> Option<[f64; N]> {
    let mut total = 0.0;
    let mut sum = [0.0; N];
    for entry in stencil.neighbours.row(i).0.flowing() {
        let r_ij = stencil.position[i] - stencil.position[entry.j()];
        let weight = kernel.value(r_ij.norm());
        if weight == 0.0 {
            continue; // in the support of another of the cluster, where the value may be stale
        }
        let value = at(entry.j(), r_ij);
        total += weight;
        for k in 0..N {
            sum[k] += weight * value[k];
        }
    }
    (total > 0.0).then(|| sum.map(|s| s / total))
}
