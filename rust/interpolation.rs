//! The pressure that acts, and values of the fluid at any point: quadratic moving least squares.

use crate::base::{Vector, parallel};
use crate::boundary::shepard;
use crate::frame::Frame;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Largest sum of the moduli of the weights of a fit, whose sum is one.
const LARGEST_AMPLIFICATION: f64 = 8.0;

/// The pressure of particles and images: what they keep of it and, of what else pushed the fluid in the last step, the mean over the
/// kernel's support. Next to walls that alternates from layer to layer, which no gradient sees and no fit can read. It takes about as
/// long as a pass; what is not `wanted` of the real particles stays without.
pub fn smooth_acting_pressure<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    Frame { stencil, images, .. }: &Frame<D>,
    wanted: impl Fn(usize) -> bool + Sync,
) -> Vec<f64> {
    let Particles { kind, pressure, unkept_pressure, .. } = particles;
    let mut acting = pressure.clone();
    if settings.has_unkept_pressure() {
        parallel::for_each(images.real(&mut acting), |i, acting| {
            if wanted(i)
                && kind[i] != ParticleKind::Solid
                && let Some([mean]) = shepard(settings, stencil, i, |j, _| [unkept_pressure[j]])
            {
                *acting += mean;
            }
        });
        images.fill(&mut acting);
    }
    acting
}

/// Whether each real particle, or an image of it, is near any of `points`.
pub fn is_near<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    points: &[Vector<D>],
) -> Vec<bool> {
    let mut is_near = vec![false; particles.real];
    for point in points {
        for_each_near(settings, particles, frame, point, |j| is_near[frame.images.source(particles.real, j)] = true);
    }
    is_near
}

/// `f` for every particle and image less than the support radius away from `point`.
fn for_each_near<const D: usize>(
    settings: &Settings,
    Particles { position, .. }: &Particles<D>,
    Frame { grid, .. }: &Frame<D>,
    point: &Vector<D>,
    mut f: impl FnMut(usize),
) {
    let radius = settings.support_radius();
    if point.iter().all(|x| x.is_finite()) {
        grid.for_each_run(&[*point], |run| {
            let indices = run.indices.iter().map(|&j| j as usize);
            indices.filter(|&j| (position[j] - point).norm_squared() < radius * radius).for_each(&mut f);
        });
    }
}

/// Pressure and velocity at `point` from the fluid around it that is seen from there, the particles having such a `pressure`: exact for
/// quadratic fields, for linear ones where few particles are near. None where no fluid is near.
pub fn interpolate<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    pressure: &[f64],
    point: &Vector<D>,
) -> Option<(f64, Vector<D>)> {
    let radius = settings.support_radius();
    let (mut near, mut solid) = (Vec::new(), Vec::new());
    for_each_near(settings, particles, frame, point, |j| {
        if particles.kind[j] == ParticleKind::Solid { solid.push(j) } else { near.push(j) }
    });
    let weights = with_kernel!(settings.kernel, kernel => {
        let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
        let seen = |place: &Vector<D>| frame.faces.sight(particles, settings.particle_spacing, &solid, point, place);
        shape_functions(&near, radius, particles, point, |place: &Vector<D>, distance| seen(place) * kernel.value(distance))
    })?;
    let pressure = near.iter().zip(&weights).map(|(&j, w)| pressure[j] * w).sum();
    let velocity = near.iter().zip(&weights).map(|(&j, w)| particles.velocity[j] * *w).sum();
    Some((pressure, velocity))
}

/// The weight of each particle in `near` in the interpolated value: that of the fit of a quadratic field or, where that would make too much
/// of what the particles differ by, as far outside, of a linear one, or of the mean.
fn shape_functions<const D: usize>(
    near: &[usize],
    radius: f64,
    particles: &Particles<D>,
    point: &Vector<D>,
    weight: impl Fn(&Vector<D>, f64) -> f64,
) -> Option<Vec<f64>> {
    let away: Vec<_> = near.iter().map(|&j| (particles.position[j] - point) / radius).collect();
    let weights: Vec<f64> =
        near.iter().zip(&away).map(|(&j, away)| weight(&particles.position[j], radius * away.norm())).collect();
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return None;
    }
    // r_k, then r_k r_l.
    let functions = |r: &Vector<D>, count: usize| {
        let products = (0..D).flat_map(|k| (0..=k).map(move |l| r[k] * r[l]));
        DVector::from_iterator(count, r.iter().copied().chain(products).take(count))
    };
    let fits = [D * (D + 3) / 2, D].map(|count| {
        let functions: Vec<_> = away.iter().map(|r| functions(r, count)).collect();
        fit(&functions, &weights, total)
    });
    let sound = |fit: &Vec<f64>| fit.iter().map(|weight| weight.abs()).sum::<f64>() < LARGEST_AMPLIFICATION;
    let [(quadratic, all_told), (linear, _)] = fits;
    let fitted = if all_told && sound(&quadratic) { quadratic } else { linear };
    Some(if sound(&fitted) { fitted } else { weights.iter().map(|w| w / total).collect() })
}

/// What each value counts in the value at the point of the least-squares fit of one and functions that vanish there; and whether the
/// particles tell of all of these: those that too few, or collinear ones, do not tell of are taken as zero.
fn fit(functions: &[DVector<f64>], weights: &[f64], total: f64) -> (Vec<f64>, bool) {
    let count = functions[0].len();
    // About the mean, where the fit is the mean of the values whatever its coefficients.
    let mean = functions.iter().zip(weights).fold(DVector::zeros(count), |mean, (f, w)| mean + f * (w / total));
    let mut moments = DMatrix::zeros(count, count);
    for (f, w) in functions.iter().zip(weights) {
        let deviation = f - &mean;
        moments.ger(*w, &deviation, &deviation, 1.0);
    }
    // Not by singular values: nalgebra's are wrong by 4e-4 for some matrices of three dimensions.
    let SymmetricEigen { eigenvalues, eigenvectors } = moments.symmetric_eigen();
    let told = eigenvalues.map(|value| if value > 1e-6 * total { 1.0 / value } else { 0.0 });
    let slope = &eigenvectors * (eigenvectors.transpose() * &mean).component_mul(&told);
    let counts = functions.iter().zip(weights).map(|(f, w)| w * (1.0 / total - (f - &mean).dot(&slope))).collect();
    (counts, told.iter().all(|told| *told > 0.0))
}
