//! Instructions of a step a pair-pass, counted by valgrind: a figure that other work on the machine cannot change. It says nothing of
//! caches and of how instructions overlap, so time what it finds with the floor bench.
//!
//! `cargo bench --bench instructions`, before and after a change.

use alsph::{Clock, Simulation};
use std::process::Command;

mod lattice;
use lattice::{METHODS, Method};

/// Particles a side, in 2-D and 3-D.
const SIDES: [usize; 2] = [48, 10];

/// Pairs a particle.
const NEIGHBOURS: [f64; 2] = [48.1, 267.0];

/// Counts differ by these steps, so that the start cancels.
const STEPS: [u64; 2] = [1, 3];

fn steps<const D: usize>(side: usize, method: Method, steps: u64) {
    let settings = lattice::settings::<D>(side, method);
    let simulation = Simulation::new(settings, lattice::particles::<D>(side), Clock::default(), Some(1));
    simulation.and_then(|mut simulation| simulation.advance(steps, None)).expect("the vortex is stable");
}

/// Instructions of a run of this program with `arguments`.
fn count(arguments: [usize; 3]) -> Option<f64> {
    let program = std::env::current_exe().ok()?;
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(program)
        .args(arguments.map(|number| number.to_string()))
        .output()
        .ok()?;
    let text = String::from_utf8(output.stderr).ok()?;
    let line = text.lines().find(|line| line.contains("I") && line.contains("refs:"))?;
    line.rsplit(':').next()?.trim().replace(',', "").parse().ok()
}

fn main() {
    let numbers: Vec<usize> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    if let [dimensions, method, count] = numbers[..] {
        let side = SIDES[dimensions - 2];
        return if dimensions == 2 {
            steps::<2>(side, METHODS[method], count as u64)
        } else {
            steps::<3>(side, METHODS[method], count as u64)
        };
    }
    for dimensions in [2, 3] {
        for (k, Method { name, passes, .. }) in METHODS.into_iter().enumerate() {
            let [few, many] = STEPS.map(|steps| count([dimensions, k, steps as usize]));
            let (Some(few), Some(many)) = (few, many) else {
                println!("valgrind is needed, and did not run");
                std::process::exit(1);
            };
            let particles = (SIDES[dimensions - 2] as f64).powi(dimensions as i32);
            let step = (many - few) / (STEPS[1] - STEPS[0]) as f64;
            println!(
                "{dimensions}-D, {name}: {step:.4e} instructions a step, {:.2} a pair-pass",
                step / (particles * NEIGHBOURS[dimensions - 2] * passes)
            );
        }
    }
}
