//! What this machine can do, beside what the engine makes of it: memory bandwidth, arithmetic rate, and a pair loop written by
//! hand, measured in the same run as the engine's passes over the same particles, on one thread. All take turns, and the
//! fastest of each counts, in units of the loop by hand: other work on the machine only ever slows a round down.
//!
//! `cargo bench --bench floor -- --save` keeps these ratios, and `cargo bench --bench floor` compares with those kept: so see
//! whether a change made the engine slower.

use alsph::base::lanes::{LANES, Lanes, Task, run};
use alsph::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient};
use alsph::frame::{Frame, Travel};
use alsph::neighbours::{Entry, Grid, NeighbourList};
use alsph::{Clock, Particles, Simulation, Vector};
use std::collections::HashMap;
use std::hint::black_box;
use std::time::Instant;

mod lattice;
use lattice::METHODS;

/// Particles a side, about as many in all as the paper's channel has at D/Δx = 20.
const SIDE: usize = 277;

/// Turns that each measurement takes.
const ROUNDS: usize = 25;

/// Where the ratios are kept.
const SAVED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/target/floor.json");

fn seconds(work: &mut dyn FnMut()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

/// Seconds of the fastest of all rounds: other work on the machine only ever slows one down.
fn fastest(mut work: impl FnMut()) -> f64 {
    (0..ROUNDS).map(|_| seconds(&mut work)).fold(f64::INFINITY, f64::min)
}

/// Sum an array: as fast as memory gives it.
struct Read<'a> {
    values: &'a [[f64; LANES]],
    sum: &'a mut f64,
}

impl Task for Read<'_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let mut sums = [V::zero(); 8];
        for block in self.values.chunks_exact(sums.len()) {
            for (sum, value) in sums.iter_mut().zip(block) {
                *sum += V::load(value);
            }
        }
        *self.sum = sums.into_iter().fold(V::zero(), |a, b| a + b).store()[0];
    }
}

/// Multiply and add in registers, one of each a time and lane.
struct Arithmetic<'a> {
    times: usize,
    result: &'a mut f64,
}

impl Task for Arithmetic<'_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let factor = V::splat(black_box(0.999));
        let (mut products, mut sums) = ([V::splat(1.0); 6], [V::splat(1.0); 6]);
        for _ in 0..self.times / products.len() {
            for k in 0..products.len() {
                products[k] = products[k] * factor;
                sums[k] += factor;
            }
        }
        let all = products.into_iter().chain(sums).fold(V::zero(), |a, b| a + b);
        *self.result = all.store()[0];
    }
}

/// An entry of the rows that the pair loop by hand reads.
#[repr(C)]
struct Near {
    slopes: [f32; LANES],
    j: u32,
}

/// Σ slope (f_j − f_i) r_ij with nothing around it: rows of four particles in one array, no corrections, no chunks.
struct ByHand<'a> {
    rows: &'a [std::ops::Range<usize>],
    near: &'a [Near],
    position: &'a [Vector<2>],
    field: &'a [f64],
    out: &'a mut [[[f64; LANES]; 2]],
}

impl Task for ByHand<'_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (c, (row, out)) in self.rows.iter().zip(self.out).enumerate() {
            let first = c * LANES;
            let x = V::load(&std::array::from_fn(|lane| self.position[first + lane][0]));
            let y = V::load(&std::array::from_fn(|lane| self.position[first + lane][1]));
            let f = V::load(&std::array::from_fn(|lane| self.field[first + lane]));
            let (mut gx, mut gy) = (V::zero(), V::zero());
            for near in &self.near[row.clone()] {
                let j = near.j as usize;
                let weight = (V::splat(self.field[j]) - f) * V::load_single(&near.slopes);
                gx += weight * (x - V::splat(self.position[j][0]));
                gy += weight * (y - V::splat(self.position[j][1]));
            }
            *out = [gx.store(), gy.store()];
        }
    }
}

/// The floor of one machine.
struct Machine {
    /// B/s
    bandwidth: f64,
    /// FLOP/s
    arithmetic: f64,
}

fn machine() -> Machine {
    let values = vec![[1.0; LANES]; 1 << 23];
    let mut sum = 0.0;
    let read = fastest(|| run(Read { values: &values, sum: &mut sum }));
    let times = 6 << 20;
    let mut result = 0.0;
    let compute = fastest(|| run(Arithmetic { times, result: &mut result }));
    black_box((sum, result));
    Machine { bandwidth: size_of_val(&values[..]) as f64 / read, arithmetic: (2 * LANES * times) as f64 / compute }
}

/// The rows of `frame` for the pair loop by hand, but for a last row of fewer than four.
fn rows_by_hand(frame: &Frame<2>, particles: &Particles<2>) -> (Vec<std::ops::Range<usize>>, Vec<Near>) {
    let (mut rows, mut near) = (Vec::new(), Vec::new());
    for first in (0..particles.real - LANES + 1).step_by(LANES) {
        let start = near.len();
        let (row, _) = frame.stencil.neighbours.row(first);
        near.extend(row.all().iter().map(|entry| Near { slopes: entry.slopes, j: entry.j() as u32 }));
        rows.push(start..near.len());
    }
    (rows, near)
}

/// One thing to time.
struct Measurement<'a> {
    name: &'static str,
    /// Passes over all pairs, if it is not a single one.
    passes: f64,
    /// Additions, subtractions and multiplications a lane of one entry, and f64 numbers a particle beside the entries; none for
    /// whole steps.
    operations: f64,
    numbers: usize,
    work: Box<dyn FnMut() + 'a>,
}

fn main() {
    let save = std::env::args().any(|argument| argument == "--save");
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("no pool was made before");
    let settings = lattice::settings::<2>(SIDE, METHODS[0]);
    let mut particles = lattice::particles::<2>(SIDE);
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), true);
    frame.stencil.correct();
    let count = particles.real;
    let pairs = frame.stencil.neighbours.pair_count(&particles, settings.support_radius()) as f64;
    let entries = frame.stencil.neighbours.entry_count() as f64;
    let machine = machine();
    println!(
        "{count} particles, {:.1} neighbours each, {:.2} lanes a pair, one thread",
        pairs / count as f64,
        LANES as f64 * entries / pairs
    );
    println!("memory bandwidth   {:6.1} GB/s, reading 256 MiB", machine.bandwidth / 1e9);
    println!("arithmetic         {:6.1} GFLOP/s, f64 multiplications and additions, not fused", machine.arithmetic / 1e9);

    let (rows, near) = rows_by_hand(&frame, &particles);
    let velocity = &particles.velocity;
    let scalar: Vec<f64> = velocity.iter().map(|u| u[0]).collect();
    let both: Vec<[f64; 2]> = velocity.iter().map(|u| [u[0], u[1]]).collect();
    let stencil = &frame.stencil;
    let zeros = || (vec![Vector::<2>::zeros(); count], vec![0.0; count]);
    let mut out = vec![[[0.0; LANES]; 2]; rows.len()];
    let (mut gradients, mut divergences) = zeros();
    let ((mut laplacians, mut traces), (mut slopes, mut curvatures)) = (zeros(), zeros());
    let (mut grid, mut list) = (Grid::default(), NeighbourList::default());
    let mut again = Frame::default();
    again.search(&settings, &mut particles.clone(), Travel::default(), false);
    let mut simulations = METHODS.map(|method| {
        let settings = lattice::settings::<2>(SIDE, method);
        let mut simulation = Simulation::new(settings, lattice::particles::<2>(SIDE), Clock::default(), Some(1))
            .expect("the particles of the bench are valid");
        simulation.advance(2, None).expect("the vortex is stable");
        simulation
    });
    let pass = |name, operations, numbers, work| Measurement { name, passes: 1.0, operations, numbers, work };
    let mut measurements = vec![
        pass(
            "by hand: uncorrected gradient",
            8.0,
            5,
            Box::new(|| {
                run(ByHand { rows: &rows, near: &near, position: &particles.position, field: &scalar, out: &mut out })
            }),
        ),
        pass(
            "gradient",
            8.0,
            10,
            Box::new(|| stencil.for_each_one(Gradient(&scalar), &mut gradients, |_, value, out| *out = value)),
        ),
        pass(
            "divergence",
            14.0,
            10,
            Box::new(|| stencil.for_each_one(Divergence(velocity), &mut divergences, |_, value, out| *out = value)),
        ),
        pass(
            "Laplacian and divergence",
            16.0,
            12,
            Box::new(|| {
                let operator = LaplacianAndGradient { velocity, seen: |s: usize, _: usize| velocity[s] };
                stencil.for_each(operator, &mut laplacians, &mut traces, |_, (laplacian, gradient), l, d| {
                    (*l, *d) = (laplacian, gradient.trace())
                });
            }),
        ),
        pass(
            "gradient and Laplacian",
            11.0,
            12,
            Box::new(|| {
                stencil
                    .for_each(GradientAndLaplacian(&both), &mut slopes, &mut curvatures, |_, value, g, l| (*g, *l) = value);
            }),
        ),
        pass(
            "grid and neighbour list",
            0.0,
            0,
            Box::new(|| {
                let radius = settings.neighbour_distance();
                grid.build(&particles.position, &particles.id, radius, settings.bounds());
                list.search(&particles, None, &grid, radius);
            }),
        ),
        Measurement {
            name: "volumes, corrections",
            passes: 2.0,
            operations: 0.0,
            numbers: 0,
            work: Box::new(|| {
                again.stencil.evaluate(&settings, &particles, |volume| again.images.fill(volume));
                again.stencil.correct();
            }),
        },
    ];
    for (method, simulation) in METHODS.into_iter().zip(&mut simulations) {
        measurements.push(Measurement {
            name: method.name,
            passes: method.passes,
            operations: 0.0,
            numbers: 0,
            work: Box::new(|| assert!(simulation.advance(1, None).is_ok())),
        });
    }
    let mut times = vec![Vec::new(); measurements.len()];
    for _ in 0..ROUNDS {
        for (times, measurement) in times.iter_mut().zip(&mut measurements) {
            times.push(seconds(&mut measurement.work));
        }
    }

    let saved: HashMap<String, f64> =
        std::fs::read_to_string(SAVED).ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    let mut ratios = HashMap::new();
    let fastest = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    let by_hand = fastest(&times[0]);
    println!();
    println!(
        "{:30} {:>8} {:>12} {:>7} {:>8} {:>8} {:>8}",
        "", "ns/pair", "pairs/s", "memory", "compute", "by hand", "saved"
    );
    for (measurement, measured) in measurements.iter().zip(&times) {
        let fastest = fastest(measured);
        let ratio = fastest / by_hand / measurement.passes;
        let bytes = entries * size_of::<Entry>() as f64 + (measurement.numbers * size_of::<f64>() * count) as f64;
        let part = |of: f64| if measurement.operations > 0.0 { format!("{:.0}%", 100.0 * of) } else { String::new() };
        println!(
            "{:30} {:8.3} {:12.2e} {:>7} {:>8} {:7.2}x {:>8}",
            measurement.name,
            fastest / (pairs * measurement.passes) * 1e9,
            pairs * measurement.passes / fastest,
            part(bytes / machine.bandwidth / fastest),
            part(measurement.operations * LANES as f64 * entries / machine.arithmetic / fastest),
            ratio,
            saved.get(measurement.name).map_or(String::new(), |saved| format!("{:+.1}%", 100.0 * (ratio / saved - 1.0)))
        );
        ratios.insert(measurement.name, ratio);
    }
    println!();
    println!("A directed pair and pass, the fastest round.");
    if save {
        let text = serde_json::to_string_pretty(&ratios).expect("numbers can be written");
        std::fs::write(SAVED, text).expect("target/ can be written");
        println!("kept in {SAVED}");
    } else if !saved.is_empty() {
        println!("saved: the change of by hand since --save.");
    }
}
