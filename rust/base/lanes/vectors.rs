//! Vectors and matrices of lanes.

use super::{LANES, Lanes};
use crate::base::{Matrix, Vector};

/// r_ij = r_i − r_j, of the particle i of each lane.
#[inline(always)]
pub fn from<V: Lanes, const D: usize>(here: [V; D], there: &Vector<D>) -> [V; D] {
    let mut difference = here;
    for axis in 0..D {
        difference[axis] = here[axis] - V::splat(there[axis]);
    }
    difference
}

/// The square of a vector's length.
#[inline(always)]
pub fn norm_squared<V: Lanes, const D: usize>(vector: [V; D]) -> V {
    let mut sum = vector[0] * vector[0];
    for component in &vector[1..] {
        sum = sum.plus_product(*component, *component);
    }
    sum
}

/// `sum += factor * vector`.
#[inline(always)]
pub fn add_product<V: Lanes, const D: usize>(sum: &mut [V; D], factor: V, vector: [V; D]) {
    for axis in 0..D {
        sum[axis] = sum[axis].plus_product(factor, vector[axis]);
    }
}

/// The vector of each lane.
#[inline(always)]
pub fn vectors<V: Lanes, const D: usize>(components: [V; D]) -> [Vector<D>; LANES] {
    let mut vectors = [Vector::zeros(); LANES];
    for axis in 0..D {
        let component = components[axis].store();
        for lane in 0..LANES {
            vectors[lane][axis] = component[lane];
        }
    }
    vectors
}

/// The matrix of each lane.
#[inline(always)]
pub fn matrices<V: Lanes, const D: usize>(components: [[V; D]; D]) -> [Matrix<D>; LANES] {
    let mut matrices = [Matrix::zeros(); LANES];
    for k in 0..D {
        for l in 0..D {
            let component = components[k][l].store();
            for lane in 0..LANES {
                matrices[lane][(k, l)] = component[lane];
            }
        }
    }
    matrices
}
