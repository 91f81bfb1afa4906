//! The quintic spline.

use super::Kernel;
use crate::base::lanes::Real;
use std::f64::consts::PI;

/// Quintic spline, support 3h (Liu and Liu 2010, the paper's reference 38).
#[derive(Clone, Copy)]
pub struct QuinticSpline;

impl QuinticSpline {
    /// max(knot − q, 0).
    #[inline(always)]
    fn below<R: Real>(knot: f64, q: R) -> R {
        (R::splat(knot) - q).positive()
    }
}

impl Kernel for QuinticSpline {
    fn support(self) -> f64 {
        3.0
    }

    fn factor(self, dimensions: usize) -> f64 {
        [1.0 / 120.0, 7.0 / (478.0 * PI), 1.0 / (120.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(self, q: R) -> R {
        let (a, b, c) = (Self::below(3.0, q), Self::below(2.0, q), Self::below(1.0, q));
        let (a2, b2, c2) = (a * a, b * b, c * c);
        (a * (a2 * a2)).plus_product(R::splat(-6.0) * b, b2 * b2).plus_product(R::splat(15.0) * c, c2 * c2)
    }

    #[inline(always)]
    fn derivative<R: Real>(self, q: R) -> R {
        let (a, b, c) = (Self::below(3.0, q), Self::below(2.0, q), Self::below(1.0, q));
        let (a2, b2, c2) = (a * a, b * b, c * c);
        R::splat(-5.0) * (a2 * a2).plus_product(R::splat(-6.0) * b2, b2).plus_product(R::splat(15.0) * c2, c2)
    }
}
