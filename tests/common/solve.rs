//! Poisson equations of particles, and what their solvers make of them.

use super::set::Set;
use alsph::poisson::{Goal, Poisson, Solution, System};
use alsph::settings::{Settings, Solver};
use alsph::surface::Surface;
use alsph::{ParticleKind, Particles};
use std::f64::consts::TAU;

/// Settings of a unit box of `side` particles a direction, whose solids have the pressure of the fluid around.
pub fn settings<const D: usize>(side: usize, boundary: &str) -> Settings {
    let mut value = super::settings_value::<D>(1.0 / side as f64, boundary);
    value["wall_pressure"] = "adami".into();
    super::parse(&value)
}

/// x of −∇²x = `source`, by real particle.
pub fn solve<const D: usize>(
    set: &Set<D>,
    settings: &Settings,
    solver: Solver,
    source: &[f64],
    tolerance: f64,
) -> (Solution, Vec<f64>) {
    solve_beside(None, set, settings, solver, source, tolerance)
}

/// The same beside a free surface.
pub fn solve_beside<const D: usize>(
    surface: Option<&Surface<D>>,
    set: &Set<D>,
    settings: &Settings,
    solver: Solver,
    source: &[f64],
    tolerance: f64,
) -> (Solution, Vec<f64>) {
    let Set { particles, frame } = set;
    let system = System { settings, particles, frame, surface, largest: settings.largest_eigenvalues() };
    let mut poisson = Poisson::default();
    poisson.begin(system, solver);
    let (mut source, mut x) = (source.to_vec(), vec![0.0; particles.len()]);
    let goal = Goal { tolerance, max_iterations: 1000, damping: 0.5 };
    let solution = poisson.solve(system, solver, goal, &mut source, &mut x);
    x.truncate(particles.real);
    (solution, x)
}

/// The same for everyone, of the particle with this id.
pub fn noise(id: u64) -> f64 {
    let mixed = (id + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

pub fn noise_of<const D: usize>(particles: &Particles<D>) -> Vec<f64> {
    particles.id[..particles.real].iter().map(|&id| noise(id)).collect()
}

/// A long wave, which only the background grid sees.
pub fn wave_of<const D: usize>(particles: &Particles<D>) -> Vec<f64> {
    particles.position[..particles.real].iter().map(|x| (0.5 * TAU * x[0]).cos()).collect()
}

/// Make an outlet of what lies beyond this x.
pub fn add_outlet<const D: usize>(particles: &mut Particles<D>, from: f64) {
    for i in 0..particles.real {
        if particles.position[i][0] > from {
            particles.kind[i] = ParticleKind::Outlet;
        }
    }
}
