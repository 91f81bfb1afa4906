//! Loads against exact values, torques among them, and that they do not depend on how particles are stored.

use alsph::boundary::{Walls, surface_area};
use alsph::loads::{Load, force_of_pressure, loads};
use alsph::motion::Motion;
use alsph::{Clock, ParticleKind, Particles, Settings, Simulation, Vector};
use approx::assert_relative_eq;
use common::set::Set;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

mod common;

const RULES: [&str; 4] = ["paper", "adami", "cubic", "morris"];
const VISCOSITY: f64 = 0.01;

fn settings<const D: usize>(side: usize, rule: &str, boundary: &str) -> Value {
    let mut value = common::settings_value::<D>(1.0 / side as f64, boundary);
    value["wall_velocity"] = rule.into();
    value
}

/// The unit box, solid where `surface` gives a depth and the normal.
fn around<const D: usize>(
    side: usize,
    disorder: f64,
    surface: impl Fn(&Vector<D>) -> Option<(f64, Vector<D>)>,
) -> Particles<D> {
    let mut points = common::lattice::<D>(side, disorder);
    points.iter_mut().zip(common::lattice::<D>(side, 0.0)).filter(|(_, x)| surface(x).is_some()).for_each(|(p, x)| *p = x);
    let mut particles = common::particles(points);
    for i in 0..particles.real {
        if let Some((depth, normal)) = surface(&particles.position[i]) {
            (particles.kind[i], particles.depth[i], particles.normal[i]) = (ParticleKind::Solid, depth, normal);
        }
    }
    particles
}

/// [`common::cylinder`] with normals and depths.
fn cylinder(side: usize) -> Particles<2> {
    let mut particles = common::cylinder(side, 4);
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
        let arm = particles.position[i].add_scalar(-0.5);
        (particles.normal[i], particles.depth[i]) = (arm.normalize(), common::RADIUS - arm.norm());
    }
    particles
}

/// A box with the half widths `half`.
fn square(side: usize, disorder: f64, half: [f64; 2]) -> Particles<2> {
    around(side, disorder, |x: &Vector<_>| {
        let arm: Vector<2> = x - Vector::repeat(0.5);
        let depths = [0, 1].map(|axis| half[axis] - arm[axis].abs());
        let axis = usize::from(depths[1] < depths[0]);
        let normal = Vector::from_fn(|k, _| if k == axis { arm[axis].signum() } else { 0.0 });
        (depths[axis] > 0.0).then_some((depths[axis], normal))
    })
}

/// The same with solids half a spacing aside, so that fluid above stands just as near to two of them.
fn between(side: usize, half: [f64; 2]) -> Particles<2> {
    let mut particles = square(side, 0.0, half);
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
        particles.position[i][0] += 0.5 / side as f64;
    }
    particles
}

fn sphere(side: usize, disorder: f64) -> Particles<3> {
    around(side, disorder, |x: &Vector<_>| {
        let arm: Vector<3> = x - Vector::repeat(0.5);
        (arm.norm() < 0.3).then(|| (0.3 - arm.norm(), arm.normalize()))
    })
}

/// Give the fluid a velocity and a pressure, and the solids the pressure.
fn with_flow<const D: usize>(
    mut particles: Particles<D>,
    velocity: impl Fn(&Vector<D>) -> Vector<D>,
    pressure: impl Fn(&Vector<D>) -> f64,
) -> Particles<D> {
    for i in 0..particles.real {
        particles.pressure[i] = pressure(&particles.position[i]);
        if particles.kind[i] != ParticleKind::Solid {
            particles.velocity[i] = velocity(&particles.position[i]);
        }
    }
    particles
}

/// What walls show, their slopes, and areas, by id, and the loads.
fn seen<const D: usize>(settings: &Settings, set: &Set<D>) -> (Vec<Vec<f64>>, Load<D>) {
    let Set { particles, frame } = set;
    let mut walls = Walls::new(settings);
    walls.see(settings, particles, frame);
    let load = loads(settings, particles, frame, &walls, &Motion::default(), |s| {
        force_of_pressure(&frame.stencil, |i| particles.pressure[i], s)
    })[0];
    walls.sharpen(settings, particles, frame, |i| particles.velocity[i] * particles.position[i][0], 1.0);
    let mut order: Vec<usize> = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid).collect();
    order.sort_by_key(|&i| particles.id[i]);
    let of = |field: &dyn Fn(usize) -> Vector<D>| {
        order.iter().flat_map(|&s| field(s).iter().copied().collect::<Vec<_>>()).collect()
    };
    let area = |&s: &usize| surface_area(settings, particles, &frame.stencil, s);
    let fields = vec![
        of(&|s| walls.viscous_velocity.get(s).copied().unwrap_or_else(Vector::zeros)),
        of(&|s| walls.slope.get(s).copied().flatten().unwrap_or_else(Vector::zeros)),
        of(&|s| walls.dispersion[s]),
        order.iter().map(area).collect(),
    ];
    (fields, load)
}

fn numbers<const D: usize>(load: &Load<D>) -> Vec<f64> {
    let forces = load.pressure_force.iter().chain(&load.viscous_force).copied();
    forces.chain(load.pressure_torque).chain(load.viscous_torque).collect()
}

/// What walls show and the loads on them are the same, but for rounding, in another order of storage, and so with other clusters.
fn check_order<const D: usize>(side: usize, particles: Particles<D>) {
    let count = particles.real;
    let step = (count / 2 + 1..)
        .find(|step| (2..=*step).all(|d| !count.is_multiple_of(d) || !step.is_multiple_of(d)))
        .expect("coprime");
    let order: Vec<u32> = (0..count).map(|i| (i * step % count) as u32).collect();
    for rule in RULES {
        let settings = common::parse(&settings::<D>(side, rule, "periodic"));
        let mut scattered = particles.clone();
        scattered.reorder(&order);
        let [sorted, scattered] = [(particles.clone(), true), (scattered, false)]
            .map(|(particles, reorder)| seen(&settings, &Set::of(particles, &settings, reorder)));
        let forces = [&sorted.1, &scattered.1].map(numbers);
        for (a, b) in sorted.0.iter().chain([&forces[0]]).zip(scattered.0.iter().chain([&forces[1]])) {
            let largest = a.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            let off = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off <= 1e-12 * largest, "{D}-D, {rule}: {:.1e} of the largest", off / largest);
        }
    }
}

#[test]
fn walls_and_loads_do_not_depend_on_the_order_of_the_particles() {
    let flow = |x: &Vector<2>| Vector::from([(7.0 * x[1]).sin(), x[0] * x[0]]);
    let pressure = |x: &Vector<2>| (5.0 * x[0]).cos() + x[1];
    for particles in [
        cylinder(40),
        square(40, 0.0, [0.2; 2]),
        square(40, 0.2, [0.2; 2]),
        // A plate of three layers, faces between the points of the lattice and upon them.
        square(40, 0.0, [0.3, 0.0375]),
        square(40, 0.1, [0.3, 0.05]),
    ] {
        check_order(40, with_flow(particles, flow, pressure));
    }
    // Binary fractions, so that ties are exact.
    check_order(32, with_flow(between(32, [0.25; 2]), flow, pressure));
    let flow = |x: &Vector<3>| Vector::from([(7.0 * x[1]).sin(), x[0] * x[0], x[2]]);
    let pressure = |x: &Vector<3>| (5.0 * x[0]).cos() + x[2];
    for disorder in [0.0, 0.2] {
        check_order(14, with_flow(sphere(14, disorder), flow, pressure));
    }
}

fn load_on<const D: usize>(side: usize, rule: &str, center: &[f64], particles: Particles<D>) -> Load<D> {
    let mut value = settings::<D>(side, rule, "none");
    value["bodies"][0]["center"] = json!(center);
    let settings = common::parse(&value);
    seen(&settings, &Set::of(particles, &settings, true)).1
}

/// In a linear pressure field a body feels −∇p times its volume, in its centroid, about whatever point the torque is taken.
fn check_pressure_torque<const D: usize>(side: usize, volume: f64, particles: Particles<D>, tolerance: f64) {
    let slope = Vector::<D>::from_fn(|axis, _| [0.7, -1.1, 0.4][axis]);
    let particles = with_flow(particles, |_| Vector::zeros(), |x| 0.2 + slope.dot(&x.add_scalar(-0.5)));
    let largest = slope.norm() * volume;
    for center in [[0.5, 0.5, 0.5], [0.1, 0.4, 0.3], [1.2, -0.3, 0.8]] {
        let load = load_on(side, "cubic", &center[..D], particles.clone());
        let force = slope * -volume;
        assert_relative_eq!(load.pressure_force, force, epsilon = tolerance * largest);
        let arm = nalgebra::Vector3::from_fn(|k, _| if k < D { 0.5 - center[k] } else { 0.0 });
        let torque = arm.cross(&nalgebra::Vector3::from_fn(|k, _| if k < D { force[k] } else { 0.0 }));
        assert_relative_eq!(nalgebra::Vector3::from(load.pressure_torque), torque, epsilon = tolerance * largest);
        assert!(load.viscous_force.norm() < 1e-12 && load.viscous_torque.iter().all(|torque| torque.abs() < 1e-12));
    }
}

#[test]
fn a_pressure_gradient_turns_a_body_about_any_point_as_its_volume_says() {
    check_pressure_torque(40, PI * common::RADIUS.powi(2), cylinder(40), 0.02);
    check_pressure_torque(40, 0.6 * 0.3, square(40, 0.0, [0.3, 0.15]), 0.02);
    let particles = sphere(16, 0.0);
    let volume = particles.counts()[ParticleKind::Solid as usize] as f64 / 16f64.powi(3);
    check_pressure_torque(16, volume, particles, 0.05);
}

/// Around a cylinder at rest the fluid turns with A (r − R²/r): its torque is 4π μ A R².
#[test]
fn the_friction_of_a_circling_flow_turns_a_cylinder() {
    let swirl = |x: &Vector<2>| {
        let arm = x.add_scalar(-0.5);
        Vector::from([-arm[1], arm[0]]) * (1.0 - (common::RADIUS / arm.norm()).powi(2))
    };
    let exact = 4.0 * PI * VISCOSITY * common::RADIUS.powi(2);
    for center in [[0.5, 0.5], [0.2, 0.9]] {
        let load = load_on(60, "cubic", &center, with_flow(cylinder(60), swirl, |_| 0.0));
        // Nothing but torque, so about any point.
        assert_relative_eq!(load.viscous_torque[2], exact, max_relative = 0.01);
        assert!(load.viscous_force.norm() < 0.01 * exact / common::RADIUS, "{}", load.viscous_force);
    }
}

/// Fluid that turns like a rigid body with the surface has no friction on it: its slope ω gives a torque of 2π μ ω R², and its transpose as
/// much the other way.
#[test]
fn fluid_that_turns_with_a_cylinder_leaves_it_alone() {
    for (side, tolerance) in [(20, 0.2), (40, 0.1), (80, 0.05)] {
        let mut particles = cylinder(side);
        for i in 0..particles.real {
            let arm = particles.position[i].add_scalar(-0.5);
            let solid = particles.kind[i] == ParticleKind::Solid;
            particles.velocity[i] = Vector::from([-arm[1], arm[0]]) * if solid { common::RADIUS / arm.norm() } else { 1.0 };
        }
        let load = load_on(side, "cubic", &[0.5, 0.5], particles);
        let slope = TAU * VISCOSITY * common::RADIUS.powi(2);
        assert!(load.viscous_torque[2].abs() < tolerance * slope, "{side}: {} of {slope}", load.viscous_torque[2]);
        assert!(load.viscous_force.norm() < 1e-3 * VISCOSITY, "{side}: {}", load.viscous_force);
    }
}

/// A flow along a plate under it: friction and its torque about any point.
#[test]
fn the_friction_on_a_plate_turns_it_about_a_point_beside_it() {
    let plate = around(40, 0.1, |x: &Vector<2>| (x[1] < 0.5).then(|| (0.5 - x[1], Vector::y())));
    let plate = with_flow(plate, |x| Vector::from([x[1] - 0.5, 0.0]), |_| 0.0);
    for center in [[0.5, 0.5], [0.1, 1.3], [0.7, -0.4]] {
        let mut value = settings::<2>(40, "cubic", "none");
        value["domain"]["boundaries"] = json!([["periodic", "periodic"], ["none", "none"]]);
        value["bodies"][0]["center"] = json!(center);
        let settings = common::parse(&value);
        let load = seen(&settings, &Set::of(plate.clone(), &settings, true)).1;
        assert_relative_eq!(load.viscous_force, Vector::from([VISCOSITY, 0.0]), epsilon = 0.01 * VISCOSITY);
        assert_relative_eq!(load.viscous_torque[2], -(0.5 - center[1]) * VISCOSITY, epsilon = 0.01 * VISCOSITY);
    }
}

/// Between a cylinder at rest and one of twice its radius that turns around it with ω the torque is 4π μ ω R₁² R₂² / (R₂² − R₁²). Bodies only
/// go straight on, so each particle of the outer one is a body of its own; the friction on them is not that on a wall that turns.
#[test]
fn couette_flow_between_cylinders_turns_the_inner_one() {
    let (spacing, inner, outer, omega, mu) = (0.025, 0.25, 0.5, 2.0, 0.05);
    let (mut value, mut particles) = (settings::<2>(40, "cubic", "none"), common::particles(Vec::new()));
    for (key, chosen) in [
        ("wall_pressure", json!("linear")),
        ("kinematic_viscosity", json!(mu)),
        ("viscous_order", json!(4)),
        ("max_iterations", json!(2)),
        ("projection_sweeps", json!(4)),
        ("derivative_frame", json!("midpoint")),
    ] {
        value[key] = chosen;
    }
    let mut bodies = vec![json!({"name": "inner", "velocity": [0.0, 0.0], "moves": false, "center": [0.9, 0.2]})];
    for ring in 6..24 {
        let radius = (ring as f64 + 0.5) * spacing;
        let count = (TAU * radius / spacing).round() as usize;
        for k in 0..count {
            let arm = Vector::from([(TAU * k as f64 / count as f64).cos(), (TAU * k as f64 / count as f64).sin()]);
            let turning = Vector::from([-arm[1], arm[0]]);
            let (kind, depth, normal, speed) = match radius {
                r if r < inner => (ParticleKind::Solid, inner - r, arm, 0.0),
                r if r > outer => (ParticleKind::Solid, r - outer, -arm, omega * outer),
                r => (
                    ParticleKind::Fluid,
                    0.0,
                    Vector::zeros(),
                    omega * outer.powi(2) / (outer.powi(2) - inner.powi(2)) * (r - inner.powi(2) / r),
                ),
            };
            particles.body.push(if radius > outer { bodies.len() as u16 } else { 0 });
            if radius > outer {
                bodies.push(json!({"name": format!("outer {}", bodies.len()), "velocity": (turning * speed).as_slice(), "moves": false, "center": [0.5, 0.5]}));
            }
            particles.position.push((arm * radius).add_scalar(0.5));
            particles.velocity.push(turning * speed);
            particles.pressure.push(0.0);
            particles.kind.push(kind);
            particles.depth.push(depth);
            particles.normal.push(normal);
        }
    }
    particles.real = particles.position.len();
    particles.id = (0..particles.real as u64).collect();
    value["bodies"] = bodies.into();
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(2)).expect("valid");
    simulation.advance_until(0.25, None).expect("stable");
    let exact = 4.0 * PI * mu * omega * (inner * outer).powi(2) / (outer.powi(2) - inner.powi(2));
    let loads = simulation.take_history().pop().expect("steps were taken").loads;
    let (pressure, viscous) = (|load: &Load<2>| load.pressure_torque[2], |load: &Load<2>| load.viscous_torque[2]);
    assert_relative_eq!(viscous(&loads[0]), exact, max_relative = 0.02);
    assert!(pressure(&loads[0]).abs() < 0.05 * exact, "{}", pressure(&loads[0]));
}

/// Fluid is what was there and what has come less what has gone, to the particle, and fills its volume.
#[test]
fn mass_is_conserved_to_the_particle() {
    let side = 20;
    let spacing = 1.0 / side as f64;
    let mut value = settings::<2>(side, "cubic", "none");
    (value["wall_pressure"], value["projection_sweeps"]) = ("linear".into(), 4.into());
    value["domain"] =
        json!({"lower": [0.0, 0.0], "upper": [2.0, 1.0], "boundaries": [["inlet", "outlet"], ["slip", "slip"]]});
    let (half, buffer) = (3.0 * spacing, 8);
    let cells = (0..side).flat_map(|y| (-buffer..2 * side as i64 + buffer).map(move |x| [x as f64 + 0.5, y as f64 + 0.5]));
    let mut particles = common::particles(cells.map(|cell| Vector::from(cell) * spacing).collect());
    for i in 0..particles.real {
        let arm = particles.position[i] - Vector::from([0.7, 0.5]);
        let axis = usize::from(arm[1].abs() > arm[0].abs());
        particles.velocity[i] = Vector::from([1.0, 0.0]);
        particles.kind[i] = match particles.position[i][0] {
            _ if arm.abs().max() < half => ParticleKind::Solid,
            x if x < 0.0 => ParticleKind::Inlet,
            x if x > 2.0 => ParticleKind::Outlet,
            _ => continue,
        };
        if particles.kind[i] == ParticleKind::Solid {
            particles.depth[i] = half - arm.abs().max();
            particles.normal[i][axis] = arm[axis].signum();
        }
    }
    let particle = spacing * spacing;
    let fluid = particles.counts()[ParticleKind::Fluid as usize] as f64 * particle;
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(2)).expect("valid");
    simulation.advance_until(0.6, None).expect("stable");
    let history = simulation.take_history();
    for report in &history {
        let now = report.counts[ParticleKind::Fluid as usize] as f64 * particle;
        assert_relative_eq!(now, fluid + report.clock.mass_in - report.clock.mass_out, epsilon = 1e-12);
        assert_relative_eq!(report.volume, report.fluid as f64 * particle, max_relative = 0.005);
    }
    let last = history.last().expect("steps were taken").clock;
    // What the inlet lets in is prescribed.
    assert_relative_eq!(last.mass_in, last.time, epsilon = 1.5 * spacing);
}
