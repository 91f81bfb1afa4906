//! Values of the fluid at any point: linear moving least squares.

use crate::frame::Frame;
use crate::kernel::Smoothing;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::Settings;
use crate::with_kernel;
use nalgebra::{DMatrix, DVector};

/// Pressure and velocity at `point` from the fluid around it that is seen from there, exact for linear fields; None where no fluid is
/// near.
pub fn interpolate<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    Frame { grid, faces, .. }: &Frame<D>,
    point: &Vector<D>,
) -> Option<(f64, Vector<D>)> {
    if !point.iter().all(|x| x.is_finite()) {
        return None;
    }
    let radius = settings.support_radius();
    let (mut near, mut solid) = (Vec::new(), Vec::new());
    grid.for_each_run(&[*point], |run| {
        let inside = run.indices.iter().map(|&j| j as usize);
        for j in inside.filter(|&j| (particles.position[j] - point).norm_squared() < radius * radius) {
            if particles.kind[j] == ParticleKind::Solid { solid.push(j) } else { near.push(j) }
        }
    });
    let weights = with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        let seen = |place: &Vector<D>| faces.sight(particles, settings.particle_spacing, &solid, point, place);
        shape_functions(&near, radius, particles, point, |place: &Vector<D>, distance| seen(place) * kernel.value(distance))
    })?;
    let pressure = near.iter().zip(&weights).map(|(&j, w)| particles.pressure[j] * w).sum();
    let velocity = near.iter().zip(&weights).map(|(&j, w)| particles.velocity[j] * *w).sum();
    Some((pressure, velocity))
}

/// The weight of each particle in `near` in the interpolated value.
fn shape_functions<const D: usize>(
    near: &[usize],
    radius: f64,
    particles: &Particles<D>,
    point: &Vector<D>,
    weight: impl Fn(&Vector<D>, f64) -> f64,
) -> Option<Vec<f64>> {
    let basis = |j: usize| {
        let r = (particles.position[j] - point) / radius;
        DVector::from_fn(D + 1, |k, _| if k == 0 { 1.0 } else { r[k - 1] })
    };
    let weight = |j: usize| weight(&particles.position[j], (particles.position[j] - point).norm());
    let mut moments = DMatrix::zeros(D + 1, D + 1);
    for &j in near {
        let p = basis(j);
        moments += &p * p.transpose() * weight(j);
    }
    let total = moments[(0, 0)];
    if total <= 0.0 {
        return None;
    }
    let one = DVector::from_fn(D + 1, |k, _| if k == 0 { 1.0 } else { 0.0 });
    // Too few or collinear particles leave only the Shepard average.
    let coefficients = moments.svd(true, true).solve(&one, 1e-6 * total).unwrap_or_else(|_| &one / total);
    Some(near.iter().map(|&j| coefficients.dot(&basis(j)) * weight(j)).collect())
}
