//! The stencil: all that the derivatives need to know of the particle positions of one frame. (14) (17)

use crate::kernel::{BLOCK, Kernel, Smoothing};
use crate::neighbours::{NeighbourList, Row, Slope};
use crate::operators::Neighbourhood;
use crate::particles::{Matrix, Particles, Vector};
use crate::settings::Settings;
use crate::with_kernel;

/// Inverse correction tensors with a larger norm are taken for singular: too few neighbours for a gradient.
const SINGULAR: f64 = 1e3;

/// The square of a distance at which every kernel is zero, for the unused entries of a block.
const FAR: f64 = 1e100;

#[derive(Debug, Default)]
pub struct Stencil<const D: usize> {
    pub neighbours: NeighbourList,
    /// Positions that the stencil was evaluated at, of real particles and images.
    pub position: Vec<Vector<D>>,
    /// V_i = 1 / Σ_j W_ij, of real particles and images.
    pub volume: Vec<f64>,
    /// Correction of the real particles.
    pub correction: Vec<Correction<D>>,
}

/// What the sums over a particle's neighbours are corrected with.
#[derive(Clone, Copy, Debug)]
pub struct Correction<const D: usize> {
    /// α⁻¹, or the identity where α is singular.
    pub inverse: Matrix<D>,
    /// −2(D+2) / (2 + tr α).
    pub laplacian: f64,
}

impl<const D: usize> Stencil<D> {
    /// Volumes, slopes and corrections at the present positions. `mirror` copies the volumes of real particles to their images.
    pub fn evaluate(&mut self, settings: &Settings, particles: &Particles<D>, mirror: impl Fn(&mut [f64])) {
        self.position.clone_from(&particles.position);
        self.volume.resize(particles.len(), 0.0);
        self.correction.resize(particles.real, Correction::of(&Matrix::identity()));
        with_kernel!(settings.kernel, K => self.volumes(Smoothing::<K>::new(settings.smoothing_length(), D), settings.particle_spacing.powi(D as i32)));
        mirror(&mut self.volume);
        self.corrections(settings.particle_spacing.powi(D as i32));
    }

    /// V_i, and the slopes with the nominal volume Δx^D in the place of V_j, lest f32 overflow in small units.
    fn volumes<K: Kernel>(&mut self, kernel: Smoothing<K>, nominal: f64) {
        let position = &self.position;
        let real = self.correction.len();
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
                        pair.slope = (nominal * slope) as Slope;
                    }
                }
                *volume = 1.0 / sum;
            },
        );
    }

    /// V_j into the slopes, and the correction tensor (17) from the slopes as stored.
    fn corrections(&mut self, nominal: f64) {
        let (volume, position) = (&self.volume, &self.position);
        let real = self.correction.len();
        self.neighbours.for_each_mut(
            &mut self.correction,
            &mut vec![(); real],
            #[inline(always)]
            |i, pairs, correction, ()| {
                let mut alpha = Matrix::<D>::zeros();
                for pair in pairs {
                    let r_ij = position[i] - position[pair.j()];
                    pair.slope = (volume[pair.j()] / nominal * pair.slope()) as Slope;
                    alpha -= r_ij * r_ij.transpose() * pair.slope();
                }
                *correction = Correction::of(&alpha);
            },
        );
    }

    /// `f(neighbourhood of i, &mut a[i], &mut b[i])` for every real particle, in parallel. Mark `f` `#[inline(always)]`.
    #[inline(always)]
    pub fn for_each<A: Send, B: Send>(
        &self,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(Neighbourhood<D>, &mut A, &mut B) + Sync + Send,
    ) {
        self.neighbours.for_each(
            a,
            b,
            #[inline(always)]
            |i, row, a, b| f(self.neighbourhood(i, row), a, b),
        );
    }

    /// `f(neighbourhood of i, &mut out[i])` for every real particle, in parallel. Mark `f` `#[inline(always)]`.
    #[inline(always)]
    pub fn for_each_one<A: Send>(&self, out: &mut [A], f: impl Fn(Neighbourhood<D>, &mut A) + Sync + Send) {
        // A vector of () takes no memory.
        let mut nothing = vec![(); out.len()];
        self.for_each(
            out,
            &mut nothing,
            #[inline(always)]
            |near, out, ()| f(near, out),
        );
    }

    /// The neighbourhood of real particle `i`.
    pub fn at(&self, i: usize) -> Neighbourhood<'_, D> {
        self.neighbourhood(i, self.neighbours.row(i))
    }

    #[inline(always)]
    fn neighbourhood<'a>(&'a self, i: usize, row: Row<'a>) -> Neighbourhood<'a, D> {
        Neighbourhood { i, row, position: &self.position, correction: &self.correction[i] }
    }
}

impl<const D: usize> Correction<D> {
    #[inline(always)]
    fn of(alpha: &Matrix<D>) -> Self {
        let inverse = match alpha.try_inverse() {
            Some(inverse) if inverse.norm() < SINGULAR => inverse,
            _ => Matrix::identity(),
        };
        Self { inverse, laplacian: -2.0 * (D as f64 + 2.0) / (2.0 + alpha.trace()) }
    }
}
