//! How far particles are displaced: the velocity scales of (18), and its limit.

use std::f64::consts::TAU;

use alsph::boundary::Walls;
use alsph::kernel::{QuinticSpline, Smoothing};
use alsph::particles::{ParticleKind, Particles};
use alsph::settings::Shifting;
use alsph::shifting::shift;
use alsph::{Matrix, Settings, Vector};
use approx::assert_relative_eq;
use common::set::Set;

mod common;

const SIDE: usize = 14;
const VELOCITY_MAX: f64 = 1.7;

/// The shift of each particle of a disordered box of vortices, and of one that is alone.
fn shifts(settings: &Settings, time_step: f64) -> (Set<2>, Vec<Vector<2>>) {
    shifts_beside(settings, time_step, 0.0)
}

/// The same beside a body that takes the box up to x = `wall`.
fn shifts_beside(settings: &Settings, time_step: f64, wall: f64) -> (Set<2>, Vec<Vector<2>>) {
    let mut points = common::lattice::<2>(SIDE, 0.3);
    points.push(Vector::from([9.0, 9.0]));
    let mut particles = common::particles(points);
    for i in (0..particles.real).filter(|&i| particles.position[i][0] < wall) {
        particles.kind[i] = ParticleKind::Solid;
    }
    let mut set = Set::of(particles, settings, false);
    for i in 0..set.particles.real {
        let [x, y] = (TAU * set.particles.position[i]).into();
        let vortices = [x.sin() * y.cos(), -x.cos() * y.sin()];
        set.particles.velocity[i] =
            Vector::from(vortices) + 0.1 * Vector::from([(3.0 * i as f64).sin(), (2.0 * i as f64).cos()]);
    }
    let mut walls = Walls::new(settings);
    walls.viscous_velocity = set.particles.velocity.clone();
    let mut after = set.particles.clone();
    shift(settings, &mut after, &set.frame, &walls, time_step, VELOCITY_MAX, &mut Vec::new());
    let shifts = (0..after.real).map(|i| after.position[i] - set.particles.position[i]).collect();
    (set, shifts)
}

#[test]
fn the_shift_goes_with_the_xsph_velocity_the_strain_or_the_largest_velocity() {
    let mut settings = common::settings::<2>(1.0 / SIDE as f64, "none");
    let kernel = Smoothing::new(QuinticSpline, settings.smoothing_length(), 2);
    let time_step = 1e-4;
    let mut strained = 0;
    for shifting in [Shifting::Xsph, Shifting::Strain, Shifting::MaximumVelocity] {
        settings.shifting = shifting;
        let (set, shifts) = shifts(&settings, time_step);
        for i in 0..SIDE * SIDE {
            let (mut asymmetry, mut distances, mut count) = (Vector::<2>::zeros(), 0.0, 0.0);
            let (mut relative, mut squares, mut total) = (Vector::<2>::zeros(), 0.0, kernel.value(0.0));
            let (mut differences, mut moments) = (Matrix::<2>::zeros(), Matrix::<2>::zeros());
            for j in (0..SIDE * SIDE).filter(|&j| j != i) {
                let r_ij = set.particles.position[i] - set.particles.position[j];
                if r_ij.norm() < settings.support_radius() {
                    asymmetry += r_ij / r_ij.norm().powi(3);
                    (distances, count) = (distances + r_ij.norm(), count + 1.0);
                    let u_ij = set.particles.velocity[i] - set.particles.velocity[j];
                    let weight = kernel.value(r_ij.norm());
                    relative += weight * u_ij;
                    squares += weight * u_ij.norm_squared();
                    total += weight;
                    let slope = set.frame.stencil.volume[j] * kernel.slope(r_ij.norm());
                    differences += slope * u_ij * r_ij.transpose();
                    moments += slope * r_ij * r_ij.transpose();
                }
            }
            let mean: f64 = distances / count;
            let gradient = differences * moments.try_inverse().unwrap();
            let strain = settings.smoothing_length() * (0.5 * (gradient * gradient).trace()).max(0.0).sqrt();
            let mixing = f64::sqrt(squares / total) / 3.0;
            strained += usize::from(shifting == Shifting::Strain && strain > mixing);
            let speed = match shifting {
                Shifting::Xsph => relative.norm() / total,
                Shifting::Strain => settings.shift_coefficient * strain.max(mixing),
                _ => settings.shift_coefficient * VELOCITY_MAX,
            };
            let expected = asymmetry * (mean * mean * speed * time_step);
            assert_relative_eq!(shifts[i], expected, epsilon = 1e-5 * expected.norm());
        }
        assert_eq!(shifts[SIDE * SIDE], Vector::<2>::zeros());
    }
    assert!(strained > SIDE && strained < SIDE * SIDE - SIDE, "{strained}");
}

#[test]
fn no_shift_is_longer_than_its_limit() {
    for shifting in [Shifting::Strain, Shifting::Xsph, Shifting::MaximumVelocity] {
        let mut settings = common::settings::<2>(1.0 / SIDE as f64, "none");
        settings.shifting = shifting;
        let limit = settings.shift_limit / SIDE as f64;
        let (_, free) = shifts(&settings, 1e-4);
        let (_, limited) = shifts(&settings, 1.0);
        let mut ends = 0;
        for (free, limited) in free.iter().zip(&limited) {
            let long = free * 1e4;
            let expected = if long.norm() > limit { long * (limit / long.norm()) } else { long };
            assert_relative_eq!(*limited, expected, epsilon = 1e-9 * limit);
            ends += usize::from(long.norm() > limit);
        }
        assert!(ends > SIDE * SIDE / 2);
    }
    let mut settings = common::settings::<2>(1.0 / SIDE as f64, "none");
    settings.shifting = Shifting::None;
    assert!(shifts(&settings, 1.0).1.iter().all(|shift| *shift == Vector::<2>::zeros()));
}

/// Next to a body the limit is the way that the fastest particle goes in the step, if that is more.
#[test]
fn what_touches_a_body_may_be_shifted_by_the_way_of_the_fastest() {
    let (spacing, wall) = (1.0 / SIDE as f64, 0.3);
    let settings = common::settings::<2>(spacing, "none");
    for way in [0.05 * spacing, 0.4 * spacing] {
        let time_step = way / VELOCITY_MAX;
        let (_, free) = shifts_beside(&settings, 1e-4, wall);
        let (set, limited) = shifts_beside(&settings, time_step, wall);
        let Particles { position, kind, .. } = &set.particles;
        let (mut held, mut longer) = (0, 0);
        for i in (0..set.particles.real).filter(|&i| kind[i] == ParticleKind::Fluid) {
            let solids = (0..set.particles.real).filter(|&s| kind[s] == ParticleKind::Solid);
            let nearest = solids.map(|s| (position[i] - position[s]).norm() / spacing).fold(9.0, f64::min);
            let touches = (2.5 - 2.0 * nearest).clamp(0.0, 1.0);
            let limit = (0.1 + touches * (way / spacing - 0.1).max(0.0)) * spacing;
            let long = free[i] * (time_step / 1e-4);
            let expected = if long.norm() > limit { long * (limit / long.norm()) } else { long };
            assert_relative_eq!(limited[i], expected, epsilon = 1e-9 * spacing);
            held += usize::from(touches == 0.0 && long.norm() > limit);
            longer += usize::from(expected.norm() > 0.11 * spacing);
        }
        assert!(way < 0.1 * spacing || (held > 0 && longer > 2), "{held} {longer}");
    }
}
