//! What happens to particles that cross the sides of the domain: inlet and outlet buffers, periodic wrap, slip walls.

use crate::neighbours::Grid;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::{Boundary, Settings};

/// Mass that crossed the inlet and outlet planes.
#[derive(Clone, Copy, Debug, Default)]
pub struct MassFlow {
    pub inflow: f64,
    pub outflow: f64,
}

/// Turn, wrap, add and remove the particles that have crossed a side. `particles` hold no images; `grid` is of their
/// positions before the step.
pub fn end_step<const D: usize>(
    particles: &mut Particles<D>,
    settings: &Settings,
    grid: &Grid<D>,
    next_id: &mut u64,
) -> MassFlow {
    let mut flow = MassFlow::default();
    let mass = settings.density * settings.particle_spacing.powi(D as i32);
    let mut keep = vec![true; particles.real];
    let mut entered = Vec::new();
    for axis in 0..D {
        let [lower_kind, upper_kind] = settings.domain.boundaries[axis];
        for (side, inward) in [(lower_kind, 1.0), (upper_kind, -1.0)] {
            let plane = if inward > 0.0 { settings.domain.lower[axis] } else { settings.domain.upper[axis] };
            let crossing = Crossing { axis, plane, inward, settings };
            match side {
                Boundary::Inlet => entered.extend(crossing.inlet(particles).map(|i| (i, axis, inward))),
                Boundary::Outlet => flow.outflow += mass * crossing.outlet(particles, &mut keep) as f64,
                Boundary::Slip => crossing.reflect(particles),
                Boundary::Periodic => crossing.wrap(particles),
                Boundary::None => {}
            }
        }
    }
    flow.inflow = mass * entered.len() as f64;
    let refill: Vec<_> =
        entered.iter().map(|&(i, axis, inward)| refill(particles, settings, grid, i, axis, inward)).collect();
    for ((i, ..), (position, pressure)) in entered.into_iter().zip(refill) {
        let new = particles.push_copy(i);
        particles.position[new] = position;
        particles.pressure[new] = pressure;
        particles.id[new] = *next_id;
        *next_id += 1;
        particles.kind[i] = ParticleKind::Fluid;
        keep.push(true);
    }
    particles.real = particles.len();
    if keep.contains(&false) {
        particles.retain(&keep);
    }
    flow
}

/// The particle that replaces inlet particle `i` at the far end of the buffer, with the pressure that the flow has there:
/// that of the nearest inlet particle.
fn refill<const D: usize>(
    particles: &Particles<D>,
    settings: &Settings,
    grid: &Grid<D>,
    i: usize,
    axis: usize,
    inward: f64,
) -> (Vector<D>, f64) {
    let mut position = particles.position[i];
    position[axis] -= inward * settings.buffer_length();
    let mut nearest = (f64::INFINITY, particles.pressure[i]);
    grid.for_each_run(&position, |run| {
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

/// One side of the domain.
struct Crossing<'a> {
    axis: usize,
    plane: f64,
    /// +1 where the domain lies above the plane, −1 where it lies below.
    inward: f64,
    settings: &'a Settings,
}

impl Crossing<'_> {
    /// Distance inside the domain.
    fn inside<const D: usize>(&self, position: &Vector<D>) -> f64 {
        self.inward * (position[self.axis] - self.plane)
    }

    /// Inlet particles that have entered the domain.
    fn inlet<const D: usize>(&self, particles: &Particles<D>) -> impl Iterator<Item = usize> {
        (0..particles.real)
            .filter(|&i| particles.kind[i] == ParticleKind::Inlet && self.inside(&particles.position[i]) >= 0.0)
    }

    /// Fluid becomes buffer, buffer that came back becomes fluid, buffer at its end goes. Returns the net number that left.
    fn outlet<const D: usize>(&self, particles: &mut Particles<D>, keep: &mut [bool]) -> i64 {
        let mut left = 0;
        for i in 0..particles.real {
            let inside = self.inside(&particles.position[i]);
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
                ParticleKind::Outlet if inside < -self.settings.buffer_length() => keep[i] = false,
                _ => {}
            }
        }
        left
    }

    /// Put back what slipped through a slip wall by rounding or by a shift.
    fn reflect<const D: usize>(&self, particles: &mut Particles<D>) {
        for i in 0..particles.real {
            if particles.kind[i] != ParticleKind::Solid && self.inside(&particles.position[i]) < 0.0 {
                let x = &mut particles.position[i][self.axis];
                *x = 2.0 * self.plane - *x;
                particles.velocity[i][self.axis] *= -1.0;
            }
        }
    }

    fn wrap<const D: usize>(&self, particles: &mut Particles<D>) {
        let period = self.settings.domain.upper[self.axis] - self.settings.domain.lower[self.axis];
        for position in &mut particles.position[..particles.real] {
            // The upper plane is the lower one.
            if self.inside(position) < 0.0 || (self.inward < 0.0 && self.inside(position) == 0.0) {
                position[self.axis] += self.inward * period;
            }
        }
    }
}
