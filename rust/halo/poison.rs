//! Values that can say that they are stale: NaN, which whatever is computed from them becomes too.

use crate::base::{Matrix, Tensor, Vector};
use nalgebra::ArrayStorage;

/// A value that can say that it is stale.
pub trait Poison: Copy + Send + Sync {
    const POISON: Self;

    /// Whether any of it is NaN, which alone is not itself.
    #[allow(clippy::eq_op)]
    fn is_poison(&self) -> bool
    where
        Self: PartialEq,
    {
        self != self
    }
}

impl Poison for f64 {
    const POISON: Self = f64::NAN;
}

impl<const N: usize> Poison for [f64; N] {
    const POISON: Self = [f64::NAN; N];
}

impl<const D: usize> Poison for Vector<D> {
    const POISON: Self = Vector::from_array_storage(ArrayStorage([[f64::NAN; D]]));
}

impl<const D: usize> Poison for Tensor<D> {
    const POISON: Self = Self(Matrix::from_array_storage(ArrayStorage([[f64::NAN; D]; D])));
}

impl<T: Poison> Poison for Option<T> {
    const POISON: Self = Some(T::POISON);
}
