//! Values of the fluid between its particles.

use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use approx::assert_relative_eq;
use serde_json::json;

mod common;

type Field<const D: usize> = fn(&Vector<D>) -> (f64, Vector<D>);

/// p and u of linear fields.
fn linear<const D: usize>(x: &Vector<D>) -> (f64, Vector<D>) {
    let slope = Vector::<D>::from_fn(|k, _| [0.7, -1.1, 0.4][k]);
    (0.3 + slope.dot(x), Vector::from_fn(|k, _| 0.2 - slope[k] * x[(k + 1) % D]))
}

/// Those of quadratic fields.
fn quadratic<const D: usize>(x: &Vector<D>) -> (f64, Vector<D>) {
    let (p, u) = linear(x);
    (p - 2.0 * x[0] * x[1] + x[D - 1].powi(2), Vector::from_fn(|k, _| u[k] * x[0] + x[k].powi(2)))
}

fn sampled<const D: usize>(
    field: Field<D>,
    spacing: f64,
    mut particles: Particles<D>,
    points: &[Vector<D>],
) -> Vec<(f64, Vector<D>)> {
    for i in 0..particles.real {
        let (p, u) = field(&particles.position[i]);
        // What solids have says nothing of the fluid.
        let fluid = particles.kind[i] == ParticleKind::Fluid;
        (particles.pressure[i], particles.velocity[i]) = if fluid { (p, u) } else { (1e3, Vector::repeat(1e3)) };
    }
    let settings = common::settings::<D>(spacing, "none");
    let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(1)).expect("valid");
    simulation.sample(points)
}

/// At points of the unit box, those outside moved onto its sides, or so much inside of them.
fn fields_are_exact<const D: usize>(field: Field<D>, side: usize, inside: f64) {
    let mut particles = common::particles(common::lattice::<D>(side, 0.3));
    particles.kind.iter_mut().step_by(5).for_each(|kind| *kind = ParticleKind::Solid);
    let points: Vec<_> =
        common::lattice::<D>(5, 0.9).into_iter().map(|x| x.map(|x| x.clamp(inside, 1.0 - inside))).collect();
    for (point, (p, u)) in points.iter().zip(sampled(field, 1.0 / side as f64, particles, &points)) {
        let exact = field(point);
        assert_relative_eq!(p, exact.0, epsilon = 1e-10);
        assert_relative_eq!(u, exact.1, epsilon = 1e-10);
    }
}

#[test]
fn linear_and_quadratic_fields_are_sampled_exactly() {
    fields_are_exact::<2>(linear, 14, 0.0);
    fields_are_exact::<3>(linear, 8, 0.0);
    fields_are_exact::<2>(quadratic, 14, 0.0);
    // In a corner of a box it makes too much of noise.
    fields_are_exact::<3>(quadratic, 8, 0.1);
}

/// Values that scatter, as those of a pressure do, scatter no more than eight times as much where they are sampled, far outside too.
#[test]
fn sampling_makes_little_of_noise() {
    let noise: Field<2> = |x| ((1e4 * x[0]).sin() * (1.7e4 * x[1]).cos(), Vector::zeros());
    let points: Vec<_> = (0..40).map(|k| Vector::from([0.37, 1.25 - 0.02 * k as f64])).collect();
    for disorder in [0.0, 0.3] {
        let values = sampled(noise, 1.0 / 14.0, common::particles(common::lattice::<2>(14, disorder)), &points);
        assert!(values.iter().all(|(p, _)| p.is_nan() || p.abs() < 8.0), "{values:?}");
    }
}

/// What pushes beside the pressure counts by its mean: a constant as it is, what alternates from particle to particle not at all, and nothing where
/// the scheme has none.
#[test]
fn the_pressure_that_acts_is_smooth() {
    let side = 14;
    let mut particles = common::particles(common::lattice::<2>(side, 0.0));
    particles.unkept_pressure =
        particles.position.iter().map(|x| 0.3 + (x.sum() * side as f64).round().rem_euclid(2.0) * 2.0 - 1.0).collect();
    let points = [[0.5, 0.5], [0.53, 0.31], [0.7, 0.62]].map(Vector::from);
    let alsph = json!({"kind": "alsph"});
    let isph =
        json!({"kind": "isph", "pressure_share": 0.9, "solver": "bicgstab", "tolerance": 1e-6, "max_solver_iterations": 9});
    let edac = json!({"kind": "edac", "sound_speed": 10, "diffusion_coefficient": 0.5});
    for (boundary, scheme, expected) in
        [("none", &alsph, 0.3), ("periodic", &alsph, 0.3), ("slip", &isph, 0.3), ("none", &edac, 0.0)]
    {
        let mut settings = common::settings_value::<2>(1.0 / side as f64, boundary);
        (settings["scheme"], settings["wall_pressure"]) = (scheme.clone(), "linear".into());
        let mut particles = particles.clone();
        (0..particles.real).for_each(|i| particles.pressure[i] = linear(&particles.position[i]).0);
        let settings = common::parse(&settings);
        let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(2)).expect("valid");
        for (point, (p, _)) in points.iter().zip(simulation.sample(&points)) {
            assert_relative_eq!(p, linear(point).0 + expected, epsilon = 0.01);
        }
        let snapshot = simulation.snapshot();
        let particles = simulation.particles();
        assert_eq!(snapshot.pressure.len(), particles.real);
        let inside = |i: &usize| particles.position[*i].iter().all(|x| (0.3..0.7).contains(x));
        for i in (0..particles.real).filter(inside) {
            assert_relative_eq!(snapshot.pressure[i], particles.pressure[i] + expected, epsilon = 0.01);
        }
    }
}

#[test]
fn where_no_fluid_is_near_there_is_no_value() {
    // One particle with a support radius of 0.4: all that is known are its own values.
    let lone = Vector::from([0.5, 0.5]);
    let points = [[0.5, 0.5], [0.5, 0.89], [0.5, 0.91], [f64::NAN, 0.5], [0.5, f64::INFINITY]].map(Vector::from);
    let values = sampled(linear, 0.1, common::particles(vec![lone]), &points);
    for (p, u) in &values[..2] {
        assert_relative_eq!(*p, linear(&lone).0, epsilon = 1e-12);
        assert_relative_eq!(*u, linear(&lone).1, epsilon = 1e-12);
    }
    // Of a row of particles, how the values change along it.
    let row = (0..9).map(|k| Vector::from([0.1 * k as f64 + 0.05, 0.5])).collect();
    for (p, u) in sampled(linear, 0.1, common::particles(row), &[Vector::from([0.42, 0.6])]) {
        let exact = linear(&Vector::from([0.42, 0.5]));
        assert_relative_eq!(p, exact.0, epsilon = 1e-12);
        assert_relative_eq!(u, exact.1, epsilon = 1e-12);
    }
    // Of a few, what is linear.
    let few: Vec<_> = [[0.53, 0.51], [0.48, 0.54], [0.51, 0.45], [0.46, 0.47], [0.55, 0.56]].map(Vector::from).to_vec();
    for count in [3, 4, 5] {
        let point = Vector::from([0.5, 0.5]);
        let exact = linear(&point);
        for (p, u) in sampled(linear, 0.1, common::particles(few[..count].to_vec()), &[point]) {
            assert_relative_eq!(p, exact.0, epsilon = 1e-10);
            assert_relative_eq!(u, exact.1, epsilon = 1e-10);
        }
    }
    let known = values.iter().map(|(p, u)| p.is_finite() && u.iter().all(|u| u.is_finite()));
    assert_eq!(known.collect::<Vec<_>>(), [true, true, false, false, false]);
}
