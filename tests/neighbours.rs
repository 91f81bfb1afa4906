//! The grid search against brute force, periodic sides and slip walls included.

use alsph::frame::{Frame, Travel};
use alsph::neighbours::{Entry, brute_force_neighbours};
use alsph::settings::Settings;
use alsph::{ParticleKind, Particles, Vector};
use proptest::prelude::*;

mod common;

/// Every real particle's neighbours closer than `radius`, sorted. What else the rows hold must not count.
fn listed<const D: usize>(frame: &Frame<D>, particles: &Particles<D>, radius: f64) -> Vec<Vec<u32>> {
    (0..particles.real)
        .map(|i| {
            let (row, lane) = frame.stencil.neighbours.row(i);
            let far = |j: usize| (particles.position[i] - particles.position[j]).norm_squared() >= radius * radius;
            let (beyond, mut near): (Vec<&Entry>, Vec<&Entry>) = row.all().iter().partition(|entry| far(entry.j()));
            assert!(beyond.iter().all(|entry| entry.slope(lane) == 0.0));
            near.retain(|entry| entry.j() != i);
            let mut near: Vec<u32> = near.iter().map(|entry| entry.j() as u32).collect();
            near.sort_unstable();
            near
        })
        .collect()
}

/// Distances of every real particle to its periodic and mirror images by trying all 3^D boxes around the domain.
fn counts_by_images<const D: usize>(settings: &Settings, particles: &Particles<D>) -> Vec<usize> {
    use alsph::settings::Boundary;
    let real: Vec<Vector<D>> = particles.position[..particles.real].to_vec();
    let mut all = Vec::new();
    for code in 0..3usize.pow(D as u32) {
        'particle: for point in &real {
            let mut image = *point;
            for axis in 0..D {
                let side = code / 3usize.pow(axis as u32) % 3;
                let (lower, upper) = (settings.domain.lower[axis], settings.domain.upper[axis]);
                let [low, high] = settings.domain.boundaries[axis];
                match (side, low, high) {
                    (0, ..) => {}
                    (1, Boundary::Periodic, _) => image[axis] += upper - lower,
                    (2, Boundary::Periodic, _) => image[axis] -= upper - lower,
                    (1, Boundary::Slip, _) => image[axis] = 2.0 * lower - image[axis],
                    (2, _, Boundary::Slip) => image[axis] = 2.0 * upper - image[axis],
                    _ => continue 'particle,
                }
            }
            all.push(image);
        }
    }
    let radius = settings.support_radius();
    real.iter().map(|point| all.iter().filter(|other| (*other - point).norm() < radius).count() - 1).collect()
}

fn check<const D: usize>(points: Vec<Vector<D>>, boundary: &str, solid: u64) -> Result<(), TestCaseError> {
    let settings = common::settings::<D>(0.1, boundary);
    let mut particles = common::particles(points);
    for (i, kind) in particles.kind.iter_mut().enumerate() {
        if i as u64 % 7 < solid {
            *kind = ParticleKind::Solid;
        }
    }
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), true);
    let radius = settings.support_radius();
    let expected = brute_force_neighbours(&particles.position, particles.real, radius);
    prop_assert_eq!(listed(&frame, &particles, radius), expected);
    let counts: Vec<usize> = listed(&frame, &particles, radius).iter().map(Vec::len).collect();
    prop_assert_eq!(counts, counts_by_images(&settings, &particles));
    for i in 0..particles.real {
        let (row, _) = frame.stencil.neighbours.row(i);
        prop_assert!(row.flowing().iter().all(|entry| particles.kind[entry.j()] != ParticleKind::Solid));
        prop_assert!(row.solid().iter().all(|entry| particles.kind[entry.j()] == ParticleKind::Solid));
    }
    Ok(())
}

/// Particles in no order at all: those of a row lie anywhere.
fn check_scattered<const D: usize>(points: Vec<Vector<D>>) -> Result<(), TestCaseError> {
    let settings = common::settings::<D>(0.025, "none");
    let mut particles = common::particles(points);
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), false);
    let radius = settings.support_radius();
    let expected = brute_force_neighbours(&particles.position, particles.real, radius);
    prop_assert_eq!(listed(&frame, &particles, radius), expected);
    Ok(())
}

/// Particles that end within the skin of where their velocities take them need no new search, others get one.
fn check_moved(points: Vec<Vector<2>>, boundary: &str, speed: f64, deviation: f64) -> Result<(), TestCaseError> {
    let mut value = common::settings_value::<2>(0.1, boundary);
    value["derivative_frame"] = "updated".into();
    let settings = common::parse(&value);
    let mut particles = common::particles(points);
    let direction = |angle: f64| Vector::from([angle.cos(), angle.sin()]);
    particles.velocity.iter_mut().enumerate().for_each(|(i, u)| *u = direction(i as f64) * speed);
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel { time_step: 1.0, velocity_max: speed, fraction: 0.0 }, true);
    for i in 0..particles.real {
        particles.position[i] += particles.velocity[i] + direction(2.5 * i as f64) * (deviation * speed);
    }
    frame.images.fill_positions(&mut particles.position);
    frame.update(&settings, &particles);
    let radius = settings.support_radius();
    let expected = brute_force_neighbours(&particles.position, particles.real, radius);
    prop_assert_eq!(listed(&frame, &particles, radius), expected);
    if deviation <= 0.2 {
        let counts: Vec<usize> = listed(&frame, &particles, radius).iter().map(Vec::len).collect();
        prop_assert_eq!(counts, counts_by_images(&settings, &particles));
    }
    Ok(())
}

fn points<const D: usize>(most: usize) -> impl Strategy<Value = Vec<Vector<D>>> {
    proptest::collection::vec(proptest::array::uniform::<_, D>(1e-6..1.0 - 1e-6), 1..most)
        .prop_map(|points| points.into_iter().map(Vector::from).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn search_in_2d_finds_what_brute_force_finds(points in points::<2>(400), boundary in common::boundary(), solid in 0u64..3) {
        check(points, boundary, solid)?;
    }

    #[test]
    fn search_in_3d_finds_what_brute_force_finds(points in points::<3>(200), boundary in common::boundary(), solid in 0u64..3) {
        check(points, boundary, solid)?;
    }

    #[test]
    fn search_among_scattered_particles_finds_what_brute_force_finds(flat in points::<2>(800), solid in points::<3>(800)) {
        check_scattered(flat)?;
        check_scattered(solid)?;
    }

    #[test]
    fn moved_particles_keep_all_their_neighbours(
        points in points::<2>(400), boundary in common::boundary(), speed in 0.0..0.1f64, deviation in 0.0..0.4f64,
    ) {
        check_moved(points, boundary, speed, deviation)?;
    }
}

#[test]
fn a_list_is_renewed_when_anything_strays_far() {
    check_moved(common::lattice::<2>(12, 0.3), "none", 0.05, 2.0).expect("the list is complete");
}

/// A search that may put the particles into the order of its cells moves each whole, and next to one another those that are near.
#[test]
fn particles_are_put_into_the_order_of_the_cells() {
    let settings = common::settings::<2>(0.05, "none");
    let points = common::lattice::<2>(20, 0.3);
    let mut particles = common::particles((0..400).map(|i| points[i * 7919 % 400]).collect());
    particles.velocity.copy_from_slice(&particles.position);
    let start = particles.clone();
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), true);
    for i in 0..400 {
        let from = particles.id[i] as usize;
        assert_eq!([particles.position[i], particles.velocity[i]], [start.position[from]; 2]);
    }
    let step = |position: &[Vector<2>]| position.windows(2).map(|two| (two[1] - two[0]).norm()).sum::<f64>() / 400.0;
    assert!(step(&particles.position) < 3.0 * 0.05 && step(&start.position) > 6.0 * 0.05);
    particles.id.sort_unstable();
    assert_eq!(particles.id, start.id);
}

/// A unit of length 2^10 times as short gives the same neighbours, and volumes 2^20 times as large.
#[test]
fn the_unit_of_length_does_not_matter() {
    let [plain, scaled] = [1.0, 1024.0].map(|unit| {
        let mut value = common::settings_value::<2>(0.1 * unit, "periodic");
        value["domain"]["upper"] = vec![unit; 2].into();
        let settings = common::parse(&value);
        let points = common::lattice::<2>(10, 0.4).into_iter().map(|x| x * unit);
        let mut particles = common::particles(points.collect());
        let mut frame = Frame::default();
        frame.search(&settings, &mut particles, Travel::default(), true);
        let volumes = frame.stencil.volume.iter().map(|volume| volume / (unit * unit)).collect::<Vec<_>>();
        (particles.id[..particles.real].to_vec(), listed(&frame, &particles, settings.support_radius()), volumes)
    });
    assert_eq!(plain, scaled);
}

/// Pairs that come at each other at the largest speed, and then by nearly all of the skin, become neighbours from the farthest there is.
#[test]
fn what_comes_head_on_at_full_speed_is_found() {
    let mut value = common::settings_value::<2>(0.1, "none");
    value["derivative_frame"] = "updated".into();
    let settings = common::parse(&value);
    let (speed, beyond, radius) = (0.05, 0.0024, settings.support_radius());
    let first = common::lattice::<2>(15, 0.5).into_iter().map(|x| Vector::from([0.5 * x[0], x[1]]));
    let apart = Vector::from([radius + 2.0 * speed + 1.6 * beyond, 0.0]);
    let mut particles = common::particles(first.flat_map(|x| [x, x + apart]).collect());
    particles.velocity.iter_mut().enumerate().for_each(|(i, u)| u[0] = if i % 2 == 0 { speed } else { -speed });
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel { time_step: 1.0, velocity_max: speed, fraction: 0.0 }, true);
    for i in 0..particles.real {
        particles.position[i][0] += particles.velocity[i][0] * (1.0 + beyond / speed);
    }
    frame.update(&settings, &particles);
    assert_eq!(listed(&frame, &particles, radius), brute_force_neighbours(&particles.position, particles.real, radius));
}

#[test]
fn far_strays_cost_no_memory() {
    let mut points: Vec<Vector<2>> = (0..100).map(|i| Vector::from([0.01 * i as f64, 0.0])).collect();
    points.push(Vector::from([1e12, -1e15]));
    let settings = common::settings::<2>(0.1, "none");
    let mut particles = common::particles(points);
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), true);
    let radius = settings.support_radius();
    assert_eq!(listed(&frame, &particles, radius), brute_force_neighbours(&particles.position, particles.real, radius));
}

#[test]
fn a_frame_is_evaluated_again_once_a_particle_has_moved_by_more_than_its_tolerance() {
    for (search_every_iteration, moved, kept) in [(false, 0.9e-5, true), (false, 1.1e-5, false), (true, 0.9e-5, false)] {
        let mut value = common::settings_value::<2>(0.1, "periodic");
        (value["derivative_frame"], value["search_every_iteration"]) = ("updated".into(), search_every_iteration.into());
        let settings = common::parse(&value);
        let mut particles = common::particles(common::lattice::<2>(12, 0.3));
        let mut frame = Frame::default();
        frame.search(&settings, &mut particles, Travel { time_step: 1.0, velocity_max: 0.005, fraction: 0.0 }, true);
        let before = frame.stencil.position.clone();
        particles.position[7][0] += 0.1 * moved;
        frame.update(&settings, &particles);
        assert_eq!(frame.stencil.position == before, kept, "search {search_every_iteration}, moved {moved} spacings");
        assert!(kept || frame.stencil.position == particles.position);
    }
}
