//! What a simulation refuses to begin with, how far it goes, and what it tells and is told on the way.

use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use approx::assert_relative_eq;
use serde_json::{Value, json};
use std::time::Duration;

mod common;

const SIDE: usize = 12;

/// A channel in uniform flow with buffers, and solid particles in one corner of the inlet's.
fn channel() -> (Value, Particles<2>) {
    let spacing = 1.0 / SIDE as f64;
    let mut value = common::settings_value::<2>(spacing, "none");
    value["domain"]["boundaries"] = json!([["inlet", "outlet"], ["slip", "slip"]]);
    let cells = (0..SIDE).flat_map(|y| (-8..SIDE as i64 + 8).map(move |x| [x as f64 + 0.5, y as f64 + 0.5]));
    let mut particles = common::particles(cells.map(|cell| Vector::from(cell) * spacing).collect());
    particles.velocity.fill(Vector::from([1.0, 0.0]));
    for i in 0..particles.real {
        particles.kind[i] = match particles.position[i][0] {
            x if x < 0.0 => ParticleKind::Inlet,
            x if x > 1.0 => ParticleKind::Outlet,
            _ => ParticleKind::Fluid,
        };
    }
    (value, particles)
}

fn begun(value: &Value, particles: Particles<2>, clock: Clock) -> alsph::Result<Simulation<2>> {
    Simulation::new(common::parse(value), particles, clock, Some(1))
}

fn simulation() -> Simulation<2> {
    let (value, particles) = channel();
    begun(&value, particles, Clock::default()).expect("valid")
}

/// The error of a beginning with the particles changed.
fn refusal(change: impl FnOnce(&mut Particles<2>)) -> String {
    let (value, mut particles) = channel();
    change(&mut particles);
    begun(&value, particles, Clock::default()).err().expect("refused").to_string()
}

#[test]
fn arrays_that_cannot_be_simulated_are_refused_by_name() {
    let nan = f64::NAN;
    type Change = Box<dyn Fn(&mut Particles<2>)>;
    let changes: [(&str, Change); 12] = [
        ("`kind`: holds no fluid", Box::new(|p| p.kind.fill(ParticleKind::Inlet))),
        ("`position`: of particle 9 is", Box::new(move |p| p.position[9][1] = nan)),
        ("`velocity`: of particle 9 is", Box::new(move |p| p.velocity[9][0] = f64::INFINITY)),
        ("`normal`: of particle 9 is", Box::new(move |p| p.normal[9][0] = nan)),
        ("`pressure`: of particle 9 is", Box::new(move |p| p.pressure[9] = nan)),
        ("`depth`: of particle 9 is", Box::new(move |p| p.depth[9] = nan)),
        ("`body`: particle 9 belongs to body 1, of 1", Box::new(|p| (p.kind[9], p.body[9]) = (ParticleKind::Solid, 1))),
        ("`position`: particle 9 is at -0.01 in direction 1, outside 0..1", Box::new(|p| p.position[9][1] = -0.01)),
        ("`position`: particle 9 is at 1.01 in direction 1, outside 0..1", Box::new(|p| p.position[9][1] = 1.01)),
        ("`id`: 7 stands twice", Box::new(|p| p.id[100] = 7)),
        (
            "`id`: 1099511627781 is one that follows inlet particle 5",
            Box::new(|p| {
                (p.kind[5], p.id[9]) = (ParticleKind::Inlet, (1 << 40) + 5);
            }),
        ),
        (
            "`id`: 18446744073709551615 of an inlet particle is too large",
            Box::new(|p| {
                (p.kind[3], p.id[3]) = (ParticleKind::Inlet, u64::MAX);
            }),
        ),
    ];
    for (text, change) in changes {
        let error = refusal(change);
        assert!(error.contains(text), "{error} where {text} is right");
    }
    // On the sides, and beyond open ones, particles may be; a body may lie where it likes, and need be none for fluid.
    let (value, mut particles) = channel();
    (particles.position[8][1], particles.position[9][1]) = (0.0, 1.0);
    (particles.kind[10], particles.position[10][1]) = (ParticleKind::Solid, -0.2);
    (particles.body[8], particles.id[8]) = (7, u64::MAX);
    let mut simulation = begun(&value, particles, Clock::default()).expect("valid");
    // A solid particle has the velocity of its body.
    assert_eq!(simulation.particles().velocity[10], Vector::<2>::zeros());
    assert!(simulation.look_at_failed(|_| ()).is_none());

    let (value, particles) = channel();
    let clocks = [(nan, 0.0, 0.0), (0.0, nan, 0.0), (0.0, 0.0, nan)];
    for (time, mass_in, mass_out) in clocks {
        let clock = Clock { time, mass_in, mass_out, ..Clock::default() };
        assert!(begun(&value, particles.clone(), clock).err().expect("refused").to_string().contains("must be finite"));
    }
    // All within a spacing: of those expected around each within 2.5 support radii, and so 10 Δx, at most twenty times as many and a few.
    for (count, fits) in [(2064, true), (2065, false)] {
        let near = (0..count).map(|k| Vector::from([0.5 + 1e-6 * f64::from(k), 0.5])).collect();
        let error = begun(&value, common::particles(near), Clock::default()).err().map(|error| error.to_string());
        assert_eq!(error.is_none(), fits, "{error:?}");
        assert!(error.is_none_or(|error| error.contains("2065 particles around each, where it makes 100 expected")));
    }
    let space = common::settings::<3>(0.1, "none");
    let error = Simulation::new(space, particles, Clock::default(), Some(1)).err().expect("refused").to_string();
    assert!(error.contains("3 does not fit 2-dimensional arrays"), "{error}");
}

#[test]
fn a_simulation_goes_as_far_as_it_is_asked_to() {
    let mut simulation = simulation();
    assert_eq!(simulation.threads(), 1);
    assert_eq!(simulation.advance(3, None).expect("stable"), 3);
    let clock = simulation.clock();
    let history = simulation.take_history();
    assert_eq!((clock.step, history.len()), (3, 3));
    assert_relative_eq!(clock.time, history.iter().map(|report| report.time_step).sum::<f64>(), max_relative = 1e-14);
    assert_eq!(history[2].counts, simulation.particles().counts());
    assert!(simulation.take_history().is_empty());
    let until = clock.time + 0.02;
    assert!(simulation.advance_until(until, None).expect("stable"));
    let (time, last) = (simulation.clock().time, simulation.take_history().pop().expect("a step").time_step);
    assert!(time >= until && time - last < until);
    // What has been reached takes no step; each call that may take none more takes one.
    assert!(simulation.advance_until(until, None).expect("stable"));
    assert_eq!(simulation.advance(0, None).expect("stable"), 0);
    assert_eq!(simulation.advance(5, Some(Duration::ZERO)).expect("stable"), 1);
    assert!(!simulation.advance_until(1e9, Some(Duration::ZERO)).expect("stable"));
    assert_eq!(simulation.take_history().len(), 2);
}

/// One column of particles has crossed either plane after one spacing; masses go on from those of the beginning.
#[test]
fn the_mass_that_has_crossed_goes_on() {
    let (value, particles) = channel();
    let mut simulation = begun(&value, particles, Clock { mass_in: 2.0, mass_out: 3.0, ..Clock::default() }).expect("valid");
    simulation.advance_until(1.0 / SIDE as f64, None).expect("stable");
    let clock = simulation.clock();
    assert_relative_eq!(clock.mass_in, 2.0 + 1.0 / SIDE as f64, epsilon = 1e-12);
    assert_relative_eq!(clock.mass_out, 3.0 + 1.0 / SIDE as f64, epsilon = 1e-12);
}

#[test]
fn an_inflow_is_prescribed_in_the_order_of_the_ids() {
    let mut simulation = simulation();
    simulation.advance(20, None).expect("stable");
    let (position, particles) = (simulation.inflow_position(), simulation.particles());
    let mut inlet: Vec<_> = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Inlet).collect();
    inlet.sort_by_key(|&i| particles.id[i]);
    assert_eq!(position, inlet.iter().map(|&i| particles.position[i]).collect::<Vec<_>>());
    let velocity: Vec<_> = position.iter().map(|x| Vector::from([1.0 + 0.1 * x[1], 0.01 * x[0]])).collect();
    simulation.set_inflow(&velocity).expect("valid");
    for (&i, u) in inlet.iter().zip(&velocity) {
        assert_eq!(simulation.particles().velocity[i], *u);
    }
    // What is near an image of the inlet sees that velocity too.
    let gradient = simulation.snapshot().velocity_gradient;
    let particles = simulation.particles();
    let middle = |&i: &usize| particles.kind[i] == ParticleKind::Inlet && (-0.45..-0.3).contains(&particles.position[i][0]);
    let at_wall: Vec<_> = (0..particles.real).filter(middle).filter(|&i| particles.position[i][1] < 0.05).collect();
    let inside: Vec<_> =
        (0..particles.real).filter(middle).filter(|&i| (particles.position[i][1] - 0.5).abs() < 0.1).collect();
    assert!(!at_wall.is_empty() && !inside.is_empty());
    // Mirrored at the wall, u has no slope there.
    at_wall.iter().for_each(|&i| assert!((0.0..0.08).contains(&gradient[i][(0, 1)]), "{}", gradient[i]));
    inside.iter().for_each(|&i| assert_relative_eq!(gradient[i][(0, 1)], 0.1, epsilon = 1e-6));
    let error = simulation.set_inflow(&velocity[1..]).expect_err("too few").to_string();
    assert!(error.contains(&format!("{} rows for {} inlet particles", velocity.len() - 1, velocity.len())), "{error}");
    let unknown = vec![Vector::from([1.0, f64::NAN]); velocity.len()];
    assert!(simulation.set_inflow(&unknown).expect_err("no number").to_string().contains("is not finite"));
}

/// A velocity that has blown up ends the run before the step shrinks for ever.
#[test]
fn a_step_that_would_be_ten_thousand_times_too_small_is_a_breakdown() {
    for (speed, breaks) in [(3e3, false), (1e9, true)] {
        let (mut value, mut particles) = channel();
        value["time_step"] = 1e-3.into();
        particles.velocity[40] = Vector::from([0.0, speed]);
        let mut simulation = begun(&value, particles, Clock::default()).expect("valid");
        let error = simulation.advance(1, None).err().map(|error| error.to_string());
        let told =
            error.as_ref().is_some_and(|error| error.contains("velocity of particle 40") && error.contains("is 1000000000"));
        assert_eq!(told, breaks, "{error:?}");
    }
}

/// The smallest of the bounds.
#[test]
fn friction_and_body_force_limit_the_step() {
    for (key, chosen) in [
        ("kinematic_viscosity", json!(50.0)),
        ("body_force", json!([0.0, 1e5])),
        ("time_step", json!(1e-7)),
        ("courant", json!(0.05)),
    ] {
        let (mut value, particles) = channel();
        value["time_step"] = 1e-2.into();
        value[key] = chosen;
        let settings = common::parse(&value);
        let limits = settings.time_step_limits(1.0, settings.largest_eigenvalues());
        let expected = [settings.time_step, limits.courant, 0.9 * limits.penalty, limits.viscous, limits.body_force];
        let mut simulation = begun(&value, particles, Clock::default()).expect("valid");
        _ = simulation.advance(1, None);
        let least = expected.into_iter().fold(f64::INFINITY, f64::min);
        match simulation.take_history().pop() {
            Some(report) => assert_relative_eq!(report.time_step, least, max_relative = 1e-14),
            None => panic!("{key}: no step was taken"),
        }
    }
}
