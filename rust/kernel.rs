//! Smoothing kernels W(r, h), normalised in 1-D to 3-D.

use crate::lanes::{Lanes, Real};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A radial kernel W = σ_D / h^D · w(q), q = r/h. Implementations give w and dw/dq without the factor.
pub trait Kernel: Copy + Send + Sync {
    /// Support radius over smoothing length: w(q) = 0 for q at or above it.
    const SUPPORT: f64;
    /// σ_D, so that the integral over D-dimensional space is 1.
    fn factor(dimensions: usize) -> f64;
    fn value<R: Real>(q: R) -> R;
    fn derivative<R: Real>(q: R) -> R;
}

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
    const SUPPORT: f64 = 3.0;

    fn factor(dimensions: usize) -> f64 {
        [1.0 / 120.0, 7.0 / (478.0 * PI), 1.0 / (120.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(q: R) -> R {
        let (a, b, c) = (Self::below(3.0, q), Self::below(2.0, q), Self::below(1.0, q));
        let (a2, b2, c2) = (a * a, b * b, c * c);
        (a * (a2 * a2)).plus_product(R::splat(-6.0) * b, b2 * b2).plus_product(R::splat(15.0) * c, c2 * c2)
    }

    #[inline(always)]
    fn derivative<R: Real>(q: R) -> R {
        let (a, b, c) = (Self::below(3.0, q), Self::below(2.0, q), Self::below(1.0, q));
        let (a2, b2, c2) = (a * a, b * b, c * c);
        R::splat(-5.0) * (a2 * a2).plus_product(R::splat(-6.0) * b2, b2).plus_product(R::splat(15.0) * c2, c2)
    }
}

/// Wendland C2 in its 2-D and 3-D form, support 2h (Wendland 1995; Dehnen and Aly 2012).
#[derive(Clone, Copy)]
pub struct WendlandC2;

impl Kernel for WendlandC2 {
    const SUPPORT: f64 = 2.0;

    fn factor(dimensions: usize) -> f64 {
        [3.0 / 4.0, 7.0 / (4.0 * PI), 21.0 / (16.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        a * a * a * a * (R::splat(2.0) * q + R::splat(1.0))
    }

    #[inline(always)]
    fn derivative<R: Real>(q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        R::splat(-5.0) * q * a * a * a
    }
}

/// Wendland C4 in its 2-D and 3-D form, support 2h (Wendland 1995; Dehnen and Aly 2012).
#[derive(Clone, Copy)]
pub struct WendlandC4;

impl Kernel for WendlandC4 {
    const SUPPORT: f64 = 2.0;

    fn factor(dimensions: usize) -> f64 {
        [27.0 / 32.0, 9.0 / (4.0 * PI), 495.0 / (256.0 * PI)][dimensions - 1]
    }

    #[inline(always)]
    fn value<R: Real>(q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        let a2 = a * a;
        a2 * a2 * a2 * (R::splat(35.0 / 12.0) * q * q + R::splat(3.0) * q + R::splat(1.0))
    }

    #[inline(always)]
    fn derivative<R: Real>(q: R) -> R {
        let a = (R::splat(1.0) - R::splat(0.5) * q).positive();
        let a2 = a * a;
        R::splat(-14.0 / 3.0) * q * a * a2 * a2 * (R::splat(1.0) + R::splat(2.5) * q)
    }
}

/// Added to the squares of q, so that a particle is no exception among its neighbours, and below what single precision resolves
/// at ordinary distances.
const SMALLEST: f64 = 1e-8;

/// The choice of kernel as a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelKind {
    QuinticSpline,
    WendlandC2,
    WendlandC4,
}

/// Run `$body` with the type `$K` bound to the kernel chosen at run time.
#[macro_export]
macro_rules! with_kernel {
    ($kind:expr, $K:ident => $body:expr) => {
        match $kind {
            $crate::kernel::KernelKind::QuinticSpline => {
                type $K = $crate::kernel::QuinticSpline;
                $body
            }
            $crate::kernel::KernelKind::WendlandC2 => {
                type $K = $crate::kernel::WendlandC2;
                $body
            }
            $crate::kernel::KernelKind::WendlandC4 => {
                type $K = $crate::kernel::WendlandC4;
                $body
            }
        }
    };
}

impl KernelKind {
    /// Support radius over smoothing length.
    pub fn support(self) -> f64 {
        with_kernel!(self, K => K::SUPPORT)
    }
}

/// A kernel with its smoothing length and dimension fixed.
#[derive(Clone, Copy)]
pub struct Smoothing<K> {
    inverse_length: f64,
    factor: f64,
    kernel: std::marker::PhantomData<K>,
}

impl<K: Kernel> Smoothing<K> {
    pub fn new(smoothing_length: f64, dimensions: usize) -> Self {
        let factor = K::factor(dimensions) / smoothing_length.powi(dimensions as i32);
        Self { inverse_length: 1.0 / smoothing_length, factor, kernel: std::marker::PhantomData }
    }

    /// W(r).
    #[inline(always)]
    pub fn value<R: Real>(&self, distance: R) -> R {
        R::splat(self.factor) * K::value(distance * R::splat(self.inverse_length))
    }

    /// (dW/dr) / r, so that ∇_i W_ij = slope · r_ij. `distance` must not be zero.
    #[inline(always)]
    pub fn slope<R: Real>(&self, distance: R) -> R {
        let derivative = K::derivative(distance * R::splat(self.inverse_length));
        R::splat(self.factor * self.inverse_length) * derivative / distance
    }

    /// q² of a squared distance, q = r/h. Zero gives a small q instead.
    #[inline(always)]
    pub fn ratio_squared<R: Real>(&self, square: R) -> R {
        R::splat(SMALLEST).plus_product(square, R::splat(self.inverse_length * self.inverse_length))
    }

    /// q = r/h and 1/q in double precision, and w(q) in single, for two sets of squared distances.
    #[inline(always)]
    pub fn ratios<V: Lanes>(&self, squares: [V; 2]) -> [(V, V, V); 2] {
        let (s0, s1) = (self.ratio_squared(squares[0]), self.ratio_squared(squares[1]));
        let q = V::join(s0, s1).sqrt();
        let ([w0, w1], [y0, y1]) = (V::split(K::value(q)), V::split(V::Singles::splat(1.0) / q));
        let (y0, y1) = (newton(s0, y0), newton(s1, y1));
        [(s0 * y0, y0, w0), (s1 * y1, y1, w1)]
    }

    /// w(q), and `factor` (dw/dq) / q, of q².
    #[inline(always)]
    pub fn value_and_slope<R: Real>(ratio_squared: R, factor: f64) -> (R, R) {
        let q = ratio_squared.sqrt();
        (K::value(q), R::splat(factor) * K::derivative(q) / q)
    }

    /// What w(q) is to be multiplied with to give W(r), and (dw/dq) / q to give (dW/dr) / r.
    pub fn factors(&self) -> (f64, f64) {
        (self.factor, self.factor * self.inverse_length * self.inverse_length)
    }
}

/// A step of Newton's method from y towards 1/√x, which doubles its digits.
#[inline(always)]
fn newton<V: Lanes>(x: V, y: V) -> V {
    y * V::splat(1.5).plus_product(x * V::splat(-0.5) * y, y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn check<K: Kernel>(first_dimension: usize) {
        for dimensions in first_dimension..=3 {
            let h = 0.7;
            let smoothing = Smoothing::<K>::new(h, dimensions);
            let steps = 20_000;
            let dr = K::SUPPORT * h / steps as f64;
            let integral: f64 = (0..steps)
                .map(|k| {
                    let r = (k as f64 + 0.5) * dr;
                    let shell = [2.0, 2.0 * PI * r, 4.0 * PI * r * r][dimensions - 1];
                    smoothing.value(r) * shell * dr
                })
                .sum();
            assert_relative_eq!(integral, 1.0, epsilon = 1e-6);
        }
        for k in 1..100 {
            let q = K::SUPPORT * k as f64 / 100.0;
            let difference = (K::value(q + 1e-6) - K::value(q - 1e-6)) / 2e-6;
            assert_relative_eq!(K::derivative(q), difference, epsilon = 1e-7, max_relative = 1e-6);
            assert!(K::derivative(q) <= 0.0);
        }
        assert_eq!(K::value(K::SUPPORT), 0.0);
        assert_eq!(K::derivative(K::SUPPORT * 1.5), 0.0);
    }

    #[test]
    fn kernels_integrate_to_one_and_match_their_derivative() {
        check::<QuinticSpline>(1);
        check::<WendlandC2>(2);
        check::<WendlandC4>(2);
    }
}
