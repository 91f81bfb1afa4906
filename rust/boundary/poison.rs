//! Values that can say that they are stale: NaN, which whatever is computed from them becomes too.

use crate::particles::Vector;
use nalgebra::ArrayStorage;

/// A value that can say that it is stale.
pub trait Poison: Copy + Send + Sync {
    const POISON: Self;

    fn is_poison(&self) -> bool;
}

impl Poison for f64 {
    const POISON: Self = f64::NAN;

    fn is_poison(&self) -> bool {
        self.is_nan()
    }
}

impl<const N: usize> Poison for [f64; N] {
    const POISON: Self = [f64::NAN; N];

    fn is_poison(&self) -> bool {
        self.iter().any(|x| x.is_nan())
    }
}

impl<const D: usize> Poison for Vector<D> {
    const POISON: Self = Vector::from_array_storage(ArrayStorage([[f64::NAN; D]]));

    fn is_poison(&self) -> bool {
        self.iter().any(|x| x.is_nan())
    }
}

impl<T: Poison> Poison for Option<T> {
    const POISON: Self = Some(T::POISON);

    fn is_poison(&self) -> bool {
        self.is_some_and(|value| value.is_poison())
    }
}
