//! Fluids with a free surface: operators where the support of a particle is cut, what is found to be the surface, and what a step keeps.

use alsph::base::Tensor;
use alsph::discretisation::{
    AdjointGradient, ConservativeGradient, Divergence, LaplacianAndItsSum, LaplacianDiagonal, Roughness, VelocityGradient,
};
use alsph::frame::{Frame, Travel};
use alsph::motion::Pose;
use alsph::report::Report;
use alsph::settings::{Settings, Solver};
use alsph::surface::Surface;
use alsph::{Clock, Matrix, ParticleKind, Particles, Place, Simulation, Vector};
use approx::assert_relative_eq;
use common::set::Set;
use common::solve::solve_beside;
use nalgebra::Vector3;
use proptest::prelude::*;
use serde_json::json;

mod common;

const SPACING: f64 = 0.1;

/// Settings of a box of side 4 with a free surface; gravity points down.
fn settings<const D: usize>(sides: &str, gradient: &str) -> Settings {
    let mut value = common::settings_value::<D>(SPACING, sides);
    let mut force = vec![0.0; D];
    force[D - 1] = -1.0;
    let surface = json!({"reference_velocity": 1, "pressure_gradient": gradient, "tension": false, "packing_relaxation": 0.05, "artificial_viscosity": 0.05});
    let others = json!({
        "free_surface": surface, "body_force": force, "derivative_frame": "midpoint", "shifting": "none",
        "wall_pressure": "linear", "penalty_constant": null, "courant": 0.2, "time_step": 1, "viscous_theta": 0.5,
        "max_iterations": 2, "projection_sweeps": 4, "bodies": [],
    });
    for (name, of) in others.as_object().expect("a table") {
        value[name] = of.clone();
    }
    value["domain"]["upper"] = vec![4.0; D].into();
    common::parse(&value)
}

/// A block of particles with its lowest corner at `corner`, each moved by up to `disorder` spacings.
fn block<const D: usize>(corner: [f64; D], counts: [usize; D], disorder: f64, seed: u64) -> Vec<Vector<D>> {
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let total = counts.iter().product::<usize>();
    (0..total)
        .map(|mut number| {
            Vector::from_fn(|axis, _| {
                let k = number % counts[axis];
                number /= counts[axis];
                corner[axis] + (k as f64 + 0.5 + 2.0 * disorder * random()) * SPACING
            })
        })
        .collect()
}

/// Every scheme.
fn schemes() -> [serde_json::Value; 6] {
    let isph = |share: f64, solver: &str| json!({"kind": "isph", "pressure_share": share, "solver": solver, "tolerance": 1e-3, "max_solver_iterations": 200});
    [
        json!({"kind": "alsph"}),
        isph(1.0, "bicgstab"),
        isph(0.5, "multigrid"),
        json!({"kind": "explicit_isph", "sweeps": 1, "mach_number": 0.1}),
        json!({"kind": "wcsph", "sound_speed": 15, "density_diffusion": "antuono", "diffusion_coefficient": 0.1}),
        json!({"kind": "edac", "sound_speed": 15, "diffusion_coefficient": 0.5}),
    ]
}

/// [`settings`] of a scheme.
fn settings_of<const D: usize>(scheme: &serde_json::Value, sides: &str, gradient: &str) -> Settings {
    let mut value = serde_json::to_value(settings::<D>(sides, gradient)).expect("JSON");
    value["scheme"] = scheme.clone();
    common::parse(&value)
}

fn fluid<const D: usize>(position: Vec<Vector<D>>, velocity: impl Fn(&Vector<D>) -> Vector<D>) -> Particles<D> {
    let mut particles = common::particles(position);
    particles.velocity = particles.position.iter().map(velocity).collect();
    particles
}

fn found<const D: usize>(settings: &Settings, mut particles: Particles<D>) -> (Particles<D>, Frame<D>, Surface<D>) {
    let (mut frame, mut surface) = (Frame::default(), Surface::default());
    frame.search(settings, &mut particles, Travel::default(), false);
    surface.find(settings, &particles, &mut frame);
    (particles, frame, surface)
}

/// Σ V u·G*(q B) + Σ V q ∇·u, over what it is made of.
fn adjointness<const D: usize>(settings: &Settings, position: Vec<Vector<D>>) -> f64 {
    let wave = |x: &Vector<D>| Vector::from_fn(|k, _| (7.0 * x[k] + 3.0 * x.sum()).sin());
    let (mut particles, frame, _) = found(settings, fluid(position, wave));
    frame.images.fill(&mut particles.velocity);
    let (real, count) = (particles.real, particles.len());
    let q = |i: usize| (5.0 * particles.position[i].sum()).cos();
    let mut tensor = vec![Tensor(Matrix::<D>::zeros()); count];
    for i in 0..real {
        tensor[i].0 = frame.stencil.correction[i].inverse * q(i);
    }
    frame.images.fill(&mut tensor);
    let (mut pushed, mut taken) = (vec![0.0; real], vec![0.0; real]);
    frame.stencil.for_each_one(AdjointGradient { tensor: &tensor, own: |_| 1.0 }, &mut pushed, |i, value, out| {
        *out = value.dot(&particles.velocity[i]);
    });
    frame.stencil.for_each_one(Divergence(&particles.velocity), &mut taken, |i, value, out| *out = value * q(i));
    let size: f64 = taken.iter().map(|value| value.abs()).sum();
    (pushed.iter().sum::<f64>() + taken.iter().sum::<f64>()) / size
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    /// Slopes are in single precision, but the same for both of a pair but for rounding.
    #[test]
    fn the_gradient_of_the_penalty_is_adjoint_to_the_divergence(seed in 0u64..1000, disorder in 0.0..0.25f64) {
        for sides in ["air", "slip"] {
            let corner = if sides == "air" { 1.0 } else { 0.0 };
            let settings = settings::<2>(sides, "adjoint");
            prop_assert!(adjointness(&settings, block([corner; 2], [14, 9], disorder, seed)).abs() < 1e-6);
            let settings = self::settings::<3>(sides, "adjoint");
            prop_assert!(adjointness(&settings, block([corner; 3], [6, 5, 7], disorder, seed)).abs() < 1e-6);
        }
    }

    #[test]
    fn forces_between_particles_cancel(seed in 0u64..1000) {
        let settings = settings::<2>("air", "conservative");
        let (particles, frame, _) = found(&settings, fluid(block([1.0; 2], [12, 8], 0.2, seed), |_| Vector::zeros()));
        let pressure: Vec<f64> = particles.position.iter().map(|x| 1.0 + (3.0 * x.sum()).sin()).collect();
        let mut force = vec![Vector::<2>::zeros(); particles.real];
        frame.stencil.for_each_one(ConservativeGradient { pressure: &pressure, own: |_| 1.0 }, &mut force, |_, value, out| *out = value);
        let size: f64 = force.iter().map(|f| f.norm()).sum();
        let sum: Vector<2> = force.iter().sum();
        let torque: f64 = force.iter().zip(&particles.position).map(|(f, x)| x[0] * f[1] - x[1] * f[0]).sum();
        prop_assert!(sum.norm() < 1e-6 * size && torque.abs() < 1e-6 * size, "{sum} {torque} of {size}");
    }
}

/// What the artificial viscosity does to velocities, not less thinly surrounded ones.
fn roughness<const D: usize>(particles: &mut Particles<D>, frame: &Frame<D>) -> Vec<Vector<D>> {
    frame.images.fill(&mut particles.velocity);
    let (velocity, count) = (&particles.velocity, particles.len());
    let mut gradient = vec![Tensor(Matrix::<D>::zeros()); count];
    frame.stencil.for_each_one(VelocityGradient(velocity), frame.images.real(&mut gradient), |_, value, out| out.0 = value);
    frame.images.fill(&mut gradient);
    let mut found = vec![Vector::zeros(); particles.real];
    let operator = Roughness { velocity, gradient: &gradient, weight: &vec![1.0; count] };
    frame.stencil.for_each_one(operator, &mut found, |_, value, out| *out = value);
    found
}

fn artificial_viscosity_is_of_roughness_alone<const D: usize>(counts: [usize; D], seed: u64) {
    let settings = settings::<D>("air", "adjoint");
    // A linear flow has none, but for neighbours of those at the surface, where α⁻¹ is bounded.
    let linear =
        |x: &Vector<D>| Vector::from_fn(|k, _| 0.3 + (0..D).map(|l| (k as f64 - 2.0 * l as f64) * x[l]).sum::<f64>());
    let (mut particles, frame, _) = found(&settings, fluid(block([1.0; D], counts, 0.2, seed), linear));
    let is_within = |x: &Vector<D>| (0..D).all(|k| (0.55..counts[k] as f64 * SPACING - 0.55).contains(&(x[k] - 1.0)));
    for (i, rough) in roughness(&mut particles, &frame).into_iter().enumerate() {
        let x = &particles.position[i];
        assert!(!is_within(x) || rough.norm() < 1e-3, "{rough} at {x}");
    }
    // What goes from particle to particle it takes, and momentum it keeps.
    let mut sign = 1.0;
    particles.velocity.iter_mut().for_each(|u| {
        sign = -sign;
        *u = Vector::from_fn(|k, _| sign * (k as f64 + 1.0));
    });
    let rough = roughness(&mut particles, &frame);
    let (size, sum): (f64, Vector<D>) = (rough.iter().map(|r| r.norm()).sum(), rough.iter().sum());
    assert!(sum.norm() < 1e-6 * size, "{sum} of {size}");
    let work: f64 = rough.iter().zip(&particles.velocity).map(|(r, u)| r.dot(u)).sum();
    let energy: f64 = particles.velocity[..particles.real].iter().map(|u| u.norm_squared()).sum();
    assert!(work < -energy / SPACING.powi(2), "{work} of {energy}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn artificial_viscosity_takes_what_goes_from_particle_to_particle_alone(seed in 0u64..1000) {
        artificial_viscosity_is_of_roughness_alone::<2>([20, 16], seed);
        artificial_viscosity_is_of_roughness_alone::<3>([13, 14, 13], seed);
    }
}

#[test]
fn artificial_viscosity_is_of_fourth_order_in_a_smooth_flow() {
    let of = |wavelength: f64| {
        let settings = settings::<2>("air", "adjoint");
        let wave = |x: &Vector<2>| Vector::<2>::new(0.0, (x[0] * std::f64::consts::TAU / wavelength).sin());
        let (mut particles, frame, _) = found(&settings, fluid(block([0.5; 2], [30, 30], 0.0, 0), wave));
        let rough = roughness(&mut particles, &frame);
        let middle = |x: &Vector<2>| x.iter().all(|x| (1.1..2.9).contains(x));
        let size = |i: usize| if middle(&particles.position[i]) { rough[i].norm() } else { 0.0 };
        (0..particles.real).map(size).fold(0.0, f64::max)
    };
    assert_relative_eq!(of(1.6) / of(3.2), 16.0, max_relative = 0.1);
}

#[test]
fn the_surface_is_the_outermost_row() {
    let settings = settings::<2>("air", "adjoint");
    let (particles, _, surface) = found(&settings, fluid(block([1.0; 2], [20, 16], 0.0, 0), |_| Vector::zeros()));
    for (x, place) in particles.position.iter().zip(&surface.place) {
        let rows =
            (0..2).map(|k| (x[k] - 1.0).min([2.0, 1.6][k] - (x[k] - 1.0)) / SPACING).fold(f64::INFINITY, f64::min).floor();
        let expected = match rows as usize {
            0 => Place::AtSurface,
            1 | 2 => Place::Near,
            _ => Place::Inside,
        };
        let seen = if rows == 2.0 && *place == Place::Inside { Place::Near } else { *place }; // nearly whole there
        assert_eq!(seen, expected, "at {x}, row {rows}");
    }
    assert!(surface.weight.iter().all(|w| (0.0..=1.0).contains(w)));
}

#[test]
fn the_surface_in_space_is_the_outermost_layer() {
    let settings = settings::<3>("air", "adjoint");
    let (particles, _, surface) = found(&settings, fluid(block([1.0; 3], [10, 11, 12], 0.0, 0), |_| Vector::zeros()));
    let at_surface = |x: &Vector<3>| {
        (0..3).any(|k| {
            let row = ((x[k] - 1.0) / SPACING).floor() as usize;
            row == 0 || row == [9, 10, 11][k]
        })
    };
    for (x, place) in particles.position.iter().zip(&surface.place) {
        assert_eq!(*place == Place::AtSurface, at_surface(x), "at {x}: {place:?}");
    }
}

#[test]
fn beside_a_slip_wall_is_no_surface() {
    let settings = settings::<2>("slip", "adjoint");
    let (particles, _, surface) = found(&settings, fluid(block([0.0; 2], [40, 10], 0.0, 0), |_| Vector::zeros()));
    for (x, place) in particles.position.iter().zip(&surface.place) {
        assert_eq!(*place == Place::AtSurface, x[1] > 0.9, "at {x}");
    }
}

#[test]
fn a_row_is_alone_and_three_are_not() {
    let settings = settings::<2>("air", "adjoint");
    let places = |rows| found(&settings, fluid(block([1.0; 2], [20, rows], 0.0, 0), |_| Vector::zeros())).2.place;
    assert!(places(1).iter().all(|place| *place == Place::Isolated));
    assert!(places(3)[20..40].iter().skip(2).take(16).all(|place| *place != Place::Isolated));
}

#[test]
fn a_drop_falls_as_a_stone_does() {
    for (scheme, gradient) in schemes().iter().flat_map(|scheme| [(scheme, "adjoint"), (scheme, "conservative")]) {
        let settings = settings_of::<2>(scheme, "air", gradient);
        let start = block([1.5, 2.5], [10, 10], 0.0, 0);
        let thrown = Vector::<2>::new(0.3, 0.1);
        let particles = fluid(start.clone(), |_| thrown);
        let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(1)).expect("settings");
        simulation.advance(20, None).expect("steps");
        let time = simulation.clock().time;
        let particles = simulation.particles();
        for i in 0..particles.real {
            let from = start[particles.id[i] as usize];
            let expected = from + thrown * time + Vector::<2>::new(0.0, -0.5 * time * time);
            assert_relative_eq!(particles.position[i], expected, epsilon = 1e-6);
            assert_relative_eq!(particles.velocity[i], thrown + Vector::<2>::new(0.0, -time), epsilon = 1e-5);
        }
    }
}

#[test]
fn drops_that_meet_keep_their_momentum() {
    for (scheme, gradient) in schemes().iter().flat_map(|scheme| [(scheme, "adjoint"), (scheme, "conservative")]) {
        let mut settings = settings_of::<2>(scheme, "air", gradient);
        settings.body_force = vec![0.0; 2];
        settings.kinematic_viscosity = 1e-12;
        let mut position = block([1.0, 2.0], [8, 8], 0.1, 3);
        position.extend(block([1.85, 2.3], [8, 8], 0.1, 4));
        let towards = |x: &Vector<2>| Vector::<2>::new(if x[0] < 1.82 { 1.0 } else { -1.0 }, 0.0);
        let particles = fluid(position, towards);
        let sums = |particles: &Particles<2>| {
            let real = 0..particles.real;
            let momentum: Vector<2> = real.clone().map(|i| particles.velocity[i]).sum();
            let turn = |i: usize| {
                let (x, u) = (particles.position[i], particles.velocity[i]);
                x[0] * u[1] - x[1] * u[0]
            };
            (momentum, real.clone().map(turn).sum::<f64>(), real.map(|i| particles.velocity[i].norm_squared()).sum::<f64>())
        };
        let (momentum, turn, energy) = sums(&particles);
        let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(1)).expect("settings");
        simulation.advance_until(0.4, None).expect("steps");
        let (after, turned, left) = sums(simulation.particles());
        assert!((after - momentum).norm() < 1e-4, "{scheme} {gradient}: {after} from {momentum}");
        assert!((turned - turn).abs() < 0.02 * 128.0 * 0.3, "{scheme} {gradient}: {turned} from {turn}");
        assert!(left < 0.97 * energy, "{scheme} {gradient}: they do not meet: {left} of {energy}");
    }
}

#[test]
fn what_leaves_to_the_air_is_lost_and_counted() {
    let settings = settings::<2>("air", "adjoint");
    let particles = fluid(block([1.0, 0.05], [6, 6], 0.0, 0), |_| Vector::<2>::new(0.0, -1.0));
    let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(1)).expect("settings");
    simulation.advance_until(0.4, None).expect("steps");
    let left = simulation.particles().real;
    assert!(left < 30, "{left} are left");
    assert_relative_eq!(simulation.clock().mass_out, (36 - left) as f64 * SPACING * SPACING, max_relative = 1e-12);
}

#[test]
fn what_does_not_go_with_a_free_surface_is_refused() {
    for (name, value) in [
        ("shifting", json!("strain")),
        ("viscous_order", json!(4)),
        ("derivative_frame", json!("updated")),
        ("scheme", json!({"kind": "explicit_isph", "sweeps": 1, "mach_number": 0.1, "density_relaxation": 0.5})),
        ("free_surface", json!(null)),
    ] {
        let mut settings = serde_json::to_value(settings::<2>("air", "adjoint")).expect("JSON");
        settings[name] = value;
        let refused = Settings::from_json(&settings.to_string()).expect_err(name).to_string();
        assert!(refused.contains(if name == "free_surface" { "air" } else { name }), "{refused}");
    }
}

#[test]
fn water_in_space_has_the_same_bits_on_two_threads_and_makes_no_energy() {
    for gradient in ["adjoint", "conservative"] {
        let mut settings = settings::<3>("slip", gradient);
        settings.domain.boundaries[2][1] = alsph::settings::Boundary::Air;
        settings.kinematic_viscosity = 1e-4;
        let run = |threads| {
            let particles = fluid(block([0.0; 3], [8, 5, 9], 0.02, 5), |_| Vector::zeros());
            let mut simulation =
                Simulation::new(settings.clone(), particles, Clock::default(), Some(threads)).expect("settings");
            simulation.advance(30, None).expect("steps");
            let history = simulation.take_history();
            let particles = simulation.particles();
            let mut order: Vec<_> = (0..particles.real).collect();
            order.sort_by_key(|&i| particles.id[i]);
            let state: Vec<_> = order.into_iter().map(|i| (particles.position[i], particles.pressure[i])).collect();
            (state, history)
        };
        let (one, history) = run(1);
        assert_eq!(one, run(2).0);
        let energy: Vec<_> = history.iter().map(|report| report.kinetic_energy + report.potential_energy).collect();
        let mut least = energy[0];
        for value in &energy {
            least = least.min(*value);
            assert!(value - least < 0.005 * energy[0], "{gradient}: {energy:?}");
        }
        assert!(history.last().expect("steps").kinetic_energy > 0.01 * energy[0], "it does not fall");
        assert!(history.iter().all(|report| report.places[0] > 0), "no surface");
    }
}

/// Water between slip walls over a floor of solids, on it a free body that floats, half in it one that swings as it is told: the same bits with
/// all that is stale made NaN, cut, on two threads and stored in another order, and loads that are its momentum. With every rule of the walls, frame and gradient, in 2-D and 3-D.
fn water_with_bodies<const D: usize>(
    scheme: &serde_json::Value,
    walls: &str,
    frame: &str,
    gradient: &str,
    kinematic_viscosity: f64,
) {
    let mut value = serde_json::to_value(settings_of::<D>(scheme, "slip", gradient)).expect("JSON");
    (value["wall_velocity"], value["derivative_frame"]) = (walls.into(), frame.into());
    value["kinematic_viscosity"] = json!(kinematic_viscosity);
    value["domain"]["upper"] = vec![1.2; D].into();
    let mut sides = vec![["slip", "slip"]; D];
    sides[D - 1] = ["none", "air"];
    value["domain"]["boundaries"] = json!(sides);
    let center = |x: f64, up: f64| {
        Vector::<D>::from_fn(|axis, _| {
            if axis == 0 {
                x
            } else if axis == D - 1 {
                up
            } else {
                0.6
            }
        })
    };
    let places = [center(0.35, 0.85), center(0.9, 0.7)];
    let turning = if D == 2 { 1 } else { 3 };
    let rigid = json!({
        "mass": 0.02, "inertia": if D == 2 { vec![1e-3] } else { vec![1e-3, 0.0, 0.0, 0.0, 1e-3, 0.0, 0.0, 0.0, 1e-3] },
        "force": vec![0.0; D], "stiffness": vec![0.0; D], "damping": vec![0.0; D], "free": vec![true; D + turning],
        "added_mass": 0.02, "added_inertia": 1e-3,
    });
    value["bodies"] = json!([
        {"name": "floor", "velocity": vec![0.0; D], "moves": false, "center": vec![0.0; D]},
        {"name": "float", "velocity": null, "moves": true, "center": places[0].as_slice(), "rigid": rigid},
        {"name": "paddle", "velocity": null, "moves": true, "center": places[1].as_slice()},
    ]);
    let settings = common::parse(&value);
    let (side, deep) = (12, 4);
    let mut particles = common::particles(Vec::new());
    let cells = side * (side + deep) * if D == 3 { side } else { 1 };
    for k in 0..cells {
        let (x, rest) = (k % side, k / side);
        let (across, up) = if D == 3 { (rest % side, rest / side) } else { (0, rest) };
        let place = Vector::<D>::from_fn(|axis, _| {
            let cell = if axis == 0 {
                x as f64
            } else if axis == D - 1 {
                up as f64 - deep as f64
            } else {
                across as f64
            };
            (cell + 0.5) * SPACING
        });
        let within = |k: usize| 0.17 - (place - places[k]).norm();
        let (kind, body, depth, normal) = match (0..2).find(|&k| within(k) > 0.0) {
            _ if place[D - 1] < 0.0 => {
                (ParticleKind::Solid, 0, -place[D - 1], Vector::from_fn(|axis, _| f64::from(axis == D - 1)))
            }
            Some(k) => (ParticleKind::Solid, k as u16 + 1, within(k), (place - places[k]).normalize()),
            None if up - deep >= 8 => continue,
            None => (ParticleKind::Fluid, 0, 0.0, Vector::zeros()),
        };
        particles.position.push(place);
        particles.velocity.push(Vector::zeros());
        particles.pressure.push(if kind == ParticleKind::Fluid { 0.8 - place[D - 1] } else { 0.0 });
        particles.kind.push(kind);
        particles.body.push(body);
        particles.depth.push(depth);
        particles.normal.push(normal);
        particles.id.push(k as u64);
    }
    particles.real = particles.position.len();
    let start = |particles: Particles<D>, clock, threads, poison| {
        let mut simulation = Simulation::new(settings.clone(), particles, clock, Some(threads)).expect("settings");
        simulation.poison(poison);
        simulation.forcing.motion = Some(Box::new(|time: f64| {
            let (sin, cos) = (6.0 * time).sin_cos();
            let displacement = Vector3::x() * (0.05 * sin);
            let velocity = Vector3::x() * (0.3 * cos);
            Ok(vec![Pose { displacement, velocity, acceleration: Vector3::x() * (-1.8 * sin), ..Pose::default() }])
        }));
        simulation
    };
    let mut whole = start(particles.clone(), Clock::default(), 1, false);
    whole.advance(12, None).expect("steps");
    let mut first = start(particles, Clock::default(), 2, true);
    first.advance(5, None).expect("steps");
    let (mut saved, poses) = (first.particles().clone(), first.poses());
    saved.drop_images();
    let order: Vec<u32> = (0..saved.real as u32).rev().collect();
    saved.reorder(&order);
    let mut second = start(saved, first.clock(), 2, true);
    second.set_poses(&poses).expect("poses");
    second.advance(7, None).expect("steps");
    let state = |simulation: &Simulation<D>| {
        let particles = simulation.particles();
        let mut order: Vec<_> = (0..particles.real).collect();
        order.sort_by_key(|&i| particles.id[i]);
        order.into_iter().map(|i| (particles.position[i], particles.velocity[i], particles.pressure[i])).collect::<Vec<_>>()
    };
    assert!(state(&whole) == state(&second), "{scheme} {walls} {frame} {gradient} {D}");
    assert_eq!(whole.poses(), second.poses());
    assert!(whole.poses()[1].displacement.norm() > 0.0 && whole.poses()[2].displacement.x > 0.0);
    // What acts on the bodies is what moves the water: nothing else does upwards, but its weight. The viscous term loses some.
    let (mass, up) = (SPACING.powi(D as i32), D - 1);
    let water = whole.particles();
    let flows = |i: &usize| water.kind[*i] == ParticleKind::Fluid;
    let momentum: f64 = (0..water.real).filter(flows).map(|i| mass * water.velocity[i][up]).sum();
    let weight = mass * (0..water.real).filter(flows).count() as f64 * whole.clock().time;
    let given = |report: &Report<D>| -> f64 {
        report.time_step * report.loads.iter().map(|load| load.pressure_force[up] + load.viscous_force[up]).sum::<f64>()
    };
    let given: f64 = whole.take_history().iter().map(given).sum();
    let missed = momentum + given + weight;
    assert!(missed.abs() < 0.02 * kinematic_viscosity, "{scheme} {walls} {frame} {gradient} {D}: {missed} of {weight}");
}

#[test]
fn water_with_bodies_has_the_same_bits_however_it_is_computed() {
    for scheme in &schemes() {
        for (walls, gradient) in [("adami", "conservative"), ("morris", "adjoint"), ("paper", "conservative")] {
            for (frame, viscosity) in [("midpoint", 1e-3), ("initial", 1e-6)] {
                water_with_bodies::<2>(scheme, walls, frame, gradient, viscosity);
            }
        }
        water_with_bodies::<3>(scheme, "adami", "midpoint", "conservative", 1e-3);
        water_with_bodies::<3>(scheme, "morris", "midpoint", "adjoint", 1e-6);
    }
}

/// Solids show what mirrors do: a column over a floor of solids presses on it with its weight, as over a slip wall.
#[test]
fn solids_beside_a_surface_carry_the_weight() {
    schemes().iter().for_each(solids_carry_the_weight);
}

fn solids_carry_the_weight(scheme: &serde_json::Value) {
    let mut value = serde_json::to_value(settings::<2>("slip", "conservative")).expect("JSON");
    value["wall_velocity"] = "adami".into();
    value["scheme"] = scheme.clone();
    value["domain"] = json!({"lower": [0.0, 0.0], "upper": [2.0, 2.0], "boundaries": [["slip", "slip"], ["none", "air"]]});
    value["bodies"] = json!([{"name": "floor", "velocity": [0.0, 0.0], "moves": false, "center": [0.0, 0.0]}]);
    let mut particles = fluid(block([0.0, -0.4], [20, 14], 0.0, 0), |_| Vector::zeros());
    for i in 0..particles.real {
        let height = particles.position[i][1];
        if height < 0.0 {
            (particles.kind[i], particles.depth[i]) = (ParticleKind::Solid, -height);
            particles.normal[i] = Vector::from([0.0, 1.0]);
        } else {
            particles.pressure[i] = 1.0 - height;
        }
    }
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(2)).expect("settings");
    simulation.advance(60, None).expect("steps");
    for report in simulation.take_history() {
        let lift = report.loads[0].pressure_force[1];
        assert!((lift + 2.0).abs() < 0.07, "{scheme}: {lift} at {:?}", report.clock);
        assert!(report.loads[0].pressure_force[0].abs() < 1e-3 && report.kinetic_energy < 1e-4, "{report:?}");
    }
}

/// A Laplacian has the diagonal that a value there has in it, of the lattice and beside the surface, and water at rest has the one of none.
#[test]
fn the_air_is_where_neighbours_are_missing() {
    let settings = settings::<2>("slip", "adjoint");
    let (mut particles, frame, surface) = found(&settings, fluid(block([0.0; 2], [40, 20], 0.0, 0), |_| Vector::zeros()));
    let laplacian = |field: &[f64]| {
        let mut out = vec![0.0; particles.real];
        frame
            .stencil
            .for_each_one(LaplacianAndItsSum(field), &mut out, |i, value, out| *out = surface.laplacian(i, value, field[i]));
        out
    };
    let mut diagonal = vec![0.0; particles.real];
    frame
        .stencil
        .for_each_one(LaplacianDiagonal, &mut diagonal, |i, value, out| *out = surface.laplacian_diagonal(i, value));
    for i in (0..particles.real).step_by(37) {
        let mut unit = vec![0.0; particles.len()];
        unit[i] = 1.0;
        assert_relative_eq!(laplacian(&unit)[i], diagonal[i], max_relative = 1e-6);
        if particles.position[i][1] < 1.7 {
            assert_relative_eq!(diagonal[i], -settings.laplacian_diagonal() / SPACING.powi(2), max_relative = 0.01);
        }
    }
    let inside = |i: usize| particles.position[i][0] > 1.0 && particles.position[i][0] < 3.0;
    let heights: Vec<_> = (0..particles.real).filter(|&i| inside(i)).map(|i| (i, particles.position[i][1])).collect();
    frame.images.fill_pressure(&mut particles.pressure, &particles.position, |_| Vector::zeros());
    let depth: Vec<_> = particles.position.iter().map(|x| 2.0 - x[1]).collect();
    let water = laplacian(&depth);
    for (i, height) in heights {
        // Over a slip wall the depth goes on, as of water at rest. The error of one row, over its own distance to the next.
        assert!((water[i] * SPACING).abs() < if height > 1.7 { 0.5 } else { 1e-4 }, "{height}: {}", water[i]);
    }
}

/// Water of any depth, over any floor: its pressure is that of the equation, and the number of iterations does not grow with that of particles.
#[test]
fn the_pressure_under_a_surface_is_solved_in_few_iterations() {
    for rows in [16, 32, 64] {
        let spacing = 1.0 / rows as f64;
        let mut value = serde_json::to_value(settings::<2>("slip", "adjoint")).expect("JSON");
        (value["particle_spacing"], value["domain"]["upper"]) = (json!(spacing), json!([2.0, 2.0]));
        let settings = common::parse(&value);
        for disorder in [0.0, 0.15] {
            let mut position = block([0.0; 2], [2 * rows, rows], disorder, 1);
            position.iter_mut().for_each(|x| *x *= spacing / SPACING);
            let (particles, frame, surface) = found(&settings, fluid(position, |_| Vector::zeros()));
            let set = Set { particles, frame };
            let source = vec![1.0; set.particles.real];
            let found = [Solver::Bicgstab, Solver::Multigrid, Solver::Jacobi].map(|solver| {
                let tolerance = if solver == Solver::Jacobi { 1e-7 } else { 1e-8 };
                let (solution, x) = solve_beside(Some(&surface), &set, &settings, solver, &source, tolerance);
                let most = match solver {
                    Solver::Bicgstab => 8,
                    Solver::Multigrid => 20,
                    Solver::Jacobi => 1000,
                };
                assert!(solution.iterations <= most, "{rows} {disorder} {solver:?}: {solution:?}");
                x
            });
            let mut sum = 0.0;
            for (i, x) in found[0].iter().enumerate() {
                let height = set.particles.position[i][1];
                let error = (x - 0.5 * (1.0 - height * height)) / spacing;
                assert!(disorder > 0.0 || error.abs() < 0.15, "{rows} at {height}: {error}");
                assert!((x - found[1][i]).abs() < 1e-6, "{rows} {disorder} at {height}");
                assert!(rows > 16 || (x - found[2][i]).abs() < 0.1, "{disorder} at {height}: {x} {}", found[2][i]);
                sum += error;
            }
            let mean = sum / set.particles.real as f64;
            assert!(mean.abs() < 0.6, "{rows} {disorder}: {mean}");
        }
    }
}
