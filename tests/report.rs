//! What is recorded of a step.

use alsph::flow::Step;
use alsph::{ParticleKind, Report, Settings};
use approx::assert_relative_eq;
use serde_json::json;

mod common;

/// Sums of a report run over the fluid, and the pressure at the inlet is the mean of all but solids within Δx of an inlet's plane.
#[test]
fn a_report_is_that_of_plain_sums() {
    let side = 20;
    let mut value = common::settings_value::<2>(1.0 / side as f64, "none");
    (value["density"], value["domain"]["boundaries"]) = (1.7.into(), json!([["none", "inlet"], ["inlet", "outlet"]]));
    let mut settings = common::parse(&value);
    let mut particles = common::particles(common::lattice::<2>(side, 0.3));
    for i in 0..particles.real {
        let phase = i as f64;
        particles.kind[i] = [ParticleKind::Fluid, ParticleKind::Solid, ParticleKind::Inlet, ParticleKind::Outlet][i % 7 % 4];
        particles.velocity[i] = [phase.sin(), (2.0 * phase).cos()].into();
        particles.pressure[i] = (3.0 * phase).sin();
    }
    let volume: Vec<f64> = (0..particles.real).map(|i| 0.002 + 0.001 * (5.0 * i as f64).sin()).collect();
    let report = |settings: &Settings| {
        let step = Step { settings, time_step: 0.01, velocity_max: 1.5 };
        Report::new(step, &particles, &volume, 0.7, Vec::new())
    };
    let now = report(&settings);
    let fluid: Vec<_> = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Fluid).collect();
    assert_eq!((now.time_step, now.penalty, now.velocity_max, now.fluid), (0.01, 0.7, 1.5, fluid.len()));
    assert_relative_eq!(now.volume, fluid.iter().map(|&i| volume[i]).sum::<f64>(), max_relative = 1e-12);
    let square: f64 = fluid.iter().map(|&i| volume[i] * particles.velocity[i].norm_squared()).sum();
    assert_relative_eq!(now.kinetic_energy, 0.5 * 1.7 * square, max_relative = 1e-12);
    // At x = 1 and y = 0, those in the corner twice.
    let near = |i: usize, axis: usize, plane: f64| (particles.position[i][axis] - plane).abs() <= 1.0 / side as f64;
    let weight = |i: usize| f64::from(u8::from(near(i, 0, 1.0)) + u8::from(near(i, 1, 0.0)));
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..particles.real).filter(|&i| particles.kind[i] != ParticleKind::Solid) {
        (sum, count) = (sum + weight(i) * particles.pressure[i], count + weight(i));
    }
    assert_relative_eq!(now.inlet_pressure, sum / count, max_relative = 1e-12);
    settings.domain.boundaries = common::settings::<2>(0.05, "slip").domain.boundaries;
    assert!(report(&settings).inlet_pressure.is_nan());
}
