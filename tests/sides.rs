//! What happens at the sides of the domain, and the images beyond them.

use alsph::boundary::{MassFlow, PressureRule, VelocityRule, conditions, end_step};
use alsph::halo::Images;
use alsph::neighbours::Grid;
use alsph::settings::WallPressure;
use alsph::{ParticleKind, Particles, Settings, Vector};
use approx::assert_relative_eq;
use serde_json::{Value, json};

mod common;

const SPACING: f64 = 0.1;

fn box_between(boundaries: Value) -> Value {
    let mut value = common::settings_value::<2>(SPACING, "none");
    (value["density"], value["domain"]) =
        (1.7.into(), json!({"lower": [-1.0, 0.5], "upper": [1.0, 2.0], "boundaries": boundaries}));
    value
}

/// Fluid at `points` with a velocity, and a solid particle at each of them too.
fn doubled(points: &[[f64; 2]]) -> Particles<2> {
    let mut particles = common::particles([points, points].concat().into_iter().map(Vector::from).collect());
    particles.velocity.fill(Vector::from([3.0, -2.0]));
    particles.kind[points.len()..].fill(ParticleKind::Solid);
    particles
}

fn ended(value: &Value, particles: &mut Particles<2>) {
    let settings = common::parse(value);
    end_step(particles, &settings, &Grid::default(), 0.01);
}

#[test]
fn slip_walls_throw_fluid_back() {
    let points = [[-1.02, 1.0], [1.03, 1.0], [0.0, 0.49], [0.0, 2.01], [1.01, 2.02], [1.0, 1.0], [-1.0, 0.5], [0.3, 1.0]];
    let back = [[-0.98, 1.0], [0.97, 1.0], [0.0, 0.51], [0.0, 1.99], [0.99, 1.98], [1.0, 1.0], [-1.0, 0.5], [0.3, 1.0]];
    let turned = [[-3.0, -2.0], [-3.0, -2.0], [3.0, 2.0], [3.0, 2.0], [-3.0, 2.0], [3.0, -2.0], [3.0, -2.0], [3.0, -2.0]];
    let mut particles = doubled(&points);
    ended(&box_between(json!([["slip", "slip"], ["slip", "slip"]])), &mut particles);
    for i in 0..points.len() {
        assert_relative_eq!(particles.position[i], Vector::from(back[i]), epsilon = 1e-12);
        assert_eq!(particles.velocity[i], Vector::from(turned[i]));
        // Bodies go through.
        assert_eq!(particles.position[points.len() + i], Vector::from(points[i]));
        assert_eq!(particles.velocity[points.len() + i], Vector::from([3.0, -2.0]));
    }
}

#[test]
fn what_leaves_through_a_periodic_side_comes_in_at_the_other() {
    let points = [[-1.02, 1.0], [1.03, 1.0], [0.0, 0.49], [0.0, 2.01], [1.0, 1.0], [-1.0, 0.5], [0.3, 2.0]];
    let back = [[0.98, 1.0], [-0.97, 1.0], [0.0, 1.99], [0.0, 0.51], [-1.0, 1.0], [-1.0, 0.5], [0.3, 0.5]];
    let mut particles = doubled(&points);
    ended(&box_between(json!([["periodic", "periodic"], ["periodic", "periodic"]])), &mut particles);
    for i in 0..particles.real {
        assert_relative_eq!(particles.position[i], Vector::from(back[i % points.len()]), epsilon = 1e-12);
        assert_eq!(particles.velocity[i], Vector::from([3.0, -2.0]));
    }
}

#[test]
fn fluid_that_crosses_an_outlet_has_no_pressure_and_counts_as_mass() {
    let settings = common::parse(&box_between(json!([["inlet", "outlet"], ["slip", "slip"]])));
    // Two leave, one comes back, one stays in the buffer, one is within; two enter.
    let cells = [[1.01, 1.0], [1.02, 1.2], [0.99, 1.4], [1.3, 1.0], [0.5, 1.0], [-0.99, 1.0], [-0.98, 1.5], [-1.2, 1.0]];
    let mut particles = common::particles(cells.map(Vector::from).to_vec());
    particles.kind[2..4].fill(ParticleKind::Outlet);
    particles.kind[5..].fill(ParticleKind::Inlet);
    (0..8).for_each(|i| particles.pressure[i] = 1.0 + i as f64);
    let flow = end_step(&mut particles, &settings, &Grid::default(), 0.01);
    let mass = 1.7 * SPACING * SPACING;
    assert_relative_eq!(flow.outflow, mass, epsilon = 1e-12);
    assert_relative_eq!(flow.inflow, 2.0 * mass, epsilon = 1e-12);
    // Those that follow have the pressure of the one that they follow, where no other is known.
    assert_eq!(particles.pressure, [0.0, 0.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 6.0, 7.0]);
    assert_eq!((&particles.id[8..], particles.real), (&[5, 6].map(|id| (1 << 40) + id)[..], 10));
    // Without an outlet nothing leaves through it.
    let closed = common::parse(&box_between(json!([["inlet", "none"], ["slip", "slip"]])));
    let mut particles = common::particles(vec![Vector::from([1.01, 1.0])]);
    assert_eq!(end_step(&mut particles, &closed, &Grid::default(), 0.01).outflow, 0.0);
    assert_eq!(particles.kind, [ParticleKind::Fluid]);
}

/// The outlet's buffer ends at its length beyond the side: what goes further is no longer there, and is not counted again as mass.
#[test]
fn particles_go_at_the_end_of_the_outlets_buffer() {
    let settings = common::parse(&box_between(json!([["inlet", "outlet"], ["slip", "slip"]])));
    let end = 1.0 + settings.buffer_length();
    let mut particles = common::particles([end - 0.01, end + 0.01, end + 5.0].map(|x| Vector::from([x, 1.0])).to_vec());
    particles.kind.fill(ParticleKind::Outlet);
    let flow = end_step(&mut particles, &settings, &Grid::default(), 0.01);
    assert_eq!((&particles.id[..], particles.real, flow.outflow), (&[0][..], 1, 0.0));
}

/// Of the particles around, the nearest inlet particle counts, not fluid, and no image.
#[test]
fn a_refilled_particle_has_the_pressure_of_the_nearest_inlet_particle() {
    let settings = common::parse(&box_between(json!([["inlet", "outlet"], ["none", "none"]])));
    let far = -0.99 - settings.buffer_length();
    let cells = [[-0.99, 1.0], [far + 0.08, 1.0], [far + 0.05, 1.05], [far, 1.01], [far, 0.91], [far + 0.01, 1.0]];
    let mut particles = common::particles(cells.map(Vector::from).to_vec());
    particles.kind.fill(ParticleKind::Inlet);
    particles.kind[3] = ParticleKind::Fluid;
    (0..6).for_each(|i| particles.pressure[i] = i as f64);
    let mut grid = Grid::default();
    grid.build(&particles.position, &particles.id, settings.support_radius(), settings.bounds());
    // The last was an image, and is gone.
    particles.real = 5;
    particles.drop_images();
    end_step(&mut particles, &settings, &grid, 0.01);
    assert_relative_eq!(particles.position[5], Vector::from([far, 1.0]), epsilon = 1e-12);
    assert_eq!(particles.pressure[5], 2.0);
}

#[test]
fn deep_in_an_inlet_is_a_support_radius_beyond_its_plane() {
    let settings = common::parse(&box_between(json!([["inlet", "outlet"], ["inlet", "none"]])));
    let (condition, radius) = (conditions(&settings), settings.support_radius());
    let deep =
        |kind, x: f64, y: f64| condition(kind, &Vector::from([x, y])).pressure == PressureRule::SolvedWithoutDivergence;
    let inlet = |x: f64, y: f64| deep(ParticleKind::Inlet, x, y);
    assert!(inlet(-1.0 - 1.01 * radius, 1.0) && !inlet(-1.0 - 0.99 * radius, 1.0) && !inlet(0.0, 1.0));
    assert!(inlet(0.0, 0.5 - 1.01 * radius) && !inlet(0.0, 0.5 - 0.99 * radius));
    assert!(!deep(ParticleKind::Fluid, -9.0, 1.0) && !inlet(9.0, 1.0));
    let closed = common::parse(&box_between(json!([["none", "outlet"], ["slip", "slip"]])));
    let rule = conditions(&closed)(ParticleKind::Inlet, &Vector::from([-9.0, 1.0])).pressure;
    assert_eq!(rule, PressureRule::Solved);
}

#[test]
fn what_a_particle_obeys_follows_from_its_kind() {
    let sides = json!([["inlet", "outlet"], ["slip", "slip"]]);
    let settings = Settings { wall_pressure: WallPressure::Linear, ..common::parse(&box_between(sides)) };
    let rule = |settings: &Settings, kind| conditions(settings)(kind, &Vector::from([0.0, 1.0]));
    let kinds = [ParticleKind::Fluid, ParticleKind::Inlet, ParticleKind::Outlet, ParticleKind::Solid];
    let pressure = [PressureRule::Solved, PressureRule::Solved, PressureRule::Zero, PressureRule::FromFluid];
    assert_eq!(kinds.map(|kind| rule(&settings, kind).pressure), pressure);
    let kept = VelocityRule::Kept;
    assert_eq!(kinds.map(|kind| rule(&settings, kind).velocity), [VelocityRule::Solved, kept, kept, kept]);
    let paper = Settings { wall_pressure: WallPressure::Paper, ..settings };
    assert_eq!(rule(&paper, ParticleKind::Solid).pressure, PressureRule::Solved);
}

/// Images beyond periodic sides in x and slip walls in y.
fn images_of(points: &[[f64; 2]]) -> (Images<2>, Particles<2>) {
    let settings = common::parse(&box_between(json!([["periodic", "periodic"], ["slip", "slip"]])));
    let mut particles = common::particles(points.iter().copied().map(Vector::from).collect());
    particles.velocity.fill(Vector::from([3.0, -2.0]));
    particles.normal.fill(Vector::from([0.6, 0.8]));
    (0..points.len()).for_each(|i| particles.pressure[i] = i as f64);
    let mut images = Images::default();
    images.create(&mut particles, &settings.domain, 0.25);
    (images, particles)
}

#[test]
fn images_lie_within_reach_of_the_sides() {
    // In a corner, on the planes, at reach and just within, and far from all sides.
    let points = [[-0.9, 0.6], [1.0, 1.0], [0.0, 0.5], [0.76, 1.0], [0.75, 1.0], [0.0, 1.76], [0.0, 1.75], [0.0, 1.0]];
    let (images, particles) = images_of(&points);
    assert_eq!(particles.real, points.len());
    let expected = [
        (0, [1.1, 0.6], 1.0),
        (1, [-1.0, 1.0], 1.0),
        (3, [-1.24, 1.0], 1.0),
        (0, [-0.9, 0.4], -1.0),
        (5, [0.0, 2.24], -1.0),
        (0, [1.1, 0.4], -1.0),
    ];
    assert_eq!(particles.len() - particles.real, expected.len());
    for (k, (source, place, turned)) in expected.into_iter().enumerate() {
        let i = particles.real + k;
        assert_relative_eq!(particles.position[i], Vector::from(place), epsilon = 1e-12);
        assert_eq!(particles.velocity[i], Vector::from([3.0, -2.0 * turned]));
        assert_eq!(particles.normal[i], Vector::from([0.6, 0.8 * turned]));
        assert_eq!((particles.pressure[i], particles.id[i]), (source as f64, source as u64));
    }
    let (mut position, mut velocity, mut pressure) =
        (particles.position.clone(), particles.velocity.clone(), particles.pressure.clone());
    position[0] += Vector::from([0.01, 0.02]);
    (velocity[0], pressure[0]) = (Vector::from([5.0, 7.0]), 9.0);
    images.fill_positions(&mut position);
    images.fill(&mut velocity);
    images.fill(&mut pressure);
    let corner = particles.len() - 1;
    assert_relative_eq!(position[corner], Vector::from([1.11, 0.38]), epsilon = 1e-12);
    assert_eq!((velocity[corner], pressure[corner]), (Vector::from([5.0, -7.0]), 9.0));
}

#[test]
fn what_is_stale_is_made_nan_and_what_looks_fresh_is_found() {
    let (mut images, particles) = images_of(&[[-0.9, 1.0], [0.0, 1.0]]);
    let mut field = particles.pressure.clone();
    images.real(&mut field)[0] = 4.0;
    assert!(field[..2] == [4.0, 1.0] && field[2].is_nan());
    images.check(&field);
    images.fill(&mut field);
    images.check(&field);
    images.check::<f64>(&[]);
    images.blank(&mut field, 3);
    assert!(field.iter().all(|value| value.is_nan()));
    // Without poison what was there stays, and nothing is checked.
    images.poisons = false;
    let mut field = vec![1.0, 2.0, 3.0];
    images.real(&mut field)[0] = 4.0;
    images.blank(&mut field, 3);
    assert_eq!(field, [4.0, 2.0, 3.0]);
    images.check(&field);
    images.poisons = true;
    // The panic is wanted.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let found = std::panic::catch_unwind(|| images.check(&field));
    std::panic::set_hook(hook);
    assert!(found.is_err());
}

/// Fluid with a velocity in front of an outlet at x = 1, and the first `columns` of its buffer with another.
fn at_an_outlet(columns: usize, velocity: [f64; 2], kept: [f64; 2]) -> (Settings, Particles<2>) {
    let settings = common::parse(&box_between(json!([["none", "outlet"], ["slip", "slip"]])));
    let place = |k: usize, l: usize| Vector::from([0.05 + 0.1 * k as f64, 0.55 + 0.1 * l as f64]);
    let mut particles = common::particles((0..10 + columns).flat_map(|k| (0..15).map(move |l| place(k, l))).collect());
    for i in 0..particles.real {
        let inside = particles.position[i][0] < 1.0;
        particles.velocity[i] = Vector::from(if inside { velocity } else { kept });
        particles.kind[i] = if inside { ParticleKind::Fluid } else { ParticleKind::Outlet };
    }
    (settings, particles)
}

fn end(settings: &Settings, particles: &mut Particles<2>) -> MassFlow {
    let mut grid = Grid::default();
    grid.build(&particles.position, &particles.id, settings.support_radius(), settings.bounds());
    end_step(particles, settings, &grid, 0.01)
}

#[test]
fn a_buffer_that_fluid_comes_back_from_follows_it_and_stays_full() {
    let (settings, mut particles) = at_an_outlet(2, [-0.5, 0.3], [0.4, 0.1]);
    let before = particles.clone();
    let flow = end(&settings, &mut particles);
    let columns = (settings.buffer_length() / SPACING).round() as usize;
    assert_eq!((particles.real, flow.returning), (15 * (10 + columns), 30));
    assert_eq!((flow.inflow, flow.outflow), (0.0, 0.0));
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Outlet) {
        assert_relative_eq!(particles.velocity[i], Vector::from([-0.5, 0.3]), epsilon = 1e-12);
        assert_eq!(particles.pressure[i], 0.0);
        let cells = (particles.position[i] - Vector::from([0.05, 0.55])) / SPACING;
        let moved = if i < before.real { -0.001 / SPACING } else { 0.0 }; // back by what it has moved along the outlet
        assert_relative_eq!(cells[1] - cells[1].round(), moved, epsilon = 1e-9);
        assert_relative_eq!(cells[0], cells[0].round(), epsilon = 1e-9);
    }
    let mut ids = particles.id.clone();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), particles.real);
    let full = particles.real;
    end(&settings, &mut particles);
    assert_eq!(particles.real, full);
    // New ones go on with ids that none has had as long as the last ones are there.
    let mut keep = vec![true; particles.real];
    keep[before.real..before.real + 5].fill(false);
    particles.retain(&keep);
    let newest = *particles.id.iter().max().unwrap();
    end(&settings, &mut particles);
    assert_eq!(particles.real, full);
    assert!(particles.id[full - 5..].iter().all(|&id| id > newest));
}

#[test]
fn a_buffer_that_fluid_leaves_into_keeps_its_velocities() {
    for (velocity, kept, follows) in [
        (0.5, 0.4, false),
        (0.01, 2.0, false),
        (-0.01, 2.0, true),
        (0.5, -0.1, true),
        (0.9, 0.091, false),
        (0.9, 0.089, true),
    ] {
        let (settings, mut particles) = at_an_outlet(3, [velocity, 0.0], [kept, 0.0]);
        let flow = end(&settings, &mut particles);
        let expected = if follows { velocity } else { kept };
        assert_relative_eq!(particles.velocity[15 * 13 - 1][0], expected, epsilon = 1e-12);
        assert_eq!(flow.returning, if velocity < 0.0 { 45 } else { 0 });
        assert!(velocity < 0.0 || particles.real == 15 * 13);
    }
}

#[test]
fn of_those_that_crowd_in_a_buffer_that_follows_one_stays() {
    let (settings, mut particles) = at_an_outlet(8, [-0.5, 0.0], [-0.5, 0.0]);
    let middle = 15 * 12 + 7;
    let added = particles.push_copy(middle);
    particles.position[added] += Vector::from([0.02, 0.03]);
    particles.id[added] = 9999;
    particles.real += 1;
    end(&settings, &mut particles);
    assert!(particles.id.contains(&particles.id[middle]) && !particles.id.contains(&9999));
    assert_eq!(particles.real, 15 * 18);
}
