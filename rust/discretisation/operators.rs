//! Derivatives at the particles. (15) (16)
//!
//! Every operator sums weights times differences, so a constant field has derivatives of exactly zero, and corrects the sum
//! with the tensor made of the same weights, so a linear field has its exact gradient.

use crate::base::lanes::{LANES, Lanes, add_product, matrices, norm_squared, vectors};
use crate::base::{Matrix, Tensor, Vector};
use crate::discretisation::correction::Correction;
use crate::discretisation::operator::{Neighbours, Operator};

/// ∇f. (15)
pub struct Gradient<'a>(pub &'a [f64]);

/// ∂u_k/∂x_l as the entry (k, l). (15)
pub struct VelocityGradient<'a, const D: usize>(pub &'a [Vector<D>]);

/// ∇·u. (15)
pub struct Divergence<'a, const D: usize>(pub &'a [Vector<D>]);

/// ∇f of the first entry of a field of pairs and ∇²g of the second, the scalar form of (16).
pub struct GradientAndLaplacian<'a>(pub &'a [[f64; 2]]);

/// ∇²f, the scalar form of (16).
pub struct Laplacian<'a>(pub &'a [f64]);

/// What the value of the particle itself counts in [`Laplacian`]; negative.
pub struct LaplacianDiagonal;

/// Σ slope (f_i + f_j) r_ij: what particles push each other with that carry the pressures f, in opposite directions.
pub struct ConservativeGradient<'a, F> {
    pub pressure: &'a [f64],
    /// What a particle's own counts in its sum: 1, or −1 where the sum is to be that of differences.
    pub own: F,
}

/// Σ slope (M_i + M_j) r_ij of a field of matrices: with M = q α⁻¹ and equal volumes it is minus the adjoint of [`Divergence`],
/// Σ u·(of M) = −Σ q ∇·u, and a gradient of q where neighbours are evenly spread.
pub struct AdjointGradient<'a, const D: usize, F> {
    pub tensor: &'a [Tensor<D>],
    /// As of [`ConservativeGradient`].
    pub own: F,
}

/// −2 Σ slope w_i w_j (u_j − u_i + ½ (∇u_i + ∇u_j) r_ij) over what flows: a Laplacian of what a field does beside being linear from one
/// particle to the next, of fourth order in smooth fields.
pub struct Roughness<'a, const D: usize> {
    pub velocity: &'a [Vector<D>],
    pub gradient: &'a [Tensor<D>],
    /// w.
    pub weight: &'a [f64],
}

/// ∇²f as [`Laplacian`], and −2 Σ slope (f_i − f_j) without a correction.
pub struct LaplacianAndItsSum<'a>(pub &'a [f64]);

/// What tells where a fluid ends: α (17), Σ slope r_ij, −Σ slope and −Σ slope |r_ij|.
pub struct Surroundings;

/// The largest value, above 0, of the neighbours and the particle itself, of two fields side by side.
pub struct Largest<'a>(pub &'a [[f64; 2]]);

/// ∇²u, component by component, and ∂u_k/∂x_l as the entry (k, l). In the Laplacian of particle i the solid neighbour s shows the
/// velocity `seen(s, i)`.
pub struct LaplacianAndGradient<'a, const D: usize, F> {
    pub velocity: &'a [Vector<D>],
    pub seen: F,
}

impl<const D: usize> Operator<D> for Gradient<'_> {
    type Value = Vector<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Vector<D>; LANES] {
        let here: V = near.cluster().lanes(|i| self.0[i]);
        let mut gradient = [V::zero(); D];
        near.for_each(
            #[inline(always)]
            |j, slope: V, r_ij| {
                let difference = (V::splat(self.0[j]) - here) * slope;
                add_product(&mut gradient, difference, r_ij);
            },
        );
        corrected(gradient, &near.corrections())
    }
}

impl<const D: usize, F: Fn(usize) -> f64 + Sync> Operator<D> for ConservativeGradient<'_, F> {
    type Value = Vector<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Vector<D>; LANES] {
        let here: V = near.cluster().lanes(|i| self.pressure[i] * (self.own)(i));
        let mut gradient = [V::zero(); D];
        near.for_each(
            #[inline(always)]
            |j, slope: V, r_ij| add_product(&mut gradient, (V::splat(self.pressure[j]) + here) * slope, r_ij),
        );
        vectors(gradient)
    }
}

impl<const D: usize, F: Fn(usize) -> f64 + Sync> Operator<D> for AdjointGradient<'_, D, F> {
    type Value = Vector<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Vector<D>; LANES] {
        let cluster = near.cluster();
        let mut here = [[V::zero(); D]; D];
        for k in 0..D {
            for l in 0..D {
                here[k][l] = cluster.lanes(|i| self.tensor[i].0[(k, l)] * (self.own)(i));
            }
        }
        let mut gradient = [V::zero(); D];
        near.for_each(
            #[inline(always)]
            |j, slope: V, r_ij| {
                let there = &self.tensor[j].0;
                for k in 0..D {
                    let mut sum = V::zero();
                    for l in 0..D {
                        sum = sum.plus_product(V::splat(there[(k, l)]) + here[k][l], r_ij[l]);
                    }
                    gradient[k] = gradient[k].plus_product(sum, slope);
                }
            },
        );
        vectors(gradient)
    }
}

impl<const D: usize> Operator<D> for Roughness<'_, D> {
    type Value = Vector<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Vector<D>; LANES] {
        let Self { velocity, gradient, weight } = *self;
        let cluster = near.cluster();
        let (here, own): ([V; D], V) = (cluster.vectors(velocity), cluster.lanes(|i| -2.0 * weight[i]));
        let bent: [[V; D]; D] = std::array::from_fn(|k| std::array::from_fn(|l| cluster.lanes(|i| gradient[i].0[(k, l)])));
        let mut sum = [V::zero(); D];
        near.for_each_flowing(
            #[inline(always)]
            |j, slope: V, r_ij| {
                let factor = slope * own * V::splat(weight[j]);
                for k in 0..D {
                    let mut linear = V::zero();
                    for l in 0..D {
                        linear = linear.plus_product(V::splat(gradient[j].0[(k, l)]) + bent[k][l], r_ij[l]);
                    }
                    let rest = (V::splat(velocity[j][k]) - here[k]).plus_product(linear, V::splat(0.5));
                    sum[k] = sum[k].plus_product(rest, factor);
                }
            },
        );
        near.corrections();
        vectors(sum)
    }
}

impl<const D: usize> Operator<D> for LaplacianAndItsSum<'_> {
    type Value = (f64, f64);

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [(f64, f64); LANES] {
        let (sum, linear) = differences(near, self.0);
        let laplacian = corrected_laplacian(sum, linear, &near.corrections());
        let sum = sum.store();
        std::array::from_fn(|lane| (laplacian[lane], -2.0 * sum[lane]))
    }
}

impl<const D: usize> Operator<D> for Surroundings {
    type Value = (Matrix<D>, Vector<D>, [f64; 2]);

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Self::Value; LANES] {
        let (mut alpha, mut first) = ([[V::zero(); D]; D], [V::zero(); D]);
        let (mut sum, mut reach) = (V::zero(), V::zero());
        near.for_each(
            #[inline(always)]
            |_, slope: V, r_ij| {
                sum += of_others(slope, r_ij);
                reach = reach.plus_product(slope, norm_squared(r_ij).sqrt());
                for k in 0..D {
                    let weight = slope * r_ij[k];
                    first[k] += weight;
                    for l in 0..D {
                        alpha[k][l] = alpha[k][l].plus_product(weight, r_ij[l]);
                    }
                }
            },
        );
        near.corrections();
        let (alpha, first, sum, reach) = (matrices(alpha), vectors(first), sum.store(), reach.store());
        std::array::from_fn(|lane| (-alpha[lane], first[lane], [-sum[lane], -reach[lane]]))
    }
}

impl<const D: usize> Operator<D> for Largest<'_> {
    type Value = [f64; 2];

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [[f64; 2]; LANES] {
        let mut least: [V; 2] = std::array::from_fn(|k| near.cluster().lanes(|i| -self.0[i][k]));
        near.for_each(
            #[inline(always)]
            |j, slope: V, _| {
                let seen = slope.below(V::zero());
                for k in 0..2 {
                    least[k] = least[k].least(V::splat(-self.0[j][k]) * seen);
                }
            },
        );
        near.corrections();
        let least = least.map(V::store);
        std::array::from_fn(|lane| [-least[0][lane], -least[1][lane]])
    }
}

impl<const D: usize> Operator<D> for VelocityGradient<'_, D> {
    type Value = Matrix<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Matrix<D>; LANES] {
        let (tensor, corrections) = (matrices(uncorrected_gradient(near, self.0)), near.corrections());
        // α is symmetric.
        std::array::from_fn(|lane| tensor[lane] * corrections[lane].inverse)
    }
}

impl<const D: usize> Operator<D> for Divergence<'_, D> {
    type Value = f64;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [f64; LANES] {
        let tensor = matrices(uncorrected_gradient(near, self.0));
        corrected_trace(&tensor, &near.corrections())
    }
}

impl<const D: usize> Operator<D> for GradientAndLaplacian<'_> {
    type Value = (Vector<D>, f64);

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [(Vector<D>, f64); LANES] {
        let here: [V; 2] = [near.cluster().lanes(|i| self.0[i][0]), near.cluster().lanes(|i| self.0[i][1])];
        let (mut gradient, mut laplacian, mut linear) = ([V::zero(); D], V::zero(), [V::zero(); D]);
        near.for_each(
            #[inline(always)]
            |j, slope: V, r_ij| {
                let [f, g] = self.0[j];
                add_product(&mut gradient, (V::splat(f) - here[0]) * slope, r_ij);
                let difference = (V::splat(g) - here[1]) * slope;
                laplacian += difference;
                add_product(&mut linear, difference, r_ij);
            },
        );
        let corrections = near.corrections();
        let gradient = corrected(gradient, &corrections);
        let laplacian = corrected_laplacian(laplacian, linear, &corrections);
        std::array::from_fn(|lane| (gradient[lane], laplacian[lane]))
    }
}

impl<const D: usize> Operator<D> for Laplacian<'_> {
    type Value = f64;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [f64; LANES] {
        let (sum, linear) = differences(near, self.0);
        corrected_laplacian(sum, linear, &near.corrections())
    }
}

impl<const D: usize> Operator<D> for LaplacianDiagonal {
    type Value = f64;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [f64; LANES] {
        let (mut sum, mut first) = (V::zero(), [V::zero(); D]);
        near.for_each(
            #[inline(always)]
            |_, slope: V, r_ij| {
                sum += of_others(slope, r_ij);
                add_product(&mut first, slope, r_ij);
            },
        );
        corrected_laplacian(sum, first, &near.corrections()).map(|weight| -weight)
    }
}

impl<const D: usize, F: Fn(usize, usize) -> Vector<D> + Sync> Operator<D> for LaplacianAndGradient<'_, D, F> {
    type Value = (Vector<D>, Matrix<D>);

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [(Vector<D>, Matrix<D>); LANES] {
        let velocity = self.velocity;
        let cluster = near.cluster();
        let here: [V; D] = cluster.vectors(velocity);
        let (mut laplacian, mut tensor) = ([V::zero(); D], [[V::zero(); D]; D]);
        // What the solids add to ∇u, before its correction, where they show another velocity than their own.
        let mut shown = [[V::zero(); D]; D];
        near.for_each_flowing(
            #[inline(always)]
            |j, slope: V, r_ij| {
                for k in 0..D {
                    let difference = (V::splat(velocity[j][k]) - here[k]) * slope;
                    laplacian[k] += difference;
                    add_product(&mut tensor[k], difference, r_ij);
                }
            },
        );
        near.for_each_solid(
            #[inline(always)]
            |s, slope: V, r_ij| {
                let seen = cluster.particles().map(|i| (self.seen)(s, i));
                for k in 0..D {
                    let (seen, own) = (V::load(&seen.map(|u| u[k])), V::splat(velocity[s][k]));
                    laplacian[k] = laplacian[k].plus_product(seen - here[k], slope);
                    add_product(&mut tensor[k], (own - here[k]) * slope, r_ij);
                    add_product(&mut shown[k], (seen - own) * slope, r_ij);
                }
            },
        );
        let corrections = near.corrections();
        let (laplacian, tensor, shown) = (vectors(laplacian), matrices(tensor), matrices(shown));
        std::array::from_fn(|lane| {
            let Correction { laplacian: factor, asymmetry, inverse } = &corrections[lane];
            let linear = (tensor[lane] + shown[lane]) * asymmetry;
            // α is symmetric.
            ((laplacian[lane] + linear) * *factor, tensor[lane] * inverse)
        })
    }
}

/// The slope, but zero of the particle itself, which stands among its neighbours.
#[inline(always)]
fn of_others<V: Lanes, const D: usize>(slope: V, r_ij: [V; D]) -> V {
    slope * (V::zero() - norm_squared(r_ij)).below(V::zero())
}

/// Σ slope (u_j − u_i) r_ijᵀ: ∇u before its correction.
#[inline(always)]
fn uncorrected_gradient<V: Lanes, const D: usize>(near: &mut impl Neighbours<V, D>, field: &[Vector<D>]) -> [[V; D]; D] {
    let here: [V; D] = near.cluster().vectors(field);
    let mut tensor = [[V::zero(); D]; D];
    near.for_each(
        #[inline(always)]
        |j, slope: V, r_ij| {
            for k in 0..D {
                add_product(&mut tensor[k], (V::splat(field[j][k]) - here[k]) * slope, r_ij);
            }
        },
    );
    tensor
}

/// Σ slope (f_j − f_i) and Σ slope (f_j − f_i) r_ij.
#[inline(always)]
fn differences<V: Lanes, const D: usize>(near: &mut impl Neighbours<V, D>, field: &[f64]) -> (V, [V; D]) {
    let here: V = near.cluster().lanes(|i| field[i]);
    let (mut sum, mut linear) = (V::zero(), [V::zero(); D]);
    near.for_each(
        #[inline(always)]
        |j, slope: V, r_ij| {
            let difference = (V::splat(field[j]) - here) * slope;
            sum += difference;
            add_product(&mut linear, difference, r_ij);
        },
    );
    (sum, linear)
}

/// α⁻¹ times a vector.
#[inline(always)]
fn corrected<V: Lanes, const D: usize>(sum: [V; D], corrections: &[Correction<D>; LANES]) -> [Vector<D>; LANES] {
    let sum = vectors(sum);
    std::array::from_fn(|lane| corrections[lane].inverse * sum[lane])
}

/// A scalar Laplacian, from Σ slope (f_j − f_i) and Σ slope (f_j − f_i) r_ij.
#[inline(always)]
fn corrected_laplacian<V: Lanes, const D: usize>(
    sum: V,
    linear: [V; D],
    corrections: &[Correction<D>; LANES],
) -> [f64; LANES] {
    let (sum, linear) = (sum.store(), vectors(linear));
    std::array::from_fn(
        #[inline(always)]
        |lane| {
            let Correction { laplacian: factor, asymmetry, .. } = &corrections[lane];
            factor * (sum[lane] + asymmetry.dot(&linear[lane]))
        },
    )
}

/// Σ_kl α⁻¹_kl T_kl.
#[inline(always)]
fn corrected_trace<const D: usize>(tensor: &[Matrix<D>; LANES], corrections: &[Correction<D>; LANES]) -> [f64; LANES] {
    std::array::from_fn(|lane| tensor[lane].component_mul(&corrections[lane].inverse).sum())
}
