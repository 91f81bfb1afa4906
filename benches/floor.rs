//! What this machine can do, beside what the engine makes of it: memory bandwidth, arithmetic rate, and a pair loop written by
//! hand, measured in the same run as the engine's passes over the same particles, on one thread.
//!
//! `cargo bench --bench floor`

use alsph::frame::{Frame, Travel};
use alsph::lanes::{LANES, Lanes, Task, run};
use alsph::neighbours::Entry;
use alsph::operators::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndDivergence};
use alsph::{Particles, Vector};
use std::hint::black_box;
use std::time::Instant;

mod lattice;

/// Particles a side, about as many in all as the paper's channel has at D/Δx = 20.
const SIDE: usize = 277;

/// Rounds, of which the fastest counts: other work on the machine only ever slows one down.
const ROUNDS: usize = 30;

/// Seconds of the fastest of a number of rounds.
fn fastest(mut work: impl FnMut()) -> f64 {
    (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
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

/// Seconds of the pair loop by hand over the rows of `frame`, but for a last row of fewer than four.
fn by_hand(frame: &Frame<2>, particles: &Particles<2>, field: &[f64]) -> f64 {
    let (mut rows, mut near) = (Vec::new(), Vec::new());
    for first in (0..particles.real - LANES + 1).step_by(LANES) {
        let start = near.len();
        let (row, _) = frame.stencil.neighbours.row(first);
        near.extend(
            row.all()
                .iter()
                .map(|entry| Near { slopes: std::array::from_fn(|lane| entry.slope(lane) as f32), j: entry.j() as u32 }),
        );
        rows.push(start..near.len());
    }
    let mut out = vec![[[0.0; LANES]; 2]; rows.len()];
    let seconds = fastest(|| {
        run(ByHand { rows: &rows, near: &near, position: &particles.position, field, out: &mut out });
    });
    black_box(&out);
    seconds
}

fn main() {
    // Arguments that cargo passes are of no use here.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("no pool was made before");
    let settings = lattice::settings::<2>(SIDE, "initial");
    let mut particles = lattice::particles::<2>(SIDE);
    let mut frame = Frame::default();
    frame.search(&settings, &mut particles, Travel::default(), true);
    frame.stencil.correct();
    let (stencil, count) = (&frame.stencil, particles.real);
    let pairs = stencil.neighbours.pair_count(&particles, settings.support_radius()) as f64;
    let entries = stencil.neighbours.entry_count() as f64;
    let machine = machine();
    println!(
        "{count} particles, {:.1} neighbours each, {:.2} lanes a pair, one thread",
        pairs / count as f64,
        LANES as f64 * entries / pairs
    );
    println!("memory bandwidth   {:6.1} GB/s, reading 256 MiB", machine.bandwidth / 1e9);
    println!("arithmetic         {:6.1} GFLOP/s, f64 multiplications and additions, not fused", machine.arithmetic / 1e9);
    println!();
    println!("{:28} {:>8} {:>12} {:>8} {:>8} {:>10}", "pass", "ns/pair", "pairs/s", "memory", "compute", "by hand");

    let velocity = &particles.velocity;
    let scalar: Vec<f64> = velocity.iter().map(|u| u[0]).collect();
    let both: Vec<[f64; 2]> = velocity.iter().map(|u| [u[0], u[1]]).collect();
    let (mut vectors, mut scalars) = (vec![Vector::<2>::zeros(); count], vec![0.0; count]);
    let hand = by_hand(&frame, &particles, &scalar);
    // Operations a lane of one entry: additions, subtractions and multiplications of the loop.
    let report = |name: &str, seconds: f64, operations: f64, fields: usize| {
        let bytes = entries * size_of::<Entry>() as f64 + (fields * size_of::<f64>() * count) as f64;
        let memory = bytes / machine.bandwidth / seconds;
        let compute = operations * LANES as f64 * entries / machine.arithmetic / seconds;
        println!(
            "{name:28} {:8.3} {:12.2e} {:7.0}% {:7.0}% {:9.2}x",
            seconds / pairs * 1e9,
            pairs / seconds,
            100.0 * memory,
            100.0 * compute,
            seconds / hand
        );
    };
    report("by hand: uncorrected gradient", hand, 8.0, 5);
    let seconds = fastest(|| stencil.for_each_one(Gradient(&scalar), &mut vectors, |_, value, out| *out = value));
    report("gradient", seconds, 8.0, 10);
    let seconds = fastest(|| stencil.for_each_one(Divergence(velocity), &mut scalars, |_, value, out| *out = value));
    report("divergence", seconds, 14.0, 10);
    let seconds = fastest(|| {
        let operator = LaplacianAndDivergence { velocity, seen: |s: usize, _: usize| velocity[s] };
        stencil.for_each(operator, &mut vectors, &mut scalars, |_, value, l, d| (*l, *d) = value);
    });
    report("Laplacian and divergence", seconds, 16.0, 12);
    let seconds = fastest(|| {
        stencil.for_each(GradientAndLaplacian(&both), &mut vectors, &mut scalars, |_, value, g, l| (*g, *l) = value);
    });
    report("gradient and Laplacian", seconds, 11.0, 12);
    black_box((&vectors, &scalars));
}
