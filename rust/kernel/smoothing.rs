//! Values and slopes of a kernel at its smoothing length.

use super::Kernel;
use crate::base::lanes::{Lanes, Real};

/// Added to the squares of q, so that a particle is no exception among its neighbours, and below what single precision resolves
/// at ordinary distances.
const SMALLEST: f64 = 1e-8;

/// A kernel with its smoothing length and dimension fixed.
#[derive(Clone, Copy)]
pub struct Smoothing<K> {
    inverse_length: f64,
    factor: f64,
    kernel: K,
}

impl<K: Kernel> Smoothing<K> {
    pub fn new(kernel: K, smoothing_length: f64, dimensions: usize) -> Self {
        let factor = kernel.factor(dimensions) / smoothing_length.powi(dimensions as i32);
        Self { inverse_length: 1.0 / smoothing_length, factor, kernel }
    }

    /// W(r).
    #[inline(always)]
    pub fn value<R: Real>(&self, distance: R) -> R {
        R::splat(self.factor) * self.kernel.value(distance * R::splat(self.inverse_length))
    }

    /// (dW/dr) / r, so that ∇_i W_ij = slope · r_ij. `distance` must not be zero.
    #[inline(always)]
    pub fn slope<R: Real>(&self, distance: R) -> R {
        let derivative = self.kernel.derivative(distance * R::splat(self.inverse_length));
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
        let ([w0, w1], [y0, y1]) = (V::split(self.kernel.value(q)), V::split(V::Singles::splat(1.0) / q));
        let (y0, y1) = (newton(s0, y0), newton(s1, y1));
        [(s0 * y0, y0, w0), (s1 * y1, y1, w1)]
    }

    /// w(q), and `factor` (dw/dq) / q, of q².
    #[inline(always)]
    pub fn value_and_slope<R: Real>(&self, ratio_squared: R, factor: f64) -> (R, R) {
        let q = ratio_squared.sqrt();
        (self.kernel.value(q), R::splat(factor) * self.kernel.derivative(q) / q)
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
