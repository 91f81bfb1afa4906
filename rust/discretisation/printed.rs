//! The viscous term as the paper prints it.

use crate::base::Vector;
use crate::discretisation::stencil::Stencil;
use crate::neighbours::Entry;

/// ∇²u + 2∇(∇·u) at particle `i`, which (16) gives as printed: the vector form with the correction tensor. Solid neighbours
/// show the velocity that `solid` gives.
#[inline(never)]
pub fn vector_laplacian<const D: usize>(
    stencil: &Stencil<D>,
    velocity: &[Vector<D>],
    i: usize,
    solid: impl Fn(usize) -> Vector<D>,
) -> Vector<D> {
    let (row, lane) = stencil.neighbours.row(i);
    let mut sum = Vector::zeros();
    let mut add = |entry: &Entry, u_j: Vector<D>| {
        let r_ij = stencil.position[i] - stencil.position[entry.j()];
        let radial = (velocity[i] - u_j).dot(&r_ij) / r_ij.norm_squared().max(f64::MIN_POSITIVE);
        sum += r_ij * (radial * entry.slope(lane));
    };
    row.flowing().iter().for_each(|entry| add(entry, velocity[entry.j()]));
    row.solid().iter().for_each(|entry| add(entry, solid(entry.j())));
    stencil.correction[i].inverse * sum * (2.0 * (D as f64 + 2.0))
}
