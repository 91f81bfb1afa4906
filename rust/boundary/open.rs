//! What happens to particles that cross the sides of the domain: inlet and outlet buffers, periodic wrap, slip walls.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::outlet::Outlets;
use crate::boundary::side::{Side, outermost, sides};
use crate::neighbours::Grid;
use crate::particles::{ParticleKind, Particles, follower};
use crate::settings::{Boundary, Settings};

/// What crossed the inlet and outlet planes.
#[derive(Clone, Copy, Debug, Default)]
pub struct MassFlow {
    pub inflow: f64,
    pub outflow: f64,
    /// Number of particles in the buffers of outlets that come back.
    pub returning: usize,
}

/// Turn, wrap, add and remove the particles that have crossed a side. `particles` hold no images; `grid` is of their
/// positions before the step.
pub fn end_step<const D: usize>(
    particles: &mut Particles<D>,
    settings: &Settings,
    grid: &Grid<D>,
    time_step: f64,
) -> MassFlow {
    let sides = sides(settings);
    let of = |kind| sides.iter().filter(|side| side.kind == kind).copied().collect::<Vec<_>>();
    // Most particles are inside, and stay what they are.
    let near = parallel::filter(particles.real, |i| {
        let buffer = matches!(particles.kind[i], ParticleKind::Inlet | ParticleKind::Outlet);
        buffer || sides.iter().any(|side| side.inside(&particles.position[i]) <= 0.0)
    });
    let outlets = of(Boundary::Outlet);
    let buffers = Outlets { settings, outlets: &outlets, grid };
    let following = buffers.follow(particles, &near, time_step);
    let inward = |&&i: &&usize| {
        outermost(&outlets, &particles.position[i])
            .is_some_and(|(_, side)| side.inward * particles.velocity[i][side.axis] > 0.0)
    };
    let returning = following.iter().filter(inward).count();
    of(Boundary::Slip).iter().for_each(|side| side.reflect(particles, &near));
    of(Boundary::Periodic).iter().for_each(|side| side.wrap(particles, &near, settings));
    let (mut left, mut gone) = leave(particles, &near, &outlets, settings.buffer_length());
    let open = of(Boundary::Air);
    let is_lost = |&i: &usize| open.iter().any(|side| side.inside(&particles.position[i]) < 0.0);
    let fluid = near.iter().copied().filter(|&i| particles.kind[i] == ParticleKind::Fluid);
    let lost: Vec<_> = fluid.filter(is_lost).collect();
    left += lost.len() as i64;
    gone.extend(lost);
    let entered = enter(particles, &near, &of(Boundary::Inlet), settings, grid);
    gone.extend(buffers.crowded(particles, &following));
    buffers.fill(particles);
    if !gone.is_empty() {
        let mut keep = vec![true; particles.real];
        gone.into_iter().for_each(|i| keep[i] = false);
        particles.retain(&keep);
    }
    let mass = settings.density * settings.particle_spacing.powi(D as i32);
    MassFlow { inflow: mass * entered as f64, outflow: mass * left as f64, returning }
}

/// Of the particles `near`, fluid that crosses an outlet becomes buffer, buffer that came back becomes fluid, buffer at its end
/// goes. Returns the net number that left, and those that go.
fn leave<const D: usize>(
    particles: &mut Particles<D>,
    near: &[usize],
    outlets: &[Side],
    buffer_length: f64,
) -> (i64, Vec<usize>) {
    let (mut left, mut gone) = (0, Vec::new());
    if outlets.is_empty() {
        return (left, gone);
    }
    for &i in near {
        let inside = outermost(outlets, &particles.position[i]).map_or(0.0, |(inside, _)| inside);
        match particles.kind[i] {
            ParticleKind::Fluid if inside < 0.0 => {
                particles.kind[i] = ParticleKind::Outlet;
                particles.pressure[i] = 0.0;
                left += 1;
            }
            ParticleKind::Outlet if inside >= 0.0 => {
                particles.kind[i] = ParticleKind::Fluid;
                left -= 1;
            }
            ParticleKind::Outlet if inside < -buffer_length => gone.push(i),
            _ => {}
        }
    }
    (left, gone)
}

/// Of the particles `near`, those of the inlet that have entered the domain become fluid, and new ones follow at the far end of
/// the buffer. Returns how many entered.
fn enter<const D: usize>(
    particles: &mut Particles<D>,
    near: &[usize],
    inlets: &[Side],
    settings: &Settings,
    grid: &Grid<D>,
) -> usize {
    let crossed = |i: usize| match particles.kind[i] {
        ParticleKind::Inlet => outermost(inlets, &particles.position[i]).filter(|(inside, _)| *inside >= 0.0),
        _ => None,
    };
    let entered: Vec<(usize, Side)> = near.iter().filter_map(|&i| crossed(i).map(|(_, side)| (i, side))).collect();
    let refill: Vec<_> = entered.iter().map(|&(i, side)| refill(particles, settings, grid, i, side)).collect();
    for (&(i, _), (position, pressure)) in entered.iter().zip(refill) {
        let new = particles.push_copy(i);
        particles.position[new] = position;
        particles.pressure[new] = pressure;
        particles.id[new] = follower(particles.id[i]);
        particles.kind[i] = ParticleKind::Fluid;
    }
    particles.real = particles.len();
    entered.len()
}

/// Position and pressure of the particle that replaces inlet particle `i` at the far end of the buffer. The pressure must come
/// from the flow: it is that of the nearest inlet particle.
fn refill<const D: usize>(
    particles: &Particles<D>,
    settings: &Settings,
    grid: &Grid<D>,
    i: usize,
    side: Side,
) -> (Vector<D>, f64) {
    let mut position = particles.position[i];
    position[side.axis] -= side.inward * settings.buffer_length();
    let mut nearest = (f64::INFINITY, particles.pressure[i]);
    grid.for_each_run(&[position], |run| {
        for &j in run.indices {
            let j = j as usize;
            if j < particles.real && particles.kind[j] == ParticleKind::Inlet {
                let distance = (particles.position[j] - position).norm_squared();
                if distance < nearest.0 {
                    nearest = (distance, particles.pressure[j]);
                }
            }
        }
    });
    (position, nearest.1)
}
