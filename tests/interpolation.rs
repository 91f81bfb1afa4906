//! Values of the fluid between its particles.

use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use approx::assert_relative_eq;
use serde_json::{Value, json};

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
        (particles.pressure[i], particles.velocity[i]) = field(&particles.position[i]);
    }
    let solids: Vec<_> = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Solid).collect();
    let sampled = |scheme: Value, particles: &Particles<D>| {
        let settings = common::parse(&settings_with::<D>(scheme, spacing, "none"));
        Simulation::new(settings, particles.clone(), Clock::default(), Some(1)).expect("valid").sample(points)
    };
    // The velocity of solids says nothing of the fluid. With their pressure the fluid's goes on, of which the gradient knows.
    solids.iter().for_each(|&i| particles.velocity[i] = Vector::repeat(1e3));
    let followed = sampled(edac(), &particles);
    // Without a gradient it says nothing either.
    solids.iter().for_each(|&i| particles.pressure[i] = 1e3);
    let values = sampled(json!({"kind": "alsph"}), &particles);
    for (a, b) in values.iter().zip(&followed) {
        assert_eq!(a.1.map(f64::to_bits), b.1.map(f64::to_bits));
    }
    values.into_iter().chain(followed).collect()
}

/// A scheme whose pressure alternates next to walls.
fn edac() -> Value {
    json!({"kind": "edac", "sound_speed": 10, "diffusion_coefficient": 0.5})
}

fn settings_with<const D: usize>(scheme: Value, spacing: f64, boundary: &str) -> Value {
    let mut settings = common::settings_value::<D>(spacing, boundary);
    (settings["scheme"], settings["wall_pressure"]) = (scheme, "linear".into());
    settings
}

/// At points of the unit box, those outside moved onto its sides, or so much inside of them.
fn fields_are_exact<const D: usize>(field: Field<D>, side: usize, inside: f64) {
    let mut particles = common::particles(common::lattice::<D>(side, 0.3));
    particles.kind.iter_mut().step_by(5).for_each(|kind| *kind = ParticleKind::Solid);
    let points: Vec<_> =
        common::lattice::<D>(5, 0.9).into_iter().map(|x| x.map(|x| x.clamp(inside, 1.0 - inside))).collect();
    for (point, (p, u)) in points.iter().cycle().zip(sampled(field, 1.0 / side as f64, particles, &points)) {
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

/// Next to a wall p may err from layer to layer, by what its gradient sees little of: at the surface a sample makes less of that than a fit
/// of the values alone, as the velocity has it.
#[test]
fn waves_from_layer_to_layer_are_read_less() {
    let (side, wave) = (20, [0.07, -0.09, 0.03]);
    let spacing = 1.0 / side as f64;
    for disorder in [0.0, 0.1, 0.2] {
        let mut particles = common::particles(common::lattice::<2>(side, 0.0));
        let disturbed = common::lattice::<2>(side, disorder);
        for i in 0..particles.real {
            let layer = (particles.position[i][1] / spacing).floor() as usize;
            let x = std::mem::replace(&mut particles.position[i], disturbed[i]);
            particles.kind[i] = if layer < 4 { ParticleKind::Solid } else { ParticleKind::Fluid };
            let wave = layer.checked_sub(4).and_then(|k| wave.get(k)).unwrap_or(&0.0);
            particles.pressure[i] = quadratic(&disturbed[i]).0 + wave;
            particles.velocity[i] = Vector::from([quadratic(&disturbed[i]).0 + wave, x[0]]);
        }
        let settings = common::parse(&settings_with::<2>(edac(), spacing, "none"));
        let mut simulation = Simulation::new(settings, particles, Clock::default(), Some(2)).expect("valid");
        let points: Vec<_> = (0..9).map(|k| Vector::from([0.3 + 0.05 * k as f64, 4.0 * spacing])).collect();
        let values = simulation.sample(&points);
        let rms = |value: fn(&(f64, Vector<2>)) -> f64| {
            let errors = points.iter().zip(&values).map(|(x, sample)| value(sample) - quadratic(x).0);
            (errors.map(|error| error * error).sum::<f64>() / points.len() as f64).sqrt()
        };
        let (with_gradient, alone) = (rms(|(p, _)| *p), rms(|(_, u)| u[0]));
        assert!(with_gradient < 0.7 * alone, "{with_gradient} of {alone}, disorder {disorder}");
    }
}

/// Next to slip walls and periodic sides samples are those of a box with all of its images in place, of whatever pressure.
#[test]
fn samples_at_a_side_are_those_with_its_images_in_place() {
    fn at_sides<const D: usize>(boundary: &str, side: usize) {
        let sign = if boundary == "slip" { -1.0 } else { 1.0 };
        let noise = |x: &Vector<D>| x.iter().enumerate().map(|(k, x)| (7e3 * x + k as f64).sin()).product::<f64>();
        let mut own = common::particles(common::lattice::<D>(side, 0.2));
        for i in 0..own.real {
            let x = own.position[i];
            (own.pressure[i], own.velocity[i]) = (noise(&x), x.map(|x| (5e3 * x).cos()));
        }
        let (mut points, mut values) = (Vec::new(), Vec::new());
        for tile in 0..3usize.pow(D as u32) {
            let shift = Vector::<D>::from_fn(|k, _| (tile / 3usize.pow(k as u32) % 3) as f64 - 1.0);
            for i in 0..own.real {
                let place = |x: f64, shift: f64| match boundary {
                    "slip" if shift != 0.0 => 1.0 + shift - x,
                    _ => x + shift,
                };
                points.push(own.position[i].zip_map(&shift, place));
                values.push((
                    own.pressure[i],
                    own.velocity[i].zip_map(&shift, |u, shift| if shift == 0.0 { u } else { u * sign }),
                ));
            }
        }
        let mut all = common::particles(points);
        (all.pressure, all.velocity) = values.into_iter().unzip();
        let around: Vec<_> = (0..D)
            .flat_map(|axis| {
                [0.0, 0.03, 0.06, 0.95]
                    .map(|at| Vector::<D>::from_fn(|k, _| if k == axis { at } else { 0.02 + 0.4 * k as f64 }))
            })
            .collect();
        let sampled = |boundary: &str, reach: f64, particles: Particles<D>| {
            let mut value = settings_with::<D>(edac(), 1.0 / side as f64, boundary);
            (value["domain"]["lower"], value["domain"]["upper"]) = (json!(vec![-reach; D]), json!(vec![1.0 + reach; D]));
            let settings = common::parse(&value);
            Simulation::new(settings, particles, Clock::default(), Some(2)).expect("valid").sample(&around)
        };
        for ((p, u), (q, v)) in sampled(boundary, 0.0, own).into_iter().zip(sampled("none", 1.0, all)) {
            assert_relative_eq!(p, q, epsilon = 1e-5, max_relative = 1e-5);
            assert_relative_eq!(u, v, epsilon = 1e-9, max_relative = 1e-9);
        }
    }
    for boundary in ["slip", "periodic"] {
        at_sides::<2>(boundary, 14);
        at_sides::<3>(boundary, 9);
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
    let edac = edac();
    for (boundary, scheme, expected) in
        [("none", &alsph, 0.3), ("periodic", &alsph, 0.3), ("slip", &isph, 0.3), ("none", &edac, 0.0)]
    {
        let settings = settings_with::<2>(scheme.clone(), 1.0 / side as f64, boundary);
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
    // One particle that is told of up to 0.15: all that is known are its own values.
    let lone = Vector::from([0.5, 0.5]);
    let points = [[0.5, 0.5], [0.5, 0.649], [0.5, 0.651], [f64::NAN, 0.5], [0.5, f64::INFINITY]].map(Vector::from);
    let values = sampled(linear, 0.1, common::particles(vec![lone]), &points);
    for (p, u) in values.chunks(points.len()).flat_map(|values| &values[..2]) {
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
    assert_eq!(known.collect::<Vec<_>>(), [true, true, false, false, false].repeat(2));
}
