//! Derivatives at a particle. (15) (16)
//!
//! Every operator sums weights times differences, so a constant field has derivatives of exactly zero, and corrects the sum
//! with the tensor made of the same weights, so a linear field has its exact gradient.

use crate::neighbours::{Pair, Row};
use crate::particles::{Matrix, Vector};
use crate::stencil::Correction;

/// A particle and all that its derivatives need beside the field.
#[derive(Clone, Copy)]
pub struct Neighbourhood<'a, const D: usize> {
    pub i: usize,
    pub row: Row<'a>,
    /// Positions of the frame.
    pub position: &'a [Vector<D>],
    pub correction: &'a Correction<D>,
}

/// Sums of one pass over the pairs.
#[derive(Clone, Copy)]
struct Sums<const D: usize> {
    /// Σ slope r_ij (f_j − f_i), and for a vector field its outer product.
    gradient: Vector<D>,
    tensor: Matrix<D>,
    /// Σ slope (f_j − f_i).
    scalar: f64,
    vector: Vector<D>,
}

impl<const D: usize> Sums<D> {
    #[inline(always)]
    fn zeros() -> Self {
        Self { gradient: Vector::zeros(), tensor: Matrix::zeros(), scalar: 0.0, vector: Vector::zeros() }
    }
}

impl<const D: usize> Neighbourhood<'_, D> {
    /// Add up `add(slope, slope · r_ij, field_j, sums)` over `pairs`, in two sets of sums at a time. Entries that `add` never
    /// touches cost nothing.
    #[inline(always)]
    fn sum<T>(&self, pairs: &[Pair], field: &[T], add: impl Fn(f64, Vector<D>, &T, &mut Sums<D>)) -> Sums<D> {
        let here = self.position[self.i];
        let mut even = Sums::zeros();
        let mut odd = Sums::zeros();
        let one = |pair: &Pair, sums: &mut Sums<D>| {
            let slope = pair.slope();
            add(slope, (here - self.position[pair.j()]) * slope, &field[pair.j()], sums);
        };
        let mut twos = pairs.chunks_exact(2);
        for two in &mut twos {
            one(&two[0], &mut even);
            one(&two[1], &mut odd);
        }
        if let [last] = twos.remainder() {
            one(last, &mut even);
        }
        Sums {
            gradient: even.gradient + odd.gradient,
            tensor: even.tensor + odd.tensor,
            scalar: even.scalar + odd.scalar,
            vector: even.vector + odd.vector,
        }
    }

    /// ∇f. (15)
    #[inline(always)]
    pub fn gradient(&self, field: &[f64]) -> Vector<D> {
        let at_i = field[self.i];
        let sums = self.sum(
            self.row.all(),
            field,
            #[inline(always)]
            |_, weight, f, sums| sums.gradient += weight * (f - at_i),
        );
        self.correction.inverse * sums.gradient
    }

    /// ∂u_k/∂x_l as the entry (k, l). (15)
    #[inline(always)]
    pub fn velocity_gradient(&self, field: &[Vector<D>]) -> Matrix<D> {
        // α is symmetric.
        self.uncorrected_gradient(field) * self.correction.inverse
    }

    /// ∂u_k/∂x_l as the entry (k, l), and ∇p. (15)
    #[inline(always)]
    pub fn velocity_and_pressure_gradient(&self, velocity: &[Vector<D>], pressure: &[f64]) -> (Matrix<D>, Vector<D>) {
        let (u_i, p_i) = (velocity[self.i], pressure[self.i]);
        let mut tensor = Matrix::zeros();
        let mut gradient = Vector::zeros();
        for pair in self.row.all() {
            let weight = (self.position[self.i] - self.position[pair.j()]) * pair.slope();
            tensor += (velocity[pair.j()] - u_i) * weight.transpose();
            gradient += weight * (pressure[pair.j()] - p_i);
        }
        (tensor * self.correction.inverse, self.correction.inverse * gradient)
    }

    /// ∇·u. (15)
    #[inline(always)]
    pub fn divergence(&self, field: &[Vector<D>]) -> f64 {
        self.corrected_trace(&self.uncorrected_gradient(field))
    }

    /// ∇²f, the scalar form of (16).
    #[inline(always)]
    pub fn laplacian(&self, field: &[f64]) -> f64 {
        let at_i = field[self.i];
        let sums = self.sum(
            self.row.all(),
            field,
            #[inline(always)]
            |slope, _, f, sums| sums.scalar += slope * (f - at_i),
        );
        self.correction.laplacian * sums.scalar
    }

    /// ∇²u, component by component, and ∇·u. In the Laplacian solid neighbours show the velocity that `solid` gives.
    #[inline(always)]
    pub fn laplacian_and_divergence(&self, field: &[Vector<D>], solid: impl Fn(usize) -> Vector<D>) -> (Vector<D>, f64) {
        let at_i = field[self.i];
        let flowing = self.sum(
            self.row.flowing(),
            field,
            #[inline(always)]
            |slope, weight, u, sums| {
                let difference = u - at_i;
                sums.tensor += difference * weight.transpose();
                sums.vector += difference * slope;
            },
        );
        let (mut tensor, mut vector) = (flowing.tensor, flowing.vector);
        for pair in self.row.solid() {
            let weight = (self.position[self.i] - self.position[pair.j()]) * pair.slope();
            tensor += (field[pair.j()] - at_i) * weight.transpose();
            vector += (solid(pair.j()) - at_i) * pair.slope();
        }
        (vector * self.correction.laplacian, self.corrected_trace(&tensor))
    }

    /// ∇f of the first entry of a field of pairs and ∇²g of the second.
    #[inline(always)]
    pub fn gradient_and_laplacian(&self, field: &[[f64; 2]]) -> (Vector<D>, f64) {
        let at_i = field[self.i];
        let sums = self.sum(
            self.row.all(),
            field,
            #[inline(always)]
            |slope, weight, [f, g], sums| {
                sums.gradient += weight * (f - at_i[0]);
                sums.scalar += slope * (g - at_i[1]);
            },
        );
        (self.correction.inverse * sums.gradient, self.correction.laplacian * sums.scalar)
    }

    /// ∇²u + 2∇(∇·u), which (16) gives as printed: the vector form with the correction tensor. Solid neighbours show the
    /// velocity that `solid` gives.
    #[inline(always)]
    pub fn vector_laplacian(&self, field: &[Vector<D>], solid: impl Fn(usize) -> Vector<D>) -> Vector<D> {
        let mut sum = Vector::zeros();
        let mut add = |pair: &Pair, u_j: Vector<D>| {
            let r_ij = self.position[self.i] - self.position[pair.j()];
            let radial = (field[self.i] - u_j).dot(&r_ij) / r_ij.norm_squared().max(f64::MIN_POSITIVE);
            sum += r_ij * (radial * pair.slope());
        };
        self.row.flowing().iter().for_each(|pair| add(pair, field[pair.j()]));
        self.row.solid().iter().for_each(|pair| add(pair, solid(pair.j())));
        self.correction.inverse * sum * (2.0 * (D as f64 + 2.0))
    }

    /// Σ slope (u_j − u_i) r_ijᵀ: ∇u before its correction.
    #[inline(always)]
    fn uncorrected_gradient(&self, field: &[Vector<D>]) -> Matrix<D> {
        let at_i = field[self.i];
        self.sum(
            self.row.all(),
            field,
            #[inline(always)]
            |_, weight, u, sums| sums.tensor += (u - at_i) * weight.transpose(),
        )
        .tensor
    }

    /// Σ_kl α⁻¹_kl T_kl.
    #[inline(always)]
    fn corrected_trace(&self, tensor: &Matrix<D>) -> f64 {
        tensor.component_mul(&self.correction.inverse).sum()
    }
}
