//! Thin bodies: what the two faces of one show to the fluid on each.

use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use serde_json::json;

mod common;

const SIDE: usize = 10;
const SPACING: f64 = 1.0 / SIDE as f64;

/// Two streams over each other, each one unit high, between a floor, a plate of `rows` layers of solid particles and a lid that slides.
/// With `faces` the plate has two particles at each place.
fn two_streams(rows: usize, faces: bool) -> (serde_json::Value, Particles<2>) {
    let mut points = Vec::new();
    let mut walls = Vec::new();
    let thickness = rows as f64 * SPACING;
    let mut row = |y: f64, wall: Option<(u16, f64, f64)>| {
        for k in 0..SIDE {
            points.push(Vector::from([(k as f64 + 0.5) * SPACING, y]));
            walls.push(wall);
        }
    };
    for k in 0..SIDE {
        let height = (k as f64 + 0.5) * SPACING;
        row(height, None);
        row(1.0 + thickness + height, None);
    }
    for k in 0..4 {
        let depth = (k as f64 + 0.5) * SPACING;
        row(-depth, Some((0, 1.0, depth)));
        row(2.0 + thickness + depth, Some((2, -1.0, depth)));
    }
    for k in 0..rows {
        let depth = (k as f64 + 0.5) * SPACING;
        let upper = (1, 1.0, thickness - depth);
        let lower = (1, -1.0, depth);
        if faces {
            row(1.0 + depth, Some(upper));
            row(1.0 + depth, Some(lower));
        } else {
            row(1.0 + depth, Some(if upper.2 < lower.2 { upper } else { lower }));
        }
    }
    let mut particles = common::particles(points);
    for (i, wall) in walls.into_iter().enumerate() {
        let Some((body, up, depth)) = wall else { continue };
        particles.kind[i] = ParticleKind::Solid;
        (particles.body[i], particles.normal[i], particles.depth[i]) = (body, Vector::from([0.0, up]), depth);
    }
    let mut value = common::settings_value::<2>(SPACING, "none");
    value["kinematic_viscosity"] = 1.0.into();
    (value["wall_velocity"], value["wall_pressure"], value["viscous_order"]) = ("cubic".into(), "linear".into(), 4.into());
    value["domain"] = json!({"lower": [0.0, 0.0], "upper": [1.0, 2.0 + thickness], "boundaries": [["periodic", "periodic"], ["none", "none"]]});
    value["bodies"] = ["floor", "plate", "lid"]
        .map(|name| json!({"name": name, "velocity": [f64::from(name == "lid"), 0.0], "moves": false, "center": [0.0, 0.0]}))
        .into_iter()
        .collect();
    (value, particles)
}

/// Largest velocity below the plate, and largest error above it, after the flow has settled; shear on floor, plate and lid.
fn settled(rows: usize, faces: bool) -> (f64, f64, [f64; 3]) {
    let (value, particles) = two_streams(rows, faces);
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(1)).expect("valid");
    simulation.advance_until(1.0, None).expect("stable");
    let particles = simulation.particles();
    let (mut below, mut above) = (0.0f64, 0.0f64);
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Fluid) {
        let height = particles.position[i][1] - 1.0 - rows as f64 * SPACING;
        let [u, v] = particles.velocity[i].into();
        if height < 0.0 { below = below.max(u.hypot(v)) } else { above = above.max((u - height).hypot(v)) }
    }
    let loads = simulation.take_history().pop().expect("steps were taken").loads;
    (below, above, [0, 1, 2].map(|k| loads[k].viscous_force[0]))
}

#[test]
fn a_thin_plate_parts_two_streams() {
    for rows in [2, 3] {
        let (below, above, shear) = settled(rows, true);
        assert!(below < 1e-3 && above < 1e-3, "{rows} rows: {below} below the plate, error {above} above it");
        let error = [0.0, 1.0, -1.0].into_iter().zip(shear).map(|(exact, shear)| (shear - exact).abs()).fold(0.0, f64::max);
        assert!(error < 0.02, "{rows} rows: shear {shear:?}");
    }
    let (one_for_both, ..) = settled(2, false);
    assert!(one_for_both > 2e-3, "one particle for both faces drags the stream below along, {one_for_both}");
}

#[test]
fn a_restart_and_threads_change_no_bit_of_a_flow_past_a_thin_plate() {
    let (value, particles) = two_streams(2, true);
    let start =
        |particles, clock, threads| Simulation::new(common::parse(&value), particles, clock, Some(threads)).expect("valid");
    let mut whole = start(particles.clone(), Clock::default(), 2);
    whole.advance(21, None).expect("stable");
    let mut first = start(particles, Clock::default(), 1);
    first.advance(7, None).expect("stable");
    let mut state = first.particles().clone();
    state.drop_images();
    let mut resumed = start(state, first.clock(), 1);
    resumed.advance(14, None).expect("stable");
    let bits = |simulation: &Simulation<2>| -> Vec<_> {
        let particles = simulation.particles();
        let mut rows: Vec<_> =
            (0..particles.real).map(|i| (particles.id[i], particles.velocity[i].map(f64::to_bits))).collect();
        rows.sort_by_key(|row| row.0);
        rows
    };
    let different = bits(&whole).iter().zip(&bits(&resumed)).filter(|(a, b)| a != b).count();
    assert_eq!(different, 0);
}
