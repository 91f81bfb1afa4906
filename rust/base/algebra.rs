//! Vectors and matrices of a number of dimensions.

pub type Vector<const D: usize> = nalgebra::SVector<f64, D>;
pub type Matrix<const D: usize> = nalgebra::SMatrix<f64, D, D>;

/// A matrix that a particle carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tensor<const D: usize>(pub Matrix<D>);

/// Eigenvalues of a symmetric matrix, and its eigenvectors as columns.
pub fn symmetric_eigen<const D: usize>(matrix: &Matrix<D>) -> (Vector<D>, Matrix<D>) {
    // nalgebra has them for each number of dimensions, not for any.
    macro_rules! of {
        ($Fixed:ty) => {{
            let eigen = <$Fixed>::from_column_slice(matrix.as_slice()).symmetric_eigen();
            (
                Vector::from_column_slice(eigen.eigenvalues.as_slice()),
                Matrix::from_column_slice(eigen.eigenvectors.as_slice()),
            )
        }};
    }
    match D {
        2 => of!(nalgebra::Matrix2<f64>),
        3 => of!(nalgebra::Matrix3<f64>),
        _ => unreachable!("settings have two or three dimensions"),
    }
}
