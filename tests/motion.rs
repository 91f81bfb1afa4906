//! Bodies that move as rigid ones: they keep their shape, the fluid feels them as it should, and free ones obey Newton and Euler.

use alsph::motion::{MotionRule, Pose};
use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use approx::assert_relative_eq;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

mod common;

const SIDE: usize = 24;

/// A periodic box of fluid around a disc or ball of radius [`common::RADIUS`], and its settings: the body moves, by a rule unless `rigid`.
fn body_in_fluid(rigid: Value, change: &[(&str, Value)]) -> (Value, Particles<2>) {
    let spacing = 1.0 / SIDE as f64;
    let mut value = common::settings_value::<2>(spacing, "periodic");
    let defaults = [
        ("wall_velocity", json!("cubic")),
        ("wall_pressure", json!("linear")),
        ("derivative_frame", json!("midpoint")),
        ("max_iterations", json!(2)),
        ("projection_sweeps", json!(4)),
        ("sweep_weights", json!("chebyshev")),
        ("viscous_theta", json!(0.5)),
        ("penalty_constant", Value::Null),
        ("courant", json!(0.2)),
        ("time_step", json!(0.2 * spacing)),
        ("shifting", json!("strain")),
        ("shift_coefficient", json!(0.75)),
    ];
    defaults.iter().chain(change).for_each(|(key, chosen)| value[*key] = chosen.clone());
    value["bodies"] = json!([{"name": "body", "velocity": null, "moves": true, "center": [0.5, 0.5], "rigid": rigid}]);
    let mut particles = common::cylinder(SIDE, 4);
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
        let arm = particles.position[i].add_scalar(-0.5);
        (particles.normal[i], particles.depth[i]) = (arm.normalize(), common::RADIUS - arm.norm());
    }
    (value, particles)
}

fn simulation(value: &Value, particles: &Particles<2>, motion: Option<MotionRule>) -> Simulation<2> {
    let mut simulation = Simulation::new(common::parse(value), particles.clone(), Clock::default(), Some(2)).expect("valid");
    simulation.forcing.motion = motion;
    simulation
}

fn told(pose: impl Fn(f64) -> Pose + Send + Sync + 'static) -> Option<MotionRule> {
    Some(Box::new(move |time| Ok(vec![pose(time)])))
}

/// One that swings and turns.
fn swing(time: f64) -> Pose {
    let (sin, cos) = (TAU * time).sin_cos();
    Pose {
        displacement: Vector3::new(0.1 * sin, 0.05 * (1.0 - cos), 0.0),
        velocity: Vector3::new(0.1 * cos, 0.05 * sin, 0.0) * TAU,
        acceleration: Vector3::new(-0.1 * sin, 0.05 * cos, 0.0) * TAU.powi(2),
        angle: Vector3::z() * (3.0 * time),
        spin: Vector3::z() * 3.0,
        ..Pose::default()
    }
}

/// Where the solids are, by id.
fn solids(particles: &Particles<2>) -> Vec<(u64, Vector<2>, Vector<2>, Vector<2>)> {
    let solid = |&i: &usize| particles.kind[i] == ParticleKind::Solid;
    let of = |i: usize| (particles.id[i], particles.position[i], particles.normal[i], particles.velocity[i]);
    let mut found: Vec<_> = (0..particles.real).filter(solid).map(of).collect();
    found.sort_by_key(|each| each.0);
    found
}

/// After many steps each solid is where the rule has it, with the normal there and the velocity of the surface above it, however far the body
/// has come, and across periodic sides.
#[test]
fn a_body_keeps_its_shape_wherever_it_goes() {
    for frame in ["midpoint", "initial", "updated"] {
        let (value, particles) = body_in_fluid(Value::Null, &[("derivative_frame", json!(frame))]);
        // Twice through the box.
        let through = |time: f64| Pose {
            displacement: Vector3::x() * (2.0 * time),
            velocity: Vector3::x() * 2.0,
            ..swing(0.3 * time)
        };
        let mut simulation = simulation(&value, &particles, told(through));
        simulation.advance_until(1.0, None).expect("stable");
        let (time, pose) = (simulation.clock().time, through(simulation.clock().time));
        assert!(simulation.clock().step > 100 && time >= 1.0);
        let (sin, cos) = pose.angle.z.sin_cos();
        for ((_, start, ..), (_, now, normal, velocity)) in
            solids(&particles).into_iter().zip(solids(simulation.particles()))
        {
            let arm = start.add_scalar(-0.5);
            let turned = Vector::from([cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]]);
            let place = turned.add_scalar(0.5) + Vector::from([pose.displacement.x, pose.displacement.y]);
            let away = (place - now).map(|x| x - x.round());
            assert!(away.norm() < 1e-9, "{frame}: {away:?}");
            assert!((0.0..1.0).contains(&now[0]) && (0.0..1.0).contains(&now[1]));
            assert_relative_eq!(normal, turned.normalize(), epsilon = 1e-7);
            let above = turned.normalize() * common::RADIUS;
            let speed = Vector::from([2.0 - pose.spin.z * above[1], pose.velocity.y + pose.spin.z * above[0]]);
            assert_relative_eq!(velocity, speed, epsilon = 1e-6);
        }
    }
}

/// A body that moves through a fluid at rest feels what the same body at rest does in a stream, the whole being seen from a frame that
/// moves evenly.
#[test]
fn forces_are_those_of_the_stream_past_a_body_at_rest() {
    for scheme in [
        json!({"kind": "alsph"}),
        json!({"kind": "isph", "pressure_share": 0.9, "solver": "bicgstab", "tolerance": 1e-4, "max_solver_iterations": 100}),
        json!({"kind": "wcsph", "sound_speed": 10, "density_diffusion": "antuono", "diffusion_coefficient": 0.1}),
    ] {
        // In steps of one length, else those of the fluid at rest are longer.
        let step = json!(0.1 / SIDE as f64);
        let even =
            [("scheme", scheme.clone()), ("adaptive_time_step", json!(false)), ("time_step", step), ("courant", json!(0.2))];
        let (value, particles) = body_in_fluid(Value::Null, &even);
        let still = told(|_| Pose::default());
        let towed = told(|time| Pose { displacement: -Vector3::x() * time, velocity: -Vector3::x(), ..Pose::default() });
        let mut streaming = particles.clone();
        (0..streaming.real)
            .filter(|&i| particles.kind[i] == ParticleKind::Fluid)
            .for_each(|i| streaming.velocity[i][0] = 1.0);
        let drag = |particles: &Particles<2>, motion| {
            let mut simulation = simulation(&value, particles, motion);
            simulation.advance(100, None).expect("stable");
            let late = simulation.take_history().split_off(20);
            late.iter().map(|report| (report.loads[0].pressure_force + report.loads[0].viscous_force)[0]).sum::<f64>()
                / late.len() as f64
        };
        let (stream, towed) = (drag(&streaming, still), drag(&particles, towed));
        assert!(stream > 0.05, "no drag to compare: {stream}");
        assert_relative_eq!(towed, stream, max_relative = 0.05);
    }
}

/// A free disc on a spring in a fluid so thin that it does not matter swings as a spring does; so does one that turns keep its angular
/// velocity, beside what viscosity takes.
#[test]
fn a_heavy_body_obeys_newton() {
    let (mass, stiffness) = (500.0, 500.0 * (TAU / 0.5f64).powi(2));
    let rigid = json!({
        "mass": mass, "inertia": [15.0], "force": [0.0, -0.02 * stiffness], "stiffness": [stiffness, stiffness], "damping": [0.0, 0.0],
        "free": [true, true, true], "added_mass": 0.3, "added_inertia": 0.01,
    });
    let (value, particles) = body_in_fluid(rigid, &[("courant", json!(0.1)), ("time_step", json!(0.05 / SIDE as f64))]);
    let mut simulation = simulation(&value, &particles, None);
    let turning = Pose { spin: Vector3::z(), ..Pose::default() };
    simulation.set_poses(&[turning]).expect("one body");
    simulation.advance_until(0.5, None).expect("stable");
    let history = simulation.take_history();
    let lowest = history.iter().map(|report| report.poses[0].displacement.y).fold(0.0, f64::min);
    assert_relative_eq!(lowest, -0.04, max_relative = 0.02);
    let last = history.last().expect("steps were taken").poses[0];
    assert!(last.displacement.y.abs() < 1e-3, "{last:?}");
    assert_relative_eq!(last.angle.z, 0.5, max_relative = 0.02);
}

/// A spring makes no energy, however long the steps are, and a rule for the body force acts on a free body as the constant one does.
#[test]
fn a_heavy_body_keeps_its_energy_and_feels_the_body_force() {
    let (mass, stiffness) = (500.0, 500.0 * (TAU / 0.5f64).powi(2));
    let rigid = |stiffness: f64| {
        json!({
            "mass": mass, "inertia": [15.0], "force": [0.0, -0.02 * stiffness], "stiffness": [stiffness, stiffness],
            "damping": [0.0, 0.0], "free": [true, true, true], "added_mass": 0.3, "added_inertia": 0.01,
        })
    };
    let (value, particles) = body_in_fluid(rigid(stiffness), &[("courant", json!(0.1))]);
    let mut swinging = simulation(&value, &particles, None);
    swinging.advance_until(1.5, None).expect("stable");
    let history = swinging.take_history();
    let highest = |period: f64| {
        let within = history.iter().filter(|report| (period..period + 0.5).contains(&report.clock.time));
        within.map(|report| report.poses[0].displacement.y + 0.02).fold(0.0, f64::max)
    };
    // With the spring of a step's start the amplitude would grow by ω² Δt/4 of it a time.
    assert_relative_eq!(highest(1.0), 0.02, max_relative = 0.05);

    let (mut value, particles) = body_in_fluid(rigid(0.0), &[]);
    let mut forced = simulation(&value, &particles, None);
    forced.forcing.body_force = Some(Box::new(|position, _| Ok(vec![Vector::from([0.5, 0.0]); position.len()])));
    value["body_force"] = json!([0.5, 0.0]);
    let mut constant = simulation(&value, &particles, None);
    for simulation in [&mut forced, &mut constant] {
        simulation.advance_until(0.2, None).expect("stable");
        let (pose, time) = (simulation.poses()[0], simulation.clock().time);
        assert_relative_eq!(pose.velocity.x, 0.5 * time, max_relative = 0.05);
    }
}

/// Steps follow a spring that is much stiffer than the fluid asks for, and a damper; a constant step that does not is refused. What cannot move
/// is not asked.
#[test]
fn steps_are_short_enough_for_springs_and_dampers() {
    let rigid = |[stiffness, damping]: [f64; 2], free: bool| {
        json!({
            "mass": 5.0, "inertia": [0.15], "force": [0.0, 0.0], "stiffness": [0.0, stiffness], "damping": [0.0, damping],
            "free": [true, free, true], "added_mass": 0.3, "added_inertia": 0.01,
        })
    };
    for (law, limit) in [([2e5, 0.0], 0.02 * (5.0 / 2e5f64).sqrt()), ([0.0, 2500.0], 0.5 * 5.0 / 2500.0)] {
        let (mut value, particles) = body_in_fluid(rigid(law, true), &[]);
        let mut springy = simulation(&value, &particles, None);
        springy.set_poses(&[Pose { velocity: Vector3::y(), ..Pose::default() }]).expect("one body");
        springy.advance_until(0.1, None).expect("stable");
        let history = springy.take_history();
        assert!(history.iter().all(|report| report.time_step <= limit), "{law:?}: {:?}", history[0].time_step);
        let farthest = history.iter().map(|report| report.poses[0].displacement.y.abs()).fold(0.0, f64::max);
        let known = if law[1] > 0.0 { 5.0 / law[1] } else { (5.0 / law[0]).sqrt() };
        assert_relative_eq!(farthest, known, max_relative = 0.05);

        let (held, _) = body_in_fluid(rigid(law, false), &[]);
        simulation(&held, &particles, None).advance(1, None).expect("stable");
        value["penalty_constant"] = json!(1.0);
        for (name, constant) in [("adaptive_until", json!(50.0)), ("adaptive_time_step", json!(false))] {
            value[name] = constant; // at the start, though the first steps would be adaptive ones
            let refused = simulation(&value, &particles, None).advance(1, None).expect_err("too long a step").to_string();
            assert!(refused.contains("is too long for a free body: at most"), "{refused}");
        }
    }
}

/// A run that goes on from the particles and poses of another has the bits of that, normals at all angles among them.
#[test]
fn the_shape_is_that_of_the_particles_to_the_last_bit() {
    let (value, particles) = body_in_fluid(Value::Null, &[]);
    let mut whole = simulation(&value, &particles, told(swing));
    for _ in 0..3 {
        whole.advance(1, None).expect("stable");
        let mut again =
            Simulation::new(common::parse(&value), whole.particles().clone(), whole.clock(), Some(1)).expect("valid");
        again.forcing.motion = told(swing);
        again.advance(1, None).expect("stable");
        whole.advance(1, None).expect("stable");
        assert_eq!(solids(again.particles()), solids(whole.particles()));
    }
}

/// What begins to move drags fluid along, as an array of discs does.
#[test]
fn the_fluid_answers_with_the_mass_that_is_dragged_along() {
    let displaced = PI * common::RADIUS.powi(2);
    for density in [0.1, 2.0] {
        let mass = density * displaced;
        let rigid = json!({
            "mass": mass, "inertia": [1.0], "force": [mass, 0.0], "stiffness": [0.0, 0.0], "damping": [0.0, 0.0],
            "free": [true, true, true], "added_mass": 1.5 * displaced, "added_inertia": 0.0,
        });
        let solve = json!({"kind": "isph", "pressure_share": 0.9, "solver": "bicgstab", "tolerance": 1e-6, "max_solver_iterations": 100});
        let thin = [("scheme", solve), ("kinematic_viscosity", json!(1e-5)), ("courant", json!(0.1))];
        let (value, particles) = body_in_fluid(rigid, &thin);
        let mut simulation = simulation(&value, &particles, None);
        simulation.advance(25, None).expect("stable");
        let report = simulation.take_history().pop().expect("steps were taken");
        let added = (mass / report.poses[0].acceleration.x - mass) / displaced;
        // Relative to the mean flow C = (1 + φ)/(1 − φ) in an array of which the discs fill φ, and without a mean pressure gradient
        // that flow goes along with φ (1 + C) / (1 + φ (1 + C)) of the acceleration.
        let coefficient = (1.0 + displaced) / (1.0 - displaced);
        let along = displaced * (1.0 + coefficient) / (1.0 + displaced * (1.0 + coefficient));
        assert_relative_eq!(added, coefficient * (1.0 - along) - along, max_relative = 0.03);
    }
}

/// A heavy ball in a periodic box in space, in a fluid that makes no difference.
fn ball_in_space(inertia: [f64; 9], free: [bool; 6]) -> Simulation<3> {
    let spacing = 1.0 / 10.0;
    let mut value = common::settings_value::<3>(spacing, "periodic");
    (value["kinematic_viscosity"], value["wall_pressure"], value["wall_velocity"]) =
        (json!(1e-6), json!("linear"), json!("adami"));
    (value["time_step"], value["max_iterations"]) = (json!(2e-3), json!(1));
    value["bodies"] = json!([{"name": "body", "velocity": null, "moves": true, "center": [0.5, 0.5, 0.5], "rigid": {
        "mass": 1e4, "inertia": inertia, "force": [0.0, 0.0, 0.0],
        "stiffness": [0.0, 0.0, 0.0], "damping": [0.0, 0.0, 0.0], "free": free, "added_mass": 0.1, "added_inertia": 0.01,
    }}]);
    let mut particles = common::particles(common::lattice::<3>(10, 0.0));
    for i in 0..particles.real {
        let arm = particles.position[i].add_scalar(-0.5);
        if arm.norm() < 0.26 {
            particles.kind[i] = ParticleKind::Solid;
            (particles.normal[i], particles.depth[i]) = (arm.normalize(), 0.26 - arm.norm());
        }
    }
    Simulation::<3>::new(common::parse(&value), particles, Clock::default(), Some(2)).expect("valid")
}

/// In space a free body that turns about none of its principal axes tumbles, and keeps energy and angular momentum.
#[test]
fn a_body_in_space_tumbles() {
    let inertia = [1000.0, 2000.0, 3000.0];
    let mut simulation = ball_in_space([inertia[0], 0.0, 0.0, 0.0, inertia[1], 0.0, 0.0, 0.0, inertia[2]], [true; 6]);
    let spin = Vector3::new(0.02, 3.0, 0.02);
    simulation.set_poses(&[Pose { spin, ..Pose::default() }]).expect("one body");
    simulation.advance_until(0.4, None).expect("stable");
    let pose = simulation.poses()[0];
    let turn = nalgebra::Rotation3::from_scaled_axis(pose.angle);
    let own = turn.inverse() * pose.spin;
    let of = |spin: &Vector3<f64>| Vector3::new(inertia[0] * spin.x, inertia[1] * spin.y, inertia[2] * spin.z);
    assert_relative_eq!(turn * of(&own), of(&spin), epsilon = 6.0);
    assert_relative_eq!(own.dot(&of(&own)), spin.dot(&of(&spin)), max_relative = 0.01);
    // Euler's equations about the middle axis, linear in the rest: ω₁' = −Ω ω₃, ω₃' = −Ω ω₁/3.
    let grown = 3f64.sqrt() * simulation.clock().time;
    let euler = [grown.cosh() - 3f64.sqrt() * grown.sinh(), grown.cosh() - grown.sinh() / 3f64.sqrt()].map(|x| 0.02 * x);
    assert_relative_eq!(own.x, euler[0], epsilon = 5e-4);
    assert_relative_eq!(own.z, euler[1], epsilon = 5e-4);
}

/// On an axle it goes on turning, though it is not balanced: the axle answers what would make it tumble.
#[test]
fn a_body_on_an_axle_keeps_turning() {
    let inertia = [1000.0, 0.0, 300.0, 0.0, 2000.0, 400.0, 300.0, 400.0, 2500.0];
    let mut simulation = ball_in_space(inertia, [true, true, true, false, false, true]);
    let spin = Vector3::z() * 3.0;
    simulation.set_poses(&[Pose { spin, ..Pose::default() }]).expect("one body");
    simulation.advance_until(0.2, None).expect("stable");
    let pose = simulation.poses()[0];
    assert_relative_eq!(pose.spin, spin, epsilon = 1e-3);
    assert_relative_eq!(pose.angle, spin * simulation.clock().time, epsilon = 1e-3);
}

/// Contact is not computed: a free body that comes into another ends the run. So does one that a slip wall cuts, if it moves across that.
/// The state is that of the step before.
#[test]
fn a_body_that_meets_another_or_leaves_the_wall_that_cuts_it_ends_the_run() {
    let rigid = json!({
        "mass": 50.0, "inertia": [1.0], "force": [0.0, 0.0], "stiffness": [0.0, 0.0], "damping": [0.0, 0.0],
        "free": [true, true, true], "added_mass": 0.1, "added_inertia": 1e-3,
    });
    let (mut value, mut particles) = body_in_fluid(rigid, &[]);
    let fixed = json!({"name": "block", "velocity": [0.0, 0.0], "moves": false, "center": [0.0, 0.0]});
    value["bodies"].as_array_mut().expect("bodies").push(fixed);
    for i in 0..particles.real {
        let deep = particles.position[i][0] - 0.875;
        if particles.kind[i] == ParticleKind::Fluid && deep > 0.0 {
            (particles.kind[i], particles.body[i]) = (ParticleKind::Solid, 1);
            let out = if deep < 0.0625 { -1.0 } else { 1.0 };
            (particles.normal[i], particles.depth[i]) = (Vector::from([out, 0.0]), deep.min(0.125 - deep));
        }
    }
    let mut rolling = simulation(&value, &particles, None);
    rolling.set_poses(&[Pose { velocity: Vector3::x() * 2.0, ..Pose::default() }, Pose::default()]).expect("two bodies");
    let error = rolling.advance_until(1.0, None).expect_err("they meet").to_string();
    assert!(error.contains("`body` has come into `block`"), "{error}");
    let came = rolling.poses()[0].displacement.x;
    assert!((0.125..0.15).contains(&came), "{came}");
    let (of, clock) = (solids(rolling.particles()), rolling.clock());
    assert!(rolling.advance(1, None).is_err() && solids(rolling.particles()) == of && rolling.clock().time == clock.time);

    let (mut half, particles) = body_in_fluid(Value::Null, &[]);
    half["domain"]["boundaries"] = json!([["slip", "slip"], ["slip", "slip"]]);
    let away = |time: f64| Pose { displacement: Vector3::y() * time, velocity: Vector3::y(), ..Pose::default() };
    half["domain"]["lower"] = json!([0.0, 0.5]);
    let upper: Vec<_> = (0..particles.real).filter(|&i| particles.position[i][1] > 0.5).map(|i| i as u32).collect();
    let mut particles = particles;
    particles.reorder(&upper);
    particles.real = upper.len();
    let error = simulation(&half, &particles, told(away)).advance_until(1.0, None).expect_err("it is cut").to_string();
    assert!(error.contains("`body`, which a slip wall cuts, moves across it, along axis 1"), "{error}");
    let along =
        told(|time| Pose { displacement: Vector3::x() * (0.1 * time), velocity: Vector3::x() * 0.1, ..Pose::default() });
    simulation(&half, &particles, along).advance_until(0.2, None).expect("it may move along");
}

/// What cannot be is refused, and says what.
#[test]
fn motions_that_cannot_be_are_refused() {
    let (value, particles) = body_in_fluid(Value::Null, &[]);
    let error = simulation(&value, &particles, None).advance(1, None).expect_err("no rule").to_string();
    assert!(error.contains("neither a velocity nor a rule"), "{error}");
    let error = simulation(&value, &particles, Some(Box::new(|_| Ok(Vec::new()))))
        .advance(1, None)
        .expect_err("no pose")
        .to_string();
    assert!(error.contains("0 bodies, where 1 are moved"), "{error}");
    let nan = told(|time| Pose { velocity: Vector3::x() * (0.0 / (0.01 - time).max(0.0)), ..Pose::default() });
    let error = simulation(&value, &particles, nan).advance_until(1.0, None).expect_err("NaN").to_string();
    assert!(error.contains("not finite"), "{error}");
    let error = simulation(&value, &particles, None).set_poses(&[]).expect_err("no body").to_string();
    assert!(error.contains("30 finite numbers for each of 1 bodies"), "{error}");
    for (key, wrong, told) in [
        ("mass", json!(0.0), "rigid.mass"),
        ("inertia", json!([1.0, 2.0]), "rigid.inertia"),
        ("inertia", json!([-1.0]), "rigid.inertia"),
        ("free", json!([true]), "rigid.free"),
        ("added_mass", json!(-1.0), "rigid.added_mass"),
        ("force", json!([1.0]), "rigid.force"),
    ] {
        let mut rigid = json!({
            "mass": 1.0, "inertia": [1.0], "force": [0.0, 0.0], "stiffness": [0.0, 0.0], "damping": [0.0, 0.0],
            "free": [true, true, true], "added_mass": 0.0, "added_inertia": 0.0,
        });
        rigid[key] = wrong;
        let (value, _) = body_in_fluid(rigid, &[]);
        let error = alsph::Settings::from_json(&value.to_string()).expect_err("wrong").to_string();
        assert!(error.contains(told), "{error}");
    }
    let late = |time: f64| if time > 0.02 { 1.0 } else { 0.0 };
    for (way, turn, told_of) in [(0.05, 0.0, "comes 0.050"), (0.01, 0.0, "comes 0.010"), (0.0, 0.1, "turns 0.100")] {
        let (displacement, angle) = (Vector3::x() * way, Vector3::z() * turn);
        let jump =
            move |time| Pose { displacement: displacement * late(time), angle: angle * late(time), ..Pose::default() };
        let error = simulation(&value, &particles, told(jump)).advance_until(0.1, None).expect_err("it jumps").to_string();
        assert!(error.contains("motion`: jumps at time 0.0") && error.contains(told_of), "{error}");
    }
    // One that starts at once does not.
    let start = move |time: f64| {
        let (velocity, spin) = (Vector3::x() * late(time), Vector3::z() * late(time));
        let (displacement, angle) = (velocity * (time - 0.02), spin * (time - 0.02));
        Pose { displacement, angle, velocity, spin, ..Pose::default() }
    };
    simulation(&value, &particles, told(start)).advance_until(0.05, None).expect("it starts");
    for wrong in [[1.0, 5.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]] {
        let rigid = json!({
            "mass": 1.0, "inertia": wrong, "force": [0.0, 0.0, 0.0], "stiffness": [0.0, 0.0, 0.0], "damping": [0.0, 0.0, 0.0],
            "free": [true, true, true, true, true, true], "added_mass": 0.0, "added_inertia": 0.0,
        });
        let mut value = common::settings_value::<3>(0.1, "periodic");
        (value["wall_pressure"], value["wall_velocity"]) = (json!("linear"), json!("adami"));
        value["bodies"] =
            json!([{"name": "body", "velocity": null, "moves": true, "center": [0.5, 0.5, 0.5], "rigid": rigid}]);
        let error = alsph::Settings::from_json(&value.to_string()).expect_err("no tensor").to_string();
        assert!(error.contains("rigid.inertia") && error.contains("symmetric"), "{error}");
    }
    let (value, _) = body_in_fluid(Value::Null, &[("wall_pressure", json!("paper"))]);
    let error = alsph::Settings::from_json(&value.to_string()).expect_err("the paper's walls do not move").to_string();
    assert!(error.contains("wall_pressure"), "{error}");
}

/// A body that comes to a side of the domain is told of by its name.
#[test]
fn a_body_at_a_side_is_told_of() {
    let (mut value, particles) = body_in_fluid(Value::Null, &[]);
    value["domain"]["boundaries"] = json!([["slip", "slip"], ["slip", "slip"]]);
    let towed = told(|time| Pose { displacement: Vector3::x() * time, velocity: Vector3::x(), ..Pose::default() });
    let error = simulation(&value, &particles, towed).advance_until(0.5, None).expect_err("it is narrow").to_string();
    assert!(error.contains("body \"body\" has reached a side") || error.contains("diverged"), "{error}");
}
