//! Derivatives at a particle from a run of its pairs. (15) (16)
//!
//! Every operator sums weights times differences, so a constant field has derivatives of exactly zero.

use crate::neighbours::Pair;
use crate::particles::{Matrix, Vector};

/// Σ over the pairs of what `add(pair, field_j, sums)` adds, with two sets of sums in flight. Entries that `add` never
/// touches cost nothing.
#[inline(always)]
fn sum<const D: usize, T>(pairs: &[Pair<D>], field: &[T], add: impl Fn(&Pair<D>, &T, &mut [f64; 4])) -> [f64; 4] {
    let mut even = [0.0; 4];
    let mut odd = [0.0; 4];
    let mut chunks = pairs.chunks_exact(2);
    for chunk in &mut chunks {
        add(&chunk[0], &field[chunk[0].j()], &mut even);
        add(&chunk[1], &field[chunk[1].j()], &mut odd);
    }
    if let [last] = chunks.remainder() {
        add(last, &field[last.j()], &mut even);
    }
    std::array::from_fn(|k| even[k] + odd[k])
}

/// The first D sums as a vector.
#[inline(always)]
fn vector<const D: usize>(sums: &[f64; 4]) -> Vector<D> {
    Vector::from_fn(|k, _| sums[k])
}

#[inline(always)]
fn weight<const D: usize>(pair: &Pair<D>, k: usize) -> f64 {
    f64::from(pair.gradient[k])
}

/// ∇f. (15)
#[inline(always)]
pub fn gradient<const D: usize>(pairs: &[Pair<D>], field: &[f64], at_i: f64) -> Vector<D> {
    vector(&sum(pairs, field, |pair, f, sums| {
        for k in 0..D {
            sums[k] += weight(pair, k) * (f - at_i);
        }
    }))
}

/// ∂u_k/∂x_l as the entry (k, l). (15)
#[inline(always)]
pub fn velocity_gradient<const D: usize>(pairs: &[Pair<D>], field: &[Vector<D>], at_i: Vector<D>) -> Matrix<D> {
    let mut gradient = Matrix::zeros();
    for pair in pairs {
        let difference = field[pair.j()] - at_i;
        for l in 0..D {
            for k in 0..D {
                gradient[(k, l)] += difference[k] * weight(pair, l);
            }
        }
    }
    gradient
}

/// ∇·u. (15)
#[inline(always)]
pub fn divergence<const D: usize>(pairs: &[Pair<D>], field: &[Vector<D>], at_i: Vector<D>) -> f64 {
    sum(pairs, field, |pair, u, sums| {
        for k in 0..D {
            sums[0] += weight(pair, k) * (u[k] - at_i[k]);
        }
    })[0]
}

/// ∇²f, the scalar form of (16).
#[inline(always)]
pub fn laplacian<const D: usize>(pairs: &[Pair<D>], field: &[f64], at_i: f64) -> f64 {
    sum(pairs, field, |pair, f, sums| sums[0] += f64::from(pair.laplacian) * (f - at_i))[0]
}

/// ∇²u, component by component, and ∇·u.
#[inline(always)]
pub fn laplacian_and_divergence<const D: usize>(
    pairs: &[Pair<D>],
    field: &[Vector<D>],
    at_i: Vector<D>,
) -> (Vector<D>, f64) {
    let sums = sum(pairs, field, |pair, u, sums| {
        for k in 0..D {
            let difference = u[k] - at_i[k];
            sums[k] += f64::from(pair.laplacian) * difference;
            sums[3] += weight(pair, k) * difference;
        }
    });
    (vector(&sums), sums[3])
}

/// ∇f of the first entry of a field of pairs and ∇²g of the second.
#[inline(always)]
pub fn gradient_and_laplacian<const D: usize>(pairs: &[Pair<D>], field: &[[f64; 2]], at_i: [f64; 2]) -> (Vector<D>, f64) {
    let sums = sum(pairs, field, |pair, [f, g], sums| {
        for k in 0..D {
            sums[k] += weight(pair, k) * (f - at_i[0]);
        }
        sums[3] += f64::from(pair.laplacian) * (g - at_i[1]);
    });
    (vector(&sums), sums[3])
}

/// ∇²u + 2∇(∇·u), which (16) gives as printed: the vector form with the correction tensor. `position` are the
/// positions that the weights belong to.
#[inline(always)]
pub fn vector_laplacian<const D: usize>(
    pairs: &[Pair<D>],
    position: &[Vector<D>],
    field: &[Vector<D>],
    i: usize,
) -> Vector<D> {
    let mut sum = Vector::zeros();
    for pair in pairs {
        let r_ij = position[i] - position[pair.j()];
        let radial = (field[i] - field[pair.j()]).dot(&r_ij) / r_ij.norm_squared().max(f64::MIN_POSITIVE);
        for l in 0..D {
            sum[l] += radial * weight(pair, l);
        }
    }
    sum * (2.0 * (D as f64 + 2.0))
}
