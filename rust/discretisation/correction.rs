//! What sums over the neighbours of a particle are corrected with. (17)

use crate::base::{Matrix, Vector};

/// Inverse correction tensors with a larger norm are taken for singular: too few neighbours for a gradient.
const SINGULAR: f64 = 1e3;

/// What the sums over a particle's neighbours are corrected with.
#[derive(Clone, Copy, Debug)]
pub struct Correction<const D: usize> {
    /// α⁻¹, or the identity where α is singular.
    pub inverse: Matrix<D>,
    /// −2(D+2) / (2 + tr α).
    pub laplacian: f64,
    /// α⁻¹ Σ slope r_ij: times the sum of ∇f before its correction, what a uniform gradient takes from the sum of ∇²f where
    /// neighbours are not evenly spread. Zero if that is to stay.
    pub asymmetry: Vector<D>,
}

impl<const D: usize> Correction<D> {
    /// From α and Σ slope r_ij.
    #[inline(always)]
    pub fn of(alpha: &Matrix<D>, asymmetry: Vector<D>) -> Self {
        let inverse = match alpha.try_inverse() {
            Some(inverse) if inverse.norm_squared() < SINGULAR * SINGULAR => inverse,
            _ => Matrix::identity(),
        };
        Self { inverse, laplacian: -2.0 * (D as f64 + 2.0) / (2.0 + alpha.trace()), asymmetry: inverse * asymmetry }
    }

    /// Whether α is singular: no tensor that is not has just the identity as its inverse, α being a sum in single precision.
    pub fn is_singular(&self) -> bool {
        self.inverse == Matrix::<D>::identity()
    }
}
