//! Smoothing kernels W(r, h), normalised in 1-D to 3-D.
//!
//! A new kernel is one file, and here its module, its type and its name in the list of `kernels!`; Python asks for that list.

use crate::base::lanes::Real;
use serde::{Deserialize, Serialize};

mod quintic_spline;
mod smoothing;
mod wendland;

pub use quintic_spline::QuinticSpline;
pub use smoothing::Smoothing;
pub use wendland::{WendlandC2, WendlandC4};

/// A radial kernel W = σ_D / h^D · w(q), q = r/h. Implementations give w and dw/dq without the factor.
pub trait Kernel: Copy + Send + Sync {
    /// Support radius over smoothing length: w(q) = 0 for q at or above it.
    const SUPPORT: f64;
    /// σ_D, so that the integral over D-dimensional space is 1.
    fn factor(dimensions: usize) -> f64;
    fn value<R: Real>(q: R) -> R;
    fn derivative<R: Real>(q: R) -> R;
}

/// The choice of kernel as a setting, by the types in `$kernel`, and `with_kernel!(kind, K => body)`, which runs `body` with the type `K`
/// bound to the kernel chosen at run time. `$d` is a dollar.
macro_rules! kernels {
    ($d:tt $($kernel:ident)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum KernelKind {
            $($kernel,)*
        }

        impl KernelKind {
            pub const ALL: &[Self] = &[$(Self::$kernel,)*];
        }

        macro_rules! with_kernel {
            ($d kind:expr, $d K:ident => $d body:expr) => {
                match $d kind {
                    $($crate::kernel::KernelKind::$kernel => {
                        type $d K = $crate::kernel::$kernel;
                        $d body
                    })*
                }
            };
        }
    };
}

kernels!($ QuinticSpline WendlandC2 WendlandC4);

pub(crate) use with_kernel;

impl KernelKind {
    /// Support radius over smoothing length.
    pub fn support(self) -> f64 {
        with_kernel!(self, K => K::SUPPORT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::PI;

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
        for kind in KernelKind::ALL {
            with_kernel!(kind, K => check::<K>(if K::SUPPORT == 2.0 { 2 } else { 1 }));
        }
    }
}
