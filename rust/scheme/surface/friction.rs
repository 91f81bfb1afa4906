//! What acts on the fluid beside pressure and body force: the viscous term, in which no stress acts from the air, and an artificial
//! viscosity that takes what moves from particle to particle.

use super::Terms;
use crate::base::{Vector, parallel};
use crate::discretisation::{AdjointGradient, Roughness};
use crate::flow::{Flow, Step};
use crate::settings::FreeSurface;

/// Of the support, within which a particle that sees air makes its neighbours take what it gives.
const WITHIN: f64 = 1.0 - 1e-4;

impl<const D: usize> Terms<D> {
    /// All of it, from u^n and ∇u^n in `tensor`, and the pressure of the surface.
    pub(super) fn find_friction(&mut self, step: Step, flow: &Flow<D>) {
        self.find_roughness(step, flow);
        self.free_of_stress(step, flow);
        let (derived, viscosity) = (&self.derived, step.settings.kinematic_viscosity);
        parallel::for_each(&mut self.friction, |i, friction| *friction += derived[i].laplacian * viscosity);
    }

    /// What the artificial viscosity does: of pairs, so that momentum is kept, and nothing in a linear flow (after Frontiere, Raskin and Owen
    /// 2017). Particles that are thinly surrounded, whose ∇u is not so well known, have the share √w of it.
    fn find_roughness(&mut self, step: Step, Flow { particles, frame, surface, .. }: &Flow<D>) {
        let FreeSurface { artificial_viscosity, reference_velocity, .. } = self.own;
        let viscosity = artificial_viscosity * reference_velocity * step.settings.particle_spacing;
        frame.images.blank(&mut self.friction, particles.real);
        if viscosity == 0.0 {
            self.friction.fill(Vector::zeros());
            return;
        }
        frame.images.blank(&mut self.pushed, particles.len());
        let weight = &surface.weight;
        parallel::for_each(frame.images.real(&mut self.pushed), |i, share| *share = weight[i].sqrt());
        frame.images.fill(&mut self.pushed);
        frame.images.fill(&mut self.tensor);
        frame.stencil.for_each_one(
            Roughness { velocity: &particles.velocity, gradient: &self.tensor, weight: &self.pushed },
            &mut self.friction,
            |_, roughness, friction| *friction = roughness * viscosity,
        );
    }

    /// The viscous term next to the surface, where no stress acts on the fluid from outside: of the stress 2ν S it is what the pressure's
    /// gradient is of the pressure, so that Σ u·(term) is minus what 2ν S:S takes. And the pressure that answers the stress there.
    ///
    /// Of particles that see air, and of their neighbours: what those that see air take from below, by corrections that are not the whole
    /// fluid's, these have to give, or a stress is left on the surface that does not fall with Δx (a wave's decay was 6 to 13 % too large).
    fn free_of_stress(&mut self, step: Step, Flow { particles, frame, surface, .. }: &Flow<D>) {
        let viscosity = step.settings.kinematic_viscosity;
        frame.images.blank(&mut self.surface_pressure, particles.real);
        let strain_rate = &self.strain_rate;
        parallel::for_each(&mut self.surface_pressure, |i, pressure| {
            let normal = surface.normal(i);
            *pressure = if surface.place[i].sees_air() {
                2.0 * step.settings.density * viscosity * (strain_rate[i].0 * normal).dot(&normal)
            } else {
                0.0
            };
        });
        if viscosity == 0.0 {
            return;
        }
        frame.images.blank(&mut self.tensor, particles.len());
        parallel::for_each(frame.images.real(&mut self.tensor), |i, tensor| {
            tensor.0 = strain_rate[i].0 * frame.stencil.correction[i].inverse * 2.0;
        });
        frame.images.fill(&mut self.tensor);
        frame.images.blank(&mut self.pushed, particles.len());
        parallel::for_each(frame.images.real(&mut self.pushed), |i, flag| {
            *flag = f64::from(u8::from(surface.place[i].sees_air()))
        });
        frame.images.fill(&mut self.pushed);
        // Of a lattice's neighbours at the very edge of the support, which take nothing, rounding would decide.
        let (sees_air, reach) = (&self.pushed, WITHIN * step.settings.support_radius());
        let is_beside_air = |i: usize| {
            let (row, position) = (frame.stencil.neighbours.row(i).0, &frame.stencil.position);
            let beside = |j: usize| sees_air[j] > 0.0 && (position[j] - position[i]).norm() < reach;
            sees_air[i] > 0.0 || row.all().iter().any(|entry| beside(entry.j()))
        };
        frame.stencil.for_each_one(
            AdjointGradient { tensor: &self.tensor, own: |_| 1.0 },
            &mut self.derived,
            |i, value, derived| {
                // What a wall does to the stress solids do not tell.
                let is_free = frame.stencil.solids_near(step.settings, i).next().is_none();
                if is_free && is_beside_air(i) {
                    derived.laplacian = value;
                }
            },
        );
    }
}
