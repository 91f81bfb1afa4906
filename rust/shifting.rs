//! Artificial particle displacement. (18) (19)

use crate::frame::Frame;
use crate::kernel::{Kernel, Smoothing};
use crate::neighbours::Row;
use crate::operators;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::{Settings, Shifting};
use crate::with_kernel;

/// Displace the fluid particles towards an even spacing and carry velocity and pressure along to first order.
/// `particles` stand at r^{n+1}; the derivatives are those of `frame`.
pub fn shift<const D: usize>(
    settings: &Settings,
    particles: &mut Particles<D>,
    frame: &Frame<D>,
    time_step: f64,
    velocity_max: f64,
) {
    if settings.shifting == Shifting::None {
        return;
    }
    let change = with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        displacements(settings, kernel, particles, frame, time_step, velocity_max)
    });
    for (i, (displacement, velocity, pressure)) in change.into_iter().enumerate() {
        particles.position[i] += displacement;
        particles.velocity[i] += velocity;
        particles.pressure[i] += pressure;
    }
}

/// δr, δr·∇u and δr·∇p of every real particle.
fn displacements<K: Kernel, const D: usize>(
    settings: &Settings,
    kernel: Smoothing<K>,
    particles: &Particles<D>,
    frame: &Frame<D>,
    time_step: f64,
    velocity_max: f64,
) -> Vec<(Vector<D>, Vector<D>, f64)> {
    let limit = settings.shift_limit * settings.particle_spacing;
    let mut change = vec![(Vector::zeros(), Vector::zeros(), 0.0); particles.real];
    frame.stencil.neighbours.for_each_one(&mut change, |i, row, (shift, du, dp)| {
        if particles.kind[i] != ParticleKind::Fluid {
            return;
        }
        let local = Surroundings::of(settings, kernel, particles, row, i);
        let speed = match settings.shifting {
            Shifting::Xsph => local.relative_speed,
            _ => settings.shift_coefficient * velocity_max,
        };
        *shift = local.asymmetry * (local.mean_distance * local.mean_distance * speed * time_step);
        let length = shift.norm();
        if length > limit {
            *shift *= limit / length;
        }
        let (velocity, pressure) = (&particles.velocity, &particles.pressure);
        *du = operators::velocity_gradient(row.all(), velocity, velocity[i]) * *shift;
        *dp = operators::gradient(row.all(), pressure, pressure[i]).dot(shift);
    });
    change
}

/// The sums of (18) at one particle.
struct Surroundings<const D: usize> {
    /// Σ r_ij / r_ij³.
    asymmetry: Vector<D>,
    /// r_0.
    mean_distance: f64,
    /// u_v.
    relative_speed: f64,
}

impl<const D: usize> Surroundings<D> {
    #[inline(always)]
    fn of<K: Kernel>(settings: &Settings, kernel: Smoothing<K>, particles: &Particles<D>, row: Row<D>, i: usize) -> Self {
        let radius = settings.support_radius();
        let (mut asymmetry, mut relative) = (Vector::zeros(), Vector::zeros());
        let (mut total, mut distances, mut count) = (kernel.value(0.0), 0.0, 0.0);
        for pair in row.all() {
            let j = pair.j();
            let r_ij = particles.position[i] - particles.position[j];
            let distance = r_ij.norm().max(1e-6 * radius);
            if distance >= radius {
                continue; // in the list only for its skin
            }
            let weight = kernel.value(distance);
            asymmetry += r_ij / (distance * distance * distance);
            relative += (particles.velocity[i] - particles.velocity[j]) * weight;
            total += weight;
            distances += distance;
            count += 1.0;
        }
        let mean_distance = if count > 0.0 { distances / count } else { 0.0 };
        Self { asymmetry, mean_distance, relative_speed: relative.norm() / total }
    }
}
