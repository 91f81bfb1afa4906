//! What is prescribed by place and time: a body force and the velocity of surfaces.

use alsph::forcing::{Forcing, Rule};
use alsph::{Clock, Error, ParticleKind, Particles, Settings, Simulation, Vector};
use serde_json::{Value, json};

mod common;

const FORCE: [f64; 2] = [0.3, -0.8];
const LID: f64 = 0.7;

/// A box of fluid, periodic in x, between solid walls three layers deep that go along at U = 0.7 and stay in place.
fn channel() -> (Value, Particles<2>) {
    let (side, layers) = (12i64, 4i64);
    let spacing = 1.0 / side as f64;
    let mut value = common::settings_value::<2>(spacing, "none");
    value["domain"]["boundaries"] = json!([["periodic", "periodic"], ["none", "none"]]);
    value["body_force"] = json!(FORCE);
    value["bodies"][0]["velocity"] = json!([LID, 0.0]);
    let cells = (0..side).flat_map(|column| (-layers..side + layers).map(move |row| [column, row]));
    let mut particles =
        common::particles(cells.map(|cell| Vector::from(cell.map(|k| (k as f64 + 0.5) * spacing))).collect());
    for i in 0..particles.real {
        let y = particles.position[i][1];
        let depth = (-y).max(y - 1.0);
        if depth > 0.0 {
            particles.kind[i] = ParticleKind::Solid;
            particles.depth[i] = depth;
            particles.normal[i] = Vector::from([0.0, if y < 0.5 { 1.0 } else { -1.0 }]);
            particles.velocity[i] = Vector::from([LID, 0.0]);
        }
    }
    (value, particles)
}

fn simulation(settings: Settings, particles: &Particles<2>, forcing: Forcing<2>) -> Simulation<2> {
    let mut simulation = Simulation::new(settings, particles.clone(), Clock::default(), Some(1)).expect("valid");
    simulation.forcing = forcing;
    simulation
}

fn everywhere(vector: [f64; 2]) -> Option<Rule<2>> {
    Some(Box::new(move |position, _| Ok(vec![Vector::from(vector); position.len()])))
}

fn bits(simulation: &Simulation<2>) -> Vec<[u64; 5]> {
    let Particles { real, position, velocity, pressure, .. } = simulation.particles();
    let numbers = |i: usize| [position[i][0], position[i][1], velocity[i][0], velocity[i][1], pressure[i]].map(f64::to_bits);
    (0..*real).map(numbers).collect()
}

#[test]
fn what_a_rule_gives_everywhere_is_what_the_settings_give() {
    let alsph = json!({"kind": "alsph"});
    let edac = json!({"kind": "edac", "sound_speed": 10, "diffusion_coefficient": 0.5});
    for (scheme, wall_pressure) in [(&alsph, "adami"), (&alsph, "linear"), (&edac, "adami"), (&edac, "linear")] {
        let (mut value, particles) = channel();
        (value["scheme"], value["wall_pressure"], value["adaptive_time_step"]) =
            (scheme.clone(), wall_pressure.into(), false.into());
        let mut told = simulation(common::parse(&value), &particles, Forcing::default());
        (value["body_force"], value["bodies"][0]["velocity"]) = (json!([0.0, 0.0]), Value::Null);
        let rules = Forcing { body_force: everywhere(FORCE), surface_velocity: everywhere([LID, 0.0]), motion: None };
        let mut asked = simulation(common::parse(&value), &particles, rules);
        let mut still = simulation(common::parse(&value), &particles, Forcing::default());
        for simulation in [&mut told, &mut asked, &mut still] {
            simulation.advance(40, None).expect("stable");
        }
        assert_eq!(bits(&told), bits(&asked), "{scheme} {wall_pressure}");
        assert_ne!(bits(&told), bits(&still));
    }
}

#[test]
fn a_rule_that_is_taken_away_acts_no_more() {
    let (value, particles) = channel();
    let mut simulations = [Some(()), None].map(|pushed| {
        let body_force = pushed.and_then(|()| everywhere([0.0, 0.0]));
        simulation(common::parse(&value), &particles, Forcing { body_force, surface_velocity: None, motion: None })
    });
    let [pushed, plain] = &mut simulations;
    pushed.advance(3, None).expect("stable");
    plain.advance(3, None).expect("stable");
    let mut once = 0;
    pushed.forcing.body_force = Some(Box::new(move |position, _| {
        once += 1;
        Ok(vec![Vector::repeat(if once > 1 { f64::NAN } else { 0.0 }); position.len()])
    }));
    pushed.advance(1, None).expect("asked once");
    pushed.forcing.body_force = None;
    pushed.advance(20, None).expect("asked no more");
    plain.advance(21, None).expect("stable");
    assert_eq!(bits(pushed), bits(plain));

    let mut value = value;
    value["adaptive_time_step"] = false.into();
    let still = |body_force| {
        simulation(common::parse(&value), &particles, Forcing { body_force, surface_velocity: None, motion: None })
    };
    let (mut pushed, mut plain) = (still(everywhere([5.0, 0.0])), still(None));
    pushed.advance(1, None).expect("stable");
    pushed.forcing.body_force = None;
    let before: Vec<_> = (0..particles.real).map(|i| pushed.particles().velocity[i][0]).collect();
    pushed.advance(1, None).expect("stable");
    plain.advance(1, None).expect("stable");
    let fluid = |simulation: &Simulation<2>| {
        let particles = simulation.particles();
        (0..particles.real)
            .find(|&i| particles.kind[i] == ParticleKind::Fluid && (particles.position[i][1] - 0.5).abs() < 0.1)
    };
    let i = fluid(&pushed).expect("some");
    let gained = pushed.particles().velocity[i][0] - before[i];
    let step = pushed.settings().time_step;
    assert!((gained / step - FORCE[0]).abs() < 1.0, "{gained} in {step}");
}

/// du/dt = cos t in a periodic box of fluid.
#[test]
fn a_force_that_changes_in_time_is_integrated_at_second_order() {
    let error = |steps: u64| {
        let mut value = common::settings_value::<2>(0.125, "periodic");
        (value["time_step"], value["adaptive_time_step"]) = ((1.0 / steps as f64).into(), false.into());
        value["penalty_constant"] = 1.0.into();
        let rule: Rule<2> = Box::new(|position, time| Ok(vec![Vector::from([time.cos(), 0.0]); position.len()]));
        let forcing = Forcing { body_force: Some(rule), surface_velocity: None, motion: None };
        let mut simulation = simulation(common::parse(&value), &common::particles(common::lattice::<2>(8, 0.0)), forcing);
        simulation.advance(steps, None).expect("stable");
        (simulation.particles().velocity[0][0] - 1f64.sin()).abs()
    };
    let (coarse, fine) = (error(16), error(32));
    assert!(coarse < 2e-4 && coarse / fine > 3.9 && coarse / fine < 4.1, "{coarse} {fine}");
}

#[test]
fn surfaces_move_as_told_and_no_others() {
    let (mut value, particles) = channel();
    let wall = value["bodies"][0].clone();
    value["bodies"] = json!([wall, wall]);
    (value["bodies"][1]["name"], value["bodies"][1]["velocity"]) = ("lid".into(), Value::Null);
    let mut particles = particles;
    for i in 0..particles.real {
        particles.body[i] = u16::from(particles.kind[i] == ParticleKind::Solid && particles.position[i][1] > 0.5);
    }
    let rule: Rule<2> = Box::new(|position, time| Ok(position.iter().map(|r| Vector::from([r[0] + time, 0.1])).collect()));
    let mut simulation =
        simulation(common::parse(&value), &particles, Forcing { surface_velocity: Some(rule), ..Forcing::default() });
    simulation.advance(1, None).expect("stable");
    let time = simulation.clock().time;
    let now = simulation.particles();
    for i in (0..now.real).filter(|&i| now.kind[i] == ParticleKind::Solid) {
        let [x, y]: [f64; 2] = now.position[i].into();
        let expected = if y > 0.5 { [x + 0.5 * time, 0.1] } else { [LID, 0.0] };
        assert_eq!(<[f64; 2]>::from(now.velocity[i]), expected);
        let start = (0..particles.real).find(|&k| particles.id[k] == now.id[i]).expect("the same");
        assert_eq!(particles.position[start], now.position[i], "they stay in place");
    }
}

#[test]
fn a_rule_that_fails_leaves_the_simulation_as_it_was() {
    let (value, particles) = channel();
    let rules: [(Rule<2>, &str); 3] = [
        (Box::new(|_, _| Ok(Vec::new())), "array `body force`: 0 rows for 240 particles"),
        (Box::new(|position, _| Ok(vec![Vector::repeat(f64::NAN); position.len()])), "all must be finite"),
        (
            Box::new(|_, _| Err(Error::Array { name: "body force", problem: "as it likes".into() })),
            "array `body force`: as it likes",
        ),
    ];
    for (rule, message) in rules {
        let mut value = value.clone();
        value["derivative_frame"] = "midpoint".into();
        let mut simulation = simulation(common::parse(&value), &particles, Forcing::default());
        simulation.advance(3, None).expect("stable");
        let (before, clock) = (bits(&simulation), simulation.clock());
        simulation.forcing.body_force = Some(rule);
        let error = simulation.advance(1, None).expect_err("refused").to_string();
        assert!(error.contains(message), "{error}");
        assert_eq!((bits(&simulation), clock.step), (before, simulation.clock().step));
    }
}
