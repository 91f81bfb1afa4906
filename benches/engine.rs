//! Cost of each stage on perturbed periodic lattices, per directed pair (stages) and per particle (whole step).
//!
//! `cargo bench` prints the throughput in elements a second: pairs for search, stencil and operators, particles for a step.

use alsph::frame::Frame;
use alsph::lanes::LANES;
use alsph::operators::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndDivergence, VelocityGradient};
use alsph::settings::Settings;
use alsph::{Clock, Matrix, ParticleKind, Particles, Simulation, Vector};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;

/// Particles a side of the two lattices.
const SIDES: [usize; 2] = [141, 447];

fn settings(side: usize, derivative_frame: &str) -> Settings {
    let spacing = 1.0 / side as f64;
    Settings::from_json(&format!(
        r#"{{"dimensions": 2, "particle_spacing": {spacing}, "smoothing_ratio": 1.3333333333333333, "kernel": "quintic_spline",
            "density": 1.0, "kinematic_viscosity": 0.01, "body_force": [0, 0], "time_step": {time_step},
            "adaptive_time_step": true, "time_step_safety": 0.9, "derivative_frame": "{derivative_frame}",
            "search_every_iteration": false, "max_iterations": 5, "divergence_tolerance": 1e-12, "penalty_constant": 100,
            "velocity_laplacian": "scalar", "shifting": "xsph", "shift_coefficient": 0.04, "shift_limit": 0.1,
            "wall_velocity": "adami", "wall_pressure": "paper",
            "domain": {{"lower": [0, 0], "upper": [1, 1], "boundaries": [["periodic", "periodic"], ["periodic", "periodic"]]}},
            "bodies": []}}"#,
        time_step = 0.05 * spacing
    ))
    .expect("the settings of the bench are valid")
}

/// A Taylor-Green vortex on a lattice displaced by up to 0.2 Δx, reproducibly.
fn particles(side: usize) -> Particles<2> {
    let spacing = 1.0 / side as f64;
    let count = side * side;
    let mut seed = 1u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / (1u64 << 31) as f64 - 0.5
    };
    let position: Vec<Vector<2>> = (0..count)
        .map(|i| Vector::from([(i % side) as f64, (i / side) as f64].map(|x| (x + 0.5 + 0.4 * random()) * spacing)))
        .collect();
    let velocity = position
        .iter()
        .map(|x| {
            let [x, y] = [x[0], x[1]].map(|x| std::f64::consts::TAU * x);
            Vector::from([-x.cos() * y.sin(), x.sin() * y.cos()])
        })
        .collect();
    Particles {
        real: count,
        position,
        velocity,
        pressure: vec![0.0; count],
        kind: vec![ParticleKind::Fluid; count],
        body: vec![0; count],
        normal: vec![Vector::zeros(); count],
        depth: vec![0.0; count],
        id: (0..count as u64).collect(),
    }
}

fn stages(criterion: &mut Criterion) {
    for side in SIDES {
        let settings = settings(side, "initial");
        let mut particles = particles(side);
        let mut frame = Frame::default();
        frame.search(&settings, &mut particles, 0.0, true);
        let count = particles.real;
        let pairs = frame.stencil.neighbours.pair_count(&frame.stencil.position, settings.support_radius());
        let entries = frame.stencil.neighbours.entry_count();
        println!(
            "{count} particles, {:.1} neighbours each, {:.2} lanes a pair",
            pairs as f64 / count as f64,
            (LANES * entries) as f64 / pairs as f64
        );
        let mut group = criterion.benchmark_group("stages");
        group.throughput(Throughput::Elements(pairs as u64)).sample_size(20);
        group.bench_function(BenchmarkId::new("search and stencil", count), |b| {
            b.iter(|| frame.search(&settings, &mut particles, 0.0, true));
        });
        group.bench_function(BenchmarkId::new("stencil", count), |b| {
            b.iter(|| frame.update(&settings, &particles));
        });
        let velocity = &particles.velocity;
        let scalar: Vec<f64> = velocity.iter().map(|u| u[0]).collect();
        let both: Vec<[f64; 2]> = velocity.iter().map(|u| [u[0], u[1]]).collect();
        let stencil = &frame.stencil;
        let mut vectors = vec![Vector::zeros(); count];
        let mut scalars = vec![0.0; count];
        let mut matrices = vec![Matrix::zeros(); count];
        group.bench_function(BenchmarkId::new("gradient", count), |b| {
            b.iter(|| {
                stencil.for_each_one(Gradient(&scalar), &mut vectors, |_, value, out| *out = value);
                black_box(&vectors);
            });
        });
        group.bench_function(BenchmarkId::new("divergence", count), |b| {
            b.iter(|| {
                stencil.for_each_one(Divergence(velocity), &mut scalars, |_, value, out| *out = value);
                black_box(&scalars);
            });
        });
        group.bench_function(BenchmarkId::new("laplacian and divergence", count), |b| {
            b.iter(|| {
                let operator = LaplacianAndDivergence { velocity, seen: |s: usize, _: usize| velocity[s] };
                stencil.for_each(operator, &mut vectors, &mut scalars, |_, value, l, d| (*l, *d) = value);
                black_box((&vectors, &scalars));
            });
        });
        group.bench_function(BenchmarkId::new("gradient and laplacian", count), |b| {
            b.iter(|| {
                stencil.for_each(GradientAndLaplacian(&both), &mut vectors, &mut scalars, |_, value, g, l| (*g, *l) = value);
                black_box((&vectors, &scalars));
            });
        });
        group.bench_function(BenchmarkId::new("velocity gradient", count), |b| {
            b.iter(|| {
                stencil.for_each_one(VelocityGradient(velocity), &mut matrices, |_, value, out| *out = value);
                black_box(&matrices);
            });
        });
        group.finish();
    }
}

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step of 5 iterations");
    group.sample_size(10);
    for side in SIDES {
        for (algorithm, frame) in [(1, "updated"), (2, "initial")] {
            for threads in [1, 2] {
                let mut simulation =
                    Simulation::new(settings(side, frame), particles(side), Clock::default(), Some(threads))
                        .expect("the particles of the bench are valid");
                group.throughput(Throughput::Elements((side * side) as u64));
                let name = format!("algorithm {algorithm}, {threads} threads");
                group.bench_function(BenchmarkId::new(name, side * side), |b| b.iter(|| simulation.advance(1, None)));
            }
        }
    }
    group.finish();
}

criterion_group!(benches, stages, step);
criterion_main!(benches);
