//! A kernel from outside the crate.

use alsph::base::lanes::Real;
use alsph::kernel::{Custom, CustomKernel, Kernel, KernelKind, WendlandC2};
use alsph::{Clock, Settings, Simulation};
use approx::assert_relative_eq;
use std::f64::consts::PI;

mod common;

/// The cubic spline (Monaghan 1992).
struct Cubic {
    /// What its integrals in 1-D to 3-D are.
    integrals: [f64; 3],
}

impl CustomKernel for Cubic {
    fn support(&self) -> f64 {
        2.0
    }

    fn factor(&self, dimensions: usize) -> f64 {
        self.integrals[dimensions - 1] * [1.0 / 6.0, 5.0 / (14.0 * PI), 1.0 / (4.0 * PI)][dimensions - 1]
    }

    fn value(&self, q: f64) -> f64 {
        (2.0 - q).positive().powi(3) - 4.0 * (1.0 - q).positive().powi(3)
    }

    fn derivative(&self, q: f64) -> f64 {
        -3.0 * (2.0 - q).positive().powi(2) + 12.0 * (1.0 - q).positive().powi(2)
    }
}

/// One of the engine's, as if it were not.
struct Copied;

impl CustomKernel for Copied {
    fn support(&self) -> f64 {
        WendlandC2.support()
    }

    fn factor(&self, dimensions: usize) -> f64 {
        WendlandC2.factor(dimensions)
    }

    fn value(&self, q: f64) -> f64 {
        WendlandC2.value(q)
    }

    fn derivative(&self, q: f64) -> f64 {
        WendlandC2.derivative(q)
    }
}

/// The last kinetic energy of Taylor-Green vortices and their mean |∇·u|.
fn vortices(kernel: KernelKind) -> (f64, f64) {
    let mut settings = settings(kernel);
    settings.projection_sweeps = 4;
    let mut simulation = Simulation::new(settings, common::taylor_green(32, 0.0), Clock::default(), Some(2)).expect("valid");
    simulation.advance_until(0.2, None).expect("stable");
    let last = simulation.take_history().pop().expect("steps were taken");
    (last.kinetic_energy, last.outcome.divergence_sum / 1024.0)
}

fn settings(kernel: KernelKind) -> Settings {
    Settings { kernel, smoothing_ratio: 2.0, ..common::settings::<2>(1.0 / 32.0, "periodic") }
}

#[test]
fn a_copy_of_one_of_the_engines_gives_the_same_flow() {
    let (own, own_divergence) = vortices(KernelKind::WendlandC2);
    let (copied, divergence) = vortices(KernelKind::Custom(Custom(&Copied)));
    assert_relative_eq!(copied, own, max_relative = 1e-6);
    assert_relative_eq!(divergence, own_divergence, max_relative = 1e-3);
}

#[test]
fn a_kernel_of_the_callers_carries_a_flow() {
    let (energy, divergence) = vortices(KernelKind::Custom(Custom(&Cubic { integrals: [1.0; 3] })));
    assert_relative_eq!(energy, 0.25 * (-16.0 * PI * PI * 0.01 * 0.2_f64).exp(), max_relative = 0.02);
    assert!(divergence < 0.05, "{divergence}");
}

#[test]
fn what_is_no_kernel_is_refused_on_surfaces_too() {
    for (kernel, message) in [
        (&Cubic { integrals: [1.0, 1.1, 1.0] }, "integral in 2-D must be 1"),
        (&Cubic { integrals: [0.9, 1.0, 1.0] }, "integral in 1-D must be 1"),
    ] {
        let wrong = settings(KernelKind::Custom(Custom(kernel)));
        let refused = Simulation::new(wrong, common::taylor_green(32, 0.0), Clock::default(), Some(1)).err();
        let error = refused.expect("refused").to_string();
        assert!(error.contains(message), "{error}");
    }
}
