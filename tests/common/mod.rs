//! Settings and particle sets that the tests share.
#![allow(dead_code)] // not every test uses every helper

use alsph::settings::Settings;
use alsph::{ParticleKind, Particles, Place, Vector};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

pub mod manufactured;
pub mod set;
pub mod solve;

/// Settings of a unit box with the same boundary on every side, no bodies but one still one named "wall".
pub fn settings_value<const D: usize>(particle_spacing: f64, boundary: &str) -> Value {
    json!({
        "dimensions": D, "particle_spacing": particle_spacing, "smoothing_ratio": 4.0 / 3.0, "kernel": "quintic_spline",
        "density": 1.0, "kinematic_viscosity": 0.01, "body_force": vec![0.0; D],
        "time_step": 0.05 * particle_spacing, "adaptive_time_step": true, "time_step_safety": 0.9,
        "scheme": {"kind": "alsph"},
        "derivative_frame": "initial", "search_every_iteration": false,
        "max_iterations": 5, "projection_sweeps": 0, "divergence_tolerance": 1e-3, "penalty_constant": 100.0,
        "courant": null, "viscous_theta": 1.0, "sweep_weights": "equal", "sweep_pressure": "rough",
        "velocity_laplacian": "scalar", "laplacian_correction": true, "viscous_order": 2, "shifting": "xsph", "shift_coefficient": 0.04, "shift_limit": 0.1,
        "wall_velocity": "adami", "wall_pressure": "paper",
        "domain": {"lower": vec![0.0; D], "upper": vec![1.0; D], "boundaries": vec![[boundary; 2]; D]},
        "bodies": [{"name": "wall", "velocity": vec![0.0; D], "moves": false, "center": vec![0.0; D]}],
    })
}

pub fn settings<const D: usize>(particle_spacing: f64, boundary: &str) -> Settings {
    parse(&settings_value::<D>(particle_spacing, boundary))
}

/// Periodic settings with Laplacians that are not corrected for the asymmetry of the neighbours.
pub fn compact_settings<const D: usize>(particle_spacing: f64, smoothing_ratio: f64) -> Settings {
    let mut value = settings_value::<D>(particle_spacing, "periodic");
    value["laplacian_correction"] = false.into();
    value["smoothing_ratio"] = smoothing_ratio.into();
    parse(&value)
}

pub fn parse(value: &Value) -> Settings {
    Settings::from_json(&value.to_string()).expect("valid settings")
}

/// Taylor-Green: u = −U e^{−8π²νt} cos 2πx sin 2πy, v = U e^{−8π²νt} sin 2πx cos 2πy in the unit square.
pub fn taylor_green(side: usize, disorder: f64) -> Particles<2> {
    let mut particles = particles(lattice::<2>(side, disorder));
    for i in 0..particles.real {
        let [x, y] = [0, 1].map(|k| 2.0 * PI * particles.position[i][k]);
        particles.velocity[i] = Vector::from([-x.cos() * y.sin(), x.sin() * y.cos()]);
        particles.pressure[i] = -0.25 * ((2.0 * x).cos() + (2.0 * y).cos());
    }
    particles
}

/// Fluid at rest at `points`.
pub fn particles<const D: usize>(points: Vec<Vector<D>>) -> Particles<D> {
    let count = points.len();
    Particles {
        real: count,
        position: points,
        velocity: vec![Vector::zeros(); count],
        pressure: vec![0.0; count],
        kind: vec![ParticleKind::Fluid; count],
        body: vec![0; count],
        normal: vec![Vector::zeros(); count],
        depth: vec![0.0; count],
        place: vec![Place::Inside; count],
        unkept_pressure: vec![0.0; count],
        id: (0..count as u64).collect(),
    }
}

/// The cell-centred lattice of the unit box with `side` particles a direction, displaced by up to `disorder` spacings.
pub fn lattice<const D: usize>(side: usize, disorder: f64) -> Vec<Vector<D>> {
    let mut seed = 7u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / (1u64 << 30) as f64 - 1.0
    };
    (0..side.pow(D as u32))
        .map(|i| {
            Vector::from_fn(|axis, _| ((i / side.pow(axis as u32) % side) as f64 + 0.5 + disorder * random()) / side as f64)
        })
        .collect()
}

/// Radius of [`cylinder`].
pub const RADIUS: f64 = 0.25;

/// Distance from the surface of [`cylinder`], negative inside.
pub fn distance(x: &Vector<2>) -> f64 {
    x.add_scalar(-0.5).norm() - RADIUS
}

/// The lattice of the unit square cut by a cylinder in its middle, of solid particles on rings as `alsph.geometry` places them.
pub fn cylinder(side: usize, layers: usize) -> Particles<2> {
    perturbed_cylinder(side, layers, 0.0)
}

/// [`cylinder`] in a lattice displaced by up to `disorder` spacings.
pub fn perturbed_cylinder(side: usize, layers: usize, disorder: f64) -> Particles<2> {
    let spacing = 1.0 / side as f64;
    let mut points = lattice(side, disorder);
    points.retain(|x| distance(x) >= 0.0);
    let fluid = points.len();
    for radius in (0..layers).map(|layer| RADIUS - (layer as f64 + 0.5) * spacing).take_while(|&radius| radius > 0.0) {
        let count = 2 * (PI * radius / spacing).round().max(2.0) as usize;
        let angles = (0..count).map(|k| (k as f64 + 0.5) * TAU / count as f64);
        points.extend(angles.map(|angle| Vector::from([0.5 + radius * angle.cos(), 0.5 + radius * angle.sin()])));
    }
    let mut particles = particles(points);
    particles.kind[fluid..].fill(ParticleKind::Solid);
    particles
}

/// Fluid particles within `reach` of the surface of [`cylinder`].
pub fn fluid_near_cylinder(particles: &Particles<2>, reach: f64) -> Vec<usize> {
    let near = |&i: &usize| particles.kind[i] == ParticleKind::Fluid && distance(&particles.position[i]) < reach;
    (0..particles.real).filter(near).collect()
}

pub fn boundary() -> impl Strategy<Value = &'static str> {
    prop_oneof![Just("none"), Just("slip"), Just("periodic")]
}
