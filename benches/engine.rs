//! Cost of each stage on perturbed periodic lattices, per directed pair (stages) and per particle and pass (whole step).
//!
//! `cargo bench` prints the throughput in elements a second: pairs for search, stencil and operators, particles times passes for a step.

use alsph::base::lanes::LANES;
use alsph::breakdown;
use alsph::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, VelocityGradient};
use alsph::frame::{Frame, Travel};
use alsph::{Clock, Matrix, Simulation, Vector};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lattice::{METHODS, particles, settings};
use std::hint::black_box;

mod lattice;

/// Particles a side of the two lattices.
const SIDES: [usize; 2] = [141, 447];

fn stages(criterion: &mut Criterion) {
    for side in SIDES {
        let settings = settings::<2>(side, METHODS[0]);
        let mut particles = particles::<2>(side);
        let mut frame = Frame::default();
        frame.search(&settings, &mut particles, Travel::default(), true);
        frame.stencil.correct();
        let count = particles.real;
        let pairs = frame.stencil.neighbours.pair_count(&particles, settings.support_radius());
        let entries = frame.stencil.neighbours.entry_count();
        println!(
            "{count} particles, {:.1} neighbours each, {:.2} lanes a pair",
            pairs as f64 / count as f64,
            (LANES * entries) as f64 / pairs as f64
        );
        let mut group = criterion.benchmark_group("stages");
        group.throughput(Throughput::Elements(pairs as u64)).sample_size(20);
        group.bench_function(BenchmarkId::new("search and stencil", count), |b| {
            b.iter(|| {
                frame.search(&settings, &mut particles, Travel::default(), true);
                frame.stencil.correct();
            });
        });
        group.bench_function(BenchmarkId::new("stencil", count), |b| {
            b.iter(|| {
                frame.update(&settings, &particles);
                frame.stencil.correct();
            });
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
                let operator = LaplacianAndGradient { velocity, seen: |s: usize, _: usize| velocity[s] };
                stencil.for_each(operator, &mut vectors, &mut scalars, |_, (laplacian, gradient), l, d| {
                    (*l, *d) = (laplacian, gradient.trace())
                });
                black_box((&vectors, &scalars));
            });
        });
        group.bench_function(BenchmarkId::new("gradient and laplacian", count), |b| {
            b.iter(|| {
                stencil.for_each(GradientAndLaplacian(&both), &mut vectors, &mut scalars, |_, value, g, l| (*g, *l) = value);
                black_box((&vectors, &scalars));
            });
        });
        group.bench_function(BenchmarkId::new("breakdown", count), |b| {
            b.iter(|| assert!(breakdown::find(&settings, &particles, &frame, &[], settings.time_step).is_none()));
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
    let mut group = criterion.benchmark_group("step");
    group.sample_size(10);
    for side in SIDES {
        for method in METHODS {
            for threads in [1, 2] {
                let mut simulation =
                    Simulation::new(settings::<2>(side, method), particles::<2>(side), Clock::default(), Some(threads))
                        .expect("the particles of the bench are valid");
                group.throughput(Throughput::Elements((side * side) as u64 * method.passes as u64));
                let name = format!("{}, {threads} threads", method.name);
                group.bench_function(BenchmarkId::new(name, side * side), |b| b.iter(|| simulation.advance(1, None)));
            }
        }
    }
    group.finish();
}

criterion_group!(benches, stages, step);
criterion_main!(benches);
