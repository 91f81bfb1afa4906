//! What solving the Poisson equation of the pressure takes, as a Markdown table: `cargo run --release --example poisson`, with the name of a set and a
//! number of particles to go no further than after `--` if not all of it is wanted (`box 3e5`).
//!
//! Passes over the neighbours: four a multigrid cycle, eight a step of BiCGSTAB. Of that many BiCGSTAB took four fewer where it
//! ended in the middle of its last step, which it does not say. The residual that a solve begins with is one more.

use alsph::Particles;
use alsph::settings::{Settings, Solver};
use common::set::Set;
use common::solve::{add_outlet, noise_of, settings, solve, wave_of};

#[path = "../tests/common/mod.rs"]
mod common;

/// Displacement of the particles of the lattice in spacings.
const DISORDER: f64 = 0.2;
/// Layers of solids, and of an outlet.
const LAYERS: usize = 4;
/// More particles than these are too much for Jacobi's iteration.
const MOST_FOR_JACOBI: usize = 30_000;

/// Fluid around a cylinder with slip sides, one end a wall and the other an outlet.
fn cylinder(side: usize) -> (Particles<2>, Settings) {
    let mut particles = common::perturbed_cylinder(side, LAYERS, DISORDER);
    add_outlet(&mut particles, 1.0 - LAYERS as f64 / side as f64);
    (particles, settings::<2>(side, "slip"))
}

/// The same in a periodic box.
fn array(side: usize) -> (Particles<2>, Settings) {
    (common::perturbed_cylinder(side, LAYERS, DISORDER), settings::<2>(side, "periodic"))
}

fn closed<const D: usize>(side: usize) -> (Particles<D>, Settings) {
    (common::particles(common::lattice::<D>(side, DISORDER)), settings::<D>(side, "slip"))
}

/// Seconds of this thread on a processor, if the system tells: those of a clock are others' too on a busy machine.
fn seconds() -> Option<f64> {
    let spent = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(1e-9 * spent.split_whitespace().next()?.parse::<f64>().ok()?)
}

fn table<const D: usize>(name: &str, (particles, settings): (Particles<D>, Settings)) {
    let set = Set::of(particles, &settings, true);
    let count = set.particles.real;
    let solvers = [(Solver::Bicgstab, 8), (Solver::Multigrid, 4), (Solver::Jacobi, 1)];
    for (kind, source) in [("noise", noise_of(&set.particles)), ("wave", wave_of(&set.particles))] {
        for (solver, passes) in
            solvers.into_iter().filter(|(solver, _)| *solver != Solver::Jacobi || count < MOST_FOR_JACOBI)
        {
            for tolerance in [1e-3, 1e-8] {
                let start = seconds();
                let (solution, _) = solve(&set, &settings, solver, &source, tolerance);
                let taken = seconds().zip(start).map_or(f64::NAN, |(end, start)| end - start);
                let passes = passes * solution.iterations;
                let each = 1e9 * taken / (passes as f64 * count as f64);
                let ended = if solution.within_tolerance { "" } else { ", given up" };
                println!(
                    "| {name} | {count} | {kind} | {solver:?} | {tolerance:.0e} | {} | {passes} | {:.1e}{ended} | {taken:.2} | {each:.0} |",
                    solution.iterations, solution.residual,
                );
            }
        }
    }
}

/// Particles and settings of so many rows.
type Planar = fn(usize) -> (Particles<2>, Settings);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let only = arguments.iter().find(|argument| argument.parse::<f64>().is_err());
    let most = arguments.iter().find_map(|argument| argument.parse().ok()).unwrap_or(f64::INFINITY);
    let wanted = |name: &str, count: f64| only.is_none_or(|only| only == name) && count <= most;
    println!(
        "One thread; seconds on a processor of a whole solve, the laying of its grids included. Jacobi: at most 1000 iterations,"
    );
    println!("its tolerance is the change of one.\n");
    println!(
        "| set | N | source | solver | tolerance | iterations | passes, at most | residual | s | ns/(particle and pass) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let planar: [(&str, Planar); 3] = [("cylinder", cylinder), ("array", array), ("box", closed::<2>)];
    let all = || {
        for (side, count) in [(160, 2e4), (500, 2e5), (1580, 2e6)] {
            for (name, make) in planar.into_iter().filter(|(name, _)| wanted(name, count)) {
                table(name, make(side));
            }
        }
        for (side, count) in [(31, 3e4), (67, 3e5)] {
            if wanted("space", count) {
                table("space", closed::<3>(side));
            }
        }
    };
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(all),
        Err(error) => eprintln!("no thread: {error}"),
    }
}
