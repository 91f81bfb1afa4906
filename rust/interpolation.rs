//! Values of the fluid at any point: linear moving least squares.

use crate::kernel::Smoothing;
use crate::neighbours::Grid;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::Settings;
use crate::with_kernel;
use nalgebra::{DMatrix, DVector};

/// Pressure and velocity at `point` from the fluid around it, exact for linear fields; None where no fluid is near.
pub fn interpolate<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    grid: &Grid<D>,
    point: &Vector<D>,
) -> Option<(f64, Vector<D>)> {
    if !point.iter().all(|x| x.is_finite()) {
        return None;
    }
    let radius = settings.support_radius();
    let mut near = Vec::new();
    grid.for_each_run(&[*point], |run| {
        near.extend(run.indices.iter().map(|&j| j as usize).filter(|&j| {
            particles.kind[j] != ParticleKind::Solid && (particles.position[j] - point).norm_squared() < radius * radius
        }));
    });
    let weights = with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        shape_functions(&near, radius, particles, point, |distance| kernel.value(distance))
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
    kernel: impl Fn(f64) -> f64,
) -> Option<Vec<f64>> {
    let basis = |j: usize| {
        let r = (particles.position[j] - point) / radius;
        DVector::from_fn(D + 1, |k, _| if k == 0 { 1.0 } else { r[k - 1] })
    };
    let weight = |j: usize| kernel((particles.position[j] - point).norm());
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
