//! The sides of the domain, and how far inside them a position is.

use crate::base::Vector;
use crate::particles::{ParticleKind, Particles};
use crate::settings::{Boundary, Settings};

/// One side of the domain.
#[derive(Clone, Copy)]
pub struct Side {
    pub kind: Boundary,
    pub axis: usize,
    pub plane: f64,
    /// +1 where the domain lies above the plane, −1 where it lies below.
    pub inward: f64,
}

/// Both sides of each direction.
pub fn sides(settings: &Settings) -> Vec<Side> {
    let domain = &settings.domain;
    (0..domain.boundaries.len())
        .flat_map(|axis| {
            let [lower, upper] = domain.boundaries[axis];
            [
                Side { kind: lower, axis, plane: domain.lower[axis], inward: 1.0 },
                Side { kind: upper, axis, plane: domain.upper[axis], inward: -1.0 },
            ]
        })
        .collect()
}

/// Whether a particle of an inlet buffer lies so deep in it that all it sees is prescribed, and cut off at the buffer's end: its
/// divergence says nothing about the flow.
pub fn deep_in_inlet<const D: usize>(settings: &Settings) -> impl Fn(&Vector<D>) -> bool + Sync {
    let inlets: Vec<Side> = sides(settings).into_iter().filter(|side| side.kind == Boundary::Inlet).collect();
    let radius = settings.support_radius();
    move |position| outermost(&inlets, position).is_some_and(|(inside, _)| -inside > radius)
}

/// The side that `position` is farthest beyond, or nearest to, and its distance inside it.
pub fn outermost<const D: usize>(sides: &[Side], position: &Vector<D>) -> Option<(f64, Side)> {
    sides.iter().map(|&side| (side.inside(position), side)).min_by(|a, b| a.0.total_cmp(&b.0))
}

impl Side {
    /// Distance inside the domain.
    pub fn inside<const D: usize>(&self, position: &Vector<D>) -> f64 {
        self.inward * (position[self.axis] - self.plane)
    }

    /// Put back what slipped through a slip wall by rounding or by a shift.
    pub fn reflect<const D: usize>(&self, particles: &mut Particles<D>, near: &[usize]) {
        for &i in near {
            if particles.kind[i] != ParticleKind::Solid && self.inside(&particles.position[i]) < 0.0 {
                let x = &mut particles.position[i][self.axis];
                *x = 2.0 * self.plane - *x;
                particles.velocity[i][self.axis] *= -1.0;
            }
        }
    }

    /// Bring what has left through a periodic side in at the other.
    pub fn wrap<const D: usize>(&self, particles: &mut Particles<D>, near: &[usize], settings: &Settings) {
        let period = settings.domain.upper[self.axis] - settings.domain.lower[self.axis];
        for &i in near {
            let position = &mut particles.position[i];
            // The upper plane is the lower one.
            if self.inside(position) < 0.0 || (self.inward < 0.0 && self.inside(position) == 0.0) {
                position[self.axis] += self.inward * period;
            }
        }
    }
}
