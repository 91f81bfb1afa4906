//! Shepard averages of the fluid around a particle, and what solid particles show of it: pressure (20), divergence, gradients.

use crate::base::Vector;
use crate::discretisation::{Gradient, Stencil};
use crate::forcing::BodyForce;
use crate::frame::Frame;
use crate::halo::{Mirrored, Poison};
use crate::kernel::{Smoothing, with_kernel};
use crate::neighbours::Entry;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::settings::{Settings, WallPressure};

/// Σ W field_j / Σ W over the flowing neighbours of particle `i`, of the value that `at` gives for j and r_ij. None without
/// neighbours.
pub fn shepard<const D: usize, const N: usize>(
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

/// Give each solid particle i of `field` the Shepard average of what `at(field, i, j, r_ij)` says of the flowing neighbours, as `of` makes it
/// of N numbers; of zeros without neighbours. `kind` is that of the real particles. Images are renewed before and after.
fn extrapolate<T: Mirrored<D> + Poison, const D: usize, const N: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    kind: &[ParticleKind],
    field: &mut [T],
    at: impl Fn(&[T], usize, usize, Vector<D>) -> [f64; N] + Sync,
    of: impl Fn([f64; N]) -> T + Sync,
) {
    frame.images.fill(field);
    let values = &*field;
    let average = |i| of(shepard(settings, &frame.stencil, i, |j, r_ij| at(values, i, j, r_ij)).unwrap_or([0.0; N]));
    let extrapolated = of_solids(kind, average);
    if !extrapolated.is_empty() {
        let real = frame.images.real(field);
        extrapolated.into_iter().for_each(|(i, value)| real[i] = value);
        frame.images.fill(field);
    }
}

/// Solid particles show the mean of what the fluid around them has: ∂/∂n = 0.
pub fn extrapolate_scalar<const D: usize>(settings: &Settings, frame: &Frame<D>, kind: &[ParticleKind], field: &mut [f64]) {
    extrapolate(settings, frame, kind, field, |field, _, j, _| [field[j]], |[mean]| mean);
}

/// [`extrapolate_scalar`] of a vector.
pub fn extrapolate_vector<const D: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    kind: &[ParticleKind],
    field: &mut [Vector<D>],
) {
    extrapolate(settings, frame, kind, field, |field, _, j, _| field[j].into(), Vector::<D>::from);
}

/// Renew the pressure of images and solids from that of the fluid. `gradient` is memory to be used.
pub fn extend_pressure<const D: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    particles: &mut Particles<D>,
    body_force: &BodyForce<D>,
    gradient: &mut Vec<Vector<D>>,
) {
    frame.images.fill(&mut particles.pressure);
    if settings.wall_pressure == WallPressure::Linear {
        frame.images.blank(gradient, particles.len());
        frame.stencil.evaluate_near_solids(Gradient(&particles.pressure), frame.images.real(gradient));
        frame.images.fill(gradient);
    }
    extrapolate_pressure(settings, frame, particles, gradient, body_force);
}

/// The pressure of solid particles: the Shepard average of the fluid's, with the hydrostatic term less the body's acceleration (Adami, Hu and
/// Adams 2012, eq. 27) or continued along its `gradient`, which only the rule [`WallPressure::Linear`] reads.
pub fn extrapolate_pressure<const D: usize>(
    settings: &Settings,
    frame: &Frame<D>,
    Particles { real, kind, pressure, .. }: &mut Particles<D>,
    gradient: &[Vector<D>],
    body_force: &BodyForce<D>,
) {
    let linear = settings.wall_pressure == WallPressure::Linear;
    let slope = |i: usize, j: usize| {
        if linear { gradient[j] } else { (body_force.at(j) - body_force.acceleration_of_wall(i)) * settings.density }
    };
    let continued = |pressure: &[f64], i: usize, j: usize, r_ij: Vector<D>| [pressure[j] + slope(i, j).dot(&r_ij)];
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
    with_kernel!(settings.kernel, kernel => {
        let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
        for (entry, share) in near {
            let r_ij = stencil.position[i] - stencil.position[entry.j()];
            let weight = share * kernel.value(r_ij.norm());
            if weight != 0.0 {
                f(entry.j(), weight, r_ij);
            }
        }
    });
}
