//! Where the energy goes that a step takes.

use super::Terms;
use crate::base::{Vector, exact_sums};
use crate::flow::{Flow, Step};
use crate::particles::ParticleKind;
use crate::scheme::Taken;

impl<const D: usize> Terms<D> {
    /// What each part of the step that leads to `flow` has taken of the energy. With the mean of u^n and u^{n+1}, which takes r^n to r^{n+1}, the
    /// change of velocity that is a part's makes just the change of energy that is: they and the viscous term's sum to what is lost.
    pub(super) fn taken(&self, step: Step, flow: &Flow<D>) -> Taken {
        let Flow { particles, frame, before, body_force, .. } = flow;
        let (dt, viscosity) = (step.time_step, step.settings.kinematic_viscosity);
        let [artificial, penalty, pressure, sweeps, contact] = exact_sums(particles.real, |i| {
            (particles.kind[i] == ParticleKind::Fluid).then(|| {
                let [first, last] = [before.velocity[i], particles.velocity[i]];
                let momentum = (first + last) * (0.5 * step.settings.density * frame.stencil.volume[i]);
                let (star, corrected, swept) = (self.velocity_star[i], self.corrected[i], self.swept[i]);
                let changes: [Vector<D>; 5] = [
                    (self.friction[i] - self.derived[i].laplacian * viscosity) * dt,
                    star - first - self.friction[i] * dt,
                    corrected - star - body_force.at(i) * dt,
                    swept - corrected,
                    last - swept,
                ];
                changes.map(|change| -momentum.dot(&change) / dt)
            })
        });
        Taken { artificial, penalty, pressure, sweeps, contact }
    }
}
