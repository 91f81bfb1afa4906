//! Time and memory a particle from 2e4 to 5e6 particles, in 2-D and 3-D, with the default method: both should stay flat.
//!
//! `cargo bench --bench scaling` runs every size in a process of its own; `cargo bench --bench scaling -- 3 100 2` one size, as
//! dimensions, particles a side and threads.

use alsph::{Clock, Simulation};
use std::process::Command;
use std::time::Instant;

mod lattice;
use lattice::METHODS;

/// Dimensions and particles a side.
const SIZES: [(usize, usize); 8] = [(2, 141), (2, 447), (2, 1000), (2, 2236), (3, 27), (3, 59), (3, 100), (3, 171)];

/// Time spent on a size, at least three steps.
const SECONDS: f64 = 10.0;

/// Peak memory of this process in bytes (Linux only).
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse::<f64>().ok());
    1024.0 * peak.unwrap_or(f64::NAN)
}

fn one<const D: usize>(side: usize, threads: usize) {
    let settings = lattice::settings::<D>(side, METHODS[2]);
    let particles = lattice::particles::<D>(side);
    let count = particles.real as f64;
    let mut simulation =
        Simulation::new(settings, particles, Clock::default(), Some(threads)).expect("the particles of the bench are valid");
    simulation.advance(1, None).expect("the vortex is stable");
    let mut times = Vec::new();
    while times.iter().sum::<f64>() < SECONDS || times.len() < 3 {
        let start = Instant::now();
        simulation.advance(1, None).expect("the vortex is stable");
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{D}-D {count:9} particles, {threads} threads: {:7.3} µs a particle and step, {:6.0} B a particle",
        1e6 * times[times.len() / 2] / count,
        peak_memory() / count
    );
}

fn main() {
    let numbers: Vec<usize> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    if let [dimensions, side, threads] = numbers[..] {
        return if dimensions == 2 { one::<2>(side, threads) } else { one::<3>(side, threads) };
    }
    let program = std::env::current_exe().expect("a running program has a path");
    for (dimensions, side) in SIZES {
        for threads in [1, 2] {
            let arguments = [dimensions, side, threads].map(|number| number.to_string());
            let status = Command::new(&program).args(arguments).status().expect("the bench can start itself");
            if !status.success() {
                println!("{dimensions}-D, {side} a side, {threads} threads: {status}");
            }
        }
    }
}
