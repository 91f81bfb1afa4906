//! The pressure that acts, and values of the fluid at any point: quadratic moving least squares.

use crate::base::{Matrix, Vector, parallel};
use crate::boundary::shepard;
use crate::discretisation::Stencil;
use crate::frame::Frame;
use crate::halo::Mirrored;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use std::collections::HashMap;

/// How near to a point the nearest fluid that is seen from there is where there is fluid [Δx]: 0.71 and 0.87 at the most amid a lattice of two
/// and three dimensions. Beside a free surface the air begins nearer.
const FARTHEST: [f64; 2] = [1.5, 1.0];

/// Largest sum of the moduli of the weights of a fit, whose sum is one.
const LARGEST_AMPLIFICATION: f64 = 8.0;

/// What ∇p of a particle counts in a fit beside its p: as much as a difference of pressure over so many Δx. Where p errs from layer to
/// layer, which its gradient sees less of, a fit of p alone reads that at a surface several times over; next to walls the gradient errs,
/// too, so that a smooth p is read better alone.
const GRADIENT_SPAN: f64 = 0.25;

/// The pressure of particles and images: what they keep of it and, of what else pushed the fluid in the last step, the mean over the
/// kernel's support. Next to walls that alternates from layer to layer, which no gradient sees and no fit can read. It takes about as
/// long as a pass; what is not `wanted` of the real particles stays without.
pub fn smooth_acting_pressure<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    Frame { stencil, images, .. }: &Frame<D>,
    wanted: impl Fn(usize) -> bool + Sync,
) -> Vec<f64> {
    let Particles { pressure, unkept_pressure, .. } = particles;
    let mut acting = pressure.clone();
    if settings.has_unkept_pressure() {
        parallel::for_each(images.real(&mut acting), |i, acting| {
            if wanted(i)
                && let Some([mean]) = shepard(settings, stencil, i, |j, _| [unkept_pressure[j]])
            {
                *acting += mean;
            }
        });
        images.fill(&mut acting);
    }
    acting
}

/// The pressure that acts near some points, of particles and images, and where it alternates how it changes there, of real particles.
pub struct ActingPressure<const D: usize> {
    value: Vec<f64>,
    slope: HashMap<usize, Slope<D>>,
}

impl<const D: usize> ActingPressure<D> {
    /// That near `points`; the stencil's corrections are known where the pressure alternates.
    pub fn near(settings: &Settings, particles: &Particles<D>, frame: &Frame<D>, points: &[Vector<D>]) -> Self {
        let mut near = vec![false; particles.real];
        for point in points {
            for_each_near(settings, particles, frame, point, |j| near[frame.images.source(particles.real, j)] = true);
        }
        let mut sloped = Vec::new();
        let mut wanted = near.clone();
        if settings.pressure_alternates() {
            sloped = parallel::filter(particles.real, |i| near[i] && particles.kind[i] != ParticleKind::Solid);
            for &i in &sloped {
                let row = frame.stencil.neighbours.row(i).0;
                row.all().iter().for_each(|entry| wanted[frame.images.source(particles.real, entry.j())] = true);
            }
        }
        let value = smooth_acting_pressure(settings, particles, frame, |i| wanted[i]);
        let slope = sloped.into_par_iter().filter_map(|i| Some((i, Slope::of(&frame.stencil, &value, i)?))).collect();
        Self { value, slope }
    }
}

/// How a field changes next to a particle, as its neighbours tell.
#[derive(Clone, Copy)]
struct Slope<const D: usize> {
    /// Its gradient, exact for linear fields. (15)
    gradient: Vector<D>,
    /// The same of r_k r_l about the particle, whose true one is zero: entry (m, l) of the k-th is that along m.
    bend: [Matrix<D>; D],
}

impl<const D: usize> Slope<D> {
    /// None where too few neighbours tell of it.
    fn of(Stencil { neighbours, position, correction, .. }: &Stencil<D>, field: &[f64], i: usize) -> Option<Self> {
        let inverse = (!correction[i].is_singular()).then_some(correction[i].inverse)?;
        let (mut gradient, mut bend) = (Vector::zeros(), [Matrix::zeros(); D]);
        let (row, lane) = neighbours.row(i);
        for entry in row.all() {
            let r_ij = position[i] - position[entry.j()];
            let weight = inverse * r_ij * entry.slope(lane);
            gradient += weight * (field[entry.j()] - field[i]);
            bend.iter_mut().enumerate().for_each(|(k, bend)| *bend += weight * r_ij.transpose() * r_ij[k]);
        }
        Some(Self { gradient, bend })
    }
}

impl<const D: usize> Mirrored<D> for Slope<D> {
    fn mirrored(self, sign: &Vector<D>) -> Self {
        let bend = |k: usize| Matrix::from_fn(|m, l| sign[k] * sign[m] * sign[l] * self.bend[k][(m, l)]);
        Self { gradient: self.gradient.mirrored(sign), bend: std::array::from_fn(bend) }
    }
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

/// Pressure and velocity at `point` from the fluid around it that is seen from there, the particles having the `pressure` near it: exact for
/// quadratic fields, for linear ones where few particles are near. None where no fluid is within 1.5 Δx, or Δx beside a free surface.
pub fn interpolate<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    pressure: &ActingPressure<D>,
    point: &Vector<D>,
) -> Option<(f64, Vector<D>)> {
    let (mut near, mut solid) = (Vec::new(), Vec::new());
    for_each_near(settings, particles, frame, point, |j| {
        if particles.kind[j] == ParticleKind::Solid { solid.push(j) } else { near.push(j) }
    });
    let slope = |&j: &usize| {
        let slope = pressure.slope.get(&frame.images.source(particles.real, j));
        slope.map(|slope| frame.images.at_source(particles.real, j, *slope))
    };
    let around = Around {
        radius: settings.support_radius(),
        spacing: settings.particle_spacing,
        away: near.iter().map(|&j| particles.position[j] - point).collect(),
        weights: with_kernel!(settings.kernel, kernel => {
            let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
            let seen = |j: usize| frame.faces.sight(particles, settings.particle_spacing, &solid, point, &particles.position[j]);
            near.iter().map(|&j| seen(j) * kernel.value((particles.position[j] - point).norm())).collect()
        }),
    };
    let farthest = FARTHEST[usize::from(settings.free_surface.is_some())] * settings.particle_spacing;
    if !around.away.iter().zip(&around.weights).any(|(r, weight)| *weight > 0.0 && r.norm() <= farthest) {
        return None;
    }
    let slopes: Vec<_> = near.iter().map(slope).collect();
    let of_velocity = around.weigh(&vec![None; near.len()])?;
    let has_slopes = slopes.iter().any(Option::is_some);
    let of_pressure = if has_slopes { &around.weigh(&slopes)? } else { &of_velocity };
    let values = near.iter().zip(&of_pressure.value).map(|(&j, w)| pressure.value[j] * w).sum::<f64>();
    let gradients = slopes.iter().zip(&of_pressure.gradient).map(|(slope, w)| slope.map_or(0.0, |s| s.gradient.dot(w)));
    let velocity = near.iter().zip(&of_velocity.value).map(|(&j, w)| particles.velocity[j] * *w).sum();
    Some((values + gradients.sum::<f64>(), velocity))
}

/// What the value of each particle, and its gradient, count in an interpolated value.
struct Weights<const D: usize> {
    value: Vec<f64>,
    gradient: Vec<Vector<D>>,
}

/// The fluid around a point.
struct Around<const D: usize> {
    radius: f64,
    spacing: f64,
    /// Where the particles are, from the point.
    away: Vec<Vector<D>>,
    /// What they count in a fit.
    weights: Vec<f64>,
}

impl<const D: usize> Around<D> {
    /// The weights of the fit of a quadratic field to values and, where there are, slopes or, where that would make too much of what
    /// the particles differ by, as far outside, of a linear one, or of the mean.
    fn weigh(&self, slopes: &[Option<Slope<D>>]) -> Option<Weights<D>> {
        let total: f64 = self.weights.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let sound = |fit: &Weights<D>| {
            let of_gradients: f64 = fit.gradient.iter().map(|w| w.norm()).sum();
            fit.value.iter().map(|w| w.abs()).sum::<f64>() + of_gradients / self.spacing < LARGEST_AMPLIFICATION
        };
        let (quadratic, all_told) = self.fit(D * (D + 3) / 2, slopes, total);
        let fitted = if all_told && sound(&quadratic) { quadratic } else { self.fit(D, slopes, total).0 };
        Some(if sound(&fitted) {
            fitted
        } else {
            let value = self.weights.iter().map(|w| w / total).collect();
            Weights { value, gradient: vec![Vector::zeros(); slopes.len()] }
        })
    }

    /// The weights of the least-squares fit of one and `count` functions that vanish at the point; and whether the particles tell of
    /// all of these: those that too few, or collinear ones, do not tell of are taken as zero.
    fn fit(&self, count: usize, slopes: &[Option<Slope<D>>], total: f64) -> (Weights<D>, bool) {
        let span = GRADIENT_SPAN * self.spacing;
        let functions: Vec<_> = self.away.iter().map(|r| self.functions(r, count)).collect();
        // Along each axis what the slopes say of the functions, beside what they say of the field, both times `span`.
        let derivatives: Vec<Option<[DVector<f64>; D]>> = slopes
            .iter()
            .zip(&self.away)
            .map(|(slope, r)| slope.as_ref().map(|slope| self.derivatives(r, &slope.bend, count).map(|row| row * span)))
            .collect();
        // About the mean, where the fit is the mean of the values whatever its coefficients.
        let mean = functions.iter().zip(&self.weights).fold(DVector::zeros(count), |mean, (f, w)| mean + f * (w / total));
        let mut moments = DMatrix::zeros(count, count);
        for ((f, rows), w) in functions.iter().zip(&derivatives).zip(&self.weights) {
            let deviation = f - &mean;
            moments.ger(*w, &deviation, &deviation, 1.0);
            rows.iter().flatten().for_each(|row| moments.ger(*w, row, row, 1.0));
        }
        // Not by singular values: nalgebra's are wrong by 4e-4 for some matrices of three dimensions.
        let SymmetricEigen { eigenvalues, eigenvectors } = moments.symmetric_eigen();
        let told = eigenvalues.map(|value| if value > 1e-6 * total { 1.0 / value } else { 0.0 });
        let slope = &eigenvectors * (eigenvectors.transpose() * &mean).component_mul(&told);
        let value = functions.iter().zip(&self.weights).map(|(f, w)| w * (1.0 / total - (f - &mean).dot(&slope))).collect();
        let of_gradient = |(rows, w): (&Option<[DVector<f64>; D]>, &f64)| {
            rows.as_ref().map_or_else(Vector::zeros, |rows| Vector::from_fn(|m, _| -w * span * rows[m].dot(&slope)))
        };
        let gradient = derivatives.iter().zip(&self.weights).map(of_gradient).collect();
        (Weights { value, gradient }, told.iter().all(|told| *told > 0.0))
    }

    /// The first `count` of r_k, then r_k r_l, in radii.
    fn functions(&self, r: &Vector<D>, count: usize) -> DVector<f64> {
        let r = r / self.radius;
        let products = pairs::<D>().map(|(k, l)| r[k] * r[l]);
        DVector::from_iterator(count, r.iter().copied().chain(products).take(count))
    }

    /// What a slope with this `bend` says of these functions along each axis.
    fn derivatives(&self, r: &Vector<D>, bend: &[Matrix<D>; D], count: usize) -> [DVector<f64>; D] {
        std::array::from_fn(|m| {
            let along = |k: usize| f64::from(k == m);
            let products = pairs::<D>().map(|(k, l)| along(k) * r[l] + along(l) * r[k] + bend[k][(m, l)]);
            let rows = (0..D).map(|k| along(k) * self.radius).chain(products);
            DVector::from_iterator(count, rows.map(|row| row / self.radius.powi(2)).take(count))
        })
    }
}

/// Every two axes, once.
fn pairs<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|k| (0..=k).map(move |l| (k, l)))
}
