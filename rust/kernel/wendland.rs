//! Wendland's kernels.

use super::Kernel;
use crate::base::lanes::Real;
use std::f64::consts::PI;

/// Wendland C2 in its 2-D and 3-D form, support 2h (Wendland 1995; Dehnen and Aly 2012).
#[derive(Clone, Copy)]
pub struct WendlandC2;

impl Kernel for WendlandC2 {
    fn support(self) -> f64 {
        2.0
    }

    fn factor(self, dimensions: usize) -> f64 {
        [3.0 / 4.0, 7.0 / (4.0 * PI), 21.0 / (16.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(self, q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        a * a * a * a * (R::splat(2.0) * q + R::splat(1.0))
    }

    #[inline(always)]
    fn derivative<R: Real>(self, q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        R::splat(-5.0) * q * a * a * a
    }
}

/// Wendland C4 in its 2-D and 3-D form, support 2h (Wendland 1995; Dehnen and Aly 2012).
#[derive(Clone, Copy)]
pub struct WendlandC4;

impl Kernel for WendlandC4 {
    fn support(self) -> f64 {
        2.0
    }

    fn factor(self, dimensions: usize) -> f64 {
        [27.0 / 32.0, 9.0 / (4.0 * PI), 495.0 / (256.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(self, q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        let a2 = a * a;
        a2 * a2 * a2 * (R::splat(35.0 / 12.0) * q * q + R::splat(3.0) * q + R::splat(1.0))
    }

    #[inline(always)]
    fn derivative<R: Real>(self, q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        let a2 = a * a;
        R::splat(-14.0 / 3.0) * q * a * a2 * a2 * (R::splat(1.0) + R::splat(2.5) * q)
    }
}
