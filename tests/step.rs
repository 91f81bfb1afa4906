//! One step against the equations, written out with the operators; what a shift and a refill see.

use alsph::boundary::{Walls, end_step};
use alsph::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient};
use alsph::flow::{Before, Flow, Step};
use alsph::forcing::BodyForce;
use alsph::frame::{Frame, Travel};
use alsph::kernel::{QuinticSpline, Smoothing};
use alsph::motion::Motion;
use alsph::neighbours::Grid;
use alsph::scheme::{Alsph, Outcome, Scheme};
use alsph::settings::{SweepPressure, SweepWeights, WallPressure};
use alsph::shifting::shift;
use alsph::surface::Surface;
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
    set.frame.images.fill(&mut field);
    field
}

fn scalars(set: &Set<2>, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let real = set.particles.real;
    let mut field: Vec<_> = (0..set.particles.len()).map(|i| if i < real { value(i) } else { 0.0 }).collect();
    set.frame.images.fill(&mut field);
    field
}

/// ∇²u and ∇u, solids showing the fluid the mirror of its velocity.
fn derivatives(settings: &Settings, set: &Set<2>, velocity: &[Vector<2>]) -> Vec<(Vector<2>, Matrix<2>)> {
    let mirror = mirror(settings, set, velocity);
    let solid = |i: usize| set.particles.kind[i] == ParticleKind::Solid;
    set.apply(LaplacianAndGradient { velocity, seen: |s, i| if solid(i) { velocity[s] } else { mirror[s] } })
}

/// u^{n+1} and p^{n+1} of a step: (8), (10), (11) and the sweeps, with the pressure of solids (20).
fn equations(settings: &Settings, set: &Set<2>) -> (Vec<Vector<2>>, Vec<f64>) {
    let (rho, nu, dt) = (settings.density, settings.kinematic_viscosity, TIME_STEP);
    let gravity = Vector::from_column_slice(&settings.body_force);
    let Particles { kind, normal, .. } = &set.particles;
    let paper_walls = settings.wall_pressure == WallPressure::Paper;
    let initial = set.particles.velocity.clone();
    let spacing = settings.particle_spacing;
    let penalty = match settings.penalty_constant {
        Some(constant) => constant * largest(&initial).powi(2) * dt,
        None => spacing.powi(2) / (settings.largest_laplacian_eigenvalue() * dt),
    };
    let theta = settings.viscous_theta;
    let lead = settings.derivative_frame.fraction() * dt;
    let solenoidal = |gradient: &Matrix<2>| lead * (gradient * gradient).trace();
    // What is prescribed at both ends of the flow has no divergence to be taken off.
    let deep = |i: usize| kind[i] == ParticleKind::Inlet && set.frame.stencil.position[i][0] < -settings.support_radius();
    let beyond = |i: usize, divergence: f64| if deep(i) { 0.0 } else { divergence };
    // The compact Laplacian of a wave is too small by c k²Δx² of it.
    let dispersion = settings.laplacian_dispersion() * spacing.powi(2);
    let first = derivatives(settings, set, &initial);
    let sharpening = derivatives(settings, set, &vectors(set, |i| first[i].0 * dispersion));
    let sharpening = |i: usize| if settings.viscous_order == 4 { sharpening[i].0 } else { Vector::zeros() };
    let (mut velocity, mut pressure) = (initial.clone(), set.particles.pressure.clone());
    for iteration in 1..=settings.max_iterations {
        let derived = derivatives(settings, set, &velocity);
        let divergence = scalars(set, |i| derived[i].1.trace() - solenoidal(&derived[i].1));
        let both: Vec<_> = divergence.iter().zip(&pressure).map(|(&divergence, &p)| [divergence, p]).collect();
        let of_both = set.apply(GradientAndLaplacian(&both));
        let viscous = |i: usize| (derived[i].0 * theta + first[i].0 * (1.0 - theta) - sharpening(i)) * nu;
        let star = vectors(set, |i| match kind[i] {
            ParticleKind::Outlet => initial[i],
            ParticleKind::Solid if !paper_walls => initial[i],
            _ => initial[i] + (of_both[i].0 * penalty + viscous(i) + gravity) * dt,
        });
        let divergence = set.apply(Divergence(&star));
        let change = |i: usize| {
            let divergence = beyond(i, divergence[i] - solenoidal(&derived[i].1));
            penalty * (rho * divergence - dt * of_both[i].1)
        };
        let gradient = set.apply(Gradient(&pressure));
        let gradient =
            vectors(set, |i| if settings.wall_pressure == WallPressure::Linear { gradient[i] } else { gravity * rho });
        pressure = scalars(set, |i| match kind[i] {
            ParticleKind::Outlet => 0.0,
            // What stops Δu takes a pressure of ½ρ (Δu·n)².
            ParticleKind::Solid if paper_walls => {
                pressure[i] - change(i) + 0.5 * rho * (star[i] - initial[i]).dot(&normal[i]).powi(2)
            }
            _ => pressure[i] - change(i),
        });
        if !paper_walls {
            pressure = extrapolated(settings, set, &pressure, |j, r_ij| pressure[j] + gradient[j].dot(&r_ij));
        }
        let gradient = set.apply(Gradient(&pressure));
        let is_fluid = |i: usize| kind[i] == ParticleKind::Fluid;
        velocity = vectors(set, |i| if is_fluid(i) { star[i] - gradient[i] * (dt / rho) } else { velocity[i] });
        if iteration == settings.max_iterations {
            // The eigenvalues whose waves two sweeps take off, over the largest: the zeros of T_2 on [0.2, 1].
            let zeros = match settings.sweep_weights {
                SweepWeights::Equal => [1.0, 1.0],
                SweepWeights::Chebyshev => [0.6 + 0.4 * 0.5f64.sqrt(), 0.6 - 0.4 * 0.5f64.sqrt()],
            };
            let before = pressure.clone();
            for zero in &zeros[..settings.projection_sweeps] {
                let relaxation = spacing.powi(2) / (1.1 * zero * settings.largest_projection_eigenvalue());
                let divergence = set.apply(Divergence(&velocity));
                let divergence = scalars(set, |i| match kind[i] {
                    ParticleKind::Outlet => 0.0,
                    _ => beyond(i, divergence[i] - solenoidal(&derived[i].1)),
                });
                let divergence = extrapolated(settings, set, &divergence, |j, _| divergence[j]);
                let gradient = set.apply(Gradient(&divergence));
                velocity = vectors(set, |i| if is_fluid(i) { velocity[i] + gradient[i] * relaxation } else { velocity[i] });
                // The pressure keeps a half of each sweep.
                pressure = scalars(set, |i| pressure[i] - 0.5 * rho * relaxation / dt * divergence[i]);
            }
            if settings.sweep_pressure == SweepPressure::Smooth {
                // Of a wave with an eigenvalue λ of the compact Laplacian 1 − λ/λ_max is left.
                let kept: Vec<_> = pressure.iter().zip(&before).map(|(after, before)| [0.0, after - before]).collect();
                let laplacian = set.apply(GradientAndLaplacian(&kept));
                let shortest = spacing.powi(2) / settings.largest_laplacian_eigenvalue();
                pressure = scalars(set, |i| pressure[i] + if is_fluid(i) { shortest * laplacian[i].1 } else { 0.0 });
            }
        }
    }
    (velocity, pressure)
}

#[test]
fn a_step_is_that_of_the_equations() {
    let paper = [json!(60.0), json!(1.0), json!("equal"), json!("rough"), json!(4)];
    let second_order = [Value::Null, json!(0.5), json!("chebyshev"), json!("smooth"), json!(4)];
    let mixed = [Value::Null, json!(0.7), json!("equal"), json!("smooth"), json!(2)];
    for (frame, chosen) in [
        ("initial", &paper),
        ("midpoint", &paper),
        ("midpoint", &second_order),
        ("initial", &second_order),
        ("midpoint", &mixed),
    ] {
        let mut value = settings(frame);
        let keys = ["penalty_constant", "viscous_theta", "sweep_weights", "sweep_pressure", "viscous_order"];
        for (key, chosen) in keys.into_iter().zip(chosen) {
            value[key] = chosen.clone();
        }
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

/// The same between an inlet and an outlet, past a cylinder whose surface slides, by each rule for the pressure of solids.
#[test]
fn a_step_past_a_body_is_that_of_the_equations() {
    let rules = [("initial", "paper", "rough"), ("initial", "adami", "rough"), ("midpoint", "linear", "smooth")];
    for (frame, wall_pressure, sweep_pressure) in rules {
        let mut value = settings(frame);
        (value["wall_pressure"], value["viscous_order"]) = (wall_pressure.into(), 2.into());
        value["sweep_pressure"] = sweep_pressure.into();
        value["domain"]["boundaries"] = json!([["inlet", "outlet"], ["periodic", "periodic"]]);
        value["bodies"][0]["velocity"] = json!([0.3, 0.1]);
        let settings = common::parse(&value);
        let mut start = past_a_cylinder();
        with_buffers(&mut start);
        for i in 0..start.real {
            start.pressure[i] = (start.position[i][0] - 2.0 * start.position[i][1]).sin();
        }
        let mut set = first_frame(&settings, start.clone());
        set.particles.velocity = vectors(&set, |i| stepped_from(&settings, &set.particles)[i]);
        let (velocity, pressure) = equations(&settings, &set);
        let after = stepped(&value, start, 1);
        assert!(after.counts().iter().all(|&count| count >= 100), "{:?}", after.counts());
        for i in 0..after.real {
            assert_eq!(after.id[i], set.particles.id[i]);
            assert_relative_eq!(after.velocity[i], velocity[i], epsilon = 1e-11);
            assert_relative_eq!(after.pressure[i], pressure[i], epsilon = 1e-9);
        }
    }
}

/// Columns of particles upstream and downstream of the unit box.
fn with_buffers(particles: &mut Particles<2>) {
    let [rows, columns] = [SIDE, 8];
    for (kind, first) in [(ParticleKind::Inlet, -(columns as f64)), (ParticleKind::Outlet, SIDE as f64)] {
        for k in 0..rows * columns {
            let i = particles.push_copy(0);
            let [x, y] = [first + (k / rows) as f64, (k % rows) as f64];
            particles.position[i] = Vector::from([x, y]).add_scalar(0.5) / SIDE as f64;
            particles.velocity[i] = Vector::from([1.0 + 0.3 * (TAU * particles.position[i][1]).sin(), 0.0]);
            (particles.kind[i], particles.id[i]) = (kind, i as u64);
        }
    }
    particles.real = particles.len();
}

fn first_flow(settings: &Settings, start: Particles<2>) -> Flow<2> {
    let Set { particles, frame } = first_frame(settings, start);
    Flow {
        particles,
        frame,
        walls: Walls::new(settings),
        before: Before::default(),
        body_force: BodyForce::new(settings),
        surface: Surface::default(),
        motion: Motion::default(),
    }
}

/// Without viscosity a step changes the velocity by the gradient of the acting pressure, with sweeps and without, and says what
/// divergence it leaves.
#[test]
fn the_velocity_changes_by_the_gradient_of_all_that_acts() {
    for (sweeps, kept) in [(0, "rough"), (3, "rough"), (3, "smooth")] {
        let mut value = settings("initial");
        (value["projection_sweeps"], value["sweep_pressure"]) = (json!(sweeps), kept.into());
        value["kinematic_viscosity"] = json!(1e-15);
        value["body_force"] = json!([0.0, 0.0]);
        let settings = common::parse(&value);
        let mut flow = first_flow(&settings, box_of_fluid());
        let step = Step { settings: &settings, time_step: TIME_STEP, velocity_max: 1.0 };
        let mut scheme = Alsph::new(&settings);
        // A second step in the same frame has nothing of the first.
        for _ in 0..2 {
            flow.remember();
            let solved = scheme.solve(step, &mut flow);
            let Flow { particles, frame, walls, before, body_force, surface, motion } = flow;
            let acting: Vec<_> = (0..particles.len()).map(|i| scheme.acting_pressure(step, &particles, i)).collect();
            let seen = acting.iter().zip(&particles.pressure).any(|(acting, p)| (acting - p).abs() > 1e-3);
            assert!(seen, "nothing to be seen");
            let set = Set { particles, frame };
            for (i, gradient) in set.apply(Gradient(&acting)).into_iter().enumerate() {
                let change = (set.particles.velocity[i] - before.velocity[i]) * (settings.density / TIME_STEP);
                assert_relative_eq!(change, -gradient, epsilon = 1e-9);
            }
            let divergence = set.apply(Divergence(&set.particles.velocity)).into_iter().map(f64::abs);
            let outcome = Outcome::new(&settings, &set.particles, solved, |i| scheme.divergence(i));
            assert_relative_eq!(outcome.divergence_max, divergence.clone().fold(0.0, f64::max), epsilon = 1e-12);
            assert_relative_eq!(outcome.divergence_sum, divergence.sum::<f64>(), max_relative = 1e-9);
            let Set { particles, frame } = set;
            flow = Flow { particles, frame, walls, before, body_force, surface, motion };
        }
    }
}

/// A weakly compressible step is half of p, all of u and the other half of p, with what diffuses of p in the middle of it.
#[test]
fn a_weakly_compressible_step_is_that_of_its_equations() {
    for (scheme, coefficient, corrected) in [
        (
            json!({"kind": "wcsph", "sound_speed": 9.0, "density_diffusion": "none", "diffusion_coefficient": 0.1}),
            0.0,
            false,
        ),
        (
            json!({"kind": "wcsph", "sound_speed": 9.0, "density_diffusion": "molteni", "diffusion_coefficient": 0.1}),
            0.1,
            false,
        ),
        (
            json!({"kind": "wcsph", "sound_speed": 9.0, "density_diffusion": "antuono", "diffusion_coefficient": 0.2}),
            0.2,
            true,
        ),
        (json!({"kind": "edac", "sound_speed": 9.0, "diffusion_coefficient": 0.4}), 0.05, false),
    ] {
        let mut value = settings("midpoint");
        (value["scheme"], value["wall_pressure"]) = (scheme, json!("linear"));
        value["viscous_order"] = json!(2);
        let settings = common::parse(&value);
        let set = first_frame(&settings, box_of_fluid());
        let (before, p, dt) = (set.particles.velocity.clone(), set.particles.pressure.clone(), TIME_STEP);
        let stiffness = 0.5 * dt * settings.density * 81.0;
        let divergence = |velocity: &[Vector<2>]| set.apply(Divergence(velocity));
        let compressed = divergence(&before);
        let middle = scalars(&set, |i| p[i] - stiffness * compressed[i]);
        let pairs: Vec<_> = middle.iter().map(|&p| [p; 2]).collect();
        let pushed = set.apply(GradientAndLaplacian(&pairs));
        let viscous = derivatives(&settings, &set, &before);
        let gravity = Vector::from_column_slice(&settings.body_force);
        let velocity = vectors(&set, |i| {
            let acceleration = viscous[i].0 * settings.kinematic_viscosity - pushed[i].0 / settings.density + gravity;
            before[i] + acceleration * dt
        });
        let (again, gradient) = (divergence(&velocity), vectors(&set, |i| pushed[i].0));
        let spread = divergence(&gradient);
        let diffusivity = coefficient * settings.smoothing_length() * 9.0;
        let after = stepped(&value, box_of_fluid(), 1);
        for i in 0..after.real {
            let diffusing = pushed[i].1 - if corrected { spread[i] } else { 0.0 };
            let pressure = middle[i] - stiffness * again[i] + dt * diffusivity * diffusing;
            assert_eq!(after.id[i], set.particles.id[i]);
            assert_relative_eq!(after.velocity[i], velocity[i], epsilon = 1e-11);
            assert_relative_eq!(after.pressure[i], pressure, epsilon = 1e-10);
        }
    }
}

/// Fluid at rest under an even pressure acts with that alone.
#[test]
fn at_rest_the_pressure_acts_as_it_is() {
    let mut value = settings("midpoint");
    value["body_force"] = json!([0.0, 0.0]);
    // The sweeps come with the last iteration that may be.
    value["max_iterations"] = json!(1);
    let settings = common::parse(&value);
    let mut start = box_of_fluid();
    start.velocity.fill(Vector::zeros());
    start.pressure.fill(2.5);
    let mut flow = first_flow(&settings, start);
    let step = Step { settings: &settings, time_step: TIME_STEP, velocity_max: 1.0 };
    let mut scheme = Alsph::new(&settings);
    flow.remember();
    scheme.solve(step, &mut flow);
    let particles = flow.particles;
    for i in 0..particles.real {
        assert_eq!(particles.velocity[i], Vector::<2>::zeros());
        assert_eq!([particles.pressure[i], scheme.acting_pressure(step, &particles, i)], [2.5; 2]);
    }
}

/// What a first step leaves of a wave along y, and Δt.
fn left_of_a_wave(value: &Value, length: usize) -> (f64, f64) {
    let mut particles = common::particles(common::lattice::<2>(length, 0.0));
    let wave = |x: &Vector<2>| (TAU * x[1]).sin();
    // So slow that nothing moves.
    (0..particles.real).for_each(|i| particles.velocity[i][0] = 1e-6 * wave(&particles.position[i]));
    let mut simulation = Simulation::new(common::parse(value), particles, Clock::default(), Some(1)).expect("valid");
    simulation.advance(1, None).expect("stable");
    let (time, particles) = (simulation.clock().time, simulation.particles());
    let sums = (0..particles.real).map(|i| (wave(&particles.position[i]), particles.velocity[i][0]));
    let (product, square) = sums.fold((0.0, 0.0), |(product, square), (wave, u)| (product + wave * u, square + wave * wave));
    (product / (1e-6 * square), time)
}

/// The rate at which a wave along y decays in the first step, over its exact rate, less 1.
fn error_of_viscosity(length: usize, order: u8) -> f64 {
    let mut value = common::settings_value::<2>(1.0 / length as f64, "periodic");
    (value["viscous_order"], value["projection_sweeps"]) = (order.into(), 2.into());
    let (left, time) = left_of_a_wave(&value, length);
    (1.0 - left) / (0.01 * TAU * TAU * time) - 1.0
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

/// The viscous term of a wave that nothing else acts on is u − xu to first order in a step, x = νk²Δt; with the new velocity in the second
/// iteration u − xu + θx²u, which is exact to second order with θ = ½.
#[test]
fn the_viscous_term_is_of_second_order_in_time_with_a_half_of_the_new_velocity() {
    let left = |theta: f64, time_step: f64| {
        let mut value = common::settings_value::<2>(1.0 / 24.0, "periodic");
        value["viscous_theta"] = theta.into();
        (value["max_iterations"], value["time_step"]) = (2.into(), time_step.into());
        left_of_a_wave(&value, 24).0
    };
    let x = (1.0 - left(0.5, 1e-6)) / 1e-6 * 0.02;
    assert!(x > 5e-3, "{x}");
    for theta in [0.5, 0.7] {
        assert_relative_eq!(left(theta, 0.02), 1.0 - x + theta * x * x, epsilon = 1e-8);
    }
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
        set.frame.images.fill_positions(&mut set.particles.position);
        set.frame.images.fill(&mut set.particles.velocity);
        set.frame.images.fill(&mut set.particles.pressure);
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
        let mirrored = carried(mirror(&settings, &set, &set.particles.velocity));
        assert!(mirrored < 1e-11 && own > 1e-5, "{rule}: {mirrored:.1e} with the mirror, {own:.1e} with their own velocity");
    }
}

/// The ∇·u that the shift finds is that of the last derivatives without a shift, in each frame, past a body whose surface slides.
#[test]
fn a_shift_finds_the_divergence_that_the_iterations_leave() {
    for frame in ["initial", "midpoint", "updated"] {
        let left = |shifting: &str| {
            let mut value = settings(frame);
            (value["wall_velocity"], value["wall_pressure"], value["shifting"]) =
                ("cubic".into(), "linear".into(), shifting.into());
            value["bodies"][0]["velocity"] = json!([0.3, 0.1]);
            let simulation = Simulation::new(common::parse(&value), past_a_cylinder(), Clock::default(), Some(1));
            let mut simulation = simulation.expect("valid");
            simulation.advance(1, None).expect("stable");
            simulation.take_history()[0].outcome
        };
        let (shifted, plain) = (left("xsph"), left("none"));
        assert!(plain.divergence_max > 1e-3, "nothing to be seen");
        assert_relative_eq!(shifted.divergence_max, plain.divergence_max, max_relative = 1e-11);
        assert_relative_eq!(shifted.divergence_sum, plain.divergence_sum, max_relative = 1e-11);
    }
}

/// The velocities that a step begins with: those of solids are their body's.
fn stepped_from(settings: &Settings, particles: &Particles<2>) -> Vec<Vector<2>> {
    let body = Vector::from_column_slice(settings.bodies[0].velocity.as_deref().expect("given"));
    let solid = |i: usize| particles.kind[i] == ParticleKind::Solid;
    (0..particles.real).map(|i| if solid(i) { body } else { particles.velocity[i] }).collect()
}

/// 2 u_wall minus the average of the fluid's velocity; the velocity itself at others than solids.
fn mirror(settings: &Settings, set: &Set<2>, velocity: &[Vector<2>]) -> Vec<Vector<2>> {
    let average = averages(settings, set, |j, _| velocity[j]);
    vectors(set, |s| average[s].map_or(velocity[s], |average| velocity[s] * 2.0 - average))
}

/// `field`, at solids the average of what `value` gives for flowing neighbours j and r_ij.
fn extrapolated(settings: &Settings, set: &Set<2>, field: &[f64], value: impl Fn(usize, Vector<2>) -> f64) -> Vec<f64> {
    let average = averages(settings, set, |j, r_ij| Vector::from([value(j, r_ij)]));
    let solid = |i: usize| set.particles.kind[i] == ParticleKind::Solid;
    scalars(set, |i| if solid(i) { average[i].map_or(0.0, |average| average[0]) } else { field[i] })
}

/// Σ W value / Σ W over the flowing neighbours of each solid, by plain sums; None without any.
fn averages<const N: usize>(
    settings: &Settings,
    set: &Set<2>,
    value: impl Fn(usize, Vector<2>) -> Vector<N>,
) -> Vec<Option<Vector<N>>> {
    let Particles { kind, real, .. } = &set.particles;
    let smoothing = Smoothing::new(QuinticSpline, settings.smoothing_length(), 2);
    let position = &set.frame.stencil.position;
    let average = |s: usize| {
        let mut sums = (0.0, Vector::zeros());
        for j in (0..position.len()).filter(|&j| kind[j] != ParticleKind::Solid) {
            let r_ij = position[s] - position[j];
            let weight = smoothing.value(r_ij.norm());
            sums = (sums.0 + weight, sums.1 + value(j, r_ij) * weight);
        }
        (sums.0 > 0.0).then(|| sums.1 / sums.0)
    };
    (0..*real).map(|i| if kind[i] == ParticleKind::Solid { average(i) } else { None }).collect()
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
    grid.build(&particles.position, &particles.id, settings.support_radius(), settings.bounds());
    // One has crossed the inlet.
    let crossing = 8 * 4;
    particles.position[crossing][0] = 0.01;
    end_step(&mut particles, &settings, &grid, 0.01);
    let new = particles.id.iter().position(|&id| id == (1 << 40) + crossing as u64).expect("one follows");
    let last = crossing + 7;
    assert_relative_eq!(particles.position[new], Vector::from([-0.79, 0.45]), epsilon = 1e-12);
    assert_eq!(particles.pressure[new], pressure(&particles.position[last]));
}
