//! Values of the fluid between its particles.

use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use approx::assert_relative_eq;

mod common;

/// p and u of linear fields.
fn linear<const D: usize>(x: &Vector<D>) -> (f64, Vector<D>) {
    let slope = Vector::<D>::from_fn(|k, _| [0.7, -1.1, 0.4][k]);
    (0.3 + slope.dot(x), Vector::from_fn(|k, _| 0.2 - slope[k] * x[(k + 1) % D]))
}

fn sampled<const D: usize>(spacing: f64, mut particles: Particles<D>, points: &[Vector<D>]) -> Vec<(f64, Vector<D>)> {
    for i in 0..particles.real {
        let (p, u) = linear(&particles.position[i]);
        // What solids have says nothing of the fluid.
        let fluid = particles.kind[i] == ParticleKind::Fluid;
        (particles.pressure[i], particles.velocity[i]) = if fluid { (p, u) } else { (1e3, Vector::repeat(1e3)) };
    }
    let settings = common::settings::<D>(spacing, "none");
    let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(1)).expect("valid");
    simulation.sample(points)
}

fn linear_fields_are_exact<const D: usize>(side: usize) {
    let mut particles = common::particles(common::lattice::<D>(side, 0.3));
    particles.kind.iter_mut().step_by(5).for_each(|kind| *kind = ParticleKind::Solid);
    // At the sides of the box, too.
    let points: Vec<_> = common::lattice::<D>(5, 0.9).into_iter().map(|x| x.map(|x| x.clamp(0.0, 1.0))).collect();
    for (point, (p, u)) in points.iter().zip(sampled(1.0 / side as f64, particles, &points)) {
        let exact = linear(point);
        assert_relative_eq!(p, exact.0, epsilon = 1e-10);
        assert_relative_eq!(u, exact.1, epsilon = 1e-10);
    }
}

#[test]
fn linear_fields_are_sampled_exactly() {
    linear_fields_are_exact::<2>(14);
    linear_fields_are_exact::<3>(8);
}

#[test]
fn where_no_fluid_is_near_there_is_no_value() {
    // One particle with a support radius of 0.4: all that is known are its own values.
    let lone = Vector::from([0.5, 0.5]);
    let points = [[0.5, 0.5], [0.5, 0.89], [0.5, 0.91], [f64::NAN, 0.5], [0.5, f64::INFINITY]].map(Vector::from);
    let values = sampled(0.1, common::particles(vec![lone]), &points);
    for (p, u) in &values[..2] {
        assert_relative_eq!(*p, linear(&lone).0, epsilon = 1e-12);
        assert_relative_eq!(*u, linear(&lone).1, epsilon = 1e-12);
    }
    // Of a row of particles, how the values change along it.
    let row = (0..9).map(|k| Vector::from([0.1 * k as f64 + 0.05, 0.5])).collect();
    for (p, u) in sampled(0.1, common::particles(row), &[Vector::from([0.42, 0.6])]) {
        let exact = linear(&Vector::from([0.42, 0.5]));
        assert_relative_eq!(p, exact.0, epsilon = 1e-12);
        assert_relative_eq!(u, exact.1, epsilon = 1e-12);
    }
    let known = values.iter().map(|(p, u)| p.is_finite() && u.iter().all(|u| u.is_finite()));
    assert_eq!(known.collect::<Vec<_>>(), [true, true, false, false, false]);
}
