//! What the benches run on: a Taylor-Green vortex on a perturbed periodic lattice.

use alsph::Particles;
use alsph::settings::Settings;

#[path = "../../tests/common/mod.rs"]
mod common;

/// A way of taking a step, and the passes over all pairs that it has. No bench reads all of it.
#[derive(Clone, Copy)]
#[allow(dead_code)]
pub struct Method {
    pub name: &'static str,
    derivative_frame: &'static str,
    max_iterations: usize,
    projection_sweeps: usize,
    viscous_order: u8,
    pub passes: f64,
}

/// The steps that are counted and timed: the paper's, and those of the defaults.
pub const METHODS: [Method; 4] = [
    Method::new("Algorithm 2, the paper's", "initial", 5, 0, 2, 23.0),
    Method::new("Algorithm 1, the paper's", "updated", 5, 0, 2, 29.0),
    Method::new("the defaults", "midpoint", 2, 4, 4, 20.0),
    Method::new("Algorithm 1, the defaults", "updated", 2, 4, 4, 23.0),
];

impl Method {
    const fn new(
        name: &'static str,
        derivative_frame: &'static str,
        max_iterations: usize,
        projection_sweeps: usize,
        viscous_order: u8,
        passes: f64,
    ) -> Self {
        Self { name, derivative_frame, max_iterations, projection_sweeps, viscous_order, passes }
    }
}

/// Settings of a periodic unit box with `side` particles a direction, all iterations in every step.
pub fn settings<const D: usize>(side: usize, method: Method) -> Settings {
    let mut value = common::settings_value::<D>(1.0 / side as f64, "periodic");
    value["derivative_frame"] = method.derivative_frame.into();
    value["max_iterations"] = method.max_iterations.into();
    value["projection_sweeps"] = method.projection_sweeps.into();
    value["sweep_pressure"] = "smooth".into();
    value["viscous_order"] = method.viscous_order.into();
    value["divergence_tolerance"] = 1e-12.into();
    common::parse(&value)
}

/// The particles, displaced by up to 0.2 Δx.
pub fn particles<const D: usize>(side: usize) -> Particles<D> {
    let mut particles = common::particles(common::lattice::<D>(side, 0.2));
    for (x, u) in particles.position.iter().zip(&mut particles.velocity) {
        let [x, y] = [x[0], x[1]].map(|x| std::f64::consts::TAU * x);
        (u[0], u[1]) = (-x.cos() * y.sin(), x.sin() * y.cos());
    }
    particles
}
