//! Smoothing kernels W(r, h), normalised in 1-D to 3-D.
//!
//! A new kernel is one file, and here its module, its type and its name in the list of `kernels!`; Python asks for that list.

use crate::base::error::{Result, setting};
use crate::base::lanes::Real;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

mod custom;
mod quintic_spline;
mod smoothing;
mod wendland;

pub use custom::{Custom, CustomKernel};
pub use quintic_spline::QuinticSpline;
pub use smoothing::Smoothing;
pub use wendland::{WendlandC2, WendlandC4};

/// A radial kernel W = σ_D / h^D · w(q), q = r/h. Implementations give w and dw/dq without the factor.
pub trait Kernel: Copy + Send + Sync {
    /// Support radius over smoothing length: w(q) = 0 for q at or above it.
    fn support(self) -> f64;
    /// σ_D, so that the integral over D-dimensional space is 1.
    fn factor(self, dimensions: usize) -> f64;
    fn value<R: Real>(self, q: R) -> R;
    fn derivative<R: Real>(self, q: R) -> R;
}

/// The choice of kernel as a setting, by the types in `$kernel`, and `with_kernel!(kind, kernel => body)`, which runs `body` with `kernel`
/// bound to the one chosen at run time. `$d` is a dollar.
macro_rules! kernels {
    ($d:tt $($kernel:ident)*) => {
        #[derive(Clone, Copy, Debug, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum KernelKind {
            $($kernel,)*
            /// One from outside the crate, which has no name.
            #[serde(skip)]
            Custom(Custom),
        }

        impl KernelKind {
            /// Those that have a name.
            pub const ALL: &[Self] = &[$(Self::$kernel,)*];
        }

        macro_rules! with_kernel {
            ($d kind:expr, $d name:ident => $d body:expr) => {
                match $d kind {
                    $($crate::kernel::KernelKind::$kernel => {
                        let $d name = $crate::kernel::$kernel;
                        $d body
                    })*
                    $crate::kernel::KernelKind::Custom($d name) => $d body,
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
        with_kernel!(self, kernel => kernel.support())
    }

    /// Refuse what is no kernel in space of `dimensions`: its integral is 1, it falls to zero at its support, and `derivative` is its slope.
    pub fn validate(self, dimensions: usize) -> Result<()> {
        with_kernel!(self, kernel => validate(kernel, dimensions)).map_err(|problem| setting("kernel", problem))
    }
}

fn validate<K: Kernel>(kernel: K, dimensions: usize) -> std::result::Result<(), String> {
    let support = kernel.support();
    if !(support.is_finite() && support > 0.0) {
        return Err(format!("its support must be a positive number, not {support}"));
    }
    let points = 20_000;
    let dq = support / points as f64;
    let mut integral = 0.0;
    for q in (0..points).map(|k| (k as f64 + 0.5) * dq) {
        let shell = [2.0, 2.0 * PI * q, 4.0 * PI * q * q][dimensions - 1];
        integral += kernel.factor(dimensions) * kernel.value(q) * shell * dq;
        let slope = (kernel.value(q + 1e-6) - kernel.value(q - 1e-6)) / 2e-6;
        let derivative = kernel.derivative(q);
        if !((derivative - slope).abs() <= 1e-5 * (slope.abs() + kernel.value(0.0)) && derivative <= 0.0) {
            return Err(format!(
                "at q = {q:.4} its derivative is {derivative}, its slope {slope}; they must agree and not be above zero"
            ));
        }
    }
    if !(1.0 - 1e-6..=1.0 + 1e-6).contains(&integral) {
        return Err(format!("its integral in {dimensions}-D must be 1, not {integral}: see its factor"));
    }
    for q in [1.0, 1.5] {
        let (value, derivative) = (kernel.value(q * support), kernel.derivative(q * support));
        if value != 0.0 || derivative != 0.0 {
            return Err(format!("at and beyond its support it must be 0, not {value} with a derivative of {derivative}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_integrate_to_one_and_match_their_derivative() {
        for kind in KernelKind::ALL {
            for dimensions in 1..=3 {
                kind.validate(dimensions).unwrap();
            }
        }
    }
}
