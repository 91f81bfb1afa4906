//! One step against the equations, written out with the operators; what a shift and a refill see.

use alsph::boundary::{Walls, end_step};
use alsph::frame::{Frame, Travel};
use alsph::kernel::{QuinticSpline, Smoothing};
use alsph::neighbours::{Grid, brute_force_neighbours};
use alsph::operators::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient};
use alsph::scheme::{Alsph, Step, relaxation};
use alsph::shifting::shift;
use alsph::{Clock, Matrix, ParticleKind, Particles, Settings, Simulation, Vector};
use approx::assert_relative_eq;
use common::set::Set;
use serde_json::{Value, json};
use std::f64::consts::TAU;

mod common;

const SIDE: usize = 24;
const TIME_STEP: f64 = 0.002;

/// A disordered periodic box of fluid in motion under pressure.
fn box_of_fluid() -> Particles<2> {
    let mut particles = common::particles(common::lattice::<2>(SIDE, 0.1));
    for i in 0..particles.real {
        let [x, y] = [0, 1].map(|k| TAU * particles.position[i][k]);
        particles.velocity[i] = Vector::from([0.5 + x.cos() * y.sin(), 0.8 * x.sin() - 0.2 * y.cos()]);
        particles.pressure[i] = 0.3 * (x.cos() - (x + y).sin());
    }
    particles
}

fn settings(frame: &str) -> Value {
    let mut value = common::settings_value::<2>(1.0 / SIDE as f64, "periodic");
    for (key, chosen) in [
        ("derivative_frame", json!(frame)),
        ("time_step", json!(TIME_STEP)),
        ("adaptive_time_step", json!(false)),
        ("density", json!(1.7)),
        ("body_force", json!([0.3, -0.2])),
        ("max_iterations", json!(2)),
        ("projection_sweeps", json!(2)),
        ("viscous_order", json!(4)),
        ("penalty_constant", json!(60.0)),
        ("shifting", json!("none")),
        ("divergence_tolerance", json!(1e-12)),
    ] {
        value[key] = chosen;
    }
    value
}

/// `count` steps of a simulation.
fn stepped(value: &Value, particles: Particles<2>, count: u64) -> Particles<2> {
    let mut simulation = Simulation::new(common::parse(value), particles, Clock::default(), Some(1)).expect("valid");
    simulation.advance(count, None).expect("stable");
    simulation.particles().clone()
}

/// The particles with the frame of their first step.
fn first_frame(settings: &Settings, mut particles: Particles<2>) -> Set<2> {
    let velocity_max = largest(&particles.velocity);
    let fraction = settings.derivative_frame.fraction();
    let mut frame = Frame::default();
    frame.search(settings, &mut particles, Travel { time_step: TIME_STEP, velocity_max, fraction }, true);
    frame.stencil.correct();
    Set { particles, frame }
}

fn largest(velocity: &[Vector<2>]) -> f64 {
    velocity.iter().map(|u| u.norm()).fold(0.0, f64::max)
}

/// A field of real particles with its images.
fn vectors(set: &Set<2>, value: impl Fn(usize) -> Vector<2>) -> Vec<Vector<2>> {
    let real = set.particles.real;
    let mut field: Vec<_> = (0..set.particles.len()).map(|i| if i < real { value(i) } else { Vector::zeros() }).collect();
    set.frame.images.vectors(&mut field);
    field
}

fn scalars(set: &Set<2>, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let real = set.particles.real;
    let mut field: Vec<_> = (0..set.particles.len()).map(|i| if i < real { value(i) } else { 0.0 }).collect();
    set.frame.images.scalars(&mut field);
    field
}

/// ∇²u and ∇u.
fn derivatives(set: &Set<2>, velocity: &[Vector<2>]) -> Vec<(Vector<2>, Matrix<2>)> {
    set.apply(LaplacianAndGradient { velocity, seen: |s, _| velocity[s] })
}

/// u^{n+1} and p^{n+1} of a step without solids and open sides: (8), (10), (11) and the sweeps.
fn equations(settings: &Settings, set: &Set<2>) -> (Vec<Vector<2>>, Vec<f64>) {
    let (rho, nu, dt) = (settings.density, settings.kinematic_viscosity, TIME_STEP);
    let gravity = Vector::from_column_slice(&settings.body_force);
    let initial = set.particles.velocity.clone();
    // r_AL = C_BV u_max² Δt.
    let penalty = settings.penalty_constant * largest(&initial).powi(2) * dt;
    let lead = settings.derivative_frame.fraction() * dt;
    let solenoidal = |gradient: &Matrix<2>| lead * (gradient * gradient).trace();
    // The compact Laplacian of a wave is too small by c k²Δx² of it.
    let dispersion = settings.laplacian_dispersion() * settings.particle_spacing.powi(2);
    let first = derivatives(set, &initial);
    let sharpening = derivatives(set, &vectors(set, |i| first[i].0 * dispersion));
    let (mut velocity, mut pressure) = (initial.clone(), set.particles.pressure.clone());
    for iteration in 1..=settings.max_iterations {
        let derived = derivatives(set, &velocity);
        let divergence = scalars(set, |i| derived[i].1.trace() - solenoidal(&derived[i].1));
        let both: Vec<_> = divergence.iter().zip(&pressure).map(|(&divergence, &p)| [divergence, p]).collect();
        let of_both = set.apply(GradientAndLaplacian(&both));
        let viscous = |i: usize| (derived[i].0 - sharpening[i].0) * nu;
        let star = vectors(set, |i| initial[i] + (of_both[i].0 * penalty + viscous(i) + gravity) * dt);
        let divergence = set.apply(Divergence(&star));
        let change = |i: usize| penalty * (rho * (divergence[i] - solenoidal(&derived[i].1)) - dt * of_both[i].1);
        pressure = scalars(set, |i| pressure[i] - change(i));
        let gradient = set.apply(Gradient(&pressure));
        velocity = vectors(set, |i| star[i] - gradient[i] * (dt / rho));
        if iteration == settings.max_iterations {
            let relaxation = settings.particle_spacing.powi(2) / (1.1 * settings.largest_projection_eigenvalue());
            for _ in 0..settings.projection_sweeps {
                let divergence = set.apply(Divergence(&velocity));
                let divergence = scalars(set, |i| divergence[i] - solenoidal(&derived[i].1));
                let gradient = set.apply(Gradient(&divergence));
                velocity = vectors(set, |i| velocity[i] + gradient[i] * relaxation);
                // The pressure keeps a half of each sweep.
                pressure = scalars(set, |i| pressure[i] - 0.5 * rho * relaxation / dt * divergence[i]);
            }
        }
    }
    (velocity, pressure)
}

#[test]
fn a_step_is_that_of_the_equations() {
    for frame in ["initial", "midpoint"] {
        let value = settings(frame);
        let settings = common::parse(&value);
        let set = first_frame(&settings, box_of_fluid());
        let (velocity, pressure) = equations(&settings, &set);
        let after = stepped(&value, box_of_fluid(), 1);
        for i in 0..after.real {
            assert_eq!(after.id[i], set.particles.id[i]);
            assert_relative_eq!(after.velocity[i], velocity[i], epsilon = 1e-11);
            assert_relative_eq!(after.pressure[i], pressure[i], epsilon = 1e-9);
            // (12), periodic.
            let start = if frame == "initial" { set.particles.position[i] } else { set.frame.start[i] };
            let moved = after.position[i] - start - (set.particles.velocity[i] + velocity[i]) * (0.5 * TIME_STEP);
            assert_relative_eq!(moved, moved.map(f64::round), epsilon = 1e-12);
        }
    }
}

/// Without viscosity a step changes the velocity by the gradient of the acting pressure, with sweeps and without.
#[test]
fn the_velocity_changes_by_the_gradient_of_all_that_acts() {
    for sweeps in [0, 3] {
        let mut value = settings("initial");
        value["projection_sweeps"] = json!(sweeps);
        value["kinematic_viscosity"] = json!(1e-15);
        value["body_force"] = json!([0.0, 0.0]);
        let settings = common::parse(&value);
        let Set { mut particles, mut frame } = first_frame(&settings, box_of_fluid());
        let before = particles.velocity.clone();
        let (penalty, relaxation) = (0.05, relaxation(&settings));
        let step = Step { settings: &settings, time_step: TIME_STEP, penalty, relaxation, dispersion: 0.0 };
        let mut scheme = Alsph::default();
        scheme.iterate(step, &mut particles, &mut frame, &mut Walls::new(&settings));
        let acting: Vec<_> = (0..particles.len()).map(|i| scheme.acting_pressure(step, &particles, i)).collect();
        assert!(acting.iter().zip(&particles.pressure).any(|(acting, p)| (acting - p).abs() > 1e-3), "nothing to be seen");
        let set = Set { particles, frame };
        for (i, gradient) in set.apply(Gradient(&acting)).into_iter().enumerate() {
            let change = (set.particles.velocity[i] - before[i]) * (settings.density / TIME_STEP);
            assert_relative_eq!(change, -gradient, epsilon = 1e-9);
        }
    }
}

/// The rate at which a wave along y decays in the first step, over its exact rate, less 1.
fn error_of_viscosity(length: usize, order: u8) -> f64 {
    let mut value = common::settings_value::<2>(1.0 / length as f64, "periodic");
    (value["viscous_order"], value["projection_sweeps"]) = (order.into(), 2.into());
    let mut particles = common::particles(common::lattice::<2>(length, 0.0));
    let wave = |x: &Vector<2>| (TAU * x[1]).sin();
    // So slow that nothing moves.
    (0..particles.real).for_each(|i| particles.velocity[i][0] = 1e-6 * wave(&particles.position[i]));
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(1)).expect("valid");
    simulation.advance(1, None).expect("stable");
    let (time, particles) = (simulation.clock().time, simulation.particles());
    let sums = (0..particles.real).map(|i| (wave(&particles.position[i]), particles.velocity[i][0]));
    let (product, square) = sums.fold((0.0, 0.0), |(product, square), (wave, u)| (product + wave * u, square + wave * wave));
    (1.0 - product / (1e-6 * square)) / (0.01 * TAU * TAU * time) - 1.0
}

/// The fourth order takes off all that the second leaves of a wave, c k²Δx², not most of it. c is told from two waves at second order.
#[test]
fn a_wave_decays_at_its_rate_but_for_the_fourth_order() {
    let square = |length: usize| (TAU / length as f64).powi(2);
    let [long, short] = [96, 48].map(|length| error_of_viscosity(length, 2));
    let dispersion = (long - short) / (square(48) - square(96));
    let taken_off = error_of_viscosity(48, 4) - short;
    assert_relative_eq!(taken_off, dispersion * square(48), max_relative = 0.02);
}

/// A flow past a cylinder that has gone through its solid particles until now.
fn past_a_cylinder() -> Particles<2> {
    let mut particles = common::cylinder(SIDE, 4);
    for i in 0..particles.real {
        particles.velocity[i] = Vector::from([1.0, 0.2 * (TAU * particles.position[i][0]).sin()]);
        if particles.kind[i] == ParticleKind::Solid {
            let arm = particles.position[i].add_scalar(-0.5);
            (particles.normal[i], particles.depth[i]) = (arm.normalize(), common::RADIUS - arm.norm());
        }
    }
    particles
}

/// What is carried along with a shift follows the gradient that solids make with the mirror of the fluid's velocity, 2 u_wall − ⟨u⟩,
/// whatever they show to the viscous term.
#[test]
fn the_shift_sees_the_mirror_of_the_fluid_in_the_walls() {
    for rule in ["adami", "cubic"] {
        let mut value = settings("initial");
        (value["wall_velocity"], value["wall_pressure"]) = (rule.into(), "linear".into());
        value["bodies"][0]["velocity"] = json!([0.3, 0.1]);
        let settings = common::parse(&value);
        let start = past_a_cylinder();
        let plain = stepped(&value, start.clone(), 1);
        value["shifting"] = "xsph".into();
        let shifted = stepped(&value, start.clone(), 1);
        let mut set = first_frame(&settings, start);
        let velocity_max = largest(&stepped_from(&settings, &set.particles));
        for i in 0..plain.real {
            let moved = plain.position[i] - set.particles.position[i];
            set.particles.position[i] += moved - moved.map(f64::round);
            (set.particles.velocity[i], set.particles.pressure[i]) = (plain.velocity[i], plain.pressure[i]);
        }
        set.frame.images.positions(&mut set.particles.position);
        set.frame.images.vectors(&mut set.particles.velocity);
        set.frame.images.scalars(&mut set.particles.pressure);
        let carried = |shown: Vec<Vector<2>>| {
            let (mut walls, mut particles) = (Walls::new(&settings), set.particles.clone());
            walls.viscous_velocity = shown;
            let mut settings = settings.clone();
            settings.shifting = alsph::settings::Shifting::Xsph;
            shift(&settings, &mut particles, &set.frame, &walls, TIME_STEP, velocity_max, &mut Vec::new());
            let difference = (0..plain.real).map(|i| (particles.velocity[i] - shifted.velocity[i]).norm());
            difference.fold(0.0, f64::max)
        };
        let own = carried(set.particles.velocity.clone());
        let mirrored = carried(mirror(&settings, &set));
        assert!(mirrored < 1e-11 && own > 1e-5, "{rule}: {mirrored:.1e} with the mirror, {own:.1e} with their own velocity");
    }
}

/// The velocities that a step begins with: those of solids are their body's.
fn stepped_from(settings: &Settings, particles: &Particles<2>) -> Vec<Vector<2>> {
    let body = Vector::from_column_slice(&settings.bodies[0].velocity);
    let solid = |i: usize| particles.kind[i] == ParticleKind::Solid;
    (0..particles.real).map(|i| if solid(i) { body } else { particles.velocity[i] }).collect()
}

/// 2 u_wall minus the average of the fluid's velocity, by plain sums.
fn mirror(settings: &Settings, set: &Set<2>) -> Vec<Vector<2>> {
    let Particles { position, velocity, kind, real, .. } = &set.particles;
    let smoothing = Smoothing::<QuinticSpline>::new(settings.smoothing_length(), 2);
    let frame = &set.frame.stencil.position;
    let near = brute_force_neighbours(frame, *real, settings.support_radius());
    assert_eq!(frame.len(), position.len());
    vectors(set, |s| {
        let fluid = near[s].iter().map(|&j| j as usize).filter(|&j| kind[j] != ParticleKind::Solid);
        let weights = fluid.map(|j| (smoothing.value((frame[s] - frame[j]).norm()), velocity[j]));
        let (total, sum) = weights.fold((0.0, Vector::zeros()), |(total, sum), (w, u)| (total + w, sum + u * w));
        if total > 0.0 { velocity[s] * 2.0 - sum / total } else { velocity[s] }
    })
}

/// Who follows at the far end of an inlet buffer has the pressure of the flow there.
#[test]
fn a_refilled_particle_has_the_pressure_of_its_surroundings() {
    let mut value = common::settings_value::<2>(0.1, "none");
    value["domain"]["boundaries"] = json!([["inlet", "outlet"], ["periodic", "periodic"]]);
    let settings = common::parse(&value);
    let cells = (0..80).map(|k| [k % 8, k / 8]);
    let mut particles =
        common::particles(cells.map(|[x, y]| Vector::from([-0.05 - 0.1 * x as f64, 0.05 + 0.1 * y as f64])).collect());
    particles.kind.fill(ParticleKind::Inlet);
    let pressure = |x: &Vector<2>| 3.0 + x[0] + 0.1 * x[1];
    (0..80).for_each(|i| particles.pressure[i] = pressure(&particles.position[i]));
    let mut grid = Grid::default();
    grid.build(&particles.position, settings.support_radius(), settings.bounds());
    // One has crossed the inlet.
    let crossing = 8 * 4;
    particles.position[crossing][0] = 0.01;
    end_step(&mut particles, &settings, &grid, &mut 100);
    let new = particles.id.iter().position(|&id| id == 100).expect("one follows");
    let last = crossing + 7;
    assert_relative_eq!(particles.position[new], Vector::from([-0.79, 0.45]), epsilon = 1e-12);
    assert_eq!(particles.pressure[new], pressure(&particles.position[last]));
}
