//! What the benches run on: a Taylor-Green vortex on a perturbed periodic lattice.

use alsph::Particles;
use alsph::settings::Settings;

#[path = "../../tests/common/mod.rs"]
mod common;

/// Settings of a periodic unit box with `side` particles a direction, the paper's five iterations in every step.
pub fn settings<const D: usize>(side: usize, derivative_frame: &str) -> Settings {
    let mut value = common::settings_value::<D>(1.0 / side as f64, "periodic");
    value["derivative_frame"] = derivative_frame.into();
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
