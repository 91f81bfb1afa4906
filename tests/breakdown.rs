//! What counts as a breakdown, of which particle and how far, and what is said to be its cause.

use alsph::breakdown::{Symptom, find, likely_cause};
use alsph::kernel::{QuinticSpline, Smoothing};
use alsph::settings::TimeStepLimits;
use alsph::{ParticleKind, Particles, Place, Settings, Vector};
use common::set::Set;
use serde_json::{Value, json};

mod common;

const SIDE: usize = 12;
const SPACING: f64 = 1.0 / SIDE as f64;
/// So small that Δx / Δt limits no velocity.
const TIME_STEP: f64 = 1e-9;

/// A box between an inlet, an outlet, a slip wall and a side without one.
fn settings() -> Value {
    let mut value = common::settings_value::<2>(SPACING, "none");
    value["domain"]["boundaries"] = json!([["inlet", "outlet"], ["slip", "none"]]);
    value
}

/// What is found after `change`.
fn found(value: &Value, time_step: f64, change: impl FnOnce(&mut Set<2>)) -> Option<Symptom> {
    let settings = common::parse(value);
    let mut set = Set::of(common::particles(common::lattice::<2>(SIDE, 0.0)), &settings, false);
    change(&mut set);
    find(&settings, &set.particles, &set.frame, &[], time_step)
}

fn symptom(particle: usize, field: &'static str, value: f64) -> Option<Symptom> {
    Some(Symptom { particle, field, value })
}

#[test]
fn a_symptom_is_what_is_beyond_its_bound() {
    let value = settings();
    assert_eq!(found(&value, TIME_STEP, |_| ()), None);
    // The first, whatever comes after it.
    let both = |set: &mut Set<2>| [130, 20].into_iter().for_each(|i| set.particles.pressure[i] = f64::INFINITY);
    assert_eq!(found(&value, TIME_STEP, both), symptom(20, "pressure", f64::INFINITY));

    let at_speed = |u: f64| move |set: &mut Set<2>| set.particles.velocity[7] = Vector::from([0.6 * u, -0.8 * u]);
    let mut limited = settings();
    limited["velocity_limit"] = 2.0.into();
    // Δx in a step, and the user's limit if that is less.
    for (value, time_step, fastest) in
        [(&value, SPACING / 4.0, 4.0), (&limited, SPACING / 4.0, 2.0), (&limited, SPACING, 1.0)]
    {
        assert_eq!(found(value, time_step, at_speed(0.999 * fastest)), None);
        let fast = found(value, time_step, at_speed(1.001 * fastest)).expect("too fast");
        assert!((fast.particle, fast.field) == (7, "velocity") && (fast.value / fastest - 1.001).abs() < 1e-12, "{fast:?}");
    }
    // A drop that is alone in the air may be as fast as it will, if it does not cross Δx.
    let settings = common::parse(&limited);
    let mut set = Set::of(common::particles(common::lattice::<2>(SIDE, 0.0)), &settings, false);
    let mut place = vec![Place::Inside; set.particles.real];
    place[7] = Place::Isolated;
    let alone = |set: &Set<2>| find(&settings, &set.particles, &set.frame, &place, SPACING / 4.0);
    at_speed(3.999)(&mut set);
    assert_eq!(alone(&set), None);
    at_speed(4.001)(&mut set);
    assert_eq!(alone(&set).map(|symptom| symptom.field), Some("velocity"));
    let unknown = found(&value, TIME_STEP, at_speed(f64::NAN)).expect("no number");
    assert!(unknown.field == "velocity" && unknown.value.is_nan());
    // The velocity of a solid is prescribed.
    let solid = |set: &mut Set<2>| {
        at_speed(1e30)(set);
        set.particles.kind[7] = ParticleKind::Solid;
    };
    assert_eq!(found(&value, TIME_STEP, solid), None);
}

#[test]
fn fluid_is_lost_a_support_radius_beyond_a_closed_side() {
    let value = settings();
    let radius = common::parse(&value).support_radius();
    // Inlet, outlet, slip wall and none.
    let sides = [([-1.0, 0.0], false), ([1.0, 0.0], false), ([0.0, -1.0], true), ([0.0, 1.0], true)];
    for (outward, closed) in sides {
        let outward = Vector::from(outward);
        let at = |beyond: f64, kind: ParticleKind| {
            found(&value, TIME_STEP, |set| {
                set.particles.position[9] = Vector::from([0.5, 0.5]) + outward * (0.5 + beyond);
                set.particles.kind[9] = kind;
            })
        };
        assert_eq!(at(0.99 * radius, ParticleKind::Fluid), None);
        assert_eq!(at(1.01 * radius, ParticleKind::Outlet), None);
        match at(1.01 * radius, ParticleKind::Fluid) {
            Some(symptom) if closed => {
                assert!((symptom.particle, symptom.field) == (9, "position"));
                assert!((symptom.value - 1.01 * radius).abs() < 1e-12, "{symptom:?}");
            }
            found => assert!(found.is_none() && !closed, "{found:?} beyond {outward:?}"),
        }
    }
}

#[test]
fn fluid_is_lost_three_quarters_of_a_spacing_under_a_surface() {
    let settings = common::parse(&settings());
    // Fluid Δx above a solid particle, which is so deep under a surface that the fluid is less deep by Δx at the most. Solid particles far
    // from it are in the row of its cluster, for one in between. [Δx]
    let at = |depths: &[f64], far: f64| {
        let mut cells = vec![[0.0, 0.0], [2.0, 0.0], [far, 0.0]];
        cells.resize(3 + depths.len(), [0.0, -1.0]);
        let mut particles =
            common::particles(cells.into_iter().map(|cell| Vector::from(cell).add_scalar(6.0) * SPACING).collect());
        particles.kind[1] = ParticleKind::Outlet;
        for (i, depth) in [5.0].iter().chain(depths).enumerate().map(|(k, depth)| (k + 2, depth)) {
            (particles.kind[i], particles.depth[i]) = (ParticleKind::Solid, depth * SPACING);
            particles.normal[i][1] = if i == 4 { -1.0 } else { 1.0 };
        }
        let set = Set::of(particles, &settings, false);
        let found =
            find(&settings, &set.particles, &set.frame, &[], TIME_STEP).filter(|symptom| symptom.field == "position");
        found.map(|symptom| symptom.value / SPACING)
    };
    assert_eq!(at(&[1.74], 4.1), None);
    assert!((at(&[1.76], 4.1).expect("lost") - 0.76).abs() < 1e-12);
    assert!((at(&[1.74], 3.9).expect("lost") - 1.1).abs() < 1e-12);
    // Of two at one place, for the two faces of a plate, only the one whose face the fluid is on says how deep it is.
    assert_eq!(at(&[0.5, 2.5], 4.1), None);
    // How far off the other face is counts for fluid within a spacing alone.
    let above = |height: f64, deeper: f64| {
        let cells = [[0.0, height], [0.0, 0.0], [0.0, 0.0]].map(|cell| Vector::from(cell).add_scalar(6.0) * SPACING);
        let mut particles = common::particles(cells.to_vec());
        for (i, depth, normal) in [(1, 0.5, -1.0), (2, deeper, 1.0)] {
            (particles.kind[i], particles.depth[i]) = (ParticleKind::Solid, depth * SPACING);
            particles.normal[i][1] = normal;
        }
        let set = Set::of(particles, &settings, false);
        let found =
            find(&settings, &set.particles, &set.frame, &[], TIME_STEP).filter(|symptom| symptom.field == "position");
        found.map(|symptom| symptom.value / SPACING)
    };
    assert_eq!(above(1.4, 3.0), None);
    assert!((above(0.6, 1.5).expect("lost") - 0.9).abs() < 1e-12);
}

#[test]
fn a_particle_is_alone_whose_neighbours_sum_to_a_quarter_of_its_own_kernel() {
    let settings = common::parse(&settings());
    let own = Smoothing::new(QuinticSpline, settings.smoothing_length(), 2).value(0.0);
    let with_volume = |volume: f64| found(&self::settings(), TIME_STEP, |set| set.frame.stencil.volume[3] = volume);
    assert_eq!(with_volume(0.999 / (1.25 * own)), None);
    assert_eq!(with_volume(1.001 / (1.25 * own)), symptom(3, "volume", 1.001 / (1.25 * own)));
}

fn cause(settings: &Settings, particles: &Particles<2>, field: &'static str, time_step: f64, limits: [f64; 3]) -> String {
    let [penalty, viscous, body_force] = limits;
    let symptom = Symptom { particle: 0, field, value: 1.0 };
    likely_cause(
        settings,
        particles,
        symptom,
        time_step,
        TimeStepLimits { courant: f64::INFINITY, penalty, acoustic: f64::INFINITY, viscous, body_force },
    )
}

#[test]
fn the_cause_is_the_least_limit_that_the_step_is_beyond_or_the_place() {
    let settings = common::parse(&settings());
    let particles = common::particles(common::lattice::<2>(SIDE, 0.0));
    let cause = |field, time_step, limits| cause(&settings, &particles, field, time_step, limits);
    for (limits, name) in [([0.5, 1.0, 2.0], "penalty"), ([1.0, 0.5, 2.0], "viscous"), ([2.0, 1.0, 0.5], "body force")] {
        let text = cause("velocity", 1.0, limits);
        assert!(text.starts_with(&format!("the time step 1.000e0 is 2.0 times the {name} limit")), "{text}");
        assert!(text.contains("before it, 5.000e-1:"), "{text}");
    }
    // A step at its bound is not beyond it.
    assert!(!cause("velocity", 1.0005, [1.0; 3]).contains("times the"));
    assert!(cause("velocity", 1.0015, [1.0; 3]).contains("times the"));
    assert!(cause("position", 0.1, [1.0; 3]).contains("through a wall or into a body"));
    assert!(cause("volume", 0.1, [1.0; 3]).contains("a void has opened"));
}

#[test]
fn a_place_is_named_by_what_is_near() {
    let mut value = settings();
    value["domain"]["upper"] = json!([4.0, 2.0]);
    let settings = common::parse(&value);
    let near = 2.0 * settings.support_radius();
    let place = |kind: ParticleKind, x: f64, from_body: f64| {
        let mut particles =
            common::particles(vec![Vector::from([x, 0.1]), Vector::from([x, 0.1 + from_body]), Vector::from([x, 90.0])]);
        particles.kind = vec![kind, ParticleKind::Solid, ParticleKind::Solid];
        cause(&settings, &particles, "velocity", 0.1, [1.0; 3])
    };
    for (kind, x, from_body, name) in [
        (ParticleKind::Inlet, 2.0, 0.1, "in the inlet buffer"),
        (ParticleKind::Outlet, 2.0, 0.1, "in the outlet buffer"),
        (ParticleKind::Fluid, 0.99 * near, 0.1, "near the inlet"),
        (ParticleKind::Fluid, 4.0 - 0.99 * near, 0.1, "near the outlet"),
        (ParticleKind::Fluid, 1.01 * near, 0.99 * near, "near \"wall\""),
        (ParticleKind::Fluid, 4.0 - 1.01 * near, 1.01 * near, "in the open flow"),
        // A body is not near itself.
        (ParticleKind::Solid, 2.0, 1.01 * near, "in the open flow"),
    ] {
        let text = place(kind, x, from_body);
        assert!(text.starts_with(&format!("it is {name}: take")), "{text} where {name} is right");
    }
}
