//! Values of the fluid at any point: linear moving least squares.

use crate::base::Vector;
use crate::frame::Frame;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;
use nalgebra::{DMatrix, SymmetricEigen};

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

/// The weight of each particle in `near` in the interpolated value: that of the fit of a linear field, whose slope in directions that too
/// few or collinear particles do not tell of is taken as zero.
fn shape_functions<const D: usize>(
    near: &[usize],
    radius: f64,
    particles: &Particles<D>,
    point: &Vector<D>,
    weight: impl Fn(&Vector<D>, f64) -> f64,
) -> Option<Vec<f64>> {
    let away = |j: usize| (particles.position[j] - point) / radius;
    let weights: Vec<f64> = near.iter().map(|&j| weight(&particles.position[j], radius * away(j).norm())).collect();
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return None;
    }
    // About the mean of the places, where the fit is the mean of the values whatever its slope.
    let mean = near.iter().zip(&weights).map(|(&j, w)| away(j) * (w / total)).sum::<Vector<D>>();
    let mut moments = DMatrix::zeros(D, D);
    for (&j, w) in near.iter().zip(&weights) {
        let r = away(j) - mean;
        moments += r * r.transpose() * *w;
    }
    // Not by singular values: nalgebra's are wrong by 4e-4 for some matrices of three dimensions.
    let SymmetricEigen { eigenvalues, eigenvectors } = moments.symmetric_eigen();
    let told = eigenvalues.map(|value| if value > 1e-6 * total { 1.0 / value } else { 0.0 });
    let slope = &eigenvectors * (eigenvectors.transpose() * mean).component_mul(&told);
    Some(near.iter().zip(&weights).map(|(&j, w)| w * (1.0 / total - (away(j) - mean).dot(&slope))).collect())
}
