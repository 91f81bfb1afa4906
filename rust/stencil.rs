//! The stencil: all that the derivatives need to know of the particle positions of one frame. (14) (17)

use crate::kernel::{BLOCK, Kernel, Smoothing};
use crate::neighbours::{NeighbourList, Weight};
use crate::particles::{Matrix, Particles, Vector};
use crate::settings::Settings;
use crate::with_kernel;

/// Correction tensors with a smaller determinant are taken for singular: too few neighbours for a gradient.
const SINGULAR: f64 = 1e-3;

/// The square of a distance at which every kernel is zero, for the unused entries of a block.
const FAR: f64 = 1e100;

#[derive(Debug, Default)]
pub struct Stencil<const D: usize> {
    pub neighbours: NeighbourList<D>,
    /// V_i = 1 / Σ_j W_ij, of real particles and images.
    pub volume: Vec<f64>,
    /// 2(D+2) / (2 + tr α_i) of real particles.
    pub laplacian_factor: Vec<f64>,
}

impl<const D: usize> Stencil<D> {
    /// Volumes and pair weights at the present positions. `mirror` copies the volumes of real particles to their images.
    pub fn evaluate(&mut self, settings: &Settings, particles: &Particles<D>, mirror: impl Fn(&mut [f64])) {
        self.volume.resize(particles.len(), 0.0);
        self.laplacian_factor.resize(particles.real, 0.0);
        with_kernel!(settings.kernel, K => self.volumes(Smoothing::<K>::new(settings.smoothing_length(), D), particles));
        mirror(&mut self.volume);
        self.weights(&particles.position);
    }

    /// V_i, and the kernel's slope in the place of the Laplacian weight.
    fn volumes<K: Kernel>(&mut self, kernel: Smoothing<K>, particles: &Particles<D>) {
        let position = &particles.position;
        let real = particles.real;
        self.neighbours.for_each_mut(
            &mut self.volume[..real],
            &mut vec![(); real],
            #[inline(always)]
            |i, pairs, volume, ()| {
                let mut sum = kernel.value(0.0);
                for block in pairs.chunks_mut(BLOCK) {
                    let (mut squares, mut values, mut slopes) = ([FAR; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
                    for (square, pair) in squares.iter_mut().zip(&*block) {
                        *square = (position[i] - position[pair.j()]).norm_squared().max(f64::MIN_POSITIVE);
                    }
                    kernel.evaluate(&squares, &mut values, &mut slopes);
                    sum += values.iter().sum::<f64>();
                    for (slope, pair) in slopes.iter().zip(block) {
                        pair.laplacian = *slope as Weight;
                    }
                }
                *volume = 1.0 / sum;
            },
        );
    }

    /// The correction tensor (17), and the weights with it applied.
    fn weights(&mut self, position: &[Vector<D>]) {
        let volume = &self.volume;
        let real = self.laplacian_factor.len();
        self.neighbours.for_each_mut(
            &mut self.laplacian_factor,
            &mut vec![(); real],
            #[inline(always)]
            |i, pairs, factor, ()| {
                let mut alpha = Matrix::<D>::zeros();
                for pair in pairs.iter() {
                    let r_ij = position[i] - position[pair.j()];
                    alpha -= r_ij * r_ij.transpose() * (volume[pair.j()] * f64::from(pair.laplacian));
                }
                let correction = correction(&alpha);
                *factor = 2.0 * (D as f64 + 2.0) / (2.0 + alpha.trace());
                for pair in pairs {
                    let slope = volume[pair.j()] * f64::from(pair.laplacian);
                    let gradient = correction * (position[i] - position[pair.j()]) * slope;
                    pair.gradient = std::array::from_fn(|k| gradient[k] as Weight);
                    pair.laplacian = (-*factor * slope) as Weight;
                }
            },
        );
    }
}

/// α⁻¹, or the identity where α is singular.
fn correction<const D: usize>(alpha: &Matrix<D>) -> Matrix<D> {
    match alpha.try_inverse() {
        // Of a symmetric matrix: 1/det is the product of the inverse's eigenvalues, bounded by its norm.
        Some(inverse) if inverse.norm() < 1.0 / SINGULAR => inverse,
        _ => Matrix::identity(),
    }
}
