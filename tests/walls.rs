//! What solid particles show to the viscous term, and its fourth order.

use alsph::boundary::{Walls, surface_area};
use alsph::discretisation::LaplacianAndGradient;
use alsph::loads::{Load, loads};
use alsph::motion::Motion;
use alsph::settings::WallVelocity;
use alsph::{ParticleKind, Vector};
use approx::assert_relative_eq;
use common::set::Set;
use std::f64::consts::PI;

mod common;

const WALL_VELOCITY: f64 = 0.3;

/// A cubic over a height [Δx].
fn cubic(n: f64) -> f64 {
    2.0 * n - 0.3 * n * n + 0.02 * n * n * n
}

/// The direction of the fluid's velocity.
fn along<const D: usize>() -> Vector<D> {
    Vector::from_fn(|k, _| if k == 0 { 1.0 } else { -0.5 })
}

/// Of a direction, what is along a wall with that normal.
fn tangential<const D: usize>(direction: Vector<D>, normal: &Vector<D>) -> Vector<D> {
    direction - normal * direction.dot(normal)
}

/// Disordered particles in the unit box, solid where the height that `surface` gives with the normal is negative, the fluid with the
/// cubic's velocity in the direction that `direction` gives for the normal. Returns for solid particles less than Δx deep away from
/// the box's sides their depth [Δx] and what they show beyond their own velocity, and the load on them.
fn shown<const D: usize>(
    side: usize,
    surface: impl Fn(&Vector<D>) -> (f64, Vector<D>),
    direction: impl Fn(&Vector<D>) -> Vector<D>,
) -> (Vec<(f64, Vector<D>)>, Load<D>) {
    let spacing = 1.0 / side as f64;
    let mut value = common::settings_value::<D>(spacing, "none");
    value["wall_velocity"] = "cubic".into();
    let settings = common::parse(&value);
    let mut particles = common::particles(common::lattice::<D>(side, 0.2));
    for i in 0..particles.real {
        let (height, normal) = surface(&particles.position[i]);
        if height > 0.0 {
            particles.velocity[i] = Vector::repeat(WALL_VELOCITY) + direction(&normal) * cubic(height / spacing);
        } else {
            (particles.kind[i], particles.normal[i], particles.depth[i]) = (ParticleKind::Solid, normal, -height);
            particles.velocity[i] = Vector::repeat(WALL_VELOCITY);
        }
    }
    let set = Set::of(particles, &settings, true);
    let mut walls = Walls::new(&settings);
    walls.see(&settings, &set.particles, &set.frame);
    let margin = 2.0 * settings.support_radius();
    let inside = |x: &Vector<D>| x.iter().all(|&x| x > margin && x < 1.0 - margin);
    let near = |i: &usize| set.particles.kind[*i] == ParticleKind::Solid && set.particles.depth[*i] < spacing;
    let solids = (0..set.particles.real).filter(near).filter(|&i| inside(&set.particles.position[i]));
    let seen = |i: usize| walls.viscous_velocity[i].add_scalar(-WALL_VELOCITY);
    let shown: Vec<_> = solids.map(|i| (set.particles.depth[i] / spacing, seen(i))).collect();
    assert!(shown.len() > 20);
    (shown, loads(&settings, &set.particles, &set.frame, &walls, &Motion::default(), |_| Vector::zeros())[0])
}

/// A cubic profile goes on into the solid particles, in 2-D and 3-D, over a plane and over a cylinder. An odd mirror image would
/// be 15 to 30 % off.
#[test]
fn solids_show_the_cubic_of_the_fluid_above() {
    let (plane, _) = shown::<2>(40, |x| (x[1] - 0.5, Vector::y()), |_| along());
    let plane = plane.into_iter().map(|(depth, u)| (depth, u[0], u[1]));
    let (upright, _) = shown::<3>(24, |x| (x[2] - 0.5, Vector::z()), |_| along());
    let upright = upright.into_iter().map(|(depth, u)| (depth, u[0], u[2]));
    for (depth, along, across) in plane.chain(upright) {
        assert_relative_eq!(along, cubic(-depth), max_relative = 0.06);
        assert_relative_eq!(across, -0.5 * cubic(-depth), max_relative = 0.06);
    }
    let centre = Vector::from([0.5, 0.5]);
    let cylinder = |x: &Vector<2>| ((x - centre).norm() - 0.2, (x - centre).normalize());
    let (around, load) = shown(60, cylinder, |_| along());
    for (depth, u) in around {
        assert_relative_eq!(u[0], cubic(-depth), max_relative = 0.08);
    }
    // The friction is that of the slope along the surface, 2 per Δx all around, half of which is in the direction of `along`.
    let friction = 0.01 * 2.0 * 60.0 * (PI * 0.2);
    let check = |load: &Load<2>| {
        assert_relative_eq!(load.viscous_force[0], friction, max_relative = 0.03);
        assert_relative_eq!(load.viscous_force[1], -0.5 * friction, max_relative = 0.03);
    };
    check(&load);
    let (_, load) = shown(60, cylinder, |normal| tangential(along(), normal));
    // There is no pressure, and what the pairs exchange beyond the friction is small.
    check(&load);
    assert!(load.pressure_force.norm() < 0.15 * friction, "{}", load.pressure_force);
}

/// A single layer of fluid tells no more than the line through it and the surface.
#[test]
fn over_a_single_layer_the_profile_is_a_line() {
    let spacing = 0.05;
    let mut value = common::settings_value::<2>(spacing, "periodic");
    value["wall_velocity"] = "cubic".into();
    let settings = common::parse(&value);
    let [wall, fluid] = [Vector::from([0.2, 0.1]), Vector::from([1.0, -0.3])];
    let cells = (0..100).map(|k| Vector::from([(k % 20) as f64, (k / 20) as f64]).add_scalar(0.5) * spacing);
    let mut particles = common::particles(cells.collect());
    particles.velocity[80..].fill(wall + fluid);
    for i in 0..80 {
        (particles.kind[i], particles.velocity[i], particles.normal[i]) = (ParticleKind::Solid, wall, Vector::y());
        particles.depth[i] = 4.0 * spacing - particles.position[i][1];
    }
    let Set { particles, frame } = Set::of(particles, &settings, false);
    let mut walls = Walls::new(&settings);
    walls.see(&settings, &particles, &frame);
    let slope = fluid / (0.5 * spacing);
    for i in 40..80 {
        assert_relative_eq!(walls.slope[i].expect("there is fluid above"), slope, max_relative = 1e-3);
        assert_relative_eq!(walls.viscous_velocity[i], wall - slope * particles.depth[i], epsilon = 1e-3);
    }
}

/// By the rule of Morris, Fox and Zhu a solid shows each fluid particle the line through that particle and the surface, but not beyond
/// half of what the particle has; and other solids its own velocity.
#[test]
fn morris_shows_the_line_through_each_particle_and_the_surface() {
    let mut settings = common::settings::<2>(0.1, "none");
    settings.wall_velocity = WallVelocity::Morris;
    let (wall, slope, normal) = (Vector::from([0.3, -0.1]), Vector::from([2.0, 0.5]), Vector::from([0.6, 0.8]));
    let along = Vector::from([0.8, -0.6]);
    for (depth, height, shown) in [(0.1, 0.25, -0.1), (0.1, 0.2, -0.1), (0.1, 0.15, -0.075), (0.15, 0.02, -0.01)] {
        let mut particles = common::particles(vec![-normal * depth, along * 0.1 + normal * height, along * 0.2]);
        for solid in [0, 2] {
            particles.kind[solid] = ParticleKind::Solid;
            (particles.velocity[solid], particles.normal[solid]) = (wall, normal);
        }
        (particles.depth[0], particles.velocity[1]) = (depth, wall + slope * height);
        let walls = Walls::new(&settings);
        assert_relative_eq!(walls.seen_by(&particles, 0, 1), wall + slope * shown, epsilon = 1e-12);
        assert_eq!(walls.seen_by(&particles, 0, 2), wall);
    }
}

/// What makes the viscous term of fourth order goes on into the solids as a line, and deep in them there is none.
#[test]
fn solids_show_the_line_of_the_fluids_laplacian() {
    let settings = common::settings::<2>(1.0 / 30.0, "none");
    let height = |x: &Vector<2>| x[1] - 0.5;
    let line = |height: f64| Vector::from([1.0 + 3.0 * height, -2.0 * height]);
    let mut particles = common::particles(common::lattice::<2>(30, 0.2));
    for i in 0..particles.real {
        let height = height(&particles.position[i]);
        if height < 0.0 {
            (particles.kind[i], particles.normal[i], particles.depth[i]) = (ParticleKind::Solid, Vector::y(), -height);
        }
    }
    let Set { particles, frame } = Set::of(particles, &settings, true);
    let mut walls = Walls::new(&settings);
    walls.sharpen(&settings, &particles, &frame, |i| line(height(&particles.position[i])) * 2.0, 0.5);
    let inside = |x: &Vector<2>| (x[0] - 0.5).abs() < 0.5 - settings.support_radius();
    let mut solids = 0;
    for (i, x) in particles.position.iter().enumerate().filter(|(_, x)| inside(x)) {
        if height(x) > -1.0 / 30.0 {
            assert_relative_eq!(walls.dispersion[i], line(height(x)), epsilon = 1e-3);
            solids += usize::from(height(x) < 0.0);
        }
        if height(x) < -1.5 * settings.support_radius() {
            assert_eq!(walls.dispersion[i], Vector::<2>::zeros());
        }
    }
    assert!(solids > 15);
}

/// The solids of a cylinder stand for its surface, whatever the fluid does and however many layers there are.
#[test]
fn solids_stand_for_the_area_of_the_surface() {
    for (side, layers) in [(40, 1), (40, 4), (80, 4)] {
        let settings = common::settings::<2>(1.0 / side as f64, "none");
        let mut particles = common::cylinder(side, layers);
        for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid) {
            particles.normal[i] = (particles.position[i].add_scalar(-0.5)).normalize();
            particles.depth[i] = -common::distance(&particles.position[i]);
        }
        let Set { particles, frame } = Set::of(particles, &settings, true);
        let solids = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid);
        let area: f64 = solids.map(|s| surface_area(&settings, &particles, &frame.stencil, s)).sum();
        assert_relative_eq!(area, 2.0 * PI * common::RADIUS, max_relative = 0.005);
    }
}

/// Relative error of the viscous term of a wave `length` Δx long.
fn error_of_wave(length: usize, fourth_order: bool) -> f64 {
    let settings = common::settings::<2>(1.0 / length as f64, "periodic");
    let set = Set::<2>::of(common::particles(common::lattice::<2>(length, 0.0)), &settings, true);
    let velocity = set.field(|x| Vector::from([(2.0 * PI * x[1]).sin(), 0.0]));
    let laplacian_of = |velocity: &[Vector<2>]| -> Vec<_> {
        let seen = |s: usize, _: usize| velocity[s];
        set.apply(LaplacianAndGradient { velocity, seen }).into_iter().map(|(laplacian, _)| laplacian).collect()
    };
    let mut laplacian = laplacian_of(&velocity);
    if fourth_order {
        let factor = settings.laplacian_dispersion() * settings.particle_spacing.powi(2);
        let mut walls = Walls::new(&settings);
        walls.sharpen(&settings, &set.particles, &set.frame, |i| laplacian[i], factor);
        let correction = laplacian_of(&walls.dispersion);
        laplacian.iter_mut().zip(correction).for_each(|(laplacian, correction)| *laplacian -= correction);
    }
    let exact = |i: usize| -4.0 * PI * PI * velocity[i][0];
    let error = |i: usize| (laplacian[i][0] - exact(i)).abs() / (4.0 * PI * PI);
    (0..set.particles.real).map(error).fold(0.0, f64::max)
}

#[test]
fn the_viscous_term_is_of_second_or_fourth_order() {
    let order = |fourth| (error_of_wave(12, fourth) / error_of_wave(24, fourth)).log2();
    assert_relative_eq!(order(false), 2.0, epsilon = 0.1);
    assert!(order(true) > 3.5, "{}", order(true));
    assert!(error_of_wave(12, true) < 0.2 * error_of_wave(12, false));
}
