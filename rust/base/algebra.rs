//! Vectors and matrices of a number of dimensions.

pub type Vector<const D: usize> = nalgebra::SVector<f64, D>;
pub type Matrix<const D: usize> = nalgebra::SMatrix<f64, D, D>;
