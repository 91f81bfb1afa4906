//! Kernels from outside the crate.

use super::Kernel;
use crate::base::lanes::Real;
use std::fmt::{Debug, Formatter};

/// A kernel from outside the crate: as [`Kernel`], but one number at a time, which takes longer.
pub trait CustomKernel: Send + Sync {
    fn support(&self) -> f64;
    fn factor(&self, dimensions: usize) -> f64;
    fn value(&self, q: f64) -> f64;
    fn derivative(&self, q: f64) -> f64;
}

#[derive(Clone, Copy)]
pub struct Custom(pub &'static dyn CustomKernel);

impl Debug for Custom {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Custom")
    }
}

impl Kernel for Custom {
    fn support(self) -> f64 {
        self.0.support()
    }

    fn factor(self, dimensions: usize) -> f64 {
        self.0.factor(dimensions)
    }

    #[inline(always)]
    fn value<R: Real>(self, q: R) -> R {
        q.map(|q| self.0.value(q))
    }

    #[inline(always)]
    fn derivative<R: Real>(self, q: R) -> R {
        q.map(|q| self.0.derivative(q))
    }
}
